"""Does a mesh bound a solid? Where it does, no ray from outside meets the back of a triangle."""

from __future__ import annotations

import numpy as np

from envbench.geometry import TriangleMesh


def is_closed(mesh: TriangleMesh) -> bool:
    """Tell whether as many triangles lie left of every edge as right of it, vertices at one place taken as one."""
    _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corners = place.ravel()[mesh.triangles].astype(np.int64)
    start, end = corners, np.roll(corners, -1, axis=1)
    count = int(corners.max()) + 1
    return bool(np.array_equal(np.sort((start * count + end).ravel()), np.sort((end * count + start).ravel())))
