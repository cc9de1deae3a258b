"""Paths of many bounces in one loop of Dr.Jit: a lane begins its next path where one has ended.

So short paths do not wait for the longest one beside them.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

Draws = list[Any]
"""Samplers: of light and lobes, and beside it that of views and tangents averaged over, if any are."""

Step = Callable[..., tuple[Any, ...]]
"""From depth, whether there is a path, its throughput, interaction, place, totals and draws to those after a step."""

_A_THREAD, _ON_GPU = 2**15, 2**22
"""Lanes in flight: two of the blocks that a thread takes at a time."""


def in_flight(mi: Any) -> int:
    """Return how many lanes keep the machine busy, or more."""
    import drjit as dr

    return _ON_GPU if dr.backend_v(mi.Float) == dr.JitBackend.CUDA else _A_THREAD * dr.thread_count()


def shared(points: int, samples: int, most: int) -> int:
    """Return how many lanes share the samples of a point: of all points at `most` so many, if that is one a point."""
    each = samples & -samples
    while each > 1 and points * each > most:
        each //= 2
    return each


def paths(mi: Any, bounces: int, step: Step, si: Any, where: tuple[Any, ...], totals: list[Any], draws: Draws) -> Any:
    """Return the totals of paths that begin at `si` and `where`, each lane taking as many as its sampler says.

    A loop takes a `step` of a path at a time and begins the next path where one has ended.
    """
    import drjit as dr

    first, begun, many = si, where, draws[0].many

    def go_on(k: Any, depth: Any, through: Any, si: Any, where: Any, totals: Any, draws: Any) -> Any:
        depth, on, through, si, where, totals, draws = step(depth, mi.Bool(True), through, si, where, totals, draws)
        ended = ~on | (depth > bounces)

        def begin(start: Any, now: Any) -> Any:
            return dr.select(ended, start, now)

        for name in ("n", "wi", "uv"):
            setattr(si, name, begin(getattr(first, name), getattr(si, name)))
        axes = zip(*((frame.s, frame.t, frame.n) for frame in (first.sh_frame, si.sh_frame)), strict=True)
        si.sh_frame = mi.Frame3f(*itertools.starmap(begin, axes))
        for sampler in draws:
            sampler.begin(ended)
        where = tuple(map(begin, begun, where))
        return k + begin(1, 0), begin(0, depth), begin(mi.Color3f(1), through), si, where, totals, draws

    state = mi.UInt32(0), mi.UInt32(0), mi.Color3f(1), mi.SurfaceInteraction3f(si), where, totals, draws
    return dr.while_loop(state, lambda k, *_: k < many, go_on)[5]
