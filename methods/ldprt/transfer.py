"""Diffuse transfer vectors at the vertices of a shape at rest, simulated with Mitsuba's rays.

The transfer vector t of a vertex is what it sends out, for reflectance 1, of each spherical harmonic shone as light
(Sloan, Luna and Snyder 2005, sec. 2): exit radiance = t . e. With directions s drawn by the cosine about its normal,

    t_lm = int V(s) max(N.s, 0) / pi y_lm(s) ds = E[V(s) y_lm(s)],

V being 0 where the shape itself is in the way. What is in the way sends light on: each bounce gathers, along fresh
rays, the transfer vectors of the bounce before, interpolated over the triangle that is hit, times albedo.
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
from envbench.arrays import components
from envbench.directions import Array
from envbench.errors import BadInput
from envbench.geometry import Geometry
from methods.ldprt import basis, membrane
from methods.ldprt.casting import BATCHES, Casting

MOST_RAYS = 10**6
MOST_BANDS = 16


class Kind(StrEnum):
    """What transfer accounts for."""

    UNSHADOWED = "unshadowed"
    SHADOWED = "shadowed"
    INTERREFLECTED = "interreflected"
    SUBSURFACE = "subsurface"
    """`methods.ldprt.subsurface` simulates it."""


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
    check(order, rays, bounces, seed)
    share = np.broadcast_to(np.asarray(albedo, float), len(mesh.vertices))
    if not ((share >= 0) & (share <= 1)).all():
        raise BadInput(f"albedo must lie in [0, 1]. Got {share.min():g} to {share.max():g} instead.")
    if kind is Kind.UNSHADOWED or geometry.convex:
        vectors = membrane.transfer(mesh.normals, order)
        return Transfer(vectors, np.zeros_like(vectors), kind, 0, time.perf_counter() - started)

    per_batch = -(-rays // BATCHES)
    passes = 1 + (bounces if kind is Kind.INTERREFLECTED else 0)
    gather = _Gather(Casting.of(mesh, both_sides=passes > 1 and not is_closed(mesh)))
    states = np.random.SeedSequence(seed).generate_state(passes)
    light, variance = gather.light(order, per_batch, int(states[0]), None)
    vectors = light
    for state in states[1:]:
        sent = np.tile(share, gather.cast.sides)[:, None] * light
        light, more = gather.light(order, per_batch, int(state), sent)
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
class _Gather:
    """The passes of a simulation: light where nothing is in the way, then what comes from what is."""

    cast: Casting

    def light(self, order: int, per_batch: int, seed: int, sent: Array | None) -> tuple[Array, Array]:
        """Return what a pass gathers, (sides V, n^2), and the variance of that.

        Parameters
        ----------
        sent : (sides V, n^2) or None
            What the vertices send out of the bounce before; None for the light itself, where nothing is in the way.
        """
        surface = None if sent is None else self._surface(sent)
        return self.cast.averaged(order, per_batch, lambda chosen: self._sums(order, per_batch, seed, chosen, surface))

    def _sums(
        self, order: int, per_batch: int, seed: int, chosen: slice, surface: tuple[Any, Any, Any] | None
    ) -> list[NDArray[np.float32]]:
        """Return the sums over the rays of each batch, n^2 arrays (vertices x BATCHES): a lane and loop each."""
        import drjit as dr

        mi = self.cast.mi
        lanes, start, direction_of, many = self.cast.rays(chosen, per_batch, seed)

        def body(i: Any, sums: list[Any]) -> tuple[Any, list[Any]]:
            direction = direction_of(i)
            ray = mi.Ray3f(start, direction)
            if surface is None:
                seen = ~self.cast.scene.ray_test(ray)
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

        mi, (corners, facing, sent) = self.cast.mi, surface
        found = self.cast.scene.ray_intersect_preliminary(ray)
        hit = found.is_valid()
        behind = dr.dot(dr.gather(mi.Vector3f, facing, found.prim_index, hit), ray.d) > 0
        if self.cast.sides == 1:
            hit &= ~behind  # the inside of a closed shape is dark
            place = mi.UInt32(0)
        else:
            place = dr.select(behind, mi.UInt32(len(self.cast.starts) // 2), mi.UInt32(0))
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
        mi = self.cast.mi
        return (
            mi.UInt32(self.cast.triangles.astype(np.uint32).ravel()),
            components(mi.Vector3f, self.cast.facing),
            mi.Float(sent.astype(np.float32).ravel()),
        )


def _kind(kind: Kind | str) -> Kind:
    known = [entry for entry in Kind if entry is not Kind.SUBSURFACE]
    if kind not in known:
        raise BadInput(f"kind must be one of {', '.join(known)}. Got '{kind}' instead.")
    return Kind(kind)


def check(order: int, rays: int, bounces: int, seed: int) -> None:
    """Raise `BadInput` for a setting out of range."""
    for name, value, low, high in (
        ("order", order, 1, MOST_BANDS), ("rays", rays, BATCHES, MOST_RAYS), ("bounces", bounces, 0, 100),
        ("seed", seed, 0, 2**63),
    ):  # fmt: skip
        if not low <= value <= high:
            raise BadInput(f"{name} must lie in [{low}, {high}]. Got {value} instead.")
