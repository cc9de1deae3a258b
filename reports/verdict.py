"""Which way of rendering is best at a given error, in each situation: the report's answer, from scores and timings."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from envbench.metrics import paired_difference
from envbench.records import CellResult, Phase, SceneResult, Score, Status, Timing

LEVELS = (0.01, 0.05, 0.10)
"""NRMSE that the answer is given for."""


@dataclass(frozen=True)
class Situation:
    """What changes in a use, and the phases that its user then pays for."""

    name: str
    meaning: str
    phases: tuple[Phase, ...]


SITUATIONS = (
    Situation("changing light", "relight + frame + shade", (Phase.RELIGHT, Phase.FRAME, Phase.SHADE)),
    Situation("static light", "frame + shade: only the view changes", (Phase.FRAME, Phase.SHADE)),
    Situation("changing material", "prepare + relight + frame + shade", tuple(Phase)),
)


@dataclass(frozen=True)
class Candidate:
    """A method with its settings, over all scenes of one material, in one situation.

    Attributes
    ----------
    bound : float
        Largest upper bound of the NRMSE's 95 % interval over the scenes; inf where a scene has no such score.
    worst : str
        The light of the scene that has it.
    seconds, fastest, slowest : float
        The situation's phases, mean over the scenes: of the medians, the fastest and the slowest rounds.
    phases : tuple of (Phase, float)
        The medians' means that add up to `seconds`.
    errors : mapping of str to Score
        The NRMSE by scene.
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
    errors: Mapping[str, Score]


@dataclass(frozen=True)
class Answer:
    """The best candidate and those that cannot be told apart from it, a method's fastest each.

    At a `level`: the fastest that keeps it, and those whose rounds overlap its own; where there is none, `closest` is
    the most accurate. At no level (None): the most accurate, and those whose errors cannot be told from its own.
    """

    level: float | None
    best: Candidate | None
    tied: tuple[Candidate, ...]
    closest: Candidate | None

    @property
    def methods(self) -> tuple[str, ...]:
        """The winner and other methods that are as good, each once."""
        return tuple(dict.fromkeys(c.method for c in (self.best, *self.tied) if c))


@dataclass(frozen=True)
class Verdict:
    """The answers for one material, by situation, one for each of `LEVELS` and last for the least error.

    `undefined` names its scenes whose relative error does not exist (black), `methods` those that were tried.
    """

    parts: tuple[str, ...]
    scenes: tuple[str, ...]
    methods: tuple[str, ...]
    answers: Mapping[str, tuple[Answer, ...]]
    undefined: tuple[str, ...]

    @property
    def title(self) -> str:
        """Material, and shape and view where they vary."""
        return " · ".join(self.parts)


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
    """Answer for each material (and shape and view, where the run has several); steps of hard cases are left out."""
    plain = [scene for scene in scenes if not scene.knob]
    fields = ("material", *varied(plain, ("geometry", "view")))
    groups: dict[tuple[str, ...], list[SceneResult]] = {}
    for scene in plain:
        groups.setdefault(tuple(getattr(scene, name) for name in fields), []).append(scene)
    by_scene: dict[str, list[CellResult]] = {}
    for cell in cells:
        by_scene.setdefault(cell.scene, []).append(cell)
    return tuple(
        _verdict(key, group, [cell for scene in group for cell in by_scene.get(scene.name, ())])
        for key, group in groups.items()
    )


def competitions(found: Sequence[Verdict]) -> tuple[Verdict, ...]:
    """Return the materials on which several methods were tried; all, where there is none such."""
    return tuple(verdict for verdict in found if len(verdict.methods) > 1) or tuple(found)


def glance(found: Sequence[Verdict]) -> dict[str, tuple[dict[tuple[str, ...], tuple[str, ...]], ...]]:
    """Return, by situation and level, which methods are best on which materials; () stands for none.

    Where several methods were tried on some materials, those on which only one was tried are left out.
    """
    contested = competitions(found)
    telling = [
        i == 0 or len(set(values)) > 1 for i, values in enumerate(zip(*(v.parts for v in contested), strict=True))
    ]
    table: dict[str, tuple[dict[tuple[str, ...], tuple[str, ...]], ...]] = {}
    for situation in SITUATIONS:
        columns: list[dict[tuple[str, ...], tuple[str, ...]]] = [{} for _ in range(len(LEVELS) + 1)]
        for verdict in contested:
            for column, answer in zip(columns, verdict.answers[situation.name], strict=True):
                title = " · ".join(part for part, tells in zip(verdict.parts, telling, strict=True) if tells)
                column[answer.methods] = (*column.get(answer.methods, ()), title)
        table[situation.name] = tuple(
            dict(sorted(column.items(), key=lambda item: (not item[0], -len(item[1])))) for column in columns
        )
    return table


def _verdict(parts: tuple[str, ...], group: Sequence[SceneResult], cells: Sequence[CellResult]) -> Verdict:
    judged = {scene.name: scene.light for scene in group if scene.reference_rms > 0}
    rows: dict[tuple[str, str], list[CellResult]] = {}
    for cell in cells:
        if cell.scene in judged:
            rows.setdefault(identity(cell), []).append(cell)
    answers: dict[str, tuple[Answer, ...]] = {}
    for situation in SITUATIONS:
        candidates = [c for row in rows.values() if (c := _candidate(row, judged, situation.phases))]
        answers[situation.name] = (*(_answer(level, candidates) for level in LEVELS), _most_accurate(candidates))
    return Verdict(
        parts,
        tuple(scene.name for scene in group),
        tuple(dict.fromkeys(cell.method for cell in cells)),
        answers,
        tuple(scene.light for scene in group if scene.name not in judged),
    )


def _candidate(row: Sequence[CellResult], lights: Mapping[str, str], phases: Sequence[Phase]) -> Candidate | None:
    """Judge one method over its scenes, given with their lights; None unless every one was scored and timed."""
    timings = [[timing(cell, phase) for phase in phases] for cell in row]
    complete = [[entry for entry in entries if entry] for entries in timings]
    usable = all(cell.status is Status.OK for cell in row) and all(len(c) == len(phases) for c in complete)
    if len(row) != len(lights) or not usable:
        return None
    errors = {cell.scene: entry for cell in row if (entry := score(cell, "nrmse"))}
    highs = [entry.high if (entry := errors.get(cell.scene)) else math.nan for cell in row]
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
            (phase, sum(entries[i].median for entries in complete) / len(row)) for i, phase in enumerate(phases)
        ),
        lacks=tuple(dict.fromkeys(effect for cell in row for effect in cell.lacks)),
        errors=errors,
    )


def _answer(level: float, candidates: Sequence[Candidate]) -> Answer:
    enough = sorted((c for c in candidates if c.bound <= level), key=lambda c: c.seconds)
    if not enough:
        return Answer(level, None, (), min(candidates, key=lambda c: c.bound, default=None))
    best = enough[0]
    return Answer(level, best, _fastest_each(c for c in enough[1:] if c.fastest <= best.slowest), None)


def _most_accurate(candidates: Sequence[Candidate]) -> Answer:
    known = [c for c in candidates if math.isfinite(c.bound)]
    if not known:
        return Answer(None, None, (), None)
    leader = min(known, key=lambda c: c.bound)
    peers = sorted((c for c in known if c is leader or _alike(c, leader)), key=lambda c: c.seconds)
    best = peers[0]  # of what cannot be told apart, the fastest
    return Answer(None, best, _fastest_each(peers[1:], but=best.method), None)


def _alike(a: Candidate, b: Candidate) -> bool:
    """Whether on no scene the paired difference of their errors excludes zero."""
    return a.errors.keys() == b.errors.keys() and all(_overlap(a.errors[s], b.errors[s]) for s in a.errors)


def _overlap(a: Score, b: Score) -> bool:
    if a.high < b.low or b.high < a.low or math.isnan(a.high + b.high):
        return False
    if not a.jackknife or len(a.jackknife) != len(b.jackknife):
        return True
    low, high = paired_difference(a, b)
    return low <= 0 <= high


def _fastest_each(candidates: Iterable[Candidate], but: str = "") -> tuple[Candidate, ...]:
    """Return the first candidate of each method, which is its fastest; none of method `but`."""
    first: dict[str, Candidate] = {}
    for candidate in candidates:
        if candidate.method != but:
            first.setdefault(candidate.method, candidate)
    return tuple(first.values())
