"""What a run leaves behind: plain, picklable records that the store keeps and the report reads."""

from __future__ import annotations

import re
import statistics
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.errors import BadInput
from envbench.scene import Decision


class Status(StrEnum):
    """How a cell ended."""

    OK = "ok"
    DECLINED = "declined"
    FAILED = "failed"
    CRASHED = "crashed"
    TIMED_OUT = "timed out"
    OUT_OF_MEMORY = "out of memory"


class Phase(StrEnum):
    """The steps of a method, in order."""

    PREPARE = "prepare"
    RELIGHT = "relight"
    FRAME = "frame"
    SHADE = "shade"


@dataclass(frozen=True)
class Timing:
    """Seconds of one phase: the `first` call (kernel compilation included) and the interleaved `rounds` after it.

    `prepare` is timed on its first call only if that takes long; `rounds` then is empty and the first call counts.
    """

    phase: Phase
    first: float
    rounds: tuple[float, ...] = ()
    shared: bool = False
    """Measured on an earlier scene of the same asset: `prepare` is paid once for all of them."""

    @property
    def median(self) -> float:
        """Median over the rounds, in seconds."""
        return statistics.median(self.rounds) if self.rounds else self.first

    @property
    def spread(self) -> tuple[float, float]:
        """Fastest and slowest round, in seconds."""
        return (min(self.rounds), max(self.rounds)) if self.rounds else (self.first, self.first)


@dataclass(frozen=True)
class Score:
    """One metric of one cell, with its 95 % interval where the metric has one (NaN bounds where it has none).

    `jackknife` holds the K leave-one-out values, so that two methods scored against the same replicates can be compared
    by the interval of their paired difference.
    """

    metric: str
    value: float
    low: float = float("nan")
    high: float = float("nan")
    below_floor: bool = False
    jackknife: tuple[float, ...] = ()


@dataclass(frozen=True)
class CellResult:
    """One method with one set of settings on one scene.

    `key` is the cell's content address within the plan (scene and its specs, method, settings, reference settings).
    """

    key: str
    scene: str
    method: str
    settings: dict[str, Any]
    status: Status
    reason: str = ""
    timings: tuple[Timing, ...] = ()
    scores: tuple[Score, ...] = ()
    bytes: int = 0
    predictions: dict[str, float] = field(default_factory=dict[str, float])
    """Energy error (squared NRMSE over uniform (R, V)) that each theory predicts, by its name."""
    description: dict[str, Any] = field(default_factory=dict[str, Any])
    lacks: tuple[str, ...] = ()
    """Effects of the scene that the method does not simulate."""
    image: NDArray[np.float32] | None = None
    """(H, W, 3) where the points form an image; NaN where there is no point."""

    @property
    def label(self) -> str:
        """Method and settings, as rows and legends name a cell."""
        settings = ", ".join(f"{k}={v}" for k, v in self.settings.items())
        return f"{self.method}({settings})" if settings else self.method


@dataclass(frozen=True)
class SceneResult:
    """A scene of a run and its reference: `light`, `material`, `geometry`, `view` by name, `specs` what they meant."""

    name: str
    light: str
    material: str
    geometry: str
    view: str
    specs: dict[str, Any]
    effects: tuple[str, ...]
    points: int
    reference_key: str
    reference_floor: float
    reference_target: float
    reference_samples: int
    reference_replicates: int
    reference_seconds: float
    reference_from_cache: bool
    reference_rms: float
    notes: tuple[str, ...] = ()
    knob: str = ""
    """The hard case that the scene is a step of: what is turned, from easy to extreme."""
    step: int = 0
    setting: str = ""
    """The knob's value at this step, as text."""
    position: int = 0
    """Place in the plan; scenes are carried out in the order that prepares each asset once."""
    decisions: tuple[Decision, ...] = ()
    """Why each effect is simulated, or is not."""
    image: NDArray[np.float32] | None = None
    """(H, W, 3) reference mean where the points form an image; NaN where there is no point."""


@dataclass(frozen=True)
class MaterialSheet:
    """What is known of a material by itself: what a user checks before trusting a measured BRDF.

    Attributes
    ----------
    lobes : tuple of str
        Each lobe in words: kind, parameters, centre, whole or clipped.
    reciprocity : float
        RMS of rho(L, V) - rho(V, L) over the RMS of rho, the cosine left out, over cosine-weighted pairs; 0 is ideal.
    negative : float
        Share of those pairs at which some channel is negative before clamping.
    albedo : tuple of (degrees, r, g, b)
        Directional albedo by the angle of the view to the normal.
    orders : tuple of (eps, lobe number, F, P, missing energy)
        Least SHRM orders that leave out at most eps of a lobe's energy.
    captured : tuple of (lobe number, P, energy)
        Captured energy by P at F = 30.
    slices : tuple of (light degrees, view angles in degrees, values)
        rho times cos, mean of r, g and b, in the plane of incidence: the lobe plot. Negative angles: the light's side.
    """

    name: str
    spec: dict[str, Any]
    lobes: tuple[str, ...]
    notes: tuple[str, ...]
    reciprocity: float
    negative: float
    albedo: tuple[tuple[float, float, float, float], ...]
    orders: tuple[tuple[float, int, int, int, float], ...]
    captured: tuple[tuple[int, int, float], ...]
    slices: tuple[tuple[float, tuple[float, ...], tuple[float, ...]], ...]


@dataclass(frozen=True)
class Picture:
    """A picture that belongs to a study: PNG, with what it shows, its tone mapping and its scale in the caption."""

    name: str
    caption: str
    png: bytes = field(repr=False)


@dataclass(frozen=True)
class Study:
    """A table that belongs to no scene and method, e.g. what a paper prints beside the same recomputed.

    Attributes
    ----------
    title, text : str
        What the table shows, in a line and in a few sentences.
    columns : tuple of str
        Headings, a unit in brackets where there is one.
    rows : tuple of tuple
        Of as many entries as there are columns. True and False show as "holds" and "differs", None as a dash.
    notes : tuple of str
        What a reader should know, a line each.
    seconds : float
        What making it took; NaN until it was measured.
    reason : str
        Why there is no table; empty where there is one.
    needs_data : bool
        The reason is that files of data are absent, and says how to get them.
    pictures : tuple of Picture
        Shown under the table.
    """

    name: str
    title: str
    text: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float | int | bool | None, ...], ...]
    notes: tuple[str, ...] = ()
    seconds: float = float("nan")
    reason: str = ""
    needs_data: bool = False
    pictures: tuple[Picture, ...] = ()

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, 1):
            if len(row) != len(self.columns):
                raise BadInput(
                    f"study '{self.name}': row {number} must have {len(self.columns)} entries, one a column. "
                    f"Got {len(row)} instead."
                )

    @property
    def judged(self) -> tuple[int, int]:
        """How many of its true-or-false entries are true, and how many there are."""
        said = [entry for row in self.rows for entry in row if isinstance(entry, bool)]
        return sum(said), len(said)

    @staticmethod
    def missing(name: str, reason: str, *, needs_data: bool = False) -> Study:
        """Return what stands for a study that came to nothing."""
        return Study(name, name, "", (), (), reason=reason, needs_data=needs_data)


@dataclass(frozen=True)
class Film:
    """A mesh in motion as a method shades it: one looped picture that a browser plays.

    Attributes
    ----------
    caption : str
        Method and settings, light, material, what moves, and how radiance became colours.
    mime : str
        The type of `data`, e.g. "image/webp".
    notes : tuple of str
        What a viewer should know, a line each (effects that are not simulated, vertices without a value ...).
    reason : str
        Why there is no picture; empty where there is one.
    """

    name: str
    caption: str
    mime: str = ""
    data: bytes = b""
    notes: tuple[str, ...] = ()
    seconds: float = float("nan")
    reason: str = ""


@dataclass(frozen=True)
class RunInfo:
    """A run: what was asked, where, with which versions, and how it ended (`finished` None while it runs)."""

    id: str
    suite: str
    suite_text: str
    started: str
    machine: dict[str, Any]
    versions: dict[str, str]
    finished: str | None = None
    wall_seconds: float | None = None
    overhead_seconds: float | None = None

    @property
    def commit(self) -> str:
        """What git calls the checkout that ran, "-dirty" where files were changed; "unknown" without git."""
        found = re.search(r"\(git ([^)]+)\)", self.versions.get("envbench", ""))
        return found[1] if found else "unknown"
