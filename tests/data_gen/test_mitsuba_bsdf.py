"""The Mitsuba form of a material: samples follow the density (chi2), evaluation is that of the lobes in NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from data_gen.lobes import Lambertian, Microfacet, Phong
from data_gen.mitsuba_bsdf import bsdf
from envbench.directions import from_angles, uniform
from envbench.material import Centre, Lobe, Material

GRAZING = 1.5
LOBES: list[tuple[Lobe, ...]] = [
    (Lambertian(reflectance=(0.2, 0.5, 0.8)),),
    (Phong(exponent=8),),
    (Phong(exponent=8, clipped=False),),
    (Phong(exponent=200, clipped=False),),
    (Microfacet(sigma=0.2),),
    (Microfacet(sigma=0.2, clipped=False),),
    (Microfacet(sigma=0.6, clipped=False),),
    (Lambertian(reflectance=(0.1, 0.2, 0.3)), Phong(exponent=30), Microfacet(sigma=0.3, clipped=False)),
]
VIEWS = [0.0, 0.9, GRAZING]
BINS = 40
LEVEL = 1e-3
"""Chance that the whole set of chi2 tests fails although all is well (Sidak, within the test)."""


@pytest.fixture
def scalar(mi: ModuleType) -> Iterator[ModuleType]:
    mi.set_variant("scalar_rgb")
    yield mi
    mi.set_variant("llvm_ad_rgb")


def interaction(mi: ModuleType, view: np.ndarray, count: int) -> Any:
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f(*view.tolist())
    return si


@pytest.mark.parametrize("angle", VIEWS)
@pytest.mark.parametrize("lobes", LOBES, ids=lambda lobes: " ".join(f"{x}"[:40] for x in lobes))
def test_samples_follow_the_density(mi: ModuleType, lobes: tuple[Lobe, ...], angle: float) -> None:
    """Pearson's test over bins of L.

    About L = -V the microfacet density grows as 1 / H.V, which no grid of bins can integrate where the view grazes. The
    bins are then those of H about V, since p(H) = 4 (H.V) p(L) is bounded, without the last row of them (L within 6
    degrees of -V), in which float32 L + V cancels.
    """
    import drjit as dr
    from mitsuba.chi2 import ChiSquareTest, SphericalDomain

    plugin = bsdf(Material("test", lobes))
    view, context = from_angles(angle, 0.7), mi.BSDFContext()

    frame = mi.Frame3f(mi.Vector3f(*view.tolist()))
    halfway = angle == GRAZING and any(isinstance(lobe, Microfacet) for lobe in lobes)

    def sample(u: Any) -> tuple[Any, Any]:
        drawn, _ = plugin.sample(context, interaction(mi, view, dr.width(u)), u[0], mi.Point2f(u[1], u[2]))
        half = dr.normalize(frame.to_local(drawn.wo) + mi.Vector3f(0, 0, 1))
        kept = (drawn.pdf > 0) & ((half.z > 2 / BINS) | ~mi.Bool(halfway))
        return half if halfway else drawn.wo, dr.select(kept, mi.Float(1), mi.Float(0))

    def density(direction: Any) -> Any:
        wo = frame.to_world(2 * direction.z * direction - mi.Vector3f(0, 0, 1)) if halfway else direction
        pdf = plugin.pdf(context, interaction(mi, view, dr.width(wo)), wo)
        return dr.select(direction.z > 2 / BINS, 4 * direction.z * pdf, 0) if halfway else pdf

    # 32 nodes a bin leave a jump at the horizon about a 64th of one bin.
    domain = SphericalDomain()
    test = ChiSquareTest(domain, sample, density, sample_dim=3, sample_count=200_000, res=BINS, ires=32)
    assert test.run(LEVEL, test_count=len(LOBES) * len(VIEWS), quiet=True), test.messages


@pytest.mark.parametrize("angle", VIEWS)
@pytest.mark.parametrize("lobes", LOBES, ids=lambda lobes: " ".join(f"{x}"[:40] for x in lobes))
def test_evaluation_is_that_of_the_lobes(mi: ModuleType, lobes: tuple[Lobe, ...], angle: float) -> None:
    view, normal = from_angles(angle, 0.7), np.array([0.0, 0.0, 1.0])
    light = uniform(4096, np.random.default_rng(0)).T
    expected = np.zeros((3, light.shape[1]))
    for lobe in lobes:
        centre = normal if lobe.centre is Centre.NORMAL else 2 * view[2] * normal - view
        expected += np.stack(lobe.evaluate(light, view, centre, normal))
    plugin = bsdf(Material("test", lobes))
    wo = mi.Vector3f(light.astype(np.float32))
    si, context = interaction(mi, view, light.shape[1]), mi.BSDFContext()
    value, pdf = plugin.eval_pdf(context, si, wo)
    # float32 directions are off by 6e-8, and the lobes' log-slopes reach 1 / sigma^2 = 200 and s: 1e-4 is generous
    assert value.numpy() == pytest.approx(expected, rel=1e-4, abs=1e-4 * expected.max())
    assert np.array_equal(value.numpy(), plugin.eval(context, si, wo).numpy())
    assert np.array_equal(pdf.numpy(), plugin.pdf(context, si, wo).numpy())


def test_weights_are_value_over_density(mi: ModuleType) -> None:
    plugin = bsdf(Material("test", LOBES[-1]))
    rng = np.random.default_rng(3)
    si, context = interaction(mi, from_angles(0.9, 0.7), 1000), mi.BSDFContext()
    u, v, w = (mi.Float(rng.random(1000).astype(np.float32)) for _ in range(3))
    drawn, weight = plugin.sample(context, si, u, mi.Point2f(v, w))
    value, pdf = plugin.eval_pdf(context, si, drawn.wo)
    kept = drawn.pdf.numpy() > 0
    assert kept.mean() > 0.5
    assert (weight * drawn.pdf).numpy()[:, kept] == pytest.approx(value.numpy()[:, kept], rel=1e-5)
    assert drawn.pdf.numpy()[kept] == pytest.approx(pdf.numpy()[kept], rel=1e-5)


def test_inactive_lanes_are_zero(mi: ModuleType) -> None:
    plugin = bsdf(Material("test", LOBES[0]))
    si, context = interaction(mi, from_angles(0.3, 0.7), 4), mi.BSDFContext()
    value, pdf = plugin.eval_pdf(context, si, mi.Vector3f(0, 0, 1), mi.Bool(False))
    _, weight = plugin.sample(context, si, mi.Float(0.5), mi.Point2f(0.3, 0.4), mi.Bool(False))
    assert not value.numpy().any()
    assert not pdf.numpy().any()
    assert not weight.numpy().any()


def test_scalar_variant(scalar: ModuleType) -> None:
    """A second variant in the same process gets a class of its own, and the same numbers."""
    view = from_angles(0.9, 0.7)
    lobe = Microfacet(sigma=0.3, clipped=False)
    si = scalar.SurfaceInteraction3f()
    si.wi = scalar.Vector3f(*view.tolist())
    drawn, weight = bsdf(Material("test", (lobe,))).sample(scalar.BSDFContext(), si, 0.3, scalar.Point2f(0.4, 0.2))
    light, normal = np.array(drawn.wo), np.array([0.0, 0.0, 1.0])
    centre = 2 * view[2] * normal - view
    expected = lobe.evaluate(light, view, centre, normal)[0] / lobe.density(light, view, centre, normal)
    assert np.array(weight) == pytest.approx(np.full(3, expected), rel=1e-4)
