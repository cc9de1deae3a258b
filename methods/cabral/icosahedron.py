"""The views that maps are made for: vertices of an icosahedron, as it is or subdivided, and weights between them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array

SUBDIVISIONS = {12: 0, 42: 1, 162: 2}
"""How often each edge is halved, by the number of vertices."""


@lru_cache(maxsize=len(SUBDIVISIONS))
def sphere(count: int) -> tuple[Array, NDArray[np.int64]]:
    """Return the vertices (count, 3), unit, and the faces (20 * 4^k, 3), counter-clockwise from outside."""
    from trimesh.creation import icosphere

    mesh = icosphere(subdivisions=SUBDIVISIONS[count])
    vertices, faces = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)
    vertices.flags.writeable = faces.flags.writeable = False
    return vertices, faces


def subtended(count: int, direction: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the face that `direction` (3,) meets and its spherical barycentric weights (Cabral et al. 1999, sec. 3.4).

    A vertex's weight is the area of the spherical triangle that the direction forms with the two others, over the
    face's. Areas are spherical excesses, alpha + beta + gamma - pi, taken as

        tan(E / 2) = a.(b x c) / (1 + a.b + b.c + c.a)      (Van Oosterom and Strackee 1983)

    which needs no angle and so has no pole where two directions meet: at vertices and on edges. Weights sum to 1. From
    face to face they are continuous where the faces are mirror images in their edge, as all of an icosahedron are.

    Returns
    -------
    (3,) int, (3,) float64
        Vertices and weights.
    """
    vertices, faces = sphere(count)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    sides = np.stack([np.cross(p, q) @ direction for p, q in ((b, c), (c, a), (a, b))], axis=1)
    face = faces[int(np.argmax(sides.min(1)))]
    areas = np.array([excess(vertices[face[k - 2]], vertices[face[k - 1]], direction) for k in range(3)])
    return face, areas / areas.sum()


def excess(a: Array, b: Array, c: Array) -> float:
    """Return the area of the spherical triangle of three unit vectors (3,); 0 where they run clockwise."""
    return float(2 * np.arctan2(max(np.dot(a, np.cross(b, c)), 0.0), 1 + a @ b + b @ c + c @ a))


def longest_edge(count: int) -> float:
    """Return the angle in radians between neighbouring vertices, the largest there is."""
    vertices, faces = sphere(count)
    cosines = np.sum(vertices[faces] * vertices[np.roll(faces, 1, axis=1)], axis=-1)
    return float(np.arccos(cosines.min()))
