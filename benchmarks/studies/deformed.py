"""Figures 1 and 5 to 7 of Sloan, Luna and Snyder 2005: shapes in poses, by LDPRT and its rivals, against Mitsuba."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks import CATALOGUE
from benchmarks.studies.contact_sheet import compose
from benchmarks.studies.renderings import LOCAL, SCALE, SHADOWS, TONED, rendered, shaded
from benchmarks.studies.stand_ins import ONTO_VASE, RELIEF, SHEET
from envbench.catalogue import Spec
from envbench.records import Picture, Study
from envbench.scene import Effect
from methods.ldprt import LDPRT, GlossyLDPRT, SHRotation, StaticPRT

RAYS = 2000
LDPRT_, UNSHADOWED, STATIC = "LDPRT", "unshadowed", "not turned"
FRONT, ABOVE = (0.3, -1.0, 0.25), (0.2, -0.7, 0.9)
LIGHT_4: dict[str, Any] = {"kind": "projected", "of": "studio", "order": 4}
GLOSSY: dict[str, Any] = {"kind": "cook-torrance", "roughness": 0.3}
BENT: dict[str, Any] = {"kind": "onto", "surface": "bent"}
WAVED: dict[str, Any] = {"kind": "wave", "amplitude": 0.08}
VASE: list[dict[str, Any]] = [
    {"kind": "onto", "surface": "vase"},
    {"kind": "bend", "degrees": 50.0, "axis": "z", "towards": "x"},
]


@dataclass(frozen=True)
class Case:
    """A shape to show, and by what.

    Attributes
    ----------
    local, whole : sequence of Effect
        What the two references simulate.
    """

    name: str
    geometry: Spec
    methods: Mapping[str, Any]
    light: Spec | str = "studio-6"
    material: Spec | str = "lambertian"
    direction: Sequence[float] = FRONT
    local: Sequence[Effect] = LOCAL
    whole: Sequence[Effect] = SHADOWS


@dataclass
class _Prepared:
    """Methods that were prepared, by shape at rest, so that poses share it."""

    kept: dict[tuple[str, str], Any] = field(default_factory=dict[tuple[str, str], Any])

    def of(self, name: str, method: Any, scene: Any) -> Any:
        key = scene.geometry.rest.key + scene.material.key, name
        if key not in self.kept:
            self.kept[key] = method.prepare(scene.material, scene.geometry.rest)
        return self.kept[key]


def _compared(
    name: str, title: str, text: str, cases: Sequence[Case], rival: str, notes: Sequence[str] = ()
) -> Study:  # fmt: skip
    """Return the errors of each case's methods, a row a method, and their pictures."""
    prepared, rows, tiles = _Prepared(), [], []
    columns = list(cases[0].methods)
    for case in cases:
        local, whole = (
            rendered(case.geometry, effects, light=case.light, material=case.material, direction=case.direction)
            for effects in (case.local, case.whole)
        )
        found = {m: shaded(by, whole.scene, prepared.of(m, by, whole.scene)) for m, by in case.methods.items()}
        errors = {m: (local.error(values), whole.error(values)) for m, values in found.items()}
        for method, (near, all_) in errors.items():
            best = all_ < errors[rival][1] if method == LDPRT_ and rival in errors else None
            rows.append((case.name, method, near, all_, best))
        tiles.append(
            [
                whole.reference(),
                *(whole.tile(found[m], f"error {errors[m][1]:.3f}") if m in found else None for m in columns),
                whole.difference(found[LDPRT_], SCALE),
            ]
        )
    sheet = compose(
        tiles,
        columns=("reference", *columns, "LDPRT less reference"),
        labels=[case.name for case in cases],
        notes=(TONED,),
        scale=SCALE,
    )
    return Study(
        name, title, text,
        ("shape", "method", "error, local effects", "error, all shadows", f"LDPRT nearer than {rival}"),
        tuple(rows), tuple(notes),
        pictures=(Picture(name, "The reference has all shadows of the posed mesh.", sheet),),
    )  # fmt: skip


_NRMSE = "NRMSE over the pixels, the reference's noise taken off, 0 below it"
_ERRORS = (
    f"{_NRMSE}: against Mitsuba with the shadows of the shape at rest carried along, which LDPRT approximates, and "
    "with those of the shape as it is posed, which are shown."
)


def deformed_patch() -> Study:
    """Return figure 5: texture patches, deformed."""
    diffuse = {LDPRT_: LDPRT(rays=RAYS), UNSHADOWED: SHRotation(transfer="unshadowed"), STATIC: StaticPRT(rays=RAYS)}
    cases = [
        Case("bumps, waved", _patch("bumps", 0.075, WAVED), diffuse, direction=ABOVE),
        Case("bumps, bent", _patch("bumps", 0.075, BENT), diffuse, direction=(1.0, -0.3, 0.5)),
        Case("weave, waved", _patch("weave", 0.0625, WAVED), diffuse, direction=ABOVE),
        Case("waffle, bent", _patch("waffle", 0.1, BENT), diffuse, direction=(1.0, -0.3, 0.5)),
    ]
    return _compared(
        "deformed-patch", "Texture patches in a pose, by transfer simulated on the flat patch",
        f"n = 6, N = 4, {RAYS:,} rays a vertex, under `studio` projected to six bands. {_ERRORS}",
        cases, UNSHADOWED,
    )  # fmt: skip


def deformed_head(stand_in: bool = False) -> Study:
    """Return figure 6: the head, or a woven vase, bent and twisted, each ray traced, not turned, and by LDPRT."""
    bend = {"kind": "bend", "degrees": 60.0, "axis": "z", "towards": "x"}
    twist = {"kind": "twist", "degrees": 90.0, "axis": "z"}
    methods = {STATIC: StaticPRT(), LDPRT_: LDPRT(), UNSHADOWED: SHRotation(transfer="unshadowed")}
    shape, first = (RELIEF, [ONTO_VASE]) if stand_in else (CATALOGUE.geometries["head"], [])
    poses = (("bent", [bend]), ("twisted", [twist]), ("bent and twisted", [twist, bend]))
    cases = [Case(label, {**shape, "pose": [*first, *pose]}, methods) for label, pose in poses]
    what = "A woven vase" if stand_in else "The head"
    return _compared(
        "deformed-vase" if stand_in else "deformed-head",
        f"{what}, bent and twisted: ray traced, with undeformed transfer, by LDPRT",
        f"n = 6, N = 4, 5,000 rays a vertex, under `studio` projected to six bands. {_ERRORS}",
        cases, STATIC,
    )  # fmt: skip


def textured_vase() -> Study:
    """Return figure 7: textures on a bent vase, one of them glossy."""
    diffuse = {LDPRT_: LDPRT(rays=RAYS), UNSHADOWED: SHRotation(transfer="unshadowed"), STATIC: StaticPRT(rays=RAYS)}
    glossy = {LDPRT_: GlossyLDPRT(), UNSHADOWED: GlossyLDPRT(transfer="unshadowed"),
              "7 rows": GlossyLDPRT(rows=7)}  # fmt: skip
    view = Effect.VIEW_DEPENDENCE
    cases = [
        *(Case(name, _vase(name, height), diffuse) for name, height in
          (("bumps", 0.15), ("weave", 0.1), ("swirl", 0.06), ("waffle", 0.2))),
        Case("weave, glossy", _vase("weave", 0.1), glossy, LIGHT_4, GLOSSY, FRONT, (view, *LOCAL), (view, *SHADOWS)),
    ]  # fmt: skip
    return _compared(
        "textured-vase", "Textures laid onto a vase that bends, by transfer simulated on the flat patch",
        f"n = 6, N = 4, {RAYS:,} rays a vertex, under `studio` projected to six bands; glossy: Cook-Torrance of "
        f"roughness .3, n = 4, n_b = 3, N = 3, under four bands. {_ERRORS}",
        cases, UNSHADOWED,
        ("Glossy, three rows leave out most of what is missing (glossy-head): seven stand beside them.",),
    )  # fmt: skip


def flying_bat(stand_in: bool = False) -> Study:
    """Return figure 1: the bat as a thin membrane in its wing beat, or a sheet that waves."""
    methods = {
        LDPRT_: LDPRT(order=3, lobes=1, transfer="unshadowed"),
        "LDPRT of six bands": LDPRT(order=6, lobes=1, transfer="unshadowed"),
        STATIC: StaticPRT(order=3, transfer="unshadowed"),
    }
    if stand_in:
        shapes = {f"amplitude {a:g}": {**SHEET, "pose": {"kind": "wave", "amplitude": a}} for a in (-0.1, 0.05, 0.15)}
    else:
        bat = CATALOGUE.geometries["bat"]
        shapes = {f"time {t:g}": {**bat, "pose": {"kind": "skin", "time": t}} for t in (0.0, 0.3, 0.6)}
    cases = [
        Case(name, shape, methods, material="membrane", direction=(0.3, -1.0, 0.5), local=(), whole=SHADOWS)
        for name, shape in shapes.items()
    ]
    return _compared(
        "waving-membrane" if stand_in else "flying-bat",
        f"{'A sheet' if stand_in else 'The bat'} as a thin membrane, in three poses",
        "One lobe about the normal in closed form (eq. 23), n = 3, under `studio` projected to six bands. "
        f"{_NRMSE}: against Mitsuba without shadows, as the membrane's transfer has it, and with all of them.",
        cases, STATIC,
        ("The light has six bands and the transfer three: six bands show what the others are worth.",),
    )  # fmt: skip


def _patch(texture: str, height: float, pose: Any) -> dict[str, Any]:
    return {
        "kind": "patch", "tiles": 4, "size": 1.0, "resolution": 97, "texture": texture, "height": height, "pose": pose,
    }  # fmt: skip


def _vase(texture: str, height: float) -> dict[str, Any]:
    """Return the table of a patch on the vase: tiles of 24 vertices, half as many as the presets', twice as large."""
    return {
        "kind": "patch", "tiles": [5, 4], "size": [2.5, 2.0], "resolution": [121, 97], "texture": texture,
        "height": height, "pose": VASE,
    }  # fmt: skip
