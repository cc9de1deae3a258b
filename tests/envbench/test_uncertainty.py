"""Estimates and intervals against the definition spelled out, and against simulated replicates."""

import numpy as np
import pytest
from scipy import stats

from envbench.uncertainty import Estimate, difference, mean, square

P = 1e-4  # chance of a false alarm of each statistical test


def obvious(d):
    """The unbiased mean square, as CONVENTIONS.md words it."""
    return np.mean(d.mean(0) ** 2 - d.var(0, ddof=1) / len(d))


def test_square_is_the_definition_and_so_is_every_leave_one_out_value():
    d = 0.3 + np.random.default_rng(0).standard_normal((8, 50))
    estimate = square(d @ d.T / 50)
    without = [obvious(np.delete(d, k, 0)) for k in range(8)]
    # Sums of 8 x 50 terms of order 1 in float64.
    np.testing.assert_allclose([estimate.value, *estimate.jackknife], [obvious(d), *without], rtol=0, atol=1e-13)


def test_interval_of_a_mean_is_students():
    x = np.random.default_rng(1).standard_normal(8)
    oracle = stats.t.interval(0.95, 7, x.mean(), stats.sem(x))
    np.testing.assert_allclose(mean(x).interval, oracle, rtol=1e-12)


def simulate(K, variances, snr, runs, seed=0):
    """Errors against K replicates: noise along orthogonal directions, the true error along the first of them."""
    rng = np.random.default_rng(seed)
    error = np.zeros(len(variances))
    error[0] = snr * np.sqrt(variances[0] / K)
    noise = np.sqrt(variances) * rng.standard_normal((runs, K, len(variances)))
    return np.sum(error**2), [square(d @ d.T) for d in error - noise]


@pytest.mark.parametrize("snr", [0, 1, 5])
def test_square_is_unbiased(snr):
    truth, estimates = simulate(8, np.ones(5), snr, 2000)
    values = np.array([e.value for e in estimates])
    assert abs(values.mean() - truth) < stats.norm.isf(P / 2) * values.std() / np.sqrt(2000)


NOISE = {"one direction": np.ones(1), "two": np.ones(2), "falling": 1 / np.arange(1, 40) ** 2.0, "many": np.ones(100)}


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("K", [8, 16])
@pytest.mark.parametrize("snr", [0, 1.5, 2.5, 5])
def test_interval_of_a_square_covers(noise, K, snr):
    runs = 800
    truth, estimates = simulate(K, NOISE[noise], snr, runs)
    covered = sum(low <= truth <= high for low, high in (e.interval for e in estimates))
    assert covered >= stats.binom.ppf(P, runs, 0.93)


def test_without_the_curvature_it_would_not():
    truth, estimates = simulate(16, np.ones(1), 1.5, 800)
    plain = [Estimate(e.value, e.jackknife).interval for e in estimates]
    assert sum(low <= truth <= high for low, high in plain) < stats.binom.ppf(P, 800, 0.93)


def test_difference_of_two_squares_covers_exactly_at_the_floor_and_above():
    rng = np.random.default_rng(3)
    runs, covered = 2000, 0
    a, b = np.zeros(20), np.zeros(20)
    a[0], b[:2] = 0.5, 0.3
    for noise in rng.standard_normal((runs, 8, 20)):
        first, second = (square((e - noise) @ (e - noise).T).jackknife for e in (a, b))
        low, high = difference(first, second)
        covered += low <= np.sum(a**2) - np.sum(b**2) <= high
    assert stats.binom.ppf(P, runs, 0.95) <= covered <= stats.binom.isf(P, runs, 0.95)


def test_without_noise_the_interval_is_a_point():
    estimate = square(np.full((8, 8), 0.25))
    assert estimate.value == pytest.approx(0.25, rel=1e-14)
    assert estimate.interval == pytest.approx((0.25, 0.25), rel=1e-12)
