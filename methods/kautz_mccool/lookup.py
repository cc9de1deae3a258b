"""Looking the 3D texture up: bilinear in (alpha, beta), linear in theta_o, at the shifted central direction."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from envbench.geometry import Points
from envbench.material import Centre
from methods.angular.prefilter import widest_view


def look_up(
    texture: NDArray[np.float32], shift: NDArray[np.floating], centre: Centre, points: Points
) -> NDArray[np.float32]:
    """Interpolate a texture (rows, columns, T, 3) at points; returns (n, 3).

    Over central directions the meaning is `envbench.latlong`'s. The central direction is first turned towards the view
    by the angle `shift` (T,), interpolated at theta_o. About R that is towards N too, and N still tells at grazing, V =
    -R.
    """
    llvm.find()
    import drjit as dr
    from drjit.llvm import Array3f, Float, Int32, UInt32

    rows, columns, nodes = texture.shape[:3]
    table = Float(texture.ravel())
    axis, view, normal = (
        Array3f(np.ascontiguousarray(d.T, np.float32)) for d in (points.central(centre), points.view, points.normal)
    )
    layers: list[tuple[Any, Any]] = [(Int32(0), 1.0)]
    if nodes > 1:
        theta = dr.atan2(dr.norm(dr.cross(axis, view)), dr.dot(axis, view))
        place = dr.minimum(theta * ((nodes - 1) / widest_view(centre)), nodes - 1)
        layer = dr.minimum(dr.floor(place), nodes - 2)
        layers = [(Int32(layer), 1 - (place - layer)), (Int32(layer) + 1, place - layer)]
    if shift.any():
        turns = Float(shift.astype(np.float32))
        turn = sum((weight * dr.gather(Float, turns, UInt32(k)) for k, weight in layers), start=Float(0))
        towards = normal if centre is Centre.REFLECTION else view
        towards = towards - dr.dot(towards, axis) * axis
        sine, cosine = dr.sincos(turn)
        axis = cosine * axis + sine * towards * dr.rsqrt(dr.maximum(dr.squared_norm(towards), 1e-20))

    y = dr.atan2(dr.sqrt(axis.x * axis.x + axis.y * axis.y), axis.z) * (rows / np.pi) - 0.5
    x = dr.atan2(axis.y, axis.x) * (columns / (2 * np.pi)) - 0.5
    top, left = dr.floor(y), dr.floor(x)
    value = Array3f(0)
    for down in (0, 1):
        row = Int32(top) + down
        beyond = (row < 0) | (row >= rows)
        row = dr.select(row < 0, -1 - row, dr.select(row >= rows, 2 * rows - 1 - row, row))
        turned = dr.select(beyond, columns // 2, 0)
        along = y - top if down else 1 - (y - top)
        for right in (0, 1):
            column = (Int32(left) + right + turned + columns) % columns
            weight = along * (x - left if right else 1 - (x - left))
            texel = (row * columns + column) * nodes
            for k, share in layers:
                value = dr.fma(weight * share, dr.gather(Array3f, table, UInt32(texel + k)), value)
    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T.copy()
