"""Which effects of each scene are simulated, on what grounds, and what that costs and saves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from envbench.records import SceneResult
from envbench.scene import Basis, Decision
from reports.numerals import between, percent, seconds


@dataclass(frozen=True)
class Line:
    """A decision in words; `kind` marks one that a user should look at."""

    effect: str
    simulated: str
    basis: str
    contribution: str
    interval: str
    cost: str
    saved: str
    probe: str
    reason: str
    kind: str = ""


@dataclass(frozen=True)
class Decided:
    """The decisions of one scene, and the tolerance that they were taken at, in words."""

    scene: str
    tolerance: str
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Effects:
    """The decisions of all scenes that have any, and their sum in words."""

    scenes: tuple[Decided, ...]
    summary: str


def effects(scenes: Sequence[SceneResult]) -> Effects | None:
    """Return what a run decided about effects; None where nothing was decided."""
    decided = [scene for scene in scenes if scene.decisions]
    if not decided:
        return None
    return Effects(
        tuple(Decided(scene.name, _tolerance(scene), tuple(map(_line, scene.decisions))) for scene in decided),
        _summary([decision for scene in decided for decision in scene.decisions], len(decided)),
    )


def warnings(scene: SceneResult) -> tuple[str, ...]:
    """Return a line for each effect that a user switched off although it matters."""
    return tuple(
        f"{decision.effect} switched off, and it matters: {percent(decision.contribution)} "
        f"({between(percent(decision.low), percent(decision.high))})"
        for decision in scene.decisions
        if decision.missed
    )


def _line(decision: Decision) -> Line:
    measured = not math.isnan(decision.contribution)
    ruled_out = decision.basis is Basis.FACT and decision.contribution == 0
    interval = measured and not ruled_out and not math.isnan(decision.low) and not math.isnan(decision.high)
    bounces = "" if decision.bounces is None else f", {decision.bounces} bounce{'s' * (decision.bounces != 1)}"
    return Line(
        decision.effect,
        f"yes{bounces}" if decision.simulated else "no",
        decision.basis,
        "none" if ruled_out else percent(decision.contribution) if measured else "–",
        between(percent(decision.low), percent(decision.high)) if interval else "",
        _duration(decision.cost),
        _duration(decision.saved) if decision.saved > 0 else "–",
        _duration(decision.seconds) if decision.seconds > 0 else "–",
        decision.reason,
        "warn" if decision.missed else "",
    )


def _duration(value: float) -> str:
    return "–" if math.isnan(value) else seconds(value)


def _tolerance(scene: SceneResult) -> str:
    asked = {decision.tolerance for decision in scene.decisions if decision.tolerance is not None}
    return " or ".join(percent(value) for value in sorted(asked))


def _summary(decisions: Sequence[Decision], scenes: int) -> str:
    grounds = ", ".join(
        f"{count} by {basis}" for basis in Basis if (count := sum(decision.basis is basis for decision in decisions))
    )
    left_out = sum(not decision.simulated for decision in decisions)
    probes = seconds(sum(decision.seconds for decision in decisions))
    saved = seconds(sum(decision.saved for decision in decisions))
    plural = "s" if scenes != 1 else ""
    return (
        f"{len(decisions)} decisions on {scenes} scene{plural}: {grounds}. {left_out} effects were left out, "
        f"which saved {saved}; probes took {probes}."
    )
