"""The parameters of generated lights, checked: what is wrong is said as scikit-learn says it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from envbench.directions import Array, normalised
from envbench.errors import BadInput

MAX_ROWS = 4096


def integer(light: str, name: str, value: Any, low: int, high: int) -> int:
    """Return `value` if it is an int in [low, high]; raises `BadInput` otherwise."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise BadInput(f"The '{name}' of light '{light}' must be an int in [{low}, {high}]. Got {value!r} instead.")
    return value


def number(light: str, name: str, value: Any, low: float, high: float) -> float:
    """Return `value` if it is a number in [low, high]; raises `BadInput` otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise BadInput(f"The '{name}' of light '{light}' must be a number in [{low}, {high}]. Got {value!r} instead.")
    return float(value)


def colour(light: str, name: str, value: Any) -> Array:
    """Return radiance (3,) from a number or three, each in [0, 1e9]; raises `BadInput` otherwise."""
    values: Sequence[Any] = (
        cast("Sequence[Any]", value) if isinstance(value, list | tuple | np.ndarray) else [value] * 3
    )
    if len(values) != 3:
        raise BadInput(f"The '{name}' of light '{light}' must be a number or three. Got {value!r} instead.")
    return np.array([number(light, name, v, 0, 1e9) for v in values])


def direction(light: str, name: str, value: Any) -> Array:
    """Return the unit vector (3,) along `value`; raises `BadInput` when it is not three numbers or has no length."""
    try:
        vector = np.array(value, float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise BadInput(f"The '{name}' of light '{light}' must be three numbers, not all 0. Got {value!r} instead.")
    return normalised(vector)
