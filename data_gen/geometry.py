"""Shapes by name or by a table of a suite: `build` makes them, `GEOMETRIES` are the presets.

``{"kind": "sphere"}`` is the unit sphere in closed form. ``{"kind": "mesh", "path": "shape.obj"}`` reads a triangle
mesh (.obj .ply .stl .glb through trimesh, or .npz with arrays `vertices`, `triangles`, optionally `normals` and `uv`);
``convex = true | false`` overrides what its triangles say.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench.directions import Array, normalised
from envbench.errors import BadInput, unknown
from envbench.geometry import Geometry, TriangleMesh

GEOMETRIES: dict[str, dict[str, Any]] = {"sphere": {"kind": "sphere"}}

SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".npz")
NO_AREA = 1e-14
"""A triangle whose area is below this share of the squared diagonal has none."""
HULL_GAP = 1e-6
"""A closed mesh that fills all but this share of its hull's volume is convex (single precision leaves about 1e-7)."""


def build(spec: Mapping[str, Any], name: str = "geometry") -> Geometry:
    """Make a shape from a table with ``kind`` "sphere" or "mesh" (`path`, optionally `convex`).

    Raises
    ------
    BadInput
        For an unknown kind or setting, and for a file that holds no usable mesh.

    Examples
    --------
    >>> build({"kind": "sphere"}, "ball").convex
    True
    """
    kinds = {"sphere": set[str](), "mesh": {"path", "convex"}}
    kind = str(spec.get("kind"))
    if kind not in kinds:
        raise unknown(f"kind of geometry '{name}':", kind, kinds)
    for key in spec:
        if key not in kinds[kind] | {"kind"}:
            raise unknown(f"setting of geometry '{name}' ({kind}):", key, kinds[kind])
    if kind == "sphere":
        return Geometry(name)
    path, convex = spec.get("path"), spec.get("convex")
    if not isinstance(path, str | Path):
        raise BadInput(f"geometry '{name}': path must name a mesh file. Got {path!r} instead.")
    if not isinstance(convex, bool | None):
        raise BadInput(f"geometry '{name}': convex must be true or false. Got {convex!r} instead.")
    return read(Path(path), name, convex)


def read(path: Path, name: str | None = None, convex: bool | None = None) -> Geometry:
    """Read a triangle mesh.

    Zero-area triangles and unused vertices are dropped, a closed mesh that is inside out is turned, and normals that
    the file lacks are means of the adjoining triangles' normals weighted by the corner angle, vertices at one place
    taken as one (so creases are smoothed: write normals to the file to keep them). Each is said in the notes.

    Parameters
    ----------
    path : Path
    name : str, optional
        The file's name without suffix by default.
    convex : bool, optional
        Overrides the test: closed, and as large as its convex hull.

    Raises
    ------
    BadInput
        Missing, empty or unreadable file, unknown suffix, no triangles, NaN, an index out of range.
    """
    name = name or path.stem
    vertices, triangles, normals, uv = _load(path)
    _check(path, vertices, triangles, normals, uv)
    notes: list[str] = []

    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    solid = np.linalg.norm(_cross(vertices, triangles), axis=1) > 2 * NO_AREA * extent**2
    if not solid.any():
        raise BadInput(f"mesh '{path}' holds no triangle of positive area; export it with its faces.")
    if not solid.all():
        notes.append(f"{np.count_nonzero(~solid)} triangles without area were dropped from '{path.name}'.")
    triangles = triangles[solid]
    used, corners = np.unique(triangles, return_inverse=True)
    if len(used) < len(vertices):
        notes.append(f"{len(vertices) - len(used)} unused vertices were dropped from '{path.name}'.")
    triangles = corners.reshape(-1, 3).astype(np.int32)
    vertices, normals, uv = vertices[used], None if normals is None else normals[used], None if uv is None else uv[used]

    triangles, filled = _outward(vertices, triangles, path, notes)
    normals = _shading_normals(vertices, triangles, normals, path, notes)
    mesh = TriangleMesh(vertices, triangles, normals, uv)
    return Geometry(name, mesh, bool(filled) if convex is None else convex, tuple(notes))


def mitsuba_mesh(mi: ModuleType, mesh: TriangleMesh) -> Any:
    """Return the mesh with its normals (and uv, if any) as a `mi.Mesh` of the variant that is set."""
    properties = mi.Properties()
    shape = mi.Mesh(
        "mesh", len(mesh.vertices), len(mesh.triangles), properties, has_vertex_normals=True,
        has_vertex_texcoords=mesh.uv is not None,
    )  # fmt: skip
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    parameters["faces"] = mesh.triangles.astype(np.uint32).ravel()
    if mesh.uv is not None:
        parameters["vertex_texcoords"] = mesh.uv.astype(np.float32).ravel()
    parameters.update()
    return shape


_Loaded = tuple[Array, NDArray[Any], Array | None, Array | None]


def _load(path: Path) -> _Loaded:
    if path.suffix.lower() not in SUFFIXES:
        raise BadInput(f"mesh '{path}' ends in '{path.suffix}'; give one of {', '.join(SUFFIXES)}.")
    if not path.is_file():
        raise BadInput(f"mesh '{path}' is not there; check the path.")
    if path.stat().st_size == 0:
        raise BadInput(f"mesh '{path}' is empty; write it again.")
    try:
        return _load_npz(path) if path.suffix.lower() == ".npz" else _load_trimesh(path)
    except Exception as error:  # parsers of six formats, each with errors of its own for a broken file
        reason = " ".join(str(error).split())[:120]
        raise BadInput(f"mesh '{path}' cannot be read ({reason}); write it again.") from error


def _load_npz(path: Path) -> _Loaded:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        normals = file["normals"].astype(float) if "normals" in file else None
        uv = file["uv"].astype(float) if "uv" in file else None
        return file["vertices"].astype(float), np.asarray(file["triangles"]), normals, uv


def _load_trimesh(path: Path) -> _Loaded:
    import trimesh

    scene: Any = trimesh.load_scene(path, process=False)
    parts: list[Any] = []
    for node in scene.graph.nodes_geometry:
        matrix, key = scene.graph[node]
        part = scene.geometry[key].copy(include_cache=True)
        if isinstance(part, trimesh.Trimesh) and len(part.faces):
            parts.append(part.apply_transform(matrix))
    if not parts:
        return np.zeros((0, 3)), np.zeros((0, 3), int), None, None
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    triangles = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)])
    # `vertex_normals` would compute what the file lacks, without welding; the cache holds only what it gives
    given = all("vertex_normals" in part._cache for part in parts)
    uvs: list[Any] = [getattr(part.visual, "uv", None) for part in parts]
    return (
        np.concatenate([part.vertices for part in parts]),
        triangles,
        np.concatenate([part.vertex_normals for part in parts]) if given else None,
        np.concatenate(uvs) if all(uv is not None for uv in uvs) else None,
    )


def _check(path: Path, vertices: Array, triangles: NDArray[Any], normals: Array | None, uv: Array | None) -> None:
    for what, array, columns in (("vertices", vertices, 3), ("triangles", triangles, 3), ("normals", normals, 3),
                                 ("uv", uv, 2)):  # fmt: skip
        if array is not None and (array.ndim != 2 or array.shape[1] != columns):
            raise BadInput(f"mesh '{path}': {what} have shape {array.shape}; (n, {columns}) is needed.")
    for what, array in (("normals", normals), ("uv", uv)):
        if array is not None and len(array) != len(vertices):
            raise BadInput(f"mesh '{path}': {len(array)} {what} for {len(vertices)} vertices; give one a vertex.")
    if not len(triangles):
        raise BadInput(f"mesh '{path}' holds no triangles; export it with its faces.")
    if not np.issubdtype(triangles.dtype, np.integer):
        raise BadInput(f"mesh '{path}': triangles are {triangles.dtype}; integers are needed.")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        worst = triangles.max() if triangles.max() >= len(vertices) else triangles.min()
        raise BadInput(f"mesh '{path}': a triangle names vertex {worst} of {len(vertices)} (from 0); write it again.")
    for what, array in (("vertices", vertices), ("normals", normals), ("uv", uv)):
        if array is not None and not np.isfinite(array[triangles]).all():
            raise BadInput(f"mesh '{path}' holds NaN or infinite {what}; mend it first.")


def _cross(vertices: Array, triangles: NDArray[Any]) -> Array:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _outward(
    vertices: Array, triangles: NDArray[np.int32], path: Path, notes: list[str]
) -> tuple[NDArray[np.int32], bool]:
    """Turn a closed mesh's triangles outward, and tell whether it fills its convex hull."""
    import trimesh

    welded: Any = trimesh.Trimesh(vertices, triangles, process=False)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    if not (welded.is_watertight and welded.is_winding_consistent):
        return triangles, False
    if welded.volume < 0:
        notes.append(f"'{path.name}' was inside out; its triangles were turned.")
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    volume = abs(welded.volume)
    return triangles, volume > 0 and welded.convex_hull.volume * (1 - HULL_GAP) <= volume


def _shading_normals(
    vertices: Array, triangles: NDArray[np.int32], normals: Array | None, path: Path, notes: list[str]
) -> Array:
    """Return unit normals (V, 3) that point to the same side as the triangles: the file's, or computed ones."""
    import trimesh

    if normals is not None and (np.linalg.norm(normals, axis=1) > 0).all():
        normals = normalised(normals)
        if np.sum(_cross(vertices, triangles) * normals[triangles].sum(1)) < 0:
            notes.append(f"the normals of '{path.name}' opposed its triangles; they were turned.")
            normals = -normals
        return normals
    places, welded = np.unique(vertices, axis=0, return_inverse=True)
    welded = welded.ravel()
    mesh = trimesh.Trimesh(places, welded[triangles], process=False)
    computed = normalised(mesh.vertex_normals)[welded]
    if not (np.linalg.norm(computed, axis=1) > 0.5).all():
        raise BadInput(f"mesh '{path}' has a vertex whose triangles face each other; give it normals.")
    notes.append(f"normals of '{path.name}' were computed from its triangles.")
    return computed
