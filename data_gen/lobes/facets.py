"""Geometry and reflectance of mirroring facets, whose normals are the half vectors H = (L + V) / |L + V|."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from data_gen.lobes.draws import held_cone
from data_gen.lobes.polar import Vector
from envbench.arrays import dot, namespace
from envbench.errors import BadInput
from envbench.material import Centre, Lobe

MIN_ROUGHNESS = 0.01


@dataclass(frozen=True, kw_only=True)
class Facets(Lobe):
    """A lobe of mirroring facets about N: rho_hat = D F G / (4 N.V), zero unless N.L > 0 and N.V > 0.

    F is Schlick's f0 + (1 - f0) (1 - V.H)^5 (Schlick 1994).

    Attributes
    ----------
    roughness : float
        In [0.01, 1].
    f0 : (r, g, b)
        Reflectance at normal incidence, in [0, 1].
    """

    roughness: float = 0.3
    f0: tuple[float, float, float] = (1.0, 1.0, 1.0)

    centre = Centre.REFLECTION
    channels = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = type(self).__name__
        if not MIN_ROUGHNESS <= self.roughness <= 1:
            raise BadInput(f"{kind} roughness must lie in [{MIN_ROUGHNESS:g}, 1]. Got {self.roughness} instead.")
        if len(self.f0) != 3 or not all(0 <= f <= 1 for f in self.f0):
            raise BadInput(f"{kind} f0 must be three numbers in [0, 1]. Got {self.f0} instead.")

    def cone(self, eps: float) -> float:
        """Found from the lobe's own samples, for views up to grazing."""
        return held_cone(self, eps)


@dataclass(frozen=True)
class Half:
    """H relative to N and V; tan^2 of N and H is `sine2` / `cosine2`, exact near the normal in single precision too."""

    cosine2: Any
    sine2: Any
    view: Any
    """V.H"""
    above: Any
    """Whether N.H > 0."""

    @classmethod
    def of(cls, light: Any, view: Any, normal: Any) -> Half:
        xp = namespace(light[0], view[0], normal[0])
        n, h = normal, (light[0] + view[0], light[1] + view[1], light[2] + view[2])
        cross = (n[1] * h[2] - n[2] * h[1], n[2] * h[0] - n[0] * h[2], n[0] * h[1] - n[1] * h[0])
        square, along = dot(h, h), dot(n, h)
        exists = square > 1e-12  # there is none for L = -V
        square = xp.maximum(square, 1e-12)
        sine2 = xp.where(exists, dot(cross, cross) / square, 1.0)
        return cls(along * along / square, sine2, 0.5 * xp.sqrt(square), exists & (along > 0))


def schlick(f0: tuple[float, float, float], cosine: Any) -> Vector:
    """Return F for r, g and b."""
    m = 1 - cosine
    power = m * m * m * m * m
    return f0[0] + (1 - f0[0]) * power, f0[1] + (1 - f0[1]) * power, f0[2] + (1 - f0[2]) * power


def mirrored(view: Any, half: Any, exists: Any) -> Vector:
    """Return V mirrored about H, or zero where it does not exist or sees the back of the facet."""
    xp = namespace(view[0], half[0])
    cosine = dot(view, half)
    seen = exists & (cosine > 0)
    x, y, z = (xp.where(seen, 2 * cosine * h - v, 0.0) for h, v in zip(half, view, strict=True))
    return x, y, z
