"""The doctor: what it finds, and that what is missing comes with a remedy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from envbench import doctor
from envbench.doctor import Finding
from envbench.scene import Scene
from tests.envbench.conftest import call


def test_a_machine_that_runs_the_tests_is_well(tmp_path: Path) -> None:
    code, text, _ = call("doctor", "--out", tmp_path)
    assert code == 0, text
    for what in ("LLVM library", "Mitsuba llvm_ad_rgb", "Mitsuba scalar_rgb", "EGL", "references", "mitsuba", "python"):
        assert what in text


def test_what_is_missing_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    lost = Finding("LLVM", "nowhere", ok=False, needed=True, remedy="install it")
    monkeypatch.setattr(doctor, "trials", lambda: iter([lost]))
    code, text, _ = call("doctor", "--out", tmp_path)
    assert code == 3
    assert any("MISSING" in line and "install it" in line for line in text.splitlines())


@pytest.mark.parametrize(("difference", "expected"), [(1e-5, 0), (1e-3, 3)])
def test_references_that_differ_are_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, difference: float, expected: int
) -> None:
    from references import agreement

    def table(scenes: list[Scene]) -> list[agreement.Agreement]:
        return [agreement.Agreement(scene.name, difference, 1e-4, 0.0, 1e-4, 1e-4) for scene in scenes]

    monkeypatch.setattr(doctor, "trials", lambda: iter([]))
    monkeypatch.setattr(agreement, "table", table)
    code, text, _ = call("doctor", "--references", "--out", tmp_path)
    assert code == expected
    assert "esplanade/phong/sphere/front" in text
    assert ("DIFFER" in text) == bool(expected)


def test_a_trial_that_aborts_or_hangs_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "LIMIT", 0.5)
    assert doctor._end(doctor._start("import os; os.abort()")) == (False, "exit code -6")
    assert doctor._end(doctor._start("import time; time.sleep(60)")) == (False, "no answer within 0.5 s")
    assert doctor._end(doctor._start("print('fine')")) == (True, "fine")


def test_without_the_benchmark_folders_it_says_so(tmp_path: Path) -> None:
    """An engine alone, as from a wheel, has nothing to run."""
    code = "import shutil, sys; from envbench import root; root.__file__ = sys.argv[1]; print(root.find())"
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "a" / "b" / "root.py")],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert "CannotRun: no folder 'benchmarks'" in done.stderr
