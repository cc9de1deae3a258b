"""Kautz-McCool: averages against closed forms and the terms q = 0, textures against plain sums, losses as predicted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from data_gen import views
from data_gen.lobes import CookTorrance, KajiyaKay, Lambertian, Microfacet, Phong
from envbench import harmonics, latlong, laws
from envbench.directions import Array, from_angles, normalised, reflect, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Lobe, Material
from envbench.scene import Scene
from methods.kautz_mccool import KautzMcCool
from methods.kautz_mccool.average import averaged
from methods.kautz_mccool.lookup import look_up
from methods.kautz_mccool.radial import AzimuthalAverage
from methods.kautz_mccool.texture import summed, synthesised
from methods.shrm import explicit, maps
from methods.shrm.coefficients import expand

SPHERE = Geometry("sphere")
SINGLE = 2e-5


def queries(count: int, seed: int = 0) -> Points:
    return views.build({"kind": "uniform", "count": count, "seed": seed}, SPHERE)[0]


def random_light(height: int, width: int, seed: int = 0) -> Environment:
    return Environment("random", np.random.default_rng(seed).uniform(0, 1, (height, width, 3)).astype(np.float32))


def rendered(method: KautzMcCool, lobe: Lobe, light: Environment, points: Points) -> Array:
    prepared = method.prepare(Material("m", (lobe,)), SPHERE)
    return np.asarray(method.shade(method.frame(method.relight(prepared, light), None), points), float)


def test_a_lobe_without_azimuth_is_its_own_average() -> None:
    lobe = KajiyaKay()
    found = averaged(lobe, 9, shifted=True, order=63)
    assert not found.shift.any()
    z: Any = np.array([0.0, 0.0, 1.0])[:, None]
    for theta_o, values in zip(explicit.polar_nodes(lobe.centre, 9), found.values[0], strict=True):
        view, light = (np.moveaxis(from_angles(t, 0.0), -1, 0) for t in (np.array([theta_o]), found.theta))
        np.testing.assert_allclose(values, lobe.evaluate(light, view, z, z)[0], atol=1e-12)


def test_what_averaging_loses_are_the_terms_q_above_0() -> None:
    """1 - sum rho_lp0^2 / total by SHRM, whose P = 12 misses .001 of this lobe, and a table fine in theta_o."""
    lobe = Microfacet(sigma=0.3, clipped=False)
    terms = expand(lobe, 0.001, order=40, view_order=12)
    zonal = float((terms.rho[0, :, :, 0] ** 2).sum() * 3 / terms.total)
    assert averaged(lobe, 48, shifted=False, order=63).missing == pytest.approx(1 - zonal, abs=1.5e-3)


def test_the_texture_is_that_of_the_shrm_terms_q_0() -> None:
    """Summed over p to 12; what lies beyond is an amplitude of sqrt(missing), met by light mostly of low degree."""
    lobe, F, rows = Microfacet(sigma=0.5, clipped=False), 16, 12
    light = harmonics.analyse(random_light(32, 64).radiance, F)
    shrm = expand(lobe, 0.01, order=F, view_order=12)
    nodes = explicit.polar_nodes(lobe.centre, 7)
    truth = np.moveaxis(explicit.averaged(shrm, maps.synthesise(shrm, light, rows), nodes), (0, 1), (3, 2))
    texture = synthesised(averaged(lobe, 7, shifted=False, order=F).zonal(F), light, rows)
    assert np.sqrt(np.mean((texture - truth) ** 2) / np.mean(truth**2)) < np.sqrt(shrm.missing)


def obvious(light: Environment, lobe: AzimuthalAverage, centre: Array, cone: float) -> Array:
    """Sum over the texels within the cone, one central direction at a time."""
    grid = latlong.grid(*light.radiance.shape[:2]).reshape(-1, 3)
    power = (light.radiance * latlong.solid_angles(*light.radiance.shape[:2])[..., None]).reshape(-1, 3)
    axis: Any = centre[:, None]
    rho = np.stack(lobe.evaluate(grid.T, axis, axis, axis), -1)
    return np.sum(rho * power * (grid @ centre >= np.cos(cone))[:, None], 0)


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.4), Phong(exponent=6, reflectance=(1, 0.5, 0.2))], ids=repr)
def test_a_summed_texture_is_the_obvious_sum(lobe: Lobe, mi: object) -> None:
    light, rows, T = random_light(16, 32), 4, 3
    mean = averaged(lobe, T, shifted=True, order=63)
    texture = summed(mean, light.radiance, rows, 0.01)
    assert texture.shape == (rows, 2 * rows, T, 3)
    for k in range(T):
        average = AzimuthalAverage.of(mean, k)
        truth = [obvious(light, average, c, average.cone(0.01)) for c in latlong.grid(rows, 2 * rows).reshape(-1, 3)]
        np.testing.assert_allclose(texture[:, :, k].reshape(-1, 3), truth, atol=SINGLE * np.max(truth))


def test_both_ways_of_prefiltering_agree(mi: object) -> None:
    """Smooth light: eps of the integral, and of the energy; texel sums err by (pi / 48)^2 / 24 times curvatures."""
    x, y, z = np.moveaxis(latlong.grid(48, 96), -1, 0)
    light = Environment("smooth", np.stack([1 + x, 1 + y * z, 1 + x * z], -1).astype(np.float32))
    lobe, points = Microfacet(sigma=0.3), queries(256)
    one, other = (
        rendered(KautzMcCool(eps=1e-3, rows=24, polar=8, prefiltering=p, light_rows=0), lobe, light, points)
        for p in ("shrm", "angular")
    )
    assert np.sqrt(np.mean((one - other) ** 2) / np.mean(one**2)) < 3e-3


def test_the_tabulated_average_is_a_lobe() -> None:
    average = AzimuthalAverage.of(averaged(Microfacet(sigma=0.3), 5, shifted=True, order=63), 3)
    axis: Any = np.array([0.0, 0.6, 0.8])[:, None]
    rng = np.random.default_rng(0)
    light = np.stack(average.sample((rng.random(4096), rng.random(4096)), axis, axis, axis))
    assert np.allclose((light**2).sum(0), 1)
    density = average.density(light, axis, axis, axis)
    assert (density > 0).all()
    # a cap drawn uniformly: its solid angle is 1 / density
    assert density[0] == pytest.approx(1 / (2 * np.pi * (1 - np.cos(average.end))))
    theta = np.linspace(0, average.cone(0.1), 4001)
    inside = np.trapezoid(average.profile(*_at(theta), axis, axis)[0] * np.sin(theta), theta)
    theta = np.linspace(0, np.pi, 16001)
    whole = np.trapezoid(average.profile(*_at(theta), axis, axis)[0] * np.sin(theta), theta)
    assert inside == pytest.approx(0.9 * whole, rel=5e-3)  # entries of the table


def _at(theta: Array) -> tuple[Any, Any]:
    """Directions at `theta` from the axis (0, .6, .8), and that axis as a view."""
    axis, across = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    return np.cos(theta) * axis[:, None] + np.sin(theta) * across[:, None], axis[:, None]


@pytest.mark.parametrize("centre", list(Centre))
def test_look_up_is_trilinear_about_the_shifted_axis(centre: Centre, mi: object) -> None:
    rows, T = 6, 5
    texture = np.random.default_rng(0).random((rows, 2 * rows, T, 3)).astype(np.float32)
    shift = np.linspace(0, 0.7, T)
    points = queries(400, seed=2)
    axis = points.central(centre)
    theta = np.arccos(np.clip(np.sum(axis * points.view, -1), -1, 1))
    nodes = explicit.polar_nodes(centre, T)
    towards = normalised(points.view - np.sum(axis * points.view, -1, keepdims=True) * axis)
    turn = np.interp(theta, nodes, shift)[:, None]
    turned = np.cos(turn) * axis + np.sin(turn) * towards
    layers = np.stack([latlong.interpolate(texture[:, :, k], turned) for k in range(T)], 1)
    place = np.interp(theta, nodes, np.arange(T))
    low = np.minimum(place.astype(int), T - 2)
    share, at = (place - low)[:, None], np.arange(len(points))
    truth = (1 - share) * layers[at, low] + share * layers[at, low + 1]
    # single precision: an angle near 0 or pi to 1e-3, and slopes of one a texel
    np.testing.assert_allclose(look_up(texture, shift, centre, points), truth, atol=5e-4)


def lamp(size: int = 256) -> tuple[Environment, Array]:
    """One pixel, a point for all lobes here, and its direction; its irradiance is 1."""
    radiance = np.zeros((size, 2 * size, 3), np.float32)
    row, column = int(0.37 * size), int(0.6 * size)
    radiance[row, column] = 1 / latlong.solid_angles(size, 2 * size)[row, 0]
    return Environment("lamp", radiance), latlong.grid(size, 2 * size)[row, column]


def lamp_error(method: KautzMcCool, lobe: Lobe) -> tuple[float, float]:
    """Return the measured energy error over 2^16 uniform (R, V) under one lamp, and the predicted one."""
    light, direction = lamp()
    points = queries(2**16)
    got = rendered(method, lobe, light, points)
    axes = (np.moveaxis(v, -1, 0) for v in (points.view, points.central(lobe.centre), points.normal))
    exact = np.stack(np.broadcast_arrays(*lobe.evaluate(direction[:, None], *axes)), -1)
    prepared = method.prepare(Material("m", (lobe,)), SPHERE)
    (predicted,) = method.predictions(prepared, light).values()
    return float(np.mean((got - exact) ** 2) / np.mean(exact**2)), predicted


@pytest.mark.parametrize(
    ("lobe", "shift", "polar"),
    [
        (Microfacet(sigma=0.3), False, 24),
        (Microfacet(sigma=0.3), True, 24),
        (Microfacet(sigma=0.3, clipped=False), True, 4),
        (Phong(exponent=8), True, 12),
        (KajiyaKay(), True, 12),
    ],
    ids=repr,
)
def test_the_energy_lost_under_one_lamp_is_predicted(lobe: Lobe, shift: bool, polar: int, mi: object) -> None:
    """Averaging, interpolation in theta_o and truncation; a tenth for bilinear lookup and for few queries."""
    measured, predicted = lamp_error(KautzMcCool(eps=1e-3, rows=96, polar=polar, shift=shift), lobe)
    assert measured == pytest.approx(predicted, rel=0.1)


def test_the_shifted_axis_halves_the_loss_of_an_off_specular_lobe(mi: object) -> None:
    lobe = CookTorrance(roughness=0.4)
    plain, moved = (averaged(lobe, 24, shifted=s, order=63) for s in (False, True))
    assert moved.missing < 0.7 * plain.missing
    assert moved.shift.max() > 0.1
    measured = [lamp_error(KautzMcCool(eps=1e-3, rows=96, polar=24, shift=s), lobe)[0] for s in (False, True)]
    assert measured[1] < 0.8 * measured[0]


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.5), Phong(exponent=8), CookTorrance(roughness=0.4)], ids=repr)
def test_a_shift_never_loses_more(lobe: Lobe) -> None:
    plain, moved = (averaged(lobe, 12, shifted=s, order=63) for s in (False, True))
    assert moved.missing <= plain.missing
    # averaging keeps integrals, whatever the axis; azimuths meet a clipped edge to 1 / 96 of a ring
    np.testing.assert_allclose(moved.integral[:-1], plain.integral[:-1], rtol=1e-2)


def test_a_radially_symmetric_lobe_takes_one_map() -> None:
    (prepared,) = KautzMcCool().prepare(Material("m", (Lambertian(),)), SPHERE)
    assert prepared.average.values.shape[:2] == (1, 1)
    assert prepared.zonal[0, 0, :3] == pytest.approx([1, 2 / 3, 1 / 4], abs=1e-11)  # 1e-12 of its cone


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "lobe",
    [Lambertian(), Phong(exponent=32), Microfacet(), Microfacet(sigma=0.05), CookTorrance(), KajiyaKay()],
    ids=repr,
)
def test_it_keeps_the_laws(lobe: Lobe, seed: int, mi: object) -> None:
    assert laws.check(KautzMcCool(), Material("m", (lobe,)), seed) == []
    if seed == 0:
        quick = KautzMcCool(prefiltering="angular", rows=16, polar=8)
        assert laws.check(quick, Material("m", (lobe,)), seed) == []


@pytest.mark.parametrize("shape", [(2, 4), (3, 5)])
@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.01), CookTorrance(), Lambertian()], ids=repr)
def test_hard_cases_stay_finite(shape: tuple[int, int], lobe: Lobe, mi: object) -> None:
    radiance = np.zeros((*shape, 3), np.float32)
    radiance[0, -1] = 1e8
    grazing = from_angles(np.pi / 2 - np.radians(0.01) * np.arange(3), 0.3)
    normal = np.concatenate([np.tile([[0.0, 0, 1]], (3, 1)), uniform(32, np.random.default_rng(0)), [[0.0, 0, 1]]])
    view = np.concatenate([grazing, normal[3:]])
    points = Points(normal, normal, normal, reflect(normal, view), view, np.full(len(normal), 1 / len(normal)))
    for prefiltering in ("shrm", "angular"):
        method = KautzMcCool(eps=0.1, polar=4, prefiltering=prefiltering, rows=16)
        assert np.isfinite(rendered(method, lobe, Environment("hard", radiance), points)).all()


@dataclass(frozen=True, kw_only=True)
class AboutTheTangent(Phong):
    centre = Centre.TANGENT


def test_a_clipped_lobe_about_the_tangent_is_declined() -> None:
    points = queries(4)
    whole = AboutTheTangent(clipped=False)
    scene = Scene("s", random_light(4, 8), Material("m", (whole,)), SPHERE, points)
    assert KautzMcCool().declines(scene) is None
    clipped = replace(scene, material=Material("m", (replace(whole, clipped=True),)))
    assert "depends on the normal" in str(KautzMcCool().declines(clipped))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"eps": 0.0}, "eps must lie in"),
        ({"eps": float("nan")}, "Got nan"),
        ({"rows": 1}, "rows must be 0"),
        ({"polar": 1}, "polar must lie in"),
        ({"prefiltering": "fast"}, "'shrm' or 'angular'. Got 'fast'"),
        ({"light_rows": 1}, "light_rows must be 0"),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        KautzMcCool(**settings)


def test_textures_that_would_fill_the_memory_are_refused() -> None:
    with pytest.raises(BadInput, match=r"would take \d+\.\d GiB"):
        KautzMcCool(rows=2048, polar=32).prepare(Material("m", (Microfacet(sigma=0.5),)), SPHERE)


def test_what_was_chosen_is_described() -> None:
    method = KautzMcCool(polar=6)
    described = method.describe(method.prepare(Material("m", (Lambertian(), Phong(exponent=8))), SPHERE))
    assert described["T"] == [1, 6]
    assert len(KautzMcCool.sweep()) >= 4
