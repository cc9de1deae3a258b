"""Factored BRDFs against closed forms and other quadratures, and the whole chain against the integral it stands for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from data_gen.lobes import CookTorrance, KajiyaKay, Lambertian, Phong
from envbench.directions import from_angles, reflect, uniform
from envbench.errors import BadInput
from envbench.material import Centre, Lobe, Material
from envbench.real_harmonics import basis
from methods.ldprt import glossy, shade
from methods.ldprt.glossy import Factored
from methods.ldprt.rotation import rotate

COOK_TORRANCE = Material("glossy", (CookTorrance(roughness=0.3),))
Z = np.array([0.0, 0.0, 1.0])


@lru_cache(maxsize=4)
def factored(count: int) -> Factored:
    return glossy.factor(COOK_TORRANCE, 4, count)


def upper(count: int, seed: int = 0) -> np.ndarray:
    s = uniform(count, np.random.default_rng(seed))
    return s * np.where(s[:, 2:] < 0, [1, 1, -1], 1)


def test_the_square_keeps_areas() -> None:
    """2 pi / 4 everywhere, by central differences (h^2 = 1e-8), off the diagonals where the map has a crease."""
    point = np.random.default_rng(0).uniform(-0.98, 0.98, (400, 2))
    point = point[np.abs(np.abs(point[:, 0]) - np.abs(point[:, 1])) > 1e-3]
    h = 1e-4
    by_a, by_b = (
        (glossy.hemisphere(point + step) - glossy.hemisphere(point - step)) / (2 * h) for step in ([h, 0], [0, h])
    )
    assert np.allclose(np.sum(np.cross(by_a, by_b) * glossy.hemisphere(point), -1), np.pi / 2, rtol=1e-5)


def test_square_and_hemisphere_are_inverse() -> None:
    point = np.random.default_rng(1).uniform(-1, 1, (500, 2))
    special = np.array([[0, 0], [1, 1], [-1, 1], [1, -1], [-1, -1], [1, 0], [0, -1], [0.3, 0.3], [-0.2, 0.2]])
    for p in (point, special):
        s = glossy.hemisphere(p)
        assert np.allclose(np.linalg.norm(s, axis=-1), 1, rtol=0, atol=1e-14)
        # on a diagonal of the square either sector's formula may have been taken: both are the same point
        assert np.allclose(glossy.square(s), p, rtol=0, atol=1e-12)
    s = upper(500)
    assert np.allclose(glossy.hemisphere(glossy.square(s)), s, rtol=0, atol=1e-12)
    assert np.all(glossy.views(8)[..., 2] > 0)


def test_lambertian_rows_are_the_clamped_cosines() -> None:
    """B = A_l y_lm(z), A_l / pi = 1, 2/3, 1/4, 0, whatever the view; Gauss's rule is exact for polynomials."""
    B = glossy.matrix([Lambertian(reflectance=(0.2, 0.5, 1.0))], 4, upper(5), 16)
    expected = basis(3, Z) * np.repeat([1, 2 / 3, 1 / 4, 0], [1, 3, 5, 7])
    assert np.allclose(B, np.multiply.outer([0.2, 0.5, 1.0], np.tile(expected, (5, 1))), rtol=0, atol=1e-12)


def test_a_whole_phong_lobe_is_zonal_about_r() -> None:
    """B = Lambda_l y_lm(R), Lambda_l = 2 pi (s + 1) / (2 pi) int x^s P_l(x) dx over [0, 1]."""
    view = upper(12, 1)
    B = glossy.matrix([Phong(exponent=6, clipped=False)], 4, view)
    x, weight = np.polynomial.legendre.leggauss(12)
    x, weight = (x + 1) / 2, weight / 2
    zonal = 7 * (weight * x**6) @ np.polynomial.legendre.legvander(x, 3)
    expected = (basis(3, reflect(view, Z)) * np.repeat(zonal, [1, 3, 5, 7])[:, None]).T
    assert np.allclose(B, expected, rtol=0, atol=1e-5)  # the lobe's kink at a right angle, on a grid of 128 rows


@pytest.mark.parametrize("lobe", [CookTorrance(roughness=0.3), Phong(exponent=20)], ids=repr)
def test_rows_agree_with_stratified_sampling(lobe: Lobe) -> None:
    """The lobe's own draws, 512 x 512 strata jittered: weights <= 2, y <= 1, an error of some 2 / 512^1.5 = 2e-4."""
    view = upper(4, 2)
    B = glossy.matrix([lobe], 4, view)
    rng, N = np.random.default_rng(3), 512
    u = (np.stack(np.meshgrid(*2 * [np.arange(N)])).reshape(2, -1) + rng.uniform(size=(2, N * N))) / N
    for v, row in zip(view, B[0], strict=True):
        R = reflect(v, Z)
        s = np.stack(lobe.sample((u[0], u[1]), v, R, Z))
        value, density = lobe.evaluate(s, v, R, Z)[0], lobe.density(s, v, R, Z)
        weight = np.divide(value, density, out=np.zeros_like(value), where=density > 0)
        assert np.abs(basis(3, s.T) @ weight / N**2 - row).max() < 1e-3


@pytest.mark.parametrize("f0", [(1.0, 1.0, 1.0), (1.0, 0.4, 0.04)])
def test_singular_values_are_those_left_out(f0: tuple[float, float, float]) -> None:
    """The error of U Sigma V over views, channels and harmonics is `svd_error`; with all n^2 rows none is left."""
    material = Material("metal or not", (CookTorrance(roughness=0.3, f0=f0),))
    B = glossy.matrix(material.lobes, 4, glossy.views(16).reshape(-1, 3))
    errors = []
    for count in (3, 7, 16):
        made = glossy.factor(material, 4, count, 16)
        again = np.einsum("abjc,jk->cabk", made.factors, made.rows).reshape(3, -1, 16)
        assert np.sqrt(np.sum((again - B) ** 2) / np.sum(B**2)) == pytest.approx(made.svd_error, abs=1e-12)
        errors.append(made.svd_error)
    assert errors[0] > errors[1] > errors[2] == 0


def test_channels_share_their_rows() -> None:
    lobe = CookTorrance(roughness=0.3, reflectance=(1.0, 0.5, 0.1))
    coloured = glossy.factor(Material("coloured", (lobe,)), 4, 3)
    u = coloured.factors / coloured.factors[..., :1]
    assert np.allclose(u, np.broadcast_to([1.0, 0.5, 0.1], u.shape), rtol=0, atol=1e-6)
    assert coloured.svd_error == pytest.approx(factored(3).svd_error, abs=1e-12)


def radiance(view: np.ndarray, normal: np.ndarray, turn: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Integrate the BRDF about a posed normal over band-limited light by a grid of its own, about the lobe's R."""
    posed = turn @ normal
    R = reflect(view, posed)
    theta, phi = np.pi * (np.arange(400) + 0.5) / 400, 2 * np.pi * (np.arange(400) + 0.5) / 400
    local = from_angles(theta[:, None], phi[None]).reshape(-1, 3)
    s = local @ glossy.frames(R[None])[0].T
    weight = np.repeat(np.sin(theta) * np.pi / 400 * 2 * np.pi / 400, 400)
    value = COOK_TORRANCE.lobes[0].evaluate(s.T, view, R, posed)[0]
    return (value * weight) @ (basis(3, s).T @ e)


def test_the_chain_is_the_integral() -> None:
    """u(v) M' e, all rows, unshadowed and turned: off by the view map's interpolation, h^2 / 8 of second derivatives.

    A lobe of width .3 seen at 1/16 of a unit square: (1/16)^2 / 8 (l = 3: 12 to 16) = 1 %, more towards the horizon,
    where R moves twice as fast as V and the last texels are kept on: views within 70 degrees of the normal.
    """
    rng = np.random.default_rng(4)
    made, e = factored(16), rng.normal(size=(16, 3))
    count = 12
    normals, rotations = uniform(count, rng), Rotation.random(count, rng).as_matrix()
    posed = np.einsum("vab,vb->va", rotations, normals)
    local = from_angles(rng.uniform(0, 1.2, count), rng.uniform(0, 2 * np.pi, count))
    view = np.einsum("vab,vb->va", glossy.frames(posed), local)
    expected = np.stack([radiance(*given, e) for given in zip(view, normals, rotations, strict=True)])
    frames = glossy.frames(normals)
    u = glossy.view_factors(made, view, frames, rotations)
    turned = rotate(glossy.unshadowed(made.rows, frames), rotations[:, None])
    got = np.einsum("vjc,vjk,kc->vc", u, turned, e)
    assert np.sqrt(np.mean((got - expected) ** 2)) < 0.02 * np.sqrt(np.mean(expected**2))


def test_rows_as_lobes_in_the_kernel() -> None:
    """The chain through `shade`: each row held by its DC and linear terms alone, at order 2."""
    rng = np.random.default_rng(5)
    made = glossy.factor(COOK_TORRANCE, 2, 4)
    normals, rotations = uniform(40, rng), Rotation.random(40, rng).as_matrix()
    frames = glossy.frames(normals)
    M = glossy.unshadowed(made.rows, frames)
    u = glossy.view_factors(made, uniform(40, rng), frames, rotations)
    e = rng.normal(size=(4, 3))
    lobes = shade.pack(np.tile(Z, (40, 4, 1, 1)), np.zeros((40, 4, 1, 2)), M)
    expected = np.einsum("vjc,vjk,kc->vc", u, rotate(M, rotations[:, None]), e)
    assert np.allclose(shade.evaluated(lobes, e, rotations, u), expected, rtol=0, atol=1e-6)


def test_views_from_below_see_nothing() -> None:
    u = glossy.view_factors(factored(3), np.array([[0, 0, -1.0], [0, 0, 1.0]]), np.tile(np.eye(3), (2, 1, 1)))
    assert np.all(u[0] == 0)
    assert np.any(u[1] != 0)


def test_view_factors_are_bilinear_between_texels() -> None:
    """Texel centres give their own factors; halfway between two of them is the mean; in single precision."""
    made, size = factored(3), glossy.VIEW_SIZE
    flat = np.tile(np.eye(3), (size * size, 1, 1))
    at_centres = glossy.view_factors(made, glossy.views(size).reshape(-1, 3), flat).reshape(made.factors.shape)
    assert np.allclose(at_centres, made.factors, rtol=0, atol=1e-6)
    a = (2 * np.arange(size) + 1) / size - 1
    between = glossy.hemisphere(np.stack(np.meshgrid((a[1:] + a[:-1]) / 2, a), axis=-1))
    got = glossy.view_factors(made, between.reshape(-1, 3), flat[: size * (size - 1)])
    expected = (made.factors[:, 1:] + made.factors[:, :-1]) / 2
    assert np.allclose(got.reshape(expected.shape), expected, rtol=0, atol=1e-6)
    with pytest.raises(BadInput, match="need frames"):
        glossy.view_factors(made, between.reshape(-1, 3), flat)


def directions(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a product rule over the sphere, exact to degree 2 count - 1, and its weights."""
    z, weight = np.polynomial.legendre.leggauss(count)
    phi = np.pi * np.arange(2 * count) / count
    s = from_angles(np.arccos(z)[:, None], phi[None]).reshape(-1, 3)
    return s, np.repeat(weight * np.pi / count, 2 * count)


def test_with_nothing_in_the_way_rays_give_the_turned_rows() -> None:
    """The rule integrates products of two harmonics of band 3 exactly; and T of the identity is the rotation."""
    s, weight = directions(8)
    frames = glossy.frames(uniform(7, np.random.default_rng(6)))
    rows, visible = factored(3).rows, np.ones((7, len(s)), bool)
    for given in (s, np.tile(s, (7, 1, 1))):
        got = glossy.specialise(rows, frames, given, visible, weight)
        assert np.allclose(got, glossy.unshadowed(rows, frames), rtol=0, atol=1e-12 * np.abs(rows).max())
    T = glossy.specialise(np.eye(16), frames, s, visible, weight)
    assert np.allclose(T[2], rotate(np.eye(16), frames[2]), rtol=0, atol=1e-12)
    uniformly = glossy.specialise(rows, frames, s, np.zeros_like(visible))
    assert np.all(uniformly == 0)


def test_rows_under_a_shadow_are_the_product_with_transfer(monkeypatch: pytest.MonkeyPatch) -> None:
    """M' = Sigma V T with T made whole, for random visibility, directions of each point's own, and in batches."""
    rng = np.random.default_rng(7)
    frames = glossy.frames(uniform(9, rng))
    s = uniform(9 * 200, rng).reshape(9, 200, 3)
    visible = rng.uniform(size=(9, 200)) < 0.5
    T = np.einsum("vkab,vk->vab", *product(frames, s, visible))
    got = glossy.specialise(factored(3).rows, frames, s, visible)
    assert np.allclose(got, factored(3).rows @ T, rtol=0, atol=1e-10 * np.abs(factored(3).rows).max())
    monkeypatch.setattr(glossy, "_FLOATS", 200 * 19 * 2)
    assert np.allclose(glossy.specialise(factored(3).rows, frames, s, visible), got, rtol=0, atol=1e-12)


def product(frames: np.ndarray, s: np.ndarray, visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    local = np.einsum("vba,vkb->vka", frames, s)
    y, y_local = (basis(3, d.reshape(-1, 3)).T.reshape(*d.shape[:2], 16) for d in (s, local))
    return y_local[..., :, None] * y[..., None, :], visible * 4 * np.pi / s.shape[1]


def test_errors_of_rows_and_of_their_fit_are_orthogonal() -> None:
    """Against the radiance itself, over all views of the map, points and channels."""
    rng = np.random.default_rng(8)
    made = factored(16)
    rows = glossy.specialise(made.rows, glossy.frames(uniform(5, rng)), *shadow(rng))
    fitted = rows[:, :3] + 0.01 * np.abs(rows).max() * rng.normal(size=(5, 3, 16))
    e = rng.normal(size=(16, 3))
    for light in (e, None):
        found = glossy.errors(rows, 3, fitted, light)
        light = np.eye(16) if light is None else light
        whole, kept, stood_in = (
            np.einsum("abjc,vjk->abcvk", made.factors[:, :, : M.shape[1]], M @ light)
            for M in (rows, rows[:, :3], fitted)
        )
        length = np.linalg.norm(whole)
        assert np.linalg.norm(whole - kept) / length == pytest.approx(found.svd, rel=1e-9)
        assert np.linalg.norm(kept - stood_in) / length == pytest.approx(found.fit, rel=1e-9)
        assert np.linalg.norm(whole - stood_in) / length == pytest.approx(np.hypot(found.svd, found.fit), rel=1e-9)
    unshadowed = glossy.unshadowed(made.rows, glossy.frames(uniform(5, rng)))
    assert glossy.errors(unshadowed, 3).svd == pytest.approx(factored(3).svd_error, rel=1e-9)


def shadow(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    return uniform(300, rng), rng.uniform(size=(5, 300)) < 0.6


def test_what_cannot_be_factored() -> None:
    with pytest.raises(BadInput, match="isotropic BRDFs only"):
        glossy.factor(Material("hair", (KajiyaKay(exponent=32),)), 4, 3)
    with pytest.raises(BadInput, match="too narrow"):
        glossy.factor(Material("mirror", (Phong(exponent=1e5),)), 4, 3)
    with pytest.raises(BadInput, match=r"must lie in \[1, 16\]. Got 17"):
        glossy.factor(COOK_TORRANCE, 4, 17)
    with pytest.raises(BadInput, match="view maps must be"):
        glossy.factor(COOK_TORRANCE, 4, 3, 2)
    with pytest.raises(BadInput, match="rows need frames"):
        glossy.specialise(np.eye(16), np.zeros((5, 3, 3)), np.zeros((10, 3)), np.zeros((5, 9)))
    assert KajiyaKay(exponent=32).centre is Centre.TANGENT
