"""`./bench`, run in a small checkout of its own, with stand-ins for Python and uv that write down their calls."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TOOLS = ("sh", "dirname", "cat", "cksum", "uname", "id", "rm", "mkdir")

PYTHON = """#!/bin/sh
case "$1 $2" in
    "-c "*$MISSING*) [ -n "$MISSING" ] && exit 1; exit 0 ;;
    "-V "*) echo "Python 3.11.2" ;;
    "-m $FAILING") echo "python $*" >>"$LOG"; exit 1 ;;
    "-m venv") echo "python $*" >>"$LOG"; mkdir -p "$3/bin"; cat "$0" >"$3/bin/python"; chmod +x "$3/bin/python" ;;
    "-m pip") echo "pip $*" >>"$LOG"; cat "$UV" >"${0%python}uv"; chmod +x "${0%python}uv" ;;
    "-m "*) echo "python $*" >>"$LOG" ;;
esac
"""

UV = """#!/bin/sh
echo "uv $*" >>"$LOG"
mkdir -p "$UV_PROJECT_ENVIRONMENT/bin"
cd "$UV_PROJECT_ENVIRONMENT/bin"
cat "$STAND_IN" >python
printf '#!/bin/sh\\nprintf "[%%s]" "$PWD" "$@"\\n' >envbench
printf '#!/bin/sh\\n echo lint-imports >>"$LOG"\\n' >lint-imports
chmod +x python envbench lint-imports
"""


@dataclass
class Checkout:
    """A folder with the launcher in it, and the only folder of commands that it may use."""

    root: Path
    commands: Path

    def bench(self, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
        log = str(self.commands.parent / "log")
        stand_ins = {"STAND_IN": str(self.commands.parent / "python"), "UV": str(self.commands.parent / "uv")}
        environment = {"PATH": str(self.commands), "LOG": log, "MISSING": "", "FAILING": "none"} | stand_ins | variables
        return subprocess.run(
            [self.root / "bench", *arguments],
            env=environment,
            cwd=self.commands.parent,
            capture_output=True,
            text=True,
            timeout=30,
        )

    @property
    def calls(self) -> list[str]:
        log = self.commands.parent / "log"
        return log.read_text().splitlines() if log.exists() else []


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    root = tmp_path / "a check out"
    commands = tmp_path / "commands"
    root.mkdir()
    commands.mkdir()
    for file in ("bench", "uv.lock", "pyproject.toml"):
        shutil.copy(ROOT / file, root)
    for tool in (*TOOLS, "chmod"):
        found = shutil.which(tool)
        assert found is not None
        (commands / tool).symlink_to(found)
    for name, text in (("python", PYTHON), ("uv", UV)):
        (tmp_path / name).write_text(text)
    place(commands / "python3", PYTHON)
    place(commands / "uv", UV)
    return Checkout(root, commands)


def place(file: Path, text: str) -> None:
    file.write_text(text)
    file.chmod(0o755)


def test_first_use_installs_and_arguments_arrive_whole(checkout: Checkout) -> None:
    done = checkout.bench("run", "my suite.toml", "")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"[{checkout.commands.parent}][run][my suite.toml][]"
    (call,) = checkout.calls
    assert call.startswith("uv sync --locked --project ")
    assert call.endswith("--no-dev --inexact")


def test_second_use_installs_nothing_until_the_lock_changes(checkout: Checkout) -> None:
    checkout.bench("run")
    assert checkout.bench("run").stderr == ""
    assert len(checkout.calls) == 1
    with (checkout.root / "uv.lock").open("a") as lock:
        lock.write("\n")
    checkout.bench("run")
    assert len(checkout.calls) == 2


def test_the_development_environment_serves_run_too(checkout: Checkout) -> None:
    checkout.bench("test")
    checkout.bench("run")
    assert sum(call.startswith("uv ") for call in checkout.calls) == 1


def test_a_moved_checkout_is_installed_again(checkout: Checkout) -> None:
    checkout.bench("run")
    moved = Checkout(checkout.root.rename(checkout.root.with_name("moved")), checkout.commands)
    assert moved.bench("run").returncode == 0
    assert moved.calls[-1].endswith("--reinstall")


def test_tests_go_on_after_a_failure_and_name_it(checkout: Checkout) -> None:
    done = checkout.bench("test", "-k", "two words", FAILING="ruff")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "bench: failed: ruff format --check, ruff check"
    assert checkout.calls[1:] == [
        "python -m ruff format --check",
        "python -m ruff check",
        "python -m pyright",
        "lint-imports",
        "python -m pytest -k two words",
    ]
    assert checkout.bench("test").returncode == 0


def test_without_uv_it_comes_by_pip(checkout: Checkout) -> None:
    (checkout.commands / "uv").unlink()
    done = checkout.bench("run")
    assert done.returncode == 0, done.stderr
    assert [call.split()[0] for call in checkout.calls] == ["python", "pip", "uv"]
    assert (checkout.root / ".cache" / "uv" / "bin" / "uv").exists()


@pytest.mark.parametrize(
    ("missing", "told"),
    [
        ("sys.version_info", "no Python 3.11 to 3.13 on the path"),
        ("ensurepip", "python3 has no venv module: 'apt-get install python3-venv'"),
        ("libatomic", "Dr.Jit needs libatomic.so.1: 'sudo apt-get install libatomic1'"),
    ],
)
def test_what_is_missing_is_one_line(checkout: Checkout, missing: str, told: str) -> None:
    if missing == "libatomic" and os.uname().sysname != "Linux":
        pytest.skip("only Linux needs libatomic.so.1")
    (checkout.commands / "uv").unlink()
    done = checkout.bench("run", MISSING=missing)
    assert done.returncode == 3
    assert told in done.stderr.splitlines()[-1]


def test_no_argument_shows_every_command(checkout: Checkout) -> None:
    done = checkout.bench()
    assert "./bench test" in done.stdout
    assert "./bench kernels" in done.stdout
    assert done.stdout.endswith("[--help]")


def test_ci_runs_exactly_bench_test() -> None:
    script = (ROOT / ".ci" / "run").read_text().splitlines()
    assert script[-1].endswith("exec ./bench test")
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    assert os.access(ROOT / "bench", os.X_OK)
