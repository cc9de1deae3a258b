"""Kautz and McCool's 3D textures: reflection maps of an azimuthally averaged BRDF, one for each angle of the view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, pi, sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.resample import downsampled
from envbench import harmonics
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.laws import WIDEST
from envbench.material import Centre, Lobe, Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene
from methods.kautz_mccool.average import Average, averaged
from methods.kautz_mccool.lookup import look_up
from methods.kautz_mccool.texture import summed, synthesised

Array = NDArray[np.float64]

MAX_BYTES = 2**31
"""Of all textures under one light."""
MAX_F = 511
MAX_ROWS = 512
"""S where none is given, at most."""
ROWS_PER_ORDER = 4
"""S / F where no S is given: bilinear lookup then leaves (pi / 4)^2 / 8 = 8 % of the highest frequency."""


@dataclass(frozen=True, eq=False)
class PreparedLobe:
    """A lobe's average, its zonal coefficients g_l (C, T, F + 1), the energy share all that misses, and S."""

    average: Average
    zonal: Array
    missing: float
    rows: int

    @property
    def order(self) -> int:
        """F."""
        return self.zonal.shape[2] - 1

    @property
    def bytes(self) -> int:
        """Size of the texture."""
        return 3 * 4 * 2 * self.rows**2 * len(self.average.shift)


@dataclass(frozen=True, eq=False)
class Texture3D:
    """One lobe's reflected radiance, `values` (S, 2 S, T, 3), over shifted central directions and theta_o."""

    centre: Centre
    shift: Array
    values: NDArray[np.float32]


@dataclass(frozen=True)
class KautzMcCool(Method):
    """Average each lobe over azimuth, prefilter the light with that for some theta_o, and look up trilinearly.

    Attributes
    ----------
    eps : float
        What prefiltering may leave out of the averaged BRDF: of its energy ("shrm"), of its integral ("angular").
    rows : int
        S; 0 takes 4 (F + 1), between 16 and 512.
    polar : int
        T, the number of angles theta_o; a radially symmetric lobe takes one.
    prefiltering : {"shrm", "angular"}
        By the terms q = 0 of a spherical harmonic reflection map, each theta_o to order F and none left out in p; or by
        summing the light's texels in the cone that holds 1 - eps of the average.
    shift : bool
        Average about the axis where the lobe's energy is, not about the central direction, for each theta_o.
    light_rows : int
        Rows to which "angular" reduces the light; 0 takes it as given.
    """

    eps: float = 0.01
    rows: int = 0
    polar: int = 16
    prefiltering: str = "shrm"
    shift: bool = True
    light_rows: int = 64

    name = "kautz-mccool"
    summary = "3D textures of the azimuthally averaged BRDF over central direction and theta_o; trilinear lookup"
    source = "Kautz and McCool 2000, as in Ramamoorthi and Hanrahan 2002, sec. 3.2 and appendix C"

    def __post_init__(self) -> None:
        if not 0 < self.eps < 1:
            raise BadInput(f"eps must lie in (0, 1). Got {self.eps} instead.")
        if self.rows and not 2 <= self.rows <= 4096:
            raise BadInput(f"rows must be 0 (chosen from F) or lie in [2, 4096]. Got {self.rows} instead.")
        if not 2 <= self.polar <= 256:
            raise BadInput(f"polar must lie in [2, 256]. Got {self.polar} instead.")
        if self.prefiltering not in ("shrm", "angular"):
            raise BadInput(f"prefiltering must be 'shrm' or 'angular'. Got '{self.prefiltering}' instead.")
        if self.light_rows and not 2 <= self.light_rows <= 8192:
            raise BadInput(f"light_rows must be 0 or lie in [2, 8192]. Got {self.light_rows} instead.")

    def declines(self, scene: Scene) -> str | None:
        if any(lobe.centre is Centre.TANGENT and lobe.clipped for lobe in scene.material.lobes):
            return (
                "a clipped lobe about the tangent also depends on the normal: its average over azimuth is another lobe."
            )
        return None

    def prepare(self, material: Material, geometry: Geometry) -> tuple[PreparedLobe, ...]:
        prepared = tuple(map(self._averaged, material.lobes))
        size = sum(p.bytes for p in prepared)
        if size > MAX_BYTES:
            raise BadInput(f"its textures would take {size / 2**30:.1f} GiB; raise eps, or lower rows or polar.")
        return prepared

    def relight(self, prepared: tuple[PreparedLobe, ...], environment: Environment) -> tuple[Texture3D, ...]:
        if self.prefiltering == "angular":
            light = downsampled(environment, self.light_rows) if self.light_rows else environment
            values = [summed(p.average, light.radiance, p.rows, self.eps) for p in prepared]
        else:
            order = max(p.order for p in prepared)
            coefficients = harmonics.analyse(environment.radiance, order)
            values = [synthesised(p.zonal, harmonics.truncate(coefficients, order, p.order), p.rows) for p in prepared]
        return tuple(Texture3D(p.average.centre, p.average.shift, v) for p, v in zip(prepared, values, strict=True))

    def shade(self, framed: tuple[Texture3D, ...], points: Points) -> NDArray[np.floating]:
        first, *others = (look_up(t.values, t.shift, t.centre, points) for t in framed)
        return sum(others, start=first)

    def predictions(self, prepared: tuple[PreparedLobe, ...], environment: Environment) -> dict[str, float]:
        """Energy of the BRDF lost to averaging, to linear interpolation in theta_o, and to truncation.

        Unshifted, averaging loses the terms q > 0. Lookup over central directions loses more. The energies of several
        lobes are added as if orthogonal.
        """
        totals = [p.average.over_views(p.average.total) for p in prepared]
        missing = sum(p.missing * total for p, total in zip(prepared, totals, strict=True))
        return {"BRDF energy of the azimuthal average": missing / sum(totals) if sum(totals) else 0.0}

    def describe(self, prepared: tuple[PreparedLobe, ...]) -> dict[str, Any]:
        return {
            "F": [p.order for p in prepared],
            "S": [p.rows for p in prepared],
            "T": [len(p.average.shift) for p in prepared],
            "energy lost to averaging": [p.average.missing for p in prepared],
            "largest shift in degrees": [float(np.degrees(np.abs(p.average.shift).max())) for p in prepared],
        }

    def tolerance(self, prepared: tuple[PreparedLobe, ...]) -> Tolerance:
        """Averaging keeps a lobe's integral, and theta_o does not change under a turn: only lookup and sums err.

        Constant light: linear interpolation of the integral over theta_o, an RMS over uniform (R, V) of which a few
        views may show three times as much. Turned light: bilinear lookup leaves d^2 / 8 of a curvature of 4 (light that
        varies over half a radian, as that of `envbench.laws`). A sum over texels loses the cone's eps, as much again at
        its edge, and at a pole (h / w)^2 / 12 for rows of height h <= w, the lobe's width.
        """
        averages = [p.average for p in prepared]
        error = sum(sqrt(a.over_views(a.uneven**2)) for a in averages)
        whole = sqrt(sum(a.over_views(a.integral**2) for a in averages))  # lobes are positive: no less than this
        constant = 3 * error / whole if whole > 0 else 0.0
        rotation = max(4 * (pi / p.rows) ** 2 / 8 for p in prepared)
        loss = 1e-3
        if self.prefiltering == "angular":
            narrowest = min(float(p.average.cone(exp(-1)).min()) for p in prepared)
            loss += 2 * self.eps + min(pi / (self.light_rows or 64) / narrowest, 1) ** 2 / 12
        return Tolerance(constant_light=min(constant + loss, WIDEST), rotation=min(rotation + loss, WIDEST))

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [
            cls(eps=0.1, polar=6),
            cls(eps=0.01, polar=8, shift=False),
            cls(eps=0.01, polar=8),
            cls(eps=0.001, polar=16),
            cls(eps=0.001, polar=32),
            cls(eps=0.01, rows=64, polar=16, prefiltering="angular"),
        ]

    def _averaged(self, lobe: Lobe) -> PreparedLobe:
        for highest in (63, MAX_F):  # most lobes need few degrees
            mean = averaged(lobe, self.polar, self.shift, highest)
            zonal = mean.zonal(highest)
            degree = (2 * np.arange(highest + 1) + 1) / (4 * pi)
            held = np.cumsum([mean.over_views(e) for e in ((zonal**2).sum(0) * degree).T])
            energy = mean.over_views(mean.energy)
            if held[-1] >= (1 - self.eps) * energy:
                break
        order = min(int(np.searchsorted(held, (1 - self.eps) * energy)), len(held) - 1)
        kept = mean.over_views(mean.energy_within(self.eps)) if self.prefiltering == "angular" else float(held[order])
        total = mean.over_views(mean.total)
        missing = mean.missing + (max(energy - kept, 0) / total if total > 0 else 0.0)
        rows = self.rows or min(max(ROWS_PER_ORDER * (order + 1), 16), MAX_ROWS)
        return PreparedLobe(mean, zonal[:, :, : order + 1].copy(), missing, rows)
