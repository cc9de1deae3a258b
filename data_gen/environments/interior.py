"""A window-lit hall: a scene of 10^4 : 1 whose every radiance and solid angle is known."""

from __future__ import annotations

import numpy as np

from data_gen.environments import parameters as p
from envbench.directions import Array, from_angles
from envbench.environment import Environment

# Metres from the viewpoint: the hall is 12 x 6 x 5 m, seen from 1.5 m above the middle of its floor.
LOW, HIGH = np.array([-6.0, -3.0, -1.5]), np.array([6.0, 3.0, 3.5])
PANE_WIDTH, SILL, LINTEL = 1.2, -0.5, 2.1
FLOOR, WALL, CEILING = np.array([1.0, 1.0, 1.0]), np.array([3.0, 2.6, 2.2]), np.array([2.0, 2.0, 2.0])
_FINE = 4


def hall(*, windows: int = 4, contrast: float = 1e4, size: int = 128) -> Environment:
    """Return a dim hall lit by a row of tall windows in the long wall at +y.

    Parameters
    ----------
    windows : int
        Panes of 1.2 x 2.6 m, evenly spaced.
    contrast : float
        Radiance of the windows over that of the darkest surface, the floor, which is 1.
    size : int
        Rows of the map; each sample is the mean over its pixel, from 4 x 4 directions.
    """
    height = p.integer("hall", "size", size, 8, 2048)
    panes = p.integer("hall", "windows", windows, 1, 8)
    contrast = p.number("hall", "contrast", contrast, 10, 1e9)
    offsets = (np.arange(_FINE) + 0.5) / _FINE
    phi = 2 * np.pi * (np.arange(2 * height)[:, None] + offsets) / (2 * height)
    radiance = np.empty((height, 2 * height, 3), np.float32)
    for row in range(height):
        theta = np.pi * (row + offsets) / height
        values = _seen(from_angles(theta[:, None, None], phi), panes, contrast)
        radiance[row] = np.average(values.mean(axis=2), axis=0, weights=np.sin(theta))
    return Environment("hall", radiance)


def _seen(direction: Array, panes: int, contrast: float) -> Array:
    """Return the radiance (..., 3) of what `direction` (..., 3) meets."""
    with np.errstate(divide="ignore"):
        distance = np.where(direction > 0, HIGH, LOW) / direction
    side = distance.argmin(axis=-1)
    x, y, z = np.moveaxis(direction * distance.min(axis=-1, keepdims=True), -1, 0)
    pitch = (HIGH[0] - LOW[0]) / panes
    off_centre = np.abs((x - LOW[0]) % pitch - pitch / 2)
    window = (side == 1) & (y > 0) & (off_centre < PANE_WIDTH / 2) & (z > SILL) & (z < LINTEL)
    surface = np.where((side == 2)[..., None], np.where((z > 0)[..., None], CEILING, FLOOR), WALL)
    return np.where(window[..., None], contrast * FLOOR, surface)
