"""Transfer through a medium: a white one, an empty one, an absorbing one, and Mitsuba's `volpath`."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh

from data_gen.mitsuba_light import emitter
from envbench import latlong, real_harmonics
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Geometry, TriangleMesh
from envbench.material import Medium
from methods.ldprt import membrane
from methods.ldprt.subsurface import simulate

OPEN = np.sqrt(4 * np.pi)


def geometry(mesh: Any) -> Geometry:
    normals = np.array(mesh.vertex_normals)
    shape = TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32), normals)
    return Geometry("test", shape, convex=False)


def dumbbell() -> Any:
    """Two balls beside each other: what leaves one may enter the other."""
    balls = [trimesh.creation.icosphere(1, radius=r) for r in (1.0, 0.7)]
    balls[1].apply_translation([2.0, 0.3, 0])
    return trimesh.util.concatenate(balls)


@pytest.mark.parametrize("path", [0.05, 1.0])
def test_a_white_medium_returns_all(mi: ModuleType, path: float) -> None:
    got = simulate(geometry(dumbbell()), 3, Medium(path), rays=200)
    assert got.vectors[:, 0] * OPEN == pytest.approx(1, abs=1e-5)
    assert got.rays == 200
    linear = got.vectors[:42, 1:4]  # what is thick sends light back, what is thin lets it through
    towards = np.sum(linear * membrane.transfer(geometry(dumbbell()).mesh.normals[:42], 2)[:, 1:], axis=1).mean()  # pyright: ignore
    assert (towards > 0) == (path == 0.05)


def test_an_empty_medium_lets_light_straight_through(mi: ModuleType) -> None:
    """The clamped cosine about -N, in closed form, on a convex shape."""
    shape = geometry(trimesh.creation.icosphere(2))
    assert shape.mesh is not None
    got = simulate(shape, 4, Medium(1e6), rays=1000)
    np.testing.assert_allclose(got.vectors, membrane.transfer(-shape.mesh.normals, 4), atol=1e-2)


@pytest.mark.parametrize("path", [0.5, 2.0])
def test_an_absorbing_ball(mi: ModuleType, path: float) -> None:
    """Through a unit ball a ray at the cosine c goes 2 c: E[exp(-2 c / l)] = int_0^1 2 c exp(-2 c / l) dc."""
    got = simulate(geometry(trimesh.creation.icosphere(4)), 1, Medium(path, albedo=1e-9), rays=100)
    k = 2 / path
    exact = 2 * (1 - (1 + k) * np.exp(-k)) / k**2
    mean = got.vectors[:, 0].mean() * OPEN
    error = np.sqrt((got.standard_error**2).mean() / len(got.vectors)) * OPEN
    assert mean == pytest.approx(exact, abs=4 * error + 2e-3)  # and what 5,120 triangles cut off the ball


def test_agrees_with_volpath(mi: ModuleType, tmp_path: Path) -> None:
    """Under a band-limited light, at vertices: t . e against Mitsuba's own volumetric path tracer."""
    import drjit as dr

    mesh, order = dumbbell(), 3
    medium = Medium(0.4, albedo=0.9)
    e = np.random.default_rng(1).normal(size=(order**2, 3))
    e[0] += 12  # positive everywhere
    grid = latlong.grid(96, 192)
    values = np.tensordot(real_harmonics.basis(order - 1, grid.reshape(-1, 3)).T, e, 1).reshape(96, 192, 3)
    light = Environment("test", values.astype(np.float32))
    e = real_harmonics.project(light.radiance, order - 1)
    file = tmp_path / "mesh.ply"
    mesh.export(file)
    world = mi.load_dict({
        "type": "scene",
        "light": emitter(light),
        "shape": {
            "type": "ply", "filename": str(file), "bsdf": {"type": "null"},
            "interior": {
                "type": "homogeneous", "albedo": medium.albedo, "sigma_t": 1 / medium.mean_free_path,
                "phase": {"type": "isotropic"},
            },
        },
    })  # fmt: skip
    integrator = mi.load_dict({"type": "volpath", "max_depth": -1, "rr_depth": 1000})
    chosen, count = np.arange(0, len(mesh.vertices), 7), 4096
    normals, positions = (np.array(v)[chosen] for v in (mesh.vertex_normals, mesh.vertices))
    index = dr.arange(mi.UInt32, len(chosen) * count) // count
    at, n = (
        dr.gather(mi.Vector3f, mi.Vector3f(v.T.astype(np.float32, order="C")), index) for v in (positions, normals)
    )
    estimates = []
    for seed in range(8):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, dr.width(index))
        out = mi.Frame3f(n).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        radiance = integrator.sample(
            world, sampler, mi.RayDifferential3f(mi.Point3f(at - 1e-4 * n + 0.05 * out), -out)
        )[0]
        estimates.append(np.array(radiance).reshape(3, -1, count).mean(-1).T)
    theirs = np.stack(estimates).astype(float)
    runs = [simulate(geometry(mesh), order, medium, rays=2000, seed=seed).vectors[chosen] @ e for seed in range(4)]
    error = np.mean(runs, axis=0) - theirs.mean(0)
    noise = theirs.var(0, ddof=1) / 8 + np.var(runs, axis=0, ddof=1) / 4
    assert (error**2).mean() < 2 * noise.mean()
    assert abs(error.mean()) < 2e-3 * theirs.mean()


def test_the_standard_error_is_honest(mi: ModuleType) -> None:
    shape, medium = geometry(dumbbell()), Medium(0.3, albedo=0.95)
    runs = [simulate(shape, 3, medium, rays=200, seed=seed) for seed in range(8)]
    spread = np.var([run.vectors for run in runs], axis=0, ddof=1).mean()
    stated = np.mean([run.standard_error**2 for run in runs])
    assert spread / stated == pytest.approx(1, abs=0.25)


def test_refuses(mi: ModuleType) -> None:
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(BadInput, match="closed"):
        simulate(geometry(sheet), 3, Medium(1.0))
    with pytest.raises(BadInput, match="mean_free_path"):
        Medium(0.0)
    with pytest.raises(BadInput, match="albedo"):
        Medium(1.0, albedo=1.2)
    with pytest.raises(BadInput, match="albedo"):
        Medium(1.0, albedo=0.0)
