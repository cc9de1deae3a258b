"""Light that may be negative, as a projection is: every method takes it as the difference of its two parts."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.environments import build
from data_gen.materials import MATERIALS
from data_gen.materials import build as material
from envbench import laws
from envbench.environment import Environment
from envbench.geometry import Geometry
from envbench.scene import Scene
from methods import METHODS

LIGHT = build({"kind": "projected", "light": {"kind": "lamps", "seed": 2}, "order": 5, "size": 32})


@pytest.mark.parametrize("lobe", ["lambertian", "phong"])
@pytest.mark.parametrize("name", METHODS)
def test_signed_light_is_the_difference_of_its_parts(name: str, lobe: str, mi: object) -> None:
    assert LIGHT.radiance.min() < 0
    brdf, method = material(MATERIALS[lobe], lobe), METHODS[name].sweep()[0]
    viewer, points = laws.queries(np.random.default_rng(0), 24)[0]
    if method.declines(Scene("test", LIGHT, brdf, Geometry("sphere"), points, viewer)) is not None:
        pytest.skip(f"{name} takes no part in {lobe}")
    prepared = method.prepare(brdf, Geometry("sphere"))

    def shaded(light: Environment) -> np.ndarray:
        return np.asarray(method.shade(method.frame(method.relight(prepared, light), viewer), points), float)

    got, parts = shaded(LIGHT), [sign * shaded(part) for sign, part in LIGHT.parts]
    scale = np.sqrt(np.mean(np.square(parts)))
    assert np.sqrt(np.mean((got - sum(parts)) ** 2)) <= 2 * method.tolerance(prepared).linearity * scale
    assert (sum(parts) < 0).any() or lobe == "lambertian"
