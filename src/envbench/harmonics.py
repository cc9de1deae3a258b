"""Spherical harmonics of light (CONVENTIONS.md): complex, orthonormal, Condon-Shortley; every transform is ducc0's.

Coefficients L_lm of a real function are kept for m >= 0 only, m-major as ducc0 wants them:
``[(l, m) for m in range(F + 1) for l in range(m, F + 1)]``, shape (C, (F + 1)(F + 2) / 2).
"""

from __future__ import annotations

import os
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import latlong
from envbench.errors import BadInput

Coefficients = NDArray[np.complexfloating]

# What turns samples of a piecewise linear function into its integral against a smooth one: hat functions of step d
# have the spectrum sinc^2(k d / 2) = 1 - x^2/12 + x^4/360 - ..., x = k d; these five taps agree through x^4.
HAT_TAPS = (-1 / 240, 1 / 10, 97 / 120, 1 / 10, -1 / 240)
HAT_LIMIT = 1.5
"""The largest x = F pi / H that the taps are used for: they err by x^6 / 7560, 1.5e-3 at degree F and 2e-5 at F / 2."""


def threads() -> int:
    """Return the number of threads that transforms use: the cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=32)
def degrees(order: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return l and m of each coefficient of an expansion to `order` F.

    Examples
    --------
    >>> l, m = degrees(2)
    >>> list(zip(l.tolist(), m.tolist()))
    [(0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2)]
    """
    m = np.repeat(np.arange(order + 1), order + 1 - np.arange(order + 1))
    l = np.concatenate([np.arange(k, order + 1) for k in range(order + 1)])
    l.flags.writeable = m.flags.writeable = False
    return l, m


def analyse(samples: NDArray[np.floating], order: int, smooth_beyond: int | None = None) -> Coefficients:
    """Return L_lm = int f Y_lm^* of the *bilinear* function f that a lat-long map means.

    Parameters
    ----------
    samples : (H, W, C) float32 or float64
        Values at the pixel centres; the precision of the samples is that of the transform.
    order : int
        F >= 0.
    smooth_beyond : int, optional
        Degree beyond which the coefficients will be damped to nothing (a smooth lobe asked to a high order): the map is
        refined for degrees up to here only. Default `order`.

    Returns
    -------
    (C, (F + 1)(F + 2) / 2) complex
        Exact but for the taps' truncation (`HAT_LIMIT`) and what lies beyond the map's own band.
    """
    import ducc0

    if order < 0:
        raise BadInput(f"the order of an expansion must be >= 0. Got {order} instead.")
    samples = _refined(samples, order, order if smooth_beyond is None else smooth_beyond)
    height, width, channels = samples.shape
    # Fejer's rule on all rows: ducc0's analysis first resamples to the order's own rows, and so lets detail of the
    # light leak into low degrees (measured: 4 % of the result for Phong s = 8, F = 9, under a captured sun)
    weights = ducc0.sht.get_gridweights("F1", height) / width
    interleaved = samples if samples.flags.c_contiguous else np.ascontiguousarray(samples)
    by_row = ducc0.sht.map2leg(
        map=interleaved.reshape(-1, channels).T, mmax=order, nthreads=threads(),
        nphi=np.full(height, width, np.uint64), phi0=np.full(height, np.pi / width),
        ringstart=np.arange(height, dtype=np.uint64) * width,
    )  # fmt: skip
    m = np.arange(order + 1)
    by_row = _hat_filtered(by_row, weights, np.sinc(m / width) ** 2)  # between columns exact: a ring is one period
    theta, _ = latlong.angles(height, width)
    return np.concatenate([
        ducc0.sht.leg2alm(leg=by_row[c : c + 1], lmax=order, theta=theta, nthreads=threads()) for c in range(channels)
    ])  # fmt: skip


def truncate(alm: Coefficients, order: int, lower: int) -> Coefficients:
    """Return the coefficients up to `lower` of an expansion `alm` (C, n) to `order`."""
    if lower == order:
        return alm
    l, m = degrees(order)
    return alm[:, (l <= lower) & (m <= lower)]


def synthesise(alm: Coefficients, spin: int, order: int, out: NDArray[np.floating], nthreads: int = 1) -> None:
    """Fill `out` with a spin-`spin` synthesis on the pixel centres of a lat-long map.

    Parameters
    ----------
    alm : (1, n) complex
        E-mode coefficients; for spin 0 the ordinary ones.
    out : (1, S, W) for spin 0, else (2, S, W)
        ducc0's map, or its two components (Q, U).
    """
    import ducc0

    ducc0.sht.synthesis_2d(
        alm=alm, map=out, spin=spin, lmax=order, geometry="F1", phi0=np.pi / out.shape[2], nthreads=nthreads,
        mode="STANDARD" if spin == 0 else "GRAD_ONLY",
    )  # fmt: skip


def synthesise_at(
    alm: Coefficients, order: int, theta_phi: NDArray[np.float64], accuracy: float, spin: int = 0
) -> NDArray[Any]:
    """Evaluate functions at scattered directions.

    Parameters
    ----------
    alm : (C, n) complex
        As `synthesise` takes them, one function each.
    theta_phi : (k, 2)
    accuracy : float
        What the result may err by, relative to its RMS; ducc0 wants at least 1e-6 in single precision.

    Returns
    -------
    (C, k) for spin 0, else (2 C, k): Q and U of each in turn
    """
    import ducc0

    return np.concatenate([
        ducc0.sht.synthesis_general(
            alm=alm[c : c + 1], spin=spin, lmax=order, loc=theta_phi, epsilon=accuracy, nthreads=threads(),
            mode="STANDARD" if spin == 0 else "GRAD_ONLY",
        )
        for c in range(len(alm))
    ])  # fmt: skip


def _refined(samples: NDArray[Any], order: int, significant: int) -> NDArray[Any]:
    """Resample the bilinear function to more rows where the map has too few for `order` (ducc0) or for the taps."""
    height, width = samples.shape[:2]
    rows = max(order + 1, int(np.ceil(min(significant, order) * np.pi / HAT_LIMIT)))
    columns = 2 * order + 2
    if height >= rows and width >= columns:
        return samples
    # odd, so that the old samples are among the new ones and both mean the same function
    factor = max(-(-rows // height), -(-columns // width)) // 2 * 2 + 1
    fine = latlong.interpolate(samples, latlong.grid(factor * height, factor * width))
    return fine.astype(samples.dtype)


def _hat_filtered(by_row: Coefficients, weights: NDArray[np.float64], columns: NDArray[np.float64]) -> Coefficients:
    """Apply `HAT_TAPS` along theta to f_m(theta), (C, H, F + 1), then each row's weight and each m's factor.

    Beyond a pole a row meets its half-turned self, which multiplies f_m by (-1)^m.
    """
    sign = np.where(np.arange(by_row.shape[2]) % 2, -1, 1).astype(by_row.real.dtype)
    above, below = sign * by_row[:, 1::-1], sign * by_row[:, :-3:-1]
    padded = np.concatenate([above, by_row, below], axis=1)
    c, b, a = (by_row.real.dtype.type(tap) for tap in HAT_TAPS[:3])
    out = a * padded[:, 2:-2] + b * (padded[:, 1:-3] + padded[:, 3:-1]) + c * (padded[:, :-4] + padded[:, 4:])
    out *= (weights[:, None] * columns).astype(sign.dtype)
    return out
