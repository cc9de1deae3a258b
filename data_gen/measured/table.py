"""A BRDF as numbers on a grid over half-angle coordinates, read back by linear interpolation."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.arrays import dot, namespace
from envbench.directions import Array, from_angles

_TINY = 1e-30


@dataclass(frozen=True, eq=False)
class Packed:
    """Rows of numbers that NumPy and Dr.Jit read alike; Dr.Jit's copies are made once a type and never pickled.

    Attributes
    ----------
    values : (n,) or (n, 4) float32
    """

    values: NDArray[np.float32]
    _uploaded: dict[type, Any] = field(default_factory=dict[type, Any], repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return {"values": self.values, "_uploaded": {}}

    def at(self, index: Any) -> Any:
        """Return the numbers, or four arrays of the rows' entries, at a float array of whole numbers."""
        dr = sys.modules.get("drjit")
        if dr is None or not dr.is_array_v(index):
            rows = self.values[np.asarray(index).astype(np.intp)]
            return rows if self.values.ndim == 1 else np.moveaxis(rows, -1, 0)
        kind = type(index)
        if kind not in self._uploaded:
            self._uploaded[kind] = kind(self.values.ravel())
        target = kind
        if self.values.ndim == 2:  # four floats are one gather
            target = getattr(sys.modules[kind.__module__], kind.__name__.replace("Float", "Array4f"))
        return dr.gather(target, self._uploaded[kind], dr.uint32_array_t(kind)(index))


@dataclass(frozen=True, eq=False)
class Table:
    """f in 1/sr at the nodes of a grid over (t, d, p) in [0, 1]^3; equal where the numbers are.

    With theta_h the angle of N and H, theta_d that of L and H, and phi_d the azimuth of L about H, from N's far side
    (Rusinkiewicz 1998), and a(y, x) = y / (x + y), which grows with atan2(y, x) but needs no trigonometry:

        t = sqrt(a(sin theta_h, cos theta_h)),   d = 1 - sqrt(a(cos theta_d, sin theta_d)),
        p = (1 - cos phi_d / (|cos phi_d| + |sin phi_d|)) / 2.

    The square roots gather nodes at the peak, as MERL's does (Matusik 2003), and at grazing. phi_d and -phi_d are one:
    the material is its own mirror image, as isotropic paint and cloth are. L and V may be exchanged (phi_d + pi) only
    if the numbers say so.

    Attributes
    ----------
    values : (n_t, n_d, n_p, 4) float32
        r, g, b, and an unused fourth that makes a row one gather.
    negative : float
        Share of cosine-weighted pairs at which the source had a negative channel, clamped to 0 here.
    """

    name: str
    values: NDArray[np.float32]
    negative: float = 0.0

    @cached_property
    def digest(self) -> str:
        """Content address of the numbers."""
        return hashlib.sha256(repr(self.values.shape).encode() + self.values.tobytes()).hexdigest()

    @cached_property
    def _rows(self) -> Packed:
        return Packed(self.values.reshape(-1, 4))

    def __getstate__(self) -> dict[str, Any]:
        return {"name": self.name, "values": self.values, "negative": self.negative}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.values.shape[:3]))
        return f"<table {self.name}, {size}, {self.digest[:16]}>"

    def lookup(self, t: Any, d: Any, p: Any) -> tuple[Any, Any, Any]:
        """Return r, g and b by linear interpolation at coordinates in [0, 1]."""
        xp = namespace(t, d, p)
        sizes = self.values.shape[:3]
        corner, weights = 0.0, []
        for x, n in zip((t, d, p), sizes, strict=True):
            x = x * (n - 1)
            whole = xp.minimum(xp.floor(x), n - 2.0)
            corner = corner * n + whole  # whole numbers below 2^24: exact in single precision
            weights.append(x - whole)
        u, v, w = weights

        def edge(offset: int) -> Any:  # between two neighbours in p, which share a cache line
            low, high = self._rows.at(corner + offset), self._rows.at(corner + (offset + 1))
            return [low[k] + w * (high[k] - low[k]) for k in range(3)]

        def face(offset: int) -> Any:
            low, high = edge(offset), edge(offset + sizes[2])
            return [a + v * (b - a) for a, b in zip(low, high, strict=True)]

        near, far = face(0), face(sizes[1] * sizes[2])
        r, g, b = (a + u * (b - a) for a, b in zip(near, far, strict=True))
        return r, g, b


def coordinates(light: Any, view: Any, normal: Any) -> tuple[Any, Any, Any]:
    """Return (t, d, p) of `Table`, component-first directions above the horizon."""
    xp = namespace(light[0], view[0], normal[0])
    h = tuple(a + b for a, b in zip(light, view, strict=True))  # |h| = 2 cos theta_d
    k = tuple(a - b for a, b in zip(light, view, strict=True))  # |k| = 2 sin theta_d
    along, across = _length(h), _length(k)
    cosine, sine = xp.maximum(dot(normal, h), 0.0), _length(_cross(normal, h))  # both times |h|
    t = xp.sqrt(sine / (sine + cosine + _TINY))
    d = 1 - xp.sqrt(along / (across + along + _TINY))
    # about H, N = (-sin theta_h, 0, cos theta_h) and k = |k| (cos phi_d, sin phi_d, 0)
    c, s = -dot(normal, k) * along, xp.abs(2 * dot(normal, _cross(view, light)))
    p = 0.5 - 0.5 * c / (xp.abs(c) + s + _TINY)
    return t, d, xp.minimum(xp.maximum(p, 0.0), 1.0)


def directions(t: Any, d: Any, p: Any) -> tuple[Array, Array]:
    """Return L and V, (..., 3), about N = z at coordinates in [0, 1]; the inverse of `coordinates`."""
    theta_h = np.arctan2(t**2, 1 - t**2)
    theta_d = np.arctan2(1 - (1 - d) ** 2, (1 - d) ** 2)
    c = 1 - 2 * np.asarray(p)
    phi_d = np.arctan2(1 - np.abs(c), c)
    about_h = from_angles(theta_d, phi_d)
    sine, cosine = np.sin(theta_h), np.cos(theta_h)

    def turned(x: Array, y: Array, z: Array) -> Array:  # Ry(theta_h): H goes from z to its place, azimuth 0
        return np.stack(np.broadcast_arrays(cosine * x + sine * z, y, cosine * z - sine * x), -1)

    x, y, z = np.moveaxis(about_h, -1, 0)
    return turned(x, y, z), turned(-x, -y, z)


def _length(v: Any) -> Any:
    return namespace(v[0]).sqrt(dot(v, v))


def _cross(a: Any, b: Any) -> tuple[Any, Any, Any]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
