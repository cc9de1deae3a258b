"""From a suite's ``[[scenes]]`` and ``[[knobs]]`` to scenes: names looked up, tables turned."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from envbench.catalogue import Catalogue, Spec
from envbench.effects import EffectSettings
from envbench.errors import BadInput, unknown
from envbench.reference import ReferenceSettings
from envbench.root import Workbench
from envbench.scene import Scene, told
from envbench.suite import Grid, Knob, Suite

KINDS = {"light": "lights", "material": "materials", "geometry": "geometries", "view": "views"}


@dataclass(frozen=True)
class Turn:
    """The step of a hard case that a scene is: knob, its number from 0 and its value, and the path that it turns."""

    knob: str
    step: int
    value: Any
    vary: str

    @property
    def setting(self) -> str:
        """The value as text.

        Examples
        --------
        >>> Turn("size", 0, [512, 256], "light.size").setting, Turn("gloss", 1, 1e5, "material.exponent").setting
        ('512 x 256', '100000')
        """
        return worded(self.value)


@dataclass(frozen=True)
class SceneSpec:
    """A scene by name and by what its parts mean; small and picklable, so that a worker builds it itself.

    `name` is light/material/geometry/view, the same in every suite, and after it the effects where a grid chose them.

    Attributes
    ----------
    effects : Plan, tuple of Effect or None
        What the grid chose.
    planning : EffectSettings
        How the effects are chosen, what the grid chose included.
    """

    light: str
    material: str
    geometry: str
    view: str
    specs: Mapping[str, Spec]
    turn: Turn | None = None
    position: int = field(default=0, compare=False)
    effects: str | tuple[str, ...] | None = None
    floor: float | None = None
    planning: EffectSettings = field(default_factory=EffectSettings)

    @property
    def name(self) -> str:
        """The four names, joined, and the effects that were chosen."""
        return "/".join((self.light, self.material, self.geometry, self.view)) + told(self.effects)

    @property
    def meaning(self) -> dict[str, Any]:
        """What the four names meant, and of a step of a hard case what was turned."""
        turn = {} if self.turn is None else {"knob": {"vary": self.turn.vary, "value": self.turn.value}}
        listed = not isinstance(self.planning.plan, str)
        chosen = {"effects": {"only": [str(effect) for effect in self.planning.plan]}} if listed else {}
        return {**self.specs, **turn, **chosen}

    def place(self) -> dict[str, Any]:
        """Return the fields of a `SceneResult` that say where in its plan, and in its hard case, the scene stands."""
        turn = self.turn
        step = {} if turn is None else {"knob": turn.knob, "step": turn.step, "setting": turn.setting}
        return {"position": self.position, **step}

    def reference(self, settings: ReferenceSettings) -> ReferenceSettings:
        """Return the settings of ground truth with the floor that the scene asks for, if it does."""
        return settings if self.floor is None else replace(settings, floor=self.floor)

    def build(self, catalogue: Catalogue) -> Scene:
        """Build the scene; raises `BadInput`."""
        scene = catalogue.scene(name=self.name, effects=self.planning.plan, **self.specs)
        return replace(scene, order=self.planning.order)


def expand(grid: Grid, suite: Suite, bench: Workbench) -> Iterator[SceneSpec]:
    """Yield the scenes of a grid, each name looked up among the suite's tables and the catalogue's presets."""
    planning = suite.effects if grid.effects is None else replace(suite.effects, plan=grid.effects)
    axes = {"light": grid.lights, "material": grid.materials, "geometry": (grid.geometry,), "view": (grid.view,)}
    found = {kind: {name: look_up(kind, name, suite, bench) for name in names} for kind, names in axes.items()}
    for names in itertools.product(*axes.values()):
        specs = {kind: found[kind][name] for kind, name in zip(axes, names, strict=True)}
        yield SceneSpec(*names, specs=specs, effects=grid.effects, floor=grid.floor, planning=planning)


def steps(knob: Knob, suite: Suite, bench: Workbench, what: str = "knob") -> Iterator[SceneSpec]:
    """Yield a knob's scenes from easy to extreme; the part that is turned is named by the knob and its value.

    `what` is how messages call it.
    """
    what = f"{what} '{knob.name}'"
    kind, _, path = knob.vary.partition(".")
    if kind not in (*KINDS, "method") or (kind == "method" and not path):
        raise BadInput(
            f"{what}: vary must begin with light, material, geometry, view or method, "
            f"as in \"material.exponent\". Got '{knob.vary}' instead."
        )
    given = {part: getattr(knob, part) for part in KINDS}
    specs = {
        part: look_up(part, value, suite, bench) if isinstance(value, str) else _placed(value, suite)
        for part, value in given.items()
    }
    named = {part: value if isinstance(value, str) else knob.name for part, value in given.items()}
    varied = "view" if kind == "method" else kind
    for number, value in enumerate(knob.values):
        turn = Turn(knob.name, number, value, knob.vary)
        turned = dict(specs)
        if kind != "method":
            turned[kind] = _turned(specs[kind], knob.vary, value, what, suite, bench)
        names = named | {varied: f"{knob.name} = {turn.setting}".replace("/", ":")}
        yield SceneSpec(*names.values(), specs=turned, turn=turn, planning=suite.effects)


def look_up(kind: str, name: str, suite: Suite, bench: Workbench) -> Spec:
    """Return what a name means; raises `BadInput` for one that is unknown, or stands for two things."""
    own: Mapping[str, Spec] = getattr(suite, KINDS[kind])
    presets: Mapping[str, Spec] = getattr(bench.catalogue, KINDS[kind])
    if name in own and name in presets:
        raise BadInput(f"[{KINDS[kind]}.{name}] hides a preset of that name; choose another name.")
    if name not in own:
        if name not in presets:
            raise unknown(kind, name, {*own, *presets})
        return presets[name]
    return _placed(own[name], suite)


def worded(value: Any) -> str:
    """Word a value of TOML in few characters."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return f"{value:.9g}"
        case Mapping():
            return ", ".join(f"{key} {worded(entry)}" for key, entry in value.items())
        case [*entries]:
            return " x ".join(map(worded, entries))
        case _:
            return str(value)


_FILES = ("path", "image")
"""Keys of a table, or of one within it, that name a file."""


def _placed(spec: Spec, suite: Suite) -> Spec:
    """Return a table whose paths begin at the suite's folder, else where envbench was started."""
    folder: Path = getattr(suite, "folder", Path())

    def placed(key: str, value: Any) -> Any:
        match value:
            case Mapping():
                return {str(inner): placed(str(inner), entry) for inner, entry in value.items()}
            case [*entries]:
                return [placed("", entry) for entry in entries]
            case str() if key in _FILES and value and (folder / value).exists():
                return str(folder / value)
            case _:
                return value

    return placed("", spec)


def _turned(spec: Spec, vary: str, value: Any, what: str, suite: Suite, bench: Workbench) -> Spec:
    """Return a table with what `vary` leads to replaced; all of it where that is but a kind."""
    kind, _, path = vary.partition(".")
    if not path:
        if isinstance(value, str):
            return look_up(kind, value, suite, bench)
        if isinstance(value, Mapping):
            return _placed(value, suite)
        raise BadInput(f"{what}: a {kind} is a name or a table. Got {value!r} instead.")
    turned = copy.deepcopy(dict(spec))
    keys: list[Any] = [int(key) if key.isdigit() else key for key in path.split(".")]
    *way, last = keys
    place: Any = turned
    try:
        for key in way:
            place = place[key]
        if isinstance(place, list):
            _ = place[last]  # an entry that is not there cannot be turned; a setting may have its default
        place[last] = value
    except (KeyError, IndexError, TypeError):
        raise BadInput(f"{what}: '{vary}' leads nowhere in the {kind}'s table {dict(spec)}.") from None
    return turned
