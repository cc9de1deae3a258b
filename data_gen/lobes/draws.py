"""What a lobe's own samples tell of it: its albedo, and the cone that holds it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from envbench.directions import Array, from_angles, reflect
from envbench.material import Centre, Lobe

_MANY, _FEW = 4096, 512
_VIEWS = np.radians([0, 10, 20, 30, 40, 50, 60, 70, 80, 85, 89, 89.9])
_FINEST = 1e-3
"""Share of a lobe that this many samples still find."""


def held_cone(lobe: Lobe, eps: float) -> float:
    """Return the half-angle in (0, pi] about C that holds 1 - eps of the whole lobe in each channel, for any view."""
    if eps < _FINEST:
        return float(np.pi)
    angles, weights = _draws(lobe, _MANY, False)
    held = np.cumsum(weights, axis=1)
    total = held[:, -1]
    reached = np.argmax(held >= (1 - eps) * total[:, None], axis=1)  # (views, channels), first draw that reaches it
    widest = np.take_along_axis(angles, reached, axis=1)  # (views, channels)
    return float(np.where(total > 0, widest, 0).max()) or float(np.pi)  # a black lobe is held by any


def albedo(lobe: Lobe) -> Array:
    """Return what the lobe, clipped if it is, reflects of constant light: mean over cosine-weighted views, (3,)."""
    _, weights = _draws(lobe, _FEW, lobe.clipped)
    share = np.sin(2 * _VIEWS)
    mean = np.einsum("v,vc->c", share / share.sum(), weights.mean(1))
    return np.broadcast_to(mean, 3) * lobe.reflectance


@lru_cache(maxsize=16)
def _draws(lobe: Lobe, count: int, clipped: bool) -> tuple[Array, Array]:
    """Return by view the sorted angles of `count` draws to C, (views, n), and their weights, (views, n, channels)."""
    k = np.arange(count) + 1
    u = k * 0.7548776662466927 % 1, k * 0.5698402909980532 % 1  # Roberts's R2 sequence
    normal, tangent = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    angles: list[Array] = []
    weights: list[Array] = []
    for angle in _VIEWS:
        view = from_angles(angle, 0.3)
        match lobe.centre:
            case Centre.REFLECTION:
                centre = reflect(view, normal)
            case Centre.NORMAL:
                centre = normal
            case Centre.TANGENT:
                centre = tangent
        frame = [np.broadcast_to(v[:, None], (3, count)) for v in (view, centre, normal)]
        light = np.stack(lobe.sample(u, *frame))
        density = lobe.density(light, *frame)
        alive = (np.sum(light**2, axis=0) > 0.5) & (density > 0) & ((light[2] > 0) | (not clipped))
        values = np.stack(np.broadcast_arrays(*lobe.profile(light, *frame)), axis=-1)
        weight = np.where(alive[:, None], values / np.where(alive, density, 1.0)[:, None], 0.0)
        off = np.arctan2(np.linalg.norm(np.cross(centre, light.T), axis=-1), centre @ light)
        order = np.argsort(off)
        angles.append(off[order])
        weights.append(weight[order])
    return np.stack(angles), np.stack(weights)
