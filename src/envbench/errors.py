"""The ways in which envbench ends early, and how it words them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LISTED = 24
"""Most names that one line lists; of more, the nearest."""


class BadInput(ValueError):
    """What the user gave cannot be used: one line naming the thing, the value and the remedy (exit code 2)."""


class NeedsData(BadInput):
    """A file of data that the project does not ship is absent: one line naming it and how to get it."""


class CannotRun(RuntimeError):
    """This machine lacks something the run needs: one line naming it and how to get it (exit code 3)."""


def unknown(kind: str, name: str, known: Iterable[str]) -> BadInput:
    """Word the error for a `name` that is not among the `known` ones, nearest first.

    Examples
    --------
    >>> print(unknown("method", "shmr", ["angular", "shrm"]))
    unknown method 'shmr': did you mean 'shrm'? Known: angular, shrm.
    """
    known = sorted(known)
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean '{near[0]}'? " if near else ""
    listed = difflib.get_close_matches(name, known, n=_LISTED, cutoff=0.0) if len(known) > _LISTED else known
    rest = f" and {len(known) - len(listed)} more" if len(known) > len(listed) else ""
    return BadInput(f"unknown {kind} '{name}': {hint}Known: {', '.join(listed) or 'none'}{rest}.")
