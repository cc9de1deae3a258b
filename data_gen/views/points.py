"""Places on a shape that queries are asked at: on the sphere in closed form, or on a mesh in its pose."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry.frames import surface_rotations, uv_tangents
from envbench.directions import Array, normalised, perpendicular, to_angles
from envbench.geometry import Geometry


@dataclass(frozen=True, eq=False)
class Spots:
    """What `envbench.geometry.Points` says of the shape alone: the same names, each (n, ...), or None for all."""

    position: Array
    normal: Array
    geometric_normal: Array
    tangent: Array
    rotation: Array | None = None
    triangle: NDArray[np.int32] | None = None
    barycentric: Array | None = None
    uv: Array | None = None

    def of(self, chosen: Any = slice(None)) -> dict[str, Any]:
        """Return the chosen spots by name, as `Points` takes them."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: None if array is None else array[chosen] for name, array in arrays.items()}


def on_mesh(geometry: Geometry, triangle: NDArray[np.int32], barycentric: Array) -> Spots:
    """Return places (n,) of a mesh in its pose, given on its triangles.

    The rotation takes the shading normal at rest to the posed one, and is tangentially nearest to the blend of the
    corners' rotations. The tangent follows growing u; where there is no u, it is `perpendicular` to the normal at rest,
    carried by the rotation.
    """
    rest, posed = geometry.mesh, geometry.posed.mesh
    assert rest is not None
    assert posed is not None
    corners = posed.triangles[triangle]

    def blend(attribute: Array) -> Array:
        return np.einsum("nk,nk...->n...", barycentric, attribute[corners])

    normal = _unit(blend(posed.normals), posed.normals[corners[:, 0]])
    tangent = perpendicular(normal)
    rotation = None
    if geometry.pose is not None:
        before = _unit(blend(rest.normals), rest.normals[corners[:, 0]])
        rotation = surface_rotations(before, normal, blend(geometry.pose.rotations))
        tangent = np.einsum("nij,nj->ni", rotation, perpendicular(before))
    if posed.uv is not None:
        along = blend(uv_tangents(posed))
        across = normalised(along - np.sum(along * normal, axis=1, keepdims=True) * normal)
        sound = np.abs(np.sum(across * normal, axis=1)) + np.abs(np.linalg.norm(across, axis=1) - 1) < 1e-9
        tangent = np.where(sound[:, None], across, tangent)
    a, b, c = (posed.vertices[corners[:, k]] for k in range(3))
    geometric = normalised(np.cross(b - a, c - a))
    uv = None if posed.uv is None else blend(posed.uv)
    return Spots(blend(posed.vertices), normal, geometric, tangent, rotation, triangle, barycentric, uv)


def equal(count: int) -> Array:
    """Return equal weights that sum to 1."""
    return np.full(count, 1 / count)


def sphere_uv(position: Array) -> Array:
    """Return (u, v) = (phi / 2 pi, theta / pi) of positions (n, 3) on the unit sphere, shape (n, 2)."""
    theta, phi = to_angles(position)
    return np.stack([phi / (2 * np.pi), theta / np.pi], axis=-1)


def _unit(blended: Array, instead: Array) -> Array:
    """Return unit normals, `instead` where the blend of opposite ones vanishes."""
    return normalised(np.where(np.linalg.norm(blended, axis=1, keepdims=True) > 1e-9, blended, instead))
