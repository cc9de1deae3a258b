"""One `envbench run`, from its options to the finished run: suite, plan, worker, store."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from envbench import root, suite
from envbench.errors import BadInput
from envbench.messages import Setup
from envbench.plan import overridden, plan
from envbench.progress import Progress
from envbench.records import RunInfo
from envbench.runner import Runner
from envbench.store import Store
from envbench.supervisor import Limits, Supervisor

STORE = "envbench.sqlite"
REPORT = "report.html"
CACHE = "cache"
LOG = "worker.log"


@dataclass(frozen=True)
class Options:
    """What the user asks of a run; None leaves what the suite says.

    Attributes
    ----------
    suite : str
        A name, or the path of a TOML file.
    out : Path
        Folder of the store, the cache of references and the report.
    root : Path or None
        The user's own folder with ``methods/`` and ``suites/``.
    scenes, methods : tuple of str
        Where given, only these of the suite's.
    """

    suite: str = "quick"
    out: Path = Path("results")
    root: Path | None = None
    resume: bool = False
    limits: Limits = field(default_factory=Limits)
    rounds: int | None = None
    floor: float | None = None
    variant: str | None = None
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()


def run(options: Options, progress: Progress, began: float | None = None) -> RunInfo:
    """Run a suite and return the finished run; `began` is the Unix time from which its wall time counts.

    Raises
    ------
    BadInput
        Something that the user gave cannot be used; nothing was computed.
    CannotRun
        This machine lacks something that the run needs.
    KeyboardInterrupt
        Finished cells are kept, and the worker is gone.
    """
    asked = suite.read(root.load(options.root).suite(options.suite))
    return carry_out(asked, options, progress, began)


def carry_out(asked: suite.SuiteFile, options: Options, progress: Progress, began: float | None = None) -> RunInfo:
    """Run a suite that was read already: see `run`."""
    writable(options.out)
    bench = root.load(options.root)
    asked = overridden(asked, floor=options.floor, variant=options.variant, rounds=options.rounds)
    setup = Setup(options.root, options.out / CACHE, options.out / LOG, asked.reference)
    with Store.open(options.out / STORE, create=True) as store:
        supervisor = Supervisor(setup, options.limits)  # loads its libraries while the plan is made
        try:
            work = plan(asked, bench, scenes=options.scenes, methods=options.methods)
            for place, reason in bench.broken.items():
                progress.line(f"warning, {place} is left out: {reason}")
            for note in work.notes:
                progress.line(f"note, {note}")
            runner = Runner(work, store, supervisor, options.limits.seconds or work.timing.timeout, progress)
            return runner.run(resume=options.resume, began=began)
        finally:
            progress.stop()
            supervisor.stop()


def opened(out: Path) -> Store:
    """Open the store in an output folder, to be read."""
    return Store.open(out / STORE)


def write_report(store: Path, ref: str, path: Path) -> Path:
    """Write a run's report as the benchmark root does."""
    with Store.open(store) as opened:
        return root.offered(root.REPORT)(opened, ref, path)


def writable(out: Path) -> None:
    """Make the output folder, and write a little into it; raises `BadInput` if that fails."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out) as probe:
            probe.write(bytes(65536))
            probe.flush()
    except OSError as error:
        raise BadInput(f"output folder {out} cannot be written: {error.strerror}. Give another with --out.") from None
