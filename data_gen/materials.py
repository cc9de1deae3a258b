"""Materials by name or by a table of a suite: `build` makes them, `MATERIALS` are the presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from data_gen.lobes import Lambertian, Microfacet, Phong
from envbench.errors import BadInput, unknown
from envbench.material import Lobe, Material

LOBES: dict[str, type[Lobe]] = {"lambertian": Lambertian, "phong": Phong, "microfacet": Microfacet}

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
}


def build(spec: Mapping[str, Any], name: str = "material") -> Material:
    """Make a material from a table: either one lobe's own settings, or ``lobes = [...]``, a list of such tables.

    A lobe's table has ``kind`` (a name in `LOBES`), the lobe's parameters, and optionally ``reflectance`` (3 numbers)
    and ``clipped`` (default true).

    Raises
    ------
    BadInput
        For an unknown kind or parameter, or a value out of range.

    Examples
    --------
    >>> build({"kind": "phong", "exponent": 8}).lobes[0].exponent
    8.0
    """
    if "lobes" not in spec:
        return Material(name, (_lobe(spec, name),))
    extra = set(spec) - {"lobes"}
    if extra:
        raise BadInput(f"material '{name}': '{min(extra)}' stands beside 'lobes'; put it into a lobe's own table.")
    tables = spec["lobes"]
    if not isinstance(tables, list | tuple) or not all(isinstance(table, Mapping) for table in tables):
        raise BadInput(f"material '{name}': 'lobes' must be a list of tables. Got {tables!r} instead.")
    return Material(name, tuple(_lobe(table, name) for table in tables))


def _lobe(table: Mapping[str, Any], material: str) -> Lobe:
    kind = table.get("kind")
    if kind not in LOBES:
        raise unknown(f"lobe kind of material '{material}':", str(kind), LOBES)
    known = {f.name: f for f in fields(LOBES[kind])}
    settings: dict[str, Any] = {}
    for key, value in table.items():
        if key == "kind":
            continue
        if key not in known:
            raise unknown(f"setting of the {kind} lobe of material '{material}':", key, known)
        settings[key] = _checked(key, value, known[key].default, material)
    return LOBES[kind](**settings)


def _checked(key: str, value: Any, default: Any, material: str) -> Any:
    """Return `value` as the kind of thing that `default` is."""
    where = f"material '{material}': {key}"
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise BadInput(f"{where} must be true or false. Got {value!r} instead.")
        return value
    numbers = list(value) if isinstance(value, list | tuple) else [value]
    wanted = len(default) if isinstance(default, tuple) else 1
    if len(numbers) != wanted or not all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers):
        raise BadInput(f"{where} must be {'a number' if wanted == 1 else f'{wanted} numbers'}. Got {value!r} instead.")
    return tuple(map(float, numbers)) if isinstance(default, tuple) else float(numbers[0])
