"""The furnace: what constant light of radiance 1 reflects, by quadrature, and how much of it clipping takes away."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from envbench.directions import Array, perpendicular
from envbench.geometry import Points
from envbench.material import Material
from envbench.scene import Scene

SAMPLED_POINTS = 24


def clipping(scene: Scene) -> str | None:
    """Say in one line what clipping the lobes at the horizon takes away at the points of a scene, or None."""
    if not any(lobe.clipped and not lobe.radially_symmetric for lobe in scene.material.lobes):
        return None
    points = scene.points.spread(SAMPLED_POINTS)
    whole = replace(scene.material, lobes=tuple(replace(lobe, clipped=False) for lobe in scene.material.lobes))
    kept = lobe_integrals(scene.material, points).sum(-1) / lobe_integrals(whole, points).sum(-1)
    return (
        f"lobes are clipped at the horizon: under constant light they reflect {1 - kept.mean():.2%} less than whole"
        f" ({1 - kept.min():.0%} less at the worst of {len(points)} points)"
    )


def lobe_integrals(material: Material, points: Points) -> Array:
    """Return what constant light of radiance 1 reflects at the points, (n, 3): quadrature about each lobe's centre."""
    t, w = np.polynomial.legendre.leggauss(200)
    t, w = (t + 1) / 2, w / 2
    azimuths = 2 * np.pi * (np.arange(64) + 0.5) / 64
    out = np.zeros((len(points), 3))
    for lobe in material.lobes:
        end = lobe.cone(1e-12)
        theta = end * t**2  # squeezed towards the centre
        weight = (w * 2 * end * t * np.sin(theta))[:, None] * (2 * np.pi / len(azimuths))
        local = np.stack(
            [
                np.sin(theta)[:, None] * np.cos(azimuths),
                np.sin(theta)[:, None] * np.sin(azimuths),
                np.broadcast_to(np.cos(theta)[:, None], (len(theta), len(azimuths))),
            ]
        )
        for i, centre in enumerate(points.central(lobe.centre)):
            x = perpendicular(centre)
            light: Any = np.einsum("kij,kc->cij", local, np.stack([x, np.cross(centre, x), centre]))
            view, axis, normal = (v[:, None, None] for v in (points.view[i], centre, points.normal[i]))
            out[i] += [float(np.sum(v * weight)) for v in lobe.evaluate(light, view, axis, normal)]
    return out
