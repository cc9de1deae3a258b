"""The timings of section 6 of Sloan, Luna and Snyder 2005: simulation, fits, shading, and the light's table."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import CATALOGUE
from data_gen import environments, geometry, materials
from envbench import harmonics, real_harmonics
from envbench.catalogue import Spec
from envbench.directions import Array, normalised, uniform
from envbench.records import Study
from methods.ldprt import fit, glossy, membrane, shade, table
from methods.ldprt.simulated import SIMULATIONS, Request
from methods.ldprt.transfer import Kind, Transfer

RAYS, ORDER, LOBES = 5000, 6, 4
ROUNDS = 15
WAFFLE = "64 x 64 waffle"
TEXTURES = {
    WAFFLE: {"kind": "patch", "texture": "waffle", "height": 0.4, "resolution": 64},
    "128 x 128 swirl": {"kind": "patch", "texture": "swirl", "height": 0.12, "resolution": 128},
}
"""One tile each, a vertex a texel; the paper's waffle scatters light inside."""

_Row = tuple[str | float | int | None, ...]


def timings(head: Spec | None = None, bat: Spec | None = None) -> Study:
    """Return seconds of what is done once, and frames a second of what is done in each."""
    shape = geometry.build(CATALOGUE.geometries["head"] if head is None else head, "head")
    wings = geometry.build(CATALOGUE.geometries["bat"] if bat is None else bat, "bat").mesh
    assert wings is not None
    transfer = _simulated(shape)
    points = len(transfer.vectors)
    rows: list[_Row] = [_row("simulation", "head", ORDER, None, points, transfer.seconds)]
    tiles = {name: _simulated(geometry.build(spec, name)).vectors for name, spec in TEXTURES.items()}
    lobes, seconds = _fitted(transfer.vectors, LOBES)
    rows.append(_row("fit", "head", ORDER, LOBES, points, seconds))
    for name, vectors in tiles.items():
        for count in (1, 2, 3, LOBES) if name == WAFFLE else (LOBES,):
            rows.append(_row("fit", name, ORDER, count, len(vectors), _fitted(vectors, count)[1]))

    light = real_harmonics.project(environments.build({"kind": "captured", "name": "studio"}).radiance, ORDER - 1)
    turns = _turns(points)
    packed = shade.pack(lobes.axes, lobes.coefficients, lobes.direct)
    frames: dict[tuple[str, str, int, int | None, int], Callable[[], Any]] = {
        ("shading", "head, table made anew", ORDER, LOBES, points): lambda: shade.specialised(
            packed, light, table.build(light, ORDER), turns
        ),
        ("shading", "head, evaluated", ORDER, LOBES, points): lambda: shade.evaluated(packed, light, turns),
        ("shading", "glossy head", 4, 3, points): _glossy(points, turns, light),
        ("shading", "bat, table made anew", 3, 1, len(wings.normals)): _membrane(wings.normals, light),
        ("table", "64 x 32", ORDER, None, 64 * 32): lambda: table.build(light, ORDER),
    }
    rows += [_row(*what, seconds) for what, seconds in zip(frames, _medians(list(frames.values())), strict=True)]
    return Study(
        "ldprt-timings" if head is None else "ldprt-timings-generated",
        "Times of LDPRT: what is done once an asset, and what is done in each frame",
        f"{harmonics.threads()} threads. Simulation: {RAYS:,} rays a vertex, shadowed. Fits: two restarts at most. "
        "Shading: every vertex turned by a rotation of its own, three channels, medians of "
        f"{ROUNDS} rounds in turns; the bat is a membrane of one lobe and three bands; of the glossy head, n = 4, "
        "n_b = 3 and N = 3, lobes are drawn at random, on which time does not depend. The paper shades what graphics "
        "hardware of 2005 has rasterised, and draws it too.",
        ("step", "of", "n", "N", "points", "seconds", "Hz"),
        tuple(rows),
    )


def _row(step: str, of: str, n: int, lobes: int | None, points: int, seconds: float) -> _Row:
    return step, of, n, lobes, points, seconds, 1 / seconds


def _simulated(shape: Any) -> Transfer:
    return SIMULATIONS.get(shape, Request(ORDER, Kind.SHADOWED, RAYS, 0, 1.0, 0))


def _fitted(vectors: Array, count: int) -> tuple[Any, float]:
    start = time.perf_counter()
    found = fit.fit(vectors, count)
    return found, time.perf_counter() - start


def _turns(count: int) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.random(count, rng=np.random.default_rng(2)).as_matrix()


def _glossy(points: int, turns: Array, light: Array) -> Callable[[], Any]:
    """Return what shades a glossy shape: its view factors, and nine lobes a point."""
    brdf = glossy.factor(materials.build({"kind": "cook-torrance", "roughness": 0.3}, "glossy"), 4, 3)
    rng = np.random.default_rng(3)
    frames = glossy.frames(uniform(points, rng))
    view = np.broadcast_to(normalised(np.array([0.3, -1.0, 0.25])), (points, 3))
    coefficients = rng.normal(size=(points, 3, 3, 4))
    coefficients[..., :2] = 0
    axes = uniform(9 * points, rng).reshape(points, 3, 3, 3)
    packed = shade.pack(axes, coefficients, rng.normal(size=(points, 3, 4)))
    return lambda: shade.evaluated(packed, light, turns, glossy.view_factors(brdf, view, frames, turns))


def _membrane(normals: Array, light: Array) -> Callable[[], Any]:
    """Return what shades a membrane: one lobe of three bands about the normal."""
    g = np.tile(membrane.coefficients(3, 0.5), (len(normals), 1, 1))
    direct = g[:, :, 0] * real_harmonics.basis(0, normals[:1])[0, 0]
    g[:, :, 0] = 0
    packed, turns = shade.pack(normals[:, None], g, direct), _turns(len(normals))
    return lambda: shade.specialised(packed, light, table.build(light, 3), turns)


def _medians(runs: list[Callable[[], Any]]) -> list[float]:
    """Return the median seconds of each, their rounds in turns."""
    seconds = np.empty((ROUNDS, len(runs)))
    for run in runs:
        run()
    for taken in seconds:
        for i, run in enumerate(runs):
            start = time.perf_counter()
            run()
            taken[i] = time.perf_counter() - start
    return [float(median) for median in np.median(seconds, axis=0)]
