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
from methods.shrm.legendre import reduced

Array = NDArray[np.float64]


def terms(P: int, F: int, Q: int) -> Iterator[tuple[int, int, int]]:
    """Yield (p, q, plane): the terms 0 <= q <= Q of an order-P map and the first of the planes that each fills."""
    plane = 0
    for p in range(P + 1):
        for q in range(min(p, F, Q) + 1):
            yield p, q, plane
            plane += 1 if q == 0 else 2


def planes(P: int, F: int, Q: int) -> int:
    """Return the number of planes: (P + 1)^2 where F >= P and Q >= P, P + 1 where Q = 0."""
    return sum(1 if q == 0 else 2 for _, q, _ in terms(P, F, Q))


def synthesise(
    lobe: LobeCoefficients, light: harmonics.Coefficients, rows: int, columns: int | None = None
) -> NDArray[np.floating]:
    """Return the planes of all maps of a lobe.

    Parameters
    ----------
    light : (3, n) complex
        L_lm to an order of at least `lobe.F`.
    rows, columns : int
        The maps have S x 2 S samples at pixel centres, S = `rows`, or S x `columns`.

    Returns
    -------
    (3, planes, S, 2 S)
    """
    F = lobe.F
    out = np.empty((3, planes(lobe.P, F, lobe.Q), rows, columns or 2 * rows), light.real.dtype)
    alm = products(lobe, light)

    def one(job: tuple[int, int, int, int]) -> None:
        channel, term, q, plane = job
        first = alm[channel, term : term + 1]
        harmonics.synthesise(first, q, F, out[channel, plane : plane + (1 if q == 0 else 2)])

    jobs = [(c, i, q, plane) for c in range(3) for i, (_, q, plane) in enumerate(terms(lobe.P, F, lobe.Q))]
    with ThreadPoolExecutor(harmonics.threads()) as pool:  # ducc0 lets go of the interpreter's lock
        list(pool.map(one, jobs))
    return out


def products(lobe: LobeCoefficients, light: harmonics.Coefficients) -> harmonics.Coefficients:
    """Return the coefficients of every term of `terms` as `harmonics.synthesise` takes them: (3, terms, n)."""
    l, _ = harmonics.degrees(lobe.F)
    scale = np.ones(lobe.F + 1) if lobe.radial else np.sqrt(4 * np.pi / (2 * np.arange(lobe.F + 1) + 1))
    p, q, _ = np.array(list(terms(lobe.P, lobe.F, lobe.Q))).T
    rho = (lobe.rho * scale[:, None, None])[:, :, p, q] * lobe.reflectance[:, None, None]  # (3, F + 1, terms)
    return light[:, None] * np.moveaxis(rho, 1, 2)[..., l].astype(light.real.dtype)


def at(
    lobe: LobeCoefficients, alm: harmonics.Coefficients, where: NDArray[np.float64], accuracy: float
) -> NDArray[np.floating]:
    """Return what all planes hold at central directions (k, 2) of (theta, phi), summed there: shape (3, planes, k)."""
    out = np.empty((3, planes(lobe.P, lobe.F, lobe.Q), len(where)), alm.real.dtype)
    for i, (_, q, plane) in enumerate(terms(lobe.P, lobe.F, lobe.Q)):
        found = harmonics.synthesise_at(alm[:, i], lobe.F, where, accuracy, q)
        out[:, plane : plane + (1 if q == 0 else 2)] = found.reshape(3, -1, len(where))
    return out


def read(lobe: LobeCoefficients, stored: NDArray[np.floating], centre: Array, view: Array) -> Array:
    """Return the radiance (n, 3) that the planes (3, K, S, W) hold at central directions and views, both (n, 3)."""
    rows, columns = stored.shape[2:]
    even, odd = lookup.matrices(centre, rows, columns)
    out = np.zeros((len(centre), 3))
    weights = basis(lobe, to_local(view, centre))
    for _, q, first in terms(lobe.P, lobe.F, lobe.Q):
        for plane in (first,) if q == 0 else (first, first + 1):
            for channel in range(3):
                out[:, channel] += (odd if q % 2 else even) @ stored[channel, plane].reshape(-1) * weights[plane]
    return out


def basis(lobe: LobeCoefficients, local_view: Array) -> Array:
    """Return what multiplies each plane at a view (n, 3) in the frame of the lobe's centre: shape (planes, n)."""
    if lobe.radial:
        return np.ones((1, len(local_view)))
    x, y, z = local_view.T
    a = reduced(lobe.P, min(lobe.P, lobe.F, lobe.Q), z)
    turn = (x + 1j * y) ** np.arange(len(a))[:, None]
    out = np.empty((planes(lobe.P, lobe.F, lobe.Q), len(local_view)))
    for p, q, plane in terms(lobe.P, lobe.F, lobe.Q):
        if q == 0:
            out[plane] = a[0, p]
        else:
            out[plane], out[plane + 1] = -2 * a[q, p] * turn[q].real, -2 * a[q, p] * turn[q].imag
    return out
