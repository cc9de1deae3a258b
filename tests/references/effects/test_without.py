"""What is rendered without an effect, against slow averages of the ordinary kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from data_gen.environments.projected import project
from data_gen.lobes import KajiyaKay, Lambertian, Phong
from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from envbench import latlong
from envbench.directions import normalised, perpendicular, uniform
from envbench.environment import Environment
from envbench.geometry import Geometry, Points, TriangleMesh, Viewer
from envbench.material import Lobe, Material
from envbench.reference import ReferenceSettings
from envbench.scene import FREE, Effect, Scene
from references.effects.without import simulated
from references.estimators import estimator_for
from references.mitsuba_direct import render
from references.quadrature import integrate

K = 8


@pytest.fixture(scope="module")
def smooth() -> Environment:
    directions = latlong.grid(32, 64)
    lamp = np.exp(4 * (directions @ normalised([1.0, 2, 1.5]) - 1))
    return Environment("smooth", (0.1 + lamp[..., None] * [2.0, 1.5, 1]).astype(np.float32))


def scene(light: Environment, lobes: tuple[Lobe, ...], effects: frozenset[Effect] = FREE, count: int = 5) -> Scene:
    rng = np.random.default_rng(3)
    normal = uniform(count, rng)
    tangent = perpendicular(normal)
    points = Points(normal, normal, normal, tangent, normalised(normal + tangent), np.full(count, 1 / count))
    return Scene("test", light, Material("test", lobes), Geometry("sphere"), points, effects=effects)


def replicates(made: Scene, samples: int = 1024) -> np.ndarray:
    estimator = estimator_for(made, ReferenceSettings())
    return np.stack([estimator.replicate(made.points, samples, s) for s in np.random.SeedSequence(5).spawn(K)])


def assert_mean(found: np.ndarray, exact: np.ndarray) -> None:
    """At each point and channel within six standard errors: t with 7 degrees of freedom exceeds that by 5e-4."""
    error = found.std(0, ddof=1) / np.sqrt(K)
    assert (np.abs(found.mean(0) - exact) < 6 * error + 1e-4 * exact.max()).all()


def averaged(made: Scene, turn: Callable[[Points], list[tuple[float, Points]]]) -> np.ndarray:
    """Return the quadrature's radiance, averaged over points turned in many ways, each with its weight."""
    return sum((w * integrate(replace(made, points=points)) for w, points in turn(made.points)), np.zeros(1))


def views(points: Points) -> list[tuple[float, Points]]:
    """Views about the normal by product quadrature: Gauss in the square of the cosine, and even azimuths."""
    x, w = np.polynomial.legendre.leggauss(8)
    found: list[tuple[float, Points]] = []
    across = np.cross(points.normal, points.tangent)
    for square, weight in zip((x + 1) / 2, w / 2, strict=True):
        for phi in 2 * np.pi * (np.arange(16) + 0.5) / 16:
            flat = np.cos(phi) * points.tangent + np.sin(phi) * across
            view = np.sqrt(square) * points.normal + np.sqrt(1 - square) * flat
            found.append((weight / 16, replace(points, view=view)))
    return found


def tangents(points: Points) -> list[tuple[float, Points]]:
    across = np.cross(points.normal, points.tangent)
    angles = 2 * np.pi * (np.arange(64) + 0.5) / 64
    return [(1 / 64, replace(points, tangent=np.cos(a) * points.tangent + np.sin(a) * across)) for a in angles]


@pytest.mark.parametrize("lobe", [Phong(exponent=4, clipped=False), Phong(exponent=6)], ids=["whole", "clipped"])
def test_without_view_dependence_is_the_mean_over_views(mi: ModuleType, smooth: Environment, lobe: Lobe) -> None:
    made = scene(smooth, (Lambertian(reflectance=(0.2, 0.2, 0.2)), lobe))
    exact = averaged(made, views)
    assert_mean(replicates(replace(made, effects=FREE - {Effect.VIEW_DEPENDENCE})), exact)
    assert np.abs(exact - integrate(made)).max() > 0.05 * exact.max()  # else it would tell nothing


def test_without_anisotropy_is_the_mean_over_tangents(mi: ModuleType, smooth: Environment) -> None:
    made = scene(smooth, (KajiyaKay(exponent=8),))
    exact = averaged(made, tangents)
    assert_mean(replicates(replace(made, effects=FREE - {Effect.ANISOTROPY})), exact)
    assert np.abs(exact - integrate(made)).max() > 0.05 * exact.max()


def test_averages_leave_all_other_random_numbers(mi: ModuleType, smooth: Environment) -> None:
    """A diffuse surface looks the same from everywhere, so that the average is the same to rounding."""
    made = scene(smooth, (Lambertian(),))
    plain = Estimator(Surface(made.material, None), smooth)
    turned = replace(plain, surface=replace(plain.surface, any_view=True, any_tangent=True))
    a, b = (e.replicate(made.points, 64, np.random.SeedSequence(1)) for e in (plain, turned))
    assert np.abs(a - b).max() < 0.05 * a.max()  # turned tangents turn the lobes' draws, not the light's
    only = replace(plain, surface=replace(plain.surface, any_view=True))
    np.testing.assert_allclose(only.replicate(made.points, 64, np.random.SeedSequence(1)), a, rtol=1e-5)


def test_without_light_detail_the_light_has_few_bands(mi: ModuleType, lit: Environment) -> None:
    made = replace(scene(lit, (Phong(exponent=20, clipped=False),)), order=3)
    exact = integrate(replace(made, environment=project(lit, 3)))
    assert_mean(replicates(replace(made, effects=FREE - {Effect.LIGHT_DETAIL})), exact)


def test_without_perspective_all_look_one_way(smooth: Environment) -> None:
    made = replace(scene(smooth, (Phong(),)), viewer=Viewer(eye=(0.0, -4.0, 1.0)))
    far = simulated(replace(made, effects=FREE - {Effect.PERSPECTIVE}))
    direction = normalised(np.array([0.0, -4, 1]) - made.points.position.mean(0))
    np.testing.assert_allclose(far.points.view, np.tile(direction, (5, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(far.points.reflection, axis=1), 1)
    assert simulated(made) is made


@pytest.mark.parametrize("lobe", [Lambertian(reflectance=(0.7, 0.7, 0.7)), Phong(exponent=10)])
def test_bounces_add_up_one_by_one(mi: ModuleType, smooth: Environment, lobe: Lobe) -> None:
    """What k bounces show is the beginning of what more show, with the same random numbers."""
    mesh = corner()
    n = 20
    normal = np.tile([0.0, 0, 1], (n, 1))
    position = np.c_[np.linspace(-0.9, -0.1, n), np.linspace(-0.5, 0.5, n), np.zeros(n)]
    points = Points(position, normal, normal, perpendicular(normal), normal, np.full(n, 1 / n))
    made = Scene("test", smooth, Material("test", (lobe,)), Geometry("corner", mesh, convex=False), points)
    made = replace(made, effects=FREE | {Effect.SELF_SHADOWING, Effect.INTERREFLECTION})
    whole = estimator_for(made, ReferenceSettings(bounces=3))
    parts = whole.by_bounce(points, 64, np.random.SeedSequence(2))
    assert parts.shape == (4, n, 3)
    for k in range(4):
        one = replace(whole, surface=replace(whole.surface, bounces=k)).replicate(points, 64, np.random.SeedSequence(2))
        np.testing.assert_allclose(parts[: k + 1].sum(0), one, rtol=1e-5, atol=1e-6)
    assert parts[1].mean() > 0.01 * parts[0].mean()


def corner() -> TriangleMesh:
    """A floor and a wall that meet: open, seen from one side."""
    vertices = np.array([[-1.0, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0], [0, -1, 1.5], [0, 1, 1.5]])
    vertices = np.concatenate([vertices[:4], vertices[[1, 4, 5, 2]]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    normals = np.repeat([[0.0, 0, 1], [-1.0, 0, 0]], 4, axis=0)
    return TriangleMesh(vertices, triangles, normals)


def test_a_diffuse_convex_scene_is_in_closed_form(lit: Environment, constant: Environment) -> None:
    """Zero noise and no ray, where the light has few bands; else it is sampled."""
    settings = ReferenceSettings(floor=1e-3)
    banded = render(scene(project(lit, 4), (Lambertian(reflectance=(0.5, 0.6, 0.7)),)), settings)
    exact = integrate(scene(project(lit, 4), (Lambertian(reflectance=(0.5, 0.6, 0.7)),)))
    np.testing.assert_allclose(banded.mean, exact, atol=1e-5 * np.abs(exact).max())
    assert (banded.floor, banded.visibility_rays, len(banded.replicates)) == (0.0, 0, 8)
    uniform_light = render(scene(constant, (Lambertian(),)), settings)
    np.testing.assert_allclose(uniform_light.mean, 1, atol=1e-6)
    assert render(scene(lit, (Lambertian(),)), settings).floor > 0
