"""Local, deformable PRT: sums of zonal lobes at each vertex, whose axes turn with it; and its simpler relatives."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array
from envbench.errors import BadInput
from methods.ldprt import fit, shade, table
from methods.ldprt.diffuse import Diffuse, Lit, chosen
from methods.ldprt.lobes import Lobes, stored_directly
from methods.ldprt.transfer import Transfer


@dataclass(frozen=True)
class Zonal(Diffuse):
    """Transfer as zonal lobes (Sloan, Luna and Snyder 2005, eq. 11).

    Attributes
    ----------
    table : bool
        Read e_l(s) from a 64 x 32 table made of the light (eqs. 24 and 25), instead of summing harmonics (eq. 13).
    """

    table: bool = False

    def store(self, transfer: Transfer) -> tuple[Any, dict[str, Any]]:
        lobes = self.fitted(transfer.vectors)
        off = lobes.vectors() - transfer.vectors
        error = float(np.sqrt((off**2).sum() / (transfer.vectors**2).sum()))
        return shade.pack(lobes.axes, lobes.coefficients, lobes.direct), {"lobes": lobes.count, "fit error": error}

    @abstractmethod
    def fitted(self, vectors: Array) -> Lobes:
        """Return the lobes of transfer vectors (V, n^2)."""

    def specialise(self, light: Array) -> Any:
        return table.build(light, self.order) if self.table else None

    def evaluate(self, lit: Lit, vertex: NDArray[np.integer], rotations: Array | None) -> NDArray[np.float32]:
        lobes = chosen(lit.asset.stored, vertex)
        if self.table:
            return shade.specialised(lobes, lit.light, lit.extra, rotations)
        return shade.evaluated(lobes, lit.light, rotations)


@dataclass(frozen=True)
class LDPRT(Zonal):
    """N lobes about fitted axes at each vertex; DC, and from three lobes on the linear part, stored directly.

    Attributes
    ----------
    lobes : int
        N.
    restarts : int
        Most further starts of the fit at a vertex whose error is high.
    """

    lobes: int = 4
    restarts: int = 2

    name = "ldprt"
    summary = "stores transfer at vertices as a few zonal lobes, whose axes turn with the deforming surface"
    source = "Sloan, Luna and Snyder 2005, secs. 3 to 5"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.lobes <= 2 * self.order - 1:
            raise BadInput(
                f"lobes must lie in [1, {2 * self.order - 1}]: as many as the highest band of order {self.order}"
                f" holds. Got {self.lobes} instead."
            )
        if stored_directly(self.lobes) >= self.order**2:
            raise BadInput(f"{self.lobes} lobes need order > 2: what is below is stored directly. Got {self.order}.")
        if not 0 <= self.restarts <= 100:
            raise BadInput(f"restarts must lie in [0, 100]. Got {self.restarts} instead.")

    def fitted(self, vectors: Array) -> Lobes:
        return fit.fit(vectors, self.lobes, self.restarts)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(lobes=count) for count in (1, 2, 3, 4, 5)]


@dataclass(frozen=True)
class LinearLobe(Zonal):
    """One lobe about the axis of the transfer's linear part: no search at all."""

    name = "linear-lobe"
    summary = "stores one zonal lobe at each vertex, about the axis of the transfer's linear part"
    source = "Sloan, Luna and Snyder 2005, sec. 3.3 (the optimal linear lobe)"

    def fitted(self, vectors: Array) -> Lobes:
        return fit.optimal_linear(vectors)


@dataclass(frozen=True)
class BentNormal(Zonal):
    """The unshadowed cosine about the bent normal, times ambient occlusion: what engines store most often."""

    name = "bent-normal"
    summary = "stores a bent normal and an ambient occlusion at each vertex"
    source = "Fernando 2004 (GPU Gems, ch. 17), as in Sloan, Luna and Snyder 2005, sec. 2"

    def fitted(self, vectors: Array) -> Lobes:
        return fit.bent_normal(vectors)
