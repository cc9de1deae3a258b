"""How many samples each part of a reference takes at each point, for the noise asked for at the least cost."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from data_gen.mitsuba_estimator import Estimator
from envbench.directions import Array
from envbench.geometry import Points
from envbench.reference import ReferenceSettings
from references.estimators import divided

MOST = 4**10
"""Samples a point in one replicate, at most."""
SECOND = 4
"""How many times the samples of a first look a second one takes, where many more are to come: it shows the order."""
QUIET = 0.1
"""Of the squared noise of direct light, that bounces make at most where they have samples of their own."""
_STEP = 0.05
"""Of the logarithm of what samples are proportional to: they are powers of four anyway."""
_LEAST_SHARE = 1e-4
"""Of the largest power, that a point counts with: its own may have been measured too low."""


@dataclass
class Part:
    """One of the independent estimates whose sum the radiance is, with samples of its own.

    Attributes
    ----------
    samples : (n,) int
        At each point of one replicate: powers of four.
    least : int
        Samples that a point takes at least: a quarter of the first.
    order : float
        With which noise falls, about, by the samples.
    replicates : (K, n, 3)
        What the last samples gave.
    cost : float
        Of one sample, relative to those of other parts: by its rays, so that all machines plan alike.
    seconds : float
        That the last replicates took, each.
    before : (float, float)
        Mean samples of the look before the last, and its standard error.
    """

    estimator: Estimator
    samples: NDArray[np.int_]
    least: int = field(init=False)
    order: float = field(init=False)
    replicates: Array = field(init=False, repr=False)
    cost: float = field(init=False)
    seconds: float = field(init=False, default=0.0)
    before: tuple[float, float] = field(init=False, default=(0.0, 0.0))

    def __post_init__(self) -> None:
        self.least, self.order = int(self.samples.min()) // 4, self.estimator.order
        self.cost = 1.0 + self.estimator.rays

    @property
    def spent(self) -> float:
        """What one replicate costs."""
        return self.cost * float(self.samples.sum())

    def look(self, points: Points, settings: ReferenceSettings) -> tuple[Array, Array]:
        """Render a first time, and return direct light and what comes by way of the shape, (K, n, 3) each."""
        samples = int(self.samples[0])
        made: list[Array] = []
        started = 0.0
        for seed in np.random.SeedSequence((settings.seed, int(self.samples.sum()))).spawn(settings.replicates):
            made.append(self.estimator.by_bounce(points, samples, seed))
            started = started or time.perf_counter()
        self.seconds = (time.perf_counter() - started) / (settings.replicates - 1)
        direct, rest = (np.stack([m[one].sum(0) for m in made]) for one in (slice(1), slice(1, None)))
        self.replicates = direct + rest
        return direct, rest

    def sample(self, points: Points, settings: ReferenceSettings, place: int) -> None:
        """Render all replicates afresh, by seeds of its `place` among the parts."""
        number = int(self.samples.sum())
        seeds = np.random.SeedSequence((settings.seed, number, *[place] * (place > 0))).spawn(settings.replicates)
        made: list[Array] = []
        started = 0.0
        for seed in seeds:
            made.append(self.estimator.replicate(points, self.samples, seed))
            started = started or time.perf_counter()  # a first replicate may have had to compile: the next have not
        self.seconds = (time.perf_counter() - started) / (len(seeds) - 1)
        self.replicates = np.stack(made)

    @property
    def rays(self) -> int:
        """Visibility rays that the replicates took."""
        return self.estimator.rays * int(self.samples.sum()) * len(self.replicates)

    def plan(self, wanted: NDArray[np.int_], power: Array, second: bool) -> None:
        """Take the samples that are wanted next, or where many are and there may be a `second` look, that one."""
        self.before = float(self.samples.mean()), math.sqrt(power.sum())
        looked = second and wanted.mean() > 2 * SECOND * self.samples.mean()
        self.samples = SECOND * self.samples if looked else wanted

    def learn_order(self, power: Array) -> None:
        """Take the order that the last two looks show: it lies between the estimator's and 1."""
        samples, noise = self.before
        grown, now = self.samples.mean() / samples, math.sqrt(power.sum())
        if grown > 1 and 0 < now < noise:
            self.order = min(max(math.log(noise / now) / math.log(grown), self.estimator.order), 1.0)

    def power(self, weight: Array, modulation: Array | float) -> Array:
        """Return the squared standard error at each point, (n,), mean over channels, times its weight of a sum 1."""
        made = self.replicates * modulation
        return made.var(0, ddof=1).mean(-1) / len(made) * weight / weight.sum()


def apart(whole: Part, direct: Array, rest: Array, weight: Array, modulation: Array | float) -> list[Part]:
    """Return the parts that a first look calls for: direct light and bounces apart where these make little noise."""
    made = [Part(estimator, whole.samples) for estimator in divided(whole.estimator)]
    for part, values in zip(made, (direct, rest), strict=True):
        part.replicates = values
        part.seconds = whole.seconds * part.cost / sum(p.cost for p in made)
    noise = [part.power(weight, modulation).sum() for part in made]
    return made if noise[1] < QUIET * noise[0] else [whole]


def planned(
    parts: Sequence[Part], powers: Sequence[Array], goal: float, most: float
) -> tuple[list[NDArray[np.int_]], float]:
    """Return the samples of each part, (n,) each, that reach a standard error of `goal`, and the one to expect.

    With a noise of q N^-p at a point of a part, p its order, the sum of q^2 N^-2p over all is least for a given cost at
    N ~ (p q^2 / cost)^(1 / (2 p + 1)). One replicate costs at most so much.
    """
    constants = [power * part.samples ** (2 * part.order) for part, power in zip(parts, powers, strict=True)]
    wanted = [
        part.order * np.maximum(constant, max(_LEAST_SHARE * constant.max(), 1e-300)) / part.cost
        for part, constant in zip(parts, constants, strict=True)
    ]

    def at(scale: float) -> tuple[list[NDArray[np.int_]], float, float]:
        samples: list[NDArray[np.int_]] = []
        noise = cost = 0.0
        for part, constant, want in zip(parts, constants, wanted, strict=True):
            exponents = np.round((scale + np.log(want)) / (2 * part.order + 1) / math.log(4))
            least = math.log(part.least, 4)
            samples.append(4 ** np.clip(exponents, round(least), round(math.log(MOST, 4))).astype(int))
            noise += float((constant / samples[-1] ** (2 * part.order)).sum())
            cost += part.cost * float(samples[-1].sum())
        return samples, math.sqrt(noise), cost

    # Bisection: noise falls with the scale, and cost grows, both in steps.
    low = -max(float(np.log(want.max())) for want in wanted)
    high = 3 * math.log(MOST) - min(float(np.log(want.min())) for want in wanted)
    while high - low > _STEP:
        middle = (low + high) / 2
        _, noise, cost = at(middle)
        low, high = (low, middle) if noise <= goal or cost > most else (middle, high)
    samples, noise, cost = at(high)
    return (samples, noise) if cost <= most else at(low)[:2]
