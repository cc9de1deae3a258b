"""What the facts of a scene say about each effect, before anything is rendered.

A fact rules an effect out for certain: whatever is simulated, leaving the effect out changes nothing. What no fact
rules out may matter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from data_gen.boundary import is_closed
from data_gen.lobes import Lambertian, Membrane
from envbench import harmonics, latlong
from envbench.environment import Environment
from envbench.geometry import Geometry, TriangleMesh
from envbench.material import Centre, Material
from envbench.scene import Effect, Scene

_WALKS = "none of its own: light that scatters inside leaves the shape and comes in again"
DETAIL = 1e-3
"""RMS of a light beyond its first bands, relative to its own, that counts as none: the map of a light projected to
these bands keeps a fifth of this beyond them."""


@dataclass(frozen=True)
class Fact:
    """Whether a scene has occasion for an effect, and why, in words."""

    occasion: bool
    reason: str


def facts(scene: Scene) -> dict[Effect, Fact]:
    """Return what is known of every effect of a scene."""
    found = {effect: Fact(False, "the light is black") for effect in Effect}
    if not scene.environment.radiance.any():
        return found
    viewed, along, inside = _view(scene.material), _tangent(scene.material), _subsurface(scene)
    shadows = Fact(False, _WALKS) if inside.occasion else _shadows(scene)
    found[Effect.VIEW_DEPENDENCE], found[Effect.ANISOTROPY], found[Effect.SELF_SHADOWING] = viewed, along, shadows
    found[Effect.INTERREFLECTION] = shadows if inside.occasion else _bounces(scene, shadows)
    found[Effect.DEFORMATION] = _deformation(scene, shadows, inside)
    found[Effect.SUBSURFACE] = inside
    found[Effect.PERSPECTIVE] = _perspective(scene, viewed)
    found[Effect.LIGHT_DETAIL] = _detail(scene.environment, scene.order)
    return found


def occasions(scene: Scene) -> frozenset[Effect]:
    """Return the effects that no fact rules out."""
    return frozenset(effect for effect, fact in facts(scene).items() if fact.occasion)


def opaque(scene: Scene) -> Scene:
    """Return the scene whose material has no medium."""
    return replace(scene, material=replace(scene.material, medium=None))


def fillable(shape: Geometry) -> bool:
    """Whether a medium can fill a shape: its mesh is closed, at rest and posed."""
    meshes = shape.mesh, shape.posed.mesh
    return all(mesh is not None and _closed(mesh) for mesh in meshes)


@lru_cache(maxsize=4)
def _closed(mesh: TriangleMesh) -> bool:
    return is_closed(mesh)


def _view(material: Material) -> Fact:
    if all(isinstance(lobe, Lambertian | Membrane) for lobe in material.lobes):
        return Fact(False, "diffuse: every lobe looks the same from everywhere")
    return Fact(True, "a lobe depends on the view")


def _tangent(material: Material) -> Fact:
    if all(lobe.centre is not Centre.TANGENT for lobe in material.lobes):
        return Fact(False, "isotropic: no lobe depends on the tangent")
    return Fact(True, "a lobe is centred on the tangent")


def _shadows(scene: Scene) -> Fact:
    if scene.geometry.posed.convex:
        return Fact(False, "convex: no point shadows another")
    return Fact(True, "not convex: points may shadow one another")


def _bounces(scene: Scene, shadows: Fact) -> Fact:
    if not shadows.occasion:
        return Fact(False, "convex: no point lights another")
    if not any(any(lobe.reflectance) for lobe in scene.material.lobes) or _black(scene.material):
        return Fact(False, "black: the shape reflects nothing onto itself")
    return Fact(True, "not convex: points may light one another")


def _black(material: Material) -> bool:
    return material.texture is not None and not material.texture.values.any()


def _deformation(scene: Scene, shadows: Fact, inside: Fact) -> Fact:
    if scene.geometry.pose is None:
        return Fact(False, "no pose")
    if inside.occasion:
        return Fact(True, "posed: light may scatter through it otherwise than at rest")
    if not shadows.occasion:
        return Fact(False, "convex as posed: no part meets another, and the pose turns local effects only")
    return Fact(True, "posed: its parts may shadow one another as they did not at rest")


def _subsurface(scene: Scene) -> Fact:
    if scene.material.medium is None:
        return Fact(False, "opaque: the material has no medium")
    if not fillable(scene.geometry):
        return Fact(False, "opaque: the shape is no closed mesh, which a medium could fill")
    return Fact(True, "the material has a medium")


def _perspective(scene: Scene, viewed: Fact) -> Fact:
    if scene.viewer is None:
        return Fact(False, "every point has a view of its own")
    if scene.viewer.eye is None:
        return Fact(False, "the viewer is distant")
    if not viewed.occasion:
        return Fact(False, "diffuse: where the viewer is makes no difference")
    return Fact(True, "the viewer is near")


@lru_cache(maxsize=4)
def _detail(environment: Environment, order: int) -> Fact:
    if np.ptp(environment.radiance, axis=(0, 1)).max() == 0:
        return Fact(False, "the light is constant")
    beyond = beyond_bands(environment, order)
    if beyond <= DETAIL:
        return Fact(False, f"the light has {order} bands: beyond them lies {beyond:.1e} of its RMS")
    return Fact(True, f"{beyond:.0%} of the light's RMS lies beyond {order} bands")


def beyond_bands(environment: Environment, order: int) -> float:
    """Return the RMS of what a light is beyond the bands l < `order`, relative to its own."""
    samples = environment.radiance
    height, width = samples.shape[:2]
    if height <= order or width < 2 * order:
        return 1.0
    alm = harmonics.analyse(samples, order - 1)
    rest = samples.astype(np.float64)
    for channel in range(3):
        banded = np.empty((1, height, width))
        harmonics.synthesise(alm[channel : channel + 1].astype(complex), 0, order - 1, banded, harmonics.threads())
        rest[..., channel] -= banded[0]
    weight = latlong.solid_angles(height, width)[..., None]
    return float(np.sqrt((rest**2 * weight).sum() / (samples.astype(np.float64) ** 2 * weight).sum()))
