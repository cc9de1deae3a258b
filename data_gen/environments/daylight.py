"""Sun and sky by Mitsuba's `sunsky` (Hosek and Wilkie 2012, 2013), as a lat-long map."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import numpy as np

from data_gen.environments import parameters as p
from envbench import llvm
from envbench.directions import Array, from_angles, perpendicular, to_angles
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.latlong import grid, solid_angles

APERTURE = np.radians(0.5358)
"""Angle across the sun, rad: Mitsuba's default."""
_SUN_RINGS, _SUN_SPOKES = 64, 128


def sunsky(
    *,
    sun: Any = (0.3, 0.4, 0.6),
    turbidity: float = 3.0,
    albedo: float = 0.3,
    sun_scale: float = 1.0,
    sky_scale: float = 1.0,
    size: int = 256,
) -> Environment:
    """Return sun and sky above a black ground, in Mitsuba's unit (W m^-2 sr^-1 nm^-1).

    The sky is taken at the pixel centres. The sun is smaller than a pixel of most maps, so its power is laid on the
    pixels that it covers: the map keeps its power whatever the size, its peak only from some 1,350 rows (4 pixels
    across); a note says so.

    Parameters
    ----------
    sun : 3 numbers
        Towards the sun, above the horizon.
    turbidity : float
        1 (clear) to 10 (hazy).
    albedo : float
        Of the ground, as the sky reflects it, 0 to 1.
    sun_scale, sky_scale : float
        Factors of radiance, 0 to leave one out.
    size : int
        Rows of the map.
    """
    height = p.integer("sunsky", "size", size, 16, 2048)
    towards = p.direction("sunsky", "sun", sun)
    if towards[2] <= 0:
        raise BadInput(f"The 'sun' of light 'sunsky' must stand above the horizon (z > 0). Got {sun!r} instead.")
    model = {
        "type": "sunsky",
        "sun_direction": towards.tolist(),
        "turbidity": p.number("sunsky", "turbidity", turbidity, 1, 10),
        "albedo": p.number("sunsky", "albedo", albedo, 0, 1),
    }
    scales = p.number("sunsky", "sun_scale", sun_scale, 0, 1e6), p.number("sunsky", "sky_scale", sky_scale, 0, 1e6)

    loaded = sys.modules.get("mitsuba")
    before = loaded.variant() if loaded is not None else None
    mi = llvm.mitsuba(fallback=True)
    try:
        sky = mi.load_dict({**model, "sun_scale": 0.0, "sky_scale": scales[1]})
        radiance = _radiance(mi, sky, grid(height, 2 * height))
        disc = mi.load_dict({**model, "sun_scale": scales[0], "sky_scale": 0.0})
        _lay_on(radiance, *_disc(mi, disc, towards))
    finally:
        if before is not None:
            mi.set_variant(before)
    across = APERTURE * height / np.pi
    notes = (
        [f"the sun is {across:.2g} pixels across: its power is kept, its peak and edge are not"] if across < 4 else []
    )
    return Environment("sunsky", np.maximum(radiance, 0).astype(np.float32), tuple(notes))


def _radiance(mi: ModuleType, emitter: Any, direction: Array) -> Array:
    """Evaluate a Mitsuba emitter from directions (..., 3), in any RGB variant."""
    flat = direction.reshape(-1, 3).astype(np.float32)
    if mi.variant().startswith("scalar"):
        si = mi.SurfaceInteraction3f()
        values = np.empty(flat.shape)
        for k, d in enumerate(flat):
            si.wi = mi.Vector3f(-d)
            values[k] = emitter.eval(si)
    else:
        import drjit as dr

        si = dr.zeros(mi.SurfaceInteraction3f, len(flat))
        si.wi = -mi.Vector3f(np.ascontiguousarray(flat.T))
        values = np.array(emitter.eval(si), float).T
    return values.reshape(direction.shape)


def _disc(mi: ModuleType, emitter: Any, towards: Array) -> tuple[Array, Array]:
    """Return directions (n, 3) over the sun's disc and the irradiance-like power, W m^-2 nm^-1, (n, 3), of each."""
    # Equal solid angles: cos(angle) is even in [cos(aperture / 2), 1].
    versine = (1 - np.cos(APERTURE / 2)) * (np.arange(_SUN_RINGS) + 0.5) / _SUN_RINGS
    across = perpendicular(towards)
    frame = np.stack([across, np.cross(towards, across), towards])
    local = from_angles(np.arccos(1 - versine)[:, None], 2 * np.pi * np.arange(_SUN_SPOKES) / _SUN_SPOKES)
    where = local.reshape(-1, 3) @ frame
    share = 2 * np.pi * (1 - np.cos(APERTURE / 2)) / len(where)
    return where, _radiance(mi, emitter, where) * share


def _lay_on(radiance: Array, where: Array, power: Array) -> None:
    """Add each `power` (n, 3), over the pixel's solid angle, to the pixel of `radiance` that its direction meets."""
    height, width = radiance.shape[:2]
    theta, phi = to_angles(where)
    row = np.minimum((theta * height / np.pi).astype(int), height - 1)
    column = np.minimum((phi * width / (2 * np.pi)).astype(int), width - 1)
    np.add.at(radiance, (row, column), power / solid_angles(height, width)[row])
