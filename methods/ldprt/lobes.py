"""Sums of zonal lobes about free axes: spherical functions that are turned by turning their axes (eqs. 6, 7 and 10)."""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt

import numpy as np

from envbench.directions import Array
from envbench.errors import BadInput
from envbench.real_harmonics import basis

MAX_ORDER = 20
"""n: the bands l < n. The Gram matrices of the lobes are safe in double precision far beyond."""
FEWEST_WITH_LINEAR = 3
"""Lobes from which the linear coefficients are stored directly: three axes span them (sec. 3.3)."""
LINEAR = ((3, -1.0), (1, -1.0), (2, 1.0))
"""Where the x, y and z of the linear part lie, and their signs: y_11 = -k x, y_1-1 = -k y, y_10 = k z."""


def stored_directly(lobes: int) -> int:
    """Return how many SH coefficients are kept beside `lobes` lobes: DC, and from three lobes on the linear ones."""
    return 4 if lobes >= FEWEST_WITH_LINEAR else 1


def order_of(coefficients: int) -> int:
    """Return n of vectors of n^2 SH coefficients.

    Raises
    ------
    BadInput
        No square of an n in [1, `MAX_ORDER`].
    """
    n = isqrt(coefficients)
    if n * n != coefficients or not 1 <= n <= MAX_ORDER:
        raise BadInput(f"SH vectors must hold n^2 coefficients, n in [1, {MAX_ORDER}]. Got {coefficients} instead.")
    return n


def linear_part(vectors: Array) -> Array:
    """Return the linear coefficients (-t_11, -t_1-1, t_10) of vectors (V, n^2) as 3-vectors (V, 3) (sec. 3.3)."""
    return np.stack([sign * vectors[:, at] for at, sign in LINEAR], axis=-1)


@dataclass(frozen=True, eq=False)
class Lobes:
    """N zonal lobes at each of V points: t_lm = sum_i y_lm(s_i) g*_il, in the bands that are not stored directly.

    Parameters
    ----------
    axes : (V, N, 3)
        s_i, unit vectors.
    coefficients : (V, N, n)
        g*_il; zero in the bands stored directly.
    direct : (V, d)
        The first d SH coefficients themselves: d = 1 (DC) or 4 (DC and linear).

    Raises
    ------
    BadInput
        The shapes disagree, an axis is no unit vector, a value is not finite, or a band is stored twice.
    """

    axes: Array
    coefficients: Array
    direct: Array

    def __post_init__(self) -> None:
        V, N = self.axes.shape[:2] if self.axes.ndim == 3 else (-1, -1)
        if self.axes.shape != (V, N, 3) or N < 1:
            raise BadInput(f"lobe axes must have shape (V, N, 3), N >= 1. Got {self.axes.shape} instead.")
        if self.coefficients.ndim != 3 or self.coefficients.shape[:2] != (V, N) or not self.coefficients.shape[2]:
            raise BadInput(f"lobe coefficients must have shape ({V}, {N}, n). Got {self.coefficients.shape} instead.")
        if self.direct.ndim != 2 or len(self.direct) != V or self.direct.shape[1] not in (1, 4):
            raise BadInput(f"direct terms must have shape ({V}, 1 or 4). Got {self.direct.shape} instead.")
        order_of(self.order**2)
        for name in ("axes", "coefficients", "direct"):
            if not np.isfinite(getattr(self, name)).all():
                raise BadInput(f"lobe {name} must be finite. Got NaN or infinity at {_where(self, name)} instead.")
        length = np.linalg.norm(self.axes, axis=-1)
        if V and (worst := float(np.abs(length - 1).max())) > 1e-5:
            raise BadInput(f"lobe axes must be unit vectors. Got one whose length is {worst:.3g} off instead.")
        if self.direct_bands > self.order:
            raise BadInput(
                f"{self.direct.shape[1]} direct terms need n >= {self.direct_bands}. Got {self.order} instead."
            )
        if np.any(self.coefficients[:, :, : self.direct_bands]):
            raise BadInput("lobe coefficients must be zero in the bands stored directly. Got others instead.")

    def __len__(self) -> int:
        return len(self.axes)

    @property
    def count(self) -> int:
        """N."""
        return self.axes.shape[1]

    @property
    def order(self) -> int:
        """n: the bands are l = 0 ... n - 1."""
        return self.coefficients.shape[2]

    @property
    def direct_bands(self) -> int:
        """Bands stored directly."""
        return int(np.sqrt(self.direct.shape[1]))

    def vectors(self) -> Array:
        """Return the SH vectors (V, n^2) that the lobes mean (eq. 7)."""
        y = basis(self.order - 1, self.axes.reshape(-1, 3)).reshape(self.order**2, *self.axes.shape[:2])
        out = np.empty((len(self), self.order**2))
        out[:, : self.direct.shape[1]] = self.direct
        for l in range(self.direct_bands, self.order):
            band = slice(l * l, (l + 1) ** 2)
            out[:, band] = np.einsum("mvi,vi->vm", y[band], self.coefficients[:, :, l])
        return out

    def rotated(self, rotations: Array) -> Lobes:
        """Return the lobes turned by a rotation (V, 3, 3) each: axes and the direct linear part turn (eq. 10)."""
        if rotations.shape != (len(self), 3, 3):
            raise BadInput(
                f"rotations of {len(self)} points must have shape ({len(self)}, 3, 3). Got {rotations.shape}."
            )
        direct = self.direct.copy()
        if self.direct_bands > 1:
            turned = np.einsum("vab,vb->va", rotations, linear_part(self.direct))
            for component, (at, sign) in enumerate(LINEAR):
                direct[:, at] = sign * turned[:, component]
        return Lobes(np.einsum("vab,vib->via", rotations, self.axes), self.coefficients, direct)


def _where(lobes: Lobes, name: str) -> str:
    point = int(np.nonzero(~np.isfinite(getattr(lobes, name)))[0][0])
    return f"point {point}"
