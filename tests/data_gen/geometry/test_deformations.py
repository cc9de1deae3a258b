"""Deformations and surfaces: gradients against finite differences, and closed forms of what they keep."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from data_gen.geometry.deformations import Bend, Box, Deformation, Stretch, Turn, Twist, Wave
from data_gen.geometry.surfaces import Bent, Cylinder, Surface, Torus, Vase, thick
from envbench.directions import Array, normalised

X = np.random.default_rng(0).uniform([-1, 0, 2], [1, 1.5, 5], (60, 3))
BOX = Box.of(X)

DEFORMATIONS: list[Deformation] = [
    Turn(degrees=70, axis=(1, -2, 0.5)),
    Bend(degrees=75),
    Bend(degrees=-120, axis="y", towards="z"),
    Bend(degrees=1e-5, axis="x", towards="z"),
    Twist(degrees=200),
    Twist(degrees=-40, axis="x"),
    Stretch(factor=1.7, axis="y"),
    Stretch(factor=0.5, axis="z", across=3),
    Wave(amplitude=0.2, cycles=1.5, phase=0.1),
    Wave(amplitude=-0.1, axis="z", towards="y"),
]


def differences(function: Any, x: Array, step: float = 1e-5) -> Array:
    """Return the gradients (n, 3, 3) of a map of places (n, 3), by central differences: error of step^2."""
    columns = [(function(x + step * e) - function(x - step * e)) / (2 * step) for e in np.eye(3)]
    return np.stack(columns, axis=2)


@pytest.mark.parametrize("deformation", DEFORMATIONS, ids=str)
def test_gradients_are_those_of_finite_differences(deformation: Deformation) -> None:
    _, F = deformation.at(X, BOX)
    np.testing.assert_allclose(F, differences(lambda x: deformation.at(x, BOX)[0], X), atol=1e-7)


def test_a_bend_keeps_the_length_of_the_axis_and_turns_its_sections() -> None:
    s = np.linspace(-0.5, 0.5, 1001)
    axis = BOX.centre + s[:, None] * [0, 0, BOX.size[2]]
    posed, F = Bend(degrees=90).at(axis, BOX)
    assert np.linalg.norm(np.diff(posed, axis=0), axis=1).sum() == pytest.approx(BOX.size[2], rel=1e-6)
    radius = BOX.size[2] / (np.pi / 2)
    away = posed - BOX.centre - [radius, 0, 0]
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), radius, rtol=1e-12)  # an arc, curving towards x
    q = np.radians(90) * s
    np.testing.assert_allclose(F[:, 2, 2], np.cos(q), atol=1e-12)
    np.testing.assert_allclose(F[:, 0, 2], np.sin(q), atol=1e-12)
    np.testing.assert_array_equal(Bend(degrees=0).at(X, BOX)[0], BOX.centre + (X - BOX.centre))


def test_a_twist_keeps_volume_and_turns_the_ends_by_half_each_way() -> None:
    _, F = Twist(degrees=300, axis="y").at(X, BOX)
    np.testing.assert_allclose(np.linalg.det(F), 1, atol=1e-12)
    top = BOX.centre + np.array([0, BOX.size[1] / 2, 1])
    posed, _ = Twist(degrees=60, axis="y").at(top[None], BOX)
    np.testing.assert_allclose(posed[0] - BOX.centre, [0.5, BOX.size[1] / 2, np.cos(np.radians(30))], atol=1e-12)


def test_a_stretch_keeps_volume_unless_told_otherwise() -> None:
    assert np.linalg.det(Stretch(factor=1.7).at(X, BOX)[1]) == pytest.approx(np.ones(len(X)))
    posed, _ = Stretch(factor=2, across=1, axis="x").at(X, BOX)
    np.testing.assert_allclose(posed - BOX.centre, (X - BOX.centre) * [2, 1, 1])


SURFACES: list[Surface] = [
    Bent(degrees=100),
    Cylinder(radius=0.7, length=2),
    Vase(),
    Vase(profile=((1.0, 0.0), (0.5, 2.0))),
    Torus(radius=1.2, tube=0.5),
]


@pytest.mark.parametrize("surface", SURFACES, ids=str)
def test_surfaces_have_their_gradients_and_normals(surface: Surface) -> None:
    rng = np.random.default_rng(1)
    uvh = rng.uniform([0.01, 0.01, -0.1], [0.99, 0.99, 0.1], (80, 3))
    _, F, normal = thick(surface, *uvh.T, (1.3, 0.8))
    np.testing.assert_allclose(F, differences(lambda x: thick(surface, *x.T, (1.3, 0.8))[0], uvh), atol=2e-7)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-12)
    assert np.linalg.det(F).min() > 0  # (S_u, S_v, n) is right-handed, and nothing folds
    flat = thick(surface, uvh[:, 0], uvh[:, 1], 0 * uvh[:, 2], (1.3, 0.8))[1]
    np.testing.assert_allclose(normal, normalised(np.cross(flat[:, :, 0], flat[:, :, 1])), atol=1e-12)


def test_seams_meet_to_the_last_bit() -> None:
    v, h = np.random.default_rng(2).uniform(0, 1, (2, 50))
    zero, one = np.zeros(50), np.ones(50)
    for surface in SURFACES[1:]:
        for first, last in zip(thick(surface, zero, v, h, (1, 1)), thick(surface, one, v, h, (1, 1)), strict=True):
            np.testing.assert_array_equal(first, last)
    torus = SURFACES[-1]
    for first, last in zip(thick(torus, v, zero, h, (1, 1)), thick(torus, v, one, h, (1, 1)), strict=True):
        np.testing.assert_array_equal(first, last)


def test_surfaces_are_what_they_are_called() -> None:
    u, v = np.random.default_rng(3).uniform(0, 1, (2, 100))
    h = np.full(100, 0.05)
    place, _, normal = thick(Torus(radius=1.2, tube=0.5), u, v, h, (1, 1))
    ring = np.hypot(place[:, 0], place[:, 1]) - 1.2
    np.testing.assert_allclose(np.hypot(ring, place[:, 2]), 0.55, rtol=1e-12)
    np.testing.assert_allclose(normal[:, 2], place[:, 2] / 0.55, atol=1e-12)
    place, _, _ = thick(Cylinder(radius=0.7, length=2), u, v, h, (1, 1))
    np.testing.assert_allclose(np.hypot(place[:, 0], place[:, 1]), 0.75, rtol=1e-12)
    knots = np.array(Vase().profile)
    chord = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    place, _, _ = thick(Vase(), 0 * chord, chord / chord[-1], 0 * chord, (1, 1))
    np.testing.assert_allclose(place[:, [0, 2]], knots, atol=1e-12)
    # a bent patch keeps its own lengths
    _, F, _ = thick(Bent(degrees=80), u, v, 0 * h, (1.3, 0.8))
    np.testing.assert_allclose(np.linalg.norm(F[:, :, :2], axis=1), np.broadcast_to([1.3, 0.8], (100, 2)), rtol=1e-12)
