"""LDPRT's shading of a head of 17,575 vertices beside what it replaces: eq. 13 evaluated, and SH rotation a vertex.

The paper's rates are of a Geforce 6800 Ultra: 100 to 200 frames a second for diffuse transfer (n = 6, N = 4, three
channels), 70 to 100 for glossy (n = 4, three rows of three lobes, one channel), 1430 tables a second by themselves. A
frame here is all that changes with light and pose: the table, the turned axes, the lookups.

A table pays where lookups are cheap, as on graphics hardware. On a processor with 16 lanes a lookup of 12 numbers at
four corners takes longer than evaluating 32 harmonics: eq. 25 costs about twice what eq. 13 does, and the kernel alone
four times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from data_gen.lobes import CookTorrance
from envbench.directions import Array, uniform
from envbench.material import Material
from methods.ldprt import glossy, shade, table
from methods.ldprt.shade import Packed, Turning

Against = Callable[..., float]
VERTICES = 17_575
FRAMES_BAR = 200.0
GLOSSY_FRAMES_BAR = 100.0
TABLES_BAR = 1430.0


@dataclass(frozen=True)
class Head:
    """Random lobes: what shading costs does not depend on their values."""

    lobes: Packed
    transfer: NDArray[np.float32]
    rotations: Array
    light: Array


def head(n: int = 6, lobes: int = 4, rows: int = 1) -> Head:
    rng = np.random.default_rng(0)
    shape = (VERTICES, rows, lobes)
    coefficients = rng.normal(size=(*shape, n))
    coefficients[..., :2] = 0
    axes = uniform(VERTICES * rows * lobes, rng).reshape(*shape, 3)
    packed = shade.pack(axes, coefficients, rng.normal(size=(VERTICES, rows, 4)))
    transfer = rng.normal(size=(VERTICES, n * n)).astype(np.float32)
    return Head(packed, transfer, Rotation.random(VERTICES, rng).as_matrix(), rng.normal(size=(n * n, 3)))


def frame(given: Head) -> Any:
    n = given.lobes.n
    return shade.specialised(given.lobes, given.light, table.build(given.light, n), given.rotations)


def rates(benchmark: Any, bar: float | None = None) -> None:
    seconds = benchmark.stats.stats.median
    best = benchmark.stats.stats.min
    benchmark.extra_info.update(
        frames_per_second=1 / seconds, best_frames_per_second=1 / best, points_per_second=VERTICES / seconds
    )
    if bar is not None:
        benchmark.extra_info["frames_per_second_bar"] = bar


def test_frame_against_evaluation(against: Against, benchmark: Any) -> None:
    """Eqs. 24 and 25, the table included, beside eq. 13."""
    given = head()
    against(
        lambda: frame(given), lambda: shade.evaluated(given.lobes, given.light, given.rotations), "eq. 13 evaluated"
    )
    rates(benchmark, FRAMES_BAR)


@pytest.mark.parametrize("turning", list(Turning))
def test_frame_against_full_rotation(turning: Turning, against: Against, benchmark: Any) -> None:
    """Beside zxzxz: the light three times a vertex, as the paper has it, or transfer once."""
    given = head()
    against(
        lambda: frame(given),
        lambda: shade.full(given.transfer, given.light, given.rotations, turning),
        f"SH rotation of {turning} a vertex",
    )
    rates(benchmark, FRAMES_BAR)


def test_evaluation_against_full_rotation(against: Against, benchmark: Any) -> None:
    """Eq. 13 beside zxzxz of the light."""
    given = head()
    against(
        lambda: shade.evaluated(given.lobes, given.light, given.rotations),
        lambda: shade.full(given.transfer, given.light, given.rotations),
        "SH rotation of light a vertex",
    )
    rates(benchmark, FRAMES_BAR)


def test_local_light(against: Against, benchmark: Any) -> None:
    """A light of each vertex's own: harmonics from a table beside harmonics evaluated."""
    given = head()
    lights = np.random.default_rng(1).normal(size=(VERTICES, 36, 3)).astype(np.float32)
    against(
        lambda: shade.locally(given.lobes, lights, table.harmonics(6), given.rotations),
        lambda: shade.evaluated(given.lobes, lights, given.rotations),
        "eq. 13 evaluated",
        rounds=7,
    )
    rates(benchmark)


def test_glossy_frame(benchmark: Any) -> None:
    """Eq. 16, n = 4, three rows of three lobes, three channels: table, view factors and lookups."""
    given = head(4, 3, 3)
    normals = uniform(VERTICES, np.random.default_rng(2))
    brdf, frames = glossy.factor(Material("glossy", (CookTorrance(roughness=0.3),)), 4, 3), glossy.frames(normals)
    view = np.tile([0.0, 0.6, 0.8], (VERTICES, 1))

    def shaded() -> Any:
        factors = glossy.view_factors(brdf, view, frames, given.rotations)
        return shade.specialised(given.lobes, given.light, table.build(given.light, 4), given.rotations, factors)

    benchmark.pedantic(shaded, rounds=15, warmup_rounds=2)
    rates(benchmark, GLOSSY_FRAMES_BAR)


def test_table(benchmark: Any) -> None:
    """The 64 x 32 table of a light, n = 6."""
    light = np.random.default_rng(0).normal(size=(36, 3))
    benchmark.pedantic(lambda: table.build(light, 6), rounds=200, warmup_rounds=5)
    benchmark.extra_info.update(tables_per_second=1 / benchmark.stats.stats.median, tables_per_second_bar=TABLES_BAR)
