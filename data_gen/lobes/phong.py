"""The normalised Phong lobe (RH 2002, sec. 6.3), about R, and the powers of a cosine that narrow lobes need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.polar import Vector, about
from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe

MAX_EXPONENT = 1e7
"""Beyond it (a lobe of 0.02 degrees) single precision no longer tells C.L from 1."""


@dataclass(frozen=True, kw_only=True)
class Phong(Lobe):
    """rho_hat = (s + 1) / (2 pi) max(R.L, 0)^s (RH 2002, sec. 6.3), s = `exponent`; whole, it integrates to 1."""

    exponent: float = 32.0

    centre = Centre.REFLECTION

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.exponent <= MAX_EXPONENT:
            raise BadInput(f"phong exponent must lie in [0, {MAX_EXPONENT:g}]. Got {self.exponent} instead.")

    @property
    def radially_symmetric(self) -> bool:
        return not self.clipped

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        return (phong_density(light, centre, self.exponent),)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> Vector:
        return phong_sample(u, centre, self.exponent)

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return phong_density(light, centre, self.exponent)

    def cone(self, eps: float) -> float:
        """Appendix D of RH 2002: cos theta* = eps^(1 / (s + 1))."""
        return float(np.arccos(eps ** (1 / (self.exponent + 1))))


def phong_density(light: Any, axis: Any, s: Any) -> Any:
    """Return (s + 1) / (2 pi) max(C.L, 0)^s, C the unit `axis`.

    cos^s is lost in rounding near the peak for large s: there 1 - cos is taken from the chord, |C - L|^2 = 2 (1 - cos).
    """
    xp = namespace(light[0], axis[0])
    cosine = dot(axis, light)
    chord = (axis[0] - light[0], axis[1] - light[1], axis[2] - light[2])
    deficit = 0.5 * dot(chord, chord)
    log_cosine = xp.where(deficit < 0.01, log1m(deficit), xp.log(xp.maximum(cosine, 1e-30)))
    return xp.where(cosine > 0, (s + 1) / (2 * np.pi) * xp.exp(s * log_cosine), 0.0)


def phong_sample(u: tuple[Any, Any], axis: Any, s: Any) -> Vector:
    """Draw from `phong_density`: cos theta = u^(1 / (s + 1)), its deficit from 1 by a series where it is small."""
    xp = namespace(u[0], axis[0])
    x = -xp.log(xp.maximum(u[0], 1e-30)) / (s + 1)
    deficit = xp.where(x < 0.1, x * (1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5)))), 1 - xp.exp(-x))
    return about(axis, 1 - deficit, xp.sqrt(deficit * (2 - deficit)), 2 * np.pi * u[1])


def log1m(x: Any) -> Any:
    """log(1 - x) for 0 <= x < 0.01 by its series, to 1e-8 relative."""
    return -x * (1 + x * (1 / 2 + x * (1 / 3 + x / 4)))
