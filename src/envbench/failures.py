"""How a cell's end is put into one line: what a method raised, and what its process died of."""

from __future__ import annotations

import re
import signal
import sys
import traceback
from pathlib import Path

from envbench.messages import (
    Failure,
    FirstPass,
    MakeFilm,
    MakeReference,
    MakeSheet,
    MakeStudy,
    MakeWithout,
    Request,
    Round,
)
from envbench.records import Status


def failure(error: BaseException, request: Request) -> Failure:
    """Word what a request raised: type, message, and the line of the method's file that it came from."""
    status = Status.OUT_OF_MEMORY if isinstance(error, MemoryError) else Status.FAILED
    text = ": ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))
    return Failure(status, text + _where(error, request))


def death(code: int | None, last_words: str) -> str:
    """Word the end of a process by its exit `code` and what it last wrote to its log.

    Examples
    --------
    >>> death(-11, "")
    'the process was killed by SIGSEGV'
    """
    if code is not None and code < 0:
        how = f"the process was killed by {signal.Signals(-code).name}"
        if code == -signal.SIGKILL:
            how += " (by the system when memory runs out, as a rule)"
    else:
        how = f"the process ended itself with exit code {code}"
    stack = re.search(r'File "([^"]+)", line (\d+) in (\w+)', last_words)
    if stack:
        return f"{how} in {stack[3]} ({Path(stack[1]).name}:{stack[2]})"
    lines = [line.strip() for line in last_words.splitlines() if line.strip()]
    return f"{how}; its last words: {lines[-1][:200]}" if lines else how


def _where(error: BaseException, request: Request) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    match request:
        case MakeReference() | MakeWithout() | MakeSheet() | MakeStudy():
            return ""
        case FirstPass(cell) | Round(cell):
            method = cell.method
        case MakeFilm(animation):
            method = animation.method
    own = getattr(sys.modules.get(type(method).__module__), "__file__", None)
    inside = [frame for frame in frames if frame.filename == own]
    return f" ({Path(inside[-1].filename).name}:{inside[-1].lineno}, in {inside[-1].name})" if inside else ""
