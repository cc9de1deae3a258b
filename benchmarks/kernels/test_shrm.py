"""SHRM beside the least work that it could be: the dynamic map of equation 12, and the expansion of a lobe."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from data_gen.lobes import Microfacet
from envbench.environment import Environment
from envbench.geometry import Geometry, Viewer
from envbench.material import Material
from methods.shrm import SHRMGlobal
from methods.shrm.coefficients import captured

Against = Callable[..., float]


def test_dynamic_map(against: Against, benchmark: Any) -> None:
    """Eq. 12 into 64 x 64 x 6 texels, P = 3, RGB, float32: bar 1.5 x one BLAS product over the same bytes."""
    method = SHRMGlobal(order=24, view_order=3, size=64)
    light = Environment("noise", np.random.default_rng(0).random((64, 128, 3)).astype(np.float32))
    prepared = method.prepare(Material("microfacet", (Microfacet(sigma=0.1, clipped=False),)), Geometry("sphere"))
    relit = method.relight(prepared, light)
    viewer = Viewer(direction=(0.0, 0.6, 0.8))
    same = np.random.default_rng(1).random((16, 3 * 6 * 64 * 64), np.float32)
    weights = np.ones(16, np.float32)

    against(lambda: method.frame(relit, viewer), lambda: weights @ same, "weights (16,) @ map (16, 73728)", bar=1.5)
    benchmark.extra_info["frames_per_second"] = 1 / benchmark.stats.stats.median


def test_expansion_for_a_survey(benchmark: Any) -> None:
    """Captured energy at F = 30, P = 0 ... 5 of one lobe: bar 0.15 s."""
    benchmark.pedantic(lambda: captured(Microfacet(sigma=0.2), 30, 5), rounds=5, warmup_rounds=1)
    benchmark.extra_info["seconds_bar"] = 0.15
