"""Where a source map shows what the destination shows, and how far it is to be trusted there (Cabral et al. 1999, 3.3).

A point p_d of the destination shows a direction c, as a mirror ball does. For lobes about R (or T) c is that direction
and its source point is g_mirror^-1(c) in the source's frame; for lobes about N it is a normal, its source point is
g_normal^-1(c), and so the result must be looked up with n in place of r.

About R a source fails at the direction away from its own viewer, where its whole rim is one direction. Trust grows from
0 to 1 with the distance from that point, on the destination's disk, up to `fade`. About N it cannot show a normal that
faces away; trust grows with n.v up to `fade`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from envbench.arrays import namespace
from envbench.directions import Array
from methods.cabral import spheremap

UNTRUSTED = 1e-4
"""What remains of a weight without trust, so that a point that no source is trusted at has their plain blend."""
NOWHERE = 1e3
"""Where the singular point of a source lies that sees from the destination's own view: on no point of the disk."""


@dataclass(frozen=True, eq=False)
class Source:
    """One of the three views that are blended: its `weight`, the destination's frame in its own, its singular point."""

    weight: float
    turn: Array
    singular: tuple[float, float]


def source(view: Array, weight: float, destination: Array) -> Source:
    """Return the source seen from `view` (3,) for the frame (3, 3) of the destination."""
    turn = spheremap.frame(view).T @ destination
    away = -view @ destination
    x, y = spheremap.from_mirror((away[0], away[1], away[2]), (NOWHERE, NOWHERE))
    return Source(weight, turn, (float(x), float(y)))


def place(
    shown: spheremap.Vector, p: tuple[Any, Any], turn: Any, singular: tuple[Any, Any], by_normal: bool, fade: float
) -> tuple[Any, Any, Any]:
    """Return the point of a source that shows what the destination shows at `p`, and its trust in [0, 1]."""
    xp = namespace(shown[0])
    x, y, z = shown
    local = tuple(turn[i][0] * x + turn[i][1] * y + turn[i][2] * z for i in range(3))
    onto_rim = 1 / xp.sqrt(xp.maximum(p[0] * p[0] + p[1] * p[1], 1e-20))
    rim = (p[0] * onto_rim, p[1] * onto_rim)
    if by_normal:
        reliable, (s, t) = local[2], spheremap.from_normal((local[0], local[1], local[2]), rim)
    else:
        dx, dy = p[0] - singular[0], p[1] - singular[1]
        reliable, (s, t) = xp.sqrt(dx * dx + dy * dy), spheremap.from_mirror((local[0], local[1], local[2]), rim)
    trust = xp.minimum(xp.maximum(reliable / fade, 0.0), 1.0) if fade else 0 * x + 1
    return s, t, trust
