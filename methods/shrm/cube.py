"""Reflection maps as six cube faces, straight from coefficients of light and lobe, and bicubic lookup in them.

Faces for lookup carry a border of `BORDER` texels: more of the face's own plane, beyond its edge, where the map is a
function of directions like anywhere else. So no lookup needs a neighbouring face.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from envbench import cubemap, harmonics
from envbench.directions import to_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from methods.shrm import lookup
from methods.shrm.coefficients import LobeCoefficients

ACCURACY = 1e-4
"""What ducc0's synthesis at scattered directions may err by, relative to the RMS of the map."""


BORDER = 2


def texels(size: int, border: int = 0) -> NDArray[np.float64]:
    """Return (theta, phi) of all texels of six `size` x `size` faces with their borders, (6 (size + 2 border)^2, 2)."""
    a = (2 * np.arange(-border, size + border) + 1) / size - 1
    face = np.stack([*np.meshgrid(a, a), np.ones((len(a), len(a)))], -1)
    right_up_forward = np.einsum("fkc,ijc->fijk", cubemap.FACES, face).reshape(-1, 3)
    return np.stack(to_angles(right_up_forward[:, [2, 0, 1]]), axis=-1)


def matrix(directions: NDArray[np.float64], size: int) -> sparse.csr_array:
    """Return the interpolation matrix (n, texels) of faces with borders."""
    seen = directions[:, [1, 2, 0]]  # right, up, forward
    forward = cubemap.FACES[:, :, 2]  # of each face, its middle
    face = np.argmax(seen @ forward.T, axis=1)
    a, b, depth = np.einsum("nkc,nk->cn", cubemap.FACES[face], seen)
    width = size + 2 * BORDER
    x, fx = lookup.split((a / depth + 1) * size / 2 - 0.5)
    y, fy = lookup.split((b / depth + 1) * size / 2 - 0.5)
    taps = np.arange(-1, 3) + BORDER
    column, row = x[:, None, None] + taps, (y[:, None] + taps)[:, :, None]
    index = ((face[:, None, None] * width + row) * width + column).reshape(-1).astype(np.int32)
    weights = (lookup.lagrange(fy)[:, :, None] * lookup.lagrange(fx)[:, None, :]).reshape(-1)
    starts = np.arange(0, 16 * len(seen) + 1, 16, dtype=np.int32)
    return sparse.csr_array((weights, index, starts), shape=(len(seen), 6 * width**2))


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
