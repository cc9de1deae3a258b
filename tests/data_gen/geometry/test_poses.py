"""Poses of meshes: laws of every kind, skinning against its formula written out, and tables that are wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from data_gen.geometry import GEOMETRIES, build, read
from envbench.directions import Array, normalised
from envbench.errors import BadInput
from envbench.geometry import Geometry, Pose, TriangleMesh


def parts(geometry: Geometry) -> tuple[TriangleMesh, Pose]:
    assert geometry.mesh is not None
    assert geometry.pose is not None
    return geometry.mesh, geometry.pose


def check(geometry: Geometry) -> None:
    """Check what every pose promises: rotations, exact on normals, on unit normals."""
    mesh, pose = parts(geometry)
    R = pose.rotations
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-13)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, mesh.normals), pose.normals, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(pose.normals, axis=1), 1, atol=1e-13)
    assert pose.vertices.shape == pose.normals.shape == mesh.vertices.shape


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    sphere: Any = trimesh.creation.icosphere(subdivisions=3)
    path = tmp_path / "ball.npz"
    np.savez(path, vertices=sphere.vertices * [1, 1.2, 1.5], triangles=sphere.faces)
    return path


POSES: list[Any] = [
    {"kind": "turn", "degrees": 40, "axis": [1, 2, 3]},
    {"kind": "bend", "degrees": 60},
    {"kind": "twist", "degrees": 90, "axis": "y"},
    {"kind": "stretch", "factor": 1.5},
    {"kind": "wave", "amplitude": 0.05},
    [{"kind": "twist", "degrees": 90}, {"kind": "bend", "degrees": 60}, {"kind": "turn", "degrees": 20}],
]


@pytest.mark.parametrize("pose", POSES, ids=str)
def test_poses_rotate_and_leave_the_rest_alone(pose: Any, ball: Path) -> None:
    plain, posed = (build({"kind": "mesh", "path": ball, **more}) for more in ({}, {"pose": pose}))
    check(posed)
    assert plain.mesh is not None
    assert posed.rest.key == plain.key != posed.key
    mesh, seen = parts(posed)
    np.testing.assert_array_equal(mesh.vertices, plain.mesh.vertices)
    # the posed normals are those of the posed shape: the triangles' own, to the mesh's resolution (edges of 9 degrees)
    geometric = read_normals(seen.vertices, mesh)
    assert np.sum(geometric * seen.normals, axis=1).min() > np.cos(np.radians(6))


def read_normals(vertices: Array, mesh: TriangleMesh) -> Array:
    shape: Any = trimesh.Trimesh(vertices, mesh.triangles, process=False)
    return normalised(shape.vertex_normals)


def test_a_rigid_turn_is_that_rotation_at_every_vertex(ball: Path) -> None:
    axis, degrees = np.array([1.0, -2, 0.5]), 123.0
    pose = {"kind": "turn", "degrees": degrees, "axis": axis.tolist()}
    geometry = build({"kind": "mesh", "path": ball, "pose": pose})
    mesh, posed = parts(geometry)
    R = Rotation.from_rotvec(np.radians(degrees) * normalised(axis)).as_matrix()
    np.testing.assert_allclose(posed.rotations, np.broadcast_to(R, posed.rotations.shape), atol=1e-13)
    np.testing.assert_allclose(posed.vertices, mesh.vertices @ R.T, atol=1e-13)
    assert (geometry.convex, posed.convex) == (True, True)


def test_convexity_is_that_of_the_pose(ball: Path) -> None:
    for pose, convex in ((POSES[1], False), (POSES[3], True), ({"kind": "bend", "degrees": 0}, True)):
        assert parts(build({"kind": "mesh", "path": ball, "pose": pose}))[1].convex is convex


def test_a_fold_is_said_and_still_rotates(ball: Path) -> None:
    geometry = build({"kind": "mesh", "path": ball, "pose": {"kind": "bend", "degrees": 360, "towards": "y"}})
    check(geometry)
    assert any("folds the shape" in note for note in geometry.notes)


def skinned(path: Path, *, bones: int = 3, dense: bool = True, **more: Any) -> dict[str, Any]:
    """Save a column of a mesh whose bones bend it at thirds, keyed at times 0, 1/2 and 1; return the arrays."""
    from data_gen.geometry.generated import grid

    uv, triangles = grid((5, 13))
    vertices = np.stack([uv[:, 0] - 0.5, 0.1 * np.sin(6 * uv[:, 0]), 3 * uv[:, 1]], axis=1)
    height = np.clip(uv[:, 1] * bones - 0.5, 0, bones - 1 - 1e-9)
    low, share = height.astype(int), height % 1
    indices, weights = np.stack([low, low + 1], axis=1), np.stack([1 - share, share], axis=1)
    rng = np.random.default_rng(0)
    local = np.tile(np.eye(4), (3, bones, 1, 1))
    local[1, :, :3, :3] = Rotation.from_rotvec(rng.normal(size=(bones, 3)) * 0.4).as_matrix()
    local[:, :, 2, 3] = 1
    bind = np.tile(np.eye(4), (bones, 1, 1))
    bind[:, 2, 3] = -np.arange(1, bones + 1)  # bone b begins at height b + 1 at rest
    arrays: dict[str, Any] = {
        "vertices": vertices, "triangles": triangles, "uv": uv,
        "key_local": local, "key_times": np.array([0, 0.5, 1]), "bone_offset": bind,
        "bone_parents": np.arange(bones) - 1, "skin_weights": weights, "skin_indices": indices,
    }  # fmt: skip
    if dense:
        full = np.zeros((len(vertices), bones))
        np.put_along_axis(full, indices, weights, axis=1)
        world = np.empty((3, bones, 4, 4))
        for k in range(3):
            for b in range(bones):
                world[k, b] = local[k, b] if b == 0 else world[k, b - 1] @ local[k, b]
        arrays |= {"skin_weights": full, "key_transforms": (world @ bind)[:, :, :3]}
        del arrays["skin_indices"], arrays["key_local"]
    np.savez(path, **{**arrays, **more})
    return arrays


def test_skinning_is_its_formula_by_bones_and_by_frames(tmp_path: Path) -> None:
    bones, frames = tmp_path / "bones.npz", tmp_path / "frames.npz"
    sparse, full = skinned(bones, dense=False), skinned(frames)
    by_time = build({"kind": "mesh", "path": bones, "pose": {"kind": "skin", "time": 0.5}})
    by_frame = build({"kind": "mesh", "path": frames, "pose": {"kind": "skin", "frame": 1}})
    check(by_time)
    mesh, pose = parts(by_time)
    transforms = full["key_transforms"][1]
    for i in range(len(mesh.vertices)):
        place, normal = np.zeros(3), np.zeros(3)
        for bone, weight in zip(sparse["skin_indices"][i], sparse["skin_weights"][i], strict=True):
            place += weight * (transforms[bone] @ [*mesh.vertices[i], 1])
            normal += weight * (transforms[bone, :, :3] @ mesh.normals[i])
        np.testing.assert_allclose(pose.vertices[i], place, atol=1e-12)
        np.testing.assert_allclose(pose.normals[i], normalised(normal), atol=1e-12)
    np.testing.assert_allclose(parts(by_frame)[1].vertices, pose.vertices, atol=1e-12)
    np.testing.assert_allclose(parts(by_frame)[1].rotations, pose.rotations, atol=1e-12)
    given = {"kind": "skin", "transforms": transforms.tolist()}
    other = build({"kind": "mesh", "path": frames, "pose": given})
    np.testing.assert_allclose(parts(other)[1].rotations, pose.rotations, atol=1e-12)


def test_keys_are_interpolated_on_the_sphere(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    arrays = skinned(path, dense=False)
    pose = {kind: parts(build({"kind": "mesh", "path": path, "pose": {"kind": "skin", "time": kind}}))[1]
            for kind in (0, 0.25, 1)}  # fmt: skip
    np.testing.assert_allclose(pose[0].vertices, arrays["vertices"] + [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(pose[1].vertices, pose[0].vertices, atol=1e-12)
    # the lowest vertices belong to bone 0 alone: half way to its key is half the angle
    half = Rotation.from_rotvec(Rotation.from_matrix(arrays["key_local"][1, 0, :3, :3]).as_rotvec() / 2)
    expected = half.apply(arrays["vertices"][:5] - [0, 0, 1]) + np.array([0, 0, 1])
    np.testing.assert_allclose(pose[0.25].vertices[:5], expected, atol=1e-12)


def test_one_bone_moved_rigidly_is_that_rotation_in_the_axes_of_up(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    skinned(path)
    R = Rotation.from_rotvec([0.3, -1, 0.2])
    transform = np.concatenate([R.as_matrix(), [[1], [2], [3]]], axis=1).ravel().tolist()
    for up in ("x", "y", "z"):
        plain = build({"kind": "mesh", "path": path, "up": up})
        skin = {"kind": "skin", "transforms": [transform] * 3}
        _, pose = parts(build({"kind": "mesh", "path": path, "up": up, "pose": skin}))
        file, turned = read(path).mesh, plain.mesh
        assert file is not None
        assert turned is not None
        Q = np.linalg.lstsq(file.vertices, turned.vertices, rcond=None)[0].T
        assert np.linalg.det(Q) == pytest.approx(1)
        np.testing.assert_allclose(Q @ np.eye(3)["xyz".index(up)], [0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(pose.vertices, (R.apply(file.vertices) + np.array([1, 2, 3])) @ Q.T, atol=1e-12)
        expected = np.broadcast_to(Q @ R.as_matrix() @ Q.T, pose.rotations.shape)
        np.testing.assert_allclose(pose.rotations, expected, atol=1e-12)


def test_unused_vertices_are_dropped_from_the_skin_too(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    arrays = skinned(path)
    whole = parts(build({"kind": "mesh", "path": path, "pose": {"kind": "skin", "frame": 1}}))[1]
    more = {name: np.concatenate([arrays[name][:1], arrays[name]]) for name in ("vertices", "uv", "skin_weights")}
    np.savez(path, **{**arrays, **more, "triangles": arrays["triangles"] + 1})
    np.testing.assert_allclose(
        parts(build({"kind": "mesh", "path": path, "pose": {"kind": "skin", "frame": 1}}))[1].vertices, whole.vertices
    )


def test_a_pose_from_a_file_finds_its_rotations(ball: Path, tmp_path: Path) -> None:
    rest = read(ball).mesh
    assert rest is not None
    bend = parts(build({"kind": "mesh", "path": ball, "pose": POSES[1]}))[1]
    np.savez(tmp_path / "bent.npz", vertices=bend.vertices, normals=bend.normals)
    np.savez(tmp_path / "bare.npz", vertices=bend.vertices)
    for name, degrees in (("bent", 1.0), ("bare", 5.0)):  # without normals, those of triangles of 9 degrees
        geometry = build(
            {"kind": "mesh", "path": ball, "pose": {"kind": "file", "path": str(tmp_path / f"{name}.npz")}}
        )
        check(geometry)
        between = bend.rotations @ parts(geometry)[1].rotations.swapaxes(1, 2)
        assert np.degrees(Rotation.from_matrix(between).magnitude()).max() < degrees


def test_a_patch_on_a_surface_is_its_closed_form() -> None:
    patch = {"kind": "patch", "texture": "bumps", "height": 0.05, "resolution": 33, "size": [2, 1]}
    cylinder = {"kind": "onto", "surface": {"kind": "cylinder", "radius": 2 / (2 * np.pi)}, "relief": 0.5}
    geometry = build({**patch, "pose": cylinder})
    check(geometry)
    mesh, pose = parts(geometry)
    angle, radius = np.pi * mesh.vertices[:, 0], 1 / np.pi + 0.5 * mesh.vertices[:, 2]
    expected = np.stack([radius * np.cos(angle), radius * np.sin(angle), mesh.vertices[:, 1] - 0.5], axis=1)
    np.testing.assert_allclose(pose.vertices, expected, atol=1e-12)
    flat = np.flatnonzero(mesh.vertices[:, 2] == 0)  # patch normals there are z, and go to the cylinder's
    np.testing.assert_allclose(pose.normals[flat], normalised(expected[flat] * [1, 1, 0]), atol=1e-6)
    frame = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    np.testing.assert_allclose(pose.rotations[flat][:, :, 0], frame[flat], atol=1e-6)


def test_a_periodic_patch_has_no_seam() -> None:
    for texture in ("bumps", "weave", "swirl", "waffle"):
        patch = {"kind": "patch", "texture": texture, "tiles": 3, "resolution": 49}
        mesh, pose = parts(build({**patch, "pose": {"kind": "onto", "surface": "torus"}}))
        assert mesh.uv is not None
        for side in (0, 1):
            first, last = (np.flatnonzero(mesh.uv[:, side] == end) for end in (0, 1))
            np.testing.assert_allclose(pose.vertices[first], pose.vertices[last], atol=1e-12)
            np.testing.assert_allclose(pose.normals[first], pose.normals[last], atol=1e-6)


@pytest.mark.parametrize("name", [name for name, spec in GEOMETRIES.items() if "pose" in spec])
def test_presets_pose(name: str, shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ENVBENCH_DATA", str(shared_data))
    geometry = build(GEOMETRIES[name], name)
    check(geometry)
    mesh, pose = parts(geometry)
    a, b, c = (pose.vertices[mesh.triangles[:, k]] for k in range(3))
    agree = np.sum(np.cross(b - a, c - a) * pose.normals[mesh.triangles].sum(1), axis=1) > 0
    # flexed skin folds over itself at some joints
    assert agree.mean() > 0.98


WRONG: list[tuple[Any, str]] = [
    ({"kind": "bnd"}, r"^geometry 'g': unknown kind of pose: 'bnd': did you mean 'bend'\? Known: bend, file, onto"),
    ({"kind": "bend", "degres": 1}, "unknown setting of pose .bend.: 'degres': did you mean 'degrees'"),
    ({"kind": "bend"}, r"pose \(bend\) needs the setting 'degrees'"),
    ({"kind": "bend", "degrees": "much"}, r"degrees must be a number in \[-720, 720\]. Got 'much' instead."),
    ({"kind": "bend", "degrees": float("nan")}, "degrees must be a number"),
    ({"kind": "bend", "degrees": 1, "axis": "w"}, "axis must be 'x', 'y' or 'z'. Got 'w' instead."),
    ({"kind": "bend", "degrees": 1, "axis": ["x"]}, "axis must be 'x', 'y' or 'z'"),
    ({"kind": "bend", "degrees": 1, "axis": "x"}, "towards must not be the axis itself, 'x'."),
    ({"kind": "turn", "degrees": 1, "axis": [0, 0, 0]}, "axis must not be zero"),
    ({"kind": "turn", "degrees": 1, "axis": "z"}, "axis must be 3 finite numbers. Got 'z' instead."),
    ({"kind": "stretch", "factor": 0}, "factor must be a number"),
    ({"kind": "onto", "surface": "torsu"}, "unknown kind of surface: 'torsu': did you mean 'torus'"),
    ({"kind": "onto", "surface": {"kind": "torus", "tube": 2}}, "surface: tube must be less than radius, 1. Got 2"),
    ({"kind": "onto", "surface": {"kind": "vase", "profile": [[0, 1]]}}, "at least two pairs of a radius above 0"),
    ({"kind": "onto", "surface": {"kind": "vase", "profile": [[1, 1], [1, 1]]}}, "must not repeat a point"),
    ({"kind": "onto", "surface": "torus"}, "pose: a patch needs uv to be laid onto a surface; this mesh has none."),
    ({"kind": "skin"}, "a time, a frame or transforms; give exactly one"),
    ({"kind": "skin", "time": 2}, r"time must be a number in \[0, 1\]. Got 2 instead."),
    ({"kind": "skin", "time": 0.5}, "'ball.npz' has no array skin_weights, so it has no skin pose."),
    ([], "a table with 'kind', or a list of them"),
    ("bend", "pose must be a table with 'kind'. Got 'bend' instead."),
    ([{"kind": "turn", "degrees": 1}, {"kind": "onto", "surface": "vase"}], "'onto' begins at the mesh at rest"),
]


@pytest.mark.parametrize(("pose", "message"), WRONG, ids=str)
def test_wrong_poses_are_refused_in_one_line(pose: Any, message: str, ball: Path) -> None:
    with pytest.raises(BadInput, match=message) as refusal:
        build({"kind": "mesh", "path": ball, "pose": pose}, "g")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("more", "pose", "message"),
    [
        ({"skin_weights": np.full((65, 3), 0.3)}, {"frame": 0}, "weights of vertex 0 in 'a.npz' sum to 0.9, not 1"),
        ({"skin_weights": np.full((65, 3), np.nan)}, {"frame": 0}, "sum to nan, not 1: normalise them"),
        ({"skin_weights": np.tile([2.0, -1, 0], (65, 1))}, {"frame": 0}, "reach -1; they must not be negative"),
        ({"skin_weights": np.full((60, 3), 1 / 3)}, {"frame": 0}, "are for 60 vertices; this mesh has 65."),
        ({}, {"frame": 3}, "frame must be at most 2 in 'a.npz'. Got 3 instead."),
        ({}, {"time": 0}, "'a.npz' has no array key_local to take a time of; give a frame or transforms."),
        ({}, {"transforms": [[1.0] * 12] * 2}, "transforms are for 2 handles; 'a.npz' has 3."),
        ({}, {"transforms": [[1.0] * 9] * 3}, "transforms must be n x 12 finite numbers."),
        ({}, {"transforms": 3}, "transforms must be n x 12 finite numbers. Got 3 instead."),
        ({"skin_indices": np.full((65, 3), 7)}, {"frame": 0}, "bone 7 of a vertex in 'a.npz' is not one of 3."),
        ({"skin_indices": np.zeros((65, 2), int)}, {"frame": 0}, "skin_indices of 'a.npz' must be bones"),
        ({"key_transforms": np.full((3, 3, 3, 4), np.nan)}, {"frame": 1}, "takes vertices to infinity or NaN"),
    ],
)
def test_skins_that_are_wrong_are_refused(more: Any, pose: Any, message: str, tmp_path: Path) -> None:
    skinned(tmp_path / "a.npz", **more)
    with pytest.raises(BadInput, match=rf"^geometry 'g': pose: .*{message}"):
        build({"kind": "mesh", "path": tmp_path / "a.npz", "pose": {"kind": "skin", **pose}}, "g")


def test_a_pose_of_another_mesh_is_refused(ball: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.npz"
    skinned(other)
    for pose, message in (
        ({"kind": "skin", "frame": 1, "path": str(other)}, "skin_weights of 'other.npz' are for 65 vertices"),
        ({"kind": "file", "path": str(other)}, "'other.npz' poses 65 vertices; this mesh has 642."),
        ({"kind": "file", "path": str(tmp_path / "none.npz")}, "is neither there nor in the data folder"),
    ):
        with pytest.raises(BadInput, match=message):
            build({"kind": "mesh", "path": ball, "pose": pose}, "g")


def test_only_flat_patches_are_laid_onto_surfaces(tmp_path: Path) -> None:
    skinned(tmp_path / "a.npz")
    with pytest.raises(BadInput, match="only a flat patch is laid onto a surface"):
        build({"kind": "mesh", "path": tmp_path / "a.npz", "pose": {"kind": "onto", "surface": "vase"}})
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.savez(tmp_path / "m.npz", vertices=vertices, triangles=[[0, 1, 2]], uv=vertices[:, :2] * [1, -1])
    with pytest.raises(BadInput, match="mirror image"):
        build({"kind": "mesh", "path": tmp_path / "m.npz", "pose": {"kind": "onto", "surface": "vase"}})
    with pytest.raises(BadInput, match="the sphere in closed form has no pose; give a mesh"):
        build({"kind": "sphere", "pose": {"kind": "turn", "degrees": 1}})
    with pytest.raises(BadInput, match="the mesh has no extent along z; choose another axis"):
        build({"kind": "mesh", "path": tmp_path / "m.npz", "pose": {"kind": "twist", "degrees": 1}})
