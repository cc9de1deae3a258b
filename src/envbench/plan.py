"""From a suite to what is computed: scenes, cells (a method with its settings on a scene), sheets ..."""

from __future__ import annotations

import fnmatch
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from envbench.animation import AnimationSpec, animations
from envbench.catalogue import Spec
from envbench.choices import Choice, choices, selected
from envbench.errors import BadInput, NeedsData, unknown
from envbench.grids import SceneSpec, expand, look_up, steps
from envbench.method import Method
from envbench.reference import ReferenceSettings
from envbench.root import Workbench
from envbench.scene import Scene
from envbench.suite import SuiteFile, TimingSettings


@dataclass(frozen=True)
class CellSpec:
    """A method on a scene.

    Attributes
    ----------
    key : str
        Content address.
    method : Method
        With its settings made.
    settings : mapping
        As rows name them.
    """

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
    """All that a run computes.

    Attributes
    ----------
    notes : tuple of str
        What a user should know of the inputs, and what is left out, a line each.
    survey : mapping of str to Spec
        Materials of which a sheet is made.
    studies : tuple of str
        Tables of the catalogue's to make.
    animations : tuple of AnimationSpec
        Meshes in motion to draw.
    """

    suite: str
    text: str
    reference: ReferenceSettings
    timing: TimingSettings
    cells: tuple[CellSpec, ...]
    notes: tuple[str, ...] = ()
    survey: Mapping[str, Spec] = field(default_factory=dict[str, Spec])
    studies: tuple[str, ...] = ()
    animations: tuple[AnimationSpec, ...] = ()

    @property
    def scenes(self) -> tuple[SceneSpec, ...]:
        """The scenes, each once, in order."""
        return tuple({cell.scene.name: cell.scene for cell in self.cells}.values())

    @property
    def by_asset(self) -> tuple[SceneSpec, ...]:
        """The scenes, those of one material and shape next to each other, so that each is prepared once."""
        assets: dict[tuple[str, str], list[SceneSpec]] = {}
        for scene in self.scenes:
            assets.setdefault((scene.material, scene.geometry), []).append(scene)
        return tuple(scene for group in assets.values() for scene in group)

    def of(self, scene: SceneSpec) -> tuple[CellSpec, ...]:
        """Return the cells of a scene, in order."""
        return tuple(cell for cell in self.cells if cell.scene.name == scene.name)


@dataclass
class _Entry:
    """A scene with the choices that run on it, by identity, and whether it may be left out."""

    spec: SceneSpec
    choices: dict[str, Choice]
    optional: bool


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
    every = choices(suite.methods, bench)
    entries = _entries(suite, bench, every)
    whole = not scenes and not methods
    survey = _survey(suite, bench) if whole else {}
    studies = _studies(suite, bench) if whole else ()
    films, without = animations(suite, bench) if whole else ((), ())
    beside = bool(survey or studies or films)
    if not (entries and every) and not beside and not without:
        lacking = "[[methods]]" if entries else "[[scenes]]"
        raise BadInput(f"suite '{suite.name}' names no cell: give it at least one {lacking} with something in it.")
    _known("scene", scenes, entries)
    _known("method", methods, {choice.method.name for choice in every})
    cells: list[CellSpec] = []
    notes: dict[str, None] = {}
    absent: dict[str, list[str]] = {}
    for position, entry in enumerate(entries.values()):
        spec = replace(entry.spec, position=position)
        chosen = [c for c in entry.choices.values() if not methods or c.method.name in methods]
        if not chosen or (scenes and spec.name not in scenes):
            continue
        try:
            scene = spec.build(bench.catalogue)
        except NeedsData as error:
            if not entry.optional:
                raise
            absent.setdefault(str(error), []).append(spec.name)
            continue
        notes.update(dict.fromkeys(remarks(scene)))
        content = _content(scene, spec, suite.reference)
        for choice in chosen:
            key = hashlib.sha256("\0".join((*content, choice.identity)).encode()).hexdigest()
            cells.append(CellSpec(key, spec, choice.method, choice.settings))
    left_out = (*(f"left out {_listed(names)}: {reason}" for reason, names in absent.items()), *without)
    if not cells and not beside:
        raise BadInput(f"suite '{suite.name}' has no scene left. {' '.join(left_out)}")
    settings = suite.reference, suite.timing
    return Plan(suite.name, suite.text, *settings, tuple(cells), (*left_out, *notes), survey, studies, films)


def remarks(scene: Scene) -> tuple[str, ...]:
    """Return what a user should know of how a scene's inputs were read, a line each."""
    named = (scene.environment, scene.material, scene.geometry)
    return tuple(f"{thing.name}: {note}" for thing in named for note in thing.notes)


def _entries(suite: SuiteFile, bench: Workbench, every: Sequence[Choice]) -> dict[str, _Entry]:
    """Return all scenes by name; one that two grids name has the methods of both."""
    entries: dict[str, _Entry] = {}
    for spec, chosen, optional in (*_of_grids(suite, bench, every), *_of_knobs(suite, bench, every)):
        entry = entries.setdefault(spec.name, _Entry(spec, {}, optional))
        if entry.spec != spec:
            raise BadInput(f"suite '{suite.name}' means two things by '{spec.name}': give its knob another name.")
        entry.choices |= {choice.identity: choice for choice in chosen if choice.identity not in entry.choices}
        entry.optional &= optional
    return entries


_Found = Iterator[tuple[SceneSpec, Sequence[Choice], bool]]


def _of_grids(suite: SuiteFile, bench: Workbench, every: Sequence[Choice]) -> _Found:
    for number, grid in enumerate(suite.scenes, 1):
        chosen = selected(every, grid.methods, f"[[scenes]] {number}")
        for spec in expand(grid, suite, bench):
            yield spec, chosen, grid.optional


def _of_knobs(suite: SuiteFile, bench: Workbench, every: Sequence[Choice]) -> _Found:
    for knob in suite.knobs:
        chosen = selected(every, knob.methods, f"knob '{knob.name}'")
        part, _, setting = knob.vary.partition(".")
        for spec in steps(knob, suite, bench):
            value = knob.values[spec.turn.step] if spec.turn else None
            turned = [c.turned(setting, value, f"knob '{knob.name}'") for c in chosen] if part == "method" else chosen
            yield spec, turned, knob.optional


def _survey(suite: SuiteFile, bench: Workbench) -> dict[str, Spec]:
    """Return the materials to look at: presets that a glob matches, and those of the suite's scenes."""
    if suite.survey is None:
        return {}
    presets = bench.catalogue.materials
    found: dict[str, Spec] = {}
    for pattern in suite.survey.materials:
        names = fnmatch.filter(presets, pattern) or ([pattern] if pattern in suite.materials else [])
        if not names:
            raise unknown("material of [survey]:", pattern, {*presets, *suite.materials})
        found |= {name: look_up("material", name, suite, bench) for name in names}
    used = dict.fromkeys(name for grid in suite.scenes for name in grid.materials)
    return {name: look_up("material", name, suite, bench) for name in used} | found


def _studies(suite: SuiteFile, bench: Workbench) -> tuple[str, ...]:
    """Return the names of the tables to make, each once."""
    for name in suite.studies:
        if name not in bench.catalogue.studies:
            raise unknown("study", name, bench.catalogue.studies)
    return tuple(dict.fromkeys(suite.studies))


def _known(kind: str, wanted: Sequence[str], there: Iterable[str]) -> None:
    for name in wanted:
        if name not in there:
            raise unknown(f"{kind} of this suite:", name, there)


def _listed(names: Sequence[str]) -> str:
    more = len(names) - 1
    return names[0] + (f" and {more} more scene{'s' if more > 1 else ''}" if more else "")


def _content(scene: Scene, spec: SceneSpec, reference: ReferenceSettings) -> tuple[str, ...]:
    parts = (scene.environment, scene.material, scene.geometry, scene.points)
    return (scene.name, *(part.key for part in parts), repr(spec.planning), repr(spec.reference(reference)))


def overridden(suite: SuiteFile, *, floor: float | None, variant: str | None, rounds: int | None) -> SuiteFile:
    """Return the suite with what the command line overrides."""
    changes = {k: v for k, v in {"floor": floor, "variant": variant}.items() if v is not None}
    grids = suite.scenes if floor is None else tuple(replace(grid, floor=None) for grid in suite.scenes)
    timing = suite.timing if rounds is None else replace(suite.timing, rounds=rounds)
    return replace(suite, reference=replace(suite.reference, **changes), timing=timing, scenes=grids)
