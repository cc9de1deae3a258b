"""Pages of papers: one HTML file a paper and one that links them; LaTeX and CSV of each item beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from envbench.papers import Found
from reports import numerals
from reports.page import environment, replaced, style
from reports.papers import latex
from reports.papers.figures import figure
from reports.papers.items import Paper
from reports.papers.terminal import counted, printed
from reports.papers.verdicts import Judged, JudgedPaper, MissingEntry, judge, worded
from reports.plots import packed_plotly
from reports.studies import StudyTable, studies

INDEX = "index.html"


@dataclass(frozen=True)
class Shown:
    """An item as its page shows it: figures by title (None and a reason where one cannot be drawn)."""

    judged: Judged
    figures: tuple[tuple[str, dict[str, Any] | None, str], ...]
    table: StudyTable | None


def write(papers: Sequence[tuple[Paper, Mapping[str, Found]]], folder: Path) -> Path:
    """Write the pages of papers of which something was run, and the index; return the index.

    Each item has a LaTeX file, a CSV file of its comparisons and one of its study's table beside the page. Nothing in
    them but what was stored: written again from one store, all files are the same.
    """
    from markupsafe import Markup

    written = [judge(paper, found) for paper, found in papers if found]
    template = environment().get_template("paper.html")
    plotly, sheet = Markup(packed_plotly()), style()
    for judged in written:
        beside = folder / judged.paper.name
        for entry in judged.items:
            replaced(beside / f"{entry.item.slug}.tex", latex.latex(entry))
            replaced(beside / f"{entry.item.slug}.csv", latex.comparisons(entry))
            if entry.found:
                replaced(beside / f"{entry.item.slug}-study.csv", latex.table(entry))
        page = template.render(
            paper=judged.paper, counts=counted(judged), items=list(map(_shown, judged.items)), runs=_runs(judged),
            worded=worded, printed=printed, plotly=plotly, data=Markup(_data(judged)), style=sheet,
        )  # fmt: skip
        replaced(folder / f"{judged.paper.name}.html", page)
    left = [paper for paper, found in papers if not found]
    index = environment().get_template("papers.html").render(papers=written, counted=counted, left=left, style=sheet)
    return replaced(folder / INDEX, index)


def _shown(judged: Judged) -> Shown:
    if judged.found is None:
        return Shown(judged, (), None)
    return Shown(judged, tuple(_figures(judged)), studies([judged.found.study])[0])


def _figures(judged: Judged) -> list[tuple[str, dict[str, Any] | None, str]]:
    assert judged.found is not None
    drawn: list[tuple[str, dict[str, Any] | None, str]] = []
    for plot in judged.item.plots if judged.found.study.rows else ():
        try:
            drawn.append((plot.title, figure(plot, judged.found), ""))
        except MissingEntry as missing:
            drawn.append((plot.title, None, str(missing)))
    return drawn


def _data(judged: JudgedPaper) -> str:
    """Return all figures by "item number": JSON that may stand in a script element."""
    drawn = {
        f"{i}-{k}": found
        for i, entry in enumerate(judged.items)
        if entry.found
        for k, (_, found, _) in enumerate(_figures(entry))
        if found
    }
    return json.dumps(drawn, ensure_ascii=False).replace("</", "<\\/")


def _runs(judged: JudgedPaper) -> list[tuple[str, str, str, str]]:
    """Return the runs behind a page: id, commit, when, where."""
    runs = {entry.found.run.id: entry.found.run for entry in judged.items if entry.found}
    return [
        (run.id, run.commit, numerals.moment(run.started), str(run.machine.get("cpu", ""))) for run in runs.values()
    ]
