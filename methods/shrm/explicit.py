"""From a local SHRM to explicit reflection maps, and back (RH 2002, appendix C, last paragraph).

An SHRM is a finite sum over its planes, B = sum_k plane_k(alpha, beta) basis_k(theta_o, phi_o), so a table of B at
given view directions is a matrix product, and a table gives the planes back by linear least squares. All of it happens
at the maps' own S x W central directions, at the pixel centres.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from envbench import latlong
from envbench.directions import from_angles, to_local
from envbench.errors import BadInput
from envbench.harmonics import threads
from envbench.material import Centre
from methods.angular.prefilter import widest_view
from methods.shrm import maps
from methods.shrm.coefficients import LobeCoefficients

Array = NDArray[np.float64]
Planes = NDArray[np.floating]
"""(3, K, S, W), as `methods.shrm.maps.synthesise` returns them."""


def polar_nodes(centre: Centre, count: int) -> Array:
    """Return the theta_o of a table's `count` maps: evenly from 0 to `widest_view`."""
    return np.linspace(0, widest_view(centre), count)


def local_views(centre: Centre, count: int) -> Array:
    """Return a table's T x T view directions in the frame of the central direction, (T, T, 3); `count` is T."""
    return from_angles(polar_nodes(centre, count)[:, None], 2 * np.pi * np.arange(count) / count)


def views(lobe: LobeCoefficients, planes: Planes, count: int) -> NDArray[np.float32]:
    """Tabulate B(alpha, beta, theta_o, phi_o) at T x T local view directions, T = `count`.

    Returns
    -------
    (S, W, T, T, 3)
        In the layout of `methods.angular.lookup.look_up`. One product of (S W, 3 K) by (3 K, 3 T T), whose second
        factor is the basis at the T x T directions, once a channel: the zeros cost less than moving the channels would.
    """
    _, _, rows, columns = planes.shape
    at_views = maps.basis(lobe, local_views(lobe.centre, count).reshape(-1, 3)).astype(np.float32)
    by_channel = np.einsum("kt,cd->cktd", at_views, np.eye(3, dtype=np.float32)).reshape(3 * len(at_views), -1)
    stored = planes.astype(np.float32, copy=False).reshape(3 * len(at_views), -1)
    return (stored.T @ by_channel).reshape(rows, columns, count, count, 3)


def seen_from(lobe: LobeCoefficients, planes: Planes, directions: ArrayLike) -> Planes:
    """Tabulate the radiance towards fixed global view directions (k, 3), over all central directions: (k, 3, S, W).

    Cabral's prerendered maps, for the vertices of an icosahedron (equation 12 without the dynamic map's frame).
    """
    centre = latlong.grid(*planes.shape[2:]).reshape(-1, 3)

    def one(view: Array) -> Planes:
        weights = maps.basis(lobe, to_local(view, centre)).astype(planes.dtype, copy=False)
        return np.einsum("kn,ckn->cn", weights, planes.reshape(*planes.shape[:2], -1))

    with ThreadPoolExecutor(threads()) as pool:
        seen = np.stack(list(pool.map(one, np.asarray(directions, float))))
    return seen.reshape(len(seen), 3, *planes.shape[2:])


def averaged(lobe: LobeCoefficients, planes: Planes, theta_o: ArrayLike) -> Planes:
    """Tabulate the mean of B over phi_o, sum_p B_p0 Y_p0(theta_o), at polar angles (n,): shape (3, n, S, W).

    The 3D texture of Kautz and McCool 2000.
    """
    weights = zonal_basis(lobe, theta_o).astype(planes.dtype, copy=False)
    return np.einsum("pt,cpsw->ctsw", weights, planes[:, _zonal(lobe)], optimize=True)


def zonal_basis(lobe: LobeCoefficients, theta_o: ArrayLike) -> Array:
    """Return Y_p0 at polar angles (n,), (P + 1, n); 1 for a radially symmetric lobe."""
    return maps.basis(lobe, from_angles(theta_o, 0.0))[_zonal(lobe)]


def _zonal(lobe: LobeCoefficients) -> list[int]:
    """Return the planes with q = 0."""
    return [plane for _, q, plane in maps.terms(lobe.P, lobe.F, lobe.Q) if q == 0]


def fit(lobe: LobeCoefficients, table: NDArray[np.floating]) -> Planes:
    """Return the planes that come nearest to a T x T table in the mean square over the view's sphere; undoes `views`.

    Parameters
    ----------
    lobe : LobeCoefficients
        Says which terms there are: the orders P and F, and the central direction.
    table : (S, W, T, T, 3)

    Returns
    -------
    (3, K, S, W)
        Exact where the table is a sum of these terms; a table about N, seen from the hemisphere alone, leaves the terms
        less than independent, and the least of several solutions is taken.

    Raises
    ------
    BadInput
        Where T <= 2 P: the azimuths cannot tell the terms apart.
    """
    rows, columns, count = table.shape[:3]
    if count <= 2 * lobe.P:
        raise BadInput(
            f"a table of {count} x {count} views cannot give order P = {lobe.P}: lower P or take T >= {2 * lobe.P + 1}."
        )
    basis = maps.basis(lobe, local_views(lobe.centre, count).reshape(-1, 3))
    weight = np.sqrt(np.repeat(_bands(lobe.centre, count), count))
    solve = np.linalg.pinv((basis * weight).T) * weight  # (K, T T)
    by_channel = np.moveaxis(table, -1, 0).reshape(3, rows * columns, -1)
    return (solve.astype(table.dtype) @ by_channel.transpose(0, 2, 1)).reshape(3, len(basis), rows, columns)


def _bands(centre: Centre, count: int) -> Array:
    """Return the solid angle of the band of views nearest to each polar node, but for a common factor: (T,)."""
    nodes = polar_nodes(centre, count)
    edges = np.concatenate([nodes[:1], (nodes[1:] + nodes[:-1]) / 2, nodes[-1:]])
    return np.cos(edges[:-1]) - np.cos(edges[1:])
