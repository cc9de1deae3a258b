"""A lobe's spherical harmonics in the light alone, view by view: the first two of the three sums of RH 2002, app. C.

    r_lq(theta_o) = int int rho_hat(theta_i, theta_o, phi) f_lq(theta_i) cos(q phi) sin theta_i dtheta_i dphi

with Y_lm = f_lm e^(i m phi). Its energy in the light is sum_lq U_q r_lq^2 = int rho_hat^2, U_0 = 1, else 2. A lobe that
does not depend on phi has q = 0 only; one that does not depend on the view either has a single node of theta_o.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from envbench.directions import from_angles
from envbench.harmonics import threads
from envbench.material import Centre, Lobe
from methods.shrm.legendre import associated

Array = NDArray[np.float64]

VIEWS = 64
"""Nodes of theta_o in [0, pi]."""
AZIMUTHS = 64
"""Intervals of phi in [0, pi]; half as many Gauss-Legendre nodes where the horizon cuts it short."""
_TAIL = 1e-16
"""Part of a lobe's integral that may lie outside the cone that is sampled."""


@dataclass(frozen=True)
class Spectrum:
    """r_lq of one lobe at nodes of theta_o.

    Attributes
    ----------
    cosines, weights : (n_o,)
        Gauss-Legendre in cos theta_o over [-1, 1]; the weights sum to 2.
    r : (channels, n_o, F + 1, Q + 1)
    energy : (channels, n_o)
        int rho_hat^2 over light, by quadrature: what no order leaves out.
    """

    cosines: Array
    weights: Array
    r: Array
    energy: Array

    @property
    def totals(self) -> Array:
        """Energy over light and view, 2 pi int int int rho_hat^2, of each channel."""
        return 2 * np.pi * self.energy @ self.weights

    def energies(self, weight: Array) -> Array:
        """Return the energy of each degree l, (F + 1,), over all views, channels pooled by `weight`."""
        U = np.where(np.arange(self.r.shape[3]) == 0, 1.0, 2.0)
        return 2 * np.pi * np.einsum("colq,colq,o,q,c->l", self.r, self.r, self.weights, U, weight, optimize=True)

    def by_view(self, P: int) -> Array:
        """Return rho_lpq, (channels, F + 1, P + 1, Q + 1): the third sum, over theta_o."""
        f = associated(P, self.r.shape[3] - 1, np.arccos(self.cosines))
        return 2 * np.pi * np.einsum("colq,qpo,o->clpq", self.r, f, self.weights, optimize=True)


def spectrum(lobe: Lobe, order: int, azimuthal: int) -> Spectrum:
    """Return r_lq for l <= `order` and q <= `azimuthal`, of the lobe as it is, clipping included, reflectance aside.

    Nodes in theta_i are those of Gauss-Legendre in t, theta_i = end t^2: fine where a lobe is narrow, and none beyond
    the cone that holds it. About R the horizon cuts each circle of theta_i at +-phi_c, cos phi_c = -cot theta_i
    cot(theta_o / 2): phi is integrated up to it.
    """
    end = min(lobe.cone(_TAIL), np.pi)
    if lobe.clipped and lobe.centre is Centre.NORMAL:
        end = min(end, np.pi / 2)
    count = max(160, int(1.4 * order * end)) + 32  # degrees l <= order times as high ones of the lobe
    t, w_t = special.roots_legendre(count)
    t, w_t = (t + 1) / 2, w_t / 2
    theta = end * t**2
    w_i = w_t * 2 * end * t * np.sin(theta)
    cosines, w_o = (np.zeros(1), np.full(1, 2.0)) if lobe.radially_symmetric else special.roots_legendre(VIEWS)
    Q = 0 if lobe.azimuthally_symmetric else azimuthal
    cut = lobe.clipped and lobe.centre is Centre.REFLECTION and not lobe.azimuthally_symmetric

    def seen_from(angle: float) -> tuple[Array, Array]:  # one view at a time bounds memory
        phi, w_phi = _azimuths(theta, angle, cut, 1 if Q == 0 and lobe.azimuthally_symmetric else AZIMUTHS)
        values = _local(lobe, theta[:, None], np.full((1, 1), angle), phi)  # (c, n_i, n_phi)
        weighted = values * w_phi
        energy = np.einsum("cij,cij,i->c", values, weighted, w_i, optimize=True)
        q = np.arange(Q + 1)
        if len(phi) == 1:
            return energy, weighted @ np.cos(q * phi[0][:, None])
        out = np.empty((*weighted.shape[:2], Q + 1))
        turn = np.cos(phi)
        now, before = np.ones_like(phi), turn
        for k in q:  # cos((k + 1) phi) = 2 cos(phi) cos(k phi) - cos((k - 1) phi)
            out[..., k] = np.einsum("cij,ij->ci", weighted, now)
            now, before = 2 * turn * now - before, now
        return energy, out

    with ThreadPoolExecutor(threads()) as pool:
        energy, sums = map(np.stack, zip(*pool.map(seen_from, np.arccos(cosines)), strict=True))  # (n_o, c, ...)
    f_i = associated(order, Q, theta) * w_i
    r = np.matmul(np.moveaxis(sums, 3, 0).reshape(Q + 1, -1, count), np.swapaxes(f_i, 1, 2))
    r = np.moveaxis(r.reshape(Q + 1, len(cosines), -1, order + 1), (2, 1, 3, 0), (0, 1, 2, 3))
    return Spectrum(cosines, w_o, r, energy.T)


def _azimuths(theta_i: Array, theta_o: float, cut: bool, intervals: int) -> tuple[Array, Array]:
    """Return nodes of phi, (1 or n_i, k), and weights for twice the integral over [0, pi], where the light is seen."""
    if not cut:
        if intervals == 1:
            return np.zeros((1, 1)), np.full((1, 1), 2 * np.pi)
        phi = np.pi * np.arange(intervals + 1) / intervals
        return phi[None], np.where((phi == 0) | (phi == np.pi), 0.5, 1.0)[None] * (2 * np.pi / intervals)
    x, w = special.roots_legendre(intervals // 2)
    level = -np.cos(theta_i) * np.cos(theta_o / 2) / np.maximum(np.sin(theta_i) * np.sin(theta_o / 2), 1e-300)
    edge = np.arccos(np.clip(level, -1, 1))[:, None]
    return edge * (x + 1) / 2, edge * w


def _local(lobe: Lobe, theta_i: Array, theta_o: Array, phi: Array) -> Array:
    """Evaluate the lobe in the frame of its centre: C = z, V in the xz plane; (channels, ...), reflectance aside."""
    light: Any = np.moveaxis(from_angles(theta_i, phi), -1, 0)
    view: Any = np.moveaxis(from_angles(theta_o, 0.0), -1, 0)
    centre = np.array([0.0, 0.0, 1.0]).reshape(3, *(1,) * (light.ndim - 1))
    normal = centre
    if lobe.centre is Centre.REFLECTION:
        # the half vector of V and R, from its angle: the sum of the two vanishes towards grazing, theta_o = pi
        normal = np.moveaxis(from_angles(np.asarray(theta_o) / 2, 0.0), -1, 0)
    values = replace(lobe, reflectance=(1.0, 1.0, 1.0)).evaluate(light, view, centre, normal)
    return np.stack(np.broadcast_arrays(*values[: lobe.channels]))
