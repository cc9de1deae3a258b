"""Diffuse transfer vectors at the vertices of a shape at rest, simulated with Mitsuba's rays.

The transfer vector t of a vertex is what it sends out, for reflectance 1, of each spherical harmonic shone as light
(Sloan, Luna and Snyder 2005, sec. 2): exit radiance = t . e. With directions s drawn by the cosine about its normal,

    t_lm = int V(s) max(N.s, 0) / pi y_lm(s) ds = E[V(s) y_lm(s)],

V being 0 where the shape itself is in the way. What is in the way sends light on: each bounce gathers, along fresh
rays, the transfer vectors of the bounce before, interpolated over the triangle that is hit, times albedo.

A vertex's own triangles.  Rays start from p + d M, d tiny (`_LIFT`) and M the mean normal of all triangles that meet at
p's place. Where the surface is convex about p, the solid about p lies below p's tangent plane, x.N <= 0 for all its
points p + x, since its normal N is a triangle's or a positive sum of those of several; and M.N > 0. A ray of direction
s has (d M + s t).N > 0, so that it never meets the solid: no triangle need be excluded, and none that rises from p in
truth (the walls of a groove, the other side of a crease) is. Starting on either side of one triangle's plane, as rays
from within a triangle do, would let half of p's triangles shadow it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import StrEnum
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from data_gen.boundary import is_closed
from data_gen.geometry import mitsuba_mesh
from envbench import llvm
from envbench.directions import Array, normalised
from envbench.errors import BadInput
from envbench.geometry import Geometry, TriangleMesh
from methods.ldprt import basis, membrane

BATCHES = 10
"""Independent sets that the rays of a vertex are drawn in: the standard error is that of the mean over them."""
MOST_RAYS = 10**6
MOST_BANDS = 16
_LIFT = 2e-5
"""How far above a vertex its rays start, relative to the shape's radius: some 100 roundings of a coordinate."""
_AGREE = 0.1
"""Cosine between a vertex's own normal and the mean one of its place, below which its own is trusted."""
_LANES = 2**19
"""Batches in flight at a time: bounds the memory to n^2 floats for each."""
_GOLDEN = (sqrt(5) - 1) / 2


class Kind(StrEnum):
    """What transfer accounts for."""

    UNSHADOWED = "unshadowed"
    SHADOWED = "shadowed"
    INTERREFLECTED = "interreflected"


@dataclass(frozen=True, eq=False)
class Transfer:
    """Diffuse transfer at the vertices of a shape at rest.

    Attributes
    ----------
    vectors : (V, n^2) float64
        In the order l*l + l + m and the frame of the mesh's vertices; constant light 1 on an open vertex returns 1.
    standard_error : (V, n^2) float64
        Of each coefficient, from the spread over `BATCHES` sets of rays; zero where the form is closed.
    rays : int
        Cast from each vertex, in all passes together.
    seconds : float
        What it took.
    """

    vectors: Array
    standard_error: Array
    kind: Kind
    rays: int
    seconds: float

    @property
    def order(self) -> int:
        """The number n of bands."""
        return round(sqrt(self.vectors.shape[1]))

    @property
    def relative_error(self) -> float:
        """Standard error over length, both as RMS over all vertices and coefficients."""
        return float(np.sqrt((self.standard_error**2).sum() / (self.vectors**2).sum()))


def simulate(
    geometry: Geometry,
    order: int,
    *,
    kind: Kind | str = Kind.SHADOWED,
    rays: int = 5000,
    bounces: int = 1,
    albedo: ArrayLike = 1.0,
    seed: int = 0,
) -> Transfer:
    """Simulate diffuse transfer at each vertex.

    Unshadowed transfer, and any transfer of a convex shape, is the clamped cosine in closed form. The mesh is opaque:
    on a closed one light comes from outside, and on an open one both sides send light on.

    Parameters
    ----------
    geometry : Geometry
        A mesh; its pose, if it has one, is not looked at.
    order : int
        n, the number of bands.
    kind : Kind or str
    rays : int
        From each vertex, for direct light and again for each bounce; rounded up to a multiple of `BATCHES`.
    bounces : int
        k, looked at for inter-reflected transfer alone.
    albedo : float or (V,)
        Of the surface that sends light on. A vertex's own reflectance is left to the shading.
    seed : int

    Raises
    ------
    BadInput
        For a shape without a mesh, and a setting out of range.
    """
    started = time.perf_counter()
    kind = _kind(kind)
    mesh = geometry.rest.mesh
    if mesh is None:
        raise BadInput(f"transfer is simulated at vertices; '{geometry.name}' is a sphere in closed form: give a mesh.")
    _check(order, rays, bounces, seed)
    share = np.broadcast_to(np.asarray(albedo, float), len(mesh.vertices))
    if not ((share >= 0) & (share <= 1)).all():
        raise BadInput(f"albedo must lie in [0, 1]. Got {share.min():g} to {share.max():g} instead.")
    if kind is Kind.UNSHADOWED or geometry.convex:
        vectors = membrane.transfer(mesh.normals, order)
        return Transfer(vectors, np.zeros_like(vectors), kind, 0, time.perf_counter() - started)

    per_batch = -(-rays // BATCHES)
    passes = 1 + (bounces if kind is Kind.INTERREFLECTED else 0)
    bench = _Bench.of(mesh, both_sides=passes > 1 and not is_closed(mesh))
    states = np.random.SeedSequence(seed).generate_state(passes)
    light, variance = bench.gathered(order, per_batch, int(states[0]), None)
    vectors = light
    for state in states[1:]:
        sent = np.tile(share, bench.sides)[:, None] * light
        light, more = bench.gathered(order, per_batch, int(state), sent)
        vectors, variance = vectors + light, variance + more
    count = len(mesh.vertices)
    return Transfer(
        vectors[:count],
        np.sqrt(variance[:count]),
        kind,
        per_batch * BATCHES * passes,
        time.perf_counter() - started,
    )


@dataclass(frozen=True, eq=False)
class _Bench:
    """A mesh made ready for Mitsuba: moved to the origin, of radius 1, so that `_LIFT` has a meaning.

    `starts` and `normals` (sides V, 3): of the second side, where there is one, after those of the first.
    """

    mi: Any
    scene: Any
    starts: Array
    normals: Array
    triangles: NDArray[np.int32]
    facing: Array
    sides: int

    @classmethod
    def of(cls, mesh: TriangleMesh, both_sides: bool) -> _Bench:
        mi = llvm.mitsuba("llvm_ad_rgb")
        low, high = mesh.vertices.min(0), mesh.vertices.max(0)
        vertices = (mesh.vertices - (low + high) / 2) / (np.linalg.norm(high - low) / 2)
        placed = TriangleMesh(vertices, mesh.triangles, mesh.normals)
        a, b, c = (vertices[mesh.triangles[:, k]] for k in range(3))
        normals = np.concatenate([mesh.normals, -mesh.normals]) if both_sides else mesh.normals
        sides = 1 + both_sides
        up = _upwards(vertices, mesh)
        starts = np.tile(vertices, (sides, 1)) + _LIFT * (np.concatenate([up, -up]) if both_sides else up)
        scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mi, placed)})
        return cls(mi, scene, starts, normals, mesh.triangles, np.cross(b - a, c - a), sides)

    def gathered(self, order: int, per_batch: int, seed: int, sent: Array | None) -> tuple[Array, Array]:
        """Return what a pass gathers, (sides V, n^2), and the variance of that.

        Parameters
        ----------
        sent : (sides V, n^2) or None
            What the vertices send out of the bounce before; None for the light itself, where nothing is in the way.
        """
        count = len(self.starts)
        mean, variance = np.empty((count, order**2)), np.empty((count, order**2))
        surface = None if sent is None else self._surface(sent)
        size = max(1, _LANES // BATCHES)
        for first in range(0, count, size):
            chosen = slice(first, min(first + size, count))
            sums = self._sums(order, per_batch, seed, chosen, surface)
            batches = (np.stack(sums, axis=-1).astype(np.float64) / per_batch).reshape(-1, BATCHES, order**2)
            mean[chosen], variance[chosen] = batches.mean(1), batches.var(1, ddof=1) / BATCHES
        return mean, variance

    def _sums(
        self, order: int, per_batch: int, seed: int, chosen: slice, surface: tuple[Any, Any, Any] | None
    ) -> list[NDArray[np.float32]]:
        """Return the sums over the rays of each batch, n^2 arrays (vertices x BATCHES): one kernel, one loop a batch.

        A batch's rays are a Kronecker lattice (i / m, i golden) under a random shift: one in each of m strata.
        """
        import drjit as dr

        mi = self.mi
        lanes = (chosen.stop - chosen.start) * BATCHES
        lane = dr.arange(mi.UInt32, lanes)
        vertex = lane // BATCHES
        start = dr.gather(mi.Point3f, mi.Point3f(_columns(self.starts[chosen])), vertex)
        frame = mi.Frame3f(dr.gather(mi.Vector3f, mi.Vector3f(_columns(self.normals[chosen])), vertex))
        a, b = mi.sample_tea_32(lane + dr.opaque(mi.UInt32, chosen.start * BATCHES), dr.opaque(mi.UInt32, seed), 6)
        shift = mi.Point2f(a >> 8, b >> 8) * 2.0**-24
        many = dr.opaque(mi.UInt32, per_batch)
        step = dr.rcp(mi.Float(many))

        def body(i: Any, sums: list[Any]) -> tuple[Any, list[Any]]:
            u = mi.Point2f((mi.Float(i) + shift.x) * step, mi.Float(i) * _GOLDEN + shift.y)
            direction = frame.to_world(mi.warp.square_to_cosine_hemisphere(u - dr.floor(u)))
            ray = mi.Ray3f(start, direction)
            if surface is None:
                seen = ~self.scene.ray_test(ray)
                found = basis.evaluate(order, direction)
            else:
                found, seen = self._hit(order, ray, surface)
            return i + 1, [s + dr.select(seen, f, 0) for s, f in zip(sums, found, strict=True)]

        _, sums = dr.while_loop(
            state=(dr.zeros(mi.UInt32, lanes), [dr.zeros(mi.Float, lanes) for _ in range(order**2)]),
            cond=lambda i, _: i < many,
            body=body,
            labels=("i", "sums"),
        )
        dr.eval(sums)
        return [s.numpy() for s in sums]

    def _hit(self, order: int, ray: Any, surface: tuple[Any, Any, Any]) -> tuple[list[Any], Any]:
        """Return what comes back along the ray from the surface, and whether there is any."""
        import drjit as dr

        mi, (corners, facing, sent) = self.mi, surface
        found = self.scene.ray_intersect_preliminary(ray)
        hit = found.is_valid()
        behind = dr.dot(dr.gather(mi.Vector3f, facing, found.prim_index, hit), ray.d) > 0
        if self.sides == 1:
            hit &= ~behind  # the inside of a closed shape is dark
            place = mi.UInt32(0)
        else:
            place = dr.select(behind, mi.UInt32(len(self.starts) // 2), mi.UInt32(0))
        v, w = found.prim_uv.x, found.prim_uv.y
        shares = (1 - v - w, v, w)
        width = order**2
        rows = [(dr.gather(mi.UInt32, corners, 3 * found.prim_index + k, hit) + place) * width for k in range(3)]
        return [
            sum((share * dr.gather(mi.Float, sent, row + k, hit) for share, row in zip(shares, rows, strict=True)),
                start=mi.Float(0))
            for k in range(width)
        ], hit  # fmt: skip

    def _surface(self, sent: Array) -> tuple[Any, Any, Any]:
        mi = self.mi
        return (
            mi.UInt32(self.triangles.astype(np.uint32).ravel()),
            mi.Vector3f(_columns(self.facing)),
            mi.Float(sent.astype(np.float32).ravel()),
        )


def _columns(rows: Array) -> NDArray[np.float32]:
    return np.ascontiguousarray(rows.T, np.float32)


def _upwards(vertices: Array, mesh: TriangleMesh) -> Array:
    """Return the mean unit normal (V, 3) of the triangles that meet at each vertex's place, by their areas.

    Where these face each other, or away from the vertex's own normal, that one is taken.
    """
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    place = place.ravel()
    a, b, c = (vertices[mesh.triangles[:, k]] for k in range(3))
    corner = place[mesh.triangles].ravel()
    area = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    mean = normalised(np.stack([np.bincount(corner, area[:, k], place.max() + 1) for k in range(3)], axis=-1))[place]
    agrees = np.sum(mean * mesh.normals, axis=1) > _AGREE
    return np.where(agrees[:, None], mean, mesh.normals)


def _kind(kind: Kind | str) -> Kind:
    try:
        return Kind(kind)
    except ValueError:
        raise BadInput(f"kind must be one of {', '.join(Kind)}. Got '{kind}' instead.") from None


def _check(order: int, rays: int, bounces: int, seed: int) -> None:
    for name, value, low, high in (
        ("order", order, 1, MOST_BANDS), ("rays", rays, BATCHES, MOST_RAYS), ("bounces", bounces, 0, 100),
        ("seed", seed, 0, 2**63),
    ):  # fmt: skip
        if not low <= value <= high:
            raise BadInput(f"{name} must lie in [{low}, {high}]. Got {value} instead.")
