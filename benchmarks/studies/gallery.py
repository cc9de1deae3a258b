"""Materials under lights on a mesh, as one global SHRM each renders them: RH 2002, figure 1, and section 7.5."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.studies.contact_sheet import Pixels, Tile, compose, exposed, percent
from benchmarks.studies.rendered import error, scene
from envbench.catalogue import Spec
from envbench.directions import Array, normalised, upright
from envbench.environment import Environment
from envbench.records import Picture, Study
from envbench.reference import ReferenceSettings
from envbench.scene import FREE, Scene
from envbench.tonemap import displayed, exposure
from methods.shrm import SHRMGlobal
from references import reference

ORDER, VIEW_ORDER, FIBRE_ORDER, SIZE = 30, 5, 8, 64
"""F and P that the paper finds to suffice (sec. 7.2), P of its fibres (7.1), and its 64 x 64 x 6 texels (7.5)."""
TOWARDS, FOV = (0.4, 0.88, 0.15), 70.0
"""Where the viewer is, and the degrees that the picture's background spans."""
ACCURATE = 0.1
"""NRMSE at most that "accurate" is taken for: the paper puts no number to it."""
FRAMES, JUDGED = 5, 2048
"""Frames that are timed, and points at which errors are taken."""
PROBES: dict[str, str | Spec] = {
    "Grace Cathedral": {"kind": "file", "path": "environments/grace.exr"},
    "St. Peter's": {"kind": "file", "path": "environments/stpeters.exr"},
    "Uffizi": {"kind": "file", "path": "environments/uffizi.hdr"},
    "Eucalyptus Grove": {"kind": "file", "path": "environments/eucalyptus.exr"},
}
MATERIALS = {
    "microfacet": "microfacet",
    "krylon blue": "krylon-blue",
    "orange peel": "curet-55-orange-peel",
    "velvet": "curet-07-velvet",
    "Kajiya-Kay": "kajiya-kay",
}
SHIPPED: dict[str, str | Spec] = {
    "esplanade": "esplanade",
    "studio": "studio",
    "workshop": "workshop",
    "generated hall": "hall",
}
ANALYTIC = {
    "microfacet": "microfacet",
    "blue paint": "lafortune-bluepaint",
    "clay": "lafortune-clay",
    "felt": "lafortune-felt",
    "Kajiya-Kay": "kajiya-kay",
}
"""The nearest to the figure's materials that need no data: Lafortune's own measurements are in the project."""


def figure_1(
    name: str,
    lights: Mapping[str, str | Spec] = PROBES,
    materials: Mapping[str, str] = MATERIALS,
    geometry: str = "armadillo",
    size: int = 160,
) -> Study:
    """Return error and frame rate of each material under each light, with images; raises `NeedsData` without files."""
    rows: list[tuple[str | int | float, ...]] = []
    sheet: list[list[Tile]] = []
    view: Spec = {"kind": "image", "size": size, "direction": list(TOWARDS)}
    prepared: dict[str, Any] = {}
    for light, spec in lights.items():
        tiles: list[Tile] = []
        for called, material in materials.items():
            shown = scene(spec, material, geometry, view, effects=tuple(FREE))
            P = FIBRE_ORDER if material == "kajiya-kay" else VIEW_ORDER
            method = SHRMGlobal(order=ORDER, view_order=P, size=SIZE)
            if called not in prepared:
                prepared[called] = method.prepare(shown.material, shown.geometry.rest)
            left_out = float(method.describe(prepared[called])["missing energy"][0])
            relit = method.relight(prepared[called], shown.environment)
            values = np.asarray(method.shade(method.frame(relit, shown.viewer), shown.points), float)
            seconds = [_frame(method, relit, shown) for _ in range(FRAMES)]
            some = replace(shown, points=shown.points.spread(JUDGED))
            judged = np.asarray(method.shade(method.frame(relit, shown.viewer), some.points), float)
            off = error(judged, reference(some, ReferenceSettings(floor=2e-2, budget=60)))
            rows.append((light, called, ORDER, P, left_out, off, off <= ACCURATE, 1 / float(np.median(seconds))))
            tiles.append(Tile(_with_background(shown, values), f"NRMSE {percent(off)}"))
        sheet.append(tiles)
    worst = max(rows, key=lambda row: row[5])
    text = "Objects: linear radiance, each exposed by itself, clipped, sRGB curve. Backgrounds: sRGB(x / (1 + x))."
    return Study(
        name,
        f"Five materials under four lights: {geometry}, global SHRM",
        f"RH 2002, figure 1: F = {ORDER}, P = {VIEW_ORDER} ({FIBRE_ORDER} for Kajiya-Kay), {SIZE} x {SIZE} x 6 texels. "
        "Errors against Mitsuba without shadows, which reflection maps do not know either. A frame is eq. 12 and a "
        f"lookup at every pixel that the shape covers of {size} x {size}; the median of {FRAMES}. Errors are taken at "
        f"{JUDGED:,} of these pixels; accurate is one of at most {ACCURATE:g}.",
        ("light", "material", "F", "P", "BRDF energy left out", "NRMSE", "accurate", "frames a second"),
        tuple(rows),
        (f"The largest error is that of {worst[1]} under {worst[0]}: {float(worst[5]):.3g}.",),
        pictures=(
            Picture(
                "gallery",
                f"Rendered by SHRM: {', '.join(materials)} under {', '.join(lights)}. {text}",
                compose(sheet, columns=list(materials), labels=list(lights), notes=[text]),
            ),
        ),
    )  # fmt: skip


def _frame(method: SHRMGlobal, relit: Any, shown: Scene) -> float:
    start = time.perf_counter()
    method.shade(method.frame(relit, shown.viewer), shown.points)
    return time.perf_counter() - start


def _with_background(shown: Scene, values: Array) -> Pixels:
    """Return the image before the light that a camera would see behind it."""
    image = shown.points.image(values)
    pixels = exposed(image, exposure(values))
    nothing = np.isnan(image[..., 0])
    pixels[nothing] = _background(shown.environment, len(image))[nothing]
    return pixels


def _background(light: Environment, size: int) -> Pixels:
    towards = normalised(TOWARDS)
    right, up = upright(towards, (0.0, 0.0, 1.0))
    along = np.tan(np.radians(FOV) / 2) * (2 * (np.arange(size) + 0.5) / size - 1)
    seen = light(normalised(along[None, :, None] * right - along[:, None, None] * up - towards))
    flat = seen.reshape(-1, 3)
    return np.rint(255 * displayed(flat, flat)).astype(np.uint8).reshape(size, size, 3)
