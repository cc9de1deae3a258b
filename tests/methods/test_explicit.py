"""Explicit tables filled from SHRM: they tend to the SHRM as they grow, at the rate of bilinear lookup."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from data_gen import environments, views
from data_gen.lobes import CookTorrance, KajiyaKay, Lambertian, Microfacet, Phong
from envbench import harmonics, laws
from envbench.directions import Array, from_angles, reflect
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points
from envbench.material import Centre, Lobe, Material
from envbench.method import footprint
from envbench.scene import Scene
from methods.explicit import Explicit
from methods.shrm import maps
from methods.shrm.coefficients import expand

SPHERE = Geometry("sphere")


def queries(count: int) -> Points:
    return views.build({"kind": "uniform", "count": count, "seed": 0}, SPHERE)[0]


def rendered(method: Explicit, lobe: Lobe, light: Environment, points: Points) -> Array:
    relit = method.relight(method.prepare(Material("m", (lobe,)), SPHERE), light)
    return np.asarray(method.shade(method.frame(relit, None), points), float)


def shrm(lobe: Lobe, eps: float, light: Environment, points: Points) -> Array:
    """The SHRM that the table was made from, finely stored."""
    coefficients = expand(lobe, eps)
    spectrum = harmonics.analyse(light.radiance.astype(np.float64), coefficients.F)
    planes = maps.synthesise(coefficients, spectrum, 16 * coefficients.F)
    return np.asarray(maps.read(coefficients, planes, points.central(lobe.centre), points.view), float)


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.3), KajiyaKay(), Phong(exponent=32, clipped=False)], ids=repr)
def test_a_finer_table_comes_nearer_to_the_shrm(lobe: Lobe, mi: object) -> None:
    """(pi / samples)^2 / 8 of the highest frequency in four angles, of which this light holds little: half of it."""
    light, points = environments.build({"kind": "captured", "name": "studio"}), queries(1024)
    truth = shrm(lobe, 0.03, light, points)
    errors = [
        float(np.sqrt(np.mean((rendered(Explicit(eps=0.03, samples=s), lobe, light, points) - truth) ** 2)))
        for s in (4, 8)
    ]
    scale = float(np.sqrt(np.mean(truth**2)))
    for error, samples in zip(errors, (4, 8), strict=True):
        assert error < 4 * (np.pi / samples) ** 2 / 8 / 2 * scale
    assert errors[1] < errors[0] / 2  # a fourth, for smooth functions


def test_sizes_follow_the_orders() -> None:
    method = Explicit(eps=0.03)
    (prepared,) = method.prepare(Material("m", (Microfacet(),)), SPHERE)
    assert (prepared.rows, prepared.directions) == (10 * prepared.coefficients.F, 10 * prepared.coefficients.P)
    (flat,) = method.prepare(Material("m", (Lambertian(),)), SPHERE)
    assert flat.directions == 1
    (given,) = Explicit(rows=20, directions=6).prepare(Material("m", (Microfacet(),)), SPHERE)
    assert (given.rows, given.directions) == (20, 6)
    relit = Explicit(rows=20, directions=6).relight(
        (given,), environments.build({"kind": "captured", "name": "studio"})
    )
    assert footprint(relit) == given.bytes == 3 * 4 * 20 * 40 * 36


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "lobe", [Lambertian(), Phong(exponent=32), Microfacet(), CookTorrance(roughness=0.5), KajiyaKay()], ids=repr
)
def test_it_keeps_the_laws(lobe: Lobe, seed: int, mi: object) -> None:
    assert laws.check(Explicit(eps=0.1, samples=4), Material("m", (lobe,)), seed) == []


def test_several_lobes_are_added(mi: object) -> None:
    light, points, method = environments.build({"kind": "captured", "name": "studio"}), queries(64), Explicit(eps=0.1)
    lobes = (Lambertian(reflectance=(0.5, 0.1, 0)), Microfacet(sigma=0.4))
    relit = method.relight(method.prepare(Material("m", lobes), SPHERE), light)
    both = method.shade(pickle.loads(pickle.dumps(relit)), points)
    np.testing.assert_allclose(both, sum(rendered(method, lobe, light, points) for lobe in lobes), rtol=1e-5)


@pytest.mark.parametrize("shape", [(2, 4), (3, 5)])
def test_hard_cases_stay_finite(shape: tuple[int, int], mi: object) -> None:
    radiance = np.zeros((*shape, 3), np.float32)
    radiance[0, -1] = 1e8
    view = from_angles(np.pi / 2 - np.radians(0.01) * np.arange(4), 0.3)
    normal = np.tile([[0.0, 0, 1]], (4, 1))
    points = Points(normal, normal, normal, reflect(normal, view), view, np.full(4, 0.25))
    assert np.isfinite(rendered(Explicit(eps=0.1), Microfacet(), Environment("hard", radiance), points)).all()


class AboutTheTangent(Phong):
    centre = Centre.TANGENT


def test_a_clipped_lobe_about_the_tangent_is_declined() -> None:
    light = Environment("black", np.zeros((4, 8, 3), np.float32))
    for lobe, declined in ((AboutTheTangent(), True), (AboutTheTangent(clipped=False), False)):
        reason = Explicit().declines(Scene("s", light, Material("m", (lobe,)), SPHERE, queries(4)))
        assert (reason is not None) == declined


def test_tables_that_would_fill_the_memory_are_refused() -> None:
    with pytest.raises(BadInput, match=r"would take \d+\.\d GiB; raise eps"):
        Explicit(rows=256, directions=64).prepare(Material("m", (Microfacet(),)), SPHERE)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"eps": 1.0}, "eps must lie in"),
        ({"rows": 1}, "rows must be 0"),
        ({"directions": 5}, "even and lie in"),
        ({"samples": float("nan")}, "samples must lie in"),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        Explicit(**settings)


def test_what_was_chosen_is_described() -> None:
    described = Explicit().describe(Explicit(eps=0.1).prepare(Material("m", (Microfacet(),)), SPHERE))
    assert set(described) == {"F", "P", "S", "T", "MiB"}
    assert len(Explicit.sweep()) >= 4
