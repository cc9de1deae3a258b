"""From what is stored at vertices to points: at a vertex itself, or blended over the corners of a triangle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array
from envbench.errors import BadInput
from envbench.geometry import Points


@dataclass(frozen=True, eq=False)
class Corners:
    """The vertices that each of n points is shaded at, `vertex` (k, n), and their shares `weight` (k, n); k = 1 or 3.

    Lobes cannot be blended, but what they send back can: a point between vertices is shaded three times, with its own
    rotation.
    """

    vertex: NDArray[np.integer]
    weight: NDArray[np.float32]

    @classmethod
    def of(cls, points: Points, triangles: NDArray[np.int32]) -> Corners:
        """Return the corners of points on a mesh with these triangles; raises `BadInput` for points on no mesh."""
        if points.triangle is None or points.barycentric is None:
            raise BadInput("transfer is stored at vertices: give points on a mesh, with triangle and barycentrics.")
        vertex, share = triangles[points.triangle], points.barycentric
        if np.all(share.max(1) == 1):
            return cls(vertex[np.arange(len(share)), share.argmax(1)][None], np.ones((1, len(share)), np.float32))
        return cls(np.ascontiguousarray(vertex.T), np.ascontiguousarray(share.T, np.float32))

    @property
    def lanes(self) -> NDArray[np.integer]:
        """The vertex of each evaluation, (k n,)."""
        return self.vertex.ravel()

    def spread(self, values: Array) -> Array:
        """Repeat what belongs to the points (n, ...) for each evaluation, (k n, ...)."""
        return values if len(self.vertex) == 1 else np.concatenate([values] * len(self.vertex))

    def blended(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the blend (n, C) of what the evaluations (k n, C) gave."""
        if len(self.vertex) == 1:
            return values
        return np.einsum("kn,knc->nc", self.weight, values.reshape(*self.vertex.shape, -1))
