"""Small paired renderings: what a scene looks like with all effects and without some, at the same points and seeds.

Of a difference d_i at point i, K replicates give the unbiased square x_i = mean(d)^2 - var(d) / K, mean over channels,
and of the radiance with all effects p_i alike. The contribution of what was left out is sqrt(<x> / <p>), <> the mean
over points by weight. Its bounds hold for the noise and for the choice of points:

- Some of the points were looked at. The mean of n numbers of unknown distribution on [0, M] has as bounds the quantiles
  of sums with Dirichlet weights, one more number beside them: M for the upper bound, 0 for the lower one (Gaffke 2005).
  The lower bound is Student's where that is lower: noise makes some of the numbers negative.
  So what a contact shadow hides cannot be missed unnoticed: to rule out that 1 in 10,000 points, none of them seen, is
  wholly dark takes 46,000 points.
- All points were looked at. What is left is noise: the delete-one jackknife over replicates, Student's t, widened
  upwards near zero (`envbench.uncertainty`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from data_gen.mitsuba_estimator import Estimator
from envbench.directions import Array
from envbench.geometry import Points
from envbench.reference import ReferenceSettings
from envbench.scene import Effect, Scene
from envbench.uncertainty import square, t_quantile
from references.effects.without import simulated
from references.estimators import scattering, surface_for

SHADOWED = frozenset({Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION})
"""Effects of what the shape has in light's way: without shadows, none of them is left."""
REPLICATES = 8
CONFIDENCE = 0.99
"""Of each bound."""
_STREAM = 0x50524F42
_DRAWS = 2000
_SINGLE = 256
"""Numbers, the largest ones, whose Dirichlet weights are drawn one by one; the others in as many groups."""


@dataclass(frozen=True)
class Bound:
    """A contribution with its lower and upper bound, relative to the RMS radiance."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Variant:
    """What is simulated: effects, and how many bounces."""

    effects: frozenset[Effect]
    bounces: int = 0


Estimators = dict[Variant, tuple[Scene, Estimator]]


@dataclass
class Looks:
    """Renderings of one scene's variants at the same points with the same random numbers.

    Attributes
    ----------
    points : (n,) int
        Which points are looked at, each one time out of n.
    whole : bool
        These are all points of the scene, once each.
    seconds, rates : dict
        What a variant took in all, its kernels' compilation included; and its kernels' run alone, a sample.
    """

    scene: Scene
    settings: ReferenceSettings
    points: NDArray[np.int_]
    whole: bool
    samples: int
    number: int
    seconds: dict[Variant, float] = field(default_factory=dict[Variant, float])
    rates: dict[Variant, float] = field(default_factory=dict[Variant, float])
    seen: dict[Variant, Array] = field(default_factory=dict[Variant, Array])

    @property
    def lanes(self) -> int:
        """Samples that one variant takes."""
        return REPLICATES * len(self.points) * self.samples

    def bounced(self, variant: Variant, estimators: Estimators) -> Array:
        """Return the radiance with at most 0, 1, ... bounces, (1 + bounces, K, n, 3), rendered by itself."""
        if variant not in self.seen:
            self.seen[variant] = np.cumsum(self._rendered(variant, estimators, Estimator.by_bounce), axis=0)
        return self.seen[variant]

    def apart(self, variant: Variant, estimators: Estimators, bands: tuple[Array, ...]) -> None:
        """See an opaque variant, and by the same paths what it is without shadows, without light detail, and without
        both: `bands` holds the coefficients of a light without detail, or none.
        """
        if variant in self.seen:
            return

        def estimate(estimator: Estimator, points: Points, samples: int, seed: np.random.SeedSequence) -> Array:
            return estimator.apart(points, samples, seed, *bands).reshape(-1, len(points), 3)

        found = self._rendered(variant, estimators, estimate)
        for light, part in enumerate(np.split(found, 1 + len(bands))):
            effects = variant.effects - ({Effect.LIGHT_DETAIL} if light else set())
            self.seen[Variant(effects - SHADOWED, 0)] = part[-1:]
            self.seen[Variant(effects, variant.bounces)] = np.cumsum(part[:-1], axis=0)

    def _rendered(self, variant: Variant, estimators: Estimators, estimate: Callable[..., Array]) -> Array:
        """Return what an `estimate` of a variant finds, (m, K, n, 3), and note what that took."""
        import drjit as dr

        start = time.perf_counter()
        if variant not in estimators:
            estimators[variant] = _estimator(self.scene, variant, self.settings.variant, estimators)
        scene, estimator = estimators[variant]
        points = scene.points.taken(np.tile(self.points, REPLICATES))
        seed = np.random.SeedSequence((self.settings.seed, _STREAM, self.number))
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            found = estimate(estimator, points, self.samples, seed)
            kernels = dr.kernel_history()
        self.rates[variant] = sum(k.get("execution_time", 0.0) for k in kernels) / 1000 / self.lanes
        if points.modulation is not None:
            found = found * points.modulation
        self.seconds[variant] = time.perf_counter() - start
        return found.reshape(len(found), REPLICATES, -1, 3)

    def bound(self, full: Array, without: Array) -> Bound:
        """Return what is left out `without` some effects, relative to the `full` radiance, (K, n, 3) each."""
        weight = self.scene.points.weight[self.points] if self.whole else np.ones(len(self.points))
        weight = weight / weight.sum()
        return noise_bound(full - without, full, weight) if self.whole else point_bound(full - without, full, without)


def look(scene: Scene, settings: ReferenceSettings, count: int, samples: int, number: int) -> Looks:
    """Return looks at `count` points of a scene, drawn by weight and spread over their order; all, if that is less."""
    if count >= len(scene.points):
        return Looks(scene, settings, np.arange(len(scene.points)), True, samples, number)
    rng = np.random.default_rng((settings.seed, _STREAM, number))
    reached = np.cumsum(scene.points.weight)
    drawn = np.searchsorted(reached, reached[-1] * (np.arange(count) + rng.random(count)) / count)
    return Looks(scene, settings, np.minimum(drawn, len(reached) - 1), False, samples, number)


def noise_bound(difference: Array, full: Array, weight: Array) -> Bound:
    """Bound a contribution from replicates (K, n, 3) at all points, whose `weight` (n,) sums to 1."""
    scale = np.sqrt(weight / 3)[:, None]

    def products(values: Array) -> Array:
        flat = (values * scale).reshape(len(values), -1)
        return flat @ flat.T

    power = square(products(full))
    if not power.value > 0:
        return Bound(0.0, 0.0, float("inf"))
    ratio = square(products(difference)).over(power)
    K = len(full)
    t = t_quantile(CONFIDENCE, K - 1)
    half = t * float(np.sqrt((K - 1) * ratio.jackknife.var()))
    return _rooted(ratio.value, ratio.value - half, ratio.value + half + t**2 * ratio.curvature)


def point_bound(difference: Array, full: Array, without: Array) -> Bound:
    """Bound a contribution from replicates (K, n, 3) at points drawn by weight."""
    x, p = _squares(difference), _squares(full)
    most = float(np.maximum(p, _squares(without)).max())
    if not p.mean() > 0:
        return Bound(0.0, 0.0, float("inf"))
    order = np.argsort(x)[::-1]
    single, rest = order[:_SINGLE], order[_SINGLE:]
    groups = [part for part in np.array_split(rest, _SINGLE) if len(part)]
    sizes = (*(1 for _ in single), *(len(part) for part in groups))
    xs, ps = (np.concatenate([v[single], [v[part].mean() for part in groups]]) for v in (x, p))
    weights, beside = _dirichlet(sizes)
    power = weights @ ps
    value = float(x.mean() / p.mean())
    spread = (x - value * p).std(ddof=1) / np.sqrt(len(x)) / p.mean()
    low = np.quantile(weights @ xs / (power + beside * p.mean()), 1 - CONFIDENCE)
    low = min(low, value - t_quantile(CONFIDENCE, len(x) - 1) * spread)
    high = np.quantile((weights @ xs + beside * most) / (power + beside * p.mean()), CONFIDENCE)
    return _rooted(value, float(low), float(high))


@lru_cache(maxsize=4)
def _dirichlet(sizes: tuple[int, ...]) -> tuple[Array, Array]:
    """Return draws of exponential weights, summed over groups of these sizes, and of one weight beside them."""
    rng = np.random.default_rng(_STREAM)
    return rng.standard_gamma(sizes, (_DRAWS, len(sizes))), rng.standard_exponential(_DRAWS)


def _rooted(value: float, low: float, high: float) -> Bound:
    value, low, high = (float(np.sqrt(max(v, 0.0))) for v in (value, low, high))
    return Bound(value, low, high)


def _squares(values: Array) -> Array:
    """Return mean(v)^2 - var(v) / K, mean over channels, of replicates (K, n, 3)."""
    return (values.mean(0) ** 2 - values.var(0, ddof=1) / len(values)).mean(-1)


def _estimator(scene: Scene, variant: Variant, mitsuba: str, others: Estimators) -> tuple[Scene, Estimator]:
    """Return a variant of a scene and what renders it: by one estimator for all variants that do not scatter inside.

    Mitsuba's objects are those of `others` where they are the same: variants seen from elsewhere share all of them.
    """
    made = simulated(replace(scene, effects=variant.effects, bounces=variant.bounces))
    apart = {Effect.PERSPECTIVE}
    for known, (_, estimator) in others.items():
        if known.effects | apart == variant.effects | apart and known.bounces == variant.bounces:
            return _alike(made, variant), estimator
    surface = surface_for(replace(made, effects=variant.effects), mitsuba, variant.bounces)
    if Effect.SUBSURFACE in variant.effects:
        every = replace(scene, effects=frozenset(Effect))  # light with and without its detail shares its noise
        return made, scattering(every, surface, made.environment)
    made, carried = _alike(made, variant), surface.carried or _poses(made, variant)
    surface = replace(surface, carried=carried)
    return made, Estimator(surface, made.environment)


def _poses(scene: Scene, variant: Variant) -> bool:
    """Whether shadows are those of a posed shape, whose points say where on the mesh they are."""
    posed = scene.geometry.pose is not None and Effect.DEFORMATION in variant.effects
    return posed and scene.points.triangle is not None and scene.points.rotation is not None


def _alike(scene: Scene, variant: Variant) -> Scene:
    """Return the scene rendered as the one is whose shadows are carried: turned by no angle, for the same kernel."""
    if not _poses(scene, variant):
        return scene
    turned = np.broadcast_to(np.eye(3), (len(scene.points), 3, 3))
    return replace(scene, points=replace(scene.points, rotation=turned))


def needed_samples(values: Array, weight: Array, samples: int, floor: float, order: float = 0.75) -> float:
    """Return how many samples a point and replicate bring the noise of replicates (K, n, 3) down to `floor`."""
    noise = float(np.average(values.var(0, ddof=1).mean(-1), weights=weight)) / len(values)
    power = max(float(np.average((values.mean(0) ** 2).mean(-1), weights=weight)) - noise, 0.0)
    return samples * float(np.sqrt(noise / power) / floor) ** (1 / order) if power > 0 else 0.0
