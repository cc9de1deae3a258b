"""Heights of texture patches: h(s, t) in [0, 1] over a tile, s and t of period 1."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from envbench.directions import Array

Relief = Callable[[Array, Array], Array]

STEP = 1e-5
"""Step of the central differences: their error is about 1e-9 of the relief's height."""


def bumps(s: Array, t: Array) -> Array:
    """One round bump a tile, sin^2(pi s) sin^2(pi t)."""
    return (np.sin(np.pi * s) * np.sin(np.pi * t)) ** 2


def weave(s: Array, t: Array) -> Array:
    """Plain weave of two by two threads, the upper of which is seen.

    Threads along t have the cross-section |S|, S = sin 2 pi s, and lie at (1 + sign(S) T) / 2, T = sin 2 pi t, by turns
    over and under those along s: heights (|S| + S T) / 2 and (|T| - S T) / 2. Both |x| and the greater of the two are
    rounded off, over `ROUNDING` of the height, so that a mesh can hold the creases.
    """
    S, T = np.sin(2 * np.pi * s), np.sin(2 * np.pi * t)
    along_t, along_s = (_rounded(S) + S * T) / 2, (_rounded(T) - S * T) / 2
    return (along_t + along_s + _rounded(along_t - along_s)) / 2


ROUNDING = 0.2


def _rounded(x: Array) -> Array:
    """Return |x| with its corner rounded: 0 at 0, 1 at 1."""
    return (np.hypot(x, ROUNDING) - ROUNDING) / (np.hypot(1, ROUNDING) - ROUNDING)


def swirl(s: Array, t: Array) -> Array:
    """Two spiral arms about the tile's centre, fading out towards its border and its eye."""
    x, y = np.mod(s, 1) - 0.5, np.mod(t, 1) - 0.5
    square = x * x + y * y
    fade = np.maximum(1 - 4 * square, 0) ** 2 * -np.expm1(-square / 0.06**2)
    return 0.5 + 0.5 * np.cos(2 * np.arctan2(y, x) + 6 * np.pi * np.sqrt(square)) * fade


def waffle(s: Array, t: Array) -> Array:
    """One pit a tile, between ridges along its borders: 1 - (1 - cos^8 pi s) (1 - cos^8 pi t)."""
    return 1 - (1 - np.cos(np.pi * s) ** 8) * (1 - np.cos(np.pi * t) ** 8)


def groove(location: float, width: float) -> Relief:
    """Return the sinusoidal groove along t of a `width` at s = `location`: 0 at its bottom, 1 beside it."""

    def height(s: Array, t: Array) -> Array:
        away = np.mod(s - location + 0.5, 1) - 0.5
        inside = np.abs(away) < width / 2
        return np.where(inside, 0.5 - 0.5 * np.cos(2 * np.pi * away / width), 1.0)

    return height


def picture(path: Path | str, samples: int) -> Relief:
    """Return the grey values of a picture as heights: periodic cubic spline, columns along s and rows along t.

    The mean of its linear channels is taken as it is, black low and white high. Detail finer than `samples` a tile can
    hold is smoothed away first.
    """
    from scipy import ndimage

    from data_gen import texture

    grey = texture.read(path).values.astype(float).mean(axis=2)
    sigma = [max(0.0, 0.5 * n / samples - 0.25) for n in grey.shape]
    smooth = ndimage.gaussian_filter(grey, sigma, mode="wrap")
    rows, columns = grey.shape
    spline = ndimage.spline_filter(smooth, order=3, mode="grid-wrap")

    def height(s: Array, t: Array) -> Array:
        at = np.stack([t * rows - 0.5, s * columns - 0.5])
        return ndimage.map_coordinates(spline, at, order=3, mode="grid-wrap", prefilter=False)

    return height


RELIEFS: dict[str, Relief] = {"bumps": bumps, "weave": weave, "swirl": swirl, "waffle": waffle}
"""The generated ones without settings of their own."""


def slopes(relief: Relief, s: Array, t: Array) -> tuple[Array, Array]:
    """Return dh/ds and dh/dt by central differences."""
    return (
        (relief(s + STEP, t) - relief(s - STEP, t)) / (2 * STEP),
        (relief(s, t + STEP) - relief(s, t - STEP)) / (2 * STEP),
    )
