"""The lobes of fibres (Kajiya and Kay 1989), about the tangent T: a mirror cone, and a diffuse part.

Both depend on the angles of L and V to T alone, so that q = 0 is exact (RH 2002, sec. 7.1). They are whole: a horizon
would bring N in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.phong import MAX_EXPONENT, log1m
from data_gen.lobes.polar import Vector, about
from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe


@dataclass(frozen=True, kw_only=True)
class _Fibre(Lobe):
    clipped: bool = False

    centre = Centre.TANGENT

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.clipped:
            raise BadInput("a kajiya-kay lobe has no horizon, as it depends on T alone; leave out 'clipped'.")

    @property
    def azimuthally_symmetric(self) -> bool:
        return True


@dataclass(frozen=True, kw_only=True)
class KajiyaKay(_Fibre):
    """rho_hat = max(cos(theta_i + theta_o - pi), 0)^s / A, theta_i and theta_o the angles of L and V to T.

    RH 2002, sec. 3.1 and 7.1, prints cos^s(theta_i - theta_o). L and V both point away from the fibre here, and its
    mirror cone is theta_i = pi - theta_o: the angle of the light is the one at which it travels. Taken from the other
    end of T, coefficients merely change sign with odd p, and orders and energies stay.

    A = 2 pi int cos^(s + 1) = 2 pi^(3/2) Gamma(s / 2 + 1) / Gamma(s / 2 + 3 / 2) makes the lobe of a view
    perpendicular to T integrate to 1; of other views less.
    """

    exponent: float = 32.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.exponent <= MAX_EXPONENT:
            raise BadInput(f"kajiya-kay exponent must lie in [1, {MAX_EXPONENT:g}]. Got {self.exponent} instead.")

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], view[0], centre[0])
        cosine, sine = _off_cone(light, view, centre)
        square = sine * sine  # near the cone, where cos^s is lost in rounding, cos = sqrt(1 - sin^2)
        log_cosine = xp.where(square < 0.01, 0.5 * log1m(square), xp.log(xp.maximum(cosine, 1e-30)))
        return (xp.where(cosine > 0, self._peak * xp.exp(self.exponent * log_cosine), 0.0),)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> Vector:
        """Draw the angle x to the mirror cone from the density ~ (1 + tan^2 x / k)^(-3/2) in tan x, and phi uniformly.

        k = 3 / (s + 2) gives it the curvature of cos^s x; it falls more slowly, so that weights stay bounded.
        """
        xp = namespace(u[0], view[0], centre[0])
        w = 2 * u[0] - 1
        off = xp.arctan2(math.sqrt(self._k) * w, xp.sqrt(xp.maximum(1 - w * w, 1e-14)))
        cosine, sine = _cosine_and_sine(view, centre)
        theta = np.pi - xp.arctan2(sine, cosine) + off
        exists = (theta > 0) & (theta < np.pi)
        drawn = about(centre, xp.cos(theta), xp.sin(theta), 2 * np.pi * u[1])
        return xp.where(exists, drawn[0], 0.0), xp.where(exists, drawn[1], 0.0), xp.where(exists, drawn[2], 0.0)

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        """p(L) = p(x) / (2 pi sin theta_i), p(x) = cos x / (2 sqrt(k)) / (cos^2 x + sin^2 x / k)^(3/2)."""
        xp = namespace(light[0], view[0], centre[0])
        cosine, sine = _off_cone(light, view, centre)
        spread = xp.maximum(cosine * cosine + sine * sine / self._k, 0.5)  # at least 1, but for no direction at all
        off = xp.maximum(cosine, 0.0) / (2 * math.sqrt(self._k) * spread * xp.sqrt(spread))
        return off / (2 * np.pi * xp.maximum(_cosine_and_sine(light, centre)[1], 1e-9))

    def cone(self, eps: float) -> float:
        """The mirror cone of a view along T lies at -T."""
        return np.pi

    @property
    def _k(self) -> float:
        return 3 / (self.exponent + 2)

    @property
    def _peak(self) -> float:
        half = self.exponent / 2
        return math.exp(math.lgamma(half + 1.5) - math.lgamma(half + 1)) / (2 * math.pi**1.5)


@dataclass(frozen=True, kw_only=True)
class KajiyaKayDiffuse(_Fibre):
    """rho_hat = sin(theta_i) / pi^2, theta_i the angle of L to T: radially symmetric about T; it integrates to 1."""

    @property
    def radially_symmetric(self) -> bool:
        return True

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        return (_cosine_and_sine(light, centre)[1] / np.pi**2,)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> Vector:
        """Draw uniformly over the sphere: a weight is then 4 sin(theta_i) / pi."""
        xp = namespace(u[0], centre[0])
        cosine = 2 * u[0] - 1
        return about(centre, cosine, xp.sqrt(4 * u[0] * (1 - u[0])), 2 * np.pi * u[1])

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return 1 / (4 * np.pi) + 0 * dot(light, centre)

    def cone(self, eps: float) -> float:
        """Within theta lies (theta - sin theta cos theta) / pi of it."""
        theta = np.linspace(0, np.pi, 20001)
        return float(np.interp(1 - eps, (theta - np.sin(theta) * np.cos(theta)) / np.pi, theta))


def _cosine_and_sine(direction: Any, axis: Any) -> tuple[Any, Any]:
    """Return cosine and sine of the angle to `axis`, the sine exact near the poles."""
    xp = namespace(direction[0], axis[0])
    d, c = direction, axis
    cross = (c[1] * d[2] - c[2] * d[1], c[2] * d[0] - c[0] * d[2], c[0] * d[1] - c[1] * d[0])
    return dot(c, d), xp.sqrt(dot(cross, cross))


def _off_cone(light: Any, view: Any, tangent: Any) -> tuple[Any, Any]:
    """Return cosine and sine of the angle theta_i + theta_o - pi between L and the mirror cone."""
    (cos_i, sin_i), (cos_o, sin_o) = _cosine_and_sine(light, tangent), _cosine_and_sine(view, tangent)
    return sin_i * sin_o - cos_i * cos_o, -(sin_i * cos_o + cos_i * sin_o)
