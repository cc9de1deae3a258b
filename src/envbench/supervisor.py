"""Watches one worker process: its time, its memory and its life; kills it when it misbehaves, and starts the next."""

from __future__ import annotations

import multiprocessing
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import psutil

from envbench import failures, worker
from envbench.errors import BadInput, CannotRun
from envbench.messages import Failure, Ready, Request, Setup
from envbench.records import Status

POLL = 0.05
"""Seconds between two looks at a worker's memory."""

START_LIMIT = 300.0
"""Seconds that a worker may take to load its libraries."""


@dataclass(frozen=True)
class Limits:
    """What one cell may use: wall seconds, and bytes of memory that its process holds."""

    seconds: float | None = None
    """As the suite says, if None."""
    memory: int | None = None
    """Three quarters of the machine's, if None."""

    def __post_init__(self) -> None:
        if self.seconds is not None and not self.seconds > 0:
            raise BadInput(f"the time-out must be > 0 seconds. Got {self.seconds} instead.")
        if self.memory is not None and self.memory <= 0:
            raise BadInput(f"the memory limit must be > 0 bytes. Got {self.memory} instead.")


class Supervisor:
    """One worker at a time, started at once and replaced after it was killed or died.

    Attributes
    ----------
    started : int
        Workers so far: a new one knows nothing of what the one before it has opened.
    """

    def __init__(self, setup: Setup, limits: Limits) -> None:
        self._setup = setup
        self._memory_limit = limits.memory or psutil.virtual_memory().total * 3 // 4
        self.started = 0
        self._start()

    def ready(self) -> Ready:
        """Wait until the worker has loaded; raises what stops it: `BadInput` or `CannotRun`."""
        if self._ready is None:
            self._ready = self._first_word()
        return self._ready

    def ask(self, request: Request, seconds: float) -> Any:
        """Return the worker's answer, or a `Failure` where it raised, died, or outran its limits."""
        self.ready()
        self._mark = self._log_size()
        with suppress(OSError):  # it died since it last answered: the wait below says how
            self._pipe.send(request)
        answer = self._wait(seconds)
        if not self._process.is_alive():
            self._start()
        return answer

    def stop(self) -> None:
        """Kill the worker and whatever it has started."""
        family: list[psutil.Process] = []
        with suppress(psutil.Error):
            family = psutil.Process(self._process.pid).children(recursive=True)
        self._process.kill()
        for child in family:
            with suppress(psutil.Error):
                child.kill()
        self._process.join()
        self._pipe.close()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=worker.main, args=(other, self._setup))
        self._mark = self._log_size()
        self._process.start()
        other.close()
        self.started += 1
        self._ready: Ready | None = None

    def _first_word(self) -> Ready:
        answer = self._wait(START_LIMIT)
        if isinstance(answer, BadInput | CannotRun):
            raise answer
        if isinstance(answer, Failure):
            raise CannotRun(f"a worker could not start: {answer.reason}. See {self._setup.log}.")
        return answer

    def _wait(self, seconds: float) -> Any:
        deadline = time.monotonic() + seconds
        while not self._pipe.poll(min(POLL, max(deadline - time.monotonic(), 0))):
            held = self._memory()
            if held > self._memory_limit:
                self.stop()
                return Failure(
                    Status.OUT_OF_MEMORY,
                    f"the process held {held / 2**30:.3g} GiB, over its limit of {self._memory_limit / 2**30:.3g} GiB",
                )
            if time.monotonic() >= deadline:
                self.stop()
                return Failure(Status.TIMED_OUT, f"no answer within {seconds:.3g} s")
        try:
            return self._pipe.recv()
        except (EOFError, OSError):
            self._process.join(5)
            code = self._process.exitcode
            self.stop()
            return Failure(Status.CRASHED, failures.death(code, self._last_words()))

    def _memory(self) -> int:
        with suppress(psutil.Error):
            return psutil.Process(self._process.pid).memory_info().rss
        return 0  # it has just died: the pipe will say so

    def _log_size(self) -> int:
        return self._setup.log.stat().st_size if self._setup.log.exists() else 0

    def _last_words(self) -> str:
        if not self._setup.log.exists():
            return ""
        with self._setup.log.open("rb") as log:
            log.seek(self._mark)
            return log.read().decode(errors="replace")
