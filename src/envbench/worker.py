"""The process that does the work: it builds scenes, makes references, and renders, scores and times cells.

It answers one request at a time over a pipe, and is trusted with nothing: `supervisor` watches its time and memory.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import sys
import threading
import time
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from envbench import attribution, effects, furnace, llvm, metrics, root, timing
from envbench.answers import checked, modulated
from envbench.choices import identity, values
from envbench.errors import BadInput, CannotRun, NeedsData, unknown
from envbench.failures import failure
from envbench.film import film
from envbench.grids import SceneSpec
from envbench.messages import (
    FirstPass,
    MakeFilm,
    MakeReference,
    MakeSheet,
    MakeStudy,
    MakeWithout,
    Ready,
    Request,
    Round,
    Setup,
)
from envbench.method import Method, footprint
from envbench.plan import CellSpec, remarks
from envbench.records import CellResult, Film, MaterialSheet, Phase, SceneResult, Status, Study, Timing
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Scene
from envbench.settings import plain

SLOW_PREPARE = 1.0
"""Seconds beyond which `prepare` is timed on its first call only."""


def main(pipe: Connection, setup: Setup) -> None:
    """Load everything once, say `Ready`, and answer requests until the pipe closes or the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _redirect_output(setup)
    try:
        desk = _load(pipe, setup)
    except (BadInput, CannotRun) as error:
        pipe.send(error)
        return
    while True:
        try:
            request: Request = pipe.recv()
        except EOFError:
            return
        try:
            answer: Any = desk.answer(request)
        except BaseException as error:  # whatever a method raises, SystemExit too, is its cell's failure alone
            answer = failure(error, request)
        pipe.send(answer)


def _load(pipe: Connection, setup: Setup) -> Desk:
    from skimage.metrics import structural_similarity

    _ = structural_similarity  # takes long to import, which no cell's time-out shall pay for
    bench = root.load(setup.user)
    mi = llvm.mitsuba(setup.reference.variant, fallback=True)
    settings = replace(setup.reference, variant=cast("str", mi.variant()))
    pipe.send(Ready(settings.variant, timing.threads()))
    return Desk(bench, setup, settings)


def _end_with_parent() -> None:
    """Die with the parent, however it died: a hung method must not outlive a killed run."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _redirect_output(setup: Setup) -> None:
    """Send what methods and libraries print, and the stack of a fatal signal, to the log."""
    log = os.open(setup.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    sys.stdout.flush()
    sys.stderr.flush()
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.close(log)
    faulthandler.enable(all_threads=False)


Answer = SceneResult | CellResult | float | dict[Phase, float] | MaterialSheet | Study | Film


@dataclass
class Prepared:
    """What a method made of an asset: its state, the scene where it did, and what that took (first call, rounds)."""

    state: Any
    scene: str
    first: float
    rounds: list[float] = field(default_factory=list[float])


@dataclass
class Desk:
    """What a worker has before it: one scene, its reference, and what each method has prepared of its asset."""

    bench: root.Workbench
    setup: Setup
    settings: ReferenceSettings
    spec: SceneSpec | None = None
    scene: Scene | None = None
    truth: Reference | None = None
    without: dict[frozenset[Effect], Reference] = field(default_factory=dict[frozenset[Effect], Reference])
    """References of the open scene without effects, by the effects."""
    prepared: dict[str, Prepared] = field(default_factory=dict[str, Prepared])
    """By `envbench.choices.identity`, for the material and shape of the scene: a further light finds it done."""

    def answer(self, request: Request) -> Answer:
        """Do what is asked."""
        match request:
            case MakeReference(spec):
                return describe(spec, *self.open(spec))
            case MakeWithout(cell):
                return self.leave_out(cell)
            case FirstPass(cell):
                return self.first(cell)
            case Round(cell):
                return self.round(cell)
            case MakeSheet(name, material):
                return self.bench.catalogue.sheet(name, material)
            case MakeStudy(name):
                self.clear()
                return self.study(name)
            case MakeFilm(animation):
                self.clear()
                return film(animation, self.bench.catalogue)

    def clear(self) -> None:
        """Forget scene, reference and prepared states: what follows needs none, and may need their memory."""
        self.spec = self.scene = self.truth = None
        self.without.clear()
        self.prepared.clear()

    def study(self, name: str) -> Study:
        """Make a table of the catalogue's, timed."""
        if name not in self.bench.catalogue.studies:
            raise unknown("study", name, self.bench.catalogue.studies)
        start = time.perf_counter()
        try:
            study = self.bench.catalogue.studies[name]()
        except NeedsData as absent:
            study = Study.missing(name, _line(absent), needs_data=True)
        if not isinstance(study, Study):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise BadInput(f"study '{name}' must return a Study. Got {type(study).__name__} instead.")
        return replace(study, name=name, seconds=time.perf_counter() - start)

    def open(self, spec: SceneSpec) -> tuple[Scene, Reference]:
        """Return a scene and its reference, after clearing the desk of any other, and of states of another asset."""
        if self.scene is None or self.truth is None or self.spec != spec:
            asset = None if self.scene is None else (self.scene.material.key, self.scene.geometry.rest.key)
            self.scene = self.truth = None
            self.without.clear()
            settings = spec.reference(self.settings)
            scene = spec.build(self.bench.catalogue)
            scene = self.bench.catalogue.effects(scene, spec.planning, settings, self.setup.cache)
            if asset != (scene.material.key, scene.geometry.rest.key):
                self.prepared.clear()
            truth = self.bench.catalogue.reference(scene, settings, self.setup.cache)
            _ = scene.points.reflection  # part of the queries: no method pays for it
            self.spec, self.scene, self.truth = spec, scene, truth
        return self.scene, self.truth

    def leave_out(self, cell: CellSpec) -> float:
        """Have the reference without the effects that a cell's method lacks at hand, where there is one to be had.

        Returns
        -------
        float
            Seconds that computing it took; 0 if it was there.
        """
        scene, _ = self.open(cell.scene)
        method = cell.method.called_for(scene)
        lacks = method.lacks(scene)
        less = attribution.without(scene, lacks)
        if less is None or lacks in self.without or method.refusal(scene) is not None:
            return 0.0
        made = self.bench.catalogue.reference(less, cell.scene.reference(self.settings), self.setup.cache)
        self.without[lacks] = made
        return 0.0 if made.from_cache else made.seconds

    def first(self, cell: CellSpec) -> CellResult:
        """Render and score a cell."""
        scene, truth = self.open(cell.scene)
        method = cell.method.called_for(scene)
        lacks = method.lacks(scene)
        named = tuple(sorted(effect.value for effect in lacks))
        blank = CellResult(cell.key, cell.scene.name, method.name, dict(cell.settings), Status.OK, lacks=named)
        declined = method.refusal(scene)
        if declined is not None:
            return replace(blank, status=Status.DECLINED, reason=_line(declined))
        known = self.prepared.get(identity(method))
        try:
            state, framed, answer, seconds = render(method, scene, known)
        except BadInput as refused:
            return replace(blank, status=Status.DECLINED, reason=_line(refused))
        radiance = checked(answer, len(scene.points))
        if known is None:
            self.prepared[identity(method)] = Prepared(state, scene.name, seconds[Phase.PREPARE])
        paid = [Timing(Phase.PREPARE, known.first, tuple(known.rounds), shared=True)] if known else []
        predictions = method.predictions(state, scene.environment)
        return replace(
            blank,
            timings=(*paid, *(Timing(phase, s) for phase, s in seconds.items())),
            scores=metrics.score(radiance, truth, scene.points, without=self.without.get(lacks)),
            bytes=footprint(framed),
            predictions={str(theory): float(error) for theory, error in predictions.items()},
            description=settled(cell.method, method) | plain(method.describe(state)),
            image=image(radiance, scene),
        )

    def round(self, cell: CellSpec) -> dict[Phase, float]:
        """Time a cell's phases once, after a warm-up where this worker did not make the first pass."""
        scene, _ = self.open(cell.scene)
        method = cell.method.called_for(scene)
        key = identity(method)
        if key not in self.prepared:
            state, _, _, seconds = render(method, scene)
            self.prepared[key] = Prepared(state, scene.name, seconds[Phase.PREPARE])
        known = self.prepared[key]
        again = known.scene == scene.name and known.first <= SLOW_PREPARE
        seconds = render(method, scene, None if again else known)[-1]
        known.rounds += [seconds[Phase.PREPARE]] if again else []
        return seconds


def _line(reason: object) -> str:
    return " ".join(str(reason).split())


def settled(asked: Method, made: Method) -> dict[str, Any]:
    """Return the settings that a scene has settled."""
    before = values(asked)
    return {name: value for name, value in values(made).items() if value != before[name]}


def render(method: Method, scene: Scene, known: Prepared | None = None) -> tuple[Any, Any, Any, dict[Phase, float]]:
    """Take a method's four steps, or the last three from what is `known`.

    Returns
    -------
    prepared, framed : the first and the last state
    values : the answer
    seconds : dict of Phase to float
    """
    seconds: dict[Phase, float] = {}
    if known is not None:
        prepared = known.state
    else:
        prepared, seconds[Phase.PREPARE] = timing.timed(lambda: method.prepare(scene.material, scene.geometry.rest))
    relit, seconds[Phase.RELIGHT] = timing.timed(lambda: method.relight(prepared, scene.environment))
    framed, seconds[Phase.FRAME] = timing.timed(lambda: method.frame(relit, scene.viewer))
    values, seconds[Phase.SHADE] = timing.timed(lambda: modulated(method.shade(framed, scene.points), scene.points))
    return prepared, framed, values, seconds


def image(values: NDArray[np.floating], scene: Scene) -> NDArray[np.float32] | None:
    """Lay radiance out as an image (H, W, 3) float32 where the points form one."""
    if scene.points.pixel is None:
        return None
    return scene.points.image(values.astype(np.float32)).astype(np.float32)


def describe(spec: SceneSpec, scene: Scene, truth: Reference) -> SceneResult:
    """Return what the store keeps of a scene and its reference."""
    return SceneResult(
        name=spec.name,
        light=spec.light,
        material=spec.material,
        geometry=spec.geometry,
        view=spec.view,
        specs=plain(spec.meaning),
        effects=tuple(sorted(effect.value for effect in scene.effects)),
        decisions=scene.decisions,
        points=len(scene.points),
        reference_key=truth.key,
        reference_floor=truth.floor,
        reference_target=truth.target,
        reference_samples=truth.samples,
        reference_replicates=len(truth.replicates),
        reference_seconds=truth.seconds,
        reference_from_cache=truth.from_cache,
        reference_rms=truth.rms,
        notes=(
            *effects.warnings(scene.decisions, spec.planning.limit),
            *remarks(scene),
            *filter(None, [furnace.clipping(scene)]),
            *truth.notes,
        ),
        **spec.place(),
        image=image(truth.mean, scene),
    )
