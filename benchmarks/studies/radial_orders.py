"""Orders of radially symmetric lobes beside the closed forms of RH 2002, sec. 6.3 and app. D."""

from __future__ import annotations

import numpy as np

from data_gen.lobes import Lambertian, Phong
from envbench.records import Study
from methods.shrm.coefficients import captured, expand

EPS = 0.01
EXPONENTS = (8, 16, 32, 64, 128, 256, 512)


def radial_orders() -> Study:
    """Return F at eps, the closed form, and how far the coefficients are from the Gaussian one."""
    rows: list[tuple[str | float | int | bool | None, ...]] = []
    for s in EXPONENTS:
        found = expand(Phong(exponent=float(s), clipped=False), EPS)
        l = np.arange(found.F + 1)
        # rho_l of the method is Lambda_l times the paper's: 1 at l = 0 for a lobe that integrates to 1
        off = found.rho[0, :, 0, 0] - np.exp(-(l**2) / (2 * s))
        near = float(np.sqrt(-s * np.log(EPS)))
        rows.append((f"Phong, s = {s}", float(s), found.F, found.P, near, float(found.F / near), found.missing,
                     float(np.abs(off).max())))  # fmt: skip
    held = float(captured(Lambertian(), 2, 0)[0])
    found = expand(Lambertian(), EPS)
    rows.append(("Lambertian", None, found.F, found.P, None, None, 1 - held, None))
    return Study(
        "radial-orders",
        f"Least order F of Phong and Lambertian lobes for eps = {EPS:g}, beside closed forms",
        "F = sqrt(-s ln eps) and rho_l ~ Lambda_l^-1 exp(-l^2 / 2s) (RH 2002, sec. 6.3, app. D); the difference of the "
        "coefficients is relative to the one of l = 0.",
        ("lobe", "s", "F", "P", "sqrt(-s ln eps)", "F over it", "energy left out", "largest difference of rho_l"),
        tuple(rows),
    )  # fmt: skip
