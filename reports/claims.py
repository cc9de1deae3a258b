"""What papers say of rival methods, judged by a run: each at the best of its settings that ran."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from envbench import suite
from envbench.errors import BadInput
from envbench.records import CellResult, SceneResult, Score, Status
from envbench.suite import Claim
from reports.verdict import identity, score, settings_text


class Judgement(StrEnum):
    """How a claim came out."""

    HOLDS = "holds"
    IN_PART = "holds in part"
    FAILS = "does not hold"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Side:
    """A method at its best: its settings, and the scene on which its NRMSE is largest."""

    method: str
    settings: str
    scene: str
    error: Score


@dataclass(frozen=True)
class Judged:
    """A claim, its two sides (None where nothing was scored on all of its scenes), and the verdict in words."""

    claim: Claim
    judgement: Judgement
    method: Side | None
    beside: Side | None
    words: str


def claims(text: str, scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> tuple[Judged, ...]:
    """Judge the claims of a suite, given as it was run, by the records of the run.

    A text that is no suite to this version, of a run by another, makes none.
    """
    try:
        said = suite.parse(text, "suite").claims
    except BadInput:
        return ()
    return tuple(_judged(claim, scenes, cells) for claim in said)


def _judged(claim: Claim, scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> Judged:
    chosen = [
        scene.name
        for scene in scenes
        if scene.material in claim.materials and (not claim.views or scene.view in claim.views) and not scene.knob
    ]
    method, beside = (_best(wanted, chosen, cells) for wanted in (claim.method, claim.beside))
    if method is None or beside is None:
        lacking = claim.method if method is None else claim.beside
        words = "no scene of it ran" if not chosen else f"{lacking['name']} was not scored on all of its scenes"
        return Judged(claim, Judgement.UNDECIDED, method, beside, words)
    if method.error.low > claim.level >= beside.error.high:
        return Judged(claim, Judgement.HOLDS, method, beside, "the one is surely above the level, the other below it")
    if method.error.low > beside.error.high:
        short = "both are above the level" if method.error.low > claim.level else "both are below the level"
        if beside.error.low <= claim.level < beside.error.high or method.error.low <= claim.level < method.error.high:
            short = "which side of the level one of them is on is not sure"
        ratio = method.error.value / beside.error.value if beside.error.value else float("inf")
        return Judged(claim, Judgement.IN_PART, method, beside, f"{ratio:.2g} times the error, but {short}")
    return Judged(claim, Judgement.FAILS, method, beside, "its error is not surely larger")


def _best(wanted: Mapping[str, Any], scenes: Sequence[str], cells: Sequence[CellResult]) -> Side | None:
    """Return the settings of least largest NRMSE over the scenes, among cells of the wanted name and settings."""
    rows: dict[tuple[str, str], list[tuple[CellResult, Score]]] = {}
    settings = {key: value for key, value in wanted.items() if key != "name"}
    for cell in cells:
        fits = cell.method == wanted["name"] and settings.items() <= dict(cell.settings).items()
        found = score(cell, "nrmse") if fits and cell.scene in scenes and cell.status is Status.OK else None
        if found is not None and found.high == found.high:
            rows.setdefault(identity(cell), []).append((cell, found))
    sides = [
        Side(cell.method, settings_text(cell), cell.scene, error)
        for row in rows.values()
        if len(row) == len(scenes)
        for cell, error in [max(row, key=lambda entry: entry[1].value)]
    ]
    return min(sides, key=lambda side: side.error.value, default=None)
