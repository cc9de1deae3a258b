"""Nine-term irradiance against scipy's harmonics, the printed matrix, and brute force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from data_gen.lobes import Lambertian, Phong
from envbench import latlong, laws
from envbench.directions import from_angles, perpendicular, to_angles, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Material
from methods.irradiance import Irradiance, clamped_cosine, quadratic_form

SPHERE = Geometry("sphere")
GREY = Material("grey", (Lambertian(reflectance=(0.2, 0.5, 0.7)), Lambertian(reflectance=(0.1, 0.1, 0.1))))
METHOD = Irradiance()


def points(normal: np.ndarray) -> Points:
    return Points(normal, normal, normal, perpendicular(normal), normal, np.full(len(normal), 1 / len(normal)))


def rendered(light: Environment, material: Material, normal: np.ndarray) -> np.ndarray:
    state = METHOD.relight(METHOD.prepare(material, SPHERE), light)
    return METHOD.shade(METHOD.frame(state, None), points(normal))


def rough(height: int, width: int) -> Environment:
    values = np.exp(np.random.default_rng(0).normal(0, 1.5, (height, width, 3)))
    return Environment("rough", values.astype(np.float32))


def test_clamped_cosine_is_the_closed_form() -> None:
    """RH 2001, eq. 8, over pi."""
    expected = [1, 2 / 3]
    for l in range(2, 21):
        even = 2 * (-1) ** (l // 2 - 1) / ((l + 2) * (l - 1)) * special.factorial(l)
        expected.append(0 if l % 2 else even / (2.0**l * special.factorial(l // 2) ** 2))
    np.testing.assert_allclose(clamped_cosine(20), expected, atol=1e-14)


def test_the_form_is_the_printed_matrix() -> None:
    """RH 2001, eqs. 11 and 12 with the real harmonics of eq. 1, for random coefficients."""
    rng = np.random.default_rng(1)
    real = rng.normal(size=9)  # order l * l + l + m
    l00, l1m1, l10, l11, l2m2, l2m1, l20, l21, l22 = real
    c1, c2, c3, c4, c5 = 0.429043, 0.511664, 0.743125, 0.886227, 0.247708
    printed = np.array([
        [c1 * l22, c1 * l2m2, c1 * l21, c2 * l11],
        [c1 * l2m2, -c1 * l22, c1 * l2m1, c2 * l1m1],
        [c1 * l21, c1 * l2m1, c3 * l20, c2 * l10],
        [c2 * l11, c2 * l1m1, c2 * l10, c4 * l00 - c5 * l20],
    ])  # fmt: skip
    # real Y_lm = (-1)^m sqrt(2) Re Y_lm for m > 0 and ... Im Y_l|m| for m < 0, so that L = (-1)^m (a - i b) / sqrt(2)
    light = np.array(
        [l00, l10, l20, -(l11 - 1j * l1m1) / 2**0.5, -(l21 - 1j * l2m1) / 2**0.5, (l22 - 1j * l2m2) / 2**0.5]
    )
    form = quadratic_form(np.broadcast_to(light, (3, 6)), np.ones(3))[:, 0].astype(float)
    one, x, y, z, xx, yy, zz, xy, yz, zx = form * np.pi
    ours = np.array([[xx, xy / 2, zx / 2, x / 2], [xy / 2, yy, yz / 2, y / 2], [zx / 2, yz / 2, zz, z / 2],
                     [x / 2, y / 2, z / 2, one]])  # fmt: skip
    np.testing.assert_allclose(ours, printed, atol=5e-6)  # printed to six digits


def test_band_limited_light_is_rendered_exactly(mi: object) -> None:
    """Light of degree 2 at most is what nine terms hold: against scipy's Y_lm times A_l."""
    theta, phi = to_angles(latlong.grid(256, 512))
    shape = np.stack([special.sph_harm_y(l, m, theta, phi).real for l, m in ((1, 1), (2, 1), (2, 2))], -1)
    normal = uniform(100, np.random.default_rng(2))
    at = to_angles(normal)
    expected = np.stack([special.sph_harm_y(l, m, *at).real for l, m in ((1, 1), (2, 1), (2, 2))], -1) * [
        2 / 3, 1 / 4, 1 / 4,
    ]  # fmt: skip
    result = rendered(Environment("smooth", (1 + shape).astype(np.float32)), Material("white", (Lambertian(),)), normal)
    # bilinear samples lose h^2 / 8 of second derivatives of at most l (l + 1)
    np.testing.assert_allclose(result, 1 + expected, atol=(np.pi / 256) ** 2 / 8 * 6 + 1e-6)


@pytest.mark.parametrize("shape", [(32, 64), (2, 4), (3, 5)])
def test_the_error_is_the_predicted_one(mi: object, shape: tuple[int, int]) -> None:
    """Over uniform normals the squared NRMSE is the light-aware prediction, its own mean being over 2000 of them."""
    light = rough(*shape)
    fine = latlong.grid(64, 128).reshape(-1, 3)
    power = light(fine) * np.broadcast_to(latlong.solid_angles(64, 128), (64, 128)).reshape(-1, 1)
    i = np.arange(2000) + 0.5
    normal = from_angles(np.arccos(1 - i / 1000), np.pi * (1 + 5**0.5) * i)
    truth = np.maximum(normal @ fine.T, 0) @ power / np.pi * METHOD.prepare(GREY, SPHERE)
    error = np.sum((rendered(light, GREY, normal) - truth) ** 2) / np.sum(truth**2)
    predicted = METHOD.predictions(METHOD.prepare(GREY, SPHERE), light)
    assert error == pytest.approx(list(predicted.values())[1], rel=0.1)  # 64 rows sample the kink at the horizon
    assert predicted["captured BRDF energy"] == pytest.approx(1 - 0.992197, abs=1e-5)  # (1/4 + 4/12 + 5/64) / (2/3)


@pytest.mark.parametrize("seed", range(3))
def test_laws(mi: object, seed: int) -> None:
    assert laws.check(METHOD, GREY, seed) == []


def test_hard_light(mi: object) -> None:
    """One pixel of 1e8 beside a pole, and constant light on the smallest maps."""
    spot = np.zeros((16, 32, 3), np.float32)
    spot[0, 31] = 1e8
    normal = np.concatenate([uniform(50, np.random.default_rng(3)), [[0.0, 0, 1], [0, 0, -1]]])
    assert np.isfinite(rendered(Environment("spot", spot), GREY, normal)).all()
    for shape in ((2, 4), (3, 5)):
        constant = Environment("constant", np.ones((*shape, 3), np.float32))
        expected = np.broadcast_to(METHOD.prepare(GREY, SPHERE), (len(normal), 3))
        np.testing.assert_allclose(rendered(constant, GREY, normal), expected, rtol=1e-4)


def test_other_lobes_are_refused() -> None:
    with pytest.raises(BadInput, match="Lambertian lobes only"):
        METHOD.prepare(Material("m", (Lambertian(), Phong())), SPHERE)
