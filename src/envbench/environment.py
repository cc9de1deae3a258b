"""Distant light: radiance over directions, as a lat-long map with one meaning."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from envbench import latlong
from envbench.directions import Array
from envbench.errors import BadInput


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance of distant light.

    Attributes
    ----------
    name : str
    radiance : (H, W, 3) float32
        Linear radiance in the capture's own unit, finite, samples at pixel centres (`envbench.latlong`);
        H >= 2, W >= 4.
    notes : tuple of str
        What a user should know of how it was read, a line each (clamped negative values, odd aspect ...).
    signed : bool
        Whether radiance may be negative, as that of a light projected to a few harmonics is; else it must not.
    """

    name: str
    radiance: NDArray[np.float32]
    notes: tuple[str, ...] = field(default=())
    signed: bool = False

    def __post_init__(self) -> None:
        shape = self.radiance.shape
        if len(shape) != 3 or shape[2] != 3 or shape[0] < 2 or shape[1] < 4:
            raise BadInput(f"environment '{self.name}' has shape {shape}; (H, W, 3) with W >= 4 and H >= 2 is needed.")
        if not np.isfinite(self.radiance).all():
            raise BadInput(f"environment '{self.name}' holds NaN or infinite radiance; mend the map first.")
        if not self.signed and self.radiance.min() < 0:
            raise BadInput(f"environment '{self.name}' holds negative radiance; clamp it when reading.")

    def __call__(self, directions: ArrayLike) -> Array:
        """Return the radiance (..., 3) from `directions` (..., 3)."""
        return latlong.interpolate(self.radiance, directions)

    @cached_property
    def mean(self) -> Array:
        """Solid-angle mean of the samples, (3,)."""
        weight = latlong.solid_angles(*self.radiance.shape[:2])[..., None]
        return (self.radiance.astype(np.float64) * weight).sum((0, 1)) / (4 * np.pi)

    @cached_property
    def parts(self) -> tuple[tuple[float, Environment], ...]:
        """The positive and the negative part, each with its sign; one that is black is left out.

        Their difference is the light everywhere, for between samples it is linear in them.
        """
        if self.radiance.min() >= 0:
            return ((1.0, self),) if self.radiance.any() else ()
        split = [(sign, np.maximum(np.float32(sign) * self.radiance, 0)) for sign in (1.0, -1.0)]
        return tuple((sign, Environment(self.name, part)) for sign, part in split if part.any())

    @cached_property
    def key(self) -> str:
        """Content address: equal for equal radiance, whatever the name."""
        return hashlib.sha256(repr(self.radiance.shape).encode() + self.radiance.tobytes()).hexdigest()
