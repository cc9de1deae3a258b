"""A user's own folder with small methods and a small suite, and the command line in this process."""

from __future__ import annotations

import importlib
import io
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

METHOD = """
import os, time
from dataclasses import dataclass
import numpy as np
from envbench.method import Method

@dataclass(frozen=True)
class Own(Method):
    name = "{name}"
    summary = "mean radiance everywhere: exact for constant light on an albedo of 1"
    source = "a test"
    number: int = 0
    factor: float = 1.0

    def __post_init__(self):
        from envbench.errors import BadInput
        if self.factor < 0:
            raise BadInput(f"factor must be >= 0. Got {{self.factor}} instead.")

    {more}

    def prepare(self, material, geometry):
        return np.zeros(8)

    def relight(self, prepared, environment):
        return environment.mean

    def shade(self, framed, points):
        {shade}
        return np.tile(self.factor * framed, (len(points), 1))
"""

SUITE = """
[reference]
floor = 0.05
budget = 1.0
[timing]
rounds = 3
[lights.grey]
kind = "constant"
radiance = [0.5, 1.0, 2.0]
[views.tiny]
kind = "image"
size = 16
direction = [0.0, -1.0, 0.0]
[[scenes]]
lights = ["grey"]
materials = ["lambertian"]
geometry = "sphere"
view = "tiny"
"""

SCENE = "grey/lambertian/sphere/tiny"


class UserFolder:
    """What ``--root`` names: ``methods/`` and ``suites/`` under a temporary folder."""

    def __init__(self, path: Path) -> None:
        self.path = path
        (path / "methods").mkdir(parents=True)
        (path / "suites").mkdir()

    def method(self, name: str, shade: str = "pass", more: str = "pass") -> Path:
        """Write a method whose `shade` begins with a statement of the test's choice."""
        return self.file(name, METHOD.format(name=name, shade=shade, more=more))

    def file(self, name: str, text: str) -> Path:
        """Write a file of methods."""
        path = self.path / "methods" / f"{name}.py"
        path.write_text(text)
        return path

    def suite(self, name: str, methods: str, scenes: str = SUITE) -> Path:
        """Write a suite: the tiny scene, and `methods` as TOML."""
        path = self.path / "suites" / f"{name}.toml"
        path.write_text(scenes + methods)
        return path


@pytest.fixture
def user(tmp_path: Path) -> Iterator[UserFolder]:
    """Give a user's folder whose methods are forgotten afterwards."""
    yield UserFolder(tmp_path / "own")
    forget(tmp_path)


def forget(folder: Path) -> None:
    """Undo the import of all methods below a folder."""
    package = sys.modules.get("methods")
    if package is not None:
        package.__path__[:] = [entry for entry in package.__path__ if not entry.startswith(str(folder))]
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(str(folder)):
            del sys.modules[name]
    importlib.invalidate_caches()


def call(*arguments: object) -> tuple[int, str, str]:
    """Call the command line in this process: exit code, standard output, standard error."""
    from envbench.cli import main

    out, err, kept = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["envbench", *map(str, arguments)]
    try:
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as end:
            main()
    finally:
        sys.argv = kept
    return int(end.value.code or 0), out.getvalue(), err.getvalue()
