"""Shading with zonal lobes that turn with their points (Sloan, Luna and Snyder 2005, sec. 5), in one kernel each.

A point's transfer is t~_lm = sum_i y_lm(s_i) g_il, and, of the first bands, the coefficients themselves (DC, or DC and
linear). Turned by R it shines back, of the light e,

    r = sum_i sum_l g_il sum_m y_lm(R s_i) e_lm + what the direct terms, turned, send back          (eqs. 10 and 13)

`evaluated` sums that as it stands, `specialised` reads the inner sum over m from the light's table (eqs. 24 and 25),
`locally` reads y_lm from a table, for a light of each point's own. `static` and `full` use SH vectors instead of lobes:
PRT that is right where nothing turned, and the exact reference with a full rotation a point.

A glossy point has J rows of lobes in place of one, and J view factors u_j that weigh what they send back (eq. 16).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from envbench.directions import Array
from envbench.errors import BadInput
from methods.ldprt import basis, rotation
from methods.ldprt.lanes import applied, finished, floats, points_last, three, transposed
from methods.ldprt.lookup import LatLong
from methods.ldprt.table import check


@dataclass(frozen=True, eq=False)
class Packed:
    """Lobes of V points as the kernels read them: single precision, points last. Made by `pack`.

    Attributes
    ----------
    axes : (J N, 3, V)
    coefficients : (J N, n - b, V)
        Of the bands b ... n - 1, b those stored directly.
    direct : (J, b^2, V)
    n : int
        Bands l < n.
    """

    axes: NDArray[np.float32]
    coefficients: NDArray[np.float32]
    direct: NDArray[np.float32]
    n: int

    def __len__(self) -> int:
        return self.axes.shape[-1]

    @property
    def rows(self) -> int:
        """J: 1 for a diffuse point."""
        return len(self.direct)

    @property
    def first(self) -> int:
        """b: the lowest band that the lobes hold."""
        return self.n - self.coefficients.shape[1]


class Turning(StrEnum):
    """What a full SH rotation a point turns: the light into the rest frame, or transfer out of it; both are exact."""

    LIGHT = "light"
    """As the paper has it: three rotations a point for three channels."""
    TRANSFER = "transfer"
    """One rotation a point, whatever the channels."""


def pack(axes: Array, coefficients: Array, direct: Array) -> Packed:
    """Lay lobes out for the kernels: once an asset.

    Parameters
    ----------
    axes : (V, N, 3) or (V, J, N, 3)
        Unit vectors s_i at rest; with J rows for a glossy point.
    coefficients : (V, N, n) or (V, J, N, n)
        g*_il, zero in the bands stored directly.
    direct : (V, d) or (V, J, d)
        The first d SH coefficients, d = 1 or 4.

    Raises
    ------
    BadInput
        Shapes that do not fit each other, or a band that is stored twice.
    """
    if axes.ndim == 3:
        axes, coefficients, direct = axes[:, None], coefficients[:, None], direct[:, None]
    V, J, N = axes.shape[:3] if axes.ndim == 4 else (-1, -1, -1)
    n, d = coefficients.shape[-1], direct.shape[-1]
    if axes.shape != (V, J, N, 3) or coefficients.shape != (V, J, N, n) or direct.shape != (V, J, d):
        raise BadInput(
            "lobes must have axes (V, J, N, 3), coefficients (V, J, N, n) and direct terms (V, J, d), or no J. "
            f"Got {axes.shape}, {coefficients.shape} and {direct.shape} instead."
        )
    if d not in (1, 4) or isqrt(d) > n:
        raise BadInput(f"direct terms must be 1 or 4 in number, at most n^2 = {n * n}. Got {d} instead.")
    b = isqrt(d)
    if np.any(coefficients[..., :b]):
        raise BadInput(f"lobe coefficients of the bands l < {b} must be zero: these are stored directly.")
    return Packed(
        points_last(axes.reshape(V, J * N, 3)),
        points_last(coefficients[..., b:].reshape(V, J * N, n - b)),
        points_last(direct),
        n,
    )


def specialised(
    lobes: Packed,
    light: NDArray[np.floating],
    table: NDArray[np.float32],
    rotations: Array | None = None,
    factors: NDArray[np.floating] | None = None,
) -> NDArray[np.float32]:
    """Return radiance (V, 3) by N lookups a point in the light's table (eq. 25).

    Parameters
    ----------
    light : (>= n^2, 3)
        For the direct terms.
    table : (rows, columns, n, 3)
        What `methods.ldprt.table.build` made of the same light.
    rotations : (V, 3, 3), optional
        Rest to posed; without them nothing turned.
    factors : (V, J) or (V, J, 3), optional
        View factors u_j, for all channels or for each; without them all 1.

    Raises
    ------
    BadInput
        Arrays of other shapes.
    """
    if table.ndim != 4 or table.shape[2] < lobes.n or table.shape[3] != 3:
        raise BadInput(f"the table must have shape (rows, columns, {lobes.n}, 3). Got {table.shape} instead.")
    check(lobes.n, (table.shape[0], table.shape[1]))
    lookup = LatLong(table[:, :, lobes.first : lobes.n].reshape(*table.shape[:2], -1))

    def by_band(axis: Any) -> list[Any]:
        values = lookup.at(axis)
        return [three(values[k : k + 3]) for k in range(0, len(values), 3)]

    return _shade(lobes, _light(light, lobes), rotations, factors, by_band)


def evaluated(
    lobes: Packed,
    light: NDArray[np.floating],
    rotations: Array | None = None,
    factors: NDArray[np.floating] | None = None,
) -> NDArray[np.float32]:
    """Return radiance (V, 3) with the harmonics evaluated at every lobe's axis (eq. 13).

    Parameters
    ----------
    light : (>= n^2, 3) or (V, >= n^2, 3)
        One for all points, or one for each.
    rotations, factors
        As for `specialised`.

    Raises
    ------
    BadInput
        Arrays of other shapes.
    """
    e = _light(light, lobes)
    return _shade(lobes, e, rotations, factors, lambda axis: _sums(lobes, basis.evaluate(lobes.n, axis), e))


def locally(
    lobes: Packed,
    light: NDArray[np.floating],
    harmonics: NDArray[np.float32],
    rotations: Array | None = None,
    factors: NDArray[np.floating] | None = None,
) -> NDArray[np.float32]:
    """Return radiance (V, 3) under a light of each point's own, with harmonics from a table (eq. 13, sec. 5).

    Parameters
    ----------
    light : (V, >= n^2, 3)
        Or (>= n^2, 3), one for all.
    harmonics : (rows, columns, n^2)
        `methods.ldprt.table.harmonics`.
    rotations, factors
        As for `specialised`.

    Raises
    ------
    BadInput
        Arrays of other shapes.
    """
    if harmonics.ndim != 3 or harmonics.shape[2] < lobes.n**2:
        raise BadInput(f"the table must have shape (rows, columns, {lobes.n**2}). Got {harmonics.shape} instead.")
    skipped, e = lobes.first**2, _light(light, lobes)
    lookup = LatLong(harmonics[:, :, skipped : lobes.n**2])
    return _shade(lobes, e, rotations, factors, lambda axis: _sums(lobes, [0.0] * skipped + lookup.at(axis), e))


def static(transfer: NDArray[np.floating], light: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return radiance (V, 3) of transfer vectors (V, n^2) as they are at rest: PRT without any rotation."""
    if transfer.ndim != 2 or light.ndim != 2 or len(light) < transfer.shape[1] or light.shape[1] != 3:
        raise BadInput(f"transfer (V, n^2) needs a light (n^2, 3). Got {transfer.shape} and {light.shape} instead.")
    return transfer.astype(np.float32, copy=False) @ light[: transfer.shape[1]].astype(np.float32)


def full(
    transfer: NDArray[np.floating], light: NDArray[np.floating], rotations: Array, turning: Turning = Turning.LIGHT
) -> NDArray[np.float32]:
    """Return radiance (V, 3) of transfer vectors (V, n^2) with a full SH rotation (V, 3, 3) a point, by zxzxz.

    Exact but for single precision: what sums of lobes approximate.

    Parameters
    ----------
    light : (>= n^2, 3)

    Raises
    ------
    BadInput
        Arrays of other shapes.
    """
    n = isqrt(transfer.shape[-1])
    if transfer.ndim != 2 or n < 1 or n * n != transfer.shape[1]:
        raise BadInput(f"transfer must have shape (V, n^2). Got {transfer.shape} instead.")
    e = _coefficients(light, n, len(transfer))
    m = _matrix(rotations, len(transfer))
    if not len(transfer):
        return np.zeros((0, 3), np.float32)
    t = floats(points_last(transfer))
    if turning is Turning.LIGHT:
        back = transposed(m)
        e = rotation.turned(e, back, rotation.euler(back))
    else:
        t = rotation.turned(t, m, rotation.euler(m))
    return finished(_dot(t, e))


def _shade(
    lobes: Packed,
    light: list[Any],
    rotations: Array | None,
    factors: NDArray[np.floating] | None,
    by_band: Callable[[Any], list[Any]],
) -> NDArray[np.float32]:
    """Sum what lobes and direct terms send back, given e_l(s) (eq. 24) in the bands that lobes hold, by `by_band`."""
    matrix = None if rotations is None else _matrix(rotations, len(lobes))
    weights = _factors(factors, lobes)
    if not len(lobes):
        return np.zeros((0, 3), np.float32)
    axes, coefficients, direct = (floats(part) for part in (lobes.axes, lobes.coefficients, lobes.direct))
    each, total = len(axes) // lobes.rows, three([0.0] * 3)
    for j, weight in enumerate(weights):
        sent = _dot(_linear_turned(direct[j], matrix), light)
        for axis, lobe in zip(axes[j * each :][:each], coefficients[j * each :][:each], strict=True):
            if lobe:
                sent += _dot(lobe, by_band(three(axis if matrix is None else applied(matrix, axis))))
        total += weight * sent
    return finished(total)


def _sums(lobes: Packed, y: Sequence[Any], light: Sequence[Any]) -> list[Any]:
    """Return e_l = sum over m of y_lm e_lm for the bands that lobes hold."""
    return [_dot(y[l * l : (l + 1) ** 2], light[l * l :]) for l in range(lobes.first, lobes.n)]


def _linear_turned(direct: list[Any], matrix: Any) -> list[Any]:
    """Turn the direct terms, DC alone or with the linear ones, which are (-y, z, -x) of a vector."""
    if matrix is None or len(direct) == 1:
        return direct
    dc, y, z, x = direct
    x, y, z = applied(matrix, [-x, -y, z])
    return [dc, -y, z, -x]


def _dot(weights: Sequence[Any], values: Sequence[Any]) -> Any:
    """Return the sum of scalars times ``Array3f``, over as many as there are weights."""
    import drjit as dr

    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=False):
        total = dr.fma(weight, value, total)
    return total


def _light(light: NDArray[np.floating], lobes: Packed) -> list[Any]:
    return _coefficients(light, lobes.n, len(lobes))


def _coefficients(light: NDArray[np.floating], n: int, count: int) -> list[Any]:
    """Return e_lm, l < n, as ``Array3f``: of one light for all points, or of one for each."""
    if light.shape[-1:] != (3,) or light.ndim not in (2, 3) or light.shape[-2] < n * n:
        raise BadInput(f"a light of order {n} must have shape ({n * n}, 3). Got {light.shape} instead.")
    llvm.find()
    import drjit as dr
    from drjit.llvm import Array3f, Float, UInt32

    if light.ndim == 2:
        # opaque: the kernel takes them as arguments, and is not compiled anew for another light
        return [three([dr.opaque(Float, float(c)) for c in e]) for e in light[: n * n]]
    if len(light) != count:
        raise BadInput(f"lights of {count} points must have shape ({count}, {n * n}, 3). Got {light.shape} instead.")
    flat = Float(light.astype(np.float32, copy=False).ravel())  # a kernel's gathers are faster than turning it round
    point = dr.arange(UInt32, count) * light.shape[1]
    return [dr.gather(Array3f, flat, point + k) for k in range(n * n)]


def _matrix(rotations: Array, count: int) -> list[list[Any]]:
    if rotations.shape != (count, 3, 3):
        raise BadInput(f"rotations of {count} points must have shape ({count}, 3, 3). Got {rotations.shape} instead.")
    return floats(points_last(rotations))


def _factors(factors: NDArray[np.floating] | None, lobes: Packed) -> list[Any]:
    if factors is None:
        return [1.0] * lobes.rows
    wanted = (len(lobes), lobes.rows)
    if factors.shape not in (wanted, (*wanted, 3)):
        raise BadInput(f"view factors must have shape {wanted} or {(*wanted, 3)}. Got {factors.shape} instead.")
    return [three(u) if factors.ndim == 3 else u for u in floats(points_last(factors))]
