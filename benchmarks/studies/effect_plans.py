"""Whether just the effects that matter are simulated: on scenes whose answer is known, and on random ones."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from benchmarks import CATALOGUE
from benchmarks.studies.effect_scenes import Known, known
from data_gen.lobes import Lambertian
from envbench.effects import EffectSettings
from envbench.errors import NeedsData
from envbench.records import Study
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Plan, Scene
from methods.ldprt import LDPRT
from methods.ldprt.simulated import SIMULATIONS
from references import reference

KNOWN = ReferenceSettings(floor=5e-3, budget=200.0, bounces=8)
"""To a noise as large as the tolerance."""
RAYS = 1000
"""From each vertex, of the transfer that is timed."""
PLANNING = EffectSettings()
"""Accuracy .05: the tolerance is .005."""
MOST_SHARE = 0.05
"""Of what is saved, that probes may cost."""
LEAST_GAIN = 3.0


Row = tuple[str | float | int | bool | None, ...]


@dataclass(frozen=True)
class Outcome:
    """A scene planned and with everything on: what differs, and seconds of references, transfer and probes."""

    scene: Scene
    difference: float
    allowed: float
    planned: float
    everything: float
    probes: float
    rays: int

    @property
    def saved(self) -> float:
        """Seconds, the probes not counted."""
        return self.everything - self.planned


def effects_known() -> Study:
    """Return for each scene of known answer: the effects planned, whether they are right, and what that saves."""
    rows: list[Row] = []
    outcomes: list[Outcome] = []
    notes: list[str] = []
    for case in known():
        try:
            scene = case.build()
        except NeedsData as error:
            notes.append(f"{case.name} is left out: {error}")
            continue
        found = compare(scene, PLANNING, KNOWN)
        outcomes.append(found)
        rows.append(_row(case, found))
    rows.append(_together(rows, outcomes))
    saved, spent = sum(o.saved for o in outcomes), sum(o.probes for o in outcomes)
    gain = sum(o.everything for o in outcomes) / (sum(o.planned for o in outcomes) + spent)
    notes += [
        f"Everything on takes {gain:.2f} times as long as what was planned, probes included: "
        f"at least {LEAST_GAIN:g} {_holds(gain >= LEAST_GAIN)}.",
        f"Probes took {spent / saved:.1%} of what they saved: "
        f"at most {MOST_SHARE:.0%} {_holds(spent <= MOST_SHARE * saved)}.",
    ]
    return Study(
        "effects-known",
        "Effects planned on scenes of known answer",
        f"Tolerance {PLANNING.limit:g} of the RMS radiance. Times are those of the reference, to a noise floor of "
        f"{KNOWN.floor:g}, and of diffuse transfer ({RAYS:,} rays a vertex) where the "
        "material is diffuse and the shape a mesh: with the effects planned, and with everything on: one path tracer "
        f"for all that may occur (light and lobes sampled, {KNOWN.bounces} bounces, rays whatever the shape; volpath "
        "where light scatters inside). Where all that occurs matters, a plan saves by how it is simulated: light "
        "without detail needs no sampling, and a diffuse surface is known in closed form but for what shadows it.",
        ("scene", "known to matter", "planned", "as known", "why", "difference", "within tolerance and noise",
         "planned (s)", "everything on (s)", "probes (s)", "times faster", "visibility rays"),
        tuple(rows),
        tuple(notes),
    )  # fmt: skip


def _together(rows: list[Row], outcomes: list[Outcome]) -> Row:
    planned, everything, probes = (
        sum(getattr(o, key) for o in outcomes) for key in ("planned", "everything", "probes")
    )
    return (
        "all together", "", "", all(row[3] for row in rows), "", None, all(row[6] for row in rows),
        planned, everything, probes, everything / (planned + probes), sum(o.rays for o in outcomes),
    )  # fmt: skip


def _holds(said: bool) -> str:
    return "holds" if said else "does not hold"


def _row(case: Known, found: Outcome) -> Row:
    effects = found.scene.effects & occasions(found.scene)
    return (
        case.name, _listed(case.effects), _listed(effects), effects == case.effects, case.why, found.difference,
        found.difference <= found.allowed, found.planned, found.everything, found.probes,
        found.everything / (found.planned + found.probes), found.rays,
    )  # fmt: skip


def occasions(scene: Scene) -> frozenset[Effect]:
    """Return the effects that decisions do not rule out by a fact."""
    return frozenset(d.effect for d in scene.decisions if d.simulated)


def _listed(effects: frozenset[Effect]) -> str:
    return ", ".join(sorted(effects)) or "none"


def compare(scene: Scene, planning: EffectSettings, settings: ReferenceSettings) -> Outcome:
    """Plan a scene, and make reference and transfer of the plan and of everything on.

    Kernels are compiled before, for both.
    """
    everything = CATALOGUE.effects(scene, replace(planning, plan=Plan.ALL), settings, None)
    planned = CATALOGUE.effects(scene, planning, settings, None)
    for each in (planned, everything):
        reference(each, replace(settings, floor=1.0))
    some = reference(planned, settings)
    every = reference(everything, settings)
    noise = np.hypot(some.floor, every.floor)
    return Outcome(
        planned,
        apart(every, some),
        planning.limit + float(noise),
        some.seconds + transfer_seconds(planned),
        every.seconds + transfer_seconds(everything),
        _probed(planned),
        some.visibility_rays,
    )


def _probed(scene: Scene) -> float:
    return sum(d.seconds for d in scene.decisions)


def apart(full: Reference, other: Reference) -> float:
    """Return the RMS difference of two references of the same points, over the RMS of the first; noise taken off."""
    noise = (full.standard_error**2 + other.standard_error**2).mean(-1)
    square = ((full.mean - other.mean) ** 2).mean(-1) - noise
    return float(np.sqrt(max((square * full.weight).sum(), 0.0))) / (full.rms or 1.0)


def transfer_seconds(scene: Scene) -> float:
    """Return what simulating the transfer takes that a scene calls for: 0 where it is not diffuse, or no mesh."""
    diffuse = all(isinstance(lobe, Lambertian) for lobe in scene.material.lobes)
    if not diffuse or scene.geometry.mesh is None:
        return 0.0
    taken: list[float] = []
    for _ in range(2):  # the first compiles
        SIMULATIONS.kept.clear()
        start = time.perf_counter()
        LDPRT(lobes=1, rays=RAYS).called_for(scene).prepare(scene.material, scene.geometry.rest)
        taken.append(time.perf_counter() - start)
    return min(taken)
