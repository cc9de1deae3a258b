"""Plain Monte Carlo: unbiased, its noise falling with the samples, its seeds not the reference's."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from data_gen.geometry import build
from data_gen.lobes import Lambertian, Microfacet, Phong
from data_gen.mitsuba_surface import Surface
from envbench import laws
from envbench.directions import normalised, perpendicular, uniform
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, Pose, TriangleMesh
from envbench.material import Material
from envbench.scene import Effect, Scene
from methods.monte_carlo import STREAM, MonteCarlo
from references.quadrature import integrate

SPHERE = Geometry("sphere")
PLASTIC = Material("plastic", (Lambertian(reflectance=(0.3, 0.2, 0.1)), Phong(exponent=40)))


def scene(material: Material, count: int = 60) -> Scene:
    rng = np.random.default_rng(0)
    light = Environment("rough", np.exp(rng.normal(0, 1.2, (32, 64, 3))).astype(np.float32))
    reflection, view = uniform(count, rng), uniform(count, rng)
    normal = normalised(reflection + view)
    points = Points(normal, normal, normal, perpendicular(normal), view, np.full(count, 1 / count))
    return Scene("test", light, material, SPHERE, points)


def rendered(method: MonteCarlo, made: Scene) -> np.ndarray:
    state = method.relight(method.prepare(made.material, made.geometry), made.environment)
    return np.asarray(method.shade(method.frame(state, None), made.points))


@pytest.mark.parametrize("material", [PLASTIC, Material("facets", (Microfacet(sigma=0.2),))], ids=lambda m: m.name)
def test_unbiased_and_less_noisy_with_samples(mi: object, material: Material) -> None:
    """Means over 8 seeds lie within their 99.9 % interval; noise falls at least as N^-1/2, so by 4 from 16 to 256."""
    made = scene(material)
    exact = integrate(made)
    few, many = (
        np.stack([rendered(MonteCarlo(samples=n, seed=seed), made) for seed in range(8)]) - exact for n in (16, 256)
    )
    means = few.mean((1, 2))
    assert abs(means.mean()) < stats.t.ppf(0.9995, 7) * means.std(ddof=1) / np.sqrt(8)
    assert np.sqrt((few**2).mean()) > 3 * np.sqrt((many**2).mean())


def test_deterministic_for_a_seed(mi: object) -> None:
    made = scene(PLASTIC)
    assert np.array_equal(rendered(MonteCarlo(), made), rendered(MonteCarlo(), made))
    assert not np.array_equal(rendered(MonteCarlo(), made), rendered(MonteCarlo(seed=1), made))


def test_seeds_are_none_of_the_references() -> None:
    """For small seeds: no first state of a reference's replicates is one of ours."""
    ours = {np.random.SeedSequence(s, spawn_key=STREAM).generate_state(1)[0] for s in range(50)}
    theirs = {
        child.generate_state(1)[0]
        for seed in range(50)
        for samples in (64 * 4096, 256 * 4096)
        for child in np.random.SeedSequence((seed, samples)).spawn(8)
    }
    assert not ours & theirs


def test_relight_builds_the_emitter_and_shade_only_samples(mi: object) -> None:
    made, method = scene(PLASTIC), MonteCarlo()
    prepared = method.prepare(made.material, made.geometry)
    relit = method.relight(prepared, made.environment)
    assert relit is not None
    assert {"bsdf", "shape"} <= set(vars(prepared))
    assert "scene" in vars(relit)
    copy = pickle.loads(pickle.dumps(relit))
    assert "scene" not in vars(copy)
    assert np.array_equal(method.shade(copy, made.points), method.shade(relit, made.points))


def test_only_shapes_that_shadow_cast_rays() -> None:
    corner = build({"kind": "sphere"}, "sphere")
    assert Surface.of(PLASTIC, corner).occluder is None
    assert MonteCarlo().describe(Surface.of(PLASTIC, corner)) == {"visibility rays a sample": 0}


@pytest.mark.parametrize("seed", range(2))
def test_laws(mi: object, seed: int) -> None:
    assert laws.check(MonteCarlo(samples=16), PLASTIC, seed) == []


def test_hard_light(mi: object) -> None:
    made = scene(Material("narrow", (Phong(exponent=1e5),)))
    for shape, pixel in (((2, 4), (0, 0)), ((3, 5), (2, 4)), ((64, 128), (0, 127))):
        spot = np.zeros((*shape, 3), np.float32)
        spot[pixel] = 1e8
        state = MonteCarlo().relight(MonteCarlo().prepare(made.material, SPHERE), Environment("spot", spot))
        assert np.isfinite(MonteCarlo().shade(state, made.points)).all()


@pytest.mark.parametrize(
    ("settings", "named"), [({"samples": 8}, "samples"), ({"samples": 32}, "samples"), ({"seed": -1}, "seed")]
)
def test_settings(settings: dict[str, int], named: str) -> None:
    with pytest.raises(BadInput, match=named):
        MonteCarlo(**settings)


def test_declines_what_it_cannot_leave_out() -> None:
    """A pose that `prepare` never sees, and shadows that a scene is told to leave out."""
    made = scene(PLASTIC)
    mesh = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], np.int32), np.eye(3))
    pose = Pose("bent", np.eye(3), np.eye(3), np.tile(np.eye(3), (3, 1, 1)))
    posed, open_ = Geometry("leaf", mesh, convex=False, pose=pose), Geometry("leaf", mesh, convex=False)
    shadowed = frozenset({Effect.SELF_SHADOWING})
    assert "pose" in str(MonteCarlo().declines(replace(made, geometry=posed, effects=shadowed)))
    assert "shadows" in str(MonteCarlo().declines(replace(made, geometry=open_)))
    assert MonteCarlo().declines(replace(made, geometry=open_, effects=shadowed)) is None
