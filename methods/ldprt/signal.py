"""Spherical functions as polynomials: their bands, gradients and second derivatives at many axes at once.

Band l of a function, T_l(s) = sum_m t_lm y_lm(s), is a homogeneous harmonic polynomial of degree l, and so each of its
derivatives is one of degree l - 1: a vector of SH coefficients again. With dy_lm/ds_a = sum_m' D_m'm y_(l-1)m',

    D^a_m'm = (2 l + 1) int s_a y_(l-1)m'(s) y_lm(s) ds,

since s_a y_(l-1)m' holds y_lm with the weight r^l / (2 l + 1) d/ds_a (the part of degree l - 2 is orthogonal to it).
The points of a batch run along the last axis everywhere, so that NumPy's loops are long ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, from_angles
from envbench.real_harmonics import basis

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The second derivatives that are kept: d2/ds_a ds_b for a <= b."""


@lru_cache(maxsize=32)
def derivative(l: int) -> Array:
    """Return D^a, (3, 2 l - 1, 2 l + 1), which takes band l of a function to band l - 1 of its derivatives; l >= 1.

    Examples
    --------
    >>> (derivative(1)[2] / np.sqrt(3)).round(12).tolist()  # d/dz sqrt(3 / (4 pi)) z = sqrt(3) y_00
    [[0.0, 1.0, 0.0]]
    """
    z, weight = np.polynomial.legendre.leggauss(l + 1)  # exact up to degree 2 l + 1
    phi = 2 * np.pi * np.arange(2 * l + 1) / (2 * l + 1)
    s = from_angles(np.arccos(z)[:, None], phi).reshape(-1, 3)
    y = basis(l, s)
    w = np.repeat(weight, len(phi)) * 2 * np.pi / len(phi)
    D = (2 * l + 1) * np.einsum("k,ka,mk,nk->amn", w, s, y[(l - 1) ** 2 : l * l], y[l * l :])
    return np.where(np.abs(D) > 1e-12, D, 0.0)


@dataclass(frozen=True, eq=False)
class Signal:
    """Functions of which the bands l = `first` ... n - 1 are to be fitted, one along the last axis each.

    Parameters
    ----------
    first : int
    bands : tuple of (2 l + 1, V)
        t_lm of l = `first` ... n - 1.
    gradients : tuple of (3, 2 l - 1, V)
    curvatures : tuple of (6, 2 l - 3, V)
        In the order of `PAIRS`; empty for l = 1.
    """

    first: int
    bands: tuple[Array, ...]
    gradients: tuple[Array, ...]
    curvatures: tuple[Array, ...]

    @classmethod
    def of(cls, vectors: Array, first: int) -> Signal:
        """Take the bands l >= `first` >= 1 of SH vectors (V, n^2)."""
        n = int(np.sqrt(vectors.shape[1]))
        t = np.ascontiguousarray(vectors.T, dtype=np.float64)
        return cls.of_bands(tuple(t[l * l : (l + 1) ** 2] for l in range(first, n)), first)

    @classmethod
    def of_bands(cls, bands: tuple[Array, ...], first: int) -> Signal:
        """Take bands (2 l + 1, V) of l = `first` and on."""
        gradients: list[Array] = []
        curvatures: list[Array] = []
        for l, band in enumerate(bands, first):
            gradient = derivative(l) @ band
            gradients.append(gradient)
            if l > 1:
                curvatures.append(np.stack([derivative(l - 1)[b] @ gradient[a] for a, b in PAIRS]))
            else:
                curvatures.append(np.zeros((len(PAIRS), 0, band.shape[1])))
        return cls(first, bands, tuple(gradients), tuple(curvatures))

    @property
    def orders(self) -> range:
        """The bands l."""
        return range(self.first, self.first + len(self.bands))

    def __len__(self) -> int:
        return self.bands[0].shape[1]

    def energy(self) -> Array:
        """Return the squared length of the bands, (V,)."""
        return np.sum([np.einsum("mv,mv->v", band, band) for band in self.bands], axis=0)

    def chosen(self, at: NDArray[np.bool_] | NDArray[np.intp]) -> Signal:
        """Keep the points where `at` says so."""
        parts = ([part[..., at] for part in kind] for kind in (self.bands, self.gradients, self.curvatures))
        return Signal(self.first, *(tuple(kind) for kind in parts))
