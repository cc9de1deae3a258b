"""What a blend of few views must lose: the error in a lobe's integral, read from other views than the one asked for."""

from __future__ import annotations

import numpy as np

from envbench.directions import Array, uniform
from envbench.material import Centre
from methods.angular.losses import integrals
from methods.cabral import icosahedron, spheremap
from methods.cabral.groups import Group
from methods.cabral.warp import UNTRUSTED, place, source

ANGLES = 65
DIRECTIONS = 1024
VIEWS = 16


def error_of_views(group: Group, maps: int, fade: float) -> float:
    """Return the error of blended integrals relative to their RMS: the RMS over directions, at the worst view.

    A lobe's integral depends on the angle of its centre and the view alone, g(theta_o), clipping included. Under
    constant light maps of any resolution therefore return sum_k w_k g(theta_k) for g(theta_o), the angles those of the
    three vertices and the view: no warp can mend it, and more views make it small.
    """
    if all(lobe.radially_symmetric for lobe in group.lobes):
        return 0.0
    theta = np.linspace(0, np.pi, ANGLES)
    g = integrals(group.lobes, group.index, theta)
    rng = np.random.default_rng(0)
    vertices, faces = icosahedron.sphere(maps)
    middle = vertices[faces[0]].sum(0)
    worst = 0.0
    for view in (middle / np.linalg.norm(middle), *uniform(VIEWS, rng)):
        shown = _shown(group.index, view, rng)
        axes = spheremap.frame(view)
        p = np.stack(spheremap.from_mirror(tuple((shown @ axes).T), (1.0, 0.0)), -1)
        blended, total = np.zeros(len(shown)), np.zeros(len(shown))
        for vertex, weight in zip(*icosahedron.subtended(maps, view), strict=True):
            seen = source(vertices[vertex], weight, axes)
            *_, trust = place(
                tuple((shown @ axes).T),
                (p[:, 0], p[:, 1]),
                seen.turn,
                seen.singular,
                group.index is Centre.NORMAL,
                fade,
            )
            share = weight * (trust + UNTRUSTED)
            blended += share * np.interp(np.arccos(np.clip(shown @ vertices[vertex], -1, 1)), theta, g)
            total += share
        truth = np.interp(np.arccos(np.clip(shown @ view, -1, 1)), theta, g)
        worst = max(worst, float(np.sqrt(np.mean((blended / total - truth) ** 2) / np.mean(truth**2))))
    return worst


def _shown(index: Centre, view: Array, rng: np.random.Generator) -> Array:
    """Return index directions (n, 3) of points whose mirror directions are uniform; of all tangents for T."""
    directions = uniform(DIRECTIONS, rng)
    if index is not Centre.NORMAL:
        return directions
    half = directions + view
    return half / np.linalg.norm(half, axis=1, keepdims=True)
