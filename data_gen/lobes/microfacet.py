"""The simplified microfacet lobe (RH 2002, sec. 7.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.polar import about
from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe

MIN_SIGMA = 1e-4


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
        half = about(normal, xp.cos(theta), xp.sin(theta), 2 * np.pi * u[1])
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
