"""Carries out a plan: references, first passes, interleaved timing rounds; each finished cell is stored at once."""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from envbench import machine
from envbench.animation import AnimationSpec
from envbench.errors import BadInput
from envbench.grids import SceneSpec
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
from envbench.plan import CellSpec, Plan
from envbench.progress import Progress
from envbench.records import CellResult, Film, MaterialSheet, Phase, RunInfo, SceneResult, Study
from envbench.settings import plain
from envbench.sheet import missing
from envbench.store import Store
from envbench.supervisor import Supervisor


@dataclass
class Runner:
    """A run in progress.

    Attributes
    ----------
    seconds : float
        The time-out of a cell: no call of it may take longer, and no further timing round begins that would.
    worked : float
        Seconds of this session spent in references, in timed phases, and waiting for what failed.
    """

    plan: Plan
    store: Store
    supervisor: Supervisor
    seconds: float
    progress: Progress
    run_id: str = ""
    worked: float = 0.0
    calls: dict[str, list[float]] = field(default_factory=dict[str, list[float]])
    """Seconds of each call so far, by cell key."""
    opened: tuple[str, int] = ("", 0)
    """The scene that is open, and in which worker."""

    def run(self, *, resume: bool = False, began: float | None = None) -> RunInfo:
        """Carry out the plan and return the finished run.

        Parameters
        ----------
        resume : bool
            Go on with the latest run of this plan; no finished cell is repeated.
        began : float
            Unix time from which the wall time counts; now, if None.
        """
        began = time.time() if began is None else began
        ready = self.supervisor.ready()
        info = resumable(self.store, self.plan) if resume else None
        if info is None:
            if resume:
                self.progress.line(f"no run of '{self.plan.suite}' to resume: a new one begins.")
            traits = machine.fingerprint() | {"variant": ready.variant, "threads": ready.threads}
            info = RunInfo(_new_id(), self.plan.suite, self.plan.text, _now(), traits, machine.versions())
            self.store.begin(info)
        self.run_id = info.id
        done = self.store.finished_keys(info.id)
        todo = [cell for cell in self.plan.cells if cell.key not in done]
        surveyed = {sheet.name for sheet in self.store.sheets(info.id)}
        survey = {name: spec for name, spec in self.plan.survey.items() if name not in surveyed}
        made = {study.name for study in self.store.studies(info.id)}
        studies = [name for name in self.plan.studies if name not in made]
        drawn = {film.name for film in self.store.films(info.id)}
        animations = [spec for spec in self.plan.animations if spec.name not in drawn]
        more = len(survey) + len(studies) + len(animations)
        if not (todo or more) and info.finished is not None:
            self.progress.line(f"run {info.id} is finished: nothing to resume.")
            return info
        self._begin_progress(todo, len(done), more)
        by_scene: dict[str, list[CellSpec]] = {}
        for cell in todo:
            by_scene.setdefault(cell.scene.name, []).append(cell)
        for scene in self.plan.by_asset:
            if scene.name in by_scene:
                self._scene(scene, by_scene[scene.name])
        self._survey(survey)
        self._studies(studies)
        self._animations(animations)
        wall = time.time() - began
        self.store.finish(info.id, _now(), wall, max(wall - self.worked, 0.0))
        return self.store.run(info.id)

    def _begin_progress(self, todo: Sequence[CellSpec], done: int, more: int) -> None:
        scenes = len({cell.scene.name for cell in todo})
        kept = f", {done} finished cells kept" if done else ""
        self.progress.line(f"run {self.run_id}: suite '{self.plan.suite}', {scenes} scenes, {len(todo)} cells{kept}.")
        self.progress.start(scenes + len(todo) * (1 + self.plan.timing.rounds) + more)

    def _scene(self, spec: SceneSpec, cells: Sequence[CellSpec]) -> None:
        answer = self._open(spec)
        self.progress.advance(1)
        if isinstance(answer, Failure):
            self.store.save_scene(self.run_id, _without_reference(spec, self.plan, answer))
            for cell in cells:
                self._settle(_failed(cell, answer))
            return
        scene = answer
        if not scene.reference_from_cache:
            self.worked += scene.reference_seconds
        self.store.save_scene(self.run_id, scene)
        self.progress.line(_about_reference(scene))
        self._time(self._first_passes(cells))

    def _survey(self, survey: Mapping[str, Any]) -> None:
        """Store a sheet of each material; one that cannot be had stands there with the reason."""
        absent: dict[str, list[str]] = {}
        for name, spec in survey.items():
            start = time.monotonic()
            answer: MaterialSheet | Failure = self._ask(MakeSheet(name, spec), self.seconds, f"{name}: sheet")
            if isinstance(answer, Failure):
                absent.setdefault(answer.reason, []).append(name)
                answer = missing(name, spec, answer.reason)
            else:
                self.worked += time.monotonic() - start
            self.store.save_sheet(self.run_id, answer)
            self.progress.advance(1)
        for reason, names in absent.items():
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            self.progress.line(f"note, no sheet of {names[0]}{more}: {reason}")

    def _studies(self, names: Sequence[str]) -> None:
        """Store each table; one that cannot be made stands there with the reason."""
        for name in names:
            answer: Study | Failure = self._ask(MakeStudy(name), self.seconds, f"study {name}")
            if isinstance(answer, Failure):
                answer = Study.missing(name, f"{answer.status.value}: {answer.reason}")
            else:
                self.worked += answer.seconds
            said = f"note, no study '{name}': {answer.reason}" if answer.reason else f"{name}  {answer.seconds:.2g} s"
            self.progress.line(said)
            self.store.save_study(self.run_id, answer)
            self.progress.advance(1)

    def _animations(self, specs: Sequence[AnimationSpec]) -> None:
        """Store each animation; one that cannot be made stands there with the reason."""
        for spec in specs:
            limit = 2 * self.seconds  # a cell's for its preparation, and one for its frames
            answer: Film | Failure = self._ask(MakeFilm(spec), limit, f"animation {spec.name}")
            if isinstance(answer, Failure):
                answer = Film(spec.name, spec.caption, reason=f"{answer.status.value}: {answer.reason}")
            elif not answer.reason:
                self.worked += answer.seconds
            if answer.reason:
                self.progress.line(f"note, left out animation '{spec.name}': {answer.reason}")
            self.store.save_film(self.run_id, answer)
            self.progress.advance(1)

    def _open(self, spec: SceneSpec) -> SceneResult | Failure:
        """Have the worker build a scene and its reference, which after the first time comes from the cache."""
        limit = 2 * self.plan.reference.budget + self.seconds
        answer = self._ask(MakeReference(spec), limit, f"{spec.name}: reference")
        if isinstance(answer, Failure):
            return replace(answer, reason=f"reference: {answer.reason}")
        self.opened = spec.name, self.supervisor.started
        return answer

    def _opened(self, spec: SceneSpec) -> Failure | None:
        """Have the scene open; return what stops that."""
        if self.opened == (spec.name, self.supervisor.started):
            return None
        answer = self._open(spec)
        return answer if isinstance(answer, Failure) else None

    def _first_passes(self, cells: Sequence[CellSpec]) -> dict[str, tuple[CellSpec, CellResult]]:
        """Render each cell once; return those that go on to the timing rounds, and settle the others."""
        live: dict[str, tuple[CellSpec, CellResult]] = {}
        for cell in cells:
            self._leave_out(cell)
            answer = self._ask_cell(FirstPass(cell))
            if isinstance(answer, Failure):
                self._settle(_failed(cell, answer))
            elif not answer.timings or not self.plan.timing.rounds:
                self._settle(answer)
            else:
                live[cell.key] = cell, answer
        return live

    def _leave_out(self, cell: CellSpec) -> None:
        """Have the worker make the reference that splits a cell's error; where it cannot, the error stays whole."""
        if isinstance(self._opened(cell.scene), Failure):
            return
        limit = 2 * self.plan.reference.budget + self.seconds
        answer: float | Failure = self._ask(MakeWithout(cell), limit, f"{cell.scene.name}: reference, less effects")
        if isinstance(answer, Failure):
            self.progress.line(f"note, the error of {cell.label} on {cell.scene.name} is not split: {answer.reason}")
        else:
            self.worked += answer

    def _time(self, live: dict[str, tuple[CellSpec, CellResult]]) -> None:
        """Time the cells of a scene in turn, every other round backwards, the last as planned."""
        for number in range(self.plan.timing.rounds):
            for key in list(live)[:: 1 if (self.plan.timing.rounds - number) % 2 else -1]:
                cell, result = live[key]
                if sum(self.calls[key]) + self.calls[key][-1] > min(
                    self.seconds, self.plan.timing.budget
                ):  # the rounds so far have to do
                    self._settle(live.pop(key)[1])
                    continue
                answer = self._ask_cell(Round(cell))
                if isinstance(answer, Failure):
                    del live[key]
                    self._settle(_failed(cell, answer))
                    continue
                live[key] = cell, _with_round(result, answer)
                if number == self.plan.timing.rounds - 1:
                    self._settle(live[key][1])

    def _ask_cell(self, request: FirstPass | Round) -> Any:
        cell = request.cell
        again = self._opened(cell.scene)
        if isinstance(again, Failure):
            return again
        start = time.monotonic()
        answer = self._ask(request, self.seconds, f"{cell.scene.name}: {cell.label}")
        self.calls.setdefault(cell.key, []).append(time.monotonic() - start)
        self.progress.advance(1)
        return answer

    def _ask(self, request: Request, seconds: float, doing: str) -> Any:
        self.progress.advance(0, doing)
        start = time.monotonic()
        answer = self.supervisor.ask(request, seconds)
        if isinstance(answer, Failure):
            self.worked += time.monotonic() - start
        return answer

    def _settle(self, result: CellResult) -> None:
        """Store a finished cell."""
        self.store.save_cell(self.run_id, result)
        self.worked += sum(sum(t.rounds) + min(t.first, t.median) for t in result.timings if not t.shared)
        self.progress.advance(1 + self.plan.timing.rounds - len(self.calls.get(result.key, ())))
        reason = f": {result.reason}" if result.reason else ""
        self.progress.cell(f"{result.scene}  {result.label}  {result.status.value}{reason}", result.status)


def resumable(store: Store, plan: Plan) -> RunInfo | None:
    """Return the latest unfinished run of the plan's suite, else its latest run if it was this plan, else None.

    Raises
    ------
    BadInput
        The unfinished run was begun with another plan.
    """
    runs = [run for run in store.runs() if run.suite == plan.suite]
    unfinished = [run for run in runs if run.finished is None]
    for run in reversed(unfinished or runs[-1:]):
        if run.suite_text == plan.text and store.finished_keys(run.id) <= {cell.key for cell in plan.cells}:
            return run
        if unfinished:
            raise BadInput(
                f"run {run.id} of '{plan.suite}' was begun with another suite text, input or setting: "
                "restore them, or leave out --resume to begin a new run."
            )
    return None


def _with_round(result: CellResult, seconds: dict[Phase, float]) -> CellResult:
    timed = {t.phase: t for t in result.timings}
    timed |= {
        phase: replace(timed[phase], rounds=(*timed[phase].rounds, s))
        for phase, s in seconds.items()
        if not timed[phase].shared
    }
    return replace(result, timings=tuple(timed.values()))


def _failed(cell: CellSpec, failure: Failure) -> CellResult:
    name, method = cell.scene.name, cell.method.name
    return CellResult(cell.key, name, method, dict(cell.settings), failure.status, failure.reason)


def _without_reference(spec: SceneSpec, plan: Plan, failure: Failure) -> SceneResult:
    nothing = float("nan")
    return SceneResult(
        name=spec.name, light=spec.light, material=spec.material, geometry=spec.geometry, view=spec.view,
        specs=plain(spec.meaning), effects=(), points=0, reference_key="", reference_floor=nothing,
        reference_target=spec.reference(plan.reference).floor, reference_samples=0, reference_replicates=0,
        reference_seconds=0.0,
        reference_from_cache=False, reference_rms=nothing, notes=(failure.reason,),
        **spec.place(),
    )  # fmt: skip


def _about_reference(scene: SceneResult) -> str:
    source = "cached" if scene.reference_from_cache else f"{scene.reference_seconds:.2g} s"
    short = "" if scene.reference_floor <= scene.reference_target else f", short of {scene.reference_target:.2g}"
    return f"{scene.name}  reference {source}, noise floor {scene.reference_floor:.2g}{short}"


def _new_id() -> str:
    return f"{datetime.now(UTC):%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
