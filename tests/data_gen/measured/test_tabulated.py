"""Sampling of tabulated lobes: chi2 in the space of half vectors, moments, the cone, the furnace."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.stats import qmc

from data_gen.measured.tabulated import Tabulated
from data_gen.measured.tabulation import tabulate
from data_gen.mitsuba_bsdf import bsdf
from envbench.directions import from_angles
from envbench.material import Material

WIDTHS = [0.02, 0.2, 1.0]
"""Of the half vector's lobe, radians: mirror-like, glossy, cloth."""
DEGREES = [0.0, 45.0, 80.0, 89.0]
LEVEL = 1e-3
NORMAL = np.array([0.0, 0.0, 1.0])


@cache
def lobe_of(width: float) -> Tabulated:
    def f(light: np.ndarray, view: np.ndarray) -> np.ndarray:
        half = light + view
        tangent = np.hypot(half[:, 0], half[:, 1]) / half[:, 2]
        return np.outer(np.exp(-((tangent / width) ** 2)) / (np.pi * width**2), [0.25, 0.2, 0.1]) + 0.05

    return Tabulated(table=tabulate(f"width {width}", f, symmetric=True)[0])


class HalfVectors:
    """A chi2 domain of (t, phi) of H, theta_h = atan2(t^2, 1 - t^2): narrow lobes fill it."""

    def __init__(self, mi: ModuleType, view: np.ndarray) -> None:
        self.mi, self.view = mi, mi.Vector3f(*view.tolist())

    def bounds(self) -> Any:
        return self.mi.ScalarBoundingBox2f([0.0, -np.pi], [1.0, np.pi])

    def aspect(self) -> float:
        return 1.0

    def half(self, p: Any) -> Any:
        import drjit as dr

        theta = dr.atan2(p.x * p.x, 1 - p.x * p.x)
        return self.mi.Vector3f(dr.sin(theta) * dr.cos(p.y), dr.sin(theta) * dr.sin(p.y), dr.cos(theta))

    def map_forward(self, p: Any) -> Any:
        import drjit as dr

        half = self.half(p)
        return 2 * dr.dot(half, self.view) * half - self.view

    def map_backward(self, light: Any) -> Any:
        import drjit as dr

        half = dr.normalize(light + self.view)
        sine = dr.sqrt(half.x * half.x + half.y * half.y)
        return self.mi.Point2f(dr.sqrt(sine / (sine + half.z)), dr.atan2(half.y, half.x))

    def jacobian(self, light: Any) -> Any:
        """dL / (dt dphi) = 4 (H.V) sin theta dtheta/dt; 0 for H beyond V."""
        import drjit as dr

        half = dr.normalize(light + self.view)
        t = self.map_backward(light).x
        slope = 2 * t / ((1 - t * t) ** 2 + t**4)
        sine = dr.sqrt(half.x * half.x + half.y * half.y)
        return dr.select(half.z > 0, 4 * dr.dot(half, self.view) * sine * slope, 0)


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("width", WIDTHS)
def test_samples_follow_the_density(mi: ModuleType, width: float, degrees: float) -> None:
    import drjit as dr
    from mitsuba.chi2 import ChiSquareTest

    view = from_angles(np.deg2rad(degrees), 0.7)
    plugin, context, domain = bsdf(Material("test", (lobe_of(width),))), mi.BSDFContext(), HalfVectors(mi, view)

    def interaction(count: int) -> Any:
        si = dr.zeros(mi.SurfaceInteraction3f, count)
        si.wi = mi.Vector3f(*view.tolist())
        return si

    def sample(u: Any) -> tuple[Any, Any]:
        drawn, _ = plugin.sample(context, interaction(dr.width(u)), u[0], mi.Point2f(u[1], u[2]))
        return drawn.wo, dr.select(drawn.pdf > 0, mi.Float(1), mi.Float(0))

    def density(light: Any) -> Any:
        return plugin.pdf(context, interaction(dr.width(light)), light) * domain.jacobian(light)

    test = ChiSquareTest(domain, sample, density, sample_dim=3, sample_count=200_000, res=32, ires=64)
    test._dump_tables = lambda: None  # leave no file behind
    assert test.run(LEVEL, test_count=len(WIDTHS) * len(DEGREES), quiet=True), test.messages


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("width", WIDTHS)
def test_weights_integrate_to_the_quadrature(width: float, degrees: float) -> None:
    """Mean of value / density against a rule over H, and no weight far beyond the albedo: low noise."""
    lobe, n = lobe_of(width), 1 << 14
    view = np.broadcast_to(from_angles(np.deg2rad(degrees), 0.0)[:, None], (3, n))
    normal = np.broadcast_to(NORMAL[:, None], view.shape)
    u = qmc.Sobol(2, rng=np.random.default_rng(0)).random(n).T
    light = np.stack(lobe.sample((u[0], u[1]), view, view, normal))
    density = np.where((light**2).sum(0) > 0.5, lobe.density(light, view, view, normal), 0)
    value = lobe.evaluate(light, view, view, normal)[0]
    weight = np.where(density > 0, value / np.where(density > 0, density, 1), 0)

    x, w = np.polynomial.legendre.leggauss(400)
    t, w = (x + 1) / 2, w / 2
    theta = np.arctan2(t**2, 1 - t**2)[:, None]
    half = from_angles(theta, np.pi * (np.arange(256) + 0.5) / 256)
    cosine = half @ view[:, 0]
    lights = np.moveaxis(2 * cosine[..., None] * half - view[:, 0], -1, 0)
    ring = (w * 2 * t / ((1 - t**2) ** 2 + t**4))[:, None] * np.sin(theta) * 2 * np.pi / 256
    axes = (view[:, 0][:, None, None], view[:, 0][:, None, None], NORMAL[:, None, None])
    albedo = np.sum(lobe.evaluate(lights, *axes)[0] * 4 * np.maximum(cosine, 0) * ring)
    # the rule's error: its 256 azimuths against the horizon's jump in H, nearest at grazing
    assert weight.mean() == pytest.approx(albedo, rel=2 / 256)
    assert weight.std() <= 2 * albedo


@pytest.mark.parametrize("eps", [0.5, 0.1, 0.01])
@pytest.mark.parametrize("width", WIDTHS)
def test_cone_holds_what_it_says(width: float, eps: float) -> None:
    lobe, n = lobe_of(width), 1 << 13
    u = qmc.Sobol(2, rng=np.random.default_rng(1)).random(n).T
    for degrees in DEGREES:
        view = np.broadcast_to(from_angles(np.deg2rad(degrees), 0.0)[:, None], (3, n))
        normal = np.broadcast_to(NORMAL[:, None], view.shape)
        light = np.stack(lobe.sample((u[0], u[1]), view, view, normal))
        density = lobe.density(light, view, view, normal)
        weight = np.where(
            density > 0, np.sum(lobe.evaluate(light, view, view, normal), 0) / np.maximum(density, 1e-9), 0
        )
        inside = np.einsum("kn,k->n", light, view[:, 0] * [-1, -1, 1]) >= np.cos(lobe.cone(eps))
        # five standard errors of a share of n weights
        assert np.sum(weight * inside) >= (1 - eps) * np.sum(weight) - 5 * np.sqrt(np.sum(weight**2) / 4)


def test_cone_grows_with_less_eps() -> None:
    cones = [lobe_of(0.2).cone(eps) for eps in (0.9, 0.5, 0.1, 0.01, 1e-9, 1e-300)]
    assert cones == sorted(cones)
    assert 0 < cones[0] < cones[-1] <= np.pi


def test_scalar_variant(mi: ModuleType) -> None:
    view, light = from_angles(0.5, 0.0), from_angles(0.6, 3.0)
    expected = lobe_of(0.2).evaluate(light, view, view, NORMAL)
    mi.set_variant("scalar_rgb")
    try:
        import drjit as dr

        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi = mi.Vector3f(*view.tolist())
        got = bsdf(Material("test", (lobe_of(0.2),))).eval(mi.BSDFContext(), si, mi.Vector3f(*light.tolist()))
        assert np.array(got) == pytest.approx(np.array(expected), rel=1e-4)
    finally:
        mi.set_variant("llvm_ad_rgb")
