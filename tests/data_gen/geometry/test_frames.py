"""Normals and rotations from gradients: laws that hold for any gradient, closed forms, and SciPy's polar factor."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from data_gen.geometry.frames import (
    cofactors,
    nearest_rotations,
    posed_normals,
    surface_rotations,
    uv_tangents,
    vertex_gradients,
)
from envbench.directions import Array, normalised, perpendicular, uniform
from envbench.geometry import TriangleMesh

ROUNDING = 1e-13  # some hundred operations at 2^-53


def check(R: Array, normals: Array, posed: Array) -> None:
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), R.shape), atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=ROUNDING)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, normals), posed, atol=ROUNDING)


ENTRY = st.floats(-1e3, 1e3) | st.sampled_from([0.0, 1.0, -1.0, 1e-12])
DIRECTION = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 1e-3).map(normalised)


@settings(max_examples=300, deadline=None)
@given(arrays(float, (3, 3), elements=ENTRY), DIRECTION)
def test_any_gradient_gives_a_rotation_that_takes_the_normal_along(F: Array, n: Array) -> None:
    """Singular, reflecting, collapsed and vanishing gradients included."""
    posed = posed_normals(n[None], F[None])
    assert np.linalg.norm(posed) == pytest.approx(1)
    check(surface_rotations(n[None], posed, F[None]), n[None], posed)


@settings(max_examples=100, deadline=None)
@given(arrays(float, (3, 3), elements=ENTRY), DIRECTION, DIRECTION)
def test_any_two_normals_are_joined(F: Array, n: Array, posed: Array) -> None:
    for other in (posed, n, -n):
        check(surface_rotations(n[None], other[None], F[None]), n[None], other[None])


def test_a_rotation_stays_itself_and_a_scale_changes_nothing() -> None:
    rng = np.random.default_rng(1)
    R = Rotation.random(200, rng=rng).as_matrix()
    n = uniform(200, rng)
    for scale in (1e-6, 1.0, 1e6):
        posed = posed_normals(n, scale * R)
        np.testing.assert_allclose(posed, np.einsum("nij,nj->ni", R, n), atol=ROUNDING)
        np.testing.assert_allclose(surface_rotations(n, posed, scale * R), R, atol=ROUNDING)


def test_the_rotation_is_the_polar_factor_of_the_surface_gradient() -> None:
    """F on the tangent plane, n to n' across it: the polar factor of that matrix, by SciPy."""
    rng = np.random.default_rng(2)
    F, n = rng.normal(size=(100, 3, 3)), uniform(100, rng)
    posed = posed_normals(n, F)
    found = surface_rotations(n, posed, F)
    for matrix, normal, after, R in zip(F, n, posed, found, strict=True):
        surface = matrix @ (np.eye(3) - np.outer(normal, normal))
        surface -= np.outer(after, after @ surface)  # rounding alone: F takes tangents to the posed plane
        np.testing.assert_allclose(R, polar(surface + np.outer(after, normal))[0], atol=1e-9)


def test_normals_stand_on_the_carried_plane_and_to_the_side_of_the_triangles() -> None:
    rng = np.random.default_rng(3)
    F = rng.normal(size=(500, 3, 3))  # half of them reflect
    a, b = rng.normal(size=(2, 500, 3))
    posed = posed_normals(normalised(np.cross(a, b)), F)
    carried = np.cross(np.einsum("nij,nj->ni", F, a), np.einsum("nij,nj->ni", F, b))
    np.testing.assert_allclose(posed, normalised(carried), atol=1e-9)
    np.testing.assert_allclose(
        cofactors(F), np.linalg.det(F)[:, None, None] * np.linalg.inv(F).swapaxes(1, 2), atol=1e-9
    )


def test_nearest_rotations_are_scipys() -> None:
    M = np.random.default_rng(4).normal(size=(50, 3, 3))
    expected = Rotation.align_vectors
    for matrix, R in zip(M, nearest_rotations(M), strict=True):
        # the rotation that best takes the unit axes to the columns (Kabsch)
        np.testing.assert_allclose(R, expected(matrix.T, np.eye(3))[0].as_matrix(), atol=1e-9)


def sheet(count: int = 9) -> TriangleMesh:
    from data_gen.geometry.generated import grid

    uv, triangles = grid((count, count))
    vertices = np.concatenate([uv, np.zeros((len(uv), 1))], axis=1)
    return TriangleMesh(vertices, triangles, np.tile([0.0, 0, 1], (len(uv), 1)), uv)


def test_gradients_of_a_pose_by_vertices_are_exact_where_it_is_linear() -> None:
    mesh = sheet()
    A = np.array([[2.0, 0.3, 0], [-0.1, 0.5, 0], [0.4, 1.0, 0]])
    F = vertex_gradients(mesh, mesh.vertices @ A.T)
    A[:, 2] = normalised(np.cross(A[:, 0], A[:, 1]))
    np.testing.assert_allclose(F, np.broadcast_to(A, F.shape), atol=1e-12)


def test_tangents_follow_u_and_vanish_where_uv_collapse() -> None:
    mesh = sheet()
    np.testing.assert_allclose(uv_tangents(mesh), np.broadcast_to([1.0, 0, 0], mesh.vertices.shape), atol=1e-12)
    assert mesh.uv is not None
    for uv in (mesh.uv * [0, 1], mesh.uv * [1, 0], mesh.uv * 0, None):
        collapsed = TriangleMesh(mesh.vertices, mesh.triangles, mesh.normals, uv)
        assert not uv_tangents(collapsed).any()
    mirrored = TriangleMesh(mesh.vertices, mesh.triangles, mesh.normals, mesh.uv * [1, -1])
    np.testing.assert_allclose(uv_tangents(mirrored), np.broadcast_to([1.0, 0, 0], mesh.vertices.shape), atol=1e-12)
    turned = TriangleMesh(mesh.vertices, mesh.triangles, mesh.normals, mesh.uv @ np.array([[0.6, 0.8], [-0.8, 0.6]]))
    np.testing.assert_allclose(uv_tangents(turned)[:, :2], np.broadcast_to([0.6, -0.8], mesh.uv.shape), atol=1e-12)
    assert np.allclose(np.sum(perpendicular(mesh.normals) * mesh.normals, axis=1), 0)
