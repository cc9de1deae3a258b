"""Real spherical harmonics, in the order l*l + l + m: Y_l0, and sqrt(2) times Re Y_lq at m = q, Im Y_lq at m = -q.

Y_lm is complex, orthonormal, with the Condon-Shortley phase (`envbench.harmonics`): so the linear ones are
sqrt(3 / (4 pi)) times -y, z and -x, at m = -1, 0 and 1. The real ones are orthonormal too.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics
from envbench.directions import Array


def basis(order: int, direction: Array) -> Array:
    """Return the harmonics of degree <= `order` at a direction (3,) or at directions (n, 3).

    One direction, the viewer of a frame, is plain arithmetic: NumPy's calls would take as long as the frame itself.

    Returns
    -------
    ((order + 1)^2,) or ((order + 1)^2, n)

    Examples
    --------
    >>> basis(1, np.array([0.0, 0.0, 1.0])).round(4).tolist()
    [0.2821, -0.0, 0.4886, -0.0]
    """
    x, y, z = direction.tolist() if direction.ndim == 1 else direction.T
    first, *others = terms(order, x, y, z)
    return np.array([first if direction.ndim == 1 else first + 0 * z, *others])


def terms(order: int, x: Any, y: Any, z: Any) -> list[Any]:
    """Return the harmonics of degree <= `order` at (x, y, z): numbers, or arrays of any library; the first is one."""
    out: list[Any] = [None] * (order + 1) ** 2
    real, imaginary = 1.0, 0.0
    for q, (first, steps) in enumerate(_recurrence(order)):
        if q:
            real, imaginary = real * x - imaginary * y, real * y + imaginary * x
        a, below, at = first, 0.0, q * q + q
        for l, (up, down) in enumerate(steps, q):
            if l > q:
                a, below, at = up * z * a - down * below, a, at + 2 * l
            if q == 0:
                out[at] = a
            else:
                out[at + q], out[at - q] = a * real, a * imaginary
    return out


@lru_cache(maxsize=32)
def _recurrence(order: int) -> tuple[tuple[float, tuple[tuple[float, float], ...]], ...]:
    """Return for each q the harmonic of degree q, by (x + i y)^q, and by degree the two factors of the next."""
    found: list[tuple[float, tuple[tuple[float, float], ...]]] = []
    first = sqrt(1 / (4 * pi))
    for q in range(order + 1):
        if q:
            first *= -sqrt((2 * q + 1) / (2 * q))
        steps = [(0.0, 0.0)]
        for l in range(q + 1, order + 1):
            up = sqrt((4 * l**2 - 1) / (l**2 - q**2))
            steps.append((up, up * sqrt(((l - 1) ** 2 - q**2) / abs(4 * (l - 1) ** 2 - 1))))
        found.append((first * (sqrt(2) if q else 1), tuple(steps)))
    return tuple(found)


def project(radiance: NDArray[np.floating], order: int) -> Array:
    """Return the coefficients, ((order + 1)^2, 3), of the bilinear function that a lat-long map (H, W, 3) means."""
    return from_complex(harmonics.analyse(radiance, order), order)


def from_complex(alm: harmonics.Coefficients, order: int) -> Array:
    """Return real coefficients ((order + 1)^2, C) of real functions with complex ones (C, n), m >= 0."""
    l, m = harmonics.degrees(order)
    at = l * l + l
    out = np.zeros(((order + 1) ** 2, len(alm)))
    # sum over +-m of a_lm Y_lm = 2 Re(a_lm Y_lm) = sqrt(2) Re a * (sqrt(2) Re Y) - sqrt(2) Im a * (sqrt(2) Im Y)
    scale = np.where(m == 0, 1.0, sqrt(2.0))
    out[at - m] = (-scale * alm.imag).T
    out[at + m] = (scale * alm.real).T
    return out
