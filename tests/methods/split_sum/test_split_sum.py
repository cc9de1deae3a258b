"""Split sum against closed forms, Karis's own sampling, and the quadrature where it is exact."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from data_gen.lobes import GGX, KajiyaKay, Lambertian, Microfacet, Phong
from envbench import latlong, laws
from envbench.directions import normalised, perpendicular, to_angles, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.furnace import lobe_integrals
from envbench.geometry import Geometry, Points
from envbench.material import Material
from envbench.scene import Scene
from methods.irradiance import Irradiance, clamped_cosine
from methods.split_sum import SplitSum, kernel
from methods.split_sum.cube import look_up, packed, texels
from references.quadrature import integrate

SPHERE = Geometry("sphere")
METAL = Material("metal", (GGX(roughness=0.4, f0=(0.9, 0.6, 0.2)), Lambertian(reflectance=(0.1, 0.2, 0.3))))


def smooth(directions: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([1 + x, 1.5 + y * z, 1.3 + np.sin(2 * x + z)], -1)


def light(height: int = 64) -> Environment:
    return Environment("smooth", smooth(latlong.grid(height, 2 * height)).astype(np.float32))


def queries(count: int, seed: int = 0) -> Points:
    rng = np.random.default_rng(seed)
    reflection, view = uniform(count, rng), uniform(count, rng)
    normal = normalised(reflection + view)
    return Points(normal, normal, normal, perpendicular(normal), view, np.full(count, 1 / count))


def rendered(method: SplitSum, material: Material, environment: Environment, points: Points) -> np.ndarray:
    return method.shade(method.relight(method.prepare(material, SPHERE), environment), points)


def nrmse(result: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean((result - truth) ** 2) / np.mean(truth**2)))


@pytest.mark.parametrize("size", [4, 16, 64])
def test_cube_lookup(mi: object, size: int) -> None:
    """Everywhere, on edges and at corners: bilinear leaves h^2 / 8 of second derivatives (at most 5, in two ways)."""
    from drjit.llvm import Array3f

    theta, phi = texels(size).T
    samples = smooth(np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1))
    corners = normalised(np.array(list(product((-1, 0, 1), repeat=3)))[np.arange(27) != 13] * 1.0)
    at = np.concatenate(
        [uniform(3000, np.random.default_rng(1)), corners, normalised(corners + np.array([1e-6, 2e-6, -1e-6]))]
    )
    found = np.array(look_up(packed(samples), size, Array3f(at.T.astype(np.float32)))).T
    assert np.abs(found - smooth(at)).max() < 2 * 5 * (2 / size) ** 2 / 8 + 1e-5


def test_phong_kernel_is_the_closed_form() -> None:
    """k_l = k_(l-2) (s - l + 2) / (s + l + 1), from P_l's recurrence; it ends where 1e-6 of the energy is left."""
    s, expected = 512, [1.0, 513 / 514]
    for l in range(2, 512):
        expected.append(max(s - l + 2, 0) / (s + l + 1) * expected[-2])
    (found,) = kernel.own(Phong(exponent=s, clipped=False), 511)
    np.testing.assert_allclose(found, expected[: len(found)], atol=1e-7)
    energy = (2 * np.arange(512) + 1) * np.square(expected)
    assert energy[len(found) :].sum() <= kernel.LOST * energy.sum() < energy[len(found) - 1 :].sum()


def test_ggx_kernel_of_roughness_one_is_the_clamped_cosine() -> None:
    found = kernel.ggx(1.0, 40)[0]
    np.testing.assert_allclose(found, clamped_cosine(40)[: len(found)], atol=1e-5)


def test_equivalent_roughness() -> None:
    """cos^s about R is exp(-2 s theta_h^2), Beckmann's alpha = 1 / sqrt(2 s); sigma is alpha; GGX is itself.

    GGX has longer tails, and the fit makes up for them: within a tenth.
    """
    assert kernel.equivalent_roughness(GGX(roughness=0.37)) == 0.37
    assert kernel.equivalent_roughness(Phong(exponent=100)) ** 2 == pytest.approx(200**-0.5, rel=0.1)
    assert kernel.equivalent_roughness(Microfacet(sigma=0.15)) ** 2 == pytest.approx(0.15, rel=0.1)


def test_the_prefilter_is_what_karis_samples(mi: object) -> None:
    """H from D by inversion with N = V = R, weights N.L, 512 x 256 midpoints: the engine's loop, taken to its limit."""
    alpha, points = 0.3, queries(12)
    u = (np.arange(512) + 0.5)[:, None] / 512
    phi = 2 * np.pi * (np.arange(256) + 0.5) / 256
    cosine = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))
    half = np.stack(
        np.broadcast_arrays(np.sqrt(1 - cosine**2) * np.cos(phi), np.sqrt(1 - cosine**2) * np.sin(phi), cosine), -1
    )
    local = 2 * half[..., 2:] * half - [0, 0, 1]
    weight = np.maximum(local[..., 2:], 0)
    expected = []
    for r in points.reflection:
        x = perpendicular(r)
        towards = local @ np.stack([x, np.cross(r, x), r])
        expected.append((light()(towards) * weight).sum((0, 1)) / weight.sum())
    lobe = GGX(roughness=alpha**0.5)
    method = SplitSum(face=64)
    state = method.relight(method.prepare(Material("ggx", (lobe,)), SPHERE), light())
    whole = replace(
        state,
        prepared=replace(
            state.prepared, readings=(replace(state.prepared.readings[0], table=np.ones((2, 3), np.float32)),)
        ),
    )
    # texels of 1/32 as above; midpoints of 256 azimuths are exact here, 512 radii to 1e-3
    np.testing.assert_allclose(method.shade(whole, points), expected, atol=2 * 5 / 32**2 / 8 + 1e-3)


def test_exact_for_a_whole_phong_lobe(mi: object) -> None:
    """It is the same about R for every view, so both factors are exact: texels of 2 / 128 radians remain."""
    scene = Scene("s", light(), Material("m", (Phong(exponent=30, clipped=False),)), SPHERE, queries(40))
    result = rendered(SplitSum(face=128), scene.material, scene.environment, scene.points)
    assert nrmse(result, integrate(scene)) < 2 * 5 * (2 / 128) ** 2 / 8


@pytest.mark.parametrize("levels", [0, 8])
def test_close_on_a_metal(mi: object, levels: int) -> None:
    """Under smooth light the split costs a few percent; it is no more than that for the chain."""
    scene = Scene("s", light(), METAL, SPHERE, queries(40))
    result = rendered(SplitSum(face=32, levels=levels), METAL, scene.environment, scene.points)
    assert nrmse(result, integrate(scene)) < 0.05


def test_diffuse_light_is_irradiance_9(mi: object) -> None:
    material, points = Material("d", (Lambertian(reflectance=(0.3, 0.6, 0.9)),)), queries(20)
    other = Irradiance()
    expected = other.shade(other.relight(other.prepare(material, SPHERE), light()), points)
    np.testing.assert_array_equal(rendered(SplitSum(), material, light(), points), expected)


@pytest.mark.parametrize("lobe", [GGX(roughness=0.5, f0=(0.04, 0.5, 1)), Phong(exponent=64), Microfacet(sigma=0.3)])
@pytest.mark.parametrize("levels", [0, 5])
def test_constant_light(mi: object, lobe: Any, levels: int) -> None:
    material, points, method = Material("m", (lobe,)), queries(60), SplitSum(levels=levels)
    constant = Environment("constant", np.ones((2, 4, 3), np.float32))
    expected = lobe_integrals(material, points)
    tolerance = method.tolerance(method.prepare(material, SPHERE)).constant_light
    assert nrmse(rendered(method, material, constant, points), expected) < tolerance


@pytest.mark.parametrize("method", [SplitSum(face=8, table=33), SplitSum(face=32, levels=5)], ids=["own", "chain"])
@pytest.mark.parametrize("lobe", [GGX(roughness=0.2), Phong(exponent=32)], ids=["ggx", "phong"])
def test_laws(mi: object, method: SplitSum, lobe: Any) -> None:
    assert laws.check(method, Material("m", (lobe, Lambertian()))) == []


@pytest.mark.parametrize("lobe", [GGX(roughness=0.01), Phong(exponent=1e5), GGX(roughness=1)])
@pytest.mark.parametrize("levels", [0, 4])
def test_hard_cases(mi: object, lobe: Any, levels: int) -> None:
    """Lobes narrower than a pixel, one pixel of 1e8, the smallest maps, grazing views, poles and seam: finite."""
    view = np.array([[0, 0, 1], [0, 0, -1], [-1, 1e-9, 0], [-1, -1e-9, 0], [np.sin(1.5706), 0, np.cos(1.5706)]])
    normal = np.array([[0, 0, 1], [0, 0, -1], [-1, 0, 0], [-1, 0, 0], [0, 0, 1.0]])
    points = Points(normal, normal, normal, perpendicular(normal), normalised(view), np.full(5, 0.2))
    for shape, pixel in (((2, 4), (0, 0)), ((3, 5), (2, 4)), ((64, 128), (0, 127))):
        spot = np.zeros((*shape, 3), np.float32)
        spot[pixel] = 1e8
        method = SplitSum(face=16, levels=levels)
        assert np.isfinite(rendered(method, Material("m", (lobe,)), Environment("spot", spot), points)).all()


def test_a_mirror_shows_the_light(mi: object) -> None:
    """A lobe far narrower than a pixel reads the light itself, at the cube's resolution."""
    points = queries(200)
    result = rendered(SplitSum(face=128), Material("m", (Phong(exponent=1e6, clipped=False),)), light(16), points)
    assert nrmse(result, light(16)(points.reflection)) < 0.01


def test_only_needed_degrees_are_expanded() -> None:
    method = SplitSum(face=128)
    described = method.describe(method.prepare(METAL, SPHERE))
    assert described["kernel"] == ["exact GGX"]
    assert described["orders"][0] < 64
    chain = SplitSum(face=128, levels=6)
    assert chain.describe(chain.prepare(METAL, SPHERE))["faces"] == [128, 64, 32, 16, 8, 8]


def test_states_are_picklable(mi: object) -> None:
    method, points = SplitSum(face=8), queries(5)
    state = method.relight(method.prepare(METAL, SPHERE), light())
    np.testing.assert_array_equal(method.shade(pickle.loads(pickle.dumps(state)), points), method.shade(state, points))


def test_what_it_declines() -> None:
    points = queries(2)
    hair = Material("hair", (KajiyaKay(),))
    reason = SplitSum().declines(Scene("s", light(), hair, SPHERE, points))
    assert reason is not None
    assert "about the tangent" in reason
    with pytest.raises(BadInput, match="about the tangent"):
        SplitSum().prepare(hair, SPHERE)
    assert SplitSum().declines(Scene("s", light(), METAL, SPHERE, points)) is None


@pytest.mark.parametrize("settings", [{"face": 2}, {"levels": 1}, {"table": 64}])
def test_settings(settings: dict[str, int]) -> None:
    with pytest.raises(BadInput, match=next(iter(settings))):
        SplitSum(**settings)


def test_texels_hold_their_faces() -> None:
    """Away from the borders they are those of `envbench.cubemap`."""
    from envbench import cubemap

    inner = texels(5).reshape(6, 7, 7, 2)[:, 1:-1, 1:-1]
    expected = np.stack(to_angles(cubemap.directions(5)), -1)
    np.testing.assert_allclose(inner, expected, atol=1e-12)
