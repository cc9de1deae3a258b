"""Mitsuba's reference: unbiased, with an honest floor, and the same as Mitsuba's own `direct` integrator."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy import stats

from data_gen.environments import LIGHTS, build
from data_gen.geometry import mitsuba_mesh
from data_gen.lobes import Lambertian, Microfacet, Phong
from data_gen.mitsuba_bsdf import bsdf
from data_gen.mitsuba_light import emitter
from envbench.directions import normalised, perpendicular, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, TriangleMesh
from envbench.material import Lobe, Material
from envbench.reference import Reference, ReferenceSettings
from envbench.scene import FREE, Effect, Scene
from references.estimators import estimator_for
from references.mitsuba_direct import _Sampling, _Step, render
from references.quadrature import integrate

MakeScene = Callable[..., Scene]
K = 8


def replicates(scene: Scene, samples: int, variant: str = "llvm_ad_rgb") -> np.ndarray:
    estimator = estimator_for(scene, ReferenceSettings(variant=variant))
    return np.stack([estimator.replicate(scene.points, samples, seed) for seed in np.random.SeedSequence(5).spawn(K)])


@pytest.mark.parametrize("lobe", [Microfacet(sigma=0.2), Phong(exponent=30, clipped=False)])
def test_spread_predicts_the_error(mi: ModuleType, make_scene: MakeScene, lit: Environment, lobe: Any) -> None:
    """Error^2 of the mean over spread^2 is F-distributed with (n, (K - 1) n) degrees of freedom over n equal points.

    Points differ, so n is the number of equal ones that would vary as much, (sum v)^2 / sum v^2 of their variances v;
    the channels of a point count as one. Were the shifts of neighbouring points alike, the ratio would be off.
    """
    scene = make_scene(lit, lobe, count=120)
    estimates = replicates(scene, 256)
    residual = estimates - integrate(scene)
    error = (residual.mean(0) ** 2).sum(-1)
    variance = (estimates.var(0, ddof=1) / K).sum(-1)
    equal = variance.sum() ** 2 / (variance**2).sum()
    low, high = stats.f.ppf([0.0005, 0.9995], equal, (K - 1) * equal)
    assert low < error.sum() / variance.sum() < high
    # replicates share nothing: the mean over pairs of their correlations is normal about 0
    scaled = residual / np.sqrt((residual**2).sum((1, 2), keepdims=True))
    correlation = np.einsum("kic,jic->kj", scaled, scaled)[np.triu_indices(K, 1)]
    assert abs(correlation.mean()) < stats.norm.ppf(0.9995) / np.sqrt(equal * len(correlation)) * 1.5


@pytest.mark.parametrize("clipped", [True, False])
def test_unbiased(mi: ModuleType, make_scene: MakeScene, lit: Environment, clipped: bool) -> None:
    """The mean over all points lies within its own 99.9 % interval about the quadrature's, few samples or not."""
    lobes = (Lambertian(reflectance=(0.2, 0.3, 0.4)), Phong(exponent=50, clipped=clipped))
    scene = make_scene(lit, *lobes, count=40)
    means = replicates(scene, 64).mean((1, 2))
    margin = stats.t.ppf(0.9995, K - 1) * means.std(ddof=1) / np.sqrt(K)
    assert means.mean() == pytest.approx(integrate(scene).mean(), abs=margin)


@pytest.mark.parametrize("builtin", [True, False], ids=["Mitsuba's diffuse", "our clipped Phong"])
def test_agrees_with_direct_on_a_sphere(mi: ModuleType, lit: Environment, builtin: bool) -> None:
    """Rays towards a sphere through Mitsuba's `direct`, against our estimate at the points they hit."""
    rng = np.random.default_rng(2)
    normal, view = uniform(200, rng), uniform(200, rng)
    view *= np.sign(np.sum(normal * view, axis=-1, keepdims=True))
    lobe = Lambertian(reflectance=(0.5, 0.5, 0.5)) if builtin else Phong(exponent=20)
    material = Material("test", (lobe,))
    points = Points(normal, normal, normal, perpendicular(normal), view, np.full(200, 1 / 200))
    ours = replicates(Scene("test", lit, material, Geometry("sphere"), points), 256)
    theirs = direct(
        mi,
        {"type": "sphere", "bsdf": {"type": "diffuse"} if builtin else bsdf(material)},
        emitter(lit),
        normal + 3 * view,
        -view,
    )
    assert_same_mean(ours, theirs)


def direct(mi: ModuleType, shape: Any, light: Any, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return K estimates (K, n, 3) by Mitsuba's `direct` with 256 independent samples a ray."""
    import drjit as dr

    scene = mi.load_dict({"type": "scene", "shape": shape, "light": light})
    integrator = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 1})
    index = dr.arange(mi.UInt32, len(origins) * 256) // 256
    columns = [mi.Vector3f(np.ascontiguousarray(v.T, np.float32)) for v in (origins, directions)]
    o, d = (dr.gather(mi.Vector3f, column, index) for column in columns)
    estimates = []
    for seed in range(K):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, dr.width(index))
        radiance = integrator.sample(scene, sampler, mi.RayDifferential3f(o, d))[0]
        estimates.append(np.array(radiance).reshape(3, -1, 256).mean(-1).T)
    return np.stack(estimates).astype(float)


def assert_same_mean(a: np.ndarray, b: np.ndarray) -> None:
    """Means over all points differ by less than the 99.9 % interval of Welch's t; so do those of each half."""
    for half in (slice(None), slice(0, None, 2), slice(1, None, 2)):
        first, second = a[:, half].mean((1, 2)), b[:, half].mean((1, 2))
        assert stats.ttest_ind(first, second, equal_var=False).pvalue > 1e-3


@pytest.mark.parametrize(("lobes", "rays"), [((Lambertian(),), 1), ((Lambertian(), Phong(exponent=20)), 2)])
def test_shadows_are_those_of_direct(mi: ModuleType, lit: Environment, lobes: tuple[Lobe, ...], rays: int) -> None:
    """An L of two faces: the corner is half hidden; `rays` a sample are counted."""
    mesh = TriangleMesh(
        vertices=np.array([[0, -9, 0], [9, -9, 0], [9, 9, 0], [0, 9, 0], [0, -9, 0], [0, 9, 0], [0, 9, 9], [0, -9, 9]])
        * 1.0,
        triangles=np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32),
        normals=np.repeat([[0.0, 0, 1], [1, 0, 0]], 4, axis=0),
    )
    rng = np.random.default_rng(4)
    floor = np.stack([rng.uniform(0.5, 3, 100), rng.uniform(-3, 3, 100), np.zeros(100)], axis=-1)
    normal = np.broadcast_to([0.0, 0, 1], floor.shape)
    view = np.broadcast_to(normalised([1.0, 0.2, 1]), floor.shape)
    points = Points(floor, normal, normal, perpendicular(normal), view, np.full(100, 0.01))
    material = Material("test", lobes)
    geometry = Geometry("corner", mesh, convex=False)
    scene = Scene("test", lit, material, geometry, points, effects=FREE | {Effect.SELF_SHADOWING})
    ours = replicates(scene, 256)
    shape = mitsuba_mesh(mi, mesh)
    shape.set_bsdf(bsdf(material))
    assert_same_mean(ours, direct(mi, shape, emitter(lit), floor + 0.1 * view, -view))
    result = render(scene, ReferenceSettings(floor=0.1))
    assert result.visibility_rays >= rays * 64 * K * len(points)
    open_sky = replicates(replace(scene, effects=frozenset()), 256).mean()
    assert ours.mean() < 0.9 * open_sky


def test_convex_shapes_cast_no_visibility_ray(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    scene = replace(make_scene(lit, Phong()), effects=frozenset({Effect.SELF_SHADOWING}))
    assert render(scene, ReferenceSettings(floor=0.1)).visibility_rays == 0


def test_samples_grow_until_the_floor_is_reached(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    scene = make_scene(lit, Microfacet(sigma=0.2), count=40)
    coarse, fine = (render(scene, ReferenceSettings(floor=floor)) for floor in (0.5, 1e-3))
    assert coarse.samples < fine.samples
    assert fine.floor <= 1e-3
    assert not fine.notes
    again = render(scene, ReferenceSettings(floor=1e-3))
    assert np.array_equal(again.replicates, fine.replicates)
    assert not np.array_equal(render(scene, ReferenceSettings(floor=0.5, seed=1)).replicates, coarse.replicates)


def test_a_step_that_falls_short_is_topped_up(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    """By samples that count: joined by what each tells, both are less noisy than the first, and unbiased."""
    scene, settings = make_scene(lit, Lambertian(), Phong(exponent=20, clipped=False), count=300), ReferenceSettings()
    empty = Reference(np.zeros((K, 300, 3)), scene.points.weight, 0, 0.0, "", settings.floor)
    sampling = _Sampling(scene, settings, empty, estimator_for(scene, settings), 0.0)
    step = sampling.afresh(np.full(300, 64))
    order = 0.75
    more = sampling.topped_up(step, 0.5, order)
    twice = sampling.topped_up(more, 0.5, order)
    assert [s.result.samples for s in (step, more, twice)] == [64, 96, 128]
    assert twice.known == pytest.approx(1 + 2 * 0.5 ** (2 * order))
    assert 64 < more.worth(order).mean() < twice.worth(order).mean() < 128
    for topped in (more, twice):
        expected = step.result.floor / np.sqrt(topped.known)
        assert topped.result.floor == pytest.approx(expected, rel=0.15)
        error = (topped.result.mean - integrate(scene)).mean()
        means = topped.result.replicates.mean((1, 2))
        assert abs(error) < stats.t.ppf(0.9995, K - 1) * means.std(ddof=1) / np.sqrt(K)


def test_what_is_lacking_is_the_least_part_that_does(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    made = render(make_scene(lit, Phong(exponent=20), count=10), ReferenceSettings(floor=0.5))

    def lacking(short: float, affordable: float = np.inf, known: float = 1.0) -> float:
        result = replace(made, target=made.floor / short)
        return _Step(result, np.full(10, 64), known, 1e-6).lacking(0.5, affordable)

    assert lacking(1.01) == 0.125
    assert lacking(1.2) == 0.5
    assert lacking(1.2, known=2.0) == 1.0
    assert lacking(2.0) == 0.0  # better planned anew
    assert lacking(1.2, affordable=0.4 * 640) == 0.0


@dataclass(frozen=True, kw_only=True)
class SaysWide(Phong):
    """A lobe with a wide cone, as a table has whose sharp peak stands on a broad floor."""

    def cone(self, eps: float) -> float:
        return 1.2


@pytest.mark.parametrize(("exponent", "sampled"), [(0.5, False), (500.0, True), (1e5, True)])
def test_a_pilot_finds_peaks(mi: ModuleType, make_scene: MakeScene, exponent: float, sampled: bool) -> None:
    """The last peak is one that the light's samples of the pilot (512 points, 8 x 64) nearly always miss."""
    scene = make_scene(build(LIGHTS["esplanade"]), SaysWide(exponent=exponent), count=600)
    assert estimator_for(scene, ReferenceSettings()).sample_lobes == sampled


def test_a_texture_modulates(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    scene = make_scene(lit, Lambertian(), count=20)
    modulation = np.random.default_rng(1).uniform(0, 1, (20, 3))
    textured = replace(scene, points=replace(scene.points, modulation=modulation))
    plain, result = (render(s, ReferenceSettings(floor=0.5)) for s in (scene, textured))
    np.testing.assert_allclose(result.mean, plain.mean * modulation, rtol=1e-6)


def test_a_spent_budget_is_said(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    result = render(make_scene(lit, Lambertian()), ReferenceSettings(floor=1e-6, budget=1e-3))
    assert len(result.notes) == 1
    assert "noise floor" in result.notes[0]
    assert "budget" in result.notes[0]


def test_chunks_join_seamlessly(
    mi: ModuleType, make_scene: MakeScene, lit: Environment, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = make_scene(lit, Phong(exponent=8, clipped=False), count=21)
    monkeypatch.setattr("data_gen.mitsuba_estimator._LANES", 4 * 1024)
    means = replicates(scene, 1024).mean(0)
    assert means == pytest.approx(integrate(scene), rel=0.05)


def test_black_light_ends_at_once(make_scene: MakeScene) -> None:
    black = Environment("black", np.zeros((4, 8, 3), np.float32))
    result = render(make_scene(black, Lambertian()), ReferenceSettings())
    assert result.samples == 0
    assert not result.mean.any()
    assert result.floor == 0


def test_a_dark_scene_is_sampled_once(mi: ModuleType, make_scene: MakeScene) -> None:
    """What sees but the tail of a lamp, 1e-12 of the light, has no noise floor worth its budget."""
    light = (1e-12 * np.random.default_rng(1).uniform(0, 1, (16, 32, 3))).astype(np.float32)
    light[10:] = 1
    scene = make_scene(Environment("below", light), Phong(exponent=500), count=10)
    up = np.tile([0.0, 0, 1], (10, 1))
    points = replace(scene.points, normal=up, geometric_normal=up, view=up)
    result = render(replace(scene, points=points), ReferenceSettings(floor=1e-5))
    assert result.samples == 64
    assert result.notes[0].startswith("dark: ")


@pytest.fixture
def restored(mi: ModuleType) -> Iterator[None]:
    yield
    mi.set_variant("llvm_ad_rgb")


@pytest.mark.usefixtures("restored")
@pytest.mark.parametrize("samples", [32, 64])
def test_scalar_variant(
    make_scene: MakeScene, lit: Environment, samples: int, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = make_scene(lit, Microfacet(sigma=0.3), count=4)
    means = replicates(scene, samples, variant="scalar_rgb").mean((1, 2))
    assert "".join(capfd.readouterr()) == ""
    margin = stats.t.ppf(0.9995, K - 1) * means.std(ddof=1) / np.sqrt(K)
    assert means.mean() == pytest.approx(integrate(scene).mean(), abs=margin)


def test_unknown_variant(make_scene: MakeScene, lit: Environment) -> None:
    with pytest.raises(BadInput, match="llvm_ad_rgb"):
        render(make_scene(lit, Lambertian()), ReferenceSettings(variant="llvm_rgb_ad"))
