"""Directions, angles and frames (CONVENTIONS.md): unit vectors, z up, arrays of shape (..., 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def from_angles(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Return (sin t cos p, sin t sin p, cos t), shape (..., 3), for angles in radians."""
    theta, phi = np.broadcast_arrays(np.asarray(theta, float), np.asarray(phi, float))
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)], axis=-1)


def to_angles(direction: ArrayLike) -> tuple[Array, Array]:
    """Return theta in [0, pi] and phi in [0, 2 pi) of directions (..., 3); exact near the poles."""
    d = np.asarray(direction, float)
    theta = np.arctan2(np.hypot(d[..., 0], d[..., 1]), d[..., 2])
    phi = np.arctan2(d[..., 1], d[..., 0])
    phi = np.where(phi < 0, phi + 2 * np.pi, phi)
    return theta, np.where(phi >= 2 * np.pi, 0.0, phi)


def normalised(v: ArrayLike) -> Array:
    """Scale vectors (..., 3) to unit length; a zero vector stays zero."""
    v = np.asarray(v, float)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0, length, 1)


def reflect(view: ArrayLike, normal: ArrayLike) -> Array:
    """Return R = 2 (N.V) N - V, the mirror direction of `view` about `normal` (both (..., 3))."""
    view, normal = np.asarray(view, float), np.asarray(normal, float)
    return 2 * np.sum(view * normal, axis=-1, keepdims=True) * normal - view


def to_local(direction: ArrayLike, centre: ArrayLike) -> Array:
    """Express `direction` in the frame R(alpha, beta) = Rz(beta) Ry(alpha) of the `centre` (alpha, beta).

    The frame's z axis is `centre` and its x axis points along growing alpha (RH 2002, eq. 3).
    """
    d = np.asarray(direction, float)
    alpha, beta = to_angles(centre)
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    along = cb * d[..., 0] + sb * d[..., 1]
    return np.stack(
        [ca * along - sa * d[..., 2], cb * d[..., 1] - sb * d[..., 0], sa * along + ca * d[..., 2]], axis=-1
    )


def perpendicular(direction: ArrayLike) -> Array:
    """Return one unit vector perpendicular to each direction (..., 3)."""
    d = np.asarray(direction, float)
    axis = np.where(np.abs(d[..., 2:3]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    return normalised(np.cross(axis, d))


def upright(towards: Array, up: Sequence[float]) -> tuple[Array, Array]:
    """Return an image's right and up (3,), seen from the unit direction `towards`.

    Where `up` is along the view, some other direction is upright.

    Examples
    --------
    >>> [axis.tolist() for axis in upright(np.array([0.0, 0.0, 1.0]), (0.0, 1.0, 0.0))]
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    above = np.asarray(up, float)
    right = np.cross(above, towards)
    if np.linalg.norm(right) < 1e-6 * np.linalg.norm(above):
        right = np.cross((0.0, 1.0, 0.0) if abs(towards[1]) < 0.9 else (1.0, 0.0, 0.0), towards)
    right = normalised(right)
    return right, np.cross(towards, right)


def uniform(count: int, rng: np.random.Generator) -> Array:
    """Draw `count` directions uniformly over the sphere, shape (count, 3)."""
    z = rng.uniform(-1, 1, count)
    phi = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
