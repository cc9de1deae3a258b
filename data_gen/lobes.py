"""The analytic lobes: Lambertian, normalised Phong, and the simplified microfacet model (RH 2002, sec. 6.3 and 7.1).

Each is written once, for NumPy and Dr.Jit alike; evaluation, sampling and density derive from the same few lines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe

MAX_EXPONENT = 1e7
"""Beyond it (a lobe of 0.02 degrees) single precision no longer tells C.L from 1."""
MIN_SIGMA = 1e-4


@dataclass(frozen=True, kw_only=True)
class Lambertian(Lobe):
    """rho_hat = max(N.L, 0) / pi: radially symmetric about N, and the same whole or clipped."""

    centre = Centre.NORMAL

    @property
    def radially_symmetric(self) -> bool:
        return True

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], centre[0])
        return (xp.maximum(dot(centre, light), 0.0) / np.pi,)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        xp = namespace(u[0], centre[0])
        return _about(centre, xp.sqrt(u[0]), 2 * np.pi * u[1])

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return self.profile(light, view, centre, normal)[0]

    def cone(self, eps: float) -> float:
        return float(np.arccos(np.sqrt(eps)))


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
        xp = namespace(light[0], centre[0])
        s = self.exponent
        cosine = dot(centre, light)
        # cos^s is lost in rounding near the peak for large s: take 1 - cos from the chord, |C - L|^2 = 2 (1 - cos)
        chord = (centre[0] - light[0], centre[1] - light[1], centre[2] - light[2])
        deficit = 0.5 * dot(chord, chord)
        log_cosine = xp.where(deficit < 0.01, _log1m(deficit), xp.log(xp.maximum(cosine, 1e-30)))
        return (xp.where(cosine > 0, (s + 1) / (2 * np.pi) * xp.exp(s * log_cosine), 0.0),)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        xp = namespace(u[0], centre[0])
        return _about(centre, xp.power(xp.maximum(u[0], 1e-30), 1 / (self.exponent + 1)), 2 * np.pi * u[1])

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return self.profile(light, view, centre, normal)[0]

    def cone(self, eps: float) -> float:
        """Appendix D of RH 2002: cos theta* = eps^(1 / (s + 1))."""
        return float(np.arccos(eps ** (1 / (self.exponent + 1))))


@dataclass(frozen=True, kw_only=True)
class Microfacet(Lobe):
    """rho_hat = exp(-(theta_h / sigma)^2) / (4 pi sigma^2), theta_h the angle of N and H (RH 2002, eq. 11)."""

    sigma: float = 0.2

    centre = Centre.REFLECTION

    def __post_init__(self) -> None:
        super().__post_init__()
        if not MIN_SIGMA <= self.sigma <= 10:
            raise BadInput(f"microfacet sigma must lie in [{MIN_SIGMA:g}, 10] radians. Got {self.sigma} instead.")

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], view[0], normal[0])
        theta = self._half_angle(light, view, normal)
        return (xp.exp(-((theta / self.sigma) ** 2)) / (4 * np.pi * self.sigma**2),)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        """Draw H with theta_h from the density ~ theta exp(-(theta / sigma)^2) on [0, pi/2], and mirror V about it."""
        xp = namespace(u[0], view[0], normal[0])
        theta = self.sigma * xp.sqrt(-xp.log(1 - u[0] * self._captured))
        half = _about(normal, xp.cos(theta), 2 * np.pi * u[1])
        cosine = dot(view, half)
        mirrored = tuple(xp.where(cosine > 0, 2 * cosine * h - v, 0.0) for h, v in zip(half, view, strict=True))
        return mirrored[0], mirrored[1], mirrored[2]

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        """p(L) = p(H) / (4 H.V), with p(H) = 2 theta e^(-(theta/sigma)^2) / (sigma^2 captured 2 pi sin theta)."""
        xp = namespace(light[0], view[0], normal[0])
        theta = self._half_angle(light, view, normal)
        half = (light[0] + view[0], light[1] + view[1], light[2] + view[2])
        cosine = 0.5 * xp.sqrt(dot(half, half))  # H.V = |L + V| / 2
        over_sine = xp.where(theta > 1e-4, theta / xp.sin(xp.maximum(theta, 1e-4)), 1.0)
        p_half = xp.exp(-((theta / self.sigma) ** 2)) * over_sine / (np.pi * self.sigma**2 * self._captured)
        return xp.where((theta < np.pi / 2) & (cosine > 1e-6), p_half / (4 * xp.maximum(cosine, 1e-6)), 0.0)

    @property
    def _captured(self) -> float:
        return float(-np.expm1(-((np.pi / 2 / self.sigma) ** 2)))

    def cone(self, eps: float) -> float:
        """Twice the half-angle theta_h that holds 1 - eps: a tilt of H by t turns L by at most 2 t.

        dL = 4 (H.V) dH weighs it by cos theta_h for a view along N and by sin theta_h at grazing: the wider counts.
        """
        return float(min(2 * max(self._tail(np.cos, eps), self._tail(np.sin, eps)), np.pi))

    def _tail(self, weight: Callable[[Any], Any], eps: float) -> float:
        theta = np.linspace(0, min(np.pi / 2, 8 * self.sigma), 20001)
        held = np.cumsum(np.exp(-((theta / self.sigma) ** 2)) * np.sin(theta) * weight(theta))
        return float(np.interp((1 - eps) * held[-1], held, theta))

    @staticmethod
    def _half_angle(light: Any, view: Any, normal: Any) -> Any:
        # atan2 of |N x H| and N.H with H unnormalised: accurate for small angles, in single precision too
        xp = namespace(light[0], view[0], normal[0])
        h = (light[0] + view[0], light[1] + view[1], light[2] + view[2])
        n = normal
        cross = (n[1] * h[2] - n[2] * h[1], n[2] * h[0] - n[0] * h[2], n[0] * h[1] - n[1] * h[0])
        return xp.arctan2(xp.sqrt(dot(cross, cross)), dot(n, h))


def _log1m(x: Any) -> Any:
    """log(1 - x) for 0 <= x < 0.01 by its series, to 1e-8 relative."""
    return -x * (1 + x * (1 / 2 + x * (1 / 3 + x / 4)))


def _about(axis: Any, cosine: Any, phi: Any) -> tuple[Any, Any, Any]:
    """Return the direction at a polar cosine and azimuth about `axis`, in the branchless frame of Duff et al. 2017."""
    xp = namespace(axis[0], cosine)
    sine = xp.sqrt(xp.maximum(1 - cosine * cosine, 0.0))
    x, y = sine * xp.cos(phi), sine * xp.sin(phi)
    sign = xp.where(axis[2] >= 0, 1.0, -1.0)
    a = -1 / (sign + axis[2])
    b = axis[0] * axis[1] * a
    s = (1 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0])
    t = (b, sign + axis[1] * axis[1] * a, -axis[1])
    return (
        x * s[0] + y * t[0] + cosine * axis[0],
        x * s[1] + y * t[1] + cosine * axis[1],
        x * s[2] + y * t[2] + cosine * axis[2],
    )
