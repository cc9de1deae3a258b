"""From a suite to the list of what is computed: scenes, and cells (a method with its settings on a scene)."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from envbench.catalogue import Catalogue, Spec
from envbench.errors import BadInput, unknown
from envbench.method import Method
from envbench.reference import ReferenceSettings
from envbench.root import Workbench
from envbench.scene import Scene
from envbench.settings import check, construct, plain
from envbench.suite import Grid, Suite, SuiteFile

KINDS = {"light": "lights", "material": "materials", "geometry": "geometries", "view": "views"}


@dataclass(frozen=True)
class SceneSpec:
    """A scene by name and by what its parts mean; small and picklable, so that a worker builds it itself.

    `name` is light/material/geometry/view, the same in every suite.
    """

    light: str
    material: str
    geometry: str
    view: str
    specs: Mapping[str, Spec]

    @property
    def name(self) -> str:
        """The four names, joined."""
        return "/".join((self.light, self.material, self.geometry, self.view))

    def build(self, catalogue: Catalogue) -> Scene:
        """Build the scene; raises `BadInput`."""
        return catalogue.scene(name=self.name, **self.specs)


@dataclass(frozen=True)
class CellSpec:
    """A method on a scene: `method` with its settings made, `settings` as rows name them, `key` its content address."""

    key: str
    scene: SceneSpec
    method: Method
    settings: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Method and settings in one line."""
        return f"{self.method.name}({', '.join(f'{k}={v}' for k, v in self.settings.items())})"


@dataclass(frozen=True)
class Plan:
    """All that a run computes. `notes` say, a line each, what a user should know of the inputs."""

    suite: str
    text: str
    reference: ReferenceSettings
    rounds: int
    cells: tuple[CellSpec, ...]
    notes: tuple[str, ...] = ()

    @property
    def scenes(self) -> tuple[SceneSpec, ...]:
        """The scenes, each once, in order."""
        return tuple({cell.scene.name: cell.scene for cell in self.cells}.values())

    def of(self, scene: SceneSpec) -> tuple[CellSpec, ...]:
        """Return the cells of a scene, in order."""
        return tuple(cell for cell in self.cells if cell.scene.name == scene.name)


def plan(suite: SuiteFile, bench: Workbench, *, scenes: Sequence[str] = (), methods: Sequence[str] = ()) -> Plan:
    """Plan a suite, having checked everything that it names: lights are read, meshes opened, methods made.

    Parameters
    ----------
    scenes, methods : sequence of str
        Where given, only these scenes and methods of the suite.

    Raises
    ------
    BadInput
        For an unknown name, a setting that its method refuses, an input that cannot be used, or a plan of no cell.
    """
    grid = {spec.name: spec for grid in suite.scenes for spec in expand(grid, suite, bench)}
    choices = {choice.label: choice for table in suite.methods for choice in _choices(table, bench)}
    if not grid or not choices:
        lacking = "[[methods]]" if grid else "[[scenes]]"
        raise BadInput(f"suite '{suite.name}' names no cell: give it at least one {lacking} with something in it.")
    _known("scene", scenes, grid)
    _known("method", methods, {choice.method.name for choice in choices.values()})
    cells: list[CellSpec] = []
    notes: dict[str, None] = {}
    for spec in grid.values():
        if scenes and spec.name not in scenes:
            continue
        scene = spec.build(bench.catalogue)
        notes.update(dict.fromkeys(remarks(scene)))
        content = _content(scene, suite.reference)
        for choice in choices.values():
            if not methods or choice.method.name in methods:
                key = hashlib.sha256("\0".join((*content, choice.label)).encode()).hexdigest()
                cells.append(CellSpec(key, spec, choice.method, choice.settings))
    return Plan(suite.name, suite.text, suite.reference, suite.timing.rounds, tuple(cells), tuple(notes))


def remarks(scene: Scene) -> tuple[str, ...]:
    """Return what a user should know of how a scene's inputs were read, a line each."""
    light, shape = scene.environment, scene.geometry
    return (*(f"{light.name}: {n}" for n in light.notes), *(f"{shape.name}: {n}" for n in shape.notes))


def expand(grid: Grid, suite: Suite, bench: Workbench) -> Iterator[SceneSpec]:
    """Yield the scenes of a grid, each name looked up among the suite's tables and the catalogue's presets."""
    axes = {"light": grid.lights, "material": grid.materials, "geometry": (grid.geometry,), "view": (grid.view,)}
    found = {kind: {name: _spec(kind, name, suite, bench) for name in names} for kind, names in axes.items()}
    for names in itertools.product(*axes.values()):
        named = dict(zip(axes, names, strict=True))
        yield SceneSpec(**named, specs={kind: found[kind][name] for kind, name in named.items()})


def _spec(kind: str, name: str, suite: Suite, bench: Workbench) -> Spec:
    own: Mapping[str, Spec] = getattr(suite, KINDS[kind])
    presets: Mapping[str, Spec] = getattr(bench.catalogue, KINDS[kind])
    if name in own and name in presets:
        raise BadInput(f"[{KINDS[kind]}.{name}] hides a preset of that name; choose another name.")
    if name not in own:
        if name not in presets:
            raise unknown(kind, name, {*own, *presets})
        return presets[name]
    spec = dict(own[name])
    beside = getattr(suite, "folder", Path()) / str(spec.get("path", ""))
    if "path" in spec and beside.exists():
        spec["path"] = str(beside)  # a path begins at the suite's folder, else where envbench was started
    return spec


def _known(kind: str, wanted: Sequence[str], there: Iterable[str]) -> None:
    for name in wanted:
        if name not in there:
            raise unknown(f"{kind} of this suite:", name, there)


def _content(scene: Scene, reference: ReferenceSettings) -> tuple[str, ...]:
    effects = ",".join(sorted(scene.effects))
    parts = (scene.environment, scene.material, scene.geometry, scene.points)
    return (scene.name, *(part.key for part in parts), effects, repr(reference))


@dataclass(frozen=True)
class _Choice:
    """A method with its settings: as rows show them, and in full as its `label`."""

    label: str
    method: Method
    settings: Mapping[str, Any]


def _choices(table: Mapping[str, Any], bench: Workbench) -> Iterator[_Choice]:
    """Yield what a ``[[methods]]`` table asks for."""
    if not isinstance(table.get("name"), str):
        raise BadInput(f"a [[methods]] table needs a name in quotes. Got {dict(table)} instead.")
    cls, what = bench.method(table["name"]), f"method '{table['name']}'"
    given = {k: v for k, v in table.items() if k not in ("name", "sweep")}
    sweep = table.get("sweep", False)
    if not isinstance(sweep, bool):
        raise BadInput(f"{what}: sweep must be true or false. Got {sweep!r} instead.")
    if sweep and given:
        raise BadInput(f"{what}: '{min(given)}' stands beside sweep = true; leave one of them out.")
    axes = {key: _axis(cls, key, value, what) for key, value in given.items()}
    combinations = (dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values()))
    instances = cls.sweep() if sweep else [construct(cls, settings, what) for settings in combinations]
    yield from _labelled(cls, list(instances), given)


def _axis(cls: type[Method], key: str, value: Any, what: str) -> list[Any]:
    """Return the values of one setting: a list is swept, unless the setting itself is a list."""
    if not isinstance(value, list):
        return [value]
    try:
        check(cls, key, value, what)
    except BadInput:
        if not value:
            raise BadInput(f"{what}: {key} is an empty list; give it at least one value.") from None
        return list(value)
    return [value]


def _labelled(cls: type[Method], instances: Sequence[Method], given: Iterable[str]) -> Iterator[_Choice]:
    """Name each instance by the settings that were given, differ from their default, or vary among the instances."""
    entries: Sequence[Any] = [f for f in fields(cls) if f.init]  # pyright: ignore[reportArgumentType]
    values = [{f.name: plain(getattr(method, f.name)) for f in entries} for method in instances]
    shown = {
        f.name
        for f in entries
        if f.name in given or any(v[f.name] != plain(f.default) or v[f.name] != values[0][f.name] for v in values)
    }
    for method, every in zip(instances, values, strict=True):
        label = f"{cls.__module__}.{cls.__qualname__} {json.dumps(every, sort_keys=True)}"
        yield _Choice(label, method, {k: v for k, v in every.items() if k in shown})


def overridden(suite: SuiteFile, *, floor: float | None, variant: str | None, rounds: int | None) -> SuiteFile:
    """Return the suite with what the command line overrides."""
    changes = {k: v for k, v in {"floor": floor, "variant": variant}.items() if v is not None}
    timing = suite.timing if rounds is None else replace(suite.timing, rounds=rounds)
    return replace(suite, reference=replace(suite.reference, **changes), timing=timing)
