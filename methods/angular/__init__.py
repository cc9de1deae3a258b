"""Angular prefiltering: the hemispherical integral, summed directly for every texel of a reflection map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, pi
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.resample import downsampled
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Lobe, Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene
from methods.angular import losses
from methods.angular.lookup import look_up
from methods.angular.prefilter import polar_nodes, prefilter, width

MAX_BYTES = 2**31
"""Of one lobe's maps."""


@dataclass(frozen=True, eq=False)
class ReflectionMaps:
    """One lobe's reflected radiance, `values` (rows, 2 rows, T, T, 3): over central and local view directions."""

    lobe: Lobe
    values: NDArray[np.float32]


@dataclass(frozen=True)
class Angular(Method):
    """Integrate over the light's texels in the cone that holds the lobe, for each texel of a lat-long map.

    A lobe that is radially symmetric about its central direction needs one map B(alpha, beta); any other needs T x T
    maps B(alpha, beta, theta_o, phi_o) over view directions in the frame of the central direction. The light's texels
    count as point samples with their solid angles, and what lies outside the cone is lost, not made up for: both are
    the method's own error. The work falls with the cone's solid angle, as 1 / s for a Phong lobe, until the lobe is as
    narrow as the light's texels: then these are sampled more finely, between each other bilinear. A lobe narrower than
    the map's texels sees light reduced to the map's own rows, so that no lamp falls between two of its samples.

    Attributes
    ----------
    light_rows : int
        S_L: the light is reduced to S_L x 2 S_L texels where it has more rows; 0 takes it as given.
    rows : int
        S_B: maps are S_B x 2 S_B.
    directions : int
        T, even: maps for T polar by T azimuthal view directions, where a lobe needs them.
    eps : float
        Share of the whole lobe's integral that the cone leaves out.
    """

    name = "angular"
    summary = (
        "stores reflection maps, one or T x T, each texel summed over the light in the lobe's cone; bilinear lookup"
    )
    source = "Ramamoorthi and Hanrahan 2002, sec. 6.2 (angular-space prefiltering) and appendix D (cone)"

    light_rows: int = 64
    rows: int = 32
    directions: int = 8
    eps: float = 0.01

    def __post_init__(self) -> None:
        if self.light_rows != 0 and not 2 <= self.light_rows <= 8192:
            raise BadInput(f"light_rows must be 0 or lie in [2, 8192]. Got {self.light_rows} instead.")
        if not 2 <= self.rows <= 2048:
            raise BadInput(f"rows must lie in [2, 2048]. Got {self.rows} instead.")
        if not 2 <= self.directions <= 64 or self.directions % 2:
            raise BadInput(f"directions must be even and lie in [2, 64]. Got {self.directions} instead.")
        if not 0 < self.eps < 1:
            raise BadInput(f"eps must lie in (0, 1). Got {self.eps} instead.")

    def declines(self, scene: Scene) -> str | None:
        for lobe in scene.material.lobes:
            if lobe.centre is Centre.TANGENT and lobe.clipped and not lobe.radially_symmetric:
                return (
                    "a clipped lobe about the tangent also depends on the normal: one dimension more than T x T maps."
                )
            size = 3 * 4 * 2 * self.rows**2 * self._views(lobe) ** 2
            if size > MAX_BYTES:
                return f"its maps would take {size / 2**30:.1f} GiB; lower rows or directions."
        return None

    def prepare(self, material: Material, geometry: Geometry) -> tuple[Lobe, ...]:
        """Nothing depends on the asset but which lobes there are."""
        return material.lobes

    def relight(self, prepared: tuple[Lobe, ...], environment: Environment) -> tuple[ReflectionMaps, ...]:
        """Sum every texel of every map."""
        shape = (self.rows, 2 * self.rows)
        return tuple(
            ReflectionMaps(
                lobe, prefilter(self._light(environment, lobe).radiance, lobe, shape, self.eps, self._views(lobe))
            )
            for lobe in prepared
        )

    def shade(self, framed: tuple[ReflectionMaps, ...], points: Points) -> NDArray[np.floating]:
        """Look up each lobe's map, bilinear in each pair of angles, and add."""
        return sum(
            (look_up(maps.values, maps.lobe.centre, points) for maps in framed[1:]),
            start=look_up(framed[0].values, framed[0].lobe.centre, points),
        )

    def describe(self, prepared: tuple[Lobe, ...]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for number, lobe in enumerate(prepared):
            views = self._views(lobe)
            label = f"{type(lobe).__name__.lower()} {number}" if len(prepared) > 1 else type(lobe).__name__.lower()
            out[f"{label}: maps"] = f"{views}x{views} of {2 * self.rows}x{self.rows}"
            out[f"{label}: cone"] = f"{degrees(lobe.cone(self.eps)):.1f} degrees"
        return out

    def tolerance(self, prepared: tuple[Lobe, ...]) -> Tolerance:
        """Allow for the grids.

        Constant light: what prefiltering loses, and what interpolation between T views gets wrong of a lobe's integral,
        a mean over views of which few queries may show twice. Rotation: the same, and h^2 / 8 of second derivatives
        over the map (4: light that varies over half a radian, as that of `envbench.laws`) and over phi_o (1).
        """
        constant, rotation = 0.0, 4 * (pi / self.rows) ** 2 / 8
        shares = losses.shares([((lobe,), lobe.centre) for lobe in prepared])
        for lobe, share in zip(prepared, shares, strict=True):
            lost = losses.of_prefiltering(lobe, self.eps, self.light_rows)
            if self._views(lobe) > 1:
                rows = self.light_rows or 64
                lost = max(lost, 2 * losses.of_ridges(lobe, self.eps, rows, self.directions))
                lost += 2 * losses.between_views(lobe, polar_nodes(lobe, self.directions, rows))
            constant += share * lost
        if max(map(self._views, prepared)) > 1:
            rotation += (2 * pi / self.directions) ** 2 / 8
        return Tolerance(constant_light=constant, rotation=constant + rotation)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [
            cls(light_rows=16, rows=16, directions=8, eps=0.03),
            cls(light_rows=32, rows=32, directions=8, eps=0.01),
            cls(light_rows=64, rows=40, directions=12, eps=0.003),
        ]

    def _light(self, environment: Environment, lobe: Lobe) -> Environment:
        rows = self.light_rows or environment.radiance.shape[0]
        return downsampled(environment, min(rows, self.rows) if width(lobe) < pi / self.rows else rows)

    def _views(self, lobe: Lobe) -> int:
        return 1 if lobe.radially_symmetric else self.directions
