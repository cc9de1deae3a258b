"""Damped Newton steps over the axes of many points at once, each with a damping of its own.

The paper warns of Levenberg and Marquardt's Hessian where the residual stays large, as it does with few lobes: this is
the exact one (`methods.ldprt.projected`), 2 N x 2 N, plus lambda I. Where that is not positive definite, or a step does
not pay, lambda grows; where the quadratic model holds, it falls, and the last steps converge quadratically.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array
from methods.ldprt.projected import Expansion, expand
from methods.ldprt.signal import Signal

ITERATIONS = 40
TOLERANCE = 1e-8
"""A point is done when the next step promises less than this share of its energy |t|^2 / 2."""
STILL_WORTH = 0.75
"""Points that are done are dropped when fewer than this share of the batch are not."""
LONGEST = 0.5
"""Of one axis in one step, as the tangent of its angle."""
FIRST_DAMPING = 1e-2
"""Relative to the energy, as is the Hessian's scale."""
LEAST_DAMPING = 1e-12
"""Relative to the energy too: the Hessian is singular where more lobes are given than the signal needs."""
DAMPINGS = 4
"""Values of lambda tried at once where the damped Hessian is not positive definite."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Axes (3, N, V) and the value of f there (V,)."""

    axes: Array
    value: Array


def minimise(signal: Signal, axes: Array, iterations: int = ITERATIONS, tolerance: float = TOLERANCE) -> Minimum:
    """Move axes (3, N, V) to a local minimum of f each. Points are dropped from the batch as they are done."""
    found = Minimum(axes.copy(), np.empty(len(signal)))
    at = np.arange(len(signal))
    energy = signal.energy() / 2 + 1e-200  # a black point is done at once
    damping = FIRST_DAMPING * energy
    here = expand(signal, axes)
    for _ in range(iterations):
        step, promised = _steps(here, damping, energy)
        more = promised > tolerance * energy
        if np.count_nonzero(more) < STILL_WORTH * len(at):
            found.axes[..., at], found.value[at] = axes, here.value
            signal, here, axes = signal.chosen(more), _chosen(here, more), axes[..., more]
            at, energy, damping, step, promised = at[more], energy[more], damping[more], step[:, more], promised[more]
            more = np.ones(len(at), bool)
        if not len(at):
            return found
        moved = _moved(axes, here.tangents, step)
        there = expand(signal, moved)
        ratio = (here.value - there.value) / np.maximum(promised, LEAST_DAMPING * energy)
        better = (there.value < here.value) & more  # what is done stands still, whether dropped yet or not
        axes, here = np.where(better, moved, axes), _where(better, there, here)
        damping = damping * np.where(~more, 1.0, np.where(ratio > 0.75, 1 / 8, np.where(ratio < 0.25, 4.0, 1.0)))
    found.axes[..., at], found.value[at] = axes, here.value
    return found


def _steps(here: Expansion, damping: Array, energy: Array) -> tuple[Array, Array]:
    """Return steps (2 N, V) and what the quadratic model promises of them (V,); raise `damping`, in place, as it must.

    A point whose damped Hessian stays indefinite stands still, and is promised much: the next round goes on with it.
    """
    diagonal = np.arange(len(here.gradient))
    least_damping = LEAST_DAMPING * energy
    np.maximum(damping, least_damping, out=damping)
    damped = here.hessian.copy()
    damped[diagonal, diagonal] += damping
    factor, pivots, least = _factor(damped)
    for _ in range(DAMPINGS):
        bad = np.nonzero(least <= 0)[0]
        if not len(bad):
            break
        damping[bad] = np.maximum(4 * damping[bad], damping[bad] - 1.5 * least[bad])
        again = here.hessian[..., bad]
        again[diagonal, diagonal] += damping[bad]
        factor[..., bad], pivots[:, bad], least[bad] = _factor(again)
    step = -_solve(factor, pivots, here.gradient)
    by_axis = step.reshape(2, -1, step.shape[1])
    longest = np.sqrt(np.max(by_axis[0] ** 2 + by_axis[1] ** 2, axis=0))
    step *= LONGEST / np.maximum(longest, LONGEST)
    bent = np.einsum("pv,pqv,qv->v", step, here.hessian, step)
    promised = -np.einsum("pv,pv->v", here.gradient, step) - bent / 2
    indefinite = least <= 0
    step[:, indefinite], promised[indefinite] = 0, np.inf
    return step, promised


def _factor(H: Array) -> tuple[Array, Array, Array]:
    """Return L and d of H = L d L^T, and the least pivot; L and d are of use where that is positive."""
    n = len(H)
    L, d = np.empty_like(H), np.empty(H[0].shape)
    for j in range(n):
        scaled = L[j, :j] * d[:j]
        d[j] = H[j, j] - np.einsum("kv,kv->v", L[j, :j], scaled)
        pivot = np.where(d[j] > 0, d[j], np.inf)
        L[j + 1 :, j] = (H[j + 1 :, j] - np.einsum("ikv,kv->iv", L[j + 1 :, :j], scaled)) / pivot
    return L, d, d.min(axis=0)


def _solve(L: Array, d: Array, right: Array) -> Array:
    x = right.copy()
    n = len(x)
    for i in range(1, n):
        x[i] -= np.einsum("jv,jv->v", L[i, :i], x[:i])
    x /= np.where(d > 0, d, 1)
    for i in reversed(range(n - 1)):
        x[i] -= np.einsum("jv,jv->v", L[i + 1 :, i], x[i + 1 :])
    return x


def _moved(axes: Array, tangents: Array, step: Array) -> Array:
    moved = axes + np.einsum("aiv,akiv->kiv", step.reshape(2, *axes.shape[1:]), tangents)
    return moved / np.sqrt(np.einsum("kiv,kiv->iv", moved, moved))


def _chosen(here: Expansion, at: NDArray[np.bool_]) -> Expansion:
    return Expansion(*(getattr(here, f.name)[..., at] for f in fields(here)))


def _where(better: NDArray[np.bool_], there: Expansion, here: Expansion) -> Expansion:
    """Take the points that got better from `there`; the others keep their tangents, gradient and Hessian."""
    if better.all():
        return there
    return Expansion(*(np.where(better, getattr(there, f.name), getattr(here, f.name)) for f in fields(here)))
