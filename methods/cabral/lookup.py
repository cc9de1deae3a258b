"""Looking a view's map up: one bilinear sample by the mirror direction, the normal or the tangent."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from envbench import llvm
from envbench.directions import Array
from envbench.geometry import Points
from envbench.material import Centre
from methods.cabral import spheremap


def look_up(maps: tuple[tuple[Centre, NDArray[np.float32]], ...], axes: Array, points: Points) -> NDArray[np.float32]:
    """Return the sum (n, 3) of the maps (size, size, 4), each at its own direction in the view's frame (3, 3)."""
    llvm.find()
    import drjit as dr
    from drjit.llvm import Array4f, Float

    value: Any = Array4f(0)
    for index, stored in maps:
        local = np.ascontiguousarray((points.central(index) @ axes).T, np.float32)
        x, y, z = map(Float, local)
        table = Float(stored.ravel())
        value += spheremap.look_up(table, len(stored), spheremap.from_mirror((x, y, z), (1.0, 0.0)))
    dr.eval(value)
    dr.sync_thread()
    return np.array(value)[:3].T.copy()
