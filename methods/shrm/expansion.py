"""What every form of SHRM shares: its orders, chosen from eps, and what theory predicts of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.harmonics import Coefficients, analyse, truncate
from envbench.material import Centre, Lobe, Material
from envbench.method import Method
from envbench.scene import Scene
from methods.shrm import predictions
from methods.shrm.coefficients import MAX_F, MAX_P, LobeCoefficients, expand, together


@dataclass(frozen=True)
class Expanded:
    """A material in the frequency domain: `parts`, one for each of its lobes; `sums` are what is stored."""

    material: Material
    parts: tuple[LobeCoefficients, ...]
    sums: tuple[LobeCoefficients, ...]

    @property
    def order(self) -> int:
        """The highest F."""
        return max(c.F for c in self.sums)

    @cached_property
    def followed(self) -> tuple[predictions.Followed, ...]:
        """The lobes beyond their orders, for predictions under any light."""
        return predictions.follow(self.material, self.parts)

    def stored(self, part: LobeCoefficients) -> int:
        """Return which of `sums` a part is in: it stands there itself, or as all of its centre."""
        alone = [i for i, c in enumerate(self.sums) if c is part]
        return (alone or [i for i, c in enumerate(self.sums) if c.centre is part.centre])[0]

    def light(self, radiance: NDArray[np.floating]) -> tuple[Coefficients, ...]:
        """Return L_lm of a lat-long map (H, W, 3) to the order of each of `sums`, in the map's precision."""
        light = analyse(radiance, self.order, max(c.significant for c in self.sums))
        return tuple(truncate(light, self.order, c.F) for c in self.sums)


@dataclass(frozen=True)
class Expansion(Method):
    """A method that stores some form of the coefficients of light and lobes.

    Parameters
    ----------
    eps : float
        Energy of the BRDF that may be left out; F and P are the least orders that keep the rest.
    order, view_order : int or None
        F and P, if they are to be given instead.
    precision : {"float64", "float32"}
    """

    eps: float = 0.01
    order: int | None = None
    view_order: int | None = None
    precision: str = "float64"

    def __post_init__(self) -> None:
        if not 0 < self.eps < 1:
            raise BadInput(f"eps must lie in (0, 1). Got {self.eps} instead.")
        for name, value, most in (("order", self.order, MAX_F), ("view_order", self.view_order, MAX_P)):
            if value is not None and not 0 <= value <= most:
                raise BadInput(f"{name} must lie in [0, {most}]. Got {value} instead.")
        if self.precision not in ("float64", "float32"):
            raise BadInput(f"precision must be 'float64' or 'float32'. Got '{self.precision}' instead.")

    def declines(self, scene: Scene) -> str | None:
        if any(lobe.centre is Centre.TANGENT and lobe.clipped for lobe in scene.material.lobes):
            return "a lobe about the tangent, clipped at the horizon, is no function of the angles to the tangent"
        return None

    def expand(self, material: Material) -> Expanded:
        """Return the coefficients of every lobe, to the orders asked for; lobes about one centre are summed."""
        parts = tuple(expand(lobe, self.eps, self.order, self.view_order) for lobe in material.lobes)
        about = ([c for c in parts if c.centre is centre] for centre in dict.fromkeys(c.centre for c in parts))
        return Expanded(material, parts, tuple(s for lobes in about for s in self.summed(lobes)))

    def summed(self, lobes: Sequence[LobeCoefficients]) -> Sequence[LobeCoefficients]:
        """Return what is stored of lobes about one centre: here their sum."""
        return [together(lobes)]

    @abstractmethod
    def expansion(self, prepared: Any) -> Expanded:
        """Return the material's expansion that a prepared state holds."""

    def lookup(self, prepared: Any, stored: int) -> predictions.Lookup:
        """Return what share of degree l's energy reading one of the sums loses, as a function of l; here none."""
        return np.zeros_like

    def predictions(self, prepared: Any, environment: Environment) -> dict[str, float]:
        """The four theories of `methods.shrm.predictions`."""
        held = self.expansion(prepared)
        lookups = [self.lookup(prepared, held.stored(part)) for part in held.parts]
        return predictions.predict(held.followed, environment, lookups)

    def describe(self, prepared: Any) -> dict[str, Any]:
        held = self.expansion(prepared)
        told: dict[str, Any] = {
            "F": [c.F for c in held.sums],
            "P": [c.P for c in held.sums],
            "q": [c.Q for c in held.sums],
            "lobes": [reason(lobe, part) for lobe, part in zip(held.material.lobes, held.parts, strict=True)],
            "missing energy": [c.missing for c in held.sums],
        }
        worst = max(c.missing for c in held.parts)
        if self.order is None and self.view_order is None and worst > self.eps:
            told["short of eps"] = f"up to F = {MAX_F}, P = {MAX_P} a lobe still lacks {worst:.3g} of its energy"
        return told


def reason(lobe: Lobe, part: LobeCoefficients) -> str:
    """Say to what orders a lobe was expanded, and what symmetry spared."""
    orders = f"about {lobe.centre}: F = {part.F}, P = {part.P}, q <= {part.Q}"
    if part.radial:
        return f"{orders}, radially symmetric"
    return f"{orders}, no dependence on azimuth" if lobe.azimuthally_symmetric else orders


def constant_light(expanded: Expanded) -> float:
    """Return how far an integral may be off: three times the RMS of what P leaves out of l = 0, over uniform (R, V).

    A narrow clipped lobe errs in few views, by half of its integral, and a few queries may happen to meet more of them;
    but at most the half that a law can still hold to.
    """
    missing = max(c.missing_constant for c in expanded.parts)
    return min(3 * float(np.sqrt(missing)) + 1e-3, 0.5)
