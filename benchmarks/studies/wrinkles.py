"""The wrinkle: its map of lobes against true transfer, and a grooved cylinder shaded by it (figure 6 of Sloan 2005)."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import Tile, compose, enlarged
from benchmarks.studies.renderings import LOCAL, SCALE, SHADOWS, TONED, Rendering, rendered
from envbench import real_harmonics
from envbench.directions import Array
from envbench.geometry import Points
from envbench.records import Picture, Study
from methods.ldprt import fit, membrane, shade
from methods.ldprt.groove import groove_transfer
from methods.ldprt.wrinkle import LobeMap, Wrinkle, fit_wrinkle

ORDER, SIZE, SAMPLES, ITERATIONS = 6, 32, 64, 150
"""The paper's map; it says neither how many samples its fit has, nor how many steps."""
BETWEEN = 4
"""Steps from a node to the next at which the map is held against the truth."""
GROOVES, WIDTH, RADIUS = 12, 0.6, 0.5
"""Around the cylinder; share of the pitch that a groove is wide; the cylinder is as long as it is wide."""
UPRIGHT, DEFORMED = "upright", "twisted and bent"
POSES = ((UPRIGHT, 0.5), (DEFORMED, 0.25), (DEFORMED, 0.5), (DEFORMED, 1.0))
"""With the depths of the rendered grooves, in their widths."""
MAPPED, OWN, UNSHADOWED, STATIC = "by the map", "by the groove's own transfer", "unshadowed", "not turned"


def wrinkle_map() -> Study:
    """Return the map's errors at its nodes and between them, beside points fitted by themselves."""
    place, depth = np.linspace(-0.5, 0.5, BETWEEN * (SIZE - 1) + 1), np.linspace(0, 1, BETWEEN * (SIZE - 1) + 1)
    truth = groove_transfer(place[:, None], depth, ORDER)
    x, d = (part.ravel() for part in np.meshgrid(place, depth, indexing="ij"))
    nodes = truth[::BETWEEN, ::BETWEEN]
    length = float(np.sqrt(np.mean(np.sum(truth**2, axis=-1))))
    start = time.perf_counter()
    together = fit_wrinkle(size=SIZE, samples=SAMPLES, iterations=ITERATIONS)
    seconds = time.perf_counter() - start
    start = time.perf_counter()
    apart = _apart(nodes)
    ways: list[tuple[str, Array, float | None]] = [
        ("one optimisation over the whole map", together.at(x, d).vectors(), seconds),
        ("each node by itself, interpolated", apart.at(x + 0.5, d).vectors(), time.perf_counter() - start),
        ("no lobes: whole vectors at the nodes, interpolated", _bilinear(nodes, x + 0.5, d), None),
    ]
    at_node = np.zeros(truth.shape[:2], bool)
    at_node[::BETWEEN, ::BETWEEN] = True
    rows: list[tuple[str | float | bool | None, ...]] = []
    maps: list[Array] = []
    for name, found, taken in ways:
        error = np.linalg.norm(found.reshape(truth.shape) - truth, axis=-1) / length
        maps.append(error)
        between = error[~at_node]
        rows.append(
            (name, *(_rms(e) for e in (error[at_node], between)), float(np.median(between)), float(error.max()), taken)
        )
    return Study(
        "wrinkle-map",
        f"A wrinkle's lobes as one map: {SIZE} x {SIZE} nodes over (x, d), three lobes",
        f"A sinusoidal groove of any depth up to its width; n = {ORDER}; DC and linear coefficients bilinear too. RMS "
        "of the difference from the groove's transfer in closed form, over the RMS length of that, at the nodes and at "
        f"the {BETWEEN * (SIZE - 1) + 1}^2 - {SIZE}^2 points of a grid {BETWEEN} times as fine. The optimisation sees "
        f"{SAMPLES} x {SAMPLES} samples, and takes {ITERATIONS} steps of conjugate gradients.",
        ("map", "error at nodes", "between", "median between", "largest", "seconds"),
        tuple(rows),
        (
            "Fitted by itself each node is nearer to the truth there; but neighbours number and choose their lobes as "
            "they please, and between them lies something else.",
        ),
        pictures=(_errors([name for name, *_ in ways], maps),),
    )


def cylinder_wrinkle() -> Study:
    """Return the errors of a grooved, twisted and bent cylinder that is shaded by the wrinkle's map."""
    wrinkle = fit_wrinkle(size=SIZE, samples=SAMPLES, iterations=ITERATIONS)
    rows: list[tuple[str | float | bool | None, ...]] = []
    tiles: list[list[Tile]] = []
    for pose, depth in POSES:
        table = _cylinder(depth, pose != UPRIGHT)
        local, whole = (rendered(table, effects, direction=(0.3, -1.0, 0.1)) for effects in (LOCAL, SHADOWS))
        found = _shaded(wrinkle, depth, whole)
        errors = {way: (local.error(values), whole.error(values)) for way, values in found.items()}
        better = errors[MAPPED][1] < min(errors[way][1] for way in (UNSHADOWED, STATIC))
        rows.append((pose, depth, *(e for way in errors for e in errors[way]), better))
        tiles.append(
            [
                whole.reference(),
                *(whole.tile(found[way], f"error {errors[way][1]:.3f}") for way in (MAPPED, UNSHADOWED)),
                whole.difference(found[MAPPED], SCALE),
            ]
        )
    sheet = compose(
        tiles,
        columns=("reference", "lobes from the map", "unshadowed", "map less reference"),
        labels=[f"{pose}, depth {depth:g}" for pose, depth in POSES],
        notes=(TONED,),
        scale=SCALE,
    )
    return Study(
        "cylinder-wrinkle",
        "A cylinder with wrinkles, shaded by the map of one groove",
        f"{GROOVES} grooves along a cylinder, {WIDTH:g} of their pitch wide; twisted by 60 and bent by 40 degrees. "
        "Each pixel reads its three lobes from the map by its place across the groove and by the depth, in widths; "
        "nothing else is precomputed. The reference is Mitsuba's, of the grooved mesh itself, under `studio` "
        "projected to six bands: with the shadows of the flat groove carried along (local), and with those of the "
        "posed one (all). NRMSE, the reference's noise taken off.",
        (
            "pose",
            "depth",
            *(f"{way}, {effects}" for way in (MAPPED, OWN, UNSHADOWED, STATIC) for effects in ("local", "all")),
            "map is best",
        ),
        tuple(rows),
        (
            "What the groove's own transfer leaves is not the lobes': its grooves have no ends, the mesh has facets, "
            "and rounding the patch opens the grooves.",
        ),
        pictures=(Picture("cylinder wrinkle", "The reference has all shadows of the posed mesh.", sheet),),
    )


def _apart(nodes: Array) -> LobeMap:
    """Return the map of nodes (X, D, n^2) each fitted by itself, with the fit's own search."""
    found = fit.fit(nodes.reshape(-1, nodes.shape[-1]), 3)
    shape = nodes.shape[:2]
    return LobeMap(*(part.reshape(*shape, *part.shape[1:]) for part in (found.axes, found.coefficients, found.direct)))


def _bilinear(nodes: Array, u: Array, v: Array) -> Array:
    from scipy.interpolate import RegularGridInterpolator

    grid = tuple(np.linspace(0, 1, k) for k in nodes.shape[:2])
    return RegularGridInterpolator(grid, nodes)(np.stack([u, v], axis=-1))


def _errors(names: list[str], maps: list[Array]) -> Picture:
    tiles: list[Tile] = []
    for error in maps:
        level = np.clip((np.log10(np.maximum(error.T[::-1], 1e-12)) + 4) / 4, 0, 1)
        grey = np.rint(255 * (1 - level)).astype(np.uint8)
        tiles.append(Tile(enlarged(np.repeat(grey[..., None], 3, axis=2), 250)))
    notes = ("Error of the signal's length, on a logarithmic scale: white 1e-4 and below, black 1 and above.",)
    return Picture(
        "errors over the map", "x to the right, depth upwards.", compose([tiles], columns=names, notes=notes)
    )


def _cylinder(depth: float, posed: bool) -> dict[str, Any]:
    """Return the table of a cylinder with grooves of a depth in their widths."""
    pose: list[dict[str, Any]] = [{"kind": "onto", "surface": {"kind": "cylinder", "radius": RADIUS, "length": 1.0}}]
    if posed:
        pose += [
            {"kind": "twist", "degrees": 60.0, "axis": "z"},
            {"kind": "bend", "degrees": 40.0, "axis": "z", "towards": "x"},
        ]
    return {
        "kind": "patch", "texture": "wrinkle", "tiles": [GROOVES, 1], "size": [2 * np.pi * RADIUS, 1.0],
        "resolution": [40 * GROOVES + 1, 33], "depth": depth * _width(), "width": WIDTH, "pose": pose,
    }  # fmt: skip


def _width() -> float:
    return WIDTH * 2 * np.pi * RADIUS / GROOVES


def _across(points: Points) -> Array:
    """Return where points lie across their groove, in its widths; at its rim where they lie beyond."""
    assert points.uv is not None
    tile = np.mod(points.uv[:, 0] * GROOVES, 1) - 0.5
    return np.clip(tile / WIDTH, -0.5, 0.5)


def _shaded(wrinkle: Wrinkle, depth: float, whole: Rendering) -> dict[str, NDArray[np.floating]]:
    """Return radiance (n, 3) by the map, by the groove's transfer itself, without shadows, and without turning."""
    points, rotations = whole.scene.points, whole.scene.points.rotation
    assert rotations is not None
    reflectance = np.sum([lobe.reflectance for lobe in whole.scene.material.lobes], axis=0)
    light = real_harmonics.project(whole.scene.environment.radiance, ORDER - 1) * reflectance
    x = _across(points)
    lobes = wrinkle.at(x, np.full(len(x), depth))
    own = groove_transfer(x, depth, ORDER)
    packed = shade.pack(lobes.axes, lobes.coefficients, lobes.direct)
    return {
        MAPPED: shade.evaluated(packed, light, rotations),
        OWN: shade.full(own, light, rotations),
        UNSHADOWED: membrane.transfer(points.normal, ORDER) @ light,
        STATIC: shade.static(own, light),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
