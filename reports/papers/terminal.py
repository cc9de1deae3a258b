"""A paper's verdicts on the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from envbench.papers import Found
from envbench.show import console
from reports.papers.items import Paper
from reports.papers.verdicts import JudgedPaper, Part, Verdict, judge, worded

_STYLES = {Verdict.DIFFERS: "yellow", Verdict.NEEDS_DATA: "cyan", Verdict.FAILED: "red"}


def show(paper: Paper, found: Mapping[str, Found]) -> bool:
    """Print every item with its comparisons; return whether none has failed."""
    from rich.table import Table
    from rich.text import Text

    judged = judge(paper, found)
    grid = Table(
        "item", "printed", "ours", "verdict", "how", title=paper.title, header_style="bold", title_justify="left"
    )
    for entry in judged.items:
        verdict = Text(entry.verdict, style=_STYLES.get(entry.verdict, "green"))
        told = entry.words if not entry.parts or entry.substituted else ""
        grid.add_row(Text(f"{entry.item.item}  {entry.item.title}", style="bold"), "", "", verdict, Text(told))
        for part in entry.parts:
            grid.add_row(*(Text(text) for text in _row(part)))
        grid.add_section()
    console().print(grid)
    console().print(f"{paper.name}: {counted(judged)}" + (f"; printed on {paper.hardware}" if paper.hardware else ""))
    return not any(entry.verdict is Verdict.FAILED for entry in judged.items)


def counted(judged: JudgedPaper) -> str:
    """Say how many items came to which verdict, e.g. ``3 agrees, 1 differs``."""
    return ", ".join(f"{n} {verdict}" for verdict, n in judged.counts.items())


def _row(part: Part) -> tuple[str, str, str, str, str]:
    how = ". ".join(filter(None, (part.rule, part.words)))
    return f"    {part.what}", printed(part), worded(part.ours), part.verdict or "shown", how


def printed(part: Part) -> str:
    """Word the printed value as the paper has it."""
    match part.printed:
        case None:
            return ""
        case bool() | str():
            return worded(part.printed)
        case number:
            return f"{number:g}"
