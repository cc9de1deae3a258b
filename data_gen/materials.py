"""Materials by name or by a table of a suite: `build` makes them, `MATERIALS` are the presets."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from data_gen import brdf_checks, measured, texture
from data_gen.lobes import (
    GGX,
    CookTorrance,
    KajiyaKay,
    KajiyaKayDiffuse,
    Lafortune,
    Lambertian,
    Membrane,
    Microfacet,
    Phong,
)
from envbench.errors import BadInput, unknown
from envbench.material import Centre, Lobe, Material, Medium

LOBES: dict[str, type[Lobe]] = {
    "lambertian": Lambertian,
    "phong": Phong,
    "microfacet": Microfacet,
    "lafortune": Lafortune,
    "kajiya-kay": KajiyaKay,
    "kajiya-kay-diffuse": KajiyaKayDiffuse,
    "cook-torrance": CookTorrance,
    "ggx": GGX,
    "membrane": Membrane,
}
"""The analytic kinds: a table holds the fields of the lobe."""

_TABLE = Path(__file__).parent / "tables" / "lafortune.toml"

Builder = Callable[[Mapping[str, Any], str], Material]

MATERIALS: dict[str, dict[str, Any]] = {
    "lambertian": {"kind": "lambertian"},
    "phong": {"kind": "phong", "exponent": 32.0},
    "phong-whole": {"kind": "phong", "exponent": 32.0, "clipped": False},
    "glossy": {"kind": "phong", "exponent": 512.0},
    "microfacet": {"kind": "microfacet", "sigma": 0.2},
    "microfacet-whole": {"kind": "microfacet", "sigma": 0.2, "clipped": False},
    "plastic": {
        "lobes": [
            {"kind": "lambertian", "reflectance": [0.4, 0.1, 0.1]},
            {"kind": "phong", "exponent": 64.0, "reflectance": [0.3, 0.3, 0.3]},
        ]
    },
    "lafortune-skin": {"kind": "lafortune", "sample": "skin"},
    "lafortune-skin-split": {"kind": "lafortune", "sample": "skin", "split": True},
    "lafortune-bluepaint": {"kind": "lafortune", "sample": "bluepaint"},
    "lafortune-brushedmetal": {"kind": "lafortune", "sample": "brushedmetal"},
    "lafortune-clay": {"kind": "lafortune", "sample": "clay"},
    "lafortune-felt": {"kind": "lafortune", "sample": "felt"},
    "lafortune-primer": {"kind": "lafortune", "sample": "primer"},
    "kajiya-kay": {"kind": "kajiya-kay", "exponent": 32.0},
    "hair": {
        "lobes": [
            {"kind": "kajiya-kay-diffuse", "reflectance": [0.3, 0.2, 0.1]},
            {"kind": "kajiya-kay", "exponent": 32.0, "reflectance": [0.4, 0.4, 0.4]},
        ]
    },
    "membrane": {"kind": "membrane", "transparency": 0.5, "reflectance": [0.6, 0.6, 0.6]},
    "membrane-map": {
        "kind": "membrane",
        "transparency": {"kind": "checker", "squares": 8, "colours": [[0.1, 0.1, 0.1], [0.9, 0.9, 0.9]]},
        "reflectance": [0.6, 0.6, 0.6],
    },
    "translucent": {"kind": "translucent", "mean_free_path": 0.1, "albedo": 0.95, "reflectance": [0.8, 0.7, 0.5]},
    "cook-torrance": {"kind": "cook-torrance", "roughness": 0.2, "f0": [0.9, 0.6, 0.4]},
    "ggx": {"kind": "ggx", "roughness": 0.3, "f0": [0.9, 0.6, 0.4]},
    "ggx-rough": {"kind": "ggx", "roughness": 0.7, "f0": [0.9, 0.6, 0.4]},
    "plastic-ggx": {
        "lobes": [
            {"kind": "lambertian", "reflectance": [0.4, 0.1, 0.1]},
            {"kind": "ggx", "roughness": 0.4, "f0": [0.04, 0.04, 0.04]},
        ]
    },
    "layered-paint": {
        "lobes": [
            {"kind": "lambertian", "reflectance": [0.2, 0.015, 0.02]},
            {"kind": "cook-torrance", "roughness": 0.35, "f0": [0.5, 0.08, 0.06]},
            {"kind": "cook-torrance", "roughness": 0.1, "f0": [0.04, 0.04, 0.04]},
        ]
    },
    **measured.PRESETS,
}


def build(spec: Mapping[str, Any], name: str = "material") -> Material:
    """Make a material from a table: one kind with its settings, or ``lobes = [...]``, a list of such tables.

    ``kind`` is a name in `LOBES`, whose table holds the lobe's parameters and optionally ``reflectance`` (3 numbers)
    and ``clipped``, or a measured kind (`data_gen.measured.KINDS`). Beside them, ``texture`` (`data_gen.texture.build`)
    modulates the whole. The material's notes say where it gains energy or is not reciprocal.

    ``translucent`` is Lambertian with a medium within, its fields beside ``reflectance``. The ``transparency`` of a
    membrane is a number, or a map: what ``texture`` may be.

    Raises
    ------
    BadInput
        For an unknown kind or parameter, a value out of range, or a file that cannot be used.

    Examples
    --------
    >>> build({"kind": "phong", "exponent": 8}).lobes[0].exponent
    8.0
    """
    table = dict(spec)
    map_ = texture.build(table.pop("texture"), name) if "texture" in table else None
    material = _sum(table, name) if "lobes" in table else _one(table, name)
    return replace(material, texture=map_, notes=(*material.notes, *_warnings(material)))


@lru_cache(maxsize=64)
def _warnings(material: Material) -> tuple[str, ...]:
    facts = replace(brdf_checks.check(material), notes=())
    if any(lobe.centre is Centre.TANGENT for lobe in material.lobes):
        facts = replace(facts, reciprocity=0.0)  # a fibre has no N.L to divide by: symmetry of rho_hat is what counts
    return brdf_checks.notes(facts)


def _sum(table: Mapping[str, Any], name: str) -> Material:
    extra = set(table) - {"lobes"}
    if extra:
        raise BadInput(f"material '{name}': '{min(extra)}' stands beside 'lobes'; put it into a lobe's own table.")
    tables = table["lobes"]
    if not isinstance(tables, list | tuple) or not all(isinstance(part, Mapping) for part in tables):
        raise BadInput(f"material '{name}': 'lobes' must be a list of tables. Got {tables!r} instead.")
    parts = [_one(part, name) for part in cast("Sequence[Mapping[str, Any]]", tables)]
    if any(part.medium or part.transparency for part in parts):
        raise BadInput(f"material '{name}': a medium, or a map of transparency, stands by itself; leave out 'lobes'.")
    return Material(name, tuple(lobe for part in parts for lobe in part.lobes), None, tuple(_notes(parts)))


def _notes(parts: Sequence[Material]) -> dict[str, None]:
    return dict.fromkeys(note for part in parts for note in part.notes)


def _one(table: Mapping[str, Any], name: str) -> Material:
    builders: dict[str, Builder] = {kind: partial(_analytic, kind) for kind in LOBES}
    builders |= {"lafortune": _lafortune, "membrane": _membrane, "translucent": _translucent, **measured.KINDS}
    kind = str(table.get("kind"))
    if kind not in builders:
        raise unknown(f"lobe kind of material '{name}':", kind, builders)
    return builders[kind](table, name)


def _analytic(kind: str, table: Mapping[str, Any], name: str) -> Material:
    known = {f.name: f for f in fields(LOBES[kind])}
    settings: dict[str, Any] = {}
    for key, value in table.items():
        if key == "kind":
            continue
        if key not in known:
            raise unknown(f"setting of the {kind} lobe of material '{name}':", key, known)
        settings[key] = _checked(key, value, known[key].default, name)
    try:
        return Material(name, (LOBES[kind](**settings),))
    except BadInput as error:
        raise BadInput(f"material '{name}': {error}") from None


def _lafortune(table: Mapping[str, Any], name: str) -> Material:
    """One lobe about R, the diffuse part in it; with ``split``, a Lambertian lobe about N and one about R.

    ``sample`` names measured coefficients of `data_gen/tables/lafortune.toml`.
    """
    table = dict(table)
    split = _checked("split", table.pop("split", False), False, name)
    if "sample" in table:
        samples = tomllib.loads(_TABLE.read_text())
        sample = str(table.pop("sample"))
        if sample not in samples:
            raise unknown(f"lafortune sample of material '{name}':", sample, samples)
        table = samples[sample] | table
    material = _analytic("lafortune", table, name)
    lobe = cast("Lafortune", material.lobes[0])
    if not split:
        return material
    r, g, b = (d * s for d, s in zip(lobe.diffuse, lobe.reflectance, strict=True))
    return replace(material, lobes=(Lambertian(reflectance=(r, g, b)), replace(lobe, diffuse=(0.0, 0.0, 0.0))))


def _membrane(table: Mapping[str, Any], name: str) -> Material:
    """A membrane whose ``transparency`` may be a map."""
    alpha = table.get("transparency")
    if not isinstance(alpha, str | Mapping):
        return _analytic("membrane", table, name)
    try:
        map_ = texture.build(cast("str | Mapping[str, Any]", alpha), name)
    except BadInput as error:
        raise type(error)(f"transparency of material '{name}': {error}") from None
    mean = float(np.clip(map_.values.mean(dtype=float), 0, 1))
    note = f"its transparency is a map, {map_.values.min():.3g} to {map_.values.max():.3g}, of mean {mean:.3g}."
    made = _analytic("membrane", {**table, "transparency": mean}, name)
    return replace(made, transparency=map_, notes=(note,))


def _translucent(table: Mapping[str, Any], name: str) -> Material:
    """A Lambertian lobe, and the medium within."""
    own = {"mean_free_path", "albedo"}
    known = {*own, "reflectance", "kind"}
    for key in table:
        if key not in known:
            raise unknown(f"setting of the translucent material '{name}':", key, known - {"kind"})
    if "mean_free_path" not in table:
        raise BadInput(f"material '{name}' (translucent) needs 'mean_free_path', a length in the mesh's unit.")
    settings = {key: _checked(key, value, 1.0, name) for key, value in table.items() if key in own}
    try:
        medium = Medium(**settings)
    except BadInput as error:
        raise BadInput(f"material '{name}': {error}") from None
    rest = {key: value for key, value in table.items() if key not in own}
    note = f"within is a medium of mean free path {medium.mean_free_path:g} and albedo {medium.albedo:g}."
    return replace(_analytic("lambertian", rest, name), medium=medium, notes=(note,))


def _checked(key: str, value: Any, default: Any, material: str) -> Any:
    """Return `value` as the kind of thing that `default` is: true or false, a number, numbers, or rows of three."""
    where = f"material '{material}': {key}"
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise BadInput(f"{where} must be true or false. Got {value!r} instead.")
        return value
    if not isinstance(default, tuple):
        if not _is_number(value):
            raise BadInput(f"{where} must be a number. Got {value!r} instead.")
        return float(value)
    if default:
        if not _are_numbers(value, len(default)):
            raise BadInput(f"{where} must be {len(default)} numbers. Got {value!r} instead.")
        return tuple(map(float, value))
    if not isinstance(value, list | tuple) or not all(_are_numbers(row, 3) for row in value):
        raise BadInput(f"{where} must be a list of rows of 3 numbers. Got {value!r} instead.")
    return tuple(tuple(map(float, row)) for row in value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _are_numbers(value: Any, count: int) -> bool:
    return isinstance(value, list | tuple) and len(value) == count and all(map(_is_number, value))
