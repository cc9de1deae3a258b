"""Looking maps up: bilinear in (alpha, beta), and bilinear in the local (theta_o, phi_o) where there are T x T maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from envbench.directions import Array
from envbench.geometry import Points
from envbench.material import Centre
from methods.angular.prefilter import widest_view


def look_up(maps: NDArray[np.float32], centre: Centre, points: Points) -> NDArray[np.float32]:
    """Interpolate maps (rows, columns, T, T, 3), columns and T even (or T = 1), at points; returns (n, 3).

    Over central directions the meaning is `envbench.latlong`'s. Beyond a pole a row meets its half-turned self, and
    there the frame R(alpha, beta) is half-turned about its own z too: R(-alpha, beta) = R(alpha, beta + pi) Rz(pi). So
    phi_o moves by pi with the row.
    """
    llvm.find()
    import drjit as dr
    from drjit.llvm import Array3f, Float, Int32, UInt32

    rows, columns, views = maps.shape[:3]
    table = Float(maps.ravel())
    c = _vectors(points.central(centre))
    across = dr.sqrt(c.x * c.x + c.y * c.y)
    phi = dr.atan2(c.y, c.x)
    y = dr.atan2(across, c.z) * (rows / np.pi) - 0.5
    x = phi * (columns / (2 * np.pi)) - 0.5
    top, left = dr.floor(y), dr.floor(x)

    corners: list[tuple[Any, Any, Any]] = [(Int32(0), Int32(0), 1.0)]
    if views > 1:
        v = _vectors(points.view)
        sin_b, cos_b = dr.sincos(phi)
        along = cos_b * v.x + sin_b * v.y
        local = Array3f(c.z * along - across * v.z, cos_b * v.y - sin_b * v.x, across * along + c.z * v.z)
        corners = _view_corners(local, widest_view(centre), views)

    value = Array3f(0)
    for down in (0, 1):
        row = Int32(top) + down
        beyond = (row < 0) | (row >= rows)
        row = dr.select(row < 0, -1 - row, dr.select(row >= rows, 2 * rows - 1 - row, row))
        for right in (0, 1):
            column = _wrapped(Int32(left) + right + dr.select(beyond, columns // 2, 0), columns)
            weight = _share(y - top, down) * _share(x - left, right)
            for k, m, share in corners:
                azimuth = _wrapped(m + dr.select(beyond, views // 2, 0), views)
                index = ((row * columns + column) * views + k) * views + azimuth
                value = dr.fma(weight * share, dr.gather(Array3f, table, UInt32(index)), value)
    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T.copy()


def _view_corners(local: Any, widest: float, views: int) -> list[tuple[Any, Any, Any]]:
    """Return the four nearest of the T x T directions: polar index, azimuthal index, weight."""
    import drjit as dr
    from drjit.llvm import Int32

    theta = dr.atan2(dr.sqrt(local.x * local.x + local.y * local.y), local.z)
    y = dr.minimum(theta, widest) * ((views - 1) / widest)
    x = dr.atan2(local.y, local.x) * (views / (2 * np.pi))
    top, left = dr.minimum(dr.floor(y), views - 2), dr.floor(x)
    return [
        (Int32(top) + down, Int32(left) + right, _share(y - top, down) * _share(x - left, right))
        for down in (0, 1)
        for right in (0, 1)
    ]


def _vectors(directions: Array) -> Any:
    from drjit.llvm import Array3f

    return Array3f(np.ascontiguousarray(directions.T, np.float32))


def _share(fraction: Any, one: int) -> Any:
    return fraction if one else 1 - fraction


def _wrapped(index: Any, count: int) -> Any:
    return (index + 2 * count) % count
