"""Radiance of a diffuse surface under light without detail: what it is unshadowed, and what the shape makes of that.

A diffuse surface that light reaches from everywhere has radiance F(N), known in closed form, which is also the mean of
w L(s) over directions s drawn by the cosine, w the albedo. Where the shape is in the way at z, its radiance takes the
place of the light's. With F as a control variate, of any weight b that does not depend on s,

    B(x) = b F(N_x) + E[w (B(z) - b L(s) where the shape is in the way, (1 - b) L(s) where it is not)],

and B(z) is estimated alike. One ray a bounce does, and none goes to the light. Where light does not tell what is hidden
the noise is least for b as large as the part of all s that meets nothing: what nothing shadows then has no noise.
Under light with detail L(s) would be too noisy: there the light is sampled too (`data_gen.mitsuba_estimator`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_paths import Draws, paths
from data_gen.mitsuba_place import met, reached
from envbench import llvm
from envbench.directions import Array
from envbench.geometry import Points

_LOOK = 64
"""Directions that each point looks into."""


@dataclass(frozen=True, eq=False)
class Openness(Estimator):
    """What part of all directions, drawn by the lobes, meets nothing: grey."""

    def _by_bounce(self, mi: Any, si: Any, place: Any, draws: list[Draws], beside: Any = None) -> list[Any]:
        import drjit as dr

        sampler = draws[0][0]
        across, which = sampler.next_2d(), sampler.next_1d()
        sample, _ = self.surface.bsdf.sample(mi.BSDFContext(), si, which, across)
        hidden = self.scene.ray_test(place.ray(mi, si.to_world(sample.wo)))
        return [mi.Color3f(dr.select(hidden, 0.0, 1.0))]


@dataclass(frozen=True, eq=False)
class Diffuse(Estimator):
    """Radiance of a diffuse surface that shadows itself.

    Attributes
    ----------
    unshadowed : (h, w, 3)
        F by normal, a lat-long map.
    """

    unshadowed: Array | None = None

    @property
    def order(self) -> float:
        return 0.6

    @property
    def rays(self) -> int:
        """One for each bounce, and one that finds what is in the way."""
        return 1 + self.surface.bounces

    @cached_property
    def _free(self) -> Any:
        mi = llvm.mitsuba(self.surface.variant)
        assert self.unshadowed is not None
        half = self.unshadowed.shape[1] // 2  # beyond a pole a row meets its own half-turned self
        rows = [np.roll(self.unshadowed[:1], half, 1), self.unshadowed, np.roll(self.unshadowed[-1:], half, 1)]
        return mi.Texture2f(mi.TensorXf(np.pad(np.concatenate(rows), ((0, 0), (1, 1), (0, 0)), mode="wrap")))

    def _seeds(self, seed: int) -> list[tuple[int, ...]]:
        return [(seed,)]

    def _place(self, mi: Any, points: Points, spread: Any) -> Any:
        found = self._openness(points)
        place = super()._place(mi, points, spread)
        return replace(place, sky=spread(np.tile(found[:, None], 3)).x)

    def _openness(self, points: Points) -> Array:
        """Return what part of all directions from each point meets nothing, (n,), about; kept for later replicates."""
        if self._kept.get("points") is not points:
            look = Openness(replace(self.surface, bounces=0), self.environment)
            found = look.replicate(points, _LOOK, np.random.SeedSequence(_LOOK))[:, 0]
            self._kept.update(points=points, openness=found)
        return self._kept["openness"]

    @cached_property
    def _kept(self) -> dict[str, Any]:
        return {}

    def _by_bounce(self, mi: Any, si: Any, place: Any, draws: list[Draws], beside: Any = None) -> list[Any]:
        import drjit as dr

        assert beside is None
        context, reflector = mi.BSDFContext(), self.surface.bsdf
        _ = self._free  # made before the loop
        deeper = dr.opaque(mi.Float, float(self._kept["openness"].mean()))
        bounces = self.surface.bounces

        def step(depth: Any, active: Any, through: Any, si: Any, where: Any, totals: Any, draws: Any) -> Any:
            sampler = draws[0]
            here = replace(place, position=where[0], geometric=where[1], normal=where[2])
            share = dr.select(depth == 0, place.sky, deeper)
            gained = through * self._at(mi, si.sh_frame.n) * share
            across, which = sampler.next_2d(), sampler.next_1d()
            sample, weight = reflector.sample(context, si, which, across, active)
            direction = si.to_world(sample.wo)
            through = through * weight
            found = met(mi, self.scene, self.surface, here.ray(mi, direction), active)
            gained += through * self._light(mi, direction) * (dr.select(found.is_valid(), 0, 1) - share)
            si, here, on = reached(mi, self.surface, found, here, direction)
            if self.surface.texture is not None:
                through = through * mi.Color3f(*self.surface.texture.eval(found.uv))
            totals = [t + dr.select(active & (depth == k), gained, mi.Color3f(0)) for k, t in enumerate(totals)]
            where = here.position, here.geometric, here.normal
            return depth + 1, active & on, through, si, where, totals, draws

        where = place.position, place.geometric, place.normal
        totals = [mi.Color3f(0) for _ in range(1 + bounces)]
        if bounces:
            return paths(mi, bounces, step, si, where, totals, draws[0])
        return step(mi.UInt32(0), mi.Bool(True), mi.Color3f(1), si, where, totals, draws[0])[5]

    def _at(self, mi: Any, n: Any) -> Any:
        import drjit as dr

        assert self.unshadowed is not None
        h, w = self.unshadowed.shape[:2]
        theta = dr.safe_acos(n.z) / dr.pi
        phi = dr.atan2(n.y, n.x) / (2 * dr.pi)
        phi = phi - dr.floor(phi)
        return mi.Color3f(*self._free.eval(mi.Point2f((phi * w + 1) / (w + 2), (theta * h + 1) / (h + 2))))

    def _light(self, mi: Any, direction: Any) -> Any:
        import drjit as dr

        seen = dr.zeros(mi.SurfaceInteraction3f)
        seen.wi = -direction
        total = mi.Color3f(0)
        for sign, scene in self._scenes:
            total += sign * scene.environment().eval(seen)
        return total
