"""Angular prefiltering: lobe evaluations a second inside the cone, and how much less a narrow lobe costs.

The bars, on two cores: Phong s = 8, 128 x 128 from 128 x 128, eps = .05 at 0.4 G evaluations a second or more; s = 512
at least 8 times faster than s = 8 (its cone is 48 times smaller).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from data_gen.lobes import Phong
from envbench import latlong
from envbench.directions import uniform
from methods.angular.prefilter import prefilter, prefilter_at

SIZE = 128
EPS = 0.05
BAR_EVALUATIONS = 0.4e9
BAR_RATIO = 8.0


def evaluations(lobe: Phong) -> int:
    """Count the light's texels inside the cone, summed over all texels of the map."""
    texels = latlong.grid(SIZE, SIZE).reshape(-1, 3)
    inside = (int(np.count_nonzero(texels @ c >= np.cos(lobe.cone(EPS)))) for c in latlong.grid(SIZE, SIZE)[:, 0])
    return SIZE * sum(inside)  # all columns of a row see as many


def prefiltering(exponent: float) -> tuple[Phong, partial[Any]]:
    radiance = np.random.default_rng(0).uniform(0, 1, (SIZE, SIZE, 3)).astype(np.float32)
    lobe = Phong(exponent=exponent, clipped=False)
    return lobe, partial(prefilter, radiance, lobe, (SIZE, SIZE), EPS)


def test_prefilter(benchmark: Any) -> None:
    """Phong s = 8, whole; beside it s = 512."""
    wide, run_wide = prefiltering(8)
    narrow, run_narrow = prefiltering(512)
    run_narrow()
    narrow_seconds = []
    for _ in range(10):
        start = time.perf_counter()
        run_narrow()
        narrow_seconds.append(time.perf_counter() - start)
    benchmark.pedantic(run_wide, rounds=10, warmup_rounds=1)
    seconds = benchmark.stats.stats.median
    rate = evaluations(wide) / seconds
    ratio = seconds / float(np.median(narrow_seconds))
    benchmark.extra_info.update(
        evaluations=evaluations(wide),
        evaluations_per_second=rate,
        rate_over_bar=rate / BAR_EVALUATIONS,
        narrow_evaluations=evaluations(narrow),
        narrow_seconds=float(np.median(narrow_seconds)),
        speedup_of_s_512_over_s_8=ratio,
        speedup_over_bar=ratio / BAR_RATIO,
    )


def test_prefilter_at(against: Callable[..., float]) -> None:
    """Phong s = 8 at random directions, beside as many texels of one map: what lanes that walk unlike cost."""
    lobe, run = prefiltering(8)
    radiance = np.random.default_rng(0).uniform(0, 1, (SIZE, SIZE, 3)).astype(np.float32)
    centre = uniform(SIZE * SIZE, np.random.default_rng(1))
    against(partial(prefilter_at, radiance, lobe, centre, centre, centre, EPS), run, "prefilter, a map", rounds=7)
