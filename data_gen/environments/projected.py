"""Any light projected to a few spherical harmonics, as precomputed transfer sees it, and what that does to it.

A projection to n bands rings: it overshoots about lamps and falls below zero away from them. Windows damp the upper
ones of its bands l < n: Hanning (1 + cos(pi l / n)) / 2, Lanczos sinc(l / n).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.environments import parameters as p
from envbench import latlong, real_harmonics
from envbench.directions import Array
from envbench.environment import Environment
from envbench.errors import BadInput, unknown

WINDOWS = ("none", "hanning", "lanczos")
MOST_BANDS = 64
_FINENESS = 40
"""Rows for each band: between them a bilinear map is then within some 1e-4 of the harmonics."""


def window(name: str, order: int) -> Array:
    """Return the factor of each band l = 0 ... order - 1.

    Examples
    --------
    >>> window("hanning", 4).round(3).tolist()
    [1.0, 0.854, 0.5, 0.146]
    """
    l = np.arange(order)
    match name:
        case "none":
            return np.ones(order)
        case "hanning":
            return (1 + np.cos(np.pi * l / order)) / 2
        case "lanczos":
            return np.sinc(l / order)
        case _:
            raise unknown("window of light 'projected':", str(name), WINDOWS)


def project(light: Environment, order: int, windowed: str = "none", height: int | None = None) -> Environment:
    """Return `light` projected to the bands l < `order`, on a map of `height` rows; it may be negative.

    The map's own projection to these bands is that of the light, windowed, to single precision: what bilinear
    interpolation takes from them is made good. Between the samples it still bends off the harmonics, by what the notes
    say. They also say how much of the light's power is lost, and how much of what is left is negative.

    Parameters
    ----------
    order : int
        n, the number of bands.
    windowed : str
        One of `WINDOWS`.
    height : int, optional
        Rows; by default 64, or 40 a band.
    """
    order = p.integer("projected", "order", order, 1, MOST_BANDS)
    height = max(64, _FINENESS * order) if height is None else height
    height = p.integer("projected", "size", height, 2, p.MAX_ROWS)
    if height < 2 * order:
        raise BadInput(f"The 'size' of light 'projected' must be >= 2 x order = {2 * order}. Got {height} instead.")
    band = np.repeat(np.arange(order), 2 * np.arange(order) + 1)
    exact = real_harmonics.project(light.radiance.astype(np.float64), order - 1)
    wanted = window(windowed, order)[band][:, None] * exact
    given, values = wanted, _synthesised(wanted, latlong.grid(height, 2 * height))
    for _ in range(2):
        given = given + wanted - real_harmonics.project(values, order - 1)
        values = _synthesised(given, latlong.grid(height, 2 * height))
    radiance = values.astype(np.float32)
    notes = (*light.notes, *_notes(light, radiance, wanted, windowed))
    return Environment(light.name, radiance, notes, signed=True)


def negative_share(radiance: NDArray[np.floating]) -> tuple[float, float]:
    """Return which share of the sphere is negative, mean of the channels, and which share of the power is there."""
    weight = latlong.solid_angles(*radiance.shape[:2])[..., None]
    below = np.minimum(radiance.astype(np.float64), 0)
    power = float((radiance.astype(np.float64) ** 2 * weight).sum())
    covered = float(((below < 0) * weight).sum() / (3 * radiance.shape[1] * weight.sum()))
    return covered, float((below**2 * weight).sum()) / power if power > 0 else 0.0


def _notes(light: Environment, radiance: NDArray[np.float32], wanted: Array, windowed: str) -> tuple[str, ...]:
    order = round(np.sqrt(len(wanted)))
    weight = latlong.solid_angles(*light.radiance.shape[:2])[..., None]
    power = float((light.radiance.astype(np.float64) ** 2 * weight).sum())
    kept = float((wanted**2).sum()) / power if power > 0 else 1.0
    covered, share = negative_share(radiance)
    low, mean = float(radiance.min()), float(np.abs(light.mean).mean()) or 1.0
    high = float(radiance.max())
    between = _between(radiance, wanted)
    shaped = "" if windowed == "none" else f", {windowed} window"
    return (
        f"projected to order {order} (l < {order}{shaped}): {kept:.1%} of the light's power is left",
        f"ringing: from {low / mean:.2f} to {high / mean:.2f} of the light's mean; negative on {covered:.1%} of the "
        f"sphere, with {share:.2%} of the power",
        f"between the samples of its {radiance.shape[0]} rows the map is off the harmonics by {between:.1e} RMS",
    )


def _between(radiance: NDArray[np.float32], wanted: Array) -> float:
    """Return the RMS by which the bilinear map misses the harmonics, over their own RMS, at directions all over."""
    count = 4096
    k = np.arange(count) + 0.5
    z, phi = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    where = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], axis=-1)
    exact = _synthesised(wanted, where)
    rms = float(np.sqrt((exact**2).mean()))
    return float(np.sqrt(((latlong.interpolate(radiance, where) - exact) ** 2).mean())) / rms if rms > 0 else 0.0


def _synthesised(coefficients: Array, where: Array) -> Array:
    """Return the sum of the harmonics, (..., 3), at directions (..., 3), a row of them at a time."""
    order = round(np.sqrt(len(coefficients))) - 1
    rows = where.reshape(-1, where.shape[-2], 3)
    summed = np.stack([real_harmonics.basis(order, row).T @ coefficients for row in rows])
    return summed.reshape(where.shape)


def source(of: Any, light: Any, presets: Mapping[str, Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return the table of the light to project: a preset's by its name `of`, or `light` itself; one of the two."""
    if (of is None) == (light is None):
        raise BadInput("light 'projected' needs either of = a preset's name or light = a table; give exactly one.")
    if of is not None:
        if of not in presets:
            raise unknown("light to project", str(of), presets)
        return presets[of]
    if not isinstance(light, Mapping):
        raise BadInput(f"The 'light' of light 'projected' must be a table. Got {light!r} instead.")
    table: Mapping[str, Any] = light
    return table
