"""The parameters of views, checked: what is wrong is said in one line."""

from __future__ import annotations

from typing import Any

import numpy as np

from envbench.directions import normalised
from envbench.errors import BadInput

Vector = tuple[float, float, float]


def integer(name: str, value: Any, low: int, high: int) -> None:
    """Refuse what is no int in [low, high]."""
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise BadInput(f"{name} must be an integer in [{low}, {high}]. Got {value!r} instead.")


def degrees(name: str, value: Any, low: float, high: float) -> None:
    """Refuse what is no number in [low, high]."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
        raise BadInput(f"{name} must lie in [{low:g}, {high:g}] degrees. Got {value!r} instead.")


def vector(name: str, value: Any) -> Vector:
    """Return three finite numbers."""
    numbers = list(value) if isinstance(value, list | tuple) else []
    if len(numbers) != 3 or not all(isinstance(n, int | float) and np.isfinite(n) for n in numbers):
        raise BadInput(f"{name} must be three finite numbers. Got {value!r} instead.")
    return float(numbers[0]), float(numbers[1]), float(numbers[2])


def direction(name: str, value: Any) -> Vector:
    """Return the unit vector along three finite numbers that are not all zero."""
    along = vector(name, value)
    if not any(along):
        raise BadInput(f"{name} must not be zero.")
    x, y, z = map(float, normalised(along))
    return x, y, z
