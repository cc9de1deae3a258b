"""Generated lights against their formulae."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.special import sph_harm_y

from data_gen.environments.daylight import APERTURE, sunsky
from data_gen.environments.generated import band_limited, constant, lamps, noise, pixel
from data_gen.environments.interior import hall
from envbench import directions, latlong


def test_constant() -> None:
    light = constant(radiance=(1, 2, 3), size=4)
    np.testing.assert_array_equal(
        light(directions.uniform(50, np.random.default_rng(0))), np.tile([1.0, 2, 3], (50, 1))
    )


def test_one_pixel_is_a_tent() -> None:
    light = pixel(row=3, column=0, radiance=[1, 2, 3e8], size=8)
    step = np.pi / 8
    theta, phi = 3.5 * step, 0.5 * step
    where = directions.from_angles(theta + step * np.array([0, 0.5, -1, 0]), phi + step * np.array([0, 0, 0, -0.75]))
    expected = np.array([1, 0.5, 0, 0.25])[:, None] * [1, 2, 3e8]
    np.testing.assert_allclose(light(where), expected, rtol=1e-12, atol=1e-6)
    assert np.count_nonzero(light.radiance) == 3


@pytest.mark.parametrize(("size", "shape"), [(16, (16, 32, 3)), ([5, 3], (3, 5, 3)), ((4, 2), (2, 4, 3))])
def test_noise_has_any_size(size: Any, shape: tuple[int, ...]) -> None:
    light = noise(size=size, seed=1)
    assert light.radiance.shape == shape
    assert light.key == noise(size=size, seed=1).key != noise(size=size, seed=2).key


def test_lamps_have_their_power_and_place() -> None:
    axis, width = directions.normalised([1.0, -2, 0.5]), 0.3
    light = lamps(lamps=[{"direction": axis.tolist(), "width": width, "radiance": [1, 2, 4]}], size=256)
    # Peak: the nearest sample is within half a pixel's diagonal. Power: samples times solid angles are a midpoint
    # rule, off by h^2 / 24 of the second derivative, 1 / width^2 a dimension.
    step = np.pi / 256
    np.testing.assert_allclose(light(axis), [1, 2, 4], rtol=step**2 / width**2)
    power = 2 * np.pi * width**2 * (1 - np.exp(-2 / width**2)) * np.array([1, 2, 4])
    np.testing.assert_allclose(light.mean * 4 * np.pi, power, rtol=step**2 / 12 / width**2)


def test_random_lamps_by_seed() -> None:
    assert lamps(seed=1, size=16).key == lamps(seed=1, size=16).key
    assert lamps(seed=1, size=16).key != lamps(seed=2, size=16).key
    # The sum of 200 powers of mean 1, uniform in [.5, 1.5]: standard deviation .29 sqrt(200); here 5 of them.
    power = lamps(count=200, size=256).mean * 4 * np.pi
    np.testing.assert_allclose(power, 200, atol=5 * 0.29 * np.sqrt(200))


def test_narrow_lamps_are_told() -> None:
    (note,) = lamps(lamps=[{"direction": [0, 0, 1], "width": 0.01, "radiance": 1}], size=64).notes
    assert "narrower than two pixels" in note


def test_band_limited_has_no_higher_bands() -> None:
    order, height = 6, 64
    light = band_limited(order=order, seed=3, size=height)
    np.testing.assert_array_equal(light.radiance.min(axis=(0, 1)), 0)
    theta, phi = latlong.angles(height, 2 * height)
    basis = np.stack([
        sph_harm_y(l, m, theta[:, None], phi).reshape(-1) for l in range(order + 1) for m in range(-l, l + 1)
    ], axis=-1)  # fmt: skip
    samples = light.radiance.reshape(-1, 3).astype(float)
    coefficients, *_ = np.linalg.lstsq(basis, samples.astype(complex), rcond=None)
    # The samples are rounded to float32.
    np.testing.assert_allclose((basis @ coefficients).real, samples, atol=samples.max() * 2**-23)
    assert np.abs(coefficients[-(2 * order + 1) :]).min() > 0  # and the last band is there


def test_hall_has_its_range_and_its_windows() -> None:
    light = hall(windows=3, contrast=1e4, size=128)
    assert light.radiance.min() == 1
    assert light.radiance.max() == 1e4

    def share(z: float, x: float) -> float:  # dw = y / r^3 dx dz on the plane y = 3
        return 3 / (x * x + 9 + z * z) ** 1.5

    solid_angle = sum(dblquad(share, x - 0.6, x + 0.6, -0.5, 2.1)[0] for x in (-4.0, 0.0, 4.0))
    seen = (light.radiance[..., 0] > 100) * (light.radiance[..., 0] / 1e4) * latlong.solid_angles(128, 256)
    # Edges are resolved to a sub-sample, pi / 512: of the windows' outline (about 5 rad at this distance) that is
    # at most half a sub-sample wide, one way or the other, and it cancels mostly.
    assert seen.sum() == pytest.approx(solid_angle, abs=5 * np.pi / 512 / 2)


def test_sunsky_keeps_the_power_of_sun_and_sky(mi: ModuleType) -> None:
    import drjit as dr

    settings = {"sun_direction": [0.3, 0.4, 0.6], "turbidity": 3.0, "albedo": 0.3}
    for scales in ({"sun_scale": 0.0}, {"sky_scale": 0.0}):
        emitter = mi.load_dict({"type": "sunsky", **settings, **scales})
        u = np.random.default_rng(1).uniform(size=(2, 100_000)).astype(np.float32)
        _, weight = emitter.sample_direction(dr.zeros(mi.Interaction3f, u.shape[1]), mi.Point2f(u))
        weight = np.array(weight, float)
        light = sunsky(sun=(0.3, 0.4, 0.6), turbidity=3, albedo=0.3, size=128, **scales)
        # Mitsuba's own sampling, 5 standard errors; a midpoint rule for the sky (1e-3), a polar grid for the disc.
        error = 5 * weight.std(axis=1) / np.sqrt(weight.shape[1]) + 2e-3 * weight.mean(axis=1)
        assert (np.abs(light.mean * 4 * np.pi - weight.mean(axis=1)) <= error).all()
    assert mi.variant() == "llvm_ad_rgb"


def test_sun_stands_where_it_should_and_is_resolved_or_told() -> None:
    towards = directions.normalised([0.3, 0.4, 0.6])
    light = sunsky(size=128)
    brightest = np.unravel_index(light.radiance.sum(-1).argmax(), (128, 256))
    assert latlong.grid(128, 256)[brightest] @ towards > np.cos(np.pi / 128)
    (note,) = light.notes
    assert f"{APERTURE * 128 / np.pi:.2g} pixels across" in note
    assert (light.radiance[64:] == 0).all()
