"""Which effects ground truth simulates on a scene: by facts, else by probes whose bounds decide against the tolerance.

What is held against what: `references.effects.variants`.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from envbench.directions import Array
from envbench.effects import EffectSettings, Probe
from envbench.reference import ReferenceSettings
from envbench.scene import FREE, Basis, Decision, Effect, Plan, Scene
from references.effects.facts import Fact, facts, opaque
from references.effects.probe import REPLICATES, Bound, Looks, Variant, look, needed_samples
from references.effects.variants import BOUNCES, INSIDE, POSED, SHADOWS, Variants

_AT_ONCE, _SOME = 4096, 2048
"""Points that are all looked at from the start; and of more, how many at first: enough to see what matters much."""
_LANES = 2**15
"""Samples of a replicate that the first look takes, or fewer: so many that a kernel's start does not count."""
_SAMPLES = 4, 16, 64, 256, 1024
"""Samples of the looks at all points, until the bounds decide; of the first look the most that `_LANES` allow."""
_FASTEST = 1.5
"""Order in which the square of a contribution gets surer with samples, or less."""
_SHOWN = 16
"""Samples, of each replicate, of pictures."""
_SHARE, _LEAST = 0.05, 0.3
"""Budget of the probes: part of what leaving effects out could save, and seconds at least."""
_FIRST_LOOK = 64
"""Samples a point that a reference takes at least."""


def planned(scene: Scene, settings: EffectSettings, reference: ReferenceSettings) -> Scene:
    """Return the scene with the effects, bounces and decisions that the settings lead to.

    Parameters
    ----------
    scene : Scene
        With a list of effects in `settings`, its own effects are those; else they are not looked at.
    settings : EffectSettings
    reference : ReferenceSettings
        How ground truth will be made: its noise floor and budget tell what simulating an effect costs.
    """
    scene = replace(scene, order=settings.order)
    known = facts(scene)
    match settings.plan:
        case Plan.ALL:
            made = _all(scene, known, reference.bounces)
        case Plan.FACTS:
            made = _with(scene, (_by_fact(effect, fact, "") for effect, fact in known.items()))
        case Plan.AUTO:
            made = _Planner(scene, settings, reference, known).plan()
        case _:
            made = _Planner(scene, settings, reference, known).listed(frozenset(Effect(e) for e in settings.plan))
    return _held(made, settings)


@dataclass(frozen=True, eq=False)
class Contributions:
    """What each measured effect makes of a scene, at all its points.

    Attributes
    ----------
    scene : Scene
        With its decisions.
    radiance : (n, 3)
        With all effects that the scene has occasion for.
    differences : dict of Effect to (n, 3)
        Radiance with an effect less that without it.
    samples : int
        That each was estimated from, at a point.
    """

    scene: Scene
    radiance: Array
    differences: dict[Effect, Array]
    samples: int


def contributions(scene: Scene, settings: EffectSettings, reference: ReferenceSettings) -> Contributions:
    """Plan a scene, measure every effect that it has occasion for, and look at what each makes of it."""
    scene = replace(scene, order=settings.order)
    planner = _Planner(scene, replace(settings, plan=Plan.AUTO, probe=Probe.ALL), reference, facts(scene))
    made = _held(planner.plan(), settings)
    looks = look(scene, reference, len(scene.points), _SHOWN, len(_SAMPLES) + 1)
    pairs = {effect: planner.variants.pair(looks, effect) for effect in planner.bounds}
    differences = {effect: (full - without).mean(0) for effect, (full, without) in pairs.items()}
    return Contributions(made, planner.variants.whole(looks).mean(0), differences, REPLICATES * looks.samples)


def _all(scene: Scene, known: dict[Effect, Fact], bounces: int) -> Scene:
    """Return the scene with everything on: shadows and bounces on convex shapes too, unless light scatters inside."""
    wanted = {e for e, fact in known.items() if fact.occasion}
    wanted |= {SHADOWS, BOUNCES} if INSIDE not in wanted else set()
    wanted |= {POSED} if scene.geometry.pose is not None else set()
    pose = scene.geometry.pose
    unheeded = replace(scene.geometry, convex=False, pose=None if pose is None else replace(pose, convex=False))
    decisions = tuple(
        Decision(effect, True, Basis.USER, "all effects are asked for")
        if effect in wanted
        else _by_fact(effect, known[effect], "")
        for effect in Effect
    )
    return replace(_with(scene, decisions), geometry=unheeded, heeded=False, bounces=bounces)


def _held(scene: Scene, settings: EffectSettings) -> Scene:
    """Return the scene, its decisions told what tolerance they are held against."""
    return replace(scene, decisions=tuple(replace(d, tolerance=settings.limit) for d in scene.decisions))


def _with(scene: Scene, decisions: Iterable[Decision]) -> Scene:
    decisions = tuple(decisions)
    bounces = next((d.bounces for d in decisions if d.effect is BOUNCES), None)
    simulated = frozenset(d.effect for d in decisions if d.simulated)
    return replace(scene, effects=simulated, bounces=bounces, decisions=decisions)


def _by_fact(effect: Effect, fact: Fact, more: str) -> Decision:
    if fact.occasion:
        return Decision(effect, True, Basis.FACT, fact.reason + more)
    return Decision(effect, False, Basis.FACT, fact.reason, 0.0, 0.0, 0.0, 0.0)


@dataclass
class _Planner:
    """One scene's plan in the making.

    Attributes
    ----------
    bounds : dict
        What leaving an effect out makes, by effect; of inter-reflection, by the bounces that are left.
    """

    scene: Scene
    settings: EffectSettings
    reference: ReferenceSettings
    known: dict[Effect, Fact]
    variants: Variants = field(init=False)
    looks: list[Looks] = field(default_factory=list[Looks])
    bounds: dict[Effect, list[Bound]] = field(default_factory=dict[Effect, list[Bound]])
    started: float = 0.0

    def __post_init__(self) -> None:
        self.variants = Variants(self.scene, self.known, self.reference.bounces)

    def plan(self) -> Scene:
        """Decide by facts, then by probes, then on all that is left out together."""
        probed = [e for e in Effect if self._probed(e)]
        more = dict.fromkeys(FREE, "; simulating it costs nothing")
        if self.reference.variant.startswith("scalar"):
            more |= dict.fromkeys(probed, "; not probed, for a scalar variant is too slow")
            probed = []
        made: dict[Effect, Decision] = {}
        if probed:
            self._probe(probed)
            made = self._decisions(probed)
        return _with(self.scene, (made.get(e) or _by_fact(e, fact, more.get(e, "")) for e, fact in self.known.items()))

    def listed(self, chosen: frozenset[Effect]) -> Scene:
        """Take the effects of a list, and measure those that it leaves out."""
        probed = [e for e in Effect if self.known[e].occasion and e not in chosen]
        if probed and not self.reference.variant.startswith("scalar"):
            self._probe(probed)
        decisions: list[Decision] = []
        known = self.known if INSIDE in chosen else facts(opaque(self.scene)) | {INSIDE: self.known[INSIDE]}
        for effect, fact in known.items():
            if effect in chosen and fact.occasion:
                decisions.append(Decision(effect, True, Basis.USER, "asked for"))
            elif effect in self.bounds:
                decisions.append(replace(self._decision(effect, False, "left out as asked"), basis=Basis.USER))
            elif fact.occasion:
                decisions.append(Decision(effect, False, Basis.USER, "left out as asked"))
            else:
                decisions.append(_by_fact(effect, fact, ""))
        return _with(self.scene, decisions)

    # ---- what is asked

    def _probed(self, effect: Effect) -> bool:
        return self.known[effect].occasion and (effect not in FREE or self.settings.probe == Probe.ALL)

    # ---- looking until the bounds decide

    def _probe(self, probed: list[Effect]) -> None:
        self.started, self.variants.detail = time.perf_counter(), Effect.LIGHT_DETAIL in probed
        undecided = list(probed)
        for looks in self._levels():
            if self.looks and self.looks[-1].whole:
                if not any(self._may_decide(effect, looks.samples) for effect in undecided):
                    continue
                if not self._affordable(looks, undecided):
                    return
            self.looks.append(looks)
            for effect in undecided:
                self.bounds[effect] = self.variants.measured(looks, effect)
            undecided = [e for e in undecided if not self._decided(e)]
            if not undecided:
                return

    def _levels(self) -> Iterator[Looks]:
        most = len(self.scene.points)
        whole = most <= _AT_ONCE or self.settings.probe == Probe.ALL  # which is shown, at all points
        count = most if whole else _SOME
        enough = max((s for s in _SAMPLES if s * count <= _LANES), default=_SAMPLES[0])
        first = look(self.scene, self.reference, count, enough, 0)
        yield first
        for number, samples in enumerate(_SAMPLES, 1):
            if not (first.whole and samples <= first.samples):
                yield look(self.scene, self.reference, most, samples, number)

    def _decided(self, effect: Effect) -> bool:
        """Whether the bounds tell which side of the tolerance a contribution is on: of bounces, for each number."""
        limit = self.settings.limit
        return all(bound.low > limit or bound.high < limit for bound in self.bounds[effect][: self._enough(effect) + 1])

    def _may_decide(self, effect: Effect, samples: int) -> bool:
        """Whether bounds from so many samples could decide, if the noise fell as fast as it can."""
        limit, fallen = self.settings.limit, (self.looks[-1].samples / samples) ** _FASTEST
        open_ = [b for b in self.bounds[effect][: self._enough(effect) + 1] if b.low <= limit <= b.high]
        for bound in open_:
            far = bound.high if bound.value < limit else bound.low
            if fallen * abs(far**2 - bound.value**2) > abs(limit**2 - bound.value**2):
                return False
        return True

    def _enough(self, effect: Effect) -> int:
        """Return the fewest bounces whose rest stays below the tolerance, or how many there are; of others 0 or 1."""
        bounds = self.bounds[effect]
        return next((k for k, bound in enumerate(bounds) if bound.high < self.settings.limit), len(bounds))

    @property
    def _budget(self) -> float:
        if self.settings.budget is not None:
            return self.settings.budget
        dear = next((e for e in (INSIDE, SHADOWS) if e in self.variants.full.effects), None)
        bare = self.variants.full if dear is None else self.variants.less(dear)
        return max(_LEAST, _SHARE * (self._cost(self.variants.full) - self._cost(bare)))

    def _affordable(self, looks: Looks, undecided: list[Effect]) -> bool:
        """Whether a look fits into the budget: a given one is of seconds in all, else of what kernels run for.

        Looks up to the first at all points are always taken.
        """
        ran = sum(past.rates[variant] * past.lanes for past in self.looks for variant in past.rates)
        spent = ran if self.settings.budget is None else time.perf_counter() - self.started
        sources = {self.variants.source(variant) for effect in undecided for variant in self.variants.compared(effect)}
        return spent + looks.lanes * sum(self._rate(source) for source in sources) <= self._budget

    # ---- what it costs

    def _rate(self, variant: Variant) -> float:
        """Return seconds a sample, by the quickest look; of what was not looked at, in proportion to its rays."""
        known = [looks.rates[variant] for looks in self.looks if variant in looks.rates]
        if known:
            return min(known)
        share = (1 + variant.bounces if SHADOWS in variant.effects else 0.5) / (1 + self.variants.full.bounces)
        return self._rate(self.variants.full) * share

    def _cost(self, variant: Variant) -> float:
        """Estimate what a reference takes: the rate of the probe by the samples that its noise calls for.

        The noise is that of all effects; but an opaque surface, where light else scatters inside, has its own.
        """
        looks = self.looks[-1]
        own = INSIDE in self.variants.full.effects - variant.effects and variant in looks.seen
        values = self.variants.rendered(looks, variant) if own else self.variants.whole(looks)
        samples = needed_samples(values, np.ones(values.shape[1]), looks.samples, self.reference.floor)
        lanes = max(samples, _FIRST_LOOK) * self.reference.replicates * len(self.scene.points)
        return float(min(self._rate(variant) * lanes, self.reference.budget))

    def _spent(self, effect: Effect) -> float:
        """Return the seconds of an effect's own renderings, and its share of those that all are held against.

        Those that cost nothing bear a share only where there are no others: else it would be rendered without them too.
        """
        own = (
            0.0
            if effect is BOUNCES
            else sum(looks.seconds.get(self.variants.less(effect), 0.0) for looks in self.looks)
        )
        bearing = self.bounds.keys() - FREE or self.bounds.keys()
        shared = sum(looks.seconds.get(self.variants.full, 0.0) for looks in self.looks) / len(bearing)
        return own + shared * (effect in bearing)

    # ---- decisions

    def _decisions(self, probed: list[Effect]) -> dict[Effect, Decision]:
        kept, reasons = self._kept(probed)
        self._together(kept, reasons)
        if kept.get(BOUNCES) and not kept.get(SHADOWS, 1):
            kept[SHADOWS], reasons[SHADOWS] = 1, "small by itself, but what sends light on hides it too"
        if kept.get(POSED) and not kept.get(SHADOWS, 1):
            kept[POSED], reasons[POSED] = 0, "nothing to act on: no shadows are simulated"
        if kept.get(BOUNCES):
            most = self.variants.full.bounces
            rest = self.bounds[BOUNCES][kept[BOUNCES]].high if kept[BOUNCES] < most else 0.0
            more = f": {kept[BOUNCES]} of {most} bounces" + (f", the rest adds at most {rest:.2%}" if rest else "")
            reasons[BOUNCES] += more
        made = {e: self._decision(e, kept[e] > 0, reasons[e], kept[e] if e is BOUNCES else None) for e in probed}
        if kept.get(INSIDE) == 0 and SHADOWS in self.variants.opaque:
            made[SHADOWS] = Decision(SHADOWS, True, Basis.FACT, "opaque and not convex: points may shadow one another")
        return made

    def _kept(self, probed: list[Effect]) -> tuple[dict[Effect, int], dict[Effect, str]]:
        """Return what the bounds of each effect say: 1 to simulate it, or its bounces; 0 to leave it out."""
        kept = {effect: self._enough(effect) for effect in probed}
        reasons: dict[Effect, str] = {}
        for effect in probed:
            decided = self._decided(effect)
            if not kept[effect]:
                reasons[effect] = "below the tolerance"
            elif decided or self.bounds[effect][0].low > self.settings.limit:
                reasons[effect] = "above the tolerance"
            else:
                reasons[effect] = f"undecided within its budget of {self._budget:.2g} s: simulated"
        return kept, reasons

    def _together(self, kept: dict[Effect, int], reasons: dict[Effect, str]) -> None:
        """Put effects back, the largest first, until what is left out stays below the tolerance together."""
        while sum(many < len(self.bounds[e]) for e, many in kept.items()) > 1:
            if not self.looks[-1].whole:
                looks = look(self.scene, self.reference, len(self.scene.points), _SAMPLES[0], 1)
                self.looks.append(looks)
            looks, without = self.looks[-1], {e for e, many in kept.items() if not many}
            bounces = kept.get(BOUNCES, self.variants.full.bounces)
            if bounces:
                without.discard(SHADOWS)
            elif SHADOWS in without:
                without.add(POSED)
            rest = Variant(self.variants.lacking(without), bounces)
            joint = looks.bound(self.variants.whole(looks), self.variants.rendered(looks, rest))
            if joint.high < self.settings.limit:
                return
            rests = {e: self.bounds[e][many].value for e, many in kept.items() if many < len(self.bounds[e])}
            largest = max(rests, key=lambda e: rests[e])
            kept[largest] += 1
            reasons[largest] = "below the tolerance by itself, not together with others"

    def _decision(self, effect: Effect, simulated: bool, reason: str, bounces: int | None = None) -> Decision:
        bound = self.bounds[effect][0]
        most = self._cost(self.variants.full)
        cost = 0.0 if effect in FREE else max(most - self._cost(self.variants.less(effect)), 0.0)
        if effect is BOUNCES and simulated:
            saved = max(most - self._cost(Variant(self.variants.full.effects, bounces or 0)), 0.0)
        else:
            saved = 0.0 if simulated else cost
        return Decision(
            effect, simulated, Basis.PROBE, reason, bound.value, bound.low, bound.high, cost, saved,
            self._spent(effect), bounces if simulated else None,
        )  # fmt: skip
