"""Figures drawn again by Plotly: our columns as lines, printed points beside them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from markupsafe import escape

from envbench.papers import Found
from reports.papers.items import Plot
from reports.papers.verdicts import Cell, column, rows

_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#b4558f", "#c98700", "#3a9bd1")
"""Okabe and Ito's, as the report's style sheet has them."""
_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "x")
_AXIS = {"gridcolor": "#e2e6ea", "linecolor": "#5b6570", "ticks": "outside", "zeroline": False, "automargin": True}


def figure(plot: Plot, found: Found) -> dict[str, Any]:
    """Return a figure as Plotly's ``newPlot`` takes it: data and layout, JSON values.

    Raises an error of `reports.papers.verdicts` where the study lacks a column.
    """
    traces: list[dict[str, Any]] = []
    for number, (name, x, y) in enumerate(_series(plot, found)):
        look = _COLOURS[number % len(_COLOURS)]
        traces.append({"name": name, "x": x, "y": y, **_drawn(plot.style, look, _SYMBOLS[number % len(_SYMBOLS)])})
    for number, points in enumerate(plot.printed):
        marker = {
            "symbol": _SYMBOLS[number % len(_SYMBOLS)] + "-open",
            "size": 11,
            "color": "#1b1f24",
            "line": {"width": 2},
        }
        name = str(escape(points.name))
        traces.append(
            {"name": name, "x": points.x, "y": points.y, "type": "scatter", "mode": "markers", "marker": marker}
        )
    layout = {
        "font": {"family": "system-ui, sans-serif", "size": 14, "color": "#1b1f24"},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "margin": {"l": 70, "r": 20, "t": 16, "b": 60},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom"},
        "barmode": "group",
        "xaxis": {**_AXIS, "title": {"text": str(escape(plot.x))}, "type": _scale(plot, "x", traces)},
        "yaxis": {**_AXIS, "title": {"text": _titled(plot)}, "type": _scale(plot, "y", traces)},
    }
    return {"data": traces, "layout": layout}


def _series(plot: Plot, found: Found) -> Iterator[tuple[str, list[Cell], list[Cell]]]:
    study = found.study
    places, x = rows(study, plot.where), column(study, plot.x)
    split = None if plot.by is None else column(study, plot.by)
    groups = [None] if split is None else list(dict.fromkeys(study.rows[i][split] for i in places))
    for heading in plot.y:
        y = column(study, heading)
        for group in groups:
            chosen = [study.rows[i] for i in places if split is None or study.rows[i][split] == group]
            points = [(row[x], row[y]) for row in chosen if row[y] is not None and row[x] is not None]
            named = heading if group is None else f"{group}" if len(plot.y) == 1 else f"{heading}, {group}"
            yield str(escape(named)), [a for a, _ in points], [b for _, b in points]


def _drawn(style: str, colour: str, symbol: str) -> dict[str, Any]:
    if style == "bars":
        return {"type": "bar", "marker": {"color": colour}}
    marker = {"symbol": symbol, "size": 8, "color": colour}
    mode = "markers" if style == "points" else "lines+markers"
    return {"type": "scatter", "mode": mode, "marker": marker, "line": {"color": colour, "width": 2}}


def _scale(plot: Plot, axis: str, traces: list[dict[str, Any]]) -> str:
    if axis in plot.log:
        return "log"
    return "category" if any(isinstance(value, str) for trace in traces for value in trace[axis]) else "linear"


def _titled(plot: Plot) -> str:
    return str(escape(plot.y[0])) if len(plot.y) == 1 else ""
