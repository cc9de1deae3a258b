"""Zonal fits of SH vectors, all points at once: greedy, then all axes together, and again from elsewhere (sec. 4.1)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from envbench import harmonics
from envbench.directions import Array, normalised, uniform
from envbench.errors import BadInput
from methods.irradiance import clamped_cosine
from methods.ldprt.greedy import greedy
from methods.ldprt.lobes import Lobes, linear_part, order_of, stored_directly
from methods.ldprt.newton import minimise
from methods.ldprt.projected import coefficients
from methods.ldprt.signal import Signal

BLOCK = 2048
"""Points of a batch: its arrays stay near the cores, and NumPy's loops are still long."""


def fit(vectors: Array, lobes: int, restarts: int = 2, above: float = 0.02, seed: int = 0) -> Lobes:
    """Fit N lobes to each SH vector; DC is stored directly, and from three lobes on the linear part too.

    A restart draws the first axis at random and finds the others greedily: lower than N random axes, which the paper
    draws, for the same work.

    Parameters
    ----------
    vectors : (V, n^2)
    lobes : int
        N, at most the 2 n - 1 that span the highest band.
    restarts : int
        Most further starts of a point.
    above : float
        Only points whose error, relative to the length of their vector, is still above this are started again.
    seed : int
        Of the restarts.

    Raises
    ------
    BadInput
        No SH vectors, not finite, or a number of lobes that cannot be of use.
    """
    first = _first_band(vectors, lobes)
    if restarts < 0:
        raise BadInput(f"restarts must be at least 0. Got {restarts} instead.")
    n, V = order_of(vectors.shape[1]), len(vectors)
    rng = np.random.default_rng(seed)
    draws = np.stack([uniform(V, rng).T for _ in range(restarts)]) if restarts else np.empty((0, 3, V))
    axes, g = np.empty((V, lobes, 3)), np.zeros((V, lobes, n))

    def block(start: int) -> None:
        part = slice(start, start + BLOCK)
        t = vectors[part].astype(np.float64)
        signal = Signal.of(t, first)
        goal = above**2 * np.einsum("vm,vm->v", t, t) / 2
        best = _best(signal, lobes, linear_axes(t).T, draws[:, :, part], goal)
        axes[part] = best.transpose(2, 1, 0)
        g[part, :, first:] = coefficients(signal, best).transpose(2, 1, 0)

    with ThreadPoolExecutor(harmonics.threads()) as pool:  # NumPy lets go of the interpreter's lock in its loops
        list(pool.map(block, range(0, V, BLOCK)))
    return Lobes(axes, g, vectors[:, : first**2].astype(np.float64))


def fit_light(light: Array, lobes: int, restarts: int = 8, seed: int = 0) -> Lobes:
    """Fit lobes to a light vector (n^2, 3), each channel for itself: the alternative that the paper rejects (sec. 3.2).

    Returns
    -------
    Lobes
        Of three points: red, green and blue.
    """
    if light.ndim != 2 or light.shape[1] != 3:
        raise BadInput(f"a light vector must have shape (n^2, 3). Got {light.shape} instead.")
    return fit(np.ascontiguousarray(light.T), lobes, restarts, 0.0, seed)


def optimal_linear(vectors: Array) -> Lobes:
    """Take one lobe about the axis of each vector's linear part, with the coefficients of eq. 18 (sec. 3.3)."""
    first = _first_band(vectors, 1)
    axes = linear_axes(vectors)
    g = np.zeros((len(vectors), 1, order_of(vectors.shape[1])))
    g[:, :, first:] = coefficients(Signal.of(vectors, first), axes.T[:, None].copy()).transpose(2, 1, 0)
    return Lobes(axes[:, None], g, vectors[:, :1].astype(np.float64))


def bent_normal(vectors: Array) -> Lobes:
    """Take the bent normal with ambient occlusion: the unshadowed cosine about the axis of the linear part, scaled.

    The clamped cosine / pi has g*_l = 2 int_0^1 z P_l(z) dz, so g*_0 y_00 = y_00 is its DC: what is left of that is the
    ambient occlusion.
    """
    _first_band(vectors, 1)
    unshadowed = clamped_cosine(order_of(vectors.shape[1]) - 1)
    unshadowed[0] = 0
    occlusion = vectors[:, :1] * np.sqrt(4 * np.pi)
    return Lobes(linear_axes(vectors)[:, None], (occlusion * unshadowed)[:, None], vectors[:, :1].astype(np.float64))


def linear_axes(vectors: Array) -> Array:
    """Return the optimal linear axes (V, 3) of vectors (V, n^2); z where there is no linear part."""
    axes = normalised(linear_part(vectors))
    return np.where(axes.any(axis=1, keepdims=True), axes, [0.0, 0.0, 1.0])


def _best(signal: Signal, lobes: int, linear: Array, draws: Array, goal: Array) -> Array:
    """Return the best axes (3, N, V) of the greedy start and of the restarts from `draws` (k, 3, V)."""
    found = minimise(signal, greedy(signal, lobes, linear))
    axes, value = found.axes, found.value
    for first in draws:
        at = np.nonzero(value > goal)[0]
        if not len(at):
            break
        part = signal.chosen(at)
        again = minimise(part, greedy(part, lobes, first=first[:, at]))
        better = again.value < value[at]
        axes[..., at[better]], value[at[better]] = again.axes[..., better], again.value[better]
    return axes


def _first_band(vectors: Array, lobes: int) -> int:
    """Check what is asked for; return the first band that lobes are fitted to."""
    if vectors.ndim != 2:
        raise BadInput(f"SH vectors must have shape (V, n^2). Got {vectors.shape} instead.")
    n = order_of(vectors.shape[1])
    first = int(np.sqrt(stored_directly(lobes)))
    if not 1 <= lobes <= 2 * n - 1:
        raise BadInput(
            f"lobes must lie in [1, {2 * n - 1}]: as many as the highest band of n = {n} holds. Got {lobes}."
        )
    if n <= first:
        raise BadInput(f"{lobes} lobes need n > {first}: the bands below are stored directly. Got n = {n} instead.")
    finite = np.isfinite(vectors).all(axis=1)
    if not finite.all():
        raise BadInput(f"SH vectors must be finite. Got NaN or infinity at point {int(np.argmin(finite))} instead.")
    return first
