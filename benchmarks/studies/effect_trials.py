"""Decisions about effects on random scenes, held against what each effect truly contributes there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from benchmarks import CATALOGUE
from benchmarks.studies.effect_plans import apart, transfer_seconds
from benchmarks.studies.effect_scenes import drawn
from envbench.effects import EffectSettings, Probe
from envbench.records import Study
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Decision, Effect, Plan, Scene
from references import reference

SCENES = 200
TOLERANCES = 0.02, 0.005, 0.00125
SETTINGS = ReferenceSettings(floor=3e-3, budget=10.0, bounces=4)
MOST_MISSED, MOST_NEEDLESS, LEAST_GAIN = 0.01, 0.2, 2.0
NEEDLESS = 1 / 3
"""Of the tolerance: an effect that contributes less was simulated without need."""
_SHADOWS, _BOUNCES = Effect.SELF_SHADOWING, Effect.INTERREFLECTION


@dataclass
class Truth:
    """References of one scene's variants, each made once."""

    full: Scene
    most: int
    made: dict[tuple[frozenset[Effect], int | None, bool], Reference] = field(default_factory=dict[Any, Reference])

    def of(self, scene: Scene) -> Reference:
        """Return the reference of a variant."""
        bounced = scene.bounces if _BOUNCES in scene.effects else None
        key = scene.effects, bounced, scene.geometry.posed.convex
        if key not in self.made:
            self.made[key] = reference(scene, SETTINGS)
        return self.made[key]

    def contribution(self, effect: Effect, bounces: int = 0) -> float:
        """Return what an effect adds, or inter-reflection beyond so many bounces; shadows are seen without bounces."""
        if effect not in self.full.effects:
            return 0.0
        base, less = self.full, self.full.effects - {effect}
        if effect is _SHADOWS:
            base = replace(base, effects=base.effects - {_BOUNCES})
            less = base.effects - {effect, Effect.DEFORMATION}
        if effect is _BOUNCES and bounces:
            return apart(self.of(base), self.of(replace(base, bounces=bounces))) if bounces < self.most else 0.0
        return apart(self.of(base), self.of(replace(base, effects=less)))


@dataclass
class Tally:
    """What came of the decisions at one tolerance."""

    left_out: int = 0
    missed: int = 0
    simulated: int = 0
    needless: int = 0
    undecided: int = 0
    worst: float = 0.0
    within: int = 0
    planned: float = 0.0
    everything: float = 0.0
    probes: float = 0.0

    def count(self, decision: Decision, truth: Truth, tolerance: float) -> None:
        """Judge one decision."""
        effect = decision.effect
        self.undecided += decision.simulated and "undecided" in decision.reason
        if decision.simulated:
            self.simulated += 1
            self.needless += truth.contribution(effect) < NEEDLESS * tolerance
        if not decision.simulated or (effect is _BOUNCES and (decision.bounces or truth.most) < truth.most):
            self.left_out += 1
            rest = truth.contribution(effect, decision.bounces or 0 if decision.simulated else 0)
            self.missed += rest > tolerance
            self.worst = max(self.worst, rest / tolerance)


def effects_random(scenes: int = SCENES, first: int = 0, told: Callable[[str], None] | None = None) -> Study:
    """Return, for three tolerances, how many decisions were wrong, how many needless, and what they saved."""
    tallies = {tolerance: Tally() for tolerance in TOLERANCES}
    for seed in range(first, first + scenes):
        scene = drawn(seed)
        full = CATALOGUE.effects(scene, EffectSettings(plan=Plan.FACTS), SETTINGS, None)
        every = CATALOGUE.effects(scene, EffectSettings(plan=Plan.ALL), SETTINGS, None)
        most = SETTINGS.bounces
        truth = Truth(replace(full, bounces=most), most)
        whole = truth.of(replace(every, bounces=most))
        whole_seconds = whole.seconds + transfer_seconds(replace(every, bounces=most))
        for tolerance, tally in tallies.items():
            planning = EffectSettings(tolerance=tolerance, probe=Probe.ALL)
            plan = CATALOGUE.effects(scene, planning, SETTINGS, None)
            for decision in plan.decisions:
                tally.count(decision, truth, tolerance)
            found = truth.of(plan)
            off = apart(whole, found)
            tally.within += off <= tolerance + (whole.floor**2 + found.floor**2) ** 0.5
            tally.planned += found.seconds + transfer_seconds(plan)
            tally.everything += whole_seconds
            tally.probes += sum(d.seconds for d in plan.decisions)
            if told:
                told(f"{scene.name} {tolerance} {off:.5f} {tally}")
    return Study(
        "effects-random",
        f"Decisions about effects on {scenes} random scenes",
        f"Each effect's contribution is known from two references of noise floor {SETTINGS.floor:g}, with it and "
        "without; an effect is missed if it was left out and contributes more than the tolerance, and needless if it "
        f"was simulated and contributes less than {NEEDLESS:.2f} of that. Every effect was decided on, those too that "
        "cost nothing. Intervals are 95 %, Clopper and Pearson's. Seconds of references and diffuse transfer.",
        ("tolerance", "left out", "missed", "missed (95 %)", f"at most {MOST_MISSED:.0%}", "largest left out (of it)",
         "simulated", "needless", "needless (95 %)", f"at most {MOST_NEEDLESS:.0%}", "undecided",
         "results within tolerance and noise", "in every scene", "planned (s)", "probes (s)", "everything on (s)",
         f"at least {LEAST_GAIN:g} times faster"),
        tuple(_row(tolerance, tally, scenes) for tolerance, tally in tallies.items()),
    )  # fmt: skip


def _row(tolerance: float, t: Tally, scenes: int) -> tuple[str | float | int | bool | None, ...]:
    return (
        tolerance, t.left_out, t.missed, _interval(t.missed, t.left_out),
        t.missed <= MOST_MISSED * t.left_out, t.worst,
        t.simulated, t.needless, _interval(t.needless, t.simulated), t.needless <= MOST_NEEDLESS * t.simulated,
        t.undecided, t.within, t.within == scenes, t.planned, t.probes, t.everything,
        t.everything >= LEAST_GAIN * (t.planned + t.probes),
    )  # fmt: skip


def _interval(count: int, of: int) -> str:
    from scipy.stats import binomtest

    if not of:
        return "none"
    found = binomtest(count, of).proportion_ci(method="exact")
    return f"{found.low:.1%} to {found.high:.1%}"
