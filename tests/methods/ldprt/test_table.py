"""Light-specialised tables: eq. 24 summed slowly, and interpolation errors beside what is stated of them."""

from __future__ import annotations

import numpy as np
import pytest

from envbench import latlong
from envbench.directions import from_angles, uniform
from envbench.errors import BadInput
from envbench.real_harmonics import basis
from methods.ldprt import table

SIZES = [(32, 64), (24, 96), (16, 16)]


def light(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n * n, 3))


def by_band(e: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Eq. 24 in double precision, (k, n, 3)."""
    n = int(np.sqrt(len(e)))
    y = basis(n - 1, s)
    return np.stack([y[l * l : (l + 1) ** 2].T @ e[l * l : (l + 1) ** 2] for l in range(n)], axis=1)


@pytest.mark.parametrize("size", SIZES)
def test_the_samples_are_equation_24(size: tuple[int, int]) -> None:
    """Rounded to single precision, over at most 2 n - 1 = 11 products."""
    e = light(6)
    got = table.build(e, 6, size)
    assert got.shape == (*size, 6, 3)
    assert got.dtype == np.float32
    assert np.allclose(got, by_band(e, latlong.grid(*size).reshape(-1, 3)).reshape(got.shape), rtol=0, atol=1e-5)


def test_bands_beyond_n_are_left_out() -> None:
    e = light(6)
    assert np.allclose(table.build(e, 3), table.build(e, 6)[:, :, :3], rtol=0, atol=1e-6)


@pytest.mark.parametrize("size", SIZES)
def test_the_error_is_below_its_bound_everywhere(size: tuple[int, int]) -> None:
    """Bernstein's, for each of 40 lights and each band, near the poles too; 1e-5 for single precision."""
    rng = np.random.default_rng(1)
    near = from_angles(rng.uniform(0, 0.2, 500), rng.uniform(0, 2 * np.pi, 500))
    s = np.concatenate([uniform(4000, rng), near, near * [1, 1, -1], [[0, 0, 1], [0, 0, -1], [1, 0, 0]]])
    for seed in range(40):
        e = light(6, seed)
        exact = by_band(e, s)
        error = np.abs(table.interpolate(table.build(e, 6, size), s) - exact).max(0)
        bound = np.abs(exact).max(0) * np.array([table.worst_error(l, size) for l in range(6)])[:, None]
        assert np.all(error <= bound + 1e-5)
        assert np.all(bound <= table.largest_error(e, size) + 1e-12)


@pytest.mark.parametrize("size", SIZES)
def test_the_rms_error_is_the_expected_one(size: tuple[int, int]) -> None:
    """Over 60 lights of three channels: 180 draws of a mean square; the next order in h l is (h l)^2 / 10 or less."""
    s = uniform(4000, np.random.default_rng(2))
    found, expected = [], []
    for seed in range(60):
        e = light(6, seed)
        found.append(np.mean((table.interpolate(table.build(e, 6, size), s) - by_band(e, s)) ** 2, axis=0))
        expected.append(table.expected_error(e, size) ** 2)
    ratio = np.sqrt(np.mean(found, (0, 2))[1:] / np.mean(expected, (0, 2))[1:])
    step = np.array([max(np.pi / size[0], 2 * np.pi / size[1]) * l for l in range(1, 6)])
    assert np.all(np.abs(ratio - 1) < 0.03 + step**2 / 10), ratio
    assert np.mean(found, (0, 2))[0] < 1e-12


def test_a_constant_light_has_no_error() -> None:
    e = np.zeros((36, 3))
    e[0] = np.sqrt(4 * np.pi)
    got = table.interpolate(table.build(e, 6), uniform(1000, np.random.default_rng(3)))
    assert np.allclose(got[:, 0], 1, rtol=0, atol=1e-6)
    assert np.all(got[:, 1:] == 0)


def test_the_papers_table_errs_by_so_much() -> None:
    """64 x 32 at l = 5: 6 % of the band's maximum at worst, 2.2 % of its RMS."""
    assert table.worst_error(5) == pytest.approx(0.0602, abs=1e-4)
    assert table.rms_error(5) == pytest.approx(0.0223, abs=1e-4)


def test_harmonics_are_shared_and_cannot_be_written() -> None:
    assert table.harmonics(4) is table.harmonics(4)
    with pytest.raises(ValueError, match="read-only"):
        table.harmonics(4)[0] = 1


@pytest.mark.parametrize(
    ("n", "size", "message"),
    [
        (0, (32, 64), "n must be >= 1. Got 0"),
        (6, (32, 63), "even number of columns"),
        (6, (1, 64), "2 rows or more"),
        (22, (32, 64), "holds orders n <= 21. Got 22"),
        (6, (4, 8), "holds orders n <= 3"),
    ],
)
def test_tables_that_cannot_be(n: int, size: tuple[int, int], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        table.harmonics(n, size)


def test_a_light_of_too_few_bands() -> None:
    with pytest.raises(BadInput, match=r"order 6 must have shape \(36, 3\). Got \(16, 3\)"):
        table.build(light(4), 6)
