"""What ``[[animations]]`` ask for: the frames of a mesh in motion, as scenes, and the method that shades them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from envbench.choices import choices
from envbench.errors import BadInput, NeedsData
from envbench.grids import SceneSpec, steps, worded
from envbench.method import Method
from envbench.root import Workbench
from envbench.scene import Effect
from envbench.suite import Animation, Knob, SuiteFile


@dataclass(frozen=True)
class AnimationSpec:
    """An animation with its names looked up; small and picklable, so that a worker makes it.

    Attributes
    ----------
    frames : tuple of SceneSpec
        One a pose, their queries the vertices.
    settings : mapping
        Of the method, as captions name them.
    """

    asked: Animation
    frames: tuple[SceneSpec, ...]
    method: Method
    settings: Mapping[str, Any]

    @property
    def name(self) -> str:
        """As the suite calls it."""
        return self.asked.name

    @property
    def caption(self) -> str:
        """Method, scene and motion in one line."""
        settings = ", ".join(f"{key}={value}" for key, value in self.settings.items())
        scene = self.frames[0]
        shape = self.asked.geometry if isinstance(self.asked.geometry, str) else "its own mesh"
        first, last = (worded(self.asked.values[i]) for i in (0, -1))
        return (
            f"{self.method.name}{f'({settings})' if settings else ''}, light {scene.light}, material {scene.material}, "
            f"geometry {shape}; {self.asked.vary} = {first} ... {last} in {len(self.frames)} frames, "
            f"{self.asked.fps:g} a second, seen from ({', '.join(f'{x:g}' for x in self.asked.direction)})"
        )


def animations(suite: SuiteFile, bench: Workbench) -> tuple[tuple[AnimationSpec, ...], tuple[str, ...]]:
    """Return a suite's animations, and a line for each that is left out as its data are absent and it may be.

    The first frame of each is built, so that what its names and tables mean is checked before anything is computed.

    Raises
    ------
    BadInput
        For an unknown name, a path that leads nowhere, or several methods where there is one to name.
    """
    found: list[AnimationSpec] = []
    absent: list[str] = []
    for asked in suite.animations:
        try:
            found.append(_spec(asked, suite, bench))
        except NeedsData as error:
            if not asked.optional:
                raise
            absent.append(f"left out animation '{asked.name}': {error}")
    return tuple(found), tuple(absent)


def _spec(asked: Animation, suite: SuiteFile, bench: Workbench) -> AnimationSpec:
    chosen = choices([asked.method], bench)
    if len(chosen) != 1:
        raise BadInput(f"animation '{asked.name}': method must be one, with one value a setting. Got {asked.method}.")
    parts = asked.light, asked.material, asked.geometry
    knob = Knob(asked.name, asked.vary, asked.values, *parts, view={"kind": "vertices"})
    frames = tuple(steps(knob, suite, bench, "animation"))
    scene = frames[0].build(bench.catalogue)
    if Effect.VIEW_DEPENDENCE in scene.effects:  # what is diffuse is shaded all round, and has no seam where it turns
        view = {"kind": "vertices", "direction": list(asked.direction)}
        frames = tuple(replace(frame, specs={**frame.specs, "view": view}) for frame in frames)
    return AnimationSpec(asked, frames, chosen[0].method, chosen[0].settings)
