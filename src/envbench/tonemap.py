"""Radiance as a screen shows it: compressed, for what is scored as it is seen; or exposed and clipped, for pictures."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
FORMULA = "sRGB(x / (1 + x)), x = max(radiance, 0) / 99th percentile of the reference's luminance"


def displayed(values: NDArray[np.float64], reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `values` (..., 3) in [0, 1], exposed for `reference` (n, 3), which must not be all black.

    Reinhard et al. 2002, eq. 3, and the transfer curve of sRGB (IEC 61966-2-1).
    """
    luminance = reference @ _LUMINANCE
    white = np.percentile(luminance, 99) or luminance.max()  # all but a few points may be black
    x = np.maximum(values, 0) / white
    x = x / (1 + x)
    return _srgb(x)


def exposure(radiance: NDArray[np.floating]) -> float:
    """Return the stops (powers of two) that bring the 99th percentile of luminance of (n, 3) to 1, to a quarter stop.

    Examples
    --------
    >>> exposure(np.full((8, 3), 4.0)), exposure(np.zeros((8, 3))), exposure(np.zeros((0, 3)))
    (-2.0, 0.0, 0.0)
    """
    luminance = radiance @ _LUMINANCE
    white = float(np.percentile(luminance, 99)) if luminance.size else 0.0
    return -round(4 * math.log2(white)) / 4 if white > 0 else 0.0


def pictured(radiance: NDArray[np.floating], stops: float) -> NDArray[np.uint8]:
    """Return finite radiance (..., 3) as 8-bit colours: exposed by `stops`, clipped to [0, 1], on sRGB's curve."""
    return np.rint(255 * _srgb(np.clip(radiance * 2.0**stops, 0, 1))).astype(np.uint8)


def _srgb(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """The transfer curve of IEC 61966-2-1, of values in [0, 1]."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
