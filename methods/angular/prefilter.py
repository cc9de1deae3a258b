"""The sum itself: one Dr.Jit kernel over all queries, culled to the lobe's cone.

B(C, V) = sum over texels L with C.L >= cos theta* of rho_hat(L, V) L_i dw. About a centre C at polar angle alpha and
azimuth beta, the light's row at polar angle t lies inside the cone for azimuths |phi - beta| <= h,

    cos theta* = cos alpha cos t + sin alpha sin t cos h
    sin^2 (h / 2) = sin((theta* + alpha - t) / 2) sin((theta* - alpha + t) / 2) / (sin alpha sin t),

the second well conditioned for narrow cones; beyond 1 the cone holds the whole row. A lane walks the rows
alpha - theta* <= t <= alpha + theta* and in each of them only the columns inside. All is turned by -beta about z, so
C = (sin alpha, 0, cos alpha).

A lobe narrower than a texel would fall between them: then the light's bilinear function is sampled `refinement` times
finer, on a grid that no one stores.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import latlong, llvm
from envbench.directions import Array, from_angles
from envbench.errors import CannotRun
from envbench.material import Centre, Lobe

MAX_REFINEMENT = 1023
"""Of a texel, each way: what a lobe of 1e-3 degrees needs in a map of 64 rows, far below what any lobe here reaches."""


def widest_view(centre: Centre) -> float:
    """Return the largest polar angle of a view about a central direction (grazing: pi about R, pi / 2 about N)."""
    return np.pi / 2 if centre is Centre.NORMAL else np.pi


def width(lobe: Lobe) -> float:
    """Return a lobe's width in radians: the half-angle of the cone that holds all of it but 1 / e."""
    return lobe.cone(exp(-1))


def refinement(height: int, lobe: Lobe) -> int:
    """Return the odd number of samples, per texel and axis, of a light of `height` rows.

    One, unless the lobe is narrower than a texel; then as many as make two of its width w. A sum over a Gaussian at
    steps d <= w / 2 errs by exp(-pi^2 w^2 / d^2), nothing, and on a pole, where rows are rings, by d^2 / (12 w^2), 2 %.
    """
    texels = np.pi / height / width(lobe)
    return 1 if texels <= 1 else min(ceil(texels - 0.5) * 2 + 1, MAX_REFINEMENT)


def grazing(height: int, lobe: Lobe) -> float:
    """Return how far from grazing, in radians, a view must stay for sums over a light of `height` rows.

    Two samples' steps: nearer to it a lobe of facets becomes a ridge between them, narrow as N.V and high as 1 / N.V,
    of which a sum finds several times too much or nothing.
    """
    return 2 * np.pi / (height * refinement(height, lobe))


def polar_nodes(lobe: Lobe, views: int, height: int) -> Array:
    """Return theta_o of the T = `views` maps, evenly from 0 to `widest_view`, the last `grazing` away from it.

    But at most half a step between views: (T,).
    """
    widest = widest_view(lobe.centre)
    theta = np.linspace(0, widest, views)
    theta[-1] -= min(grazing(height, lobe), theta[1] / 2)
    return theta


def prefilter(
    radiance: NDArray[np.float32], lobe: Lobe, shape: tuple[int, int], eps: float, views: int = 1
) -> NDArray[np.float32]:
    """Integrate light times lobe for every texel of a lat-long map of central directions (RH 2002, sec. 6.2).

    Parameters
    ----------
    radiance : (H, W, 3)
        Light; its texels are point samples with their solid angles, unless the lobe is narrower than they are.
    lobe : Lobe
    shape : (rows, columns) of the map
    eps : float
        The cone holds 1 - eps of the lobe.
    views : int
        T: maps for T polar (`polar_nodes`) by T azimuthal local view directions, phi_o = 2 pi k / T; 1 for a radially
        symmetric lobe, which depends on none.

    Returns
    -------
    (rows, columns, T, T, 3) float32

    Raises
    ------
    CannotRun
        Without an LLVM that Dr.Jit can use.
    """
    dr = _drjit()
    from drjit.llvm import Array3f, Float, UInt32

    alpha, beta = latlong.angles(*shape)
    frames = _local_frames(lobe.centre, polar_nodes(lobe, views, len(radiance))) if views > 1 else None

    lane = dr.arange(UInt32, shape[0] * shape[1] * views * views)
    texel, direction = lane // (views * views), lane % (views * views)
    row = texel // shape[1]
    polar, sine, cosine, azimuth = (
        dr.gather(Float, Float(values.astype(np.float32)), index)
        for values, index in ((alpha, row), (np.sin(alpha), row), (np.cos(alpha), row), (beta, texel % shape[1]))
    )
    centre = Array3f(sine, 0, cosine)

    def turned(local: Array) -> Any:
        x, y, z = dr.gather(Array3f, Float(local.astype(np.float32).ravel()), direction)
        return Array3f(cosine * x + sine * z, y, cosine * z - sine * x)

    view, normal = (centre, centre) if frames is None else (turned(frames[0]), turned(frames[1]))
    value = _sum(radiance, lobe, eps, polar, azimuth, lambda light: lobe.evaluate(light, view, centre, normal))
    return value.reshape(*shape, views, views, 3)


def prefilter_at(
    radiance: NDArray[np.float32],
    lobe: Lobe,
    centre: NDArray[np.floating],
    view: NDArray[np.floating],
    normal: NDArray[np.floating],
    eps: float,
) -> NDArray[np.float32]:
    """Integrate light times lobe at any central directions, views and normals.

    Parameters
    ----------
    radiance : (H, W, 3)
        Light, as in `prefilter`.
    centre, view, normal : (n, 3)
        Unit vectors: C, V and N of each query.
    eps : float
        The cone holds 1 - eps of the lobe.

    Returns
    -------
    (n, 3) float32

    Raises
    ------
    CannotRun
        Without an LLVM that Dr.Jit can use.
    """
    dr = _drjit()
    from drjit.llvm import Array3f

    order = np.argsort(centre[:, 2], kind="stable")  # lanes side by side then walk alike: twice as fast, measured
    c, v, n = (Array3f(np.ascontiguousarray(d[order].T, np.float32)) for d in (centre, view, normal))
    sine = dr.sqrt(c.x * c.x + c.y * c.y)
    sin_beta, cos_beta = dr.select(sine > 0, c.y / sine, 0), dr.select(sine > 0, c.x / sine, 1)

    def turned(d: Any) -> Any:
        return Array3f(cos_beta * d.x + sin_beta * d.y, cos_beta * d.y - sin_beta * d.x, d.z)

    c, v, n = Array3f(sine, 0, c.z), turned(v), turned(n)
    azimuth = dr.atan2(sin_beta, cos_beta)
    azimuth = dr.select(azimuth < 0, azimuth + 2 * np.pi, azimuth)
    value = _sum(radiance, lobe, eps, dr.atan2(c.x, c.z), azimuth, lambda light: lobe.evaluate(light, v, c, n))
    out = np.empty_like(value)
    out[order] = value
    return out


def _drjit() -> Any:
    reason = llvm.problem()
    if reason:
        raise CannotRun(reason)
    import drjit as dr

    return dr


def _local_frames(centre: Centre, polar: Array) -> tuple[Array, Array]:
    """Return V and N (T * T, 3), for T polar and T azimuthal angles, in the frame whose z axis is the centre.

    About R the normal is the half vector, at theta_o / 2. About T it is taken to be V's part perpendicular to T: a
    whole lobe about T knows no other.
    """
    theta, phi = np.meshgrid(polar, 2 * np.pi * np.arange(len(polar)) / len(polar), indexing="ij")
    polar_of_normal = {Centre.REFLECTION: theta / 2, Centre.NORMAL: 0 * theta, Centre.TANGENT: 0 * theta + np.pi / 2}
    return from_angles(theta, phi).reshape(-1, 3), from_angles(polar_of_normal[centre], phi).reshape(-1, 3)


def _sum(
    radiance: NDArray[np.float32], lobe: Lobe, eps: float, alpha: Any, beta: Any, rho: Callable[[Any], Any]
) -> NDArray[np.float32]:
    """Trace the two loops, over rows and columns of the light's grid; `rho` maps L to rho_hat for r, g, b; (n, 3)."""
    import drjit as dr
    from drjit.llvm import Array2f, Array3f, Float, Int32, UInt32

    fine = refinement(radiance.shape[0], lobe)
    rows, columns = radiance.shape[0] * fine, radiance.shape[1] * fine
    polar = latlong.angles(rows, columns)[0]
    table = Float(np.stack([np.cos(polar), np.sin(polar)], 1).astype(np.float32).ravel())
    light_at = _texels(radiance) if fine == 1 else _between_texels(radiance, fine)
    cone = min(lobe.cone(eps), np.pi)
    step, down = 2 * np.pi / columns, np.pi / rows
    cos_step, sin_step = float(np.cos(step)), float(np.sin(step))
    column = beta / step - 0.5  # fractional column of the centre
    sin_alpha = dr.sin(alpha)

    def add_texel(j: Any, left: Any, c: Any, s: Any, i: Any, cos_t: Any, sin_t: Any, total: Any) -> Any:
        r, g, b, _ = light_at(i, j)
        total = dr.fma(Array3f(*rho(Array3f(sin_t * c, sin_t * s, cos_t))), Array3f(r, g, b), total)
        j += 1
        j = dr.select(j == columns, 0, j)
        c, s = dr.fma(c, cos_step, -s * sin_step), dr.fma(s, cos_step, c * sin_step)
        return j, left - 1, c, s, i, cos_t, sin_t, total

    def add_row(i: Any, total: Any) -> Any:
        cos_t, sin_t = dr.gather(Array2f, table, UInt32(i))
        off = alpha - (Float(i) + 0.5) * down
        inside = dr.sin(0.5 * (cone + off)) * dr.sin(0.5 * (cone - off))
        square = inside / dr.maximum(sin_alpha * sin_t, 1e-20)
        reach = dr.select(square < 1, 2 * dr.asin(dr.sqrt(dr.clip(square, 0, 1))) / step, columns)
        start = Int32(dr.ceil(column - dr.minimum(reach, 0.5 * columns)))
        count = dr.minimum(Int32(dr.floor(column + reach)) - start + 1, columns)
        s, c = dr.sincos((Float(start) - column) * step)
        start = dr.select(start < 0, start + columns, dr.select(start >= columns, start - columns, start))
        state = (start, count, c, s, i, cos_t, sin_t, total)
        return i + 1, loop(state, lambda j, left, *_: left > 0, add_texel)[-1]

    loop: Any = dr.while_loop
    first = dr.maximum(Int32(dr.ceil((alpha - cone) / down - 0.5)), 0)
    end = dr.minimum(Int32(dr.floor((alpha + cone) / down - 0.5)) + 1, rows)
    nothing = dr.zeros(Array3f, dr.width(alpha))
    value = loop((first, nothing), lambda i, _: i < end, add_row)[-1]
    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T.copy()


def _texels(radiance: NDArray[np.float32]) -> Callable[[Any, Any], Any]:
    """Return the light's texels, times their solid angles, by row and column."""
    import drjit as dr
    from drjit.llvm import Array4f, Float, UInt32

    height, width = radiance.shape[:2]
    texels = np.zeros((height, width, 4), np.float32)  # four floats are one gather
    texels[..., :3] = radiance * latlong.solid_angles(height, width)[..., None]
    table = Float(texels.ravel())
    return lambda i, j: dr.gather(Array4f, table, UInt32(i * width + j))


def _between_texels(radiance: NDArray[np.float32], fine: int) -> Callable[[Any, Any], Any]:
    """Return the bilinear function, times solid angles, by row and column of a grid `fine` times finer (odd).

    A map with an odd number of columns is slightly smoothed beyond its outermost rows: there it is half a column off.
    """
    import drjit as dr
    from drjit.llvm import Array4f, Float, Int32, UInt32

    height, width = radiance.shape[:2]
    columns = np.arange(width)
    # a row beyond each pole: its half-turned self, half a column off where their number is odd
    half = [(columns + width // 2) % width, (columns + (width + 1) // 2) % width]
    beyond = [(radiance[row][half[0]] + radiance[row][half[1]]) / 2 for row in (0, -1)]
    padded = np.zeros((height + 2, width, 4), np.float32)
    padded[..., :3] = np.concatenate([beyond[0][None], radiance, beyond[1][None]])
    table = Float(padded.ravel())
    solid = Float(latlong.solid_angles(height * fine, width * fine)[:, 0].astype(np.float32))

    def at(i: Any, j: Any) -> Any:
        # fine sample k lies at (k + 1/2) / fine - 1/2 texels
        i0, j0 = (i - fine // 2 + fine) // fine, (j - fine // 2 + fine) // fine - 1
        fy = Float(i - fine // 2 + fine - i0 * fine) / fine
        fx = Float(j - fine // 2 + fine - (j0 + 1) * fine) / fine
        left, right = dr.select(j0 < 0, j0 + width, j0), dr.select(j0 + 1 >= width, 0, j0 + 1)

        def texel(row: Any, column: Any) -> Any:
            return dr.gather(Array4f, table, UInt32(Int32(row) * width + column))

        top = dr.lerp(texel(i0, left), texel(i0, right), fx)
        bottom = dr.lerp(texel(i0 + 1, left), texel(i0 + 1, right), fx)
        return dr.lerp(top, bottom, fy) * dr.gather(Float, solid, UInt32(i))

    return at
