"""SHRM in local form: V in the frame of the central direction, read from stored lat-long maps."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Material
from envbench.method import Tolerance
from methods.shrm import lookup, maps, predictions
from methods.shrm.coefficients import LobeCoefficients, together
from methods.shrm.expansion import Expanded, Expansion, constant_light

MAX_BYTES = 2**31
"""Of all maps under one light."""
ROWS_PER_ORDER = 4
"""S / F where no S is given: bicubic lookup then errs by less than 1 % of the highest frequency (`lookup`)."""


@dataclass(frozen=True)
class Prepared:
    """The expansion, and the rows S of the maps of each of its sums."""

    expansion: Expanded
    rows: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class LobeMaps:
    """The maps B_pq of one lobe under one light: `planes` (3, K, S, 2 S) in the layout of `methods.shrm.maps`."""

    lobe: LobeCoefficients
    planes: NDArray[np.floating]


@dataclass(frozen=True)
class SHRM(Expansion):
    """Local SHRM: for each centre, maps B_pq(alpha, beta) of its direction, summed with Y_pq(theta_o, phi_o).

    Parameters
    ----------
    rows : int
        S; 0 takes 4 (F + 1), at least 16.
    """

    rows: int = 0

    name = "shrm"
    summary = "local spherical harmonic reflection maps, read from stored lat-long maps"
    source = "Ramamoorthi and Hanrahan 2002, eqs. 5, 6 and 14, appendix C"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows and not 4 <= self.rows <= 8192:
            raise BadInput(f"rows must be 0 (chosen from F) or lie in [4, 8192]. Got {self.rows} instead.")

    def prepare(self, material: Material, geometry: Geometry) -> Prepared:
        expansion = self.expand(material)
        size = sum(self._values(c) for c in expansion.sums) * np.dtype(self.precision).itemsize
        if size > MAX_BYTES:
            raise BadInput(f"its maps would take {size / 2**30:.1f} GiB; raise eps, lower rows, or take float32.")
        return Prepared(expansion, tuple(self._rows(c) for c in expansion.sums))

    def summed(self, lobes: Sequence[LobeCoefficients]) -> Sequence[LobeCoefficients]:
        """Sum lobes about one centre where that takes less: a narrow one with P = 0 is better kept by itself."""
        one = together(lobes)
        return [one] if self._values(one) <= sum(map(self._values, lobes)) else lobes

    def expansion(self, prepared: Prepared) -> Expanded:
        return prepared.expansion

    def relight(self, prepared: Prepared, environment: Environment) -> tuple[LobeMaps, ...]:
        sums = prepared.expansion.sums
        lights = prepared.expansion.light(environment.radiance.astype(self.precision, copy=False))
        return tuple(
            LobeMaps(c, maps.synthesise(c, light, rows))
            for c, light, rows in zip(sums, lights, prepared.rows, strict=True)
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

    def lookup(self, prepared: Prepared, stored: int) -> predictions.Lookup:
        return partial(lookup.loss, spacing=np.pi / prepared.rows[stored])

    def describe(self, prepared: Prepared) -> dict[str, Any]:
        return {**super().describe(prepared), "S": list(prepared.rows)}

    def tolerance(self, prepared: Prepared) -> Tolerance:
        """Under a turn only lookup errs: (3/128) (pi / 4)^4 of the top frequency; integrals: `constant_light`."""
        return Tolerance(linearity=1e-6, constant_light=constant_light(prepared.expansion), rotation=1e-2)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(eps=eps) for eps in (0.3, 0.1, 0.03, 0.01, 0.003, 0.001)]

    def _rows(self, lobe: LobeCoefficients) -> int:
        return self.rows or max(ROWS_PER_ORDER * (lobe.F + 1), 16)

    def _values(self, lobe: LobeCoefficients) -> int:
        return 3 * maps.planes(lobe.P, lobe.F, lobe.Q) * 2 * self._rows(lobe) ** 2
