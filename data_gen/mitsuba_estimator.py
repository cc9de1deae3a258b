"""Radiance at query points by Mitsuba, from a given number of samples: for ground truth, and for a Monte-Carlo method.

At each point the estimator is that of Mitsuba's `direct` integrator, one emitter sample and one BSDF sample combined,
but it starts from the point itself instead of from a camera: position, normal, tangent and view are taken as they are.
The two are weighed by the balance heuristic (Veach 1997, sec. 9.2.2), which under captured light leaves about a tenth
less noise than the power heuristic. Without lobe samples it is `direct` with ``bsdf_samples = 0``. Where nothing can
shadow no visibility ray is cast, so that whole lobes, which reach below the horizon, are integrated too.

Bounces: the BSDF sample goes on to what the shape has in its way, and the same is done there, as `path` does.
Signed light: its positive and its negative part are estimated each by itself, and subtracted.
Carried shadows: what a shape hides at rest, carried along by a pose (`Surface.carried`).
Averages: over views, or over turns of the tangent, drawn afresh for each sample wherever light is reflected. They are
drawn by a sampler of their own, so that all other random numbers are those of the estimate without.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.lattice import Lattice
from data_gen.mitsuba_paths import Draws, in_flight, paths, shared
from data_gen.mitsuba_place import Place, averaged, interaction, laid_out, met, reached
from data_gen.mitsuba_surface import Surface, lit
from envbench import llvm
from envbench.directions import Array
from envbench.environment import Environment
from envbench.geometry import Points
from envbench.real_harmonics import terms

SAMPLER = "multijitter"
"""Low-discrepancy sampler of Mitsuba, for scalar variants; the others have lattices."""

Light = Callable[[Any], Any]
"""The radiance from a direction, Mitsuba's."""

_LANES = 2**22
"""Samples in flight at a time: bounds the memory."""
_OWN = 0x9E3779B9
"""What sets the seeds of averages apart from those of the estimates: any odd number."""
_DIMENSIONS = range(16), range(16, 20)
"""Of lattices: three bounces' light and lobes, and what is averaged over at the first point."""


@dataclass(frozen=True, eq=False)
class Estimator:
    """Radiance that a surface under a light reflects, from a given number of samples.

    Attributes
    ----------
    sample_lobes : bool
        Whether each emitter sample is joined by a sample of the lobes. Without, a peak is found by chance alone.
    """

    surface: Surface
    environment: Environment
    sample_lobes: bool = True

    @cached_property
    def scene(self) -> Any:
        """Give the light, and the occluder where there is one, as a `mi.Scene`: made at first use."""
        return self._scenes[0][1]

    @cached_property
    def _scenes(self) -> tuple[tuple[float, Any], ...]:
        """The positive and the negative part of the light, as signs and scenes; the first holds the occluder."""
        return lit(self.surface.variant, self.environment, self.surface.occluder)

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def order(self) -> float:
        """The order that noise has in the samples under captured light, or more."""
        if self.surface.occluder is not None and self.surface.bounces:
            return 0.7
        return 0.8 if self.sample_lobes else 0.6

    @property
    def rays(self) -> int:
        """Visibility rays cast for each sample: one for each direction drawn, or none where nothing can shadow."""
        if self.surface.occluder is None:
            return 0
        drawn = 1 + self.sample_lobes if not self.surface.bounces else 2 * self.surface.bounces + 1 + self.sample_lobes
        return drawn * len(self.environment.parts)

    def replicate(self, points: Points, samples: NDArray[np.int_] | int, seed: np.random.SeedSequence) -> Array:
        """Estimate the radiance at every point, (n, 3), from `samples` at each.

        They are powers of two.

        Raises
        ------
        BadInput
            Shadows are carried along to points that do not say where on the mesh they are, or the material has a map of
            transparency and they have no uv.
        """
        mi = llvm.mitsuba(self.surface.variant)
        samples = np.broadcast_to(samples, len(points))
        scalar = self.surface.variant.startswith("scalar")
        jobs = [
            (int(count), chunk)
            for count in np.unique(samples)
            for chunk in _chunks(np.flatnonzero(samples == count), 1 if scalar else max(1, _LANES // int(count)))
        ]
        sums = self._one_by_one if scalar else self._wavefront
        estimate = np.empty((len(points), 3))
        for (count, chunk), state in zip(jobs, seed.generate_state(len(jobs)), strict=True):
            estimate[chunk] = sums(mi, points, chunk, count, int(state)) / count
        return estimate

    def by_bounce(self, points: Points, samples: int, seed: np.random.SeedSequence) -> Array:
        """Estimate what light contributes that came by way of the shape 0, 1, ... times, (1 + bounces, n, 3).

        Their sums are what estimates with fewer bounces, of the same seed, are. Not for scalar variants.
        """
        mi = llvm.mitsuba(self.surface.variant)
        jobs = _chunks(np.arange(len(points)), max(1, _LANES // samples))
        estimate = np.empty((1 + self.surface.bounces, len(points), 3))
        for chunk, state in zip(jobs, seed.generate_state(len(jobs)), strict=True):
            estimate[:, chunk] = self._summed(mi, points, chunk, samples, int(state), self._by_bounce) / samples
        return estimate

    def apart(self, points: Points, samples: int, seed: np.random.SeedSequence, *lights: Array) -> Array:
        """Estimate `by_bounce`, and last what nothing shadows, under the surface's light and under others beside it.

        All by the same paths, in one kernel: the first light's are those of `by_bounce` to rounding, and what nothing
        shadows is what an estimator without occluder finds. The other lights, given by real harmonics, are seen by the
        samples of the lobes alone: of few bands, they have no peak that these would miss. Not for scalar variants.

        Parameters
        ----------
        lights : ((order + 1)^2, 3) each
            Coefficients of the other lights, which may be negative.

        Returns
        -------
        (1 + lights, 2 + bounces, n, 3)
        """
        mi = llvm.mitsuba(self.surface.variant)
        import drjit as dr

        def seen(coefficients: Array) -> Light:
            known = [mi.Color3f(*(dr.opaque(mi.Float, float(v)) for v in row)) for row in coefficients]
            order = math.isqrt(len(known)) - 1

            def light(d: Any) -> Any:
                return sum((y * c for y, c in zip(terms(order, d.x, d.y, d.z), known, strict=True)), mi.Color3f(0))

            return light

        beside = tuple(seen(light) for light in lights)
        jobs = _chunks(np.arange(len(points)), max(1, _LANES // samples))
        estimate = np.empty(((1 + len(lights)) * (2 + self.surface.bounces), len(points), 3))
        for chunk, state in zip(jobs, seed.generate_state(len(jobs)), strict=True):
            found = self._summed(mi, points, chunk, samples, int(state), partial(self._by_bounce, beside=beside))
            estimate[:, chunk] = found / samples
        return estimate.reshape(1 + len(lights), -1, len(points), 3)

    def _wavefront(self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sums over the samples of the `chosen` points, (n, 3), all at once."""
        return self._summed(mi, points, chosen, samples, seed, lambda *args: [self._radiance(*args)])[0]

    def _summed(
        self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int, estimates: Callable[..., Any]
    ) -> Array:
        """Return the sums over the samples of the `chosen` points of each of the `estimates`, (m, n, 3)."""
        import drjit as dr

        each = self._each(mi, len(chosen), samples)
        lanes = len(chosen) * each
        _ = self.surface.bsdf, self.surface.texture, self._scenes  # before all else, for kernels to be the same again
        draws = [
            [
                self._sampler(mi, samples, dr.opaque(mi.UInt32, s), lanes, kind, samples // each)
                for kind, s in enumerate(own)
            ]
            for own in self._seeds(seed)
        ]
        point = dr.arange(mi.UInt32, lanes) // dr.opaque(mi.UInt32, each)
        spread = laid_out(mi, chosen, point)
        found = estimates(mi, interaction(mi, self.surface, points, spread), self._place(mi, points, spread), draws)
        exact = [[mi.Float64(channel) for channel in rgb] for rgb in found]
        dr.eval(exact)
        return np.array([[dr.block_sum(c, each).numpy() for c in rgb] for rgb in exact]).swapaxes(1, 2)

    def _each(self, mi: Any, points: int, samples: int) -> int:
        """Return how many lanes share the samples of a point, each of which takes one after the other."""
        together = self.surface.occluder is None or not self.surface.bounces
        return samples if together else shared(points, samples, in_flight(mi))

    def _seeds(self, seed: int) -> list[tuple[int, ...]]:
        """Return the seeds of each part of the light: no part's numbers depend on how often another's light bounces."""
        averaged = self.surface.any_view or self.surface.any_tangent
        parts = [seed ^ (2 * part * _OWN & 0xFFFFFFFF) for part in range(len(self._scenes))]
        return [(part, part ^ _OWN) if averaged else (part,) for part in parts]

    def _sampler(self, mi: Any, samples: int, seed: Any, lanes: int, kind: int, many: int = 1) -> Any:
        """Return a sampler of light and lobes, or of the other kind: of what is averaged over."""
        if self.surface.variant.startswith("scalar"):
            return seeded(mi, SAMPLER, (math.isqrt(samples - 1) + 1) ** 2, seed, lanes)  # else it warns of rounding
        return Lattice.of(mi, lanes, samples, seed, _DIMENSIONS[kind], many)

    def _one_by_one(self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sum over the samples of the one `chosen` point, (3,)."""
        draws = [[self._sampler(mi, samples, s, 1, kind) for kind, s in enumerate(own)] for own in self._seeds(seed)]

        def taken(values: Array) -> Any:
            return mi.Vector3f(*(float(v) for v in values[chosen[0]]))

        si, place = interaction(mi, self.surface, points, taken), self._place(mi, points, taken)
        total = np.zeros(3)
        for _ in range(samples):
            total += np.array(self._radiance(mi, si, place, draws), float)
            for sampler in itertools.chain(*draws):
                sampler.advance()
        return total

    def _place(self, mi: Any, points: Points, spread: Callable[[Array], Any]) -> Place:
        return Place.of(mi, self.surface, points, spread)

    def _radiance(self, mi: Any, si: Any, place: Place, draws: list[Draws]) -> Any:
        """Return one estimate of the reflected radiance."""
        total = mi.Color3f(0)
        for part in self._by_bounce(mi, si, place, draws):
            total += part
        return total

    def _by_bounce(
        self, mi: Any, si: Any, place: Place, draws: list[Draws], beside: tuple[Light, ...] | None = None
    ) -> list[Any]:
        """Return one estimate for each number of bounces, of the light's parts by their signs; or all of `apart`."""
        size = 1 + self.surface.bounces if beside is None else (2 + self.surface.bounces) * (1 + len(beside))
        totals = [mi.Color3f(0) for _ in range(size)]
        for k, ((sign, scene), own) in enumerate(zip(self._scenes, draws, strict=True)):
            also = beside if k == 0 or beside is None else ()  # the lights beside are whole: with the first part
            for depth, part in enumerate(self._part(mi, scene.environment(), si, place, own, also)):
                totals[depth] += (1.0 if depth >= 2 + self.surface.bounces else sign) * part
        return totals

    def _part(
        self, mi: Any, emission: Any, si: Any, place: Place, draws: Draws, beside: tuple[Light, ...] | None = None
    ) -> list[Any]:
        """Return estimates under one part of the light: emitter and BSDF sample, weighed by their densities.

        What a BSDF sample finds of the light has come by way of the shape as often as the point it was drawn at.
        """
        import drjit as dr

        context, reflector = mi.BSDFContext(), self.surface.bsdf
        bounces = 0 if self.surface.occluder is None else self.surface.bounces

        def step(depth: Any, active: Any, through: Any, si: Any, where: Any, totals: Any, draws: Any) -> Any:
            sampler = draws[0]
            here = replace(place, position=where[0], geometric=where[1], normal=where[2])
            si = averaged(mi, self.surface, si, draws[-1])
            ds, light = emission.sample_direction(si, sampler.next_2d(), active)
            value, pdf = reflector.eval_pdf(context, si, si.to_local(ds.d), active & (ds.pdf > 0))
            share = _balance(ds.pdf, pdf) if self.sample_lobes else 1.0
            bare = through * light * value * share
            gained = self._unshadowed(mi, here, ds.d, bare)
            others: list[tuple[Any, Any]] = []
            if bounces or self.sample_lobes or beside:
                sample, weight = reflector.sample(context, si, sampler.next_1d(), sampler.next_2d(), active)
                direction = si.to_world(sample.wo)
                through = through * weight
                sent = mi.Color3f(0)
                if self.sample_lobes:
                    seen = dr.zeros(mi.SurfaceInteraction3f)
                    seen.wi = -direction
                    ds = mi.DirectionSample3f()  # its direction alone is read
                    ds.d = direction
                    sent = through * emission.eval(seen) * _balance(sample.pdf, emission.pdf_direction(si, ds))
                bare = bare + sent
                lights = [other(direction) for other in beside or ()]
                found: Any = None
                if not bounces:
                    gained += self._unshadowed(mi, here, direction, sent)
                    clear = self._unshadowed(mi, here, direction, through) if beside else through
                else:
                    last = mi.Bool(self.sample_lobes or bool(beside))
                    cast = active & dr.any(through > 0) & (last | (depth < bounces))
                    found = met(mi, self.scene, self.surface, here.ray(mi, direction), cast)
                    clear = dr.select(found.is_valid(), mi.Color3f(0), through)
                    gained += dr.select(found.is_valid(), mi.Color3f(0), sent)
                others = [(clear * light, through * light) for light in lights]
                if bounces:
                    si, here, active = reached(mi, self.surface, found, here, direction)
                    if self.surface.texture is not None:
                        through = through * mi.Color3f(*self.surface.texture.eval(found.uv))
            at = [depth == k for k in range(1 + bounces)]
            gains = [(step, gained) for step in at]
            if beside is not None:
                gains += [(at[0], bare)]
                gains += [gain for lit, free in others for gain in (*((step, lit) for step in at), (at[0], free))]
            totals = [t + dr.select(step, gain, mi.Color3f(0)) for t, (step, gain) in zip(totals, gains, strict=True)]
            return depth + 1, active, through, si, (here.position, here.geometric, here.normal), totals, draws

        where = place.position, place.geometric, place.normal
        size = 1 + bounces if beside is None else (2 + bounces) * (1 + len(beside))
        totals = [mi.Color3f(0) for _ in range(size)]
        state = mi.UInt32(0), mi.Bool(True), mi.Color3f(1), si, where, totals, draws
        if not bounces or self.surface.variant.startswith("scalar"):
            for _ in range(1 + bounces):
                state = step(*state)
            return state[5]
        return paths(mi, bounces, step, si, where, totals, draws)

    def _unshadowed(self, mi: Any, place: Place, direction: Any, radiance: Any) -> Any:
        """Return `radiance`, or zero where the shape itself hides the light in `direction`."""
        import drjit as dr

        if self.surface.occluder is None:
            return radiance
        hidden = self.scene.ray_test(place.ray(mi, direction), dr.any(radiance > 0))
        return dr.select(hidden, mi.Color3f(0), radiance)


def seeded(mi: Any, kind: str, samples: int, seed: Any, lanes: int) -> Any:
    """Return one of Mitsuba's samplers."""
    sampler = mi.load_dict({"type": kind, "sample_count": samples})
    sampler.seed(seed, lanes)
    return sampler


def _chunks(indices: NDArray[np.int_], size: int) -> list[NDArray[np.int_]]:
    return [indices[start : start + size] for start in range(0, len(indices), size)]


def _balance(a: Any, b: Any) -> Any:
    """Return the weight of a sample of density `a` beside another technique of density `b` (Veach 1997, eq. 9.8)."""
    import drjit as dr

    return dr.select(a > 0, a / dr.maximum(a + b, 1e-30), 0)
