"""What a study does with one scene: run a method's four steps, and say how far the result is from ground truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import CATALOGUE
from envbench.catalogue import Spec
from envbench.directions import Array
from envbench.method import Method
from envbench.reference import Reference
from envbench.scene import Effect, Scene

GRACE: Spec = {"kind": "file", "path": "environments/grace.exr"}
"""Grace Cathedral, which RH 2002 renders under: of the data folder."""


def scene(
    light: str | Spec, material: str | Spec, geometry: str, view: Spec, effects: Sequence[Effect] | None = None
) -> Scene:
    """Return the scene of presets' names and of tables; raises `NeedsData` where a file of it is absent."""
    return CATALOGUE.scene(
        name="study", light=_table(light, CATALOGUE.lights), material=_table(material, CATALOGUE.materials),
        geometry=CATALOGUE.geometries[geometry], view=view, effects=effects,
    )  # fmt: skip


def rendered(method: Method, shown: Scene) -> Array:
    """Return what a method answers at all points of a scene, (n, 3)."""
    prepared = method.prepare(shown.material, shown.geometry.rest)
    framed = method.frame(method.relight(prepared, shown.environment), shown.viewer)
    values: Any = method.shade(framed, shown.points)
    return np.asarray(values, float)


def error(values: Array, truth: Reference, chosen: NDArray[np.bool_] | None = None) -> float:
    """Return the NRMSE of values (n, 3), the reference's noise taken off (`envbench.metrics`), at all or some points.

    Both means go over the chosen points alone.
    """
    noise = truth.standard_error**2
    square = ((values - truth.mean) ** 2 - noise).mean(-1)
    power = (truth.mean**2 - noise).mean(-1)
    weight = truth.weight if chosen is None else truth.weight * chosen
    return float(np.sqrt(max(square @ weight, 0.0) / (power @ weight)))


def apart(a: Array, b: Array) -> float:
    """Return the RMS difference of two results (n, 3) over the RMS of the second, at points of equal weight."""
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))


def _table(given: str | Spec, presets: Mapping[str, Spec]) -> Spec:
    return presets[given] if isinstance(given, str) else given
