"""Items of an invented paper beside invented studies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from envbench.papers import Found
from envbench.records import RunInfo, Study
from reports.papers.items import Item, Paper, item
from reports.papers.verdicts import Judged, judge

HEAD = """
item = "Table 1"
title = "Errors & more"
study = "errors"
text = "What the paper shows."
"""
RUN = RunInfo(
    "20250301-101500-ab12", "paper-tiny", "", "2025-03-01T10:15:00+00:00", {"cpu": "a processor"},
    {"envbench": "0.1.0 (git 0123456789ab)"},
)  # fmt: skip


def study(name: str = "errors", title: str = "Errors by N", **changes: object) -> Study:
    """Return a table of four rows: N, a falling error, a time that grows as N squared, and whether it is well."""
    rows = tuple((n, 0.08 / n, 3e-3 * n**2, n > 1, "odd" if n % 2 else "even") for n in (1, 2, 3, 4))
    columns = ("N", "rms", "seconds", "well", "parity")
    return Study(name, title, "In words.", changes.get("columns", columns), changes.get("rows", rows))  # type: ignore[arg-type]


Make = Callable[..., Item]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Give a function that writes an item's file and reads it."""

    def made(text: str, head: str = HEAD, name: str = "table-1") -> Item:
        path = tmp_path / "tiny" / f"{name}.toml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(head + text)
        return item(path)

    return made


@pytest.fixture
def verdict(make: Make) -> Callable[..., Judged]:
    """Give a function that judges what an item's file says by studies, here by `study`."""

    def judged(text: str, *studies: Study, head: str = HEAD) -> Judged:
        found = {one.name: Found(one, RUN) for one in studies or (study(),)}
        return judge(Paper("tiny", "A tiny paper", "", (make(text, head),)), found).items[0]

    return judged
