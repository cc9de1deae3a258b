"""Light that scatters inside a shape, by random walks that look at the light where they end: for smooth light.

What leaves a point of a translucent shape, averaged over directions by the cosine, is its diffuse exit radiance. Each
walk follows light backwards through the same medium as `data_gen.mitsuba_volume`: it starts just inside, against a
direction drawn by the cosine about N, flies freely by the mean free path, scatters alike in all directions, passes the
surface straight on and may come in again. The direction in which it leaves the shape for good is that of the light:

    L = rho E[w E(s)],    w = albedo^events.

Light that comes straight through is a walk without an event. No walk looks at the light on its way, which is what a
path of `volpath` spends its time on; the price is noise under small lamps, which walks find by chance. In a white
medium constant light has no noise at all. The parts of a signed light share their walks.

Each walk's first numbers are those of a Kronecker lattice under a random shift, one for each point. One loop takes a
step of a walk at a time and begins the next walk where one has ended, so that short walks do not wait for long ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.lattice import ROUNDS
from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_paths import shared
from data_gen.mitsuba_place import laid_out
from data_gen.mitsuba_volume import MOST_EVENTS
from envbench import llvm
from envbench.arrays import components
from envbench.directions import Array
from envbench.errors import BadInput
from envbench.geometry import Points, TriangleMesh
from envbench.material import Medium

_LEAST = 0.25
"""Weight below which walks are absorbed by Russian roulette instead of dimmed."""
_AT_A_TIME = 2**18
"""Walks in flight: many more than a machine has lanes, and few enough for each lane to take several."""
_LATTICE = [round(2**32 * 1.1127756842787055**-k) for k in range(1, 7)]
"""The powers of the root of x^7 = x + 1, as fractions of 2^32: of a Kronecker lattice in six dimensions."""


@dataclass(frozen=True, eq=False)
class Walk(Estimator):
    """Radiance that leaves a translucent shape: the lobes' reflectance times what comes out of its medium.

    Carried (`Surface.carried`): walks are followed in the shape at rest, and the light is looked up where they end,
    turned along with the point. Not for scalar variants.
    """

    sample_lobes: bool = False

    @property
    def order(self) -> float:
        return 0.5

    @property
    def rays(self) -> int:
        """Walks followed for each sample, whatever rays they take."""
        return 1

    @cached_property
    def _filled(self) -> tuple[TriangleMesh, Medium]:
        mesh, medium = self.surface.occluder, self.surface.material.medium
        if mesh is None or medium is None:
            raise BadInput(f"light scatters in a medium that fills a mesh; '{self.surface.material.name}' lacks it.")
        return mesh, medium

    @cached_property
    def _facing(self) -> Any:
        """Give the normals of the triangles, of any length."""
        mesh, _ = self._filled
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        mi = llvm.mitsuba(self.surface.variant)
        return components(mi.Vector3f, np.cross(b - a, c - a))

    def _summed(
        self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int, estimates: Callable[..., Any]
    ) -> Array:
        """Return the sums over the samples of the `chosen` points, (1, n, 3): all `estimates` are the same one."""
        import drjit as dr

        walk = dr.arange(mi.UInt32, len(chosen) * samples)
        left = self._left(mi, points, chosen, samples, seed)
        weight = dr.norm(left)
        place = self._place(mi, points, laid_out(mi, chosen, walk // dr.opaque(mi.UInt32, samples)))
        seen = dr.zeros(mi.SurfaceInteraction3f)
        seen.wi = -place.posed(mi, left / dr.maximum(weight, 1e-30))
        light = mi.Color3f(0)
        for sign, scene in self._scenes:
            light += sign * scene.environment().eval(seen)
        reflectance = np.sum([lobe.reflectance for lobe in self.surface.material.lobes], axis=0)
        light = dr.select(weight > 0, light * weight, 0) * mi.Color3f(*(float(r) for r in reflectance))
        dr.eval(light)
        return np.array([[dr.block_sum(mi.Float64(c), samples).numpy() for c in light]]).swapaxes(1, 2)

    def _left(self, mi: Any, points: Points, chosen: NDArray[np.int_], samples: int, seed: int) -> Any:
        """Return the direction in which each walk has left the shape at rest, as long as its weight."""
        import drjit as dr

        mesh, medium = self._filled
        each = shared(len(chosen), samples, _AT_A_TIME)
        lane = dr.arange(mi.UInt32, len(chosen) * each)
        point = lane // dr.opaque(mi.UInt32, each)
        place = self._place(mi, points, laid_out(mi, chosen, point))
        frame = mi.Frame3f(-place.normal)
        many = dr.opaque(mi.UInt32, samples // each)
        first = lane * many
        path, albedo = (dr.opaque(mi.Float, v) for v in (medium.mean_free_path, medium.albedo))
        lift = place.lift
        start = mi.Point3f(place.position - lift * place.geometric)
        low, high = mi.Point3f(mesh.vertices.min(0)), mi.Point3f(mesh.vertices.max(0))
        dr.make_opaque(low, high)
        scene, facing, white = self.scene, self._facing, medium.albedo == 1
        low_discrepancy = _lattice(mi, point, dr.opaque(mi.UInt32, seed))
        out = dr.zeros(mi.Vector3f, len(chosen) * samples)
        dr.eval(out, facing)

        def direction(u: Any, v: Any, starts: Any) -> Any:
            """Return a direction by the cosine about -N where a walk starts, elsewhere any."""
            z = dr.select(starts, dr.safe_sqrt(1 - u), 1 - 2 * u)
            sine, cosine = dr.sincos(2 * dr.pi * v)
            r = dr.safe_sqrt(1 - z * z)
            return frame.to_world(mi.Vector3f(r * cosine, r * sine, z))

        def body(k: Any, steps: Any, p: Any, d: Any, inside: Any, drawn: Any, weight: Any, random: Any) -> Any:
            fresh = random.next_float32()
            free = -path * dr.log(1 - dr.select(drawn < 0, fresh, drawn))
            ray = mi.Ray3f(p, d, dr.select(inside, free, dr.inf), 0, [])
            found = scene.ray_intersect_preliminary(ray, coherent=False)
            hit = found.is_valid()
            outwards = dr.dot(dr.gather(mi.Vector3f, facing, found.prim_index, hit), d) > 0
            event = dr.select(hit, outwards & (free < found.t), inside)
            left = ~hit & ~inside
            p = mi.Point3f(p + dr.select(event, free, dr.select(hit, found.t + lift, 0)) * d)
            inside = event | (hit & ~outwards)
            left |= inside & dr.any((p < low) | (p > high))  # slipped out between two triangles
            dr.scatter(out, d * weight, first + k, left)
            ended = left | (steps >= MOST_EVENTS)
            if not white:
                few = weight < _LEAST
                ended |= event & few & (random.next_float32() >= albedo)
                weight = dr.select(ended, 1, dr.select(event & ~few, weight * albedo, weight))
            k = dr.select(ended, k + 1, k)
            early = ended | (event & (steps == 0))
            u, v, drawn = low_discrepancy(first + k, ended)
            u = dr.select(early, u, random.next_float32())
            v = dr.select(early, v, random.next_float32())
            d = dr.select(event | ended, direction(u, v, ended), d)
            p = mi.Point3f(dr.select(ended, start, p))
            steps = dr.select(ended, 0, steps + dr.select(event, 1, 0))
            return k, steps, p, d, inside & ~ended, dr.select(early, drawn, -1), weight, random

        begin = dr.full(mi.Bool, True, len(lane))
        u, v, drawn = low_discrepancy(first, begin)
        zero = dr.zeros(mi.UInt32, len(lane))
        state, sequence = mi.sample_tea_32(lane, dr.opaque(mi.UInt32, seed), ROUNDS)
        random = mi.PCG32(len(lane), mi.UInt64(state), mi.UInt64(sequence))
        weight = dr.full(mi.Float, 1, len(lane))
        done = dr.while_loop(
            state=(zero, mi.UInt32(zero), start, direction(u, v, begin), ~begin, drawn, weight, random),
            cond=lambda k, *_: k < many,
            body=body,
            labels=("k", "steps", "p", "d", "inside", "drawn", "weight", "random"),
        )
        dr.eval(done[0], out)
        return out


def _lattice(mi: Any, point: Any, seed: Any) -> Callable[[Any, Any], Any]:
    """Return a function of a walk: its three numbers of the start, or of the first event, under its point's shift."""
    import drjit as dr

    shifts = [s for k in range(3) for s in mi.sample_tea_32(point, seed ^ (0x9E3779B9 * (k + 1) & 0xFFFFFFFF), ROUNDS)]

    def numbers(walk: Any, starts: Any) -> Any:
        return tuple(
            mi.Float((dr.select(starts, *(shifts[j] + walk * _LATTICE[j] for j in (k, k + 3)))) >> 8) * 2.0**-24
            for k in range(3)
        )

    return numbers
