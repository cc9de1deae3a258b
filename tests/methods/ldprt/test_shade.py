"""Shading kernels against SH vectors summed slowly in double precision, with SciPy's rotations."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from envbench.directions import uniform
from envbench.errors import BadInput
from envbench.real_harmonics import basis
from methods.ldprt import shade, table
from methods.ldprt.rotation import rotate
from methods.ldprt.shade import Packed, Turning, pack

V = 60
SINGLE = 2e-6
"""Rounding of 6e-8, over sums of some 36 N terms of either sign; relative to their lengths."""


@dataclass(frozen=True)
class Case:
    """Random lobes, their SH vectors (V, J, n^2), and what turns them."""

    axes: np.ndarray
    coefficients: np.ndarray
    direct: np.ndarray
    rotations: np.ndarray
    light: np.ndarray

    @property
    def n(self) -> int:
        return self.coefficients.shape[-1]

    @property
    def packed(self) -> Packed:
        return pack(self.axes, self.coefficients, self.direct)

    @property
    def rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self.axes.ndim == 4:
            return self.axes, self.coefficients, self.direct
        return self.axes[:, None], self.coefficients[:, None], self.direct[:, None]

    def vectors(self) -> np.ndarray:
        """Eq. 7, and the direct terms."""
        axes, g, direct = self.rows
        y = np.moveaxis(basis(self.n - 1, axes.reshape(-1, 3)).reshape(-1, *axes.shape[:3]), 0, -1)
        band = np.repeat(np.arange(self.n), 2 * np.arange(self.n) + 1)
        out = np.sum(y * g[..., band], axis=2)
        out[..., : direct.shape[-1]] += direct
        return out

    def radiance(self) -> np.ndarray:
        """(V, J, 3), every vector turned in double precision."""
        return rotate(self.vectors(), self.rotations[:, None]) @ self.light

    def scale(self) -> float:
        _, g, direct = self.rows
        return float((np.abs(g).sum((-1, -2)).max() + np.abs(direct).sum(-1).max()) * np.linalg.norm(self.light))


def case(n: int, lobes: int, direct: int, rows: int | None = None, seed: int = 0) -> Case:
    rng = np.random.default_rng(seed)
    lead = (V,) if rows is None else (V, rows)
    axes = uniform(int(np.prod(lead)) * lobes, rng).reshape(*lead, lobes, 3)
    g = rng.normal(size=(*lead, lobes, n))
    g[..., : int(np.sqrt(direct))] = 0
    e = rng.normal(size=(n * n, 3))
    return Case(axes, g, rng.normal(size=(*lead, direct)), Rotation.random(V, rng).as_matrix(), e)


CASES = [(3, 1, 1), (6, 1, 1), (6, 2, 1), (4, 3, 4), (6, 4, 4), (1, 1, 1), (2, 3, 4), (9, 2, 4)]


@pytest.mark.parametrize(("n", "lobes", "direct"), CASES)
def test_equation_13_is_the_turned_vector_times_light(n: int, lobes: int, direct: int) -> None:
    given = case(n, lobes, direct)
    got = shade.evaluated(given.packed, given.light, given.rotations)
    assert got.shape == (V, 3)
    assert np.abs(got - given.radiance()[:, 0]).max() < SINGLE * given.scale()


@pytest.mark.parametrize(("n", "lobes", "direct"), CASES)
def test_the_table_is_off_by_its_interpolation_alone(n: int, lobes: int, direct: int) -> None:
    """Eq. 25: what the kernel reads is the map's own bilinear function; and below the stated bound from eq. 13."""
    given = case(n, lobes, direct)
    axes, g, _ = given.rows
    size = (32, 64)
    made = table.build(given.light, n, size)
    got = shade.specialised(given.packed, given.light, made, given.rotations)
    turned = np.einsum("vab,vjib->vjia", given.rotations, axes)
    held = np.einsum("vjil,vjilc->vc", g, table.interpolate(made, turned))
    without = Case(given.axes, 0 * given.coefficients, given.direct, given.rotations, given.light)
    assert np.abs(got - held - without.radiance()[:, 0]).max() < 3 * SINGLE * given.scale()

    bound = np.abs(g).sum((1, 2)) @ table.largest_error(given.light, size)
    assert np.all(np.abs(got - given.radiance()[:, 0]) <= bound + SINGLE * given.scale())


def test_expected_error_of_a_shaded_point() -> None:
    """Lobes with independent random coefficients: mean squares of the bands add, times the sum of <g_l^2>; to 10 %."""
    found, expected = [], []
    for seed in range(8):
        given = case(6, 4, 4, seed=seed)
        got = shade.specialised(given.packed, given.light, table.build(given.light, 6), given.rotations)
        found.append(np.mean((got - shade.evaluated(given.packed, given.light, given.rotations)) ** 2))
        power = np.mean(given.coefficients**2, 0).sum(0)
        expected.append(np.mean(power @ table.expected_error(given.light) ** 2))
    assert np.sqrt(np.mean(found) / np.mean(expected)) == pytest.approx(1, abs=0.1)


def test_without_rotation_the_identity_is_meant() -> None:
    given = case(6, 4, 4)
    identity = np.tile(np.eye(3), (V, 1, 1))
    made = table.build(given.light, 6)
    for turned, still in (
        (shade.evaluated(given.packed, given.light, identity), shade.evaluated(given.packed, given.light)),
        (
            shade.specialised(given.packed, given.light, made, identity),
            shade.specialised(given.packed, given.light, made),
        ),
        (shade.full(given.vectors()[:, 0], given.light, identity), shade.static(given.vectors()[:, 0], given.light)),
    ):
        assert np.abs(turned - still).max() < SINGLE * given.scale()


@pytest.mark.parametrize("turning", list(Turning))
@pytest.mark.parametrize("n", [1, 2, 6, 8])
def test_full_rotation_is_exact(n: int, turning: Turning) -> None:
    """The light turned back and transfer turned forth are the same scalar."""
    rng = np.random.default_rng(n)
    transfer, light = rng.normal(size=(V, n * n)), rng.normal(size=(n * n, 3))
    rotations = Rotation.random(V, rng).as_matrix()
    got = shade.full(transfer, light, rotations, turning)
    scale = np.linalg.norm(transfer, axis=1).max() * np.linalg.norm(light)
    assert np.abs(got - rotate(transfer, rotations) @ light).max() < 3 * SINGLE * scale
    back = rotate(light.T, rotations.transpose(0, 2, 1)[:, None])
    assert np.abs(got - np.einsum("vk,vck->vc", transfer, back)).max() < 3 * SINGLE * scale


def test_static_transfer_is_a_product() -> None:
    """And of constant light 1, unshadowed diffuse transfer makes 1: g_0 = 1 about any normal."""
    normals = uniform(V, np.random.default_rng(0))
    transfer = basis(2, normals).T * np.repeat([1, 2 / 3, 1 / 4], [1, 3, 5])
    constant = np.zeros((9, 3))
    constant[0] = np.sqrt(4 * np.pi)
    assert np.allclose(shade.static(transfer, constant), 1, rtol=0, atol=1e-6)


@pytest.mark.parametrize(("n", "lobes", "direct"), [(3, 1, 1), (6, 4, 4)])
def test_a_light_of_each_points_own(n: int, lobes: int, direct: int) -> None:
    """Evaluated, exact; from tables of the harmonics, off by their interpolation: bounded as the light's own table."""
    given = case(n, lobes, direct)
    lights = np.random.default_rng(5).normal(size=(V, n * n, 3))
    exact = np.einsum("vk,vkc->vc", rotate(given.vectors()[:, 0], given.rotations), lights)
    scale = given.scale() * np.linalg.norm(lights, axis=1).max() / np.linalg.norm(given.light)
    assert np.abs(shade.evaluated(given.packed, lights, given.rotations) - exact).max() < SINGLE * scale
    y = table.harmonics(n)
    got = shade.locally(given.packed, lights, y, given.rotations)
    bound = np.stack([
        np.abs(g).sum(0) @ table.largest_error(own) for g, own in zip(given.coefficients, lights, strict=True)
    ])  # fmt: skip
    assert np.all(np.abs(got - exact) <= bound + SINGLE * scale)
    assert np.abs(got - exact).max() > 1e-4  # it is a table

    one = shade.locally(given.packed, given.light, y, given.rotations)
    made = table.build(given.light, n)
    assert np.abs(one - shade.specialised(given.packed, given.light, made, given.rotations)).max() < 1e-6 * scale


def test_rows_are_weighed_by_view_factors() -> None:
    """Eq. 16, with three rows of three lobes, in every kernel."""
    given = case(4, 3, 4, rows=3)
    u = np.random.default_rng(1).normal(size=(V, 3))
    exact = np.einsum("vj,vjc->vc", u, given.radiance())
    made, scale = table.build(given.light, 4), 3 * np.abs(u).max() * given.scale()
    assert np.abs(shade.evaluated(given.packed, given.light, given.rotations, u) - exact).max() < SINGLE * scale
    got = shade.specialised(given.packed, given.light, made, given.rotations, u)
    local = shade.locally(given.packed, given.light, table.harmonics(4), given.rotations, u)
    assert np.abs(got - local).max() < SINGLE * scale
    assert np.sqrt(np.mean((got - exact) ** 2)) < 0.02 * exact.std()
    coloured = u[..., None] * [1.0, -2.0, 0.5]
    each = shade.evaluated(given.packed, given.light, given.rotations, coloured)
    assert np.abs(each - exact * [1.0, -2.0, 0.5]).max() < 2 * SINGLE * scale
    summed = shade.evaluated(given.packed, given.light, given.rotations)
    assert np.abs(summed - given.radiance().sum(1)).max() < SINGLE * scale


def test_what_is_packed_can_be_pickled_and_no_points_are_no_radiance() -> None:
    given = case(6, 4, 4)
    again = pickle.loads(pickle.dumps(given.packed))
    assert np.array_equal(shade.evaluated(again, given.light), shade.evaluated(given.packed, given.light))
    none = pack(given.axes[:0], given.coefficients[:0], given.direct[:0])
    made = table.build(given.light, 6)
    assert shade.specialised(none, given.light, made, given.rotations[:0]).shape == (0, 3)
    assert shade.full(np.zeros((0, 36)), given.light, given.rotations[:0]).shape == (0, 3)


def test_a_broken_rotation_spoils_its_own_point_alone() -> None:
    """Where a pose is not finite, nor is the result: no lookup outside the map, and the others as before."""
    given = case(6, 4, 4)
    broken = given.rotations.copy()
    broken[7], broken[9] = np.nan, np.inf
    made, others = table.build(given.light, 6), np.delete(np.arange(V), [7, 9])
    for render in (
        lambda turn: shade.specialised(given.packed, given.light, made, turn),
        lambda turn: shade.evaluated(given.packed, given.light, turn),
        lambda turn: shade.locally(given.packed, given.light, table.harmonics(6), turn),
    ):
        got = render(broken)
        assert not np.any(np.isfinite(got[[7, 9]]))
        assert np.array_equal(got[others], render(given.rotations)[others])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": np.zeros((V, 3, 3))}, "must have axes"),
        ({"direct": np.zeros((V, 2))}, "must be 1 or 4 in number"),
        ({"coefficients": np.ones((V, 4, 6))}, "must be zero"),
    ],
)
def test_lobes_that_do_not_fit(change: dict[str, np.ndarray], message: str) -> None:
    given = case(6, 4, 4)
    parts = {"axes": given.axes, "coefficients": given.coefficients, "direct": given.direct} | change
    with pytest.raises(BadInput, match=message):
        pack(**parts)


def test_arrays_that_do_not_fit() -> None:
    given = case(6, 4, 4)
    lobes, light, made = given.packed, given.light, table.build(given.light, 6)
    with pytest.raises(BadInput, match="rotations of 60 points"):
        shade.evaluated(lobes, light, given.rotations[:5])
    with pytest.raises(BadInput, match="lights of 60 points"):
        shade.evaluated(lobes, np.zeros((5, 36, 3)))
    with pytest.raises(BadInput, match=r"light of order 6 must have shape \(36, 3\)"):
        shade.evaluated(lobes, light[:25])
    with pytest.raises(BadInput, match="table must have shape"):
        shade.specialised(lobes, light, made[:, :, :5])
    with pytest.raises(BadInput, match="table must have shape"):
        shade.locally(lobes, light, table.harmonics(5))
    with pytest.raises(BadInput, match="view factors"):
        shade.evaluated(lobes, light, factors=np.ones((V, 2)))
    with pytest.raises(BadInput, match=r"needs a light"):
        shade.static(np.zeros((V, 36)), light[:25])
    with pytest.raises(BadInput, match=r"transfer must have shape"):
        shade.full(np.zeros((V, 35)), light, given.rotations)
