"""Points of equal weight, as every view makes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from envbench.directions import Array, perpendicular, to_angles
from envbench.geometry import Points


def equal(position: Array, normal: Array, geometric: Array, view: Array, **more: Any) -> Points:
    """Return points of equal weight; the tangent is one perpendicular to the normal."""
    weight = np.full(len(normal), 1 / len(normal))
    return Points(position, normal, geometric, perpendicular(normal), view, weight, **more)


def sphere_uv(position: Array) -> Array:
    """Return (u, v) = (phi / 2 pi, theta / pi) of positions (n, 3) on the unit sphere, shape (n, 2)."""
    theta, phi = to_angles(position)
    return np.stack([phi / (2 * np.pi), theta / np.pi], axis=-1)
