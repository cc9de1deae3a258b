"""The most that light can still add after so many bounces, by the albedo alone."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from data_gen.lobes import Lambertian, Membrane
from envbench import latlong
from envbench.directions import Array
from envbench.environment import Environment
from envbench.geometry import Points
from envbench.material import Material
from envbench.scene import Scene
from references.closed_form import diffuse, radiance

_ROWS = 32
_STEP = np.pi / _ROWS / np.sqrt(2)
"""Radians between any normal and the nearest of the grid, or more."""


def rest_of_bounces(scene: Scene, bounces: int) -> Array:
    """Return the most, over points, that bounces after the k-th add up to, k = 0 ... `bounces` - 1.

    A diffuse surface of albedo a under irradiance E / pi <= M has radiance <= a M, and what comes by way of it j times
    <= a^(j + 1) M: at every point, whatever the shape. RMS over channels. Infinite for other materials.
    """
    albedo = diffuse_albedo(scene.material)
    if albedo is None:
        return np.full(bounces, np.inf)
    orders = albedo ** (np.arange(1, bounces + 1)[:, None] + 1)
    rests = np.cumsum(orders[::-1], axis=0)[::-1] * _brightest(scene.environment)
    return np.sqrt((rests**2).mean(-1))


def diffuse_albedo(material: Material) -> Array | None:
    """Return an upper bound of a diffuse material's albedo by channel, (3,); None where a lobe depends on the view."""
    if not diffuse(material):
        return None
    most = None if material.transparency is None else min(float(material.transparency.values.mean(-1).max()), 1.0)
    through = [most or lobe.transparency for lobe in material.lobes if isinstance(lobe, Membrane)]
    whole = 1 + max(through, default=0.0)
    bound = whole * np.sum([lobe.reflectance for lobe in material.lobes], axis=0)
    return bound if material.texture is None else bound * material.texture.values.max((0, 1))


@lru_cache(maxsize=4)
def _brightest(environment: Environment) -> Array:
    """Return the largest irradiance over pi by channel, (3,), or more.

    From one normal to another E / pi changes by their angle times the light's integral over pi at most.
    """
    samples = environment.radiance.astype(np.float64)
    most = np.abs(samples).max((0, 1))
    if environment.signed:
        return most
    normals = latlong.grid(_ROWS, 2 * _ROWS).reshape(-1, 3)
    points = Points(normals, normals, normals, normals, normals, np.ones(len(normals)))
    found, error = radiance(Material("white", (Lambertian(),)), environment, points)
    return np.minimum(most, found.max(0) + error + _STEP * 4 * environment.mean)
