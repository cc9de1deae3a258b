"""Generated shapes that stand in for the paper's meshes where these are absent; a report names them as such."""

from __future__ import annotations

from typing import Any

RELIEF: dict[str, Any] = {
    "kind": "patch", "tiles": [5, 4], "size": [2.5, 2.0], "resolution": [151, 121], "texture": "weave", "height": 0.1,
}  # fmt: skip
"""A woven patch of 18,271 vertices, for the head of 17,575."""
ONTO_VASE: dict[str, Any] = {"kind": "onto", "surface": "vase"}
SHEET: dict[str, Any] = {"kind": "patch", "texture": "bumps", "height": 0.1, "tiles": 2, "resolution": 97}
"""A bumpy sheet, for the bat."""
