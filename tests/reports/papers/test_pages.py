"""Pages, LaTeX and CSV: all that was judged is in them, escaped, and twice the same."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import plotly.graph_objects as go

from envbench.papers import Found
from envbench.records import Picture, Study
from reports.papers import latex, show, write
from reports.papers.items import Paper
from tests.reports.papers.conftest import RUN, study

ITEM = """
[[values]]
what = "error_1 at 100 %"
column = "rms"
printed = 0.05
kind = "claim"
rule = "at most"
why = "<b>noise</b>"

[[plots]]
title = "Errors"
x = "N"
y = ["rms", "seconds"]
log = "y"
printed = [{ name = "printed", x = [2], y = [0.05] }]

[[plots]]
title = "By parity"
x = "N"
y = ["rms"]
by = "parity"
style = "bars"

[[plots]]
title = "Of nothing"
x = "M"
y = ["rms"]
"""


def written(make, folder: Path, drawn: Study | None = None) -> dict[str, str]:
    paper = Paper("tiny", "A tiny <paper>", "old hardware", (make(ITEM),))
    other = Paper("other", "Another", "", (make(ITEM),))
    found = drawn or study()
    index = write([(paper, {"errors": Found(found, RUN)}), (other, {})], folder)
    assert index == (folder / "index.html").absolute()
    return {str(path.relative_to(folder)): path.read_text() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_a_page_a_paper_and_the_tables_of_each_item(make, tmp_path: Path) -> None:
    files = written(make, tmp_path / "out")
    tables = {f"tiny/table-1{end}" for end in (".csv", "-study.csv", ".tex")}
    assert set(files) == {"index.html", "tiny.html"} | tables
    page = files["tiny.html"]
    assert "A tiny &lt;paper&gt;" in page
    assert "&lt;b&gt;noise&lt;/b&gt;" in page
    assert "<b>noise" not in page
    assert "run 20250301-101500-ab12, study errors, row 1, column rms, commit 0123456789ab" in page
    assert "old hardware" in page
    assert "has no column &#39;M&#39;" in page
    assert not re.findall(r"(?:src|href)=\"(?:https?:)?//", page)
    assert "./bench paper other" in files["index.html"]
    for linked in re.findall(r'href="([^"#]+)(?:#[^"]*)?"', page + files["index.html"]):
        assert linked in files or linked == "data:,"


def test_figures_have_our_curves_and_the_printed_points(make, tmp_path: Path) -> None:
    page = written(make, tmp_path / "out")["tiny.html"]
    told = re.search(r'id="figures">(.*?)</script>', page, re.DOTALL)
    assert told
    figures = json.loads(told[1])
    assert set(figures) == {"0-0", "0-1"}
    first, second = figures["0-0"], figures["0-1"]
    assert [trace["name"] for trace in first["data"]] == ["rms", "seconds", "printed"]
    assert first["data"][0]["y"] == [0.08, 0.04, 0.08 / 3, 0.02]
    assert first["layout"]["yaxis"]["type"] == "log"
    assert [(trace["name"], trace["x"]) for trace in second["data"]] == [("odd", [1, 3]), ("even", [2, 4])]
    for figure in figures.values():
        go.Figure(figure)  # refuses what Plotly does not know
    for key in figures:
        assert f'data-figure="{key}"' in page


def test_pictures_of_the_study_are_shown(make, tmp_path: Path) -> None:
    base = study()
    drawn = Study(
        base.name, base.title, base.text, base.columns, base.rows, pictures=(Picture("one", "Spheres", b"png"),)
    )
    assert 'src="data:image/png;base64,cG5n" alt="Spheres"' in written(make, tmp_path, drawn)["tiny.html"]


def test_written_twice_it_is_the_same(make, tmp_path: Path) -> None:
    assert written(make, tmp_path / "a") == written(make, tmp_path / "b")


def test_csv_holds_every_number_unrounded_with_its_origin(make, tmp_path: Path) -> None:
    files = written(make, tmp_path)
    (row,) = csv.DictReader(io.StringIO(files["tiny/table-1.csv"]))
    assert (float(row["ours"]), float(row["printed"]), row["verdict"]) == (0.08, 0.05, "differs")
    assert row["from"].endswith("commit 0123456789ab")
    rows = list(csv.DictReader(io.StringIO(files["tiny/table-1-study.csv"])))
    assert [float(one["rms"]) for one in rows] == [0.08 / n for n in (1, 2, 3, 4)]
    assert {(one["run"], one["commit"]) for one in rows} == {(RUN.id, "0123456789ab")}
    assert [one["row"] for one in rows] == ["1", "2", "3", "4"]


def test_latex_is_booktabs_and_escaped(make, tmp_path: Path) -> None:
    text = written(make, tmp_path)["tiny/table-1.tex"]
    assert text.count(r"\toprule") == text.count(r"\bottomrule") == text.count(r"\end{table}") == 2
    assert r"error\_1 at 100 \%" in text
    assert r"Errors \& more" in text
    body = [line for line in text.splitlines() if not line.startswith("%")]
    assert all(ord(character) < 128 for line in body for character in line)
    for table in text.split(r"\begin{tabular}")[1:]:
        columns = len(re.sub(r"\{\d+cm\}", "", table[1 : table.index("}\n")]))
        rows = [line for line in table.splitlines() if line.endswith(r"\\")]
        assert {len(re.findall(r"(?<!\\)&", row)) + 1 for row in rows} == {columns}


def test_every_character_that_latex_minds_is_escaped() -> None:
    assert latex.escaped(r"\&%$#_{}~^") == (r"\textbackslash{}\&\%\$\#\_\{\}\textasciitilde{}\textasciicircum{}")
    assert latex.escaped("1.50×10⁻⁷ – −2") == r"1.50$\times$10$^{-7}$ -- $-$2"


def test_the_terminal_says_verdicts_and_by_how_much(make, capsys) -> None:
    paper = Paper("tiny", "A tiny paper", "old hardware", (make(ITEM),))
    assert show(paper, {"errors": Found(study(), RUN)})
    out = capsys.readouterr().out
    assert "Table 1  Errors & more" in out
    assert "at most 0.05. by 0.0300, +60.0%; <b>noise</b>" in out
    assert "tiny: 1 differs; printed on old hardware" in out
    assert not show(paper, {})
