"""Do the two references agree? Mitsuba's against the quadrature, on convex scenes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from envbench.directions import Array
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Scene
from references import mitsuba_direct, quadrature

QUERIES = 32
"""Points of a scene that are compared, evenly chosen among all."""
MARGIN = 3e-4
"""Largest difference of the means, relative to the mean radiance, that passes."""
CONFIDENCE = 0.999
SETTINGS = ReferenceSettings(floor=1e-4, budget=30.0)


@dataclass(frozen=True)
class Agreement:
    """How the references compare on one scene.

    Attributes
    ----------
    scene : str
    difference : float
        Mean over points and channels of Mitsuba less quadrature, relative to the quadrature's mean.
    half_width : float
        Of the 99.9 % interval of `difference`: t with K - 1 degrees of freedom over the K replicates.
    outside : float
        Part of all points and channels where the quadrature lies outside Mitsuba's own 99.9 % interval; a few times
        0.001 is usual, since the errors at a point are not quite normal.
    rms : float
        RMS difference over RMS radiance: as large as `floor`, if the floor is honest.
    floor : float
        Noise floor that Mitsuba's reference reached.
    """

    scene: str
    difference: float
    half_width: float
    outside: float
    rms: float
    floor: float

    @property
    def agrees(self) -> bool:
        """Whether the difference of the means lies within its interval and within `MARGIN`."""
        return abs(self.difference) <= min(self.half_width, MARGIN)


def compare(name: str, sampled: Reference, exact: Array) -> Agreement:
    """Compare Mitsuba's reference with the quadrature's result (n, 3) at the same points."""
    count = len(sampled.replicates)
    quantile = float(stats.t.ppf(0.5 + CONFIDENCE / 2, count - 1))
    scale = float(exact.mean()) or 1.0
    means = sampled.replicates.mean((1, 2)) / scale  # one a replicate: errors at points of one replicate may correlate
    error = sampled.mean - exact
    # float32 replicates of identical samples (a black light) have no spread at all
    outside = np.abs(error) > quantile * sampled.standard_error + 1e-6 * np.abs(exact)
    return Agreement(
        scene=name,
        difference=float(means.mean() - exact.mean() / scale),
        half_width=float(quantile * means.std(ddof=1) / np.sqrt(count)),
        outside=float(outside.mean()),
        rms=float(np.sqrt((error**2).mean() / ((exact**2).mean() or 1.0))),
        floor=sampled.floor,
    )


def table(scenes: Iterable[Scene], settings: ReferenceSettings = SETTINGS) -> list[Agreement]:
    """Compare the references on every convex scene, at `QUERIES` of its points."""
    rows: list[Agreement] = []
    for scene in scenes:
        if scene.geometry.convex:
            part = replace(scene, points=scene.points.spread(QUERIES))
            rows.append(compare(scene.name, mitsuba_direct.render(part, settings), quadrature.integrate(part)))
    return rows
