"""The gate: has a run become less accurate than a baseline?

Both runs were scored against the same references, so nothing is left to chance and no statistics are needed. Timings
are shown, not judged: those of two runs apart in time are not comparable closely enough.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

from envbench.errors import BadInput, unknown
from envbench.records import CellResult, Phase, RunInfo, SceneResult, Status
from envbench.store import Store

MARGINS = {
    "nrmse": "relative: NRMSE may grow by this part of the baseline's, or of the noise floor where that is larger",
    "energy_ratio": "absolute: |energy ratio - 1| may grow by this much",
}
"""What is judged, and what its margin means. An all-black scene has no NRMSE: its RMSE takes the place."""


@dataclass(frozen=True)
class GateReport:
    """What the gate found, in lines of text: it is open (`ok`) if there are no `failures`."""

    run: str
    baseline: str
    compared: int
    failures: tuple[str, ...]
    notes: tuple[str, ...]
    timings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing became worse."""
        return not self.failures

    def lines(self) -> list[str]:
        """Return the plain account."""
        verdict = "ok" if self.ok else f"{len(self.failures)} failure{'s' if len(self.failures) > 1 else ''}"
        return [
            *(f"FAIL  {line}" for line in self.failures),
            *(f"note  {line}" for line in self.notes),
            *(f"time  {line} (not judged)" for line in self.timings),
            f"gate: run {self.run} against baseline {self.baseline}: {self.compared} cells compared, {verdict}.",
        ]


def gate(
    store: Store,
    run: str,
    baseline_store: Store,
    baseline: str,
    margin: float = 0.01,
    margins: Mapping[str, float] | None = None,
) -> GateReport:
    """Hold the accuracy of a run against that of a baseline, cell by cell (same scene, method and settings).

    Parameters
    ----------
    run, baseline : str
        As `Store.run` takes them.
    margin : float
        What may be lost; `MARGINS` says of what.
    margins : mapping of str to float, optional
        A margin of its own for some of `MARGINS`.

    Raises
    ------
    BadInput
        No such run, an unknown or negative margin, a baseline without cells.
    """
    limits = _limits(margin, margins or {})
    now, before = store.run(run), baseline_store.run(baseline)
    scenes, old_scenes = _scenes(store, now), _scenes(baseline_store, before)
    cells, old_cells = _cells(store, now), _cells(baseline_store, before)
    if not old_cells:
        raise BadInput(f"baseline run '{before.id}' of {baseline_store.path} holds no cell: name another run.")
    failures, differing = _references(scenes, old_scenes, {cell.scene for cell in old_cells.values()})
    notes: list[str] = []
    timings: list[str] = []
    for key, old in old_cells.items():
        where, new = f"{old.scene} / {old.label}", cells.get(key)
        if new is None:
            failures.append(f"{where}: is missing, the baseline has it")
        elif new.status is not Status.OK:
            told = f"{where}: {new.status}{f' ({new.reason})' if new.reason else ''}, was {old.status}"
            lost = old.status is Status.OK or (old.status is Status.DECLINED and new.status is not Status.DECLINED)
            (failures if lost else notes).append(told)
        elif old.status is not Status.OK:
            notes.append(f"{where}: ok, was {old.status}")
        elif old.scene not in differing:
            failures += [f"{where}: {line}" for line in _worse(new, old, old_scenes[old.scene].reference_floor, limits)]
            timings.append(f"{where}: {_pace(new, old)}")
    notes += [
        f"{c.scene} / {c.label}: new ({c.status}), not judged" for key, c in cells.items() if key not in old_cells
    ]
    notes += [f"run {r.id} was not finished" for r in (now, before) if r.finished is None]
    return GateReport(now.id, before.id, len(timings), tuple(failures), tuple(notes), tuple(timings))


def _limits(margin: float, margins: Mapping[str, float]) -> dict[str, float]:
    for name in margins:
        if name not in MARGINS:
            raise unknown("margin", name, MARGINS)
    limits = dict.fromkeys(MARGINS, margin) | dict(margins)
    for name, value in limits.items():
        if not 0 <= value < math.inf:
            raise BadInput(f"the gate's margin for {name} must be a number >= 0. Got {value} instead.")
    return limits


def _scenes(store: Store, run: RunInfo) -> dict[str, SceneResult]:
    return {scene.name: scene for scene in store.scenes(run.id)}


def _cells(store: Store, run: RunInfo) -> dict[tuple[str, str, str], CellResult]:
    cells = store.cells(run.id)
    return {(cell.scene, cell.method, json.dumps(cell.settings, sort_keys=True)): cell for cell in cells}


def _references(
    new: Mapping[str, SceneResult], old: Mapping[str, SceneResult], needed: set[str]
) -> tuple[list[str], set[str]]:
    """Return what is wrong with the references, and the scenes whose cells therefore cannot be compared."""
    wrong: dict[str, str] = {}
    for scene in sorted(needed):
        if scene not in new or not new[scene].reference_key:
            wrong[scene] = "has no reference in the run"
        elif scene not in old or not old[scene].reference_key:
            wrong[scene] = "has no reference in the baseline"
        elif new[scene].reference_key != old[scene].reference_key:
            keys = f"{new[scene].reference_key[:12]}, was {old[scene].reference_key[:12]}"
            wrong[scene] = f"reference differs ({keys}): run the baseline again with the present references"
        elif _sampled(new[scene]) != _sampled(old[scene]):
            wrong[scene] = "reference was made anew and came out otherwise: let both runs share one cache folder"
    return [f"{scene}: {what}" for scene, what in wrong.items()], set(wrong)


def _sampled(scene: SceneResult) -> tuple[int, str]:
    """Return what tells two references of one address apart: a budget, or another processor's rounding, may differ."""
    return scene.reference_samples, f"{scene.reference_rms:.6e}"


def _worse(new: CellResult, old: CellResult, floor: float, limits: Mapping[str, float]) -> list[str]:
    now, before = ({score.metric: score.value for score in cell.scores} for cell in (new, old))
    error = "rmse" if math.isnan(before.get("nrmse", math.nan)) else "nrmse"
    found: list[str] = []
    for name in (error, "energy_ratio"):
        was, value = before.get(name, math.nan), now.get(name, math.nan)
        if math.isnan(was):
            continue
        if name == "energy_ratio":
            allowed = abs(was - 1) + limits[name]
            worse, limit = not abs(value - 1) <= allowed, f"|ratio - 1| at most {allowed:.3g}"
        else:
            allowed = was + limits["nrmse"] * max(was, floor)
            worse, limit = not value <= allowed, f"at most {allowed:.6g}"
        if worse:
            found.append(f"{name} {value:.6g}, was {was:.6g}: allowed is {limit}")
    return found


def _pace(new: CellResult, old: CellResult) -> str:
    now, before = ({timing.phase: timing.median for timing in cell.timings} for cell in (new, old))
    return ", ".join(
        f"{phase} {1e3 * now[phase]:.3g} ms, was {1e3 * before[phase]:.3g}"
        for phase in Phase
        if phase in now and phase in before
    )
