"""The second reference: deterministic adaptive quadrature in float64, independent of Mitsuba and of harmonics.

At a point of a convex shape the reflected radiance is B = sum over lobes of the integral of L(w) rho_hat(w) over the
sphere. L is bilinear in (theta, phi) on the cells between pixel centres (`envbench.latlong`), so that on each cell
the integrand L rho_hat sin(theta) is as smooth as the lobe:

1. every cell gets the 2 x 2 Gauss-Legendre rule, whose nodes and radiance are shared by all queries;
2. a cell on which the lobe varies too much for the rule is split into 2 x 2, again and again;
3. a cell that the horizon N.L = 0 crosses, where a clipped lobe jumps, is cut exactly along it: at each phi the
   horizon is one polar angle theta_c(phi), and theta is integrated up to it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from data_gen.lobes import Membrane
from data_gen.texture import transparency
from envbench.arrays import dot
from envbench.directions import Array, from_angles, perpendicular, to_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.material import Lobe
from envbench.scene import Scene

TOLERANCE = 1e-8
"""Estimated error at which a cell is left whole, relative to the mean (absolute) radiance of the light."""
_TAIL = 1e-9
"""Part of a lobe that may lie outside the cone that is integrated."""
_BLOCK = 8192
"""Cells worked on at a time: their arrays stay in the processor's cache."""
_CELLS = 6
"""A cell is at most this part of the cone that holds half of the lobe, so that none hides between the nodes."""
_SLOPES = 4.0
"""Nor is it wider than this over the lobe's log-slope where steep, so that no narrow peak in a wide lobe hides."""
_DRAWS, _STEEP = 1024, 0.998
"""Directions drawn from the lobe at a query, and the quantile of their log-slopes that counts as steep."""
_DEPTH = 20
_STEP = 1e-6
_NODES = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)  # Gauss-Legendre on [0, 1], both weights 1/2


def integrate(scene: Scene, indices: ArrayLike | None = None, *, tolerance: float = TOLERANCE) -> Array:
    """Integrate the reflected radiance at the points of a convex scene.

    Parameters
    ----------
    scene : Scene
    indices : (n,) int, optional
        The points to answer; all of them if not given.
    tolerance : float
        See `TOLERANCE`; halving it until nothing changes is the test of convergence.

    Returns
    -------
    (n, 3) float64

    Raises
    ------
    BadInput
        The shape is not convex: what the light reaches then depends on visibility.
    """
    if not scene.geometry.posed.convex:
        raise BadInput(
            f"quadrature needs a convex shape, and '{scene.geometry.name}' is not; use the Mitsuba reference."
        )
    points, environment = scene.points, scene.environment
    chosen = np.arange(len(points)) if indices is None else np.asarray(indices, int)
    total = np.zeros((len(chosen), 3))
    scale = tolerance * sum(float(part.mean.sum()) for _, part in environment.parts)
    if scale == 0:
        return total
    for lobe, share in _shares(scene, chosen):
        frames = np.stack([points.view, points.central(lobe.centre), points.normal], axis=1)[chosen]
        sizes = np.minimum(lobe.cone(0.5) / _CELLS, _SLOPES / np.maximum(_slopes(lobe, frames), 1e-300))
        work = partial(_block_integrals, environment, lobe, frames, sizes, scale)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for part in pool.map(work, _blocks(environment)):  # in order: the sum is deterministic
                total += share * part
    return total if points.modulation is None else total * points.modulation[chosen]


def _shares(scene: Scene, chosen: NDArray[np.int_]) -> Iterator[tuple[Lobe, Array | float]]:
    """Yield lobes, and what each counts at the points: (n, 1), or 1 at all of them.

    A membrane is linear in its transparency: under a map it is its own two extremes, blended.
    """
    map_ = scene.material.transparency
    for lobe in scene.material.lobes:
        if map_ is None or not isinstance(lobe, Membrane):
            yield lobe, 1.0
            continue
        alpha = transparency(map_, scene.points.uv)[chosen, None]
        yield replace(lobe, transparency=0.0), 1 - alpha
        yield replace(lobe, transparency=1.0), alpha


@dataclass(frozen=True)
class _Cells:
    """Rectangles in (theta, phi), (k,) each."""

    theta0: Array
    theta1: Array
    phi0: Array
    phi1: Array

    def __getitem__(self, chosen: NDArray[np.bool_]) -> _Cells:
        return _Cells(self.theta0[chosen], self.theta1[chosen], self.phi0[chosen], self.phi1[chosen])

    def split(self) -> _Cells:
        """Return the four quarters of every cell."""
        theta, phi = (self.theta0 + self.theta1) / 2, (self.phi0 + self.phi1) / 2
        return _Cells(
            np.concatenate([self.theta0, self.theta0, theta, theta]),
            np.concatenate([theta, theta, self.theta1, self.theta1]),
            np.concatenate([self.phi0, phi, self.phi0, phi]),
            np.concatenate([phi, self.phi1, phi, self.phi1]),
        )


@dataclass(frozen=True)
class _Rule:
    """Cells with the nodes of their 2 x 2 rule.

    `light` (3, 4, k): the directions; `energy` (3, 4, k): radiance times sin(theta) d theta d phi; `centre` (3, k) and
    `radius` (k,): the cap around each cell.
    """

    cells: _Cells
    light: Array
    energy: Array
    centre: Array
    radius: Array

    @classmethod
    def of(cls, cells: _Cells, environment: Environment) -> _Rule:
        height, width = cells.theta1 - cells.theta0, cells.phi1 - cells.phi0
        theta = cells.theta0 + np.repeat(_NODES, 2)[:, None] * height
        phi = cells.phi0 + np.tile(_NODES, 2)[:, None] * width
        light = from_angles(theta, phi)
        energy = environment(light) * (np.sin(theta) * (height * width / 4))[..., None]
        middle = (cells.theta0 + cells.theta1) / 2
        centre = from_angles(middle, (cells.phi0 + cells.phi1) / 2)
        widest = np.sin(np.clip(np.pi / 2, cells.theta0, cells.theta1)) * width / 2
        return cls(cells, _first(light), _first(energy), _first(centre), height / 2 + widest)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> _Rule:
        if chosen.all():
            return self
        parts = (self.light, self.energy, self.centre, self.radius)
        return _Rule(self.cells[chosen], *(part[..., chosen] for part in parts))


def _first(values: Array) -> Array:
    """Move the components from the last axis to the first, contiguously."""
    return np.ascontiguousarray(np.moveaxis(values, -1, 0))


def _inner(value: Array, energy: Array) -> Array:
    """Sum over nodes and cells, (3,); without BLAS, whose own threads would crowd out those of the blocks."""
    return np.einsum("ck,ck->c", value.reshape(3, -1), energy.reshape(3, -1))


def _blocks(environment: Environment) -> Iterator[_Rule]:
    """Yield the cells of the whole sphere, some rows at a time."""
    height, columns = environment.radiance.shape[:2]
    theta = np.concatenate([[0.0], np.pi * (np.arange(height) + 0.5) / height, [np.pi]])
    # with an odd number of columns, half-turned knots (the polar cells) fall between columns
    count = columns * (1 + columns % 2)
    phi = 2 * np.pi * (0.5 / columns + np.arange(count + 1) / count)
    rows = max(1, _BLOCK // count)
    for start in range(0, len(theta) - 1, rows):
        edges = theta[start : start + rows + 1]
        theta0, phi0 = np.meshgrid(edges[:-1], phi[:-1], indexing="ij")
        theta1, phi1 = np.meshgrid(edges[1:], phi[1:], indexing="ij")
        yield _Rule.of(_Cells(theta0.ravel(), theta1.ravel(), phi0.ravel(), phi1.ravel()), environment)


def _slopes(lobe: Lobe, frames: Array) -> Array:
    """Return how steep the lobe is at each query: a high quantile of |grad log rho_hat| over its own draws, (n,)."""
    k = np.arange(1, _DRAWS + 1)
    u = k * 0.7548776662466927 % 1, k * 0.5698402909980532 % 1  # Roberts's R2 sequence
    result = np.zeros(len(frames))
    for i, frame in enumerate(frames):
        view, centre, normal = (np.broadcast_to(v[:, None], (3, _DRAWS)) for v in frame)
        light = np.stack(np.broadcast_arrays(*lobe.sample(u, view, centre, normal)))
        first = perpendicular(light.T).T
        value = np.sum(lobe.evaluate(light, view, centre, normal), axis=0)
        square = np.zeros(_DRAWS)
        for across in (first, np.cross(light, first, axis=0)):
            ends = [
                np.sum(lobe.evaluate(light + sign * _STEP * across, view, centre, normal), axis=0) for sign in (-1, 1)
            ]
            square += ((ends[1] - ends[0]) / (2 * _STEP)) ** 2
        found = value > 0
        if found.any():
            result[i] = np.quantile(np.sqrt(square[found]) / value[found], _STEEP)
    return result


def _block_integrals(
    environment: Environment, lobe: Lobe, frames: Array, sizes: Array, scale: float, rule: _Rule
) -> Array:
    """Return the block's part of every query's integral, (n, 3).

    `frames` (n, 3, 3) holds view, centre and normal, `sizes` (n,) the largest cells.
    """
    whole, cone = replace(lobe, clipped=False), lobe.cone(_TAIL)
    top, bottom = rule.cells.theta0.min(), rule.cells.theta1.max()
    alpha, _ = to_angles(frames[:, 1])
    result = np.zeros((len(frames), 3))
    for i in np.flatnonzero((alpha + cone >= top) & (alpha - cone <= bottom)):
        view, centre, normal = frames[i]
        query = _Query(environment, whole, view, centre, normal, cone, lobe.clipped, scale, sizes[i])
        result[i] = query.integral(rule)
    return result


@dataclass(frozen=True)
class _Query:
    """One lobe at one point."""

    environment: Environment
    whole: Lobe
    view: Array
    centre: Array
    normal: Array
    cone: float
    clipped: bool
    scale: float
    size: float

    def integral(self, rule: _Rule, depth: int = 0) -> Array:
        """Integrate over the rule's cells, splitting those on which the lobe is not resolved."""
        near = dot(self.centre, rule.centre) >= np.cos(np.minimum(self.cone + rule.radius, np.pi))
        height = dot(self.normal, rule.centre)
        reach = np.sin(np.minimum(rule.radius, np.pi / 2))
        if self.clipped:
            near &= height >= -reach
        if not near.any():
            return np.zeros(3)
        rule = rule[near]
        value = np.stack(self.whole.evaluate(rule.light, self.view, self.centre, self.normal))
        leaf = (rule.radius <= self.size) & self._resolved(value, rule.energy) | (depth == _DEPTH)
        total = np.zeros(3)
        if not leaf.all():
            total += self.integral(_Rule.of(rule.cells[~leaf].split(), self.environment), depth + 1)
        if self.clipped:
            cut = leaf & (np.abs(height) <= reach)[near]  # at most crossed: the cut is exact for any cell
            total += self._cut(rule.cells[cut])
            leaf &= ~cut
        value *= leaf
        return total + _inner(value, rule.energy)

    def _resolved(self, value: Array, energy: Array) -> NDArray[np.bool_]:
        """Tell the cells whose estimated error is small, (k,).

        Where f varies by the part r of its maximum over the nodes, f ~ exp(x) on a scale of 1/r cells, and the rule's
        relative error per dimension is r^4 / 4320 times the twelve-fold that a Gaussian's fourth derivative reaches
        and (sqrt 3)^4 from nodes to edges: about r^4 / 40.
        """
        value, energy = value.sum(0), energy.sum((0, 1)) / 3
        most, least = value.max(0), value.min(0)
        spread = (most - least) ** 2
        return spread * spread * energy <= 40 * self.scale * most**3

    def _limit(self, phi: Array) -> Array:
        """Return theta_c in [0, pi] where N.L = nz cos(theta) + nr cos(phi - phi_n) sin(theta) vanishes."""
        nx, ny, nz = self.normal
        along = nx * np.cos(phi) + ny * np.sin(phi)
        return np.arctan2(abs(nz), -along if nz >= 0 else along)

    def _cut(self, cells: _Cells) -> Array:
        """Integrate over the parts of the cells above the horizon.

        The horizon enters and leaves a cell through its sides, or through theta0 and theta1 at
        cos(phi - phi_n) = -nz cot(theta) / nr: between these azimuths the integral over theta is smooth in phi.
        """
        nx, ny, nz = self.normal
        breaks = [cells.phi0, cells.phi1]
        for theta in (cells.theta0, cells.theta1):
            cosine = -nz * np.cos(theta) / (np.hypot(nx, ny) * np.sin(theta) + 1e-300)
            for turn in (-1.0, 1.0):
                phi = np.arctan2(ny, nx) + turn * np.arccos(np.clip(cosine, -1, 1))
                breaks.append(np.minimum(cells.phi0 + np.mod(phi - cells.phi0, 2 * np.pi), cells.phi1))
        edges = np.sort(breaks, axis=0)
        width = (edges[1:] - edges[:-1]).ravel()
        kept = width > 1e-13
        start, width = edges[:-1].ravel()[kept], width[kept]
        theta0, theta1 = np.tile(cells.theta0, 5)[kept], np.tile(cells.theta1, 5)[kept]
        phi = start + _NODES[:, None, None] * width
        limit = np.clip(self._limit(phi), theta0, theta1)
        low, high = (theta0, limit) if nz >= 0 else (limit, theta1)
        theta = low + _NODES[:, None] * (high - low)
        light = from_angles(theta, phi)
        weight = np.sin(theta) * (high - low) * width / 4
        value = self.whole.evaluate(_first(light), self.view, self.centre, self.normal)
        radiance = _first(self.environment(light)) * weight
        return _inner(np.stack(value), radiance)
