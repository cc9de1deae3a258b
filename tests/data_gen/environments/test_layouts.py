"""Layouts against independent statements of each: a smooth function painted by the book must come back."""

from __future__ import annotations

import numpy as np
import pytest

from data_gen.environments.layouts import Layout, check_aspect, to_latlong
from envbench import directions, latlong
from envbench.errors import BadInput

N = 24  # texels across a cube face
HEIGHT = 2 * N  # rows of the map: the same resolution about the equator
STEP = np.pi / HEIGHT


def smooth(d: np.ndarray) -> np.ndarray:
    """Tell every axis from every other: |gradient| <= 1.5, second derivative along a great circle <= 2."""
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack([2 + x + 0.5 * x * y, 2 + y + 0.5 * y * z, 2 + z + 0.5 * z * x], axis=-1)


def ours(right: np.ndarray, up: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """Turn picture axes into a direction: forward is +x, right is +y, up is +z."""
    return directions.normalised(np.stack(np.broadcast_arrays(forward, right, up), axis=-1))


def centres(n: int) -> np.ndarray:
    return (2 * np.arange(n) + 1.0) / n - 1


def strip_directions() -> np.ndarray:
    """Invert the table of the OpenGL specification (section Cube Map Texture Selection): sc, tc, ma by face."""
    s, t = np.meshgrid(centres(N), centres(N))
    one = np.ones_like(s)
    # (rx, ry, rz), with sc = s, tc = t and |ma| = 1 solved for the components.
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    return np.concatenate([ours(right=rx, up=ry, forward=rz) for rx, ry, rz in faces], axis=1)


def cross_directions() -> np.ndarray:
    """Fold the paper: each cell shares an edge with its neighbour towards the front."""
    a, b = np.meshgrid(centres(N), centres(N))
    one = np.ones_like(a)
    picture = np.full((4 * N, 3 * N, 3), np.nan)
    cells = {
        (0, 1): ours(a, one, b),
        (1, 0): ours(-one, -b, a),
        (1, 1): ours(a, -b, one),
        (1, 2): ours(one, -b, -a),
        (2, 1): ours(a, -one, -b),
        (3, 1): ours(a, b, -one),
    }
    for (i, j), cell in cells.items():
        picture[i * N : (i + 1) * N, j * N : (j + 1) * N] = cell
    return picture


def probe_directions(size: int) -> np.ndarray:
    """Follow Debevec's page: (u, v) in [-1, 1], angle pi sqrt(u^2 + v^2) from forward, around it by atan2(v, u)."""
    u, v = np.meshgrid(centres(size), -centres(size))
    angle, around = np.pi * np.hypot(u, v), np.arctan2(v, u)
    d = ours(np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle))
    d[np.hypot(u, v) > 1] = np.nan
    return d


def openexr_directions() -> np.ndarray:
    theta = np.pi * np.arange(HEIGHT) / (HEIGHT - 1)
    phi = 2 * np.pi * np.arange(2 * HEIGHT) / (2 * HEIGHT - 1)
    return directions.from_angles(theta[:, None], phi)


PICTURES = {
    "latlong": (Layout.LATLONG, latlong.grid(HEIGHT, 2 * HEIGHT)),
    "openexr": (Layout.OPENEXR, openexr_directions()),
    "probe": (Layout.PROBE, probe_directions(2 * HEIGHT)),
    "cross": (Layout.CROSS, cross_directions()),
    "strip": (Layout.STRIP, strip_directions()),
    "column": (Layout.STRIP, np.concatenate(np.split(strip_directions(), 6, axis=1), axis=0)),
}


@pytest.mark.parametrize("name", PICTURES)
def test_smooth_function_comes_back(name: str) -> None:
    # Two bilinear lookups (h^2 / 8 a dimension each; the cube's texel is 4 h / pi at a face's centre) and one box
    # (h^2 / 24): 2 (1.62 / 8 + 1 / 8 + 1 / 24) = .74 h^2 times the second derivative, which the projections raise
    # from 2 to at most 2 + 1.5 (gradient times the curvature of the texel grid).
    layout, where = PICTURES[name]
    radiance = to_latlong(smooth(where).astype(np.float32), layout)
    assert radiance.shape == (HEIGHT, 2 * HEIGHT, 3)
    assert np.isfinite(radiance).all()  # corners and empty cells hold NaN: they must not be looked at
    d = directions.uniform(20_000, np.random.default_rng(3))
    tolerance = np.full(len(d), 0.74 * 3.5 * STEP**2)
    if layout is Layout.PROBE:  # the last ring stands for straight back: up to sqrt(2) pixels away, and 2 for bilinear
        tolerance[np.arccos(-d[:, 0]) < 4 * STEP] = 1.5 * 4 * STEP
    error = np.abs(latlong.interpolate(radiance, d) - smooth(d)).max(axis=-1)
    assert (error <= tolerance).all(), (error - tolerance).max()


@pytest.mark.parametrize(
    ("layout", "size", "pixel", "axis"),
    [
        (Layout.LATLONG, (8, 16), (0, 3), (0, 0, 1)),
        (Layout.LATLONG, (9, 18), (4, 0), (1, 0, 0)),
        (Layout.LATLONG, (9, 18), (4, 4), (0, 1, 0)),
        (Layout.PROBE, (9, 9), (4, 4), (1, 0, 0)),
        (Layout.PROBE, (9, 9), (4, 6), (0, 1, 0)),
        (Layout.PROBE, (9, 9), (2, 4), (0, 0, 1)),
        (Layout.PROBE, (9, 9), (4, 2), (0, -1, 0)),
        (Layout.CROSS, (12, 9), (1, 4), (0, 0, 1)),
        (Layout.CROSS, (12, 9), (4, 4), (1, 0, 0)),
        (Layout.CROSS, (12, 9), (4, 1), (0, -1, 0)),
        (Layout.CROSS, (12, 9), (4, 7), (0, 1, 0)),
        (Layout.CROSS, (12, 9), (7, 4), (0, 0, -1)),
        (Layout.CROSS, (12, 9), (10, 4), (-1, 0, 0)),
        (Layout.STRIP, (3, 18), (1, 1), (0, 1, 0)),
        (Layout.STRIP, (3, 18), (1, 4), (0, -1, 0)),
        (Layout.STRIP, (3, 18), (1, 7), (0, 0, 1)),
        (Layout.STRIP, (3, 18), (1, 10), (0, 0, -1)),
        (Layout.STRIP, (3, 18), (1, 13), (1, 0, 0)),
        (Layout.STRIP, (18, 3), (16, 1), (-1, 0, 0)),
    ],
)
def test_axes(layout: Layout, size: tuple[int, int], pixel: tuple[int, int], axis: tuple[int, int, int]) -> None:
    picture = np.zeros((*size, 3), np.float32)
    picture[pixel] = 1
    radiance = to_latlong(picture, layout)
    height, width = radiance.shape[:2]
    centroid = (radiance[..., :1] * latlong.grid(height, width) * latlong.solid_angles(height, width)[..., None]).sum(
        (0, 1)
    )
    assert directions.normalised(centroid) @ axis > np.cos(1.5 * np.pi / height)


def test_back_of_the_cross_stands_on_its_head() -> None:
    picture = np.zeros((4 * N, 3 * N, 3), np.float32)
    picture[3 * N : 3 * N + 2, N : 2 * N] = 1  # the back's upper edge joins the bottom
    lit = latlong.grid(HEIGHT, 2 * HEIGHT)[to_latlong(picture, Layout.CROSS)[..., 0] > 0.5]
    assert (lit[:, 2] < 0).all()
    assert (lit[:, 0] < 0).all()


@pytest.mark.parametrize("name", ["probe", "cross", "strip"])
def test_peak_of_one_pixel_keeps_its_power(name: str) -> None:
    # One source pixel is a tent whose sum over sub-samples at most one pixel apart is off by 1/8 at worst, and the
    # solid angle of a pixel varies by a few per cent over the tent.
    layout, where = PICTURES[name]
    rng = np.random.default_rng(4)
    seen = np.argwhere(np.isfinite(where[..., 0]))
    if layout is Layout.PROBE:  # near the rim too, but for the last ring, which stands for straight back
        seen = seen[np.arccos(-where[tuple(seen.T)][:, 0]) > 4 * STEP]
    for i, j in rng.permutation(seen)[:16]:
        picture = np.zeros((*where.shape[:2], 3), np.float32)
        picture[i, j] = 1e4
        radiance = to_latlong(picture, layout)[..., 0] * latlong.solid_angles(HEIGHT, 2 * HEIGHT)
        assert radiance.sum() == pytest.approx(1e4 * pixel_solid_angle(layout, where[i, j]), rel=0.2)
        centroid = directions.normalised((radiance[..., None] * latlong.grid(HEIGHT, 2 * HEIGHT)).sum((0, 1)))
        assert centroid @ where[i, j] > np.cos(STEP)


def pixel_solid_angle(layout: Layout, d: np.ndarray) -> float:
    if layout is Layout.PROBE:  # dw = sin t dt df = sin t / t * (pi / radius)^2 of the area
        t = np.arccos(d[0])
        return np.sin(t) / t * np.pi**2 * (1 / HEIGHT) ** 2
    return np.abs(d).max() ** 3 * (2 / N) ** 2


@pytest.mark.parametrize(
    ("layout", "size"),
    [(Layout.PROBE, (64, 32)), (Layout.CROSS, (4, 3)), (Layout.STRIP, (12, 4)), (Layout.CROSS, (7, 9))],
)
def test_wrong_aspect_is_refused(layout: Layout, size: tuple[int, int]) -> None:
    with pytest.raises(BadInput, match=f"{size[0]} x {size[1]} pixels, but layout '{layout}' has the aspect"):
        check_aspect(layout, *size)
