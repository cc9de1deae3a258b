"""Glossy transfer through a factored BRDF (Sloan, Luna and Snyder 2005, eqs. 14 to 16), for isotropic BRDFs.

In a point's frame, normal z, the BRDF is a matrix over view samples and the light's harmonics,

    B_ij = int rho_hat(v_i, s) y_j(s) ds = (U Sigma V)_ij                                              (eq. 14)

(our lobes' rho_hat holds the cosine). With the n_b largest singular values, exit radiance is u(v) M' e: view factors
u(v), columns of U read as maps over the view, and n_b rows M' = Sigma V T of transfer, T from source light to incident
radiance in the point's frame (eq. 15). Every row is a transfer vector, to be fitted with lobes like a diffuse one.

Where the three channels of a BRDF differ they are more rows of B: they share V, and so M', and differ in u(v).

No tangent is asked of a surface: a BRDF that turning about the normal does not change gives the same in any frame. So B
is also known at every azimuth from one, by turning about z, and a lobe about the hair's tangent has no such B.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isqrt, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.arrays import namespace
from envbench.directions import Array, perpendicular, reflect
from envbench.errors import BadInput
from envbench.material import Centre, Lobe, Material
from envbench.real_harmonics import basis
from methods.ldprt.lanes import applied, floats, points_last, transposed
from methods.ldprt.lookup import Bilinear
from methods.ldprt.rotation import rotate, turned_about_z

VIEW_SIZE = 32
"""The paper's maps of view factors are 32 x 32."""
QUADRATURE = 128
"""Rows of light directions over each hemisphere that B is summed over, by as many columns over half a turn."""
_FLOATS = 2**24
"""Values that one batch of `specialise` holds: 128 MiB."""


@dataclass(frozen=True, eq=False)
class Factored:
    """A BRDF with the n_b largest singular values of its matrix.

    Attributes
    ----------
    factors : (S, S, n_b, 3)
        U: u(v) over the square of views (`square`), for r, g and b. Orthonormal over views and channels.
    rows : (n_b, n^2)
        Sigma V, in the point's frame.
    singular : (n^2,)
        All singular values, falling.
    """

    factors: Array
    rows: Array
    singular: Array

    @property
    def svd_error(self) -> float:
        """RMS error of B for the singular values left out, relative to B's RMS."""
        power = self.singular**2
        return float(np.sqrt(power[len(self.rows) :].sum() / power.sum())) if power.any() else 0.0


@dataclass(frozen=True)
class Errors:
    """RMS errors over all points and views, relative to the whole signal.

    The two are of different rows, which are orthogonal: their squares add.
    """

    svd: float
    fit: float


def factor(material: Material, n: int, count: int, size: int = VIEW_SIZE) -> Factored:
    """Factor a material's BRDF for light of order `n`, and keep `count` rows n_b.

    Raises
    ------
    BadInput
        A lobe that is not isotropic or too narrow (`matrix`), or a count beyond what the matrix has.
    """
    if not 1 <= count <= n * n:
        raise BadInput(f"rows of a BRDF of order {n} must lie in [1, {n * n}]. Got {count} instead.")
    if not 2 <= size <= 1024 or 3 * size * size < n * n:
        raise BadInput(f"view maps must be 2 to 1024 wide and have n^2 = {n * n} samples. Got {size} instead.")
    B = matrix(material.lobes, n, views(size).reshape(-1, 3))
    U, sigma, V = np.linalg.svd(np.moveaxis(B, 0, -1).transpose(0, 2, 1).reshape(-1, n * n), full_matrices=False)
    factors = U[:, :count].reshape(size, size, 3, count).transpose(0, 1, 3, 2)
    return Factored(np.ascontiguousarray(factors), sigma[:count, None] * V[:count], sigma)


def matrix(lobes: Sequence[Lobe], n: int, view: Array, quadrature: int = QUADRATURE) -> Array:
    """Return B (3, n_v, n^2) of eq. 14 for views (n_v, 3) in the point's frame.

    A product rule: Gauss's in s_z over each hemisphere, midpoints in azimuth.

    Raises
    ------
    BadInput
        A lobe about the tangent, or one that falls between the directions of the rule.
    """
    for lobe in lobes:
        if lobe.centre is Centre.TANGENT:
            raise BadInput("glossy transfer holds isotropic BRDFs only; a lobe about the tangent is none.")
        if lobe.cone(0.5) < 2 * pi / quadrature:
            raise BadInput(
                f"a lobe with half its energy within {np.degrees(lobe.cone(0.5)):.2g} degrees is too narrow for a BRDF "
                f"matrix over {quadrature} rows of directions."
            )
    cosine, which = np.unique(view[:, 2].round(12), return_inverse=True)
    at_zero = np.stack([_row(lobes, n, float(z), quadrature) for z in cosine])  # (k, 3, n^2), azimuth 0
    across = np.hypot(view[:, 0], view[:, 1])
    scale = 1 / np.where(across > 0, across, 1)
    cos_phi, sin_phi = np.where(across > 0, view[:, 0] * scale, 1.0), view[:, 1] * scale
    components = list(np.moveaxis(at_zero[which], 0, 2).transpose(1, 0, 2))  # n^2 of (3, n_v)
    return np.stack(turned_about_z(components, cos_phi, sin_phi), axis=-1)


def _row(lobes: Sequence[Lobe], n: int, cosine: float, quadrature: int) -> Array:
    """Return B (3, n^2) for the view (sin, 0, cos). Mirrored in y it is the same: half the azimuths do."""
    z, weight = np.polynomial.legendre.leggauss(quadrature)
    z, weight = (z + 1) / 2, weight / 2
    if not all(lobe.clipped for lobe in lobes):
        z, weight = np.concatenate([z, -z]), np.tile(weight, 2)
    phi = pi * (np.arange(quadrature) + 0.5) / quadrature
    sine = np.sqrt(1 - z * z)[:, None]
    s = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), z[:, None])).reshape(3, -1)
    view, normal = np.array([np.sqrt(max(1 - cosine**2, 0.0)), 0.0, cosine]), np.array([0.0, 0.0, 1.0])
    centres = {Centre.NORMAL: normal, Centre.REFLECTION: reflect(view, normal)}
    value = sum(
        np.stack(np.broadcast_arrays(*lobe.evaluate(s, view, centres[lobe.centre], normal), s[0])[:3]) for lobe in lobes
    )
    l = np.array([isqrt(k) for k in range(n * n)])
    even = np.arange(n * n) - l * l - l >= 0  # y_lm of m < 0 is odd in y
    return (value * np.repeat(weight * 2 * pi / quadrature, quadrature)) @ (basis(n - 1, s.T) * even[:, None]).T


def views(size: int) -> Array:
    """Return the view directions (S, S, 3) of a map's texel centres: row i at b, column j at a, from -1 to 1.

    The square goes to the disk concentrically (Shirley and Chiu 1997), and that to the hemisphere, z = 1 - r^2: both
    keep ratios of areas.
    """
    b, a = np.meshgrid(*2 * [(2 * np.arange(size) + 1) / size - 1], indexing="ij")
    return hemisphere(np.stack([a, b], axis=-1))


def hemisphere(square: Array) -> Array:
    """Return directions (..., 3) of points (a, b) in [-1, 1]^2."""
    a, b = square[..., 0], square[..., 1]
    wide = np.abs(a) > np.abs(b)
    r = np.where(wide, a, b)
    ratio = np.where(wide, b, a) / np.where(r == 0, 1, r)
    phi = np.where(wide, pi / 4 * ratio, pi / 2 - pi / 4 * ratio)
    across = r * np.sqrt(2 - r * r)
    return np.stack([across * np.cos(phi), across * np.sin(phi), 1 - r * r], axis=-1)


def square(direction: Array) -> Array:
    """Return the points (..., 2) of the square that `hemisphere` takes to directions with z >= 0."""
    return np.stack(_square(*np.moveaxis(direction, -1, 0)), axis=-1)


def _square(x: Any, y: Any, z: Any) -> tuple[Any, Any]:
    xp = namespace(x, y, z)
    r = xp.sqrt((x * x + y * y) / (1 + xp.maximum(z, 0.0)))
    phi = xp.arctan2(y, x)
    quarter = xp.floor(phi / (pi / 2) + 0.5)  # -2 ... 2, towards -a, -b, +a, +b and -a
    along = r * (phi - pi / 2 * quarter) / (pi / 4)
    a = xp.where(quarter == 0, r, xp.where(quarter == 1, -along, xp.where(quarter == -1, along, -r)))
    b = xp.where(quarter == 0, along, xp.where(quarter == 1, r, xp.where(quarter == -1, -r, -along)))
    return a, b


def view_factors(brdf: Factored, view: Array, frames: Array, rotations: Array | None = None) -> NDArray[np.float32]:
    """Return u(v) at points, (V, n_b, 3), bilinear in the map; zero where the viewer is below the horizon.

    Beyond the outermost texels' centres their values are kept.

    Parameters
    ----------
    view : (V, 3)
        To the viewer, as posed.
    frames : (V, 3, 3)
        `frames` of the points at rest.
    rotations : (V, 3, 3), optional
        Rest to posed.

    Raises
    ------
    BadInput
        Arrays of other shapes.
    """
    V, size, count = len(view), len(brdf.factors), len(brdf.rows)
    if view.shape != (V, 3) or any(m.shape != (V, 3, 3) for m in (frames, rotations) if m is not None):
        shapes = [None if m is None else m.shape for m in (view, frames, rotations)]
        raise BadInput(f"views (V, 3) need frames and rotations (V, 3, 3). Got {shapes} instead.")
    if not V:
        return np.zeros((0, count, 3), np.float32)
    values = Bilinear(brdf.factors.reshape(size, size, -1))
    import drjit as dr

    local = floats(points_last(view))
    for matrix in (rotations, frames):
        if matrix is not None:
            local = applied(transposed(floats(points_last(matrix))), local)
    a, b = (dr.clip((t + 1) * (size / 2) - 0.5, 0, size - 1) for t in _square(*local))
    u = [dr.select(local[2] > 0, value, 0) for value in values.at(b, a)]
    dr.eval(u)
    dr.sync_thread()
    return np.stack([np.array(value) for value in u], axis=-1).reshape(V, count, 3)


def frames(normals: Array) -> Array:
    """Return matrices (V, 3, 3) that take a point's frame, normal z, to the shape's: columns are the frame's axes."""
    tangent = perpendicular(normals)
    return np.stack([tangent, np.cross(normals, tangent), normals], axis=-1)


def unshadowed(rows: Array, frames: Array) -> Array:
    """Return M' (V, n_b, n^2) where nothing is in the way: T turns the light into the point's frame."""
    return np.asarray(rotate(rows, frames[:, None]), float)


def specialise(
    rows: Array,
    frames: Array,
    directions: Array,
    visible: NDArray[np.generic],
    solid_angle: float | Array | None = None,
) -> Array:
    """Return M' (V, n_b, n^2) with shadows, from rays: M'_j,lm = int b_j(F^-1 s) V(s) y_lm(s) ds, b_j row j of Sigma V.

    T itself is never made. It is what `rows` = the identity would give.

    Parameters
    ----------
    rows : (n_b, n^2)
    frames : (V, 3, 3)
        F, from the point's frame to the shape's.
    directions : (K, 3) for all points, or (V, K, 3)
        In the shape's frame.
    visible : (V, K)
        V(s): 1 or True where a ray gets away; 0 below the horizon.
    solid_angle : float, (K,) or (V, K), optional
        What a direction stands for, in sr; default 4 pi / K, for directions uniform over the sphere.

    Raises
    ------
    BadInput
        Arrays of other shapes.
    """
    V, K = len(frames), directions.shape[-2]
    if frames.shape != (V, 3, 3) or directions.shape not in ((K, 3), (V, K, 3)) or visible.shape != (V, K):
        raise BadInput(
            "rows need frames (V, 3, 3), directions (K, 3) or (V, K, 3), and what is visible (V, K). "
            f"Got {frames.shape}, {directions.shape} and {visible.shape} instead."
        )
    n = isqrt(rows.shape[-1])
    turned = unshadowed(rows, frames)
    weight = np.broadcast_to(4 * pi / K if solid_angle is None else solid_angle, (V, K))
    shared = basis(n - 1, directions) if directions.ndim == 2 else None
    out = np.empty_like(turned)
    step = max(1, _FLOATS // (K * (len(rows) + (0 if shared is not None else n * n))))
    for start in range(0, V, step):
        batch = slice(start, start + step)
        if shared is None:
            y = basis(n - 1, directions[batch].reshape(-1, 3)).reshape(n * n, -1, K).transpose(1, 0, 2)
        else:
            y = shared
        out[batch] = (turned[batch] @ y * (visible[batch] * weight[batch])[:, None]) @ np.swapaxes(y, -1, -2)
    return out


def errors(rows: Array, count: int, fitted: Array | None = None, light: Array | None = None) -> Errors:
    """Return what the left-out rows cost, and what fitting the others costs besides (figure 4).

    U's columns are orthonormal over the map's views and channels, so that sums of squares over rows are sums over them.

    Parameters
    ----------
    rows : (V, n^2, n^2)
        M' with no singular value left out (`factor` with count n^2).
    count : int
        n_b, rows kept.
    fitted : (V, n_b, n^2), optional
        What stands in for those kept.
    light : (n^2, C), optional
        Measure radiance under this light; without it that under white noise, for which each harmonic weighs the same.
    """
    light = np.eye(rows.shape[-1]) if light is None else light
    whole = float(np.sum((rows @ light) ** 2)) or 1.0
    fit = 0.0 if fitted is None else float(np.sum(((fitted - rows[:, :count]) @ light) ** 2))
    return Errors(float(np.sqrt(np.sum((rows[:, count:] @ light) ** 2) / whole)), float(np.sqrt(fit / whole)))
