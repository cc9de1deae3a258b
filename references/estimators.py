"""Which of Mitsuba's estimators serve a scene best: what reflects there, and how its light is sampled.

A scene that everything is simulated on, facts unheeded (`Scene.heeded`), has one path tracer for all effects: Mitsuba's
`path`, or `volpath`. Else it has the estimator that is cheapest for its effects:

- a diffuse surface that shadows itself, under light without detail: what the shape changes of the closed form alone,
  one ray a bounce and none to the light (`data_gen.mitsuba_diffuse`);
- light without detail that scatters inside: walks that look at the light where they end (`data_gen.mitsuba_walk`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from data_gen.lobes import Lambertian, Membrane
from data_gen.mitsuba_diffuse import Diffuse
from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from data_gen.mitsuba_volume import Scattering
from data_gen.mitsuba_walk import Walk
from envbench.directions import Array
from envbench.environment import Environment
from envbench.reference import ReferenceSettings
from envbench.scene import Effect, Scene
from references import closed_form
from references.effects.facts import occasions
from references.effects.without import left_out, simulated

FIRST = 64
"""Samples a point that a first look takes; a power of four."""
_NARROW = 0.5
"""Half-angle, in radians, of a cone that holds 90 % of a lobe, below which lobes are always sampled."""
_PILOT, _PILOT_REPLICATES = 512, 8
"""Points and replicates of the pilot that decides whether wider lobes are sampled."""
_COST = 2.0
"""How much longer a sample takes with one of the lobes; noise falls as N^-0.7, so that it may be 2^0.7 times less."""

_EXACT = 0.05
"""Part of the noise floor asked for that the unshadowed radiance may err by: what shadows itself is darker."""
_ROWS, _BENT = 256, 1.1e-5
"""Of maps of the unshadowed radiance, and what they err by between their samples, relative to their largest."""


def surface_for(scene: Scene, variant: str, bounces: int) -> Surface:
    """Return what reflects in a scene: its material, what its effects let shadow it, and what is averaged over."""
    without = left_out(scene)
    bare = Surface(
        simulated(scene).material, None, variant,
        any_view=Effect.VIEW_DEPENDENCE in without, any_tangent=Effect.ANISOTROPY in without,
    )  # fmt: skip
    carried = scene.geometry.pose is not None and Effect.DEFORMATION not in scene.effects
    shape = scene.geometry.rest if carried else scene.geometry.posed
    if Effect.SUBSURFACE in scene.effects:
        return replace(bare, occluder=shape.mesh, carried=carried)
    if not scene.effects & {Effect.SELF_SHADOWING, Effect.INTERREFLECTION}:
        return bare
    if shape.convex and scene.heeded:
        return bare
    often = bounces if scene.bounces is None else scene.bounces
    return replace(
        bare, occluder=shape.mesh, carried=carried, bounces=often if Effect.INTERREFLECTION in scene.effects else 0
    )


def estimator_for(scene: Scene, settings: ReferenceSettings) -> Estimator:
    """Return the one estimator that serves a scene best.

    Where light bounces, and on diffuse surfaces, the lobes are sampled too; so they are where a pilot does not do as
    well without. Where the light's samples miss a peak they seem less noisy than they are; so their error is taken from
    the mean of the other estimate too, which finds all peaks. The choice rests on noise alone and is the same on every
    machine.
    """
    scene = simulated(scene)
    variant = settings.variant
    surface = surface_for(scene, variant, settings.bounces)
    if Effect.SUBSURFACE in scene.effects:
        return scattering(scene, surface, scene.environment)
    if surface.occluder is not None and informed(scene, variant):
        unshadowed = _unshadowed(scene, settings.floor)
        if unshadowed is not None:
            return Diffuse(surface, scene.environment, unshadowed=unshadowed)
    both = Estimator(surface, scene.environment)
    if surface.bounces or all(isinstance(lobe, Lambertian | Membrane) for lobe in scene.material.lobes):
        return both
    light = replace(both, sample_lobes=False)
    if variant.startswith("scalar") or any(lobe.cone(0.1) < _NARROW for lobe in scene.material.lobes):
        return both
    points = scene.points.spread(_PILOT)
    seeds = np.random.SeedSequence((settings.seed, _PILOT)).spawn(2 * _PILOT_REPLICATES)
    looks = np.array([
        [estimator.replicate(points, FIRST, child) for child in seeds[half::2]]
        for half, estimator in enumerate((both, light))
    ])  # fmt: skip
    variance = (looks.var(1, ddof=1) / _PILOT_REPLICATES).mean((1, 2))
    missed = ((looks[1].mean(0) - looks[0].mean(0)) ** 2).mean() - variance[0]
    return light if max(variance[1], missed) < _COST ** (2 * 0.7) * variance[0] else both


def scattering(scene: Scene, surface: Surface, light: Environment) -> Estimator:
    """Return what renders a translucent surface under `light`, chosen for the `scene`."""
    return (Walk if informed(scene, surface.variant) else Scattering)(surface, light)


def informed(scene: Scene, variant: str) -> bool:
    """Whether estimators that rely on smooth light may serve: lamps they would find by chance alone.

    Their loops are not for scalar variants.
    """
    return scene.heeded and _smooth(scene) and not variant.startswith("scalar")


def _smooth(scene: Scene) -> bool:
    """Whether the light has no detail, or none that is simulated."""
    return Effect.LIGHT_DETAIL not in occasions(scene) & scene.effects


def _unshadowed(scene: Scene, floor: float) -> Array | None:
    """Return the unshadowed radiance by normal, a lat-long map (h, 2 h, 3); None where it is not known to the floor."""
    material, light = scene.material, scene.environment
    if not closed_form.diffuse(material) or material.transparency is not None:
        return None
    found = closed_form.by_normal(material, light, _ROWS)
    error = closed_form.error(material, light) + _BENT * np.abs(found).max()
    return found if error <= _EXACT * floor * np.sqrt((found**2).mean()) else None
