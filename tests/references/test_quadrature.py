"""The quadrature: closed forms, a slow and obvious sum, symmetries of the grid, convergence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from data_gen.lobes import GGX, CookTorrance, KajiyaKay, Lafortune, Lambertian, Microfacet, Phong
from envbench import latlong
from envbench.directions import from_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.furnace import lobe_integrals
from envbench.material import Lobe
from envbench.scene import Scene
from references.quadrature import integrate

MakeScene = Callable[..., Scene]


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("exponent", [8, 64, 512])
def test_whole_phong_under_constant_light_is_one(make_scene: MakeScene, constant: Environment, exponent: float) -> None:
    result = integrate(make_scene(constant, Phong(exponent=exponent, clipped=False)))
    assert result == pytest.approx(1, abs=1e-5)  # the accuracy that the quadrature aims at


def test_lambertian_under_constant_light_is_its_reflectance(make_scene: MakeScene, constant: Environment) -> None:
    result = integrate(make_scene(constant, Lambertian(reflectance=(0.2, 0.5, 0.8))))
    assert result == pytest.approx(np.broadcast_to([0.2, 0.5, 0.8], result.shape), abs=1e-5)


def test_clipped_phong_of_exponent_one_has_a_closed_form(make_scene: MakeScene, constant: Environment) -> None:
    """Projected onto the plane of R, {R.L > 0, N.L > 0} is half a disc and half an ellipse: pi (1 + N.R) / 2."""
    scene = make_scene(constant, Phong(exponent=1), count=64)
    cosine = np.sum(scene.points.normal * scene.points.reflection, axis=-1)
    # the kink of (R.L)+ at R.L = 0 is not cut along: its cells, h = 0.1 wide, cost about h^2 / 200 in all
    assert integrate(scene)[:, 0] == pytest.approx((1 + cosine) / 2, abs=1e-4)


def test_linear_light_on_lambertian() -> None:
    """L = cos(theta) has the irradiance coefficient 2/3 about N: B = 1 + 2/3 N.z for L = 1 + cos(theta).

    The map interpolates cos(theta) between samples h apart: at most h^2 / 8 too low.
    """
    height = 128
    theta, _ = latlong.angles(height, 4)
    radiance = np.broadcast_to(1 + np.cos(theta)[:, None, None], (height, 4, 3)).astype(np.float32)
    environment = Environment("linear", np.ascontiguousarray(radiance))
    normal = from_angles(np.linspace(0, np.pi, 9), 0.4)
    scene = one_query_scene(environment, Lambertian(), normal, normal)
    assert integrate(scene)[:, 0] == pytest.approx(1 + 2 / 3 * normal[:, 2], abs=(np.pi / height) ** 2 / 8 + 1e-6)


def one_query_scene(environment: Environment, lobe: Lobe, normal: np.ndarray, view: np.ndarray) -> Scene:
    from envbench.directions import perpendicular
    from envbench.geometry import Geometry, Points
    from envbench.material import Material

    points = Points(normal, normal, normal, perpendicular(normal), view, np.full(len(normal), 1 / len(normal)))
    return Scene("test", environment, Material("test", (lobe,)), Geometry("sphere"), points)


@pytest.mark.parametrize("shape", [(32, 64), (7, 9), (2, 4)], ids=str)
@pytest.mark.parametrize("lobe", [Phong(exponent=12), Microfacet(sigma=0.4), Microfacet(sigma=0.4, clipped=False)])
def test_against_a_plain_sum_over_a_fine_grid(make_scene: MakeScene, lobe: Lobe, shape: tuple[int, int]) -> None:
    """Midpoint sum over 600 x 1200 directions: a jump costs about the square root of cells hit times a cell."""
    environment = Environment("random", np.random.default_rng(1).exponential(1, (*shape, 3)).astype(np.float32))
    scene = make_scene(environment, lobe, count=4)
    height, width = 600, 1200
    directions = latlong.grid(height, width)
    energy = environment(directions) * latlong.solid_angles(height, width)[..., None]
    light = np.moveaxis(directions, -1, 0)
    points = scene.points
    expected = [
        [np.sum(v * energy[..., c]) for c, v in enumerate(lobe.evaluate(light, view, centre, normal))]
        for view, centre, normal in zip(points.view, points.reflection, points.normal, strict=True)
    ]
    step, peak = np.pi / height, 13 / (2 * np.pi)  # the highest of the lobes
    jump = 3 * np.sqrt(2 * np.pi / step) * step**2 * peak * environment.radiance.max()
    assert integrate(scene) == pytest.approx(np.array(expected), abs=jump)


@pytest.mark.parametrize("lobe", [Lambertian(), Phong(exponent=30), Microfacet(sigma=0.15)])
def test_turning_light_and_points_by_whole_columns_changes_nothing(
    make_scene: MakeScene, lit: Environment, lobe: Lobe
) -> None:
    scene = make_scene(lit, lobe, count=6)
    columns = 21
    angle = 2 * np.pi * columns / lit.radiance.shape[1]
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = Environment("turned", np.roll(lit.radiance, columns, axis=1))
    moved = one_query_scene(turned, lobe, scene.points.normal @ turn.T, scene.points.view @ turn.T)
    first = integrate(scene)
    assert rms(integrate(moved) - first) < 1e-6 * rms(first)  # rounding decides which cells are split


def test_mirroring_at_the_equator_changes_nothing(make_scene: MakeScene, lit: Environment) -> None:
    lobe = Phong(exponent=30)
    scene = make_scene(lit, lobe, count=6)
    flip = np.array([1.0, 1.0, -1.0])
    mirrored = one_query_scene(
        Environment("mirrored", np.ascontiguousarray(lit.radiance[::-1])),
        lobe,
        scene.points.normal * flip,
        scene.points.view * flip,
    )
    first = integrate(scene)
    assert rms(integrate(mirrored) - first) < 1e-6 * rms(first)


@pytest.mark.parametrize(
    "lobe", [Lambertian(), Phong(exponent=8), Phong(exponent=2000), Microfacet(sigma=0.05, clipped=False)]
)
def test_converged(make_scene: MakeScene, lit: Environment, lobe: Lobe) -> None:
    scene = make_scene(lit, lobe, count=16)
    result = integrate(scene)
    finer = integrate(scene, tolerance=1e-10)
    assert rms(result - finer) < 1e-5 * rms(finer)


def test_axis_aligned_normals(lit: Environment) -> None:
    """Horizons through the poles or along the equator are no special case: a tilt of 1e-9 changes nothing."""
    normal = np.concatenate([np.eye(3), -np.eye(3)])
    view = from_angles(0.8, 0.3) * np.where(normal.sum(-1, keepdims=True) > 0, 1, -1)
    exact = integrate(one_query_scene(lit, Phong(exponent=4), normal, view))
    tilted = normal + 1e-9
    assert integrate(one_query_scene(lit, Phong(exponent=4), tilted, view)) == pytest.approx(exact, rel=1e-6)


def test_lobes_add_up_and_indices_choose(make_scene: MakeScene, lit: Environment) -> None:
    lobes = (Lambertian(reflectance=(0.1, 0.2, 0.3)), Phong(exponent=20))
    both = integrate(make_scene(lit, *lobes))
    assert both == pytest.approx(sum(integrate(make_scene(lit, lobe)) for lobe in lobes), rel=1e-12)
    assert integrate(make_scene(lit, *lobes), [3, 1]) == pytest.approx(both[[3, 1]], rel=1e-12)


def test_black_light_is_black(make_scene: MakeScene) -> None:
    black = Environment("black", np.zeros((4, 8, 3), np.float32))
    assert not integrate(make_scene(black, Lambertian())).any()


def test_a_shape_with_shadows_is_refused(make_scene: MakeScene, constant: Environment) -> None:
    scene = make_scene(constant, Lambertian())
    with pytest.raises(BadInput, match="convex"):
        integrate(replace(scene, geometry=replace(scene.geometry, name="bunny", convex=False)))


@pytest.mark.parametrize(
    "lobe", [GGX(roughness=0.4, f0=(0.9, 0.5, 0.1)), CookTorrance(roughness=0.2), KajiyaKay(exponent=32)], ids=repr
)
def test_constant_light_is_what_the_furnace_says(make_scene: MakeScene, constant: Environment, lobe: Lobe) -> None:
    """Two quadratures that share nothing: cells of the map, about 1e-5 accurate, and polar coordinates about a lobe."""
    scene = make_scene(constant, lobe, count=8)
    assert integrate(scene) == pytest.approx(lobe_integrals(scene.material, scene.points), abs=3e-5)


def test_a_narrow_peak_in_a_wide_lobe_is_found() -> None:
    """Under a map of 4 x 2, whose cells are far wider than the peak (1 % of the whole): it is the sum of its parts."""
    environment = Environment("small", np.random.default_rng(1).random((2, 4, 3)).astype(np.float32))
    peak = {"c_xy": ((-1.0,) * 3,), "c_z": ((1.0,) * 3,), "n": ((500.0,) * 3,)}
    whole, alone = Lafortune(diffuse=(0.9, 0.5, 0.2), **peak), Lafortune(**peak)
    normal = from_angles([0.7], 0.4)
    view = from_angles([1.2], 0.4)
    parts = [
        one_query_scene(environment, lobe, normal, view) for lobe in (alone, Lambertian(reflectance=whole.diffuse))
    ]
    expected = sum(integrate(scene, tolerance=1e-6) for scene in parts)
    got = integrate(one_query_scene(environment, whole, normal, view), tolerance=1e-6)
    assert got == pytest.approx(expected, abs=2e-4)  # the peak reflects 1e-2


def test_a_texture_multiplies_what_is_reflected(make_scene: MakeScene, lit: Environment) -> None:
    scene = make_scene(lit, Phong(exponent=20), count=6)
    modulation = np.random.default_rng(2).random((6, 3))
    textured = replace(scene, points=replace(scene.points, modulation=modulation))
    assert integrate(textured) == pytest.approx(modulation * integrate(scene), rel=1e-12)
    assert integrate(textured, [4, 1]) == pytest.approx((modulation * integrate(scene))[[4, 1]], rel=1e-12)
