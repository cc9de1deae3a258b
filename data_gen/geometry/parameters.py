"""The settings of shapes and poses, checked: what is wrong is said in one line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from envbench.errors import BadInput, unknown

AXES = {"x": 0, "y": 1, "z": 2}

Made = TypeVar("Made")


def number(name: str, value: Any, low: float, high: float) -> float:
    """Return a number in [low, high]."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
        raise BadInput(f"{name} must be a number in [{low:g}, {high:g}]. Got {value!r} instead.")
    return float(value)


def integer(name: str, value: Any, low: int, high: int) -> int:
    """Return an int in [low, high]."""
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise BadInput(f"{name} must be an integer in [{low}, {high}]. Got {value!r} instead.")
    return value


def pair(name: str, value: Any, low: int, high: int) -> tuple[int, int]:
    """Return two ints in [low, high], from two of them or from one for both."""
    both = list(value) if isinstance(value, list | tuple) else [value, value]
    if len(both) != 2:
        raise BadInput(f"{name} must be one integer or two. Got {value!r} instead.")
    return integer(name, both[0], low, high), integer(name, both[1], low, high)


def lengths(name: str, value: Any) -> tuple[float, float]:
    """Return two positive finite numbers, from two of them or from one for both."""
    both = list(value) if isinstance(value, list | tuple) else [value, value]
    if len(both) != 2:
        raise BadInput(f"{name} must be one length or two. Got {value!r} instead.")
    return number(name, both[0], 1e-6, 1e6), number(name, both[1], 1e-6, 1e6)


def path(name: str, value: Any) -> Path:
    """Return the path of a file, checked to be text."""
    if not isinstance(value, str | Path) or not str(value):
        raise BadInput(f"{name} must name a file. Got {value!r} instead.")
    return Path(value)


def axis(name: str, value: Any) -> int:
    """Return the number of an axis "x", "y" or "z"."""
    if not isinstance(value, str) or value not in AXES:
        raise BadInput(f"{name} must be 'x', 'y' or 'z'. Got {value!r} instead.")
    return AXES[value]


def other_axis(name: str, value: Any, first: str) -> int:
    """Return the number of an axis that is not `first`."""
    chosen = axis(name, value)
    if value == first:
        raise BadInput(f"{name} must not be the axis itself, '{first}'.")
    return chosen


def array(name: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return finite numbers of a shape, where None is any length."""
    wanted = " x ".join("n" if n is None else str(n) for n in shape)
    try:
        numbers = np.array(value, float)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    fits = numbers.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, numbers.shape, strict=True))
    if not fits or not np.isfinite(numbers).all():
        got = repr(value) if len(repr(value)) < 80 else f"an array of shape {numbers.shape}"
        raise BadInput(f"{name} must be {wanted} finite numbers. Got {got} instead.")
    return numbers


def made(what: str, kinds: Mapping[str, type[Made]], table: Any, beside: Iterable[str] = ()) -> Made:
    """Make what a table with `kind` describes, its settings the fields of that kind's dataclass.

    Settings named in `beside` are left to the caller. Errors begin with `what`.
    """
    if not isinstance(table, Mapping):
        raise BadInput(f"{what} must be a table with 'kind'. Got {table!r} instead.")
    kind = str(table.get("kind"))
    if kind not in kinds:
        raise unknown(f"kind of {what}:", kind, kinds)
    known = [f.name for f in fields(kinds[kind])]  # pyright: ignore[reportArgumentType] - every kind is a dataclass
    beside = list(beside)
    settings = {str(key): value for key, value in table.items() if key != "kind" and key not in beside}
    for key in settings:
        if key not in known:
            raise unknown(f"setting of {what} ({kind}):", key, [*known, *beside])
    for f in fields(kinds[kind]):  # pyright: ignore[reportArgumentType]
        if f.default is MISSING and f.name not in settings:
            raise BadInput(f"{what} ({kind}) needs the setting '{f.name}'.")
    try:
        return kinds[kind](**settings)
    except BadInput as error:
        raise type(error)(f"{what}: {error}") from None
