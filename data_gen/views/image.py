"""Images: what each pixel of a camera sees, of the unit sphere in closed form, of a mesh by Mitsuba's rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry import mitsuba_mesh
from data_gen.views import parameters as p
from data_gen.views.parameters import Vector
from data_gen.views.points import Spots, equal, on_mesh, sphere_uv
from envbench import llvm
from envbench.arrays import components
from envbench.directions import Array, normalised, perpendicular, upright
from envbench.errors import BadInput
from envbench.geometry import Geometry, Points, TriangleMesh, Viewer


@dataclass(frozen=True, kw_only=True)
class Image:
    """The visible points at the pixel centres of a square image, of equal weight.

    Orthographic from a distant `direction`, framing the shape's bounding sphere; or in perspective from an `eye`. The
    unit sphere is met in closed form, a mesh by Mitsuba's rays with its shading normals interpolated. A pixel whose
    shading or geometric normal faces away (N.V <= 0: the back of an open mesh, or a silhouette of a coarse one) has no
    reflected radiance to ask for: it is left out, and the points' notes count such pixels.
    """

    kind: ClassVar[str] = "image"

    size: int = 256
    direction: Vector | None = None
    eye: Vector | None = None
    fov: float | None = None
    target: Vector | None = None
    up: Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        p.integer("size", self.size, 1, 8192)
        for key in ("direction", "eye", "target", "up"):
            value = getattr(self, key)
            if value is not None:
                check = p.direction if key in ("direction", "up") else p.vector
                object.__setattr__(self, key, check(key, value))
        if (self.direction is None) == (self.eye is None):
            raise BadInput("an image has either a direction or an eye; give exactly one of them.")
        if self.eye is None and not (self.fov is None and self.target is None):
            raise BadInput("fov and target belong to an eye; a distant direction has neither.")
        fov: Any = self.fov
        if fov is not None and not (isinstance(fov, int | float) and 0 < fov < 180):
            raise BadInput(f"fov must lie in (0, 180) degrees. Got {fov!r} instead.")

    def points(self, geometry: Geometry, name: str) -> tuple[Points, Viewer]:
        """Find what each pixel sees."""
        posed = geometry.posed
        origins, rays, viewer = self._camera(posed)
        if posed.mesh is None:
            hit, position = _meet_sphere(origins, rays)
            spot = Spots(position, position, position, perpendicular(position), uv=sphere_uv(position))
        else:
            hit, triangle, barycentric = _meet_mesh(posed.mesh, origins, rays)
            spot = on_mesh(geometry, triangle, barycentric)
        view = -rays[hit]
        front = (np.sum(spot.normal * view, axis=1) > 0) & (np.sum(spot.geometric_normal * view, axis=1) > 0)
        if not front.any():
            raise BadInput(f"view '{name}' sees nothing of '{geometry.name}'; move its eye, target or direction.")
        away = int(np.count_nonzero(~front))
        notes = (f"{away} of {len(front)} covered pixels are left out: their normal faces away.",) if away else ()
        pixel = np.stack(np.divmod(np.flatnonzero(hit), self.size), axis=1).astype(np.int32)
        points = Points(
            **spot.of(front), view=view[front], weight=equal(int(np.count_nonzero(front))),
            pixel=pixel[front], image_shape=(self.size, self.size), notes=notes,
        )  # fmt: skip
        return points, viewer

    def _camera(self, geometry: Geometry) -> tuple[Array, Array, Viewer]:
        """Return each pixel's ray, origins (size^2, 3) and unit directions into the scene, row by row from the top."""
        centre, radius = _bounds(geometry)
        along = 2 * (np.arange(self.size) + 0.5) / self.size - 1
        x, y = np.tile(along, self.size)[:, None], np.repeat(-along, self.size)[:, None]
        if self.direction is not None:
            towards = np.asarray(self.direction)
            right, up = upright(towards, self.up)
            origins = centre + radius * (x * right + y * up + 2 * towards)
            return origins, np.broadcast_to(-towards, origins.shape), Viewer(direction=self.direction)
        eye = np.asarray(self.eye, float)
        if geometry.mesh is None and np.linalg.norm(eye) <= 1:
            raise BadInput(f"the eye {self.eye} lies inside the unit sphere; move it out.")
        axis = normalised((centre if self.target is None else np.asarray(self.target)) - eye)
        if not axis.any():
            raise BadInput(f"the eye {self.eye} lies at its own target; move one of them.")
        right, up = upright(-axis, self.up)
        half = np.tan(np.radians(40.0 if self.fov is None else self.fov) / 2)
        rays = normalised(axis + half * (x * right + y * up))
        viewer = Viewer(eye=self.eye, axis=(float(axis[0]), float(axis[1]), float(axis[2])))
        return np.broadcast_to(eye, rays.shape), rays, viewer


def _bounds(geometry: Geometry) -> tuple[Array, float]:
    """Return the centre and radius of a sphere about the shape."""
    if geometry.mesh is None:
        return np.zeros(3), 1.0
    vertices = geometry.mesh.vertices
    centre = (vertices.min(0) + vertices.max(0)) / 2
    return centre, float(np.linalg.norm(vertices - centre, axis=1).max())


def _meet_sphere(origins: Array, rays: Array) -> tuple[NDArray[np.bool_], Array]:
    """Meet the unit sphere: which rays hit; position, which is the normal, of those that do."""
    b = np.sum(origins * rays, axis=1)
    discriminant = b * b - np.sum(origins * origins, axis=1) + 1
    hit = (discriminant > 0) & (b < 0)
    distance = -b[hit] - np.sqrt(discriminant[hit])
    return hit, normalised(origins[hit] + distance[:, None] * rays[hit])


def _meet_mesh(mesh: TriangleMesh, origins: Array, rays: Array) -> tuple[NDArray[np.bool_], NDArray[np.int32], Array]:
    """Cast the rays with Mitsuba: which hit; triangle and barycentric coordinates (n, 3) of those that do."""
    mi = llvm.mitsuba("llvm_ad_rgb")
    scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mi, mesh)})
    ray = mi.Ray3f(components(mi.Point3f, origins), components(mi.Vector3f, rays))
    found = scene.ray_intersect_preliminary(ray, coherent=True)
    hit = np.array(found.is_valid())
    v, w = np.array(found.prim_uv)[:, hit].astype(float)  # of rays that miss it holds anything
    return hit, np.array(found.prim_index)[hit].astype(np.int32), np.stack([1 - v - w, v, w], axis=1)
