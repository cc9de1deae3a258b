"""A run on the terminal: a table of its cells, and its sum in a line."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from envbench.attribution import sentence
from envbench.errors import unknown
from envbench.metrics import METRICS
from envbench.records import CellResult, Film, Phase, RunInfo, SceneResult, Score, Status, Study
from envbench.scene import Decision
from envbench.stability import verdicts
from envbench.store import Store

if TYPE_CHECKING:
    from rich.console import Console


def is_failure(cell: CellResult) -> bool:
    """Whether a cell came to nothing; one that was declined did not."""
    return cell.status not in (Status.OK, Status.DECLINED)


def summary(run: RunInfo, cells: Sequence[CellResult]) -> str:
    """Return how many cells ended how, what the run took, and how much of that the harness itself."""
    counts = Counter(cell.status for cell in cells)
    ends = ", ".join(f"{counts[status]} {status.value}" for status in Status if status in counts)
    text = f"run {run.id}: {ends or 'no cell'}"
    if run.wall_seconds is None or run.overhead_seconds is None:
        return f"{text}; not finished"
    share = 100 * run.overhead_seconds / max(run.wall_seconds, 1e-9)
    return f"{text}; {run.wall_seconds:.3g} s, of which the harness itself {run.overhead_seconds:.2g} s ({share:.0f} %)"


def table(store: Store, ref: str, *, scenes: Sequence[str] = (), metrics: Sequence[str] = ("nrmse",)) -> None:
    """Print a run's cells with their `metrics`.

    Raises
    ------
    BadInput
        For an unknown run, scene or metric.
    """
    from rich.table import Table

    for metric in metrics:
        if metric not in METRICS:
            raise unknown("metric", metric, METRICS)
    run = store.run(ref)
    cells = store.cells(run.id)
    for scene in scenes:
        if scene not in {cell.scene for cell in cells}:
            raise unknown("scene of this run:", scene, {cell.scene for cell in cells})
    causes = {cell.key: sentence(cell, _share).replace(" does, ", " does,\n") for cell in cells}
    split = ("error by cause",) if any(causes.values()) else ()
    headings = ("scene", "method", *metrics, *split, "relight", "shade", "memory", "status")
    grid = Table(*headings, box=None, header_style="bold")
    last = ""
    order = store.scene_names(run.id)
    for cell in sorted(cells, key=lambda cell: order.index(cell.scene)):
        if scenes and cell.scene not in scenes:
            continue
        scores = {score.metric: score for score in cell.scores}
        grid.add_row(
            cell.scene if cell.scene != last else "",
            cell.label,
            *(number(scores.get(metric), scores.get("rmse") if metric == "nrmse" else None) for metric in metrics),
            *(causes[cell.key] for _ in split),
            *(seconds(cell, phase) for phase in (Phase.RELIGHT, Phase.SHADE)),
            f"{cell.bytes / 1024:,.0f} KiB" if cell.bytes else "",
            f"{cell.status.value}: {cell.reason}" if cell.reason else cell.status.value,
        )
        last = cell.scene
    if cells:
        console().print(grid)
    found = store.scenes(run.id)
    for scene in found:
        if scene.decisions and (not scenes or scene.name in scenes):
            console().print(f"{scene.name}: {about_effects(scene.decisions)}", highlight=False)
    if not scenes:
        _hard_cases(found, cells)
        for study in store.studies(run.id):
            console().print(about(study), highlight=False)
        for film in store.films(run.id):
            console().print(_about_film(film), highlight=False)
    console().print(summary(run, cells), highlight=False)


def _hard_cases(scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> None:
    from rich.table import Table

    found = verdicts(scenes, cells)
    if not found:
        return
    grid = Table("hard case", "method", "verdict", box=None, header_style="bold")
    last = ""
    for verdict in found:
        settings = ", ".join(f"{k}={v}" for k, v in verdict.settings.items())
        grid.add_row(verdict.knob if verdict.knob != last else "", f"{verdict.method}({settings})", verdict.text)
        last = verdict.knob
    console().print()
    console().print(grid)


def about_effects(decisions: Sequence[Decision]) -> str:
    """Say in a line which effects are simulated and which are left out, each with what it contributes and the basis.

    Examples
    --------
    >>> from envbench.scene import Basis, Effect
    >>> about_effects((
    ...     Decision(Effect.SELF_SHADOWING, True, Basis.PROBE, "", 0.14, 0.13, 0.15),
    ...     Decision(Effect.INTERREFLECTION, False, Basis.USER, "", 0.021, 0.02, 0.022, tolerance=0.01),
    ... ))
    'simulated: self-shadowing (probe: 14 % [13, 15]); left out: interreflection (user: 2.1 % [2, 2.2], which matters)'
    """

    def one(decision: Decision) -> str:
        known = not math.isnan(decision.low) and decision.high > 0
        share = f": {_percents(decision.contribution, decision.low, decision.high)}" if known else ""
        return f"{decision.effect} ({decision.basis}{share}{', which matters' if decision.missed else ''})"

    sides = {"simulated": True, "left out": False}
    named = {side: [one(d) for d in decisions if d.simulated is simulated] for side, simulated in sides.items()}
    return "; ".join(f"{side}: {', '.join(entries)}" for side, entries in named.items() if entries)


def _share(score: Score) -> str:
    if score.below_floor and score.high > 0:
        return f"< {100 * score.high:.2g} %"
    return "undefined" if math.isnan(score.value) else _percents(score.value, score.low, score.high)


def _percents(value: float, low: float, high: float) -> str:
    return f"{100 * value:.3g} % [{100 * low:.3g}, {100 * high:.3g}]"


def about(study: Study) -> str:
    """Say in a line what a study came to.

    Examples
    --------
    >>> about(Study("orders", "Orders beside table 5", "", ("F", "as printed"), ((24, True), (12, False))))
    "study 'orders': Orders beside table 5; 2 rows, 1 of 2 comparisons hold"
    >>> about(Study.missing("orders", "timed out: no answer within 9 s"))
    "study 'orders': no table, timed out: no answer within 9 s"
    """
    if study.reason:
        return f"study '{study.name}': no table, {study.reason}"
    held, judged = study.judged
    verdict = f", {held} of {judged} comparisons hold" if judged else ""
    return f"study '{study.name}': {study.title}; {len(study.rows)} row{'s' * (len(study.rows) != 1)}{verdict}"


def _about_film(film: Film) -> str:
    state = f"left out, {film.reason}" if film.reason else f"{len(film.data) / 1024:,.0f} KiB in the report"
    return f"animation '{film.name}': {state}"


def material(name: str, user: Path | None, plot: Path | None) -> None:
    """Print what is known of a material by itself; raises `BadInput`."""
    from envbench import root, sheet

    catalogue = root.load(user).catalogue
    sheet.show(name, catalogue.materials, catalogue.sheet, plot, console())


def number(score: Score | None, absolute: Score | None = None) -> str:
    """Return a score with its interval; below the noise floor its upper bound; undefined, the `absolute` error."""
    if score is None:
        return ""
    if math.isnan(score.value):
        return "undefined" if absolute is None else f"undefined; rmse {number(absolute)}"
    if score.below_floor and score.high > 0:
        return f"below floor (< {score.high:.2g})"
    interval = "" if math.isnan(score.low) else f" [{score.low:.3g}, {score.high:.3g}]"
    return f"{score.value:.3g}{interval}"


def seconds(cell: CellResult, phase: Phase) -> str:
    """Return the median time of a phase in milliseconds."""
    medians = [timing.median for timing in cell.timings if timing.phase is phase]
    return f"{1000 * medians[0]:.3g} ms" if medians else ""


def console() -> Console:
    """Return a console that wraps on a terminal, and on nothing else."""
    from rich.console import Console

    return Console(markup=False, highlight=False) if sys.stdout.isatty() else Console(width=240, markup=False)
