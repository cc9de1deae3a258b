"""SHRM's images beside those of its rivals and the correct ones: RH 2002, figures 9 and 10."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import Scale, Tile, compose, exposed, percent, round_limit, signed
from benchmarks.studies.rendered import GRACE, error, rendered, scene
from envbench.catalogue import Spec
from envbench.directions import Array
from envbench.method import Method
from envbench.records import Picture, Study
from envbench.reference import ReferenceSettings
from envbench.scene import Scene
from envbench.tonemap import exposure
from methods.cabral import Cabral
from methods.kautz_mccool import KautzMcCool
from methods.shrm import SHRM
from methods.shrm.coefficients import captured, expand
from references import reference

SETTINGS = ReferenceSettings(floor=1e-2, budget=60)
RIM = 70.0
"""Degrees between N and V from which on a view counts as near grazing."""
FIBRES = "Seen from the front. Fibres run around the vertical axis, and within 26 degrees of the poles around another."
ACCURATE, LARGE = 0.1, 0.2
"""NRMSE at most, and at least, that "accurate" and "large errors" are taken for: the paper puts no number to them."""
_LEVELS = f"Accurate is taken for an NRMSE of at most {ACCURATE:g}, large errors for one of at least {LARGE:g}."
ORDER, VIEW_ORDER = 30, 5
"""F and P of the paper's images of measured materials."""


@dataclass(frozen=True)
class _Compared:
    """A scene, its correct image, what methods make of it by name, and their errors: everywhere and near grazing."""

    name: str
    scene: Scene
    truth: Array
    rms: float
    values: Mapping[str, Array]
    errors: Mapping[str, tuple[float, float]]

    def beside(self, method: str, shrm: str) -> tuple[float, bool]:
        """Return a method's error over that of SHRM, and whether SHRM is accurate, or the method's error large."""
        off = self.errors[method][0]
        return off / self.errors[shrm][0], off <= ACCURATE if method == shrm else off >= LARGE

    def tiles(self, scale: float) -> tuple[list[Tile | None], list[Tile | None]]:
        """Return a row of images, and one of their differences under their errors."""
        image = self.scene.points.image
        stops = exposure(self.truth)
        shown = [Tile(exposed(image(values), stops)) for values in (self.truth, *self.values.values())]
        apart = [
            Tile(signed(image(values - self.truth) / self.rms, scale), f"NRMSE {percent(self.errors[name][0])}")
            for name, values in self.values.items()
        ]
        return [*shown], [None, *apart]


def figure_9(
    name: str,
    material: str = "curet-07-velvet",
    lights: Mapping[str, str | Spec] | None = None,
    called: str = "velvet (CUReT 7)",
    size: int = 128,
) -> Study:
    """Return errors and images of SHRM and of Kautz and McCool's averages; raises `NeedsData` without its files."""
    chosen = {"Grace Cathedral": GRACE, "studio": "studio"} if lights is None else lights
    methods: dict[str, Method] = {
        f"SHRM, P = {VIEW_ORDER}": SHRM(order=ORDER, view_order=VIEW_ORDER),
        "q = 0, about R": KautzMcCool(shift=False, polar=32, eps=0.001),
        "q = 0, own axis": KautzMcCool(shift=True, polar=32, eps=0.001),
    }
    compared = [
        _compare(light, scene(spec, material, "sphere", _front(size)), methods) for light, spec in chosen.items()
    ]
    (lobe,) = compared[0].scene.material.lobes
    left_out = 1 - float(captured(lobe, ORDER, VIEW_ORDER)[-1])
    all_q = expand(lobe, 0.01, ORDER, VIEW_ORDER)
    without = _energy_of_other_q(all_q.full, left_out)
    lost = dict(zip(methods, (left_out, without, None), strict=True))
    rows = tuple(
        (c.name, method, *c.errors[method], lost[method], *c.beside(method, f"SHRM, P = {VIEW_ORDER}"))
        for c in compared
        for method in methods
    )
    return Study(
        name,
        f"SHRM and the azimuthal average of Kautz and McCool on {called}",
        "RH 2002, figure 9: the correct image, an SHRM of P = 5, and a BRDF without azimuthal dependence, which is an "
        "SHRM of q = 0 alone (its footnote 7). Kautz and McCool themselves average about an axis of their own, "
        f"shifted off R, and not about R: the last row of each light. F = {ORDER} for SHRM. {_LEVELS}",
        (
            "light",
            "method",
            "NRMSE",
            f"NRMSE from {RIM:g} degrees on",
            "BRDF energy left out",
            "times SHRM's error",
            "as the paper says",
        ),
        rows,
        (),
        pictures=(_pictured("images", compared, f"{called[0].upper()}{called[1:]}, seen from the front."),),
    )


def figure_10(name: str, light: str | Spec = "studio", size: int = 176) -> Study:
    """Return errors and images of SHRM and of Cabral's twelve maps on two materials that are hard for the latter."""
    methods: dict[str, Method] = {"SHRM": SHRM(eps=0.003), "Cabral, 12 maps": Cabral(maps=12, size=128, eps=0.003)}
    materials: dict[str, Spec] = {
        "sharp microfacet": {"kind": "microfacet", "sigma": 0.1},
        "Kajiya-Kay": {"kind": "kajiya-kay", "exponent": 32.0},
    }
    compared = [
        _compare(called, scene(light, spec, "sphere", _front(size)), methods) for called, spec in materials.items()
    ]
    rows = tuple((c.name, method, *c.errors[method], *c.beside(method, "SHRM")) for c in compared for method in methods)
    return Study(
        name,
        "SHRM and Cabral's twelve maps on a sharp material and on Kajiya and Kay's",
        "RH 2002, figure 10: the correct image, an SHRM that holds 99.7 % of the BRDF's energy, and the blend of three "
        "of twelve sphere maps. The paper names neither its sharp material nor the light: here a simplified microfacet "
        f"of sigma = .1, and Kajiya and Kay's fibre of exponent 32, under the studio. {_LEVELS}",
        ("material", "method", "NRMSE", f"NRMSE from {RIM:g} degrees on", "times SHRM's error", "as the paper says"),
        rows,
        (),
        pictures=(
            _pictured(
                "images",
                compared,
                FIBRES,
            ),
        ),
    )


def _front(size: int) -> Spec:
    return {"kind": "image", "size": size, "direction": [0.0, -1.0, 0.0]}


def _compare(name: str, shown: Scene, methods: Mapping[str, Method]) -> _Compared:
    truth = reference(shown, SETTINGS)
    rim: NDArray[np.bool_] = np.sum(shown.points.normal * shown.points.view, axis=1) <= np.cos(np.radians(RIM))
    values = {called: rendered(method, shown) for called, method in methods.items()}
    errors = {called: (error(found, truth), error(found, truth, rim)) for called, found in values.items()}
    return _Compared(name, shown, truth.mean, truth.rms, values, errors)


def _pictured(name: str, compared: Sequence[_Compared], told: str) -> Picture:
    limit = round_limit([c.scene.points.image(v - c.truth) / c.rms for c in compared for v in c.values.values()])
    rows: list[Sequence[Tile | None]] = [row for c in compared for row in c.tiles(limit)]
    note = "Linear radiance, the same exposure for all images of a row, clipped, sRGB curve."
    stops = ", ".join(f"{c.name} {exposure(c.truth):+g}" for c in compared)
    png = compose(
        rows,
        columns=["correct", *compared[0].values],
        labels=[label for c in compared for label in (c.name, "less the correct image")],
        notes=[told, f"{note} Stops: {stops}."],
        scale=Scale(limit, "RMS radiances of the correct image"),
    )
    caption = f"{told} {note} Stops: {stops}. Differences: ends of the scale at {percent(limit)} of the RMS radiance."
    return Picture(name, caption, png)


def _energy_of_other_q(rho: Array, left_out: float) -> float:
    """Return the share of a BRDF's energy outside q = 0, from rho_lpq (channels, F + 1, P + 1, Q + 1) to its orders."""
    energy = (rho**2).sum((0, 1, 2))
    energy[1:] *= 2
    return float(1 - (1 - left_out) * energy[0] / energy.sum())
