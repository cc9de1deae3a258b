"""The maps B_pq(alpha, beta) of one lobe under one light: one spin-q synthesis each (RH 2002, eqs. 5, 6 and 14).

The light is real and rho_lpq is real and even in q, so B_pq is an E-mode-only spin-q function. ducc0's output (Q, U)
for the coefficients sqrt(4 pi / (2 l + 1)) L_lm rho_lpq gives B_p0 = Q, and B_pq = -(Q - i U) for q >= 1, so

    B = sum_p [ B_p0 Y_p0 + 2 Re sum_{q >= 1} B_pq Y_pq ]
      = sum_p [ Q_p0 Y_p0 - 2 sum_{q >= 1} (Q_pq Re Y_pq + U_pq Im Y_pq) ].

So ducc0's Q and U are stored as they come, one plane each, and the signs go into the basis that `basis` returns.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics
from envbench.directions import to_local
from methods.shrm import lookup
from methods.shrm.coefficients import LobeCoefficients

Array = NDArray[np.float64]


def terms(P: int, F: int) -> Iterator[tuple[int, int, int]]:
    """Yield (p, q, plane): the terms q >= 0 of an order-P map and the first of the planes that each fills."""
    plane = 0
    for p in range(P + 1):
        for q in range(min(p, F) + 1):
            yield p, q, plane
            plane += 1 if q == 0 else 2


def planes(P: int, F: int) -> int:
    """Return the number of planes: (P + 1)^2 where F >= P."""
    return sum(1 if q == 0 else 2 for _, q, _ in terms(P, F))


def synthesise(lobe: LobeCoefficients, light: harmonics.Coefficients, rows: int) -> Array:
    """Return the planes of all maps of a lobe.

    Parameters
    ----------
    light : (3, n) complex
        L_lm to an order of at least `lobe.F`.
    rows : int
        S; the maps have S x 2 S samples at pixel centres.

    Returns
    -------
    (3, planes, S, 2 S)
    """
    F = lobe.F
    out = np.empty((3, planes(lobe.P, F), rows, 2 * rows), light.real.dtype)
    l, _ = harmonics.degrees(F)
    scale = np.ones(F + 1) if lobe.radial else np.sqrt(4 * np.pi / (2 * np.arange(F + 1) + 1))
    rho = np.broadcast_to(lobe.rho, (3, *lobe.rho.shape[1:])) * lobe.reflectance[:, None, None, None]

    def one(job: tuple[int, int, int, int]) -> None:
        channel, p, q, plane = job
        alm = (light[channel] * (scale * rho[channel, :, p, q])[l].astype(out.dtype))[None]
        harmonics.synthesise(alm, q, F, out[channel, plane : plane + (1 if q == 0 else 2)])

    jobs = [(c, *term) for c in range(3) for term in terms(lobe.P, F)]
    with ThreadPoolExecutor(harmonics.threads()) as pool:  # ducc0 lets go of the interpreter's lock
        list(pool.map(one, jobs))
    return out


def read(lobe: LobeCoefficients, stored: NDArray[np.floating], centre: Array, view: Array) -> Array:
    """Return the radiance (n, 3) that the planes (3, K, S, W) hold at central directions and views, both (n, 3)."""
    rows, columns = stored.shape[2:]
    even, odd = lookup.matrices(centre, rows, columns)
    out = np.zeros((len(centre), 3))
    weights = basis(lobe, to_local(view, centre))
    for _, q, first in terms(lobe.P, lobe.F):
        for plane in (first,) if q == 0 else (first, first + 1):
            for channel in range(3):
                out[:, channel] += (odd if q % 2 else even) @ stored[channel, plane].reshape(-1) * weights[plane]
    return out


def basis(lobe: LobeCoefficients, local_view: Array) -> Array:
    """Return what multiplies each plane at a view (n, 3) in the frame of the lobe's centre: shape (planes, n).

    Y_pq = a_pq(z) (x + i y)^q, with a_pq by the usual recurrence of normalised Legendre functions over p: no angle is
    needed, and no care at the poles.
    """
    if lobe.radial:
        return np.ones((1, len(local_view)))
    x, y, z = local_view.T
    turn = [np.ones_like(x) + 0j]
    a: dict[tuple[int, int], Array | float] = {(0, 0): np.sqrt(1 / (4 * np.pi))}
    for q in range(min(lobe.P, lobe.F) + 1):
        if q:
            turn.append(turn[-1] * (x + 1j * y))
            a[q, q] = -np.sqrt((2 * q + 1) / (2 * q)) * a[q - 1, q - 1]
        for p in range(q + 1, lobe.P + 1):
            below = np.sqrt(((p - 1) ** 2 - q**2) / (4 * (p - 1) ** 2 - 1)) * a[p - 2, q] if p > q + 1 else 0.0
            a[p, q] = np.sqrt((4 * p**2 - 1) / (p**2 - q**2)) * (z * a[p - 1, q] - below)
    out = np.empty((planes(lobe.P, lobe.F), len(local_view)))
    for p, q, plane in terms(lobe.P, lobe.F):
        if q == 0:
            out[plane] = a[p, 0]
        else:
            out[plane], out[plane + 1] = -2 * a[p, q] * turn[q].real, -2 * a[p, q] * turn[q].imag
    return out
