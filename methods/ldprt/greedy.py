"""Starts of a fit: the best of a hemi-cube's axes for one lobe, and lobe after lobe on what is left (sec. 4.1)."""

from __future__ import annotations

from math import pi

import numpy as np

from envbench.directions import Array, normalised
from methods.ldprt.newton import minimise
from methods.ldprt.projected import coefficients, harmonics_at, residual
from methods.ldprt.signal import Signal

ITERATIONS = 3
"""Newton steps that refine a lobe before the next one is looked for: all of them move together in the end."""


def hemicube(side: int) -> Array:
    """Return some 3 side^2 axes (k, 3) through the squares of a cube's upper half: opposite ones are one (sec. 3.1)."""
    u = (2 * np.arange(side) + 1) / side - 1
    half = u[u >= 0]
    top = np.stack([*np.meshgrid(u, u), np.ones((side, side))], axis=-1).reshape(-1, 3)
    across, up = (part.ravel() for part in np.meshgrid(u, half))
    one = np.ones_like(across)
    walls = [
        np.stack(w, axis=-1) for w in ((one, across, up), (-one, across, up), (across, one, up), (across, -one, up))
    ]
    return normalised(np.concatenate([top, *walls]))


def gain(signal: Signal, axes: Array) -> Array:
    """Return the energy (k, V) that one lobe about each of the axes (k, 3) takes from each signal.

    With eq. 18, g_l = 4 pi / (2 l + 1) T_l(s), and |t|^2 falls by sum_l g_l T_l(s).
    """
    y = harmonics_at(axes.T[:, None], signal.orders[-1])
    out = np.zeros((len(axes), len(signal)))
    for l, t in zip(signal.orders, signal.bands, strict=True):
        out += 4 * pi / (2 * l + 1) * np.square(y[l][:, 0].T @ t)
    return out


def best_axes(signal: Signal, tried: Array, linear: Array | None = None) -> Array:
    """Return the axis (3, V) of one lobe which takes most, among those `tried` (k, 3) and one more each, (3, V)."""
    taken = gain(signal, tried)
    best = taken.argmax(axis=0)
    axes = tried[best].T.copy()
    if linear is None:
        return axes
    y = harmonics_at(linear[:, None], signal.orders[-1])
    by_linear = np.zeros(len(signal))
    for l, t in zip(signal.orders, signal.bands, strict=True):
        by_linear += 4 * pi / (2 * l + 1) * np.square(np.einsum("mv,mv->v", y[l][:, 0], t))
    return np.where(by_linear > taken[best, np.arange(len(best))], linear, axes)


def greedy(signal: Signal, lobes: int, linear: Array | None = None, first: Array | None = None) -> Array:
    """Return axes (3, N, V): each lobe is fitted to what the ones before it leave, all coefficients solved anew.

    Parameters
    ----------
    linear : (3, V), optional
        Tried for the first lobe beside the hemi-cube: the optimal linear axes.
    first : (3, V), optional
        The first axes themselves, kept as they are: a restart.
    """
    tried = hemicube(signal.orders[-1] + 3)  # n + 2 along an edge of 90 degrees, where band l turns over in 180 / l
    axes = np.empty((3, lobes, len(signal)))
    left = signal
    for i in range(lobes):
        if i:
            found = axes[:, :i]
            left = Signal.of_bands(residual(signal, found, coefficients(signal, found)), signal.first)
        if i == 0 and first is not None:
            axes[:, 0] = first
        else:
            start = best_axes(left, tried, None if i else linear)
            axes[:, i] = minimise(left, start[:, None], ITERATIONS).axes[:, 0]
    return axes
