"""Scenes on the unit sphere, with uniform (R, V)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from envbench.directions import normalised, perpendicular, uniform
from envbench.environment import Environment
from envbench.geometry import Geometry, Points
from envbench.material import Lobe, Material
from envbench.scene import Scene

MakeScene = Callable[..., Scene]


def points_at(normal: np.ndarray, view: np.ndarray) -> Points:
    n = len(normal)
    return Points(normal, normal, normal, perpendicular(normal), view, np.full(n, 1 / n))


@pytest.fixture
def make_scene() -> MakeScene:
    """Make a scene from a light and lobes; the mirror directions and views are uniform and independent."""

    def make(environment: Environment, *lobes: Lobe, count: int = 16, seed: int = 0, convex: bool = True) -> Scene:
        rng = np.random.default_rng(seed)
        reflection, view = uniform(count, rng), uniform(count, rng)
        points = points_at(normalised(reflection + view), view)
        return Scene("test", environment, Material("test", lobes), Geometry("sphere", convex=convex), points)

    return make


@pytest.fixture(scope="session")
def lit() -> Environment:
    """A rough light of 100 : 1, 32 x 64 samples."""
    rng = np.random.default_rng(7)
    return Environment("rough", np.exp(rng.normal(0, 1.2, (32, 64, 3))).astype(np.float32))


@pytest.fixture(scope="session")
def constant() -> Environment:
    return Environment("constant", np.ones((16, 32, 3), np.float32))
