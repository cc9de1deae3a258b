"""The membrane's closed form: against numeric projection, against its lobe, and what constant light returns."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.lobes import Membrane
from envbench import real_harmonics
from envbench.directions import from_angles, uniform
from envbench.errors import BadInput
from methods.ldprt import membrane
from methods.ldprt.membrane import coefficients, transfer


def projected(order: int, alpha: float) -> np.ndarray:
    """2 pi int g(z) / pi P_l(z) dz by Gauss-Legendre on either side of the kink, exact for polynomials."""
    x, weight = np.polynomial.legendre.leggauss(order + 2)
    z, weight = (x + 1) / 2, weight / 2
    front = 2 * (weight * z) @ np.polynomial.legendre.legvander(z, order - 1)
    back = 2 * (weight * z) @ np.polynomial.legendre.legvander(-z, order - 1)
    return front + alpha * back


@pytest.mark.parametrize("alpha", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("order", [1, 2, 3, 6, 20, 40])
def test_equals_numeric_projection(order: int, alpha: float) -> None:
    np.testing.assert_allclose(coefficients(order, alpha), projected(order, alpha), rtol=0, atol=1e-12)


def test_as_printed() -> None:
    """Eq. 23, term by term, with factorials."""
    from math import factorial

    alpha, order = 0.3, 20
    printed = [
        2 / 3 * (1 - alpha) if l == 1
        else 2 * (1 + alpha) * (-1) ** (l / 2 - 1) * factorial(l) / ((l + 2) * (l - 1) * 2**l * factorial(l // 2) ** 2)
        if l % 2 == 0 else 0.0
        for l in range(order)
    ]  # fmt: skip
    np.testing.assert_allclose(coefficients(order, alpha), printed, rtol=0, atol=1e-14)


def test_constant_light_returns_one_plus_alpha() -> None:
    normals, alpha = uniform(5, np.random.default_rng(0)), np.linspace(0, 1, 5)
    light = np.zeros(36)
    light[0] = np.sqrt(4 * np.pi)
    assert transfer(normals, 6, alpha) @ light == pytest.approx(1 + alpha, abs=1e-12)


def test_is_the_projection_of_its_lobe() -> None:
    """Integrals of the lobe's value times the harmonics, by a product rule split at the horizon of N = z."""
    alpha = 0.6
    x, weight = np.polynomial.legendre.leggauss(12)
    z = np.concatenate([(x - 1) / 2, (x + 1) / 2])
    phi = 2 * np.pi * np.arange(16) / 16
    light = from_angles(np.arccos(z)[:, None], phi).reshape(-1, 3)
    rule = np.repeat(np.tile(weight / 2, 2), 16) * 2 * np.pi / 16
    normal = np.array([[0.0, 0, 1]])
    axes = [normal.T] * 3
    value = Membrane(transparency=alpha).evaluate(light.T, *axes)[0]
    expected = real_harmonics.basis(5, light) @ (rule * value)
    np.testing.assert_allclose(transfer(normal, 6, alpha)[0], expected, atol=1e-12)


@pytest.mark.parametrize(("order", "alpha"), [(0, 0.5), (3, -0.1), (3, 1.1), (3, np.nan)])
def test_refuses(order: int, alpha: float) -> None:
    with pytest.raises(BadInput, match=r"order|transparency"):
        membrane.coefficients(order, alpha)
