"""What is rendered where an effect is left out: light, material and points that lack it (the rest is the surface's)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from data_gen.environments.projected import project
from envbench.directions import normalised
from envbench.geometry import Viewer
from envbench.scene import Effect, Scene
from references.effects.facts import occasions, opaque


def left_out(scene: Scene) -> frozenset[Effect]:
    """Return the effects that a scene has occasion for, and that are not simulated there."""
    return occasions(scene) - scene.effects


def simulated(scene: Scene) -> Scene:
    """Return the scene as ground truth takes it, its effects heeded.

    Without light detail, the light is its projection to the first bands. Without perspective, all points are seen from
    one distant direction: from their mean towards the eye. Without subsurface scattering, the material has no medium.
    What is left needs no change of the scene, but of how it is rendered (`references.mitsuba_direct.surface_for`).
    """
    without = left_out(scene)
    if Effect.LIGHT_DETAIL in without:
        scene = replace(scene, environment=project(scene.environment, scene.order))
    if Effect.PERSPECTIVE in without:
        scene = distant(scene)
    if Effect.SUBSURFACE not in scene.effects and scene.material.medium is not None:
        scene = opaque(scene)
    return scene


def distant(scene: Scene) -> Scene:
    """Return the scene whose eye is moved away along the line from the points' mean, to infinity."""
    assert scene.viewer is not None
    centre = np.average(scene.points.position, axis=0, weights=scene.points.weight)
    direction = normalised(np.asarray(scene.viewer.eye, float) - centre)
    points = replace(scene.points, view=np.tile(direction, (len(scene.points), 1)))
    return replace(scene, points=points, viewer=Viewer(direction=(direction[0], direction[1], direction[2])))
