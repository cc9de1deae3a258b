"""The paper's own fit, a vertex at a time: SciPy's BFGS over all axes and coefficients (eqs. 17 to 21). A slow oracle.

Independent of `methods.ldprt`: harmonics are polynomials here, whose gradients in s_x, s_y and s_z are read off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from envbench.directions import uniform
from envbench.real_harmonics import basis

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Harmonics:
    """y_lm of `degrees` as homogeneous polynomials: their monomials, and the coefficients of y and of its gradient."""

    exponents: NDArray[np.int64]  # (3, k)
    value: Array  # (m, k)
    gradient: Array  # (3, m, k)

    def __call__(self, s: Array) -> tuple[Array, Array]:
        """Return y (m, N) and its gradient (3, m, N) at vectors s (N, 3)."""
        powers = s.T[:, None] ** np.arange(self.exponents.max() + 1)[:, None]  # (3, degree + 1, N)
        a, b, c = self.exponents
        monomials = powers[0][a] * powers[1][b] * powers[2][c]
        return self.value @ monomials, self.gradient @ monomials


@lru_cache(maxsize=8)
def polynomials(first: int, n: int) -> Harmonics:
    """Return the harmonics of the bands l = first ... n - 1.

    On the sphere a homogeneous polynomial of degree l is determined by its values, so that a linear solve finds it.
    """
    exponents = np.array([e for e in product(range(n), repeat=3) if sum(e) < n]).T
    place = {tuple(e): k for k, e in enumerate(exponents.T.tolist())}
    s = uniform(400, np.random.default_rng(0))
    y = basis(n - 1, s)[first**2 :]
    value = np.zeros((len(y), len(place)))
    for l in range(first, n):
        of_degree = np.nonzero(exponents.sum(axis=0) == l)[0]
        monomials = np.prod(s.T[:, None] ** exponents[:, of_degree, None], axis=0)
        rows = slice(l * l - first**2, (l + 1) ** 2 - first**2)
        value[rows, of_degree] = np.linalg.lstsq(monomials.T, y[rows].T, rcond=None)[0].T
    gradient = np.zeros((3, *value.shape))
    for e, k in place.items():
        for a in range(3):
            if e[a]:
                lower = tuple(x - (i == a) for i, x in enumerate(e))
                gradient[a][:, place[lower]] += e[a] * value[:, k]
    return Harmonics(exponents, value, gradient)


@dataclass(frozen=True, eq=False)
class Objective:
    """psi of eq. 17 for one vector's bands l >= `first`, over x = (axes (N, 3), coefficients (N, bands))."""

    t: Array
    first: int
    n: int

    @property
    def bands(self) -> NDArray[np.int64]:
        """The band of each coefficient, from 0."""
        return np.repeat(np.arange(self.n - self.first), 2 * np.arange(self.first, self.n) + 1)

    def split(self, x: Array) -> tuple[Array, Array]:
        """Return axes, not yet normalised, and coefficients."""
        N = len(x) // (3 + self.n - self.first)
        return x[: 3 * N].reshape(N, 3), x[3 * N :].reshape(N, -1)

    def __call__(self, x: Array) -> tuple[float, Array]:
        """Return psi and its gradient."""
        axes, g = self.split(x)
        length = np.sqrt((axes * axes).sum(axis=1, keepdims=True))
        s = axes / length
        y, dy = polynomials(self.first, self.n)(s)
        spread = g.T[self.bands]
        error = (y * spread).sum(axis=1) - self.t
        by_coefficient = 2 * np.add.reduceat(y * error[:, None], self._starts(), axis=0).T  # eq. 19
        by_direction = 2 * ((dy * spread).transpose(0, 2, 1) @ error).T  # eq. 20
        by_axis = (by_direction - s * (s * by_direction).sum(axis=1, keepdims=True)) / length  # eq. 21
        return float(error @ error), np.concatenate([by_axis.ravel(), by_coefficient.ravel()])

    def solved(self, axes: Array) -> Array:
        """Return the best coefficients (N, bands) with the axes frozen, a linear solve a band."""
        y, _ = polynomials(self.first, self.n)(axes)
        starts = [*self._starts(), len(self.t)]
        bands = (slice(a, b) for a, b in pairwise(starts))
        return np.stack([np.linalg.lstsq(y[band], self.t[band], rcond=None)[0] for band in bands], axis=1)

    def descend(self, axes: Array) -> tuple[Array, Array, float]:
        """Run BFGS to convergence from axes (N, 3), their coefficients solved first; return axes, coefficients, psi."""
        start = np.concatenate([axes.ravel(), self.solved(axes).ravel()])
        found = optimize.minimize(self, start, jac=True, method="BFGS", options={"maxiter": 2000})
        reached, g = self.split(found.x)
        return reached / np.linalg.norm(reached, axis=1, keepdims=True), g, float(found.fun)

    def _starts(self) -> NDArray[np.int64]:
        return np.arange(self.first, self.n) ** 2 - self.first**2


def hemicube(side: int) -> Array:
    """Return the axes through the squares of a cube's upper half."""
    u = (2 * np.arange(side) + 1) / side - 1
    sphere = [np.insert([a, b], face, sign) for face in range(3) for sign in (1.0, -1.0) for a in u for b in u]
    upper = np.array([s for s in sphere if s[2] > 0])
    return upper / np.linalg.norm(upper, axis=1, keepdims=True)


def single(t: Array, first: int, n: int, linear: Array | None, side: int) -> tuple[Array, Array]:
    """Return axis (1, 3) and coefficients of one lobe: BFGS from the best of the hemi-cube and the optimal linear axis.

    The paper runs it from every one of them, which would take a hundred times as long.
    """
    tried = hemicube(side)
    if linear is not None:
        tried = np.concatenate([tried, linear[None]])
    y, _ = polynomials(first, n)(tried)
    edges = np.arange(first, n) ** 2 - first**2
    products = np.add.reduceat(y * t[:, None], edges, axis=0)
    gain = (4 * np.pi / (2 * np.arange(first, n) + 1)) @ products**2  # by eq. 18
    axis, g, _ = Objective(t, first, n).descend(tried[[gain.argmax()]])
    return axis, g


def fit(vector: Array, lobes: int, side: int = 8) -> tuple[Array, Array, float]:
    """Fit one SH vector (n^2,) as the paper does; return axes (N, 3), coefficients (N, bands) and psi."""
    n = int(np.sqrt(len(vector)))
    first = 2 if lobes >= 3 else 1
    t = left = vector[first**2 :]
    linear = np.array([-vector[3], -vector[1], vector[2]])
    start: Array | None = linear / np.linalg.norm(linear)
    axes = np.empty((0, 3))
    expand = polynomials(first, n)
    bands = Objective(t, first, n).bands
    for _ in range(lobes):
        axis, g = single(left, first, n, start, side)
        left = left - (expand(axis)[0] * g.T[bands]).sum(axis=1)
        axes, start = np.concatenate([axes, axis]), None
    return Objective(t, first, n).descend(axes)
