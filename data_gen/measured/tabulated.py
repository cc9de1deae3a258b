"""The lobe of a measured material: its table, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from data_gen.measured.half_vectors import HalfVectors, Reflected
from data_gen.measured.table import Table, coordinates
from envbench.arrays import dot, namespace
from envbench.directions import Array
from envbench.material import Centre, Lobe

_ANGLES = np.linspace(0, np.pi, 721)


@dataclass(frozen=True, kw_only=True)
class Tabulated(Lobe):
    """rho_hat = f(t, d, p) max(N.L, 0), f linear between the nodes of `table` (`data_gen.measured.table`).

    Zero unless N.L > 0 and N.V > 0, whole or clipped.
    """

    table: Table

    centre = Centre.REFLECTION
    channels = 3

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], view[0], normal[0])
        cosine = dot(normal, light)
        scale = xp.where((cosine > 0) & (dot(normal, view) > 0), cosine, 0.0)
        return tuple(f * scale for f in self.table.lookup(*coordinates(light, view, normal)))

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> tuple[Any, Any, Any]:
        return _sampler(self.table).sample(u, view, normal)

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        return _sampler(self.table).density(light, view, normal)

    def cone(self, eps: float) -> float:
        """The least angle that holds 1 - eps at every one of the sampler's views, plus their interval."""
        angle = _ANGLES[min(int(np.searchsorted(_held(self.table), 1 - eps)), len(_ANGLES) - 1)]
        return float(min(angle + _ANGLES[1], np.pi))


@lru_cache(maxsize=16)
def _sampler(table: Table) -> HalfVectors:
    return HalfVectors.of(table)


@lru_cache(maxsize=16)
def _held(table: Table) -> Array:
    return Reflected.of(table).within(_ANGLES)
