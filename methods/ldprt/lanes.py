"""Points as the lanes of a kernel: arrays with the points last, in single precision, and Dr.Jit's lists of them."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm

_ALIGNMENT = 64
"""Bytes: of the widest vectors, and of a line of the cache."""


def points_last(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return values (V, ...) as (..., V), in single precision and contiguous."""
    flat = values.reshape(len(values), prod(values.shape[1:])).T.astype(np.float32, order="C")
    return flat.reshape(*values.shape[1:], len(values))


def floats(values: NDArray[np.float32]) -> list[Any]:
    """Return arrays (..., V) as nested lists of ``Float``.

    Dr.Jit takes NumPy's memory as it is, and compiles whether each array of it is aligned: rows that lie now so, now
    otherwise would be compiled again at every call. So all are laid out aligned.
    """
    llvm.find()
    return _nested(_aligned(values))


def _nested(values: NDArray[np.float32]) -> list[Any]:
    from drjit.llvm import Float

    return [Float(row) if row.ndim == 1 else _nested(row) for row in values]


def _aligned(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the same values with every row at a multiple of `_ALIGNMENT` bytes."""
    rows, count = prod(values.shape[:-1]), values.shape[-1]
    step = _ALIGNMENT // values.itemsize
    width = -(-count // step) * step
    memory = np.empty(rows * width + step, np.float32)
    first = -memory.ctypes.data % _ALIGNMENT // values.itemsize
    laid = memory[first : first + rows * width].reshape(*values.shape[:-1], width)[..., :count]
    laid[...] = values
    return laid


def three(channels: Sequence[Any]) -> Any:
    """Return three ``Float``, or numbers, as an ``Array3f``."""
    from drjit.llvm import Array3f

    return Array3f(*channels)


def applied(matrix: Sequence[Sequence[Any]], vector: Sequence[Any]) -> list[Any]:
    """Return the product of a 3 x 3 matrix and a vector."""
    return [row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2] for row in matrix]


def transposed(matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Return a 3 x 3 matrix transposed: the inverse of a rotation."""
    return [[matrix[j][i] for j in range(3)] for i in range(3)]


def finished(value: Any) -> NDArray[np.float32]:
    """Return an array of C components, computed, as (V, C): planes seen as columns."""
    import drjit as dr

    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T
