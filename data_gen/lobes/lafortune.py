"""The generalised cosine lobes of Lafortune et al. 1997, isotropic, with their diffuse part, about R."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_gen.lobes.draws import held_cone
from data_gen.lobes.phong import phong_density, phong_sample
from data_gen.lobes.polar import Vector, about
from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe

Colour = tuple[float, float, float]

MAX_COEFFICIENT = 10.0
MAX_EXPONENT = 1e4
_COSINE_SHARE = 0.1
"""Least part of the samples that are drawn by the cosine: it bounds the weights where no term's own lobe reaches."""


@dataclass(frozen=True, kw_only=True)
class Lafortune(Lobe):
    """rho = diffuse / pi + sum over terms of max(c_xy (l_x v_x + l_y v_y) + c_z l_z v_z, 0)^n, z along N; times N.L.

    `c_xy`, `c_z` and `n` hold one (r, g, b) a term. c_xy < 0 < c_z is a lobe about the mirror direction, c_xy > 0 a
    retro-reflective one. Terms are not normalised: their height is part of c and n, and nothing conserves energy.
    """

    diffuse: Colour = (0.0, 0.0, 0.0)
    c_xy: tuple[Colour, ...] = ()
    c_z: tuple[Colour, ...] = ()
    n: tuple[Colour, ...] = ()

    centre = Centre.REFLECTION
    channels = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.c_xy) == len(self.c_z) == len(self.n):
            counts = f"{len(self.c_xy)}, {len(self.c_z)} and {len(self.n)}"
            raise BadInput(f"lafortune c_xy, c_z and n must hold one (r, g, b) for each term. Got {counts} instead.")
        if not any(self.diffuse) and not self.n:
            raise BadInput("a lafortune lobe reflects nothing: give it a diffuse part, or c_xy, c_z and n of a term.")
        for name, low, high in (
            ("diffuse", 0, 1),
            ("c_xy", -MAX_COEFFICIENT, MAX_COEFFICIENT),
            ("c_z", -MAX_COEFFICIENT, MAX_COEFFICIENT),
            ("n", 0, MAX_EXPONENT),
        ):
            for value in np.ravel(getattr(self, name)):
                if not low <= value <= high:
                    raise BadInput(f"lafortune {name} must lie in [{low:g}, {high:g}]. Got {value} instead.")

    def profile(self, light: Any, view: Any, centre: Any, normal: Any) -> tuple[Any, ...]:
        xp = namespace(light[0], view[0], normal[0])
        cosine = dot(normal, light)
        upright = cosine * dot(normal, view)
        flat = dot(light, view) - upright
        values: list[Any] = []
        for channel in range(3):
            total = self.diffuse[channel] / np.pi
            for c_xy, c_z, n in self._terms(channel):
                base = c_xy * flat + c_z * upright
                total = total + xp.where(base > 0, xp.exp(n * xp.log(xp.maximum(base, 1e-30))), 0.0)
            values.append(total * xp.maximum(cosine, 0.0))
        return tuple(values)

    def sample(self, u: tuple[Any, Any], view: Any, centre: Any, normal: Any) -> Vector:
        """Draw by the cosine, or from one term's own Phong lobe: (c_xy l_x v_x + ...)^n = (w.L)^n."""
        xp = namespace(u[0], view[0], normal[0])
        proposals = self._proposals(view, normal)
        total = 1 / sum(mass for _, _, mass in proposals)
        lower, share = 0.0, proposals[0][2] * total
        v = xp.minimum(u[0] / share, 1.0)
        chosen = about(normal, xp.sqrt(v), xp.sqrt(1 - v), 2 * np.pi * u[1])
        for axis, n, mass in proposals[1:]:
            lower, share = lower + share, mass * total
            v = xp.minimum(xp.maximum((u[0] - lower) / xp.maximum(share, 1e-30), 0.0), 1.0)
            drawn = phong_sample((v, u[1]), axis, n)
            here = (u[0] >= lower) & (share > 0)
            chosen = tuple(xp.where(here, new, old) for new, old in zip(drawn, chosen, strict=True))
        return chosen[0], chosen[1], chosen[2]

    def density(self, light: Any, view: Any, centre: Any, normal: Any) -> Any:
        xp = namespace(light[0], view[0], normal[0])
        proposals = self._proposals(view, normal)
        total = proposals[0][2] * xp.maximum(dot(normal, light), 0.0) / np.pi
        for axis, n, mass in proposals[1:]:
            total = total + mass * phong_density(light, axis, n)
        return total / sum(mass for _, _, mass in proposals)

    def cone(self, eps: float) -> float:
        """Found from the lobe's own samples, for views up to grazing."""
        return held_cone(self, eps)

    def _terms(self, channel: int) -> list[tuple[float, float, float]]:
        parts = zip(self.c_xy, self.c_z, self.n, strict=True)
        return [(c_xy[channel], c_z[channel], n[channel]) for c_xy, c_z, n in parts]

    def _proposals(self, view: Any, normal: Any) -> list[tuple[Any, float, Any]]:
        """Return axis, exponent and mass of the cosine lobe (about N) and of each term's, channels taken together.

        w = c_xy (V - (N.V) N) + c_z (N.V) N. Where it points below the horizon, its part along it bounds w.L above.
        """
        xp = namespace(view[0], normal[0])
        upright = dot(normal, view)
        flat = tuple(v - upright * n for v, n in zip(view, normal, strict=True))
        parts: list[tuple[Any, float, Any]] = []
        for c_xy, c_z, exponents in zip(self.c_xy, self.c_z, self.n, strict=True):
            along, up, n = float(np.mean(c_xy)), xp.maximum(float(np.mean(c_z)) * upright, 0.0), min(exponents)
            w = tuple(along * f + up * z for f, z in zip(flat, normal, strict=True))
            length = xp.sqrt(xp.maximum(dot(w, w), 1e-20))
            axis = tuple(x / length for x in w)
            height = xp.maximum(dot(normal, axis), 0.5 / math.sqrt(n + 1))  # mean of N.L over the lobe, roughly
            exists = length > 1e-6
            axis = tuple(xp.where(exists, x, z) for x, z in zip(axis, normal, strict=True))
            mass = height * xp.exp(n * xp.log(length)) * (2 * np.pi / (n + 1))
            parts.append((axis, n, xp.where(exists, mass, 0.0)))
        terms = sum(mass for _, _, mass in parts)
        floor = 1e-6 + _COSINE_SHARE / (1 - _COSINE_SHARE) * terms
        return [(normal, 1.0, xp.maximum(float(np.mean(self.diffuse)), floor) + 0 * upright), *parts]
