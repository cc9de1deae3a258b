"""Queries by name or by a table of a suite: `build` makes the points and who looks at them, `VIEWS` are the presets.

===========  ===========================================================================================
kind         settings
===========  ===========================================================================================
`uniform`    `count`, `seed`: R and V uniform and independent over the sphere
`cap`        `reflection`, `angle` (degrees): R within a cap about a direction; `count`, `seed`
`grazing`    `degrees`: the angle of N and V; `count`, `seed`
`image`      `size` (pixels a side) and either a distant `direction` (towards the viewer, orthographic), or
             an `eye` with `fov` (degrees across the image) looking at `target`; `up` is upright in the image
`vertices`   the vertices of a mesh in its pose, weighted by area: all, or `count` of them
===========  ===========================================================================================

All but images have a view of their own at each point, and no viewer, unless a distant `direction` is given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar, Protocol

from data_gen.views.image import Image
from data_gen.views.queries import Cap, Grazing, Uniform
from data_gen.views.vertices import Vertices
from envbench.errors import BadInput, unknown
from envbench.geometry import Geometry, Points, Viewer

__all__ = ["VIEWS", "build"]

VIEWS: dict[str, dict[str, Any]] = {
    "uniform": {"kind": "uniform", "count": 4096, "seed": 0},
    "grazing": {"kind": "grazing", "degrees": 89.99, "count": 1024},
    "pole": {"kind": "cap", "reflection": [0.0, 0.0, 1.0], "angle": 1.0, "count": 1024},
    "seam": {"kind": "cap", "reflection": [1.0, 0.0, 0.0], "angle": 1.0, "count": 1024},
    "image": {"kind": "image", "size": 256, "direction": [0.0, -1.0, 0.0]},
    "camera": {"kind": "image", "size": 256, "eye": [0.0, -5.0, 2.0], "fov": 28.0},
}


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
    kinds: dict[str, type[Any]] = {view.kind: view for view in (Uniform, Cap, Grazing, Image, Vertices)}
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
