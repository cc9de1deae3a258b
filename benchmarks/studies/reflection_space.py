"""How sphere maps of a few views become the map of another one: Cabral, Olano and Nemec 1999, figure 4 and section 3.

A mirror under a test environment, as the figure has it, needs no prefiltering: a texel of a source map is the light in
the direction that it mirrors. Lines of equal angle show what a warp does, and hues where each part went.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import Scale, Tile, compose, exposed, signed, toned
from benchmarks.studies.rendered import error, scene
from envbench import latlong
from envbench.catalogue import Spec
from envbench.directions import Array, normalised, to_angles
from envbench.environment import Environment
from envbench.material import Centre
from envbench.records import Picture, Study
from envbench.reference import ReferenceSettings
from methods.cabral import Cabral, icosahedron, spheremap
from methods.cabral.blend import blend
from methods.cabral.sources import queries
from methods.cabral.warp import Source, source
from references import reference

MAPS, SIZE, ROWS, FADE = 12, 128, 256, 0.5
VIEW = (0.45, -0.8, 0.4)
COUNTS = (12, 42, 162)
VIEWS = ((0.0, -1.0, 0.0), (0.9, 0.3, 0.3), (-0.3, 0.5, 0.8))
"""Whose errors are averaged, as squares: a vertex of the icosahedron lies at none of them."""
BLENDED: dict[str, Spec] = {
    "Phong, s = 32": {"kind": "phong", "exponent": 32.0},
    "microfacet, sigma = .2": {"kind": "microfacet", "sigma": 0.2},
    "Cook-Torrance, .2": {"kind": "cook-torrance", "roughness": 0.2, "f0": [0.9, 0.6, 0.4]},
    "Kajiya-Kay, s = 32": {"kind": "kajiya-kay", "exponent": 32.0},
}
SUFFICES = 0.1
"""The error up to which twelve maps are said to suffice: the paper names none."""


def figure_4(name: str) -> Study:
    """Return weights and errors of the three sources and of their blend, with all maps; it needs no data."""
    light = _test_environment()
    view = normalised(VIEW)
    axes = spheremap.frame(view)
    vertices, _ = icosahedron.sphere(MAPS)
    face, weights = icosahedron.subtended(MAPS, view)
    sources = [source(vertices[k], w, axes) for k, w in zip(face, weights, strict=True)]
    maps = np.stack([_mirror_map(light, vertices[k]) for k in face])
    exact = _mirror_map(light, view)[..., :3]
    whole = blend(maps, sources, False, FADE, None)[..., :3]
    alone = [blend(maps[[k] * 3], [s] * 3, False, FADE, None)[..., :3] for k, s in enumerate(sources)]
    parts = [_part(maps, sources, k) for k in range(3)]
    inside = np.linalg.norm(_corners(), axis=-1) <= 1
    rms = float(np.sqrt(np.mean(exact[inside] ** 2)))

    def off(found: NDArray[np.floating]) -> float:
        return float(np.sqrt(np.mean((found - exact)[inside] ** 2))) / rms

    angle = [float(np.degrees(np.arccos(np.clip(vertices[k] @ view, -1, 1)))) for k in face]
    rows: list[tuple[str | float | bool | None, ...]] = [
        (f"source {k + 1}", float(weights[k]), angle[k], off(alone[k]), off(np.asarray(maps[k, ..., :3])), None, None)
        for k in range(3)
    ]
    residual = float(np.abs(sum(parts) - whole)[inside].max()) / rms
    best = off(whole) < min(map(off, alone))
    rows.append(("blend", float(weights.sum()), 0.0, off(whole), None, residual < 1e-5, best))

    def shown(texels: NDArray[np.floating]) -> NDArray[np.uint8]:
        return exposed(np.where(inside[..., None], texels, np.nan), 0.0)

    def shown_off(texels: NDArray[np.floating]) -> NDArray[np.uint8]:
        return signed(np.where(inside[..., None], (texels - exact) / rms, np.nan), 1.0)

    png = compose(
        [
            [Tile(shown(maps[k, ..., :3]), f"source {k + 1}, {angle[k]:.0f} degrees off") for k in range(3)],
            [Tile(shown(alone[k])) for k in range(3)],
            [Tile(shown(parts[k]), f"weight {weights[k]:.3f}") for k in range(3)],
            [Tile(shown(whole), "generated"), Tile(shown(exact), "exact"), Tile(shown_off(whole), "their difference")],
        ],
        labels=["source maps", "warped to the new view", "warped and weighted", "the sum"],
        notes=[
            "Mirror under a test environment: hues by azimuth, lines every 15 degrees.",
            toned(0.0),
        ],
        scale=Scale(1.0, "RMS radiances"),
    )  # fmt: skip
    return Study(
        name,
        "Three source maps warped, weighted and blended: a mirror under a test environment",
        f"Cabral, Olano and Nemec 1999, figure 4: the three of {MAPS} maps whose face the view meets, with spherical "
        f"barycentric weights; trust fades within {FADE:g} radii of each source's singular point. Maps of {SIZE} x "
        f"{SIZE} texels; errors are RMS differences to the view's own map, over its RMS, on the disk.",
        (
            "map", "weight", "degrees from the view", "error", "error without the warp", "is the sum of its parts",
            "better than any",
        ),
        tuple(rows),
        (),
        pictures=(
            Picture("maps", f"From the sources to the generated map of the new view. {toned(0.0)}", png),
        ),
    )  # fmt: skip


def number_of_maps(name: str, light: str | Spec = "studio", size: int = 64) -> Study:
    """Return the error of 12, 42 and 162 maps on several materials."""
    rows: list[tuple[str | int | float | bool | None, ...]] = []
    for material, spec in BLENDED.items():
        shown = [scene(light, spec, "sphere", {"kind": "image", "size": size, "direction": list(v)}) for v in VIEWS]
        truth = [reference(s, ReferenceSettings(floor=1.5e-2, budget=60)) for s in shown]
        for maps in COUNTS:
            filled = "shrm" if spec["kind"] == "kajiya-kay" else "angular"  # each where it is the faster
            method = Cabral(maps=maps, size=64, prefilter=filled, eps=0.001)
            prepared = method.prepare(shown[0].material, shown[0].geometry)
            relit = method.relight(prepared, shown[0].environment)
            errors = [
                error(np.asarray(method.shade(method.frame(relit, s.viewer), s.points), float), t)
                for s, t in zip(shown, truth, strict=True)
            ]
            off = float(np.sqrt(np.mean(np.square(errors))))
            rows.append((material, maps, off, bool(off <= SUFFICES) if maps == COUNTS[0] else None))
    return Study(
        name,
        "Error by the number of maps: 12, 42 and 162 views on an icosahedron",
        "Cabral, Olano and Nemec 1999, section 3.1: one map at each vertex of an icosahedron has been sufficient for "
        "the paper's environments and BRDF. Root mean square of three views' NRMSE on the sphere under the studio. "
        "Maps of 64 x 64 texels, eps = .001.",
        ("material", "maps", "NRMSE", f"12 suffice (at most {SUFFICES:g})"),
        tuple(rows),
    )


def _test_environment() -> Environment:
    """Return hues by azimuth, bright above and dim below, under lines every 15 degrees, dark, and a lamp."""
    where = latlong.grid(ROWS, 2 * ROWS)
    theta, phi = to_angles(where)
    hue = 0.5 + 0.45 * np.cos(phi[..., None] - 2 * np.pi / 3 * np.arange(3))
    lines = np.minimum(_from_line(theta), _from_line(phi) * np.sin(theta)) < np.radians(1.0)
    light = hue * (0.6 + 0.4 * where[..., 2:]) * np.where(lines, 0.15, 1.0)[..., None]
    lamp = where @ normalised((0.3, -0.6, 0.74)) > np.cos(np.radians(6))
    return Environment("test", np.where(lamp[..., None], 1.0, light).astype(np.float32))


def _from_line(angle: Array) -> Array:
    step = np.radians(15)
    return np.abs((angle + step / 2) % step - step / 2)


def _mirror_map(light: Environment, view: Array) -> NDArray[np.float32]:
    """Return the map (size, size, 4) that a mirror ball shows from `view`."""
    points = queries(Centre.REFLECTION, view, SIZE)
    return spheremap.padded(light(points.reflection)).reshape(SIZE, SIZE, 4)


def _part(maps: NDArray[np.float32], sources: list[Source], k: int) -> NDArray[np.floating]:
    """Return what one source contributes to the blend: the blend with the other two black."""
    only = np.zeros_like(maps)
    only[k] = maps[k]
    return blend(only, sources, False, FADE, None)[..., :3]


def _corners() -> Array:
    """Return the points of all texels, those beyond the disk too, (size, size, 2)."""
    along = (2 * np.arange(SIZE) + 1) / SIZE - 1
    return np.stack(np.meshgrid(along, -along), -1)
