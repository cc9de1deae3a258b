"""Filling the 3D texture: the light prefiltered with a lobe's average at each theta_o, in either of two ways."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from envbench import harmonics
from methods.angular.prefilter import prefilter
from methods.kautz_mccool.average import Average
from methods.kautz_mccool.radial import AzimuthalAverage


def synthesised(zonal: NDArray[np.float64], light: harmonics.Coefficients, rows: int) -> NDArray[np.float32]:
    """Convolve in frequency space: B_lm = g_l L_lm for each theta_o, the terms q = 0 of an SHRM summed over all p.

    Parameters
    ----------
    zonal : (C, T, F + 1)
    light : (3, n) complex
        L_lm to order F.

    Returns
    -------
    (rows, 2 rows, T, 3)
    """
    _, nodes, terms = zonal.shape
    l, _ = harmonics.degrees(terms - 1)
    filters = np.broadcast_to(zonal, (3, nodes, terms)).astype(light.real.dtype)
    out = np.empty((3, nodes, rows, 2 * rows), light.real.dtype)

    def one(job: tuple[int, int]) -> None:
        harmonics.synthesise((light[job[0]] * filters[job][l])[None], 0, terms - 1, out[job][None])

    with ThreadPoolExecutor(harmonics.threads()) as pool:  # ducc0 lets go of the interpreter's lock
        list(pool.map(one, np.ndindex(3, nodes)))
    return np.ascontiguousarray(np.moveaxis(out, (0, 1), (3, 2)), np.float32)


def summed(average: Average, radiance: NDArray[np.float32], rows: int, eps: float) -> NDArray[np.float32]:
    """Sum the light's texels (H, W, 3) in the cone that holds 1 - eps of the average; (rows, 2 rows, T, 3)."""
    lobes = (AzimuthalAverage.of(average, number) for number in range(len(average.shift)))
    return np.concatenate([prefilter(radiance, lobe, (rows, 2 * rows), eps)[:, :, 0] for lobe in lobes], axis=2)
