"""Accuracy of SHRM: by order beside its estimates (RH 2002, fig. 6); and of measured materials by P (fig. 8)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from data_gen import environments, materials
from data_gen.external import locate
from data_gen.lobes import Phong
from data_gen.measured import curet as measured_curet
from envbench import harmonics, latlong
from envbench.environment import Environment
from envbench.errors import NeedsData
from envbench.material import Material
from envbench.records import Study
from methods.angular.prefilter import prefilter
from methods.shrm import maps, predictions
from methods.shrm.coefficients import captured, expand

GRACE, CURET = "environments/grace.exr", "brdfs/curet"
EXPONENT, ORDER, BEYOND = 32.0, 30, 127
"""Of figure 6; what the light and the lobe are followed to beyond it."""
ROWS = 64
VIEW_ORDERS = 5
EXCEPTIONS = (9, 23, 33, 41, 57)
"""Samples of CUReT that fig. 8 finds below 90 %, anisotropic ones."""


def grace() -> Study:
    """Return figure 6 under the Grace Cathedral."""
    path = locate(GRACE)
    return _by_order(
        "accuracy-by-order", "the Grace Cathedral", environments.build({"kind": "file", "path": str(path)})
    )


def workshop() -> Study:
    """Return figure 6 under a light that the project ships."""
    light = environments.build({"kind": "captured", "name": "workshop"})
    return _by_order("accuracy-by-order-workshop", "the workshop (not the Grace Cathedral)", light)


def _by_order(name: str, told: str, light: Environment) -> Study:
    lobe = Phong(exponent=EXPONENT, clipped=False)
    material = Material("Phong", (lobe,))
    wide = expand(lobe, 1e-9, BEYOND, 0)
    held = predictions.light_power(light, BEYOND).sum(0) * wide.rho[0, :, 0, 0] ** 2
    lit = predictions.light_power(light, BEYOND).sum(0)
    total_light = predictions.light_energy(light).sum()
    exact = prefilter(light.radiance.astype(np.float32), lobe, (ROWS, 2 * ROWS), 1e-6)[:, :, 0, 0]
    rows: list[tuple[int | float | bool, ...]] = []
    for F in range(ORDER + 1):
        kept = expand(lobe, 1e-9, F, 0)
        theories = predictions.predict(predictions.follow(material, [kept]), light, [np.zeros_like])
        accuracy = float(held[: F + 1].sum() / held[: ORDER + 1].sum())
        seen = np.moveaxis(maps.synthesise(kept, harmonics.analyse(light.radiance, F), ROWS)[:, 0], 0, 2)
        solid = latlong.solid_angles(ROWS, 2 * ROWS)[..., None]
        by_map = 1 - float((solid * (seen - exact) ** 2).sum() / (solid * exact.astype(float) ** 2).sum())
        of_light, of_lobe = float(lit[: F + 1].sum() / total_light), 1 - kept.missing
        least, bound = 1 - theories["least of light and BRDF"], 1 - theories["residual energy"]
        rows.append((F, accuracy, by_map, least, bound, of_lobe, of_light, least <= accuracy + 1e-9,
                     bound <= accuracy + 1e-9, least - of_lobe))  # fmt: skip
    return Study(
        name,
        f"Accuracy of an order F approximation and its estimates under {told}, Phong s = {EXPONENT:g}",
        f"Energy of the reflected light that degrees up to F hold, of what F = {ORDER} holds, as the paper has it; and "
        f"by a map of {ROWS} x {2 * ROWS} texels against angular prefiltering. Estimates (sec. 5.1): the better one of "
        "the energies of lobe and light that F holds; and the bound of appendix B, with the square of its Lambda.",
        ("F", "accuracy", "accuracy of a map", "minimum of errors", "residual bound", "energy of the BRDF",
         "energy of the light", "minimum is conservative", "bound is conservative", "minimum less BRDF alone"),
        tuple(rows),
        light.notes,
    )  # fmt: skip


def curet() -> Study:
    """Return figure 8: what F = 30 holds of each CUReT sample, by P."""
    names = sorted(name for name in materials.MATERIALS if name.startswith("curet-"))
    folder = locate(CURET)
    return _by_view_order(
        "curet-accuracy",
        "the 61 samples of CUReT",
        names,
        EXCEPTIONS,
        lambda number: measured_curet.fit(folder, number).residual,
    )


def presets() -> Study:
    """Return the same of the materials that need no data."""
    names: list[str] = []
    for name in materials.MATERIALS:
        try:
            materials.build(materials.MATERIALS[name], name)
            names.append(name)
        except NeedsData:
            continue
    return _by_view_order("preset-accuracy", "the project's own materials (not CUReT)", names)


def _by_view_order(
    name: str,
    told: str,
    names: list[str],
    exceptions: tuple[int, ...] = (),
    residual: Callable[[int], float | None] = lambda number: None,
) -> Study:
    rows: list[tuple[int | str | float | bool | None, ...]] = []
    for number, one in enumerate(names, 1):
        material = materials.build(materials.MATERIALS[one], one)
        power = np.array([float(expand(lobe, 0.5, 0, 0).total) for lobe in material.lobes])
        held = power / power.sum() @ np.array([captured(lobe, ORDER, VIEW_ORDERS) for lobe in material.lobes])
        judged = bool(held[-1] > 0.9), bool(held[3] > 0.95), number in exceptions
        rows.append((number, one, *(float(e) for e in held), *judged, residual(number)))
    above, close = sum(bool(row[-4]) for row in rows), sum(bool(row[-3]) for row in rows)
    low = [str(row[1]) for row in rows if not row[-4]]
    return Study(
        name,
        f"Energy that F = {ORDER} holds of {told}, by P",
        "Share of the energy of the BRDF about R, pooled over channels and lobes. Residual: what an isotropic "
        "fit leaves of the measurements, RMS over RMS.",
        ("number", "sample", *(f"P = {P}" for P in range(VIEW_ORDERS + 1)), "above 90 % at P = 5",
         "above 95 % at P = 3", "exception in fig. 8", "residual of the fit"),
        tuple(rows),
        (f"Above 90 % at P = 5: {above} of {len(rows)}; below: {', '.join(low) or 'none'}.",
         f"Above 95 % at P = 3: {close} of {len(rows)}."),
    )  # fmt: skip
