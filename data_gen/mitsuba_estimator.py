"""Radiance at query points by Mitsuba, from a given number of samples: for ground truth, and for a Monte-Carlo method.

At each point the estimator is that of Mitsuba's `direct` integrator, one emitter sample and one BSDF sample combined,
but it starts from the point itself instead of from a camera: position, normal, tangent and view are taken as they are.
The two are weighed by the balance heuristic (Veach 1997, sec. 9.2.2), which under captured light leaves about a tenth
less noise than the power heuristic. Without lobe samples it is `direct` with ``bsdf_samples = 0``. Where nothing can
shadow no visibility ray is cast, so that whole lobes, which reach below the horizon, are integrated too.

Bounces: the BSDF sample goes on to what the shape has in its way, and the same is done there, as `path` does.
Signed light: its positive and its negative part are estimated each by itself, and subtracted.
Carried shadows: what a shape hides at rest, carried along by a pose (`Surface.carried`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.boundary import is_closed
from data_gen.geometry import mitsuba_mesh
from data_gen.mitsuba_bsdf import bsdf, texture
from data_gen.mitsuba_light import emitter
from envbench import llvm
from envbench.directions import Array, normalised
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, TriangleMesh
from envbench.material import Material

SAMPLER = "multijitter"
"""Low-discrepancy sampler of Mitsuba; its `ldsampler` serves too."""

_LANES = 2**22
"""Samples in flight at a time: bounds the memory."""
_LIFT = 2e-5
"""How far off the surface rays start, relative to the shape's size and place: some 100 roundings of a coordinate."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What reflects: a material, and the mesh that can shadow it (None where nothing can).

    Mitsuba's objects are made at first use, belong to `variant`, and are left out when pickled.

    Attributes
    ----------
    bounces : int
        How often light may come by way of the occluder, which reflects as the material does.
    carried : bool
        The occluder is the shape at rest, whose points are elsewhere than those seen: light from w reaches a point of
        rotation R if at rest it comes through from R^T w. So a pose carries the transfer along, and no part of the
        posed shape shadows another.
    """

    material: Material
    occluder: TriangleMesh | None
    variant: str = "llvm_ad_rgb"
    bounces: int = 0
    carried: bool = False

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

    @cached_property
    def closed(self) -> bool:
        """Whether the occluder bounds a solid, so that its inside is dark; of an open one both sides reflect."""
        return self.occluder is not None and is_closed(self.occluder)

    @cached_property
    def texture(self) -> Any:
        """Give the material's texture as a `mi.Texture2f`; None where there is none."""
        if self.material.texture is None:
            return None
        return texture(llvm.mitsuba(self.variant), self.material.texture)

    @cached_property
    def lift(self) -> float:
        """How far off the occluder rays start."""
        if self.occluder is None:
            return 0.0
        vertices = self.occluder.vertices
        return _LIFT * float(np.linalg.norm(np.ptp(vertices, axis=0)) / 2 + np.abs(vertices).max())

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}


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
        return self._scenes[0][1]

    @cached_property
    def _scenes(self) -> tuple[tuple[float, Any], ...]:
        """The positive and the negative part of the light, as signs and scenes; the first holds the occluder."""
        mi = llvm.mitsuba(self.surface.variant)
        made: list[tuple[float, Any]] = []
        for sign, part in self.environment.parts:
            content = {"type": "scene", "light": emitter(part)}
            if self.surface.shape is not None and not made:
                content["shape"] = self.surface.shape
            made.append((sign, mi.load_dict(content)))
        return tuple(made)

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def order(self) -> float:
        """The order that noise has in the samples under captured light, or more."""
        return 0.8 if self.sample_lobes else 0.6

    @property
    def rays(self) -> int:
        """Visibility rays cast for each sample: one for each direction drawn, or none where nothing can shadow."""
        if self.surface.occluder is None:
            return 0
        drawn = 1 + self.sample_lobes if not self.surface.bounces else 2 * self.surface.bounces + 1 + self.sample_lobes
        return drawn * len(self.environment.parts)

    def replicate(self, points: Points, samples: NDArray[np.int_] | int, seed: np.random.SeedSequence) -> Array:
        """Estimate the radiance at every point, (n, 3), from `samples` (powers of four) at each.

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

        radiance = self._radiance(mi, self._interaction(mi, points, spread), self._place(mi, points, spread), sampler)
        dr.eval(radiance)
        return np.stack([dr.block_sum(mi.Float64(c), samples).numpy() for c in radiance], axis=-1)

    def _one_by_one(self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int) -> Array:
        """Return the sum over the samples of the one `chosen` point, (3,)."""
        sampler = mi.load_dict({"type": self.sampler, "sample_count": samples})
        sampler.seed(seed, 1)

        def taken(values: Array) -> Any:
            return mi.Vector3f(*(float(v) for v in values[chosen[0]]))

        interaction, place = self._interaction(mi, points, taken), self._place(mi, points, taken)
        total = np.zeros(3)
        for _ in range(samples):
            total += np.array(self._radiance(mi, interaction, place, sampler), float)
            sampler.advance()
        return total

    def _radiance(self, mi: Any, si: Any, place: _Place, sampler: Any) -> Any:
        """Return one estimate of the reflected radiance, of the light's parts by their signs."""
        total = mi.Color3f(0)
        for sign, scene in self._scenes:
            total += sign * self._part(mi, scene.environment(), si, place, sampler)
        return total

    def _part(self, mi: Any, emission: Any, si: Any, place: _Place, sampler: Any) -> Any:
        """Return an estimate under one part of the light: emitter and BSDF sample, weighed by their densities."""
        import drjit as dr

        context, reflector = mi.BSDFContext(), self.surface.bsdf
        bounces = 0 if self.surface.occluder is None else self.surface.bounces
        total, through, active = mi.Color3f(0), mi.Color3f(1), mi.Bool(True)
        for depth in range(1 + bounces):
            ds, light = emission.sample_direction(si, sampler.next_2d(), active)
            value, pdf = reflector.eval_pdf(context, si, si.to_local(ds.d), active & (ds.pdf > 0))
            share = _balance(ds.pdf, pdf) if self.sample_lobes else 1.0
            total += self._unshadowed(mi, place, ds.d, through * light * value * share)
            if depth == bounces and not self.sample_lobes:
                break
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
            if depth == bounces:
                total += self._unshadowed(mi, place, direction, sent)
                break
            found = self.scene.ray_intersect(place.ray(mi, direction), active & dr.any(through > 0))
            total += dr.select(found.is_valid(), mi.Color3f(0), sent)
            si, place, active = self._reached(mi, found, place, direction)
            if self.surface.texture is not None:
                through = through * mi.Color3f(*self.surface.texture.eval(found.uv))
        return total

    def _unshadowed(self, mi: Any, place: _Place, direction: Any, radiance: Any) -> Any:
        """Return `radiance`, or zero where the shape itself hides the light in `direction`."""
        import drjit as dr

        if self.surface.occluder is None:
            return radiance
        hidden = self.scene.ray_test(place.ray(mi, direction), dr.any(radiance > 0))
        return dr.select(hidden, mi.Color3f(0), radiance)

    def _reached(self, mi: Any, found: Any, place: _Place, direction: Any) -> tuple[Any, _Place, Any]:
        """Return the surface that a ray in `direction` has found, as the light sees it and as rays leave it.

        An open shape is turned to the side that was met; the inside of a closed one is met by no path that counts.
        """
        import drjit as dr

        front = dr.dot(found.n, place.at_rest(mi, direction)) < 0
        active, n, frame = found.is_valid(), found.n, found.sh_frame
        if self.surface.closed:
            active = active & front
        else:
            n = dr.select(front, n, -n)
            frame = mi.Frame3f(frame.s, dr.select(front, frame.t, -frame.t), dr.select(front, frame.n, -frame.n))
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.sh_frame = mi.Frame3f(*(place.posed(mi, axis) for axis in (frame.s, frame.t, frame.n)))
        si.n = mi.Normal3f(place.posed(mi, n))
        si.wi = si.to_local(-direction)
        si.uv = found.uv
        return si, replace(place, position=found.p, geometric=mi.Vector3f(n), normal=mi.Vector3f(frame.n)), active

    def _interaction(self, mi: Any, points: Points, spread: Callable[[Array], Any]) -> Any:
        """Return the surface interaction at the points, its arrays laid out by `spread`."""
        import drjit as dr

        si = dr.zeros(mi.SurfaceInteraction3f)
        si.p = mi.Point3f(spread(points.position))
        si.n = mi.Normal3f(spread(points.geometric_normal))
        normal, s = spread(points.normal), spread(_orthogonal(points))
        si.sh_frame = mi.Frame3f(s, dr.cross(normal, s), normal)
        si.wi = si.to_local(spread(points.view))
        if self.surface.material.transparency is not None:
            if points.uv is None:
                raise BadInput("a map of transparency needs points with uv; unwrap the mesh first.")
            uv = spread(np.pad(points.uv, ((0, 0), (0, 1))))
            si.uv = mi.Point2f(uv.x, uv.y)
        return si

    def _place(self, mi: Any, points: Points, spread: Callable[[Array], Any]) -> _Place:
        """Return where the points are on the occluder, their arrays laid out by `spread`."""
        position, geometric, normal, rotation = points.position, points.geometric_normal, points.normal, None
        if self.surface.carried and self.surface.occluder is not None:
            position, geometric, normal = _at_rest(self.surface.occluder, points)
            if points.rotation is not None:
                rotation = tuple(spread(points.rotation[:, row]) for row in range(3))
        return _Place(mi.Point3f(spread(position)), spread(geometric), spread(normal), self.surface.lift, rotation)


@dataclass(frozen=True)
class _Place:
    """Where rays leave the occluder: `position`, geometric and shading `normal` in its own frame, all Mitsuba's.

    `rotation` holds the rows of the matrix that turns the occluder's frame into the light's; None where they are one.
    """

    position: Any
    geometric: Any
    normal: Any
    lift: float
    rotation: tuple[Any, ...] | None = None

    def ray(self, mi: Any, direction: Any) -> Any:
        """Return the ray in a `direction` of the light's frame.

        It starts off the surface on the side of the shading normal that it goes to. Leaving on the geometric normal's
        side instead, a vertex would look into a convex shape past all but one of its triangles.
        """
        import drjit as dr

        turned = self.at_rest(mi, direction)
        side = dr.mulsign(mi.Float(self.lift), dr.dot(self.normal, turned))
        return mi.Ray3f(self.position + side * self.geometric, turned)

    def at_rest(self, mi: Any, vector: Any) -> Any:
        """Return R^T v."""
        if self.rotation is None:
            return vector
        x, y, z = self.rotation
        return mi.Vector3f(x * vector.x + y * vector.y + z * vector.z)

    def posed(self, mi: Any, vector: Any) -> Any:
        """Return R v."""
        import drjit as dr

        vector = mi.Vector3f(vector)
        return vector if self.rotation is None else mi.Vector3f(*(dr.dot(row, vector) for row in self.rotation))


def _at_rest(mesh: TriangleMesh, points: Points) -> tuple[Array, Array, Array]:
    """Return position, geometric and shading normal, (n, 3) each, of the points on the mesh at rest."""
    if points.triangle is None or points.barycentric is None:
        raise BadInput(
            "shadows of the shape at rest need points with triangle and barycentric; take those of an image."
        )
    corners = mesh.triangles[points.triangle]
    a, b, c = (mesh.vertices[corners[:, k]] for k in range(3))
    position, normal = (
        np.einsum("nk,nkc->nc", points.barycentric, values[corners]) for values in (mesh.vertices, mesh.normals)
    )
    return position, normalised(np.cross(b - a, c - a)), normalised(normal)


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
