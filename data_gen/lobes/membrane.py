"""The lobe of a thin, diffusely translucent membrane (Sloan, Luna and Snyder 2005, eq. 22)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.polar import about
from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe


@dataclass(frozen=True, kw_only=True)
class Membrane(Lobe):
    """rho_hat = (max(N.L, 0) + alpha max(-N.L, 0)) / pi, seen from the front: light from behind shines through.

    It is whole, for its light comes from all around, and integrates to 1 + alpha.

    Attributes
    ----------
    transparency : float
        alpha in [0, 1]; 0 is Lambertian. Values of a map, one a direction, may stand in its place to evaluate them.
    """

    clipped: bool = False
    transparency: Any = 0.5

    centre = Centre.NORMAL

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.clipped:
            raise BadInput("a membrane has no horizon, as light from behind shines through; leave out 'clipped'.")
        if isinstance(self.transparency, int | float) and not 0 <= self.transparency <= 1:
            raise BadInput(f"membrane transparency must lie in [0, 1]. Got {self.transparency} instead.")

    @property
    def radially_symmetric(self) -> bool:
        return True

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], centre[0], self.transparency)
        cosine = dot(centre, light)
        return (xp.maximum(cosine, -self.transparency * cosine) / np.pi,)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        """Draw by the lobe itself: in front where u_0 < 1 / (1 + alpha), else behind, by the cosine."""
        xp = namespace(u[0], centre[0], self.transparency)
        scaled = (1 + self.transparency) * u[0]
        front = scaled < 1
        share = xp.where(front, scaled, (scaled - 1) / xp.maximum(self.transparency, 1e-30))
        share = xp.minimum(xp.maximum(share, 0.0), 1.0)
        cosine = xp.where(front, 1.0, -1.0) * xp.sqrt(share)
        return about(centre, cosine, xp.sqrt(1 - share), 2 * np.pi * u[1])

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return self.profile(light, view, centre, normal)[0] / (1 + self.transparency)

    def cone(self, eps: float) -> float:
        """Within theta <= pi / 2 lies sin^2(theta) / (1 + alpha).

        Behind, the lobe grows up to its other pole, and a cone that ended there would cut it at its peak: all is taken.
        """
        outside = eps * (1 + self.transparency) - self.transparency
        return float(np.arccos(np.sqrt(min(outside, 1.0)))) if outside >= 0 else float(np.pi)
