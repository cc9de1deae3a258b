"""Queries: uniform statistics, the sphere in closed form, meshes against the sphere that they approximate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy import stats

from data_gen.geometry import build as build_geometry
from data_gen.geometry import read
from data_gen.geometry.frames import nearest_rotations
from data_gen.views import VIEWS, build
from envbench.directions import from_angles, normalised, perpendicular
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Pose, Viewer

SPHERE = Geometry("sphere")


def check_unit(points: Points) -> None:
    for name in ("normal", "geometric_normal", "tangent", "view"):
        np.testing.assert_allclose(np.linalg.norm(getattr(points, name), axis=1), 1, atol=1e-12)
    assert np.sum(points.normal * points.view, axis=1).min() > 0
    np.testing.assert_allclose(np.sum(points.normal * points.tangent, axis=1), 0, atol=1e-12)
    assert points.weight.sum() == pytest.approx(1)


@pytest.mark.parametrize("name", VIEWS)
def test_presets_can_be_built(name: str) -> None:
    points, viewer = build({**VIEWS[name], **({"size": 32} if VIEWS[name]["kind"] == "image" else {})}, SPHERE, name)
    check_unit(points)
    assert (viewer is None) == (VIEWS[name]["kind"] != "image")


def test_uniform_queries_have_independent_uniform_r_and_v() -> None:
    points, viewer = build({"kind": "uniform", "count": 4096, "seed": 5}, SPHERE)
    assert viewer is None
    check_unit(points)
    r, v = points.reflection, points.view
    np.testing.assert_allclose(points.normal, normalised(r + v), atol=1e-9)
    np.testing.assert_array_equal(points.position, points.normal)
    # moments of the uniform distribution; scrambled Sobol points err less than independent ones, whose standard
    # deviation is at most 1 / sqrt(n) here, so five of them are ample
    bound = 5 / np.sqrt(len(points))
    for direction in (r, v):
        assert np.abs(direction.mean(0)).max() < bound
        assert np.abs(direction.T @ direction / len(points) - np.eye(3) / 3).max() < bound
    assert np.abs(r.T @ v / len(points)).max() < bound


def test_uniform_queries_follow_seed_and_count() -> None:
    def view(count: int, seed: int) -> Any:
        return build({"kind": "uniform", "count": count, "seed": seed}, SPHERE)[0].view

    np.testing.assert_array_equal(view(100, 1), view(100, 1))
    assert len(view(100, 1)) == 100
    assert len(view(1, 0)) == 1
    assert not np.array_equal(view(100, 1), view(100, 2))


TOWARDS = normalised([0.3, -1, 0.4])


@pytest.mark.parametrize("kind", ["uniform", "cap", "grazing"])
def test_a_direction_is_one_distant_viewer(kind: str) -> None:
    points, viewer = build({"kind": kind, "count": 64, "direction": (7 * TOWARDS).tolist()}, SPHERE)
    assert viewer is not None
    np.testing.assert_allclose(viewer.direction, TOWARDS, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(points.view, np.tile(viewer.direction, (64, 1)))
    check_unit(points)
    again, other = (build({"kind": kind, "count": 64, "seed": seed}, SPHERE)[0] for seed in (0, 1))
    assert again.key == build({"kind": kind, "count": 64}, SPHERE)[0].key != other.key


def uniformity(cosine: np.ndarray, azimuth: np.ndarray) -> float:
    """Return the p-value of the worse of two Kolmogorov-Smirnov tests: `cosine` in [0, 1] and `azimuth` uniform."""
    return min(
        stats.kstest(cosine, "uniform").pvalue, stats.kstest(azimuth % (2 * np.pi) / (2 * np.pi), "uniform").pvalue
    )


@pytest.mark.parametrize("seen", [{}, {"direction": TOWARDS.tolist()}])
@pytest.mark.parametrize("angle", [180.0, 30.0, 0.01])
@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (-0.3, 1.0, -0.4)])
def test_r_is_uniform_in_a_cap(axis: tuple[float, ...], angle: float, seen: dict[str, Any]) -> None:
    spec = {"kind": "cap", "reflection": list(axis), "angle": angle, "count": 2048, **seen}
    points, _ = build(spec, SPHERE)
    check_unit(points)
    centre = normalised(axis)
    x = perpendicular(centre)
    r = points.reflection
    # area of a cap ~ chord^2; Sobol points lie more evenly than the independent ones that the test assumes. The last
    # axis with the viewer is R at -V: N is half way between opposite directions, which leaves 1e-16 / angle of R.
    chord = np.linalg.norm(r - centre, axis=1) / (2 * np.sin(np.radians(angle) / 2))
    assert chord.max() <= 1 + 1e-6
    assert uniformity(np.minimum(chord, 1) ** 2, np.arctan2(r @ np.cross(centre, x), r @ x)) > 1e-3
    if not seen:
        assert np.abs(points.view.mean(0)).max() < 5 / np.sqrt(len(points))


@pytest.mark.parametrize("degrees", [0.0, 60.0, 89.99])
@pytest.mark.parametrize("seen", [{}, {"direction": TOWARDS.tolist()}])
def test_grazing_queries_have_their_angle(degrees: float, seen: dict[str, Any]) -> None:
    points, _ = build({"kind": "grazing", "degrees": degrees, "count": 512, **seen}, SPHERE)
    check_unit(points)
    angle = np.arctan2(
        np.linalg.norm(np.cross(points.normal, points.view), axis=1), np.sum(points.normal * points.view, axis=1)
    )
    np.testing.assert_allclose(angle, np.radians(degrees), rtol=0, atol=1e-12)
    if degrees:
        x = perpendicular(points.view)
        azimuth = np.arctan2(
            np.sum(points.normal * np.cross(points.view, x), axis=1), np.sum(points.normal * x, axis=1)
        )
        assert uniformity(np.full(1, 0.5), azimuth) > 1e-3


def test_points_of_the_sphere_have_uv() -> None:
    for spec in ({"kind": "uniform", "count": 256}, {"kind": "image", "size": 16, "eye": [2, 2, 2]}):
        points, _ = build(spec, SPHERE)
        assert points.uv is not None
        assert points.uv.min() >= 0
        assert points.uv.max() <= 1
        u, v = points.uv.T
        np.testing.assert_allclose(from_angles(np.pi * v, 2 * np.pi * u), points.position, atol=1e-12)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, -1, 0), (1, 2, -0.5)])
def test_an_image_of_the_sphere_is_its_closed_form(direction: tuple[float, float, float]) -> None:
    size = 33
    points, viewer = build({"kind": "image", "size": size, "direction": direction}, SPHERE)
    check_unit(points)
    towards = normalised(direction)
    assert viewer == Viewer(direction=tuple(towards))
    np.testing.assert_array_equal(points.view, np.broadcast_to(towards, points.view.shape))
    np.testing.assert_array_equal(points.position, points.normal)
    assert points.pixel is not None
    y, x = 1 - 2 * (points.pixel[:, 0] + 0.5) / size, 2 * (points.pixel[:, 1] + 0.5) / size - 1
    np.testing.assert_allclose(points.normal @ towards, np.sqrt(1 - x * x - y * y), atol=1e-12)
    middle = np.arange(size) + 0.5
    covered = np.add.outer((2 * middle / size - 1) ** 2, (2 * middle / size - 1) ** 2) < 1
    np.testing.assert_array_equal(np.isfinite(points.image(points.normal)[..., 0]), covered)
    if direction == (0, -1, 0):  # seen from -y with z up, x grows to the right
        np.testing.assert_allclose(points.normal[:, [0, 2]], np.stack([x, y], 1), atol=1e-12)


def test_an_eye_sees_the_sphere_in_perspective() -> None:
    eye = np.array([1.0, -3.0, 2.0])
    points, viewer = build({"kind": "image", "size": 64, "eye": eye.tolist(), "fov": 50}, SPHERE)
    check_unit(points)
    assert viewer is not None
    np.testing.assert_allclose(viewer.axis, normalised(-eye))
    np.testing.assert_allclose(points.view, normalised(eye - points.position), atol=1e-12)
    assert points.pixel is not None
    # the pinhole's projection of each point is the centre of its pixel
    towards = points.position - eye
    right = normalised(np.cross(normalised(-eye), [0, 0, 1]))
    x = (towards @ right) / (towards @ normalised(-eye)) / np.tan(np.radians(25))
    np.testing.assert_allclose(x, 2 * (points.pixel[:, 1] + 0.5) / 64 - 1, atol=1e-12)


def ball_file(path: Path, subdivisions: int = 4) -> Path:
    mesh: Any = trimesh.creation.icosphere(subdivisions=subdivisions)
    np.savez(path, vertices=mesh.vertices, triangles=mesh.faces, normals=mesh.vertices, uv=mesh.vertices[:, :2])
    return path


def ball(path: Path, subdivisions: int = 4) -> Geometry:
    return read(ball_file(path, subdivisions))


@pytest.mark.parametrize("camera", [{"direction": [0.3, -1, 0.2]}, {"eye": [0, -4, 1], "fov": 35, "target": [0, 0, 0]}])
def test_a_fine_mesh_of_the_sphere_gives_the_spheres_points(camera: dict[str, Any], tmp_path: Path) -> None:
    geometry, spec = ball(tmp_path / "ball.npz"), {"kind": "image", "size": 48, **camera}
    points, viewer = build(spec, geometry)
    truth, true_viewer = build(spec, SPHERE)
    check_unit(points)
    assert viewer == true_viewer
    mesh = geometry.mesh
    assert mesh is not None
    assert points.triangle is not None
    assert points.barycentric is not None
    assert points.uv is not None
    corners = mesh.triangles[points.triangle]
    np.testing.assert_allclose(points.barycentric.sum(1), 1, atol=1e-6)
    np.testing.assert_allclose(np.einsum("nk,nkc->nc", points.barycentric, mesh.vertices[corners]), points.position)
    np.testing.assert_allclose(points.uv, points.position[:, :2], atol=1e-6)
    # a facet of edge e lies e^2 / 8 inside the sphere; seen at N.V = c, that moves the point by e^2 / (8 c)
    edge = np.linalg.norm(mesh.vertices[corners[:, 0]] - mesh.vertices[corners[:, 1]], axis=1).max()
    both = np.isfinite(truth.image(truth.normal)).all(-1) & np.isfinite(points.image(points.normal)).all(-1)
    error = np.linalg.norm(truth.image(truth.normal) - points.image(points.normal), axis=-1)[both]
    cosine = truth.image(np.sum(truth.normal * truth.view, axis=1)[:, None])[..., 0][both]
    assert (error[cosine > 0.3] < edge**2 / 4 / cosine[cosine > 0.3]).all()
    assert np.count_nonzero(both) > 0.97 * len(truth)


def test_what_faces_away_is_left_out_and_counted(tmp_path: Path) -> None:
    # two triangles in the plane z = 0, as large; the shading normals of the right one face away from the viewer
    vertices = np.array([[-1, -1, 0], [0, -1, 0], [-1, 1, 0], [0, -1, 0], [1, -1, 0], [1, 1, 0]], float)
    normals = np.array([[0, 0, 1]] * 3 + [[0, 0.6, -0.8]] * 3)
    np.savez(tmp_path / "a.npz", vertices=vertices, triangles=[[0, 1, 2], [3, 4, 5]], normals=normals)
    points, _ = build({"kind": "image", "size": 32, "direction": [0, 0, 1], "up": [0, 1, 0]}, read(tmp_path / "a.npz"))
    assert set(np.sign(points.position[:, 0])) == {-1.0}
    away, covered = len(points), 2 * len(points)
    assert points.notes == (f"{away} of {covered} covered pixels are left out: their normal faces away.",)


def test_the_tangent_is_a_perpendicular() -> None:
    points, _ = build({"kind": "uniform", "count": 16}, SPHERE)
    np.testing.assert_allclose(np.sum(points.tangent * points.normal, axis=1), 0, atol=1e-12)


def test_grazing_views_are_asked_about_more_at_less_weight() -> None:
    """Weighed, N.V has the density 2 c still; its own is c + 1/2, of mean 7 / 12. Weights there fall to nothing."""
    points, _ = build({"kind": "uniform", "count": 4096, "grazing": 0.5}, SPHERE)
    check_unit(points)
    c = np.sum(points.normal * points.view, axis=1)
    assert points.weight.sum() == pytest.approx(1)
    assert points.weight @ c == pytest.approx(2 / 3, abs=2e-3)
    assert points.weight @ c**4 == pytest.approx(1 / 3, abs=2e-3)
    assert c.mean() == pytest.approx(7 / 12, abs=2e-3)
    assert np.abs(points.weight @ points.view).max() < 0.02


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"kind": "uniform", "count": 0}, r"count must be an integer in \[1, 16777216\]. Got 0 instead."),
        ({"kind": "uniform", "seed": 1.5}, "seed must be an integer"),
        ({"kind": "unifrom"}, "did you mean 'uniform'"),
        ({"kind": "uniform", "grazing": 1}, "grazing must"),
        ({"kind": "uniform", "grazing": 0.5, "direction": [0, 0, 1]}, "a view of their own each"),
        ({"kind": "uniform", "cuont": 4}, "did you mean 'count'"),
        ({"kind": "uniform", "direction": [0, 0, 0]}, "direction must not be zero"),
        ({"kind": "cap", "reflection": [0, 0, 0]}, "reflection must not be zero"),
        ({"kind": "cap", "reflection": "up"}, "reflection must be three finite numbers"),
        ({"kind": "cap", "angle": 0}, r"angle must lie in \[0.0001, 180\] degrees. Got 0 instead."),
        ({"kind": "cap", "angle": float("nan")}, "Got nan"),
        ({"kind": "grazing", "degrees": 90}, r"degrees must lie in \[0, 89.9999\] degrees. Got 90 instead."),
        ({"kind": "grazing", "fov": 90}, "setting of view 'v'"),
        ({"kind": "image"}, "either a direction or an eye; give exactly one"),
        ({"kind": "image", "direction": [0, 0, 1], "eye": [0, 0, 2]}, "either a direction or an eye"),
        ({"kind": "image", "direction": [0, 0, 0]}, "direction must not be zero"),
        ({"kind": "image", "direction": [0, 1]}, r"direction must be three finite numbers. Got \[0, 1\] instead."),
        ({"kind": "image", "direction": [0, 0, 1], "fov": 30}, "fov and target belong to an eye"),
        ({"kind": "image", "eye": [0, 0, 2], "fov": 180}, r"fov must lie in \(0, 180\) degrees. Got 180 instead."),
        ({"kind": "image", "eye": [0, 0, 0.5]}, "lies inside the unit sphere; move it out."),
        ({"kind": "image", "eye": [0, 0, 3], "target": [0, 0, 3]}, "lies at its own target"),
        ({"kind": "image", "eye": [0, 0, 3], "target": [0, 0, 9]}, "sees nothing of 'sphere'"),
        ({"kind": "image", "size": 0, "direction": [0, 0, 1]}, "size must be an integer"),
    ],
)
def test_wrong_tables_are_refused(spec: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        build(spec, SPHERE, "v")


@pytest.mark.parametrize("kind", ["uniform", "cap", "grazing"])
def test_queries_want_the_sphere(kind: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=f"{kind} queries need the sphere; give 'ball' an image or its vertices instead"):
        build({"kind": kind}, ball(tmp_path / "ball.npz", 1))


BENT: dict[str, Any] = {"kind": "patch", "texture": "bumps", "tiles": 2, "resolution": 33,
                        "pose": {"kind": "onto", "surface": "bent"}}  # fmt: skip


def on_patch(view: dict[str, Any], spec: dict[str, Any]) -> tuple[Points, Geometry]:
    geometry = build_geometry(spec, "patch")
    points, _ = build(view, geometry)
    check_unit(points)
    return points, geometry


@pytest.mark.parametrize("view", [{"kind": "image", "size": 48, "direction": [1, 0.2, 0.3]}, {"kind": "vertices"}])
@pytest.mark.parametrize("uv", [True, False])
def test_points_of_a_pose_carry_its_rotation(view: dict[str, Any], uv: bool, tmp_path: Path) -> None:
    whole = build_geometry(BENT, "patch")
    assert whole.mesh is not None
    geometry = whole if uv else replace(whole, mesh=replace(whole.mesh, uv=None))
    points, _ = build(view, geometry)
    check_unit(points)
    rest, posed, pose = geometry.mesh, geometry.posed.mesh, geometry.pose
    assert rest is not None
    assert posed is not None
    assert pose is not None
    assert points.rotation is not None
    assert points.triangle is not None
    assert points.barycentric is not None
    R, corners = points.rotation, rest.triangles[points.triangle]

    def blend(attribute: np.ndarray) -> np.ndarray:
        return np.einsum("nk,nk...->n...", points.barycentric, attribute[corners])

    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-13)
    np.testing.assert_allclose(points.position, blend(posed.vertices), atol=1e-12)
    before = normalised(blend(rest.normals))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, before), points.normal, atol=1e-12)
    # the nearest rotation to the blend, but for the turn that takes the normals along: less than a triangle bends
    apart = np.linalg.norm(R - nearest_rotations(blend(pose.rotations)), axis=(1, 2))
    assert apart.max() < 0.02
    a, b, c = (posed.vertices[corners[:, k]] for k in range(3))
    np.testing.assert_allclose(points.geometric_normal, normalised(np.cross(b - a, c - a)), atol=1e-12)
    if uv:  # a bent patch: u runs along the arc
        assert np.median(np.abs(points.tangent[:, 2])) < 0.05
    else:
        np.testing.assert_allclose(points.tangent, np.einsum("nij,nj->ni", R, perpendicular(before)), atol=1e-12)


def test_points_without_a_pose_have_no_rotation() -> None:
    points, _ = on_patch({"kind": "vertices"}, {key: value for key, value in BENT.items() if key != "pose"})
    assert points.rotation is None
    np.testing.assert_allclose(points.tangent[:, 1], 0, atol=0.1)  # along u, which is x


def test_collapsed_uv_leave_a_tangent() -> None:
    geometry = build_geometry({key: value for key, value in BENT.items() if key != "pose"}, "patch")
    assert geometry.mesh is not None
    assert geometry.mesh.uv is not None
    flat = replace(geometry, mesh=replace(geometry.mesh, uv=0 * geometry.mesh.uv))
    points, _ = build({"kind": "vertices"}, flat)
    np.testing.assert_array_equal(points.tangent, perpendicular(points.normal))


def test_vertices_are_queries_weighted_by_their_share_of_the_posed_area(tmp_path: Path) -> None:
    stretch = {"kind": "stretch", "factor": 3.0, "axis": "x", "across": 1.0}
    geometry = build_geometry({"kind": "mesh", "path": ball_file(tmp_path / "a.npz", 3), "pose": stretch}, "ball")
    points, viewer = build({"kind": "vertices"}, geometry)
    check_unit(points)
    mesh = geometry.posed.mesh
    assert mesh is not None
    assert viewer is None
    assert points.notes == ()
    np.testing.assert_array_equal(points.position, mesh.vertices)
    np.testing.assert_allclose(points.normal, mesh.normals, atol=1e-12)
    np.testing.assert_array_equal(points.view, mesh.normals)
    assert points.barycentric is not None
    assert points.triangle is not None
    assert set(points.barycentric.ravel()) == {0.0, 1.0}
    shape: Any = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    third = np.zeros(len(mesh.vertices))
    for triangle, area in zip(mesh.triangles, shape.area_faces, strict=True):
        third[triangle] += area / 3
    np.testing.assert_allclose(points.weight, third / shape.area, rtol=1e-9)
    # the weighted mean of a linear function over a closed surface's normals: no flux of a constant field
    assert np.abs(points.weight @ points.normal).max() < 1e-3


def test_vertices_seen_from_afar_are_those_that_face_it(tmp_path: Path) -> None:
    geometry = read(ball_file(tmp_path / "a.npz", 3))
    points, viewer = build({"kind": "vertices", "direction": [0, 0, 2]}, geometry)
    check_unit(points)
    assert viewer == Viewer(direction=(0, 0, 1))
    assert points.position[:, 2].min() > 0
    left = 642 - len(points)
    assert points.notes == (f"{left} of 642 vertices are left out: they face away.",)
    few, _ = build({"kind": "vertices", "count": 50}, geometry)
    assert len(few) == 50
    assert few.weight.sum() == pytest.approx(1)
    assert len(build({"kind": "vertices", "count": 5000}, geometry)[0]) == 642


def test_vertices_without_area_are_left_out_and_counted() -> None:
    """A pose that collapses one half of a sheet onto a line."""
    geometry = build_geometry({key: value for key, value in BENT.items() if key != "pose"}, "patch")
    mesh = geometry.mesh
    assert mesh is not None
    vertices = mesh.vertices * np.where(mesh.vertices[:, :1] < 0.5, [[0.0, 1, 0]], 1)
    pose = Pose("collapse", vertices, mesh.normals, np.broadcast_to(np.eye(3), (len(vertices), 3, 3)))
    points, _ = build({"kind": "vertices"}, replace(geometry, pose=pose))
    check_unit(points)
    assert "vertices are left out: no triangle about them faces along their normal." in points.notes[0]
    lost = int(points.notes[0].split()[0])
    assert len(points) + lost == len(vertices)
    assert lost >= 15 * 33


def test_wrong_vertex_queries_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="'sphere' has no vertices; give a mesh, or uniform queries"):
        build({"kind": "vertices"}, SPHERE)
    np.savez(tmp_path / "a.npz", vertices=np.eye(3), triangles=[[0, 1, 2]])
    with pytest.raises(BadInput, match="view 'v' sees no vertex of 'a'; give another direction"):
        build({"kind": "vertices", "direction": [-1, -1, -1]}, read(tmp_path / "a.npz"), "v")
    with pytest.raises(BadInput, match="count must be an integer"):
        build({"kind": "vertices", "count": 0}, read(tmp_path / "a.npz"), "v")
