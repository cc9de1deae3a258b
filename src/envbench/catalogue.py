"""What a suite may name: the contract that `benchmarks` fulfils and the engine calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from envbench.effects import EffectSettings
from envbench.geometry import TriangleMesh
from envbench.method import Method
from envbench.records import MaterialSheet, Study
from envbench.reference import Agreement, Reference, ReferenceSettings
from envbench.scene import Scene

Spec = Mapping[str, Any]
"""A thing of a suite as TOML gives it, e.g. ``{"kind": "file", "path": "grace.exr"}``; picklable."""


class Rasteriser(Protocol):
    """Draws meshes off screen, square and in the colours that it is given."""

    def film(
        self,
        meshes: Sequence[TriangleMesh],
        colours: Sequence[NDArray[np.uint8]],
        direction: Sequence[float],
        up: Sequence[float],
        fps: float,
    ) -> tuple[str, bytes]:
        """Return the MIME type and the bytes of one looped picture: each mesh by its vertices' colours (V, 3)."""
        ...

    def close(self) -> None:
        """Give back what it holds."""
        ...


class Catalogue(Protocol):
    """Names to things. A name or table that is not understood raises `envbench.errors.BadInput`."""

    methods: Mapping[str, type[Method]]
    suites: Mapping[str, Path]
    lights: Mapping[str, Spec]
    materials: Mapping[str, Spec]
    geometries: Mapping[str, Spec]
    views: Mapping[str, Spec]
    """Point sets: uniform (R, V) queries, images seen by a viewer."""
    studies: Mapping[str, Callable[[], Study]]
    """Tables that belong to no scene and method; the first line of a function's docstring says what one shows."""

    def scene(
        self, *, name: str, light: Spec, material: Spec, geometry: Spec, view: Spec,
        effects: str | Sequence[str] | None = None,
    ) -> Scene:  # fmt: skip
        """Build a scene; raises `BadInput` for what cannot be read or makes no sense.

        Its effects are those that its facts call for, or those of a list; a plan that wants more is for `effects`.
        """
        ...

    def effects(
        self, scene: Scene, settings: EffectSettings, reference: ReferenceSettings, cache: Path | None
    ) -> Scene:
        """Return the scene with the effects, bounces and decisions that `settings` lead to, from `cache` if held."""
        ...

    def contributions(
        self, scene: Scene, settings: EffectSettings, reference: ReferenceSettings
    ) -> tuple[Scene, bytes | None]:
        """Return the scene with its decisions, every effect measured, and a PNG of what each makes of its image.

        The picture is None where the scene's points form no image.
        """
        ...

    def reference(self, scene: Scene, settings: ReferenceSettings, cache: Path | None) -> Reference:
        """Return ground truth, from `cache` where it holds it."""
        ...

    def sheet(self, name: str, material: Spec) -> MaterialSheet:
        """Return what is known of a material by itself; raises `BadInput`."""
        ...

    def rasteriser(self, size: int) -> Rasteriser:
        """Return what draws pictures of `size` pixels a side; raises `CannotRun` where this machine cannot."""
        ...

    def agreement(self, scenes: Sequence[Scene]) -> Sequence[Agreement]:
        """Hold two independent references against each other on every convex scene."""
        ...
