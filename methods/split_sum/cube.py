"""Cube maps with a border of one texel, so that bilinear lookup needs no neighbour face and shows no seam.

The border texels lie on their own face's plane, beyond its edge, and hold the same function of direction.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.cubemap import FACES
from envbench.directions import normalised, to_angles


def texels(size: int) -> NDArray[np.float64]:
    """Return (theta, phi) of all texels of six `size` x `size` faces and their borders, (6 (size + 2)^2, 2)."""
    a = (2 * np.arange(-1, size + 1) + 1) / size - 1
    face = np.stack([*np.meshgrid(a, a), np.ones((size + 2, size + 2))], -1)
    right_up_forward = np.einsum("fkc,ijc->fijk", FACES, face)
    return np.stack(to_angles(normalised(right_up_forward[..., [2, 0, 1]]).reshape(-1, 3)), -1)


def packed(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return values (k, 3) with a fourth, unused channel: four floats are one gather."""
    out = np.zeros((len(values), 4), np.float32)
    out[:, :3] = values
    return out


def look_up(cube: NDArray[np.float32], size: int, direction: Any) -> Any:
    """Interpolate a packed cube (6 (size + 2)^2, 4) bilinearly at directions, both Dr.Jit's ``Array3f``."""
    import drjit as dr
    from drjit.llvm import Array4f, Float, Int32, UInt32

    forward, right, up = direction
    across, high, deep = dr.abs(right), dr.abs(up), dr.abs(forward)
    sideways, upright = (across >= high) & (across >= deep), high >= deep
    # the inverse of `FACES`: per pair of faces, how far along and down its plane, and the distance to it
    a = dr.select(sideways, -forward * dr.sign(right), dr.select(upright, right, right * dr.sign(forward)))
    b = dr.select(sideways | ~upright, -up, forward * dr.sign(up))
    major = dr.select(sideways, across, dr.select(upright, high, deep))
    negative = dr.select(sideways, right, dr.select(upright, up, forward)) < 0
    face = dr.select(sideways, 0, dr.select(upright, 2, 4)) + dr.select(negative, 1, 0)

    x, y = ((0.5 * size) * (1 + c / major) + 0.5 for c in (a, b))  # texel 0 is the border
    left, top = (dr.clip(Int32(c), 0, size) for c in (x, y))
    fx, fy = x - left, y - top
    table, start = Float(cube.ravel()), (face * (size + 2) + top) * (size + 2) + left

    def texel(offset: int) -> Any:
        return dr.gather(Array4f, table, UInt32(start + offset))

    value = dr.lerp(dr.lerp(texel(0), texel(1), fx), dr.lerp(texel(size + 2), texel(size + 3), fx), fy)
    return value.xyz
