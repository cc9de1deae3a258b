"""The map of a new view: three source maps warped to it, weighed and summed (Cabral et al. 1999, secs. 3.3 and 3.4)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from methods.cabral import spheremap
from methods.cabral.mesh import DiskMesh
from methods.cabral.warp import UNTRUSTED, Source, place


def blend(
    maps: NDArray[np.float32], sources: list[Source], by_normal: bool, fade: float, mesh: DiskMesh | None
) -> NDArray[np.float32]:
    """Return the destination's map (size, size, 4) from three source maps (3, size, size, 4)."""
    llvm.find()
    import drjit as dr
    from drjit.llvm import Array4f, Float

    size = maps.shape[1]
    table = Float(maps.ravel())
    weights = Float(np.array([s.weight for s in sources], np.float32))
    if mesh is None:
        places = _exact(size, sources, by_normal, fade)
    else:
        places = _between_vertices(mesh, sources, by_normal, fade)
    total, value = Float(0), Array4f(0)
    for k, (x, y, trust) in enumerate(places):
        weight = dr.gather(Float, weights, k) * (trust + UNTRUSTED)
        value = dr.fma(spheremap.look_up(table, size, (x, y), k), weight, value)
        total += weight
    value /= total
    dr.eval(value)
    dr.sync_thread()
    return np.array(value).T.reshape(size, size, 4).copy()


def _exact(size: int, sources: list[Source], by_normal: bool, fade: float) -> list[tuple[Any, Any, Any]]:
    """Return each source's point and trust at every texel, as Dr.Jit arrays."""
    import drjit as dr
    from drjit.llvm import Float, UInt32

    numbers = Float(
        np.concatenate([np.concatenate([s.turn.ravel(), s.singular]) for s in sources]).astype(np.float32)
    )  # not literals: another view is no other kernel
    texel = dr.arange(UInt32, size * size)
    x = (Float(texel % size) + 0.5) * (2 / size) - 1
    y = 1 - (Float(texel // size) + 0.5) * (2 / size)
    square = x * x + y * y
    scale = dr.select(square > 1, dr.rsqrt(square), 1)
    x, y = x * scale, y * scale
    z = dr.sqrt(dr.maximum(1 - x * x - y * y, 0))
    shown = (2 * x * z, 2 * y * z, 2 * z * z - 1)

    def number(k: int, i: int) -> Any:
        return dr.gather(Float, numbers, 11 * k + i)

    def from_source(k: int) -> tuple[Any, Any, Any]:
        turn = [[number(k, 3 * i + j) for j in range(3)] for i in range(3)]
        return place(shown, (x, y), turn, (number(k, 9), number(k, 10)), by_normal, fade)

    return [from_source(k) for k in range(len(sources))]


def _between_vertices(
    mesh: DiskMesh, sources: list[Source], by_normal: bool, fade: float
) -> list[tuple[Any, Any, Any]]:
    """Return each source's point and trust at every texel, interpolated between the vertices, as Dr.Jit arrays."""
    import drjit as dr
    from drjit.llvm import Array4f, Array4u, Float, UInt32

    shown = spheremap.mirrored(spheremap.normals(mesh.vertices)).T
    p = (mesh.vertices[:, 0], mesh.vertices[:, 1])
    at_vertices = np.zeros((len(sources), len(mesh.vertices), 4), np.float32)
    for k, s in enumerate(sources):
        at_vertices[k, :, :3] = np.stack(
            place((shown[0], shown[1], shown[2]), p, s.turn, s.singular, by_normal, fade), 1
        )
    table = Float(at_vertices.ravel())
    texel = dr.arange(UInt32, len(mesh.corners))
    corners = dr.gather(Array4u, UInt32(mesh.corners.ravel()), texel)
    shares = dr.gather(Array4f, Float(mesh.shares.ravel()), texel)

    def from_source(k: int) -> tuple[Any, Any, Any]:
        first = k * len(mesh.vertices)
        x, y, trust, _ = sum(
            (shares[i] * dr.gather(Array4f, table, corners[i] + first) for i in (1, 2)),
            start=shares[0] * dr.gather(Array4f, table, corners[0] + first),
        )
        return x, y, trust

    return [from_source(k) for k in range(len(sources))]
