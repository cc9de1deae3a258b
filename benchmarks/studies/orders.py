"""Orders and energies of lobes in the frequency domain, beside what Ramamoorthi and Hanrahan 2002 print.

The independent recomputation of `captured_energy` shares no code with the method: eq. 11 is written out once more, the
integral of eq. 13 is a product rule over all three angles, and the functions f_lq are SciPy's harmonics at phi = 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from data_gen.lobes import KajiyaKay, Microfacet
from data_gen.materials import MATERIALS, build
from envbench.material import Lobe
from envbench.records import Study
from methods.shrm.coefficients import captured, expand

TABLE_5 = {0.1: (24, 3), 0.2: (12, 2), 0.3: (7, 2), 0.4: (5, 2), 0.5: (5, 2)}
"""(F, P) for eps < .03 by sigma in radians, as table 5 prints them."""
EPS = 0.03
SIGMA, ORDER = 0.2, 30
RECOMPUTED = (0.875, 0.945, 0.977, 0.987, 0.991, 0.993)
"""Energy that F = `ORDER` holds at sigma = `SIGMA` by P, recomputed independently, to three decimals."""
CLOSE = 0.002


def microfacet_orders() -> Study:
    """Return the least orders at each sigma, the printed ones, and whether they agree."""
    rows: list[tuple[float | int | bool, ...]] = []
    for sigma, (F, P) in TABLE_5.items():
        found = expand(Microfacet(sigma=sigma, clipped=False), EPS)
        rows.append((sigma, found.F, F, abs(found.F - F) <= 1, found.P, P, found.P == P, found.missing))
    return Study(
        "microfacet-orders",
        "SHRM orders of the simplified microfacet beside table 5",
        f"Least P, and then least F, that leave out at most {EPS:g} of the energy of the whole lobe (RH 2002, eq. 11), "
        "beside the orders that table 5 of the paper prints.",
        ("sigma (rad)", "F", "F printed", "F within 1", "P", "P printed", "P as printed", "energy left out"),
        tuple(rows),
        (f"At sigma = 0.1, where the scan of table 5 reads P = 3, P = 2 leaves out {rows[0][-1]:.3g} already.",),
    )


def captured_energy() -> Study:
    """Return what F = `ORDER` holds by P: the method's, a product rule's, and what was recomputed before."""
    held = captured(Microfacet(sigma=SIGMA, clipped=False), ORDER, len(RECOMPUTED) - 1)
    again = by_product_rule(SIGMA, ORDER, len(RECOMPUTED) - 1)
    rows = tuple(
        (P, float(ours), known, float(ours - known), bool(abs(ours - known) <= CLOSE), float(rule), float(ours - rule))
        for P, (ours, known, rule) in enumerate(zip(held, RECOMPUTED, again, strict=True))
    )
    return Study(
        "captured-energy",
        f"Energy of the simplified microfacet by P, sigma = {SIGMA:g}, F = {ORDER}",
        "Share of the whole lobe's energy that the orders hold (RH 2002, sec. 7.1), beside values known to three "
        "decimals, and beside a product rule over the three angles, made anew from SciPy's harmonics and eq. 11.",
        ("P", "captured", "known", "difference", f"within {CLOSE:g}", "product rule", "difference from it"),
        rows,
    )


def by_product_rule(sigma: float, order: int, view_order: int, nodes: int = 96) -> NDArray[np.float64]:
    """Return the share of the energy that F = `order` holds at P = 0 ... `view_order`, by brute force.

    R is the pole. A view at theta_o from it has its normal half way, at theta_o / 2 in the plane phi = 0. Gauss's rule
    in both cosines, the midpoint rule in phi. With U_0 = 1, else 2 (eq. 13, and its Parseval sum):

        rho_lpq = 2 pi int int int rho_hat f_lq(theta_i) f_pq(theta_o) cos(q phi),  E = sum U_q rho_lpq^2
    """
    from scipy.special import sph_harm_y

    x, weight = np.polynomial.legendre.leggauss(nodes)
    theta, phi = np.arccos(x), (np.arange(nodes) + 0.5) * np.pi / nodes  # even in phi: half a turn, counted twice
    t_i, t_o, p = theta[:, None, None], theta[None, :, None], phi[None, None, :]
    light = np.broadcast_arrays(np.sin(t_i) * np.cos(p) + 0 * t_o, np.sin(t_i) * np.sin(p) + 0 * t_o, np.cos(t_i))
    half = light[0] + np.sin(t_o), light[1], light[2] + np.cos(t_o)
    along = half[0] * np.sin(t_o / 2) + half[2] * np.cos(t_o / 2)
    across = np.hypot(half[1], half[0] * np.cos(t_o / 2) - half[2] * np.sin(t_o / 2))
    rho = np.exp(-((np.arctan2(across, along) / sigma) ** 2)) / (4 * np.pi * sigma**2)
    step = 2 * np.pi / nodes
    total = 2 * np.pi * step * np.einsum("iop,i,o->", rho**2, weight, weight)
    energy = np.zeros(view_order + 1)
    for q in range(view_order + 1):
        by_q = step * rho @ np.cos(q * phi)
        f_l = np.stack([sph_harm_y(l, q, theta, 0.0).real * weight for l in range(q, order + 1)])
        f_p = np.stack([sph_harm_y(P, q, theta, 0.0).real * weight for P in range(q, view_order + 1)])
        energy[q:] += (1 if q == 0 else 2) * ((2 * np.pi * f_l @ by_q @ f_p.T) ** 2).sum(0)
    return energy.cumsum() / total


def claimed_orders() -> Study:
    """Return what two materials of the paper lose at the orders that it names for them."""
    (skin,) = build(MATERIALS["lafortune-skin"], "lafortune-skin").lobes
    hair = KajiyaKay(exponent=32)
    pooled = _lost(skin, 4)
    channels = [_lost(replace(skin, reflectance=one), 4) for one in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    strands = _lost(hair, 8)
    q = expand(hair, EPS, ORDER, 8).Q
    return Study(
        "claimed-orders",
        "Energy left out at the orders that the paper claims",
        f"RH 2002, sec. 7.1: P = 4 holds the whole BRDF of skin about R, and P = 8 the hair of exponent 32 about the "
        f"tangent, with q = 0 alone, all but {EPS:g} of the energy. At F = {ORDER}; skin pooled over red, green and "
        "blue by the power of each, and each by itself.",
        ("material", "P", "highest q", "energy left out", f"below {EPS:g}", "red", "green", "blue"),
        (
            ("Lafortune skin, whole, about R", 4, 4, pooled, pooled < EPS, *channels),
            ("Kajiya-Kay, s = 32, about T", 8, q, strands, strands < EPS, None, None, None),
        ),
        ("Green alone lies above the level: the claim holds of the energy pooled over the channels.",)
        if pooled < EPS < channels[1]
        else (),
    )


def _lost(lobe: Lobe, view_order: int) -> float:
    return 1 - float(captured(lobe, ORDER, view_order)[view_order])
