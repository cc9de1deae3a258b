"""Maps read bilinearly in a kernel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm

_PACKET = 4
"""Floats that one gather reads."""


class Bilinear:
    """A map (H, W, C), H and W at least 2."""

    def __init__(self, values: NDArray[np.floating]) -> None:
        llvm.find()
        from drjit.llvm import Float

        self.height, self.width, self.channels = values.shape
        self.packets = -(-self.channels // _PACKET)
        padded = np.zeros((self.height, self.width, self.packets * _PACKET), np.float32)
        padded[..., : self.channels] = values
        self.table = Float(padded.ravel())

    def at(self, y: Any, x: Any) -> list[Any]:
        """Return the C values at rows y in [0, H - 1] and columns x in [0, W - 1], samples at whole numbers."""
        import drjit as dr
        from drjit.llvm import Array4f, Int32, UInt32

        # clipped as integers, so that a NaN, too, reads inside the map
        top, left = dr.clip(Int32(y), 0, self.height - 2), dr.clip(Int32(x), 0, self.width - 2)
        fy, fx = y - top, x - left
        first = UInt32(top * self.width + left)
        corners = [
            ((first + (down * self.width + right)) * self.packets, (fy if down else 1 - fy) * (fx if right else 1 - fx))
            for down in (0, 1)
            for right in (0, 1)
        ]
        out: list[Any] = []
        for packet in range(self.packets):
            value = Array4f(0)
            for index, weight in corners:
                value = dr.fma(weight, dr.gather(Array4f, self.table, index + packet), value)
            out += list(value)
        return out[: self.channels]


class LatLong:
    """A map of directions (rows, columns, C), columns even; the meaning is `envbench.latlong`'s.

    A row beyond each pole, its own half-turned self, and a column beyond each end: no index has to be wrapped.
    """

    def __init__(self, values: NDArray[np.floating]) -> None:
        self.rows, self.columns = values.shape[:2]
        beyond = np.roll(values[[0, -1]], self.columns // 2, axis=1)
        whole = np.concatenate([beyond[:1], values, beyond[1:]])
        self.map = Bilinear(np.concatenate([whole[:, -1:], whole, whole[:, :1]], axis=1))

    def at(self, s: Any) -> list[Any]:
        """Return the C values at directions, an ``Array3f``."""
        import drjit as dr

        theta, phi = dr.atan2(dr.sqrt(s.x * s.x + s.y * s.y), s.z), dr.atan2(s.y, s.x)
        phi = dr.select(phi < 0, phi + 2 * np.pi, phi)
        return self.map.at(theta * (self.rows / np.pi) + 0.5, phi * (self.columns / (2 * np.pi)) + 0.5)
