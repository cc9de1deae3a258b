"""What is predicted is what happens: against an SHRM of far higher order as truth, over uniform (R, V)."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen import environments, views
from data_gen.lobes import KajiyaKay, Lambertian, Microfacet, Phong
from envbench import latlong
from envbench.environment import Environment
from envbench.geometry import Geometry, Points
from envbench.material import Lobe, Material
from methods.shrm import SHRM
from methods.shrm.predictions import light_power

SPHERE = Geometry("sphere")
LIGHT = environments.build({"kind": "lamps", "count": 4, "seed": 1, "size": 64})
TRUTH = SHRM(order=24, view_order=12)
WEIGHED = "BRDF weighed by the light"


def rendered(method: SHRM, material: Material, points: Points) -> np.ndarray:
    return np.asarray(method.shade(method.relight(method.prepare(material, SPHERE), LIGHT), points))


@pytest.mark.parametrize(
    "lobes",
    [
        (Phong(exponent=16),),
        (Microfacet(sigma=0.3),),
        (Lambertian(reflectance=(0.5, 0.1, 0.1)), Phong(exponent=16)),
        (Lambertian(), Phong(exponent=16, clipped=False)),
    ],
    ids=lambda lobes: "+".join(type(lobe).__name__ for lobe in lobes),
)
@pytest.mark.parametrize(("order", "view_order"), [(3, 0), (6, 0), (8, 2)])
def test_error_is_as_predicted(lobes: tuple[Lobe, ...], order: int, view_order: int) -> None:
    """Within 6 %: 2^14 queries leave 2 %, and the truth itself is cut at F = 24, P = 12: 4 % of the least errors."""
    material, method = Material("m", lobes), SHRM(order=order, view_order=view_order)
    points, _ = views.build({"kind": "uniform", "count": 2**14, "grazing": 0.5}, SPHERE)
    exact = rendered(TRUTH, material, points)
    square = (rendered(method, material, points) - exact) ** 2
    error = points.weight @ square.mean(1) / (points.weight @ (exact**2).mean(1))
    predicted = method.predictions(method.prepare(material, SPHERE), LIGHT)[WEIGHED]
    assert predicted == pytest.approx(error, rel=0.06)


def test_uniform_tangents_too() -> None:
    """Tangents drawn about N: cos theta_o then has the density (2 / pi) sqrt(1 - x^2), and T is uniform."""
    points, _ = views.build({"kind": "uniform", "count": 2**14}, SPHERE)
    material, method = Material("m", (KajiyaKay(exponent=16),)), SHRM(order=5, view_order=4)
    exact = rendered(TRUTH, material, points)
    error = np.mean((rendered(method, material, points) - exact) ** 2) / np.mean(exact**2)
    assert method.predictions(method.prepare(material, SPHERE), LIGHT)[WEIGHED] == pytest.approx(error, rel=0.06)


def test_white_light_gives_captured_energy_back() -> None:
    """One pixel of light has the same power in every degree and order: w_l ~ 2 l + 1. Then weighing changes nothing."""
    radiance = np.zeros((256, 512, 3), np.float32)
    radiance[80, 60] = 1e4
    method = SHRM(eps=0.1)
    prepared = method.prepare(Material("m", (Microfacet(sigma=0.3, clipped=False),)), SPHERE)
    found = method.predictions(prepared, Environment("lamp", radiance))
    assert found[WEIGHED] == pytest.approx(found["captured BRDF energy"], rel=0.03)  # lookup's own error is in it


def test_theories_about_f_do_not_see_p() -> None:
    """Nothing is left out in F, much in P: section 5.1's rule and appendix B say zero, the others do not."""
    method = SHRM(order=40, view_order=0)
    found = method.predictions(method.prepare(Material("m", (Microfacet(sigma=0.5, clipped=False),)), SPHERE), LIGHT)
    assert found["least of light and BRDF"] < 1e-3 < found["captured BRDF energy"]
    assert found["residual energy"] < 1e-3 < found[WEIGHED]


def test_power_of_light_is_its_energy() -> None:
    radiance = 1 + np.einsum("ijk,k->ij", latlong.grid(32, 64), [0.3, 0.2, 0.5])
    power = light_power(Environment("linear", np.repeat(radiance[..., None], 3, 2).astype(np.float32)), 4)
    # int 1 and int (a.w)^2; hat functions of step d lose 1 - sinc^4(d / 2) = d^2 / 6 of a wave's power, along two axes
    assert power[0, :2] == pytest.approx([4 * np.pi, 4 * np.pi / 3 * 0.38], rel=2 * (np.pi / 32) ** 2 / 6)
    assert power[0, 2:].max() < 1e-5


def test_no_light_and_no_reflectance_predict_nothing() -> None:
    black = Environment("black", np.zeros((8, 16, 3), np.float32))
    for material, light in (
        (Material("m", (Lambertian(),)), black),
        (Material("m", (Lambertian(reflectance=(0, 0, 0)),)), LIGHT),
    ):
        found = SHRM().predictions(SHRM().prepare(material, SPHERE), light)
        assert all(np.isfinite(value) for value in found.values())
