"""How a picture file lays the sphere out, and its resampling to a lat-long map.

Every layout shows the surroundings as seen from inside, so a direction is first written in the picture's axes: right,
up, forward. As in a lat-long picture whose left edge is phi = 0, forward is our +x, right is our +y and up is our +z
(growing phi is a turn to the right: the world is the mirror image of the captured one, the same for every layout).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from envbench.cubemap import FACES
from envbench.directions import Array, from_angles
from envbench.errors import BadInput


class Layout(StrEnum):
    """A file's layout of directions.

    LATLONG
        Any aspect, 2 : 1 as a rule; samples at pixel centres (`envbench.latlong`).
    OPENEXR
        OpenEXR's own lat-long: pole to pole rows, last column = first column. Taken by itself where the header says so.
    PROBE
        Mirror-ball angular map, square: the distance from the centre is the angle from forward, the circumference is
        straight back. What lies outside the circle is ignored (Debevec 1998).
    CROSS
        Vertical cross, 3 : 4: top over left, front, right, over bottom, over back, which stands on its head.
    STRIP
        Six faces side by side, 6 : 1, or one below the other, 1 : 6, in the order +X, -X, +Y, -Y, +Z, -Z of a cube map:
        right, left, top, bottom, front, back, each as OpenGL and Direct3D store it.
    """

    LATLONG = "latlong"
    OPENEXR = "openexr-latlong"
    PROBE = "probe"
    CROSS = "cross"
    STRIP = "strip"


_CROSS_CELLS = ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (3, 1))
"""Row and column of each face in a vertical cross."""

_ASPECTS = {
    Layout.PROBE: ((1, 1),),
    Layout.CROSS: ((3, 4),),
    Layout.STRIP: ((6, 1), (1, 6)),
}


def check_aspect(layout: Layout, width: int, height: int) -> None:
    """Raise `BadInput`, without the file's name, where a `width` x `height` picture cannot have this `layout`."""
    aspects = _ASPECTS.get(layout, ())
    if aspects and not any(width * h == height * w for w, h in aspects):
        wanted = " or ".join(f"{w}:{h}" for w, h in aspects)
        raise BadInput(
            f"{width} x {height} pixels, but layout '{layout}' has the aspect {wanted}: name its own layout."
        )
    if width < 4 * (layout is not Layout.STRIP) or height < 2 * (layout is not Layout.STRIP):
        raise BadInput(f"{width} x {height} pixels; at least 4 x 2 are needed: take a larger map.")


def to_latlong(pixels: NDArray[np.float32], layout: Layout) -> NDArray[np.float32]:
    """Resample a picture (h, w, 3) to a lat-long map (H, W, 3) of the same resolution about the equator."""
    check_aspect(layout, pixels.shape[1], pixels.shape[0])
    match layout:
        case Layout.LATLONG:
            return pixels
        case Layout.OPENEXR:
            height, width = pixels.shape[:2]
            row = (np.arange(height) + 0.5) * (height - 1) / height
            column = (np.arange(width) + 0.5) * (width - 1) / width
            return _bilinear(pixels[None], 0, column[None, :], row[:, None])
        case Layout.PROBE:
            height = pixels.shape[0] // 2
            return _filtered(lambda d: _probe(pixels, d), _probe_density, height)
        case Layout.CROSS | Layout.STRIP:
            faces = _bordered(_faces(pixels, layout))
            return _filtered(lambda d: _cube(faces, d), lambda d: np.ones(d.shape[:-1]), 2 * (faces.shape[1] - 2))


def _filtered(
    lookup: Callable[[Array], NDArray[np.float32]], density: Callable[[Array], Array], height: int
) -> NDArray[np.float32]:
    """Average `lookup` over each pixel of a (height, 2 height) map, sub-samples on a grid even in (theta, phi).

    Without sin(theta) as a weight: beside a pole it would move the mean from the sample's theta, h / 2, to 2 h / 3.
    At least 4 x 4 sub-samples, and as many each way as the picture's `density` (its pixels per pixel of the map) asks
    for up to 32, so that a peak one source pixel wide neither vanishes nor flickers.
    """
    width = 2 * height
    result = np.empty((height, width, 3), np.float32)
    column = np.arange(width)
    for row in range(height):
        centres = from_angles(np.pi * (row + 0.5) / height, 2 * np.pi * (column + 0.5) / width)
        fineness = 2 ** np.clip(np.ceil(np.log2(density(centres))), 2, 5).astype(int)
        for n in np.unique(fineness):
            chosen = column[fineness == n]
            offsets = (np.arange(n) + 0.5) / n
            theta = np.pi * (row + offsets) / height
            phi = 2 * np.pi * (chosen[:, None] + offsets) / width
            values = lookup(from_angles(theta[None, :, None], phi[:, None, :]))
            result[row, chosen] = values.mean(axis=(1, 2))
    return result


def _probe(pixels: NDArray[np.float32], direction: Array) -> NDArray[np.float32]:
    """Look up an angular map; within a pixel of its rim the nearest ring of whole pixels stands for straight back."""
    size = pixels.shape[0]
    forward, right, up = np.moveaxis(direction, -1, 0)
    right = np.where((right == 0) & (up == 0), np.finfo(float).tiny, right)  # straight back is the rim, any of it
    sine = np.hypot(right, up)
    radius = np.minimum(np.arctan2(sine, forward) / np.pi, 1 - 2 * np.sqrt(2) / size)
    scale = radius / sine
    return _bilinear(pixels[None], 0, (1 + right * scale) * size / 2 - 0.5, (1 - up * scale) * size / 2 - 0.5)


def _probe_density(direction: Array) -> Array:
    """Return how much denser than radially an angular map's pixels lie around the ring of `direction`: t / sin t."""
    sine = np.hypot(direction[..., 1], direction[..., 2])
    angle = np.arctan2(sine, direction[..., 0])
    return angle / np.maximum(sine, angle / 32)


def _faces(pixels: NDArray[np.float32], layout: Layout) -> NDArray[np.float32]:
    """Cut a cross or a strip into its faces (6, n, n, 3)."""
    height, width = pixels.shape[:2]
    if layout is Layout.STRIP:
        return np.stack(np.split(pixels, 6, axis=int(width > height)))
    n = width // 3
    cells = [pixels[i * n : (i + 1) * n, j * n : (j + 1) * n] for i, j in _CROSS_CELLS]
    cells[5] = cells[5][::-1, ::-1]
    return np.stack(cells)


def _bordered(faces: NDArray[np.float32]) -> NDArray[np.float32]:
    """Surround each face by one texel looked up in its neighbours, (6, n + 2, n + 2, 3)."""
    n = faces.shape[1]
    inner = np.pad(faces, ((0, 0), (1, 1), (1, 1), (0, 0)), mode="edge")
    a = (2 * np.arange(n + 2) - 1.0) / n - 1
    right_up_forward = np.einsum("fkc,ijc->fijk", FACES, np.stack([*np.meshgrid(a, a), np.ones((n + 2, n + 2))], -1))
    bordered = _cube(inner, right_up_forward[..., [2, 0, 1]])
    bordered[:, 1:-1, 1:-1] = faces
    return bordered


def _cube(faces: NDArray[np.float32], direction: Array) -> NDArray[np.float32]:
    """Look up bordered faces (6, n + 2, n + 2, 3)."""
    n = faces.shape[1] - 2
    axes = direction[..., [1, 2, 0]]
    major = np.abs(axes).argmax(axis=-1)
    depth = np.take_along_axis(axes, major[..., None], axis=-1)
    face = 2 * major + (depth[..., 0] < 0)
    # A face's matrix has orthonormal columns: transposed it takes (right, up, forward) back to (a, b, 1).
    a, b, _ = np.moveaxis(np.einsum("...kc,...k->...c", FACES[face], axes / np.abs(depth)), -1, 0)
    return _bilinear(faces, face, (a + 1) * n / 2 + 0.5, (b + 1) * n / 2 + 0.5)


def _bilinear(stack: NDArray[np.float32], layer: NDArray[np.int_] | int, x: Array, y: Array) -> NDArray[np.float32]:
    """Interpolate pictures (k, h, w, 3) of the given layer at pixel coordinates, clamped to the picture."""
    height, width = stack.shape[1:3]
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    j, i = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    fx, fy = (x - j)[..., None].astype(np.float32), (y - i)[..., None].astype(np.float32)
    top = (1 - fx) * stack[layer, i, j] + fx * stack[layer, i, j + 1]
    bottom = (1 - fx) * stack[layer, i + 1, j] + fx * stack[layer, i + 1, j + 1]
    return ((1 - fy) * top + fy * bottom).astype(np.float32, copy=False)
