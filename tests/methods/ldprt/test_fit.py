"""Zonal fits against closed forms, finite differences, the paper's BFGS, and what random vectors can be held to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from data_gen import environments
from envbench.directions import uniform
from envbench.errors import BadInput
from envbench.real_harmonics import basis, project
from methods.irradiance import clamped_cosine
from methods.ldprt import projected
from methods.ldprt.fit import bent_normal, fit, fit_light, optimal_linear
from methods.ldprt.greedy import hemicube
from methods.ldprt.lobes import Lobes
from methods.ldprt.signal import Signal
from tests.methods.ldprt import bfgs
from tests.methods.ldprt.synthetic import random_units, transfer
from tests.methods.ldprt.test_lobes import random_lobes


def error(lobes: Lobes, vectors: np.ndarray) -> np.ndarray:
    """Return the length of each point's residual."""
    return np.linalg.norm(lobes.vectors() - vectors, axis=1)


@pytest.mark.parametrize("first", [1, 2])
@pytest.mark.parametrize("count", [1, 4])
def test_derivatives_of_the_projected_objective(count: int, first: int) -> None:
    """Central differences of step h err by h^2 of the next derivatives, and by 1e-16 / h and 1e-16 / h^2."""
    h, points = 1e-4, 3
    signal = Signal.of(random_units(points), first)
    axes = uniform(count * points, np.random.default_rng(3)).T.reshape(3, count, points).copy()
    at = projected.expand(signal, axes)

    def value(step: np.ndarray) -> np.ndarray:
        moved = axes + np.einsum("ai,akiv->kiv", step.reshape(2, count), at.tangents)
        return projected.expand(signal, moved / np.linalg.norm(moved, axis=0)).value

    unit = h * np.eye(2 * count)
    slopes = [(value(u) - value(-u)) / (2 * h) for u in unit]
    assert np.allclose(at.gradient, slopes, atol=1e-5)
    bends = [[(value(u + w) - value(u - w) - value(w - u) + value(-u - w)) / (4 * h * h) for u in unit] for w in unit]
    assert np.allclose(at.hessian, bends, atol=1e-4)


def test_gradient_of_the_paper() -> None:
    """Eqs. 19 to 21 against forward differences, whose step of 1e-7 leaves 1e-6 of a gradient of some tens."""
    rng = np.random.default_rng(0)
    psi = bfgs.Objective(random_units(1)[0, 4:], 2, 6)
    for _ in range(3):
        x = rng.normal(size=4 * 7)
        assert optimize.check_grad(lambda x: psi(x)[0], lambda x: psi(x)[1], x, epsilon=1e-7) < 1e-4


def test_projection_and_paper_mean_the_same_objective() -> None:
    """But for the ridge, which adds RIDGE (2 l + 1) / (4 pi) |g_l|^2."""
    t = random_units(1)[0]
    axes = uniform(4, np.random.default_rng(1))
    psi = bfgs.Objective(t[4:], 2, 6)
    ours = projected.expand(Signal.of(t[None], 2), axes.T[..., None].copy())
    g = ours.coefficients[..., 0].T
    ridge = projected.RIDGE * np.sum(g**2 * (2 * np.arange(2, 6) + 1)) / (4 * np.pi)
    assert 2 * ours.value[0] == pytest.approx(psi(np.concatenate([axes.ravel(), g.ravel()]))[0] + ridge, rel=1e-9)
    assert np.allclose(g, psi.solved(axes), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("lobes", [1, 2])
def test_no_worse_than_bfgs_on_transfer(lobes: int) -> None:
    """One greedy start each; the two may end in unlike minima of a point, but not on the whole."""
    vectors = transfer(40)
    paper = np.array([bfgs.fit(t, lobes)[2] for t in vectors])
    assert np.sum(error(fit(vectors, lobes, restarts=0), vectors) ** 2) <= 1.01 * paper.sum()


@pytest.mark.parametrize("vectors", [transfer(24), random_units(24)], ids=["transfer", "random"])
@pytest.mark.parametrize("lobes", [3, 4])
def test_no_worse_than_bfgs_with_restarts(lobes: int, vectors: np.ndarray) -> None:
    paper = np.array([bfgs.fit(t, lobes)[2] for t in vectors])
    assert np.sum(error(fit(vectors, lobes), vectors) ** 2) <= paper.sum()


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_what_lobes_make_lobes_give_back(count: int) -> None:
    """Axes drawn at random, n = 6. Some points keep a poorer minimum; most are found to 1e-3 of their length."""
    vectors = random_lobes(60, count, 6, seed=7).vectors()
    relative = error(fit(vectors, count, restarts=24, above=1e-3), vectors) / np.linalg.norm(vectors, axis=1)
    assert np.mean(relative < 1e-3) >= 0.85


@pytest.mark.parametrize(("lobes", "bar"), [(4, 0.25), (5, 0.03), (6, 1e-4)])
def test_random_unit_vectors(lobes: int, bar: float) -> None:
    """100 seeds, n = 6, DC and linear stored directly: 32 numbers, and six lobes have 36 unknowns."""
    vectors = random_units(100)
    assert np.median(error(fit(vectors, lobes, restarts=4), vectors)) <= bar


def test_more_lobes_are_better() -> None:
    vectors = random_units(50)
    errors = [np.sqrt(np.mean(error(fit(vectors, N, restarts=1), vectors) ** 2)) for N in range(1, 7)]
    assert np.all(np.diff(errors) < 0)


def test_one_lobe_in_closed_form() -> None:
    """Eq. 18 written out; the fitted axis beats the optimal linear one, and no axis of a fine grid beats it."""
    vectors = transfer(30)
    fitted, linear = fit(vectors, 1), optimal_linear(vectors)
    for lobes in (fitted, linear):
        y = basis(5, lobes.axes[:, 0])
        for l in range(1, 6):
            band = slice(l * l, (l + 1) ** 2)
            g = np.sum(y[band] * vectors.T[band], axis=0) / np.sum(y[band] ** 2, axis=0)
            assert np.allclose(lobes.coefficients[:, 0, l], g, atol=1e-6)  # the ridge of 1e-7
    assert np.all(error(fitted, vectors) <= error(linear, vectors) + 1e-9)
    assert error(fitted, vectors).sum() < 0.99 * error(linear, vectors).sum()
    y = basis(5, hemicube(40))
    captured = sum(
        4 * np.pi / (2 * l + 1) * (vectors[:, l * l : (l + 1) ** 2] @ y[l * l : (l + 1) ** 2]) ** 2 for l in range(1, 6)
    )
    least = np.sqrt(np.sum(vectors[:, 1:] ** 2, axis=1) - captured.max(axis=1))
    assert np.all(error(fitted, vectors) <= least + 1e-7)


def test_bent_normal_of_an_unshadowed_point_is_exact() -> None:
    """And with half of all light taken away evenly, the ambient occlusion is a half."""
    normal = uniform(8, np.random.default_rng(0))
    bands = np.repeat(clamped_cosine(5), 2 * np.arange(6) + 1)
    vectors = basis(5, normal).T * bands
    for scale in (1.0, 0.5):
        lobes = bent_normal(scale * vectors)
        assert np.allclose(lobes.axes[:, 0], normal, atol=1e-12)
        assert np.allclose(lobes.vectors(), scale * vectors, atol=1e-12)


def test_a_fitted_lobe_beats_a_bent_normal() -> None:
    vectors = transfer(100)
    assert error(optimal_linear(vectors), vectors).sum() < 0.8 * error(bent_normal(vectors), vectors).sum()


def test_light_is_fitted_a_channel_each() -> None:
    light = random_units(3).T
    lobes = fit_light(light, 6)
    assert lobes.axes.shape == (3, 6, 3)
    assert np.allclose(lobes.vectors().T, light, atol=1e-2)


@pytest.mark.parametrize("name", ["esplanade", "studio", "workshop"])
def test_captured_light_in_lobes(name: str) -> None:
    """Of its length, DC included, three lobes a channel leave .6 % (studio) to 10 % (workshop); six leave nothing."""
    light = project(environments.build({"kind": "captured", "name": name}).radiance, 5)
    residuals = [np.linalg.norm(fit_light(light, N).vectors() - light.T) for N in (1, 3, 6)]
    assert residuals[0] > residuals[1] > residuals[2]
    assert 0.004 < residuals[1] / np.linalg.norm(light) < 0.12
    assert residuals[2] < 1e-3 * np.linalg.norm(light)


def test_points_that_need_one_lobe_and_are_given_four() -> None:
    """Unshadowed points: after the first lobe nothing is left but rounding and the ridge, and nothing grows."""
    normal = np.concatenate([np.eye(3), -np.eye(3), uniform(50, np.random.default_rng(0))])
    vectors = basis(5, normal).T * np.repeat(clamped_cosine(5), 2 * np.arange(6) + 1)
    lobes = fit(vectors, 4)
    assert error(lobes, vectors).max() < 1e-5
    assert np.abs(lobes.coefficients).max() < 1


def test_points_do_not_depend_on_their_neighbours() -> None:
    vectors = random_units(30)
    whole, part = fit(vectors, 4, restarts=0), fit(vectors[7:9], 4, restarts=0)
    assert np.allclose(whole.vectors()[7:9], part.vectors(), atol=1e-8)


def test_black_and_no_points() -> None:
    black = fit(np.zeros((2, 36)), 4)
    assert not black.coefficients.any()
    assert not black.vectors().any()
    assert fit(np.empty((0, 36)), 4).axes.shape == (0, 4, 3)
    for relative in (optimal_linear, bent_normal):
        assert not relative(np.zeros((2, 36))).vectors().any()


def test_coefficients_stay_bounded_where_axes_meet() -> None:
    """y_l(s) and its derivative along a tangent: two axes that meet, with coefficients of opposite signs."""
    s, h = np.array([[0.0, 0.6, 0.8]]), 1e-4
    t = basis(5, s + np.array([h, 0, 0])) - basis(5, s)
    lobes = fit(t.T / np.linalg.norm(t), 2)
    assert error(lobes, t.T / np.linalg.norm(t))[0] < 0.02
    assert np.abs(lobes.coefficients).max() < 1e3


def test_high_orders() -> None:
    vectors = random_units(3, 20)
    assert np.all(error(fit(vectors, 8, restarts=0), vectors) < 1)


@pytest.mark.parametrize(
    ("shape", "lobes", "message"),
    [
        ((4, 36), 0, r"lobes must lie in \[1, 11\].*Got 0"),
        ((4, 36), 12, r"as many as the highest band of n = 6 holds. Got 12"),
        ((4, 35), 3, r"must hold n\^2 coefficients.*Got 35"),
        ((4, 441), 3, r"n in \[1, 20\]. Got 441"),
        ((36,), 3, r"must have shape \(V, n\^2\). Got \(36,\)"),
        ((4, 4), 3, "3 lobes need n > 2.*Got n = 2"),
        ((4, 1), 1, "1 lobes need n > 1.*Got n = 1"),
    ],
)
def test_bad_input(shape: tuple[int, ...], lobes: int, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        fit(np.ones(shape), lobes)


def test_values_that_are_not_finite_and_restarts_below_zero() -> None:
    vectors = random_units(4)
    with pytest.raises(BadInput, match=r"restarts must be at least 0. Got -1"):
        fit(vectors, 3, restarts=-1)
    vectors[2, 5] = np.nan
    with pytest.raises(BadInput, match="at point 2"):
        fit(vectors, 3)
    with pytest.raises(BadInput, match=r"must have shape \(n\^2, 3\)"):
        fit_light(vectors, 3)
