"""Tables and figures of papers: the studies that they need are run where the store lacks them, and shown as judged."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from envbench import root, session, suite
from envbench.progress import Progress
from envbench.records import RunInfo, Study
from envbench.store import Store

FOLDER = "papers"
"""Of the pages, in the output folder."""


@dataclass(frozen=True)
class Found:
    """A study with the run that it is from."""

    study: Study
    run: RunInfo


class Paper(Protocol):
    """A paper as `reports` describes it: what it needs to be run."""

    @property
    def name(self) -> str: ...

    @property
    def studies(self) -> tuple[str, ...]: ...

    @property
    def substitutes(self) -> Mapping[str, str]:
        """Studies by the ones that they stand for where data are absent."""
        ...


class Papers(Protocol):
    """What the benchmark root offers under `envbench.root.PAPERS`."""

    def names(self, user: Path | None) -> tuple[str, ...]:
        """Return the names of all papers."""
        ...

    def read(self, name: str, user: Path | None) -> Paper:
        """Read a paper; raises `envbench.errors.BadInput`."""
        ...

    def show(self, paper: Paper, found: Mapping[str, Found]) -> bool:
        """Print a paper's verdicts; return whether each item could be judged, or told what data it needs."""
        ...

    def write(self, papers: Sequence[tuple[Paper, Mapping[str, Found]]], folder: Path) -> Path:
        """Write pages and tables of papers; return the page that links them."""
        ...


def offered() -> Papers:
    """Return what reads and judges papers."""
    return cast("Papers", root.offered(root.PAPERS))


def chosen(papers: Papers, name: str, user: Path | None) -> tuple[Paper, ...]:
    """Return the papers that a name means: one, or "all"."""
    return tuple(papers.read(one, user) for one in (papers.names(user) if name == "all" else (name,)))


def run(paper: Paper, options: session.Options, progress: Progress, *, again: bool = False) -> None:
    """Run what a paper needs and the store lacks: a study not yet stored, or stored without a table.

    Parameters
    ----------
    options : Options
        Their `suite` is not looked at.
    again : bool
        Run all of it.
    """
    began = time.time()
    with Store.open(options.out / session.STORE, create=True) as store:
        have = found(store, paper)
    wanted = [name for name in paper.studies if again or _lacks(have, name)]
    for name in paper.studies:
        if name not in wanted:
            of = have[name].run
            progress.line(f"study {name}: from run {of.id}, commit {of.commit}; --again recomputes.")
    if wanted:
        session.carry_out(_suite(paper, wanted), options, progress, began=began)
    have = known(options.out, paper)
    absent = [other for name, other in paper.substitutes.items() if name in have and have[name].study.needs_data]
    instead = [name for name in dict.fromkeys(absent) if again or _lacks(have, name)]
    if instead:
        session.carry_out(_suite(paper, instead), options, progress, began=began)


def found(store: Store, paper: Paper) -> dict[str, Found]:
    """Return the newest result of each study that a paper needs, or may put in its place."""
    newest = store.newest_studies(tuple(dict.fromkeys((*paper.studies, *paper.substitutes.values()))))
    return {name: Found(study, run) for name, (study, run) in newest.items()}


def known(out: Path, paper: Paper) -> dict[str, Found]:
    """Return what the store of an output folder holds of a paper."""
    with session.opened(out) as store:
        return found(store, paper)


def _lacks(known: Mapping[str, Found], name: str) -> bool:
    return name not in known or bool(known[name].study.reason)


def _suite(paper: Paper, studies: Sequence[str]) -> suite.SuiteFile:
    name = f"paper-{paper.name}"
    return suite.parse(f"name = {json.dumps(name)}\nstudies = {json.dumps(studies)}\n", name)
