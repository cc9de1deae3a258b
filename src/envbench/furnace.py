"""The furnace: what constant light of radiance 1 reflects, by quadrature, and how much of it clipping takes away.

About a lobe's centre C a direction is (theta, phi), phi = 0 towards N. Where the lobe is clipped, N.L > 0 is |phi| < a
with cos a = -cot(theta) cot(theta_n): in (theta, phi / a) the horizon is a border, and no cell is cut by it. Cells are
split until each holds few directions of those that the lobe's own sampler draws, so that none hides a narrow peak, and
then until the integral over a cell is that over its quarters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, normalised, perpendicular
from envbench.geometry import Points
from envbench.material import Lobe, Material
from envbench.scene import Scene

SAMPLED_POINTS = 24
TOLERANCE = 2e-7
"""Change at which a cell is left as it is, relative to the lobe's integral."""
_BLOCK = 64
"""Points worked on at a time: bounds the memory."""
_DRAWS, _FEW = 512, 16
_DRAWN_DEPTH, _DEPTH = 9, 10
_NODES = 6
_BELOW_ONE = 1 - 1e-12


def clipping(scene: Scene) -> str | None:
    """Say in one line what clipping the lobes at the horizon takes away at the points of a scene, or None."""
    points = scene.points.spread(SAMPLED_POINTS)
    cut = [lobe for lobe in scene.material.lobes if lobe.clipped and not lobe.radially_symmetric]
    if not any(_reaches_below(replace(lobe, clipped=False), points) for lobe in cut):
        return None
    whole = replace(scene.material, lobes=tuple(replace(lobe, clipped=False) for lobe in scene.material.lobes))
    kept, all_ = (lobe_integrals(material, points).sum(-1) for material in (scene.material, whole))
    kept = np.where(all_ > 0, kept / np.where(all_ > 0, all_, 1), 1)
    return (
        f"lobes are clipped at the horizon: under constant light they reflect {1 - kept.mean():.2%} less than whole"
        f" ({1 - kept.min():.0%} less at the worst of {len(points)} points)"
    )


def lobe_integrals(material: Material, points: Points) -> Array:
    """Return what constant light of radiance 1 reflects at the points, (n, 3), the texture apart."""
    out = np.zeros((len(points), 3))
    for start in range(0, len(points), _BLOCK):
        block = slice(start, start + _BLOCK)
        for lobe in material.lobes:
            centre, view, normal = points.central(lobe.centre)[block], points.view[block], points.normal[block]
            out[block] += _Integrand.of(lobe, centre, view, normal).integrals()
    return out


def _reaches_below(lobe: Lobe, points: Points) -> bool:
    """Tell whether the lobe's own draws find it below the horizon of a point."""
    centre, view, normal = points.central(lobe.centre), points.view, points.normal
    light, axes = _drawn(lobe, centre, view, normal)
    value = np.sum(lobe.evaluate(light, *axes), axis=0)
    return bool(np.any((value > 0) & (np.einsum("ck,ck->k", light, axes[2]) < 0)))


def _drawn(lobe: Lobe, centre: Array, view: Array, normal: Array) -> tuple[Any, tuple[Array, Array, Array]]:
    """Return draws of the lobe, (3, n * _DRAWS), and view, centre and normal at each."""
    axes = tuple(np.repeat(v, _DRAWS, axis=0).T for v in (view, centre, normal))
    k = np.tile(np.arange(1, _DRAWS + 1), len(view))
    u = k * 0.7548776662466927 % 1, k * 0.5698402909980532 % 1  # Roberts's R2 sequence
    return np.stack(np.broadcast_arrays(*lobe.sample(u, *axes))), (axes[0], axes[1], axes[2])


@dataclass(frozen=True)
class _Cells:
    """Rectangles (k,) of (s, t) in [0, 1]^2 in a strip: theta = lo + (hi - lo) sin^2(pi s / 2), phi = a (2 t - 1)."""

    strip: NDArray[np.int_]
    s: Array
    t: Array
    width: Array
    height: Array

    def __getitem__(self, chosen: NDArray[np.bool_]) -> _Cells:
        return _Cells(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def split(self, ways: int) -> _Cells:
        """Return the quarters of each cell one after another, (4 k,), or for two `ways` its halves in s."""
        offsets = ([0, 1], [0, 0]) if ways == 2 else ([0, 0, 1, 1], [0, 1, 0, 1])
        right, up = (np.tile(offset, len(self.s)) for offset in offsets)
        strip, s, t, width, height = (np.repeat(getattr(self, field.name), ways) for field in fields(self))
        width, height = width / 2, height * 2 / ways
        return _Cells(strip, s + right * width, t + up * height, width, height)

    @classmethod
    def joined(cls, parts: Sequence[_Cells]) -> _Cells:
        """Return the cells of all parts."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


@dataclass(frozen=True)
class _Integrand:
    """A lobe about its centre at n points.

    `frames` (n, 3, 3) holds the rows x, y, C; `slope` (n,) is theta_n, or -1 where a = pi everywhere. A strip is a
    range of theta, between two of the `edges` (n, 4), on which a is smooth: `point` and `part` (strips,) say which. A
    lobe that does not depend on phi is split in theta alone, two `ways` instead of four.
    """

    lobe: Lobe
    frames: Array
    view: Array
    normal: Array
    ways: int
    slope: Array
    edges: Array
    point: NDArray[np.int_]
    part: NDArray[np.int_]

    @classmethod
    def of(cls, lobe: Lobe, centre: Array, view: Array, normal: Array) -> _Integrand:
        along = np.sum(normal * centre, axis=-1, keepdims=True)
        x = normal - along * centre
        across = np.linalg.norm(x, axis=-1, keepdims=True)
        x = np.where(across > 1e-9, normalised(x), perpendicular(centre))
        x = normalised(x - np.sum(x * centre, axis=-1, keepdims=True) * centre)
        frames = np.stack([x, np.cross(centre, x), centre], axis=1)
        ways = 2 if lobe.azimuthally_symmetric else 4
        slope = np.arctan2(across, along)[:, 0] if lobe.clipped and ways == 4 else np.full(len(view), -1.0)
        first = np.where(slope < 0, np.pi, np.abs(np.pi / 2 - slope))
        edges = np.stack([0 * first, first, np.maximum(np.pi - first, first), 0 * first + np.pi], axis=1)
        lit = edges[:, 1:] - edges[:, :-1] > 1e-12
        lit[:, 0] &= slope < np.pi / 2  # C itself is above the horizon
        lit[:, 2] &= slope > np.pi / 2
        return cls(lobe, frames, view, normal, ways, slope, edges, *np.nonzero(lit))

    def integrals(self) -> Array:
        """Return the integral over all of a point's strips, (n, 3)."""
        out = np.zeros((len(self.view), 3))
        cells = self._by_draws()
        values = self._over(cells)
        np.add.at(out, self.point[cells.strip], values)
        scale = TOLERANCE * out.max(-1)
        out[:] = 0
        for depth in range(_DEPTH + 1):
            finer = cells.split(self.ways)
            parts = self._over(finer).reshape(-1, self.ways, 3)
            point = self.point[cells.strip]
            off = np.abs(parts.sum(1) - values).max(-1) > scale[point]
            done = ~off | (depth == _DEPTH)
            np.add.at(out, point[done], parts[done].sum(1))
            if done.all():
                break
            cells, values = finer[np.repeat(~done, self.ways)], parts[~done].reshape(-1, 3)
        return out

    def _over(self, cells: _Cells) -> Array:
        """Integrate over each cell by a Gauss-Legendre rule, (k, 3)."""
        x, w = np.polynomial.legendre.leggauss(_NODES)
        x, w = (x + 1) / 2, w / 2
        s = cells.s[:, None, None] + cells.width[:, None, None] * x[:, None]
        t = cells.t[:, None, None] + cells.height[:, None, None] * x
        point, strip = self.point[cells.strip], cells.strip[:, None, None]
        low, high = self._range(strip)
        width = high - low
        theta = low + width * np.sin(np.pi / 2 * s) ** 2
        limit = self._limit(theta, self.slope[point][:, None, None])
        phi = limit * (2 * t - 1)
        sine = np.sin(theta)
        local = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)))
        light: Any = np.einsum("lkij,klc->ckij", local, self.frames[point], optimize=True)
        axes = (v[point].T[..., None, None] for v in (self.view, self.frames[:, 2], self.normal))
        jacobian = sine * 2 * limit * width * (np.pi / 2) * np.sin(np.pi * s)
        weight = jacobian * w[:, None] * w * (cells.width * cells.height)[:, None, None]
        values = self.lobe.evaluate(light, *axes)
        return np.stack([(v * weight).sum((1, 2)) for v in values], axis=-1)

    def _limit(self, theta: Array, slope: Array) -> Array:
        """Return a in [0, pi]: N.L = cos(theta) cos(theta_n) + sin(theta) sin(theta_n) cos(phi) > 0 for |phi| < a."""
        across = np.maximum(np.sin(theta) * np.sin(slope), 1e-300)
        bounded = np.arccos(np.clip(-np.cos(theta) * np.cos(slope) / across, -1, 1))
        return np.where(slope < 0, np.pi, bounded)

    def _by_draws(self) -> _Cells:
        """Split the strips until each cell holds few draws."""
        count = len(self.point)
        cells = _Cells(np.arange(count), np.zeros(count), np.zeros(count), np.ones(count), np.ones(count))
        strip, s, t = self._coordinates()
        t = t if self.ways == 4 else 0 * t
        leaves: list[_Cells] = []
        for depth in range(_DRAWN_DEPTH):
            number = 2**depth
            places = [
                (of * number + (number * x).astype(int)) * number + (number * y).astype(int)
                for of, x, y in ((strip, s, t), (cells.strip, cells.s, cells.t))
            ]
            found, draws = np.unique(np.concatenate(places), return_counts=True)  # a cell counts as a draw in itself
            many = draws[np.searchsorted(found, places[1])] > _FEW
            leaves.append(cells[~many])
            cells = cells[many].split(self.ways)
        return _Cells.joined([*leaves, cells])

    def _coordinates(self) -> tuple[NDArray[np.int_], Array, Array]:
        """Return strip, s and t of the directions that the lobe's sampler draws at the points."""
        light, _ = _drawn(self.lobe, self.frames[:, 2], self.view, self.normal)
        point = np.repeat(np.arange(len(self.view)), _DRAWS)
        x, y, z = np.einsum("ck,klc->lk", light, self.frames[point], optimize=True)
        theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
        limit = self._limit(theta, self.slope[point])
        part = (theta >= self.edges[point, 1]).astype(int) + (theta >= self.edges[point, 2])
        strips = np.full(self.edges[:, 1:].shape, -1)
        strips[self.point, self.part] = np.arange(len(self.point))
        strip = strips[point, part]
        alive = (np.sum(light**2, axis=0) > 0.5) & (np.abs(phi) < limit) & (strip >= 0)
        strip, theta, across = strip[alive], theta[alive], phi[alive] / limit[alive]
        low, high = self._range(strip)
        s = np.arcsin(np.sqrt(np.clip((theta - low) / (high - low), 0, 1))) * 2 / np.pi
        return strip, np.minimum(s, _BELOW_ONE), np.minimum((across + 1) / 2, _BELOW_ONE)

    def _range(self, strip: NDArray[np.int_]) -> tuple[Array, Array]:
        """Return the ends of strips in theta."""
        point, part = self.point[strip], self.part[strip]
        return self.edges[point, part], self.edges[point, part + 1]
