"""Clocks: a call is over when all that it started is done, on whatever threads."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def timed(call: Callable[[], T]) -> tuple[T, float]:
    """Return what `call` returns and its wall seconds, Dr.Jit synchronised before and after, no garbage collected."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        synchronise()
        start = time.perf_counter()
        value = call()
        synchronise()
        return value, time.perf_counter() - start
    finally:
        if collecting:
            gc.enable()


def synchronise() -> None:
    """Wait until Dr.Jit, if this process has loaded it, has computed all that it was asked for."""
    drjit = sys.modules.get("drjit")
    if drjit is not None:
        drjit.sync_thread()


def threads() -> dict[str, int]:
    """Return the threads that each loaded library computes with, by name; `transforms` are those of `harmonics`."""
    from threadpoolctl import threadpool_info

    from envbench import harmonics

    counts = {str(pool["internal_api"]): int(pool["num_threads"]) for pool in threadpool_info()}
    drjit = sys.modules.get("drjit")
    if drjit is not None:
        counts["drjit"] = int(drjit.thread_count())
    return counts | {"transforms": harmonics.threads()}
