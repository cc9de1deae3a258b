"""Facts of a BRDF: closed forms of albedo and reciprocity, warnings, and the lobe plot."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen import brdf_checks
from data_gen.lobes import Lambertian, Phong
from data_gen.measured.table import Table
from data_gen.measured.tabulated import Tabulated
from envbench.material import Material


def test_lambertian() -> None:
    facts = brdf_checks.check(Material("m", (Lambertian(reflectance=(0.2, 0.5, 0.9)),)))
    assert facts.reciprocity < 1e-12
    assert facts.negative == 0
    for row in facts.albedo:
        assert row[1:] == pytest.approx((0.2, 0.5, 0.9), abs=1e-12)
    assert [row[0] for row in facts.albedo] == list(brdf_checks.ALBEDO_DEGREES)
    assert brdf_checks.notes(facts) == ()


def test_whole_phong_integrates_to_one_and_is_not_reciprocal() -> None:
    facts = brdf_checks.check(Material("m", (Phong(exponent=64, clipped=False),)))
    for row in facts.albedo:
        assert row[1] == pytest.approx(1, abs=1e-3)
    # the lobe is symmetric in L and V, so f = lobe / N.L and its swap differ by the ratio of the cosines
    assert facts.reciprocity > 0.01
    assert "not reciprocal" in brdf_checks.notes(facts)[0]


def test_clipped_phong_keeps_half_at_grazing() -> None:
    """The albedo at 80 degrees against the horizon's share of the lobe: closed by a direct sum over the hemisphere."""
    facts = brdf_checks.check(Material("m", (Phong(exponent=20),)))
    x, w = np.polynomial.legendre.leggauss(300)
    theta, w = np.pi / 4 * (x + 1), w * np.pi / 4
    phi = 2 * np.pi * np.arange(400) / 400
    r = np.deg2rad(80)
    cosine = np.cos(theta)[:, None] * np.cos(r) + np.sin(theta)[:, None] * np.sin(r) * np.cos(phi)
    exact = np.sum(21 / (2 * np.pi) * np.maximum(cosine, 0) ** 20 * (np.sin(theta) * w)[:, None]) * 2 * np.pi / 400
    assert facts.albedo[-1][1] == pytest.approx(exact, abs=1e-3)


def test_a_constant_table_is_lambertian() -> None:
    table = Table("grey", np.full((4, 4, 4, 4), 1.2 / np.pi, np.float32), negative=0.25)
    facts = brdf_checks.check(Material("m", (Tabulated(table=table),)))
    assert facts.reciprocity < 1e-6
    assert facts.negative == 0.25
    for row in facts.albedo:
        assert row[1:] == pytest.approx((1.2, 1.2, 1.2), abs=2e-3)
    assert "gains energy: its albedo is 1.20" in brdf_checks.notes(facts)[0]


def test_slices_peak_at_the_mirror_direction() -> None:
    for angle, views, values in brdf_checks.slices(Material("m", (Phong(exponent=1000),))):
        assert len(views) == len(values)
        assert list(views) == sorted(views)
        assert views[int(np.argmax(values))] == pytest.approx(angle, abs=0.02)
        assert np.isfinite(values).all()
