"""Well-spread points for deterministic averages: an additive recurrence, at no cost of importing scipy.stats."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def points(count: int, dimensions: int) -> NDArray[np.float64]:
    """Return points (dimensions, count) in [0, 1): u_n = frac(1/2 + n a), a_j = g^-j, g^(d + 1) = g + 1.

    Of the recurrences in d dimensions this one spreads almost best (M. Roberts, "The Unreasonable Effectiveness of
    Quasirandom Sequences", 2018); in one dimension g is the golden ratio.

    Examples
    --------
    >>> float(points(1000, 2).mean().round(3))
    0.5
    """
    g = 2.0
    for _ in range(64):
        g = (1 + g) ** (1 / (dimensions + 1))
    steps = g ** -np.arange(1.0, dimensions + 1)
    return (0.5 + steps[:, None] * np.arange(1, count + 1)) % 1.0
