"""Radiance as a screen shows it, at one exposure for a reference and all that is compared with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FORMULA = "sRGB(x / (1 + x)), x = max(radiance, 0) / 99th percentile of the reference's luminance"


def displayed(values: NDArray[np.float64], reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `values` (..., 3) in [0, 1], exposed for `reference` (n, 3), which must not be all black.

    Reinhard et al. 2002, eq. 3, and the transfer curve of sRGB (IEC 61966-2-1).
    """
    luminance = reference @ np.array([0.2126, 0.7152, 0.0722])
    white = np.percentile(luminance, 99) or luminance.max()  # all but a few points may be black
    x = np.maximum(values, 0) / white
    x = x / (1 + x)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
