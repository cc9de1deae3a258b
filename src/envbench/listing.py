"""What there is to name: methods, scenes, suites, metrics, studies, and the presets that suites are made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from envbench import root, suite
from envbench.errors import BadInput, unknown
from envbench.grids import expand, steps
from envbench.root import Workbench
from envbench.settings import plain
from envbench.show import console

Rows = list[tuple[str, ...]]


def show(kind: str, user: Path | None) -> None:
    """Print what of a `kind` there is; raises `BadInput` for an unknown kind."""
    from rich.table import Table

    kinds: dict[str, Callable[[Workbench], Rows]] = {
        "methods": methods,
        "scenes": scenes,
        "suites": suites,
        "metrics": lambda bench: metrics(),
        "studies": studies,
        **{name: _presets(name) for name in ("lights", "materials", "geometries", "views")},
    }
    if kind not in kinds:
        raise unknown("thing to list", kind, kinds)
    bench = root.load(user)
    rows = kinds[kind](bench)
    grid = Table(*rows[0], box=None, header_style="bold")
    for row in rows[1:]:
        grid.add_row(*row)
    console().print(grid)
    for reason in bench.broken.values():
        console().print(f"warning, left out: {reason}")


def methods(bench: Workbench) -> Rows:
    """Return each method with its settings and their defaults."""
    return [
        ("name", "settings", "what it does", "source"),
        *(
            (name, _settings(cls), getattr(cls, "summary", ""), getattr(cls, "source", ""))
            for name, cls in sorted(bench.methods.items())
        ),
    ]


def scenes(bench: Workbench) -> Rows:
    """Return the scenes of every suite that can be read."""
    rows: Rows = [("name", "suite")]
    for name, path in sorted(bench.suites.items()):
        try:
            read = suite.read(path)
            rows += [(spec.name, name) for grid in read.scenes for spec in expand(grid, read, bench)]
            rows += [(spec.name, name) for knob in read.knobs for spec in steps(knob, read, bench)]
        except BadInput as error:
            rows.append((f"cannot be read: {error}", name))
    return rows


def suites(bench: Workbench) -> Rows:
    """Return every suite with its description."""
    rows: Rows = [("name", "description", "file")]
    for name, path in sorted(bench.suites.items()):
        try:
            rows.append((name, suite.read(path).description, str(path)))
        except BadInput as error:
            rows.append((name, f"cannot be read: {error}", str(path)))
    return rows


def studies(bench: Workbench) -> Rows:
    """Return every study with what its table shows."""
    shown = ((name, (make.__doc__ or "").partition("\n")[0]) for name, make in bench.catalogue.studies.items())
    return [("name", "table"), *shown]


def metrics() -> Rows:
    """Return every metric with its formula."""
    from envbench.metrics import METRICS

    return [
        ("name", "better", "formula"),
        *((name, metric.direction.value, metric.formula) for name, metric in METRICS.items()),
    ]


def _presets(name: str) -> Callable[[Workbench], Rows]:
    def rows(bench: Workbench) -> Rows:
        presets: Mapping[str, Mapping[str, Any]] = getattr(bench.catalogue, name)
        return [("name", "table"), *((key, _table(spec)) for key, spec in presets.items())]

    return rows


def _table(spec: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {plain(value)}" for key, value in spec.items())


def _settings(cls: type[Any]) -> str:
    shown = [f"{f.name} = {plain(f.default)}" if f.default is not MISSING else f.name for f in fields(cls) if f.init]
    return ", ".join(shown)
