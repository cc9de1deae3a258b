"""Shapes, the points on them that are asked about, and who looks."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, reflect
from envbench.errors import BadInput
from envbench.material import Centre


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles in the rest pose: `vertices` (V, 3), `triangles` (F, 3) int, `normals` (V, 3), `uv` (V, 2) or None."""

    vertices: Array
    triangles: NDArray[np.int32]
    normals: Array
    uv: Array | None = None


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a deformation takes a mesh: `vertices` and `normals` (V, 3), `rotations` (V, 3, 3) from rest to posed.

    The rotations are orthonormal, and take the rest normal of a vertex to its posed one.
    """

    name: str
    vertices: Array
    normals: Array
    rotations: Array
    convex: bool = False


@dataclass(frozen=True, eq=False)
class Geometry:
    """A shape at rest, and the pose in which it is seen, if there is one.

    Attributes
    ----------
    mesh : TriangleMesh or None
        At rest. None is the unit sphere about the origin, in closed form.
    convex : bool
        True where no point can shadow another at rest, so that no visibility ray is needed.
    notes : tuple of str
        What a user should know of how it was read, a line each (dropped triangles, turned normals ...).
    pose : Pose or None
    """

    name: str
    mesh: TriangleMesh | None = None
    convex: bool = True
    notes: tuple[str, ...] = ()
    pose: Pose | None = None

    @property
    def rest(self) -> Geometry:
        """The shape without its pose: all that a method's `prepare` gets to see."""
        return self if self.pose is None else replace(self, pose=None)

    @cached_property
    def posed(self) -> Geometry:
        """The shape that is seen, itself without a pose."""
        if self.pose is None or self.mesh is None:
            return self
        mesh = replace(self.mesh, vertices=self.pose.vertices, normals=self.pose.normals)
        return replace(self, mesh=mesh, convex=self.pose.convex, pose=None)

    @cached_property
    def key(self) -> str:
        """Content address of the shape."""
        if self.mesh is None:
            return "unit sphere"
        parts = [self.mesh.vertices, self.mesh.triangles, self.mesh.normals]
        convex = [self.convex]
        if self.mesh.uv is not None:
            parts += [self.mesh.uv]
        if self.pose is not None:
            parts += [self.pose.vertices, self.pose.normals, self.pose.rotations]
            convex += [self.pose.convex]
        return hashlib.sha256(b"".join(a.tobytes() for a in parts) + bytes(convex)).hexdigest()


@dataclass(frozen=True)
class Viewer:
    """Who looks: either a distant `direction` (from the surface to the viewer), or an `eye` at a finite place.

    `axis` is the camera's forward direction where there is an eye.
    """

    direction: tuple[float, float, float] | None = None
    eye: tuple[float, float, float] | None = None
    axis: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if (self.direction is None) == (self.eye is None):
            raise BadInput("a viewer is either a distant direction or an eye; give exactly one of them.")


@dataclass(frozen=True, eq=False)
class Points:
    """The queries that a method answers, and the reference answers the same ones.

    Attributes
    ----------
    position, normal, geometric_normal, tangent, view : (n, 3) float64
        Unit vectors but `position`; `normal` is the shading normal, `view` points to the viewer.
    weight : (n,)
        Quadrature weight: what an error averages over. Sums to 1.
    rotation : (n, 3, 3) or None
        Rest-to-posed rotation; None is the identity.
    modulation : (n, 3) or None
        What the material's texture is at each point; None is 1. It multiplies what a method's `shade` returns, so no
        method looks at it.
    triangle : (n,) int or None; barycentric : (n, 3) or None; uv : (n, 2) or None
    material, pose : (n,) int or None
        Indices; None is all zero.
    pixel : (n, 2) int or None
        Row and column in an image of `image_shape` (H, W), where the points form one.
    notes : tuple of str
        What a user should know of how they were chosen, a line each (pixels left out ...).
    """

    position: Array
    normal: Array
    geometric_normal: Array
    tangent: Array
    view: Array
    weight: Array
    rotation: Array | None = None
    modulation: Array | None = None
    triangle: NDArray[np.int32] | None = None
    barycentric: Array | None = None
    uv: Array | None = None
    material: NDArray[np.int32] | None = None
    pose: NDArray[np.int32] | None = None
    pixel: NDArray[np.int32] | None = None
    image_shape: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.weight)
        for name in ("position", "normal", "geometric_normal", "tangent", "view"):
            if getattr(self, name).shape != (n, 3):
                raise BadInput(f"points.{name} must have shape ({n}, 3). Got {getattr(self, name).shape} instead.")

    def __len__(self) -> int:
        return len(self.weight)

    @cached_property
    def reflection(self) -> Array:
        """R = 2 (N.V) N - V, shape (n, 3)."""
        return reflect(self.view, self.normal)

    def central(self, centre: Centre) -> Array:
        """Return the central direction of a lobe at each point, (n, 3)."""
        match centre:
            case Centre.REFLECTION:
                return self.reflection
            case Centre.NORMAL:
                return self.normal
            case Centre.TANGENT:
                return self.tangent

    def spread(self, count: int) -> Points:
        """Return `count` of the points, evenly spread over their order, equally weighted and no longer an image."""
        return self.taken(np.unique(np.linspace(0, len(self) - 1, count).round().astype(int)))

    def taken(self, chosen: NDArray[np.int_]) -> Points:
        """Return the `chosen` points, some perhaps more than once, equally weighted and no longer an image."""
        per_point = (f.name for f in fields(self) if f.name not in ("weight", "pixel", "image_shape", "notes"))
        taken: dict[str, Any] = {
            name: array[chosen] for name in per_point if (array := getattr(self, name)) is not None
        }
        return replace(self, **taken, weight=np.full(len(chosen), 1 / len(chosen)), pixel=None, image_shape=None)

    def image(self, values: NDArray[np.floating], empty: float = np.nan) -> NDArray[np.floating]:
        """Lay per-point `values` (n, C) out as an image (H, W, C); pixels without a point hold `empty`."""
        if self.pixel is None or self.image_shape is None:
            raise BadInput("these points form no image; score them as a point set.")
        out = np.full((*self.image_shape, *values.shape[1:]), empty, dtype=values.dtype)
        out[self.pixel[:, 0], self.pixel[:, 1]] = values
        return out

    @cached_property
    def key(self) -> str:
        """Content address of the queries as a reference sees them."""
        parts = (self.position, self.normal, self.geometric_normal, self.tangent, self.view)
        return hashlib.sha256(b"".join(np.ascontiguousarray(a, np.float64).tobytes() for a in parts)).hexdigest()
