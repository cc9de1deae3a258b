"""Explicit forms by way of SHRM against the same forms by hemispherical integration, both on all threads.

The bar: T x T maps of the simplified microfacet model, sigma = .2, S = 128, light of 128 rows, at least 50 times faster
by way of SHRM. Both leave the paper's eps = .05 of the BRDF out: of its energy here, of its integral there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from data_gen.lobes import Microfacet
from envbench import harmonics
from envbench.environment import Environment
from methods.angular.prefilter import prefilter
from methods.kautz_mccool.average import averaged
from methods.kautz_mccool.texture import summed, synthesised
from methods.shrm import explicit, maps
from methods.shrm.coefficients import LobeCoefficients, expand

ROWS = 128
EPS = 0.05
PER_ORDER = 10
"""T / P, the paper's rule."""
BAR = 50.0


def noise() -> Environment:
    """White noise costs what any light does."""
    return Environment("noise", np.random.default_rng(0).random((ROWS, 2 * ROWS, 3)).astype(np.float32))


def tabulated(lobe: LobeCoefficients, light: Environment, directions: int) -> Any:
    """Analyse the light, create the SHRM and tabulate it: all that a change of light costs."""
    planes = maps.synthesise(lobe, harmonics.analyse(light.radiance, lobe.F), ROWS)
    return explicit.views(lobe, planes, directions)


def seconds(run: Callable[[], Any], rounds: int) -> float:
    """The median over `rounds`, after one run to compile."""
    run()
    taken: list[float] = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        taken.append(time.perf_counter() - start)
    return float(np.median(taken))


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3, 0.4, 0.5])
def test_t_by_t_maps(sigma: float, benchmark: Any) -> None:
    """S = 128, T = 10 P. Integration is timed on every 16th row and column of the maps, and multiplied by 256."""
    light, lobe, part = noise(), Microfacet(sigma=sigma, clipped=False), 16
    coefficients = expand(lobe, EPS)
    directions = PER_ORDER * coefficients.P
    shape = (ROWS // part, 2 * ROWS // part)
    integration = part**2 * seconds(partial(prefilter, light.radiance, lobe, shape, EPS, directions), 3)
    benchmark.pedantic(partial(tabulated, coefficients, light, directions), rounds=5, warmup_rounds=1)
    speedup = integration / benchmark.stats.stats.median
    benchmark.extra_info.update(
        F=coefficients.F,
        P=coefficients.P,
        T=directions,
        MiB=ROWS * 2 * ROWS * directions**2 * 12 / 2**20,
        integration_seconds=integration,
        speedup=speedup,
        threads=harmonics.threads(),
    )
    if sigma == 0.2:
        benchmark.extra_info.update(bar=BAR, speedup_over_bar=speedup / BAR)


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3, 0.4, 0.5])
def test_3d_texture(sigma: float, benchmark: Any) -> None:
    """Kautz and McCool's texture, S = 128, T = 16, lobe averaged beforehand; every 4th row and column integrated."""
    light, lobe, part = noise(), Microfacet(sigma=sigma, clipped=False), 4
    average = averaged(lobe, 16, shifted=False, order=63)
    F = expand(lobe, EPS).F
    zonal = average.zonal(F)
    integration = part**2 * seconds(partial(summed, average, light.radiance, ROWS // part, EPS), 3)

    def by_shrm() -> Any:
        return synthesised(zonal, harmonics.analyse(light.radiance, F), ROWS)

    benchmark.pedantic(by_shrm, rounds=5, warmup_rounds=1)
    benchmark.extra_info.update(
        F=F,
        integration_seconds=integration,
        speedup=integration / benchmark.stats.stats.median,
        threads=harmonics.threads(),
    )
