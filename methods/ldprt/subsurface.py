"""Diffuse transfer of light that scatters inside the shape: random walks through a homogeneous, index-matched medium.

The medium fills a closed mesh, scatters alike in all directions, and has the refractive index of what surrounds it, so
that light passes the surface straight on. What leaves at a vertex, averaged over directions by the cosine, is diffuse
exit radiance; traced backwards, each walk enters there by the cosine about -N, and ends in the direction s in which it
leaves the shape for good:

    t_lm = E[y_lm(s)],

walks that are absorbed counting 0. This is what Mitsuba's `volpath` estimates under one light; here every walk serves
all harmonics at once. Mitsuba casts the rays. A white medium returns all: constant light 1 gives 1.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.boundary import is_closed
from envbench.arrays import components
from envbench.errors import BadInput
from envbench.geometry import Geometry
from envbench.material import Medium
from methods.ldprt import basis
from methods.ldprt.casting import BATCHES, LIFT, Casting
from methods.ldprt.transfer import Kind, Transfer, check

MOST_STEPS = 20_000
"""Steps of a ray on average after which a batch ends unfinished: a medium this thick would take hours."""


def simulate(geometry: Geometry, order: int, medium: Medium, *, rays: int = 5000, seed: int = 0) -> Transfer:
    """Simulate diffuse transfer at each vertex of a closed mesh.

    Parameters
    ----------
    geometry : Geometry
        Its pose, if it has one, is not looked at.
    order : int
        n, the number of bands.
    medium : Medium
    rays : int
        Walks from each vertex; rounded up to a multiple of `BATCHES`.
    seed : int

    Raises
    ------
    BadInput
        For a shape without a closed mesh, a setting out of range, or a medium so thick that walks do not end.
    """
    started = time.perf_counter()
    mesh = geometry.rest.mesh
    if mesh is None or not is_closed(mesh):
        raise BadInput(
            f"light scatters inside a closed mesh, and '{geometry.name}' is none; close it, or give another."
        )
    check(order, rays, 0, seed)
    per_batch = -(-rays // BATCHES)
    walk = _Walk(Casting.of(mesh, below=True), medium)
    vectors, variance = walk.cast.averaged(order, per_batch, lambda chosen: walk.sums(order, per_batch, seed, chosen))
    taken = time.perf_counter() - started
    return Transfer(vectors, np.sqrt(variance), Kind.SUBSURFACE, per_batch * BATCHES, taken)


@dataclass(frozen=True, eq=False)
class _Walk:
    cast: Casting
    medium: Medium

    def sums(self, order: int, per_batch: int, seed: int, chosen: slice) -> list[NDArray[np.float32]]:
        """Return the sums over the walks of each batch, n^2 arrays (vertices x BATCHES).

        One loop takes a step of a walk at a time, and begins the next walk where one has ended.
        """
        import drjit as dr

        mi = self.cast.mi
        lanes, start, about_normal, many = self.cast.rays(chosen, per_batch, seed)
        facing = components(mi.Vector3f, self.cast.facing)
        path = dr.opaque(mi.Float, self.medium.mean_free_path / self.cast.radius)
        albedo = dr.opaque(mi.Float, self.medium.albedo)
        streams = np.uint64(chosen.start) * np.uint64(BATCHES)
        random = mi.PCG32(lanes, initstate=dr.opaque(mi.UInt64, seed), initseq=dr.opaque(mi.UInt64, int(streams)))

        def body(i: Any, step: Any, p: Any, d: Any, random: Any, sums: list[Any]) -> Any:
            found = self.cast.scene.ray_intersect_preliminary(mi.Ray3f(p, d))
            hit = found.is_valid()
            inside = hit & (dr.dot(dr.gather(mi.Vector3f, facing, found.prim_index, hit), d) > 0)
            free = -path * dr.log(1 - random.next_float32())
            event = inside & (free < found.t)
            absorbed = event & (random.next_float32() >= albedo)
            escaped = ~hit
            u = mi.Point2f(random.next_float32(), random.next_float32())
            value = basis.evaluate(order, d)
            sums = [s + dr.select(escaped, v, 0) for s, v in zip(sums, value, strict=True)]
            ended = escaped | absorbed
            i = dr.select(ended, i + 1, i)
            on = dr.select(event, free, found.t + LIFT)
            p = dr.select(ended, start, mi.Point3f(p + dr.select(hit, on, 0) * d))
            d = dr.select(ended, -about_normal(i), dr.select(event, mi.warp.square_to_uniform_sphere(u), d))
            return i, step + 1, p, d, random, sums

        first = dr.zeros(mi.UInt32, lanes)
        limit = dr.opaque(mi.UInt32, min(MOST_STEPS * per_batch, 2**32 - 1))
        sums = [dr.zeros(mi.Float, lanes) for _ in range(order**2)]
        state = (first, dr.zeros(mi.UInt32, lanes), start, -about_normal(first), random, sums)
        i, _, _, _, _, sums = dr.while_loop(
            state=state,
            cond=lambda i, step, *_: (i < many) & (step < limit),
            body=body,
            labels=("i", "step", "p", "d", "random", "sums"),
        )
        dr.eval(i, sums)
        if np.any(i.numpy() < per_batch):
            raise BadInput(
                f"walks of mean free path {self.medium.mean_free_path:g} do not end in a shape of radius "
                f"{self.cast.radius:g}; take a longer one, or a lower albedo."
            )
        return [s.numpy() for s in sums]
