"""The furnace: closed forms, a plain sum over a fine grid, and what clipping is said to take away."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.lobes import GGX, KajiyaKay, Lafortune, Lambertian, Microfacet, Phong
from envbench import latlong
from envbench.directions import from_angles, normalised, perpendicular, uniform
from envbench.environment import Environment
from envbench.furnace import clipping, lobe_integrals
from envbench.geometry import Geometry, Points
from envbench.material import Lobe, Material
from envbench.scene import Scene


def points(count: int = 12, seed: int = 0) -> Points:
    rng = np.random.default_rng(seed)
    reflection, view = uniform(count, rng), uniform(count, rng)
    normal = normalised(reflection + view)
    return Points(normal, normal, normal, perpendicular(normal), view, np.full(count, 1 / count))


def scene(*lobes: Lobe) -> Scene:
    light = Environment("constant", np.ones((4, 8, 3), np.float32))
    return Scene("test", light, Material("test", lobes), Geometry("sphere"), points())


@pytest.mark.parametrize("exponent", [1, 32, 1e4, 1e7])
def test_whole_phong_reflects_everything(exponent: float) -> None:
    lobe = Phong(exponent=exponent, clipped=False, reflectance=(1.0, 0.5, 0.25))
    got = lobe_integrals(Material("test", (lobe,)), points())
    assert got == pytest.approx(np.broadcast_to([1, 0.5, 0.25], got.shape), rel=1e-5)


def test_clipped_phong_of_exponent_one() -> None:
    """Projected onto the plane of R, {R.L > 0, N.L > 0} is half a disc and half an ellipse: pi (1 + N.R) / 2."""
    at = points(64)
    cosine = np.sum(at.normal * at.reflection, axis=-1)
    got = lobe_integrals(Material("test", (Phong(exponent=1),)), at)
    assert got[:, 0] == pytest.approx((1 + cosine) / 2, abs=1e-5)


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.4), GGX(roughness=0.6), KajiyaKay(exponent=8)], ids=repr)
def test_against_a_plain_sum(lobe: Lobe) -> None:
    """Midpoint sum over 400 x 800 directions; the jump at the horizon costs some cells of 6e-5 sr, times the peak."""
    height, width = 400, 800
    light = np.moveaxis(latlong.grid(height, width), -1, 0)
    weight = latlong.solid_angles(height, width)
    at = points(6)
    got = lobe_integrals(Material("test", (lobe,)), at)
    for i, centre in enumerate(at.central(lobe.centre)):
        expected = [np.sum(v * weight) for v in lobe.evaluate(light, at.view[i], centre, at.normal[i])]
        assert got[i] == pytest.approx(expected, abs=1e-3)


def test_a_narrow_peak_in_a_wide_lobe_is_found() -> None:
    """(R.L)^n N.L holds 2 pi N.R / (n + 1) to 1 / n: some parts in 10^4 of this lobe, and that of its parts exactly."""
    peak = {"c_xy": ((-1.0,) * 3,), "c_z": ((1.0,) * 3,), "n": ((3000.0,) * 3,)}
    both, alone = Lafortune(diffuse=(0.9, 0.5, 0.2), **peak), Lafortune(**peak)
    at = points()
    diffuse = lobe_integrals(Material("test", (Lambertian(reflectance=both.diffuse),)), at)
    parts = diffuse + lobe_integrals(Material("test", (alone,)), at)
    assert lobe_integrals(Material("test", (both,)), at) == pytest.approx(parts, rel=1e-6)


def test_clipping_is_named_where_it_takes_something_away() -> None:
    assert "clipped at the horizon" in (clipping(scene(Phong(exponent=4))) or "")
    assert clipping(scene(Phong(exponent=4, clipped=False))) is None
    assert clipping(scene(GGX(roughness=0.5), Lambertian())) is None  # zero below the horizon, clipped or not
    assert clipping(scene(KajiyaKay())) is None


def test_nothing_but_finite_numbers_at_grazing() -> None:
    normal = np.broadcast_to([0.0, 0.0, 1.0], (3, 3))
    view = from_angles(np.radians([89.99, 90, 120]), 0.3)
    at = Points(normal, normal, normal, perpendicular(normal), view, np.full(3, 1 / 3))
    for lobe in (Phong(), Microfacet(sigma=0.01), GGX(roughness=0.1), Lambertian(), KajiyaKay(exponent=1e5)):
        got = lobe_integrals(Material("test", (lobe,)), at)
        assert np.isfinite(got).all()
        assert got.min() >= 0
