"""The two separable sums of RH 2002, sec. 6.1 and app. C, written out as products of matrices: the paper's algorithm.

    L_m(theta) = int L e^(-i m phi) dphi,   L_lm = int L_m f_lm sin(theta) dtheta           F S^2 and F^2 S steps
    B_m(alpha) = sum_l B_lm f_lm(alpha),    B = B_0 + 2 Re sum_{m > 0} B_m e^(i m beta)     F^2 S and F S^2 steps

ducc0 takes the steps over phi by Fourier transforms, in a time that hardly depends on F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from envbench import latlong
from methods.shrm.legendre import associated

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Separable:
    """The functions of both sums on a grid to order F.

    `f` (m, l, rows); `turns` (2 (F + 1), columns): cos(m phi), then -sin(m phi); `solid` (rows, 1, 1).
    """

    f: Array
    turns: Array
    solid: Array

    @classmethod
    def of(cls, order: int, rows: int, columns: int) -> Self:
        """Tabulate the functions: what is paid once for a grid and an order."""
        theta, phi = latlong.angles(rows, columns)
        angle = np.arange(order + 1)[:, None] * phi
        turns = np.concatenate([np.cos(angle), -np.sin(angle)])
        solid = latlong.solid_angles(rows, columns)[..., None]
        return cls(*(a.astype(np.float32) for a in (associated(order, order, theta), turns, solid)))

    def analyse(self, samples: Array) -> Array:
        """Return L_lm of texels (rows, columns, 3) that count as point samples: (m, l, 6), Re and Im of r, g and b."""
        rows, columns, _ = samples.shape
        weighted = (samples * self.solid).transpose(0, 2, 1).reshape(-1, columns)  # one product, not one a row
        by_row = (weighted @ self.turns.T).reshape(rows, 3, 2, -1).transpose(3, 0, 2, 1)
        return np.matmul(self.f, by_row.reshape(len(self.f), len(samples), 6))

    def synthesise(self, coefficients: Array) -> Array:
        """Return the function of coefficients (m, l, 6) on the grid: (3, rows, columns)."""
        by_row = np.matmul(self.f.transpose(0, 2, 1), coefficients)  # (m, rows, 6)
        by_row[1:] *= 2
        by_row = by_row.reshape(*by_row.shape[:2], 2, 3).transpose(3, 1, 2, 0)
        return np.matmul(by_row.reshape(3, by_row.shape[1], -1), self.turns)
