"""Directions about an axis: what every lobe samples with."""

from __future__ import annotations

from typing import Any

from envbench.arrays import namespace

Vector = tuple[Any, Any, Any]


def frame(axis: Any) -> tuple[Vector, Vector]:
    """Return two unit vectors perpendicular to the unit vector `axis` and each other (Duff et al. 2017, branchless).

    Of an axis of plain numbers they hold NumPy scalars: a Dr.Jit factor must stand to their left.
    """
    xp = namespace(axis[2])
    sign = xp.where(axis[2] >= 0, 1.0, -1.0)
    a = -1 / (sign + axis[2])
    b = axis[0] * axis[1] * a
    s = (1 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0])
    return s, (b, sign + axis[1] * axis[1] * a, -axis[1])


def about(axis: Any, cosine: Any, sine: Any, phi: Any) -> Vector:
    """Return the direction at a polar angle, by its cosine and sine, and an azimuth about `axis`."""
    xp = namespace(axis[0], cosine)
    x, y = sine * xp.cos(phi), sine * xp.sin(phi)
    s, t = frame(axis)
    return (
        x * s[0] + y * t[0] + cosine * axis[0],
        x * s[1] + y * t[1] + cosine * axis[1],
        x * s[2] + y * t[2] + cosine * axis[2],
    )
