"""What is known of a material by itself: reciprocity, energy, orders and lobe plot, put into one record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from data_gen import brdf_checks, materials
from envbench.catalogue import Spec
from envbench.material import Lobe
from envbench.records import MaterialSheet
from envbench.settings import plain
from methods.shrm.coefficients import captured, expand

EPS = (0.1, 0.03, 0.01)
"""Energy that may be left out, for which orders are told."""
ORDER, VIEW_ORDER = 30, 5
"""F and P up to which captured energy is told: those of RH 2002, fig. 8."""


def sheet(name: str, spec: Spec) -> MaterialSheet:
    """Return the sheet of a material; raises `BadInput` for one that cannot be built."""
    material = materials.build(spec, name)
    facts = brdf_checks.check(material)
    notes = dict.fromkeys((*material.notes, *brdf_checks.notes(facts)))
    return MaterialSheet(
        name=name,
        spec=plain(dict(spec)),
        lobes=tuple(map(_worded, material.lobes)),
        notes=tuple(notes),
        reciprocity=facts.reciprocity,
        negative=facts.negative,
        albedo=tuple(facts.albedo),
        orders=tuple(order for number, lobe in enumerate(material.lobes) for order in _orders(number, lobe)),
        captured=tuple(
            (number, p, float(energy))
            for number, lobe in enumerate(material.lobes)
            for p, energy in enumerate(captured(lobe, ORDER, VIEW_ORDER))
        ),
        slices=tuple(brdf_checks.slices(material)),
    )


def _orders(number: int, lobe: Lobe) -> Iterator[tuple[float, int, int, int, float]]:
    for eps in EPS:
        found = expand(lobe, eps)
        yield eps, number, found.F, found.P, found.missing


def _worded(lobe: Lobe) -> str:
    """Say what a lobe is: its kind, the parameters that are numbers or words, its centre, whole or clipped.

    Examples
    --------
    >>> from data_gen.lobes import Phong
    >>> _worded(Phong(exponent=8, clipped=False))
    'Phong, exponent 8, about R, whole'
    """
    own: dict[str, Any] = {
        f.name: getattr(lobe, f.name) for f in fields(lobe) if f.name not in ("clipped", "reflectance")
    }
    told = [f"{key} {value:g}" for key, value in own.items() if isinstance(value, int | float)]
    told += [f"{key} {value}" for key, value in own.items() if isinstance(value, str)]
    if lobe.reflectance != (1.0, 1.0, 1.0):
        told.append("reflectance " + " ".join(f"{r:.3g}" for r in lobe.reflectance))
    return ", ".join((type(lobe).__name__, *told, f"about {lobe.centre.value}", "clipped" if lobe.clipped else "whole"))
