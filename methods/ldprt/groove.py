"""The transfer of an extruded sinusoidal groove, without rays: h(x) = -d/2 (1 + cos 2 pi x), |x| <= 1/2, flat beyond.

x and the depth d are in widths of the groove. It runs along y, so a ray is blocked or not by its projection onto the
cross-section: with s = (sin t cos p, cos t, sin t sin p), t from y, a point sees all of p between its two horizons,

    arctan H+ <= p <= pi - arctan H-,   H+(x) = sup over x' > x of (h(x') - h(x)) / (x' - x),   H-(x) = H+(-x).

The surface is a height field: nothing seen lies below its tangent plane, and the clamped cosine / pi is a product,

    t_lm = 1/pi int dp (n_x cos p + n_z sin p) q_lm(p),   q_lm(p) = int_0^pi sin^2 t y_lm(t, p) dt,

of trigonometric polynomials in p of degree 1 and l. Both integrals are done by Gauss' rule, to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from envbench.directions import Array
from envbench.errors import BadInput
from envbench.real_harmonics import basis

CANDIDATES = 2049
"""Where a horizon is looked for. Its slope is found to 1e-6 d: the square of the spacing times an eighth of h''."""
ACROSS = 48
"""Nodes in t: sin^2 t y_lm is entire, and l < 20 is integrated to rounding."""


def groove_height(x: ArrayLike, depth: ArrayLike) -> Array:
    """Return h(x), in widths."""
    x = np.asarray(x, float)
    return np.where(np.abs(x) < 0.5, -np.asarray(depth, float) / 2 * (1 + np.cos(2 * np.pi * x)), 0.0)


def groove_normal(x: ArrayLike, depth: ArrayLike) -> Array:
    """Return unit normals (..., 3) at x."""
    slope = _slope(np.asarray(x, float)) * np.asarray(depth, float)
    length = np.sqrt(1 + slope**2)
    return np.stack([-slope / length, np.zeros_like(slope), 1 / length], axis=-1)


def groove_transfer(x: ArrayLike, depth: ArrayLike, n: int) -> Array:
    """Return the diffuse transfer vectors (..., n^2) at x of grooves of depth d, which broadcast; z up, x across.

    Raises
    ------
    BadInput
        A depth below 0, or n below 1 or above 20.
    """
    x, depth = np.broadcast_arrays(np.asarray(x, float), np.asarray(depth, float))
    if depth.size and not 0 <= depth.min() <= depth.max() < np.inf:
        raise BadInput(f"groove depths must be finite and at least 0. Got {depth.min():g} to {depth.max():g} instead.")
    if not 1 <= n <= 20:
        raise BadInput(f"groove transfer needs n in [1, 20]. Got {n} instead.")
    distinct, place = np.unique(np.concatenate([x.ravel(), -x.ravel()]), return_inverse=True)
    right, left = (_horizon(distinct)[place] * np.tile(depth.ravel(), 2)).reshape(2, -1)
    start, end = np.arctan(right), np.pi - np.arctan(left)
    node, weight = np.polynomial.legendre.leggauss(n + 16)
    phi = (start + end)[:, None] / 2 + (end - start)[:, None] / 2 * node  # (k, nodes)
    normal = groove_normal(x, depth).reshape(-1, 3, 1)
    cosine = normal[:, 0] * np.cos(phi) + normal[:, 2] * np.sin(phi)
    weighted = cosine * weight * (end - start)[:, None] / (2 * np.pi)
    m = np.arange(n)
    angle = m * phi[..., None]
    moments = np.concatenate([  # int (cos m p, sin m p) of what is seen of the cosine
        np.einsum("kp,kpm->km", weighted, np.cos(angle)), np.einsum("kp,kpm->km", weighted, np.sin(angle))
    ], axis=1)  # fmt: skip
    return (moments @ _across(n)).reshape(*x.shape, n * n)


def _across(n: int) -> Array:
    """Return the Fourier coefficients of q_lm(p), (2 n, n^2): of cos m p, then of sin m p, m < n."""
    t, weight = np.polynomial.legendre.leggauss(ACROSS)
    t, weight = np.pi / 2 * (t + 1), np.pi / 2 * weight
    samples = 2 * n
    phi = 2 * np.pi * np.arange(samples) / samples
    sine, cosine = np.sin(t)[:, None], np.cos(t)[:, None]
    s = np.stack(np.broadcast_arrays(sine * np.cos(phi), cosine, sine * np.sin(phi)), axis=-1)
    y = basis(n - 1, s.reshape(-1, 3)).reshape(n * n, ACROSS, samples)
    q = np.einsum("t,ktp->kp", weight * np.sin(t) ** 2, y)
    m = np.arange(n)[:, None]
    scale = np.where(m == 0, 1, 2) / samples
    return np.concatenate([(scale * np.cos(m * phi)) @ q.T, (scale * np.sin(m * phi)) @ q.T])


def _horizon(x: Array) -> Array:
    """Return H+ at each x of a groove of depth 1; slopes of other depths are proportional."""
    there = np.linspace(-0.5, 0.5, CANDIDATES)
    height = groove_height(there, 1.0)
    out = np.empty_like(x)
    for part in np.array_split(np.arange(len(x)), len(x) // 256 + 1):
        here = x[part, None]
        ahead = there - here
        chord = np.divide(
            height - groove_height(here, 1.0), ahead, out=np.zeros((len(part), CANDIDATES)), where=ahead > 1e-9
        )
        out[part] = np.maximum(chord.max(axis=1), _slope(x[part]))
    return np.maximum(out, 0)


def _slope(x: Array) -> Array:
    """Return h'(x) of depth 1."""
    return np.where(np.abs(x) < 0.5, np.pi * np.sin(2 * np.pi * x), 0.0)
