"""Rotation of spherical harmonics by the zxzxz method (Sloan, Luna and Snyder 2005, sec. 3.4).

A rotation is R = Rz(a) Ry(b) Rz(c), and a turn about y is one about z between two fixed quarter turns about x,

    R = Rz(a) Rx(-pi/2) Rz(b) Rx(pi/2) Rz(c).

A turn about z mixes m and -m alone, by cos(m t) and sin(m t). A quarter turn about x is sparse: it takes mirroring in
y to mirroring in z and the other way round, so that it takes the harmonics of the parities (p_y, p_z) to those of
(p_z, p_y) alone. Of the (2 l + 1)^2 entries of band l that leaves l^2 + l + 1. The linear band is turned by R itself.

The formula is written once, for components that are NumPy arrays, Dr.Jit's, or the numbers with which `multiplies`
counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.arrays import namespace
from envbench.directions import Array
from envbench.errors import BadInput
from envbench.real_harmonics import basis

Angle = tuple[Any, Any]
"""Cosine and sine."""
Rows = tuple[tuple[tuple[int, float], ...], ...]
"""A sparse matrix: (column, entry), by row."""

_POLE = 1e-30
"""Below this sin^2(b) the axis is not tilted, and a + c alone is known: then a = 0."""


def rotate(coefficients: NDArray[np.floating], rotations: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the coefficients of the functions f(R^-1 s), for functions f(s) with `coefficients`.

    Leading axes broadcast: V vectors (V, n^2) by V rotations (V, 3, 3), or one light (3, n^2), three channels, by
    rotations (V, 1, 3, 3) to (V, 3, n^2).

    Parameters
    ----------
    coefficients : (..., n^2)
        In the order of `envbench.real_harmonics`; float32 stays float32.
    rotations : (..., 3, 3)
        Proper orthonormal matrices.

    Raises
    ------
    BadInput
        The last axes have other lengths.
    """
    n = isqrt(coefficients.shape[-1]) if coefficients.ndim else 0
    if n < 1 or n * n != coefficients.shape[-1]:
        raise BadInput(f"SH vectors must have shape (..., n^2), n >= 1. Got {coefficients.shape} instead.")
    if rotations.shape[-2:] != (3, 3):
        raise BadInput(f"rotations must have shape (..., 3, 3). Got {rotations.shape} instead.")
    kind = np.result_type(coefficients.dtype, np.float32)
    shape = np.broadcast_shapes(coefficients.shape[:-1], rotations.shape[:-2])
    matrix = np.moveaxis(rotations.astype(kind), (-2, -1), (0, 1))
    components = list(np.moveaxis(coefficients.astype(kind), -1, 0))
    out = np.empty((*shape, n * n), kind)
    for k, component in enumerate(turned(components, matrix, euler(matrix))):
        out[..., k] = component
    return out


def euler(matrix: Any) -> tuple[Angle, Angle, Angle]:
    """Return cosine and sine of a, b and c, R = Rz(a) Ry(b) Rz(c), for a matrix of components ``matrix[i][j]``.

    a is where R takes the z axis to. Any a would do there if b were 0 or pi; so c is not read off R's last row, whose
    entries are small near those poles, but from the second row of Rz(-a) R = Ry(b) Rz(c), which is (sin c, cos c, 0).
    """
    (r00, r01, r02), (r10, r11, r12), (_, _, r22) = matrix
    xp = namespace(r00)
    square = r02 * r02 + r12 * r12
    tilted = square > _POLE
    scale = 1 / xp.sqrt(xp.where(tilted, square, 1.0))
    cos_a, sin_a = xp.where(tilted, r02 * scale, 1.0), xp.where(tilted, r12 * scale, 0.0)
    return (
        (cos_a, sin_a),
        (r22, cos_a * r02 + sin_a * r12),
        (cos_a * r11 - sin_a * r01, cos_a * r10 - sin_a * r00),
    )


def turned(components: Sequence[Any], matrix: Any, angles: tuple[Angle, Angle, Angle]) -> list[Any]:
    """Return the n^2 rotated components, given ``matrix[i][j]`` and its `euler` angles."""
    n = isqrt(len(components))
    out = list(components)
    if n > 1:
        # y_1-1, y_10 and y_11 are -k y, k z and -k x
        x, y, z = -out[3], -out[1], out[2]
        x, y, z = (row[0] * x + row[1] * y + row[2] * z for row in matrix)
        out[1:4] = -y, z, -x
    a, b, c = ([(1.0, 0.0), angle] for angle in angles)
    for l in range(2, n):
        for multiples in (a, b, c):
            _append_multiple(multiples)
        band = _about_x(_about_z(out[l * l : (l + 1) ** 2], c), l, back=False)
        band = _about_x(_about_z(band, b), l, back=True)
        out[l * l : (l + 1) ** 2] = _about_z(band, a)
    return out


def turned_about_z(components: Sequence[Any], cosine: Any, sine: Any) -> list[Any]:
    """Return n^2 components turned about z by the angle of that cosine and sine."""
    n = isqrt(len(components))
    multiples: list[Angle] = [(1.0, 0.0), (cosine, sine)]
    out = list(components[:1])
    for l in range(1, n):
        if l > 1:
            _append_multiple(multiples)
        out += _about_z(components[l * l : (l + 1) ** 2], multiples)
    return out


def multiplies(n: int) -> int:
    """Count the products that `turned` takes for n^2 components, by running it on numbers that count.

    As in the paper, conversion to Euler angles is left out. A product with a table's entry that happens to be 0 is one.

    Examples
    --------
    >>> [multiplies(n) for n in range(3, 10)]
    [53, 121, 217, 345, 509, 713, 961]
    """
    tally = _Tally()
    number = _Counted(tally)
    angle = (number, number)
    turned([number] * n**2, [[number] * 3] * 3, (angle, angle, angle))
    return tally.products


class _Tally:
    products = 0


class _Counted:
    """A number without a value, which tallies the products it takes part in."""

    def __init__(self, tally: _Tally) -> None:
        self._tally = tally

    def __mul__(self, other: object) -> _Counted:
        self._tally.products += 1
        return self

    def __add__(self, other: object) -> _Counted:
        return self

    def __neg__(self) -> _Counted:
        return self

    __rmul__ = __mul__
    __sub__ = __radd__ = __add__


def _append_multiple(multiples: list[Angle]) -> None:
    """Append cos(l t), sin(l t) to those of 0 ... l - 1: cos(l t) = 2 cos(t) cos((l - 1) t) - cos((l - 2) t)."""
    cosine, _ = multiples[1]
    twice = cosine + cosine
    (before_c, before_s), (last_c, last_s) = multiples[-2:]
    multiples.append((twice * last_c - before_c, twice * last_s - before_s))


def _about_z(band: Sequence[Any], multiples: Sequence[Angle]) -> list[Any]:
    """Turn the 2 l + 1 components of a band about z: f(phi) becomes f(phi - t), with cos(m t) and sin(m t) given."""
    l = len(band) // 2
    out = list(band)
    for m in range(1, l + 1):
        cosine, sine = multiples[m]
        even, odd = band[l + m], band[l - m]
        out[l + m] = cosine * even - sine * odd
        out[l - m] = sine * even + cosine * odd
    return out


def _about_x(band: Sequence[Any], l: int, *, back: bool) -> list[Any]:
    """Turn a band about x by a quarter turn, or back."""
    out: list[Any] = []
    for row in _quarter_turn(l)[back]:
        (k, value), *rest = row
        total = value * band[k]
        for k, value in rest:
            total = total + value * band[k]
        out.append(total)
    return out


@lru_cache(maxsize=64)
def _quarter_turn(l: int) -> tuple[Rows, Rows]:
    """Return the sparse matrices of band l that turn a function by pi/2 about x, and back: (column, entry) by row."""
    matrix = quarter_turn(l)
    parity = [_mirrored(l, m) for m in range(-l, l + 1)]
    pattern = [[k for k, (y, z) in enumerate(parity) if (z, y) == row] for row in parity]
    forth, back = (
        tuple(tuple((k, float(entries[i, k])) for k in columns) for i, columns in enumerate(pattern))
        for entries in (matrix, matrix.T)
    )
    return forth, back


def _mirrored(l: int, m: int) -> tuple[int, int]:
    """Return the signs that y_lm takes on where y, and where z, is mirrored."""
    return (1 if m >= 0 else -1), (-1) ** (l + m)


def quarter_turn(l: int) -> Array:
    """Return the matrix (2 l + 1, 2 l + 1) that turns a function of band l by pi/2 about x.

    Its entries are int y_lm(s) y_lm'(Rx(-pi/2) s) ds, summed by a product rule that is exact for degree 2 l.
    """
    z, weight = np.polynomial.legendre.leggauss(l + 1)
    phi = 2 * np.pi * np.arange(2 * l + 1) / (2 * l + 1)
    sine = np.sqrt(1 - z * z)[:, None]
    s = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), z[:, None]), -1).reshape(-1, 3)
    before, after = (basis(l, d)[l * l :] for d in (s[:, [0, 2, 1]] * [1, 1, -1], s))  # Rx(-pi/2) s = (x, z, -y)
    return (after * np.repeat(weight * 2 * np.pi / len(phi), len(phi))) @ before.T
