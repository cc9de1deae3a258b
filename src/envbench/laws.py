"""The laws of `envbench.method`, checked: what every method must keep, third-party ones too.

``check(method, material)`` runs a method on small random lights at random queries and returns a line for each law
that it breaks. A method that keeps them can be compared; one that breaks them would be compared for a defect.
``furnace(method, material)`` says what a method makes of constant light.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from envbench import latlong
from envbench.directions import Array, normalised, perpendicular, reflect, uniform
from envbench.environment import Environment
from envbench.furnace import lobe_integrals
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Material
from envbench.method import Method, Tolerance
from envbench.scene import Scene

ROWS = 128
"""Rows of the test lights; lamps are 0.5 rad wide or more: bilinear samples err by (pi / ROWS / 0.5)^2 / 8 = 3e-4."""
WIDEST = 0.5
"""The largest tolerance that holds a method to anything: one that answered black would keep every law to 1."""

Query = tuple[Viewer | None, Points]


@dataclass(frozen=True)
class Furnace:
    """What a method reflects of constant light, relative to what the material does (`envbench.furnace`).

    Attributes
    ----------
    mean : float
        Energy gained, or lost where negative, over all queries and channels.
    worst : float
        Largest deviation of one query, as a share of the mean.
    """

    mean: float
    worst: float


def check(method: Method, material: Material, seed: int = 0, count: int = 32) -> list[str]:
    """Return a line for each law that `method` breaks on `material`; an empty list is what is wanted.

    The queries are seen by one distant viewer, and again with a view of their own each where the method takes part in
    that. Lights are smooth where turned ones must mean the same, and full of detail where they need not: noise in every
    texel, and one texel with as much power as all others.

    Parameters
    ----------
    seed : int
        Of the lights, queries and turn.
    count : int
        Queries of each kind.
    """
    rng = np.random.default_rng(seed)
    asked, lamps = queries(rng, count), _lamps(rng)
    smooth, rough = _light("lamps", lamps), _rough(rng)
    asked = _taken(method, material, smooth, asked)
    if not asked:
        return []
    prepared = method.prepare(material, Geometry("sphere"))
    stated = method.tolerance(prepared)
    broken = list(_unfit(stated))
    if broken:
        return broken

    def law(name: str, got: Array, expected: Array, tolerance: float) -> None:
        scale = float(np.sqrt(np.mean(expected**2))) or 1.0
        error = float(np.sqrt(np.mean((got - expected) ** 2))) / scale
        if not error <= tolerance:
            broken.append(f"{name}: off by {error:.3g} of the RMS, stated tolerance {tolerance:.3g}")

    result, detailed = (_render(method, prepared, light, asked) for light in (smooth, rough))
    if not np.array_equal(result, _render(method, prepared, smooth, asked)):
        broken.append("deterministic: the same input twice gives different bits")
    scaled, both = (
        Environment("mixed", radiance) for radiance in (3 * rough.radiance, rough.radiance + smooth.radiance)
    )
    law("linear (scaled light)", _render(method, prepared, scaled, asked), 3 * detailed, stated.linearity)
    law("linear (sum of lights)", _render(method, prepared, both, asked), result + detailed, stated.linearity)
    black = Environment("black", 0 * smooth.radiance)
    law("zero light", _render(method, prepared, black, asked), np.zeros_like(result), 0.0)
    got, expected = _constant_light(method, material, prepared, asked)
    law("constant light", got, expected, stated.constant_light)
    turn = _random_turn(rng)
    turned, moved = _light("turned", lambda d: lamps(d @ turn)), [_turned(query, turn) for query in asked]
    law("turned light, points and view", _render(method, prepared, turned, moved), result, stated.rotation)
    return broken + list(_states(method, prepared, smooth, asked[0]))


def furnace(method: Method, material: Material, seed: int = 0, count: int = 64) -> Furnace | None:
    """Return what `method` gains or loses of constant light on `material`; None where it declines the material."""
    asked = queries(np.random.default_rng(seed), count)
    asked = _taken(method, material, Environment("constant", np.ones((8, 16, 3), np.float32)), asked)
    if not asked:
        return None
    got, expected = _constant_light(method, material, method.prepare(material, Geometry("sphere")), asked)
    scale, deviation = float(expected.mean()) or 1.0, got - expected
    return Furnace(float(deviation.mean()) / scale, float(np.abs(deviation).max()) / scale)


def _taken(method: Method, material: Material, light: Environment, asked: list[Query]) -> list[Query]:
    """Return the queries that the method does not decline."""
    sphere = Geometry("sphere")
    scenes = [Scene("laws", light, material, sphere, points, viewer) for viewer, points in asked]
    return [query for query, scene in zip(asked, scenes, strict=True) if method.refusal(scene) is None]


def _render(method: Method, prepared: Any, light: Environment, asked: list[Query]) -> Array:
    relit = method.relight(prepared, light)
    return np.concatenate([
        np.asarray(method.shade(method.frame(relit, viewer), points), float) for viewer, points in asked
    ])  # fmt: skip


def _constant_light(method: Method, material: Material, prepared: Any, asked: list[Query]) -> tuple[Array, Array]:
    """Return what the method makes of constant light, and what the lobes integrate to."""
    light = Environment("constant", np.ones((ROWS, 2 * ROWS, 3), np.float32))
    expected = np.concatenate([lobe_integrals(material, points) for _, points in asked])
    return _render(method, prepared, light, asked), expected


def _unfit(stated: Tolerance) -> Iterator[str]:
    """Name the tolerances that hold the method to nothing."""
    for name in (f.name for f in fields(stated)):
        value = getattr(stated, name)
        if not 0 <= value <= WIDEST:
            yield f"tolerance: {name} = {value:.3g} holds it to nothing; at most {WIDEST}, or decline the material"


def _states(method: Method, prepared: Any, light: Environment, query: Query) -> Iterator[str]:
    """Check that states can be pickled, answer alike afterwards, and are not changed by later steps."""
    viewer, points = query
    try:
        before = pickle.dumps(prepared)
        relit = method.relight(prepared, light)
        relit_before = pickle.dumps(relit)
        framed = method.frame(pickle.loads(relit_before), viewer)
        copied = method.shade(pickle.loads(pickle.dumps(framed)), points)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        yield f"states: one of them cannot be pickled ({error})"
        return
    direct = method.shade(method.frame(relit, viewer), points)
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


def _rough(rng: np.random.Generator) -> Environment:
    """Return other lamps with noise in every texel, and one texel with as much power as all others."""
    radiance = _lamps(rng)(latlong.grid(ROWS, 2 * ROWS)) * rng.uniform(0, 2, (ROWS, 2 * ROWS, 1))
    solid_angle = latlong.solid_angles(ROWS, 2 * ROWS)
    row, column = rng.integers(ROWS), rng.integers(2 * ROWS)
    radiance[row, column] += (radiance * solid_angle[..., None]).sum((0, 1)) / solid_angle[row]
    return Environment("rough", radiance.astype(np.float32))


def queries(rng: np.random.Generator, count: int) -> list[Query]:
    """Return queries with one distant viewer, and with a view of their own each; R uniform in both."""
    direction = uniform(1, rng)[0]
    x, y, z = map(float, direction)
    views = np.tile(direction, (count, 1)), uniform(count, rng)
    return list(zip((Viewer(direction=(x, y, z)), None), (_seen(view, rng) for view in views), strict=True))


def _seen(view: Array, rng: np.random.Generator) -> Points:
    normal = normalised(uniform(len(view), rng) + view)
    return Points(normal, normal, normal, perpendicular(normal), view, np.full(len(view), 1 / len(view)))


def _turned(query: Query, turn: Array) -> Query:
    """Turn viewer and points by the matrix `turn` (3, 3)."""
    viewer, points = query
    parts = ("position", "normal", "geometric_normal", "tangent", "view")
    moved = replace(points, **{part: getattr(points, part) @ turn.T for part in parts})
    if viewer is None:
        return None, moved
    x, y, z = map(float, turn @ np.asarray(viewer.direction))
    return Viewer(direction=(x, y, z)), moved


def _random_turn(rng: np.random.Generator) -> Array:
    """Return a random rotation as the product of two mirrorings."""
    a, b = normalised(rng.normal(size=(2, 3)))
    return reflect(reflect(np.eye(3), a), b).T
