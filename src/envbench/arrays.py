"""One formula for NumPy and Dr.Jit: the few functions that a BRDF needs, by the kind of its argument.

A lobe is written once against `Namespace` and so serves the float64 quadrature (NumPy), the Mitsuba plugin
and the angular kernel (Dr.Jit). Vectors are component-first: ``v[0], v[1], v[2]``, whether `v` is a NumPy array
of shape (3, ...) or a Dr.Jit ``Vector3f``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, Protocol, cast

import numpy as np

from envbench.directions import Array


class Namespace(Protocol):
    """What a formula may call: elementwise functions with NumPy's meaning."""

    def exp(self, x: Any, /) -> Any: ...
    def log(self, x: Any, /) -> Any: ...
    def sqrt(self, x: Any, /) -> Any: ...
    def sin(self, x: Any, /) -> Any: ...
    def cos(self, x: Any, /) -> Any: ...
    def arccos(self, x: Any, /) -> Any: ...
    def arctan2(self, y: Any, x: Any, /) -> Any: ...
    def power(self, x: Any, y: Any, /) -> Any: ...
    def maximum(self, x: Any, y: Any, /) -> Any: ...
    def minimum(self, x: Any, y: Any, /) -> Any: ...
    def where(self, condition: Any, x: Any, y: Any, /) -> Any: ...
    def floor(self, x: Any, /) -> Any: ...
    def abs(self, x: Any, /) -> Any: ...


def namespace(*values: Any) -> Namespace:
    """Return NumPy, or Dr.Jit under NumPy's names when any of `values` is a Dr.Jit array.

    Examples
    --------
    >>> namespace(np.ones(3)) is np
    True
    """
    dr = sys.modules.get("drjit")  # a Dr.Jit array cannot exist before drjit is imported
    if dr is None or not any(dr.is_array_v(v) for v in values):
        return cast("Namespace", np)
    drjit = SimpleNamespace(
        exp=dr.exp, log=dr.log, sqrt=dr.sqrt, sin=dr.sin, cos=dr.cos, arccos=dr.acos, arctan2=dr.atan2,
        power=dr.power, maximum=dr.maximum, minimum=dr.minimum, where=dr.select,
        floor=dr.floor, abs=dr.abs,
    )  # fmt: skip
    return cast("Namespace", drjit)


def dot(a: Sequence[Any] | Any, b: Sequence[Any] | Any) -> Any:
    """Inner product of two component-first vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def components(kind: Any, rows: Array) -> Any:
    """Return vectors (n, 3) as a Dr.Jit type.

    Component by component: taken apart by Dr.Jit itself, their number would be a constant of each kernel.
    """
    import drjit as dr

    return kind(*(dr.value_t(kind)(column) for column in np.ascontiguousarray(rows.T, np.float32)))
