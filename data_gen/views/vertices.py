"""The vertices of a mesh as queries: where transfer that is stored by vertex is exact, without interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry.frames import at_vertices
from data_gen.views import parameters as p
from data_gen.views.parameters import Vector
from data_gen.views.points import on_mesh
from envbench.directions import Array, normalised
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, TriangleMesh, Viewer


@dataclass(frozen=True, kw_only=True)
class Vertices:
    """Each vertex in the pose, weighted by a third of the area of its triangles; or `count` of them, evenly spread.

    Seen by a distant `direction`, or without one each along its own normal, which is all the same to a diffuse surface.
    A vertex is given on the adjoining triangle whose normal is nearest to its own. Left out, and counted, are those
    without area about them, and those whose shading or geometric normal faces away.
    """

    kind: ClassVar[str] = "vertices"

    count: int | None = None
    direction: Vector | None = None

    def __post_init__(self) -> None:
        if self.count is not None:
            p.integer("count", self.count, 1, 2**24)
        if self.direction is not None:
            object.__setattr__(self, "direction", p.direction("direction", self.direction))

    def points(self, geometry: Geometry, name: str) -> tuple[Points, Viewer | None]:
        """Give the queries."""
        mesh = geometry.posed.mesh
        if mesh is None:
            raise BadInput(f"view '{name}': '{geometry.name}' has no vertices; give a mesh, or uniform queries.")
        area, triangle, corner, agreement = _at_vertices(mesh)
        view = mesh.normals if self.direction is None else np.broadcast_to(self.direction, mesh.normals.shape)
        sound = (area > 0) & (agreement > 0)
        chosen = np.flatnonzero(sound)
        spots = on_mesh(geometry, triangle[chosen], np.eye(3)[corner[chosen]])
        towards = view[chosen]
        front = (np.sum(spots.normal * towards, axis=1) > 0) & (np.sum(spots.geometric_normal * towards, axis=1) > 0)
        if not front.any():
            raise BadInput(f"view '{name}' sees no vertex of '{geometry.name}'; give another direction.")
        kept = np.flatnonzero(front)
        if self.count is not None:
            kept = kept[np.unique(np.linspace(0, len(kept) - 1, min(self.count, len(kept))).round().astype(int))]
        weight = area[chosen[kept]]
        points = Points(
            **spots.of(kept), view=towards[kept], weight=weight / weight.sum(),
            notes=_notes(len(area), len(area) - len(chosen), int(np.count_nonzero(~front))),
        )  # fmt: skip
        return points, None if self.direction is None else Viewer(direction=self.direction)


def _at_vertices(mesh: TriangleMesh) -> tuple[Array, NDArray[np.int32], NDArray[np.int_], Array]:
    """Return of each vertex a third of the adjoining area, the triangle nearest to its normal, which of its corners
    the vertex is, and the cosine between the two normals; where there is no area, any triangle at cosine -1.
    """
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    area = at_vertices(np.linalg.norm(cross, axis=1)[:, None] / 6, mesh.triangles, len(mesh.vertices))[:, 0]
    vertex = mesh.triangles.T.ravel()
    side = np.tile(np.arange(len(mesh.triangles), dtype=np.int32), 3)
    cosine = np.sum(normalised(cross)[side] * mesh.normals[vertex], axis=1)
    cosine[np.linalg.norm(cross, axis=1)[side] == 0] = -1
    order = np.lexsort((cosine, vertex))  # by vertex, the best last
    last = order[np.flatnonzero(np.diff(vertex[order], append=-1))]
    triangle, corner = np.zeros(len(area), np.int32), np.zeros(len(area), int)
    best = np.full(len(area), -1.0)
    triangle[vertex[last]], corner[vertex[last]] = side[last], last // len(mesh.triangles)
    best[vertex[last]] = cosine[last]
    return area, triangle, corner, best


def _notes(count: int, degenerate: int, away: int) -> tuple[str, ...]:
    reasons = ((degenerate, "no triangle about them faces along their normal"), (away, "they face away"))
    return tuple(f"{n} of {count} vertices are left out: {reason}." for n, reason in reasons if n)
