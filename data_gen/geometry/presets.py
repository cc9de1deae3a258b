"""Shapes by name. Meshes lie in the data folder (`data_gen.external`), and are looked for when one is built."""

from __future__ import annotations

from typing import Any


def _mesh(name: str, **pose: Any) -> dict[str, Any]:
    table: dict[str, Any] = {"kind": "mesh", "path": f"meshes/{name}.npz", "up": "y"}
    return {**table, "pose": pose} if pose else table


_TILE = 0.25
_RELIEFS: dict[str, dict[str, Any]] = {
    "bumps": {"texture": "bumps", "height": 0.3 * _TILE},
    "weave": {"texture": "weave", "height": 0.25 * _TILE},
    "swirl": {"texture": "swirl", "height": 0.12 * _TILE},
    "waffle": {"texture": "waffle", "height": 0.4 * _TILE},
    "wrinkle": {"texture": "wrinkle", "depth": 0.3 * _TILE, "width": 0.6},
}
"""The textures with heights that shadow visibly: shares of a tile's side."""

_SQUARE: dict[str, Any] = {"kind": "patch", "tiles": 4, "size": 4 * _TILE, "resolution": 97}
_ROUND: dict[str, Any] = {"kind": "patch", "tiles": [10, 8], "size": [10 * _TILE, 8 * _TILE], "resolution": [201, 161]}
"""Patches of 24 and 20 vertices a tile; the second is about as wide as the vase is round, and as high as its profile is
long, so that tiles keep their shape on it."""

_SLAB: dict[str, Any] = {
    "kind": "patch", "tiles": 3, "size": 3 * _TILE, "resolution": 43, "thickness": 0.4 * _TILE, **_RELIEFS["waffle"],
}  # fmt: skip
"""A closed waffle for light to scatter in: 3,698 vertices above and below, 344 at its sides."""

_VASE = {"kind": "onto", "surface": "vase"}
_TORUS = {"kind": "onto", "surface": {"kind": "torus", "radius": 0.45, "tube": 0.28}}
_LEAN = {"kind": "bend", "degrees": 50.0, "axis": "z", "towards": "x"}

# In the file's axes: the arm of handle 0 is raised by 50 degrees about -z through its shoulder. Row by row, with c and
# s the cosine and sine, p the shoulder: x' = c (x - p_x) + s (y - p_y) + p_x, y' = -s (x - p_x) + c (y - p_y) + p_y.
_C, _S, _SHOULDER = 0.6427876, 0.7660444, (-0.13, 0.16)
_STILL = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
_RAISED = [
    *(_C, _S, 0.0, (1 - _C) * _SHOULDER[0] - _S * _SHOULDER[1]),
    *(-_S, _C, 0.0, _S * _SHOULDER[0] + (1 - _C) * _SHOULDER[1]),
    *(0.0, 0.0, 1.0, 0.0),
]

GEOMETRIES: dict[str, dict[str, Any]] = {
    "sphere": {"kind": "sphere"},
    "head": _mesh("head_big_ears"),
    "head-bent": _mesh("head_big_ears", kind="bend", degrees=60.0, axis="z", towards="x"),
    "head-twisted": _mesh("head_big_ears", kind="twist", degrees=90.0, axis="z"),
    "head-sad": _mesh("head_sad"),
    "bat": _mesh("bat"),
    "bat-flying": _mesh("bat", kind="skin", time=0.5),
    "armadillo": _mesh("armadillo"),
    "armadillo-waving": _mesh("armadillo", kind="skin", transforms=[_RAISED, _STILL, _STILL, _STILL, _STILL]),
    "elephant": _mesh("elephant"),
    "elephant-posed": _mesh("elephant", kind="skin", frame=100.0),
    "spot": _mesh("spot"),
    "spot-stretched": _mesh("spot", kind="stretch", factor=1.4, axis="z"),
    "bunny": _mesh("bunny"),
    "cylinder": {"kind": "cylinder"},
    "vase": {"kind": "vase"},
    "torus": {"kind": "torus"},
    "ellipsoid": {"kind": "ellipsoid", "axes": [1.0, 0.8, 0.6]},
    "bowl": {"kind": "vase", "profile": [[0.7, 0.5], [0.66, 0.3], [0.5, 0.12], [0.3, 0.03], [0.01, 0.0]]},
    "tube": {"kind": "vase", "profile": [[0.3, 1.0], [0.3, 0.0]]},
    "walls": {"kind": "walls"},
    "patch-flat": {**_SQUARE, "texture": "bumps", "height": 0.0},
    "cloth-folded": {
        **_SQUARE,
        "texture": "bumps",
        "height": 0.0,
        "pose": {"kind": "wave", "amplitude": 0.12, "cycles": 2.0},
    },
    "vase-waved": {"kind": "vase", "pose": {"kind": "wave", "amplitude": 0.06, "axis": "z", "towards": "x"}},
    **{f"patch-{name}": {**_SQUARE, **relief} for name, relief in _RELIEFS.items()},
    **{
        f"patch-{name}-waved": {**_SQUARE, **relief, "pose": {"kind": "wave", "amplitude": 0.08}}
        for name, relief in _RELIEFS.items()
    },
    **{
        f"patch-{name}-bent": {**_SQUARE, **relief, "pose": {"kind": "onto", "surface": "bent"}}
        for name, relief in _RELIEFS.items()
    },
    "slab-waffle": _SLAB,
    "slab-waffle-bent": {**_SLAB, "pose": {"kind": "onto", "surface": "bent"}},
    **{f"vase-{name}": {**_ROUND, **relief, "pose": _VASE} for name, relief in _RELIEFS.items()},
    **{f"vase-{name}-bent": {**_ROUND, **relief, "pose": [_VASE, _LEAN]} for name, relief in _RELIEFS.items()},
    **{f"torus-{name}": {**_ROUND, **relief, "pose": _TORUS} for name, relief in _RELIEFS.items()},
}
