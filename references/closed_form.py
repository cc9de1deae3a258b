"""Ground truth without sampling: a diffuse surface that nothing shadows, under a light of few bands.

A lobe about N that depends on N.L alone turns the light's harmonics L_lm into the radiance's by a factor a band,

    B_lm = rho_l L_lm,   rho_l = 2 pi int_-1^1 rho_hat(x) P_l(x) dx        (Ramamoorthi and Hanrahan 2001, eq. 9),

and what lies beyond degree F adds at most ||L_beyond|| sqrt(sum_{l > F} rho_l^2 (2 l + 1) / (4 pi)) at any normal.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from data_gen.lobes import Lambertian, Membrane
from envbench import harmonics, latlong, real_harmonics
from envbench.directions import Array
from envbench.environment import Environment
from envbench.geometry import Points
from envbench.material import Material
from references.effects.facts import beyond_bands

DEGREE = 32
"""F: enough for what a bilinear map of few bands bends off them."""
_TAIL = 2048


def diffuse(material: Material) -> bool:
    """Whether a material is one that this knows."""
    return material.medium is None and all(isinstance(lobe, Lambertian | Membrane) for lobe in material.lobes)


def by_normal(material: Material, environment: Environment, height: int) -> Array:
    """Return the radiance of unshadowed diffuse points by their normal, a lat-long map (H, 2 H, 3): see `radiance`."""
    alm = harmonics.analyse(environment.radiance.astype(np.float64), DEGREE)
    l, _ = harmonics.degrees(DEGREE)
    found = np.empty((height, 2 * height, 3))
    for channel, factors in enumerate(_by_band(material).T):
        banded = np.empty((1, height, 2 * height))
        own = (alm[channel : channel + 1] * factors[l]).astype(complex)
        harmonics.synthesise(own, 0, DEGREE, banded, harmonics.threads())
        found[..., channel] = banded[0]
    return found


def radiance(material: Material, environment: Environment, points: Points) -> tuple[Array, float]:
    """Return the radiance (n, 3) of unshadowed diffuse points, and the most that it errs by anywhere.

    The material has no map of transparency; `Points.modulation` is left to whoever asks.
    """
    light = real_harmonics.project(environment.radiance.astype(np.float64), DEGREE)
    band = np.repeat(np.arange(DEGREE + 1), 2 * np.arange(DEGREE + 1) + 1)
    values = real_harmonics.basis(DEGREE, points.normal).T @ (_by_band(material)[band] * light)
    return values, error(material, environment)


def error(material: Material, environment: Environment) -> float:
    """Return the most that the radiance of `radiance` errs by at any normal."""
    return _beyond(environment) * sum(max(lobe.reflectance) * _tail(_transparency(lobe)) for lobe in material.lobes)


def _by_band(material: Material) -> Array:
    """Return rho_l of a material by channel, (F + 1, 3)."""
    return sum(
        (_factors(_transparency(lobe))[: DEGREE + 1, None] * np.asarray(lobe.reflectance) for lobe in material.lobes),
        np.zeros((DEGREE + 1, 3)),
    )


def _transparency(lobe: object) -> float:
    return lobe.transparency if isinstance(lobe, Membrane) else 0.0


@lru_cache(maxsize=16)
def _factors(transparency: float) -> Array:
    """Return rho_l for l <= `_TAIL` of (max(x, 0) + alpha max(-x, 0)) / pi."""
    # int_0^1 x P_l: 1/2, 1/3, 1/8, then 0 for odd l and c_(l+2) = -c_l (l - 1) / (l + 4) for even l
    half = np.zeros(_TAIL + 1)
    half[:3] = 1 / 2, 1 / 3, 1 / 8
    for l in range(2, _TAIL - 1, 2):
        half[l + 2] = -half[l] * (l - 1) / (l + 4)
    return 2 * half * (1 + transparency * (-1.0) ** np.arange(_TAIL + 1))


def _tail(transparency: float) -> float:
    l = np.arange(DEGREE + 1, _TAIL + 1)
    return float(np.sqrt((_factors(transparency)[DEGREE + 1 :] ** 2 * (2 * l + 1)).sum() / (4 * np.pi)))


@lru_cache(maxsize=4)
def _beyond(environment: Environment) -> float:
    """Return ||L_beyond|| of the brightest channel, or more."""
    samples = environment.radiance.astype(np.float64)
    if np.ptp(samples, axis=(0, 1)).max() == 0:
        return 0.0
    weight = latlong.solid_angles(*samples.shape[:2])[..., None]
    return beyond_bands(environment, DEGREE + 1) * float(np.sqrt((samples**2 * weight).sum()))
