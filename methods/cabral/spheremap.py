"""Sphere maps: the picture of a ball from far away, its disk inscribed in a square of texels (Cabral et al. 1999, 3.3).

A point of the disk p = (x, y), |p| <= 1, with x to the right and y up as the view sees it, shows the normal
(x, y, sqrt(1 - x^2 - y^2)) and, as a mirror ball, the direction 2 z n - (0, 0, 1): the whole sphere, of which all rim
points show the one direction away from the viewer. The paper's texture coordinates are (p + 1) / 2. Texels beyond the
disk hold what the nearest rim point holds, so that bilinear lookup darkens no rim.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.arrays import namespace
from envbench.directions import Array, perpendicular, reflect

Vector = tuple[Any, Any, Any]


def texels(size: int) -> Array:
    """Return the points p of all texels, drawn to the rim from beyond it, (size, size, 2); row 0 is the top."""
    along = (2 * np.arange(size) + 1) / size - 1
    p = np.stack(np.meshgrid(along, -along), -1)
    return p / np.maximum(np.linalg.norm(p, axis=-1, keepdims=True), 1)


def normals(p: Array) -> Array:
    """Return g_normal: the normals (..., 3), local to the view, that the points (..., 2) show."""
    z = np.sqrt(np.maximum(1 - np.sum(p * p, axis=-1, keepdims=True), 0))
    return np.concatenate([p, z], axis=-1)


def mirrored(normal: Array) -> Array:
    """Return g_mirror from g_normal: the direction that a mirror of this local normal shows."""
    return reflect([0.0, 0.0, 1.0], normal)


def frame(view: Array) -> Array:
    """Return the axes right, up and towards the viewer as columns (..., 3, 3): local to global."""
    right = perpendicular(view)
    return np.stack([right, np.cross(view, right), view], axis=-1)


def from_normal(n: Vector, at_rim: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return g_normal^-1, the point that shows a local normal; one that faces away goes to the nearest rim point."""
    xp = namespace(n[0])
    length = xp.sqrt(xp.maximum(n[0] * n[0] + n[1] * n[1], 1e-30))
    scale = xp.where(n[2] > 0, 1.0, 1 / length)
    x, y = n[0] * scale, n[1] * scale
    lost = (n[2] <= 0) & (length < 1e-6)
    return xp.where(lost, at_rim[0], x), xp.where(lost, at_rim[1], y)


def from_mirror(r: Vector, at_rim: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return g_mirror^-1, the point that shows a local direction; `at_rim` for the one that all rim points show."""
    xp = namespace(r[0])
    square = r[0] * r[0] + r[1] * r[1] + (r[2] + 1) * (r[2] + 1)
    scale = 1 / xp.sqrt(xp.maximum(square, 1e-30))
    lost = square < 1e-12
    return xp.where(lost, at_rim[0], r[0] * scale), xp.where(lost, at_rim[1], r[1] * scale)


def look_up(table: Any, size: int, p: tuple[Any, Any], first: int = 0) -> Any:
    """Interpolate bilinearly at points of the disk.

    Parameters
    ----------
    table : drjit Float
        Maps (k, size, size, 4), flat.
    p : pair of drjit Float
    first : int
        Which of the maps.

    Returns
    -------
    drjit Array4f
    """
    import drjit as dr
    from drjit.llvm import Array4f, Float, UInt32

    u = dr.clip((p[0] + 1) * (0.5 * size) - 0.5, 0, size - 1)
    v = dr.clip((1 - p[1]) * (0.5 * size) - 0.5, 0, size - 1)
    left, top = dr.minimum(UInt32(u), size - 2), dr.minimum(UInt32(v), size - 2)
    fx, fy = u - Float(left), v - Float(top)
    start = (first * size + top) * size + left

    def texel(offset: int) -> Any:
        return dr.gather(Array4f, table, start + offset)

    above = dr.fma(fx, texel(1), (1 - fx) * texel(0))
    below = dr.fma(fx, texel(size + 1), (1 - fx) * texel(size))
    return dr.fma(fy, below, (1 - fy) * above)


def padded(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Lay colours (..., 3) out as four floats, which are one gather."""
    out = np.zeros((*values.shape[:-1], 4), np.float32)
    out[..., :3] = values
    return out
