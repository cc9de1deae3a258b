"""Any BRDF as a table: its values at the nodes, and how far the table is from it between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from data_gen import quasirandom
from data_gen.measured.table import Table, coordinates, directions
from envbench.directions import Array, from_angles

Function = Callable[[Array, Array], Array]
"""f(L, V) in 1/sr, (n, 3), for directions (n, 3) with N = z; may be negative."""

Shapes = Sequence[tuple[int, int, int]]
SHAPES: Shapes = ((64, 46, 31), (96, 64, 31), (256, 64, 31))
"""Nodes over (t, d, p): 1.5, 3 and 8 MB."""
TOLERANCE = 0.01
"""Error of the table (`Fidelity.error`) at which a grid is fine enough."""
PAIRS = 4096
HORIZON = 1e-3
"""Cosine of 89.94 degrees."""


@dataclass(frozen=True)
class Fidelity:
    """How a table stands to the function that it was made of, over cosine-weighted pairs of directions.

    Attributes
    ----------
    error : float
        RMS of the difference over the RMS of the function, r, g and b pooled.
    asymmetry : float
        The same for what taking the mean of f and its mirror image changed.
    negative : float
        Share of the pairs with a negative channel, clamped to 0.
    lost : float
        Negative energy, as a part of the positive.
    """

    error: float
    asymmetry: float
    negative: float
    lost: float


def tabulate(
    name: str, function: Function, *, symmetric: bool = False, horizon: float = HORIZON, shapes: Shapes = SHAPES
) -> tuple[Table, Fidelity]:
    """Evaluate the mean of f and its mirror image at the nodes of a grid, negative values clamped to 0.

    The grid is the coarsest of `shapes` whose error is at most `TOLERANCE`, or the last. A node with L or V below the
    horizon takes the value at the nearest d that is above it: only interpolation across the horizon reads it.

    Parameters
    ----------
    symmetric : bool
        The function is its own mirror image: it need not be evaluated twice.
    horizon : float
        Least cosine of L and V to N that the function is asked for; nearer the horizon f stays as it is there.
    """
    light, view = pairs()
    kept = np.minimum(light[:, 2], view[:, 2]) >= horizon
    light, view = light[kept], view[kept]
    f, odd = _mirrored(function, light, view)
    positive = np.maximum(f, 0)
    scale = _rms(positive) or 1.0
    negative = float(np.mean((f < 0).any(-1)))
    table, error = Table(name, np.zeros((2, 2, 2, 4), np.float32), negative), np.inf
    for shape in shapes:
        if error <= TOLERANCE:
            break
        t, d, p = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
        nodes = tuple(v.reshape(-1, 3) for v in directions(t, _above(t, d, p, horizon), p))
        at_nodes = function(*nodes) if symmetric else _mirrored(function, *nodes)[0]
        values = np.zeros((*shape, 4), np.float32)
        values[..., :3] = np.maximum(at_nodes, 0).reshape(*shape, 3)
        table = Table(name, values, negative)
        got = np.stack(table.lookup(*coordinates(light.T, view.T, np.array([0.0, 0.0, 1.0]))), -1)
        error = _rms(got - positive) / scale
    lost = float((positive - f).sum() / max(positive.sum(), 1e-300))
    return table, Fidelity(error, _rms(odd) / scale, negative, lost)


def pairs(count: int = PAIRS) -> tuple[Array, Array]:
    """Return `count` pairs of cosine-weighted directions, (count, 3) each, well spread."""
    u = quasirandom.points(count, 4)
    light, view = (from_angles(np.arccos(np.sqrt(u[k])), 2 * np.pi * u[k + 1]) for k in (0, 2))
    return light, view


def _mirrored(function: Function, light: Array, view: Array) -> tuple[Array, Array]:
    """Return the mean of f and its mirror image (y to -y), and half their difference."""
    mirror = np.array([1.0, -1.0, 1.0])
    f, image = function(light, view), function(light * mirror, view * mirror)
    return (f + image) / 2, (f - image) / 2


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _above(t: Array, d: Array, p: Array, horizon: float) -> Array:
    """Return d, reduced where L or V would not be above the horizon.

    The lower of them has z = a cos theta_d - b sin theta_d = r cos(theta_d + atan2(b, a)), with a = cos theta_h and
    b = sin theta_h |cos phi_d|.
    """
    theta_h, c = np.arctan2(t**2, 1 - t**2), np.abs(1 - 2 * p)
    a, b = np.cos(theta_h), np.sin(theta_h) * c / np.hypot(c, 1 - c)
    highest = np.arccos(np.minimum(horizon / np.maximum(np.hypot(a, b), 1e-30), 1)) - np.arctan2(b, a)
    highest = np.maximum(highest, 0)
    return np.minimum(d, 1 - np.sqrt(np.cos(highest) / (np.sin(highest) + np.cos(highest))))
