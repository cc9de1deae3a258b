"""Transforms of light: against direct integration of the bilinear function, and SciPy's harmonics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from envbench import harmonics, latlong
from envbench.directions import uniform
from envbench.errors import BadInput


def integrated(samples: np.ndarray, order: int, cuts: int = 12) -> np.ndarray:
    """L_lm of the bilinear function, slow and obvious: Gauss-Legendre on `cuts` parts of every cell."""
    height, width = samples.shape[:2]
    x, w = np.polynomial.legendre.leggauss(cuts)
    knots = np.concatenate([[0], np.pi * (np.arange(height) + 0.5) / height, [np.pi]])
    theta = (knots[:-1, None] + (x + 1) / 2 * np.diff(knots)[:, None]).ravel()
    w_theta = (w / 2 * np.diff(knots)[:, None]).ravel() * np.sin(theta)
    phi = (2 * np.pi * (np.arange(2 * width)[:, None] / 2 + (x + 1) / 4) / width).ravel()
    w_phi = np.tile(w * np.pi / width / 2, 2 * width)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    values = latlong.interpolate(samples, np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1))
    l, m = harmonics.degrees(order)
    weighted = values * (w_theta[:, None] * w_phi)[..., None]
    return np.stack(
        [np.einsum("ijc,ij->c", weighted, special.sph_harm_y(a, b, t, p).conj()) for a, b in zip(l, m, strict=True)], -1
    )


@pytest.mark.parametrize(("height", "width"), [(2, 4), (3, 5), (8, 16), (15, 31), (12, 12)])
def test_analysis_is_the_integral_of_the_bilinear_function(height: int, width: int) -> None:
    """White noise is the worst light there is: all of its energy lies at the map's own scale."""
    samples = np.random.default_rng(height).random((height, width, 3))
    order = 3
    got, exact = harmonics.analyse(samples, order), integrated(samples, order)
    # the taps err by x^6 / 7560 at x = F pi / H <= 1; the fold of detail beyond a row's band by about 1 / H^2
    assert np.abs(got - exact).max() < 2e-3 * np.abs(exact).max()


def test_detail_does_not_leak_into_low_degrees() -> None:
    """One bright pixel: L_lm at low degree is that of a point, whatever the order asked for."""
    samples = np.zeros((64, 128, 1))
    samples[20, 17] = 1e4
    low, high = harmonics.analyse(samples, 4), harmonics.truncate(harmonics.analyse(samples, 20), 20, 4)
    assert np.abs(low - high).max() < 1e-10 * np.abs(high).max()
    exact = integrated(samples[:, :, :], 4, cuts=3)
    assert np.abs(low - exact).max() < 2e-4 * np.abs(exact).max()


def test_synthesis_is_the_sum_of_scipys_harmonics() -> None:
    rng = np.random.default_rng(0)
    order, directions = 7, uniform(50, rng)
    l, m = harmonics.degrees(order)
    alm = rng.normal(size=(1, len(l))) + 1j * rng.normal(size=(1, len(l))) * (m > 0)
    theta, phi = np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0]) % (2 * np.pi)
    terms = alm[0][:, None] * special.sph_harm_y(l[:, None], m[:, None], theta, phi)
    exact = (terms.real * np.where(m == 0, 1, 2)[:, None]).sum(0)
    got = harmonics.synthesise_at(alm, order, np.stack([theta, phi], -1), 1e-10)[0]
    assert np.allclose(got, exact, atol=1e-8 * np.abs(exact).max())


def test_constant_light_has_degree_zero_alone() -> None:
    alm = harmonics.analyse(np.full((16, 32, 3), 2.0), 6)
    expected = np.zeros_like(alm)
    expected[:, 0] = 2 * np.sqrt(4 * np.pi)
    assert np.allclose(alm, expected, atol=1e-12)


def test_negative_order_is_refused() -> None:
    with pytest.raises(BadInput, match="Got -1"):
        harmonics.analyse(np.zeros((4, 8, 3)), -1)
