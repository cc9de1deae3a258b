"""An environment as Mitsuba's `envmap`: the same function of direction, exactly, on Mitsuba's own grid.

Mitsuba interpolates bilinearly too, but its rows sit at theta = pi i / (H' - 1), so that the poles are rows; its
columns sit at half pixels, run against +phi, and y is up. Our function is piecewise bilinear with its row knots at
theta = pi (i + 1/2) / H (`envbench.latlong`), and every grid whose knots include these reproduces it: with
H' = 2 H + 1 they are the odd rows. On the pole rows it has the mean of a sample and its half-turned partner, which
depends on the column. With W odd the partner lies between two columns, so the columns are doubled and the grid
turned by half a fine pixel, for all knots to be columns.

Mitsuba samples directions by bilinear interpolation of luminance times sin(theta) at its knots. That is zero on a pole
row, so the polar patches follow the next row alone, and where a sample is far darker than its half-turned partner they
would be drawn too seldom: never, if it is black (a single lit pixel beside a pole loses 3.8 % of its light). Then
H' = 4 H + 1 is taken, whose first inner row mixes both samples 3 : 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.environment import Environment

_POLAR_CONTRAST = 8.0
"""Ratio of half-turned partners beside a pole above which the finer grid is taken; it bounds eval / pdf there."""


def emitter(environment: Environment) -> dict[str, Any]:
    """Return the dictionary for ``mi.load_dict`` whose emitter is `environment`; a Mitsuba variant must be set.

    Its ``eval`` differs from ``environment(direction)`` by float32 rounding only: of the texture coordinate (relative
    to the map's slope, about 6e-8 (W + H)), and of acos near a pole.
    """
    import mitsuba as mi

    samples = environment.radiance
    odd = samples.shape[1] % 2 == 1
    if odd:
        samples = _doubled(samples)
    knots = _row_knots(samples[:, ::-1], 4 if _contrasting(samples[[0, -1]]) else 2)
    # (x, y, z) of Mitsuba's frame is our (-z, -x, y): y is up and u = 1 - phi / (2 pi).
    to_world = np.array([[0.0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    if odd:
        to_world = _turned(-np.pi / samples.shape[1]) @ to_world
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(knots),
        "to_world": mi.ScalarTransform4f(to_world.tolist()),
    }


def _doubled(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the map with columns at phi = 2 pi k / (2 W), k = 0 ... 2 W - 1."""
    between = np.float32(0.5) * (samples + np.roll(samples, 1, axis=1))
    return np.stack([between, samples], axis=2).reshape(samples.shape[0], -1, 3)


def _contrasting(pole_rows: NDArray[np.float32]) -> bool:
    """Whether a sample of the (2, W, 3) rows beside the poles is far darker than its half-turned partner."""
    luminance = pole_rows @ np.array([0.2126, 0.7152, 0.0722])
    partner = np.roll(luminance, luminance.shape[1] // 2, axis=1)
    return bool((partner > _POLAR_CONTRAST * luminance).any())


def _row_knots(samples: NDArray[np.float32], fineness: int) -> NDArray[np.float32]:
    """Interpolate rows at theta = pi k / (fineness H), k = 0 ... fineness H; W even."""
    height, width = samples.shape[:2]
    top, bottom = (np.roll(samples[[i]], width // 2, axis=1) for i in (0, -1))
    padded = np.concatenate([top, samples, bottom])
    knots = np.empty((fineness * height + 1, width, 3), np.float32)
    for k in range(fineness):
        rows = knots[k::fineness]
        first, f = divmod(k / fineness + 0.5, 1)
        above = padded[int(first) :][: len(rows)]
        below = padded[int(first) + 1 :][: len(rows)]
        rows[:] = np.float32(1 - f) * above + np.float32(f) * below
    return knots


def _turned(angle: float) -> NDArray[np.float64]:
    """Return the (4, 4) rotation about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
