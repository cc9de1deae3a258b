"""Generated meshes: patches as height fields, facing walls, ellipsoids, and surfaces of revolution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry import parameters as p
from data_gen.geometry import reliefs, surfaces
from data_gen.geometry.surfaces import Surface
from envbench.directions import Array, normalised
from envbench.errors import BadInput, unknown
from envbench.geometry import Geometry, TriangleMesh

RESOLUTION = 64
"""Vertices a side, where a table does not say."""
MAX_RESOLUTION = 2048
"""Most vertices a side: 8.4 million triangles."""


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A rectangle of `size` in z = 0 with a relief: `tiles` of a generated texture, or of a picture.

    `height` is that of the relief above z = 0. The wrinkle is a groove below it instead, of a `depth` and a `width`
    (share of a tile) at a `location` across the tile. uv go once over the patch, whatever its tiles. With a `thickness`
    it is a closed slab, flat below, its bottom so far under the relief's lowest point.
    """

    kind: ClassVar[str] = "patch"

    texture: str | None = None
    image: Any = None
    resolution: Any = RESOLUTION
    tiles: Any = 1
    size: Any = 1.0
    height: float | None = None
    depth: float | None = None
    location: float | None = None
    width: float | None = None
    thickness: float | None = None

    def __post_init__(self) -> None:
        p.pair("resolution", self.resolution, 2, MAX_RESOLUTION)
        p.pair("tiles", self.tiles, 1, 1024)
        p.lengths("size", self.size)
        if (self.texture is None) == (self.image is None):
            raise BadInput("a patch has either a texture or an image; give exactly one of them.")
        if self.texture is not None and self.texture not in (*reliefs.RELIEFS, "wrinkle"):
            raise unknown("texture", str(self.texture), [*reliefs.RELIEFS, "wrinkle"])
        if self.image is not None:
            p.path("image", self.image)
        wrinkle = self.texture == "wrinkle"
        limits = {"height": (-1e3, 1e3), "depth": (0, 1e3), "location": (-1e3, 1e3), "width": (1e-3, 1)}
        for key, (low, high) in limits.items():
            value = getattr(self, key)
            if value is None:
                continue
            if (key == "height") == wrinkle:
                raise BadInput(
                    f"{key} is no setting of {'a wrinkle' if wrinkle else 'this texture: a wrinkle has it'}."
                )
            p.number(key, value, low, high)
        if self.thickness is not None:
            p.number("thickness", self.thickness, 1e-6, 1e6)

    def geometry(self, name: str) -> Geometry:
        """Make the mesh."""
        tiles, size = np.array(p.pair("tiles", self.tiles, 1, 1024)), np.array(p.lengths("size", self.size))
        resolution = p.pair("resolution", self.resolution, 2, MAX_RESOLUTION)
        relief, scale = self._relief(int(max(resolution / tiles)))
        uv, triangles = grid(resolution)
        s, t = (uv * tiles).T
        h = relief(s, t)
        low = h.max() if self.texture == "wrinkle" else 0.0  # the wrinkle lies below its surroundings
        slope = scale * np.stack(reliefs.slopes(relief, s, t), axis=1) * tiles / size
        vertices = np.concatenate([uv * size, scale * (h - low)[:, None]], axis=1)
        normals = normalised(np.concatenate([-slope, np.ones((len(uv), 1))], axis=1))
        flat = float(np.ptp(vertices[:, 2])) == 0
        mesh = TriangleMesh(vertices, triangles, normals, uv)
        if self.thickness is not None:
            mesh = slab(mesh, resolution, float(vertices[:, 2].min()) - self.thickness)
        return Geometry(name, mesh, flat, self._notes(resolution, tiles))

    def _relief(self, samples: int) -> tuple[reliefs.Relief, float]:
        if self.texture == "wrinkle":
            location = 0.5 if self.location is None else self.location
            return reliefs.groove(location, 0.5 if self.width is None else self.width), 0.2 if self.depth is None else (
                self.depth
            )
        height = 0.15 if self.height is None else self.height
        if self.image is not None:
            return reliefs.picture(self.image, samples), height
        return reliefs.RELIEFS[str(self.texture)], height

    def _notes(self, resolution: tuple[int, int], tiles: NDArray[np.int_]) -> tuple[str, ...]:
        a_tile = min((n - 1) / k for n, k in zip(resolution, tiles, strict=True))
        if a_tile >= 8:
            return ()
        return (f"{a_tile:.2g} vertices a tile cannot hold its relief; a resolution of 8 a tile or more is needed.",)


@dataclass(frozen=True, kw_only=True)
class Walls:
    """Two upright rectangles of `size` (along y, along z) that face each other across a `gap` along x."""

    kind: ClassVar[str] = "walls"

    size: Any = 1.0
    gap: float = 0.5
    resolution: Any = RESOLUTION // 2

    def __post_init__(self) -> None:
        p.lengths("size", self.size)
        p.number("gap", self.gap, 1e-6, 1e6)
        p.pair("resolution", self.resolution, 2, MAX_RESOLUTION)

    def geometry(self, name: str) -> Geometry:
        """Make the mesh: the wall at -x first, each seen from the other."""
        uv, triangles = grid(p.pair("resolution", self.resolution, 2, MAX_RESOLUTION))
        along = (uv - 0.5) * p.lengths("size", self.size)
        sides: list[Array] = []
        normals: list[Array] = []
        for side in (-1.0, 1.0):  # on the wall at +x y runs backwards, so that (S_u, S_v, n) is right-handed there too
            across = np.full(len(uv), side * self.gap / 2)
            sides.append(np.stack([across, -side * along[:, 0], along[:, 1]], axis=1))
            normals.append(np.tile([-side, 0.0, 0.0], (len(uv), 1)))
        both = np.concatenate([triangles, triangles + len(uv)]).astype(np.int32)
        mesh = TriangleMesh(np.concatenate(sides), both, np.concatenate(normals), np.tile(uv, (2, 1)))
        return Geometry(name, mesh, False)


@dataclass(frozen=True, kw_only=True)
class Ellipsoid:
    """A convex mesh: an icosahedron's faces divided into 4^`subdivisions`, on the ellipsoid of half-`axes` x, y, z."""

    kind: ClassVar[str] = "ellipsoid"

    axes: Any = (1.0, 1.0, 1.0)
    subdivisions: int = 4

    def __post_init__(self) -> None:
        if (p.array("axes", self.axes, (3,)) <= 0).any():
            raise BadInput(f"axes must be three lengths > 0. Got {self.axes!r} instead.")
        p.integer("subdivisions", self.subdivisions, 0, 8)

    def geometry(self, name: str) -> Geometry:
        """Make the mesh."""
        from trimesh.creation import icosphere

        ball: Any = icosphere(subdivisions=self.subdivisions)
        axes, unit = np.array(self.axes, float), np.asarray(ball.vertices, float)
        mesh = TriangleMesh(unit * axes, np.asarray(ball.faces, np.int32), normalised(unit / axes))
        return Geometry(name, mesh, True)


def slab(top: TriangleMesh, resolution: tuple[int, int], bottom: float) -> TriangleMesh:
    """Return the solid between a height field over a grid and the plane z = `bottom`, closed by four walls.

    All parts have their own vertices at the edges, with normals of their own, and uv that are x and y scaled.
    """
    assert top.uv is not None
    columns, rows = resolution
    count = len(top.vertices)
    index = np.arange(count).reshape(rows, columns)
    below = top.vertices * [1, 1, 0] + [0, 0, bottom]
    parts: list[tuple[Array, NDArray[Any], Array, Array]] = [
        (top.vertices, top.triangles, top.normals, top.uv),
        (below, top.triangles[:, ::-1], np.tile([0.0, 0, -1], (count, 1)), top.uv),
    ]
    # counter-clockwise about the slab, seen from above: what is on the left is outside once z is up
    edges = [
        (index[0], (0, -1, 0)),
        (index[:, -1], (1, 0, 0)),
        (index[-1, ::-1], (0, 1, 0)),
        (index[::-1, 0], (-1, 0, 0)),
    ]
    for edge, normal in edges:
        n = len(edge)
        k = np.arange(n - 1)
        quads = np.stack([np.stack([k, k + 1, n + k + 1], 1), np.stack([k, n + k + 1, n + k], 1)], 1).reshape(-1, 3)
        wall = np.concatenate([below[edge], top.vertices[edge]])
        parts.append((wall, quads, np.tile(np.array(normal, float), (2 * n, 1)), np.tile(top.uv[edge], (2, 1))))
    starts = np.cumsum([0] + [len(vertices) for vertices, *_ in parts])
    return TriangleMesh(
        np.concatenate([vertices for vertices, *_ in parts]),
        np.concatenate([t + start for (_, t, *_), start in zip(parts, starts, strict=False)]).astype(np.int32),
        np.concatenate([normals for *_, normals, _ in parts]),
        np.concatenate([uv for *_, uv in parts]),
    )


def revolved(surface: Surface, resolution: Any, name: str) -> Geometry:
    """Make the mesh of a surface: seen from outside; the two sides of a seam are vertices at one place."""
    uv, triangles = grid(p.pair("resolution", resolution, 3, MAX_RESOLUTION))
    u, v = uv.T
    vertices, _, normals = surfaces.thick(surface, u, v, np.zeros_like(u), (1.0, 1.0))
    return Geometry(name, TriangleMesh(vertices, triangles, normalised(normals), uv), False)


def grid(resolution: tuple[int, int]) -> tuple[Array, NDArray[np.int32]]:
    """Return uv (V, 2), u fastest, and triangles (F, 3), counter-clockwise, of a grid of columns and rows."""
    columns, rows = resolution
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    upper = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    triangles = np.stack([lower, upper], axis=1).reshape(-1, 3).astype(np.int32)
    return np.stack([u.ravel(), v.ravel()], axis=1), triangles
