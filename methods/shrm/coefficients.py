"""Spherical harmonic coefficients of a lobe, and the orders that hold 1 - eps of its energy (RH 2002, app. A and C).

    rho_lpq = 2 pi int int int rho_hat f_lq(theta_i) f_pq(theta_o) cos(q phi) sin theta_i sin theta_o   (eq. 13)

The energy, 2 pi int rho_hat^2 over theta_i, theta_o and phi, is sum U_q rho_lpq^2 with U_0 = 1, else 2. A radially
symmetric lobe has P = 0 and is kept as rho_l = 2 pi int rho_hat P_l, with rho_l00 = sqrt(2 l + 1) rho_l; one that does
not depend on phi has q = 0 only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from envbench.material import Centre, Lobe
from methods.shrm.spectrum import Spectrum, spectrum

Array = NDArray[np.float64]

MAX_F = 1023
MAX_P = 16
MAX_TERMS = 2**19
"""(F + 1)^2 (P + 1)^2 of orders that are chosen, (F + 1)^2 (P + 1) where q = 0: maps of 768 bytes a term at S = 4 F."""


@dataclass(frozen=True)
class LobeCoefficients:
    """A lobe in the frequency domain.

    Attributes
    ----------
    rho : (channels, F + 1, P + 1, Q + 1)
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
    def Q(self) -> int:  # noqa: N802
        """Order in phi_o: the highest q that is kept, 0 where the lobe does not depend on phi."""
        return self.rho.shape[3] - 1

    @property
    def significant(self) -> int:
        """The degree that holds all but 1e-10 of the captured energy: beyond it light hardly counts."""
        by_degree = energies(self.full, np.ones(len(self.rho))).sum(1)
        return int(np.searchsorted(np.cumsum(by_degree), (1 - 1e-10) * by_degree.sum()))

    @property
    def full(self) -> Array:
        """rho_lpq of a radially symmetric lobe too."""
        return self.rho * np.sqrt(2 * np.arange(self.F + 1) + 1)[:, None, None] if self.radial else self.rho


def expand(lobe: Lobe, eps: float, order: int | None = None, view_order: int | None = None) -> LobeCoefficients:
    """Expand a lobe to the least P, then the least F, that hold 1 - eps of its energy, or to the orders given.

    Where no orders up to `MAX_F`, `MAX_P` and `MAX_TERMS` hold so much, the best are used: see
    `LobeCoefficients.missing`.
    """
    reflectance = np.asarray(lobe.reflectance, float)
    weight = pooled(lobe)
    most = 0 if lobe.radially_symmetric else MAX_P if view_order is None else view_order
    highest = _first_guess(lobe) if order is None else order
    while True:
        seen = spectrum(lobe, highest, most)
        rho = seen.by_view(most)
        total = float(seen.totals @ weight)
        energy = energies(rho, weight)
        captured = energy.cumsum(0).cumsum(1)  # [F, P]
        lost = total - captured[-1, -1]
        ended = energy[3 * highest // 4 :].sum() <= 0.02 * max(eps * total, lost)  # a higher F would bring little
        if order is not None or highest >= MAX_F or captured[-1, -1] >= (1 - eps) * total or ended:
            break
        highest = min(2 * highest + 1, MAX_F)
    F, P = _orders(captured, eps, total, rho.shape[3] == 1, order, None if view_order is None else most)
    rho = rho[:, : F + 1, : P + 1, : P + 1].copy()
    if lobe.radially_symmetric:
        rho /= np.sqrt(2 * np.arange(F + 1) + 1)[:, None, None]
    missing = _share_missing(captured[F, P], total)
    constant = _share_missing(captured[0, P], float(_constant(seen) @ weight))
    return LobeCoefficients(lobe.centre, rho, lobe.radially_symmetric, reflectance, total, missing, constant)


def _orders(
    captured: Array, eps: float, total: float, zonal: bool, order: int | None, view_order: int | None
) -> tuple[int, int]:
    """Return F and P as given, or the least P and F that hold enough, or what holds most within `MAX_TERMS`."""
    f, p = np.ogrid[: captured.shape[0], : captured.shape[1]]
    allowed = (f + 1) ** 2 * (p + 1) ** (1 if zonal else 2) <= MAX_TERMS
    if order is not None:
        allowed = f == order
    if view_order is not None:
        allowed = allowed & (p == view_order) if order is None else (f == order) & (p == view_order)
    held = np.where(allowed, captured, -1.0)
    best = held.max()  # where that is not enough, nor are the orders spent on its last tenth
    wanted = min((1 - eps) * total, best - max(0.02 * eps * total, 0.1 * (total - best)))
    P = int(np.argmax(held.max(0) >= wanted))
    return int(np.argmax(held[:, P] >= min(wanted, held[:, P].max()))), P


def together(lobes: Sequence[LobeCoefficients]) -> LobeCoefficients:
    """Return the sum of lobes about one centre, to the highest of their orders; energies as if they were orthogonal."""
    first, *others = lobes
    if not others:
        return first
    radial = all(lobe.radial for lobe in lobes)
    F, P, Q = max(c.F for c in lobes), max(c.P for c in lobes), max(c.Q for c in lobes)
    rho = np.zeros((3, F + 1, P + 1, Q + 1))
    for c in lobes:
        coefficients = c.rho if radial else c.full
        rho[:, : c.F + 1, : c.P + 1, : c.Q + 1] += coefficients * c.reflectance[:, None, None, None]
    total = sum(c.total for c in lobes)
    share = [c.total / total if total else 0.0 for c in lobes]
    missing = sum(s * c.missing for s, c in zip(share, lobes, strict=True))
    constant = max(c.missing_constant for c in lobes)
    return LobeCoefficients(first.centre, rho, radial, np.ones(3), total, missing, constant)


def _first_guess(lobe: Lobe) -> int:
    """Return 31, or the least doubling of it beyond 3 / theta, theta the cone of half a lobe: cos^s has 2.5 at .01."""
    return min(32 * 2 ** int(np.ceil(np.log2(max(3 / lobe.cone(0.5) / 32, 1)))) - 1, MAX_F)


def captured(lobe: Lobe, F: int, P_max: int) -> Array:
    """Return the share of a lobe's energy that order F holds at P = 0 ... `P_max`, (P_max + 1,)."""
    seen, weight = spectrum(lobe, F, P_max), pooled(lobe)
    total = float(seen.totals @ weight)
    held = energies(seen.by_view(P_max), weight).sum(0).cumsum()
    return held / total if total > 0 else np.ones(P_max + 1)


def pooled(lobe: Lobe) -> Array:
    """Return what each channel's energy counts: squared reflectance, summed where r, g and b share one shape."""
    squared = np.asarray(lobe.reflectance, float) ** 2
    return squared if lobe.channels == 3 else squared.sum(keepdims=True)


def energies(rho: Array, weight: Array) -> Array:
    """Return the energy of each (l, p), (F + 1, P + 1), of rho_lpq, pooled over channels by `weight`."""
    U = np.where(np.arange(rho.shape[3]) == 0, 1.0, 2.0)
    return np.einsum("clpq,q,c->lp", rho**2, U, weight, optimize=True)


def _constant(seen: Spectrum) -> Array:
    """Energy of l = 0 in all p, of each channel."""
    return 2 * np.pi * seen.r[:, :, 0, 0] ** 2 @ seen.weights


def _share_missing(held: float, total: float) -> float:
    return max(float(1 - held / total), 0.0) if total > 0 else 0.0
