"""Reading files of measurements: numbers in text, and Mitsuba borrowed for a moment."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from envbench import llvm
from envbench.directions import Array
from envbench.errors import BadInput

_LARGEST = 64 << 20


def size_of(path: Path) -> int:
    """Return the bytes of a file; raises `BadInput` where it is none."""
    try:
        if path.is_file():
            return path.stat().st_size
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}).") from error
    raise BadInput(f"{path}: no such file; give the path of a file of measurements.")


def numbers(path: Path) -> Array:
    """Return all numbers of a text file, (n,); `#` starts a comment.

    Raises
    ------
    BadInput
        It is no text, holds a word, NaN or Inf, or is larger than 64 MB.
    """
    if size_of(path) > _LARGEST:
        raise BadInput(f"{path}: {size_of(path)} bytes are more than any such file has; give the right one.")
    try:
        lines = path.read_text("ascii").splitlines()
        values = np.array([float(word) for line in lines for word in line.partition("#")[0].split()])
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: not the numbers in text that it should hold ({error}); get it again.") from error
    if not np.isfinite(values).all():
        raise BadInput(f"{path}: holds NaN or Inf; get it again.")
    return values


@contextmanager
def mitsuba(variant: str) -> Generator[Any]:
    """Give Mitsuba with `variant` set, and set the one that was before when done."""
    import importlib

    llvm.find()
    before = importlib.import_module("mitsuba").variant()
    mi = llvm.mitsuba(variant)
    try:
        yield mi
    finally:
        if before is not None and before != variant:
            mi.set_variant(before)
