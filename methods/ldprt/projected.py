"""The fit's objective with the coefficients projected out: value, gradient and Hessian over the axes alone.

For fixed axes s_i the best coefficients are linear least squares, band by band: A_l g_l = b_l with b_li = T_l(s_i) and

    A_lij = sum_m y_lm(s_i) y_lm(s_j) = K_l(s_i.s_j),   K_l(c) = (2 l + 1) / (4 pi) P_l(c)   (the addition theorem).

What is left of eq. 17, halved, is f(s) = 1/2 (|t|^2 - sum_l b_l.g_l): 2 N angles instead of 2 N + N n variables. With
u_ia the step of axis i along its tangent e_ia, E_aij = e_ia.s_j, and all sums over j including i (where E is zero, and
where the two terms in K' cancel since K_l(s_i.s_i) is constant):

    df/du_ia             = sum_l g_li D_lai,   D_lai = sum_j g_lj K_l' E_aij - e_ia.grad T_l(s_i)
    d2f/du_ia du_jb |_g  = sum_l g_li g_lj (K_l'' E_aij E_bji + K_l' e_ia.e_jb)
                         + delta_ij [sum_lj g_li g_lj (K_l'' E_aij E_bij - K_l' s_i.s_j delta_ab)
                                     - sum_l g_li (e_ia.hess T_l(s_i).e_ib - l T_l(s_i) delta_ab)]
    d2f/dg_lk du_ia      = c_lk,ia = delta_ki D_lai + g_li K_l'(s_i.s_k) E_aik

and, the coefficients following the axes, H = d2f/du2|_g - sum_l c_l^T A_l^-1 c_l. Axes that meet make A_l singular and
would let coefficients of opposite signs grow without bound: `RIDGE` times its diagonal is added to A_l throughout. That
adds RIDGE (2 l + 1) / (4 pi) |g_l|^2 to |t - t~|^2, and keeps all of the above exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from envbench.directions import Array
from envbench.real_harmonics import basis
from methods.ldprt.signal import PAIRS, Signal

RIDGE = 1e-7
"""Relative to the diagonal of A_l. Coefficients stay below |t| / sqrt(RIDGE); a fit with |g| near |t| loses 1e-7."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """f to second order about axes (3, N, V), as functions of the 2 N steps along the tangents.

    Parameters
    ----------
    value : (V,)
        f + the ridge's share.
    coefficients : (B, N, V)
        g_l of the signal's bands.
    tangents : (2, 3, N, V)
    gradient : (2 N, V)
        Of u_ia, a varying slowest.
    hessian : (2 N, 2 N, V)
    """

    value: Array
    coefficients: Array
    tangents: Array
    gradient: Array
    hessian: Array


def expand(signal: Signal, axes: Array) -> Expansion:
    """Expand f about axes (3, N, V)."""
    N, V = axes.shape[1:]
    e = tangents(axes)
    y = harmonics_at(axes, signal.orders[-1])
    values, slopes, curvatures = _signal_at(signal, y, e)
    cosine = np.einsum("kiv,kjv->ijv", axes, axes)
    K, K1, K2 = _between(signal.orders, cosine)
    L = cholesky(K)
    g = _solved(L, values)
    value = (signal.energy() - np.einsum("lnv,lnv->v", values, g)) / 2

    E = np.einsum("akiv,kjv->aijv", e, axes)
    M = K1[:, None] * E
    D = np.einsum("laijv,ljv->laiv", M, g) - slopes
    gradient = np.einsum("liv,laiv->aiv", g, D)

    gg = g[:, :, None] * g[:, None]
    P1, P2 = np.einsum("lijv,lijv->ijv", gg, K1), np.einsum("lijv,lijv->ijv", gg, K2)
    cross = P1[:, None] * np.einsum("akiv,bkjv->aibjv", e, e)
    cross += (P2 * E)[:, :, None] * E.transpose(2, 0, 1, 3)  # E_aij E_bji
    own = np.einsum("ijv,aijv,bijv->abiv", P2, E, E) - np.einsum("liv,labiv->abiv", g, curvatures)
    turn = np.einsum("l,liv,liv->iv", np.array(signal.orders, float), g, values) - np.einsum("ijv,ijv->iv", P1, cosine)
    own[0, 0] += turn
    own[1, 1] += turn
    c = (g[:, None, :, None] * M).transpose(0, 3, 1, 2, 4).copy()  # (B, k, a, i, V)
    for i in range(N):
        cross[:, i, :, i] += own[:, :, i]
        c[:, i, :, i] += D[:, :, i]
    W = forward(L, c.reshape(len(g), N, 2 * N, V)).reshape(-1, 2 * N, V)
    hessian = cross.reshape(2 * N, 2 * N, V)
    for p in range(2 * N):
        hessian[p, : p + 1] -= np.einsum("rv,rqv->qv", W[:, p], W[:, : p + 1])
        hessian[:p, p] = hessian[p, :p]
    return Expansion(value, g, e, gradient.reshape(2 * N, V), hessian)


def coefficients(signal: Signal, axes: Array) -> Array:
    """Return the best coefficients (B, N, V) for fixed axes (3, N, V): eq. 18, for any number of axes."""
    y = harmonics_at(axes, signal.orders[-1])
    values = np.stack([_contracted(t, y[l]) for l, t in zip(signal.orders, signal.bands, strict=True)])
    K, _, _ = _between(signal.orders, np.einsum("kiv,kjv->ijv", axes, axes))
    return _solved(cholesky(K), values)


def residual(signal: Signal, axes: Array, g: Array) -> tuple[Array, ...]:
    """Return the bands t_lm - sum_i y_lm(s_i) g_li."""
    y = harmonics_at(axes, signal.orders[-1])
    return tuple(
        t - np.einsum("miv,iv->mv", y[l], g[at])
        for at, (l, t) in enumerate(zip(signal.orders, signal.bands, strict=True))
    )


def harmonics_at(axes: Array, degree: int) -> list[Array]:
    """Return y_lm(s_i), (2 l + 1, N, V) for each l <= `degree`, of axes (3, N, V)."""
    y = basis(degree, axes.reshape(3, -1).T).reshape(-1, *axes.shape[1:])
    return [y[l * l : (l + 1) ** 2] for l in range(degree + 1)]


def tangents(axes: Array) -> Array:
    """Return two tangents, (2, 3, ...), of unit vectors (3, ...): Duff et al. 2017, without a pole."""
    x, y, z = axes
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    return np.stack([
        np.stack([1 + sign * x * x * a, sign * b, -sign * x]),
        np.stack([b, sign + y * y * a, -y]),
    ])  # fmt: skip


def cholesky(A: Array) -> Array:
    """Return the lower L of positive definite A = L L^T, (..., N, N, V)."""
    L = np.zeros_like(A)
    N = A.shape[-2]
    for j in range(N):
        pivot = A[..., j, j, :] - np.einsum("...kv,...kv->...v", L[..., j, :j, :], L[..., j, :j, :])
        # rounding may leave a pivot of the ridge's size at or below zero
        L[..., j, j, :] = np.sqrt(np.maximum(pivot, RIDGE / 4 * A[..., j, j, :]))
        for i in range(j + 1, N):
            left = A[..., i, j, :] - np.einsum("...kv,...kv->...v", L[..., i, :j, :], L[..., j, :j, :])
            L[..., i, j, :] = left / L[..., j, j, :]
    return L


def forward(L: Array, right: Array) -> Array:
    """Solve L x = right, (..., N, k, V), with L (..., N, N, V)."""
    x = right.copy()
    for i in range(L.shape[-2]):
        for j in range(i):
            x[..., i, :, :] -= L[..., i, j, None, :] * x[..., j, :, :]
        x[..., i, :, :] *= 1 / L[..., i, i, None, :]
    return x


def backward(L: Array, right: Array) -> Array:
    """Solve L^T x = right, (..., N, V), with L (..., N, N, V)."""
    x = np.empty_like(right)
    for i in reversed(range(L.shape[-2])):
        left = right[..., i, :] - np.einsum("...jv,...jv->...v", L[..., i + 1 :, i, :], x[..., i + 1 :, :])
        x[..., i, :] = left / L[..., i, i, :]
    return x


def _solved(L: Array, right: Array) -> Array:
    return backward(L, forward(L, right[..., None, :])[..., 0, :])


def _between(orders: range, cosine: Array) -> tuple[Array, Array, Array]:
    """Return A_l, its ridge included, and K_l' and K_l'' of all pairs of axes, (B, N, N, V), from cosines (N, N, V).

    Those of an axis with itself are left 0: whatever they are, they cancel.
    """
    A, K1, K2 = (np.zeros((len(orders), *cosine.shape)) for _ in range(3))
    i, j = np.triu_indices(len(cosine), 1)
    for whole, pairs in zip((A, K1, K2), _kernels(orders, cosine[i, j]), strict=True):
        whole[:, i, j] = whole[:, j, i] = pairs
    l = np.array(orders)
    diagonal = np.arange(len(cosine))
    A[:, diagonal, diagonal] = ((1 + RIDGE) * (2 * l + 1) / (4 * pi))[:, None, None]
    return A, K1, K2


def _signal_at(signal: Signal, y: list[Array], e: Array) -> tuple[Array, Array, Array]:
    """Return T_l (B, N, V), its slopes along the tangents (B, 2, N, V), and curvatures (B, 2, 2, N, V)."""
    N, V = e.shape[2:]
    B = len(signal.bands)
    values, slopes, curvatures = np.empty((B, N, V)), np.empty((B, 2, N, V)), np.zeros((B, 2, 2, N, V))
    # e_a H e_b, written out over `PAIRS`
    weights = {
        (a, b): [e[a, p] * e[b, q] if p == q else e[a, p] * e[b, q] + e[a, q] * e[b, p] for p, q in PAIRS]
        for a, b in ((0, 0), (0, 1), (1, 1))
    }
    for at, l in enumerate(signal.orders):
        values[at] = _contracted(signal.bands[at], y[l])
        gradient = [_contracted(part, y[l - 1]) for part in signal.gradients[at]]
        for a in range(2):
            slopes[at, a] = sum(e[a, k] * gradient[k] for k in range(3))
        if l > 1:
            hessian = [_contracted(part, y[l - 2]) for part in signal.curvatures[at]]
            for (a, b), weight in weights.items():
                curvatures[at, a, b] = curvatures[at, b, a] = sum(w * h for w, h in zip(weight, hessian, strict=True))
    return values, slopes, curvatures


def _contracted(t: Array, y: Array) -> Array:
    """Return sum_m t_m y_m(s_i), (N, V), of coefficients (m, V) and harmonics (m, N, V)."""
    return np.einsum("mv,miv->iv", t, y)


def _kernels(orders: range, c: Array) -> tuple[Array, Array, Array]:
    """Return K_l(c) and its first and second derivatives, (B, ...)."""
    K, K1, K2 = (np.empty((len(orders), *c.shape)) for _ in range(3))
    p0, p1 = np.ones_like(c), c
    d0, d1 = np.zeros_like(c), np.ones_like(c)
    s0, s1 = np.zeros_like(c), np.zeros_like(c)
    for l in range(1, orders[-1] + 1):
        if l > 1:
            # (l) P_l = (2 l - 1) c P_(l-1) - (l - 1) P_(l-2), P_l' = P_(l-2)' + (2 l - 1) P_(l-1), and again
            p0, p1, older = p1, ((2 * l - 1) * c * p1 - (l - 1) * p0) / l, p1
            d0, d1, slope = d1, d0 + (2 * l - 1) * older, d1
            s0, s1 = s1, s0 + (2 * l - 1) * slope
        if l in orders:
            at, scale = l - orders[0], (2 * l + 1) / (4 * pi)
            K[at], K1[at], K2[at] = scale * p1, scale * d1, scale * s1
    return K, K1, K2
