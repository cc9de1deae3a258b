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
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data_gen.mitsuba_estimator import Estimator
from envbench.directions import Array
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
    return _sampled(_Sampling(scene, settings, result, estimator_for(scene, settings), started))


@dataclass(frozen=True)
class _Step:
    """An estimate, and what the next one is planned from.

    Attributes
    ----------
    samples : (n,) int
        A point and replicate, of the rendering afresh that it began with.
    known : float
        How many times that rendering's information it holds, topped up.
    cost : float
        Seconds that a sample takes.
    """

    result: Reference
    samples: NDArray[np.int_]
    known: float
    cost: float

    def worth(self, order: float) -> Array:
        """Return how many samples a point, (n,), would tell as much in one rendering."""
        return self.samples * self.known ** (1 / (2 * order))

    def lacking(self, order: float, affordable: float) -> float:
        """Return the least part of its samples that brings it to its floor; 0 where that takes too many."""
        more = self.known * ((self.result.floor / self.result.target) ** 2 - 1)
        most = affordable / self.samples.sum()
        return next((part for part in _PARTS if part ** (2 * order) > _SAFE * more and part <= most), 0.0)


@dataclass
class _Sampling:
    """The steps of one scene's reference, and what they took together."""

    scene: Scene
    settings: ReferenceSettings
    empty: Reference
    estimator: Estimator
    started: float
    steps: int = 0
    rays: int = 0

    @property
    def first(self) -> NDArray[np.int_]:
        """Samples of the first look."""
        few = self.settings.variant.startswith("scalar")
        return np.full(len(self.scene.points), FIRST // 4 if few else FIRST)

    def afresh(self, samples: NDArray[np.int_]) -> _Step:
        """Render with these samples a point."""
        replicates, cost = self._replicates(samples)
        return _Step(self._reference(replicates, samples.mean()), samples, 1.0, cost)

    def topped_up(self, step: _Step, part: float, order: float) -> _Step:
        """Render with a part of a step's samples, everywhere, and join both by what they tell."""
        samples = (part * step.samples).astype(int)
        replicates, cost = self._replicates(samples)
        more = part ** (2 * order)
        share = more / (step.known + more)
        joined = step.result.replicates + share * (replicates - step.result.replicates)
        result = self._reference(joined, step.result.samples + samples.mean())
        return replace(step, result=result, known=step.known + more, cost=cost)

    def affordable(self, step: _Step) -> float:
        """Return how many samples, of all points, what is left of the budget pays for."""
        return 0.9 * (self.settings.budget - step.result.seconds) / step.cost

    def _replicates(self, samples: NDArray[np.int_]) -> tuple[Array, float]:
        """Return K replicates, (K, n, 3), and the seconds of a sample, without what the first had to compile."""
        made: list[Array] = []
        begun = 0.0
        for seed in np.random.SeedSequence((self.settings.seed, self.steps)).spawn(self.settings.replicates):
            made.append(self.estimator.replicate(self.scene.points, samples, seed))
            begun = begun or time.perf_counter()
        self.steps += 1
        self.rays += self.estimator.rays * int(samples.sum()) * len(made)
        modulation = 1.0 if self.scene.points.modulation is None else self.scene.points.modulation
        return np.stack(made) * modulation, (time.perf_counter() - begun) / (len(made) - 1) / samples.sum()

    def _reference(self, replicates: Array, samples: float) -> Reference:
        return replace(
            self.empty,
            replicates=replicates.astype(np.float32).astype(np.float64),
            samples=round(samples),
            seconds=time.perf_counter() - self.started,
            visibility_rays=self.rays,
        )


def _sampled(sampling: _Sampling) -> Reference:
    """Take steps until one reaches the floor, or the budget ends."""
    settings, light = sampling.settings, sampling.scene.environment.mean.max()
    first = sampling.first
    goal, order, before = _MARGIN * settings.floor, sampling.estimator.order, (0.0, 0.0)
    step = sampling.afresh(first)
    while step.result.floor > settings.floor:
        result, affordable = step.result, sampling.affordable(step)
        if result.rms < _DARK * light:
            note = f"dark: {result.rms:.1e} RMS under light of mean radiance {light:.2g}"
            return replace(result, notes=(f"{note}; sampled once, whatever the noise",))
        part = step.lacking(order, affordable) if before[0] else 0.0
        if part:
            step = sampling.topped_up(step, part, order)
            continue
        worth = step.worth(order)
        if before[0] == first[0]:
            measured = math.log(before[1] / result.floor) / math.log(worth.mean() / before[0])
            order = min(max(measured, _RANDOM), 1.0)
        elif before[0]:  # a plan that fell short is not made again, but with a lower goal
            goal *= settings.floor / result.floor
        planned, floor = _plan(result, worth, order, goal, min(affordable, _GROWTH * worth.sum()))
        if not before[0] and planned.mean() > _FAR * first[0] and affordable > 2 * _SECOND * first.sum():
            planned = _SECOND * first  # a second look, at the same samples everywhere, shows the order
        if floor > settings.floor and floor > 0.9 * result.floor:
            end = f"{_MOST} samples a point" if planned.max() == _MOST else f"the budget of {settings.budget:g} s"
            note = f"noise floor {result.floor:.1e} instead of {settings.floor:.1e}: {end} came first"
            return replace(result, notes=(note,))
        before = worth.mean(), result.floor
        step = sampling.afresh(planned)
    return step.result


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
    measured: Reference, samples: Array, order: float, goal: float, most: float
) -> tuple[NDArray[np.int_], float]:
    """Return the samples a point, (n,) powers of two, that reach `goal` at the least cost, and the floor expected.

    With a noise of q_i N_i^-p at point i, p the `order`, weighed w_i, the sum of w_i q_i^2 N_i^-2p for a given sum of
    N_i is least at N_i ~ (w_i q_i^2)^(1 / (2 p + 1)). They are `most` in all; the noise was measured with `samples`.
    """
    power = (measured.standard_error**2).mean(-1) * measured.weight / measured.weight.sum()
    constant = power * samples ** (2 * order)
    share = np.maximum(constant, 1e-4 * constant.max()) ** (1 / (2 * order + 1))
    best = samples.astype(int), measured.floor
    for scale in np.geomspace(1, _MOST, 16 * round(math.log2(_MOST))) / share.max():
        exponents = np.clip(np.round(np.log2(scale * share)), 4, math.log2(_MOST))
        planned = 2 ** exponents.astype(int)
        if planned.sum() > most:
            break
        best = planned, float(np.sqrt((constant / planned ** (2 * order)).sum())) / (measured.rms or 1.0)
        if best[1] <= goal:
            break
    return best
