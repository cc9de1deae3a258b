"""The laws of `envbench.method`, checked: what every method must keep, third-party ones too.

``check(method, material)`` runs a method on small, smooth, random lights at random queries and returns a line for each
law that it breaks. A method that keeps them can be compared; one that breaks them would be compared for a defect.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from envbench import latlong
from envbench.directions import Array, normalised, perpendicular, reflect, uniform
from envbench.environment import Environment
from envbench.furnace import lobe_integrals
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Material
from envbench.method import Method
from envbench.scene import Scene

ROWS = 128
"""Rows of the test lights; lamps are 0.5 rad wide or more: bilinear samples err by (pi / ROWS / 0.5)^2 / 8 = 3e-4."""


def check(method: Method, material: Material, seed: int = 0, count: int = 32) -> list[str]:
    """Return a line for each law that `method` breaks on `material`; an empty list is what is wanted.

    Parameters
    ----------
    seed : int
        Of the lights, queries and turn.
    count : int
        Queries, all seen by one distant viewer, so that methods that need one take part.
    """
    rng = np.random.default_rng(seed)
    viewer, points = _queries(rng, count)
    lamps, other = _lamps(rng), _lamps(rng)
    scene = Scene("laws", _light("lamps", lamps), material, Geometry("sphere"), points, viewer)
    if method.declines(scene) is not None:
        return []
    prepared = method.prepare(material, scene.geometry)

    def render(light: Environment, at: Points = points, seen: Viewer = viewer) -> Array:
        relit = method.relight(prepared, light)
        return np.asarray(method.shade(method.frame(relit, seen), at), float)

    broken: list[str] = []

    def law(name: str, got: Array, expected: Array, tolerance: float) -> None:
        scale = float(np.sqrt(np.mean(expected**2))) or 1.0
        error = float(np.sqrt(np.mean((got - expected) ** 2))) / scale
        if not error <= tolerance:
            broken.append(f"{name}: off by {error:.3g} of the RMS, stated tolerance {tolerance:.3g}")

    stated = method.tolerance(prepared)
    result = render(scene.environment)
    if not np.array_equal(result, render(scene.environment)):
        broken.append("deterministic: the same input twice gives different bits")
    scaled = _light("scaled", lambda d: 3 * lamps(d))
    law("linear (scaled light)", render(scaled), 3 * result, stated.linearity)
    both = _light("both", lambda d: lamps(d) + other(d))
    law("linear (sum of lights)", render(both), result + render(_light("other", other)), stated.linearity)
    law("zero light", render(_light("black", lambda d: 0 * lamps(d))), np.zeros_like(result), 0.0)
    constant = _light("constant", lambda d: np.ones((*d.shape[:-1], 3)))
    law("constant light", render(constant), lobe_integrals(material, points), stated.constant_light)
    turn = _random_turn(rng)
    turned = _light("turned", lambda d: lamps(d @ turn))
    law("turned light, points and view", render(turned, *_turned(points, viewer, turn)), result, stated.rotation)
    return broken + list(_states(method, prepared, scene))


def _states(method: Method, prepared: Any, scene: Scene) -> Iterator[str]:
    """Check that states can be pickled, answer alike afterwards, and are not changed by later steps."""
    try:
        before = pickle.dumps(prepared)
        relit = method.relight(prepared, scene.environment)
        relit_before = pickle.dumps(relit)
        framed = method.frame(pickle.loads(relit_before), scene.viewer)
        copied = method.shade(pickle.loads(pickle.dumps(framed)), scene.points)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        yield f"states: one of them cannot be pickled ({error})"
        return
    direct = method.shade(method.frame(relit, scene.viewer), scene.points)
    if not np.array_equal(copied, direct):
        yield "states: a pickled copy does not shade like the original"
    if pickle.dumps(prepared) != before or pickle.dumps(relit) != relit_before:
        yield "states: a later step changes an earlier state"


def _lamps(rng: np.random.Generator) -> Callable[[Array], Array]:
    """Return a sum of three wide spherical Gaussians on a dim background, as a function of directions."""
    axes, colours, widths = uniform(3, rng), rng.uniform(0.2, 2, (3, 3)), rng.uniform(0.5, 1, 3)

    def radiance(directions: Array) -> Array:
        lobes = np.exp((directions @ axes.T - 1) / widths**2)
        return 0.1 + lobes @ colours

    return radiance


def _light(name: str, radiance: Callable[[Array], Array]) -> Environment:
    return Environment(name, radiance(latlong.grid(ROWS, 2 * ROWS)).astype(np.float32))


def _queries(rng: np.random.Generator, count: int) -> tuple[Viewer, Points]:
    direction = uniform(1, rng)[0]
    normal = normalised(uniform(count, rng) + direction)  # R uniform: what captured energy speaks of
    view = np.broadcast_to(direction, normal.shape).copy()
    weight = np.full(count, 1 / count)
    x, y, z = map(float, direction)
    return Viewer(direction=(x, y, z)), Points(normal, normal, normal, perpendicular(normal), view, weight)


def _turned(points: Points, viewer: Viewer, turn: Array) -> tuple[Points, Viewer]:
    """Turn points and viewer by the matrix `turn` (3, 3)."""
    parts = ("position", "normal", "geometric_normal", "tangent", "view")
    x, y, z = map(float, turn @ np.asarray(viewer.direction))
    moved = {part: getattr(points, part) @ turn.T for part in parts}
    return replace(points, **moved), Viewer(direction=(x, y, z))


def _random_turn(rng: np.random.Generator) -> Array:
    """Return a random rotation as the product of two mirrorings."""
    a, b = normalised(rng.normal(size=(2, 3)))
    return reflect(reflect(np.eye(3), a), b).T
