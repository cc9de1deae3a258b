"""What theory predicts held against what was measured: energy errors, by theory."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from envbench.records import CellResult, SceneResult, Score, Status
from reports.verdict import score

ASKED = "eps asked for"
"""The setting `eps` of a method, read as a theory: no more energy than that is left out."""
CLOSE = 0.2
"""Relative difference up to which a prediction counts as close."""


@dataclass(frozen=True)
class Theory:
    """How one theory of one method did.

    Attributes
    ----------
    cells, kept : int
        Cells with a prediction, and those whose measured energy error is not surely larger.
    decided, close : int
        Cells whose measured error lies above the reference's noise, and those of them within `CLOSE` of it.
    ratio : float
        Median of measured / predicted over `decided`.
    """

    method: str
    name: str
    cells: int
    kept: int
    decided: int
    close: int
    ratio: float


@dataclass(frozen=True)
class Case:
    """A cell whose error was predicted: `measured` energy error with its interval, predictions, worst single view."""

    cell: CellResult
    scene: SceneResult
    measured: float
    low: float
    high: float
    predicted: Mapping[str, float]
    worst: Score | None
    remark: str


@dataclass(frozen=True)
class Held:
    """The comparison of a run; `uniform`: whether its queries are those that theory averages over."""

    theories: tuple[Theory, ...]
    cases: tuple[Case, ...]
    uniform: bool


def held(scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> Held:
    """Hold predictions against measurements; over uniform (R, V) alone where a run has such queries."""
    by_name = {scene.name: scene for scene in scenes if not scene.knob}
    every = [case for cell in cells if cell.scene in by_name and (case := _case(cell, by_name[cell.scene]))]
    uniform = [case for case in every if _uniform(case.scene)]
    cases = uniform or every
    keys = dict.fromkeys((case.cell.method, theory) for case in cases for theory in case.predicted)
    return Held(tuple(_theory(*key, cases) for key in keys), tuple(cases), bool(uniform))


def exception(cell: CellResult, scene: SceneResult | None) -> str:
    """Say by how much the measured energy error exceeds a prediction, and which theory does account for it.

    Nothing is said where the queries are not those that theory averages over.
    """
    found, known = _measured(cell), predicted(cell)
    if found is None or not known or scene is None or not _uniform(scene):
        return ""
    value, low, _ = found
    over = {theory: error for theory, error in known.items() if low > error > 0}
    if not over:
        return ""
    theory, error = max(over.items(), key=lambda item: value / item[1])
    by = [name for name, other in known.items() if other > 0 and abs(value / other - 1) <= CLOSE]
    return f"{value / error:.3g} × {theory}" + (f"; as {by[0]} says" if by else "; no theory accounts for it")


def predicted(cell: CellResult) -> dict[str, float]:
    """Return the energy errors that theories predict for a cell, the eps that was asked for among them."""
    eps = cell.settings.get("eps")
    asked = {ASKED: float(eps)} if isinstance(eps, int | float) and cell.predictions else {}
    return asked | {name: error for name, error in cell.predictions.items() if error >= 0}


def _uniform(scene: SceneResult) -> bool:
    view = scene.specs.get("view", {})
    return view.get("kind") == "uniform" and "direction" not in view


def _measured(cell: CellResult) -> tuple[float, float, float] | None:
    """Return the energy error (squared NRMSE) of a cell with its interval."""
    captured = score(cell, "captured_energy")
    if cell.status is not Status.OK or captured is None or math.isnan(captured.value):
        return None
    return 1 - captured.value, 1 - captured.high, 1 - captured.low


def _case(cell: CellResult, scene: SceneResult) -> Case | None:
    found, known = _measured(cell), predicted(cell)
    if found is None or not known:
        return None
    return Case(cell, scene, *found, known, score(cell, "worst_view"), exception(cell, scene))


def _theory(method: str, name: str, cases: Sequence[Case]) -> Theory:
    of = [case for case in cases if case.cell.method == method and name in case.predicted]
    decided = [case for case in of if case.low > 0 and case.predicted[name] > 0]
    ratios = [case.measured / case.predicted[name] for case in decided]
    return Theory(
        method,
        name,
        cells=len(of),
        kept=sum(not case.low > case.predicted[name] for case in of),
        decided=len(decided),
        close=sum(abs(ratio - 1) <= CLOSE for ratio in ratios),
        ratio=statistics.median(ratios) if ratios else math.nan,
    )
