"""Functions over the sphere as polar glyphs: a surface at the distance |f(s)|, red where f > 0 and blue where f < 0."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.contact_sheet import NO_POINT, Pixels
from data_gen import views
from envbench.directions import Array, normalised
from envbench.geometry import Geometry, TriangleMesh
from envbench.real_harmonics import basis

ROWS, EYE = 120, 12.0
"""Rows of the surface's grid, and how far away it is seen from: nearly orthographic."""
POSITIVE, NEGATIVE = np.array([202, 60, 60]), np.array([60, 100, 200])


def glyph(vector: Array, reach: float, size: int) -> Pixels:
    """Draw the function of an SH vector (n^2,); `reach` is the value that ends at the border of the picture."""
    theta, phi = np.linspace(0, np.pi, ROWS + 1), np.linspace(0, 2 * np.pi, 2 * ROWS + 1)
    t, p = (part.ravel() for part in np.meshgrid(theta, phi, indexing="ij"))
    s = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    value = vector @ basis(round(np.sqrt(len(vector))) - 1, s) / reach
    place = np.abs(value)[:, None] * s
    corner = (np.arange(ROWS)[:, None] * len(phi) + np.arange(len(phi) - 1)).ravel()
    lower = np.stack([corner, corner + len(phi), corner + len(phi) + 1], axis=1)
    upper = np.stack([corner, corner + len(phi) + 1, corner + 1], axis=1)
    triangles = np.concatenate([lower, upper]).astype(np.int32)
    mesh = TriangleMesh(place, triangles, _normals(place, triangles, s))
    eye = EYE * normalised(np.array([0.5, -1.0, 0.4]))
    view = {"kind": "image", "size": size, "eye": eye.tolist(), "target": [0.0, 0.0, 0.0],
            "fov": float(2 * np.degrees(np.arctan(1 / EYE)))}  # fmt: skip
    points, _ = views.build(view, Geometry("glyph", mesh, convex=False))
    assert points.triangle is not None
    assert points.barycentric is not None
    above = np.sum(points.barycentric * value[triangles[points.triangle]], axis=1) > 0
    facing = np.sum(points.normal * points.view, axis=1)[:, None]
    colour = np.where(above[:, None], POSITIVE, NEGATIVE) * (0.35 + 0.65 * facing)
    drawn = points.image(colour)
    return np.where(np.isfinite(drawn), np.rint(np.nan_to_num(drawn)), NO_POINT).astype(np.uint8)


def _normals(place: Array, triangles: NDArray[np.int32], outward: Array) -> Array:
    """Return the vertices' normals, means of the triangles' by area; outward where there is none."""
    a, b, c = (place[triangles[:, k]] for k in range(3))
    cross, total = np.cross(b - a, c - a), np.zeros_like(place)
    for k in range(3):
        np.add.at(total, triangles[:, k], cross)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-12, total / np.maximum(length, 1e-12), outward)
