"""Diffuse transfer like a shadowed mesh's: the clamped cosine about a random normal, above a random smooth horizon."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envbench.directions import uniform
from envbench.real_harmonics import basis

Array = NDArray[np.float64]

DIRECTIONS = 2000


def fibonacci(count: int) -> Array:
    """Return directions (count, 3) of equal weight, evenly spread."""
    i = np.arange(count) + 0.5
    z, phi = 1 - 2 * i / count, np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def transfer(points: int, n: int = 6, seed: int = 0) -> Array:
    """Return transfer vectors (points, n^2). Seen is what lies above a + b s.u + c (s.v) (s.w), as a cosine.

    A point may lie all in the dark; of 1,000 some do.
    """
    rng = np.random.default_rng(seed)
    s = fibonacci(DIRECTIONS)
    projected = basis(n - 1, s).T * 4 * np.pi / DIRECTIONS / np.pi
    normal, u = uniform(points, rng), uniform(points, rng)
    v, w = rng.normal(size=(2, points, 3))
    a, b, c = rng.uniform([[-0.2], [0], [0]], [[0.5], [0.6], [0.3]], (3, points))[..., None]
    out = np.empty((points, n * n))
    for start in range(0, points, 1024):
        part = slice(start, start + 1024)
        cosine = normal[part] @ s.T
        horizon = a[part] + b[part] * (u[part] @ s.T) + c[part] * (v[part] @ s.T) * (w[part] @ s.T)
        out[part] = (np.maximum(cosine, 0) * (cosine > horizon)) @ projected
    return out


def random_units(count: int, n: int = 6) -> Array:
    """Return random unit SH vectors (count, n^2), the paper's hard case (fig. 2): seed i gives vector i."""
    vectors = np.stack([np.random.default_rng(seed).normal(size=n * n) for seed in range(count)])
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
