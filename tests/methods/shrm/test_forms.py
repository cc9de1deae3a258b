"""Global SHRM and pure coefficients: the same function as the local maps, each read its own way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special

from data_gen import environments, views
from data_gen.lobes import KajiyaKay, Lambertian, Microfacet, Phong
from envbench.directions import from_angles, to_angles, to_local, uniform
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Viewer
from envbench.material import Lobe, Material
from envbench.real_harmonics import basis
from envbench.scene import Scene
from methods.shrm import SHRM, SHRMCoefficients, SHRMGlobal, maps, rotation
from methods.shrm.coefficients import expand
from methods.shrm.lookup import loss

SPHERE = Geometry("sphere")
LIGHT = environments.build({"kind": "captured", "name": "studio"})
LOBES: list[tuple[Lobe, ...]] = [
    (Lambertian(),),
    (Microfacet(sigma=0.3),),
    (KajiyaKay(exponent=32),),
    (Lambertian(reflectance=(0.4, 0.1, 0.1)), Phong(exponent=64), Phong(exponent=8, clipped=False)),
]


def rendered(
    method: SHRM | SHRMGlobal | SHRMCoefficients, lobes: tuple[Lobe, ...], viewer: Viewer | None, points: Points
):
    prepared = method.prepare(Material("m", lobes), SPHERE)
    return np.asarray(method.shade(method.frame(method.relight(prepared, LIGHT), viewer), points), float)


def seen_by_one(count: int = 400) -> tuple[Points, Viewer | None]:
    return views.build({"kind": "uniform", "count": count, "direction": [0.3, -0.5, 0.6]}, SPHERE)


def nrmse(got: np.ndarray, exact: np.ndarray) -> float:
    return float(np.sqrt(np.mean((got - exact) ** 2) / np.mean(exact**2)))


@pytest.mark.parametrize("lobe", [Microfacet(), KajiyaKay()], ids=repr)
def test_global_coefficients_mean_the_same_function(lobe: Lobe) -> None:
    """Equation 8: random planes at random centres, seen from random views, in either frame."""
    rng = np.random.default_rng(1)
    coefficients = expand(lobe, 0.01, order=6, view_order=5)
    where = np.stack(to_angles(uniform(30, rng)), -1)
    planes = rng.normal(size=(3, maps.planes(5, 6, coefficients.Q), 30))
    found, view = rotation.to_global(coefficients, planes, where), uniform(30, rng)
    local = to_local(view, from_angles(where[:, 0], where[:, 1]))
    expected = np.einsum("ckn,kn->nc", planes, maps.basis(coefficients, local))
    assert np.allclose(np.einsum("knc,kn->nc", found, basis(5, view)), expected, atol=1e-12)


@pytest.mark.parametrize("storage", ["cube", "latlong"])
@pytest.mark.parametrize("lobes", LOBES, ids=lambda lobes: "+".join(type(lobe).__name__ for lobe in lobes))
def test_all_forms_agree(lobes: tuple[Lobe, ...], storage: str) -> None:
    """Lookup errs by (3/128) (pi/4)^4 = 9e-3 of the highest degrees, which hold a few % of the energy: 2e-3."""
    points, viewer = seen_by_one()
    exact = rendered(SHRMCoefficients(eps=0.03), lobes, viewer, points)
    assert nrmse(rendered(SHRM(eps=0.03), lobes, viewer, points), exact) < 2e-3
    assert nrmse(rendered(SHRMGlobal(eps=0.03, storage=storage), lobes, viewer, points), exact) < 2e-3
    # four times as many samples an axis: 4^4 times nearer, down to single precision
    fine = SHRMGlobal(eps=0.03, storage=storage, size=256, precision="float64")
    assert nrmse(rendered(fine, lobes, viewer, points), exact) < 1e-4


def test_lookup_is_seamless_over_faces_and_poles() -> None:
    """R 1e-7 on either side of a cube edge, of a corner, and about a pole: the same to what lookup errs."""
    a = np.array(
        [[1, 1 - 1e-7, 0.3], [1 - 1e-7, 1, 0.3], [1, 1, 1 - 1e-7], [1 - 1e-7, 1, 1], [1e-7, 0, 1], [0, 1e-7, 1]]
    )
    R = a / np.linalg.norm(a, axis=1, keepdims=True)
    points, viewer = seen_by_one(len(R))
    view = points.view[0]
    normal = (R + view) / np.linalg.norm(R + view, axis=1, keepdims=True)
    points = replace(points, normal=normal)
    for storage in ("cube", "latlong"):
        got = rendered(SHRMGlobal(eps=0.03, storage=storage), (Microfacet(sigma=0.3),), viewer, points)
        assert np.abs(got[::2] - got[1::2]).max() < 2e-3 * np.abs(got).max()


def test_lambertian_is_the_nine_term_quadratic_form() -> None:
    """Against the sum of SciPy's harmonics with the same coefficients."""
    method, normal = SHRMCoefficients(), uniform(50, np.random.default_rng(2))
    points = Points(normal, normal, normal, normal, normal, np.full(50, 1 / 50))
    relit = method.relight(method.prepare(Material("m", (Lambertian(),)), SPHERE), LIGHT)
    assert relit[0].matrices.shape == (3, 4, 4)
    assert np.allclose(relit[0].matrices, relit[0].matrices.transpose(0, 2, 1))
    lobe = expand(Lambertian(), 0.01, order=2)
    alm = maps.products(
        lobe, method.prepare(Material("m", (Lambertian(),)), SPHERE).light(LIGHT.radiance.astype(float))[0]
    )
    theta, phi = to_angles(normal)
    exact = np.zeros((50, 3))
    for k, (l, m) in enumerate([(0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2)]):
        Y = special.sph_harm_y(l, m, theta, phi)
        exact += (1 if m == 0 else 2) * (alm[:, 0, k] * Y[:, None]).real
    assert np.allclose(method.shade(relit, points), exact, rtol=0, atol=1e-12 * np.abs(exact).max())


def test_an_eye_sees_along_its_axis() -> None:
    points, viewer = seen_by_one()
    assert viewer is not None
    x, y, z = viewer.direction or (0, 0, 1)
    eye = Viewer(eye=(5 * x, 5 * y, 5 * z), axis=(-x, -y, -z))
    lobes = (Microfacet(),)
    assert np.array_equal(rendered(SHRMGlobal(), lobes, eye, points), rendered(SHRMGlobal(), lobes, viewer, points))


def test_what_is_declined() -> None:
    points, _ = views.build({"kind": "uniform", "count": 8}, SPHERE)
    glossy = Scene("s", LIGHT, Material("m", (Microfacet(),)), SPHERE, points)
    assert "view of its own" in (SHRMGlobal().declines(glossy) or "")
    assert SHRMGlobal().declines(replace(glossy, material=Material("m", (Lambertian(),)))) is None
    narrow = replace(glossy, material=Material("m", (Phong(exponent=1e5, clipped=False),)))
    assert "store a map" in (SHRMCoefficients().declines(narrow) or "")


@pytest.mark.parametrize(
    ("settings", "words"), [({"storage": "sphere"}, "'cube' or 'latlong'"), ({"size": 3}, "size must be 0")]
)
def test_settings_out_of_range(settings: dict, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        SHRMGlobal(**settings)


def test_loss_of_lookup_is_lagranges_bound_at_most() -> None:
    """Twice (for two axes) the square of (3/128) k^4, k radians a sample; and it falls by 2^8 when k is halved."""
    found = loss(np.array([10.0, 20.0]), np.pi / 160)
    assert np.all(found <= 2 * (3 / 128 * (np.array([10, 20]) * np.pi / 160) ** 4) ** 2)
    assert found[1] / found[0] == pytest.approx(2**8, rel=0.1)


@pytest.mark.parametrize("form", [SHRM, SHRMGlobal, SHRMCoefficients])
def test_the_orders_of_each_lobe_are_told_and_what_symmetry_spared(form: type) -> None:
    lobes = (Lambertian(), Phong(exponent=8, clipped=False), KajiyaKay(exponent=32), Microfacet(sigma=0.3))
    method = form(eps=0.1)
    state = method.prepare(Material("m", lobes), SPHERE)
    told, parts = method.describe(state), method.expansion(state).parts
    orders = [f"F = {c.F}, P = {c.P}, q <= {c.Q}" for c in parts]
    assert told["lobes"] == [
        f"about N: {orders[0]}, radially symmetric",
        f"about R: {orders[1]}, radially symmetric",
        f"about T: {orders[2]}, no dependence on azimuth",
        f"about R: {orders[3]}",
    ]
    assert [(c.P, c.Q) for c in parts[:2]] == [(0, 0), (0, 0)]
    assert parts[2].P > 0 == parts[2].Q
    assert parts[3].Q > 0
    assert len(told["q"]) == len(told["F"])
