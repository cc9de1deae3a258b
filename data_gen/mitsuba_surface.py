"""What reflects, in Mitsuba: a material, the mesh that can shadow it, and both under a light."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from data_gen.boundary import is_closed
from data_gen.geometry import mitsuba_mesh
from data_gen.mitsuba_bsdf import bsdf, texture
from data_gen.mitsuba_light import emitter
from envbench import llvm
from envbench.environment import Environment
from envbench.geometry import Geometry, TriangleMesh
from envbench.material import Material

_LIFT = 2e-5
"""How far off the surface rays start, relative to the shape's size and place: some 100 roundings of a coordinate."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What reflects: a material, and the mesh that can shadow it (None where nothing can).

    Mitsuba's objects are made at first use, belong to `variant`, and are left out when pickled.

    Attributes
    ----------
    bounces : int
        How often light may come by way of the occluder, which reflects as the material does.
    carried : bool
        The occluder is the shape at rest, whose points are elsewhere than those seen: light from w reaches a point of
        rotation R if at rest it comes through from R^T w. So a pose carries the transfer along, and no part of the
        posed shape shadows another.
    any_view : bool
        The material looks the same from everywhere: its reflection is the mean over views about the shading normal,
        weighed by their cosine. A point's radiance is its radiosity over pi.
    any_tangent : bool
        The material is the same along all tangents: the mean over their turns about the shading normal.
    """

    material: Material
    occluder: TriangleMesh | None
    variant: str = "llvm_ad_rgb"
    bounces: int = 0
    carried: bool = False
    any_view: bool = False
    any_tangent: bool = False

    @classmethod
    def of(cls, material: Material, geometry: Geometry, variant: str = "llvm_ad_rgb") -> Surface:
        """Return the surface of a shape: a convex one, or the sphere in closed form, shadows nothing."""
        return cls(material, None if geometry.convex else geometry.mesh, variant)

    @cached_property
    def bsdf(self) -> Any:
        """Give the material as a `mi.BSDF`."""
        llvm.mitsuba(self.variant)
        return bsdf(self.material)

    @cached_property
    def shape(self) -> Any:
        """Give the occluder as a `mi.Mesh`; None where there is none."""
        return None if self.occluder is None else _mesh(self.variant, self.occluder)

    @cached_property
    def closed(self) -> bool:
        """Whether the occluder bounds a solid, so that its inside is dark; of an open one both sides reflect."""
        return self.occluder is not None and _closed(self.occluder)

    @cached_property
    def texture(self) -> Any:
        """Give the material's texture as a `mi.Texture2f`; None where there is none."""
        if self.material.texture is None:
            return None
        return texture(llvm.mitsuba(self.variant), self.material.texture)

    @cached_property
    def lift(self) -> float:
        """How far off the occluder rays start."""
        if self.occluder is None:
            return 0.0
        vertices = self.occluder.vertices
        return _LIFT * float(np.linalg.norm(np.ptp(vertices, axis=0)) / 2 + np.abs(vertices).max())

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}


@lru_cache(maxsize=4)
def _closed(occluder: TriangleMesh) -> bool:
    return is_closed(occluder)


@lru_cache(maxsize=2)
def _mesh(variant: str, occluder: TriangleMesh) -> Any:
    return mitsuba_mesh(llvm.mitsuba(variant), occluder)


@lru_cache(maxsize=2)
def lit(variant: str, environment: Environment, occluder: TriangleMesh | None) -> tuple[tuple[float, Any], ...]:
    """Return the parts of a light, as signs and scenes; the first holds the occluder. Kept for the next estimators."""
    mi = llvm.mitsuba(variant)
    import drjit as dr

    made: list[tuple[float, Any]] = []
    for sign, part in environment.parts:
        content = {"type": "scene", "light": emitter(part)}
        if occluder is not None and not made:
            content["shape"] = _mesh(variant, occluder)
        scene = mi.load_dict(content)
        # What Mitsuba would evaluate at first use is so here: else the first kernel would be compiled twice.
        parameters = mi.traverse(scene)
        dr.eval([parameters[key] for key in parameters.keys()])  # noqa: SIM118 - no mapping
        made.append((sign, scene))
    return tuple(made)
