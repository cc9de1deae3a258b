"""What to know of a BRDF before trusting it: reciprocity, energy, negative values; and its plot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from data_gen import quasirandom
from data_gen.measured.tabulated import Tabulated
from envbench.directions import Array, from_angles
from envbench.material import Centre, Lobe, Material

ALBEDO_DEGREES = (0.0, 30.0, 45.0, 60.0, 75.0, 80.0)
LIGHT_DEGREES = (0.0, 30.0, 60.0, 80.0)
_DRAWS = 4096
_GRAZING = np.cos(np.deg2rad(89.0))
"""Pairs with a direction nearer to the horizon are left out of the reciprocity: rho_hat / N.L may be unbounded."""
_NORMAL, _TANGENT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class BrdfFacts:
    """What `check` finds.

    Attributes
    ----------
    reciprocity : float
        RMS of f(L, V) - f(V, L) over the RMS of f = rho_hat / N.L, over cosine-weighted pairs; 0 is ideal.
    negative : float
        Share of those pairs at which a channel of the source was negative before clamping; 0 for an analytic lobe.
    albedo : tuple of (degrees, r, g, b)
        Integral of rho_hat over L by the angle of V to N, in the plane of N and T; of a whole lobe, over the sphere.
    notes : tuple of str
        What the figures leave out.
    """

    reciprocity: float
    negative: float
    albedo: tuple[tuple[float, float, float, float], ...]
    notes: tuple[str, ...] = ()


def check(material: Material) -> BrdfFacts:
    """Measure a BRDF by quasi-Monte Carlo with the lobes' own samples; its texture is left out."""
    lobes = material.lobes
    about_tangent = any(lobe.centre is Centre.TANGENT for lobe in lobes)
    return BrdfFacts(
        reciprocity=_reciprocity(lobes),
        negative=max((lobe.table.negative for lobe in lobes if isinstance(lobe, Tabulated)), default=0.0),
        albedo=_albedo(lobes),
        notes=("a lobe about T: the albedo is of views in the plane of N and T alone",) if about_tangent else (),
    )


def notes(facts: BrdfFacts) -> tuple[str, ...]:
    """Return a line for each thing that a passive surface would not do, with the number."""
    lines: list[str] = []
    if facts.reciprocity > 0.01:
        lines.append(f"not reciprocal: f(L, V) and f(V, L) differ by {facts.reciprocity:.1%} RMS")
    angle, highest = max(((row[0], max(row[1:])) for row in facts.albedo), key=lambda pair: pair[1])
    if highest > 1.001:
        lines.append(f"gains energy: its albedo is {highest:.3f} at {angle:g} degrees")
    return (*lines, *facts.notes)


def slices(material: Material) -> Iterator[tuple[float, tuple[float, ...], tuple[float, ...]]]:
    """Yield the lobe plot: light's angle, views' angles in the plane of incidence, and rho_hat, the mean of r, g, b.

    Degrees; a negative view is on the light's side. Views gather about the mirror direction.
    """
    near = np.geomspace(0.01, 30, 60)
    for angle in LIGHT_DEGREES:
        views = np.concatenate([np.linspace(-89, 89, 179), angle - near, angle + near, [angle]])
        views = np.unique(views[np.abs(views) <= 89])
        light = from_angles(np.deg2rad(-angle), 0.0)[:, None]
        value = _sum(material.lobes, light, from_angles(np.deg2rad(views), 0.0).T).mean(0)
        yield angle, tuple(views.tolist()), tuple(value.tolist())


def _albedo(lobes: tuple[Lobe, ...]) -> tuple[tuple[float, float, float, float], ...]:
    u = quasirandom.points(_DRAWS, 2)
    total = np.zeros((len(ALBEDO_DEGREES), 3))
    for k, angle in enumerate(ALBEDO_DEGREES):
        view = np.broadcast_to(from_angles(np.deg2rad(angle), 0.0)[:, None], (3, _DRAWS))
        for lobe in lobes:
            frame = (view, _centre(lobe, view), np.broadcast_to(_NORMAL[:, None], view.shape))
            light = np.stack(lobe.sample((u[0], u[1]), *frame))
            density = np.where((light**2).sum(0) > 0.5, lobe.density(light, *frame), 0.0)
            value = np.stack(lobe.evaluate(light, *frame))
            total[k] += np.where(density > 0, value / np.where(density > 0, density, 1), 0.0).mean(1)
    return tuple((angle, float(r), float(g), float(b)) for angle, (r, g, b) in zip(ALBEDO_DEGREES, total, strict=True))


def _reciprocity(lobes: tuple[Lobe, ...]) -> float:
    """Draw V by the cosine, and L by the cosine or a lobe; weigh by what cosine-weighted pairs would be."""
    u = quasirandom.points(_DRAWS, 5)
    view = _cosine(u[0], u[1])
    light = _cosine(u[2], u[3])
    choice = np.floor(u[4] * 2 * len(lobes)).astype(int)  # the upper half of the choices is the cosine
    normal = np.broadcast_to(_NORMAL[:, None], view.shape)
    for k, lobe in enumerate(lobes):
        drawn = np.stack(lobe.sample((u[2], u[3]), view, _centre(lobe, view), normal))
        light = np.where(choice == k, drawn, light)
    kept = np.minimum(light[2], view[2]) > _GRAZING
    light, view, normal = light[:, kept], view[:, kept], normal[:, kept]
    by_cosine = light[2] / np.pi
    densities = [lobe.density(light, view, _centre(lobe, view), normal) for lobe in lobes]
    weight = by_cosine / (by_cosine / 2 + np.sum(densities, axis=0) / (2 * len(lobes)))
    f, swapped = _sum(lobes, light, view) / light[2], _sum(lobes, view, light) / view[2]
    square = float(np.sum(weight * f**2))
    return float(np.sqrt(np.sum(weight * (f - swapped) ** 2) / square)) if square > 0 else 0.0


def _cosine(u: Array, v: Array) -> Array:
    return from_angles(np.arccos(np.sqrt(u)), 2 * np.pi * v).T


def _sum(lobes: tuple[Lobe, ...], light: Array, view: Array) -> Array:
    """Return rho_hat of all lobes, (3, n), N = z and T = x."""
    shape = np.broadcast_shapes(light.shape, view.shape)
    light, view = np.broadcast_to(light, shape), np.broadcast_to(view, shape)
    normal = np.broadcast_to(_NORMAL[:, None], shape)
    values = [np.stack(lobe.evaluate(light, view, _centre(lobe, view), normal)) for lobe in lobes]
    return np.sum(values, axis=0)


def _centre(lobe: Lobe, view: Array) -> Array:
    match lobe.centre:
        case Centre.REFLECTION:
            return view * np.array([-1.0, -1.0, 1.0])[:, None]
        case Centre.NORMAL:
            return np.broadcast_to(_NORMAL[:, None], view.shape)
        case Centre.TANGENT:
            return np.broadcast_to(_TANGENT[:, None], view.shape)
