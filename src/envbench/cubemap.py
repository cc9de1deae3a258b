"""Cube maps: six faces in the order +X, -X, +Y, -Y, +Z, -Z, each as OpenGL and Direct3D store it.

A cube shows the surroundings from inside with axes right, up and forward. As in a lat-long picture whose left edge is
phi = 0, forward is our +x, right is our +y and up is our +z.
"""

from __future__ import annotations

import numpy as np

from envbench.directions import Array, normalised

FACES: Array = np.array(
    [
        [(0, 0, 1), (0, -1, 0), (-1, 0, 0)],  # +X: (1, -b, -a)
        [(0, 0, -1), (0, -1, 0), (1, 0, 0)],  # -X: (-1, -b, a)
        [(1, 0, 0), (0, 0, 1), (0, 1, 0)],  # +Y: (a, 1, b)
        [(1, 0, 0), (0, 0, -1), (0, -1, 0)],  # -Y: (a, -1, -b)
        [(1, 0, 0), (0, -1, 0), (0, 0, 1)],  # +Z: (a, -b, 1)
        [(-1, 0, 0), (0, -1, 0), (0, 0, -1)],  # -Z: (-a, -b, -1)
    ],
    float,
)
"""Right, up and forward of the point (a, b) of each face, a to the right and b downwards in [-1, 1]: rows (a, b, 1)."""


def directions(size: int) -> Array:
    """Return the directions of the texel centres, shape (6, size, size, 3).

    Examples
    --------
    >>> directions(1)[:, 0, 0].astype(int).tolist()
    [[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]]
    """
    a = (2 * np.arange(size) + 1) / size - 1
    face = np.stack([*np.meshgrid(a, a), np.ones((size, size))], -1)
    right_up_forward = np.einsum("fkc,ijc->fijk", FACES, face)
    return normalised(right_up_forward[..., [2, 0, 1]])
