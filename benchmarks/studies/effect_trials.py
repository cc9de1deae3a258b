"""Decisions about effects on random scenes, held against what each effect truly contributes there."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import Any

from benchmarks import CATALOGUE
from benchmarks.studies.effect_plans import RAYS, transfer_seconds
from benchmarks.studies.effect_scenes import drawn
from envbench.attribution import RESTS_ON
from envbench.directions import Array
from envbench.effects import EffectSettings, Probe
from envbench.records import Study
from envbench.reference import ReferenceSettings
from envbench.scene import FREE, Decision, Effect, Plan, Scene
from references import reference
from references.effects.probe import Estimators, Looks, Variant, look

SCENES = 200
TOLERANCES = 0.02, 0.005, 0.00125
SETTINGS = ReferenceSettings(floor=1e-2, budget=20.0, bounces=8)
SAMPLES = 64, 256, 1024
"""A point of each replicate, for what effects truly contribute: the fewer points there are, the more."""
_LANES = 2**18
"""Samples of a replicate, at most, beyond the fewest a point."""
NOISE = 5e-4
"""Of what is truly contributed, or less: paired renderings share most of their noise."""
MOST_MISSED, MOST_NEEDLESS, LEAST_GAIN = 0.01, 0.2, 2.0
NEEDLESS = 1 / 3
"""Of the tolerance: an effect that contributes less was simulated without need."""
_SHADOWS, _BOUNCES = Effect.SELF_SHADOWING, Effect.INTERREFLECTION


@dataclass
class Truth:
    """What effects contribute to one scene, from paired renderings of all its points with seeds of their own.

    Attributes
    ----------
    full : Scene
        With all that its facts give occasion for, and `most` bounces.
    """

    full: Scene
    most: int
    looks: Looks
    estimators: Estimators = field(default_factory=Estimators)
    timed: dict[Any, float] = field(default_factory=dict[Any, float])

    @classmethod
    def of(cls, full: Scene, most: int) -> Truth:
        """Return the truth about a scene, none of it rendered yet."""
        settings = replace(SETTINGS, seed=1)
        points = len(full.points)
        samples = max((s for s in SAMPLES if s * points <= _LANES), default=SAMPLES[0])
        return cls(full, most, look(full, settings, points, samples, 0))

    def contribution(self, effect: Effect, bounces: int = 0) -> float:
        """Return what an effect adds, or inter-reflection beyond so many bounces; shadows are seen without bounces."""
        if effect not in self.full.effects:
            return 0.0
        everything = self._by_bounce(self.full.effects)
        if effect is _BOUNCES:
            return self._apart(everything[-1], everything[min(bounces, len(everything) - 1)])
        less = self.full.effects - {effect}
        if effect is _SHADOWS:
            return self._apart(everything[0], self._by_bounce(less - {_BOUNCES, Effect.DEFORMATION})[0])
        return self._apart(everything[-1], self._by_bounce(less)[-1])

    def off(self, plan: Scene) -> float:
        """Return how much a planned scene differs from the full one."""
        found = self._by_bounce(plan.effects & self.full.effects)
        bounces = self.most if plan.bounces is None else plan.bounces
        return self._apart(self._by_bounce(self.full.effects)[-1], found[min(bounces, len(found) - 1)])

    def seconds(self, scene: Scene) -> float:
        """Return what reference and transfer of a scene take; the same computation is timed once."""
        bounced = scene.bounces if _BOUNCES in scene.effects else None
        key = scene.effects, bounced, scene.heeded
        if key not in self.timed:
            reference(scene, replace(SETTINGS, floor=1.0))  # compiles its kernels
            self.timed[key] = reference(scene, SETTINGS).seconds + transfer_seconds(scene)
        return self.timed[key]

    def _by_bounce(self, effects: frozenset[Effect]) -> Array:
        bounces = self.most if _BOUNCES in effects else 0
        return self.looks.bounced(Variant(effects, bounces), self.estimators)

    def _apart(self, full: Array, other: Array) -> float:
        return 0.0 if full is other else self.looks.bound(full, other).value


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

    def count(self, decision: Decision, simulated: Collection[Effect], truth: Truth, tolerance: float) -> None:
        """Judge one decision beside what is `simulated`: an effect whose ground is left out has nothing to act on.

        Shadows that a pose moves, for one, where none matter; that it was right to leave them out is judged by itself.
        """
        effect = decision.effect
        if effect in RESTS_ON and RESTS_ON[effect] not in simulated:
            return
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
        truth = Truth.of(full, SETTINGS.bounces)
        whole = truth.seconds(replace(every, bounces=SETTINGS.bounces))
        _planned(scene, TOLERANCES[-1])  # compiles its kernels
        for tolerance, tally in tallies.items():
            plan = _planned(scene, tolerance)
            for decision in plan.decisions:
                tally.count(decision, plan.effects, truth, tolerance)
            off = truth.off(plan)
            tally.within += off <= tolerance + NOISE
            tally.planned += truth.seconds(plan)
            tally.everything += whole
            tally.probes += sum(d.seconds for d in plan.decisions if d.effect not in FREE)
            if told:
                told(f"{scene.name} {tolerance} {off:.5f} {tally}")
    return Study(
        "effects-random",
        f"Decisions about effects on {scenes} random scenes",
        "Each effect's contribution is known from paired renderings of all points, with it and without, of "
        f"{SAMPLES[0]} samples or, where points are few, up to {SAMPLES[-1]} in each of 8 replicates; an effect is "
        "missed if it was left out and contributes more than the tolerance, and needless if it was simulated and "
        f"contributes less than {NEEDLESS:.2f} of that. Every effect was decided on, those too that cost nothing; the "
        "probes' seconds are those of the others, all that both are held against counted as theirs: what a user's "
        "default takes, or a little more. Intervals are 95 %, Clopper and Pearson's. Seconds are those of references "
        f"of noise floor {SETTINGS.floor:g}, which end after {SETTINGS.budget:g} s whatever they have reached, and of "
        f"diffuse transfer of {RAYS:,} rays a vertex; all of a second time, after kernels were compiled.",
        ("tolerance", "left out", "missed", "missed (95 %)", f"at most {MOST_MISSED:.0%}", "largest left out (of it)",
         "simulated", "needless", "needless (95 %)", f"at most {MOST_NEEDLESS:.0%}", "undecided",
         "results within tolerance and noise", "in every scene", "planned (s)", "probes (s)", "everything on (s)",
         f"at least {LEAST_GAIN:g} times faster"),
        tuple(_row(tolerance, tally, scenes) for tolerance, tally in tallies.items()),
    )  # fmt: skip


def _planned(scene: Scene, tolerance: float) -> Scene:
    return CATALOGUE.effects(scene, EffectSettings(tolerance=tolerance, probe=Probe.ALL), SETTINGS, None)


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
