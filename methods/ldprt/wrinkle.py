"""The wrinkle: lobes as a bilinear map over (x, d), fitted in one piece so that neighbours' lobes belong together.

Points fitted one by one number their lobes as they please, and take one of several minima: what lies between two of
them means nothing. Here the parameters of the nodes, axes and coefficients alike, are the variables of one problem,

    min over nodes   mean over samples of |t - t~(axes, g interpolated to the sample)|^2,

with more samples than nodes, so that a lobe which jumps from node to node costs error between them (sec. 4.2). DC and
linear coefficients are bilinear as well; no lobe holds them, and they are linear least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize

from envbench.directions import Array, normalised
from envbench.errors import BadInput
from methods.ldprt.fit import linear_axes
from methods.ldprt.groove import groove_transfer
from methods.ldprt.lobes import Lobes, order_of
from methods.ldprt.projected import coefficients, expand, harmonics_at
from methods.ldprt.signal import Signal, derivative

LOBES = 3
FIRST = 2
"""The first band that lobes hold."""
ANGLES = np.radians(np.arange(20, 91, 5))
"""Tried between the optimal linear lobe and each of its two neighbours; nearer ones would be hard to tell apart."""


@dataclass(frozen=True, eq=False)
class LobeMap:
    """Lobe parameters at the nodes of a regular grid over the unit square, the outermost nodes on its border.

    Parameters
    ----------
    axes : (X, D, N, 3)
        Interpolated first, normalised afterwards: of any length but zero.
    coefficients : (X, D, N, n)
    direct : (X, D, 4)
    """

    axes: Array
    coefficients: Array
    direct: Array

    def at(self, u: ArrayLike, v: ArrayLike) -> Lobes:
        """Return the lobes at places (V,) of the square; places beyond it are moved to its border."""
        u, v = np.broadcast_arrays(np.asarray(u, float).ravel(), np.asarray(v, float).ravel())
        (row, down), (column, right) = (_cell(t, size) for t, size in zip((u, v), self.axes.shape[:2], strict=True))
        corners = [
            (row + i, column + j, (down if i else 1 - down) * (right if j else 1 - right))
            for i in (0, 1)
            for j in (0, 1)
        ]

        def read(nodes: Array) -> Array:
            shape = (len(u), *(1,) * (nodes.ndim - 2))
            return sum((w.reshape(shape) * nodes[i, j] for i, j, w in corners), np.zeros(shape))

        axes = read(self.axes)
        axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
        return Lobes(axes, read(self.coefficients), read(self.direct))


@dataclass(frozen=True, eq=False)
class Wrinkle:
    """The lobes of a sinusoidal groove (`methods.ldprt.groove`) of any depth up to `depth`, |x| <= 1/2."""

    nodes: LobeMap
    depth: float
    error: float
    """RMS over the samples, relative to the RMS length of their vectors."""

    def at(self, x: ArrayLike, depth: ArrayLike) -> Lobes:
        """Return the lobes at locations x across the groove, in its widths, and depths d, (V,) each.

        In the groove's frame: x across it, y along it, z up. Beyond its rims the ground is flat, as it is at them.
        """
        d = np.asarray(depth, float)
        if d.size and not 0 <= d.min() <= d.max() <= self.depth:
            raise BadInput(
                f"wrinkle depths must lie in [0, {self.depth:g}], which was fitted. Got {d.min():g} to {d.max():g}."
            )
        return self.nodes.at(np.asarray(x, float) + 0.5, d / self.depth)


def fit_wrinkle(depth: float = 1.0, n: int = 6, size: int = 32, samples: int = 64, iterations: int = 150) -> Wrinkle:
    """Fit a groove's transfer up to a depth, in widths: `size` x `size` nodes to `samples` x `samples` points."""
    if not 0 < depth < np.inf:
        raise BadInput(f"the depth of a wrinkle must be finite and above 0. Got {depth} instead.")
    x, d = np.linspace(-0.5, 0.5, samples), np.linspace(0, depth, samples)
    signal = groove_transfer(x[:, None], d, n)
    nodes, error = fit_map(signal, (size, size), iterations)
    return Wrinkle(nodes, depth, error)


def fit_map(signal: Array, size: tuple[int, int], iterations: int = 150) -> tuple[LobeMap, float]:
    """Fit a map of nodes (X, D) to a signal (X', D', n^2) sampled on a finer grid over the same square.

    Returns
    -------
    LobeMap, float
        And the RMS error over the samples, relative to the RMS length of their vectors.
    """
    n = order_of(signal.shape[-1])
    if n <= FIRST:
        raise BadInput(f"a map of {LOBES} lobes needs n > {FIRST}: the bands below are stored directly. Got n = {n}.")
    for nodes, samples in zip(size, signal.shape[:2], strict=True):
        if not 2 <= nodes < samples:
            raise BadInput(f"a map needs at least 2 nodes a side, and more samples. Got {nodes} and {samples} instead.")
    problem = _Problem.of(signal, size)
    direct = problem.least_squares(signal[..., : FIRST**2])
    axes, g = _start(problem.least_squares(signal))
    axes, g = problem.descend(axes, g, iterations)
    whole = np.zeros((*g.shape[:-1], n))
    whole[..., FIRST:] = g
    found = LobeMap(axes, whole, direct)
    u, v = (np.linspace(0, 1, k) for k in signal.shape[:2])
    got = found.at(np.repeat(u, len(v)), np.tile(v, len(u))).vectors().reshape(signal.shape)
    return found, float(np.sqrt(np.sum((got - signal) ** 2) / np.sum(signal**2)))


def _start(signal: Array) -> tuple[Array, Array]:
    """Return axes (X, D, 3, 3) and coefficients (X, D, 3, bands): the optimal linear lobe between two others.

    The groove runs along y and its transfer is even in y: the two are turned towards y and -y, by the angle of the
    least error at each node. (Two in the plane of the cross-section end in a higher minimum: .057 against .053 of the
    signal's length, for 12 x 12 nodes.)
    """
    flat = signal.reshape(-1, signal.shape[-1])
    bands = Signal.of(flat, FIRST)
    middle = linear_axes(flat).T
    axes, least = np.empty((3, LOBES, len(flat))), np.full(len(flat), np.inf)
    for angle in ANGLES:
        aside = np.sin(angle) * np.array([[0.0], [1.0], [0.0]])
        tried = np.stack(
            [middle, *(normalised((np.cos(angle) * middle + side).T).T for side in (aside, -aside))], axis=1
        )
        left = expand(bands, tried).value
        axes, least = np.where(left < least, tried, axes), np.minimum(left, least)
    g = coefficients(bands, axes)
    return (
        axes.transpose(2, 1, 0).reshape(*signal.shape[:2], LOBES, 3),
        g.transpose(2, 1, 0).reshape(*signal.shape[:2], LOBES, -1),
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """The objective over all nodes, and its gradient."""

    bands: tuple[Array, ...]  # t_lm at the samples, (2 l + 1, S)
    rows: Array  # hat functions of the nodes at the samples, (X', X)
    columns: Array  # (D', D)

    @classmethod
    def of(cls, signal: Array, size: tuple[int, int]) -> _Problem:
        flat = np.ascontiguousarray(signal.reshape(-1, signal.shape[-1]).T)
        bands = tuple(flat[l * l : (l + 1) ** 2] for l in range(FIRST, int(np.sqrt(len(flat)))))
        rows, columns = (_hats(np.linspace(0, 1, k), n) for k, n in zip(signal.shape[:2], size, strict=True))
        return cls(bands, rows, columns)

    def least_squares(self, signal: Array) -> Array:
        """Return the nodes (X, D, k) whose bilinear function is nearest to samples (X', D', k)."""
        rows, columns = (np.linalg.pinv(hats).astype(np.float64) for hats in (self.rows, self.columns))
        return _separably(rows, columns, signal)

    def interpolated(self, nodes: Array) -> Array:
        """Return nodes (X, D, k) at the samples, (k, S)."""
        return _separably(self.rows, self.columns, nodes).reshape(-1, nodes.shape[2]).T.copy()

    def gathered(self, samples: Array) -> Array:
        """Return the transpose of that: samples (k, S) to nodes (X, D, k)."""
        grid = samples.T.reshape(len(self.rows), len(self.columns), -1)
        return _separably(self.rows.T, self.columns.T, grid)

    def __call__(self, axes: Array, g: Array) -> tuple[float, Array, Array]:
        """Return the objective and its gradients by the nodes' axes (X, D, N, 3) and coefficients (X, D, N, B)."""
        nodes, N = axes.shape[:2], axes.shape[2]
        raw = self.interpolated(axes.reshape(*nodes, -1)).reshape(N, 3, -1).swapaxes(0, 1)  # (3, N, S)
        g = self.interpolated(g.reshape(*nodes, -1)).reshape(N, len(self.bands), -1).swapaxes(0, 1)  # (B, N, S)
        length = np.sqrt(np.einsum("kis,kis->is", raw, raw))
        s = raw / length
        y = harmonics_at(s, FIRST + len(self.bands) - 1)
        error = tuple(
            np.einsum("mis,is->ms", y[l], g[at]) - t
            for at, (l, t) in enumerate(zip(self._orders, self.bands, strict=True))
        )
        by_g = np.stack([np.einsum("ms,mis->is", e, y[l]) for l, e in zip(self._orders, error, strict=True)])
        by_s = np.zeros_like(s)
        for at, l in enumerate(self._orders):
            by_s += g[at] * np.einsum("kms,mis->kis", derivative(l) @ error[at], y[l - 1])
        by_s = (by_s - s * np.einsum("kis,kis->is", s, by_s)) / length  # eq. 21
        scale = 2 / s.shape[2]
        return (
            float(sum(np.sum(e * e) for e in error) / s.shape[2]),
            self.gathered(scale * by_s.swapaxes(0, 1).reshape(3 * N, -1)).reshape(axes.shape),
            self.gathered(scale * by_g.swapaxes(0, 1).reshape(N * len(g), -1)).reshape(*nodes, N, -1),
        )

    def descend(self, axes: Array, g: Array, iterations: int) -> tuple[Array, Array]:
        """Run nonlinear conjugate gradients over all nodes; each kind of variable is scaled by its own curvature."""
        l = np.array(self._orders)
        # |dy/ds|^2 = l (l + 1) (2 l + 1) / (4 pi), half of it along each tangent; |y|^2 = (2 l + 1) / (4 pi)
        steep = np.mean(np.sum(g**2 * l * (l + 1) * (2 * l + 1) / (8 * pi), axis=-1))
        unit = np.concatenate([
            np.full(axes.size, 1 / np.sqrt(steep)), np.broadcast_to(np.sqrt(4 * pi / (2 * l + 1)), g.shape).ravel()
        ])  # fmt: skip
        unit *= np.sqrt(axes.shape[0] * axes.shape[1])

        def parts(x: Array) -> tuple[Array, Array]:
            whole = x * unit
            return whole[: axes.size].reshape(axes.shape), whole[axes.size :].reshape(g.shape)

        def objective(x: Array) -> tuple[float, Array]:
            value, by_axes, by_g = self(*parts(x))
            return value, unit * np.concatenate([by_axes.ravel(), by_g.ravel()])

        start = np.concatenate([axes.ravel(), g.ravel()]) / unit
        found = optimize.minimize(
            objective, start, jac=True, method="CG", options={"maxiter": iterations, "gtol": 1e-9}
        )
        return parts(found.x)

    @property
    def _orders(self) -> range:
        return range(FIRST, FIRST + len(self.bands))


def _separably(rows: Array, columns: Array, grid: Array) -> Array:
    """Apply matrices (x, X) and (d, D) along the first two axes of a grid (X, D, k)."""
    X, D, k = grid.shape
    return columns @ (rows @ grid.reshape(X, D * k)).reshape(-1, D, k)


def _cell(t: Array, nodes: int) -> tuple[NDArray[np.intp], Array]:
    """Return the node before each place t in [0, 1], the last but one at most, and how far beyond it t lies."""
    at = np.clip(t, 0, 1) * (nodes - 1)
    before = np.minimum(at.astype(np.intp), nodes - 2)
    return before, at - before


def _hats(t: Array, nodes: int) -> Array:
    """Return the hat functions of `nodes` over [0, 1] at places t (k,): (k, nodes)."""
    before, beyond = _cell(t, nodes)
    out = np.zeros((len(t), nodes))
    out[np.arange(len(t)), before] = 1 - beyond
    out[np.arange(len(t)), before + 1] = beyond
    return out
