"""Angular prefiltering against the slow and obvious sum, closed forms, and its own symmetries."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from data_gen import views
from data_gen.lobes import GGX, CookTorrance, Lambertian, Microfacet, Phong
from envbench import latlong, laws
from envbench.directions import Array, from_angles, normalised, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Lobe, Material
from envbench.scene import Scene
from methods.angular import Angular, losses
from methods.angular.lookup import look_up
from methods.angular.prefilter import grazing, polar_nodes, prefilter, prefilter_at, refinement, width

SPHERE = Geometry("sphere")
SINGLE = 2e-5
"""Single precision: rounding of a lobe's value (1e-6 relative for exponents of about 10), sums of some 10^3 texels."""


def random_light(height: int, width: int, seed: int = 0) -> Environment:
    return Environment("random", np.random.default_rng(seed).uniform(0, 1, (height, width, 3)).astype(np.float32))


def constant_light(height: int) -> Environment:
    return Environment("constant", np.ones((height, 2 * height, 3), np.float32))


def smooth_light(height: int) -> Environment:
    x, y, z = np.moveaxis(latlong.grid(height, 2 * height), -1, 0)
    return Environment("smooth", np.stack([1 + x, 1 + y * z, 1 + np.sin(2 * x + z)], -1).astype(np.float32))


def refined(light: Environment, factor: int) -> Environment:
    height, columns = light.radiance.shape[:2]
    if factor == 1:
        return light
    grid = latlong.grid(factor * height, factor * columns)
    return replace(light, radiance=latlong.interpolate(light.radiance, grid).astype(np.float32))


def obvious(light: Environment, lobe: Lobe, centre: Array, view: Array, normal: Array, cone: float = np.pi) -> Array:
    """Sum over all texels within `cone` of the centre, one query (3,) at a time, in double precision.

    Where the lobe is narrower than a texel, over those of the same bilinear function on the finer grid.
    """
    light = refined(light, refinement(len(light.radiance), lobe))
    grid = latlong.grid(*light.radiance.shape[:2]).reshape(-1, 3)
    power = (light.radiance * latlong.solid_angles(*light.radiance.shape[:2])[..., None].astype(float)).reshape(-1, 3)
    rho = lobe.evaluate(grid.T, view[:, None], centre[:, None], normal[:, None])
    inside = grid @ centre >= np.cos(cone)
    return np.array([np.sum(rho[channel] * inside * power[:, channel]) for channel in range(3)])


def turn(alpha: float, beta: float) -> Array:
    """R(alpha, beta) = Rz(beta) Ry(alpha) as a matrix."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    return np.array([[cb, -sb, 0], [sb, cb, 0], [0, 0, 1]]) @ np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])


def points_about(normal: Array, view: Array) -> Points:
    return Points(normal, normal, normal, normal, view, np.full(len(normal), 1 / len(normal)))


def nrmse(result: Any, truth: Any) -> float:
    return float(np.sqrt(np.mean((result - truth) ** 2) / np.mean(truth**2)))


@pytest.mark.parametrize("lobe", [Lambertian(), Phong(exponent=8, clipped=False), Phong(exponent=300, clipped=False)])
@pytest.mark.parametrize("eps", [0.3, 0.001])
def test_a_radially_symmetric_map_is_the_obvious_sum(lobe: Lobe, eps: float) -> None:
    light, shape = random_light(23, 38), (5, 9)
    maps = prefilter(light.radiance, lobe, shape, eps)
    assert maps.shape == (5, 9, 1, 1, 3)
    centres = latlong.grid(*shape).reshape(-1, 3)
    truth = [obvious(light, lobe, c, c, c, lobe.cone(eps)) for c in centres]
    np.testing.assert_allclose(maps.reshape(-1, 3), truth, rtol=0, atol=SINGLE * np.max(truth))


@pytest.mark.parametrize("lobe", [Phong(exponent=5, reflectance=(0.2, 1, 0.5)), Microfacet(sigma=0.3)])
def test_maps_over_views_are_the_obvious_sum(lobe: Lobe) -> None:
    light, shape, views_, eps = random_light(16, 21), (4, 6), 4, 0.05
    maps = prefilter(light.radiance, lobe, shape, eps, views_)
    assert maps.shape == (4, 6, 4, 4, 3)
    truth = np.zeros(maps.shape)
    for row, alpha in enumerate(latlong.angles(*shape)[0]):
        for column, beta in enumerate(latlong.angles(*shape)[1]):
            for k, theta in enumerate(polar_nodes(lobe, views_, 16)):
                for m, phi in enumerate(2 * np.pi * np.arange(views_) / views_):
                    frame = turn(alpha, beta)
                    view, normal = frame @ from_angles(theta, phi), frame @ from_angles(theta / 2, phi)
                    truth[row, column, k, m] = obvious(light, lobe, frame[:, 2], view, normal, lobe.cone(eps))
    np.testing.assert_allclose(maps, truth, rtol=0, atol=SINGLE * truth.max())


@dataclass(frozen=True, kw_only=True)
class Tinted(Microfacet):
    """Three shapes, one a channel, in a cone that no measured lobe can narrow."""

    channels = 3

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        (value,) = super().profile(light, view, centre, normal)
        return value, value * value, 1 + value

    def cone(self, eps: float) -> float:
        return float(np.pi)


ANYWHERE = [
    Lambertian(),
    Phong(exponent=5, reflectance=(0.2, 1, 0.5)),
    Microfacet(sigma=0.3, clipped=False),
    Tinted(sigma=0.3),
    Phong(exponent=2000),
]


@pytest.mark.parametrize("lobe", ANYWHERE, ids=repr)
@pytest.mark.parametrize(("height", "columns"), [(16, 21), (3, 6), (2, 4)])
def test_at_any_direction_it_is_the_obvious_sum(lobe: Lobe, height: int, columns: int) -> None:
    if width(lobe) < np.pi / height:
        columns += columns % 2  # a half turn of an odd number of columns is smoothed on the finer grid
    light, eps, rng = random_light(height, columns), 0.05, np.random.default_rng(1)
    poles_and_seam = from_angles([0, np.pi, 0.01, 3.14, 1.0, 1.0], [0, 0, 2, 5, 1e-9, 2 * np.pi - 1e-9])
    normal = np.concatenate([uniform(24, rng), poles_and_seam])
    view = normalised(uniform(len(normal), rng) + normal)
    view[-1] = np.cross(normal[-1], [0.0, 0.6, 0.8])  # grazing: R = -V
    points = points_about(normal, normalised(view))
    centre = points.central(lobe.centre)
    found = prefilter_at(light.radiance, lobe, centre, points.view, normal, eps)
    truth = np.array(
        [obvious(light, lobe, c, v, n, lobe.cone(eps)) for c, v, n in zip(centre, points.view, normal, strict=True)]
    )
    # a texel on the edge of cone or horizon may fall either way in single precision: its value there, not more
    off = np.abs(found - truth).max(1) > SINGLE * truth.max() * max(1, 1 / width(lobe))
    assert found.dtype == np.float32
    assert np.count_nonzero(off) <= 2


def test_a_lobe_narrower_than_a_texel_sees_the_light_between() -> None:
    """The bilinear light hardly changes within the lobe, so that it reflects the light's own value."""
    light = smooth_light(64)
    directions = np.concatenate([uniform(200, np.random.default_rng(0)), [[0, 0, 1], [0, 0, -1]]])
    for lobe in (Phong(exponent=1e5, clipped=False), Phong(exponent=1e7, clipped=False)):
        found = prefilter_at(light.radiance, lobe, directions, directions, directions, 1e-4)
        # the share outside the cone; on a pole steps of w / 2 err by 1 / 48 (`refinement`); in single precision the
        # kink of the bilinear light, a second difference of (pi / 64)^2, is met within w of it
        bound = np.full((len(directions), 1), 1e-4 + (np.pi / 64) ** 2)
        bound[-2:] += 1 / 48
        assert (np.abs(found - light(directions)) <= 2 * bound).all()  # the light is at most 2


@pytest.mark.parametrize("lobe", [Phong(exponent=1e5), Microfacet(sigma=0.01)], ids=repr)
def test_no_lamp_falls_between_the_texels_of_a_map(lobe: Lobe) -> None:
    """One pixel of 1e8: reflected energy over uniform R stays that of the lamp for every lobe narrower than a texel."""
    radiance = np.zeros((256, 512, 3), np.float32)
    radiance[100, 77] = 1e8
    light, points = Environment("lamp", radiance), views.build({"kind": "uniform", "count": 2**14}, SPHERE)[0]
    for rows in (16, 24):
        found = np.asarray(relit_and_shaded(Angular(rows=rows, directions=2, light_rows=0), light, lobe, points))
        assert np.isfinite(found).all()
        if isinstance(lobe, Phong):  # a mean over two polar views, of which the second lies partly below the horizon
            # over R: texels of the map hold the light's own, of equal solid angle: 2^14 queries find it to 10 %
            kept = losses.integrals((lobe,), lobe.centre, polar_nodes(lobe, 2, rows)).mean()
            assert found.mean() == pytest.approx(kept * light.mean[0], rel=0.1)


@pytest.mark.parametrize("eps", [0.3, 0.05, 0.001])
@pytest.mark.parametrize("lobe", [Lambertian(), Phong(exponent=8, clipped=False)])
def test_the_cone_loses_eps_of_a_constant_light(lobe: Lobe, eps: float) -> None:
    rows = 128
    maps = prefilter(constant_light(rows).radiance, lobe, (16, 8), eps)
    # the cone's edge cuts a ring of texels: the sum errs by less than the ring half a texel wide
    edge = from_angles(lobe.cone(eps), 0.0)[:, None]
    axis = np.array([[0.0], [0.0], [1.0]])
    ring = lobe.profile(edge, axis, axis, axis)[0][0] * 2 * np.pi * np.sin(lobe.cone(eps)) * (np.pi / rows / 2)
    # and the smooth inside is a midpoint sum, of error h^2 / 24 times a second derivative of at most 2 s
    assert np.abs(maps - (1 - eps)).max() < ring + (np.pi / rows) ** 2 / 24 * 16 + SINGLE


def test_a_clipped_lobe_loses_what_lies_below_the_horizon() -> None:
    rows, views_ = 96, 4
    whole = Phong(exponent=64, clipped=False)
    clipped = replace(whole, clipped=True)
    maps = prefilter(constant_light(rows).radiance, clipped, (8, 4), 1e-4, views_)
    np.testing.assert_allclose(maps[:, :, 0], 1, atol=1e-3)  # R = N: nothing of it lies below
    # near grazing, R nearly perpendicular to N: about half of it; the cut through the peak errs by up to half a texel's
    # strip of the lobe
    strip = np.sqrt(whole.exponent / (2 * np.pi)) * np.pi / rows / 2
    expected = losses.integrals((clipped,), clipped.centre, polar_nodes(clipped, views_, rows)[-1:])[0]
    assert 0.5 < expected < 0.7
    np.testing.assert_allclose(maps[:, :, -1], expected, atol=strip + 1e-3)


@pytest.mark.parametrize(
    "lobe", [GGX(roughness=0.7), CookTorrance(roughness=0.15, clipped=False), Phong(exponent=8)], ids=repr
)
def test_no_lobe_is_lost_or_gained_at_the_grazing_view(lobe: Lobe) -> None:
    """Facets are divided by N.V and are nothing below the horizon: the map of grazing views must not err there."""
    maps = prefilter(constant_light(64).radiance, lobe, (8, 16), 0.01, 4)[:, :, -1].mean((2, 3))
    expected = losses.integrals((lobe,), lobe.centre, polar_nodes(lobe, 4, 64)[-1:])[0]
    # the ridge of the narrowest lobe here, 2 m N.V wide, is a sixth of a texel wide and six texels long
    assert grazing(64, lobe) <= 0.1
    assert np.abs(maps - expected).max() < 0.3 * expected


def test_look_up_means_what_latlong_means() -> None:
    maps = random_light(6, 12).radiance
    rng = np.random.default_rng(1)
    poles_and_seam = from_angles([0, np.pi, 0.01, 3.13, 1.0, 1.0], [0, 0, 2, 5, 1e-9, 2 * np.pi - 1e-9])
    normal = np.concatenate([uniform(500, rng), poles_and_seam, [[0.0, 0, 1], [0, 0, -1]]])
    found = look_up(maps[:, :, None, None], Centre.NORMAL, points_about(normal, normal))
    np.testing.assert_allclose(found, latlong.interpolate(maps, normal), atol=SINGLE)


def test_look_up_of_views_is_right_at_poles_and_seams() -> None:
    rows, views_ = 48, 32

    def truth(centre: Array, view: Array) -> Array:
        mixed = np.cross(centre, [0.3, 0.5, 0.8])
        return np.stack([view[..., 0], np.sum(view * mixed, -1), view[..., 2] * centre[..., 1]], -1)

    alpha, beta = latlong.angles(rows, 2 * rows)
    theta, phi = np.linspace(0, np.pi, views_), 2 * np.pi * np.arange(views_) / views_
    frames = np.array([[turn(a, b) for b in beta] for a in alpha])
    local = from_angles(theta[:, None], phi[None, :])
    view = np.einsum("abij,klj->abkli", frames, local)
    maps = truth(np.broadcast_to(frames[:, :, None, None, :, 2], view.shape), view).astype(np.float32)

    rng = np.random.default_rng(2)
    poles = from_angles([0.002, 0.03, 0.03, np.pi - 0.01, np.pi - 0.04, 1.0, 1.0], [0, 3, 6, 1, 4, 1e-4, 6.2831])
    centre = np.concatenate([np.repeat(poles, 50, 0), uniform(300, rng)])
    view = uniform(len(centre), rng)
    points = points_about(normalised(centre + view), view)
    # bilinear in four angles, each of spacing h, of products of at most two unit sinusoids: 4 (h^2 / 8) each, and twice
    # that about phi, whose spacing on the view's sphere is doubled
    bound = ((np.pi / rows) ** 2 * 2 + (np.pi / (views_ - 1)) ** 2 + (2 * np.pi / views_) ** 2) / 2
    found = look_up(maps, Centre.REFLECTION, points)
    assert np.abs(found - truth(points.reflection, view)).max() < bound


def test_microfacet_converges_as_the_grids_grow() -> None:
    lobe = Microfacet(sigma=0.3)
    light = smooth_light(48)
    points, _ = views.build({"kind": "uniform", "count": 200, "seed": 3}, SPHERE)
    truth = np.array(
        [obvious(light, lobe, r, v, n) for r, v, n in zip(points.reflection, points.view, points.normal, strict=True)]
    )
    errors = []
    for rows, views_ in ((6, 4), (12, 8), (24, 16)):
        method = Angular(light_rows=0, rows=rows, directions=views_, eps=1e-4)
        result = method.shade(method.relight(method.prepare(Material("m", (lobe,)), SPHERE), light), points)
        errors.append(nrmse(result, truth))
    # second order would divide by 4, but a kink (the horizon) keeps bilinear interpolation from it: by 2 at least
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert errors[2] < 0.02


@dataclass(frozen=True, kw_only=True)
class AboutTheTangent(Phong):
    centre = Centre.TANGENT


def scene(*lobes: Lobe) -> Scene:
    points, viewer = views.build({"kind": "image", "size": 4, "direction": [0, 0, 1]}, SPHERE)
    return Scene("s", constant_light(8), Material("m", lobes), SPHERE, points, viewer)


def test_it_declines_only_what_it_cannot_hold() -> None:
    assert Angular().declines(scene(Lambertian(), Phong(), Microfacet(), AboutTheTangent(clipped=False))) is None
    assert "also depends on the normal" in str(Angular().declines(scene(AboutTheTangent())))
    assert "GiB; lower rows or directions" in str(Angular(rows=512, directions=32).declines(scene(Phong())))


def relit_and_shaded(method: Angular, light: Environment, lobe: Lobe, points: Points) -> Any:
    return method.shade(relit(method, light, lobe), points)


def relit(method: Angular, light: Environment, *lobes: Lobe) -> Any:
    return method.relight(method.prepare(Material("m", lobes), SPHERE), light)


def test_the_exact_laws() -> None:
    method = Angular(light_rows=12, rows=12, directions=4, eps=0.01)
    points, _ = views.build({"kind": "uniform", "count": 64, "seed": 0}, SPHERE)
    lobes = (Lambertian(), Phong(exponent=8, reflectance=(0.5, 0.2, 0.1)))
    light = random_light(24, 48)
    state = relit(method, light, *lobes)
    once = method.shade(state, points)
    assert once.shape == (64, 3)
    np.testing.assert_array_equal(once, method.shade(relit(method, light, *lobes), points))
    np.testing.assert_array_equal(once, method.shade(pickle.loads(pickle.dumps(state)), points))
    each = sum(method.shade(relit(method, light, lobe), points) for lobe in lobes)
    np.testing.assert_allclose(once, each, rtol=1e-6)
    tripled = relit(method, Environment("3", 3 * light.radiance), *lobes)
    np.testing.assert_allclose(method.shade(tripled, points), 3 * once, rtol=1e-5)
    assert not method.shade(relit(method, Environment("0", 0 * light.radiance), *lobes), points).any()


def test_turning_light_and_points_by_whole_columns_changes_nothing() -> None:
    method = Angular(light_rows=0, rows=12, directions=6, eps=0.01)
    points, _ = views.build({"kind": "uniform", "count": 64, "seed": 0}, SPHERE)
    light, lobe = random_light(24, 48), Microfacet(sigma=0.4, clipped=False)
    turned_light = Environment("turned", np.roll(light.radiance, 10, axis=1))  # 5 columns of the map
    about_z = turn(0.0, 2 * np.pi * 10 / 48)
    turned_points = points_about(points.normal @ about_z.T, points.view @ about_z.T)
    here, there = relit(method, light, lobe), relit(method, turned_light, lobe)
    np.testing.assert_allclose(method.shade(there, turned_points), method.shade(here, points), rtol=1e-4)


@pytest.mark.parametrize("lobe", [Lambertian(), Phong(exponent=32, clipped=False), Phong(exponent=8), Microfacet()])
def test_it_keeps_the_laws(lobe: Lobe) -> None:
    assert laws.check(Angular(light_rows=24, rows=16, directions=6, eps=0.01), Material("m", (lobe,)), count=32) == []


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rows": 1}, r"rows must lie in \[2, 2048\]. Got 1 instead."),
        ({"light_rows": 1}, r"light_rows must be 0 or lie in \[2, 8192\]. Got 1 instead."),
        ({"directions": 5}, r"directions must be even and lie in \[2, 64\]. Got 5 instead."),
        ({"eps": 0.0}, r"eps must lie in \(0, 1\). Got 0.0 instead."),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Angular(**settings)


def test_what_was_chosen_is_described() -> None:
    method = Angular(rows=32, directions=8)
    description = method.describe(method.prepare(Material("m", (Lambertian(), Phong(exponent=8))), SPHERE))
    assert description["lambertian 0: maps"] == "1x1 of 64x32"
    assert description["phong 1: maps"] == "8x8 of 64x32"
    assert description["phong 1: cone"] == "53.2 degrees"
    assert len(Angular.sweep()) >= 3
