"""A view of Cabral's maps: three of them warped exactly, or over the paper's tessellated disk; then one lookup a point.

Both warps end in the same twelve bilinear samples' worth of memory; what the mesh saves is arithmetic alone. The kernel
that reads the three maps without any warp is what neither can undercut.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from data_gen.lobes import Phong
from envbench.environment import Environment
from envbench.geometry import Geometry, Viewer
from envbench.material import Material
from methods.cabral import Cabral, Relit

VIEWER = Viewer(direction=(0.3, -0.9, 0.316))


def relit(method: Cabral) -> Relit:
    radiance = np.random.default_rng(0).uniform(0, 1, (32, 64, 3)).astype(np.float32)
    prepared = method.prepare(Material("m", (Phong(exponent=32, clipped=False),)), Geometry("sphere"))
    return method.relight(prepared, Environment("random", radiance))


@pytest.mark.parametrize("rings", [8, 16, 32])
@pytest.mark.parametrize("size", [64, 256])
def test_mesh_against_exact_warp(size: int, rings: int, benchmark: Any, against: Callable[..., float]) -> None:
    """One frame: the mesh beside the exact warp, and how far its picture is from that."""
    exact, mesh = (Cabral(size=size, prefilter="angular", mesh=n) for n in (0, rings))
    maps = relit(exact)
    meshed = Relit(mesh.prepare(Material("m", maps.prepared.groups[0].lobes), Geometry("sphere")), maps.maps)
    against(lambda: mesh.frame(meshed, VIEWER), lambda: exact.frame(maps, VIEWER), "exact warp", rounds=25)
    a, b = (m.frame(r, VIEWER).maps[0][1][..., :3] for m, r in ((mesh, meshed), (exact, maps)))
    benchmark.extra_info["nrmse_against_exact"] = float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))
