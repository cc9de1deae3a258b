"""References of translucent shapes: a white medium, the method's own walks, and shapes in a pose."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh

from data_gen.lobes import Lambertian
from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from data_gen.mitsuba_volume import Scattering
from data_gen.mitsuba_walk import Walk
from envbench import latlong, real_harmonics
from envbench.directions import normalised, perpendicular
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Pose, TriangleMesh
from envbench.material import Material, Medium
from envbench.reference import ReferenceSettings
from envbench.scene import Effect, Scene
from methods import METHODS
from references.cache import provenance
from references.estimators import estimator_for
from references.mitsuba_direct import render

K = 8
INSIDE = frozenset({Effect.SUBSURFACE})
TURN = np.array([[0.0, -0.6, 0.8], [1, 0, 0], [0, 0.8, 0.6]])
WAX = Material("wax", (Lambertian(reflectance=(0.8, 0.6, 0.4)),), medium=Medium(0.4, albedo=0.9))


@pytest.fixture(scope="module")
def dumbbell() -> TriangleMesh:
    """Two balls beside each other: what leaves one may enter the other."""
    balls = [trimesh.creation.icosphere(1, radius=r) for r in (1.0, 0.7)]
    balls[1].apply_translation([2.0, 0.3, 0])
    mesh: Any = trimesh.util.concatenate(balls)
    return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32), np.array(mesh.vertex_normals))


def turned(mesh: TriangleMesh) -> Pose:
    turns = np.broadcast_to(TURN, (len(mesh.vertices), 3, 3))
    return Pose("turned", mesh.vertices @ TURN.T + 0.5, mesh.normals @ TURN.T, turns)


def points_on(mesh: TriangleMesh, pose: Pose | None = None, count: int = 40) -> Points:
    """Vertices, each as the first corner of a triangle."""
    triangle = np.linspace(0, len(mesh.triangles) - 1, count).astype(np.int32)
    vertex = mesh.triangles[triangle, 0]
    vertices, normals = (mesh.vertices, mesh.normals) if pose is None else (pose.vertices, pose.normals)
    a, b, c = (vertices[mesh.triangles[triangle, k]] for k in range(3))
    normal = normals[vertex]
    return Points(
        vertices[vertex], normal, normalised(np.cross(b - a, c - a)), perpendicular(normal), normal,
        np.full(count, 1 / count), rotation=None if pose is None else pose.rotations[vertex], triangle=triangle,
        barycentric=np.eye(3)[np.zeros(count, int)],
    )  # fmt: skip


def signed_light(order: int = 4) -> Environment:
    """A light of a few harmonics that is negative in places."""
    e = np.random.default_rng(1).normal(size=(order**2, 3))
    e[0] += 4
    grid = latlong.grid(64, 128)
    values = np.tensordot(real_harmonics.basis(order - 1, grid.reshape(-1, 3)).T, e, 1).reshape(64, 128, 3)
    assert values.min() < 0
    return Environment("signed", values.astype(np.float32), signed=True)


def replicates(made: Scene, samples: int, seed: int = 5) -> np.ndarray:
    estimator = estimator_for(made, ReferenceSettings())
    assert isinstance(estimator, Walk)
    return looks(estimator, made.points, samples, seed)


def looks(estimator: Estimator, points: Points, samples: int, seed: int) -> np.ndarray:
    return np.stack([estimator.replicate(points, samples, s) for s in np.random.SeedSequence(seed).spawn(K)])


def test_light_with_detail_is_sampled_on_the_way(mi: ModuleType, dumbbell: TriangleMesh) -> None:
    lamp = Environment("lamp", np.pad(np.ones((1, 1, 3), np.float32), ((8, 7), (0, 31), (0, 0))))
    shape = Geometry("balls", dumbbell, False)
    made = Scene("test", lamp, WAX, shape, points_on(dumbbell), effects=INSIDE | {Effect.LIGHT_DETAIL})
    assert isinstance(estimator_for(made, ReferenceSettings()), Scattering)
    assert isinstance(estimator_for(replace(made, effects=INSIDE), ReferenceSettings()), Walk)
    assert isinstance(estimator_for(replace(made, effects=INSIDE), ReferenceSettings(variant="scalar_rgb")), Scattering)
    assert isinstance(estimator_for(replace(made, effects=INSIDE, heeded=False), ReferenceSettings()), Scattering)
    integrators = {
        provenance(replace(made, effects=e), ReferenceSettings())["integrator"] for e in (made.effects, INSIDE)
    }
    assert len(integrators) == 2


def test_a_white_medium_in_constant_light_sends_out_the_reflectance(
    mi: ModuleType, dumbbell: TriangleMesh, constant: Environment
) -> None:
    surface = Surface(replace(WAX, medium=Medium(0.4)), dumbbell)
    got = looks(Scattering(surface, constant), points_on(dumbbell), 256, seed=5)
    error = got.std(0, ddof=1) / np.sqrt(K)
    assert np.abs(got.mean((0, 1)) / WAX.lobes[0].reflectance - 1) == pytest.approx(0, abs=0.01)
    assert np.sqrt(((got.mean(0) - WAX.lobes[0].reflectance) ** 2).mean()) < 1.5 * np.sqrt((error**2).mean())


@pytest.mark.parametrize("posed", [False, True])
def test_agrees_with_transfer_by_walks(mi: ModuleType, dumbbell: TriangleMesh, posed: bool) -> None:
    """Within both noises, under signed light of the transfer's own bands; posed: turned transfer, and light."""
    pose = turned(dumbbell) if posed else None
    made = Scene(
        "test", signed_light(), WAX, Geometry("balls", dumbbell, False, pose=pose), points_on(dumbbell, pose),
        effects=INSIDE,
    )  # fmt: skip
    theirs = replicates(made, 1024)
    ours: list[np.ndarray] = []
    for seed in range(4):
        method = METHODS["sh-rotation"](order=4, transfer="subsurface", rays=2000, seed=seed)  # pyright: ignore[reportCallIssue]
        assert method.refusal(made) is None
        assert method.lacks(made) == set()
        prepared = method.prepare(made.material, made.geometry.rest)
        ours.append(method.shade(method.relight(prepared, made.environment), made.points))
    error = np.mean(ours, axis=0) - theirs.mean(0)
    noise = theirs.var(0, ddof=1) / K + np.var(ours, axis=0, ddof=1) / 4
    assert (error**2).mean() < 2 * noise.mean()
    assert abs(error.mean()) < 0.01 * np.abs(theirs.mean(0)).mean()


def test_the_posed_shape_is_met_with_deformation(mi: ModuleType, dumbbell: TriangleMesh) -> None:
    """A rigid pose tells no more of deformation than of local effects; paths start within the posed shape."""
    pose = turned(dumbbell)
    shape = Geometry("balls", dumbbell, False, pose=pose)
    made = Scene("test", signed_light(), WAX, shape, points_on(dumbbell, pose), effects=INSIDE)
    local, posed = replicates(made, 512), replicates(replace(made, effects=INSIDE | {Effect.DEFORMATION}), 512, seed=6)
    error = local.mean(0) - posed.mean(0)
    noise = (local.var(0, ddof=1) + posed.var(0, ddof=1)) / K
    assert (error**2).mean() < 2 * noise.mean()


def test_renders_with_texture_and_replicates_of_their_own(
    mi: ModuleType, dumbbell: TriangleMesh, constant: Environment
) -> None:
    points = points_on(dumbbell, count=12)
    made = Scene("test", constant, WAX, Geometry("balls", dumbbell, False), points, effects=INSIDE)
    settings = ReferenceSettings(floor=0.1, budget=5)
    plain, half = (
        render(replace(made, points=replace(points, modulation=m)), settings) for m in (None, np.full((12, 3), 0.5))
    )
    assert len({replicate.tobytes() for replicate in plain.replicates}) == settings.replicates
    assert half.replicates == pytest.approx(plain.replicates / 2, rel=1e-6)
    assert plain.rms > 0
    inside, opaque = (provenance(replace(made, effects=e), settings) for e in (INSIDE, frozenset[Effect]()))
    assert inside["integrator"] != opaque["integrator"]


def test_needs_a_medium(mi: ModuleType, dumbbell: TriangleMesh, constant: Environment) -> None:
    surface = Surface(replace(WAX, medium=None), dumbbell)
    with pytest.raises(BadInput, match="wax"):
        Scattering(surface, constant).replicate(points_on(dumbbell), 16, np.random.SeedSequence(0))
