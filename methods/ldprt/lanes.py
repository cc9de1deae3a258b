"""Points as the lanes of a kernel: arrays with the points last, in single precision, and Dr.Jit's lists of them."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm


def points_last(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return values (V, ...) as (..., V), in single precision and contiguous."""
    flat = values.reshape(len(values), prod(values.shape[1:])).T.astype(np.float32, order="C")
    return flat.reshape(*values.shape[1:], len(values))


def floats(values: NDArray[np.float32]) -> list[Any]:
    """Return arrays (..., V) as nested lists of ``Float``."""
    llvm.find()
    from drjit.llvm import Float

    return [Float(row) if row.ndim == 1 else floats(row) for row in values]


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
