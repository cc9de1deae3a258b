"""Kernel benchmarks: each beside the bare library call or limit that it is held against, in one process, in turns.

Times are medians; a ratio is the median of the ratios of neighbouring runs, so that it holds when the machine's speed
drifts. ``./bench kernels`` prints the table at the end; results/kernels.json keeps all in pytest-benchmark's format.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from envbench import harmonics

Run = Callable[[], Any]


@pytest.fixture
def against(benchmark: Any) -> Callable[..., float]:
    """Time `ours` and `peer` in turns: ``against(ours, peer, "what the peer is", bar=1.5)`` returns ours / peer."""

    def measure(ours: Run, peer: Run, what: str, bar: float | None = None, rounds: int = 15) -> float:
        ours()
        peer()
        seconds = np.array([(_seconds(ours), _seconds(peer)) for _ in range(rounds)])
        ratio = float(np.median(seconds[:, 0] / seconds[:, 1]))
        benchmark.extra_info.update(
            peer=what, peer_median_s=float(np.median(seconds[:, 1])), ratio=ratio, threads=harmonics.threads()
        )
        if bar is not None:
            benchmark.extra_info["bar"] = bar
        benchmark.pedantic(ours, rounds=rounds, warmup_rounds=1)
        return ratio

    return measure


def _seconds(run: Run) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print what each kernel is held against."""
    session = getattr(config, "_benchmarksession", None)
    for bench in getattr(session, "benchmarks", []):
        terminalreporter.write_line(f"{bench.name}: median {1e3 * bench.stats.median:.3g} ms")
        for key, value in bench.extra_info.items():
            shown = f"{value:.4g}" if isinstance(value, float) else value
            terminalreporter.write_line(f"    {key.replace('_', ' ')}: {shown}")
