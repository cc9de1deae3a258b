"""Decisions about effects, kept on disk beside the references: JSON, named by all that can change them."""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import envbench.effects
import envbench.uncertainty
from envbench.effects import EffectSettings
from envbench.reference import ReferenceSettings
from envbench.scene import Basis, Decision, Effect, Plan, Scene
from references.cache import address, provenance
from references.effects import bounces, planner, probe, variants
from references.effects.planner import planned

SOURCES = (planner, probe, variants, bounces, envbench.effects, envbench.uncertainty)
"""Modules whose code is part of the address, beside those of a reference's."""


def decided(scene: Scene, settings: EffectSettings, reference: ReferenceSettings, cache: Path | None) -> Scene:
    """Return `planned`, from `cache` where it holds that; what is wrong with a file there is no more than a miss.

    Only what was measured is worth a file.
    """
    if cache is None or settings.plan in (Plan.ALL, Plan.FACTS):
        return planned(scene, settings, reference)
    file = cache / f"{_address(scene, settings, reference)}.effects.json"
    found = _read(file)
    if found is not None:
        simulated = frozenset(d.effect for d in found if d.simulated)
        often = next((d.bounces for d in found if d.effect is Effect.INTERREFLECTION), None)
        return replace(scene, effects=simulated, bounces=often, decisions=found, order=settings.order)
    made = planned(scene, settings, reference)
    if any(d.seconds for d in made.decisions):
        _write(file, made.decisions)
    return made


def _address(scene: Scene, settings: EffectSettings, reference: ReferenceSettings) -> str:
    own: dict[str, Any] = {"planning": asdict(settings)}
    own |= {m.__name__: hashlib.sha256(inspect.getsource(m).encode()).hexdigest() for m in SOURCES}
    return address(provenance(replace(scene, effects=frozenset()), reference) | own)


def _read(file: Path) -> tuple[Decision, ...] | None:
    try:
        return tuple(_decision(row) for row in json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _decision(row: Mapping[str, Any]) -> Decision:
    values: dict[str, Any] = {
        k: math.nan if v is None and k not in ("bounces", "tolerance") else v for k, v in row.items()
    }
    values["effect"], values["basis"] = Effect(row["effect"]), Basis(row["basis"])
    return Decision(**values)


def _write(file: Path, decisions: tuple[Decision, ...]) -> None:
    """Write the file whole or not at all; that it cannot be written stops nothing."""
    rows = [
        {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in asdict(d).items()}
        for d in decisions
    ]
    beside = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(json.dumps(rows), encoding="utf-8")
        beside.replace(file)
    except OSError:
        pass
