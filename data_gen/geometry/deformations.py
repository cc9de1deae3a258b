"""Deformations of space in closed form, in the mesh's own extent: each gives posed places and the gradient F there.

Below, c is the centre of the rest mesh's bounding box, `axis` a the long way of the deformation, L the box's length
along it, and s in [-L / 2, L / 2] the place along it from c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from data_gen.geometry import parameters as p
from envbench.directions import Array, normalised
from envbench.errors import BadInput


@dataclass(frozen=True)
class Box:
    """The bounding box of a mesh at rest: `centre` (3,) and `size` (3,)."""

    centre: Array
    size: Array

    @classmethod
    def of(cls, vertices: Array) -> Box:
        low, high = vertices.min(0), vertices.max(0)
        return cls((low + high) / 2, high - low)

    def length(self, axis: int) -> float:
        """Return the extent along an axis, which must not be zero."""
        if self.size[axis] <= 0:
            raise BadInput(f"the mesh has no extent along {'xyz'[axis]}; choose another axis.")
        return float(self.size[axis])


class Deformation(Protocol):
    """A kind of deformation: a dataclass of its settings."""

    kind: ClassVar[str]

    def at(self, x: Array, box: Box) -> tuple[Array, Array]:
        """Return the posed places (n, 3) of rest places x (n, 3), and the gradients (n, 3, 3) there."""
        ...


@dataclass(frozen=True, kw_only=True)
class Turn:
    """A rigid rotation by `degrees` about a direction `axis` through c: what any method must be exact under."""

    kind: ClassVar[str] = "turn"

    degrees: float
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        p.number("degrees", self.degrees, -3600, 3600)
        if not p.array("axis", self.axis, (3,)).any():
            raise BadInput("axis must not be zero.")

    def at(self, x: Array, box: Box) -> tuple[Array, Array]:
        from scipy.spatial.transform import Rotation

        rotation = Rotation.from_rotvec(np.radians(self.degrees) * normalised(self.axis)).as_matrix()
        return box.centre + (x - box.centre) @ rotation.T, np.broadcast_to(rotation, (len(x), 3, 3))


@dataclass(frozen=True, kw_only=True)
class Bend:
    """The axis becomes an arc of `degrees` and length L whose middle stays, its ends curving to `towards`.

    With k = radians / L, q = s k and t the place from c along `towards`: (s, t) goes to (sin q / k - t sin q,
    (1 - cos q) / k + t cos q), so F is the turn by q of a stretch of 1 - k t along the axis (Barr 1984, sec. 4).
    """

    kind: ClassVar[str] = "bend"

    degrees: float
    axis: str = "z"
    towards: str = "x"

    def __post_init__(self) -> None:
        p.number("degrees", self.degrees, -720, 720)
        p.axis("axis", self.axis)
        p.other_axis("towards", self.towards, self.axis)

    def at(self, x: Array, box: Box) -> tuple[Array, Array]:
        a, w = p.AXES[self.axis], p.AXES[self.towards]
        curvature = np.radians(self.degrees) / box.length(a)
        offset = x - box.centre
        s, t = offset[:, a], offset[:, w]
        q = s * curvature
        sine, cosine = np.sin(q), np.cos(q)
        posed = offset.copy()
        # sin q / k = s sinc(q), (1 - cos q) / k = s sin(q / 2) sinc(q / 2): a bend by nothing too
        posed[:, a] = s * np.sinc(q / np.pi) - t * sine
        posed[:, w] = s * np.sin(q / 2) * np.sinc(q / (2 * np.pi)) + t * cosine
        F = np.tile(np.eye(3), (len(x), 1, 1))
        stretch = 1 - curvature * t
        F[:, a, a], F[:, a, w] = cosine * stretch, -sine
        F[:, w, a], F[:, w, w] = sine * stretch, cosine
        return box.centre + posed, F


@dataclass(frozen=True, kw_only=True)
class Twist:
    """Sections across the axis turn about it, through c: by `degrees` in all from end to end, the middle stays."""

    kind: ClassVar[str] = "twist"

    degrees: float
    axis: str = "z"

    def __post_init__(self) -> None:
        p.number("degrees", self.degrees, -3600, 3600)
        p.axis("axis", self.axis)

    def at(self, x: Array, box: Box) -> tuple[Array, Array]:
        a = p.AXES[self.axis]
        i, j = (a + 1) % 3, (a + 2) % 3  # turning i towards j is positive about a
        rate = np.radians(self.degrees) / box.length(a)
        offset = x - box.centre
        sine, cosine = np.sin(rate * offset[:, a]), np.cos(rate * offset[:, a])
        posed = offset.copy()
        posed[:, i] = cosine * offset[:, i] - sine * offset[:, j]
        posed[:, j] = sine * offset[:, i] + cosine * offset[:, j]
        F = np.tile(np.eye(3), (len(x), 1, 1))
        F[:, i, i], F[:, i, j], F[:, i, a] = cosine, -sine, -rate * posed[:, j]
        F[:, j, i], F[:, j, j], F[:, j, a] = sine, cosine, rate * posed[:, i]
        return box.centre + posed, F


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Longer by `factor` along the axis and by `across` at right angles to it, which by default keeps the volume."""

    kind: ClassVar[str] = "stretch"

    factor: float
    axis: str = "z"
    across: float | None = None

    def __post_init__(self) -> None:
        p.number("factor", self.factor, 1e-3, 1e3)
        p.axis("axis", self.axis)
        if self.across is not None:
            p.number("across", self.across, 1e-3, 1e3)

    def at(self, x: Array, box: Box) -> tuple[Array, Array]:
        factors = np.full(3, self.factor**-0.5 if self.across is None else self.across)
        factors[p.AXES[self.axis]] = self.factor
        return box.centre + factors * (x - box.centre), np.broadcast_to(np.diag(factors), (len(x), 3, 3))


@dataclass(frozen=True, kw_only=True)
class Wave:
    """Moved along `towards` by amplitude L sin(2 pi (cycles s / L + phase)): `cycles` waves from end to end."""

    kind: ClassVar[str] = "wave"

    amplitude: float
    cycles: float = 1.0
    phase: float = 0.0
    axis: str = "x"
    towards: str = "z"

    def __post_init__(self) -> None:
        p.number("amplitude", self.amplitude, -10, 10)
        p.number("cycles", self.cycles, 0, 1000)
        p.number("phase", self.phase, -1000, 1000)
        p.axis("axis", self.axis)
        p.other_axis("towards", self.towards, self.axis)

    def at(self, x: Array, box: Box) -> tuple[Array, Array]:
        a, w = p.AXES[self.axis], p.AXES[self.towards]
        length = box.length(a)
        angle = 2 * np.pi * (self.cycles * (x[:, a] - box.centre[a]) / length + self.phase)
        posed = x.copy()
        posed[:, w] += self.amplitude * length * np.sin(angle)
        F = np.tile(np.eye(3), (len(x), 1, 1))
        F[:, w, a] = self.amplitude * 2 * np.pi * self.cycles * np.cos(angle)
        return posed, F
