"""Car paint by reflection-space image-based rendering: Cabral, Olano and Nemec 1999, figures 3 and 5, section 5.

The paint is the preset `layered-paint`: a coloured base, flakes about R in it, and a sharp clear coat with its Fresnel
term, summed. All share one set of maps under the mirror warp, as the paper has it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import (
    Pixels,
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
from benchmarks.studies.reflection_space import SUFFICES
from benchmarks.studies.rendered import apart, error, rendered, scene
from envbench.catalogue import Spec
from envbench.directions import Array, normalised
from envbench.material import Centre
from envbench.records import Picture, Study
from envbench.reference import ReferenceSettings
from envbench.scene import FREE
from envbench.tonemap import displayed, exposure
from methods.cabral import Cabral
from methods.cabral.sources import integrated, queries
from methods.shrm import SHRM
from references import reference

LIGHT, PAINT = "esplanade", "layered-paint"
VIEWS = ((-0.35, -0.9, 0.25), (0.6, -0.75, 0.28))
SIZE, MAPS = 96, 12
SURFACES: dict[str, str | Spec] = {
    "paint": PAINT,
    "chrome": {"kind": "cook-torrance", "roughness": 0.08, "f0": [0.55, 0.56, 0.58]},
    "rubber": {
        "lobes": [
            {"kind": "lambertian", "reflectance": [0.04, 0.04, 0.04]},
            {"kind": "cook-torrance", "roughness": 0.5, "f0": [0.04, 0.04, 0.04]},
        ]
    },
}
"""Surfaces of a car, which the figure has maps for without naming them."""
METHOD = Cabral(maps=MAPS, size=SIZE, prefilter="angular", warp="mirror")


def figure_3(name: str, geometry: str = "bunny", size: int = 192) -> Study:
    """Return errors and images of a painted mesh from two views; raises `NeedsData` where the mesh is absent."""
    rows: list[tuple[str | int | float | None, ...]] = []
    errors: list[float] = []
    images: list[tuple[NDArray[np.floating], ...]] = []
    values: list[Array] = []
    relit = None
    for number, towards in enumerate(VIEWS, 1):
        view: Spec = {"kind": "image", "size": size, "direction": list(towards)}
        shown = scene(LIGHT, PAINT, geometry, view, effects=tuple(FREE))
        if relit is None:
            relit = METHOD.relight(METHOD.prepare(shown.material, shown.geometry.rest), shown.environment)
        found = np.asarray(METHOD.shade(METHOD.frame(relit, shown.viewer), shown.points), float)
        truth = reference(shown, ReferenceSettings(floor=2e-2, budget=60))
        shrm = SHRM(order=40, view_order=5)
        prepared = shrm.prepare(shown.material, shown.geometry.rest)
        beside = np.asarray(shrm.shade(shrm.relight(prepared, shown.environment), shown.points), float)
        errors.append(error(found, truth))
        rows.append((number, f"Cabral, {MAPS} maps", errors[-1], errors[-1] <= SUFFICES))
        rows.append((number, "SHRM, F = 40, P = 5", error(beside, truth), None))
        image = shown.points.image
        images.append((image(found), image(truth.mean), image(found - truth.mean) / truth.rms))
        values.append(truth.mean)
    stops = exposure(np.concatenate(values))
    limit = round_limit([difference for *_, difference in images])
    png = compose(
        [
            [
                Tile(exposed(a, stops)),
                Tile(exposed(b, stops)),
                Tile(signed(d, limit), f"NRMSE {percent(off)}"),
            ]
            for (a, b, d), off in zip(images, errors, strict=True)
        ],
        columns=[f"{MAPS} maps, blended", "reference", "difference"],
        labels=["view 1", "view 2"],
        notes=[f"Layered paint under {LIGHT}, {geometry}. Neither image has shadows. {toned(stops)}"],
        scale=Scale(limit, "RMS radiances of the reference"),
    )
    return Study(
        name,
        f"Layered paint under {LIGHT}, rendered from {MAPS} sphere maps: {geometry}",
        f"Cabral, Olano and Nemec 1999, figure 3: a base with flakes under a clear coat, {MAPS} maps of {SIZE} x "
        f"{SIZE} texels integrated over the light, one mirror warp for all lobes. Beside Mitsuba, without shadows, "
        "which no reflection map knows. The paper's car, and the place outdoors where it stands, are not to be had.",
        ("view", "method", "NRMSE", f"{MAPS} suffice (at most {SUFFICES:g})"),
        tuple(rows),
        (),
        pictures=(Picture("painted", f"Blended maps, reference and difference. {toned(stops)}", png),),
    )


def figure_5(name: str, size: int = 64) -> Study:
    """Return how maps of three surfaces differ, with all maps as the figure lays them out; it needs no data."""
    view: Spec = {"kind": "image", "size": 64, "direction": list(VIEWS[0])}
    rows: list[tuple[str | int | float, ...]] = []
    sheet: list[list[Tile]] = []
    labels: list[str] = []
    for surface, spec in SURFACES.items():
        shown = scene(LIGHT, spec, "sphere", view)
        method = replace(METHOD, size=size)
        relit = method.relight(method.prepare(shown.material, shown.geometry), shown.environment)
        (maps,) = relit.maps
        ((_, generated),) = method.frame(relit, shown.viewer).maps
        stops = exposure(maps[..., :3].reshape(-1, 3))
        tiles = [Tile(_disk(m, stops)) for m in maps]
        levels = _mip(generated)
        sheet += [[*tiles[:6]], [*tiles[6:]], [Tile(_disk(level, stops)) for level in levels[:5]]]
        labels += [f"{surface}: 12 sources, {stops:+g} stops", "", "generated map, MIP levels"]
        asked = queries(Centre.REFLECTION, normalised(VIEWS[0]), size)
        lobes, light = shown.material.lobes, shown.environment
        own = integrated(lobes, light, [asked], method.eps, method.light_rows)[..., :3].reshape(-1, 3).astype(float)
        off, each = (
            apart(rendered(replace(method, warp=warp), replace(shown, points=asked)), own)
            for warp in ("mirror", "auto")
        )
        rows.append((surface, len(maps), size, len(levels), maps.nbytes // 4 * 3, off, off <= SUFFICES, each))
    light = scene(LIGHT, PAINT, "sphere", view).environment.radiance[::2, ::2].astype(float)
    flat = light.reshape(-1, 3)
    picture = np.rint(255 * displayed(flat, flat)).astype(np.uint8).reshape(light.shape)
    note = "Environment: sRGB(x / (1 + x)). Maps: linear radiance, exposed as told at each row, clipped, sRGB curve."
    return Study(
        name,
        f"All maps behind a painted car: environment, {MAPS} source maps a surface, generated maps",
        f"Cabral, Olano and Nemec 1999, figure 5. Source maps of {size} x {size} texels, one mirror warp; generated "
        "maps are those of the first view of figure 3, halved down to a texel. Their error is the RMS difference "
        "to the map integrated for that view itself, over its RMS; the last column has diffuse lobes in maps of their "
        "own, under the normal warp.",
        (
            "surface", "source maps", "texels across", "MIP levels", "bytes of the sources",
            "error of the generated map", f"{MAPS} suffice (at most {SUFFICES:g})", "with a warp for each lobe",
        ),
        tuple(rows),
        (),
        pictures=(
            Picture("environment", f"The environment, {LIGHT}. {note}", compose([[Tile(picture)]], notes=[note])),
            Picture(
                "maps",
                f"For each surface its {MAPS} source maps, and the generated map with its MIP levels. {note}",
                compose(sheet, labels=labels, notes=[note]),
            ),
        ),
    )  # fmt: skip


def costs(name: str, size: int = 128) -> Study:
    """Return seconds of one source map, of a frame's warp and blend, and of lookups, for the layered paint."""
    shown = scene(LIGHT, PAINT, "sphere", {"kind": "image", "size": 256, "direction": list(VIEWS[0])})
    rows: list[tuple[str | float | None, ...]] = []
    method = replace(METHOD, size=size)
    group, (asked, *_) = method.prepare(shown.material, shown.geometry).groups[0], [normalised(VIEWS[0])]
    one = [queries(group.index, asked, size)]
    cost = _median(lambda: integrated(group.lobes, shown.environment, one, method.eps, method.light_rows), 2)
    rows.append(("one source map, integrated", cost, 1 / cost))
    for called, mesh in (("a frame's map, exact warp", 0), ("a frame's map, tessellated disk", 16)):
        drawn = replace(method, mesh=mesh, eps=0.5, light_rows=4)  # a frame takes as long whatever its maps hold
        prepared = drawn.prepare(shown.material, shown.geometry)
        relit = drawn.relight(prepared, shown.environment)
        cost = _median(lambda drawn=drawn, relit=relit: drawn.frame(relit, shown.viewer), 9)
        rows.append((called, cost, 1 / cost))
        if not mesh:
            framed = drawn.frame(relit, shown.viewer)
            cost = _median(lambda drawn=drawn, framed=framed: drawn.shade(framed, shown.points), 9)
            rows.append(("lookup of an image of 256 x 256", cost, 1 / cost))
            whole = rows[1][1] + cost  # type: ignore[operator]
            rows.append(("a frame: exact warp and lookup", whole, 1 / whole))
    return Study(
        name,
        "What one map and one frame cost: layered paint",
        f"Cabral, Olano and Nemec 1999, section 5: several minutes a map, 20 frames a second on an Onyx2. Maps of "
        f"{size} x {size} texels from a light of {method.light_rows} rows; medians, on this machine's processor alone.",
        ("step", "seconds", "a second"),
        tuple(rows),
    )


def _median(step: Callable[[], object], rounds: int) -> float:
    step()  # compiles
    seconds: list[float] = []
    for _ in range(rounds):
        start = time.perf_counter()
        step()
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def _disk(texels: NDArray[np.floating], stops: float) -> Pixels:
    """Return a sphere map's disk on white, enlarged to about 96 pixels where it is larger than 16."""
    size = len(texels)
    along = (2 * np.arange(size) + 1) / size - 1
    inside = np.hypot(along[:, None], along) <= 1
    pixels = exposed(np.where(inside[..., None], texels[..., :3], np.nan), stops)
    return enlarged(pixels, 96) if size > 48 else pixels


def _mip(texels: NDArray[np.floating]) -> list[NDArray[np.floating]]:
    """Return the map and its halves, each texel the mean of four, down to one texel."""
    levels = [texels]
    while len(levels[-1]) > 1:
        last = levels[-1]
        levels.append((last[::2, ::2] + last[1::2, ::2] + last[::2, 1::2] + last[1::2, 1::2]) / 4)
    return levels
