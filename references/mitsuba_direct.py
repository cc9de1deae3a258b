"""Ground truth by Mitsuba: reflected radiance at the query points, with its noise, from as many samples as it takes.

How light is sampled, and in how many parts, is what serves the scene best (`references.estimators`).

What is simulated follows the scene's effects:

======================================  ==============================================================================
effects                                 light reaches a point
======================================  ==============================================================================
none of those below                     from everywhere
self-shadowing                          where the shape lets it through. Of a posed shape: where the shape *at rest*
                                        does, seen from the point at rest, its directions turned along with the pose:
                                        local effects only, what a transfer simulated at rest and turned tells of
self-shadowing, deformation             where the posed shape lets it through
inter-reflection, beside these          also by way of the shape, as often as the scene says, or the settings
subsurface                              having scattered inside the shape, posed or, without deformation, at rest, as
                                        above. Shadows and bounces are those of the paths: nothing is opaque
======================================  ==============================================================================

The others are left out as `references.effects.without` says. Without view dependence the radiance is the mean over
views about the shading normal, weighed by their cosine; without anisotropy, over all turns of the tangent. A diffuse
surface that nothing shadows, under a light of few bands, is not sampled at all (`references.closed_form`).
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Scene
from references import closed_form
from references.allocation import MOST, SECOND, Part, apart, planned
from references.effects.without import simulated
from references.estimators import FIRST, divisible, estimator_for, surface_for

_EXACT = 0.1
"""Part of the noise floor asked for that a closed form may err by, at any point."""
_GROWTH = 100
"""Most that the samples of one step exceed those of the step that it is planned from."""
_MARGIN = 0.87
"""Of the target is planned for: points whose noise was measured too low by chance get too few samples."""


def render(scene: Scene, settings: ReferenceSettings, key: str = "") -> Reference:
    """Sample until the noise floor reaches its target or the budget ends.

    Each step renders afresh, with the samples that the noise of the step before calls for, most where it was highest
    (`references.allocation`).
    As no estimate enters the plan of its own samples, all stay unbiased.

    Parameters
    ----------
    scene : Scene
    settings : ReferenceSettings
    key : str
        Content address to label the result with.

    Returns
    -------
    Reference
        Its replicates hold float32 values, so that a stored copy is the same to the bit.

    Raises
    ------
    BadInput, CannotRun
        The variant is unknown, or cannot run on this machine.
    """
    started = time.perf_counter()
    shape = (settings.replicates, len(scene.points), 3)
    result = Reference(np.zeros(shape), scene.points.weight, 0, 0.0, key, settings.floor)
    if not scene.environment.radiance.any():
        return result
    scene = simulated(scene)
    exact = _exact(scene, result)
    if exact is not None:
        return replace(exact, seconds=time.perf_counter() - started)
    modulation = 1.0 if scene.points.modulation is None else scene.points.modulation
    whole = estimator_for(scene, settings)
    first = FIRST // 4 if settings.variant.startswith("scalar") else FIRST
    parts = [Part(whole, np.full(len(scene.points), first))]
    goal, rays, looks = _MARGIN * settings.floor, 0, 0
    while True:
        if not looks and divisible(scene, whole):
            direct, rest = parts[0].look(scene.points, settings)
            rays += parts[0].rays
            parts = apart(parts[0], direct, rest, scene.points.weight, modulation)
        else:
            for place, part in enumerate(parts):
                part.sample(scene.points, settings, place)
            rays += sum(part.rays for part in parts)
        replicates = np.sum([part.replicates for part in parts], axis=0) * modulation
        result = replace(
            result,
            replicates=replicates.astype(np.float32).astype(np.float64),
            samples=round(sum(part.samples.mean() for part in parts)),
            seconds=time.perf_counter() - started,
            visibility_rays=rays,
        )
        if result.floor <= settings.floor:
            return result
        looks += 1
        powers = [part.power(scene.points.weight, modulation) for part in parts]
        if looks == 2:
            for part, power in zip(parts, powers, strict=True):
                part.learn_order(power)
        elif looks > 2:  # a plan that fell short is not made again, but with a lower goal
            goal *= settings.floor / result.floor
        spent = sum(part.spent for part in parts)
        left = 0.9 * (settings.budget - result.seconds) / settings.replicates
        affordable = left / sum(part.seconds for part in parts)
        target = goal * result.rms if result.rms > 0 else goal
        samples, noise = planned(parts, powers, target, min(affordable, _GROWTH) * spent)
        floor = noise / (result.rms or 1.0)
        if floor > settings.floor and floor > 0.9 * result.floor:
            most = max(part.samples.max() for part in parts) == MOST
            end = f"{MOST} samples a point" if most else f"the budget of {settings.budget:g} s"
            note = f"noise floor {result.floor:.1e} instead of {settings.floor:.1e}: {end} came first"
            return replace(result, notes=(note,))
        for part, power, wanted in zip(parts, powers, samples, strict=True):
            part.plan(wanted, power, second=looks == 1 and affordable > 2 * SECOND)


def _exact(scene: Scene, empty: Reference) -> Reference | None:
    """Return the reference in closed form, all replicates equal; None where there is none, or none exact enough."""
    material = scene.material
    if not scene.heeded or not closed_form.diffuse(material) or material.transparency is not None:
        return None
    if surface_for(scene, "scalar_rgb", 0).occluder is not None:
        return None
    values, error = closed_form.radiance(material, scene.environment, scene.points)
    if scene.points.modulation is not None:
        values = values * scene.points.modulation
    exact = np.broadcast_to(values.astype(np.float32).astype(np.float64), empty.replicates.shape)
    found = replace(empty, replicates=exact, notes=(f"in closed form, to {error:.1e} at every point",))
    return found if error <= _EXACT * empty.target * found.rms else None
