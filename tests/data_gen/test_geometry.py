"""Reading meshes: closed forms of simple solids, every format, and files that are wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from data_gen.geometry import GEOMETRIES, build, read
from envbench.errors import BadInput
from envbench.geometry import Geometry, TriangleMesh


def save(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def mesh_of(geometry: Geometry) -> TriangleMesh:
    assert geometry.mesh is not None
    return geometry.mesh


@pytest.fixture
def ball() -> Any:
    return trimesh.creation.icosphere(subdivisions=2)


def test_presets_can_be_built() -> None:
    assert {name: build(spec, name).mesh for name, spec in GEOMETRIES.items()} == {"sphere": None}


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb"])
def test_a_ball_is_convex_with_radial_normals_in_every_format(ball: Any, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"ball.{suffix}"
    ball.export(path)
    geometry = build({"kind": "mesh", "path": str(path)}, "ball")
    mesh = mesh_of(geometry)
    assert geometry.convex
    assert len(mesh.triangles) == 320
    # a vertex of an icosphere is a centre of symmetry of its fan but for the twelve old ones' neighbours: 1 degree
    assert np.sum(mesh.normals * mesh.vertices, axis=1).min() > np.cos(np.radians(1))
    assert "computed" in geometry.notes[0]


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb"])
def test_normals_of_the_file_are_kept(ball: Any, tmp_path: Path, suffix: str) -> None:
    tilted = ball.vertices + np.array([0.3, 0, 0])
    ball.vertex_normals = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    path = tmp_path / f"ball.{suffix}"
    match suffix:
        case "obj":
            path.write_text(trimesh.exchange.obj.export_obj(ball, include_normals=True))
        case "ply":
            path.write_bytes(trimesh.exchange.ply.export_ply(ball, vertex_normal=True))
        case _:
            path.write_bytes(trimesh.exchange.gltf.export_glb(ball.scene(), include_normals=True))
    geometry = read(path)
    mesh = mesh_of(geometry)
    expected = mesh.vertices + np.array([0.3, 0, 0])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals, expected, atol=1e-6)
    assert geometry.notes == ()


def test_convexity_is_what_the_hull_says(tmp_path: Path) -> None:
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=4)
    dented = ball.copy()
    dented.vertices[0] *= 0.99  # a dimple one vertex wide
    open_box = trimesh.Trimesh(box.vertices, box.faces[1:], process=False)
    two = trimesh.util.concatenate([box, trimesh.creation.box().apply_translation([3, 0, 0])])
    ring = trimesh.creation.torus(1, 0.3)
    verdicts: dict[str, bool] = {}
    for name, mesh in {"box": box, "ball": ball, "dented": dented, "open": open_box, "two": two, "ring": ring}.items():
        mesh.export(tmp_path / f"{name}.ply")
        verdicts[name] = read(tmp_path / f"{name}.ply").convex
    assert verdicts == {"box": True, "ball": True, "dented": False, "open": False, "two": False, "ring": False}
    assert build({"kind": "mesh", "path": tmp_path / "ring.ply", "convex": True}).convex


def test_a_mesh_that_is_inside_out_is_turned(ball: Any, tmp_path: Path) -> None:
    path = save(tmp_path / "a.npz", vertices=ball.vertices, triangles=ball.faces[:, ::-1], normals=-ball.vertices)
    geometry = read(path)
    mesh = mesh_of(geometry)
    assert geometry.convex
    np.testing.assert_allclose(mesh.normals, mesh.vertices, atol=1e-12)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert np.sum(np.cross(b - a, c - a) * a, axis=1).min() > 0
    assert [("inside out" in note, "opposed" in note) for note in geometry.notes] == [(True, False), (False, True)]


def test_what_carries_no_area_is_dropped_and_said(tmp_path: Path) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9], [2, 0, 0]], float)
    path = save(tmp_path / "a.npz", vertices=vertices, triangles=[[0, 1, 2], [1, 1, 2], [0, 1, 4]], uv=vertices[:, :2])
    geometry = read(path)
    mesh = mesh_of(geometry)
    np.testing.assert_array_equal(mesh.vertices, vertices[:3])
    np.testing.assert_array_equal(mesh.uv, vertices[:3, :2])
    np.testing.assert_array_equal(mesh.triangles, [[0, 1, 2]])
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 3)
    assert "2 triangles without area" in geometry.notes[0]
    assert "2 unused vertices" in geometry.notes[1]


def test_seams_are_smoothed_when_normals_are_computed(tmp_path: Path) -> None:
    # a roof whose ridge is stored twice: both copies get the mean of the two sides, which points up
    vertices = np.array([[0, 0, 1], [1, 0, 1], [0, -1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 0]], float)
    geometry = read(save(tmp_path / "a.npz", vertices=vertices, triangles=[[0, 2, 1], [3, 4, 5]]))
    np.testing.assert_allclose(mesh_of(geometry).normals[[0, 3]], [[0, 0, 1]] * 2, atol=1e-12)


def test_meshes_of_the_data_folder(shared_data: Path) -> None:
    spot = read(shared_data / "meshes" / "spot.npz")
    mesh = mesh_of(spot)
    assert (len(mesh.vertices), len(mesh.triangles), spot.convex, spot.notes) == (3225, 5856, False, ())
    assert mesh.uv is not None


TRIANGLE = {"vertices": np.eye(3), "triangles": np.array([[0, 1, 2]])}


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"triangles": np.zeros((0, 3), int)}, "holds no triangles; export it with its faces."),
        ({"triangles": np.array([[0, 1, 3]])}, r"a triangle names vertex 3 of 3 \(from 0\)"),
        ({"triangles": np.array([[0, 1, -1]])}, "a triangle names vertex -1 of 3"),
        ({"triangles": np.array([[0.0, 1, 2]])}, "triangles are float64; integers are needed."),
        ({"triangles": np.array([[0, 1, 1]])}, "no triangle of positive area"),
        ({"triangles": np.array([[0, 1]])}, r"triangles have shape \(1, 2\); \(n, 3\) is needed."),
        ({"vertices": np.full((3, 3), np.nan)}, "holds NaN or infinite vertices; mend it first."),
        ({"normals": np.full((3, 3), np.inf)}, "holds NaN or infinite normals; mend it first."),
        ({"normals": np.eye(3)[:2]}, "2 normals for 3 vertices; give one a vertex."),
    ],
)
def test_wrong_arrays_are_refused_in_one_line(arrays: dict[str, Any], message: str, tmp_path: Path) -> None:
    path = save(tmp_path / "bad.npz", **{**TRIANGLE, **arrays})
    with pytest.raises(BadInput, match=rf"^mesh '.*bad\.npz'.*{message}.*$"):
        read(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", None, "is not there; check the path."),
        ("a.xyz", b"1 2 3", r"ends in '\.xyz'; give one of \.obj, \.ply, \.stl, \.glb, \.npz\."),
        ("a.ply", b"", "is empty; write it again."),
        ("a.obj", b"hello", "holds no triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "cannot be read"),
        ("a.glb", b"glTF", "cannot be read"),
        ("a.npz", b"PK\x03\x04", "cannot be read"),
        ("a.npz", b"not a zip file", "cannot be read"),
    ],
)
def test_wrong_files_are_refused_in_one_line(name: str, content: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInput, match=rf"^mesh '.*{name}'.*{message}.*$"):
        read(path)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"kind": "spere"}, "unknown kind of geometry 'g': 'spere': did you mean 'sphere'"),
        ({"kind": "mesh", "paht": "a.obj"}, "did you mean 'path'"),
        ({"kind": "mesh"}, "path must name a mesh file. Got None instead."),
        ({"kind": "mesh", "path": "a.obj", "convex": "yes"}, "convex must be true or false. Got 'yes' instead."),
        ({"kind": "sphere", "radius": 2}, "unknown setting of geometry 'g'"),
    ],
)
def test_wrong_tables_are_refused(spec: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        build(spec, "g")
