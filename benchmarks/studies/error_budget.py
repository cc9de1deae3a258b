"""Where LDPRT's error comes from on a bent head: each cause measured by itself, and all together against the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks import CATALOGUE
from benchmarks.studies.renderings import distance, shaded
from envbench import real_harmonics
from envbench.directions import Array
from envbench.records import Study
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Effect, Scene
from methods.ldprt import LDPRT, SHRotation
from methods.ldprt.simulated import SIMULATIONS, Request
from methods.ldprt.transfer import Kind
from references import reference

COUNT, FLOOR, BUDGET = 2048, 3e-3, 12.0
LIGHT = "studio"


def error_budget() -> Study:
    """Return each cause's RMS error, of the RMS radiance, with what it was measured between."""
    light, projected = CATALOGUE.lights[LIGHT], CATALOGUE.lights[f"{LIGHT}-6"]
    scenes: dict[str, Scene] = {
        name: CATALOGUE.scene(
            name="head", light=of, material=CATALOGUE.materials["lambertian"],
            geometry=CATALOGUE.geometries["head-bent"], view={"kind": "vertices", "count": COUNT}, effects=effects,
        )
        for name, of, effects in (
            ("whole", light, (Effect.SELF_SHADOWING, Effect.DEFORMATION, Effect.LIGHT_DETAIL)),
            ("banded", projected, (Effect.SELF_SHADOWING, Effect.DEFORMATION)),
            ("local", projected, (Effect.SELF_SHADOWING,)),
        )
    }  # fmt: skip
    settings = ReferenceSettings(floor=FLOOR, budget=BUDGET)
    truth = {name: reference(scene, settings) for name, scene in scenes.items()}
    scene = scenes["local"]
    exact, evaluated, tabled = (shaded(m, scene) for m in (SHRotation(), LDPRT(), LDPRT(table=True)))
    noise = _ray_noise(scene)
    rms = truth["whole"].rms
    floor = {name: found.floor * found.rms / rms for name, found in truth.items()}
    banded, distant = _apart(truth["whole"], truth["banded"]), _apart(truth["banded"], truth["local"])
    causes: list[tuple[str, float, str]] = [
        ("band limit of the light", banded / rms, "references: the light, its projection"),
        ("distant effects", distant / rms, "references: visibility posed, at rest"),
        ("noise of the rays", noise / rms, "standard error of the transfer, lit"),
        ("zonal fit", _rms(evaluated - exact) / rms, "four lobes against whole vectors, fully rotated"),
        ("table lookup", _rms(tabled - evaluated) / rms, "eq. 25 against eq. 13"),
    ]  # fmt: skip
    together = float(np.sqrt(sum(error**2 for _, error, _ in causes)))
    whole = distance(tabled, truth["whole"]) / rms
    left = distance(exact, truth["local"]) / rms
    rows: list[tuple[str | float | bool | None, ...]] = [*causes]
    rows += [
        ("all, as independent", together, "root of the sum of squares"),
        ("whole", whole, "LDPRT with its table against the reference under the light, all effects"),
        (
            "remainder",
            left,
            "whole vectors against the reference of local effects under the projection: vertices, floors",
        ),
    ]
    return Study(
        "error-budget",
        f"Error budget of LDPRT: the bent head under {LIGHT}, {COUNT:,} vertices",
        "RMS errors relative to the RMS radiance of the reference, the references' own noise taken off where two are "
        "compared. n = 6, N = 4, 5,000 rays a vertex, 64 x 32 table. Glossy transfer adds the rows left out: see "
        "glossy-head.",
        ("cause", "error", "measured between"),
        tuple(rows),
        (
            f"Together the causes make {together / whole:.2f} of the whole; they are not quite independent.",
            "Noise floors of the references: "
            + ", ".join(f"{name} {value:.2g}" for name, value in floor.items())
            + ".",
        ),
    )


def _ray_noise(scene: Scene) -> float:
    """Return the RMS over points of the radiance's standard error, each vertex turned."""
    transfer = SIMULATIONS.get(scene.geometry, Request(6, Kind.SHADOWED, 5000, 0, 1.0, 0))
    again = SIMULATIONS.get(scene.geometry, Request(6, Kind.SHADOWED, 5000, 0, 1.0, 1))
    light = real_harmonics.project(scene.environment.radiance, 5)
    # a turn mixes the coefficients of a band alone, and the noise of all turns alike: two runs differ by sqrt(2) of it
    off = again.vectors - transfer.vectors
    band = np.repeat(np.arange(6), 2 * np.arange(6) + 1)
    power = np.array([(off[:, band == l] ** 2).sum(1).mean() / (2 * l + 1) for l in range(6)])
    shone = np.array([(light[band == l] ** 2).sum(0).mean() for l in range(6)])
    return float(np.sqrt((power * shone).sum() / 2))


def _apart(a: Reference, b: Reference) -> float:
    """Return the RMS difference of two references, their noise taken off."""
    noise = (a.standard_error**2).mean(-1) + (b.standard_error**2).mean(-1)
    square = ((a.mean - b.mean) ** 2).mean(-1)
    return float(np.sqrt(max(((square - noise) * a.weight).sum(), 0.0)))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def transfer_agreement() -> Study:
    """Return simulated transfer against Mitsuba's rendering of the head at rest under band-limited lights."""
    rows: list[tuple[str | float | bool, ...]] = []
    for name in ("esplanade-6", "studio-6", "workshop-6"):
        scene = CATALOGUE.scene(
            name="head", light=CATALOGUE.lights[name], material=CATALOGUE.materials["lambertian"],
            geometry=CATALOGUE.geometries["head"], view={"kind": "vertices", "count": COUNT},
            effects=(Effect.SELF_SHADOWING,),
        )  # fmt: skip
        truth = reference(scene, ReferenceSettings(floor=FLOOR, budget=BUDGET))
        found = shaded(SHRotation(), replace(scene, points=scene.points))
        apart = float(np.sqrt((((found - truth.mean) ** 2).mean(-1) * truth.weight).sum())) / truth.rms
        expected = float(np.hypot(_ray_noise(scene) / truth.rms, truth.floor))
        bias = float(((found - truth.mean).mean(-1) * truth.weight).sum()) / truth.rms
        rows.append((name, apart, expected, apart / expected, bias))
    return Study(
        "transfer-agreement",
        f"Simulated transfer against Mitsuba's own rendering: the head at rest, {COUNT:,} vertices",
        "RMS difference of t . e and the reference (positive less negative part of the projected light), over "
        "the reference's "
        "RMS; beside what the standard error of 5,000 rays a vertex and the reference's noise floor make together.",
        ("light", "difference", "expected of the noise", "ratio", "mean difference"),
        tuple(rows),
    )
