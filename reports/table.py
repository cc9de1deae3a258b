"""The summary table: one row a cell, each entry with what it sorts by and what stands beneath it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from envbench.attribution import sentence, split
from envbench.metrics import METRICS
from envbench.records import CellResult, Phase, SceneResult, Score, Status
from reports.effects import warnings
from reports.measured import exception
from reports.numerals import RADIANCE, UNDEFINED, between, percent, ratio, seconds, size, three
from reports.verdict import score, settings_text, timing, varied


@dataclass(frozen=True)
class Entry:
    """What one place of the table says; `note` is the small line beneath, `order` what sorting uses (None: last)."""

    text: str = "–"
    note: str = ""
    order: float | str | None = None
    title: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Column:
    """A heading, its explanation, and whether its entries are numbers."""

    heading: str
    title: str
    number: bool = True


@dataclass(frozen=True)
class Row:
    """A cell of the run as the table shows it; `scene` is its index, None where it has no reference."""

    cell: CellResult
    scene: int | None
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class Table:
    """Headings and rows, in the run's order."""

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]


_IN_PERCENT = ("nrmse", "max_error", "worst_view")
_NEAR_ONE = ("energy_ratio", "captured_energy", "ssim")
_SHOWN_WITH_NRMSE = ("captured_energy", "mse", "rmse", "max_error")
"""What says the same in other units, or nearly: no columns of their own."""
_CAUSE = "error by cause"
"""The column of what an NRMSE consists of; its parts have none of their own."""
FURNACE = 1e-3
"""How far from 1 the energy ratio under constant light may be before the row says what is lost."""


def table(scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> Table:
    """Build the table; scene fields that never vary are left out, light and material always stand."""
    names = ("light", "material", *varied(scenes, ("geometry", "view")))
    parts = {name for name, metric in METRICS.items() if metric.splits}
    scored = {entry.metric for cell in cells for entry in cell.scores} - set(_SHOWN_WITH_NRMSE) - parts
    metrics = tuple(name for name in METRICS if name in scored) + tuple(sorted(scored - set(METRICS)))
    if any(split(cell) for cell in cells):
        metrics = (*metrics[:1], _CAUSE, *metrics[1:])
    index = {scene.name: i for i, scene in enumerate(scenes)}
    rows = tuple(
        Row(
            cell,
            place := index.get(cell.scene),
            (
                *_scene_entries(cell, None if place is None else scenes[place], names),
                Entry(cell.method, f"lacks {', '.join(cell.lacks)}" if cell.lacks else "", cell.method),
                _settings(cell),
                Entry(cell.status, cell.reason, cell.status, kind=f"status {cell.status.name.lower()}"),
                *(_metric(cell, name, None if place is None else scenes[place]) for name in metrics),
                _predicted(cell, None if place is None else scenes[place]),
                *(_phase(cell, phase) for phase in Phase),
                Entry(size(cell.bytes), order=cell.bytes) if cell.status is Status.OK else Entry(),
            ),
        )
        for cell in cells
    )
    return Table((*_columns(names, metrics),), rows)


_CAUSE_TITLE = (
    "of the RMS radiance: the method against the reference without what it lacks, and that reference against the whole "
    "one; beneath, their 95 % intervals, and the cross term: the square of the NRMSE is the sum of both squares and "
    "twice that. Sorts by what is ignored"
)


def _columns(names: Sequence[str], metrics: Sequence[str]) -> list[Column]:
    return [
        *(Column(name, f"{name} of the scene", number=False) for name in names),
        Column("method", "way of rendering, and the effects of the scene that it lacks", number=False),
        Column("settings", "the method's settings; hover for what it chose", number=False),
        Column("status", "how the cell ended, and why", number=False),
        *(
            Column(METRICS[name].title, METRICS[name].formula)
            if name in METRICS
            else Column(name, _CAUSE_TITLE if name == _CAUSE else name)
            for name in metrics
        ),
        Column(
            "predicted NRMSE",
            "square root of the energy error that theory predicts over uniform (R, V); "
            "beneath, where the measured error exceeds it",
        ),
        *(Column(phase, f"{phase}: median of the rounds, fastest – slowest beneath") for phase in Phase),
        Column("memory", "bytes of the arrays that must be kept to shade"),
    ]


def _scene_entries(cell: CellResult, scene: SceneResult | None, names: Sequence[str]) -> list[Entry]:
    if scene is None:
        return [Entry(cell.scene, "no reference", cell.scene), *[Entry()] * (len(names) - 1)]
    first, *others = (Entry(getattr(scene, name), order=getattr(scene, name), title=scene.name) for name in names)
    said = warnings(scene)
    return [replace(first, note="; ".join(said), kind="warn") if said else first, *others]


def _settings(cell: CellResult) -> Entry:
    text = settings_text(cell) or "defaults"
    chosen = ", ".join(f"{key} = {json.dumps(value, default=str)}" for key, value in cell.description.items())
    return Entry(text, order=text, title=f"chosen: {chosen}" if chosen else "", kind="settings")


def _cause(cell: CellResult) -> Entry:
    parts = split(cell)
    if parts is None:
        return Entry()
    done, ignored, cross = parts
    if math.isnan(ignored.value):
        return Entry(UNDEFINED)
    intervals = f"{_interval(done, percent)}; {_interval(ignored, percent)}"
    note = f"{intervals}; cross term {three(cross.value)} ({_interval(cross, three)})"
    return Entry(cause(cell), note, _order(ignored.value), kind="cause")


def cause(cell: CellResult) -> str:
    """Say what a cell's NRMSE consists of; empty where it is not split."""
    return sentence(cell, lambda part: f"< {percent(part.high)}" if part.below_floor else percent(part.value))


def _metric(cell: CellResult, name: str, scene: SceneResult | None) -> Entry:
    if name == _CAUSE:
        return _cause(cell)
    entry = score(cell, name)
    if entry is None:
        return Entry()
    if name == "nrmse":
        return replace(nrmse(cell, entry), title=_also(cell))
    word = percent if name in _IN_PERCENT else ratio if name in _NEAR_ONE else three
    unit = "\N{NO-BREAK SPACE}dB" if name == "psnr" else ""
    if math.isnan(entry.value):
        return Entry(UNDEFINED)
    note = "within the noise" if entry.below_floor else _interval(entry, word)
    lost = _furnace(entry, scene) if name == "energy_ratio" and scene is not None else ""
    return Entry(word(entry.value) + unit, lost or note, _order(entry.value), title=note if lost else "")


def _furnace(ratio: Score, scene: SceneResult) -> str:
    """Say what a method loses or gains under constant light, where that is surely more than `FURNACE`."""
    surely = ratio.low > 1 + FURNACE or ratio.high < 1 - FURNACE
    if scene.specs.get("light", {}).get("kind") != "constant" or not surely:
        return ""
    return f"furnace {ratio.value:.4f}: {'loses' if ratio.value < 1 else 'gains'} {percent(abs(1 - ratio.value))}"


def _also(cell: CellResult) -> str:
    named = ((METRICS[name], score(cell, name)) for name in _SHOWN_WITH_NRMSE)
    return ", ".join(
        f"{metric.title} {(ratio if metric.name in _NEAR_ONE else three)(entry.value)} {metric.unit}".strip()
        for metric, entry in named
        if entry
    )


def nrmse(cell: CellResult, entry: Score) -> Entry:
    """Word the NRMSE: with its interval, as an upper bound below the noise floor, or the RMSE where it is undefined."""
    if math.isnan(entry.value):
        absolute = score(cell, "rmse")
        return Entry(UNDEFINED, f"RMSE {three(absolute.value)} {RADIANCE}" if absolute else "")
    if entry.below_floor:
        return Entry(f"< {percent(entry.high)}", "below noise floor", _order(entry.high))
    return Entry(percent(entry.value), _interval(entry, percent), _order(entry.value))


def _interval(entry: Score, word: Callable[[float], str]) -> str:
    known = math.isfinite(entry.low) and math.isfinite(entry.high)
    return between(word(entry.low), word(entry.high)) if known else ""


def _predicted(cell: CellResult, scene: SceneResult | None) -> Entry:
    known = {theory: math.sqrt(error) for theory, error in cell.predictions.items() if error >= 0}
    if not known:
        return Entry()
    first = next(iter(known.values()))
    title = "; ".join(f"{theory}: {percent(error)}" for theory, error in known.items())
    return Entry(percent(first), exception(cell, scene), _order(first), title, kind="remark")


def _phase(cell: CellResult, phase: Phase) -> Entry:
    entry = timing(cell, phase)
    if entry is None:
        return Entry()
    fast, slow = entry.spread
    note = between(seconds(fast), seconds(slow)) if entry.rounds else "first call"
    title = f"first call (compilation included) {seconds(entry.first)}; {len(entry.rounds)} rounds"
    title += "; measured on an earlier scene of this material and shape" if entry.shared else ""
    return Entry(seconds(entry.median), note, _order(entry.median), title)


def _order(value: float) -> float | None:
    return None if math.isnan(value) else max(min(value, 1e300), -1e300)
