"""Studies beside Ramamoorthi and Hanrahan: the paper's sums against ducc0, closed forms, what holds at any speed."""

from __future__ import annotations

import time

import numpy as np
import pytest

from benchmarks.studies import accuracy, clock, irradiance, prefiltering, radial_orders, sampling
from benchmarks.studies.separable import Separable
from data_gen.lobes import Phong
from envbench import harmonics, latlong
from methods.shrm import maps
from methods.shrm.coefficients import expand


@pytest.mark.parametrize(("order", "shape"), [(0, (8, 8)), (5, (16, 16)), (20, (48, 96))])
def test_the_papers_sums_synthesise_what_ducc0_does(order: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    l, m = harmonics.degrees(order)
    alm = (rng.normal(size=len(l)) + 1j * np.where(m > 0, rng.normal(size=len(l)), 0)).astype(np.complex64)
    packed = np.zeros((order + 1, order + 1, 6), np.float32)
    packed[m, l, 0], packed[m, l, 3] = alm.real, alm.imag
    exact = np.empty((1, *shape), np.float32)
    harmonics.synthesise(alm[None], 0, order, exact)
    found = Separable.of(order, *shape).synthesise(packed)
    assert np.allclose(found[0], exact[0], atol=1e-4 * np.abs(exact).max())
    assert not found[1:].any()


def test_the_papers_sums_give_back_the_coefficients_of_a_smooth_map() -> None:
    # texels with their solid angles integrate products of degree 2 F to h^2, h = pi / 256
    order, shape = 6, (256, 512)
    sums = Separable.of(order, *shape)
    packed = np.random.default_rng(1).normal(size=(order + 1, order + 1, 6)).astype(np.float32)
    l, m = np.meshgrid(np.arange(order + 1), np.arange(order + 1))
    packed[m > l] = 0
    packed[0, :, 3:] = 0  # real
    found = sums.analyse(np.ascontiguousarray(np.moveaxis(sums.synthesise(packed), 0, 2)))
    assert np.abs(found - packed)[m <= l].max() < 50 * (np.pi / 256) ** 2


def test_square_maps_are_those_of_ducc0() -> None:
    lobe = expand(Phong(exponent=8.0, clipped=False), 0.01)
    light = harmonics.analyse(prefiltering.light(32, 64), lobe.F)
    at = latlong.grid(16, 16)
    square = np.moveaxis(maps.synthesise(lobe, light, 16, 16)[:, 0], 0, 2)
    fine = np.moveaxis(maps.synthesise(lobe, light, 256)[:, 0], 0, 2)
    # bilinear between samples of F = 6, (F pi / 256)^2 / 8 of the range
    assert np.abs(square - latlong.interpolate(fine, at)).max() < 1e-3 * fine.max()


def test_the_light_keeps_its_mean_on_any_grid() -> None:
    means = [
        (latlong.solid_angles(*light.shape[:2])[..., None] * light).sum((0, 1))
        for light in (prefiltering.light(64), prefiltering.light(64, 128), prefiltering.light(320))
    ]
    assert np.allclose(means[0], means[1], rtol=1e-5)
    assert np.allclose(means[0], means[2], rtol=0.02)


def test_the_order_of_the_paper_leaves_out_less_than_eps() -> None:
    for s in prefiltering.EXPONENTS:
        assert expand(Phong(exponent=float(s), clipped=False), 0.5, prefiltering.order(s), 0).missing < 0.01


def test_a_crossing_is_found_within_and_beyond_what_was_measured() -> None:
    s = np.array([10.0, 20.0, 40.0])
    assert prefiltering.crossing(s, 30 / s) == pytest.approx((30, True))
    assert prefiltering.crossing(s, 300 / s) == pytest.approx((300, False))
    assert prefiltering.crossing(s, s) == (float("inf"), False)


def test_the_fastest_round_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    spent = iter([9.0, 3.0, 2.0, 1.0, 4.0])  # the first warms up
    monkeypatch.setattr(clock, "timed", lambda run: (run(), next(spent)))
    monkeypatch.setattr(clock, "BUDGET", 100.0)
    assert clock.fastest({"a": lambda: None}, rounds=4) == {"a": 1.0}
    calls: list[float] = []
    monkeypatch.undo()
    clock.fastest({"slow": lambda: calls.append(time.monotonic()) or time.sleep(0.6)})
    assert len(calls) == 3  # the warm-up, and two rounds that spend what a call may


def test_orders_of_radial_lobes() -> None:
    rows = {row[0]: row for row in radial_orders.radial_orders().rows}
    assert rows["Lambertian"][2:4] == (2, 0)
    assert rows["Lambertian"][6] == pytest.approx(1 / 128)  # 1 - (1/4 + 1/3 + 5/64) / (2/3)
    for s in (32, 512):
        assert rows[f"Phong, s = {s}"][5] == pytest.approx(1, abs=0.02)


def test_samples_per_order_are_where_the_error_of_bilinear_lookup_says() -> None:
    # one wave of degree F errs by (F pi / S)^2 / sqrt(120) in RMS along one axis, for small steps
    rows = {row[:3]: row[4] for row in sampling.samples_per_order().rows}
    assert rows["T", 8, 0.003] == pytest.approx(np.sqrt(10 / 3) * rows["T", 8, 0.01], rel=0.05)  # error ~ 1 / T^2
    assert rows["S", 20, 0.003] == pytest.approx(np.sqrt(10 / 3) * rows["S", 20, 0.01], rel=0.05)


def test_accuracy_and_its_estimates() -> None:
    study = accuracy.workshop()
    columns = {name: [row[i] for row in study.rows] for i, name in enumerate(study.columns)}
    assert all(columns["minimum is conservative"])
    assert all(columns["bound is conservative"])
    assert np.allclose(columns["accuracy"], columns["accuracy of a map"], atol=2e-3)  # coefficients against rendering
    assert columns["accuracy"][30] == 1


def test_nine_terms_lose_what_the_first_band_left_out_holds() -> None:
    study = irradiance.nine_terms()
    for _, average, largest, energy, in_four, held in study.rows:
        assert in_four <= 1.1 * energy  # and higher bands little
        assert energy <= 2 * in_four
        assert average <= largest
        assert held == pytest.approx(1 - 1 / 128)
