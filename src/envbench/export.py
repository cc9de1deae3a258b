"""One flat row a cell, for other tools: CSV, JSON or Parquet, by the suffix of the file's name."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from envbench.errors import BadInput, unknown
from envbench.metrics import METRICS
from envbench.records import CellResult, Phase, RunInfo, SceneResult
from envbench.store import Store

Row = dict[str, str | int | float | bool | None]


def export(store: Store, run: str, path: Path | str) -> Path:
    """Write the cells of a run to `path`, all of it or nothing.

    Parameters
    ----------
    run : str
        As `Store.run` takes it.
    path : path
        Ends in .csv, .json (an array of objects) or .parquet. What is undefined is empty, or null.

    Raises
    ------
    BadInput
        No such run; another suffix; a place that cannot be written.
    """
    path = Path(path)
    write = _WRITERS.get(path.suffix.lower())
    if write is None:
        raise unknown("suffix", path.suffix, _WRITERS)
    table = rows(store, store.run(run))
    try:
        _whole(path, write, table)
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(
            f"cannot write {path}: {reason}. Name a writable place with room; nothing was changed."
        ) from error
    return path


def rows(store: Store, run: RunInfo) -> list[Row]:
    """Return one row a cell. All rows have the same columns, their units in the names (``_s``: seconds)."""
    scenes = {scene.name: scene for scene in store.scenes(run.id)}
    return [_row(run, scenes.get(cell.scene), cell) for cell in store.cells(run.id)]


def columns() -> dict[str, type]:
    """Return the columns of an export in order, and what they hold; any value may be missing."""
    text = (
        "run",
        "suite",
        "started",
        *_SCENE_TEXT,
        "method",
        "settings",
        "status",
        "reason",
        "lacks",
        "description",
        "predicted_energy_errors",
    )
    return {
        **dict.fromkeys(text, str),
        **dict.fromkeys(("points", "reference_samples", "reference_replicates", "memory_bytes"), int),
        **dict.fromkeys(("reference_floor", "reference_rms", "reference_s"), float),
        **{f"{phase}_{what}_s": float for phase in Phase for what in ("first", "median", "fastest", "slowest")},
        **{
            name + part: bool if part == "_below_floor" else float
            for name in METRICS
            for part in ("", "_low", "_high", "_below_floor")
        },
    }


_SCENE_TEXT = ("scene", "light", "material", "geometry", "view", "knob", "setting", "effects", "reference_key")


def _row(run: RunInfo, scene: SceneResult | None, cell: CellResult) -> Row:
    row: Row = dict.fromkeys(columns())
    row |= {"run": run.id, "suite": run.suite, "started": run.started, "scene": cell.scene}
    if scene is not None:
        named = ("light", "material", "geometry", "view", "points")
        row |= {name: getattr(scene, name) for name in (*named, *(("knob", "setting") if scene.knob else ()))}
        row |= {"effects": "; ".join(scene.effects), "reference_s": scene.reference_seconds}
        kept = ("key", "samples", "replicates", "floor", "rms")
        row |= {f"reference_{name}": getattr(scene, f"reference_{name}") for name in kept}
    row |= {
        "method": cell.method,
        "settings": json.dumps(cell.settings),
        "status": cell.status.value,
        "reason": cell.reason,
        "lacks": "; ".join(cell.lacks),
        "description": json.dumps(cell.description),
        "memory_bytes": cell.bytes,
        "predicted_energy_errors": json.dumps(cell.predictions),
    }
    for timing in cell.timings:
        seconds = (timing.first, timing.median, *timing.spread)
        row |= {
            f"{timing.phase}_{n}_s": s for n, s in zip(("first", "median", "fastest", "slowest"), seconds, strict=True)
        }
    for score in cell.scores:
        if score.metric in METRICS:
            row |= {score.metric: score.value, f"{score.metric}_low": score.low, f"{score.metric}_high": score.high}
            row[f"{score.metric}_below_floor"] = score.below_floor
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in row.items()}


def _whole(path: Path, write: Callable[[Path, list[Row]], None], table: list[Row]) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        part = Path(folder) / path.name
        write(part, table)
        part.replace(path)


def _csv(path: Path, table: list[Row]) -> None:
    import csv

    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns())
        writer.writeheader()
        writer.writerows(table)


def _json(path: Path, table: list[Row]) -> None:
    def finite(value: Any) -> Any:
        return None if isinstance(value, float) and math.isinf(value) else value  # JSON has no infinity

    lines = [{name: finite(value) for name, value in row.items()} for row in table]
    path.write_text(json.dumps(lines, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _parquet(path: Path, table: list[Row]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    schema = pa.schema([(name, kinds[kind]) for name, kind in columns().items()])
    pq.write_table(pa.Table.from_pylist(table, schema=schema), path)


_WRITERS: dict[str, Callable[[Path, list[Row]], None]] = {".csv": _csv, ".json": _json, ".parquet": _parquet}
