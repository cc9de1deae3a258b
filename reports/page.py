"""The page: all that a run's records say, rendered through one template and written in one piece."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from envbench.errors import BadInput
from envbench.metrics import METRICS
from envbench.records import CellResult, Film, MaterialSheet, RunInfo, SceneResult, Status, Study
from envbench.stability import FACTOR, LEVEL
from envbench.store import Store
from reports import numerals
from reports.animations import reels
from reports.claims import claims
from reports.effects import effects, warnings
from reports.hard import hard_cases
from reports.materials import PAPER_ABOVE, PAPER_SAMPLES, PAPER_WORST, materials
from reports.measured import CLOSE, held
from reports.pictures import colour_bar, gallery, thinning
from reports.plots import marks, packed_plotly, plot_data
from reports.studies import studies
from reports.table import cause, nrmse, table
from reports.verdict import LEVELS, SITUATIONS, competitions, glance, score, settings_text, varied, verdicts

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Trouble:
    """A status other than ok with its reason, and the scenes on which a method ended so."""

    status: Status
    method: str
    settings: str
    reason: str
    scenes: tuple[str, ...]


def write(store: Store, run_ref: str, path: Path) -> Path:
    """Write the report of a run to one HTML file that opens offline.

    The file is replaced in one step: a reader sees the old report or the new one, never half of one.

    Parameters
    ----------
    run_ref : str
        A run's id, a unique prefix of one, or ``latest``.

    Returns
    -------
    Path
        `path`, absolute.

    Raises
    ------
    BadInput
        For an unknown run, or a place that cannot be written.
    """
    return replaced(path, render(store, run_ref))


def replaced(path: Path, page: str) -> Path:
    """Write a text file in one step, its folder too if need be; return its path, absolute."""
    path = path.absolute()
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            part.write_text(page, encoding="utf-8", errors="replace")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise BadInput(f"cannot write '{path}': {error.strerror or error}. Name a writable file.") from error
    return path


def render(store: Store, run_ref: str) -> str:
    """Return the report of a run as HTML; raises `BadInput` for an unknown run."""
    run = store.run(run_ref)
    beside = store.sheets(run.id), store.studies(run.id), store.films(run.id)
    return _fill(run, store.scenes(run.id), store.cells(run.id), *beside)


def environment() -> Environment:
    """Return what renders the templates, with the filters that word numbers."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    found = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters.update(
        three=numerals.three,
        percent=numerals.percent,
        seconds=numerals.seconds,
        moment=numerals.moment,
        json=lambda value: json.dumps(value, ensure_ascii=False, default=str),
    )
    return found


def style() -> Markup:
    """Return the style sheet of all pages."""
    from markupsafe import Markup

    return Markup((_TEMPLATES / "report.css").read_text(encoding="utf-8"))


def _fill(
    run: RunInfo,
    scenes: Sequence[SceneResult],
    cells: Sequence[CellResult],
    sheets: Sequence[MaterialSheet],
    tables: Sequence[Study],
    films: Sequence[Film],
) -> str:
    from markupsafe import Markup

    step = thinning([cell.image for cell in cells])
    by_scene: dict[str, list[CellResult]] = {scene.name: [] for scene in scenes}
    for cell in cells:
        by_scene.get(cell.scene, []).append(cell)
    found, looks = verdicts(scenes, cells), marks(cells)
    return (
        environment()
        .get_template("report.html")
        .render(
            run=run,
            scenes=scenes,
            cells=cells,
            machine=_machine(run.machine),
            counts=_counts(cells),
            orphans=sorted({cell.scene for cell in cells} - set(by_scene)),
            levels=LEVELS,
            situations=SITUATIONS,
            verdicts=(contested := competitions(found)),
            alone=[verdict for verdict in found if verdict not in contested],
            glance=glance(found),
            hard=hard_cases(scenes, cells, looks),
            hard_factor=FACTOR,
            hard_level=LEVEL,
            claims=claims(run.suite_text, scenes, cells),
            held=held(scenes, cells),
            close=CLOSE,
            materials=materials(sheets),
            studies=studies(tables),
            reels=reels(films),
            paper=(PAPER_ABOVE, PAPER_SAMPLES, PAPER_WORST),
            marks=looks,
            table=table(scenes, cells),
            selectors=_selectors(scenes),
            choosers=_choosers(scenes),
            galleries=[
                picture for i, scene in enumerate(scenes) if (picture := gallery(i, scene, by_scene[scene.name], step))
            ],
            colour_bar=Markup(colour_bar()),
            troubles=_troubles(cells),
            metrics=METRICS.values(),
            nrmse_of=_nrmse_of,
            cause_of=cause,
            effects=effects(scenes),
            warnings=warnings,
            settings_text=settings_text,
            data=plot_data(scenes, cells),
            style=style(),
            script=Markup((_TEMPLATES / "report.js").read_text(encoding="utf-8")),
            plotly=Markup(packed_plotly()),
        )
    )


def _machine(machine: Mapping[str, Any]) -> str:
    """Word a machine in one sentence, of what is known about it."""
    words = {
        "cpu": lambda value: str(value),
        "cores": lambda value: f"{value} cores",
        "threads": lambda value: f"threads ({_listed(value)})",
        "memory_bytes": lambda value: numerals.size(value),
        "os": lambda value: str(value),
    }
    return ", ".join(word(machine[name]) for name, word in words.items() if machine.get(name) is not None)


def _listed(value: Any) -> str:
    return ", ".join(f"{name} {count}" for name, count in value.items()) if isinstance(value, dict) else str(value)


def _counts(cells: Sequence[CellResult]) -> dict[Status, int]:
    return {status: count for status in Status if (count := sum(cell.status is status for cell in cells))}


def _selectors(scenes: Sequence[SceneResult]) -> dict[str, list[str]]:
    names = ("light", "material", *varied(scenes, ("geometry", "view")))
    return {name: list(dict.fromkeys(getattr(scene, name) for scene in scenes)) for name in names}


def _choosers(scenes: Sequence[SceneResult]) -> dict[str, list[str]]:
    """Return what chooses a scene: the parts of those that are no step of a hard case, and the steps by knob."""
    plain = [scene for scene in scenes if not scene.knob]
    turned = [scene for scene in scenes if scene.knob]
    chosen = _selectors(plain) if plain else {}
    for name in ("knob", "setting") if turned else ():
        values = list(dict.fromkeys(getattr(scene, name) for scene in turned))
        chosen[name] = ["", *values] if plain else values
    return chosen


def _troubles(cells: Sequence[CellResult]) -> list[Trouble]:
    """Gather the cells that are not ok by what happened, so that one cause reads as one line."""
    groups: dict[tuple[Status, str, str, str], list[str]] = {}
    for cell in cells:
        if cell.status is not Status.OK:
            groups.setdefault((cell.status, cell.method, settings_text(cell), cell.reason), []).append(cell.scene)
    return [Trouble(*key, tuple(names)) for key, names in groups.items()]


def _nrmse_of(cell: CellResult) -> str:
    entry = score(cell, "nrmse")
    return nrmse(cell, entry).text if entry else "not scored"
