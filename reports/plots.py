"""What the plots of accuracy against time draw: a point a scored cell, with its words; the page's script draws it."""

from __future__ import annotations

import base64
import functools
import gzip
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import escape

from envbench.records import CellResult, Phase, SceneResult, Status, Timing
from reports.numerals import between, percent, seconds
from reports.table import nrmse
from reports.verdict import SITUATIONS, score, settings_text, timing

CLOCK = 1e-7
"""Seconds below which a phase is drawn at the edge: a step that returns at once has no place on a log axis."""
PANELS: tuple[tuple[str, str, tuple[Phase, ...]], ...] = (
    ("change", "change of light: relight + frame + shade", SITUATIONS[0].phases),
    *((phase.value, phase.value, (phase,)) for phase in Phase),
)


@dataclass(frozen=True)
class Mark:
    """How a method looks everywhere in the report: a colour of the style sheet, and a shape for those who see none."""

    method: str
    colour: int
    symbol: str
    glyph: str


_SHAPES = (("circle", "●"), ("square", "■"), ("diamond", "◆"), ("triangle-up", "▲"), ("cross", "✚"), ("x", "✖"))


def marks(cells: Sequence[CellResult]) -> dict[str, Mark]:
    """Give each method its mark, in the order of the run."""
    methods = dict.fromkeys(cell.method for cell in cells)
    return {
        # The shape moves on with every turn of the colours, so that 36 methods differ.
        method: Mark(method, i % len(_SHAPES), *_SHAPES[(i + i // len(_SHAPES)) % len(_SHAPES)])
        for i, method in enumerate(methods)
    }


@functools.cache
def packed_plotly() -> str:
    """Return plotly.js as base64 of gzip, which browsers unpack themselves: 2 MB where the script has 4.8."""
    from plotly.offline import get_plotlyjs

    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), mtime=0)).decode()


def plot_data(scenes: Sequence[SceneResult], cells: Sequence[CellResult]) -> dict[str, Any]:
    """Return the plots' data as JSON types; NaN and infinity become None, names are escaped for hover texts."""
    index = {scene.name: i for i, scene in enumerate(scenes)}
    return {
        "scenes": [
            {
                "light": scene.light,
                "material": scene.material,
                "geometry": scene.geometry,
                "view": scene.view,
                "knob": scene.knob,
                "setting": scene.setting,
                "floor": scene.reference_floor if scene.reference_rms > 0 else None,
                "floorText": f"reference noise floor {percent(scene.reference_floor)}",
            }
            for scene in scenes
        ],
        "methods": [
            {"name": str(escape(mark.method)), "colour": mark.colour, "symbol": mark.symbol}
            for mark in marks(cells).values()
        ],
        "panels": [{"id": name, "title": title} for name, title, _ in PANELS],
        "points": [point for cell in cells if cell.scene in index if (point := _point(cell, index[cell.scene]))],
    }


def _point(cell: CellResult, scene: int) -> dict[str, Any] | None:
    entry = score(cell, "nrmse")
    if cell.status is not Status.OK or entry is None:
        return None
    value = entry.high if entry.below_floor else entry.value
    if not (math.isfinite(value) and value > 0):
        return None
    # A bar that reaches zero would have no end on a log axis: it is drawn over three decades.
    low = max(entry.low, value * 1e-3) if math.isfinite(entry.low) and not entry.below_floor else value
    words = nrmse(cell, entry)
    return {
        "scene": scene,
        "method": str(escape(cell.method)),
        "y": value,
        "low": low,
        "high": max(entry.high, value) if math.isfinite(entry.high) else value,
        "below": entry.below_floor,
        "settings": str(escape(settings_text(cell) or "defaults")),
        "score": str(escape(f"NRMSE {words.text} ({words.note})" if words.note else f"NRMSE {words.text}")),
        "times": {name: _time(cell, phases) for name, _, phases in PANELS},
    }


def _time(cell: CellResult, phases: Sequence[Phase]) -> dict[str, Any] | None:
    timings = [entry for phase in phases if (entry := timing(cell, phase))]
    if len(timings) < len(phases):
        return None
    return _span(timings)


def _span(timings: Sequence[Timing]) -> dict[str, Any]:
    middle = sum(entry.median for entry in timings)
    fast, slow = (sum(entry.spread[i] for entry in timings) for i in (0, 1))
    return {
        "x": max(middle, CLOCK),
        "low": max(fast, CLOCK),
        "high": max(slow, CLOCK),
        "text": f"{seconds(middle)} ({between(seconds(fast), seconds(slow))})",
    }
