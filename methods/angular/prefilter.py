"""The sum itself: one Dr.Jit kernel over all texels of all maps, culled to the lobe's cone.

For a central direction C = (alpha, beta), B(C, V) = sum over texels L with C.L >= cos theta* of rho_hat(L, V) L_i dw.
The light's row at polar angle t lies inside the cone for azimuths |phi - beta| <= h,

    cos theta* = cos alpha cos t + sin alpha sin t cos h.

A lane walks the rows alpha - theta* <= t <= alpha + theta* and in each of them only the columns inside; h comes from a
table, since all texels of an output row share it. All is turned by -beta about z, so C = (sin alpha, 0, cos alpha).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import latlong, llvm
from envbench.directions import Array, from_angles
from envbench.errors import CannotRun
from envbench.material import Centre, Lobe


def widest_view(centre: Centre) -> float:
    """Return the largest polar angle of a view about a central direction (grazing: pi about R, pi / 2 about N)."""
    return np.pi / 2 if centre is Centre.NORMAL else np.pi


def prefilter(
    radiance: NDArray[np.float32], lobe: Lobe, shape: tuple[int, int], eps: float, views: int = 1
) -> NDArray[np.float32]:
    """Integrate light times lobe for every texel of a lat-long map of central directions (RH 2002, sec. 6.2).

    Parameters
    ----------
    radiance : (H, W, 3)
        Light; its texels are point samples with their solid angles.
    lobe : Lobe
    shape : (rows, columns) of the map
    eps : float
        The cone holds 1 - eps of the lobe.
    views : int
        T: maps for T polar by T azimuthal local view directions, theta_o = k widest_view / (T - 1) and
        phi_o = 2 pi k / T; 1 for a radially symmetric lobe, which depends on none.

    Returns
    -------
    (rows, columns, T, T, 3) float32

    Raises
    ------
    CannotRun
        Without an LLVM that Dr.Jit can use.
    """
    reason = llvm.problem()
    if reason:
        raise CannotRun(reason)
    import drjit as dr
    from drjit.llvm import Array3f, Float, UInt32

    alpha, beta = latlong.angles(*shape)
    frames = _local_frames(lobe.centre, views) if views > 1 else None

    lane = dr.arange(UInt32, shape[0] * shape[1] * views * views)
    texel, direction = lane // (views * views), lane % (views * views)
    row = texel // shape[1]
    sine, cosine, azimuth = (
        dr.gather(Float, Float(values.astype(np.float32)), index)
        for values, index in ((np.sin(alpha), row), (np.cos(alpha), row), (beta, texel % shape[1]))
    )
    centre = Array3f(sine, 0, cosine)

    def turned(local: Array) -> Any:
        x, y, z = dr.gather(Array3f, Float(local.astype(np.float32).ravel()), direction)
        return Array3f(cosine * x + sine * z, y, cosine * z - sine * x)

    view, normal = (centre, centre) if frames is None else (turned(frames[0]), turned(frames[1]))
    value = _sum(radiance, _cone(alpha, radiance.shape[0], lobe.cone(eps)), row, azimuth,
                 lambda light: lobe.evaluate(light, view, centre, normal))  # fmt: skip
    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T.reshape(*shape, views, views, 3).copy()


def _local_frames(centre: Centre, views: int) -> tuple[Array, Array]:
    """Return V and N (T * T, 3) in the frame whose z axis is the central direction.

    About R the normal is the half vector, at theta_o / 2, also at grazing where V = -R. About T it is taken to be V's
    part perpendicular to T: a whole lobe about T knows no other.
    """
    theta, phi = np.meshgrid(
        np.linspace(0, widest_view(centre), views), 2 * np.pi * np.arange(views) / views, indexing="ij"
    )
    polar_of_normal = {Centre.REFLECTION: theta / 2, Centre.NORMAL: 0 * theta, Centre.TANGENT: 0 * theta + np.pi / 2}
    return from_angles(theta, phi).reshape(-1, 3), from_angles(polar_of_normal[centre], phi).reshape(-1, 3)


def _cone(
    alpha: Array, height: int, angle: float
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]:
    """Return, for each polar angle (n,), the light's first row in the cone, the one past the last, and h (n, H)."""
    t = latlong.angles(height, 4)[0]
    inside = np.abs(alpha[:, None] - t) <= angle
    first = inside.argmax(1)
    cosine = (np.cos(angle) - np.cos(alpha)[:, None] * np.cos(t)) / (np.sin(alpha)[:, None] * np.sin(t))
    half = np.arccos(np.clip(cosine, -1, 1))
    return first.astype(np.uint32), (first + inside.sum(1)).astype(np.uint32), half.astype(np.float32)


def _sum(radiance: NDArray[np.float32], cone: Any, row: Any, azimuth: Any, lobe: Any) -> Any:
    """Trace the two loops, over rows and over columns; `lobe` maps the light's direction to rho_hat for r, g, b."""
    import drjit as dr
    from drjit.llvm import Array2f, Array3f, Array4f, Float, Int32, UInt32

    height, width = radiance.shape[:2]
    texels = np.zeros((height, width, 4), np.float32)  # four floats are one gather
    texels[..., :3] = radiance * latlong.solid_angles(height, width)[..., None]
    polar = latlong.angles(height, width)[0]
    light, rows = Float(texels.ravel()), Float(np.stack([np.cos(polar), np.sin(polar)], 1).astype(np.float32).ravel())
    first, last, half = (kind(a.ravel()) for kind, a in zip((UInt32, UInt32, Float), cone, strict=True))

    step = 2 * np.pi / width
    cos_step, sin_step = float(np.cos(step)), float(np.sin(step))
    column = azimuth / step - 0.5  # fractional column of the centre

    def add_texel(index: Any, left: Any, c: Any, s: Any, end: Any, cos_t: Any, sin_t: Any, total: Any) -> Any:
        r, g, b, _ = dr.gather(Array4f, light, index)
        total = dr.fma(Array3f(*lobe(Array3f(sin_t * c, sin_t * s, cos_t))), Array3f(r, g, b), total)
        index += 1
        index = dr.select(index == end, index - width, index)
        c, s = dr.fma(c, cos_step, -s * sin_step), dr.fma(s, cos_step, c * sin_step)
        return index, left - 1, c, s, end, cos_t, sin_t, total

    def add_row(i: Any, total: Any) -> Any:
        reach = dr.gather(Float, half, row * height + i) / step
        cos_t, sin_t = dr.gather(Array2f, rows, i)
        start = Int32(dr.ceil(column - reach))
        count = dr.minimum(Int32(dr.floor(column + reach)) - start + 1, width)
        s, c = dr.sincos((Float(start) - column) * step)
        start = dr.select(start < 0, start + width, dr.select(start >= width, start - width, start))
        begin = i * width
        state = (begin + UInt32(start), count, c, s, begin + width, cos_t, sin_t, total)
        return i + 1, loop(state, lambda index, left, *_: left > 0, add_texel)[-1]

    loop: Any = dr.while_loop
    end = dr.gather(UInt32, last, row)
    nothing = dr.zeros(Array3f, dr.width(row))
    return loop((dr.gather(UInt32, first, row), nothing), lambda i, _: i < end, add_row)[-1]
