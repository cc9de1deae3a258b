"""Reading meshes: closed forms of simple solids, every format, and files that are wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from data_gen.geometry import build, read
from envbench.directions import normalised
from envbench.errors import BadInput
from envbench.geometry import Geometry, TriangleMesh

TRIANGLE = {"vertices": np.eye(3), "triangles": np.array([[0, 1, 2]])}


def save(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def mesh_of(geometry: Geometry) -> TriangleMesh:
    assert geometry.mesh is not None
    return geometry.mesh


@pytest.fixture
def ball() -> Any:
    return trimesh.creation.icosphere(subdivisions=2)


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


def test_an_edge_of_three_triangles_is_said_and_the_mesh_taken_for_open(tmp_path: Path) -> None:
    box: Any = trimesh.creation.box()
    fin = np.concatenate([box.vertices, [[2.0, 2, 2]]])
    faces = np.concatenate([box.faces, [[*box.faces[0][:2], 8]]])
    geometry = read(save(tmp_path / "a.npz", vertices=fin, triangles=faces, normals=normalised(fin)))
    assert geometry.notes == ("'a.npz' has 1 edges where more than two triangles meet; it is taken for open.",)
    assert not geometry.convex
    assert len(mesh_of(geometry).triangles) == 13


def test_triangles_wound_against_the_others_are_turned(ball: Any, tmp_path: Path) -> None:
    wrong = np.random.default_rng(0).uniform(size=len(ball.faces)) < 0.3
    faces = np.where(wrong[:, None], ball.faces[:, ::-1], ball.faces)
    two = np.concatenate([faces, faces[:, ::-1] + len(ball.vertices)])  # the other piece is wrong by 0.7
    vertices = np.concatenate([ball.vertices, ball.vertices + np.array([3, 0, 0])])
    one = read(save(tmp_path / "one.npz", vertices=ball.vertices, triangles=faces))
    assert one.convex
    assert f"{wrong.sum()} triangles of 'one.npz' were wound against the others; turned." in one.notes
    for mesh in (
        mesh_of(one),
        mesh_of(read(save(tmp_path / "two.npz", vertices=vertices, triangles=two[: len(faces)]))),
    ):
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        assert np.sum(np.cross(b - a, c - a) * a, axis=1).min() > 0
        assert np.sum(mesh.normals * mesh.vertices, axis=1).min() > 0.99
    # each piece of an open mesh keeps what most of it says: here the second faces inward, and is said to be closed
    both = mesh_of(read(save(tmp_path / "both.npz", vertices=vertices, triangles=two)))
    centre = both.vertices - np.where(both.vertices[:, :1] > 1.5, [[3.0, 0, 0]], 0)
    assert set(np.sign(np.sum(both.normals * centre, axis=1))) == {1.0, -1.0}


def test_a_one_sided_band_is_said(tmp_path: Path) -> None:
    angle = np.linspace(0, 2 * np.pi, 41)[:-1]
    across = np.stack([np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)], axis=1)
    middle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices = np.concatenate([middle - 0.3 * across, middle + 0.3 * across])
    i, j = np.arange(40), np.arange(1, 41) % 40
    low, high = np.where(j == 0, 40, j), np.where(j == 0, 0, j + 40)  # the last strip joins half-turned
    triangles = np.concatenate([np.stack([i, low, high], 1), np.stack([i, high, i + 40], 1)])
    normals = np.broadcast_to([0.0, 0, 1], vertices.shape)
    geometry = read(save(tmp_path / "a.npz", vertices=vertices, triangles=triangles, normals=normals))
    assert any("one-sided" in note for note in geometry.notes)
    assert not geometry.convex


def test_nothing_but_one_triangle_will_do(tmp_path: Path) -> None:
    geometry = read(save(tmp_path / "a.npz", **TRIANGLE))
    mesh = mesh_of(geometry)
    np.testing.assert_allclose(mesh.normals, np.full((3, 3), 3**-0.5))
    assert not geometry.convex
    posed = build({"kind": "mesh", "path": tmp_path / "a.npz", "pose": {"kind": "twist", "degrees": 90}}).pose
    assert posed is not None


def test_what_no_triangle_uses_may_be_nan(tmp_path: Path) -> None:
    vertices = np.concatenate([[[np.nan] * 3], np.eye(3)])
    geometry = read(save(tmp_path / "a.npz", vertices=vertices, triangles=[[1, 2, 3]]))
    np.testing.assert_array_equal(mesh_of(geometry).vertices, np.eye(3))
    assert "1 unused vertices" in geometry.notes[0]


@pytest.mark.parametrize(("side", "more"), [(1001, {}), (301, {"pose": {"kind": "bend", "degrees": 60}})])
def test_two_million_triangles_take_a_bounded_memory(side: int, more: dict[str, Any], tmp_path: Path) -> None:
    """At most 600 bytes a triangle at the peak, in a pose too: 1.2 GB for two million."""
    import tracemalloc

    from data_gen.geometry.generated import grid

    uv, triangles = grid((side, side))
    vertices = np.concatenate([uv, 0.1 * np.sin(9 * uv[:, :1])], axis=1).astype(np.float32)
    path = save(tmp_path / "a.npz", vertices=vertices, triangles=triangles)
    tracemalloc.start()
    try:
        geometry = build({"kind": "mesh", "path": path, **more})
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(mesh_of(geometry).triangles) == 2 * (side - 1) ** 2
    assert peak < 600 * len(triangles)


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
        ({"kind": "mesh", "path": "a.obj"}, "a.obj is neither there nor in the data folder: set ENVBENCH_DATA"),
        ({"kind": "mesh", "path": "a.obj", "up": "up"}, "up must be 'x', 'y' or 'z'. Got 'up' instead."),
    ],
)
def test_wrong_tables_are_refused(spec: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        build(spec, "g")
