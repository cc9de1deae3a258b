"""Radiance at query points by Mitsuba, from a given number of samples: for ground truth, and for a Monte-Carlo method.

At each point the estimator is that of Mitsuba's `direct` integrator, one emitter sample and one BSDF sample combined,
but it starts from the point itself instead of from a camera: position, normal, tangent and view are taken as they are.
The two are weighed by the balance heuristic (Veach 1997, sec. 9.2.2), which under captured light leaves about a tenth
less noise than the power heuristic. Without lobe samples it is `direct` with ``bsdf_samples = 0``. Where nothing can
shadow no visibility ray is cast, so that whole lobes, which reach below the horizon, are integrated too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry import mitsuba_mesh
from data_gen.mitsuba_bsdf import bsdf
from data_gen.mitsuba_light import emitter
from envbench import llvm
from envbench.directions import Array, normalised
from envbench.environment import Environment
from envbench.geometry import Geometry, Points, TriangleMesh
from envbench.material import Material

SAMPLER = "multijitter"
"""Low-discrepancy sampler of Mitsuba; its `ldsampler` serves too."""

_LANES = 2**22
"""Samples in flight at a time: bounds the memory."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What reflects: a material, and the mesh that can shadow it (None where nothing can).

    Mitsuba's objects are made at first use, belong to `variant`, and are left out when pickled.
    """

    material: Material
    occluder: TriangleMesh | None
    variant: str = "llvm_ad_rgb"

    @classmethod
    def of(cls, material: Material, geometry: Geometry, variant: str = "llvm_ad_rgb") -> Surface:
        """Return the surface of a shape: a convex one, or the sphere in closed form, shadows nothing."""
        return cls(material, None if geometry.convex else geometry.mesh, variant)

    @cached_property
    def bsdf(self) -> Any:
        """Give the material as a `mi.BSDF`."""
        llvm.mitsuba(self.variant)
        return bsdf(self.material)

    @cached_property
    def shape(self) -> Any:
        """Give the occluder as a `mi.Mesh`; None where there is none."""
        return None if self.occluder is None else mitsuba_mesh(llvm.mitsuba(self.variant), self.occluder)

    def __getstate__(self) -> dict[str, Any]:
        return {"material": self.material, "occluder": self.occluder, "variant": self.variant}


@dataclass(frozen=True, eq=False)
class Estimator:
    """Radiance that a surface under a light reflects, from a given number of samples.

    Attributes
    ----------
    sample_lobes : bool
        Whether each emitter sample is joined by a sample of the lobes. Without, a peak is found by chance alone.
    sampler : str
        Name of a Mitsuba sampler.
    """

    surface: Surface
    environment: Environment
    sample_lobes: bool = True
    sampler: str = SAMPLER

    @cached_property
    def scene(self) -> Any:
        """Give the light, and the occluder where there is one, as a `mi.Scene`: made at first use."""
        mi = llvm.mitsuba(self.surface.variant)
        parts = {"type": "scene", "light": emitter(self.environment)}
        return mi.load_dict(parts if self.surface.shape is None else parts | {"shape": self.surface.shape})

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "scene"}

    @property
    def rays(self) -> int:
        """Visibility rays cast for each sample: one for each direction drawn, or none where nothing can shadow."""
        return 0 if self.surface.occluder is None else 1 + self.sample_lobes

    def replicate(self, points: Points, samples: NDArray[np.int_] | int, seed: np.random.SeedSequence) -> Array:
        """Estimate the radiance at every point, (n, 3), from `samples` (powers of four) at each."""
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

    def _wavefront(self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sums over the samples of the `chosen` points, (n, 3), all at once."""
        import drjit as dr

        lanes = len(chosen) * samples
        sampler = mi.load_dict({"type": self.sampler, "sample_count": samples})
        # Before seeding: without it the samples of a point are independent of each other, and seeds barely differ.
        sampler.set_samples_per_wavefront(samples)
        sampler.seed(dr.opaque(mi.UInt32, seed), lanes)
        point = dr.arange(mi.UInt32, lanes) // dr.opaque(mi.UInt32, samples)

        def spread(values: Array) -> Any:
            columns = np.ascontiguousarray(values[chosen].T, np.float32)
            return dr.gather(mi.Vector3f, mi.Vector3f(columns), point)

        radiance = self._radiance(mi, _interaction(mi, points, spread), sampler)
        dr.eval(radiance)
        return np.stack([dr.block_sum(mi.Float64(c), samples).numpy() for c in radiance], axis=-1)

    def _one_by_one(self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sum over the samples of the one `chosen` point, (3,)."""
        sampler = mi.load_dict({"type": self.sampler, "sample_count": samples})
        sampler.seed(seed, 1)
        interaction = _interaction(mi, points, lambda values: mi.Vector3f(*(float(v) for v in values[chosen[0]])))
        total = np.zeros(3)
        for _ in range(samples):
            total += np.array(self._radiance(mi, interaction, sampler), float)
            sampler.advance()
        return total

    def _radiance(self, mi: Any, si: Any, sampler: Any) -> Any:
        """Return one estimate of the reflected radiance: emitter and BSDF sample, weighed by their densities."""
        import drjit as dr

        context, emission, reflector = mi.BSDFContext(), self.scene.environment(), self.surface.bsdf
        ds, light = emission.sample_direction(si, sampler.next_2d())
        value, pdf = reflector.eval_pdf(context, si, si.to_local(ds.d), ds.pdf > 0)
        if not self.sample_lobes:
            return self._unshadowed(mi, si, ds.d, light * value)
        by_light = self._unshadowed(mi, si, ds.d, light * value * _balance(ds.pdf, pdf))

        sample, weight = reflector.sample(context, si, sampler.next_1d(), sampler.next_2d())
        direction = si.to_world(sample.wo)
        seen = dr.zeros(mi.SurfaceInteraction3f)
        seen.wi = -direction
        ds = mi.DirectionSample3f()  # its direction alone is read
        ds.d = direction
        share = _balance(sample.pdf, emission.pdf_direction(si, ds))
        return by_light + self._unshadowed(mi, si, direction, weight * emission.eval(seen) * share)

    def _unshadowed(self, mi: Any, si: Any, direction: Any, radiance: Any) -> Any:
        """Return `radiance`, or zero where the shape itself hides the light in `direction`."""
        import drjit as dr

        if self.surface.occluder is None:
            return radiance
        hidden = self.scene.ray_test(si.spawn_ray(direction), dr.any(radiance > 0))
        return dr.select(hidden, mi.Color3f(0), radiance)


def _interaction(mi: Any, points: Points, spread: Any) -> Any:
    """Return the surface interaction at the points, its arrays laid out by `spread`."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.p = mi.Point3f(spread(points.position))
    si.n = mi.Normal3f(spread(points.geometric_normal))
    normal, s = spread(points.normal), spread(_orthogonal(points))
    si.sh_frame = mi.Frame3f(s, dr.cross(normal, s), normal)
    si.wi = si.to_local(spread(points.view))
    return si


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
