"""A membrane's map of transparency: constant light, the quadrature, the closed form of the transfer, no uv."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from data_gen import geometry, views
from data_gen.materials import build
from data_gen.mitsuba_estimator import Estimator
from data_gen.mitsuba_surface import Surface
from envbench import latlong, real_harmonics
from envbench.environment import Environment
from envbench.errors import BadInput
from envbench.geometry import Points
from envbench.reference import ReferenceSettings
from envbench.scene import Scene
from methods import METHODS
from references.cache import provenance
from references.estimators import estimator_for
from references.quadrature import integrate

K = 8
LEAF = build({"kind": "membrane", "transparency": {"kind": "gradient"}, "reflectance": [0.6, 0.5, 0.4]}, "leaf")
FLAT = geometry.build({"kind": "patch", "texture": "bumps", "height": 0.0, "resolution": 9}, "flat")


def alpha_of(points: Points) -> np.ndarray:
    """From .1 to .9 with v over 256 rows, by hand: rows are centred at (i + 1/2) / 256, and the map repeats."""
    assert points.uv is not None
    row = points.uv[:, 1] * 256 - 0.5
    inside = 0.1 + 0.8 * np.clip(row, 0, 255) / 255
    blend = np.where(row < 0, -row, np.maximum(row - 255, 0))  # towards the other end
    other = np.where(row < 0, 0.9, 0.1)
    return (1 - blend) * inside + blend * other


def at_vertices() -> Points:
    return views.build({"kind": "vertices", "direction": [0.2, -0.4, 1.0]}, FLAT)[0]


def scene(light: Environment, points: Points, material: Any = LEAF) -> Scene:
    return Scene("test", light, material, FLAT, points)


def smooth(order: int = 4) -> Environment:
    e = np.random.default_rng(1).normal(size=(order**2, 3))
    e[0] += 8
    values = np.tensordot(real_harmonics.basis(order - 1, latlong.grid(64, 128).reshape(-1, 3)).T, e, 1)
    return Environment("smooth", values.reshape(64, 128, 3).astype(np.float32), signed=True)


def replicates(made: Scene, samples: int = 1024) -> np.ndarray:
    estimator = estimator_for(made, ReferenceSettings())
    return np.stack([estimator.replicate(made.points, samples, s) for s in np.random.SeedSequence(3).spawn(K)])


@pytest.mark.parametrize("sample_lobes", [True, False])
def test_constant_light_returns_one_plus_alpha(mi: ModuleType, constant: Environment, sample_lobes: bool) -> None:
    """Times the reflectance, at each point; samples of the lobe, whose density is a map too, and of the light alone."""
    points = at_vertices()
    expected = (1 + alpha_of(points))[:, None] * LEAF.lobes[0].reflectance
    estimator = Estimator(Surface(LEAF, None), constant, sample_lobes)
    found = np.stack([estimator.replicate(points, 1024, s) for s in np.random.SeedSequence(3).spawn(K)])
    assert found.mean(0) == pytest.approx(expected, rel=5e-3)
    assert np.ptp(expected[:, 0]) > 0.3
    # the lobe has a kink at the horizon, where no cell of the quadrature ends
    assert integrate(scene(constant, points)) == pytest.approx(expected, rel=3e-3)


def test_reference_quadrature_and_closed_form_agree(mi: ModuleType) -> None:
    """At vertices, where the transfer knows the map; under light of its own bands."""
    points, light = at_vertices(), smooth()
    made = scene(light, points)
    theirs = replicates(made)
    exact = integrate(made)
    noise = theirs.var(0, ddof=1) / K
    assert ((theirs.mean(0) - exact) ** 2).mean() < 2.5 * noise.mean()
    method = METHODS["sh-rotation"](order=4, transfer="unshadowed")  # pyright: ignore[reportCallIssue]
    assert method.refusal(made) is None
    found = method.shade(method.relight(method.prepare(LEAF, FLAT), light), points)
    assert found == pytest.approx(exact, rel=1e-3)
    one = build({"kind": "membrane", "transparency": 0.5, "reflectance": [0.6, 0.5, 0.4]}, "one")
    assert np.abs(integrate(scene(light, points, one)) - exact).max() > 0.1


def test_monte_carlo_looks_it_up_and_others_decline(mi: ModuleType, constant: Environment) -> None:
    made = scene(constant, at_vertices())
    known = {name: method().refusal(made) for name, method in METHODS.items()}
    assert known["monte-carlo"] is None
    for name in ("angular", "irradiance-9", "split-sum"):
        assert "map" in str(known[name])
    blind = replace(made, points=replace(made.points, uv=None))
    assert "uv" in str(METHODS["monte-carlo"]().refusal(blind))


def test_without_uv_there_is_one_line(mi: ModuleType, constant: Environment) -> None:
    points = replace(at_vertices(), uv=None)
    with pytest.raises(BadInput, match="uv"):
        Estimator(Surface(LEAF, None), constant).replicate(points, 16, np.random.SeedSequence(0))
    assert FLAT.mesh is not None
    bare = replace(FLAT, mesh=replace(FLAT.mesh, uv=None))
    with pytest.raises(BadInput, match="uv"):
        METHODS["ldprt"](transfer="unshadowed").prepare(LEAF, bare)  # pyright: ignore[reportCallIssue]


def test_the_map_and_where_it_is_read_are_part_of_the_address(constant: Environment) -> None:
    made, settings = scene(constant, at_vertices()), ReferenceSettings()
    assert made.points.uv is not None
    moved = replace(made, points=replace(made.points, uv=made.points.uv + 0.1))
    other = replace(made, material=build({"kind": "membrane", "transparency": {"kind": "checker"}}, "other"))
    assert provenance(made, settings) != provenance(moved, settings)
    assert provenance(made, settings)["material"] != provenance(other, settings)["material"]
