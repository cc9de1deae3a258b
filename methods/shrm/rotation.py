"""From V in the frame of a central direction to V in global coordinates: equation 8 of RH 2002, for many directions.

Real harmonics are those of `envbench.real_harmonics`. A turn about z by t mixes m and -m alone, by cos(m t) and
sin(m t). A turn about y is one about z between two fixed quarter turns about x,

    R(alpha, beta) = Rz(beta) Ry(alpha) = Rz(beta) Rx(-pi/2) Rz(alpha) Rx(pi/2),

so that all directions together take two products with one small orthogonal matrix a band.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envbench.directions import uniform
from envbench.real_harmonics import basis
from methods.shrm import maps
from methods.shrm.coefficients import LobeCoefficients

Array = NDArray[np.float64]


def to_global(lobe: LobeCoefficients, planes: NDArray[np.floating], theta_phi: Array) -> NDArray[np.floating]:
    """Return real coefficients in global coordinates, ((P + 1)^2, k, 3), of planes (3, K, k) at central directions.

    Parameters
    ----------
    planes : (3, K, k)
        What the planes of `methods.shrm.maps` hold at k central directions.
    theta_phi : (k, 2)
        Those directions: alpha and beta.
    """
    alpha, beta = theta_phi.astype(planes.dtype).T
    out = np.zeros(((lobe.P + 1) ** 2, planes.shape[2], 3), planes.dtype)
    for p, q, plane in maps.terms(lobe.P, lobe.F, lobe.Q):
        at = p * p + p
        if q == 0:
            out[at] = planes[:, plane].T
        else:
            # B = ... - 2 (Q Re Y + U Im Y): `maps`
            out[at + q], out[at - q] = -np.sqrt(2) * planes[:, plane].T, -np.sqrt(2) * planes[:, plane + 1].T
    for p in range(1, lobe.P + 1):
        band = slice(p * p, (p + 1) ** 2)
        quarter = _quarter_turn(p).astype(planes.dtype)
        turned = (quarter @ out[band].reshape(2 * p + 1, -1)).reshape(2 * p + 1, -1, 3)
        turned = (quarter.T @ _about_z(turned, alpha).reshape(2 * p + 1, -1)).reshape(2 * p + 1, -1, 3)
        out[band] = _about_z(turned, beta)
    return out


def _about_z(band: NDArray[np.floating], angle: NDArray[np.floating]) -> NDArray[np.floating]:
    """Turn the coefficients of one band (2 p + 1, k, 3) about z by angles (k,): f(phi) becomes f(phi - angle)."""
    p = len(band) // 2
    q = np.arange(1, p + 1, dtype=angle.dtype)[:, None]
    cosine, sine = np.cos(q * angle)[..., None], np.sin(q * angle)[..., None]
    even, odd = band[p + 1 :], band[p - 1 :: -1] if p else band[:0]
    out = np.empty_like(band)
    out[p] = band[p]
    out[p + 1 :] = even * cosine - odd * sine
    out[p - 1 :: -1] = even * sine + odd * cosine
    return out


def _quarter_turn(p: int) -> Array:
    """Return the orthogonal matrix of band p that turns a function by pi/2 about x."""
    directions = uniform(8 * p + 8, np.random.default_rng(0))
    back = directions[:, [0, 2, 1]] * [1, 1, -1]  # Rx(-pi/2) v = (x, z, -y)
    before, after = (basis(p, d)[p * p :] for d in (directions, back))
    return np.asarray(np.linalg.lstsq(before.T, after.T, rcond=None)[0], float)
