"""Fewer rows: each new sample is the mean over its pixel, by solid angle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from envbench.directions import Array
from envbench.environment import Environment
from envbench.errors import BadInput


def downsampled(environment: Environment, height: int) -> Environment:
    """Return `environment` with `height` rows and its aspect kept; as it is when it has no more rows than that.

    Pixels are averaged by the solid angle that they share with the new pixel, so `Environment.mean` stays the same
    (to float32 rounding) and no peak is lost.

    Raises
    ------
    BadInput
        When `height` is below 2.
    """
    if height < 2:
        raise BadInput(f"environment height must be >= 2 rows. Got {height} instead.")
    rows, columns = environment.radiance.shape[:2]
    if height >= rows:
        return environment
    width = max(4, round(columns * height / rows))
    down = _shares(np.cos(np.linspace(np.pi, 0, height + 1)), np.cos(np.linspace(np.pi, 0, rows + 1)))[::-1, ::-1]
    across = _shares(np.linspace(0, 1, width + 1), np.linspace(0, 1, columns + 1))
    averaged = np.einsum("ih,hwc,jw->ijc", down, environment.radiance, across, optimize=True)
    return replace(environment, radiance=averaged.astype(np.float32))


def _shares(coarse: Array, fine: Array) -> Array:
    """Return which share of each coarse interval every fine one fills, (coarse - 1, fine - 1), from growing edges."""
    low = np.maximum(coarse[:-1, None], fine[None, :-1])
    high = np.minimum(coarse[1:, None], fine[None, 1:])
    return np.maximum(high - low, 0) / np.diff(coarse)[:, None]
