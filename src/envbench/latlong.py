"""The one meaning of a lat-long map (CONVENTIONS.md): samples at pixel centres, bilinear in (theta, phi) between.

Row i sits at theta = pi (i + 1/2) / H, column j at phi = 2 pi (j + 1/2) / W. The map is periodic in phi, and beyond a
pole a row meets its own half-turned self: with f extended to the torus by f(-theta, phi) = f(theta, phi + pi),
it is plain bilinear interpolation everywhere.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from envbench.directions import Array, from_angles, to_angles


def angles(height: int, width: int) -> tuple[Array, Array]:
    """Return the polar angles (H,) of the rows and the azimuths (W,) of the columns."""
    return np.pi * (np.arange(height) + 0.5) / height, 2 * np.pi * (np.arange(width) + 0.5) / width


def grid(height: int, width: int) -> Array:
    """Return the directions of the samples, shape (H, W, 3)."""
    theta, phi = angles(height, width)
    return from_angles(theta[:, None], phi[None, :])


def solid_angles(height: int, width: int) -> Array:
    """Return each pixel's solid angle in sr, shape (H, 1); times W they sum to 4 pi."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return ((edges[:-1] - edges[1:]) * (2 * np.pi / width))[:, None]


def interpolate(samples: NDArray[Any], directions: ArrayLike) -> Array:
    """Evaluate the map at directions.

    Parameters
    ----------
    samples : (H, W, C)
        Values at the pixel centres.
    directions : (..., 3)
        Unit vectors.

    Returns
    -------
    (..., C) float64
    """
    height, width = samples.shape[:2]
    theta, phi = to_angles(directions)
    y = theta * height / np.pi - 0.5
    row = np.floor(y).astype(int)
    fy = (y - row)[..., None]
    return (1 - fy) * _along_row(samples, row, phi, width) + fy * _along_row(samples, row + 1, phi, width)


def _along_row(samples: NDArray[Any], row: NDArray[Any], phi: Array, width: int) -> Array:
    height = samples.shape[0]
    over_pole = (row < 0) | (row >= height)
    row = np.where(row < 0, -1 - row, np.where(row >= height, 2 * height - 1 - row, row))
    x = (phi + np.where(over_pole, np.pi, 0.0)) * width / (2 * np.pi) - 0.5
    column = np.floor(x).astype(int)
    fx = (x - column)[..., None]
    left, right = samples[row, column % width], samples[row, (column + 1) % width]
    return (1 - fx) * left.astype(np.float64) + fx * right.astype(np.float64)
