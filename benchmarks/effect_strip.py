"""A strip of small images: a scene with all its effects, and what each of them contributes, on one scale."""

from __future__ import annotations

from benchmarks.studies.contact_sheet import (
    Scale,
    Tile,
    compose,
    enlarged,
    exposed,
    percent,
    round_limit,
    signed,
    toned,
)
from envbench.directions import Array
from envbench.scene import Decision
from envbench.tonemap import exposure
from references.effects.planner import Contributions

_SIZE = 200
"""Pixels across an image, or as near as whole pixels of the image come."""


def draw(found: Contributions) -> bytes:
    """Return the strip as PNG.

    Contributions are in units of the RMS radiance with all effects: red is brighter with the effect than without.
    """
    scene, points = found.scene, found.scene.points

    def image(values: Array) -> Array:
        return points.image(values.astype(float)).astype(float)

    rms = float((points.weight[:, None] * found.radiance**2).sum() / points.weight.sum() / 3) ** 0.5 or 1.0
    differences = {effect: image(values / rms) for effect, values in found.differences.items()}
    limit = round_limit(list(differences.values())) if differences else 1.0
    stops = exposure(found.radiance)
    row = [Tile(enlarged(exposed(image(found.radiance), stops), _SIZE), "all effects")]
    row += [
        Tile(enlarged(signed(differences[d.effect], limit), _SIZE), _caption(d))
        for d in scene.decisions
        if d.effect in differences
    ]
    said = f"Each with less without the effect; red: brighter with it. {found.samples} samples a pixel."
    return compose([row], notes=[said, toned(stops)], scale=Scale(limit, "RMS radiances") if differences else None)


def _caption(d: Decision) -> str:
    answer = "simulated" if d.simulated else "left out"
    return f"{d.effect}\n{percent(d.contribution)} ({percent(d.low)} to {percent(d.high)}): {answer}"
