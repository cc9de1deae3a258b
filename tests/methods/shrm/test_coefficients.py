"""Expansion of lobes: q = 0 forms, three channels, narrow lobes in closed form, sums of lobes, orders within bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from data_gen.lobes import KajiyaKay, Lambertian, Microfacet, Phong
from data_gen.materials import MATERIALS, build
from methods.shrm import maps
from methods.shrm.coefficients import MAX_F, MAX_TERMS, captured, energies, expand, pooled, together
from methods.shrm.legendre import associated
from methods.shrm.spectrum import spectrum


def test_associated_legendre_functions_are_scipys() -> None:
    theta = np.array([1e-9, 0.01, 0.7, 1.6, 3.1, np.pi])
    exact = special.sph_legendre_p_all(60, 8, theta)[0][:, :9]
    assert np.allclose(np.swapaxes(associated(60, 8, theta), 0, 1), exact, rtol=0, atol=1e-11)


def test_kajiya_kay_needs_only_q_0() -> None:
    """RH 2002, sec. 7.1: s = 32, P = 8 for eps < .03; recomputed independently at F = 30: .0267, in P + 1 maps."""
    found = expand(KajiyaKay(exponent=32), 0.03, 30, 8)
    assert found.missing == pytest.approx(0.0267, abs=2e-4)
    assert (found.Q, maps.planes(found.P, found.F, found.Q)) == (0, 9)
    assert expand(KajiyaKay(exponent=32), 0.03).P == 8


def test_lafortune_skin_at_p_4() -> None:
    """Whole BRDF about R, pooled over RGB: .0287 at F = 30, P = 4, recomputed independently (conventions)."""
    (lobe,) = build(MATERIALS["lafortune-skin"], "skin").lobes
    assert lobe.channels == 3
    assert 1 - captured(lobe, 30, 4)[4] == pytest.approx(0.0287, abs=0.001)


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.2), Phong(exponent=8), KajiyaKay(exponent=32)], ids=repr)
def test_captured_is_what_expand_does_not_miss(lobe: Microfacet) -> None:
    held = captured(lobe, 12, 3)
    assert held == pytest.approx([1 - expand(lobe, 0.01, 12, P).missing for P in range(4)], abs=1e-12)
    assert np.all(np.diff(held) >= 0)


@pytest.mark.parametrize("exponent", [1e3, 1e4, 1e5])
def test_orders_of_narrow_phong_lobes(exponent: float) -> None:
    """Whole, F = sqrt(-s log eps) (RH 2002, app. D), for s far above 1; within one degree and 1 %."""
    found = expand(Phong(exponent=exponent, clipped=False), 0.01)
    assert pytest.approx(np.sqrt(-exponent * np.log(0.01)), rel=0.01, abs=1) == found.F
    assert found.missing <= 0.01


def test_energy_in_closed_form() -> None:
    """Whole Phong: 4 pi times int rho^2 = (s + 1)^2 / (2 pi (2 s + 1)); Parseval over all degrees gives it back."""
    for s in (8.0, 512.0):
        found = expand(Phong(exponent=s, clipped=False), 1e-9, order=200)
        exact = 3 * 4 * np.pi * (s + 1) ** 2 / (2 * np.pi * (2 * s + 1))
        assert found.total == pytest.approx(exact, rel=1e-8)  # what the lobe's own series is good to
        weight = pooled(Phong(exponent=s))
        assert energies(found.full, weight).sum() == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.3, clipped=False), KajiyaKay(exponent=32)], ids=repr)
def test_parseval_by_degree_and_by_view(lobe: Microfacet) -> None:
    """The energy of a degree over all views is that of all its terms p: what P leaves out is seen exactly."""
    seen, weight = spectrum(lobe, 20, 12), pooled(lobe)
    by_p = energies(seen.by_view(40), weight)
    assert seen.energies(weight).sum() == pytest.approx(by_p.sum(), rel=1e-3)  # P = 40 itself leaves that out
    assert np.all(by_p.sum(1) <= seen.energies(weight) * (1 + 1e-9))


def test_clipping_along_the_horizon_converges() -> None:
    """int rho^2 of a clipped lobe against a fine midpoint rule, which errs by a cell at the horizon, about 1 / 2000."""
    lobe = Phong(exponent=8)
    seen = spectrum(lobe, 8, 2)
    i = int(np.argmin(np.abs(np.arccos(seen.cosines) - 2.4)))  # a view whose horizon cuts the lobe
    theta_o = np.arccos(seen.cosines[i])
    theta, phi = ((np.arange(n) + 0.5) * np.pi / n for n in (2000, 4000))
    t, p = np.meshgrid(theta, phi, indexing="ij")
    above = np.cos(t) * np.cos(theta_o / 2) + np.sin(t) * np.cos(p) * np.sin(theta_o / 2) > 0
    rho = 9 / (2 * np.pi) * np.maximum(np.cos(t), 0) ** 8 * above
    exact = 2 * np.sum(rho**2 * np.sin(t)) * np.pi**2 / 8e6
    assert seen.energy[0, i] == pytest.approx(exact, rel=1 / 2000)


def test_lobes_about_one_centre_are_summed() -> None:
    narrow, wide = expand(Phong(exponent=20, clipped=False), 0.01), expand(Microfacet(), 0.01, view_order=3)
    both = together([narrow, wide])
    assert (max(narrow.F, wide.F), 3) == (both.F, both.P)
    assert both.rho[0, 2, 0, 0] == pytest.approx(np.sqrt(5) * narrow.rho[0, 2, 0, 0] + wide.rho[0, 2, 0, 0])
    assert together([narrow]) is narrow


def test_orders_stay_within_what_can_be_stored() -> None:
    """A clipped mirror-like lobe cannot be met: the best orders within the bound, and what they lack is told."""
    found = expand(build(MATERIALS["ggx"], "ggx").lobes[0], 0.03)
    assert (found.F + 1) ** 2 * (found.P + 1) ** 2 <= MAX_TERMS
    assert found.F <= MAX_F
    assert 0.03 < found.missing < 0.1


def test_view_order_means_nothing_to_a_radial_lobe() -> None:
    assert expand(Lambertian(), 0.01, order=4, view_order=5).rho.shape == (1, 5, 1, 1)
