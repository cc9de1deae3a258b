"""Spheres by how blurred the light is and how diffuse the BRDF: the lower of two frequencies decides (RH 2002, fig. 5).

The light is blurred by what a Phong BRDF of exponent s does to it, exp(-l (l + 1) / 2 s), so that both kinds of blur
have the same steps. An order is the least that holds 1 - eps of an energy (sec. 5.1): F_L that of the blurred light,
F_rho that of the BRDF, and F_B that of the reflected light field, which should be about the lower of the two.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.studies.contact_sheet import Border, Tile, compose, exposed, toned
from benchmarks.studies.rendered import GRACE, apart, rendered, scene
from data_gen.environments import downsampled
from envbench import harmonics
from envbench.catalogue import Spec
from envbench.directions import Array
from envbench.environment import Environment
from envbench.records import Picture, Study
from envbench.scene import Scene
from envbench.tonemap import exposure
from methods.shrm import SHRM
from methods.shrm.coefficients import expand

EXPONENTS = (512.0, 128.0, 32.0, 8.0, 2.0)
"""Of the BRDFs, and of the blur of the light: each blurs twice as far as the one before."""
SHARPER = 2048.0
"""What the sharpest ones are held against, one step further: no sphere of the figure has it."""
EPS, HIGHEST, ROWS = 0.01, 95, 192
"""HIGHEST is the order to which all is rendered: exp(-l^2 / s) is below 1e-7 there for the sharpest."""


class _Sphere(NamedTuple):
    """One place of the grid: its image (n, 3), and the orders of light, BRDF and reflected light field."""

    image: Array
    light: int
    brdf: int
    reflected: int


def figure_5(name: str, light: str | Spec = GRACE, of: str = "Grace Cathedral", size: int = 128) -> Study:
    """Return the orders of every sphere and what one step of either blur changes, with the grid of images."""
    view = {"kind": "image", "size": size, "direction": [0.0, -1.0, 0.0]}
    shown = scene(light, "lambertian", "sphere", view)
    lit = downsampled(shown.environment, ROWS)
    exponents = (SHARPER, *EXPONENTS)
    blurred = [_blurred(lit, s) for s in exponents]
    materials = [
        scene(light, {"kind": "phong", "exponent": s, "clipped": False}, "sphere", view).material for s in exponents
    ]
    powers = [_power(harmonics.analyse(e.radiance, HIGHEST)) for e in blurred]
    grid = [
        [_sphere(replace(shown, environment=e, material=m), power) for m in materials]
        for e, power in zip(blurred, powers, strict=True)
    ]
    rows: list[tuple[str | float | int | bool | None, ...]] = []
    for i, j in np.ndindex(len(EXPONENTS), len(EXPONENTS)):
        sphere = grid[i + 1][j + 1]
        lower = min(sphere.light, sphere.brdf)
        by_light, by_brdf = (apart(other.image, sphere.image) for other in (grid[i][j + 1], grid[i + 1][j]))
        ratio = sphere.reflected / lower
        blurred_more, decides = "both", None
        if i != j:
            blurred_more = "light" if i > j else "BRDF"
            decides = bool(by_light > by_brdf) == (i > j)
        rows.append(
            (EXPONENTS[i], EXPONENTS[j], sphere.light, sphere.brdf, lower, sphere.reflected, ratio,
             bool(0.5 <= ratio <= 1), by_light, by_brdf, blurred_more, decides)
        )  # fmt: skip
    grid = [row[1:] for row in grid[1:]]
    stops = exposure(grid[3][3].image)
    png = compose(
        [[Tile(exposed(shown.points.image(sphere.image), stops)) for sphere in row] for row in grid],
        columns=[f"BRDF s = {s:g}\nF = {sphere.brdf}" for s, sphere in zip(EXPONENTS, grid[0], strict=True)],
        labels=[f"light blurred as by s = {s:g}\nF = {row[0].light}" for s, row in zip(EXPONENTS, grid, strict=True)],
        notes=[
            f"Phong spheres under {of}. Between yellow lines the lower of both frequencies is the same, and spheres "
            "look similar.",
            toned(stops),
        ],
        borders=[Border(((0, k), (k, k), (k, 0))) for k in range(1, len(EXPONENTS))],
    )
    ratios = [sphere.reflected / min(sphere.light, sphere.brdf) for row in grid for sphere in row]
    return Study(
        name,
        f"Light blur by BRDF blur: spheres under {of}",
        "RH 2002, figure 5: the highest frequency of the reflected light field is about the lower one of light and "
        f"BRDF. Orders hold all but {EPS:g} of an energy. A step sharpens the light, or the BRDF, to the next exponent "
        "upwards; changes are RMS differences over the RMS of the sphere. Below the diagonal the light is the more "
        "blurred, and should decide what the picture is; above it the BRDF. About the lower: from half of it to it.",
        (
            "light's s", "BRDF's s", "F light", "F BRDF", "lower F", "F reflected", "over the lower", "about the lower",
            "change by a sharper light", "change by a sharper BRDF", "more blurred", "it decides",
        ),
        tuple(rows),
        (f"F reflected over the lower F lies between {min(ratios):.3g} and {max(ratios):.3g}.",),
        pictures=(
            Picture(
                "grid",
                f"Down: the light is blurred more and more; to the right: the BRDF is more diffuse. {toned(stops)}",
                png,
            ),
        ),
    )  # fmt: skip


def _blurred(light: Environment, exponent: float) -> Environment:
    """Return the light convolved with the kernel of a Phong lobe, on its own grid."""
    rows, columns = light.radiance.shape[:2]
    l, _ = harmonics.degrees(HIGHEST)
    alm = harmonics.analyse(light.radiance, HIGHEST) * np.exp(-l * (l + 1) / (2 * exponent))
    out = np.empty((rows, columns, 3))
    for channel in range(3):
        plane = np.empty((1, rows, columns))
        harmonics.synthesise(alm[channel : channel + 1], 0, HIGHEST, plane)
        out[..., channel] = plane[0]
    return Environment(light.name, out.astype(np.float32), signed=True)


def _sphere(shown: Scene, light: Array) -> _Sphere:
    """Render a sphere and tell its orders; `light` is the light's energy by degree."""
    (lobe,) = shown.material.lobes
    rho = expand(lobe, EPS, HIGHEST, 0).rho[0, :, 0, 0]
    energy = rho**2 * (2 * np.arange(HIGHEST + 1) + 1)
    image = rendered(SHRM(order=HIGHEST, view_order=0), shown)
    return _Sphere(image, _order(light), _order(energy), _order(light * rho**2))


def _power(alm: harmonics.Coefficients) -> Array:
    """Return the energy of each degree, all channels together; only m >= 0 is stored, and m > 0 counts twice."""
    l, m = harmonics.degrees(HIGHEST)
    each = (np.abs(alm) ** 2).sum(0) * np.where(m == 0, 1.0, 2.0)
    return np.bincount(l, each, HIGHEST + 1).astype(float)


def _order(energy: Array) -> int:
    return int(np.searchsorted(np.cumsum(energy), (1 - EPS) * energy.sum()))
