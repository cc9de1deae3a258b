"""A mesh as Mitsuba takes it: what ground truth casts its rays at."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from envbench.geometry import TriangleMesh


def mitsuba_mesh(mi: ModuleType, mesh: TriangleMesh, properties: Any = None) -> Any:
    """Return the mesh with its normals (and uv, if any) as a `mi.Mesh` of the variant that is set.

    `properties` may hold what the mesh is made of, as a `mi.Properties`.
    """
    shape = mi.Mesh(
        "mesh", len(mesh.vertices), len(mesh.triangles), properties or mi.Properties(), has_vertex_normals=True,
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
