"""How a run tells where it is: a bar with the time left on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from typing import Protocol

from envbench.records import Status


class Progress(Protocol):
    """What a runner tells."""

    def start(self, steps: int) -> None:
        """Begin to count `steps`, of which none is done."""
        ...

    def advance(self, steps: int, doing: str = "") -> None:
        """Count `steps` as done, and name what is done now."""
        ...

    def line(self, text: str) -> None:
        """Say something worth keeping."""
        ...

    def cell(self, text: str, status: Status) -> None:
        """Say how a cell ended."""
        ...

    def stop(self) -> None:
        """End: nothing more comes."""
        ...


class Lines:
    """Plain lines, for logs and pipes."""

    def __init__(self) -> None:
        self._done = self._steps = 0

    def start(self, steps: int) -> None:
        """Begin to count."""
        self._done, self._steps = 0, steps

    def advance(self, steps: int, doing: str = "") -> None:
        """Count silently."""
        self._done += steps

    def line(self, text: str) -> None:
        """Print."""
        print(text, flush=True)

    def cell(self, text: str, status: Status) -> None:
        """Print, with the share of the run that is done."""
        print(f"{100 * self._done // max(self._steps, 1):3d} %  {text}", flush=True)

    def stop(self) -> None:
        """Do nothing: every line is out."""


class Bar:
    """One moving line with the time left; only what is worth keeping scrolls by above it."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as RichProgress

        columns = (BarColumn(30), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(compact=True))
        self._console = Console(highlight=False)
        self._bar = RichProgress(*columns, TextColumn("{task.description}", markup=False), console=self._console)
        self._task = self._bar.add_task("", total=None)

    def start(self, steps: int) -> None:
        """Show the bar."""
        self._bar.update(self._task, total=steps)
        self._bar.start()

    def advance(self, steps: int, doing: str = "") -> None:
        """Move the bar."""
        self._bar.update(self._task, advance=steps, description=doing or None)

    def line(self, text: str) -> None:
        """Print above the bar."""
        self._console.print(text, markup=False)

    def cell(self, text: str, status: Status) -> None:
        """Print above the bar what is not as it should be."""
        if status is not Status.OK:
            self._console.print(text, markup=False, style="yellow")

    def stop(self) -> None:
        """Remove the bar."""
        self._bar.stop()


def progress() -> Progress:
    """Return the way of telling that suits standard output."""
    return Bar() if sys.stdout.isatty() else Lines()
