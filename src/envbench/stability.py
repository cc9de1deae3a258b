"""What becomes of a method while a knob is turned from easy to extreme: stable, degrades, breaks, or declines.

A step counts as

* broken, if the method failed, crashed, ran out of time or memory, returned NaN, or is surely worse than black: the
  whole 95 % interval of its NRMSE lies above 1, which is the NRMSE of answering zero everywhere;
* declined, if the method refuses it with a reason;
* degraded, if its error surely lies above both `FACTOR` times the error of the easiest step and `LEVEL`: the whole
  interval does, the upper end of the easiest step's being what it is held against;
* well, otherwise: so is all that lies below the noise floor of the reference.

A step whose reference is black has no relative error, and is judged by its status alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from envbench.records import CellResult, SceneResult, Score, Status

FACTOR = 2.0
"""How much the error may grow over the easiest step's before a method degrades."""
LEVEL = 0.01
"""NRMSE up to which no method degrades, whatever the easiest step's error."""
BLACK = 1.0
"""NRMSE of answering zero."""


class Outcome(StrEnum):
    """What became of a step; of a method, the worst of its steps, in this order."""

    STABLE = "stable"
    DEGRADES = "degrades"
    DECLINES = "declines"
    BREAKS = "breaks"


@dataclass(frozen=True)
class Step:
    """A step of a knob for one method.

    `error` is the NRMSE with its interval (`low`, `high`), the upper bound where it is `below` the noise floor; NaN
    where there is none. `reason` is why it broke or was declined.
    """

    setting: str
    scene: str
    outcome: Outcome
    error: float
    low: float
    high: float
    below: bool
    reason: str


@dataclass(frozen=True)
class KnobVerdict:
    """What became of a method (with `settings`, what is turned left out) under one knob; steps from easy to extreme."""

    knob: str
    vary: str
    method: str
    settings: dict[str, Any]
    steps: tuple[Step, ...]

    @property
    def outcome(self) -> Outcome:
        """The worst that was met."""
        order = list(Outcome)
        return max((step.outcome for step in self.steps), key=order.index, default=Outcome.STABLE)

    def first(self, outcome: Outcome) -> Step | None:
        """Return the first step that came out so."""
        return next((step for step in self.steps if step.outcome is outcome), None)

    @property
    def growth(self) -> float:
        """The largest error over the easiest step's; NaN where either is unknown."""
        errors = [step.error for step in self.steps if not math.isnan(step.error)]
        easy = self.steps[0].error if self.steps else math.nan
        return max(errors, default=math.nan) / easy if easy > 0 else math.nan

    @property
    def text(self) -> str:
        """The verdict in words.

        Examples
        --------
        >>> steps = [Step(s, "", o, e, e, e, False, r) for s, o, e, r in [
        ...     ("8", Outcome.STABLE, .01, ""), ("64", Outcome.DEGRADES, .05, ""), ("512", Outcome.BREAKS, 1.5, "")]]
        >>> KnobVerdict("gloss", "material.exponent", "shrm", {}, tuple(steps)).text
        'degrades from 64 (error 5 %, 5 times the easiest), breaks from 512 (error 150 %, worse than black)'
        """
        parts = [self._said(outcome) for outcome in list(Outcome)[1:] if self.first(outcome)]
        if parts:
            return ", ".join(parts)
        worst = max((step.error for step in self.steps if not math.isnan(step.error)), default=math.nan)
        return "stable" if math.isnan(worst) else f"stable (error at most {_percent(worst)})"

    def _said(self, outcome: Outcome) -> str:
        step = self.first(outcome)
        assert step is not None
        after = self.steps[self.steps.index(step) :]
        where = f"from {step.setting}" if all(s.outcome is not Outcome.STABLE for s in after) else f"at {step.setting}"
        if step.reason:
            return f"{outcome} {where} ({step.reason})"
        if outcome is Outcome.BREAKS:
            return f"{outcome} {where} (error {_percent(step.error)}, worse than black)"
        easy = self.steps[0].error
        times = f", {step.error / easy:.2g} times the easiest" if easy > 0 else ""
        return f"{outcome} {where} (error {_percent(step.error)}{times})"


def verdicts(scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> tuple[KnobVerdict, ...]:
    """Judge every method under every knob of a run, by knob and then as the cells come."""
    by_name = {scene.name: scene for scene in scenes if scene.knob}
    groups: dict[tuple[str, str, str], list[tuple[SceneResult, CellResult]]] = {}
    for knob in dict.fromkeys(scene.knob for scene in by_name.values()):
        for cell in cells:
            scene = by_name.get(cell.scene)
            if scene is not None and scene.knob == knob:
                key = knob, cell.method, json.dumps(_settings(cell, scene), default=str)
                groups.setdefault(key, []).append((scene, cell))
    return tuple(_judge(sorted(group, key=lambda pair: pair[0].step)) for group in groups.values())


def _settings(cell: CellResult, scene: SceneResult) -> dict[str, Any]:
    return {key: value for key, value in cell.settings.items() if f"method.{key}" != _vary(scene)}


def _vary(scene: SceneResult) -> str:
    return str(scene.specs.get("knob", {}).get("vary", ""))


def _judge(group: Sequence[tuple[SceneResult, CellResult]]) -> KnobVerdict:
    scene, cell = group[0]
    easy = _nrmse(cell) if scene.step == 0 else None
    limit = max(FACTOR * easy.high if easy and not math.isnan(easy.high) else 0.0, LEVEL)
    steps = tuple(_step(scene, cell, limit) for scene, cell in group)
    return KnobVerdict(scene.knob, _vary(scene), cell.method, _settings(cell, scene), steps)


def _step(scene: SceneResult, cell: CellResult, limit: float) -> Step:
    nothing = math.nan
    if cell.status is not Status.OK:
        declined = cell.status is Status.DECLINED
        reason = cell.reason if declined else f"{cell.status}: {cell.reason}".rstrip(": ")
        outcome = Outcome.DECLINES if declined else Outcome.BREAKS
        return Step(scene.setting, scene.name, outcome, nothing, nothing, nothing, False, reason)
    score = _nrmse(cell)
    if score is None:
        return Step(scene.setting, scene.name, Outcome.STABLE, nothing, nothing, nothing, False, "")
    low = score.value if math.isnan(score.low) else score.low
    outcome = Outcome.BREAKS if low > BLACK else Outcome.DEGRADES if low > limit else Outcome.STABLE
    error = score.high if score.below_floor else score.value
    return Step(scene.setting, scene.name, outcome, error, score.low, score.high, score.below_floor, "")


def _nrmse(cell: CellResult) -> Score | None:
    """Return the cell's relative error, if it has one."""
    found = next((score for score in cell.scores if score.metric == "nrmse"), None)
    return None if found is None or math.isnan(found.value) else found


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"
