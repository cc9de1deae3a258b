"""A shape in a pose as pictures: Mitsuba's reference, what methods make of the same, how far off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import CATALOGUE
from benchmarks.studies.contact_sheet import Scale, Tile, exposed, signed
from envbench.catalogue import Spec
from envbench.directions import Array
from envbench.geometry import Geometry
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Scene
from envbench.tonemap import exposure
from references import reference

LOCAL = (Effect.SELF_SHADOWING,)
"""Shadows of the shape at rest, carried along: what LDPRT claims."""
SHADOWS = (Effect.SELF_SHADOWING, Effect.DEFORMATION)
"""Shadows of the shape as it is posed."""
SIZE = 160
SCALE = Scale(0.2, "RMS radiances of the reference")
TONED = (
    "Linear radiance, exposed so that the 99th percentile of the reference's luminance is about 1, alike in a row, "
    "clipped, sRGB curve."
)
SETTINGS = ReferenceSettings(floor=3e-2, budget=600.0)
"""A floor that is reached in seconds, and a budget that is not: so a study gives the same twice."""


@dataclass(frozen=True, eq=False)
class Rendering:
    """A scene and its reference."""

    scene: Scene
    truth: Reference

    def error(self, values: NDArray[np.floating]) -> float:
        """Return the NRMSE of radiance (n, 3) at the scene's points, the reference's own noise taken off."""
        return distance(values, self.truth) / self.truth.rms

    @property
    def stops(self) -> float:
        """The exposure of all its tiles."""
        return exposure(self.truth.mean)

    def reference(self, caption: str = "") -> Tile:
        """Return a tile of the reference."""
        return self.tile(self.truth.mean, caption)

    def tile(self, values: NDArray[np.floating], caption: str = "") -> Tile:
        """Return a tile of radiance (n, 3) at the scene's points."""
        return Tile(exposed(self.scene.points.image(np.asarray(values, float)), self.stops), caption)

    def difference(self, values: NDArray[np.floating], scale: Scale, caption: str = "") -> Tile:
        """Return a tile of what is too much and too little, over the reference's RMS."""
        relative = (np.asarray(values, float) - self.truth.mean) / self.truth.rms
        return Tile(signed(self.scene.points.image(relative), scale.limit), caption)


def rendered(
    geometry: Spec | str,
    effects: Sequence[Effect] | None,
    *,
    light: Spec | str = "studio-6",
    material: Spec | str = "lambertian",
    direction: Sequence[float] = (0.3, -1.0, 0.25),
    size: int = SIZE,
    settings: ReferenceSettings = SETTINGS,
) -> Rendering:
    """Render a shape, by name or table, seen from a distant direction."""
    scene = CATALOGUE.scene(
        name=geometry if isinstance(geometry, str) else "shape",
        light=CATALOGUE.lights[light] if isinstance(light, str) else light,
        material=CATALOGUE.materials[material] if isinstance(material, str) else material,
        geometry=CATALOGUE.geometries[geometry] if isinstance(geometry, str) else geometry,
        view={"kind": "image", "size": size, "direction": list(direction)},
        effects=effects,
    )
    return Rendering(scene, reference(scene, settings))


def shaded(method: Any, scene: Scene, prepared: Any = None) -> Array:
    """Return the radiance (n, 3) that a method finds at a scene's points."""
    if prepared is None:
        prepared = method.prepare(scene.material, scene.geometry.rest)
    return np.asarray(method.shade(method.relight(prepared, scene.environment), scene.points), float)


def at_rest(geometry: Spec | str) -> Geometry:
    """Return a shape without its pose, by name or table."""
    from data_gen.geometry import build

    return build(CATALOGUE.geometries[geometry] if isinstance(geometry, str) else geometry).rest


def distance(found: NDArray[np.floating], truth: Reference) -> float:
    """Return the RMS difference of radiance (n, 3) from a reference, whose noise is taken off."""
    square = ((found - truth.mean) ** 2 - truth.standard_error**2).mean(-1)
    return float(np.sqrt(max((square * truth.weight).sum(), 0.0)))
