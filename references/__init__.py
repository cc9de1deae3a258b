"""Ground truth: Mitsuba at the query points, kept in a cache, and an independent quadrature to hold it against."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from envbench.reference import Reference, ReferenceSettings
from envbench.scene import Scene
from references.cache import Damaged, address, load, path, provenance, store
from references.mitsuba_direct import render

__all__ = ["reference"]


def reference(scene: Scene, settings: ReferenceSettings | None = None, cache: Path | None = None) -> Reference:
    """Return ground truth at the points of `scene`.

    Parameters
    ----------
    scene : Scene
    settings : ReferenceSettings, optional
    cache : Path, optional
        Folder that is looked in first, and written to. What is wrong with it becomes a note; it stops nothing.

    Raises
    ------
    BadInput, CannotRun
        The variant is unknown, or cannot run on this machine.
    """
    settings = settings or ReferenceSettings()
    origin = provenance(scene, settings)
    key = address(origin)
    notes: tuple[str, ...] = ()
    if cache is not None:
        try:
            found = load(cache, origin, scene)
        except Damaged as damage:
            notes = (f"cache file {path(cache, key)} was damaged ({damage}): recomputed",)
        else:
            if found is not None:
                return found
    made = replace(render(scene, settings, key), provenance=origin)
    if cache is not None:
        try:
            store(cache, made)
        except OSError as error:
            notes += (f"reference not kept in {cache}: {error}",)
    return replace(made, notes=made.notes + notes)
