"""What the order P of the view's harmonics does to images: RH 2002, figure 7."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import Scale, Tile, compose, exposed, percent, round_limit, signed, toned
from benchmarks.studies.rendered import GRACE, error, rendered, scene
from envbench.catalogue import Spec
from envbench.directions import Array, from_angles, normalised, to_angles
from envbench.geometry import Points
from envbench.records import Picture, Study
from envbench.reference import ReferenceSettings
from envbench.scene import Scene
from envbench.tonemap import exposure
from methods.shrm import SHRM
from methods.shrm.coefficients import captured
from references import reference

ORDER, VIEW_ORDERS, ROWS = 30, range(6), 128
"""F_B, P and S_B of the figure."""
VIEWS = {"theta_o = 60, phi_o = 0": (60.0, 0.0), "theta_o = 140, phi_o = 90": (140.0, 90.0)}
"""The two local views (theta_o, phi_o) in degrees, each held at all R; the paper does not say which it took."""
AVERAGE = "uniform R and V"
MATERIAL: Spec = {"kind": "microfacet", "sigma": 0.2, "clipped": False}


def figure_7(name: str, light: str | Spec = GRACE, of: str = "Grace Cathedral", size: int = 128) -> Study:
    """Return the error by P at two views and over uniform (R, V), with images; raises `NeedsData` without the light."""
    sphere = scene(light, MATERIAL, "sphere", {"kind": "image", "size": size, "direction": [0.0, -1.0, 0.0]})
    average = scene(light, MATERIAL, "sphere", {"kind": "uniform", "count": 8192})
    held = captured(sphere.material.lobes[0], ORDER, VIEW_ORDERS[-1])
    settings = ReferenceSettings(floor=1.5e-2, budget=60)
    rows: list[tuple[str | int | float | bool, ...]] = []
    sheet: list[list[Tile]] = []
    labels: list[str] = []
    shots: dict[str, list[Array]] = {}
    for view, asked in {**{v: _from_view(sphere, *angles) for v, angles in VIEWS.items()}, AVERAGE: average}.items():
        truth = reference(asked, settings)
        for P in VIEW_ORDERS:
            values = rendered(SHRM(order=ORDER, view_order=P, rows=ROWS), asked)
            off = error(values, truth)
            rows.append((P, view, float(held[P]), off, off**2, bool(off**2 <= 1 - held[P])))
            shots.setdefault(view, []).append(values)
        shots[view].append(truth.mean)
    images = {view: [sphere.points.image(values) for values in shots[view]] for view in VIEWS}
    differences = {view: [(i - same[-1]) / _rms(same[-1]) for i in same[:-1]] for view, same in images.items()}
    stops = exposure(np.concatenate([shots[view][-1] for view in VIEWS]))
    scale = Scale(round_limit([d for all_of in differences.values() for d in all_of]), "RMS radiances of the image")
    for view, same in images.items():
        errors = [row[3] for row in rows if row[1] == view]
        sheet.append([Tile(exposed(image, stops)) for image in same])
        sheet.append(
            [Tile(signed(d, scale.limit), percent(float(e))) for d, e in zip(differences[view], errors, strict=True)]
        )
        labels += [view.replace(", ", "\n"), "less the exact image; NRMSE"]
    png = compose(
        sheet,
        columns=[*(f"P = {P}: {percent(float(held[P]))} of the BRDF's energy" for P in VIEW_ORDERS), "exact"],
        labels=labels,
        notes=[
            f"Simplified microfacet, sigma = 0.2, under {of}. Spheres of central directions R, as seen from afar; "
            "at each of them the view is at the same angles in R's frame.",
            f"SHRM with F = {ORDER}, S = {ROWS}. {toned(stops)}",
        ],
        scale=scale,
    )  # fmt: skip
    return Study(
        name,
        f"Images by the view's order P: simplified microfacet, sigma = 0.2, under {of}",
        f"RH 2002, figure 7: SHRM with F = {ORDER}, S = {ROWS} and P = 0 ... 5 against Mitsuba, with the whole lobe of "
        "eq. 11. "
        "The BRDF's captured energy is what the paper estimates accuracy by: the energy error, NRMSE squared, should "
        "not be above what the BRDF lacks. At one view that need not hold, over uniform R and V it does on average.",
        ("P", "view", "BRDF energy", "NRMSE", "energy error", "within the estimate"),
        tuple(rows),
        (),
        pictures=(
            Picture(
                "images by P",
                f"P = 0 ... 5 and the exact image at two local views, and differences on a scale of "
                f"{percent(scale.limit)} of the image's RMS radiance at its ends. {toned(stops)}",
                png,
            ),
        ),
    )


def _from_view(sphere: Scene, theta_o: float, phi_o: float) -> Scene:
    """Return the scene whose points have their own direction for R, seen from (theta_o, phi_o) in R's frame."""
    R = sphere.points.normal
    alpha, beta = to_angles(R)
    x, y = from_angles(alpha + np.pi / 2, beta), from_angles(np.full_like(beta, np.pi / 2), beta + np.pi / 2)
    local = from_angles(np.radians(theta_o), np.radians(phi_o))
    view = local[0] * x + local[1] * y + local[2] * R
    normal = normalised(R + view)
    points = Points(normal, normal, normal, x, view, sphere.points.weight)
    return replace(sphere, points=points, viewer=None)


def _rms(image: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.nanmean(image**2)))
