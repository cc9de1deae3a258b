"""Plain Monte Carlo: "just render it", Mitsuba stopped at a number of samples a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log2, sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Material
from envbench.method import Method, Tolerance
from envbench.scene import FREE, Effect, Scene

MOST = 4**8
STREAM = (0x4D43, 1)
"""Spawn key of the seeds. A reference's have one element, so that no seeds of the two give the same samples."""


@dataclass(frozen=True)
class MonteCarlo(Method):
    """Estimate each point anew from a low-discrepancy set of light and lobe samples (balance heuristic).

    Nothing is stored but Mitsuba's scene, and nothing is wrong but noise: `scores` of this method are those of one
    realisation. The samples are those of the reference's own estimator, from seeds of their own.

    Attributes
    ----------
    samples : int
        Of the light and of the lobes, each, at a point; a power of four.
    seed : int
    """

    name = "monte-carlo"
    summary = "stores nothing; light and lobes are sampled at each point by Mitsuba, a fixed number of times"
    source = "Veach 1997, sec. 9.2 (multiple importance sampling); Mitsuba 3"
    simulates = FREE | {Effect.SELF_SHADOWING}
    maps_transparency = True

    samples: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        if not 16 <= self.samples <= MOST or 2 ** (2 * round(log2(self.samples) / 2)) != self.samples:
            raise BadInput(f"samples must be a power of four in [16, {MOST}]. Got {self.samples} instead.")
        if not 0 <= self.seed < 2**64:
            raise BadInput(f"seed must lie in [0, 2^64). Got {self.seed} instead.")

    def declines(self, scene: Scene) -> str | None:
        if scene.geometry.pose is not None:
            return "its rays meet the shape at rest: it is prepared before there is a pose"
        if not scene.geometry.convex and Effect.SELF_SHADOWING not in scene.effects:
            return "it always simulates the shadows that this scene leaves out"
        if scene.material.transparency is not None and scene.points.uv is None:
            return "its map of transparency needs points with uv"
        return None

    def prepare(self, material: Material, geometry: Geometry) -> Surface:
        """Make Mitsuba's BSDF, and the shape's ray-tracing structure where it can shadow itself."""
        surface = Surface.of(material, geometry)
        _ = surface.bsdf, surface.shape
        return surface

    def relight(self, prepared: Surface, environment: Environment) -> Estimator | None:
        """Make Mitsuba's emitter with its sampling tables; None for a black light, of which nothing can be drawn."""
        if not environment.radiance.any():
            return None
        estimator = Estimator(prepared, environment)
        _ = estimator.scene
        return estimator

    def shade(self, framed: Estimator | None, points: Points) -> NDArray[np.floating]:
        """Sample. The first call compiles the kernel."""
        if framed is None:
            return np.zeros((len(points), 3))
        return framed.replicate(points, self.samples, np.random.SeedSequence(self.seed, spawn_key=STREAM))

    def describe(self, prepared: Surface) -> dict[str, Any]:
        return {"visibility rays a sample": 0 if prepared.occluder is None else 2}

    def tolerance(self, prepared: Surface) -> Tolerance:
        """Allow for noise: its order, and a bound on what one sample can weigh.

        With the balance heuristic a sample weighs at most min(rho_hat A, L a), A and a what light and lobe integrate
        to: at most L_max a, some three times what points reflect under the lamps of `envbench.laws`, and a under
        constant light. N stratified samples of a function of range r, smooth but for an edge that crosses 2 sqrt(N)
        strata, err by r sqrt(2) / 2 N^(-3/4). Two such errors make a turn, three a sum of lights.
        """
        noise = 3 * sqrt(0.5) * self.samples**-0.75
        return Tolerance(linearity=sqrt(3) * noise, constant_light=noise / 2, rotation=sqrt(2) * noise)

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        return [cls(samples=4**k) for k in range(2, 6)]
