"""Spherical harmonic coefficients of a lobe, and the orders that hold 1 - eps of its energy (RH 2002, app. A and C).

    rho_lpq = 2 pi int int int rho_hat f_lq(theta_i) f_pq(theta_o) cos(q phi) sin theta_i sin theta_o   (eq. 13)

with Y_lm = f_lm e^(i m phi). The energy, 2 pi int rho_hat^2 over theta_i, theta_o and phi, is sum U_q rho_lpq^2 with
U_0 = 1, else 2. A radially symmetric lobe has P = 0 and rho_l = 2 pi int rho_hat P_l instead, with energy
sum (2 l + 1) / (4 pi) rho_l^2.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

from envbench.directions import from_angles
from envbench.harmonics import threads
from envbench.material import Centre, Lobe

Array = NDArray[np.float64]

MAX_F = 511
MAX_P = 12
VIEW_NODES, AZIMUTHS = 64, 96
"""Samples of theta_o in [0, pi] and intervals of phi in [0, pi]: what a lobe's clipped edge needs, P itself is low."""


@dataclass(frozen=True)
class LobeCoefficients:
    """A lobe in the frequency domain.

    Attributes
    ----------
    rho : (channels, F + 1, P + 1, P + 1)
        rho_lpq, zero for q > min(l, p); for a radially symmetric lobe rho_l, shape (channels, F + 1, 1, 1).
    radial : bool
    reflectance : (3,)
    total : float
        Energy of the whole expansion, by quadrature, pooled over r, g and b.
    missing : float
        1 - captured energy: the share of `total` that the orders leave out.
    missing_constant : float
        The same for what the lobe integrates to (l = 0): the energy error under constant light.
    """

    centre: Centre
    rho: Array
    radial: bool
    reflectance: Array
    total: float
    missing: float
    missing_constant: float

    @property
    def F(self) -> int:  # noqa: N802
        """Order in (alpha, beta)."""
        return self.rho.shape[1] - 1

    @property
    def P(self) -> int:  # noqa: N802
        """Order in (theta_o, phi_o)."""
        return self.rho.shape[2] - 1

    @property
    def significant(self) -> int:
        """The degree that holds all but 1e-10 of the captured energy: beyond it light hardly counts."""
        by_degree = energies(self.rho, self.radial, np.ones(len(self.rho))).sum(1)
        return int(np.searchsorted(np.cumsum(by_degree), (1 - 1e-10) * by_degree.sum()))


def expand(lobe: Lobe, eps: float, order: int | None = None, view_order: int | None = None) -> LobeCoefficients:
    """Expand a lobe to the least P, then the least F, that hold 1 - eps of its energy, or to the orders given.

    Where no orders up to `MAX_F`, `MAX_P` hold so much, the best are used: see `LobeCoefficients.missing`.
    """
    reflectance = np.asarray(lobe.reflectance, float)
    weight = reflectance**2 if lobe.channels == 3 else np.array([np.sum(reflectance**2)])
    highest = 31 if order is None else order
    while True:
        if lobe.radially_symmetric:
            rho, totals, constants = _radial(lobe, highest)
        else:
            rho, totals, constants = _full(lobe, highest, MAX_P if view_order is None else view_order)
        total = float(totals @ weight)
        energy = energies(rho, lobe.radially_symmetric, weight)
        captured = energy.cumsum(0).cumsum(1)  # [F, P]
        lost = total - captured[-1, -1]
        ended = energy[3 * highest // 4 :].sum() <= 0.02 * max(eps * total, lost)  # a higher F would bring little
        if order is not None or highest >= MAX_F or captured[-1, -1] >= (1 - eps) * total or ended:
            break
        highest = min(2 * highest + 1, MAX_F)
    wanted = min((1 - eps) * total, captured[-1, -1] - 0.02 * eps * total)
    P = int(np.argmax(captured[-1] >= wanted)) if view_order is None else view_order
    F = int(np.argmax(captured[:, P] >= min(wanted, captured[-1, P] - 0.02 * eps * total))) if order is None else order
    rho = rho[:, : F + 1, : P + 1, : P + 1].copy()
    missing = _share_missing(captured[F, P], total)
    constant = _share_missing(captured[0, P], float(constants @ weight))
    return LobeCoefficients(lobe.centre, rho, lobe.radially_symmetric, reflectance, total, missing, constant)


def _share_missing(captured: float, total: float) -> float:
    return max(float(1 - captured / total), 0.0) if total > 0 else 0.0


def energies(rho: Array, radial: bool, weight: Array) -> Array:
    """Return the energy of each (l, p), (F + 1, P + 1), pooled over channels by `weight` (squared reflectance)."""
    if radial:
        by_channel = rho[..., 0] ** 2 * ((2 * np.arange(rho.shape[1]) + 1) / (4 * np.pi))[:, None]
    else:
        by_channel = (rho**2 * np.where(np.arange(rho.shape[3]) == 0, 1.0, 2.0)).sum(-1)
    return np.einsum("clp,c->lp", by_channel, weight)


def _radial(lobe: Lobe, order: int) -> tuple[Array, Array, Array]:
    """rho_l by Gauss-Legendre in t, theta = theta* t^2: fine where the lobe is narrow."""
    n = max(4 * order, 512)
    t, w = special.roots_legendre(n)
    t, w = (t + 1) / 2, w / 2
    end = lobe.cone(1e-300)
    theta = end * t**2
    weight = w * 2 * end * t * np.sin(theta)
    values = _local(lobe, theta[:, None], np.array([[0.0]]), np.array([[0.0]]))[:, :, 0]
    legendre = special.legendre_p_all(order, np.cos(theta))[0]
    rho = 2 * np.pi * (values * weight) @ legendre.T
    return rho[:, :, None, None], 2 * np.pi * (values**2 * weight).sum(-1), rho[:, 0] ** 2 / (4 * np.pi)


def _full(lobe: Lobe, order: int, view_order: int) -> tuple[Array, Array, Array]:
    """The three sums of appendix C: over phi by FFT (DCT-I), over theta_o and theta_i by Gauss-Legendre."""
    x_i, w_i = special.roots_legendre(max(3 * order, 128))
    x_o, w_o = special.roots_legendre(VIEW_NODES)
    phi = np.pi * np.arange(AZIMUTHS + 1) / AZIMUTHS  # the lobe is even in phi: half a turn, by the cosine transform
    step = 2 * np.pi * (np.pi / AZIMUTHS)
    ends = np.where((phi == 0) | (phi == np.pi), 1.0, 2.0)
    theta_i, theta_o = np.arccos(x_i), np.arccos(x_o)
    f_i = _associated(order, view_order, x_i)  # (F+1, P+1 of q, n_i)
    f_o = _associated(view_order, view_order, x_o)

    def seen_from(angle: float) -> tuple[Array, Array]:  # one view at a time bounds memory
        values = _local(lobe, theta_i[:, None], np.full((1, 1), angle), phi[None, :])  # (c, n_i, n_phi)
        energy = np.einsum("cij,i,j->c", values**2, w_i, ends, optimize=True) * step
        return energy, np.asarray(fft.dct(values, type=1, axis=-1))[..., : view_order + 1] * step

    with ThreadPoolExecutor(threads()) as pool:
        by_view, cosines = map(np.stack, zip(*pool.map(seen_from, theta_o), strict=True))  # (n_o, c, ...)
    by_p = np.einsum("ocnq,pqo,o->cnpq", cosines, f_o, w_o, optimize=True)
    rho = np.einsum("cnpq,lqn,n->clpq", by_p, f_i, w_i, optimize=True)
    # Parseval in theta_o alone: sum_p rho_0p0^2 = (1 / 2 pi) int g^2, g the integral of the lobe times f_00
    integral = np.einsum("ocn,n->oc", cosines[..., 0], w_i * f_i[0, 0])
    return rho, w_o @ by_view, np.einsum("oc,o->c", integral**2, w_o) / (2 * np.pi)


def _associated(degree: int, order: int, x: Array) -> Array:
    """f_lm(theta) = Y_lm e^(-i m phi), shape (degree + 1, order + 1, len(x)), zero for m > l."""
    return special.sph_legendre_p_all(degree, order, np.arccos(x))[0][:, : order + 1]


def _local(lobe: Lobe, theta_i: Array, theta_o: Array, phi: Array) -> Array:
    """Evaluate the lobe, clipping included, in the frame of its centre: C = z, V in the xz plane; (channels, ...)."""
    light: Any = np.moveaxis(from_angles(theta_i, phi), -1, 0)
    view: Any = np.moveaxis(from_angles(theta_o, 0.0), -1, 0)
    centre = np.array([0.0, 0.0, 1.0]).reshape(3, *(1,) * (light.ndim - 1))
    normal = centre
    if lobe.centre is Centre.REFLECTION:
        half = view + centre
        normal = half / np.sqrt((half**2).sum(0))
    values = replace(lobe, reflectance=(1.0, 1.0, 1.0)).evaluate(light, view, centre, normal)
    return np.stack(np.broadcast_arrays(*values[: lobe.channels]))
