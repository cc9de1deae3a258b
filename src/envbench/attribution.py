"""Whose fault an error is: what a method ignores (effects that it lacks), and what it does but approximately.

With r the scene's reference, q that of the same scene without the effects L that a method lacks, and b the method,

    b - r = (b - q) + (q - r),

approximation and missing effects. `envbench.metrics` estimates the RMS of both, and their mean product, without bias.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

from envbench.records import CellResult, Score
from envbench.scene import Effect, Scene

RESTS_ON = {
    Effect.INTERREFLECTION: Effect.SELF_SHADOWING,
    Effect.DEFORMATION: Effect.SELF_SHADOWING,
    Effect.PERSPECTIVE: Effect.VIEW_DEPENDENCE,
}
"""What is no effect without another: what sends light on hides it too, a pose moves what hides, and a viewer is
nowhere to a surface that looks the same to all."""


def without(scene: Scene, lacks: Collection[Effect]) -> Scene | None:
    """Return the scene without some of its effects and what rests on them; None where no reference leaves them out.

    Points of a posed shape that do not say where at rest they are leave deformation out of no reference.
    """
    if not lacks:
        return None
    kept = {effect for effect in scene.effects if effect not in lacks and RESTS_ON.get(effect) not in lacks}
    placed = scene.points.triangle is not None and scene.points.barycentric is not None
    carried = scene.geometry.pose is not None and Effect.SELF_SHADOWING in kept and Effect.DEFORMATION not in kept
    return replace(scene, effects=frozenset(kept)) if placed or not carried else None


def split(cell: CellResult) -> tuple[Score, Score, Score] | None:
    """Return a cell's approximation, missing effects and cross term; None where its error is not split."""
    found = {score.metric: score for score in cell.scores}
    done, ignored, cross = (found.get(name) for name in ("approximation", "missing_effects", "cross"))
    return (done, ignored, cross) if done and ignored and cross else None


def sentence(cell: CellResult, word: Callable[[Score], str]) -> str:
    """Say what a cell's error consists of, each part by `word`; empty where its error is not split.

    Examples
    --------
    >>> from envbench.records import Status
    >>> scores = Score("approximation", 0.021), Score("missing_effects", 0.14), Score("cross", 0.0)
    >>> cell = CellResult("", "", "", {}, Status.OK, scores=scores, lacks=("self-shadowing",))
    >>> sentence(cell, lambda score: f"{score.value:.1%}")
    '2.1% in what it does, 14.0% in what it ignores (self-shadowing)'
    """
    parts = split(cell)
    if parts is None:
        return ""
    done, ignored, _ = parts
    return f"{word(done)} in what it does, {word(ignored)} in what it ignores ({', '.join(cell.lacks)})"
