"""A mesh in motion as a method shades it: prepared and lit once, framed and shaded pose by pose, drawn off screen."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from envbench.animation import AnimationSpec
from envbench.answers import checked, modulated
from envbench.catalogue import Catalogue
from envbench.errors import CannotRun
from envbench.geometry import Points, TriangleMesh
from envbench.records import Film
from envbench.tonemap import exposure, pictured

_SPREAD = 4
"""Edges over which a vertex without a value takes its neighbours': as far as one may be seen across a silhouette."""

Array = NDArray[np.float64]


def film(spec: AnimationSpec, catalogue: Catalogue) -> Film:
    """Make an animation; without a rasteriser, or where the method declines, it stands there with the reason."""
    start = time.perf_counter()
    nothing = Film(spec.name, spec.caption)
    try:
        rasteriser = catalogue.rasteriser(spec.asked.size)
    except CannotRun as error:
        return replace(nothing, reason=str(error))
    with closing(rasteriser):
        shaded = _shaded(spec, catalogue)
        if isinstance(shaded, str):
            return replace(nothing, reason=shaded)
        meshes, values, lacks = shaded
        stops = exposure(np.concatenate([value[_known(value)] for value in values]))
        pairs = [spread(value, mesh.triangles) for value, mesh in zip(values, meshes, strict=True)]
        colours = [pictured(np.where(_known(value)[:, None], value, 0), stops) for value in pairs]
        asked = spec.asked
        mime, data = rasteriser.film(meshes, colours, asked.direction, asked.up, asked.fps)
    tone = f"exposure {stops:+.2f} EV, clipped to [0, 1], sRGB curve, the same for all frames"
    notes = (*lacks, *_without_value(values, pairs))
    seconds = time.perf_counter() - start
    return Film(spec.name, f"{spec.caption}; {tone}; colours interpolated between vertices", mime, data, notes, seconds)


def _shaded(spec: AnimationSpec, catalogue: Catalogue) -> tuple[list[TriangleMesh], list[Array], tuple[str, ...]] | str:
    """Return the posed meshes, the radiance of their vertices, and notes; or why the method declines."""
    method = spec.method
    meshes: list[TriangleMesh] = []
    values: list[Array] = []
    relit = None
    lacks: tuple[str, ...] = ()
    for frame in spec.frames:
        scene = frame.build(catalogue)
        if not meshes:
            method = method.called_for(scene)
        declined = method.refusal(scene)
        if declined is not None:
            return f"declined: {' '.join(str(declined).split())}"
        if not meshes:
            prepared = method.prepare(scene.material, scene.geometry.rest)
            relit = method.relight(prepared, scene.environment)
            effects = sorted(effect.value for effect in method.lacks(scene))
            lacks = (f"Not simulated: {', '.join(effects)}.",) if effects else ()
        answer = modulated(method.shade(method.frame(relit, scene.viewer), scene.points), scene.points)
        mesh = scene.geometry.posed.mesh
        assert mesh is not None
        meshes.append(mesh)
        values.append(at_vertices(checked(answer, len(scene.points)), scene.points, mesh))
    return meshes, values, lacks


def at_vertices(values: NDArray[np.floating], points: Points, mesh: TriangleMesh) -> Array:
    """Return what points at the vertices of a mesh hold, by vertex: (V, 3), NaN at those that no point lies on."""
    assert points.triangle is not None
    assert points.barycentric is not None
    out = np.full(mesh.vertices.shape, np.nan)
    corner = points.barycentric.argmax(axis=1)
    out[mesh.triangles[points.triangle, corner]] = values
    return out


def spread(values: Array, triangles: NDArray[np.int32]) -> Array:
    """Return values (V, 3) of which the NaN within `_SPREAD` edges of others are means of their neighbours.

    A neighbour counts once for each triangle that it shares.

    Examples
    --------
    >>> strip = np.array([[0, 1, 2], [1, 2, 3]], np.int32)
    >>> spread(np.array([[1.0] * 3, [3.0] * 3, [5.0] * 3, [np.nan] * 3]), strip)[:, 0].tolist()
    [1.0, 3.0, 5.0, 4.0]
    """
    values = values.copy()
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    a, b = np.concatenate([ends, ends[:, ::-1]]).T
    for _ in range(_SPREAD):
        known = _known(values)
        bridge = ~known[a] & known[b]
        if not bridge.any():
            break
        to, count = a[bridge], len(values)
        shares = np.bincount(to, minlength=count)
        sums = np.stack([np.bincount(to, values[b[bridge], k], count) for k in range(3)], axis=1)
        values[shares > 0] = sums[shares > 0] / shares[shares > 0, None]
    return values


def _known(values: Array) -> NDArray[np.bool_]:
    return np.logical_and.reduce(np.isfinite(values), axis=1)


def _without_value(values: list[Array], filled: list[Array]) -> tuple[str, ...]:
    lost = max(int((~_known(value)).sum()) for value in values)
    black = max(int((~_known(value)).sum()) for value in filled)
    if not lost:
        return ()
    rest = f"; {black} are too far from any and black" if black else ""
    return (f"Up to {lost} of {len(values[0])} vertices a frame have no value and take their neighbours'{rest}.",)
