"""What the representation loses of a lobe's integral: by the cone and by texels, and between few views."""

from __future__ import annotations

import numpy as np

from envbench import latlong
from envbench.directions import Array, from_angles
from envbench.furnace import lobe_integrals
from envbench.geometry import Points
from envbench.material import Centre, Lobe, Material
from methods.angular.prefilter import polar_nodes, prefilter, widest_view, width


def of_prefiltering(lobe: Lobe, eps: float, light_rows: int) -> float:
    """Return the share of constant light that the sum over texels may be off by, over all R.

    The cone loses eps. Point samples, h <= w apart for a lobe of width w, sum a smooth lobe to within (h / w)^2 / 12,
    on a pole, where rows are rings; and the horizon, a jump of a clipped lobe, to within half a texel's strip of it,
    h / (2 w), where it passes within w of R: a share sin^2 w of all R.
    """
    w = width(lobe)
    step = min(np.pi / (light_rows or 64) / w, 1)
    strip = step / 2 * float(np.sin(min(w, np.pi / 2))) if lobe.clipped and not lobe.radially_symmetric else 0.0
    return eps + step**2 / 12 + strip


def of_ridges(lobe: Lobe, eps: float, light_rows: int, views: int) -> float:
    """Return the RMS error of sums over texels of constant light, relative to the RMS, over the maps of all views.

    No formula bounds it for a lobe that is narrower than its width in some views, as facets are near grazing: so it is
    taken from maps of 8 x 16 texels, each view's with its share of all views.
    """
    nodes = polar_nodes(lobe, views, light_rows)
    found = prefilter(np.ones((light_rows, 2 * light_rows, 3), np.float32), lobe, (8, 16), eps, views).mean(-1)
    exact = integrals((lobe,), lobe.centre, nodes)
    over_maps = latlong.solid_angles(8, 16)[:, 0] / (4 * np.pi) * 16
    square = np.einsum("rckm,r->k", (found - exact[:, None]) ** 2, over_maps) / (16 * views)
    theta = np.linspace(0, widest_view(lobe.centre), 16 * (views - 1) + 1)
    share = np.array([np.interp(theta, theta[::16], row) for row in np.eye(views)]) @ np.sin(theta)
    return float(np.sqrt(np.sum(square * share) / np.sum(exact**2 * share)))


def integrals(lobes: tuple[Lobe, ...], centre: Centre, theta: Array) -> Array:
    """Return what constant light of radiance 1 reflects, mean of r, g and b, by the angle of the view to a direction.

    Parameters
    ----------
    centre : Centre
        Which of R, N and T is looked from; lobes about another follow from it (N halfway from R to V).
    theta : (n,)
        Angles in radians: at most pi / 2 counts for N.

    Returns
    -------
    (n,) float64
    """
    view, axis = from_angles(theta, 0.0), np.tile([0.0, 0.0, 1.0], (len(theta), 1))
    polar = {Centre.REFLECTION: theta / 2, Centre.NORMAL: 0 * theta, Centre.TANGENT: 0 * theta + np.pi / 2}
    normal = from_angles(polar[centre], 0.0)
    points = Points(normal, normal, normal, axis, view, np.full(len(theta), 1 / len(theta)))
    return lobe_integrals(Material("lobes", lobes), points).mean(1)


def between_views(lobe: Lobe, nodes: Array) -> float:
    """Return the error of a lobe's integral between views, theta_o at `nodes`, relative to its RMS.

    The RMS over R (or T) uniform, and over N as it then lies, of linear interpolation between nodes that count as even.
    """
    even = np.linspace(0, widest_view(lobe.centre), len(nodes))
    theta = np.linspace(0, even[-1], 16 * (len(nodes) - 1) + 1)
    g, at_nodes = (integrals((lobe,), lobe.centre, angles) for angles in (theta, nodes))
    share = np.sin(2 * theta) if lobe.centre is Centre.NORMAL else np.sin(theta)
    error = np.interp(theta, even, at_nodes) - g
    return float(np.sqrt(np.sum(error**2 * share) / np.sum(g**2 * share)))


def shares(parts: list[tuple[tuple[Lobe, ...], Centre]]) -> list[float]:
    """Return how much each part of a BRDF, lobes looked at from one centre, weighs in the RMS of all.

    The RMS of a sum of non-negative functions is at least the root of the sum of their mean squares. So relative errors
    e_k of parts of RMS r_k make at most sum_k e_k r_k / sqrt(sum_k r_k^2) of the whole.
    """
    theta = np.arccos(np.linspace(1, -1, 33))
    rms: list[float] = []
    for lobes, centre in parts:
        angles = theta / 2 if centre is Centre.NORMAL else theta  # N lies midway between R and V
        rms.append(float(np.sqrt(np.mean(integrals(lobes, centre, angles) ** 2))))
    whole = float(np.linalg.norm(rms))
    return [part / whole if whole else 1.0 for part in rms]
