"""Where points are in Mitsuba's world: how light sees them, where rays leave the shape, and where they meet it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.mitsuba_surface import Surface
from envbench.arrays import components
from envbench.directions import Array, normalised
from envbench.errors import BadInput
from envbench.geometry import Points, TriangleMesh


def laid_out(mi: Any, chosen: NDArray[np.int_], point: Any) -> Callable[[Array], Any]:
    """Return what lays an array (n, 3) of all points out on lanes: each has one `point` of the `chosen`."""
    import drjit as dr

    rows = np.resize(chosen, max(2, len(chosen)))  # a single one would be a constant of the kernel

    def spread(values: Array) -> Any:
        return dr.gather(mi.Vector3f, components(mi.Vector3f, values[rows]), point)

    return spread


def interaction(mi: Any, surface: Surface, points: Points, spread: Callable[[Array], Any]) -> Any:
    """Return the surface interaction at the points, its arrays laid out by `spread`."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.p = mi.Point3f(spread(points.position))
    si.n = mi.Normal3f(spread(points.geometric_normal))
    normal, s = spread(points.normal), spread(_orthogonal(points))
    si.sh_frame = mi.Frame3f(s, dr.cross(normal, s), normal)
    si.wi = si.to_local(spread(points.view))
    if surface.material.transparency is not None:
        if points.uv is None:
            raise BadInput("a map of transparency needs points with uv; unwrap the mesh first.")
        uv = spread(np.pad(points.uv, ((0, 0), (0, 1))))
        si.uv = mi.Point2f(uv.x, uv.y)
    return si


def averaged(mi: Any, surface: Surface, si: Any, sampler: Any) -> Any:
    """Return the interaction as seen from a view drawn anew, its tangent turned, where a surface averages over them."""
    import drjit as dr

    if not (surface.any_view or surface.any_tangent):
        return si
    turned = mi.SurfaceInteraction3f(si)
    if surface.any_tangent:
        sine, cosine = dr.sincos(2 * dr.pi * sampler.next_1d())
        frame = si.sh_frame
        along = mi.Vector3f(cosine * frame.s + sine * frame.t)
        turned.sh_frame = mi.Frame3f(along, dr.cross(frame.n, along), frame.n)
        turned.wi = turned.to_local(si.to_world(si.wi))
    if surface.any_view:
        turned.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    return turned


@dataclass(frozen=True)
class Place:
    """Where rays leave the occluder: `position`, geometric and shading `normal` in its own frame, all Mitsuba's.

    `rotation` holds the rows of the matrix that turns the occluder's frame into the light's; None where they are one.
    `sky` is what part of the directions meets nothing, where that was asked for.
    """

    position: Any
    geometric: Any
    normal: Any
    lift: Any
    rotation: tuple[Any, ...] | None = None
    sky: Any = None

    @classmethod
    def of(cls, mi: Any, surface: Surface, points: Points, spread: Callable[[Array], Any]) -> Place:
        """Return where the points are on the occluder, their arrays laid out by `spread`."""
        import drjit as dr

        position, geometric, normal, rotation = points.position, points.geometric_normal, points.normal, None
        if surface.carried and surface.occluder is not None:
            position, geometric, normal = _at_rest(surface.occluder, points)
            if points.rotation is not None:
                rotation = tuple(spread(points.rotation[:, row]) for row in range(3))
        lift = dr.opaque(mi.Float, surface.lift)  # no constant of the kernel, which serves other shapes too
        return cls(mi.Point3f(spread(position)), spread(geometric), spread(normal), lift, rotation)

    def ray(self, mi: Any, direction: Any) -> Any:
        """Return the ray in a `direction` of the light's frame.

        It starts off the surface on the side of the shading normal that it goes to. Leaving on the geometric normal's
        side instead, a vertex would look into a convex shape past all but one of its triangles.
        """
        import drjit as dr

        turned = self.at_rest(mi, direction)
        side = dr.mulsign(mi.Float(self.lift), dr.dot(self.normal, turned))
        return mi.Ray3f(self.position + side * self.geometric, turned)

    def at_rest(self, mi: Any, vector: Any) -> Any:
        """Return R^T v."""
        if self.rotation is None:
            return vector
        x, y, z = self.rotation
        return mi.Vector3f(x * vector.x + y * vector.y + z * vector.z)

    def posed(self, mi: Any, vector: Any) -> Any:
        """Return R v."""
        import drjit as dr

        vector = mi.Vector3f(vector)
        return vector if self.rotation is None else mi.Vector3f(*(dr.dot(row, vector) for row in self.rotation))


def met(mi: Any, scene: Any, surface: Surface, ray: Any, active: Any) -> Any:
    """Return the surface that a ray meets first, as `scene.ray_intersect` does.

    That asks whichever shape was met, among all of the process; here it is the occluder. So kernels do not depend
    on what other shapes there are, and are found again when Dr.Jit has compiled them before.
    """
    first = scene.ray_intersect_preliminary(ray, active=active)
    found = surface.shape.compute_surface_interaction(ray, first, mi.RayFlags.All, active & first.is_valid())
    found.t = first.t
    found.initialize_sh_frame()
    return found


def reached(mi: Any, surface: Surface, found: Any, place: Place, direction: Any) -> tuple[Any, Place, Any]:
    """Return the surface that a ray in `direction` has found, as the light sees it and as rays leave it.

    An open shape is turned to the side that was met; the inside of a closed one is met by no path that counts.
    """
    import drjit as dr

    front = dr.dot(found.n, place.at_rest(mi, direction)) < 0
    active, n, frame = found.is_valid(), found.n, found.sh_frame
    if surface.closed:
        active = active & front
    else:
        n = dr.select(front, n, -n)
        frame = mi.Frame3f(frame.s, dr.select(front, frame.t, -frame.t), dr.select(front, frame.n, -frame.n))
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.sh_frame = mi.Frame3f(*(place.posed(mi, axis) for axis in (frame.s, frame.t, frame.n)))
    si.n = mi.Normal3f(place.posed(mi, n))
    si.wi = si.to_local(-direction)
    si.uv = found.uv
    return si, replace(place, position=found.p, geometric=mi.Vector3f(n), normal=mi.Vector3f(frame.n)), active


def _at_rest(mesh: TriangleMesh, points: Points) -> tuple[Array, Array, Array]:
    """Return position, geometric and shading normal, (n, 3) each, of the points on the mesh at rest."""
    if points.triangle is None or points.barycentric is None:
        raise BadInput(
            "shadows of the shape at rest need points with triangle and barycentric; take those of an image."
        )
    corners = mesh.triangles[points.triangle]
    a, b, c = (mesh.vertices[corners[:, k]] for k in range(3))
    position, normal = (
        np.einsum("nk,nkc->nc", points.barycentric, values[corners]) for values in (mesh.vertices, mesh.normals)
    )
    return position, normalised(np.cross(b - a, c - a)), normalised(normal)


def _orthogonal(points: Points) -> Array:
    """Return the tangents, made perpendicular to the shading normals."""
    along = np.sum(points.tangent * points.normal, axis=-1, keepdims=True)
    return normalised(points.tangent - along * points.normal)
