"""The two references agree on captured light, and a factor of 1.001 in either is caught."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from data_gen.environments import LIGHTS, build
from data_gen.lobes import Lambertian, Microfacet, Phong
from envbench import root, suite
from envbench.environment import Environment
from envbench.plan import SceneSpec, expand
from envbench.reference import ReferenceSettings
from envbench.scene import Scene
from references import agreement
from references.mitsuba_direct import render
from references.quadrature import integrate

MakeScene = Callable[..., Scene]


BENCH = root.load()
QUICK = suite.read(BENCH.suite("quick"))
SPECS = [spec for grid in QUICK.scenes for spec in expand(grid, QUICK, BENCH)]


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_every_scene_of_quick(mi: ModuleType, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    """At a noise floor of 1e-4, at 16 points of each scene; ``./bench doctor --references`` takes 32."""
    monkeypatch.setattr(agreement, "QUERIES", 16)
    (row,) = agreement.table([spec.build(BENCH.catalogue)], ReferenceSettings(floor=1e-4, budget=60))
    assert row.floor <= 1e-4
    assert row.agrees, row
    # RMS of a mean over its standard error: sqrt of F(n, 7 n), n >= 4 lighting conditions that differ
    assert row.rms < 3.5 * row.floor


def test_a_whole_lobe(mi: ModuleType, make_scene: MakeScene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agreement, "QUERIES", 16)
    scene = make_scene(build(LIGHTS["studio"]), Phong(exponent=64, clipped=False), count=64)
    (row,) = agreement.table([scene], ReferenceSettings(floor=1e-4))
    assert row.agrees, row


def test_a_planted_factor_is_caught(mi: ModuleType, make_scene: MakeScene, lit: Environment) -> None:
    scene = make_scene(lit, Microfacet(sigma=0.2), count=64)
    sampled, exact = render(scene, ReferenceSettings(floor=3e-4)), integrate(scene)
    assert agreement.compare("true", sampled, exact).agrees
    for factor in (1.001, 1 / 1.001):
        scaled = replace(sampled, replicates=sampled.replicates * factor)
        assert not agreement.compare("Mitsuba off", scaled, exact).agrees
        assert not agreement.compare("quadrature off", sampled, exact * factor).agrees


def test_black_light_agrees(make_scene: MakeScene) -> None:
    black = Environment("black", np.zeros((4, 8, 3), np.float32))
    (row,) = agreement.table([make_scene(black, Lambertian())])
    assert row.agrees
    assert row.outside == 0


def test_shapes_with_shadows_are_left_out(make_scene: MakeScene, lit: Environment) -> None:
    assert agreement.table([make_scene(lit, Lambertian(), convex=False)]) == []
