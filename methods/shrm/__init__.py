"""Spherical harmonic reflection maps (Ramamoorthi and Hanrahan 2002), local form, read from stored maps."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene
from methods.shrm import maps
from methods.shrm.coefficients import MAX_F, MAX_P, LobeCoefficients, expand

MAX_BYTES = 2**31
"""Of all maps under one light."""
ROWS_PER_ORDER = 4
"""S / F where no S is given: bicubic lookup then errs by less than 1 % of the highest frequency (`lookup`)."""


@dataclass(frozen=True)
class PreparedLobe:
    """A lobe's coefficients and the resolution of its maps."""

    coefficients: LobeCoefficients
    rows: int

    def bytes(self, item: int) -> int:
        """Return what its maps take with `item` bytes a value."""
        return 3 * maps.planes(self.coefficients.P, self.coefficients.F) * 2 * self.rows**2 * item


@dataclass(frozen=True, eq=False)
class LobeMaps:
    """The maps B_pq of one lobe under one light: `planes` (3, K, S, 2 S) in the layout of `methods.shrm.maps`."""

    lobe: LobeCoefficients
    planes: NDArray[np.floating]


@dataclass(frozen=True)
class SHRM(Method):
    """Local SHRM: for each lobe, maps B_pq(alpha, beta) of its central direction, summed with Y_pq(theta_o, phi_o).

    Parameters
    ----------
    eps : float
        Energy of the BRDF that may be left out; F and P are the least orders that keep the rest.
    order, view_order : int or None
        F and P, if they are to be given instead.
    rows : int
        S; 0 takes 4 (F + 1), at least 16.
    precision : {"float64", "float32"}
    """

    eps: float = 0.01
    order: int | None = None
    view_order: int | None = None
    rows: int = 0
    precision: str = "float64"

    name = "shrm"
    summary = "local spherical harmonic reflection maps, read from stored lat-long maps"
    source = "Ramamoorthi and Hanrahan 2002, eqs. 5, 6 and 14, appendix C"

    def __post_init__(self) -> None:
        if not 0 < self.eps < 1:
            raise BadInput(f"eps must lie in (0, 1). Got {self.eps} instead.")
        for name, value, most in (("order", self.order, MAX_F), ("view_order", self.view_order, MAX_P)):
            if value is not None and not 0 <= value <= most:
                raise BadInput(f"{name} must lie in [0, {most}]. Got {value} instead.")
        if self.rows and not 4 <= self.rows <= 4096:
            raise BadInput(f"rows must be 0 (chosen from F) or lie in [4, 4096]. Got {self.rows} instead.")
        if self.precision not in ("float64", "float32"):
            raise BadInput(f"precision must be 'float64' or 'float32'. Got '{self.precision}' instead.")

    def declines(self, scene: Scene) -> str | None:
        if any(lobe.centre is Centre.TANGENT and lobe.clipped for lobe in scene.material.lobes):
            return "a lobe about the tangent, clipped at the horizon, is no function of the angles to the tangent"
        return None

    def prepare(self, material: Material, geometry: Geometry) -> tuple[PreparedLobe, ...]:
        expanded = (expand(lobe, self.eps, self.order, self.view_order) for lobe in material.lobes)
        prepared = tuple(PreparedLobe(c, self.rows or max(ROWS_PER_ORDER * (c.F + 1), 16)) for c in expanded)
        size = sum(p.bytes(np.dtype(self.precision).itemsize) for p in prepared)
        if size > MAX_BYTES:
            raise BadInput(f"its maps would take {size / 2**30:.1f} GiB; raise eps, lower rows, or take float32.")
        return prepared

    def relight(self, prepared: tuple[PreparedLobe, ...], environment: Environment) -> tuple[LobeMaps, ...]:
        order = max(p.coefficients.F for p in prepared)
        significant = max(p.coefficients.significant for p in prepared)
        radiance = environment.radiance.astype(self.precision, copy=False)
        light = harmonics.analyse(radiance, order, significant)
        return tuple(
            LobeMaps(c, maps.synthesise(c, harmonics.truncate(light, order, c.F), p.rows))
            for p in prepared
            for c in (p.coefficients,)
        )

    def shade(self, framed: tuple[LobeMaps, ...], points: Points) -> NDArray[np.floating]:
        out = np.empty((len(points), 3))
        lobes = [(stored, points.central(stored.lobe.centre)) for stored in framed]

        def part(chosen: slice) -> None:
            out[chosen] = sum(maps.read(s.lobe, s.planes, c[chosen], points.view[chosen]) for s, c in lobes)

        edges = np.linspace(0, len(points), harmonics.threads() + 1).astype(int)
        with ThreadPoolExecutor(harmonics.threads()) as pool:  # NumPy and SciPy let go of the interpreter's lock
            list(pool.map(part, map(slice, edges[:-1], edges[1:])))
        return out

    def predictions(self, prepared: tuple[PreparedLobe, ...], environment: Environment) -> dict[str, float]:
        """1 - captured BRDF energy (RH 2002, sec. 5.1); the energies of several lobes are added as if orthogonal."""
        total = sum(p.coefficients.total for p in prepared)
        missing = sum(p.coefficients.missing * p.coefficients.total for p in prepared)
        return {"captured BRDF energy": missing / total if total else 0.0}

    def describe(self, prepared: tuple[PreparedLobe, ...]) -> dict[str, Any]:
        return {
            "F": [p.coefficients.F for p in prepared],
            "P": [p.coefficients.P for p in prepared],
            "S": [p.rows for p in prepared],
            "missing energy": [p.coefficients.missing for p in prepared],
        }

    def tolerance(self, prepared: tuple[PreparedLobe, ...]) -> Tolerance:
        """Under a turn only lookup errs: (3/128) (pi / 4)^4 of the top frequency. An integral lacks what P leaves out.

        The latter is a mean over uniform (R, V); a few views may show three times as much.
        """
        missing = max(p.coefficients.missing_constant for p in prepared)
        return Tolerance(linearity=1e-6, constant_light=3 * np.sqrt(missing) + 1e-3, rotation=1e-2)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(eps=eps) for eps in (0.3, 0.1, 0.03, 0.01, 0.003, 0.001)]
