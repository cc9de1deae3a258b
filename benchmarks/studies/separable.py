"""The two separable sums of RH 2002, sec. 6.1 and app. C, written out as products of matrices: the paper's algorithm.

    L_m(theta) = int L e^(-i m phi) dphi,   L_lm = int L_m f_lm sin(theta) dtheta           F S^2 and F^2 S steps
    B_m(alpha) = sum_l B_lm f_lm(alpha),    B = B_0 + 2 Re sum_{m > 0} B_m e^(i m beta)     F^2 S and F S^2 steps

What the transforms of ducc0 do by Fourier transforms, and so in a time that hardly depends on F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from envbench import latlong
from methods.shrm.legendre import associated


@dataclass(frozen=True, eq=False)
class Separable:
    """The functions of both sums on an S x S grid to order F: `f` (F + 1, F + 1, S) by m and l, `turns` (S, F + 1)."""

    f: NDArray[np.float32]
    turns: NDArray[np.complex64]
    solid: NDArray[np.float32]

    @classmethod
    def of(cls, order: int, rows: int, columns: int) -> Self:
        """Tabulate the functions: what is paid once for a grid and an order."""
        theta, phi = latlong.angles(rows, columns)
        f = associated(order, order, theta).astype(np.float32)
        turns = np.exp(1j * np.outer(phi, np.arange(order + 1))).astype(np.complex64)
        return cls(f, turns, latlong.solid_angles(rows, columns)[:, :1].astype(np.float32))

    def analyse(self, samples: NDArray[np.float32]) -> NDArray[np.complex64]:
        """Return L_lm of texels (S, S, 3) that count as point samples: (m, l, 3)."""
        weighted = np.moveaxis(samples, 2, 1) * self.solid[..., None]
        by_row = np.ascontiguousarray(np.moveaxis(weighted @ self.turns.conj(), 2, 0))  # (m, theta, 3)
        return np.matmul(self.f, by_row)

    def synthesise(self, coefficients: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Return the function of coefficients (m, l, 3) on the grid: (S, 3, S)."""
        by_row = np.matmul(np.swapaxes(self.f, 1, 2), coefficients)  # (m, alpha, 3)
        by_row[1:] *= 2
        by_row = np.ascontiguousarray(np.moveaxis(by_row, 0, 2))
        return by_row.real @ self.turns.real.T - by_row.imag @ self.turns.imag.T
