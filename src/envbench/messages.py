"""What a run asks of its worker process, and what comes back: small picklable values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from envbench.animation import AnimationSpec
from envbench.catalogue import Spec
from envbench.grids import SceneSpec
from envbench.plan import CellSpec
from envbench.records import Status
from envbench.reference import ReferenceSettings


@dataclass(frozen=True)
class Setup:
    """What a worker is told when it starts; its standard output and error go to `log`."""

    user: Path | None
    cache: Path | None
    log: Path
    reference: ReferenceSettings


@dataclass(frozen=True)
class Ready:
    """A worker's first word: Mitsuba's variant and the threads that it computes with."""

    variant: str
    threads: dict[str, int]


@dataclass(frozen=True)
class MakeReference:
    """Asks for a scene's reference; answered by a `SceneResult`."""

    scene: SceneSpec


@dataclass(frozen=True)
class MakeWithout:
    """Asks for the reference without the effects that a cell's method lacks; answered by what it took, in seconds."""

    cell: CellSpec


@dataclass(frozen=True)
class FirstPass:
    """Asks to render and score a cell, each phase timed on its first call; answered by a `CellResult`."""

    cell: CellSpec


@dataclass(frozen=True)
class Round:
    """Asks to time a cell once more; answered by a dict of `Phase` to seconds."""

    cell: CellSpec


@dataclass(frozen=True)
class MakeSheet:
    """Asks what is known of a material by itself; answered by a `MaterialSheet`."""

    name: str
    material: Spec


@dataclass(frozen=True)
class MakeStudy:
    """Asks for a table of the catalogue's by name; answered by a `Study`."""

    name: str


@dataclass(frozen=True)
class MakeFilm:
    """Asks for an animation; answered by a `Film`."""

    animation: AnimationSpec


Request = MakeReference | MakeWithout | FirstPass | Round | MakeSheet | MakeStudy | MakeFilm


@dataclass(frozen=True)
class Failure:
    """Answers a request that came to nothing: how it counts, and why in one line."""

    status: Status
    reason: str
