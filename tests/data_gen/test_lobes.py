"""Lobes: integrals in closed form, density against samples, single precision against double, the cone's content."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.lobes import Lambertian, Microfacet, Phong
from data_gen.materials import MATERIALS, build
from envbench.directions import from_angles, reflect
from envbench.errors import BadInput
from envbench.material import Centre, Lobe

LOBES = [Lambertian(), Phong(exponent=1), Phong(exponent=64), Microfacet(sigma=0.05), Microfacet(sigma=0.5)]
VIEWS = [0.0, 0.7, 1.3, 1.55]


def frame_of(lobe: Lobe, view_angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """View, centre and normal, component-first, for N = z."""
    view, normal = from_angles(view_angle, 0.3), np.array([0.0, 0.0, 1.0])
    centre = normal if lobe.centre is Centre.NORMAL else reflect(view, normal)
    return view, centre, normal


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


@pytest.mark.parametrize("lobe", [*LOBES, Phong(exponent=1e5), Microfacet(sigma=0.01)], ids=repr)
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


@pytest.mark.parametrize("name", MATERIALS)
def test_presets_build(name: str) -> None:
    assert build(MATERIALS[name], name).name == name


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ({"kind": "fong"}, "did you mean 'phong'"),
        ({"kind": "phong", "exponnt": 3}, "did you mean 'exponent'"),
        ({"kind": "phong", "exponent": -1}, "exponent must lie in"),
        ({"kind": "phong", "exponent": float("nan")}, "Got nan"),
        ({"kind": "phong", "exponent": "3"}, "must be a number"),
        ({"kind": "microfacet", "sigma": 0}, "sigma must lie in"),
        ({"kind": "phong", "clipped": 1}, "must be true or false"),
        ({"kind": "phong", "reflectance": [1, 2]}, "3 numbers"),
        ({"kind": "phong", "reflectance": [1, 2, -1]}, "three finite numbers >= 0"),
        ({"lobes": []}, "no lobe"),
        ({"lobes": [{"kind": "phong"}], "clipped": True}, "beside 'lobes'"),
        ({"lobes": "phong"}, "list of tables"),
    ],
)
def test_bad_materials_say_so_in_one_line(spec: dict, words: str) -> None:
    with pytest.raises(BadInput, match=words) as error:
        build(spec, "mine")
    assert "\n" not in str(error.value)
