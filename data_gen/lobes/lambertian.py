"""The Lambertian lobe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.polar import about
from envbench.arrays import dot, namespace
from envbench.material import Centre, Lobe


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
        return about(centre, xp.sqrt(u[0]), xp.sqrt(1 - u[0]), 2 * np.pi * u[1])

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return self.profile(light, view, centre, normal)[0]

    def cone(self, eps: float) -> float:
        return float(np.arccos(np.sqrt(eps)))
