"""References on posed shapes, with bounces, and under signed light."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy import stats

from data_gen.geometry import mitsuba_mesh
from data_gen.lobes import Lambertian, Membrane, Phong
from data_gen.mitsuba_bsdf import bsdf
from data_gen.mitsuba_light import emitter
from envbench import latlong, real_harmonics
from envbench.directions import normalised, perpendicular
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Pose, TriangleMesh
from envbench.material import Lobe, Material, Texture
from envbench.reference import ReferenceSettings
from envbench.scene import FREE, Effect, Scene
from methods.ldprt.transfer import simulate
from references.cache import address, provenance
from references.estimators import estimator_for
from references.mitsuba_direct import render
from references.quadrature import integrate

K = 8
LOCAL = frozenset({Effect.SELF_SHADOWING})
ALL = LOCAL | {Effect.DEFORMATION}
TURN = np.array([[0.0, -0.6, 0.8], [1, 0, 0], [0, 0.8, 0.6]])  # rows orthonormal, a rotation
GREY = (0.6, 0.6, 0.6)


def cross(divisions: int = 1) -> TriangleMesh:
    """A slab above another: shadows, and faces that send light to each other; nothing touches."""
    slabs = [trimesh.creation.box(extents=e) for e in ((2, 2, 0.4), (0.4, 2, 2))]
    slabs[1].apply_translation([0.3, 0.1, 1.7])
    mesh = trimesh.util.concatenate(slabs)
    for _ in range(divisions):
        mesh = mesh.subdivide()
    mesh.unmerge_vertices()
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32), np.array(mesh.vertex_normals))


def pose(mesh: TriangleMesh, turn: np.ndarray) -> Pose:
    turns = np.broadcast_to(turn, (len(mesh.vertices), 3, 3))
    return Pose("turned", mesh.vertices @ turn.T + 0.5, mesh.normals @ turn.T, turns)


def points_on(mesh: TriangleMesh, posed: Pose | None = None, count: int = 60, seed: int = 0) -> Points:
    """Points within random triangles, seen from some 45 degrees off their normals."""
    rng = np.random.default_rng(seed)
    triangle = rng.integers(len(mesh.triangles), size=count).astype(np.int32)
    barycentric = rng.dirichlet((2, 2, 2), count)
    corners = mesh.triangles[triangle]
    vertices, normals = (mesh.vertices, mesh.normals) if posed is None else (posed.vertices, posed.normals)
    position, normal = (np.einsum("nk,nkc->nc", barycentric, v[corners]) for v in (vertices, normals))
    normal = normalised(normal)
    a, b, c = (vertices[corners[:, k]] for k in range(3))
    view = normalised(normal + perpendicular(normal))
    return Points(
        position, normal, normalised(np.cross(b - a, c - a)), perpendicular(normal), view, np.full(count, 1 / count),
        rotation=None if posed is None else posed.rotations[corners[:, 0]], triangle=triangle, barycentric=barycentric,
    )  # fmt: skip


def scene(
    light: Environment, points: Points, geometry: Geometry, effects: frozenset[Effect], lobe: Lobe | None = None
) -> Scene:
    material = Material("test", (lobe or Lambertian(reflectance=GREY),))
    return Scene("test", light, material, geometry, points, effects=FREE | effects)


def replicates(made: Scene, samples: int = 256, bounces: int = 3, seed: int = 5) -> np.ndarray:
    estimator = estimator_for(made, ReferenceSettings(bounces=bounces))
    return np.stack([
        estimator.replicate(made.points, samples, s) for s in np.random.SeedSequence(seed).spawn(K)
    ])  # fmt: skip


def assert_same(a: np.ndarray, b: np.ndarray) -> None:
    """Means over all points differ by no more than Welch's t allows at 99.9 %, nor do squares at each point."""
    assert stats.ttest_ind(a.mean((1, 2)), b.mean((1, 2)), equal_var=False).pvalue > 1e-3
    square = (a.mean(0) - b.mean(0)) ** 2
    expected = (a.var(0, ddof=1) + b.var(0, ddof=1)) / K
    assert square.mean() < 2.5 * expected.mean() + 1e-12  # 60 points, channels alike, of heavy tails


def turned(light: Environment, turn: np.ndarray) -> Environment:
    """The light that is at w what the other is at R^T w, on a grid so fine that it hardly matters."""
    return Environment("turned", light(latlong.grid(256, 512) @ turn).astype(np.float32))


@pytest.fixture(scope="module")
def smooth() -> Environment:
    directions = latlong.grid(64, 128)
    lamp = np.exp(4 * (directions @ normalised([1.0, 2, 1.5]) - 1))
    return Environment("smooth", (0.1 + lamp[..., None] * [2.0, 1.5, 1]).astype(np.float32))


@pytest.mark.parametrize("lobe", [Lambertian(reflectance=GREY), Phong(exponent=60)], ids=["diffuse", "glossy"])
@pytest.mark.parametrize("bounces", [0, 2])
def test_a_rigid_pose_is_the_rest_under_turned_light(
    mi: ModuleType, smooth: Environment, lobe: Lobe, bounces: int
) -> None:
    """Local effects only, all effects, and the shape at rest with light and view turned back: one and the same."""
    mesh = cross()
    posed = pose(mesh, TURN)
    more = frozenset({Effect.INTERREFLECTION}) if bounces else frozenset[Effect]()
    geometry, points = Geometry("cross", mesh, convex=False, pose=posed), points_on(mesh, posed)
    local, whole = (replicates(scene(smooth, points, geometry, e | more, lobe), 64) for e in (LOCAL, ALL))
    at_rest = points_on(mesh)
    assert points.normal @ TURN == pytest.approx(at_rest.normal)
    at_rest = replace(at_rest, view=points.view @ TURN, tangent=points.tangent @ TURN)
    back = scene(turned(smooth, TURN.T), at_rest, geometry.rest, LOCAL | more, lobe)
    expected = replicates(back, 64, seed=6)
    assert_same(local, expected)
    assert_same(whole, expected)


def test_local_effects_leave_out_what_the_pose_brings(mi: ModuleType, smooth: Environment) -> None:
    """A flat sheet folded to a right angle: local effects see no fold, all effects do."""
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    flat = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    corner = np.arange(72).reshape(8, 9)[:, :-1].ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 10], corner[:, None] + [0, 10, 9]]).astype(np.int32)
    up = np.broadcast_to([0.0, 0, 1], flat.shape)
    wall = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # x goes up, the normal to -x
    right = flat[:, 0] > 1e-9
    turns = np.where(right[:, None, None], wall, np.eye(3))
    posed = Pose("folded", np.einsum("nij,nj->ni", turns, flat), np.einsum("nij,nj->ni", turns, up), turns)
    mesh = TriangleMesh(flat, faces, up)
    geometry = Geometry("sheet", mesh, convex=False, pose=posed)
    points = points_on(mesh, posed)
    local, whole, none = (replicates(scene(smooth, points, geometry, e)) for e in (LOCAL, ALL, frozenset[Effect]()))
    assert_same(local, none)
    assert whole.mean() < 0.9 * local.mean()
    keys = {address(provenance(scene(smooth, points, geometry, e), ReferenceSettings())) for e in (LOCAL, ALL)}
    moved = replace(points, rotation=np.broadcast_to(np.eye(3), (len(points), 3, 3)))
    keys.add(address(provenance(scene(smooth, moved, geometry, LOCAL), ReferenceSettings())))
    assert len(keys) == 3


def test_local_effects_need_to_know_the_place_at_rest(mi: ModuleType, smooth: Environment) -> None:
    mesh = cross()
    points = replace(points_on(mesh, pose(mesh, TURN)), triangle=None)
    with pytest.raises(BadInput, match="triangle and barycentric"):
        replicates(scene(smooth, points, Geometry("cross", mesh, convex=False, pose=pose(mesh, TURN)), LOCAL))


def by_path(mi: ModuleType, made: Scene, bounces: int) -> np.ndarray:
    """Estimates (K, n, 3) by Mitsuba's own `path` along the views, 128 independent samples a ray."""
    import drjit as dr

    mesh = made.geometry.mesh
    assert mesh is not None
    shape = mitsuba_mesh(mi, mesh)
    shape.set_bsdf(bsdf(made.material))
    world = mi.load_dict({"type": "scene", "shape": shape, "light": emitter(made.environment)})
    integrator = mi.load_dict({"type": "path", "max_depth": bounces + 2, "rr_depth": 1000})
    points, index = made.points, dr.arange(mi.UInt32, len(made.points) * 128) // 128
    o, d = (
        dr.gather(mi.Vector3f, mi.Vector3f(np.ascontiguousarray(v.T, np.float32)), index)
        for v in (points.position + 1e-3 * points.view, -points.view)
    )
    estimates = []
    for seed in range(K):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, dr.width(index))
        radiance = integrator.sample(world, sampler, mi.RayDifferential3f(mi.Point3f(o), d))[0]
        estimates.append(np.array(radiance).reshape(3, -1, 128).mean(-1).T)
    return np.stack(estimates).astype(float)


@pytest.mark.parametrize("lobe", [Lambertian(reflectance=GREY), Phong(exponent=60)], ids=["diffuse", "glossy"])
def test_bounces_are_those_of_path(mi: ModuleType, smooth: Environment, lobe: Lobe) -> None:
    mesh = cross()
    made = scene(smooth, points_on(mesh), Geometry("cross", mesh, convex=False), LOCAL | {Effect.INTERREFLECTION}, lobe)
    direct, lit = (replicates(made, 64, k) for k in (1, 2))
    assert_same(direct, by_path(mi, made, 1))
    assert_same(lit, by_path(mi, made, 2))
    assert lit.mean() > direct.mean()


def test_a_texture_modulates_bounces(mi: ModuleType, smooth: Environment) -> None:
    """A texture of one grey is a reflectance: at the points, that of `modulation`; at bounces, the estimator's."""
    mesh = replace(cross(), uv=np.random.default_rng(0).uniform(-1, 2, (len(cross().vertices), 2)))
    geometry, points, effects = Geometry("cross", mesh, convex=False), points_on(mesh), LOCAL | {Effect.INTERREFLECTION}
    grey = scene(smooth, points, geometry, effects, Lambertian(reflectance=(0.4, 0.4, 0.4)))
    white = scene(smooth, points, geometry, effects, Lambertian(reflectance=(0.8, 0.8, 0.8)))
    texture = Texture("half", np.full((4, 4, 3), 0.5, np.float32))
    textured = replace(white, material=replace(white.material, texture=texture))
    assert replicates(textured, 16) * 0.5 == pytest.approx(replicates(grey, 16), rel=1e-4)


def test_a_point_at_a_vertex_of_a_convex_shape_is_not_shadowed(mi: ModuleType, smooth: Environment) -> None:
    """Not by one of its own triangles, whichever's geometric normal it has."""
    ball = trimesh.creation.icosphere(1)
    mesh = TriangleMesh(np.array(ball.vertices), np.array(ball.faces, np.int32), np.array(ball.vertex_normals))
    barycentric = np.tile([1.0, 0, 0], (len(mesh.triangles), 1))
    at = mesh.triangles[:, 0]
    normal = mesh.normals[at]
    points = Points(
        mesh.vertices[at], normal, np.array(ball.face_normals), perpendicular(normal), normal,
        np.full(len(at), 1 / len(at)), triangle=np.arange(len(at), dtype=np.int32), barycentric=barycentric,
    )  # fmt: skip
    convex, tested = (scene(smooth, points, Geometry("ball", mesh, convex=c), LOCAL) for c in (True, False))
    assert np.array_equal(replicates(convex), replicates(tested))


def ringing(order: int = 4, seed: int = 1) -> tuple[Environment, np.ndarray]:
    """Random light of l < order, a third of it negative, and its coefficients."""
    light = np.random.default_rng(seed).normal(size=(order**2, 3))
    light[0] += 2
    values = np.tensordot(real_harmonics.basis(order - 1, latlong.grid(128, 256).reshape(-1, 3)).T, light, 1)
    made = Environment("ringing", values.reshape(128, 256, 3).astype(np.float32), signed=True)
    return made, real_harmonics.project(made.radiance, order - 1)


@pytest.mark.parametrize("lobe", [Lambertian(reflectance=GREY), Phong(exponent=20), Membrane(transparency=0.4)])
def test_signed_light_is_the_difference_of_two_renderings(mi: ModuleType, lobe: Lobe) -> None:
    light, _ = ringing()
    assert light.radiance.min() < -0.2
    mesh = TriangleMesh(*(np.array(v) for v in _ball()))
    made = scene(light, points_on(mesh, count=24), Geometry("ball", mesh), frozenset(), lobe)
    both = replicates(made)
    exact = integrate(made)
    within = stats.t.ppf(0.9995, K - 1) * both.mean((1, 2)).std(ddof=1) / np.sqrt(K)
    assert both.mean() == pytest.approx(exact.mean(), abs=within)
    parts = [sign * integrate(replace(made, environment=part)) for sign, part in light.parts]
    assert np.sum(parts, axis=0) == pytest.approx(exact, abs=1e-6)


def _ball() -> tuple[Any, Any, Any]:
    ball = trimesh.creation.icosphere(1)
    return ball.vertices, ball.faces.astype(np.int32), ball.vertex_normals


def at_corners(mesh: TriangleMesh, count: int = 80) -> tuple[Points, np.ndarray]:
    """Points a thousandth inside random corners (at a corner itself the other faces of a box begin), and vertices."""
    chosen = np.random.default_rng(2).permutation(len(mesh.triangles))[:count]
    corner = np.random.default_rng(3).integers(3, size=count)
    barycentric = np.full((count, 3), 1e-3)
    barycentric[np.arange(count), corner] = 1 - 2e-3
    at = mesh.triangles[chosen, corner]
    position, normal = np.einsum("nk,nkc->nc", barycentric, mesh.vertices[mesh.triangles[chosen]]), mesh.normals[at]
    return Points(position, normal, normal, perpendicular(normal), normal, np.full(count, 1 / count)), at


def test_transfer_agrees_with_mitsuba_under_band_limited_light(mi: ModuleType) -> None:
    """Radiance at the vertices, t . e, against the reference: errors as large as both state together, and no bias."""
    mesh = cross()
    geometry, (points, at), (light, e) = Geometry("cross", mesh, convex=False), at_corners(mesh), ringing()
    reference = replicates(scene(light, points, geometry, LOCAL), 1024)
    runs = np.stack([simulate(geometry, 4, rays=2000, seed=s).vectors[at] @ e for s in range(K)]) * GREY[0]
    assert_same(runs, reference)


@pytest.mark.parametrize("bounces", [1, 2])
def test_inter_reflected_transfer_agrees_with_mitsuba(mi: ModuleType, bounces: int) -> None:
    """On a mesh so fine that interpolating the bounce between its vertices costs nothing: noise alone is left."""
    mesh = cross(divisions=3)
    geometry, (points, at), (light, e) = Geometry("cross", mesh, convex=False), at_corners(mesh), ringing()
    reference = replicates(scene(light, points, geometry, LOCAL | {Effect.INTERREFLECTION}), 1024, bounces)
    transfer = simulate(geometry, 4, kind="interreflected", rays=1000, bounces=bounces, albedo=GREY[0])
    error = GREY[0] * transfer.vectors[at] @ e - reference.mean(0)
    power = (reference.mean(0) ** 2).mean()
    noise = (reference.var(0, ddof=1) / K).mean() / power + transfer.relative_error**2
    assert (error**2).mean() / power < 1.5 * noise
    assert abs(error.mean()) < 3e-3 * np.sqrt(power)


def test_the_floor_counts_the_noise_of_both_parts(mi: ModuleType) -> None:
    mesh = TriangleMesh(*(np.array(v) for v in _ball()))
    made = scene(ringing()[0], points_on(mesh, count=24), Geometry("ball", mesh), frozenset(), Phong(exponent=8))
    result = render(made, ReferenceSettings(floor=5e-3))
    assert result.floor <= 5e-3
    error = result.mean - integrate(made)
    assert np.sqrt((error**2).mean()) < 2 * result.floor * result.rms
