"""Where a tabulated BRDF sends light: for each view, how likely each tilt of the half vector is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.polar import about
from data_gen.measured.table import Packed, Table, coordinates
from envbench.arrays import dot, namespace
from envbench.directions import Array, from_angles

VIEWS, TILTS, AZIMUTHS = 48, 128, 24
"""Intervals of theta_o in [0, pi / 2] and of t (`Table`), a power of two, and samples of H's azimuth in [0, pi]."""
_SHARES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.95)
"""Parts of the draws that may be given to the cosine: never none, so that no weight is unbounded."""
_SQUARES = np.linspace(0, 1, TILTS + 1) ** 2
_V = np.sin(np.arctan2(_SQUARES, 1 - _SQUARES) / 2) ** 2
"""sin^2(theta_h / 2) at the edges of the intervals: solid angle over 4 pi."""


@dataclass(frozen=True)
class HalfVectors:
    """Draws L from a mixture of the cosine about N and of tabulated half vectors.

    A tilt interval is drawn by its share of the reflected light, H uniformly over the ring that it spans. With p_H its
    density per sr, L has p(L) = c N.L / pi + (1 - c) p_H / (4 H.V), c the part that serves this view best.

    Attributes
    ----------
    bins : (VIEWS * TILTS, 4)
        Sum of the shares before the interval, its share, sin^2(theta_h / 2) where it begins, and how far it runs.
    cosine : (VIEWS,)
    """

    bins: Packed
    cosine: Packed

    @classmethod
    def of(cls, table: Table) -> HalfVectors:
        """Weigh the rings by quadrature: f N.L 4 (H.V) dH, pooled over r, g and b."""
        reflected = Reflected.of(table)
        energy, solid = reflected.energy, reflected.solid
        share = energy.sum(-1) + 1e-12 * energy.sum((1, 2))[:, None] + 1e-30
        share /= share.sum(1, keepdims=True)
        by_half = (share / (4 * np.pi * np.diff(_V)))[..., None] * reflected.halves / np.maximum(solid, 1e-30)
        by_cosine = np.maximum(reflected.light[..., 2], 0) / np.pi
        # the second moment of a draw's weight is the integral of value^2 / density, with energy = value dw
        second = [
            np.sum(energy**2 / np.maximum(solid * (c * by_cosine + (1 - c) * by_half), 1e-30), axis=(1, 2))
            for c in _SHARES
        ]
        cosine = np.array(_SHARES)[np.argmin(second, axis=0)]
        before = np.cumsum(share, axis=1) - share
        bins = np.stack(np.broadcast_arrays(before, share, _V[:-1], np.diff(_V)), -1)
        return cls(Packed(bins.reshape(-1, 4).astype(np.float32)), Packed(cosine.astype(np.float32)))

    def sample(self, u: tuple[Any, Any], view: Any, normal: Any) -> tuple[Any, Any, Any]:
        """Map two uniform numbers to L; a zero vector for a view below the horizon, or H beyond V."""
        xp = namespace(u[0], view[0], normal[0])
        row = _row(view, normal)
        c = self.cosine.at(row)
        diffuse = u[0] < c
        rest = xp.minimum(xp.where(diffuse, u[0] / c, (u[0] - c) / (1 - c)), 1 - 6e-8)
        azimuth = 2 * np.pi * u[1]
        tilt = self._tilt(row, rest)  # sin^2 of half the angle: keeps small tilts in single precision
        x, y, z = about(normal, xp.sqrt(rest), xp.sqrt(1 - rest), azimuth)
        h = about(normal, 1 - 2 * tilt, 2 * xp.sqrt(tilt * (1 - tilt)), azimuth)
        cosine = dot(view, h)
        seen, mirrored = dot(view, normal) > 0, cosine > 0
        drawn = (xp.where(diffuse, a, xp.where(mirrored, 2 * cosine * b - v, 0.0))
                 for a, b, v in zip((x, y, z), h, view, strict=True))  # fmt: skip
        x, y, z = (xp.where(seen, a, 0.0) for a in drawn)
        return x, y, z

    def density(self, light: Any, view: Any, normal: Any) -> Any:
        """Return the density per sr of `sample`."""
        xp = namespace(light[0], view[0], normal[0])
        row, t = _row(view, normal), coordinates(light, view, normal)[0]
        c = self.cosine.at(row)
        share, _, width = self.bins.at(row * TILTS + xp.minimum(xp.floor(t * TILTS), TILTS - 1.0))[1:4]
        h = tuple(a + b for a, b in zip(light, view, strict=True))
        halfway = 0.5 * xp.sqrt(dot(h, h))  # H.V
        by_half = share / (16 * np.pi * width * xp.maximum(halfway, 1e-6))
        upward = (dot(normal, h) > 0) & (halfway > 1e-6)
        value = c * xp.maximum(dot(normal, light), 0.0) / np.pi + (1 - c) * xp.where(upward, by_half, 0.0)
        return xp.where(dot(view, normal) > 0, value, 0.0)

    def _tilt(self, row: Any, u: Any) -> Any:
        """Return sin^2(theta_h / 2) below which lies the part `u`: bisection over the intervals of a row."""
        xp = namespace(row, u)
        first, step = row * TILTS, TILTS // 2
        found = first
        while step:
            found = xp.where(self.bins.at(found + step)[0] <= u, found + step, found)
            step //= 2
        before, share, start, width = self.bins.at(found)
        return start + width * xp.minimum(xp.maximum((u - before) / share, 0.0), 1.0)


@dataclass(frozen=True)
class Reflected:
    """What a table reflects, by quadrature over H: VIEWS views, TILTS rings, AZIMUTHS samples of half a ring.

    Attributes
    ----------
    view : (VIEWS, 3)
    light : (VIEWS, TILTS, AZIMUTHS, 3)
    halves, solid : (TILTS, 1), (VIEWS, TILTS, AZIMUTHS)
        Solid angle of a sample in H, and in L: dL = 4 (H.V) dH; 0 where H.V <= 0.
    energy : (VIEWS, TILTS, AZIMUTHS)
        f N.L dL, the mean of r, g and b.
    """

    view: Array
    light: Array
    halves: Array
    solid: Array
    energy: Array

    @classmethod
    def of(cls, table: Table) -> Reflected:
        view = from_angles(np.pi / 2 * (np.arange(VIEWS) + 0.5) / VIEWS, 0.0)
        tilt = np.arccos(1 - (_V[:-1] + _V[1:]))[:, None]
        h = from_angles(tilt, np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS)
        cosine = np.einsum("vk,tak->vta", view, h)
        light = 2 * cosine[..., None] * h - view[:, None, None]
        halves = 4 * np.pi * np.diff(_V)[:, None] / AZIMUTHS
        solid = 4 * np.maximum(cosine, 0) * halves
        value = np.zeros_like(solid)
        up = (light[..., 2] > 0) & (cosine > 0)
        axes = light[up].T, np.broadcast_to(view[:, None, None], light.shape)[up].T
        f = table.lookup(*coordinates(*axes, np.array([0.0, 0.0, 1.0])))
        value[up] = np.mean(f, axis=0) * axes[0][2]
        return cls(view, light, halves, solid, value * solid)

    def within(self, angles: Array) -> Array:
        """Return the least share over the views, (n,), of what is reflected within `angles` (n,) of R."""
        away = np.arccos(np.clip(np.einsum("vtak,vk->vta", self.light, self.view * [-1, -1, 1]), -1, 1))
        least = np.ones(len(angles))
        for weights, angle in zip(self.energy.reshape(VIEWS, -1), away.reshape(VIEWS, -1), strict=True):
            order = np.argsort(angle)
            held = np.concatenate([[0.0], weights[order].cumsum()])
            if held[-1] > 0:
                least = np.minimum(least, held[np.searchsorted(angle[order], angles)] / held[-1])
        return least


def _row(view: Any, normal: Any) -> Any:
    xp = namespace(view[0], normal[0])
    theta = xp.arccos(xp.minimum(xp.maximum(dot(view, normal), 0.0), 1.0))
    return xp.minimum(xp.floor(theta * (2 * VIEWS / np.pi)), VIEWS - 1.0)
