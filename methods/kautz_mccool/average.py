"""The 2D BRDF of Kautz and McCool: a lobe averaged over azimuth about an axis, for each theta_o of a table.

About its own central direction C the average u(theta_i, theta_o) is what the terms q = 0 of an SHRM hold. A lobe that
is off-specular, or cut by the horizon, is more nearly symmetric about another axis in the plane of incidence, turned
from C towards V by the angle delta(theta_o). In the L2 sense averaging is the projection onto what is symmetric about
the axis, and keeps the lobe's integral, so each theta_o's energy is scaled as it has to be.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from envbench.directions import from_angles
from envbench.harmonics import threads
from envbench.material import Centre, Lobe
from methods.angular.prefilter import widest_view
from methods.shrm.explicit import polar_nodes

Array = NDArray[np.float64]

AZIMUTHS = 96
"""Intervals of phi in [0, pi]: the lobe is even in it."""
GRAZING = 1e-3
"""How far short of grazing, in theta_o, the last angle is evaluated: there many lobes divide by N.V = 0."""
_TAIL = 1e-12
"""Part of a lobe that may lie beyond the nodes."""


@dataclass(frozen=True, eq=False)
class Average:
    """A lobe averaged over azimuth, at T polar angles of the view.

    Attributes
    ----------
    centre : Centre
    shift : (T,)
        delta in radians, the axis' turn from the central direction towards the view.
    theta, weight : (n,)
        Quadrature over the polar angle about the axis: the weights hold 2 pi sin(theta).
    values : (C, T, n)
        u at the nodes in 1/sr, times reflectance; C = 1 where r, g and b are equal, else 3.
    total, lost : (2 T - 1,)
        Energy of the lobe, the integral of rho_hat^2 over the sphere, and what of it the table misses: at its angles
        what is not symmetric about the axis, half-way between two of them also what linear interpolation leaves.
    """

    centre: Centre
    shift: Array
    theta: Array
    weight: Array
    values: Array
    total: Array
    lost: Array
    uneven: Array

    @property
    def integral(self) -> Array:
        """What constant light of radiance 1 returns, (T,), mean of the channels."""
        return (self.values @ self.weight).mean(0)

    @property
    def energy(self) -> Array:
        """Energy of the average, (T,), summed over the channels."""
        return (self.values**2).sum(0) @ self.weight

    @property
    def missing(self) -> float:
        """The share of the lobe's energy that the table loses."""
        total = self.over_views(self.total)
        return self.over_views(self.lost) / total if total > 0 else 0.0

    def cone(self, eps: float) -> Array:
        """Return the half-angle about the axis that holds 1 - eps of the integral at each view angle, (T,)."""
        held = np.cumsum((self.values * self.weight).sum(0), axis=-1)
        return self.theta[np.argmax(held >= (1 - eps) * held[:, -1:], axis=1)]

    def energy_within(self, eps: float) -> Array:
        """Energy of the average inside `cone`, (T,)."""
        return np.sum((self.values**2).sum(0) * self.weight * (self.theta <= self.cone(eps)[:, None]), axis=1)

    def over_views(self, energy: Array) -> float:
        """Return the mean over uniform (R, V), r, g and b together, of an energy at the table's angles or also between.

        By trapezoids (T,), or by Simpson's rule (2 T - 1,).
        """
        theta = polar_nodes(self.centre, len(energy))
        # N is the half vector of R and V, and a tangent any direction across it
        weight = {
            Centre.REFLECTION: np.sin(theta), Centre.NORMAL: np.sin(2 * theta), Centre.TANGENT: np.sin(theta) ** 2
        }[self.centre]  # fmt: skip
        if len(energy) > len(self.shift):
            weight[1::2] *= 2
        mean = float(energy[0]) if len(energy) == 1 else float(energy @ weight / weight.sum())
        return mean * 3 / len(self.values)

    def zonal(self, order: int) -> Array:
        """Return g_l = int u P_l over the sphere, (C, T, order + 1)."""
        legendre: Array = special.legendre_p_all(order, np.cos(self.theta))[0]
        return (self.values * self.weight) @ legendre.T


def averaged(lobe: Lobe, polar: int, shifted: bool, order: int) -> Average:
    """Average a lobe over azimuth at `polar` view angles, with nodes enough for degrees up to `order`.

    A radially symmetric lobe needs one angle and no shift. With `shifted`, the axis at each angle is the mean direction
    of the squared lobe, where its energy is (within .002 of the best axis' energy on the lobes tried); the lobe's own
    centre is kept where that holds more.
    """
    if lobe.radially_symmetric:
        return _average(lobe, np.zeros(1), np.zeros(1), order)
    views = polar_nodes(lobe.centre, polar)
    plain = _average(lobe, views, np.zeros(polar), order)
    if not shifted or lobe.azimuthally_symmetric:
        return plain
    with ThreadPoolExecutor(threads()) as pool:
        shift = np.array(list(pool.map(lambda view: _centroid(lobe, view), views)))
    moved = _average(lobe, views, shift, order)
    return moved if moved.missing < plain.missing else plain


def _average(lobe: Lobe, views: Array, shift: Array, order: int) -> Average:
    theta, weight = _nodes(min(lobe.cone(_TAIL) + float(np.abs(shift).max()), np.pi), max(4 * order, 256))
    dense = np.linspace(views[0], views[-1], 2 * len(views) - 1)
    with ThreadPoolExecutor(threads()) as pool:
        rings = pool.map(lambda v, s: _rings(lobe, v, s, theta, weight), dense, np.interp(dense, views, shift))
        means, totals = map(np.stack, zip(*rings, strict=True))  # (2 T - 1, C, n), (2 T - 1,)
    interpolated = means.copy()
    interpolated[1::2] = (means[:-1:2] + means[2::2]) / 2
    # the square of what linear interpolation leaves, (t (1 - t))^2, has a mean of 8/15 of its middle: Simpson takes 2/3
    lost = totals - (means**2 - 0.8 * (means - interpolated) ** 2).sum(1) @ weight
    error = np.sqrt(0.8) * ((means - interpolated) @ weight).mean(1)
    values = means[::2].swapaxes(0, 1)
    return Average(lobe.centre, shift, theta, weight, values, totals, np.maximum(lost, 0), error)


def _nodes(end: float, count: int) -> tuple[Array, Array]:
    """Gauss-Legendre in t, theta = end t^2: fine about the axis, where a narrow lobe is."""
    t, w = special.roots_legendre(count)
    t, w = (t + 1) / 2, w / 2
    theta = end * t**2
    return theta, w * 2 * end * t * 2 * np.pi * np.sin(theta)


def _centroid(lobe: Lobe, theta_o: float) -> float:
    """Return the angle from C towards V of the mean direction of the squared lobe, where its energy is."""
    theta, weight = _nodes(lobe.cone(_TAIL), 192)
    light, values = _evaluate(lobe, theta_o, 0.0, theta)
    share = (values**2).sum(0) @ _azimuths() * weight
    across = ((values**2).sum(0) * light[0]) @ _azimuths() @ weight
    along = share @ np.cos(theta)
    return float(np.arctan2(across, along)) if share.sum() > 0 else 0.0


def _rings(lobe: Lobe, theta_o: float, shift: float, theta: Array, weight: Array) -> tuple[Array, float]:
    """Return the mean over azimuth (C, n) about the shifted axis, and the energy of the lobe there."""
    _, values = _evaluate(lobe, theta_o, shift, theta)
    azimuths = _azimuths()
    return values @ azimuths, float(((values**2) @ azimuths @ weight).sum())


def _azimuths() -> Array:
    """Weights of the mean over phi = 0 ... pi."""
    weights = np.full(AZIMUTHS + 1, 1 / AZIMUTHS)
    weights[[0, -1]] /= 2
    return weights


def _evaluate(lobe: Lobe, theta_o: float, shift: float, theta: Array) -> tuple[Array, Array]:
    """Evaluate the lobe in the frame of its centre (C = z, V in the xz plane) about an axis turned by `shift` to V.

    Returns the directions (3, n, phi) and the values (C, n, phi), zero without meaning where they are not finite.
    """
    if lobe.centre is not Centre.TANGENT:
        theta_o = min(theta_o, widest_view(lobe.centre) - GRAZING)
    polar_of_normal = {Centre.REFLECTION: theta_o / 2, Centre.NORMAL: 0.0, Centre.TANGENT: np.pi / 2}[lobe.centre]
    phi = np.pi * np.arange(AZIMUTHS + 1) / AZIMUTHS
    x, y, z = np.moveaxis(from_angles(theta[:, None], phi), -1, 0)
    light: Any = np.stack([np.cos(shift) * x + np.sin(shift) * z, y, np.cos(shift) * z - np.sin(shift) * x])
    view, centre, normal = (from_angles(polar, 0.0)[:, None, None] for polar in (theta_o, 0.0, polar_of_normal))
    grey = lobe.channels == 1 and len(set(lobe.reflectance)) == 1
    values = np.stack(np.broadcast_arrays(*lobe.evaluate(light, view, centre, normal)))
    return light, values[:1] if grey else values
