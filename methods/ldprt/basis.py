"""Real spherical harmonics in a kernel, a direction a lane: the recurrence of `envbench.real_harmonics`, unrolled."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any


def evaluate(order: int, direction: Any) -> list[Any]:
    """Return y_lm for l < `order`, in the order l*l + l + m: `order`^2 Dr.Jit arrays, the constant one of width 1.

    Parameters
    ----------
    direction : Dr.Jit ``Vector3f``
        Unit vectors; the result has its precision.
    """
    x, y, z = direction.x, direction.y, direction.z
    kind = type(x)
    out: list[Any] = [None] * order**2
    first, real, imaginary = sqrt(1 / (4 * pi)), kind(1), kind(0)
    for q in range(order):
        if q:
            first *= -sqrt((2 * q + 1) / (2 * q))
            real, imaginary = real * x - imaginary * y, real * y + imaginary * x
        a, below = kind(first), kind(0)
        for l in range(q, order):
            if l > q:
                step = z * a - sqrt(((l - 1) ** 2 - q**2) / abs(4 * (l - 1) ** 2 - 1)) * below
                a, below = sqrt((4 * l**2 - 1) / (l**2 - q**2)) * step, a
            if q == 0:
                out[l * l + l] = a
            else:
                scaled = sqrt(2) * a
                out[l * l + l + q], out[l * l + l - q] = scaled * real, scaled * imaginary
    return out
