"""A suite: what a user asks for, read from TOML and checked for form (what its names mean is the plan's business)."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from envbench.effects import EffectSettings, chosen
from envbench.errors import BadInput
from envbench.reference import ReferenceSettings
from envbench.settings import construct

Tables = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class TimingSettings:
    """How often each phase of each cell is timed after its first call.

    Attributes
    ----------
    rounds : int
    budget : float
        Seconds that a cell's calls may take in all: no round begins that would exceed them, and the rounds so far, or
        the first call, have to do.
    timeout : float
        Seconds that one call of a cell may take, or a study; ``--timeout`` overrides it.
    """

    rounds: int = 5
    budget: float = 120.0
    timeout: float = 120.0

    def __post_init__(self) -> None:
        if not 0 <= self.rounds <= 1000:
            raise BadInput(f"rounds must lie in [0, 1000]. Got {self.rounds} instead.")
        if not 0 < self.budget < float("inf"):
            raise BadInput(f"budget must be a number of seconds > 0. Got {self.budget} instead.")
        if not 0 < self.timeout < float("inf"):
            raise BadInput(f"timeout must be a number of seconds > 0. Got {self.timeout} instead.")


@dataclass(frozen=True)
class Grid:
    """Every light with every material, on one geometry seen in one way.

    Attributes
    ----------
    methods : tuple of str or None
        Labels of the suite's ``[[methods]]`` that run here; None is all of them.
    optional : bool
        Leave out, with a note, the scenes whose files of data are absent, instead of refusing to begin.
    effects : Plan, tuple of Effect or None
        What ground truth simulates here: ``"auto"``, ``"facts"``, ``"all"`` or a list (`EffectSettings.plan`); None is
        as ``[effects]`` says.
    floor : float or None
        Noise floor of ground truth here; None is that of ``[reference]``.
    """

    lights: tuple[str, ...]
    materials: tuple[str, ...]
    geometry: str = "sphere"
    view: str = "image"
    methods: tuple[str, ...] | None = None
    optional: bool = False
    effects: str | tuple[str, ...] | None = None
    floor: float | None = None

    def __post_init__(self) -> None:
        if self.effects is not None:
            object.__setattr__(self, "effects", chosen(self.effects))
        if self.floor is not None:
            ReferenceSettings(floor=self.floor)  # which says what is wrong with it


@dataclass(frozen=True)
class Knob:
    """A hard case: one scene, of which one thing is turned from easy to extreme.

    Attributes
    ----------
    light, material, geometry, view : str or table
        The scene: names, or tables of the knob's own.
    vary : str
        What is turned: a dotted path into one of them (``"material.exponent"``, ``"material.lobes.0.sigma"``), one of
        them as a whole (``"light"``), or a setting of the methods (``"method.order"``).
    values : tuple
        What it is turned to, from easy to extreme; two at least.
    """

    name: str
    vary: str
    values: tuple[Any, ...]
    light: str | dict[str, Any]
    material: str | dict[str, Any]
    geometry: str | dict[str, Any] = "sphere"
    view: str | dict[str, Any] = "uniform"
    methods: tuple[str, ...] | None = None
    optional: bool = False

    def __post_init__(self) -> None:
        if "/" in self.name or not self.name.strip():
            raise BadInput(f"a knob's name must be words without '/'. Got {self.name!r} instead.")
        if len(self.values) < 2:
            raise BadInput(
                f"values must hold two steps at least, from easy to extreme. Got {list(self.values)} instead."
            )


@dataclass(frozen=True)
class Animation:
    """A mesh in motion, shaded by one method and drawn off screen; nothing of it is scored.

    Attributes
    ----------
    light, material, geometry : str or table
        Names, or tables of the animation's own.
    method : dict
        ``name`` and settings.
    vary : str
        A dotted path into the pose: ``"geometry.pose.time"``.
    values : tuple
        What it is at each frame; two at least.
    direction, up : (3,)
        Towards the viewer, far away; and what is upright in the picture.
    size : int
        Pixels a side.
    fps : float
        Frames a second.
    """

    name: str
    vary: str
    values: tuple[Any, ...]
    light: str | dict[str, Any]
    material: str | dict[str, Any]
    geometry: str | dict[str, Any]
    method: dict[str, Any]
    direction: tuple[float, float, float] = (0.0, -1.0, 0.0)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    size: int = 320
    fps: float = 12.0
    optional: bool = False

    def __post_init__(self) -> None:
        if "/" in self.name or not self.name.strip():
            raise BadInput(f"an animation's name must be words without '/'. Got {self.name!r} instead.")
        if len(self.values) < 2:
            raise BadInput(f"values must hold two frames at least. Got {list(self.values)} instead.")
        if self.vary != "geometry.pose" and not self.vary.startswith("geometry.pose."):
            raise BadInput(
                f'vary must lead into the pose, as in "geometry.pose.time": the mesh at rest stays as it is. '
                f"Got '{self.vary}' instead."
            )
        if not isinstance(self.method.get("name"), str):
            raise BadInput(f"method must be a table with the name of a method. Got {self.method} instead.")
        for key in ("direction", "up"):
            if not 0 < sum(x * x for x in getattr(self, key)) < float("inf"):
                raise BadInput(
                    f"{key} must be a finite vector that is not zero. Got {list(getattr(self, key))} instead."
                )
        if not 16 <= self.size <= 2048:
            raise BadInput(f"size must lie in [16, 2048] pixels. Got {self.size} instead.")
        if not 0.1 <= self.fps <= 60:
            raise BadInput(f"fps must lie in [0.1, 60] frames a second. Got {self.fps:g} instead.")


@dataclass(frozen=True)
class Survey:
    """Materials that are looked at by themselves: presets by name or glob (``"curet-*"``), beside the suite's own."""

    materials: tuple[str, ...] = ()


@dataclass(frozen=True)
class Claim:
    """What a paper says of two methods: on these materials `method` falls short where `beside` is accurate.

    Attributes
    ----------
    text, source : str
        In words, and where it is said.
    materials : tuple of str
        It is judged on the scenes of the run with these materials, and with `views` where they are given.
    method, beside : dict
        ``name`` of a method and settings that its cells must have; of the cells that fit, the best is taken.
    level : float
        NRMSE above which a method falls short.
    """

    text: str
    source: str
    materials: tuple[str, ...]
    method: dict[str, Any]
    beside: dict[str, Any]
    level: float = 0.05
    views: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.level < 1:
            raise BadInput(f"level must lie in (0, 1). Got {self.level} instead.")
        for key in ("method", "beside"):
            if not isinstance(getattr(self, key).get("name"), str):
                raise BadInput(f"{key} must be a table with the name of a method. Got {getattr(self, key)} instead.")


@dataclass(frozen=True)
class Suite:
    """The content of a suite file.

    Attributes
    ----------
    effects : EffectSettings
        Which effects ground truth simulates, where a grid does not say.
    lights, materials, geometries, views : dict of dict
        The suite's own named tables, beside the catalogue's presets.
    methods : tuple of dict
        Each has a ``name`` and settings; a list is swept, ``sweep = true`` asks for the method's own sweep; ``label``
        is what scenes and knobs know it by, its name if it has none.
    survey : Survey or None
        None: no sheet is made of any material.
    claims : tuple of Claim
        What the report judges by the run's measurements.
    studies : tuple of str
        Tables of the catalogue's that belong to no scene and method.
    animations : tuple of Animation
        Meshes in motion that the report shows.
    """

    name: str
    description: str = ""
    reference: ReferenceSettings = field(default_factory=ReferenceSettings)
    timing: TimingSettings = field(default_factory=TimingSettings)
    effects: EffectSettings = field(default_factory=EffectSettings)
    lights: Tables = field(default_factory=Tables)
    materials: Tables = field(default_factory=Tables)
    geometries: Tables = field(default_factory=Tables)
    views: Tables = field(default_factory=Tables)
    scenes: tuple[Grid, ...] = ()
    knobs: tuple[Knob, ...] = ()
    methods: tuple[dict[str, Any], ...] = ()
    claims: tuple[Claim, ...] = ()
    survey: Survey | None = None
    studies: tuple[str, ...] = ()
    animations: tuple[Animation, ...] = ()


@dataclass(frozen=True)
class SuiteFile(Suite):
    """A suite with the `text` it was read from and the `folder` where relative paths in its tables begin."""

    text: str = ""
    folder: Path = Path()


_KINDS: dict[str, type[Any]] = {
    "reference": ReferenceSettings, "timing": TimingSettings, "effects": EffectSettings, "survey": Survey,
}  # fmt: skip


def read(path: Path) -> SuiteFile:
    """Read a suite file.

    Raises
    ------
    BadInput
        The file is missing or no TOML (line and column are named), or a key, a type or a value is not understood.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise BadInput(f"suite {path} does not exist; 'envbench list suites' shows what there is.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"suite {path} cannot be read: {error}. A TOML file in UTF-8 is needed.") from None
    return parse(text, str(path), path.resolve().parent)


def parse(text: str, what: str, folder: Path = Path()) -> SuiteFile:
    """Read a suite from TOML `text`; `what` names it in messages."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(_located(str(error), text, what)) from None
    table.setdefault("name", Path(what).stem)
    parts: dict[str, Any] = {
        key: construct(kind, _table(table.pop(key), f"{what}: [{key}]"), f"{what}: [{key}]")
        for key, kind in _KINDS.items()
        if key in table
    }
    scenes = _tables(table.pop("scenes", []), what, "scenes")
    grids = tuple(construct(Grid, entry, f"{what}: [[scenes]] {i + 1}") for i, entry in enumerate(scenes))
    turned = _tables(table.pop("knobs", []), what, "knobs")
    knobs = tuple(construct(Knob, entry, f"{what}: [[knobs]] {i + 1}") for i, entry in enumerate(turned))
    moved = _tables(table.pop("animations", []), what, "animations")
    films = tuple(construct(Animation, entry, f"{what}: [[animations]] {i + 1}") for i, entry in enumerate(moved))
    for key, named in {"knobs": knobs, "animations": films}.items():
        names = [entry.name for entry in named]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise BadInput(f"{what}: two [[{key}]] are called '{twice[0]}'; give each a name of its own.")
    said = _tables(table.pop("claims", []), what, "claims")
    claims = tuple(construct(Claim, entry, f"{what}: [[claims]] {i + 1}") for i, entry in enumerate(said))
    parts |= {
        "scenes": grids,
        "knobs": knobs,
        "animations": films,
        "claims": claims,
        "methods": _tables(table.pop("methods", []), what, "methods"),
    }
    suite = construct(Suite, table, what)
    return replace(SuiteFile(**vars(suite), text=text, folder=folder), **parts)


def _located(message: str, text: str, what: str) -> str:
    found = re.search(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", message)
    lines = text.splitlines() or [""]
    line, column = (found[1], found[2]) if found and found[1] else (len(lines), len(lines[-1]) + 1)
    reason = message[: found.start()] if found else message
    return f"{what}, line {line}, column {column}: {reason}. Mend the TOML there."


def _table(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise BadInput(f"{what} must be a table. Got {value!r} instead.")
    return value


def _tables(value: Any, what: str, key: str) -> tuple[dict[str, Any], ...]:
    if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        raise BadInput(f"{what}: write [[{key}]], a list of tables. Got {value!r} instead.")
    return tuple(value)
