"""The groove's transfer against rays, and the wrinkle's map against points fitted one by one."""

from __future__ import annotations

import numpy as np
import pytest

from envbench.errors import BadInput
from envbench.real_harmonics import basis
from methods.irradiance import clamped_cosine
from methods.ldprt.fit import fit
from methods.ldprt.groove import groove_height, groove_normal, groove_transfer
from methods.ldprt.wrinkle import LobeMap, fit_map, fit_wrinkle
from tests.methods.ldprt.synthetic import fibonacci


def marched(x: float, depth: float, directions: np.ndarray) -> np.ndarray:
    """Walk along each direction in 2,000 steps until beyond the groove: is it free?"""
    normal = groove_normal(x, depth)
    up = directions @ normal > 0
    span = 1.0 / np.maximum(np.abs(directions[:, :1]), 1e-3)
    t = span * np.linspace(1e-6, 1, 2000)
    height = groove_height(x, depth) + directions[:, 2:] * t
    ground = groove_height(x + directions[:, :1] * t, depth)
    return up & (directions[:, 2] > 0) & (height > ground - 1e-9).all(axis=1)


@pytest.mark.parametrize(("x", "depth"), [(0.0, 0.5), (-0.2, 1.0), (0.31, 0.3), (0.45, 1.0)])
def test_groove_transfer_is_what_rays_find(x: float, depth: float) -> None:
    """4,000 directions: a border of visibility passes between them, 1e-3 of the hemisphere."""
    s = fibonacci(4000)
    cosine = np.maximum(s @ groove_normal(x, depth), 0) * marched(x, depth, s)
    wanted = basis(5, s) @ cosine * 4 / len(s)  # 4 pi / count / pi
    assert np.abs(groove_transfer(x, depth, 6) - wanted).max() < 2e-3


def test_a_groove_without_depth_is_flat() -> None:
    wanted = basis(5, np.array([0.0, 0.0, 1.0])) * np.repeat(clamped_cosine(5), 2 * np.arange(6) + 1)
    for got in (*groove_transfer([-0.4, 0.0, 0.8], 0.0, 6), groove_transfer(0.6, 1.0, 6)):
        assert np.allclose(got, wanted, atol=1e-13)


def test_groove_is_symmetric() -> None:
    """Across, m and -x go together; along, nothing depends on the sign of y: sine terms vanish."""
    left, right = groove_transfer([-0.3, 0.3], 0.7, 6)
    for l in range(6):
        for m in range(-l, l + 1):
            at = l * l + l + m
            assert left[at] == pytest.approx((-1) ** m * right[at], abs=1e-13)
            assert m >= 0 or left[at] == pytest.approx(0, abs=1e-13)


def test_map_in_one_piece_against_points_apart() -> None:
    """8 x 8 nodes, 16 x 16 samples. Points apart fit their own nodes better, and what lies between far worse."""
    wrinkle = fit_wrinkle(size=8, samples=16, iterations=100)
    signal = groove_transfer(np.linspace(-0.5, 0.5, 16)[:, None], np.linspace(0, 1, 16), 6)
    nodes = groove_transfer(np.linspace(-0.5, 0.5, 8)[:, None], np.linspace(0, 1, 8), 6)
    apart = fit(nodes.reshape(-1, 36), 3)
    by_node = LobeMap(
        apart.axes.reshape(8, 8, 3, 3), apart.coefficients.reshape(8, 8, 3, 6), apart.direct.reshape(8, 8, 4)
    )
    x, d = (part.ravel() for part in np.meshgrid(np.linspace(-0.5, 0.5, 16), np.linspace(0, 1, 16), indexing="ij"))
    flat = signal.reshape(-1, 36)
    scale = np.linalg.norm(flat)
    together = np.linalg.norm(wrinkle.at(x, d).vectors() - flat) / scale
    assert together == pytest.approx(wrinkle.error)
    assert together < 0.1
    with pytest.raises(BadInput, match=r"must lie in \[0, 1\], which was fitted. Got 0.5 to 1.5"):
        wrinkle.at([0.0, 0.0], [0.5, 1.5])
    assert np.linalg.norm(by_node.at(x + 0.5, d).vectors() - flat) / scale > 3 * together


def test_a_map_of_lobes_is_found_again() -> None:
    """Lobes that turn and fade bilinearly, from the start that knows but the linear part; that and DC are exact."""
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 3), indexing="ij")
    middle = np.stack([0.4 * u - 0.2, 0 * u, 1 + 0 * u], axis=-1)
    side = np.array([0.0, 0.9, 0.0])
    axes = np.stack([middle, middle + side, middle - side], axis=2)
    g = np.zeros((4, 3, 3, 6))
    g[..., 2:] = np.array([0.3, 0.2, 0.1, 0.05]) * np.stack([1 + u, 1 + 0.5 * v, 1 + 0.5 * v], axis=-1)[..., None]
    direct = np.stack([1 + u * v, 0 * u, middle[..., 2], -middle[..., 0]], axis=-1)
    made = LobeMap(axes, g, direct)
    x, y = np.meshgrid(np.linspace(0, 1, 16), np.linspace(0, 1, 12), indexing="ij")
    signal = made.at(x, y).vectors().reshape(16, 12, 36)
    found, error = fit_map(signal, (4, 3), 300)
    assert error < 1e-3
    assert np.allclose(found.direct, direct, atol=1e-12)
    between = made.at([0.37], [0.61]).vectors()
    assert np.linalg.norm(found.at([0.37], [0.61]).vectors() - between) < 2e-3 * np.linalg.norm(between)
    assert np.allclose(found.at([2.0], [-1.0]).axes, found.at([1.0], [0.0]).axes)


def test_bad_input() -> None:
    signal = np.zeros((9, 9, 36))
    with pytest.raises(BadInput, match=r"at least 2 nodes a side, and more samples. Got 9 and 9"):
        fit_map(signal, (9, 4))
    with pytest.raises(BadInput, match=r"needs n > 2.*Got n = 2"):
        fit_map(signal[..., :4], (4, 4))
    with pytest.raises(BadInput, match=r"depth of a wrinkle must be finite and above 0. Got 0"):
        fit_wrinkle(0)
    with pytest.raises(BadInput, match=r"groove depths must be finite and at least 0. Got -1"):
        groove_transfer(0.0, -1.0, 6)
    with pytest.raises(BadInput, match=r"n in \[1, 20\]. Got 0"):
        groove_transfer(0.0, 1.0, 0)
