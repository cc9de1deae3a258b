"""The GGX lobe (Walter et al. 2007) with Smith's height-correlated shadowing and Schlick's Fresnel term."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.facets import Facets, Half, mirrored, schlick
from data_gen.lobes.polar import Vector, frame
from envbench.arrays import dot, namespace


@dataclass(frozen=True, kw_only=True)
class GGX(Facets):
    """rho_hat = D F G / (4 N.V), alpha = roughness^2 (Burley 2012; Karis 2013).

    D = alpha^2 / (pi ((N.H)^2 (alpha^2 - 1) + 1)^2), and G the height-correlated masking and shadowing of Smith
    (Heitz 2014). Single scattering: rough lobes reflect less than they receive, also for f0 = 1.
    """

    @property
    def alpha(self) -> float:
        """Width of the distribution of normals."""
        return self.roughness**2

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        """G / (4 N.L N.V) = 1 / (2 (N.L s(N.V) + N.V s(N.L))), s(x) = sqrt(alpha^2 + (1 - alpha^2) x^2)."""
        xp = namespace(light[0], view[0], normal[0])
        half, lit, seen = Half.of(light, view, normal), dot(normal, light), dot(normal, view)
        spread = lit * self._slope(xp, seen) + seen * self._slope(xp, lit)
        value = self._distribution(half) * lit / xp.maximum(2 * spread, 1e-30)
        value = xp.where((lit > 0) & (seen > 0), value, 0.0)
        return tuple(value * f for f in schlick(self.f0, half.view))

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> Vector:
        """Draw the normals that V sees, by spherical caps (Dupuy and Benyoub 2023): weights are F G / G1 <= 1."""
        xp = namespace(u[0], view[0], normal[0])
        a, (s, t) = self.alpha, frame(normal)
        x, y, z = a * dot(view, s), a * dot(view, t), dot(normal, view)
        length = xp.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        height = (1 - u[1]) * (1 + z) - z
        radius = xp.sqrt(xp.maximum(1 - height * height, 0.0))
        hx, hy = a * (x + radius * xp.cos(2 * np.pi * u[0])), a * (y + radius * xp.sin(2 * np.pi * u[0]))
        hz = xp.maximum(z + height, 0.0)
        scale = 1 / xp.sqrt(xp.maximum(hx * hx + hy * hy + hz * hz, 1e-30))
        half = tuple(scale * (hx * i + hy * j + hz * k) for i, j, k in zip(s, t, normal, strict=True))
        return mirrored(view, half, z > 0)

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        """p(L) = D G1 / (4 N.V) = D / (2 (N.V + s(N.V)))."""
        xp = namespace(light[0], view[0], normal[0])
        half, seen = Half.of(light, view, normal), dot(normal, view)
        value = self._distribution(half) / xp.maximum(2 * (seen + self._slope(xp, seen)), 1e-30)
        return xp.where(half.above & (seen > 0), value, 0.0)

    def _slope(self, xp: Any, cosine: Any) -> Any:
        return xp.sqrt(self.alpha**2 + (1 - self.alpha**2) * cosine * cosine)

    def _distribution(self, half: Half) -> Any:
        spread = half.cosine2 * self.alpha**2 + half.sine2
        return self.alpha**2 / (np.pi * spread * spread)
