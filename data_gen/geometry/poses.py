"""Poses of a mesh, from the table `pose` of its own: `pose` makes one.

Every kind says where the vertices go and what F, the deformation's gradient there, is; normals and rotations follow
(`data_gen.geometry.frames`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from data_gen.external import locate
from data_gen.geometry import files, surfaces
from data_gen.geometry import parameters as p
from data_gen.geometry.deformations import Bend, Box, Deformation, Stretch, Turn, Twist, Wave
from data_gen.geometry.frames import posed_normals, surface_rotations, vertex_gradients
from data_gen.geometry.skinning import Skin
from data_gen.geometry.soundness import angle_weighted_normals, is_convex, welded
from envbench.directions import Array, normalised
from envbench.errors import BadInput
from envbench.geometry import Pose, TriangleMesh


@dataclass(frozen=True, eq=False)
class Rest:
    """A mesh to pose: its file, how many vertices that holds and which were `kept`, and how the file was turned."""

    mesh: TriangleMesh
    kept: NDArray[np.int_]
    count: int
    file: Path | None = None
    turn: Array = field(default_factory=lambda: np.eye(3))
    closed: bool = False


@dataclass(frozen=True, kw_only=True)
class Onto:
    """A flat patch laid onto a surface: (u, v, h) goes to S(u, v) + relief h n(u, v), where h is the patch's z.

    `surface` is "bent", "cylinder", "vase", "torus", or a table of that `kind` with settings.
    """

    kind: ClassVar[str] = "onto"

    surface: Any
    relief: float = 1.0

    def __post_init__(self) -> None:
        p.number("relief", self.relief, -1e3, 1e3)
        self.made()

    def made(self) -> surfaces.Surface:
        """Return the surface."""
        table: Any = {"kind": self.surface} if isinstance(self.surface, str) else self.surface
        return p.made("surface", surfaces.SURFACES, table)

    def at(self, mesh: TriangleMesh) -> tuple[Array, Array]:
        """Return posed places (V, 3) and gradients (V, 3, 3)."""
        if mesh.uv is None:
            raise BadInput("a patch needs uv to be laid onto a surface; this mesh has none.")
        # uv = A (x, y) + c, by least squares: exact for what is flat and unwrapped as it lies
        plane = np.column_stack([mesh.vertices[:, :2], np.ones(len(mesh.uv))])
        fit = np.linalg.lstsq(plane, mesh.uv, rcond=None)[0]
        if np.abs(plane @ fit - mesh.uv).max() > 1e-3:
            raise BadInput("only a flat patch is laid onto a surface: its uv must be x and y, scaled.")
        A = fit[:2].T
        if np.linalg.det(A) <= 0:
            raise BadInput("the uv of the patch are the mirror image of its x and y; turn v round.")
        size = (1 / float(np.linalg.norm(A[0])), 1 / float(np.linalg.norm(A[1])))
        u, v = mesh.uv.T
        places, by_uvh, _ = surfaces.thick(self.made(), u, v, self.relief * mesh.vertices[:, 2], size)
        inner = np.eye(3) * self.relief
        inner[:2, :2] = A
        return places, by_uvh @ inner


@dataclass(frozen=True, kw_only=True)
class Keyed:
    """The vertices, and normals if there are any, of another .npz: the same mesh elsewhere, vertex by vertex."""

    kind: ClassVar[str] = "file"

    path: Any

    def __post_init__(self) -> None:
        p.path("path", self.path)

    def at(self, rest: Rest) -> tuple[Array, Array, Array]:
        """Return posed places (V, 3), gradients (V, 3, 3) and normals (V, 3)."""
        path = locate(self.path)
        vertices, normals = files.posed_arrays(path)
        if len(vertices) != rest.count:
            raise BadInput(f"'{path.name}' poses {len(vertices)} vertices; this mesh has {rest.count}.")
        places = vertices[rest.kept] @ rest.turn.T
        triangles = rest.mesh.triangles
        F = vertex_gradients(rest.mesh, places)
        if normals is None:
            found = angle_weighted_normals(places, triangles, welded(rest.mesh.vertices))
        else:
            found = normalised(normals[rest.kept] @ rest.turn.T)
            a, b, c = (places[triangles[:, k]] for k in range(3))
            if np.sum(np.cross(b - a, c - a) * found[triangles].sum(1)) < 0:  # of a mesh that was inside out
                found = -found
        return places, F, found


KINDS: dict[str, Any] = {kind.kind: kind for kind in (Turn, Bend, Twist, Stretch, Wave, Skin, Onto, Keyed)}
"""Every kind of pose."""


def pose(table: Any, rest: Rest) -> tuple[Pose, tuple[str, ...]]:
    """Pose a mesh as a table says, or a list of tables carried out in turn; also say what a user should know of it.

    Raises
    ------
    BadInput
        For an unknown kind or setting, a value out of range, or arrays that are not this mesh's.
    """
    steps: list[Any] = list(table) if isinstance(table, list | tuple) else [table]
    if not steps:
        raise BadInput("pose must be a table with 'kind', or a list of them. Got [] instead.")
    made: list[Any] = [p.made("pose", KINDS, step) for step in steps]
    try:
        state = _first(made[0], rest)
        for step in made[1:]:
            state = _then(step, *state)
    except BadInput as error:
        raise type(error)(f"pose: {error}") from None
    places, F, normals = state
    name = " then ".join(step.kind for step in made)
    if not np.isfinite(places).all():
        raise BadInput(f"pose: '{name}' takes vertices to infinity or NaN; choose smaller settings.")
    rotations = surface_rotations(rest.mesh.normals, normals, F)
    convex = rest.closed and is_convex(places, rest.mesh.triangles)
    return Pose(name, places, normals, rotations, convex), _notes(places, rest.mesh, F)


_State = tuple[Array, Array, Array]
"""Posed places (V, 3), gradients from rest (V, 3, 3), and posed normals (V, 3)."""


def _first(made: Any, rest: Rest) -> _State:
    mesh = rest.mesh
    match made:
        case Skin():
            own, back = rest.turn, rest.turn.T  # of rows: x own are the file's axes, x back ours
            x, F, normals = made.at(rest.file, rest.count, rest.kept, mesh.vertices @ own, mesh.normals @ own)
            state = x @ back, rest.turn @ F @ rest.turn.T, normals @ back
        case Keyed():
            state = made.at(rest)
        case Onto():
            places, gradients = made.at(mesh)
            return places, gradients, posed_normals(mesh.normals, gradients)
        case _:
            return _then(made, mesh.vertices, np.broadcast_to(np.eye(3), (len(mesh.vertices), 3, 3)), mesh.normals)
    return _with_normals(mesh, *state)


def _with_normals(mesh: TriangleMesh, places: Array, F: Array, normals: Array) -> _State:
    """Give those without a posed normal the one that F carries."""
    lost = ~normals.any(axis=1)
    normals[lost] = posed_normals(mesh.normals[lost], F[lost])
    return places, F, normals


def _then(made: Any, places: Array, F: Array, normals: Array) -> _State:
    if isinstance(made, Skin | Onto | Keyed):
        raise BadInput(f"'{made.kind}' begins at the mesh at rest; put it first.")
    deformation: Deformation = made
    moved, gradient = deformation.at(places, Box.of(places))
    return moved, gradient @ F, posed_normals(normals, gradient)


def _notes(places: Array, mesh: TriangleMesh, F: Array) -> tuple[str, ...]:
    notes: list[str] = []
    folded = int(np.count_nonzero(np.linalg.det(F) <= 0))
    if folded:
        notes.append(
            f"the pose folds the shape at {folded} of {len(F)} vertices (its gradient is singular or reflects)."
        )
    a, b, c = (places[mesh.triangles[:, k]] for k in range(3))
    lost = int(np.count_nonzero(~np.cross(b - a, c - a).any(axis=1)))
    if lost:
        notes.append(f"{lost} of {len(mesh.triangles)} triangles have no area in the pose.")
    return tuple(notes)
