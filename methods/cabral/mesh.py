"""The tessellated disk: the warp at a few vertices, linear between them, as the paper draws it (sec. 3.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array
from methods.cabral import spheremap


@dataclass(frozen=True, eq=False)
class DiskMesh:
    """A tessellated disk.

    Attributes
    ----------
    vertices : (v, 2)
        Points of the disk, rings at sin(pi k / 2 n): finer towards the rim, as the warps bend more there.
    corners : (texels, 4) uint32; shares : (texels, 4) float32
        The triangle that each texel lies in and its barycentric coordinates, the fourth of each unused.
    """

    vertices: Array
    corners: NDArray[np.uint32]
    shares: NDArray[np.float32]


def disk_mesh(rings: int, size: int) -> DiskMesh:
    """Return the disk of `rings` rings of 4 `rings` vertices for maps of `size` x `size` texels."""
    from scipy.spatial import Delaunay

    radius = np.sin(np.pi / 2 * np.arange(1, rings + 1) / rings)
    angle = 2 * np.pi * np.arange(4 * rings) / (4 * rings)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    vertices = np.concatenate([[[0.0, 0.0]], (radius[:, None, None] * circle).reshape(-1, 2)])
    p = spheremap.texels(size).reshape(-1, 2)
    p = p * np.minimum(1, np.cos(np.pi / (4 * rings)) / np.maximum(np.linalg.norm(p, axis=1, keepdims=True), 1e-9))
    triangles: Any = Delaunay(vertices)
    found = triangles.find_simplex(p, tol=1e-9)
    to_shares = triangles.transform[found]
    first = np.einsum("nij,nj->ni", to_shares[:, :2], p - to_shares[:, 2])
    shares = np.concatenate([first, 1 - first.sum(1, keepdims=True), 0 * first[:, :1]], axis=1)
    corners = np.concatenate([triangles.simplices[found], np.zeros((len(p), 1), int)], axis=1)
    return DiskMesh(vertices, corners.astype(np.uint32), shares.astype(np.float32))
