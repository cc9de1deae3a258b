"""The fingerprint is plain JSON, and versions name what is installed."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import envbench
from envbench import machine


def test_fingerprint_is_json_and_agrees_with_the_system():
    found = machine.fingerprint()
    assert json.loads(json.dumps(found)) == found
    assert found["cpu"]
    assert 1 <= found["usable_cores"] <= found["logical_cores"]
    assert found["memory_bytes"] > 2**28
    assert found["python"] == ".".join(map(str, sys.version_info[:3]))


@pytest.mark.parametrize(("value", "ci"), [("true", True), ("1", True), ("", False), ("false", False)])
def test_ci_flag(monkeypatch, value, ci):
    monkeypatch.setenv("CI", value)
    assert machine.fingerprint()["ci"] is ci


def test_versions_name_the_libraries_and_the_commit(monkeypatch):
    found = machine.versions()
    assert found["numpy"] == np.__version__
    assert {"scipy", "mitsuba", "drjit", "ducc0", "openexr", "scikit-image", "llvm"} <= set(found)
    checkout = Path(envbench.__file__).resolve().parents[2]
    if shutil.which("git") and (checkout / ".git").exists():
        head = subprocess.run(["git", "-C", checkout, "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
        assert re.fullmatch(r"\S+ \(git ([0-9a-f]{12})(-dirty)?\)", found["envbench"])[1] == head.stdout[:12]
    monkeypatch.setenv("PATH", "")  # no git
    assert re.fullmatch(r"\S+", machine.versions()["envbench"])


def test_the_commit_of_another_checkout_is_not_ours(monkeypatch, tmp_path):
    if not shutil.which("git"):
        pytest.skip("git is not installed")
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    installed = tmp_path / "lib" / "envbench"
    installed.mkdir(parents=True)
    monkeypatch.setattr(machine, "__file__", str(installed / "machine.py"))
    assert re.fullmatch(r"\S+", machine.versions()["envbench"])


def test_nothing_heavy_is_imported():
    code = (
        "from envbench import machine, store, gate, export; import sys; machine.versions(); machine.fingerprint();"
        "print(sorted({'scipy', 'skimage', 'mitsuba', 'drjit', 'pyarrow'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
