"""Scenes on which decisions about effects are judged: some whose answer is known, and some drawn at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import CATALOGUE
from envbench.catalogue import Spec
from envbench.errors import BadInput
from envbench.scene import Effect, Scene

Table = Mapping[str, Any]

_SHADOW, _BOUNCE, _POSE = Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION
_VIEW, _TANGENT, _DETAIL, _INSIDE = Effect.VIEW_DEPENDENCE, Effect.ANISOTROPY, Effect.LIGHT_DETAIL, Effect.SUBSURFACE


@dataclass(frozen=True)
class Known:
    """A scene by its tables, the effects that it calls for, and why."""

    name: str
    light: Spec
    material: Spec
    geometry: Spec
    view: Spec
    effects: frozenset[Effect]
    why: str

    def build(self) -> Scene:
        """Build the scene with the effects that its facts call for."""
        return CATALOGUE.scene(
            name=self.name, light=self.light, material=self.material, geometry=self.geometry, view=self.view
        )


def _diffuse(reflectance: float) -> Table:
    return {"kind": "lambertian", "reflectance": [reflectance] * 3}


SKY = {"kind": "band-limited", "order": 5, "seed": 3, "size": 240}
"""Light of six bands: nothing beyond them is left to simulate."""
CONSTANT = {"kind": "constant"}
LAMP = {"kind": "lamps", "lamps": [{"direction": [0.5, -0.4, 0.77], "width": 0.06, "radiance": 200.0}]}

_FRONT = {"kind": "image", "size": 64, "direction": [0.3, -1.0, 0.4]}
_ABOVE = {"kind": "image", "size": 64, "direction": [0.2, -0.5, 1.0]}
_INTO = {"kind": "image", "size": 64, "direction": [0.1, -0.2, 1.0]}
_BETWEEN = {"kind": "vertices"}


def _known(name: str, light: Any, material: Table, geometry: Any, view: Table, effects: set[Effect], why: str) -> Known:
    found = CATALOGUE.lights[light] if isinstance(light, str) else light
    shape = CATALOGUE.geometries[geometry] if isinstance(geometry, str) else geometry
    return Known(name, found, material, shape, view, frozenset(effects), why)


def known() -> tuple[Known, ...]:
    """Return the scenes of known answer: effects that contribute much there, or nothing at all."""
    presets = CATALOGUE.materials
    return (
        _known("convex diffuse", SKY, _diffuse(0.8), "ellipsoid", _FRONT, set(), "nothing is in the way of light"),
        _known("convex glossy", "esplanade", {"kind": "phong", "exponent": 256.0}, "ellipsoid", _FRONT,
               {_VIEW, _DETAIL}, "a sharp image of a detailed light"),
        _known("bowl", SKY, _diffuse(0.7), "bowl", _INTO, {_SHADOW, _BOUNCE}, "its inside sees half of itself"),
        _known("tube", SKY, _diffuse(0.8), "tube", _BETWEEN, {_SHADOW, _BOUNCE}, "light goes in by several bounces"),
        _known("cloth fold", SKY, _diffuse(0.01), "cloth-folded", _ABOVE, {_SHADOW, _POSE},
               "flat at rest, so that its folds alone shadow; too dark to send light on"),
        _known("facing walls, white", SKY, _diffuse(0.9), "walls", _BETWEEN, {_SHADOW, _BOUNCE},
               "each fills much of the other's view"),
        _known("facing walls, black", SKY, _diffuse(0.0004), "walls", _BETWEEN, {_SHADOW}, "what hides sends nothing"),
        _known("thin membrane", SKY, presets["membrane"], "patch-flat", _ABOVE, set(), "flat, and both sides seen"),
        _known("waffle", SKY, TRANSLUCENT, "slab-waffle", _ABOVE, {_INSIDE}, "light leaves where it did not enter"),
        _known("anisotropic hair", "esplanade", presets["kajiya-kay"], "sphere", _FRONT, {_VIEW, _TANGENT, _DETAIL},
               "highlights about the tangent"),
        _known("posed bat", SKY, _diffuse(0.01), "bat-flying", _FRONT, {_SHADOW, _POSE},
               "wings raised shadow the body, and it is too dark to send light on"),
        _known("constant light", CONSTANT, _diffuse(0.7), "bowl", _INTO, {_SHADOW, _BOUNCE},
               "light has no detail to lose"),
        _known("one lamp", LAMP, _diffuse(0.8), "ellipsoid", _FRONT, {_DETAIL}, "brighter and smaller than six bands"),
    )  # fmt: skip


TRANSLUCENT = {"kind": "translucent", "reflectance": [0.8, 0.8, 0.8], "mean_free_path": 0.05, "albedo": 1.0}


_MATERIALS: tuple[Table, ...] = (
    _diffuse(0.02), _diffuse(0.1), _diffuse(0.3), _diffuse(0.6), _diffuse(0.9),
    {"lobes": [{"kind": "lambertian", "reflectance": [0.4, 0.3, 0.2]},
               {"kind": "phong", "exponent": 32.0, "reflectance": [0.05, 0.05, 0.05]}]},
    {"lobes": [{"kind": "lambertian", "reflectance": [0.5, 0.5, 0.5]},
               {"kind": "ggx", "roughness": 0.5, "f0": [0.04, 0.04, 0.04]}]},
    {"kind": "phong", "exponent": 4.0, "reflectance": [0.6, 0.6, 0.6]},
    {"kind": "phong", "exponent": 64.0, "reflectance": [0.3, 0.5, 0.7]},
    {"kind": "ggx", "roughness": 0.4, "f0": [0.9, 0.6, 0.4]},
    {"lobes": [{"kind": "kajiya-kay-diffuse", "reflectance": [0.3, 0.2, 0.1]},
               {"kind": "kajiya-kay", "exponent": 16.0, "reflectance": [0.2, 0.2, 0.2]}]},
    {"kind": "membrane", "transparency": 0.5, "reflectance": [0.6, 0.6, 0.6]},
)  # fmt: skip
"""What random scenes are made of: few, since each is compiled into Mitsuba's kernels."""


def drawn(seed: int) -> Scene:
    """Return a random scene: light, material, shape, pose and view, from easy to extreme; in view it is for certain."""
    rng = np.random.default_rng((0x5CE9E, seed))
    light, material, geometry = _light(rng), _MATERIALS[rng.integers(len(_MATERIALS))], _shape(rng)
    while True:
        try:
            return CATALOGUE.scene(
                name=f"random {seed}", light=light, material=material, geometry=geometry, view=_view(rng)
            )
        except BadInput:  # from there it turns its back
            continue


def _light(rng: np.random.Generator) -> Table:
    seed = int(rng.integers(2**31))
    match int(rng.integers(7)):
        case 0:
            return {"kind": "constant"}
        case 1:
            return {"kind": "lamps", "count": int(rng.integers(1, 4)), "seed": seed, "size": 128}
        case 2:
            return {"kind": "band-limited", "order": int(rng.integers(1, 16)), "seed": seed, "size": 64}
        case 3:
            return {"kind": "noise", "size": 16, "seed": seed}
        case 4:
            return {"kind": "band-limited", "order": int(rng.integers(3, 6)), "seed": seed, "size": 240}
        case _:
            return CATALOGUE.lights[_captured(rng)]


def _captured(rng: np.random.Generator) -> str:
    return str(rng.choice(["esplanade", "studio", "workshop"]))


def _shape(rng: np.random.Generator) -> Table:
    deep = float(np.exp(rng.uniform(np.log(0.01), np.log(0.5))))
    match int(rng.integers(8)):
        case 0:
            return {"kind": "ellipsoid", "axes": rng.uniform(0.3, 1.0, 3).tolist()}
        case 1:
            rim = rng.uniform(0.3, 2.0)
            return {"kind": "vase", "profile": [[0.7, rim * 0.5], [0.5, rim * 0.1], [0.02, 0.0]]}
        case 2:
            return {"kind": "vase", "profile": [[0.3, float(rng.uniform(0.2, 2.0))], [0.3, 0.0]]}
        case 3:
            return {"kind": "walls", "gap": float(np.exp(rng.uniform(np.log(0.2), np.log(8.0))))}
        case 4:
            return {"kind": "vase", "pose": {"kind": "bend", "degrees": float(rng.uniform(5, 90)), "axis": "z",
                                             "towards": "x"}}  # fmt: skip
        case 5:
            return {**_sheet(rng, 0.0), "pose": {"kind": "wave", "amplitude": deep / 3, "cycles": 2.0}}
        case 6:
            return {**_sheet(rng, deep / 4), "pose": {"kind": "onto", "surface": "bent"}}
        case _:
            return _sheet(rng, deep / 2)


def _sheet(rng: np.random.Generator, height: float) -> Table:
    texture = str(rng.choice(["bumps", "weave", "waffle", "swirl"]))
    return {"kind": "patch", "texture": texture, "tiles": 3, "size": 1.0, "resolution": 73, "height": height}


def _view(rng: np.random.Generator) -> Table:
    height = rng.uniform(0.5, 1.0)
    angle = rng.uniform(0, 2 * np.pi)
    side = np.sqrt(1 - height**2)
    direction = np.array([side * np.cos(angle), side * np.sin(angle), height])
    if rng.random() < 0.5:
        return {"kind": "image", "size": 80, "direction": direction.tolist()}
    return {"kind": "image", "size": 80, "eye": (4 * direction).tolist(), "fov": 30.0}
