"""Mitsuba's `envmap` against our one meaning of a lat-long map: evaluation, density and sampling."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy import stats

from data_gen.mitsuba_light import emitter
from envbench import directions
from envbench.environment import Environment

EPS = 2.0**-23
SHAPES = [(64, 128), (31, 61), (32, 61), (31, 60), (2, 4), (3, 5)]


def noise(height: int, width: int) -> Environment:
    rng = np.random.default_rng(width)
    return Environment("noise", rng.uniform(0, 1, (height, width, 3)).astype(np.float32))


def lamp(height: int, width: int, row: int, column: int) -> Environment:
    radiance = np.zeros((height, width, 3), np.float32)
    radiance[row, column] = 1e8, 2e8, 3e8
    return Environment("lamp", radiance)


LIGHTS = {
    **{f"noise {h}x{w}": noise(h, w) for h, w in SHAPES},
    "lamp at the upper pole": lamp(16, 32, 0, 5),
    "lamp at the lower pole, odd": lamp(15, 31, -1, 30),
    "lamp on the seam": lamp(16, 32, 8, 0),
    "lamp on the seam, odd": lamp(15, 31, 3, 30),
}


def vectors(mi: ModuleType, d: np.ndarray) -> Any:
    return mi.Vector3f(np.ascontiguousarray(d.T.astype(np.float32)))


def density(mi: ModuleType, light: Any, d: np.ndarray) -> np.ndarray:
    import drjit as dr

    sample = dr.zeros(mi.DirectionSample3f, len(d))
    sample.d = vectors(mi, d)
    return np.array(light.pdf_direction(dr.zeros(mi.Interaction3f, len(d)), sample), float)


def drawn(mi: ModuleType, light: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sample directions (count, 3) and their weights eval / pdf (count, 3)."""
    import drjit as dr

    u = np.random.default_rng(11).uniform(size=(2, count)).astype(np.float32)
    sample, weight = light.sample_direction(dr.zeros(mi.Interaction3f, count), mi.Point2f(u))
    return np.array(sample.d, float).T, np.array(weight, float).T


def integral(environment: Environment) -> np.ndarray:
    """Integrate over the sphere, exactly: column means (a tent's mean) times Gauss-Legendre between knots in theta."""
    radiance = environment.radiance.mean(axis=1, dtype=float)
    height = len(radiance)
    node, weight = np.polynomial.legendre.leggauss(8)
    edge = np.pi * (np.arange(height + 1)[:, None] + [-0.5, 0.5]) / height
    edge = np.clip(edge, 0, np.pi)
    theta = edge.mean(axis=1, keepdims=True) + node * np.diff(edge) / 2
    # Beyond a pole a row meets its half-turned self, whose mean is its own.
    value = np.stack([np.interp(theta, np.pi * (np.arange(height) + 0.5) / height, c) for c in radiance.T], axis=-1)
    return 2 * np.pi * (value * (np.sin(theta) * weight * np.diff(edge) / 2)[..., None]).sum((0, 1))


@pytest.mark.parametrize("name", LIGHTS)
def test_eval_is_our_function(mi: ModuleType, name: str) -> None:
    import drjit as dr

    light = LIGHTS[name]
    height, width = light.radiance.shape[:2]
    rng = np.random.default_rng(2)
    polar = np.concatenate([rng.uniform(0, 2 / height, 1000), np.pi - rng.uniform(0, 2 / height, 1000)])
    d = np.concatenate([
        directions.uniform(10_000, rng),
        directions.from_angles(polar, rng.uniform(0, 2 * np.pi, 2000)),
        directions.from_angles(rng.uniform(0, np.pi, 1000), rng.normal(0, 1 / width, 1000)),
    ]).astype(np.float32).astype(float)  # fmt: skip
    si = dr.zeros(mi.SurfaceInteraction3f, len(d))
    si.wi = -vectors(mi, d)
    error = np.abs(np.array(mi.load_dict(emitter(light)).eval(si), float).T - light(d)).max(axis=-1)

    # float32 rounding of (u, v), a few units in the last place, times the texels across; and arccos, which near a
    # pole turns a rounding of cos(theta) into one of theta by 1 / sin(theta), sqrt(2 EPS) at most.
    sine = np.maximum(np.hypot(d[:, 0], d[:, 1]), np.sqrt(2 * EPS))
    texels = 4 * EPS * (width + height) + EPS / sine * height / np.pi
    assert (error <= texels * light.radiance.max()).all()


@pytest.mark.parametrize("name", LIGHTS)
def test_sampling_is_unbiased(mi: ModuleType, name: str) -> None:
    light = LIGHTS[name]
    _, weight = drawn(mi, mi.load_dict(emitter(light)), 200_000)
    assert np.isfinite(weight).all()
    error = weight.std(axis=0) / np.sqrt(len(weight))
    # p = 1e-5 for each of 30 means; float32 weights add 1e-5 of the mean.
    expected = integral(light)
    assert (np.abs(weight.mean(axis=0) - expected) <= stats.norm.isf(5e-6) * error + 1e-5 * expected).all()


@pytest.mark.parametrize(
    "name", ["noise 2x4", "noise 3x5", "noise 31x61", "lamp at the upper pole", "lamp on the seam, odd"]
)
def test_samples_follow_the_density(mi: ModuleType, name: str) -> None:
    # Density over 16 x 32 bins by midpoints, 32 x 32 a bin: 3e-3 of a bin's share suffices for 50,000 samples.
    light = mi.load_dict(emitter(LIGHTS[name]))
    rows, columns, fine, count = 16, 32, 32, 50_000
    theta = np.pi * (np.arange(rows * fine) + 0.5) / (rows * fine)
    phi = 2 * np.pi * (np.arange(columns * fine) + 0.5) / (columns * fine)
    d = directions.from_angles(theta[:, None], phi)
    pdf = density(mi, light, d.reshape(-1, 3)).reshape(d.shape[:2]) * np.sin(theta)[:, None]
    share = pdf.reshape(rows, fine, columns, fine).sum((1, 3)) * (theta[1] - theta[0]) * (phi[1] - phi[0])
    assert share.sum() == pytest.approx(1, abs=2e-3)

    at_theta, at_phi = directions.to_angles(drawn(mi, light, count)[0])
    seen, _, _ = np.histogram2d(at_theta, at_phi, (rows, columns), ((0, np.pi), (0, 2 * np.pi)))
    full = share * count > 5
    observed = np.append(seen[full], seen[~full].sum())
    expected = np.append(share[full], max(share[~full].sum(), 0)) * count
    if expected[-1] < 5:
        assert observed[-1] < 25  # a Poisson mean of 5 exceeds 24 with p = 3e-10
        observed, expected = observed[:-1], expected[:-1]
    chi2 = ((observed - expected) ** 2 / expected).sum()
    assert stats.chi2.sf(chi2, len(observed) - 1) > 1e-4


def test_black_light_samples_to_zero(mi: ModuleType) -> None:
    light = mi.load_dict(emitter(Environment("black", np.zeros((4, 8, 3), np.float32))))
    assert not drawn(mi, light, 100)[1].any()
