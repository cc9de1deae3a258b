"""Associated Legendre functions, normalised: Y_lq = a_lq(z) (x + i y)^q at the unit vector (x, y, z), q >= 0."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def reduced(degree: int, order: int, z: Array) -> Array:
    """Return a_lq(z), shape (order + 1, degree + 1, n), zero for q > l, by the usual recurrence over l.

    Unlike Y_lq itself it has no angle in it, and needs no care at the poles. SciPy's tables of Y_lm hold the negative
    orders too and take four times as long.
    """
    out = np.zeros((order + 1, degree + 1, len(z)))
    first = np.sqrt(1 / (4 * np.pi))
    for q in range(min(order, degree) + 1):
        if q:
            first *= -np.sqrt((2 * q + 1) / (2 * q))
        a = out[q]
        a[q] = first
        for l in range(q + 1, degree + 1):
            np.multiply(z, a[l - 1], out=a[l])
            if l > q + 1:
                a[l] -= np.sqrt(((l - 1) ** 2 - q**2) / (4 * (l - 1) ** 2 - 1)) * a[l - 2]
            a[l] *= np.sqrt((4 * l**2 - 1) / (l**2 - q**2))
    return out


def associated(degree: int, order: int, theta: Array) -> Array:
    """Return f_lq(theta) = Y_lq e^(-i q phi), shape (order + 1, degree + 1, n), zero for q > l."""
    sine = np.sin(theta) ** np.arange(order + 1)[:, None]
    return reduced(degree, order, np.cos(theta)) * sine[:, None, :]
