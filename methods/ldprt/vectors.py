"""Whole transfer vectors: turned at every point, the exact form of what lobes approximate; or not turned at all."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array
from envbench.errors import BadInput
from methods.ldprt import shade
from methods.ldprt.diffuse import Diffuse, Lit
from methods.ldprt.transfer import Transfer


@dataclass(frozen=True)
class Vectors(Diffuse):
    """Transfer as n^2 coefficients a vertex, in single precision."""

    def store(self, transfer: Transfer) -> tuple[Any, dict[str, Any]]:
        return transfer.vectors.astype(np.float32), {}

    def evaluate(self, lit: Lit, vertex: NDArray[np.integer], rotations: Array | None) -> NDArray[np.float32]:
        vectors = lit.asset.stored
        if len(vertex) != len(vectors) or not np.array_equal(vertex, np.arange(len(vectors))):
            vectors = vectors[vertex]
        return shade.static(vectors, lit.light) if rotations is None else self.turned(vectors, lit.light, rotations)

    @abstractmethod
    def turned(self, vectors: NDArray[np.float32], light: Array, rotations: Array) -> NDArray[np.float32]:
        """Return radiance (k, 3) where points turned from rest by `rotations` (k, 3, 3)."""


@dataclass(frozen=True)
class SHRotation(Vectors):
    """A full SH rotation at every point, by zxzxz.

    Attributes
    ----------
    turning : {"transfer", "light"}
        What is turned: the one vector of transfer, or, as the paper has it, the three of the light.
    """

    turning: str = "transfer"

    name = "sh-rotation"
    summary = "stores whole transfer vectors at vertices, and turns them by a full SH rotation at every point"
    source = "Sloan, Luna and Snyder 2005, sec. 3.4"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.turning not in list(shade.Turning):
            raise BadInput(f"turning must be one of 'transfer', 'light'. Got '{self.turning}' instead.")

    def turned(self, vectors: NDArray[np.float32], light: Array, rotations: Array) -> NDArray[np.float32]:
        return shade.full(vectors, light, rotations, shade.Turning(self.turning))


@dataclass(frozen=True)
class StaticPRT(Vectors):
    """Transfer as it was at rest, whatever the pose: right for shapes that do not move."""

    name = "static-prt"
    summary = "stores whole transfer vectors at vertices, and does not turn them"
    source = "Sloan, Kautz and Snyder 2002, as in Sloan, Luna and Snyder 2005, fig. 6"

    def turned(self, vectors: NDArray[np.float32], light: Array, rotations: Array) -> NDArray[np.float32]:
        return shade.static(vectors, light)
