"""Triangle meshes from files: .obj .ply .stl .glb through trimesh, and .npz of plain arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_gen.geometry.soundness import Sound, mended
from envbench.directions import Array
from envbench.errors import BadInput

SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".npz")
MAX_TRIANGLES = 2**25
"""More are refused: they would need tens of GB on their way."""


def load(path: Path) -> tuple[Sound, int]:
    """Read a triangle mesh, mended where it can be, and how many vertices the file holds.

    Raises
    ------
    BadInput
        Missing, empty or unreadable file, unknown suffix, no triangles, NaN, an index out of range.
    """
    vertices, triangles, normals, uv = _load(path)
    _check(path, vertices, triangles, normals, uv)
    return mended(vertices, triangles, normals, uv, path.name), len(vertices)


def posed_arrays(path: Path) -> tuple[Array, Array | None]:
    """Read `vertices` (n, 3), and `normals` if there are any, of an .npz without triangles.

    Raises
    ------
    BadInput
        It is no .npz, or the arrays are of another shape, NaN or infinite.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            vertices = file["vertices"].astype(float)
            normals = file["normals"].astype(float) if "normals" in file else None
    except Exception as error:  # no zip, no such array, arrays of objects
        raise BadInput(f"'{path}' is no .npz with an array vertices; write it again.") from error
    for what, array in (("vertices", vertices), ("normals", normals)):
        if array is not None and (array.shape != (len(vertices), 3) or not np.isfinite(array).all()):
            raise BadInput(f"{what} of '{path}' must be {len(vertices)} x 3 finite numbers.")
    return vertices, normals


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
    if len(triangles) > MAX_TRIANGLES:
        raise BadInput(
            f"mesh '{path}' has {len(triangles):,} triangles; at most {MAX_TRIANGLES:,} are read: reduce it."
        )
    if not np.issubdtype(triangles.dtype, np.integer):
        raise BadInput(f"mesh '{path}': triangles are {triangles.dtype}; integers are needed.")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        worst = triangles.max() if triangles.max() >= len(vertices) else triangles.min()
        raise BadInput(f"mesh '{path}': a triangle names vertex {worst} of {len(vertices)} (from 0); write it again.")
    for what, array in (("vertices", vertices), ("normals", normals), ("uv", uv)):
        if array is not None and not np.all(np.isfinite(array), axis=1)[triangles].all():
            raise BadInput(f"mesh '{path}' holds NaN or infinite {what}; mend it first.")
