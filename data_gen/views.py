"""Queries by name or by a table of a suite: `build` makes the points and who looks at them, `VIEWS` are the presets.

=============  ==========================================================================================
kind           settings
=============  ==========================================================================================
``uniform``    `count`, `seed`: R and V uniform and independent over the sphere; no viewer
``image``      `size` (pixels a side) and either a distant `direction` (towards the viewer, orthographic), or
               an `eye` with `fov` (degrees across the image) looking at `target`; `up` is upright in the image
=============  ==========================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry import mitsuba_mesh
from envbench import llvm
from envbench.directions import Array, from_angles, normalised, perpendicular
from envbench.errors import BadInput, unknown
from envbench.geometry import Geometry, Points, TriangleMesh, Viewer

VIEWS: dict[str, dict[str, Any]] = {
    "uniform": {"kind": "uniform", "count": 4096, "seed": 0},
    "image": {"kind": "image", "size": 256, "direction": [0.0, -1.0, 0.0]},
    "camera": {"kind": "image", "size": 256, "eye": [0.0, -5.0, 2.0], "fov": 28.0},
}

Vector = tuple[float, float, float]


class _View(Protocol):
    kind: ClassVar[str]

    def points(self, geometry: Geometry, name: str) -> tuple[Points, Viewer | None]: ...


def build(spec: Mapping[str, Any], geometry: Geometry, name: str = "view") -> tuple[Points, Viewer | None]:
    """Make the queries of a table on `geometry`; the viewer is None where every point has a view of its own.

    Raises
    ------
    BadInput
        For an unknown kind or setting, a value out of range, or a view that sees nothing.

    Examples
    --------
    >>> points, viewer = build({"kind": "image", "size": 8, "direction": [0, 0, 1]}, Geometry("sphere"))
    >>> len(points), viewer.direction
    (52, (0.0, 0.0, 1.0))
    """
    kinds: dict[str, type[Any]] = {view.kind: view for view in (Uniform, Image)}
    kind = str(spec.get("kind"))
    if kind not in kinds:
        raise unknown(f"kind of view '{name}':", kind, kinds)
    known = [f.name for f in fields(kinds[kind])]
    settings = {key: value for key, value in spec.items() if key != "kind"}
    for key in settings:
        if key not in known:
            raise unknown(f"setting of view '{name}' ({kind}):", key, known)
    try:
        view: _View = kinds[kind](**settings)
    except BadInput as error:
        raise BadInput(f"view '{name}': {error}") from None
    return view.points(geometry, name)


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """Queries with R and V uniform and independent over the sphere, N their normalised sum, all on the unit sphere.

    They are the first `count` points of a scrambled Sobol sequence in four dimensions, of equal weight: what captured
    energy averages over (RH 2002, sec. 5), at less variance than independent draws.
    """

    kind: ClassVar[str] = "uniform"

    count: int = 4096
    seed: int = 0

    def __post_init__(self) -> None:
        _integer("count", self.count, 1, 2**24)
        _integer("seed", self.seed, 0, 2**63 - 1)

    def points(self, geometry: Geometry, name: str) -> tuple[Points, None]:
        """Draw the queries."""
        from scipy.stats import qmc

        if geometry.mesh is not None:
            raise BadInput(f"view '{name}': uniform queries need the sphere; give '{geometry.name}' an image instead.")
        exponent = max(self.count - 1, 0).bit_length()
        u = qmc.Sobol(4, scramble=True, rng=self.seed).random_base2(exponent)[: self.count]
        reflection = from_angles(np.arccos(1 - 2 * u[:, 0]), 2 * np.pi * u[:, 1])
        view = from_angles(np.arccos(1 - 2 * u[:, 2]), 2 * np.pi * u[:, 3])
        normal = normalised(reflection + view)
        return _points(normal, normal, normal, view), None


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
        _integer("size", self.size, 1, 8192)
        for key in ("direction", "eye", "target", "up"):
            value = getattr(self, key)
            if value is not None:
                object.__setattr__(self, key, _vector(key, value))
        if (self.direction is None) == (self.eye is None):
            raise BadInput("an image has either a direction or an eye; give exactly one of them.")
        if self.eye is None and not (self.fov is None and self.target is None):
            raise BadInput("fov and target belong to an eye; a distant direction has neither.")
        fov: Any = self.fov
        if fov is not None and not (isinstance(fov, int | float) and 0 < fov < 180):
            raise BadInput(f"fov must lie in (0, 180) degrees. Got {fov!r} instead.")
        for key in ("direction", "up"):
            if getattr(self, key) == (0.0, 0.0, 0.0):
                raise BadInput(f"{key} must not be zero.")

    def points(self, geometry: Geometry, name: str) -> tuple[Points, Viewer]:
        """Find what each pixel sees."""
        origins, rays, viewer = self._camera(geometry)
        if geometry.mesh is None:
            hit, position, normal, geometric = _meet_sphere(origins, rays)
            triangle = barycentric = uv = None
        else:
            hit, triangle, barycentric = _meet_mesh(geometry.mesh, origins, rays)
            position, normal, geometric, uv = _on_mesh(geometry.mesh, triangle, barycentric)
        view = -rays[hit]
        front = (np.sum(normal * view, axis=1) > 0) & (np.sum(geometric * view, axis=1) > 0)
        if not front.any():
            raise BadInput(f"view '{name}' sees nothing of '{geometry.name}'; move its eye, target or direction.")
        away = int(np.count_nonzero(~front))
        notes = (f"{away} of {len(front)} covered pixels are left out: their normal faces away.",) if away else ()
        pixel = np.stack(np.divmod(np.flatnonzero(hit), self.size), axis=1).astype(np.int32)
        points = _points(
            position[front], normal[front], geometric[front], view[front],
            triangle=None if triangle is None else triangle[front],
            barycentric=None if barycentric is None else barycentric[front],
            uv=None if uv is None else uv[front],
            pixel=pixel[front], image_shape=(self.size, self.size), notes=notes,
        )  # fmt: skip
        return points, viewer

    def _camera(self, geometry: Geometry) -> tuple[Array, Array, Viewer]:
        """Return each pixel's ray, origins (size^2, 3) and unit directions into the scene, row by row from the top."""
        centre, radius = _bounds(geometry)
        along = 2 * (np.arange(self.size) + 0.5) / self.size - 1
        x, y = np.tile(along, self.size)[:, None], np.repeat(-along, self.size)[:, None]
        if self.direction is not None:
            towards = normalised(self.direction)
            right, up = _upright(towards, self.up)
            origins = centre + radius * (x * right + y * up + 2 * towards)
            viewer = Viewer(direction=(float(towards[0]), float(towards[1]), float(towards[2])))
            return origins, np.broadcast_to(-towards, origins.shape), viewer
        eye = np.asarray(self.eye, float)
        if geometry.mesh is None and np.linalg.norm(eye) <= 1:
            raise BadInput(f"the eye {self.eye} lies inside the unit sphere; move it out.")
        axis = normalised((centre if self.target is None else np.asarray(self.target)) - eye)
        if not axis.any():
            raise BadInput(f"the eye {self.eye} lies at its own target; move one of them.")
        right, up = _upright(-axis, self.up)
        half = np.tan(np.radians(40.0 if self.fov is None else self.fov) / 2)
        rays = normalised(axis + half * (x * right + y * up))
        viewer = Viewer(eye=self.eye, axis=(float(axis[0]), float(axis[1]), float(axis[2])))
        return np.broadcast_to(eye, rays.shape), rays, viewer


def _points(position: Array, normal: Array, geometric: Array, view: Array, **more: Any) -> Points:
    weight = np.full(len(normal), 1 / len(normal))
    return Points(position, normal, geometric, perpendicular(normal), view, weight, **more)


def _bounds(geometry: Geometry) -> tuple[Array, float]:
    """Return the centre and radius of a sphere about the shape."""
    if geometry.mesh is None:
        return np.zeros(3), 1.0
    vertices = geometry.mesh.vertices
    centre = (vertices.min(0) + vertices.max(0)) / 2
    return centre, float(np.linalg.norm(vertices - centre, axis=1).max())


def _upright(towards: Array, up: Vector) -> tuple[Array, Array]:
    """Return the image's right and up; where `up` is along the view, some other direction is upright."""
    right = np.cross(up, towards)
    if np.linalg.norm(right) < 1e-6 * np.linalg.norm(up):
        right = np.cross((0.0, 1.0, 0.0) if abs(towards[1]) < 0.9 else (1.0, 0.0, 0.0), towards)
    right = normalised(right)
    return right, np.cross(towards, right)


def _meet_sphere(origins: Array, rays: Array) -> tuple[NDArray[np.bool_], Array, Array, Array]:
    """Meet the unit sphere: which rays hit; position, normal and geometric normal of those that do."""
    b = np.sum(origins * rays, axis=1)
    discriminant = b * b - np.sum(origins * origins, axis=1) + 1
    hit = (discriminant > 0) & (b < 0)
    distance = -b[hit] - np.sqrt(discriminant[hit])
    position = normalised(origins[hit] + distance[:, None] * rays[hit])
    return hit, position, position, position


def _meet_mesh(mesh: TriangleMesh, origins: Array, rays: Array) -> tuple[NDArray[np.bool_], NDArray[np.int32], Array]:
    """Cast the rays with Mitsuba: which hit; triangle and barycentric coordinates (n, 3) of those that do."""
    mi = llvm.mitsuba("llvm_ad_rgb")
    scene = mi.load_dict({"type": "scene", "shape": mitsuba_mesh(mi, mesh)})
    ray = mi.Ray3f(mi.Point3f(origins.T.astype(np.float32)), mi.Vector3f(rays.T.astype(np.float32)))
    found = scene.ray_intersect_preliminary(ray, coherent=True)
    hit = np.array(found.is_valid())
    v, w = np.array(found.prim_uv, dtype=float)[:, hit]
    return hit, np.array(found.prim_index)[hit].astype(np.int32), np.stack([1 - v - w, v, w], axis=1)


def _on_mesh(
    mesh: TriangleMesh, triangle: NDArray[np.int32], barycentric: Array
) -> tuple[Array, Array, Array, Array | None]:
    corners = mesh.triangles[triangle]

    def blend(attribute: Array) -> Array:
        return np.einsum("nk,nkc->nc", barycentric, attribute[corners])

    a, b, c = (mesh.vertices[corners[:, k]] for k in range(3))
    geometric = normalised(np.cross(b - a, c - a))
    uv = None if mesh.uv is None else blend(mesh.uv)
    return blend(mesh.vertices), normalised(blend(mesh.normals)), geometric, uv


def _integer(name: str, value: Any, low: int, high: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise BadInput(f"{name} must be an integer in [{low}, {high}]. Got {value!r} instead.")


def _vector(name: str, value: Any) -> Vector:
    numbers = list(value) if isinstance(value, list | tuple) else []
    if len(numbers) != 3 or not all(isinstance(n, int | float) and np.isfinite(n) for n in numbers):
        raise BadInput(f"{name} must be three finite numbers. Got {value!r} instead.")
    return float(numbers[0]), float(numbers[1]), float(numbers[2])
