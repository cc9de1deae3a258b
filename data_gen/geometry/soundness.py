"""From arrays of a file to a mesh that can be used: what is mended is said, what cannot be is refused.

Vertices at one place, to the last bit, are one point of the surface: copies come from seams of texture and normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, normalised
from envbench.errors import BadInput
from envbench.geometry import TriangleMesh

NO_AREA = 1e-14
"""A triangle whose area is below this share of the squared diagonal has none."""
HULL_GAP = 1e-6
"""A closed mesh that fills all but this share of its hull's volume is convex (single precision leaves about 1e-7)."""

Triangles = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Sound:
    """A mesh that can be used: which of the file's vertices were `kept`, whether it is closed, and what was done."""

    mesh: TriangleMesh
    kept: NDArray[np.int_]
    closed: bool
    convex: bool
    notes: tuple[str, ...]


def mended(
    vertices: Array, triangles: NDArray[np.integer], normals: Array | None, uv: Array | None, file: str
) -> Sound:
    """Drop what is of no use, turn what is wound wrongly, and give normals where there are none.

    Raises
    ------
    BadInput
        No triangle has an area, or triangles that face each other share a vertex without a normal.
    """
    notes: list[str] = []
    used = np.zeros(len(vertices), bool)
    used[triangles.ravel()] = True
    extent = float(np.linalg.norm(np.ptp(vertices[used], axis=0)))
    solid = np.linalg.norm(_cross(vertices, triangles), axis=1) > 2 * NO_AREA * extent**2
    if not solid.any():
        raise BadInput(f"mesh '{file}' holds no triangle of positive area; export it with its faces.")
    if not solid.all():
        notes.append(f"{np.count_nonzero(~solid)} triangles without area were dropped from '{file}'.")
    triangles = triangles[solid]
    used[:] = False
    used[triangles.ravel()] = True
    kept = np.flatnonzero(used)
    if len(kept) < len(vertices):
        notes.append(f"{len(vertices) - len(kept)} unused vertices were dropped from '{file}'.")
    triangles = (np.cumsum(used) - 1)[triangles].astype(np.int32)
    vertices, normals, uv = vertices[kept], None if normals is None else normals[kept], None if uv is None else uv[kept]

    places = welded(vertices)
    triangles, closed = _wound(vertices, triangles, places, file, notes)
    convex = closed and _fills_its_hull(vertices, triangles)
    normals = _shading_normals(vertices, triangles, places, normals, file, notes)
    return Sound(TriangleMesh(vertices, triangles, normals, uv), kept, closed, convex, tuple(notes))


def welded(vertices: Array) -> NDArray[np.int_]:
    """Return the number of each vertex's place, (V,)."""
    order = np.lexsort(vertices.T)
    fresh = np.any(np.diff(vertices[order], axis=0) != 0, axis=1)
    places = np.empty(len(vertices), int)
    places[order] = np.concatenate([[0], np.cumsum(fresh)])
    return places


def is_convex(vertices: Array, triangles: Triangles) -> bool:
    """Tell whether triangles close a convex solid, from outside."""
    edges = _edges(triangles, welded(vertices))
    return edges.closed and not edges.along.any() and _fills_its_hull(vertices, triangles)


def angle_weighted_normals(vertices: Array, triangles: Triangles, places: NDArray[np.int_]) -> Array:
    """Return the normals (V, 3): means of the adjoining triangles' normals, weighted by the angle of the corner."""
    faces = normalised(_cross(vertices, triangles))
    summed = np.zeros((int(places.max()) + 1, 3))
    for k in range(3):
        to_next, to_last = (
            normalised(vertices[triangles[:, (k + step) % 3]] - vertices[triangles[:, k]]) for step in (1, 2)
        )
        chord, across = np.linalg.norm(to_next - to_last, axis=1), np.linalg.norm(to_next + to_last, axis=1)
        weighted = 2 * np.arctan2(chord, across)[:, None] * faces
        corner = places[triangles[:, k]]
        summed += np.stack([np.bincount(corner, column, len(summed)) for column in weighted.T], axis=1)
    # an angle-weighted sum is of order 1; what is left of triangles that face each other is rounding
    summed[np.linalg.norm(summed, axis=1) < 1e-9] = 0
    return normalised(summed)[places]


def _cross(vertices: Array, triangles: NDArray[np.integer]) -> Array:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


@dataclass(frozen=True, eq=False)
class _Edges:
    """How many triangles meet at each edge, and the edges where two do.

    `sides` (E, 2) are those two's sides (F k + f is side k of triangle f), and `along` (E,) tells whether both run the
    same way along the edge, so that one of the two is wound wrongly.
    """

    counts: NDArray[np.int_]
    sides: NDArray[np.int_]
    along: NDArray[np.bool_]

    @property
    def closed(self) -> bool:
        return bool((self.counts == 2).all())


def _edges(triangles: Triangles, places: NDArray[np.int_]) -> _Edges:
    corners = places[triangles]
    start, end = corners.T.ravel(), corners[:, [1, 2, 0]].T.ravel()
    code = np.minimum(start, end) * (int(places.max()) + 1) + np.maximum(start, end)
    order = np.argsort(code, kind="stable")
    first = np.flatnonzero(np.diff(code[order], prepend=-1))
    counts = np.diff(first, append=len(code))
    pairs = first[counts == 2]
    sides = np.stack([order[pairs], order[pairs + 1]], axis=1)
    return _Edges(counts, sides, start[sides[:, 0]] == start[sides[:, 1]])


def _wound(
    vertices: Array, triangles: Triangles, places: NDArray[np.int_], file: str, notes: list[str]
) -> tuple[Triangles, bool]:
    """Make neighbours' windings agree, turn a closed mesh outward, and tell whether it is closed."""
    edges = _edges(triangles, places)
    crowded = np.count_nonzero(edges.counts > 2)
    if crowded:
        notes.append(f"'{file}' has {crowded} edges where more than two triangles meet; it is taken for open.")
    if edges.along.any():
        turned = _against(edges.sides % len(triangles), edges.along, len(triangles))
        if turned is None:
            notes.append(f"'{file}' has no two sides (it is one-sided), so its triangles face either way.")
            return triangles, False
        notes.append(f"{np.count_nonzero(turned)} triangles of '{file}' were wound against the others; turned.")
        triangles = np.where(turned[:, None], triangles[:, ::-1], triangles)
    if not edges.closed:
        return triangles, False
    if _volume(vertices, triangles) < 0:
        notes.append(f"'{file}' was inside out; its triangles were turned.")
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return triangles, True


def _against(pairs: NDArray[np.int_], along: NDArray[np.bool_], count: int) -> NDArray[np.bool_] | None:
    """Tell which triangles to turn so that neighbours agree: the fewer of each connected piece. None if none can.

    Each triangle stands twice, as it is (f) and turned (f + count); neighbours that agree are joined as they are and
    turned, others crosswise. In a piece with two sides the copies then fall into two components, its two orientations.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    other = pairs[:, 1] + np.where(along, count, 0), pairs[:, 1] + np.where(along, 0, count)
    rows, columns = np.concatenate([pairs[:, 0], pairs[:, 0] + count]), np.concatenate(other)
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(2 * count, 2 * count))
    pieces, label = connected_components(graph, directed=False)
    as_is, turned = label[:count], label[count:]
    if (as_is == turned).any():
        return None
    votes = np.bincount(as_is, minlength=pieces)  # of the two orientations, the one that more triangles have
    return (votes[turned] > votes[as_is]) | ((votes[turned] == votes[as_is]) & (turned < as_is))


def _volume(vertices: Array, triangles: Triangles) -> float:
    a, b, c = (vertices[triangles[:, k]] - vertices.mean(0) for k in range(3))
    return float(np.sum(a * np.cross(b, c))) / 6


def _fills_its_hull(vertices: Array, triangles: Triangles) -> bool:
    from scipy.spatial import ConvexHull, QhullError

    volume = _volume(vertices, triangles)
    if volume <= 0:
        return False
    try:
        return float(ConvexHull(vertices).volume) * (1 - HULL_GAP) <= volume
    except QhullError:  # flat, to its precision
        return False


def _shading_normals(
    vertices: Array, triangles: Triangles, places: NDArray[np.int_], normals: Array | None, file: str, notes: list[str]
) -> Array:
    """Return unit normals (V, 3) that point to the same side as the triangles: the file's, or computed ones."""
    if normals is not None and (np.linalg.norm(normals, axis=1) > 0).all():
        normals = normalised(normals)
        if np.sum(_cross(vertices, triangles) * normals[triangles].sum(1)) < 0:
            notes.append(f"the normals of '{file}' opposed its triangles; they were turned.")
            normals = -normals
        return normals
    computed = angle_weighted_normals(vertices, triangles, places)
    if not computed.any(axis=1).all():
        raise BadInput(f"mesh '{file}' has a vertex whose triangles face each other; give it normals.")
    notes.append(f"normals of '{file}' were computed from its triangles.")
    return computed
