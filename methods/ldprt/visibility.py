"""Which directions each vertex of a shape at rest sees, by Mitsuba's rays: for transfer that is no diffuse vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envbench.arrays import components
from envbench.directions import Array, from_angles
from envbench.geometry import Geometry
from methods.ldprt.casting import Casting

_LANES = 2**22
_GOLDEN = np.pi * (3 - np.sqrt(5))


def spread(count: int) -> Array:
    """Return directions (count, 3) evenly over the sphere: a spiral of equal areas."""
    k = np.arange(count)
    return from_angles(np.arccos(1 - (2 * k + 1) / count), _GOLDEN * k)


def visible(geometry: Geometry, directions: Array) -> NDArray[np.bool_]:
    """Tell which `directions` (K, 3) leave each vertex without meeting the shape, (V, K); none below its horizon."""
    mesh = geometry.rest.mesh
    assert mesh is not None
    above = mesh.normals @ directions.T > 0
    if geometry.rest.convex:
        return above
    casting = Casting.of(mesh)
    import drjit as dr

    mi, count = casting.mi, len(directions)
    towards = components(mi.Vector3f, directions)
    step = max(1, _LANES // count)
    for first in range(0, len(above), step):
        starts = components(mi.Point3f, casting.starts[first : first + step])
        lane = dr.arange(mi.UInt32, dr.width(starts) * count)
        ray = mi.Ray3f(dr.gather(mi.Point3f, starts, lane // count), dr.gather(mi.Vector3f, towards, lane % count))
        hidden = np.array(casting.scene.ray_test(ray)).reshape(-1, count)
        above[first : first + step] &= ~hidden
    return above
