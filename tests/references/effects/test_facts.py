"""Facts rule effects out, each with its reason; what they do not rule out has an occasion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from data_gen.environments.projected import project
from data_gen.lobes import GGX, KajiyaKay, Lambertian, Membrane, Phong
from envbench.environment import Environment
from envbench.geometry import Geometry, Points, Pose, TriangleMesh, Viewer
from envbench.material import Lobe, Material
from envbench.scene import Effect, Scene
from references.effects.facts import facts, occasions

MESH = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], np.int32), np.eye(3))
POSE = Pose("bent", np.eye(3), np.eye(3), np.tile(np.eye(3), (3, 1, 1)))
LEAF, BALL = Geometry("leaf", MESH, convex=False), Geometry("ball", MESH, convex=True)
UP = np.array([[0.0, 0, 1]])
POINTS = Points(UP, UP, UP, UP[:, [2, 0, 1]], UP, np.ones(1))
DISTANT, NEAR = Viewer(direction=(0.0, 0.0, 1.0)), Viewer(eye=(0.0, 0.0, 3.0))
NOISE = Environment("noise", np.random.default_rng(1).random((64, 128, 3)).astype(np.float32))
CONSTANT = Environment("constant", np.ones((8, 16, 3), np.float32))
BANDED, BLACK = project(NOISE, 4), Environment("black", np.zeros((8, 16, 3), np.float32))
V, A, S, B, D, P, L = (
    Effect.VIEW_DEPENDENCE, Effect.ANISOTROPY, Effect.SELF_SHADOWING, Effect.INTERREFLECTION, Effect.DEFORMATION,
    Effect.PERSPECTIVE, Effect.LIGHT_DETAIL,
)  # fmt: skip
DIFFUSE, DARK = Lambertian(), Lambertian(reflectance=(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("light", "lobe", "shape", "viewer", "expected"),
    [
        (CONSTANT, DIFFUSE, BALL, DISTANT, set[Effect]()),
        (NOISE, DIFFUSE, BALL, DISTANT, {L}),
        (BANDED, DIFFUSE, BALL, DISTANT, set[Effect]()),
        (CONSTANT, Membrane(), LEAF, NEAR, {S, B}),
        (CONSTANT, Phong(), BALL, None, {V}),
        (CONSTANT, Phong(), BALL, DISTANT, {V}),
        (CONSTANT, Phong(), BALL, NEAR, {V, P}),
        (CONSTANT, GGX(), BALL, DISTANT, {V}),
        (CONSTANT, KajiyaKay(), BALL, NEAR, {V, A, P}),
        (CONSTANT, DIFFUSE, LEAF, DISTANT, {S, B}),
        (CONSTANT, DARK, LEAF, DISTANT, {S}),
        (CONSTANT, DIFFUSE, replace(LEAF, pose=POSE), DISTANT, {S, B, D}),
        (CONSTANT, DIFFUSE, replace(BALL, pose=POSE), DISTANT, {S, B, D}),
        (CONSTANT, DIFFUSE, replace(BALL, pose=replace(POSE, convex=True)), DISTANT, set[Effect]()),
        (CONSTANT, DIFFUSE, replace(LEAF, pose=replace(POSE, convex=True)), DISTANT, set[Effect]()),
        (BLACK, KajiyaKay(), replace(LEAF, pose=POSE), NEAR, set[Effect]()),
    ],
)
def test_occasions(light: Environment, lobe: Lobe, shape: Geometry, viewer: Any, expected: set[Effect]) -> None:
    scene = Scene("test", light, Material("test", (lobe,)), shape, POINTS, viewer)
    assert occasions(scene) == expected
    known = facts(scene)
    assert set(known) == set(Effect)
    assert all(fact.reason and "\n" not in fact.reason for fact in known.values())


def test_light_detail_depends_on_the_bands_that_are_kept() -> None:
    scene = Scene("test", BANDED, Material("test", (DIFFUSE,)), BALL, POINTS, DISTANT)
    assert [L in occasions(replace(scene, order=order)) for order in (3, 4, 6)] == [True, False, False]
