"""Ground truth by Mitsuba: reflected radiance at the query points, with its noise, from as many samples as it takes.

How light is sampled is what serves the scene best (`references.estimators`).

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

import math
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from data_gen.mitsuba_estimator import Estimator
from envbench.directions import Array
from envbench.geometry import Points
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Scene
from references import closed_form
from references.effects.without import simulated
from references.estimators import FIRST, estimator_for, surface_for

_EXACT = 0.1
"""Part of the noise floor asked for that a closed form may err by, at any point."""
_MOST = 2**20
"""Samples a point in one replicate, at most."""
_SECOND, _FAR = 4, 32
"""How many times the samples of the first look a second one takes, where more than so many times are to come."""
_GROWTH = 100
"""Most that the samples of one step exceed those of the step that it is planned from."""
_DARK = 1e-9
"""RMS radiance, relative to the light's mean radiance, below which a scene counts as dark."""
_MARGIN = 0.95
"""Of the target is planned for: points whose noise was measured too low by chance get too few samples."""
_PARTS = 0.125, 0.25, 0.5, 1.0, 2.0
"""Of a step's samples, everywhere, that it may be topped up by where it fell short."""
_SAFE = 1.03
"""How much more a top-up is to know than is lacking."""
_RANDOM = 0.5
"""The order of independent samples, which that of low-discrepancy samples does not fall below."""


def render(scene: Scene, settings: ReferenceSettings, key: str = "") -> Reference:
    """Sample until the noise floor reaches its target or the budget ends.

    Each step renders afresh, with the samples that the noise of the step before calls for, most where it was highest.
    As no estimate enters the plan of its own samples, all stay unbiased. A step that fell short by little is kept, and
    topped up by a part of its samples: everywhere by the same part, so that no point's estimate sets its own weight.

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
    estimator = estimator_for(scene, settings)
    modulation = 1.0 if scene.points.modulation is None else scene.points.modulation
    first = FIRST // 4 if settings.variant.startswith("scalar") else FIRST
    samples = np.full(len(scene.points), first)
    goal, order, before, rays, looks = _MARGIN * settings.floor, estimator.order, (0, 0.0), 0, 0
    step, part, known = samples, 0.0, 1.0
    while True:
        replicates, cost = _replicates(estimator, scene.points, step, settings, looks)
        replicates, rays, looks = replicates * modulation, rays + estimator.rays * int(step.sum()), looks + 1
        if part:
            more = part ** (2 * order)
            known += more
            replicates = result.replicates + more / known * (replicates - result.replicates)
        result = replace(
            result,
            replicates=replicates.astype(np.float32).astype(np.float64),
            samples=round(samples.mean()),
            seconds=time.perf_counter() - started,
            visibility_rays=rays * settings.replicates,
        )
        if result.floor <= settings.floor:
            return result
        if result.rms < _DARK * scene.environment.mean.max():
            note = f"dark: {result.rms:.1e} RMS under light of mean radiance {scene.environment.mean.max():.2g}"
            return replace(result, notes=(f"{note}; sampled once, whatever the noise",))
        affordable = 0.9 * (settings.budget - result.seconds) / cost * step.sum() / samples.sum()
        lacking = known * ((result.floor / settings.floor) ** 2 - 1)
        enough = (p for p in _PARTS if p ** (2 * order) > _SAFE * lacking and p <= affordable)
        part = next(enough, 0.0) if before[0] else 0.0
        if part:
            step = (part * samples).astype(int)
            continue
        if before[0] == first:
            measured = math.log(before[1] / result.floor) / math.log(result.samples / before[0])
            order = min(max(measured, _RANDOM), 1.0)
        elif before[0]:  # a plan that fell short is not made again, but with a lower goal
            goal *= settings.floor / result.floor
        planned, floor = _plan(result, samples, order, goal, min(affordable, _GROWTH))
        if not before[0] and planned.mean() > _FAR * first and affordable > 2 * _SECOND:
            planned = _SECOND * samples  # a second look, at the same samples everywhere, shows the order
        before = result.samples, result.floor
        if floor > settings.floor and floor > 0.9 * result.floor:
            end = f"{_MOST} samples a point" if samples.max() == _MOST else f"the budget of {settings.budget:g} s"
            note = f"noise floor {result.floor:.1e} instead of {settings.floor:.1e}: {end} came first"
            return replace(result, notes=(note,))
        step, samples, known = planned, planned, 1.0


def _replicates(
    estimator: Estimator, points: Points, samples: NDArray[np.int_], settings: ReferenceSettings, step: int
) -> tuple[Array, float]:
    """Return K replicates, (K, n, 3), and the seconds that they would take without what the first had to compile."""
    made: list[Array] = []
    started = 0.0
    for seed in np.random.SeedSequence((settings.seed, step, int(samples.sum()))).spawn(settings.replicates):
        made.append(estimator.replicate(points, samples, seed))
        started = started or time.perf_counter()
    return np.stack(made), (time.perf_counter() - started) * len(made) / (len(made) - 1)


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


def _plan(
    measured: Reference, samples: NDArray[np.int_], order: float, goal: float, growth: float
) -> tuple[NDArray[np.int_], float]:
    """Return the samples a point, (n,) powers of two, that reach `goal` at the least cost, and the floor expected.

    With a noise of q_i N_i^-p at point i, p the `order`, weighed w_i, the sum of w_i q_i^2 N_i^-2p for a given sum of
    N_i is least at N_i ~ (w_i q_i^2)^(1 / (2 p + 1)). There are at most `growth` times the `samples` measured with.
    """
    power = (measured.standard_error**2).mean(-1) * measured.weight / measured.weight.sum()
    constant = power * samples ** (2 * order)
    share = np.maximum(constant, 1e-4 * constant.max()) ** (1 / (2 * order + 1))
    best = samples, measured.floor
    for scale in np.geomspace(1, _MOST, 16 * round(math.log2(_MOST))) / share.max():
        exponents = np.clip(np.round(np.log2(scale * share)), 4, math.log2(_MOST))
        planned = 2 ** exponents.astype(int)
        if planned.sum() > growth * samples.sum():
            break
        best = planned, float(np.sqrt((constant / planned ** (2 * order)).sum())) / (measured.rms or 1.0)
        if best[1] <= goal:
            break
    return best
