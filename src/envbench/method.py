"""The contract of a method: four steps, because users pay for them at different times.

===========  ============================  =========================================================
step         runs once per                 returns
===========  ============================  =========================================================
``prepare``  asset (material, rest shape)  what does not depend on light, e.g. BRDF coefficients
``relight``  change of light               what does not depend on the viewer, e.g. reflection maps
``frame``    view or pose                  what does not depend on the point, e.g. one blended map
``shade``    points of a frame             reflected radiance at the points
===========  ============================  =========================================================

The laws, which ``envbench.laws`` checks for every method:

* deterministic: the same input twice gives the same bits;
* linear: radiance scaled by a scales the result by a; the sum of two lights gives the sum of the results;
* zero light gives zero;
* constant light gives what the lobes integrate to;
* turning light, points and view together changes nothing;
* every state can be pickled, and no later step changes an earlier state.

A method's representation may break the inexact ones a little (a map is not rotation-invariant); it states by how much
in `Method.tolerance`, and is held to that.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from envbench.environment import Environment
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Material
from envbench.scene import FREE, Effect, Scene


@dataclass(frozen=True)
class Tolerance:
    """How closely a method keeps the inexact laws: relative to the RMS of the result, with the reason in its docs."""

    linearity: float = 1e-5
    constant_light: float = 1e-3
    rotation: float = 1e-3


class Method(ABC):
    """A way of rendering under an environment map. Subclasses are frozen dataclasses whose fields are the settings.

    Settings are checked in ``__post_init__`` (`envbench.errors.BadInput`, naming the value and what would be right).
    Every step evaluates all that it returns before it does (no Dr.Jit graph left to be paid for later).
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    """One line: what it stores and how it looks that up."""
    source: ClassVar[str]
    """The paper, and the equation or section."""
    simulates: ClassVar[frozenset[Effect]] = FREE
    maps_transparency: ClassVar[bool] = False
    """Whether it looks up a material's map of transparency, where there is one."""

    def refusal(self, scene: Scene) -> str | None:
        """Return why `scene` is not this method's: what it `declines`, and maps that it does not look up; or None."""
        if scene.material.transparency is not None and not self.maps_transparency:
            return "holds one transparency, and this material has a map of them"
        return self.declines(scene)

    def declines(self, scene: Scene) -> str | None:
        """Return why this method cannot render `scene` at all, or None.

        What a step alone finds out (maps that would not fit into memory) it raises as `BadInput`: declined too.
        """
        return None

    def called_for(self, scene: Scene) -> Self:
        """Return this method set to simulate what `scene` calls for and no more, where a setting leaves that open.

        It is asked before `prepare`; what it changed stands in the row's description.
        """
        return self

    def lacks(self, scene: Scene) -> frozenset[Effect]:
        """Return the effects of `scene` that this method, as it is set, does not account for."""
        return scene.effects - self.simulates

    @abstractmethod
    def prepare(self, material: Material, geometry: Geometry) -> Any:
        """Return what depends on the asset alone; `geometry` is in its rest pose."""

    @abstractmethod
    def relight(self, prepared: Any, environment: Environment) -> Any:
        """Return what depends on asset and light."""

    def frame(self, relit: Any, viewer: Viewer | None) -> Any:
        """Return what depends on asset, light and viewer."""
        return relit

    @abstractmethod
    def shade(self, framed: Any, points: Points) -> NDArray[np.floating]:
        """Return the reflected radiance (n, 3), float32 or float64, at the points (`Points.modulation` apart)."""

    def predictions(self, prepared: Any, environment: Environment) -> Mapping[str, float]:
        """Return the energy error (squared NRMSE over uniform (R, V)) that each theory predicts, by its name."""
        return {}

    def describe(self, prepared: Any) -> dict[str, Any]:
        """Return what was chosen for this asset, for the report (orders, resolutions ...)."""
        return {}

    def tolerance(self, prepared: Any) -> Tolerance:
        """Return how closely the inexact laws are kept for this asset."""
        return Tolerance()

    @classmethod
    def sweep(cls) -> Sequence[Self]:
        """Return instances from cheap to costly that trace the method's frontier of accuracy against time."""
        return [cls()]


def footprint(state: Any) -> int:
    """Return the bytes of all arrays that `state` holds, each counted once: what must be kept to shade."""
    seen: dict[int, int] = {}

    def visit(item: Any) -> None:
        if isinstance(item, np.ndarray):
            base: Any = item
            while isinstance(base.base, np.ndarray):
                base = base.base
            seen[id(base)] = base.nbytes
        elif isinstance(item, dict):
            for value in item.values():
                visit(value)
        elif isinstance(item, list | tuple | set | frozenset):
            for value in item:
                visit(value)
        elif is_dataclass(item) and not isinstance(item, type):
            for entry in fields(item):
                visit(getattr(item, entry.name))

    visit(state)
    return sum(seen.values())
