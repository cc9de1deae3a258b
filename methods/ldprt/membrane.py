"""The thin membrane of Sloan, Luna and Snyder 2005, sec. 4.2: zonal coefficients in closed form, for every order.

The membrane's transfer is g(z) / pi about the outward normal, g(z) = z for z = N.s >= 0 and -alpha z behind (eq. 22).
A function of z has the coefficients t_lm = g*_l y_lm(N) with g*_l = 2 pi int g(z) / pi P_l(z) dz = 2 int g P_l dz:
this is eq. 23 as printed, the division by pi included. It is the clamped cosine of RH 2001, eq. 8, once forwards and
alpha times backwards, where P_l(-z) = (-1)^l P_l(z): even bands have the factor 1 + alpha, l = 1 has 1 - alpha.
With alpha = 0 it is the unshadowed diffuse transfer; constant light 1 returns g*_0 = 1 + alpha.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from envbench import real_harmonics
from envbench.directions import Array
from envbench.errors import BadInput


def coefficients(order: int, transparency: ArrayLike = 0.0) -> Array:
    """Return g*_l for l = 0 ... order - 1, of shape (..., order).

    Parameters
    ----------
    order : int
        n >= 1, the number of bands.
    transparency : (...)
        alpha in [0, 1]: a number, or a translucency map's values.

    Raises
    ------
    BadInput

    Examples
    --------
    >>> coefficients(5, 0.5).round(4).tolist()
    [1.5, 0.3333, 0.375, 0.0, -0.0625]
    """
    if order < 1:
        raise BadInput(f"order must be >= 1. Got {order} instead.")
    alpha = np.asarray(transparency, float)
    if not ((alpha >= 0) & (alpha <= 1)).all():
        raise BadInput(f"transparency must lie in [0, 1]. Got {alpha.min():g} to {alpha.max():g} instead.")
    out = np.zeros((*alpha.shape, order))
    central = 1.0  # l! / (2^l ((l / 2)!)^2), from l to l + 2 times (l + 1) / (l + 2)
    for l in range(0, order, 2):
        out[..., l] = 2 * (1 + alpha) * (-1) ** (l // 2 + 1) / ((l + 2) * (l - 1)) * central
        central *= (l + 1) / (l + 2)
    if order > 1:
        out[..., 1] = 2 / 3 * (1 - alpha)
    return out


def transfer(normals: Array, order: int, transparency: ArrayLike = 0.0) -> Array:
    """Return transfer vectors (V, order^2) of unshadowed membranes with the `normals` (V, 3).

    `transparency` is one number or one a normal (V,); without it the surface is opaque and diffuse.
    """
    band = np.repeat(np.arange(order), 2 * np.arange(order) + 1)
    lobe = np.broadcast_to(coefficients(order, transparency), (len(normals), order))
    return real_harmonics.basis(order - 1, normals).T * lobe[:, band]
