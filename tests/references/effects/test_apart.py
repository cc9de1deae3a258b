"""What one kernel tells of a surface without shadows and under another light, against kernels of their own."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from data_gen.environments.projected import project
from data_gen.lobes import GGX, Lambertian, Phong
from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from envbench import latlong, real_harmonics
from envbench.directions import normalised, perpendicular
from envbench.environment import Environment
from envbench.geometry import Points, TriangleMesh
from envbench.material import Lobe, Material

BOUNCES, SAMPLES, K, ORDER = 2, 64, 16, 4


def seed(k: int = 0) -> np.random.SeedSequence:
    return np.random.SeedSequence((7, k))


def floor() -> Points:
    n = 12
    normal = np.tile([0.0, 0, 1], (n, 1))
    position = np.c_[np.linspace(-0.9, -0.1, n), np.linspace(-0.5, 0.5, n), np.zeros(n)]
    view = normalised(np.tile([-0.3, 0, 1], (n, 1)))
    return Points(position, normal, normal, perpendicular(normal), view, np.full(n, 1 / n))


def corner(height: float = 1.5) -> TriangleMesh:
    """A floor and a wall that meet: open, seen from one side."""
    vertices = np.array([[-1.0, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0], [0, -1, height], [0, 1, height]])
    vertices = np.concatenate([vertices[:4], vertices[[1, 4, 5, 2]]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    return TriangleMesh(vertices, triangles, np.repeat([[0.0, 0, 1], [-1.0, 0, 0]], 4, axis=0))


@pytest.fixture(scope="module")
def sharp() -> Environment:
    """Light whose first bands are negative in places."""
    directions = latlong.grid(32, 64)
    lamp = np.exp(20 * (directions @ normalised([1.0, 1, 1.5]) - 1))
    return Environment("sharp", (0.02 + lamp[..., None] * [2.0, 1.5, 1]).astype(np.float32))


SURFACES = [
    pytest.param((Lambertian(reflectance=(0.7, 0.6, 0.5)),), False, id="diffuse"),
    pytest.param((Lambertian(reflectance=(0.3, 0.3, 0.3)), GGX(roughness=0.5)), True, id="glossy"),
    pytest.param((Phong(exponent=10),), True, id="whole lobe"),
]


@pytest.mark.parametrize("bounces", [0, BOUNCES])
@pytest.mark.parametrize(("lobes", "sampled"), SURFACES)
def test_the_surface_without_shadows_is_the_one_without_occluder(
    mi: ModuleType, sharp: Environment, lobes: tuple[Lobe, ...], sampled: bool, bounces: int
) -> None:
    """From the same random numbers, to rounding; as are its bounces, under a signed light too."""
    coefficients = real_harmonics.project(sharp.radiance.astype(float), ORDER - 1)
    shadowed = Surface(Material("test", lobes), corner(), bounces=bounces)
    for light in (sharp, project(sharp, ORDER)):
        both = [Estimator(s, light, sampled) for s in (shadowed, replace(shadowed, occluder=None, bounces=0))]
        by_bounce, bare = (one.by_bounce(floor(), SAMPLES, seed()) for one in both)
        for lights in ((), (coefficients,)):
            found = both[0].apart(floor(), SAMPLES, seed(), *lights)
            assert found.shape == (1 + len(lights), 2 + bounces, 12, 3)
            np.testing.assert_allclose(found[0, :-1], by_bounce, rtol=1e-5, atol=1e-6)
            np.testing.assert_allclose(found[0, -1], bare[0], rtol=1e-5, atol=1e-6)
            assert not np.allclose(found[0, 0], bare[0], rtol=0.05, atol=1e-3)


@pytest.mark.parametrize("bounces", [0, BOUNCES])
@pytest.mark.parametrize(("lobes", "sampled"), SURFACES)
def test_another_light_is_what_a_kernel_of_its_own_sees(
    mi: ModuleType, sharp: Environment, lobes: tuple[Lobe, ...], sampled: bool, bounces: int
) -> None:
    """Of every bounce and without shadows: within six standard errors at each point, and the map's bilinear bends."""
    coefficients = real_harmonics.project(sharp.radiance.astype(float), ORDER - 1)
    surface = Surface(Material("test", lobes), corner(), bounces=bounces)
    projected = project(sharp, ORDER)
    assert projected.radiance.min() < 0
    beside, alone = Estimator(surface, sharp, sampled), Estimator(surface, projected, sampled)
    found = np.stack([beside.apart(floor(), SAMPLES, seed(k), coefficients)[1] for k in range(K)])
    other = np.stack([alone.apart(floor(), SAMPLES, seed(K + k))[0] for k in range(K)])
    error = np.sqrt((found.var(0, ddof=1) + other.var(0, ddof=1)) / K)
    apart = np.abs(found.mean(0) - other.mean(0))
    assert (apart < 6 * error + 2e-3 * np.abs(other.mean(0)).max()).all()
    assert np.abs(other.mean(0)).max() > 10 * error.mean()


def test_kernels_know_no_other_shapes(mi: ModuleType, sharp: Environment) -> None:
    """The same one serves whatever shapes there are in the process, and shapes of any size."""
    import drjit as dr

    def kernel(height: float) -> str:
        surface = Surface(Material("test", (Lambertian(),)), corner(height), bounces=BOUNCES)
        estimator = Estimator(surface, sharp, sample_lobes=False)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            estimator.apart(floor(), SAMPLES, seed())
            largest = max(dr.kernel_history([dr.KernelType.JIT]), key=lambda k: k["operation_count"])
        kept.append(surface)
        return str(largest["hash"])

    kept: list[Surface] = []
    assert kernel(1.5) == kernel(1.5) == kernel(3.0)


@pytest.mark.parametrize("bounces", [0, BOUNCES])
def test_kernels_know_neither_points_nor_samples(mi: ModuleType, sharp: Environment, bounces: int) -> None:
    """One serves all steps of a reference: many points, or a single one, with any number of samples."""
    import drjit as dr

    surface = Surface(Material("test", (GGX(roughness=0.5),)), corner(), bounces=bounces)
    estimator = Estimator(surface, sharp)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for samples in (np.full(12, 64), np.array([128, *[32] * 5, *[512] * 6])):
            estimator.replicate(floor(), samples, seed())
        kernels = [k for k in dr.kernel_history([dr.KernelType.JIT]) if k["operation_count"] > 100]
    assert len(kernels) == 4
    assert len({str(k["hash"]) for k in kernels}) == 1


def test_paths_that_take_turns_are_the_same(
    mi: ModuleType, sharp: Environment, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many lanes there are: all samples of a point on one, or each on its own."""
    surface = Surface(Material("test", (Lambertian(reflectance=(0.7, 0.6, 0.5)),)), corner(), bounces=BOUNCES)

    def by_bounce(lanes: int, *, any_view: bool) -> np.ndarray:
        monkeypatch.setattr("data_gen.mitsuba_estimator.in_flight", lambda mi: lanes)
        return Estimator(replace(surface, any_view=any_view), sharp).by_bounce(floor(), SAMPLES, seed())

    for any_view in (False, True):
        apart = by_bounce(12 * SAMPLES, any_view=any_view)
        assert (apart[:, :, 0].mean(1) > 0).all()
        for lanes in (12, 12 * 8):
            np.testing.assert_allclose(by_bounce(lanes, any_view=any_view), apart, rtol=1e-5, atol=1e-7)
