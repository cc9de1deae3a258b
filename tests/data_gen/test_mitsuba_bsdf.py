"""The Mitsuba form of a material: samples follow the density (chi2), evaluation is that of the lobes in NumPy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from data_gen.lobes import GGX, CookTorrance, KajiyaKay, KajiyaKayDiffuse, Lambertian, Membrane, Microfacet, Phong
from data_gen.lobes.facets import Facets
from data_gen.materials import MATERIALS, build
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
    build(MATERIALS["lafortune-skin"]).lobes,
    build(MATERIALS["lafortune-brushedmetal"]).lobes,
    (CookTorrance(roughness=0.3, f0=(0.9, 0.5, 0.1)),),
    (GGX(roughness=0.5, f0=(0.9, 0.5, 0.1)),),
    (GGX(roughness=1.0),),
    (KajiyaKay(exponent=32),),
    (Membrane(transparency=0.3, reflectance=(0.3, 0.2, 0.1)),),
    (KajiyaKayDiffuse(reflectance=(0.3, 0.2, 0.1)), KajiyaKay(exponent=4)),
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


Chart = tuple[Callable[[Any], Any], Callable[[Any], tuple[Any, Any]]]
"""Where a direction is binned, and back: the direction at a place, and the stretch from sr to area there."""


def plain(mi: ModuleType) -> Chart:
    return lambda wo: wo, lambda place: (place, mi.Float(1))


def half_vectors(mi: ModuleType, view: np.ndarray) -> Chart:
    """Bin H about V: about L = -V the density of facets grows as 1 / H.V, and p(H) = 4 (H.V) p(L) is bounded.

    The last row of bins (L within 6 degrees of -V), in which float32 L + V cancels, is left out.
    """
    import drjit as dr

    frame, z = mi.Frame3f(mi.Vector3f(*view.tolist())), mi.Vector3f(0, 0, 1)

    def to(wo: Any) -> Any:
        half = dr.normalize(frame.to_local(wo) + z)
        return dr.select(half.z > 2 / BINS, half, mi.Vector3f(0))

    return to, lambda half: (
        frame.to_world(2 * half.z * half - z),
        dr.select(half.z > 2 / BINS, 4 * half.z, 0),
    )


def angles_to_the_tangent(mi: ModuleType) -> Chart:
    """Bin (theta, phi) about T = x, theta evenly: a fibre's density grows as 1 / sin(theta) towards T."""
    import drjit as dr

    def to(wo: Any) -> Any:
        across = dr.sqrt(wo.y * wo.y + wo.z * wo.z)
        height = 1 - 2 * dr.atan2(across, wo.x) / dr.pi
        scale = dr.sqrt(1 - height * height) / dr.maximum(across, 1e-7)
        return mi.Vector3f(wo.y * scale, wo.z * scale, height)

    def back(place: Any) -> tuple[Any, Any]:
        theta = dr.pi / 2 * (1 - place.z)
        scale = dr.sin(theta) / dr.maximum(dr.sqrt(place.x * place.x + place.y * place.y), 1e-7)
        return mi.Vector3f(dr.cos(theta), place.x * scale, place.y * scale), dr.sin(theta) * dr.pi / 2

    return to, back


@pytest.mark.parametrize("angle", VIEWS)
@pytest.mark.parametrize("lobes", LOBES, ids=lambda lobes: " ".join(f"{x}"[:40] for x in lobes))
def test_samples_follow_the_density(mi: ModuleType, lobes: tuple[Lobe, ...], angle: float) -> None:
    """Pearson's test over bins of L, or of what L is mapped to where no grid of bins could integrate the density."""
    import drjit as dr
    from mitsuba.chi2 import ChiSquareTest, SphericalDomain

    plugin = bsdf(Material("test", lobes))
    view, context = from_angles(angle, 0.7), mi.BSDFContext()
    to, back = plain(mi)
    if angle == GRAZING and any(isinstance(lobe, Microfacet | Facets) for lobe in lobes):
        to, back = half_vectors(mi, view)
    if any(isinstance(lobe, KajiyaKay) for lobe in lobes):
        to, back = angles_to_the_tangent(mi)

    def sample(u: Any) -> tuple[Any, Any]:
        drawn, _ = plugin.sample(context, interaction(mi, view, dr.width(u)), u[0], mi.Point2f(u[1], u[2]))
        place = to(drawn.wo)
        return place, dr.select((drawn.pdf > 0) & (dr.dot(place, place) > 0.5), mi.Float(1), mi.Float(0))

    def density(place: Any) -> Any:
        wo, stretch = back(place)
        return plugin.pdf(context, interaction(mi, view, dr.width(wo)), wo) * stretch

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
        mirrored = 2 * view[2] * normal - view
        centres = {Centre.NORMAL: normal, Centre.REFLECTION: mirrored, Centre.TANGENT: np.eye(3)[0]}
        expected += np.stack(lobe.evaluate(light, view, centres[lobe.centre], normal))
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


def test_ggx_is_that_of_mitsuba(mi: ModuleType) -> None:
    """Mitsuba's `roughconductor` without its Fresnel term; its G is that of L times that of V (Walter et al. 2007)."""
    lobe = GGX(roughness=0.6, f0=(1.0, 1.0, 1.0))
    plugin = mi.load_dict({"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": lobe.alpha})
    view = from_angles(1.1, 0.7)
    light = uniform(4096, np.random.default_rng(0)).T
    theirs = plugin.eval(mi.BSDFContext(), interaction(mi, view, 4096), mi.Vector3f(light.astype(np.float32))).numpy()
    centre = np.array([-view[0], -view[1], view[2]])
    mine = lobe.evaluate(light, view, centre, np.array([0.0, 0.0, 1.0]))[0]

    def hidden(cosine: np.ndarray | float) -> np.ndarray:  # Lambda of Smith's G1 = 1 / (1 + Lambda)
        return (np.sqrt(1 + lobe.alpha**2 * (1 / np.square(cosine) - 1)) - 1) / 2

    a, b = hidden(light[2]), hidden(view[2])
    uncorrelated = mine * (1 + a + b) / ((1 + a) * (1 + b))
    assert theirs[0] == pytest.approx(uncorrelated, rel=1e-3, abs=1e-5 * mine.max())


def test_beckmann_is_that_of_mitsuba(mi: ModuleType) -> None:
    """D by Mitsuba's `MicrofacetDistribution`, with F and G as printed."""
    lobe = CookTorrance(roughness=0.4, f0=(0.9, 0.5, 0.1))
    view, normal = from_angles(1.1, 0.7), np.array([0.0, 0.0, 1.0])
    light = uniform(4096, np.random.default_rng(0)).T
    light[2] = np.abs(light[2])
    half = light + view[:, None]
    half /= np.linalg.norm(half, axis=0)
    normals = mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, lobe.roughness).eval(mi.Vector3f(half)).numpy()
    cosine = view @ half
    grooves = np.minimum(1, np.minimum(2 * half[2] * view[2] / cosine, 2 * half[2] * light[2] / cosine))
    for value, f0 in zip(lobe.evaluate(light, view, normal * 2 * view[2] - view, normal), lobe.f0, strict=True):
        fresnel = f0 + (1 - f0) * (1 - cosine) ** 5
        exact = normals * fresnel * grooves / (4 * view[2])
        assert value == pytest.approx(exact, rel=1e-3, abs=1e-5 * exact.max())
