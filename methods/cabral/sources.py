"""The radiance maps themselves: a set of lobes, seen from every vertex, integrated or read from SHRM."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.environments.resample import downsampled
from envbench.directions import Array, normalised, perpendicular
from envbench.environment import Environment
from envbench.geometry import Points
from envbench.material import Centre, Lobe
from methods.angular.prefilter import grazing, prefilter_at, width
from methods.cabral import spheremap
from methods.shrm import SHRM


def queries(index: Centre, view: Array, size: int) -> Points:
    """Return what the texels of one sphere map ask for, seen from `view` (3,), row by row.

    A texel shows a normal, and its mirror direction. A lobe about the tangent is stored by the direction of T in place
    of the mirror direction: it knows T and V alone, so that any normal perpendicular to T will do.
    """
    frame = spheremap.frame(view)
    local = spheremap.normals(spheremap.texels(size)).reshape(-1, 3)
    normal, view = local @ frame.T, np.broadcast_to(view, local.shape).copy()
    tangent = perpendicular(normal)
    if index is Centre.TANGENT:
        tangent = spheremap.mirrored(local) @ frame.T
        across = view - np.sum(view * tangent, axis=1, keepdims=True) * tangent
        along = np.linalg.norm(across, axis=1, keepdims=True) < 1e-6
        normal = np.where(along, perpendicular(tangent), normalised(across))
    return Points(normal, normal, normal, tangent, view, np.full(len(local), 1 / len(local)))


def from_shrm(method: SHRM, prepared: Any, environment: Environment, views: list[Points]) -> NDArray[np.float32]:
    """Return the maps (K, texels, 4) from spherical harmonic reflection maps: the fast way for many texels."""
    relit = method.relight(prepared, environment)
    return spheremap.padded(np.stack([method.shade(method.frame(relit, None), points) for points in views]))


def integrated(
    lobes: tuple[Lobe, ...], environment: Environment, views: list[Points], eps: float, light_rows: int
) -> NDArray[np.float32]:
    """Return the maps (K, texels, 4) by angular prefiltering: the paper's way.

    A lobe narrower than a texel sees light reduced to the map's own resolution, so that no lamp falls between two.
    """
    count = len(views[0])
    own = int(np.pi / 4 * np.sqrt(count))  # a texel at the centre of the disk turns the mirror direction by 4 / size
    every = _joined(views)
    out = np.zeros((len(every), 3), np.float32)
    for lobe in lobes:
        rows = light_rows or environment.radiance.shape[0]
        light = downsampled(environment, max(min(rows, own), 2) if width(lobe) < np.pi / own else rows)
        seen = _off_grazing(every, grazing(len(light.radiance), lobe)) if lobe.centre is Centre.REFLECTION else every
        out += prefilter_at(light.radiance, lobe, seen.central(lobe.centre), seen.view, seen.normal, eps)
    return spheremap.padded(out.reshape(len(views), count, 3))


def _joined(views: list[Points]) -> Points:
    def all_of(part: str) -> Array:
        return np.concatenate([getattr(points, part) for points in views])

    normal = all_of("normal")
    return Points(normal, normal, normal, all_of("tangent"), all_of("view"), all_of("weight"))


def _off_grazing(points: Points, angle: float) -> Points:
    """Return the points with normals turned towards the view, where R is less than `angle` from -V."""
    along, least = np.sum(points.normal * points.view, axis=1, keepdims=True), np.sin(angle / 2)
    across = normalised(points.normal - along * points.view)
    normal = np.where(along < least, least * points.view + np.sqrt(1 - least**2) * across, points.normal)
    return replace(points, normal=normal)
