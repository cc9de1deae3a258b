"""Which way of rendering is fastest at a given accuracy: the report's answer, from the scores and timings alone."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from envbench.records import CellResult, Phase, SceneResult, Score, Status, Timing

LEVELS = (0.01, 0.05, 0.10)
"""NRMSE that the answer is given for."""
CHANGE_OF_LIGHT = (Phase.RELIGHT, Phase.FRAME, Phase.SHADE)
"""What a change of light costs: all but `prepare`."""


@dataclass(frozen=True)
class Candidate:
    """A method with its settings, over all scenes of one material.

    Attributes
    ----------
    bound : float
        Largest upper bound of the NRMSE's 95 % interval over the scenes; inf where a scene has no such score.
    worst : str
        The light of the scene that has it.
    seconds, fastest, slowest : float
        relight + frame + shade, mean over the scenes: of the medians, the fastest and the slowest rounds.
    phases : tuple of (Phase, float)
        The medians' means that add up to `seconds`.
    """

    method: str
    settings: str
    bound: float
    worst: str
    seconds: float
    fastest: float
    slowest: float
    phases: tuple[tuple[Phase, float], ...]
    lacks: tuple[str, ...]


@dataclass(frozen=True)
class Answer:
    """The fastest candidate at `level` and those whose rounds overlap its own; where there is none, the closest."""

    level: float
    best: Candidate | None
    tied: tuple[Candidate, ...]
    closest: Candidate | None


@dataclass(frozen=True)
class Verdict:
    """The answers for one material; `undefined` names its scenes whose relative error does not exist (black)."""

    title: str
    scenes: tuple[str, ...]
    answers: tuple[Answer, ...]
    undefined: tuple[str, ...]


def score(cell: CellResult, metric: str) -> Score | None:
    """Return the cell's score by that name, or None."""
    return next((entry for entry in cell.scores if entry.metric == metric), None)


def timing(cell: CellResult, phase: Phase) -> Timing | None:
    """Return the cell's timing of `phase`, or None."""
    return next((entry for entry in cell.timings if entry.phase is phase), None)


def identity(cell: CellResult) -> tuple[str, str]:
    """Return what makes two cells of different scenes the same method: its name and settings."""
    return cell.method, json.dumps(cell.settings, sort_keys=True, default=str)


def settings_text(cell: CellResult) -> str:
    """Word a cell's settings, of any JSON type; nothing where it has none."""
    return ", ".join(
        f"{key}={value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)}"
        for key, value in cell.settings.items()
    )


def varied(scenes: Sequence[SceneResult], fields: Sequence[str]) -> tuple[str, ...]:
    """Return those `fields` that tell the scenes of this run apart."""
    return tuple(name for name in fields if len({getattr(scene, name) for scene in scenes}) > 1)


def verdicts(scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> tuple[Verdict, ...]:
    """Answer for each material (and shape and view, where the run has several)."""
    fields = ("material", *varied(scenes, ("geometry", "view")))
    groups: dict[tuple[str, ...], list[SceneResult]] = {}
    for scene in scenes:
        groups.setdefault(tuple(getattr(scene, name) for name in fields), []).append(scene)
    return tuple(_verdict(" · ".join(key), group, cells) for key, group in groups.items())


def _verdict(title: str, group: Sequence[SceneResult], cells: Sequence[CellResult]) -> Verdict:
    judged = {scene.name: scene.light for scene in group if scene.reference_rms > 0}
    rows: dict[tuple[str, str], list[CellResult]] = {}
    for cell in cells:
        if cell.scene in judged:
            rows.setdefault(identity(cell), []).append(cell)
    candidates = [candidate for row in rows.values() if (candidate := _candidate(row, judged))]
    return Verdict(
        title,
        tuple(scene.name for scene in group),
        tuple(_answer(level, candidates) for level in LEVELS),
        tuple(scene.light for scene in group if scene.name not in judged),
    )


def _candidate(row: Sequence[CellResult], lights: Mapping[str, str]) -> Candidate | None:
    """Judge one method over its scenes, given with their lights; None unless every one was scored and timed."""
    timings = [[timing(cell, phase) for phase in CHANGE_OF_LIGHT] for cell in row]
    complete = [[entry for entry in entries if entry] for entries in timings]
    usable = all(cell.status is Status.OK for cell in row) and all(len(c) == len(CHANGE_OF_LIGHT) for c in complete)
    if len(row) != len(lights) or not usable:
        return None
    highs = [entry.high if (entry := score(cell, "nrmse")) else math.nan for cell in row]
    bound, worst = max(
        (math.inf if math.isnan(high) else high, lights[cell.scene]) for high, cell in zip(highs, row, strict=True)
    )
    return Candidate(
        method=row[0].method,
        settings=settings_text(row[0]),
        bound=bound,
        worst=worst,
        seconds=sum(entry.median for entries in complete for entry in entries) / len(row),
        fastest=sum(entry.spread[0] for entries in complete for entry in entries) / len(row),
        slowest=sum(entry.spread[1] for entries in complete for entry in entries) / len(row),
        phases=tuple(
            (phase, sum(entries[i].median for entries in complete) / len(row))
            for i, phase in enumerate(CHANGE_OF_LIGHT)
        ),
        lacks=tuple(dict.fromkeys(effect for cell in row for effect in cell.lacks)),
    )


def _answer(level: float, candidates: Sequence[Candidate]) -> Answer:
    enough = sorted((c for c in candidates if c.bound <= level), key=lambda c: c.seconds)
    if not enough:
        return Answer(level, None, (), min(candidates, key=lambda c: c.bound, default=None))
    best = enough[0]
    return Answer(level, best, tuple(c for c in enough[1:] if c.fastest <= best.slowest), None)
