"""What all methods of precomputed diffuse transfer share: the simulation at rest, the light vector, the points."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data_gen.lobes import Lambertian, Membrane
from data_gen.texture import transparency
from envbench import real_harmonics
from envbench.directions import Array
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Material
from envbench.method import Method
from envbench.scene import Effect, Scene
from methods.ldprt import membrane
from methods.ldprt.corners import Corners
from methods.ldprt.simulated import SIMULATIONS, Request
from methods.ldprt.transfer import MOST_BANDS, MOST_RAYS, Kind, Transfer

AUTO = "auto"
CALLS = {
    Effect.SUBSURFACE: Kind.SUBSURFACE,
    Effect.INTERREFLECTION: Kind.INTERREFLECTED,
    Effect.SELF_SHADOWING: Kind.SHADOWED,
}
"""What transfer an effect calls for; of several, the first."""
MOST_BOUNCES = 16
NEEDS_MESH = "transfer is stored at vertices: it needs a mesh"


@dataclass(frozen=True, eq=False)
class Asset:
    """A prepared shape: what a method stores of its transfer, `stored`, and what multiplies it, `reflectance` (3,)."""

    stored: Any
    triangles: NDArray[np.int32]
    reflectance: Array
    told: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Lit:
    """An asset under a light: `light` (n^2, 3), reflectance included, and what else a method makes of it."""

    asset: Asset
    light: Array
    extra: Any = None


@dataclass(frozen=True)
class Diffuse(Method):
    """Transfer vectors of a diffuse shape at rest, simulated with rays; a membrane's are closed forms.

    A membrane's map of transparency is looked up at the vertices.

    Attributes
    ----------
    order : int
        n: light and transfer hold the bands l < n.
    transfer : {"auto", "unshadowed", "shadowed", "interreflected", "subsurface"}
        "auto" is what the effects of the scene call for, and shadowed where there is no scene. Subsurface: through the
        medium of a translucent material.
    rays : int
        From each vertex; walks of as many steps as they take, for subsurface transfer.
    bounces : int
        Of inter-reflected transfer; with "auto" the scene's own, where it has a number. The light that a surface sends
        on is that of its mean reflectance, in one channel.
    seed : int
        Of the rays.
    """

    maps_transparency = True

    order: int = 6
    transfer: str = AUTO
    rays: int = 5000
    bounces: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        if self.transfer not in (AUTO, *Kind):
            known = ", ".join(repr(str(kind)) for kind in (AUTO, *Kind))
            raise BadInput(f"transfer must be one of {known}. Got '{self.transfer}' instead.")
        for name, low, high in (("order", 2, MOST_BANDS), ("rays", 10, MOST_RAYS), ("bounces", 1, MOST_BOUNCES)):
            if not low <= getattr(self, name) <= high:
                raise BadInput(f"{name} must lie in [{low}, {high}]. Got {getattr(self, name)} instead.")

    def called_for(self, scene: Scene) -> Self:
        """Settle "auto": the transfer that the scene's effects call for; a membrane has but its closed form."""
        if self.transfer != AUTO:
            return self
        thin = any(isinstance(lobe, Membrane) for lobe in scene.material.lobes)
        called = [kind for effect, kind in CALLS.items() if effect in scene.effects and not thin]
        kind = called[0] if called else Kind.UNSHADOWED
        known = kind is Kind.INTERREFLECTED and scene.bounces is not None
        bounces = min(scene.bounces or 1, MOST_BOUNCES) if known else self.bounces
        return replace(self, transfer=kind.value, bounces=bounces)

    def lacks(self, scene: Scene) -> frozenset[Effect]:
        """Shadows and bounces are those of the shape at rest, if they were simulated.

        Light that scatters inside has them in its walks, which leave the shape and come in again.
        """
        own = {
            Kind.UNSHADOWED: set[Effect](),
            Kind.SHADOWED: {Effect.SELF_SHADOWING},
            Kind.INTERREFLECTED: {Effect.SELF_SHADOWING, Effect.INTERREFLECTION},
            Kind.SUBSURFACE: {Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.SUBSURFACE},
        }
        return scene.effects - own[Kind(self.called_for(scene).transfer)]

    def declines(self, scene: Scene) -> str | None:
        if scene.geometry.mesh is None:
            return NEEDS_MESH
        if self.transfer == Kind.SUBSURFACE:
            if scene.material.medium is None:
                return "subsurface transfer needs a translucent material: this one has no medium"
            if Effect.SUBSURFACE not in scene.effects:
                return "it always simulates the scattering that this scene leaves out"
        lobes = scene.material.lobes
        if any(isinstance(lobe, Membrane) for lobe in lobes):
            if len(lobes) > 1:
                return "holds a membrane by itself only"
            closed = self.transfer in (AUTO, Kind.UNSHADOWED)
            return None if closed else "a membrane's transfer is its closed form: unshadowed"
        return None if all(isinstance(lobe, Lambertian) for lobe in lobes) else "holds diffuse lobes only"

    def prepare(self, material: Material, geometry: Geometry) -> Asset:
        """Simulate the transfer, or take it from a method that did, and store it in the method's own form."""
        mesh = geometry.mesh
        if mesh is None:
            raise BadInput(NEEDS_MESH)
        reflectance = np.sum([lobe.reflectance for lobe in material.lobes], axis=0)
        found = self._simulated(material, geometry, float(reflectance.mean()))
        stored, told = self.store(found)
        how: dict[str, Any] = {"order": self.order, "transfer": found.kind.value, "vertices": len(found.vectors)}
        if found.kind is Kind.INTERREFLECTED:
            how["bounces"] = self.bounces
        if found.rays:
            how |= {
                "walks a vertex" if found.kind is Kind.SUBSURFACE else "rays a vertex": found.rays,
                "standard error": found.relative_error,
                "seconds of simulation": found.seconds,
            }
        return Asset(stored, mesh.triangles, reflectance, {**how, **told})

    def relight(self, prepared: Asset, environment: Environment) -> Lit:
        """Project the light, once."""
        light = real_harmonics.project(environment.radiance, self.order - 1) * prepared.reflectance
        return Lit(prepared, light, self.specialise(light))

    def shade(self, framed: Lit, points: Points) -> NDArray[np.floating]:
        """Shade each point at its vertex, or at the corners of its triangle."""
        corners = Corners.of(points, framed.asset.triangles)
        rotations = None if points.rotation is None else corners.spread(points.rotation)
        return corners.blended(self.evaluate(framed, corners.lanes, rotations))

    def describe(self, prepared: Asset) -> dict[str, Any]:
        return prepared.told

    @abstractmethod
    def store(self, transfer: Transfer) -> tuple[Any, dict[str, Any]]:
        """Return the form in which transfer is kept, and what to tell of it."""

    def specialise(self, light: Array) -> Any:
        """Return what is made of the light vector (n^2, 3) before any point is shaded."""
        return None

    @abstractmethod
    def evaluate(self, lit: Lit, vertex: NDArray[np.integer], rotations: Array | None) -> NDArray[np.float32]:
        """Return radiance (k, 3) at vertices (k,), each turned by its rotation from rest."""

    def _simulated(self, material: Material, geometry: Geometry, albedo: float) -> Transfer:
        lobe = material.lobes[0]
        if isinstance(lobe, Membrane):
            mesh, map_ = geometry.mesh, material.transparency
            assert mesh is not None
            alpha = lobe.transparency if map_ is None else transparency(map_, mesh.uv)
            vectors = membrane.transfer(mesh.normals, self.order, alpha)
            return Transfer(vectors, np.zeros_like(vectors), Kind.UNSHADOWED, 0, 0.0)
        kind = Kind.SHADOWED if self.transfer == AUTO else Kind(self.transfer)
        several = kind is Kind.INTERREFLECTED
        medium = material.medium if kind is Kind.SUBSURFACE else None
        if kind is Kind.SUBSURFACE and medium is None:
            raise BadInput(f"subsurface transfer needs a medium, and material '{material.name}' has none.")
        bounces, albedo = (self.bounces, albedo) if several else (0, 1.0)
        request = Request(self.order, kind, self.rays, bounces, albedo, self.seed, medium)
        return SIMULATIONS.get(geometry, request)


def chosen(packed: Any, vertex: NDArray[np.integer]) -> Any:
    """Return a dataclass of arrays with the points last, at these points: itself where they are all, in order."""
    count = len(packed)
    if len(vertex) == count and np.array_equal(vertex, np.arange(count)):
        return packed
    parts = {f.name: getattr(packed, f.name) for f in fields(packed)}
    taken = {name: part[..., vertex] if isinstance(part, np.ndarray) else part for name, part in parts.items()}
    return type(packed)(**taken)
