"""SH rotation against Wigner matrices by another route, against the functions themselves, and the paper's table."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from envbench.directions import uniform
from envbench.errors import BadInput
from envbench.real_harmonics import basis
from methods.ldprt.rotation import multiplies, quarter_turn, rotate, turned_about_z

PRINTED = {3: 53, 4: 121, 5: 217, 6: 345, 7: 509, 8: 713, 9: 961}


@lru_cache(maxsize=64)
def momentum(l: int) -> NDArray[np.complex128]:
    """Return the eigenvectors of Jy in the basis of Jz, eigenvalues ascending from -l: <m + 1|Jy|m> = -i c_m / 2."""
    m = np.arange(-l, l + 1)
    raised = np.sqrt(l * (l + 1) - m[:-1] * (m[:-1] + 1.0)) / 2
    value, vector = np.linalg.eigh(np.diag(-1j * raised, -1) + np.diag(1j * raised, 1))
    assert np.allclose(value, m, rtol=0, atol=1e-10)
    return vector


def wigner(l: int, alpha: float, beta: float, gamma: float) -> NDArray[np.float64]:
    """Return D of the real harmonics of band l from the angular momentum operators: exp(-i a Jz) exp(-i b Jy) ...

    <m'|D|m> = e^(-i a m') d_m'm(b) e^(-i c m), with d from the eigenvectors of the Hermitian Jy, stable for every l. A
    function's coefficients transform by D, complex; U takes complex to real coefficients: a real function with real
    coefficients r has c_lm = (r_m - i r_-m) / sqrt(2) and c_l-m = (-1)^m conj(c_lm).
    """
    m = np.arange(-l, l + 1)
    vector = momentum(l)
    d = (vector * np.exp(-1j * beta * m)) @ vector.conj().T
    D = np.exp(-1j * alpha * m)[:, None] * d * np.exp(-1j * gamma * m)
    U = np.zeros((2 * l + 1, 2 * l + 1), complex)  # c = U r
    U[l, l] = 1
    for q in range(1, l + 1):
        U[l + q, [l + q, l - q]] = np.array([1, -1j]) / np.sqrt(2)
        U[l - q, [l + q, l - q]] = (-1) ** q * np.array([1, 1j]) / np.sqrt(2)
    real = U.conj().T @ D @ U
    assert np.abs(real.imag).max() < 1e-12
    return real.real


TILTED = [(0.4, 1.1, -2.0), (3.0, 2.9, 0.2), (0.0, np.pi / 2, 0.0)]
AT_POLES = [(0.3, 0.0, 1.2), (0.0, 0.0, 0.0), (0.5, np.pi, 1.0)]
NEAR_POLES = [(1.0, 1e-4, np.pi), (1.0, 1e-9, 2.0), (1.0, 1e-16, 2.0), (2.0, np.pi - 1e-7, -0.7)]


@pytest.mark.parametrize("angles", TILTED + AT_POLES + NEAR_POLES)
def test_every_band_to_30_turns_by_wigners_matrix(angles: tuple[float, float, float]) -> None:
    """To 1e-12, at and near the poles too, where a and c are not known apart."""
    matrix = Rotation.from_euler("ZYZ", angles).as_matrix()
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(5, 31**2))
    got = rotate(vectors, matrix)
    for l in range(31):
        band = slice(l * l, (l + 1) ** 2)
        expected = vectors[:, band] @ wigner(l, *angles).T
        assert np.abs(got[:, band] - expected).max() < 1e-12 * np.linalg.norm(vectors[:, band], axis=1).max()


def test_a_turned_vector_is_the_turned_function() -> None:
    """f(R^-1 s), for random rotations in one batch, a rotation and its inverse in turn, and one light for all."""
    rng = np.random.default_rng(1)
    rotations = Rotation.random(50, rng).as_matrix()
    vectors, s = rng.normal(size=(50, 36)), uniform(50, rng)
    got = np.einsum("vk,kv->v", rotate(vectors, rotations), basis(5, s))
    back = np.einsum("vji,vj->vi", rotations, s)
    assert np.allclose(got, np.einsum("vk,kv->v", vectors, basis(5, back)), rtol=0, atol=1e-12)
    assert np.allclose(rotate(rotate(vectors, rotations), rotations.transpose(0, 2, 1)), vectors, rtol=0, atol=1e-13)
    light = rng.normal(size=(3, 36))
    spread = rotate(light, rotations[:, None])
    assert spread.shape == (50, 3, 36)
    assert np.allclose(spread[:, 1], rotate(np.tile(light[1], (50, 1)), rotations), rtol=0, atol=1e-13)


def test_rotations_compose() -> None:
    rng = np.random.default_rng(2)
    first, second = Rotation.random(20, rng).as_matrix(), Rotation.random(20, rng).as_matrix()
    vectors = rng.normal(size=(20, 81))
    assert np.allclose(rotate(rotate(vectors, first), second), rotate(vectors, second @ first), rtol=0, atol=1e-12)


def test_single_precision_stays_single() -> None:
    """Rounding of 6e-8 over some ten products in a row, and over cosines of multiples up to l = 5."""
    rng = np.random.default_rng(3)
    rotations, vectors = Rotation.random(200, rng).as_matrix(), rng.normal(size=(200, 36))
    got = rotate(vectors.astype(np.float32), rotations)
    assert got.dtype == np.float32
    assert np.abs(got - rotate(vectors, rotations)).max() < 1e-5


def test_multiplies_are_the_papers() -> None:
    """Counted by the loops themselves; the l^2 + l + 1 entries of a quarter turn and 4 l for a turn about z add up."""
    assert {n: multiplies(n) for n in PRINTED} == PRINTED
    for n in (1, 2, 10, 20):
        assert multiplies(n) == (9 if n > 1 else 0) + sum(2 * l * l + 14 * l + 8 for l in range(2, n))


@pytest.mark.parametrize("l", [1, 2, 7, 8, 30])
def test_what_a_quarter_turn_leaves_out_is_zero(l: int) -> None:
    """The entries outside the parity pattern; and the matrix is orthogonal."""
    matrix = quarter_turn(l)
    assert np.allclose(matrix @ matrix.T, np.eye(2 * l + 1), rtol=0, atol=1e-13)
    assert np.allclose(matrix, wigner(l, -np.pi / 2, np.pi / 2, np.pi / 2), rtol=0, atol=1e-12)
    kept = l * l + l + 1
    smallest = np.sort(np.abs(matrix).ravel())[: (2 * l + 1) ** 2 - kept]
    assert smallest.max(initial=0) < 1e-13


def test_at_l_8_two_entries_happen_to_be_zero() -> None:
    """Code that skips them counts 957, not 961: four products of the two quarter turns."""
    assert np.count_nonzero(np.abs(quarter_turn(8)) > 1e-12) == 8 * 8 + 8 + 1 - 2


def test_a_turn_about_z_alone() -> None:
    t = 0.7
    vectors = np.random.default_rng(4).normal(size=(4, 25))
    got = np.stack(turned_about_z(list(vectors.T), np.cos(t), np.sin(t)), -1)
    assert np.allclose(got, rotate(vectors, Rotation.from_euler("z", t).as_matrix()), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("vectors", "rotations"), [((2, 10), (3, 3)), ((2, 0), (3, 3)), ((), (3, 3)), ((2, 9), (3, 4)), ((2, 9), (3,))]
)
def test_bad_shapes(vectors: tuple[int, ...], rotations: tuple[int, ...]) -> None:
    with pytest.raises(BadInput, match="must have shape"):
        rotate(np.zeros(vectors), np.zeros(rotations))
