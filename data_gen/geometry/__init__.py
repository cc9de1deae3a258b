"""Shapes by name or by a table of a suite: `build` makes them, `GEOMETRIES` are the presets.

===================  ==========================================================================================
kind                 settings
===================  ==========================================================================================
`sphere`             none: the unit sphere in closed form
`mesh`               `path` (.obj .ply .stl .glb through trimesh, or .npz with arrays `vertices`, `triangles`,
                     optionally `normals` and `uv`), `convex`, `up` (the file's upward axis, which becomes z)
`patch`              a relief on a rectangle (`data_gen.geometry.generated.Patch`)
`walls`              two rectangles that face each other: `size`, `gap`, `resolution`
`ellipsoid`          a convex mesh: `axes` (half of its lengths), `subdivisions`
`cylinder` `vase`    surfaces of revolution (`data_gen.geometry.surfaces`), `resolution`
`torus`
===================  ==========================================================================================

Any but the sphere takes a table `pose`: how the mesh is deformed when it is seen (`data_gen.geometry.poses`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from data_gen.external import locate
from data_gen.geometry import files, generated, poses
from data_gen.geometry import parameters as p
from data_gen.geometry.files import SUFFIXES
from data_gen.geometry.generated import RESOLUTION, Ellipsoid, Patch, Walls
from data_gen.geometry.mitsuba_shape import mitsuba_mesh
from data_gen.geometry.poses import Rest
from data_gen.geometry.presets import GEOMETRIES
from data_gen.geometry.surfaces import SURFACES, Cylinder, Torus, Vase
from envbench.errors import BadInput
from envbench.geometry import Geometry

__all__ = ["GEOMETRIES", "SUFFIXES", "build", "mitsuba_mesh", "read"]

UPRIGHT = {
    "x": np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "y": np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]]),
    "z": np.eye(3),
}
"""The rotation that makes an axis of a file the upward one; with "y", what faced -z faces -y."""


@dataclass(frozen=True, kw_only=True)
class _Sphere:
    kind: ClassVar[str] = "sphere"


@dataclass(frozen=True, kw_only=True)
class _Mesh:
    kind: ClassVar[str] = "mesh"

    path: Any = None
    convex: Any = None
    up: str = "z"

    def __post_init__(self) -> None:
        if not isinstance(self.path, str | Path):
            raise BadInput(f"path must name a mesh file. Got {self.path!r} instead.")
        if not isinstance(self.convex, bool | None):
            raise BadInput(f"convex must be true or false. Got {self.convex!r} instead.")
        p.axis("up", self.up)


KINDS: dict[str, type[Any]] = {
    kind.kind: kind for kind in (_Sphere, _Mesh, Patch, Walls, Ellipsoid, Cylinder, Vase, Torus)
}
"""Every kind of shape, by the dataclass whose fields are its settings."""


def build(spec: Mapping[str, Any], name: str = "geometry") -> Geometry:
    """Make a shape from a table with ``kind`` and its settings, and optionally ``pose``, a table of its own.

    Raises
    ------
    BadInput
        For an unknown kind or setting, for a file that holds no usable mesh (`NeedsData` if it is absent), and for a
        pose that is not this mesh's.

    Examples
    --------
    >>> build({"kind": "sphere"}, "ball").convex
    True
    >>> bent = build({"kind": "patch", "texture": "bumps", "pose": {"kind": "bend", "degrees": 60, "axis": "x",
    ...                                                             "towards": "z"}})
    >>> bent.pose.rotations.shape
    (4096, 3, 3)
    """
    what = f"geometry '{name}'"
    revolved = str(spec.get("kind")) in SURFACES
    made: Any = p.made(what, KINDS, spec, ["pose", "resolution"] if revolved else ["pose"])
    try:
        rest, geometry = _rest(made, spec, name)
        if "pose" not in spec:
            return geometry
        if rest is None:
            raise BadInput("the sphere in closed form has no pose; give a mesh.")
        pose, notes = poses.pose(spec["pose"], rest)
    except BadInput as error:
        if str(error).startswith(("mesh '", what)):
            raise
        raise type(error)(f"{what}: {error}") from None
    return replace(geometry, pose=pose, notes=(*geometry.notes, *notes))


def read(path: Path, name: str | None = None, convex: bool | None = None) -> Geometry:
    """Read a triangle mesh.

    Zero-area triangles and unused vertices are dropped, triangles wound against their neighbours and closed meshes that
    are inside out are turned, and normals that the file lacks are means of the adjoining triangles' normals weighted by
    the corner angle, vertices at one place taken as one (so creases are smoothed: write normals to the file to keep
    them). Each is said in the notes.

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
    return _read(_Mesh(path=path, convex=convex), path, name or path.stem)[1]


def _rest(made: Any, spec: Mapping[str, Any], name: str) -> tuple[Rest | None, Geometry]:
    match made:
        case _Sphere():
            return None, Geometry(name)
        case _Mesh():
            return _read(made, locate(made.path), name)
        case Patch() | Walls() | Ellipsoid():
            geometry = made.geometry(name)
        case _:
            geometry = generated.revolved(made, spec.get("resolution", RESOLUTION), name)
    mesh = geometry.mesh
    assert mesh is not None
    return Rest(mesh, np.arange(len(mesh.vertices)), len(mesh.vertices)), geometry


def _read(made: _Mesh, path: Path, name: str) -> tuple[Rest, Geometry]:
    sound, count = files.load(path)
    turn = UPRIGHT[made.up]
    mesh = replace(sound.mesh, vertices=sound.mesh.vertices @ turn.T, normals=sound.mesh.normals @ turn.T)
    convex = sound.convex if made.convex is None else made.convex
    return Rest(mesh, sound.kept, count, path, turn, sound.closed), Geometry(name, mesh, convex, sound.notes)
