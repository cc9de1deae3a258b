"""A shifted lattice: every dimension is stratified, pairs of them are, and shifts are independent of each other."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from data_gen.lattice import VECTOR, Lattice

N, LATTICES = 256, 400


@pytest.fixture(scope="module")
def numbers(mi: ModuleType) -> np.ndarray:
    """(dimensions, lattices, N)"""
    return drawn(mi, Lattice.of(mi, N * LATTICES, N, 7), len(VECTOR) + 2)


def drawn(mi: ModuleType, lattice: Lattice, many: int) -> np.ndarray:
    return np.array([lattice.next_1d().numpy() for _ in range(many)]).reshape(many, LATTICES, N)


def test_each_dimension_is_stratified(numbers: np.ndarray) -> None:
    """The points of a lattice are 1 / N apart in every dimension: N of them, shifted together."""
    assert (numbers >= 0).all()
    assert (numbers < 1).all()
    apart = np.diff(np.sort(numbers[: len(VECTOR)], axis=-1), axis=-1)
    np.testing.assert_allclose(apart, 1 / N, atol=2e-7)


def test_pairs_are_those_of_the_lattice(mi: ModuleType, numbers: np.ndarray) -> None:
    """Two at a time, numbers have the same steps as one at a time; and their shifts do not depend on each other."""
    lattice = Lattice.of(mi, N * LATTICES, N, 7)
    pairs = np.array([lattice.next_2d().numpy() for _ in range(3)]).reshape(6, LATTICES, N)
    for taken, single in zip(pairs, numbers, strict=False):
        steps = (taken - taken[:, :1] - single + single[:, :1]) % 1
        np.testing.assert_allclose(np.minimum(steps, 1 - steps), 0, atol=4e-7)
    off = np.abs(np.corrcoef(pairs[..., 0]) - np.eye(6))
    assert off.max() < 5 / np.sqrt(LATTICES)


def test_pairs_are_spread(numbers: np.ndarray) -> None:
    """The mean of a smooth function of two dimensions errs far less than that of independent numbers."""
    a, b = numbers[0], numbers[1]
    means = (np.sin(2 * np.pi * a) * np.cos(2 * np.pi * b) + a * b).mean(-1)
    independent = np.sqrt((1 / 4 + 7 / 144) / N)
    assert means.std() < independent / 4
    assert abs(means.mean() - 0.25) < 5 * means.std() / np.sqrt(LATTICES)


def test_other_dimensions_are_those_of_the_same_lattice(mi: ModuleType, numbers: np.ndarray) -> None:
    """What two lattices of different seeds and dimensions draw fills their product."""
    other = drawn(mi, Lattice.of(mi, N * LATTICES, N, 8, range(16, 18)), 2)
    means = (numbers[0] * other[0]).mean(-1)
    assert means.std() < np.sqrt(7 / 144 / N) / 4
    assert abs(means.mean() - 0.25) < 5 * means.std() / np.sqrt(LATTICES)


def test_lanes_that_draw_several_points_draw_the_same(mi: ModuleType, numbers: np.ndarray) -> None:
    many = 8
    lattice = Lattice.of(mi, N * LATTICES // many, N, 7, many=many)
    found = np.empty((2, N * LATTICES // many, many))
    for k in range(many):
        found[:, :, k] = lattice.next_1d().numpy(), lattice.next_1d().numpy()
        lattice.begin(mi.Bool(True))
    np.testing.assert_array_equal(found.reshape(2, LATTICES, N), numbers[:2])


def test_dimensions_beyond_the_vector_are_random(mi: ModuleType, numbers: np.ndarray) -> None:
    for beyond, before in (numbers[-1:-3:-1], drawn(mi, Lattice.of(mi, N * LATTICES, N, 7, range(16, 17)), 4)[1:3]):
        assert abs(beyond.mean() - 0.5) < 5 / np.sqrt(12 * beyond.size)
        assert abs(np.corrcoef(beyond.ravel(), before.ravel())[0, 1]) < 5 / np.sqrt(beyond.size)
        assert np.abs(np.corrcoef(beyond[:, 1:].ravel(), beyond[:, :-1].ravel())[0, 1]) < 5 / np.sqrt(beyond.size)


def test_shifts_are_uniform_and_differ(mi: ModuleType, numbers: np.ndarray) -> None:
    shifts = numbers[:4, :, 0]
    assert (np.abs(shifts.mean(-1) - 0.5) < 5 / np.sqrt(12 * LATTICES)).all()
    off = np.abs(np.corrcoef(shifts) - np.eye(4))
    assert off.max() < 5 / np.sqrt(LATTICES)
    neighbours = [np.corrcoef(row[1:], row[:-1])[0, 1] for row in shifts]
    assert np.abs(neighbours).max() < 5 / np.sqrt(LATTICES)
    other = drawn(mi, Lattice.of(mi, N * LATTICES, N, 8), 1)
    assert abs(np.corrcoef(other[0, :, 0], numbers[0, :, 0])[0, 1]) < 5 / np.sqrt(LATTICES)
