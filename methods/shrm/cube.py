"""A radially symmetric lobe's reflection map as six cube faces, straight from coefficients of light and lobe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envbench import cubemap, harmonics
from envbench.directions import to_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from methods.shrm.coefficients import LobeCoefficients

ACCURACY = 1e-4
"""What ducc0's synthesis at scattered directions may err by, relative to the RMS of the map."""


def texels(size: int) -> NDArray[np.float64]:
    """Return (theta, phi) of all texels of six `size` x `size` faces, shape (6 size^2, 2): once per resolution."""
    return np.stack(to_angles(cubemap.directions(size).reshape(-1, 3)), axis=-1)


def relight(
    lobe: LobeCoefficients, environment: Environment, where: NDArray[np.float64], precision: str = "float32"
) -> NDArray[np.floating]:
    """Return the reflected radiance (k, 3) of a radially symmetric lobe about the directions `where` (k, 2).

    B_lm = rho_l L_lm (RH 2002, eq. 5 with P = 0), summed at the directions themselves: no map lies between.
    """
    if not lobe.radial:
        raise BadInput("a cube of one value a texel holds radially symmetric lobes only; use whole lobes about R or N.")
    light = harmonics.analyse(environment.radiance.astype(precision, copy=False), lobe.F, lobe.significant)
    l, _ = harmonics.degrees(lobe.F)
    rho = (lobe.rho[:, :, 0, 0] * lobe.reflectance[:, None])[:, l].astype(light.real.dtype)
    return harmonics.synthesise_at(light * rho, lobe.F, where, ACCURACY).T
