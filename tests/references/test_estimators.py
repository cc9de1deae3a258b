"""The estimators of ground truth: those that know the scene agree with the path tracer that does not."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from scipy import stats

from data_gen.environments.projected import project
from data_gen.lobes import Lambertian, Membrane, Phong
from data_gen.mitsuba_diffuse import Diffuse
from data_gen.mitsuba_estimator import Estimator
from envbench.directions import perpendicular
from envbench.environment import Environment
from envbench.geometry import Geometry, Points, TriangleMesh
from envbench.material import Lobe, Material, Texture
from envbench.reference import ReferenceSettings
from envbench.scene import FREE, Effect, Scene
from references import closed_form
from references.estimators import estimator_for
from references.mitsuba_direct import render

K = 16
SETTINGS = ReferenceSettings(floor=1e-2, bounces=3)
EFFECTS = frozenset({Effect.SELF_SHADOWING, Effect.INTERREFLECTION})


def corner() -> TriangleMesh:
    """A floor and a wall that meet: open, seen from one side."""
    vertices = np.array([[-1.0, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0], [0, -1, 1.5], [0, 1, 1.5]])
    vertices = np.concatenate([vertices[:4], vertices[[1, 4, 5, 2]]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    normals = np.repeat([[0.0, 0, 1], [-1.0, 0, 0]], 4, axis=0)
    uvs = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]] * 2)
    return TriangleMesh(vertices, triangles, normals, uv=uvs)


def scene(light: Environment, *lobes: Lobe, texture: Texture | None = None) -> Scene:
    n = 24
    normal = np.tile([0.0, 0, 1], (n, 1))
    position = np.c_[np.linspace(-0.9, -0.02, n), np.linspace(-0.5, 0.5, n), np.zeros(n)]
    points = Points(position, normal, normal, perpendicular(normal), normal, np.full(n, 1 / n))
    material = Material("test", lobes, texture=texture)
    return Scene("test", light, material, Geometry("corner", corner(), convex=False), points, effects=EFFECTS)


def replicates(estimator: Estimator, points: Points, samples: int) -> np.ndarray:
    return np.stack([estimator.replicate(points, samples, s) for s in np.random.SeedSequence(5).spawn(K)])


def assert_same(a: np.ndarray, b: np.ndarray) -> None:
    """Means over all points, and over each half, differ by less than the 99.9 % interval of Welch's t."""
    for half in (slice(None), slice(0, None, 2), slice(12, None)):
        first, second = a[:, half].mean((1, 2)), b[:, half].mean((1, 2))
        assert stats.ttest_ind(first, second, equal_var=False).pvalue > 1e-3


CHECKS = Texture("checks", np.random.default_rng(2).uniform(0.2, 1, (4, 4, 3)))


@pytest.mark.parametrize(
    ("lobes", "texture"),
    [
        ((Lambertian(reflectance=(0.9, 0.7, 0.5)),), None),
        ((Lambertian(reflectance=(0.9, 0.9, 0.9)),), CHECKS),
        ((Membrane(reflectance=(0.6, 0.6, 0.6), transparency=0.5),), None),
    ],
    ids=["plain", "textured", "membrane"],
)
def test_diffuse_under_smooth_light(
    mi: ModuleType, lit: Environment, lobes: tuple[Lobe, ...], texture: Texture | None
) -> None:
    """Some of the light is negative, as a projection's may be."""
    banded = project(lit, 4).radiance
    light = Environment("signed", banded - banded.mean(), signed=True)
    made = scene(light, *lobes, texture=texture)
    ours = estimator_for(made, SETTINGS)
    assert isinstance(ours, Diffuse)
    assert len(made.environment.parts) == 2
    plain = Estimator(ours.surface, made.environment)
    a, b = replicates(ours, made.points, 1024), replicates(plain, made.points, 1024)
    assert_same(a, b)
    by_bounce = [ours.by_bounce(made.points, 1024, s).mean((1, 2)) for s in np.random.SeedSequence(6).spawn(K)]
    expected = [plain.by_bounce(made.points, 1024, s).mean((1, 2)) for s in np.random.SeedSequence(7).spawn(K)]
    assert (stats.ttest_ind(by_bounce, expected, equal_var=False).pvalue > 1e-4).all()


def test_what_nothing_shadows_has_no_noise(mi: ModuleType, lit: Environment) -> None:
    made = scene(project(lit, 4), Lambertian())
    away = replace(made.points, position=made.points.position + np.array([0, 0, 5.0]))
    found = replicates(estimator_for(made, SETTINGS), away, 64)
    exact, error = closed_form.radiance(made.material, made.environment, away)
    np.testing.assert_allclose(found, np.broadcast_to(exact, found.shape), atol=3e-5 * np.abs(exact).max() + error)


def test_what_is_known_is_used_only_where_it_may_be(mi: ModuleType, lit: Environment) -> None:
    """Not by everything on, not under light with detail, and not beyond what the closed form is known to."""
    smooth = scene(project(lit, 4), Lambertian())
    assert type(estimator_for(replace(smooth, heeded=False), SETTINGS)) is Estimator
    assert type(estimator_for(replace(smooth, environment=lit, effects=EFFECTS | FREE), SETTINGS)) is Estimator
    assert type(estimator_for(smooth, replace(SETTINGS, floor=1e-6))) is Estimator
    assert type(estimator_for(replace(smooth, material=Material("test", (Phong(),))), SETTINGS)) is Estimator


def test_references_agree_whatever_is_known(mi: ModuleType, lit: Environment) -> None:
    for light in (lit, project(lit, 4)):
        made = replace(scene(light, Lambertian(reflectance=(0.8, 0.8, 0.8))), effects=EFFECTS | FREE)
        known, unheeded = render(made, SETTINGS), render(replace(made, heeded=False), SETTINGS)
        assert max(known.floor, unheeded.floor) <= SETTINGS.floor
        spread = np.hypot(known.standard_error, unheeded.standard_error)
        assert (np.abs(known.mean - unheeded.mean) < 7 * spread + 1e-3 * known.rms).all()
        assert_same(known.replicates, unheeded.replicates)
