"""Tables over directions, bilinear between their samples: of a light, band by band (eq. 24), and of the harmonics.

Sloan, Luna and Snyder 2005, sec. 5. A map is lat-long, with the meaning that `envbench.latlong` gives one: on the torus
(theta, phi) the functions are smooth, the poles too. How far interpolation is off is known beforehand. Between samples
h_t and h_p apart, f loses

    e = (f_tt u (h_t - u) + f_pp v (h_p - v)) / 2 + ...,    0 <= u <= h_t, 0 <= v <= h_p,

at most h_t^2 / 8 max|f_tt| + h_p^2 / 8 max|f_pp|. A function of band l is a trigonometric polynomial of degree l along
meridians (great circles) and along parallels. So Bernstein bounds its second derivatives, by l^2 times its maximum on
that circle:

    |e| <= l^2 (h_t^2 + h_p^2) / 8 max|f|.

RMS error. Of functions of band l with the mean square 1, turned at random, the covariance at two directions is
P_l(cos). Its derivatives at cos = 1, P_l' = L / 2 and P_l'' = L (L - 2) / 8 with L = l (l + 1), give

    <f_tt^2> = L (3 L - 2) / 8,   <f_pp^2> = L s^2 / 2 + 3 L (L - 2) s^4 / 8,   <f_tt f_pp> = s^2 L (L + 2) / 8,

s = sin(theta); over the sphere s^2 has the mean 2/3 and s^4 has 8/15. The mean of (u (h - u))^2 is h^4 / 30, that of
u (h - u) is h^2 / 6. So

    <e^2> = (h_t^4 <f_tt^2> + h_p^4 <f_pp^2>) / 120 + h_t^2 h_p^2 <f_tt f_pp> / 72,

to leading order in h: at h l = 2 it is 7 % too large.
"""

from __future__ import annotations

from functools import lru_cache
from math import isqrt, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from envbench import latlong
from envbench.directions import Array
from envbench.errors import BadInput
from envbench.real_harmonics import basis

SIZE = (32, 64)
"""Rows and columns of the paper's map."""

Size = tuple[int, int]


def build(light: Array, n: int, size: Size = SIZE) -> NDArray[np.float32]:
    """Return e_l(s) = sum over m of y_lm(s) e_lm at a map's directions, (rows, columns, n, 3) (eq. 24).

    Parameters
    ----------
    light : (>= n^2, 3)
        The light vector e; bands from n on are not looked at.

    Raises
    ------
    BadInput
        A light of fewer bands, or a map too small for n (`check`).
    """
    if light.ndim != 2 or light.shape[1] != 3 or len(light) < n * n:
        raise BadInput(f"a light of order {n} must have shape ({n * n}, 3). Got {light.shape} instead.")
    y = harmonics(n, size).reshape(-1, n * n)
    e = light.astype(np.float32)
    out = np.empty((len(y), n, 3), np.float32)
    for l in range(n):
        band = slice(l * l, (l + 1) ** 2)
        out[:, l] = y[:, band] @ e[band]
    return out.reshape(*size, n, 3)


@lru_cache(maxsize=8)
def harmonics(n: int, size: Size = SIZE) -> NDArray[np.float32]:
    """Return y(s) at a map's directions, (rows, columns, n^2), read-only: what lights that vary over a shape need."""
    check(n, size)
    out = basis(n - 1, latlong.grid(*size).reshape(-1, 3)).T.astype(np.float32, order="C").reshape(*size, n * n)
    out.flags.writeable = False
    return out


def check(n: int, size: Size) -> None:
    """Check that a map holds the bands l < n: that interpolation keeps more of each than it may lose.

    Raises
    ------
    BadInput
        `worst_error` of the last band exceeds 1, the columns are odd in number (over a pole a row meets its half-turned
        self), or n < 1.
    """
    if n < 1:
        raise BadInput(f"the order n must be >= 1. Got {n} instead.")
    if size[0] < 2 or size[1] < 2 or size[1] % 2:
        raise BadInput(f"a table needs 2 rows or more and an even number of columns. Got {size[0]} x {size[1]}.")
    if worst_error(n - 1, size) > 1:
        most = 1 + int(1 / sqrt(worst_error(1, size)))
        raise BadInput(
            f"a table of {size[0]} rows, {size[1]} columns holds orders n <= {most}. Got {n} instead: make it larger."
        )


def interpolate(table: NDArray[np.float32], directions: Array) -> Array:
    """Look a table (rows, columns, ...) up at directions (..., 3), in double precision: the kernels' oracle."""
    rows, columns, *rest = table.shape
    flat = latlong.interpolate(table.reshape(rows, columns, -1), directions)
    return flat.reshape(*directions.shape[:-1], *rest)


def worst_error(l: int, size: Size = SIZE) -> float:
    """Return the bound on the interpolation error of a function of band l, relative to its maximum."""
    h_t, h_p = _steps(size)
    return l * l * (h_t**2 + h_p**2) / 8


def rms_error(l: int, size: Size = SIZE) -> float:
    """Return the RMS interpolation error of functions of band l turned at random, relative to their RMS."""
    h_t, h_p = _steps(size)
    L = l * (l + 1)
    tt = L * (3 * L - 2) / 8
    pp = L / 2 * (2 / 3) + 3 * L * (L - 2) / 8 * (8 / 15)
    tp = L * (L + 2) / 8 * (2 / 3)
    return sqrt((h_t**4 * tt + h_p**4 * pp) / 120 + h_t**2 * h_p**2 * tp / 72)


def expected_error(light: Array, size: Size = SIZE) -> Array:
    """Return the RMS over directions that e_l(s) of a light (n^2, 3) is expected to be off by, shape (n, 3)."""
    length = _lengths(light) / sqrt(4 * pi)
    return length * np.array([rms_error(l, size) for l in range(len(length))])[:, None]


def largest_error(light: Array, size: Size = SIZE) -> Array:
    """Return what e_l(s) of a light (n^2, 3) cannot be off by more than, shape (n, 3).

    Radiance of lobes g_il is then off by sum_l sum_i |g_il| times that at most. The sum over m of y_lm^2 is
    (2 l + 1) / (4 pi) in every direction, which bounds the band's maximum.
    """
    length = _lengths(light)
    l = np.arange(len(length))
    return length * (np.sqrt((2 * l + 1) / (4 * pi)) * [worst_error(int(k), size) for k in l])[:, None]


def _lengths(light: Array) -> Array:
    """Return the length of each band's coefficients, (n, 3)."""
    return np.stack([np.linalg.norm(light[l * l : (l + 1) ** 2], axis=0) for l in range(isqrt(len(light)))])


def _steps(size: Size) -> tuple[float, float]:
    return pi / size[0], 2 * pi / size[1]
