"""What a method's `shade` gave, held to its contract: radiance at every point, times the material's texture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.errors import BadInput
from envbench.geometry import Points


def modulated(answer: Any, points: Points) -> Any:
    """Return what `shade` gave times the material's texture."""
    if points.modulation is None or not isinstance(answer, np.ndarray) or answer.shape != points.modulation.shape:
        return answer
    return answer * points.modulation.astype(answer.dtype)


def checked(answer: Any, count: int) -> NDArray[np.floating]:
    """Return what `shade` gave if it is radiance (count, 3); raises `BadInput` saying what it is instead."""
    if not isinstance(answer, np.ndarray):
        raise BadInput(f"shade must return a NumPy array of shape ({count}, 3). Got {type(answer).__name__} instead.")
    if answer.shape != (count, 3):
        raise BadInput(f"shade must return shape ({count}, 3). Got {answer.shape} instead.")
    if answer.dtype not in (np.float32, np.float64):
        raise BadInput(f"shade must return float32 or float64. Got {answer.dtype} instead.")
    bad = int((~np.isfinite(answer)).any(-1).sum())
    if bad:
        raise BadInput(f"shade must return finite radiance. Got NaN or infinity at {bad} of {count} points instead.")
    return answer
