"""Surfaces that a patch is laid onto, all of revolution about z: S(u, v) = (r cos p, r sin p, z), u and v in [0, 1].

The angle p grows with u, and a profile curve (r, z) is followed by v, so that (S_u, S_v, n) is right-handed with n to
the outside. With the profile's unit tangent T = (r', z') / w, w = |(r', z')|, its normal is N = (z', -r') / w, and

    dN/dv = T (r' z'' - z' r'') / w^2

since N is T turned by a right angle. The map of a thick patch, S + h n, thus has its gradient in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from data_gen.geometry import parameters as p
from envbench.directions import Array
from envbench.errors import BadInput

Curve = tuple[Array, Array, Array]
"""A profile (r, z), and its first and second derivatives by v, each (2, n)."""

Size = tuple[float, float]
"""Width and height of the flat patch, which some surfaces keep."""

VASE = ((0.30, 0.0), (0.42, 0.25), (0.50, 0.6), (0.40, 1.0), (0.24, 1.3), (0.22, 1.5), (0.32, 1.7))
"""Radius and height of the default vase, from foot to lip."""


class Surface(Protocol):
    """A surface of revolution: a dataclass of its settings."""

    kind: ClassVar[str]

    def arc(self, size: Size) -> tuple[float, float]:
        """Return the angle p at u = 0, and how far it goes in radians, for a patch of a size."""
        ...

    def curve(self, v: Array, size: Size) -> Curve:
        """Return the profile at v (n,)."""
        ...


def thick(surface: Surface, u: Array, v: Array, h: Array, size: Size) -> tuple[Array, Array, Array]:
    """Return S + h n (n, 3), its gradient (n, 3, 3) by (u, v, h), and n (n, 3)."""
    start, arc = surface.arc(size)
    whole = np.isclose(arc, 2 * np.pi, rtol=0, atol=1e-12)
    angle = start + arc * (np.mod(u, 1) if whole else u)  # the seam's two sides are at one place, to the last bit
    (r, z), (r1, z1), (r2, z2) = surface.curve(v, size)
    speed = np.hypot(r1, z1)
    speed = np.where(speed > 0, speed, 1)
    nr, nz = z1 / speed, -r1 / speed
    turn = (r1 * z2 - z1 * r2) / speed**2
    cosine, sine, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    normal = np.stack([nr * cosine, nr * sine, nz], axis=1)
    along_u = arc * (r + h * nr)
    r_v, z_v = r1 + h * turn * r1 / speed, z1 + h * turn * z1 / speed
    radius = r + h * nr
    place = np.stack([radius * cosine, radius * sine, z + h * nz], axis=1)
    by_u = np.stack([-along_u * sine, along_u * cosine, zero], axis=1)
    by_v = np.stack([r_v * cosine, r_v * sine, z_v], axis=1)
    return place, np.stack([by_u, by_v, normal], axis=2), normal


@dataclass(frozen=True, kw_only=True)
class Bent:
    """A sheet of the patch's own size, bent into an arc of `degrees` about z; its middle faces +x."""

    kind: ClassVar[str] = "bent"

    degrees: float = 90.0

    def __post_init__(self) -> None:
        p.number("degrees", self.degrees, 0.01, 360)

    def arc(self, size: Size) -> tuple[float, float]:
        radians = float(np.radians(self.degrees))
        return -radians / 2, radians

    def curve(self, v: Array, size: Size) -> Curve:
        return _straight(v, size[0] / float(np.radians(self.degrees)), size[1])


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A cylinder of `radius` about z, `length` high, open at its ends."""

    kind: ClassVar[str] = "cylinder"

    radius: float = 0.5
    length: float = 1.0

    def __post_init__(self) -> None:
        p.number("radius", self.radius, 1e-6, 1e6)
        p.number("length", self.length, 1e-6, 1e6)

    def arc(self, size: Size) -> tuple[float, float]:
        return 0.0, 2 * np.pi

    def curve(self, v: Array, size: Size) -> Curve:
        return _straight(v, self.radius, self.length)


@dataclass(frozen=True, kw_only=True)
class Vase:
    """A profile turned about z: a cubic spline through points (radius, height), from the foot to the lip.

    Its parameter v is the length of the chords between the points, so that a patch is stretched evenly along it.
    """

    kind: ClassVar[str] = "vase"

    profile: Any = VASE

    def __post_init__(self) -> None:
        points = p.array("profile", self.profile, (None, 2))
        if len(points) < 2 or (points[:, 0] <= 0).any():
            raise BadInput("profile must be at least two pairs of a radius above 0 and a height.")
        if (np.linalg.norm(np.diff(points, axis=0), axis=1) <= 0).any():
            raise BadInput("profile must not repeat a point.")

    def arc(self, size: Size) -> tuple[float, float]:
        return 0.0, 2 * np.pi

    def curve(self, v: Array, size: Size) -> Curve:
        from scipy.interpolate import CubicSpline

        points = np.array(self.profile, float)
        chords = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        spline = CubicSpline(chords / chords[-1], points, bc_type="natural")
        return spline(v).T, spline(v, 1).T, spline(v, 2).T


@dataclass(frozen=True, kw_only=True)
class Torus:
    """A ring of `radius` about z, whose tube has the radius `tube`; v goes round the tube from its outside, upwards."""

    kind: ClassVar[str] = "torus"

    radius: float = 1.0
    tube: float = 0.4

    def __post_init__(self) -> None:
        p.number("radius", self.radius, 1e-6, 1e6)
        p.number("tube", self.tube, 1e-6, 1e6)
        if self.tube >= self.radius:
            raise BadInput(f"tube must be less than radius, {self.radius:g}. Got {self.tube!r} instead.")

    def arc(self, size: Size) -> tuple[float, float]:
        return 0.0, 2 * np.pi

    def curve(self, v: Array, size: Size) -> Curve:
        angle = 2 * np.pi * np.mod(v, 1)
        cosine, sine = self.tube * np.cos(angle), self.tube * np.sin(angle)
        once, twice = 2 * np.pi, (2 * np.pi) ** 2
        first = once * np.stack([-sine, cosine])
        return np.stack([self.radius + cosine, sine]), first, twice * np.stack([-cosine, -sine])


def _straight(v: Array, radius: float, length: float) -> Curve:
    zero = np.zeros_like(v)
    return np.stack([zero + radius, (v - 0.5) * length]), np.stack([zero, zero + length]), np.stack([zero, zero])


SURFACES: dict[str, type[Surface]] = {surface.kind: surface for surface in (Bent, Cylinder, Vase, Torus)}
"""Every surface by its kind."""
