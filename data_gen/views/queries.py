"""Queries that are no image: pairs of view and normal drawn on the unit sphere, to average over or to try hard places.

Each kind takes the first `count` points of a scrambled Sobol sequence, of equal weight: less variance than independent
draws. Without a `direction` every point has a view of its own, uniform over the sphere; with one, all are seen by one
distant viewer, as methods need that make something for a view.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

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
        u = qmc.Sobol(5, scramble=True, rng=self.seed).random_base2(exponent)[: self.count]
        azimuth, weight = 2 * np.pi * u[:, 1], equal(self.count)
        if self.direction is not None:
            view = np.tile(self.direction, (self.count, 1))
            normal = self._normal(u[:, 0], azimuth, view)
        else:
            normal, view, weight = self._free(u[:, 0], azimuth, u[:, 2], 2 * np.pi * u[:, 3])
        spot = Spots(normal, normal, normal, self._tangent(normal, 2 * np.pi * u[:, 4]), uv=sphere_uv(normal))
        viewer = None if self.direction is None else Viewer(direction=self.direction)
        return Points(**spot.of(), view=view, weight=weight), viewer

    def _free(self, u: Array, azimuth: Array, v: Array, around: Array) -> tuple[Array, Array, Array]:
        """Map four numbers to normals, views of their own (here uniform, from `v` and `around`) and weights."""
        view = from_angles(np.arccos(1 - 2 * v), around)
        return self._normal(u, azimuth, view), view, equal(self.count)

    def _tangent(self, normal: Array, azimuth: Array) -> Array:
        """Return tangents; hard places keep one that is exact in single precision, whatever the azimuth."""
        return perpendicular(normal)

    @abstractmethod
    def _normal(self, u: Array, azimuth: Array, view: Array) -> Array:
        """Map a uniform number (n,) and an azimuth (n,) to the normals seen from `view` (n, 3)."""


@dataclass(frozen=True, kw_only=True)
class Uniform(_Queries):
    """R uniform over the sphere, independent of V, and T about N: what captured energy averages over (RH 2002, sec. 5).

    Attributes
    ----------
    grazing : float
        Share of the points, in [0, 1), that ask about views near grazing more often, at less weight: there clipped
        lobes and Fresnel peaks err most, and few of independent views would show it. Uniform R and V have the density
        2 c of c = N.V; this share has c itself uniform.
    """

    kind = "uniform"

    grazing: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        given: Any = self.grazing  # it comes from TOML
        if not isinstance(given, int | float) or not 0 <= given < 1:
            raise BadInput(f"grazing must be a share in [0, 1). Got {self.grazing!r} instead.")
        if self.grazing and self.direction is not None:
            raise BadInput("grazing is for queries with a view of their own each; leave it out, or the direction.")

    def _free(self, u: Array, azimuth: Array, v: Array, around: Array) -> tuple[Array, Array, Array]:
        g = self.grazing  # the density is 2 (1 - g) c + g, its integral (1 - g) c^2 + g c
        cosine = np.maximum((np.sqrt(g * g + 4 * (1 - g) * v) - g) / (2 * (1 - g)), 1e-9)
        reflection = from_angles(np.arccos(1 - 2 * u), azimuth)
        view = _about(reflection, 2 * np.arccos(cosine), around)
        # N is half way, and N = cos(theta_o / 2) R + sin(theta_o / 2) X where V = cos(theta_o) R + sin(theta_o) X
        normal = _about(reflection, np.arccos(cosine), around)
        weight = 2 * cosine / (2 * (1 - g) * cosine + g)
        return normal, view, weight / weight.sum()

    def _tangent(self, normal: Array, azimuth: Array) -> Array:
        return _about(normal, np.full(len(normal), np.pi / 2), azimuth)

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
