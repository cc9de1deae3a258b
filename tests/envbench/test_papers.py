"""`envbench paper`: what is run, what is found in the store, and what stands in for absent data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from envbench.records import RunInfo, Study
from envbench.store import Store
from tests.envbench.conftest import call

ITEM = """
item = "Equation 23"
title = "The thin membrane in closed form"
source = "A tiny paper"
study = "{study}"
substitute = "thin-membrane"
text = "Closed form."
[[values]]
what = "under constant light"
where = {{ alpha = 0.3, n = 6 }}
column = "under constant light"
printed = 1.3
kind = "exact"
tolerance = 1e-12
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Give a user's folder with a paper of one item."""
    folder = tmp_path / "own"
    for name, study in (("tiny", "thin-membrane"), ("needy", "curet-accuracy")):
        (folder / "papers" / name).mkdir(parents=True)
        (folder / "papers" / name / "equation-23.toml").write_text(ITEM.format(study=study))
    return folder


def test_a_paper_is_run_once_and_then_found_in_the_store(own: Path) -> None:
    out = own / "out"
    code, said, err = call("paper", "tiny", "--root", own, "--out", out)
    assert (code, err) == (0, "")
    assert "suite 'paper-tiny'" in said
    assert "tiny: 1 agrees" in said
    assert said.splitlines()[-1] == f"pages: {out / 'papers' / 'index.html'}"
    files = {path: path.read_bytes() for path in sorted((out / "papers").rglob("*")) if path.is_file()}
    assert {path.name for path in files} >= {"index.html", "tiny.html", "equation-23.tex", "equation-23.csv"}

    code, said, _ = call("paper", "tiny", "--root", own, "--out", out)
    assert code == 0
    assert "suite" not in said
    assert "study thin-membrane: from run" in said
    assert "--again recomputes" in said
    assert {path: path.read_bytes() for path in files} == files
    with Store.open(out / "envbench.sqlite") as store:
        assert len(store.runs()) == 1

    call("paper", "tiny", "--root", own, "--out", out, "--again")
    with Store.open(out / "envbench.sqlite") as store:
        assert len(store.runs()) == 2


def test_absent_data_are_asked_for_and_the_substitute_is_named(own: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("ENVBENCH_DATA", str(tmp_path / "nowhere"))
    out = own / "out"
    code, said, _ = call("paper", "needy", "--root", own, "--out", out)
    assert code == 0
    assert "needy: 1 needs data" in said
    page = " ".join((out / "papers" / "needy.html").read_text().split())
    assert "is neither there nor in the data folder: set ENVBENCH_DATA" in page
    assert "In its place: study &#39;thin-membrane&#39; (The thin membrane" in page
    assert "1.30" in page


def test_an_unknown_paper_is_told_in_a_line(own: Path) -> None:
    code, _, err = call("paper", "tinny", "--root", own, "--out", own / "out")
    assert code == 2
    assert "unknown paper 'tinny': did you mean 'tiny'?" in err


def test_a_study_that_failed_ends_with_1_and_is_tried_again(own: Path) -> None:
    (own / "papers" / "tiny" / "equation-23.toml").write_text(ITEM.format(study="thin-membrane").replace("0.3", "0.4"))
    code, said, _ = call("paper", "tiny", "--root", own, "--out", own / "out")
    assert code == 1
    assert "no row with alpha = 0.4, n = 6" in said


def test_a_study_that_does_not_exist_is_refused_before_anything_is_run(own: Path) -> None:
    (own / "papers" / "tiny" / "equation-23.toml").write_text(ITEM.format(study="thin-membran"))
    code, _, err = call("paper", "tiny", "--root", own, "--out", own / "out")
    assert code == 2
    assert "unknown study 'thin-membran': did you mean 'thin-membrane'?" in err


def test_the_newest_result_counts_whatever_it_is(tmp_path: Path) -> None:
    def table(reason: str = "") -> Study:
        return replace(Study("a", "t", "", ("x",), ((1,),)), reason=reason)

    with Store.open(tmp_path / "s.sqlite", create=True) as store:
        for number, study in enumerate((table(), table("timed out")), 1):
            store.begin(RunInfo(f"run-{number}", "paper-x", "", "", {}, {"envbench": f"0.1.0 (git {number})"}))
            store.save_study(f"run-{number}", study)
        found = store.newest_studies(("a", "b"))
    assert list(found) == ["a"]
    study, run = found["a"]
    assert (study.reason, run.id, run.commit) == ("timed out", "run-2", "2")


def test_without_git_the_commit_is_unknown() -> None:
    run = RunInfo("r", "s", "", "", {}, {"envbench": "0.1.0"})
    assert run.commit == "unknown"
    assert replace(run, versions={"envbench": "0.1.0 (git 0123456789ab-dirty)"}).commit == "0123456789ab-dirty"
