"""Sums of lobes: what they mean, and that turning them turns what they mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from envbench.directions import from_angles, uniform
from envbench.errors import BadInput
from envbench.real_harmonics import basis
from methods.ldprt.lobes import Lobes, stored_directly


def random_lobes(points: int, count: int, n: int, seed: int = 0) -> Lobes:
    rng = np.random.default_rng(seed)
    d = stored_directly(count)
    g = rng.normal(size=(points, count, n))
    g[:, :, : int(np.sqrt(d))] = 0
    return Lobes(uniform(points * count, rng).reshape(points, count, 3), g, rng.normal(size=(points, d)))


@pytest.mark.parametrize(("count", "n"), [(1, 3), (2, 6), (3, 6), (4, 4)])
def test_turning_lobes_turns_their_function(count: int, n: int) -> None:
    """f(R^-1 s), projected by a quadrature that is exact for products of two functions of degree < n."""
    lobes = random_lobes(5, count, n)
    turn = Rotation.random(5, rng=1).as_matrix()
    z, weight = np.polynomial.legendre.leggauss(n)
    phi = 2 * np.pi * np.arange(2 * n) / (2 * n)
    s = from_angles(np.arccos(z)[:, None], phi).reshape(-1, 3)
    w = np.repeat(weight, 2 * n) * np.pi / n
    got = lobes.rotated(turn).vectors()
    for point, t in enumerate(lobes.vectors()):
        turned = t @ basis(n - 1, s @ turn[point])  # R^-1 s = R^T s, as rows
        assert np.allclose(got[point], basis(n - 1, s) @ (w * turned), atol=1e-12)


def test_a_lobe_is_symmetric_about_its_axis() -> None:
    """Seen along the axis, g*_l scales y_l0: t . y(s) = sum_l g*_l (2 l + 1) / (4 pi) P_l(s.axis)."""
    lobes = random_lobes(4, 1, 6)
    s = uniform(50, np.random.default_rng(2))
    cosine = s @ lobes.axes[:, 0].T
    l = np.arange(6)
    g = lobes.coefficients[:, 0] * (2 * l + 1) / (4 * np.pi)
    wanted = np.einsum("kvl,vl->vk", np.polynomial.legendre.legvander(cosine, 5), g)
    wanted += lobes.direct * np.sqrt(1 / (4 * np.pi))
    assert np.allclose(lobes.vectors() @ basis(5, s), wanted, atol=1e-12)


def test_opposite_lobes_are_one() -> None:
    """Negating the axis and the coefficients of odd l changes nothing (sec. 3.1)."""
    lobes = random_lobes(3, 4, 6)
    odd = (-1.0) ** np.arange(6)
    other = replace(lobes, axes=-lobes.axes, coefficients=lobes.coefficients * odd)
    assert np.allclose(lobes.vectors(), other.vectors(), atol=1e-13)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": np.zeros((2, 3))}, r"axes must have shape \(V, N, 3\)"),
        ({"axes": np.full((2, 3, 3), 0.5)}, "axes must be unit vectors"),
        ({"axes": np.full((2, 3, 3), np.nan)}, "axes must be finite. Got NaN or infinity at point 0"),
        ({"coefficients": np.zeros((2, 4, 6))}, r"coefficients must have shape \(2, 3, n\)"),
        ({"coefficients": np.ones((2, 3, 6))}, "zero in the bands stored directly"),
        ({"coefficients": np.zeros((2, 3, 1))}, "4 direct terms need n >= 2. Got 1"),
        ({"coefficients": np.zeros((2, 3, 21))}, r"n in \[1, 20\]. Got 441"),
        ({"direct": np.zeros((2, 3))}, r"direct terms must have shape \(2, 1 or 4\)"),
    ],
)
def test_what_is_no_lobe_set_is_refused(change: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        replace(random_lobes(2, 3, 6), **change)


def test_rotations_of_other_points_are_refused() -> None:
    with pytest.raises(BadInput, match=r"must have shape \(2, 3, 3\). Got \(3, 3\)"):
        random_lobes(2, 3, 6).rotated(np.eye(3))
