"""The store: one SQLite file in which every finished cell is safe from the moment it is done.

Write-ahead logging with ``synchronous = FULL``: what was committed survives a killed process and a power cut, and a
report can read while a run writes. `envbench.schema` holds the tables.
"""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Collection, Generator
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envbench.database import connect, migrate, transaction, worded
from envbench.errors import BadInput
from envbench.records import (
    CellResult,
    Film,
    MaterialSheet,
    Phase,
    Picture,
    RunInfo,
    SceneResult,
    Score,
    Status,
    Study,
    Timing,
)
from envbench.scene import Basis, Decision, Effect


class Store:
    """Runs with their scenes and cells. Each saving method is one transaction; reading returns what was saved.

    Raises
    ------
    BadInput
        From every method: the file cannot be read or written; one line says why and what to do.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._db = connection

    @classmethod
    def open(cls, path: Path | str, *, create: bool = False) -> Self:
        """Open the store at `path`, bringing an older schema up to date.

        Parameters
        ----------
        create : bool
            Make the store, and its folder, if absent; and insist that it can be written.
        """
        path = Path(path)
        with worded(path):
            if create:
                path.parent.mkdir(parents=True, exist_ok=True)
            connection = connect(path, create)
            try:
                migrate(path, connection, create)
            except BaseException:
                connection.close()
                raise
            return cls(path, connection)

    def close(self) -> None:
        """Close the file; what was saved is there anyway."""
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    # Saving

    def begin(self, run: RunInfo) -> None:
        """Save a run that starts."""
        with self._transaction():
            if self._db.execute("SELECT 1 FROM run WHERE id = ?", (run.id,)).fetchone():
                raise BadInput(f"run '{run.id}' is in {self.path} already: resume it, or give the new run another id.")
            self._insert("run", {f.name: getattr(run, f.name) for f in fields(run)})

    def save_scene(self, run_id: str, scene: SceneResult) -> None:
        """Save a scene of a run; one of the same name is replaced."""
        row = {f.name: getattr(scene, f.name) for f in fields(scene) if f.name != "image"}
        row |= {"run_id": run_id, "decisions": [asdict(entry) for entry in scene.decisions], **_pack(scene.image)}
        with self._transaction():
            self._db.execute("DELETE FROM scene WHERE run_id = ? AND name = ?", (run_id, scene.name))
            self._insert("scene", row)

    def save_cell(self, run_id: str, cell: CellResult) -> None:
        """Save a finished cell with timings, scores and image; one of the same key is replaced."""
        apart = {"timings", "scores", "image"}
        row = {f.name: getattr(cell, f.name) for f in fields(cell) if f.name not in apart}
        row |= {"run_id": run_id, **_pack(cell.image)}
        with self._transaction():
            self._db.execute("DELETE FROM cell WHERE run_id = ? AND key = ?", (run_id, cell.key))
            number = self._insert("cell", row)
            for timing in cell.timings:
                seconds = {"first_seconds": timing.first, "median_seconds": timing.median, "rounds": timing.rounds}
                self._insert("timing", {"cell_id": number, "phase": timing.phase, **seconds, "shared": timing.shared})
            for score in cell.scores:
                self._insert("score", {"cell_id": number, **{f.name: getattr(score, f.name) for f in fields(score)}})

    def save_sheet(self, run_id: str, sheet: MaterialSheet) -> None:
        """Save what is known of a material; one of the same name is replaced."""
        with self._transaction():
            self._db.execute("DELETE FROM material WHERE run_id = ? AND name = ?", (run_id, sheet.name))
            self._insert("material", {"run_id": run_id, "name": sheet.name, "sheet": asdict(sheet)})

    def save_study(self, run_id: str, study: Study) -> None:
        """Save a table that belongs to no scene and method; one of the same name is replaced."""
        with self._transaction():
            self._db.execute("DELETE FROM study WHERE run_id = ? AND name = ?", (run_id, study.name))
            self._db.execute("DELETE FROM picture WHERE run_id = ? AND study = ?", (run_id, study.name))
            table = {f.name: getattr(study, f.name) for f in fields(study) if f.name != "pictures"}
            self._insert("study", {"run_id": run_id, "name": study.name, "study": table})
            for picture in study.pictures:
                self._insert("picture", {"run_id": run_id, "study": study.name, **vars(picture)})

    def save_film(self, run_id: str, film: Film) -> None:
        """Save an animation; one of the same name is replaced."""
        with self._transaction():
            self._db.execute("DELETE FROM animation WHERE run_id = ? AND name = ?", (run_id, film.name))
            self._insert("animation", {"run_id": run_id, **{f.name: getattr(film, f.name) for f in fields(film)}})

    def finish(self, run_id: str, finished: str, wall_seconds: float, overhead_seconds: float) -> None:
        """Save how a run ended: `finished` is a time in ISO 8601."""
        with self._transaction():
            self._db.execute(
                "UPDATE run SET finished = ?, wall_seconds = ?, overhead_seconds = ? WHERE id = ?",
                (finished, wall_seconds, overhead_seconds, run_id),
            )

    # Reading

    def runs(self) -> list[RunInfo]:
        """Return all runs, newest last."""
        return [_run(row) for row in self._rows("SELECT * FROM run ORDER BY number")]

    def run(self, ref: str) -> RunInfo:
        """Return the run that `ref` means: an id, the beginning of just one id, or "latest"."""
        runs = self.runs()
        if not runs:
            raise BadInput(f"{self.path} holds no run yet: make one with 'envbench run'.")
        if ref == "latest":
            return runs[-1]
        found = [run for run in runs if run.id == ref] or [run for run in runs if ref and run.id.startswith(ref)]
        if len(found) == 1:
            return found[0]
        what = "is the beginning of more than one run" if found else "is no run"
        newest = [run.id for run in reversed(found or runs)]
        listed = ", ".join(newest[:10]) + (f" and {len(newest) - 10} more" if len(newest) > 10 else "")
        raise BadInput(f"'{ref}' {what} of {self.path}: say 'latest' or one of {listed}.")

    def scenes(self, run_id: str) -> list[SceneResult]:
        """Return the scenes of a run in the order of its plan."""
        return [_scene(row) for row in self._rows("SELECT * FROM scene WHERE run_id = ? ORDER BY position, id", run_id)]

    def scene_names(self, run_id: str) -> list[str]:
        """Return the names of `scenes` without reading their images."""
        names = "SELECT name FROM scene WHERE run_id = ? ORDER BY position, id"
        return [row["name"] for row in self._rows(names, run_id)]

    def cells(self, run_id: str) -> list[CellResult]:
        """Return the cells of a run, by the places of their scenes and then as they were saved."""
        of_run = "SELECT {} FROM {} JOIN cell ON cell.id = cell_id WHERE run_id = ? ORDER BY {}.rowid"
        timings: dict[int, list[Timing]] = {}
        for row in self._rows(of_run.format("timing.*", "timing", "timing"), run_id):
            rounds = tuple(json.loads(row["rounds"]))
            timing = Timing(Phase(row["phase"]), row["first_seconds"], rounds, bool(row["shared"]))
            timings.setdefault(row["cell_id"], []).append(timing)
        scores: dict[int, list[Score]] = {}
        for row in self._rows(of_run.format("score.*", "score", "score"), run_id):
            scores.setdefault(row.pop("cell_id"), []).append(_score(row))
        rows = self._rows(
            """SELECT cell.* FROM cell
               LEFT JOIN scene ON scene.run_id = cell.run_id AND scene.name = cell.scene
               WHERE cell.run_id = ? ORDER BY scene.id IS NULL, scene.position, cell.id""",
            run_id,
        )
        return [_cell(row, tuple(timings.get(row["id"], ())), tuple(scores.get(row["id"], ()))) for row in rows]

    def sheets(self, run_id: str) -> list[MaterialSheet]:
        """Return what is known of the run's materials, in the order in which they were saved."""
        rows = self._rows("SELECT sheet FROM material WHERE run_id = ? ORDER BY id", run_id)
        return [MaterialSheet(**_fields(json.loads(row["sheet"]))) for row in rows]

    def studies(self, run_id: str) -> list[Study]:
        """Return the studies of a run, in the order in which they were saved."""
        rows = self._rows("SELECT study FROM study WHERE run_id = ? ORDER BY id", run_id)
        drawn: dict[str, list[Picture]] = {}
        for row in self._rows("SELECT study, name, caption, png FROM picture WHERE run_id = ? ORDER BY id", run_id):
            drawn.setdefault(row.pop("study"), []).append(Picture(**row))
        found = [Study(**_fields(json.loads(row["study"]))) for row in rows]
        return [replace(study, pictures=tuple(drawn.get(study.name, ()))) for study in found]

    def newest_studies(self, names: Collection[str]) -> dict[str, tuple[Study, RunInfo]]:
        """Return the newest result of each study that some run holds, with its run, in the order of `names`."""
        newest = """SELECT run.id FROM study JOIN run ON run.id = run_id WHERE study.name = ?
                    ORDER BY run.number DESC LIMIT 1"""
        of = {name: row["id"] for name in names for row in self._rows(newest, name)}
        runs = {run.id: run for run in self.runs()}
        made = {run_id: {study.name: study for study in self.studies(run_id)} for run_id in set(of.values())}
        return {name: (made[run_id][name], runs[run_id]) for name, run_id in of.items()}

    def films(self, run_id: str) -> list[Film]:
        """Return the animations of a run, in the order in which they were saved."""
        return [_film(row) for row in self._rows("SELECT * FROM animation WHERE run_id = ? ORDER BY id", run_id)]

    def finished_keys(self, run_id: str) -> set[str]:
        """Return the keys of all saved cells, whatever their status: what a resumed run need not repeat."""
        return {row["key"] for row in self._rows("SELECT key FROM cell WHERE run_id = ?", run_id)}

    @contextmanager
    def _transaction(self) -> Generator[None]:
        with worded(self.path), transaction(self._db):
            yield

    def _insert(self, table: str, row: dict[str, Any]) -> int | None:
        marks = ", ".join("?" * len(row))
        values = [_encode(value) for value in row.values()]
        return self._db.execute(f"INSERT INTO {table} ({', '.join(row)}) VALUES ({marks})", values).lastrowid

    def _rows(self, query: str, *values: str) -> list[dict[str, Any]]:
        with worded(self.path):
            return [dict(row) for row in self._db.execute(query, values)]


def _encode(value: Any) -> Any:
    if isinstance(value, dict | list | tuple):
        return json.dumps(value, default=_plain)
    return value.item() if isinstance(value, np.generic) else value


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else str(value)


def _pack(image: NDArray[np.float32] | None) -> dict[str, Any]:
    if image is None:
        return {}
    height, width, _ = image.shape
    return {"image_height": height, "image_width": width, "image": zlib.compress(image.astype("<f4").tobytes(), 1)}


def _unpack(row: dict[str, Any]) -> NDArray[np.float32] | None:
    height, width, blob = (row.pop(name) for name in ("image_height", "image_width", "image"))
    if blob is None:
        return None
    return np.frombuffer(zlib.decompress(blob), "<f4").astype(np.float32).reshape(height, width, 3)


def _defined(row: dict[str, Any], *names: str) -> dict[str, Any]:
    return row | {name: float("nan") for name in names if row[name] is None}  # SQLite stores NaN as NULL


def _run(row: dict[str, Any]) -> RunInfo:
    del row["number"]
    row |= {name: json.loads(row[name]) for name in ("machine", "versions")}
    return RunInfo(**row)


def _scene(row: dict[str, Any]) -> SceneResult:
    image = _unpack(row)
    del row["id"], row["run_id"]
    row |= {"specs": json.loads(row["specs"]), "reference_from_cache": bool(row["reference_from_cache"])}
    row |= {name: tuple(json.loads(row[name])) for name in ("effects", "notes")}
    row = _defined(row, *(f"reference_{name}" for name in ("floor", "target", "seconds", "rms")))
    row["decisions"] = tuple(map(_decision, json.loads(row["decisions"])))
    return SceneResult(**row, image=image)


def _decision(row: dict[str, Any]) -> Decision:
    row |= {"effect": Effect(row["effect"]), "basis": Basis(row["basis"])}
    return Decision(**row)


def _fields(row: dict[str, Any]) -> dict[str, Any]:
    return {name: _tuples(value) for name, value in row.items()}


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _film(row: dict[str, Any]) -> Film:
    del row["id"], row["run_id"]
    row |= {"notes": tuple(json.loads(row["notes"]))}
    return Film(**_defined(row, "seconds"))


def _score(row: dict[str, Any]) -> Score:
    row |= {"below_floor": bool(row["below_floor"]), "jackknife": tuple(json.loads(row["jackknife"]))}
    return Score(**_defined(row, "value", "low", "high"))


def _cell(row: dict[str, Any], timings: tuple[Timing, ...], scores: tuple[Score, ...]) -> CellResult:
    image = _unpack(row)
    del row["id"], row["run_id"]
    row |= {name: json.loads(row[name]) for name in ("settings", "description", "predictions")}
    row |= {"lacks": tuple(json.loads(row["lacks"])), "status": Status(row["status"])}
    return CellResult(**row, timings=timings, scores=scores, image=image)
