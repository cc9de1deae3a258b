"""What ground truth is: a mean, its standard error, and the replicates both come from (CONVENTIONS.md, Error)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.errors import BadInput


@dataclass(frozen=True)
class ReferenceSettings:
    """How ground truth is made.

    Attributes
    ----------
    floor : float
        Target of the noise floor, relative to the RMS radiance.
    budget : float
        Seconds after which sampling stops, whatever the floor reached.
    replicates : int
        Independently seeded estimates, K >= 8.
    seed : int
    variant : str
        Mitsuba variant.
    bounces : int
        How often light may come by way of the shape itself, in a scene that calls for inter-reflection.
    """

    floor: float = 1e-3
    budget: float = 60.0
    replicates: int = 8
    seed: int = 0
    variant: str = "llvm_ad_rgb"
    bounces: int = 3

    def __post_init__(self) -> None:
        if not 1e-6 <= self.floor <= 1:
            raise BadInput(f"reference floor must lie in [1e-6, 1]. Got {self.floor} instead.")
        if not self.budget > 0:
            raise BadInput(f"reference budget must be > 0 seconds. Got {self.budget} instead.")
        if self.replicates < 8:
            raise BadInput(f"reference replicates must be >= 8. Got {self.replicates} instead.")
        if not 1 <= self.bounces <= 64:
            raise BadInput(f"reference bounces must lie in [1, 64]. Got {self.bounces} instead.")


@dataclass(frozen=True, eq=False)
class Reference:
    """Ground truth at the points of a scene.

    Attributes
    ----------
    replicates : (K, n, 3) float64
        Independent unbiased estimates of the reflected radiance.
    weight : (n,)
        The points' quadrature weights.
    samples : int
        Samples a point in one replicate; their mean where points differ.
    seconds : float
        What computing it took (also when it came from the cache).
    key : str
        Content address: all that can change the result.
    from_cache : bool
    visibility_rays : int
        Rays cast to test visibility; zero for convex shapes.
    notes : tuple of str
    provenance : dict
    """

    replicates: NDArray[np.float64]
    weight: NDArray[np.float64]
    samples: int
    seconds: float
    key: str
    target: float
    from_cache: bool = False
    visibility_rays: int = 0
    notes: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean over the replicates, (n, 3)."""
        return self.replicates.mean(0)

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """s / sqrt(K) at each point and channel, (n, 3)."""
        return self.replicates.std(0, ddof=1) / np.sqrt(len(self.replicates))

    @property
    def rms(self) -> float:
        """RMS radiance over points (by weight) and channels; its own noise taken out."""
        power = (self.mean**2 - self.standard_error**2).mean(-1)
        return float(np.sqrt(max(np.average(power, weights=self.weight), 0.0)))

    @property
    def floor(self) -> float:
        """Noise floor reached: RMS standard error over RMS radiance (absolute where the radiance is zero)."""
        noise = float(np.sqrt(np.average((self.standard_error**2).mean(-1), weights=self.weight)))
        return noise / self.rms if self.rms > 0 else noise


AGREEMENT_MARGIN = 3e-4
"""Largest difference of two references' means, relative to the mean radiance, that passes."""


@dataclass(frozen=True)
class Agreement:
    """How two independent references, Mitsuba's and a quadrature, compare on one scene.

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
        """Whether the difference of the means lies within its interval and within `AGREEMENT_MARGIN`."""
        return abs(self.difference) <= min(self.half_width, AGREEMENT_MARGIN)
