"""Nine-term irradiance (Ramamoorthi and Hanrahan 2001) against the integral over the hemisphere."""

from __future__ import annotations

import numpy as np

from benchmarks import CATALOGUE
from envbench.records import Study
from methods.irradiance import ORDER, Irradiance, clamped_cosine
from methods.shrm.predictions import light_power
from references.quadrature import integrate

LIGHTS = ("esplanade", "studio", "workshop")
NORMALS = 256
ROWS = 64
"""Of the lights: more is nothing to a lobe as wide as this one."""
TOLERANCE = 1e-6


def nine_terms() -> Study:
    """Return the errors over uniform normals, by light, relative to the mean irradiance."""
    method, rows = Irradiance(), []
    for light in LIGHTS:
        scene = CATALOGUE.scene(
            name=f"{light}/lambertian/sphere/uniform", light={**CATALOGUE.lights[light], "size": ROWS},
            material=CATALOGUE.materials["lambertian"], geometry=CATALOGUE.geometries["sphere"],
            view={"kind": "uniform", "count": NORMALS},
        )  # fmt: skip
        exact = integrate(scene, tolerance=TOLERANCE)
        ours = method.shade(
            method.relight(method.prepare(scene.material, scene.geometry), scene.environment), scene.points
        )
        weight = scene.points.weight / scene.points.weight.sum()
        mean = (weight @ exact).mean()
        off = np.abs(ours - exact)
        square = weight @ ((ours - exact) ** 2), weight @ exact**2
        power = clamped_cosine(4) ** 2 * light_power(scene.environment, 4).sum(0)  # sum_m |E_lm|^2, to a factor
        errors = float((weight @ off).mean() / mean), float(off.max() / mean), float(square[0].sum() / square[1].sum())
        rows.append((light, *errors, float(power[4] / power.sum())))
    energy = clamped_cosine(200) ** 2 * (2 * np.arange(201) + 1)
    held = float(energy[: ORDER + 1].sum() / energy.sum())
    return Study(
        "irradiance-9-terms",
        "Nine-term irradiance against the integral over the hemisphere",
        f"Method irradiance-9 at {NORMALS:,} uniform normals against the deterministic quadrature, all channels. "
        "Average and largest absolute error over the mean irradiance; energy error: squared error over the irradiance "
        f"squared. Beside them the irradiance's own share of energy in l = 4, the first band left out, and the "
        f"share of the clamped cosine's energy that l <= {ORDER} holds.",
        ("light", "average error", "largest error", "energy error", "energy in l = 4", "cosine's energy held"),
        tuple((*row, held) for row in rows),
    )
