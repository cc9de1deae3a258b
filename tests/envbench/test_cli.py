"""The command line, from `run` to `gate`, and how fast it answers."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from tests.envbench.conftest import SCENE, UserFolder, call


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[UserFolder, int, str]:
    """Give a folder in which a suite was run, with the exit code and the output of that."""
    user = UserFolder(tmp_path_factory.mktemp("cli") / "own")
    user.method("exact")
    user.method("wrong", "raise ValueError('no\\n  idea')")
    user.file("wreck", "import nonesuch\n")
    user.suite("pair", '[[methods]]\nname = "exact"\nfactor = [1.0, 1.5]\n[[methods]]\nname = "wrong"')
    code, out, err = call("run", "pair", "--root", user.path, "--out", user.path / "out", "--rounds", 2)
    assert err == ""
    return user, code, out


def test_a_run_with_a_failed_cell_ends_with_1_and_says_what_came_of_it(done) -> None:
    user, code, out = done
    assert code == 1
    lines = out.splitlines()
    assert any(line.startswith("warning, ") and "nonesuch" in line for line in lines)
    assert any(f"{SCENE}  wrong  failed: ValueError: no idea (wrong.py:" in line for line in lines)
    assert any(f"{SCENE}  exact(factor=1.5)  ok" in line for line in lines)
    assert f"report: {user.path / 'out' / 'report.html'}" in lines
    assert "2 ok, 1 failed" in lines[-1]
    assert "the harness itself" in lines[-1]
    assert (user.path / "out" / "report.html").read_text().startswith("<!")


def test_resuming_a_finished_run_computes_nothing(done) -> None:
    user, _, _ = done
    arguments = ("run", "pair", "--resume", "--no-report", "--root", user.path, "--out", user.path / "out")
    code, out, _ = call(*arguments)
    assert code == 1
    assert "nothing to resume" in out


def test_show_report_export_and_gate_read_what_was_stored(done, tmp_path: Path) -> None:
    user, _, _ = done
    out = ("--out", user.path / "out")
    code, text, _ = call("show", "latest", *out, "--metric", "nrmse", "--metric", "max_error")
    assert code == 0
    assert SCENE in text
    assert "exact(factor=1.5)" in text
    assert "ValueError: no idea" in text
    assert call("report", "latest", *out)[0] == 0
    assert call("export", "latest", tmp_path / "run.json", *out)[0] == 0
    assert len(json.loads((tmp_path / "run.json").read_text())) == 3
    code, text, _ = call("gate", "latest", "--baseline", "latest", *out)
    assert code == 0, text
    assert text.strip()


@pytest.mark.parametrize(
    ("kind", "there"),
    [
        ("methods", "shrm"),
        ("scenes", "esplanade/phong/sphere/front"),
        ("suites", "quick"),
        ("metrics", "nrmse"),
        ("lights", "studio"),
        ("materials", "microfacet"),
    ],
)
def test_list(kind: str, there: str) -> None:
    code, text, _ = call("list", kind)
    assert code == 0
    assert there in text


def test_help_costs_little() -> None:
    """At most .3 s of processor time, whatever else the machine does; twice as much is no one's accident."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = "from envbench.cli import main; main()"
    subprocess.run([sys.executable, "-c", code, "--help"], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.3
    heavy = "import sys, envbench.cli; sys.exit(bool({'numpy', 'rich', 'mitsuba', 'pydantic'} & set(sys.modules)))"
    subprocess.run([sys.executable, "-c", heavy], check=True)
