"""Hard cases: a matrix of knobs and methods with verdicts, and a small plot of error against each knob."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from envbench.records import CellResult, SceneResult
from envbench.stability import KnobVerdict, Outcome, verdicts
from reports.numerals import percent
from reports.plots import Mark

WIDTH, HEIGHT = 300, 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 40, 8, 8, 20
_FLOOR, _CEILING = 1e-4, 10.0
"""NRMSE at the lower and the upper edge of the small plots; what lies beyond is drawn there."""


@dataclass(frozen=True)
class Judged:
    """A verdict as the matrix shows it; `settings` only where a method has several under one knob."""

    outcome: Outcome
    settings: str
    where: str
    text: str


@dataclass(frozen=True)
class KnobRow:
    """A knob: what it turns from where to where, its plot (SVG), and the verdicts by method."""

    name: str
    vary: str
    easy: str
    extreme: str
    steps: int
    plot: str
    judged: Mapping[str, tuple[Judged, ...]]


@dataclass(frozen=True)
class HardCases:
    """The matrix: rows in the order of the suite, columns by method."""

    methods: tuple[str, ...]
    rows: tuple[KnobRow, ...]


def hard_cases(
    scenes: Sequence[SceneResult], cells: Sequence[CellResult], marks: Mapping[str, Mark]
) -> HardCases | None:
    """Return the matrix of a run's hard cases, or None where it has none."""
    found = verdicts(scenes, cells)
    if not found:
        return None
    knobs = dict.fromkeys(verdict.knob for verdict in found)
    rows = tuple(_row([v for v in found if v.knob == knob], marks) for knob in knobs)
    return HardCases(tuple(dict.fromkeys(verdict.method for verdict in found)), rows)


def _row(found: Sequence[KnobVerdict], marks: Mapping[str, Mark]) -> KnobRow:
    longest = max(found, key=lambda verdict: len(verdict.steps))
    settings = [step.setting for step in longest.steps]
    several = {v.method for v in found if sum(other.method == v.method for other in found) > 1}
    judged: dict[str, list[Judged]] = {}
    for verdict in found:
        judged.setdefault(verdict.method, []).append(_judged(verdict, verdict.method in several))
    return KnobRow(
        name=longest.knob,
        vary=longest.vary,
        easy=settings[0],
        extreme=settings[-1],
        steps=len(settings),
        plot=_plot(found, settings, marks),
        judged={method: tuple(entries) for method, entries in judged.items()},
    )


def _judged(verdict: KnobVerdict, several: bool) -> Judged:
    words = ", ".join(f"{key}={value}" for key, value in verdict.settings.items())
    step = verdict.first(verdict.outcome)
    where = ""
    if verdict.outcome is not Outcome.STABLE and step is not None:
        where = "throughout" if all(s.outcome is verdict.outcome for s in verdict.steps) else f"from {step.setting}"
    text = verdict.text.partition("(")[2].rstrip(")") if verdict.outcome is Outcome.STABLE else verdict.text
    return Judged(verdict.outcome, words if several else "", where, text)


def _plot(found: Sequence[KnobVerdict], settings: Sequence[str], marks: Mapping[str, Mark]) -> str:
    """Draw NRMSE (logarithmic) against the steps, a line a method; what broke or was declined is a mark on top."""
    place = {
        setting: _LEFT + i * (WIDTH - _LEFT - _RIGHT) / max(len(settings) - 1, 1) for i, setting in enumerate(settings)
    }
    parts = [f'<svg class="knob" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="NRMSE by step">']
    for exponent in range(-4, 2):
        y, level = _height(10.0**exponent), f"{100 * 10.0**exponent:g}%"
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{WIDTH - _RIGHT}"/>')
        parts.append(f'<text x="{_LEFT - 4}" y="{y + 3:.1f}" text-anchor="end">{level}</text>')
    for setting, anchor in ((settings[0], "start"), (settings[-1], "end")):
        x = place[setting] - (8 if anchor == "start" else -4)
        parts.append(f'<text x="{x:.0f}" y="{HEIGHT - 5}" text-anchor="{anchor}">{escape(setting)}</text>')
    for verdict in found:
        parts += _line(verdict, place, f"m{marks[verdict.method].colour}")
    return "".join((*parts, "</svg>"))


def _line(verdict: KnobVerdict, place: Mapping[str, float], colour: str) -> list[str]:
    name = escape(f"{verdict.method} " + ", ".join(f"{k}={v}" for k, v in verdict.settings.items())).strip()
    known = [(place[s.setting], _height(s.error), s) for s in verdict.steps if not math.isnan(s.error)]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y, _ in known)
    parts = [f'<g class="{colour}"><polyline points="{line}"/>']
    for x, y, step in known:
        told = f"{'below ' if step.below else ''}{percent(step.error)}"
        shape = "hollow" if step.below else ""
        parts.append(
            f'<circle class="{shape}" cx="{x:.1f}" cy="{y:.1f}" r="2.5">'
            f"<title>{name}: {told} at {escape(step.setting)}</title></circle>"
        )
    for step in verdict.steps:
        if step.outcome in (Outcome.BREAKS, Outcome.DECLINES) and math.isnan(step.error):
            x = place[step.setting]
            parts.append(
                f'<path d="M{x - 3:.1f} {_TOP - 3}l6 6m0 -6l-6 6">'
                f"<title>{name}: {step.outcome} at {escape(step.setting)}: {escape(step.reason)}</title></path>"
            )
    return [*parts, "</g>"]


def _height(error: float) -> float:
    clipped = min(max(error, _FLOOR), _CEILING)
    share = (math.log10(clipped) - math.log10(_FLOOR)) / (math.log10(_CEILING) - math.log10(_FLOOR))
    return HEIGHT - _BOTTOM - share * (HEIGHT - _TOP - _BOTTOM)
