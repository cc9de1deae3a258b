"""Samples by what noise calls for: never dearer than the same everywhere, and the goal is reached."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.lobes import Lambertian
from data_gen.mitsuba_estimator import Estimator, Surface
from envbench.environment import Environment
from envbench.material import Material
from references.allocation import MOST, Part, planned

N = 50


def parts(light: Environment, costs: tuple[float, ...]) -> list[Part]:
    surface = Surface(Material("test", (Lambertian(),)), None)
    made = [Part(Estimator(surface, light), np.full(N, 64)) for _ in costs]
    for part, cost in zip(made, costs, strict=True):
        part.cost, part.order = cost, 0.5
    return made


def test_noise_is_bought_where_it_is_cheap(lit: Environment) -> None:
    """Two parts, one dear and quiet: the cost is near (sum sqrt(V c))^2, what continuous samples would take."""
    made = parts(lit, (1.0, 10.0))
    rng = np.random.default_rng(1)
    powers = [rng.uniform(0.5, 2, N) / N, 0.02 * rng.uniform(0.5, 2, N) / N]
    goal = 0.1
    samples, noise = planned(made, powers, goal, np.inf)
    assert noise <= goal
    cost = sum(part.cost * float(s.sum()) for part, s in zip(made, samples, strict=True))
    variances = [power * 64 for power in powers]
    best = sum(np.sqrt(v * p.cost).sum() for v, p in zip(variances, made, strict=True)) ** 2 / goal**2
    assert best * 0.9 < cost < best * 1.6  # in powers of four
    together = sum(float(v.sum()) for v in variances) / goal**2 * 11 * N
    assert cost < together / 3


def test_what_cannot_be_paid_is_not_planned(lit: Environment) -> None:
    made = parts(lit, (1.0,))
    samples, noise = planned(made, [np.full(N, 1 / N)], 1e-3, 1000.0 * N)
    assert samples[0].sum() <= 1000 * N
    assert noise > 1e-3
    samples, _ = planned(made, [np.full(N, 1e6)], 1e-9, np.inf)
    assert samples[0].max() == MOST


@pytest.mark.parametrize("power", [0.0, 1e-12])
def test_what_has_no_noise_takes_the_least(lit: Environment, power: float) -> None:
    made = parts(lit, (1.0, 3.0))
    samples, noise = planned(made, [np.full(N, power), np.zeros(N)], 0.1, np.inf)
    assert all((s == 16).all() for s in samples)
    assert noise <= 0.1
