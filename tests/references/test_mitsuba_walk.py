"""Walks through a translucent shape: constant light, against `volpath`, signed and turned light."""

from __future__ import annotations

import pickle
from dataclasses import replace
from types import ModuleType

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
from envbench.geometry import Points, TriangleMesh
from envbench.material import Material, Medium

K = 16
RHO = np.array([0.8, 0.6, 0.4])
WAX = Material("wax", (Lambertian(reflectance=(0.8, 0.6, 0.4)),), medium=Medium(0.3))
TURN = np.array([[0.0, -0.6, 0.8], [1, 0, 0], [0, 0.8, 0.6]])


@pytest.fixture(scope="module")
def slab() -> TriangleMesh:
    """A thin closed slab whose top is bent to a trough: what leaves it may come in again."""
    box = trimesh.creation.box((2.0, 2.0, 0.4)).subdivide().subdivide().subdivide()
    bent = np.array(box.vertices)
    bent[:, 2] += 0.6 * bent[:, 0] ** 2
    mesh = trimesh.Trimesh(bent, box.faces)
    return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32), np.array(mesh.vertex_normals))


@pytest.fixture(scope="module")
def sky() -> Environment:
    """A light of five bands, negative in places."""
    e = np.random.default_rng(3).normal(size=(25, 3))
    e[0] += 4
    grid = latlong.grid(64, 128)
    values = np.tensordot(real_harmonics.basis(4, grid.reshape(-1, 3)).T, e, 1).reshape(64, 128, 3)
    assert values.min() < 0
    return Environment("sky", values.astype(np.float32), signed=True)


def points_on(mesh: TriangleMesh, count: int = 60, rotation: np.ndarray | None = None) -> Points:
    """Points within triangles."""
    rng = np.random.default_rng(0)
    triangle = rng.choice(len(mesh.triangles), count, replace=False).astype(np.int32)
    barycentric = rng.dirichlet(np.ones(3), count)
    a, b, c = (mesh.vertices[mesh.triangles[triangle, k]] for k in range(3))
    normal = normalised(np.cross(b - a, c - a))
    position = np.einsum("nk,nkc->nc", barycentric, np.stack([a, b, c], 1))
    turns = None if rotation is None else np.broadcast_to(rotation, (count, 3, 3))
    return Points(
        position, normal, normal, perpendicular(normal), normal, np.full(count, 1 / count), rotation=turns,
        triangle=triangle, barycentric=barycentric,
    )  # fmt: skip


def looks(estimator: Estimator, points: Points, samples: int, seed: int = 1) -> np.ndarray:
    return np.stack([estimator.replicate(points, samples, s) for s in np.random.SeedSequence(seed).spawn(K)])


def assert_same(ours: np.ndarray, theirs: np.ndarray) -> None:
    """Hold two sets of replicates (K, n, 3) against each other: point by point, and their means over all points."""
    noise = (ours.var(0, ddof=1) + theirs.var(0, ddof=1)) / K
    z = (ours.mean(0) - theirs.mean(0)) / np.sqrt(noise)
    assert (z**2).mean() == pytest.approx((K - 1) / (K - 2), abs=5 * np.sqrt(2 / len(z)))  # channels are correlated
    means = [values.mean(1) for values in (ours, theirs)]
    difference = means[0].mean(0) - means[1].mean(0)
    assert (np.abs(difference) < 4 * np.sqrt(sum(m.var(0, ddof=1) for m in means) / K)).all()


def test_a_white_medium_in_constant_light_has_no_noise(
    mi: ModuleType, slab: TriangleMesh, constant: Environment
) -> None:
    got = looks(Walk(Surface(WAX, slab), constant), points_on(slab), 64)
    assert got == pytest.approx(np.broadcast_to(RHO, got.shape), rel=1e-5)


@pytest.mark.parametrize(("path", "albedo"), [(0.3, 1.0), (0.3, 0.9), (0.05, 0.5), (3.0, 1.0)])
def test_agrees_with_volpath(mi: ModuleType, slab: TriangleMesh, sky: Environment, path: float, albedo: float) -> None:
    surface = Surface(replace(WAX, medium=Medium(path, albedo)), slab)
    points = points_on(slab)
    assert_same(looks(Walk(surface, sky), points, 1024), looks(Scattering(surface, sky), points, 256, seed=2))


def test_an_absorbing_medium_dims_what_comes_straight_through(mi: ModuleType, constant: Environment) -> None:
    """A ball of diameter D: int_0^1 2 c exp(-D c / l) dc, as a chord has the length D c."""
    ball = trimesh.creation.icosphere(4)
    mesh = TriangleMesh(np.array(ball.vertices), np.array(ball.faces, np.int32), np.array(ball.vertex_normals))
    black = replace(WAX, medium=Medium(1.0, 1e-9))
    got = looks(Walk(Surface(black, mesh), constant), points_on(mesh), 1024)
    assert got.mean((0, 1)) == pytest.approx(RHO * (1 - 3 * np.exp(-2)) / 2, rel=0.01)


def test_turned_points_see_the_light_turned_back(mi: ModuleType, slab: TriangleMesh, sky: Environment) -> None:
    carried = Surface(WAX, slab, carried=True)
    points = points_on(slab, rotation=TURN)
    assert_same(looks(Walk(carried, sky), points, 1024), looks(Scattering(carried, sky), points, 256, seed=2))


def test_is_the_same_again_and_pickled(mi: ModuleType, slab: TriangleMesh, sky: Environment) -> None:
    estimator, points = Walk(Surface(WAX, slab), sky), points_on(slab)
    once, again = (e.replicate(points, 16, np.random.SeedSequence(4)) for e in (estimator, estimator))
    copied = pickle.loads(pickle.dumps(estimator)).replicate(points, 16, np.random.SeedSequence(4))
    assert np.array_equal(once, again)
    assert np.array_equal(once, copied)
    assert estimator.by_bounce(points, 16, np.random.SeedSequence(4))[0] == pytest.approx(once * 1, rel=1e-6)


def test_needs_a_medium(mi: ModuleType, slab: TriangleMesh, constant: Environment) -> None:
    with pytest.raises(BadInput, match="wax"):
        Walk(Surface(replace(WAX, medium=None), slab), constant).replicate(
            points_on(slab), 16, np.random.SeedSequence(0)
        )
