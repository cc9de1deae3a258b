"""Data that the project does not ship (light probes, measured BRDFs): where it is looked for."""

from __future__ import annotations

import os
from pathlib import Path

from envbench.errors import NeedsData

VARIABLE = "ENVBENCH_DATA"
"""Environment variable that names the data folder; without it, `shared/data` beside the checkout."""


def folder() -> Path:
    """Return the data folder, whether it exists or not."""
    named = os.environ.get(VARIABLE)
    return Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"


def locate(path: str | Path) -> Path:
    """Return where a file is: at `path` itself, else at `path` within the data folder.

    Raises
    ------
    NeedsData
        It is at neither place.
    """
    for candidate in (Path(path), folder() / path):
        if candidate.exists():
            return candidate
    raise NeedsData(f"{path} is neither there nor in the data folder: set {VARIABLE} to the folder that holds it.")
