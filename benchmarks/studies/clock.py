"""What calls cost: the fastest of rounds in turns, for what other work on a machine does to a time only adds to it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any, TypeVar

from envbench.timing import timed

K = TypeVar("K", bound=Hashable)

BUDGET = 1.0
"""Seconds that the rounds of a call may take, but for the first two."""


def fastest(runs: Mapping[K, Callable[[], Any]], rounds: int = 25) -> dict[K, float]:
    """Return the least seconds of each call after a first one that warms up.

    Calls are timed in turns, every other round backwards; those that take long have fewer rounds (`BUDGET`).
    """
    for run in runs.values():
        timed(run)
    seconds: dict[K, list[float]] = {name: [] for name in runs}
    for number in range(rounds):
        for name in list(runs)[:: -1 if number % 2 else 1]:
            if number < 2 or sum(seconds[name]) < BUDGET:
                seconds[name].append(timed(runs[name])[1])
    return {name: min(taken) for name, taken in seconds.items()}
