"""Do the two references agree? Mitsuba's against the quadrature, on convex scenes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy import stats

from envbench.directions import Array
from envbench.reference import Agreement, Reference, ReferenceSettings
from envbench.scene import Scene
from references import mitsuba_direct, quadrature

QUERIES = 32
"""Points of a scene that are compared, evenly chosen among all."""
CONFIDENCE = 0.999
SETTINGS = ReferenceSettings(floor=1e-4, budget=30.0)


def compare(name: str, sampled: Reference, exact: Array) -> Agreement:
    """Compare Mitsuba's reference with the quadrature's result (n, 3) at the same points."""
    count = len(sampled.replicates)
    quantile = float(stats.t.ppf(0.5 + CONFIDENCE / 2, count - 1))
    scale = float(np.abs(exact).mean()) or 1.0
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
        if scene.geometry.posed.convex:
            part = replace(scene, points=scene.points.spread(QUERIES))
            rows.append(compare(scene.name, mitsuba_direct.render(part, settings), quadrature.integrate(part)))
    return rows
