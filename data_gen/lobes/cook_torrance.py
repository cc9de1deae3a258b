"""The lobe of Cook and Torrance 1981: Beckmann's distribution and V-shaped grooves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.facets import Facets, Half, mirrored, schlick
from data_gen.lobes.polar import Vector, about
from envbench.arrays import dot, namespace


@dataclass(frozen=True, kw_only=True)
class CookTorrance(Facets):
    """rho_hat = D F G / (4 N.V), m = roughness.

    D = exp(-tan^2(theta_h) / m^2) / (pi m^2 cos^4(theta_h)), so that int D N.H dH = 1 (the 1981 paper's 1 / pi, in
    place of 1 / 4, goes with another normalisation of D), and G = min(1, 2 N.H N.V / V.H, 2 N.H N.L / V.H).
    F is Schlick's in place of Fresnel's, which would need an index of refraction for each colour.
    """

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], view[0], normal[0])
        half, lit, seen = Half.of(light, view, normal), dot(normal, light), dot(normal, view)
        groove, over = 2 * xp.sqrt(half.cosine2) / half.view, 1 / xp.maximum(seen, 1e-20)
        shadowed = xp.minimum(xp.minimum(over, groove), groove * xp.maximum(lit, 0.0) * over)  # G / N.V
        value = xp.where((lit > 0) & (seen > 0), self._distribution(xp, half) * shadowed / 4, 0.0)
        return tuple(value * f for f in schlick(self.f0, half.view))

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> Vector:
        """Draw H from D N.H, as tan^2(theta_h) = -m^2 log(1 - u): weights are F G V.H / (N.V N.H) <= 2."""
        xp = namespace(u[0], view[0], normal[0])
        square = -(self.roughness**2) * xp.log(xp.maximum(1 - u[0], 1e-30))
        cosine = 1 / xp.sqrt(1 + square)
        half = about(normal, cosine, cosine * xp.sqrt(square), 2 * np.pi * u[1])
        return mirrored(view, half, dot(normal, view) > 0)

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        """p(L) = D N.H / (4 V.H)."""
        xp = namespace(light[0], view[0], normal[0])
        half = Half.of(light, view, normal)
        value = self._distribution(xp, half) * xp.sqrt(half.cosine2) / (4 * half.view)
        return xp.where(half.above & (dot(normal, view) > 0), value, 0.0)

    def _distribution(self, xp: Any, half: Half) -> Any:
        cosine2, m2 = xp.maximum(half.cosine2, 1e-12), self.roughness**2
        return xp.exp(-half.sine2 / (cosine2 * m2)) / (np.pi * m2 * cosine2 * cosine2)
