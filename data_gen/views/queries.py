"""Queries that are no image: pairs of view and normal drawn on the unit sphere, to average over or to try hard places.

Each kind takes the first `count` points of a scrambled Sobol sequence, of equal weight: less variance than independent
draws. Without a `direction` every point has a view of its own, uniform over the sphere; with one, all are seen by one
distant viewer, as methods need that make something for a view.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from data_gen.views import parameters as p
from data_gen.views.parameters import Vector
from data_gen.views.points import Spots, equal, sphere_uv
from envbench.directions import Array, from_angles, normalised, perpendicular
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Viewer


@dataclass(frozen=True, kw_only=True)
class _Queries(ABC):
    kind: ClassVar[str]

    count: int = 4096
    seed: int = 0
    direction: Vector | None = None

    def __post_init__(self) -> None:
        p.integer("count", self.count, 1, 2**24)
        p.integer("seed", self.seed, 0, 2**63 - 1)
        if self.direction is not None:
            object.__setattr__(self, "direction", p.direction("direction", self.direction))

    def points(self, geometry: Geometry, name: str) -> tuple[Points, Viewer | None]:
        """Draw the queries."""
        from scipy.stats import qmc

        if geometry.mesh is not None:
            raise BadInput(
                f"view '{name}': {self.kind} queries need the sphere; give '{geometry.name}' an image or its vertices"
                " instead."
            )
        exponent = (self.count - 1).bit_length()
        dimensions = 4 if self.direction is None else 2
        u = qmc.Sobol(dimensions, scramble=True, rng=self.seed).random_base2(exponent)[: self.count]
        if self.direction is None:
            view, viewer = from_angles(np.arccos(1 - 2 * u[:, 2]), 2 * np.pi * u[:, 3]), None
        else:
            view, viewer = np.tile(self.direction, (self.count, 1)), Viewer(direction=self.direction)
        normal = self._normal(u[:, 0], 2 * np.pi * u[:, 1], view)
        spot = Spots(normal, normal, normal, perpendicular(normal), uv=sphere_uv(normal))
        return Points(**spot.of(), view=view, weight=equal(self.count)), viewer

    @abstractmethod
    def _normal(self, u: Array, azimuth: Array, view: Array) -> Array:
        """Map a uniform number (n,) and an azimuth (n,) to the normals seen from `view` (n, 3)."""


@dataclass(frozen=True, kw_only=True)
class Uniform(_Queries):
    """R uniform over the sphere, independent of V: what captured energy averages over (RH 2002, sec. 5)."""

    kind = "uniform"

    def _normal(self, u: Array, azimuth: Array, view: Array) -> Array:
        return normalised(from_angles(np.arccos(1 - 2 * u), azimuth) + view)


@dataclass(frozen=True, kw_only=True)
class Cap(_Queries):
    """R uniform over the cap within `angle` degrees of a direction `reflection`: a pole, the seam, -V."""

    kind = "cap"

    reflection: Vector = (0.0, 0.0, 1.0)
    angle: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "reflection", p.direction("reflection", self.reflection))
        p.degrees("angle", self.angle, 1e-4, 180)

    def _normal(self, u: Array, azimuth: Array, view: Array) -> Array:
        # the chord's half, sin(theta / 2), is sqrt(u) of its largest: exact for small caps, where cos(theta) is not
        polar = 2 * np.arcsin(np.sqrt(u) * np.sin(np.radians(self.angle) / 2))
        return normalised(_about(np.asarray(self.reflection), polar, azimuth) + view)


@dataclass(frozen=True, kw_only=True)
class Grazing(_Queries):
    """N at an angle of `degrees` to V, at uniform azimuths about it: towards 90, R comes to -V."""

    kind = "grazing"

    degrees: float = 89.99

    def __post_init__(self) -> None:
        super().__post_init__()
        p.degrees("degrees", self.degrees, 0, 89.9999)

    def _normal(self, u: Array, azimuth: Array, view: Array) -> Array:
        return _about(view, np.full(len(u), np.radians(self.degrees)), azimuth)


def _about(axis: Array, polar: Array, azimuth: Array) -> Array:
    """Return the directions (n, 3) at polar angles and azimuths (n,) about `axis`, (3,) or (n, 3)."""
    x = perpendicular(axis)
    local = from_angles(polar, azimuth)
    return normalised(local[:, :1] * x + local[:, 1:2] * np.cross(axis, x) + local[:, 2:] * axis)
