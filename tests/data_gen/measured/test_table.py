"""The table: coordinates and their inverse, interpolation against SciPy, Dr.Jit against NumPy, pickling."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from data_gen.measured.table import Table, coordinates, directions
from data_gen.measured.tabulated import Tabulated
from data_gen.measured.tabulation import TOLERANCE, pairs, tabulate
from envbench.directions import from_angles, uniform

NORMAL = np.array([0.0, 0.0, 1.0])


def random_table(shape: tuple[int, int, int] = (7, 5, 4), seed: int = 0) -> Table:
    return Table("random", np.random.default_rng(seed).random((*shape, 4)).astype(np.float32))


def glossy(light: np.ndarray, view: np.ndarray, width: float = 0.1) -> np.ndarray:
    """A lobe of theta_h, brighter at grazing, and a diffuse part: reciprocal and its own mirror image."""
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    tangent = np.hypot(half[:, 0], half[:, 1]) / half[:, 2]
    fresnel = 0.2 + 0.8 * (1 - np.sum(half * view, -1)) ** 5
    peak = np.exp(-((tangent / width) ** 2)) * fresnel / width**2
    return np.outer(peak, [1.0, 0.8, 0.6]) + np.array([0.05, 0.1, 0.2])


def test_coordinates_and_directions_are_inverse() -> None:
    t, d, p = np.random.default_rng(0).uniform(0.02, 0.98, (3, 5000))
    light, view = directions(t, d, p)
    up = np.minimum(light[:, 2], view[:, 2]) > 0
    assert up.mean() > 0.3
    got = np.stack(coordinates(light[up].T, view[up].T, NORMAL))
    assert got == pytest.approx(np.stack([t, d, p])[:, up], abs=1e-9)  # 1e-16 over sin theta_h sin theta_d


def test_coordinates_are_those_of_rusinkiewicz() -> None:
    """Half and difference angle by rotations, as MERL's own reader computes them."""
    light, view = pairs(256)
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    theta, phi = np.arccos(half[:, 2]), np.arctan2(half[:, 1], half[:, 0])
    x, y, z = (
        np.cos(phi) * light[:, 0] + np.sin(phi) * light[:, 1],
        np.cos(phi) * light[:, 1] - np.sin(phi) * light[:, 0],
        light[:, 2],
    )
    d = np.stack([np.cos(theta) * x - np.sin(theta) * z, y, np.sin(theta) * x + np.cos(theta) * z])
    theta_d, phi_d = np.arccos(d[2]), np.abs(np.arctan2(d[1], d[0]))
    t, dd, p = coordinates(light.T, view.T, NORMAL)
    assert np.arctan2(t**2, 1 - t**2) == pytest.approx(theta, abs=1e-7)  # arccos near 1 loses half the digits
    assert np.arctan2(1 - (1 - dd) ** 2, (1 - dd) ** 2) == pytest.approx(theta_d, abs=1e-7)
    assert np.arctan2(1 - np.abs(1 - 2 * p), 1 - 2 * p) == pytest.approx(phi_d, abs=1e-7)


def test_interpolation_is_scipys() -> None:
    table = random_table()
    where = np.random.default_rng(1).random((1000, 3))
    axes = tuple(np.linspace(0, 1, n) for n in table.values.shape[:3])
    expected = RegularGridInterpolator(axes, table.values[..., :3].astype(float))(where)
    assert np.stack(table.lookup(*where.T), -1) == pytest.approx(expected, abs=1e-6)


def test_turning_all_changes_nothing() -> None:
    light, view = pairs(512)
    table, axis = tabulate("glossy", glossy)[0], from_angles(1.1, 0.4)
    lobe = Tabulated(table=table)
    x = np.cross([0.0, 1.0, 0.0], axis)
    x /= np.linalg.norm(x)
    turn = np.stack([x, np.cross(axis, x), axis])  # rows: the axes that x, y, z turn into
    value = np.stack(lobe.evaluate(light.T, view.T, view.T, NORMAL))
    turned = np.stack(lobe.evaluate((light @ turn).T, (view @ turn).T, view.T, axis))
    assert turned == pytest.approx(value, rel=1e-9, abs=1e-9)


def test_tabulation_is_near_the_function() -> None:
    table, fidelity = tabulate("glossy", glossy)
    light, view = pairs(4000)
    got = np.stack(Tabulated(table=table).evaluate(light.T, view.T, view.T, NORMAL), -1) / light[:, 2:]
    exact = glossy(light, view)
    error = np.sqrt(np.mean((got - exact) ** 2) / np.mean(exact**2))
    assert fidelity.error <= TOLERANCE
    assert error <= 1.5 * TOLERANCE  # other pairs than those that the grid was chosen by
    assert fidelity.asymmetry < 1e-9
    assert fidelity.negative == 0


def test_mirror_images_are_averaged_and_negatives_clamped() -> None:
    def lopsided(light: np.ndarray, view: np.ndarray) -> np.ndarray:
        side = np.cross(view, light)[:, 2]
        return np.stack([1 + side, np.full(len(light), -1.0), 2 - side], -1)

    table, fidelity = tabulate("lopsided", lopsided)
    assert table.values[..., :3].reshape(-1, 3) == pytest.approx(
        np.broadcast_to([1.0, 0.0, 2.0], (table.values[..., 0].size, 3)), abs=1e-6
    )
    assert fidelity.negative == 1
    assert fidelity.lost == pytest.approx(1 / 3)
    assert fidelity.asymmetry > 0.1


@pytest.mark.parametrize("kind", ["llvm_ad_rgb", "plain"])
def test_drjit_agrees_inside_a_symbolic_loop(mi: object, kind: str) -> None:
    import drjit as dr

    if kind == "plain":
        from drjit.llvm import Array3f, Float, UInt32
    else:
        from mitsuba import Float, UInt32
        from mitsuba import Vector3f as Array3f
    lobe = Tabulated(table=random_table((16, 12, 9)), reflectance=(0.5, 1.0, 2.0))
    rng = np.random.default_rng(2)
    light, view = uniform(512, rng).T.astype(np.float32), uniform(512, rng).T.astype(np.float32)
    view[2] = np.abs(view[2])
    expected = np.stack(lobe.evaluate(light.astype(float), view.astype(float), view, NORMAL))
    lights, views = Array3f(light), Array3f(view)

    def step(i: object, total: object) -> object:
        return i + 1, total + Array3f(*lobe.evaluate(lights, views, views, (0.0, 0.0, 1.0)))

    loop = dr.while_loop
    total = loop((dr.zeros(UInt32, 512), dr.zeros(Array3f, 512)), lambda i, _: i < 3, step)[1]
    # random numbers on a grid of 1/15 change by 15 per unit of t, and t = sqrt(a) doubles float32's 1e-7 near its peak
    assert np.array(total) == pytest.approx(3 * expected, abs=1e-3)
    assert isinstance(lobe.evaluate(lights, views, views, (0.0, 0.0, 1.0))[0], Float)


def test_nothing_is_reflected_to_or_from_below() -> None:
    lobe = Tabulated(table=random_table())
    light, view = uniform(1000, np.random.default_rng(0)).T, uniform(1000, np.random.default_rng(1)).T
    value = np.stack(lobe.evaluate(light, view, view, NORMAL))
    up = (light[2] > 0) & (view[2] > 0)
    assert (value[:, up] > 0).all()
    assert not value[:, ~up].any()


def test_degenerate_directions_are_finite() -> None:
    lobe = Tabulated(table=random_table())
    grazing = from_angles(np.deg2rad(89.99), np.array([0.0, 1.0, np.pi]))
    special = np.concatenate([grazing, [[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 0, -1]]])
    light, view = (np.stack(v, -1) for v in zip(*((a, b) for a in special for b in special), strict=True))
    for values in (lobe.evaluate(light, view, view, NORMAL), (lobe.density(light, view, view, NORMAL),)):
        assert np.isfinite(np.stack(values)).all()
    u = np.random.default_rng(0).random((2, light.shape[1]))
    assert np.isfinite(np.stack(lobe.sample((u[0], u[1]), view, view, NORMAL[:, None] + 0 * view))).all()


def test_pickled_without_caches_and_equal_by_content() -> None:
    lobe = Tabulated(table=random_table())
    lobe.evaluate(NORMAL, NORMAL, NORMAL, NORMAL)
    data = pickle.dumps(lobe)
    assert len(data) < lobe.table.values.nbytes + 2000
    again = pickle.loads(data)
    assert again == lobe
    assert hash(again) == hash(lobe)
    assert again.key == lobe.key
    other = Tabulated(table=random_table(seed=1))
    assert other != lobe
    assert other.key != lobe.key
