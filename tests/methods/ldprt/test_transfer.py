"""Simulated transfer: closed forms, ambient occlusion, the furnace, and Mitsuba's own rendering."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh

from data_gen.geometry import read
from envbench import real_harmonics
from envbench.directions import uniform
from envbench.errors import BadInput
from envbench.geometry import Geometry, TriangleMesh
from methods.ldprt import basis
from methods.ldprt.transfer import Kind, Transfer, simulate

OPEN = np.sqrt(4 * np.pi)
"""What turns the first coefficient into the radiance under constant light 1."""


def geometry(mesh: Any, convex: bool = False) -> Geometry:
    normals = np.array(mesh.vertex_normals)
    shape = TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32), normals)
    return Geometry("test", shape, convex=convex)


def faceted(mesh: Any) -> Geometry:
    """The mesh with each triangle's own normal at its corners."""
    mesh.unmerge_vertices()
    return geometry(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))


def bumps(size: int = 12) -> Geometry:
    """A bumpy square, open, seen from above."""
    x, y = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size))
    z = 0.15 * np.sin(3 * np.pi * x) * np.sin(3 * np.pi * y)
    corner = np.arange(size * (size - 1)).reshape(size - 1, size)[:, :-1].ravel()
    lower = np.stack([corner, corner + 1, corner + size + 1], axis=-1)
    upper = np.stack([corner, corner + size + 1, corner + size], axis=-1)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return geometry(trimesh.Trimesh(vertices, np.concatenate([lower, upper]), process=False))


def box_without_lid() -> Geometry:
    """The inside of a cube that is open above."""
    box = trimesh.creation.box()
    box.update_faces(box.face_normals[:, 2] < 0.5)
    box.invert()
    return faceted(box.subdivide().subdivide())


def floor_and_wall(height: float) -> Geometry:
    """A floor with a vertex at distance 1 from a wall, both very long."""
    long = 300.0
    vertices = np.array([
        [1, 0, 0], [0, -long, 0], [long, -long, 0], [long, long, 0], [0, long, 0],
        [0, -long, 0], [0, long, 0], [0, long, height], [0, -long, height],
    ])  # fmt: skip
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 6, 7], [5, 7, 8]], np.int32)
    normals = np.array([[0, 0, 1]] * 5 + [[1, 0, 0]] * 4, float)
    return Geometry("corner", TriangleMesh(vertices, triangles, normals), convex=False)


def test_the_basis_of_a_kernel_is_that_of_numpy(mi: ModuleType) -> None:
    directions = uniform(100, np.random.default_rng(0)).astype(np.float32)
    found = basis.evaluate(8, mi.Vector3f(np.ascontiguousarray(directions.T)))
    expected = real_harmonics.basis(7, directions.astype(float))
    assert np.stack([np.broadcast_to(f.numpy(), 100) for f in found]) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("kind", list(Kind)[:3])
def test_on_a_convex_mesh_nothing_is_in_the_way(mi: ModuleType, kind: Kind) -> None:
    """Not one ray is: constant light returns 1 exactly, smooth or faceted, slender or round, far from the origin."""
    points = np.random.default_rng(1).normal(size=(60, 3)) * [1, 0.2, 3]
    for shape in (
        geometry(trimesh.creation.icosphere(2)),
        faceted(trimesh.creation.icosphere(1)),
        faceted(trimesh.creation.box()),
        geometry(trimesh.Trimesh(points).convex_hull),
        geometry(trimesh.Trimesh(points + np.array([1e3, 0, 0])).convex_hull),
    ):
        assert shape.mesh is not None
        got = simulate(shape, 5, kind=kind, rays=1000)
        assert got.vectors[:, 0] * OPEN == pytest.approx(1, abs=1e-5)
        exact = simulate(Geometry("same", shape.mesh), 5).vectors
        np.testing.assert_allclose(got.vectors, exact, atol=1e-2)  # 1000 rays, stratified


@pytest.mark.parametrize("height", [0.3, 1.0, 4.0])
def test_ambient_occlusion_beside_a_wall(mi: ModuleType, height: float) -> None:
    """A long wall seen up to the elevation a hides (1 - cos a) / 2 of the cosine; its corner vertices half of it."""
    got = simulate(floor_and_wall(height), 3, rays=20000)
    visible = (1 + np.cos(np.arctan(height))) / 2
    within = 4 * got.standard_error[:, 0] * OPEN + 1e-4  # and what the wall's ends let past
    assert abs(got.vectors[0, 0] * OPEN - visible) < within[0]


def test_a_crease_hides_half(mi: ModuleType) -> None:
    """Where a floor meets a wall at a right angle, each sees half of its hemisphere: nothing leaks past the corner."""
    folded = np.array([[0, -9, 0], [9, -9, 0], [9, 0, 0], [0, 0, 0], [0, 9, 0], [9, 9, 0]], float)
    floor = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]])
    wall = folded[:, [2, 1, 0]]
    vertices = np.concatenate([folded, wall])
    triangles = np.concatenate([floor, floor[:, ::-1] + 6]).astype(np.int32)
    normals = np.repeat([[0.0, 0, 1], [1, 0, 0]], 6, axis=0)
    got = simulate(Geometry("crease", TriangleMesh(vertices, triangles, normals), convex=False), 2, rays=5000)
    for corner in (3, 9):  # the middle of the crease, 9 edges of its walls away
        assert got.vectors[corner, 0] * OPEN == pytest.approx(0.5 + 0.25 * (1 - 1 / np.sqrt(2)), abs=0.1)
        assert got.vectors[corner, 0] * OPEN < 0.75


@pytest.mark.parametrize("kind", [Kind.SHADOWED, Kind.INTERREFLECTED])
def test_the_standard_error_is_honest(mi: ModuleType, kind: Kind) -> None:
    """Squares of the errors over those stated: 1 on average, over vertices, coefficients and seeds."""
    shape = bumps()
    truth = np.mean([simulate(shape, 4, kind=kind, rays=40_000, seed=100 + s).vectors for s in range(2)], axis=0)
    runs = [simulate(shape, 4, kind=kind, rays=500, seed=s) for s in range(6)]
    square = np.mean([(run.vectors - truth) ** 2 for run in runs])
    stated = np.mean([run.standard_error**2 for run in runs])
    assert square / stated == pytest.approx(1, abs=0.25)
    assert runs[0].rays == 500 * (1 if kind is Kind.SHADOWED else 2)


def test_deterministic_for_a_seed(mi: ModuleType) -> None:
    first, again, other = (simulate(bumps(), 4, rays=200, seed=s).vectors for s in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_chunks_join_seamlessly(mi: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = simulate(bumps(), 3, rays=200, kind="interreflected")
    monkeypatch.setattr("methods.ldprt.casting._LANES", 170)
    assert np.array_equal(simulate(bumps(), 3, rays=200, kind="interreflected").vectors, whole.vectors)


def test_white_furnace(mi: ModuleType) -> None:
    """In a white box that is open above, constant light 1 comes back as 1 in the end; after k bounces 0.8^k lacks."""
    box = box_without_lid()
    few, many = (simulate(box, 2, kind="interreflected", rays=1000, bounces=k).vectors[:, 0] * OPEN for k in (2, 25))
    assert few.mean() < 0.9
    assert many.mean() == pytest.approx(1, abs=0.01)
    assert np.sqrt(np.mean((many - 1) ** 2)) < 0.03
    grey = simulate(box, 2, kind="interreflected", rays=1000, bounces=25, albedo=0.5).vectors[:, 0] * OPEN
    assert grey.mean() < few.mean()


def test_the_inside_of_a_closed_shape_is_dark_and_an_open_one_has_two_sides(mi: ModuleType) -> None:
    """A white plate above a floor: its underside, lit by the floor's surroundings, sends light on."""
    plate = trimesh.creation.box(extents=(1, 1, 0.2))
    closed = simulate(faceted(plate), 1, kind="interreflected", rays=200)
    assert closed.vectors[:, 0] * OPEN == pytest.approx(1, abs=1e-5)  # convex: nothing is hit at all
    sheet = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float)
    vertices = np.concatenate([sheet, sheet * [1, 1, 0], [[0.0, 0, 0]]])
    floor = [[4, 5, 8], [5, 6, 8], [6, 7, 8], [7, 4, 8]]
    triangles = np.array([[0, 1, 2], [0, 2, 3], *floor], np.int32)
    both_up = TriangleMesh(vertices, triangles, np.repeat([[0.0, 0, 1]], 9, axis=0))
    direct, lit = (simulate(Geometry("two", both_up, convex=False), 1, kind=k, rays=2000) for k in list(Kind)[1:3])
    assert lit.vectors[8, 0] > direct.vectors[8, 0] + 5 * lit.standard_error[8, 0]


def test_head(mi: ModuleType, shared_data: Any) -> None:
    """The paper's head, with few rays: openings of the sky between dark and full, and less error for more rays."""
    head = read(shared_data / "meshes" / "head_big_ears.npz")
    results: list[Transfer] = [simulate(head, 6, rays=rays) for rays in (50, 200)]
    for result in results:
        assert result.vectors.shape == (17575, 36)
        assert 0.75 < result.vectors[:, 0].mean() * OPEN < 0.85
    assert results[1].relative_error < results[0].relative_error / 1.8


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"order": 0}, "order"),
        ({"order": 17}, "order"),
        ({"rays": 3}, "rays"),
        ({"bounces": -1}, "bounces"),
        ({"albedo": 1.5}, "albedo"),
        ({"kind": "shaded"}, "unshadowed, shadowed, interreflected"),
    ],
)
def test_refuses(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(BadInput, match=named):
        simulate(bumps(), **{"order": 3, **settings})


def test_refuses_a_shape_without_vertices() -> None:
    with pytest.raises(BadInput, match="give a mesh"):
        simulate(Geometry("sphere"), 3)
