"""The light's prefilter: what a lobe averages for N = V = R, as Legendre coefficients (Karis 2013, "split sum").

Karis draws H from D and weighs each L by N.L, normalised by the sum of weights. With N = V the density of L is
D(theta / 2) / 4, so that the limit of many samples is the radially symmetric kernel D(theta / 2) cos(theta) about R,
scaled to integrate to 1. Any other lobe about R is its own kernel there: rho_hat for N = V = R, scaled likewise.
A convolution with either is a product with k_l = 2 pi int k(theta) P_l(cos theta) sin(theta) d theta.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from data_gen.lobes import GGX
from envbench.directions import from_angles
from envbench.material import Lobe

Array = NDArray[np.float64]

MAX_ORDER = 511
LOST = 1e-6
"""Energy of the kernel that its order may leave out."""
_NODES = 2048
_CAP_EDGE = 1e-2
"""What is left of a degree at the cap: a Gaussian window keeps a kernel that is cut there from ringing."""


Profile = Callable[[Array], Array]
"""A kernel over theta, (n,) to (channels, n), to be scaled."""


def own(lobe: Lobe, cap: int) -> Array:
    """Return the kernel of a lobe about R, (channels, order + 1), k_0 = 1; GGX is Karis's."""
    return _expand(*_profile(lobe), cap)


def ggx(alpha: float, cap: int) -> Array:
    """Return the kernel of GGX, (1, order + 1); alpha = 0 is a mirror."""
    if alpha == 0:
        return np.ones((1, cap + 1))
    return _expand(partial(_ggx, alpha), np.pi / 2, cap)


def equivalent_roughness(lobe: Lobe) -> float:
    """Return the roughness in [0, 1] of the GGX whose kernel has the least energy between it and the lobe's own."""
    if isinstance(lobe, GGX):
        return lobe.roughness
    theta, weight = _nodes(np.pi)
    profile, end = _profile(lobe)
    target = _scaled(np.where(theta <= end, profile(theta), 0.0), weight).mean(0)

    def distance(roughness: float) -> float:
        near = np.where(theta <= np.pi / 2, _ggx(roughness**2, theta), 0.0)
        return float(((_scaled(near, weight)[0] - target) ** 2) @ weight)

    coarse = np.linspace(0.02, 1, 50)
    best = float(coarse[np.argmin([distance(r) for r in coarse])])
    found = optimize.minimize_scalar(distance, bounds=(max(best - 0.02, 0.005), min(best + 0.02, 1)), method="bounded")
    return float(found.x)


def _profile(lobe: Lobe) -> tuple[Profile, float]:
    """Return the kernel of a lobe about R, and the angle where it ends."""
    if isinstance(lobe, GGX):
        return partial(_ggx, lobe.alpha), np.pi / 2
    normal = np.array([[0.0], [0.0], [1.0]])

    def profile(theta: Array) -> Array:
        values = lobe.profile(from_angles(theta, 0.0).T, normal, normal, normal)
        return np.stack([np.broadcast_to(value, theta.shape) for value in values])

    end = lobe.cone(1e-9)
    return profile, min(end, np.pi / 2) if lobe.clipped else end


def _ggx(alpha: float, theta: Array) -> Array:
    """D(theta / 2) cos(theta) but for its constant, (1, n)."""
    sine, cosine = np.sin(theta / 2), np.cos(theta / 2)
    return (np.cos(theta) / (sine**2 + (alpha * cosine) ** 2) ** 2)[None]


def _nodes(end: float) -> tuple[Array, Array]:
    """Return polar angles up to `end`, squeezed towards zero, and the solid angles they stand for (sum / (2 pi))."""
    t = (np.arange(_NODES) + 0.5) / _NODES
    theta = end * t**3
    return theta, 3 * end / _NODES * t**2 * np.sin(theta)


def _scaled(values: Array, weight: Array) -> Array:
    total = (values @ weight)[:, None]
    return np.divide(values, total, out=np.zeros_like(values), where=total > 0)


def _expand(profile: Profile, end: float, cap: int) -> Array:
    theta, weight = _nodes(end)
    values = _scaled(profile(theta), weight) * weight
    return _ending(np.stack([_legendre(channel, theta, cap) for channel in values]), cap)


def _legendre(values: Array, theta: Array, order: int) -> Array:
    """Return sum_i values_i P_l(cos theta_i) for l = 0 ... order, by the three-term recurrence."""
    x = np.cos(theta)
    before, now = np.zeros_like(x), np.ones_like(x)
    out = np.empty(order + 1)
    for l in range(order + 1):
        out[l] = values @ now
        before, now = now, ((2 * l + 1) * x * now - l * before) / (l + 1)
    return out


def _ending(kernel: Array, cap: int) -> Array:
    """Cut a kernel where all but `LOST` of its energy is held; one that goes on to the cap fades out there."""
    energy = ((2 * np.arange(cap + 1) + 1) * kernel**2).sum(0)
    beyond = energy[::-1].cumsum()[::-1] / energy.sum()
    order = int(np.count_nonzero(beyond > LOST)) - 1
    if abs(kernel[:, -1]).max() > _CAP_EDGE:
        return kernel * _CAP_EDGE ** ((np.arange(cap + 1) / cap) ** 2)
    return kernel[:, : order + 1]
