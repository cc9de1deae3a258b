"""Bounds of probes hold as often as they claim, where contributions are sparse and where noise is all there is."""

from __future__ import annotations

import numpy as np
import pytest

from envbench.directions import Array
from references.effects.probe import REPLICATES, noise_bound, point_bound

TRIALS = 200
WRONG = 8
"""Of 200 trials that fail with a chance of 1 %, more than 8 fail with one of 2e-4 (binomial)."""


def made(rng: np.random.Generator, share: float, height: float, noise: float, n: int) -> tuple[Array, Array, float]:
    """Return differences and full radiance, (K, n, 3), and the true contribution; few points differ much."""
    differs = np.where(rng.random(n) < share, height, 0.0) * rng.lognormal(0, 0.5, n)
    full = 1 + 0.3 * rng.standard_normal(n)
    shape = (REPLICATES, n, 3)
    d = differs[:, None] + noise * rng.standard_normal(shape) * rng.lognormal(-0.5, 1, (1, n, 1))
    f = full[:, None] + 0.1 * rng.standard_normal(shape)
    return d, f, float(np.sqrt((differs**2).mean() / (full**2).mean()))


@pytest.mark.parametrize(
    ("share", "height", "noise"), [(0.0, 0.0, 0.3), (0.01, 0.1, 0.02), (0.003, 0.5, 0.1), (1.0, 0.01, 0.1)]
)
def test_all_points(share: float, height: float, noise: float) -> None:
    rng = np.random.default_rng(int(1000 * share) + 1)
    low = high = 0
    for _ in range(TRIALS):
        difference, full, truth = made(rng, share, height, noise, 400)
        bound = noise_bound(difference, full, np.full(400, 1 / 400))
        low, high = low + (bound.low > truth), high + (bound.high < truth)
    assert high <= WRONG
    assert low <= WRONG


@pytest.mark.parametrize(("share", "height"), [(0.0, 0.0), (0.002, 1.0), (0.02, 0.5), (0.3, 0.2), (1.0, 0.02)])
def test_some_points(share: float, height: float) -> None:
    """The truth is that of 20,000 points, 300 of which are looked at."""
    rng = np.random.default_rng(int(1000 * share) + 2)
    low = high = 0
    difference, full, truth = made(rng, share, height, 0.02, 20_000)
    for _ in range(TRIALS):
        some = rng.integers(20_000, size=300)
        bound = point_bound(difference[:, some], full[:, some], full[:, some] - difference[:, some])
        low, high = low + (bound.low > truth), high + (bound.high < truth)
    assert high <= WRONG
    assert low <= WRONG


def test_what_was_not_seen_may_be_there() -> None:
    """No difference among 300 points still allows for one at 4.6 of 300, for a wholly dark point is possible."""
    full = np.ones((REPLICATES, 300, 3))
    bound = point_bound(0 * full, full, full)
    assert bound.value == 0
    assert bound.high == pytest.approx(np.sqrt(-np.log(0.01) / 300), rel=0.1)
