"""What a deformation does to normals and frames, from its gradient F = d posed / d rest at each vertex.

A surface element with normal n is carried by cof(F), the matrix of cofactors (det F times the inverse transpose):
cross(F a, F b) = cof(F) cross(a, b). So n' = cof(F) n normalised agrees with the posed triangles even where F folds
the shape (det F < 0), and exists where F is singular, unless the surface itself collapses to a curve or a point.

The rotation of a vertex takes n to n', and within the tangent planes it is the rotation nearest to F. Let (t, b, n)
and (t', b', n') be right-handed orthonormal frames, and A_ij = e'_i . F e_j for e = (t, b), e' = (t', b'). The rotation
by a that maximises tr(Rz(a)^T A) = (A_11 + A_22) cos a + (A_21 - A_12) sin a, the polar factor of A, has

    a = atan2(A_21 - A_12, A_11 + A_22).

With n' as above det A >= 0, so the two arguments vanish together only where A = 0. The frames are orthonormal whatever
F is, and so is R = (t', b', n') Rz(a) (t, b, n)^T.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, normalised, perpendicular
from envbench.geometry import TriangleMesh

COLLAPSED = 1e-9
"""An area factor below this share of the squared gradient's size is none: its direction is rounding."""


def cofactors(F: Array) -> Array:
    """Return the matrices of cofactors of F (n, 3, 3)."""
    return np.stack([np.cross(F[:, (i + 1) % 3], F[:, (i + 2) % 3]) for i in range(3)], axis=1)


def posed_normals(normals: Array, F: Array) -> Array:
    """Return the unit normals (n, 3) after a deformation of gradient F (n, 3, 3).

    Where the surface collapses, the normal is turned by the rotation nearest to F.
    """
    carried = np.einsum("nij,nj->ni", cofactors(F), normals)
    size = np.einsum("nij,nij->n", F, F)
    lost = np.linalg.norm(carried, axis=1) <= COLLAPSED * size
    if lost.any():
        carried[lost] = np.einsum("nij,nj->ni", nearest_rotations(F[lost]), normals[lost])
    return normalised(carried)


def nearest_rotations(matrices: Array) -> Array:
    """Return the rotations (n, 3, 3) nearest to `matrices` in the Frobenius norm: U diag(1, 1, det U V^T) V^T."""
    u, _, vt = np.linalg.svd(matrices)
    u[:, :, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[:, None]
    return u @ vt


def surface_rotations(normals: Array, posed: Array, F: Array) -> Array:
    """Return the rotations (n, 3, 3) that take unit `normals` to `posed` ones, tangentially nearest to F."""
    t = perpendicular(normals)
    b = np.cross(normals, t)
    # t turned along the arc from n to n': where F says nothing, the rotation is the shortest one
    cosine = np.sum(normals * posed, axis=1, keepdims=True)
    along = np.sum(t * posed, axis=1, keepdims=True)
    turned = t - np.where(cosine > -1 + 1e-6, along / np.maximum(1 + cosine, 1e-6), 0) * (normals + posed)
    turned = normalised(turned - np.sum(turned * posed, axis=1, keepdims=True) * posed)
    beside = np.cross(posed, turned)
    ft, fb = np.einsum("nij,nj->ni", F, t), np.einsum("nij,nj->ni", F, b)
    sine = np.sum(beside * ft, axis=1) - np.sum(turned * fb, axis=1)
    angle = np.arctan2(sine, np.sum(turned * ft, axis=1) + np.sum(beside * fb, axis=1))[:, None]
    first = np.cos(angle) * turned + np.sin(angle) * beside
    before = np.stack([t, b, normals], axis=1)
    after = np.stack([first, np.cross(posed, first), posed], axis=2)
    return np.einsum("nij,njk->nik", after, before)


def vertex_gradients(mesh: TriangleMesh, posed: Array) -> Array:
    """Return F (V, 3, 3) of a pose known by its vertices alone: the adjoining triangles' mean, by rest area.

    A triangle's gradient maps its edges to the posed ones, and its unit normal to the posed one.
    """
    rest, after = _edges(mesh.vertices, mesh.triangles), _edges(posed, mesh.triangles)
    area = np.linalg.norm(np.cross(rest[:, 0], rest[:, 1]), axis=1) / 2
    basis, image = (np.concatenate([e, normalised(np.cross(e[:, 0], e[:, 1]))[:, None]], axis=1) for e in (rest, after))
    basis[area == 0] = np.eye(3)
    gradients = area[:, None, None] * np.linalg.solve(basis, image).swapaxes(1, 2)
    summed = at_vertices(gradients.reshape(-1, 9), mesh.triangles, len(posed)).reshape(-1, 3, 3)
    total = at_vertices(area[:, None], mesh.triangles, len(posed))[:, 0]
    return summed / np.where(total > 0, total, 1)[:, None, None]


def uv_tangents(mesh: TriangleMesh) -> Array:
    """Return the unit directions (V, 3) of growing u, perpendicular to the normals; zero where the mesh has none.

    At a vertex, the mean over its triangles of dp/du by their area. There is none without uv, and where the uv of all
    adjoining triangles collapse.
    """
    if mesh.uv is None:
        return np.zeros_like(mesh.normals)
    edges = _edges(mesh.vertices, mesh.triangles)
    (u1, v1), (u2, v2) = ((mesh.uv[mesh.triangles[:, k]] - mesh.uv[mesh.triangles[:, 0]]).T for k in (1, 2))
    # e_k = u_k dp/du + v_k dp/dv for two edges: dp/du by Cramer's rule, of which the direction is wanted
    determinant = u1 * v2 - u2 * v1
    size = np.hypot(u1, v1) * np.hypot(u2, v2)
    sound = np.abs(determinant) > COLLAPSED * size
    along = np.sign(determinant)[:, None] * (v2[:, None] * edges[:, 0] - v1[:, None] * edges[:, 1])
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1, keepdims=True)
    summed = at_vertices(np.where(sound[:, None], area * normalised(along), 0), mesh.triangles, len(mesh.vertices))
    level = np.linalg.norm(summed, axis=1)
    flat = summed - np.sum(summed * mesh.normals, axis=1, keepdims=True) * mesh.normals
    return normalised(np.where((np.linalg.norm(flat, axis=1) > 1e-6 * level)[:, None], flat, 0))


def at_vertices(values: Array, triangles: NDArray[np.int32], count: int) -> Array:
    """Return the sums (V, C) at the vertices of the values (F, C) of the triangles that adjoin them."""
    corners = triangles.T.ravel()
    columns = [np.bincount(corners, np.tile(column, 3), minlength=count) for column in values.T]
    return np.stack(columns, axis=1).astype(float)


def _edges(vertices: Array, triangles: NDArray[np.int32]) -> Array:
    """Return the edges from the first corner to the others, (F, 2, 3)."""
    return vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
