"""The command line. Exit codes: 0 done, 1 done with failed cells or a closed gate, 2 bad input, 3 could not run.

Only typer is imported here: whatever a command needs, it imports itself, so that ``--help`` answers at once.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from envbench.errors import BadInput, CannotRun

app = typer.Typer(
    name="envbench",
    help="Accuracy against time for rendering under environment maps, measured against Mitsuba 3.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Out = Annotated[Path, typer.Option("--out", help="Folder of the store, the cache of references and the report.")]
Run = Annotated[str, typer.Argument(metavar="RUN", help="A run's id, the beginning of one, or 'latest'.")]
Root = Annotated[Path | None, typer.Option("--root", help="Your own folder with methods/ and suites/.")]


def main() -> None:
    """Run the command line; every foreseen error is one line on standard error."""
    try:
        app()
    except BadInput as error:
        sys.exit(_error(error, 2))
    except CannotRun as error:
        sys.exit(_error(error, 3))


def _error(error: Exception, code: int) -> int:
    print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
    return code


@app.command()
def run(
    suite: Annotated[
        str, typer.Argument(metavar="SUITE", help="A suite's name, or the path of a TOML file.")
    ] = "quick",
    out: Out = Path("results"),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the suite's latest run.")] = False,
    root: Root = None,
    scene: Annotated[list[str] | None, typer.Option(help="Only this scene (may be repeated).")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Only this method (may be repeated).")] = None,
    timeout: Annotated[float | None, typer.Option(help="Seconds that a cell may take, instead of the suite's.")] = None,
    memory: Annotated[
        float | None, typer.Option(help="GiB that a cell may hold; default 3/4 of the machine's.")
    ] = None,
    rounds: Annotated[int | None, typer.Option(help="Timing rounds, instead of the suite's.")] = None,
    floor: Annotated[float | None, typer.Option(help="Noise floor of references, relative to the RMS.")] = None,
    variant: Annotated[str | None, typer.Option(help="Mitsuba variant of references.")] = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write no HTML report.")] = False,
) -> None:
    """Run a suite: reference, accuracy and time of every method on every scene, into OUT/report.html."""
    from envbench import progress, session, show
    from envbench.supervisor import Limits

    limits = Limits(timeout, None if memory is None else int(memory * 2**30))
    options = session.Options(
        suite, out, root, resume, limits, rounds, floor, variant, tuple(scene or ()), tuple(method or ())
    )
    began = time.time() - time.process_time()  # start-up keeps the processor busy
    try:
        info = session.run(options, progress.progress(), began=began)
    except KeyboardInterrupt:
        print(f"interrupted: finished cells are kept; go on with 'envbench run {suite} --resume'.", file=sys.stderr)
        raise typer.Exit(130) from None
    if not no_report:
        print(f"report: {session.write_report(out / session.STORE, info.id, out / session.REPORT)}")
    with session.opened(out) as store:
        cells = store.cells(info.id)
    print(show.summary(info, cells))
    raise typer.Exit(1 if any(show.is_failure(cell) for cell in cells) else 0)


@app.command("list")
def list_(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="methods, scenes, suites, metrics, studies, lights, materials ...")
    ],
    root: Root = None,
) -> None:
    """List what there is to name."""
    from envbench import listing

    listing.show(kind, root)


@app.command()
def show(
    what: Annotated[
        list[str] | None,
        typer.Argument(metavar="[RUN | material NAME]", help="A run (default: latest), or a material."),
    ] = None,
    out: Out = Path("results"),
    root: Root = None,
    scene: Annotated[list[str] | None, typer.Option(help="Only this scene (may be repeated).")] = None,
    metric: Annotated[list[str] | None, typer.Option(help="This metric (may be repeated).")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a material's lobe plot as HTML.")] = None,
) -> None:
    """Show a run's cells with the verdicts of its hard cases, or what is known of a material."""
    from envbench import session, show

    match what or ["latest"]:
        case ["material", name]:
            show.material(name, root, plot)
        case [run] if run != "material" and plot is None:
            with session.opened(out) as store:
                show.table(store, run, scenes=tuple(scene or ()), metrics=tuple(metric or ("nrmse", "energy_ratio")))
        case words:
            raise BadInput(f"show takes a run, or 'material NAME' (which --plot belongs to). Got {words} instead.")


@app.command()
def effects(
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help="light/material/geometry/view, by name: see 'envbench list'.")
    ],
    out: Out = Path("results"),
    root: Root = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Contribution, relative to the RMS radiance, that is left out.")
    ] = None,
    accuracy: Annotated[float, typer.Option(help="Error that matters; the tolerance is a tenth of it.")] = 0.05,
    floor: Annotated[float, typer.Option(help="Noise floor of the reference whose cost is estimated.")] = 1e-3,
) -> None:
    """Show which effects a scene calls for, what each contributes and costs, and images of that."""
    from envbench import contributions
    from envbench.effects import EffectSettings
    from envbench.reference import ReferenceSettings

    settings = EffectSettings(accuracy=accuracy, tolerance=tolerance)
    contributions.show(scene, settings, ReferenceSettings(floor=floor, budget=float("inf")), out, root)


@app.command()
def report(run: Run = "latest", out: Out = Path("results")) -> None:
    """Write a run's HTML report again."""
    from envbench import session

    print(session.write_report(out / session.STORE, run, out / session.REPORT))


@app.command()
def paper(
    name: Annotated[str, typer.Argument(metavar="PAPER", help="A paper's name, or 'all'.")],
    out: Out = Path("results"),
    again: Annotated[bool, typer.Option("--again", help="Compute what the store holds already, too.")] = False,
    root: Annotated[Path | None, typer.Option("--root", help="Your own folder with papers/.")] = None,
    timeout: Annotated[float, typer.Option(help="Seconds that a study may take.")] = 900.0,
) -> None:
    """Recompute a paper's tables and figures beside what it printed, with verdicts, into OUT/papers/index.html."""
    from envbench import papers, progress, session
    from envbench.supervisor import Limits

    offered = papers.offered()
    chosen = papers.chosen(offered, name, root)
    options = session.Options(out=out, root=root, limits=Limits(timeout))
    try:
        for one in chosen:
            papers.run(one, options, progress.progress(), again=again)
    except KeyboardInterrupt:
        print(f"interrupted: finished studies are kept; 'envbench paper {name}' goes on.", file=sys.stderr)
        raise typer.Exit(130) from None
    judged = [(one, papers.known(out, one)) for one in chosen]
    answered = [offered.show(*one) for one in judged]
    others = [offered.read(other, root) for other in offered.names(root) if other not in {one.name for one in chosen}]
    print(f"pages: {offered.write([*judged, *((one, papers.known(out, one)) for one in others)], out / papers.FOLDER)}")
    raise typer.Exit(0 if all(answered) else 1)


@app.command()
def export(
    run: Run,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Its suffix decides: .csv, .json or .parquet.")],
    out: Out = Path("results"),
) -> None:
    """Export a run, a row a cell."""
    from envbench import export, session

    with session.opened(out) as store:
        export.export(store, run, file)
    print(file)


@app.command()
def gate(
    run: Run,
    baseline: Annotated[str, typer.Option(metavar="RUN", help="The run to hold it against.")],
    out: Out = Path("results"),
    baseline_store: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The baseline's store, if another.")
    ] = None,
    margin: Annotated[float, typer.Option(help="How much worse is still well, relative.")] = 0.01,
) -> None:
    """Compare a run's accuracy with a baseline's; exit code 1 where it is worse."""
    from envbench import gate, session
    from envbench.store import Store

    with session.opened(out) as store, Store.open(baseline_store or store.path) as other:
        verdict = gate.gate(store, run, other, baseline, margin=margin)
    for line in verdict.lines():
        print(line)
    raise typer.Exit(0 if verdict.ok else 1)


@app.command()
def doctor(
    out: Out = Path("results"),
    references: Annotated[
        bool, typer.Option("--references", help="Hold both references to each other (a minute).")
    ] = False,
) -> None:
    """Say what this machine has, what it lacks, and what to do about it."""
    from envbench import doctor

    raise typer.Exit(doctor.run(out, references=references))
