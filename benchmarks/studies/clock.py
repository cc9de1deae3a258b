"""Medians of seconds of many calls, timed in turns so that a slow moment of the machine meets all of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any, TypeVar

import numpy as np

from envbench.timing import timed

K = TypeVar("K", bound=Hashable)

BUDGET = 0.5
"""Seconds that the rounds of a call may take, but for the first two."""


def medians(runs: Mapping[K, Callable[[], Any]], rounds: int = 15) -> dict[K, float]:
    """Return the median seconds of each call after a first one that warms up.

    Calls are timed in turns, every other round backwards; those that take long have fewer rounds (`BUDGET`).
    """
    for run in runs.values():
        timed(run)
    seconds: dict[K, list[float]] = {name: [] for name in runs}
    for number in range(rounds):
        for name in list(runs)[:: -1 if number % 2 else 1]:
            if number < 2 or sum(seconds[name]) < BUDGET:
                seconds[name].append(timed(runs[name])[1])
    return {name: float(np.median(taken)) for name, taken in seconds.items()}
