"""Lobes: integrals in closed form, density against samples, single precision against double, the cone's content."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import integrate

from data_gen.lobes import (
    GGX,
    CookTorrance,
    KajiyaKay,
    KajiyaKayDiffuse,
    Lafortune,
    Lambertian,
    Membrane,
    Microfacet,
    Phong,
)
from data_gen.materials import MATERIALS, build
from envbench.directions import from_angles, normalised, perpendicular, reflect, uniform
from envbench.errors import BadInput
from envbench.furnace import lobe_integrals
from envbench.geometry import Points
from envbench.material import Centre, Lobe, Material
from methods.shrm.coefficients import expand

SKIN = build(MATERIALS["lafortune-skin"]).lobes[0]
FACETS = [GGX(roughness=0.4), GGX(roughness=1.0), CookTorrance(roughness=0.3, f0=(0.9, 0.5, 0.1))]
FIBRES = [KajiyaKay(exponent=32), KajiyaKay(exponent=1), KajiyaKayDiffuse()]
MEMBRANES = [Membrane(transparency=0.3), Membrane(transparency=1.0)]
LOBES = [
    Lambertian(),
    Phong(exponent=1),
    Phong(exponent=64),
    Microfacet(sigma=0.05),
    Microfacet(sigma=0.5),
    SKIN,
    *FACETS,
    *FIBRES,
    *MEMBRANES,
]
VIEWS = [0.0, 0.7, 1.3, 1.55]


def frame_of(lobe: Lobe, view_angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """View, centre and normal, component-first, for N = z."""
    view, normal = from_angles(view_angle, 0.3), np.array([0.0, 0.0, 1.0])
    centres = {Centre.NORMAL: normal, Centre.REFLECTION: reflect(view, normal), Centre.TANGENT: np.eye(3)[0]}
    return view, centres[lobe.centre], normal


def sphere_rule(axis: np.ndarray, n: int = 600, m: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre in theta (squeezed towards the axis: theta = pi t^3) times the trapezoid in phi."""
    t, w = np.polynomial.legendre.leggauss(n)
    t, w = (t + 1) / 2, w / 2
    theta = np.pi * t**3
    weight = w * 3 * np.pi * t**2 * np.sin(theta) * (2 * np.pi / m)
    local = from_angles(theta[:, None], 2 * np.pi * (np.arange(m) + 0.5) / m)
    z = axis
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    directions = local @ np.stack([x, np.cross(z, x), z])
    return np.moveaxis(directions, -1, 0), np.broadcast_to(weight[:, None], directions.shape[:2])


@pytest.mark.parametrize("lobe", [*LOBES[:3], Phong(exponent=1e5)], ids=repr)
def test_integral_of_a_whole_lobe(lobe: Lobe) -> None:
    # furnace: Lambertian and Phong integrate to 1; the microfacet lobe has no such closed form (see below)
    view, centre, normal = frame_of(lobe, 0.7)
    light, weight = sphere_rule(centre)
    value = lobe.profile(light, view[:, None, None], centre[:, None, None], normal[:, None, None])[0]
    assert np.sum(value * weight) == pytest.approx(1, abs=1e-4)  # the kink at the equator costs O(theta' / n^2)


def test_a_membrane_lets_light_through_and_without_transparency_is_lambertian() -> None:
    view, centre, normal = frame_of(Membrane(), 0.7)
    light = uniform(200, np.random.default_rng(8)).T
    axes = [v[:, None] for v in (view, centre, normal)]
    forth, back = (Membrane(transparency=0.4).evaluate(side, *axes)[0] for side in (light, -light))
    assert back[light[2] > 0] == pytest.approx(0.4 * forth[light[2] > 0])
    assert Membrane(transparency=0.0).evaluate(light, *axes)[0] == pytest.approx(Lambertian().evaluate(light, *axes)[0])
    total = lobe_integrals(Material("test", (Membrane(transparency=0.4),)), seen_along_the_normal())
    assert total == pytest.approx(1.4, rel=1e-6)


@pytest.mark.parametrize("settings", [{"transparency": 1.01}, {"transparency": -0.1}, {"clipped": True}])
def test_a_membrane_refuses(settings: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match=r"transparency|horizon"):
        Membrane(**settings)


def test_microfacet_small_sigma_integrates_to_the_cosine() -> None:
    # dL = 4 (H.V) dH and H -> N: the integral tends to 4 cos(theta_v) pi sigma^2 / (4 pi sigma^2) = cos(theta_v)
    lobe = Microfacet(sigma=0.01)
    view, centre, normal = frame_of(lobe, 0.7)
    light, weight = sphere_rule(centre, 1500)
    value = lobe.profile(light, view[:, None, None], centre[:, None, None], normal[:, None, None])[0]
    assert np.sum(value * weight) == pytest.approx(np.cos(0.7), rel=2 * 0.01**2)


@pytest.mark.parametrize("angle", VIEWS)
@pytest.mark.parametrize("lobe", LOBES, ids=repr)
def test_samples_follow_the_density(lobe: Lobe, angle: float) -> None:
    """Moments of the samples against the density's, within five standard errors."""
    view, centre, normal = frame_of(lobe, angle)
    rng = np.random.default_rng(1)
    n = 200_000
    axes = tuple(np.broadcast_to(v[:, None], (3, n)) for v in (view, centre, normal))
    drawn = np.stack(lobe.sample((rng.random(n), rng.random(n)), *axes))
    alive = np.linalg.norm(drawn, axis=0) > 0.5
    assert np.allclose(np.linalg.norm(drawn[:, alive], axis=0), 1, atol=1e-9)
    # at grazing the density, p(H) / (4 H.V), has an integrable pole at L = -V: the rule is refined there
    light, weight = sphere_rule(-view if angle > 1.5 else centre)
    density = lobe.density(light, *(v[:, None, None] for v in (view, centre, normal)))
    total = np.sum(density * weight)
    assert total == pytest.approx(alive.mean(), abs=5 * np.sqrt(0.25 / n))
    for k in range(3):
        exact = np.sum(density * weight * light[k])
        values = np.where(alive, drawn[k], 0.0)
        assert abs(values.mean() - exact) < 5 * values.std() / np.sqrt(n)


@pytest.mark.parametrize("eps", [0.1, 0.01])
@pytest.mark.parametrize("angle", VIEWS)
@pytest.mark.parametrize("lobe", LOBES, ids=repr)
def test_cone_holds_what_it_says(lobe: Lobe, angle: float, eps: float) -> None:
    view, centre, normal = frame_of(lobe, angle)
    light, weight = sphere_rule(centre)
    value = lobe.profile(light, *(v[:, None, None] for v in (view, centre, normal)))[0] * weight
    inside = np.einsum("kij,k->ij", light, centre) >= np.cos(lobe.cone(eps))
    assert np.sum(value * inside) >= (1 - eps) * np.sum(value) * (1 - 5e-3)  # one ring of the rule


@pytest.mark.parametrize(
    "lobe", [*LOBES, Phong(exponent=1e5), Microfacet(sigma=0.01), GGX(roughness=0.1), KajiyaKay(exponent=1e4)], ids=repr
)
def test_single_precision_in_drjit_agrees(lobe: Lobe, mi: object) -> None:
    """Dr.Jit float32 against NumPy float64, relative to the peak: sqrt(s) eps32 for the directions' own rounding."""
    from mitsuba import Float, Vector3f

    view, centre, normal = frame_of(lobe, 0.7)
    light, _ = sphere_rule(centre, 60, 32)
    light = light.reshape(3, -1).astype(np.float32)
    axes = [v.astype(np.float32) for v in (view, centre, normal)]
    exact = lobe.evaluate(light.astype(float), *(v.astype(float)[:, None] for v in axes))[0]
    got = np.array(lobe.evaluate(Vector3f(light), *(Vector3f(*map(Float, v)) for v in axes))[0])
    assert np.abs(got - exact).max() <= 2e-4 * exact.max()


def test_clipping_zeroes_only_below_the_horizon() -> None:
    view, centre, normal = frame_of(Phong(), 1.3)
    light, _ = sphere_rule(normal, 50, 32)
    axes = [v[:, None, None] for v in (view, centre, normal)]
    whole, clipped = Phong(clipped=False).evaluate(light, *axes)[0], Phong().evaluate(light, *axes)[0]
    assert np.array_equal(clipped, np.where(light[2] > 0, whole, 0))


@pytest.mark.parametrize("lobe", LOBES, ids=repr)
def test_weights_are_bounded(lobe: Lobe) -> None:
    """Value over density of a draw: at most 1 / captured for microfacets, 2 for Cook-Torrance, 4 / pi for fibres."""
    for angle in VIEWS:
        frame = frame_of(lobe, angle)
        u = np.random.default_rng(2).random((2, 20_000))
        axes = tuple(np.broadcast_to(v[:, None], (3, u.shape[1])) for v in frame)
        light = np.stack(lobe.sample((u[0], u[1]), *axes))
        density = lobe.density(light, *axes)
        alive = (np.linalg.norm(light, axis=0) > 0.5) & (density > 0)
        value = np.stack(lobe.profile(light, *axes))[:, alive]
        assert (value / density[alive]).max() < 2.01


@pytest.mark.parametrize("lobe", LOBES, ids=repr)
def test_finite_for_every_view(lobe: Lobe) -> None:
    """Views at grazing, along N, below the horizon; lights there too; nothing but finite numbers >= 0."""
    rng = np.random.default_rng(5)
    for angle in (0.0, np.pi / 2 - 1e-4 * np.pi / 180, np.pi / 2, 1.8, np.pi):
        frame = frame_of(lobe, angle)
        axes = tuple(np.broadcast_to(v[:, None], (3, 512)) for v in frame)
        drawn = np.stack(lobe.sample((rng.random(512), rng.random(512)), *axes))
        light = np.concatenate([uniform(508, rng), np.eye(3)[2:], -np.eye(3)[2:], [frame[0], frame[1]]]).T
        for direction in (drawn, light):
            for values in (*lobe.profile(direction, *axes), lobe.density(direction, *axes)):
                assert np.isfinite(values).all()
                assert np.min(values) >= 0


@pytest.mark.parametrize("lobe", [SKIN, *FACETS], ids=repr)
def test_reciprocal(lobe: Lobe) -> None:
    """rho_hat / N.L stays when L and V change places."""
    rng = np.random.default_rng(3)
    light, view = (np.where(d[:, 2:] < 0, -d, d).T for d in (uniform(500, rng), uniform(500, rng)))
    normal = np.broadcast_to(np.array([0.0, 0, 1])[:, None], light.shape)
    forth = np.stack(lobe.evaluate(light, view, reflect(view.T, normal.T).T, normal)) / light[2]
    back = np.stack(lobe.evaluate(view, light, reflect(light.T, normal.T).T, normal)) / view[2]
    assert forth == pytest.approx(back, rel=1e-9)


def test_a_fibre_is_symmetric_in_light_and_view_and_bright_on_the_mirror_cone() -> None:
    tangent = np.array([1.0, 0.0, 0.0])[:, None]
    light, view = uniform(200, np.random.default_rng(4)).T, uniform(200, np.random.default_rng(5)).T
    lobe = KajiyaKay(exponent=20)
    assert lobe.profile(light, view, tangent, tangent)[0] == pytest.approx(
        lobe.profile(view, light, tangent, tangent)[0]
    )
    mirrored = np.stack([-view[0], view[2], -view[1]])  # turned about T, and to the other side of it
    assert lobe.profile(mirrored, view, tangent, tangent)[0] == pytest.approx(lobe._peak)


@pytest.mark.parametrize("angle", [0.3, 1.0, np.pi / 2])
def test_kajiya_kay_integrates_to_a_single_integral(angle: float) -> None:
    """2 pi int max(cos(theta_i + theta_o - pi), 0)^s sin(theta_i) / A, which for a view perpendicular to T is 1."""
    view = from_angles(np.pi / 2, angle)[None]  # in the plane of T = x
    points = Points(*(np.array([[0.0, 0, 1]]) for _ in range(3)), np.array([[1.0, 0, 0]]), view, np.ones(1))
    lobe = KajiyaKay(exponent=12)

    def slice_(theta: float) -> float:
        return 2 * np.pi * max(np.cos(theta + angle - np.pi), 0) ** 12 * np.sin(theta) * lobe._peak

    exact = integrate.quad(slice_, 0, np.pi, epsabs=1e-12)[0]
    assert lobe_integrals(Material("test", (lobe,)), points)[0] == pytest.approx(np.full(3, exact), rel=1e-6)
    if angle == np.pi / 2:
        assert exact == pytest.approx(1, rel=1e-9)


def seen_along_the_normal() -> Points:
    z = np.array([[0.0, 0.0, 1.0]])
    return Points(z, z, z, perpendicular(z), z, np.ones(1))


def test_ggx_of_alpha_one_seen_along_the_normal() -> None:
    """D = 1 / pi and G = 2 c / (1 + c), c = N.L: the integral of c / (1 + c) over [0, 1] is 1 - log 2."""
    material = Material("test", (GGX(roughness=1.0, f0=(1.0, 1.0, 1.0)),))
    assert lobe_integrals(material, seen_along_the_normal()) == pytest.approx(1 - np.log(2), rel=1e-6)


def test_cook_torrance_seen_along_the_normal() -> None:
    """G = min(1, 2 N.L) there; with t = tan^2(theta_h), N.L = (1 - t) / (1 + t), D N.H dH = exp(-t / m^2) dt / m^2."""
    m = 0.6

    def slice_(t: float) -> float:
        return np.exp(-t / m**2) / m**2 * min(1.0, 2 * (1 - t) / (1 + t))

    exact = integrate.quad(slice_, 0, 1, points=[1 / 3], epsabs=1e-12)[0]
    material = Material("test", (CookTorrance(roughness=m),))
    assert lobe_integrals(material, seen_along_the_normal()) == pytest.approx(exact, rel=1e-6)


def test_lafortune_holds_phong_and_lambert() -> None:
    """c_xy = -1, c_z = 1 is (R.L)^n N.L; no term is Lambertian."""
    lobe = Lafortune(diffuse=(0.3, 0.2, 0.1), c_xy=((-1.0,) * 3,), c_z=((1.0,) * 3,), n=((9.0,) * 3,))
    view, centre, normal = frame_of(lobe, 0.9)
    light = uniform(500, np.random.default_rng(6)).T
    axes = [v[:, None] for v in (view, centre, normal)]
    cosine = np.maximum(light[2], 0)
    phong = Phong(exponent=9).evaluate(light, *axes)[0] * 2 * np.pi / 10
    for value, diffuse in zip(lobe.evaluate(light, *axes), lobe.diffuse, strict=True):
        assert value == pytest.approx((diffuse / np.pi + phong) * cosine, rel=1e-9, abs=1e-12)


def test_split_lafortune_is_the_same_brdf() -> None:
    rng = np.random.default_rng(7)
    view = normalised(uniform(20, rng) + np.array([0, 0, 1.2]))
    normal = np.broadcast_to([0.0, 0.0, 1.0], view.shape)
    points = Points(normal, normal, normal, perpendicular(normal), view, np.full(20, 0.05))
    whole, split = (build(MATERIALS[name]) for name in ("lafortune-skin", "lafortune-skin-split"))
    assert lobe_integrals(split, points) == pytest.approx(lobe_integrals(whole, points), rel=2e-6)


@pytest.mark.parametrize(
    ("lobe", "view_order", "missing"), [(SKIN, 4, 0.0287), (KajiyaKay(exponent=32), 8, 0.0267)], ids=["skin", "fibre"]
)
def test_energy_left_out_is_that_of_the_paper(lobe: Lobe, view_order: int, missing: float) -> None:
    """RH 2002, sec. 7.1: below .03 at P = 4 and P = 8; the digits are those of an independent computation."""
    assert expand(lobe, 0.03, order=30, view_order=view_order).missing == pytest.approx(missing, abs=5e-5)
