"""A mesh made ready for rays from its vertices, and their sums: what every simulation of transfer shares.

A vertex's own triangles.  Rays start from p + d M, d tiny (`_LIFT`) and M the mean normal of all triangles that meet at
p's place. Where the surface is convex about p, the solid about p lies below p's tangent plane, x.N <= 0 for all its
points p + x, since its normal N is a triangle's or a positive sum of those of several; and M.N > 0. A ray of direction
s has (d M + s t).N > 0, so that it never meets the solid: no triangle need be excluded, and none that rises from p in
truth (the walls of a groove, the other side of a crease) is. Starting on either side of one triangle's plane, as rays
from within a triangle do, would let half of p's triangles shadow it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry import mitsuba_mesh
from envbench import llvm
from envbench.arrays import components
from envbench.directions import Array, normalised
from envbench.geometry import TriangleMesh

BATCHES = 10
"""Independent sets that the rays of a vertex are drawn in: the standard error is that of the mean over them."""
LIFT = 2e-5
"""How far from a vertex its rays start, relative to the shape's radius: some 100 roundings of a coordinate."""
_AGREE = 0.1
"""Cosine between a vertex's own normal and the mean one of its place, below which its own is trusted."""
_LANES = 2**19
"""Batches in flight at a time: bounds the memory to n^2 floats for each."""
_GOLDEN = (sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class Casting:
    """A mesh made ready for Mitsuba: moved to the origin and scaled to radius 1, so that `LIFT` has a meaning.

    Attributes
    ----------
    starts, normals : (sides V, 3)
        Where rays start, and about which normal; of the second side, where there is one, after those of the first.
    facing : (F, 3)
        Normals of the triangles, of any length.
    radius : float
        What the mesh was divided by.
    """

    mi: Any
    scene: Any
    starts: Array
    normals: Array
    triangles: NDArray[np.int32]
    facing: Array
    sides: int
    radius: float

    @classmethod
    def of(cls, mesh: TriangleMesh, both_sides: bool = False, below: bool = False) -> Casting:
        """Return the mesh with rays from above its vertices, or from `below`; from both sides where asked for."""
        mi = llvm.mitsuba("llvm_ad_rgb")
        low, high = mesh.vertices.min(0), mesh.vertices.max(0)
        radius = float(np.linalg.norm(high - low) / 2)
        vertices = (mesh.vertices - (low + high) / 2) / radius
        placed = TriangleMesh(vertices, mesh.triangles, mesh.normals)
        a, b, c = (vertices[mesh.triangles[:, k]] for k in range(3))
        normals = np.concatenate([mesh.normals, -mesh.normals]) if both_sides else mesh.normals
        sides = 1 + both_sides
        up = _upwards(vertices, mesh)
        starts = np.tile(vertices, (sides, 1)) + (-LIFT if below else LIFT) * (
            np.concatenate([up, -up]) if both_sides else up
        )
        scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mi, placed)})
        return cls(mi, scene, starts, normals, mesh.triangles, np.cross(b - a, c - a), sides, radius)

    def averaged(
        self, order: int, per_batch: int, sums: Callable[[slice], Sequence[NDArray[np.float32]]]
    ) -> tuple[Array, Array]:
        """Return the mean over all rays of each start, (sides V, n^2), and the variance of that mean.

        `sums` gives the sums over the rays of each batch for a range of the starts: n^2 arrays (starts x BATCHES).
        """
        count = len(self.starts)
        mean, variance = np.empty((count, order**2)), np.empty((count, order**2))
        size = max(1, _LANES // BATCHES)
        for first in range(0, count, size):
            chosen = slice(first, min(first + size, count))
            batches = (np.stack(sums(chosen), axis=-1).astype(np.float64) / per_batch).reshape(-1, BATCHES, order**2)
            mean[chosen], variance[chosen] = batches.mean(1), batches.var(1, ddof=1) / BATCHES
        return mean, variance

    def rays(self, chosen: slice, per_batch: int, seed: int) -> tuple[int, Any, Callable[[Any], Any], Any]:
        """Return lanes, where each starts, its i-th direction about the normal, by the cosine, and how many there are.

        A batch's rays are a Kronecker lattice (i / m, i golden) under a random shift: one in each of m strata.
        """
        import drjit as dr

        mi = self.mi
        lanes = (chosen.stop - chosen.start) * BATCHES
        lane = dr.arange(mi.UInt32, lanes)
        vertex = lane // BATCHES
        start = dr.gather(mi.Point3f, components(mi.Point3f, self.starts[chosen]), vertex)
        frame = mi.Frame3f(dr.gather(mi.Vector3f, components(mi.Vector3f, self.normals[chosen]), vertex))
        a, b = mi.sample_tea_32(lane + dr.opaque(mi.UInt32, chosen.start * BATCHES), dr.opaque(mi.UInt32, seed), 6)
        shift = mi.Point2f(a >> 8, b >> 8) * 2.0**-24
        many = dr.opaque(mi.UInt32, per_batch)
        step = dr.rcp(mi.Float(many))

        def direction(i: Any) -> Any:
            u = mi.Point2f((mi.Float(i) + shift.x) * step, mi.Float(i) * _GOLDEN + shift.y)
            return frame.to_world(mi.warp.square_to_cosine_hemisphere(u - dr.floor(u)))

        return lanes, start, direction, many


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
