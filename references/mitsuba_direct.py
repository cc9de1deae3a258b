"""Ground truth by Mitsuba: reflected radiance at the query points, with its noise.

At each point the estimator is that of Mitsuba's `direct` integrator, one emitter sample and one BSDF sample combined,
but it starts from the point itself instead of from a camera: position, normal, tangent and view are taken as they are.
The two are weighed by the balance heuristic (Veach 1997, sec. 9.2.2), which under captured light leaves about a tenth
less noise than the power heuristic. Where all lobes are about as wide as a hemisphere, emitter samples alone serve
best (`direct` with ``bsdf_samples = 0``). For convex shapes no visibility ray is cast, so that whole lobes, which reach
below the horizon, are integrated too.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry import mitsuba_mesh
from data_gen.mitsuba_bsdf import bsdf
from data_gen.mitsuba_light import emitter
from envbench import llvm
from envbench.directions import Array, normalised
from envbench.geometry import Points
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Scene

SAMPLER = "multijitter"
"""Low-discrepancy sampler of Mitsuba; its `ldsampler` serves too."""

_LANES = 2**22
"""Samples in flight at a time: bounds the memory."""
_MOST = 4**10
"""Samples a point in one replicate, at most."""
_SECOND = 4
"""How many times the samples of the first look a second one takes, where many more are to come."""
_GROWTH = 100
"""Most that the samples of one step exceed those of the step that it is planned from."""
_MARGIN = 0.87
"""Of the target is planned for: points whose noise was measured too low by chance get too few samples."""
_WIDE = 1.0
"""Half-angle, in radians, of a cone that holds 90 % of a lobe, beyond which it is not sampled by itself."""


def render(scene: Scene, settings: ReferenceSettings, key: str = "") -> Reference:
    """Sample until the noise floor reaches its target or the budget ends.

    Each step renders afresh, with the samples that the noise of the step before calls for, most where it was highest.
    As no estimate enters the plan of its own samples, all stay unbiased.

    Parameters
    ----------
    scene : Scene
    settings : ReferenceSettings
    key : str
        Content address to label the result with.

    Returns
    -------
    Reference
        Its replicates hold float32 values, so that a stored copy is the same to the bit.

    Raises
    ------
    BadInput, CannotRun
        The variant is unknown, or cannot run on this machine.
    """
    started = time.perf_counter()
    shape = (settings.replicates, len(scene.points), 3)
    result = Reference(np.zeros(shape), scene.points.weight, 0, 0.0, key, settings.floor)
    if not scene.environment.radiance.any():
        return result
    estimator = Estimator(scene, settings.variant)
    samples = np.full(len(scene.points), estimator.first)
    goal, order, before = _MARGIN * settings.floor, estimator.order, (0, 0.0)
    while True:
        step = time.perf_counter()
        seeds = np.random.SeedSequence((settings.seed, int(samples.sum()))).spawn(settings.replicates)
        replicates = np.stack([estimator.replicate(samples, seed) for seed in seeds])
        now = time.perf_counter()
        result = replace(
            result,
            replicates=replicates.astype(np.float32).astype(np.float64),
            samples=round(samples.mean()),
            seconds=now - started,
            visibility_rays=estimator.visibility_rays,
        )
        if result.floor <= settings.floor:
            return result
        if before[0] == estimator.first:
            measured = math.log(before[1] / result.floor) / math.log(result.samples / before[0])
            order = min(max(measured, estimator.order), 1.0)
        elif before[0]:  # a plan that fell short is not made again, but with a lower goal
            goal *= settings.floor / result.floor
        affordable = 0.9 * (settings.budget - result.seconds) / (now - step)
        planned, floor = _plan(result, samples, order, goal, min(affordable, _GROWTH))
        if not before[0] and planned.mean() > 2 * _SECOND * estimator.first and affordable > 2 * _SECOND:
            planned = _SECOND * samples  # a second look, at the same samples everywhere, shows the order
        before = result.samples, result.floor
        if floor > settings.floor and floor > 0.9 * result.floor:
            end = f"{_MOST} samples a point" if samples.max() == _MOST else f"the budget of {settings.budget:g} s"
            note = f"noise floor {result.floor:.1e} instead of {settings.floor:.1e}: {end} came first"
            return replace(result, notes=(note,))
        samples = planned


def _plan(
    measured: Reference, samples: NDArray[np.int_], order: float, goal: float, growth: float
) -> tuple[NDArray[np.int_], float]:
    """Return the samples a point, (n,) powers of four, that reach `goal` at the least cost, and the floor expected.

    With a noise of q_i N_i^-p at point i, p the `order`, weighed w_i, the sum of w_i q_i^2 N_i^-2p for a given sum of
    N_i is least at N_i ~ (w_i q_i^2)^(1 / (2 p + 1)). There are at most `growth` times the `samples` measured with.
    """
    power = (measured.standard_error**2).mean(-1) * measured.weight / measured.weight.sum()
    constant = power * samples ** (2 * order)
    share = np.maximum(constant, 1e-4 * constant.max()) ** (1 / (2 * order + 1))
    best = samples, measured.floor
    for scale in np.geomspace(1, _MOST, 16 * round(math.log2(_MOST))) / share.max():
        exponents = np.clip(np.round(np.log(scale * share) / np.log(4)), 2, math.log(_MOST, 4))
        planned = 4 ** exponents.astype(int)
        if planned.sum() > growth * samples.sum():
            break
        best = planned, float(np.sqrt((constant / planned ** (2 * order)).sum())) / (measured.rms or 1.0)
        if best[1] <= goal:
            break
    return best


class Estimator:
    """Radiance at the points of a scene from a given number of samples.

    Attributes
    ----------
    first : int
        Samples a point that a first look takes; a power of four.
    order : float
        The noise is taken to fall as N^-order at least, from some hundred samples on: so it does under captured light.
    visibility_rays : int
        Rays cast so far: one for each direction sampled, or none where nothing can shadow.
    """

    def __init__(self, scene: Scene, variant: str, sampler: str = SAMPLER) -> None:
        self._mi = mi = llvm.mitsuba(variant)
        self._scalar = variant.startswith("scalar")
        self._sampler = sampler
        self._points = scene.points
        self._bsdf = bsdf(scene.material)
        mesh = scene.geometry.mesh
        self._shadows = Effect.SELF_SHADOWING in scene.effects and mesh is not None and not scene.geometry.convex
        parts: dict[str, Any] = {"type": "scene", "light": emitter(scene.environment)}
        if self._shadows and mesh is not None:
            parts["shape"] = mitsuba_mesh(mi, mesh)
        self._scene = mi.load_dict(parts)
        self._light = self._scene.environment()
        self._sample_lobes = any(lobe.cone(0.1) < _WIDE for lobe in scene.material.lobes)
        self.first = 16 if self._scalar else 64
        self.order = 0.8 if self._sample_lobes else 0.6
        self.visibility_rays = 0

    def replicate(self, samples: NDArray[np.int_] | int, seed: np.random.SeedSequence) -> Array:
        """Estimate the radiance at every point, (n, 3), from `samples` (powers of four) at each."""
        samples = np.broadcast_to(samples, len(self._points))
        self.visibility_rays += (1 + self._sample_lobes) * int(samples.sum()) * self._shadows
        jobs = [
            (int(count), chunk)
            for count in np.unique(samples)
            for chunk in _chunks(np.flatnonzero(samples == count), 1 if self._scalar else max(1, _LANES // int(count)))
        ]
        estimate = np.empty((len(samples), 3))
        for (count, chunk), state in zip(jobs, seed.generate_state(len(jobs)), strict=True):
            sums = self._one_by_one if self._scalar else self._wavefront
            estimate[chunk] = sums(chunk, count, int(state)) / count
        return estimate

    def _wavefront(self, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sums over the samples of the `chosen` points, (n, 3), all at once."""
        import drjit as dr

        mi = self._mi
        lanes = len(chosen) * samples
        sampler = self._new_sampler(samples)
        # Before seeding: without it the samples of a point are independent of each other, and seeds barely differ.
        sampler.set_samples_per_wavefront(samples)
        sampler.seed(dr.opaque(mi.UInt32, seed), lanes)
        point = dr.arange(mi.UInt32, lanes) // dr.opaque(mi.UInt32, samples)

        def spread(values: Array) -> Any:
            columns = np.ascontiguousarray(values[chosen].T, np.float32)
            return dr.gather(mi.Vector3f, mi.Vector3f(columns), point)

        radiance = self._radiance(self._interaction(spread), sampler)
        dr.eval(radiance)
        return np.stack([dr.block_sum(mi.Float64(c), samples).numpy() for c in radiance], axis=-1)

    def _one_by_one(self, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sum over the samples of the one `chosen` point, (3,)."""
        sampler = self._new_sampler(samples)
        sampler.seed(seed, 1)
        interaction = self._interaction(lambda values: self._mi.Vector3f(*(float(v) for v in values[chosen[0]])))
        total = np.zeros(3)
        for _ in range(samples):
            total += np.array(self._radiance(interaction, sampler), float)
            sampler.advance()
        return total

    def _new_sampler(self, samples: int) -> Any:
        return self._mi.load_dict({"type": self._sampler, "sample_count": samples})

    def _interaction(self, spread: Any) -> Any:
        """Return the surface interaction at the points, its arrays laid out by `spread`."""
        import drjit as dr

        mi, points = self._mi, self._points
        tangent = _orthogonal(points)
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.p = mi.Point3f(spread(points.position))
        si.n = mi.Normal3f(spread(points.geometric_normal))
        normal, s = spread(points.normal), spread(tangent)
        si.sh_frame = mi.Frame3f(s, dr.cross(normal, s), normal)
        si.wi = si.to_local(spread(points.view))
        return si

    def _radiance(self, si: Any, sampler: Any) -> Any:
        """Return one estimate of the reflected radiance: emitter and BSDF sample, weighed by their densities."""
        import drjit as dr

        mi, context = self._mi, self._mi.BSDFContext()
        ds, light = self._light.sample_direction(si, sampler.next_2d())
        value, pdf = self._bsdf.eval_pdf(context, si, si.to_local(ds.d), ds.pdf > 0)
        if not self._sample_lobes:
            return self._unshadowed(si, ds.d, light * value)
        by_light = self._unshadowed(si, ds.d, light * value * _balance(ds.pdf, pdf))

        sample, weight = self._bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d())
        direction = si.to_world(sample.wo)
        seen = dr.zeros(mi.SurfaceInteraction3f)
        seen.wi = -direction
        ds = mi.DirectionSample3f()  # its direction alone is read
        ds.d = direction
        share = _balance(sample.pdf, self._light.pdf_direction(si, ds))
        return by_light + self._unshadowed(si, direction, weight * self._light.eval(seen) * share)

    def _unshadowed(self, si: Any, direction: Any, radiance: Any) -> Any:
        """Return `radiance`, or zero where the shape itself hides the light in `direction`."""
        import drjit as dr

        if not self._shadows:
            return radiance
        hidden = self._scene.ray_test(si.spawn_ray(direction), dr.any(radiance > 0))
        return dr.select(hidden, self._mi.Color3f(0), radiance)


def _chunks(indices: NDArray[np.int_], size: int) -> list[NDArray[np.int_]]:
    return [indices[start : start + size] for start in range(0, len(indices), size)]


def _balance(a: Any, b: Any) -> Any:
    """Return the weight of a sample of density `a` beside another technique of density `b` (Veach 1997, eq. 9.8)."""
    import drjit as dr

    return dr.select(a > 0, a / dr.maximum(a + b, 1e-30), 0)


def _orthogonal(points: Points) -> Array:
    """Return the tangents, made perpendicular to the shading normals."""
    along = np.sum(points.tangent * points.normal, axis=-1, keepdims=True)
    return normalised(points.tangent - along * points.normal)
