"""Synthetic runs: records as a run leaves them, without one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from envbench.records import CellResult, Film, MaterialSheet, Phase, RunInfo, SceneResult, Score, Status, Study, Timing


@dataclass(frozen=True)
class Records:
    """What a report reads of a store, for one run."""

    info: RunInfo
    scene_results: Sequence[SceneResult]
    cell_results: Sequence[CellResult]
    sheet_results: Sequence[MaterialSheet] = ()
    study_results: Sequence[Study] = ()
    film_results: Sequence[Film] = ()

    def run(self, ref: str) -> RunInfo:
        return self.info

    def scenes(self, run_id: str) -> list[SceneResult]:
        return list(self.scene_results)

    def cells(self, run_id: str) -> list[CellResult]:
        return list(self.cell_results)

    def sheets(self, run_id: str) -> list[MaterialSheet]:
        return list(self.sheet_results)

    def studies(self, run_id: str) -> list[Study]:
        return list(self.study_results)

    def films(self, run_id: str) -> list[Film]:
        return list(self.film_results)


class Synthetic:
    """Makers of records; keyword arguments replace what they would hold."""

    @staticmethod
    def records(scenes: Sequence[SceneResult], cells: Sequence[CellResult], **changes: Any) -> Records:
        info = RunInfo(
            id="20250301-101500-ab12",
            suite="quick",
            suite_text='name = "quick"\n',
            started="2025-03-01T10:15:00+00:00",
            machine={"cpu": "a processor", "cores": 2, "memory_bytes": 8_000_000_000, "threads": {"drjit": 2}},
            versions={"envbench": "0.1.0", "mitsuba": "3.9.1"},
            finished="2025-03-01T10:16:00+00:00",
            wall_seconds=60.0,
            overhead_seconds=9.0,
        )
        return Records(replace(info, **changes), scenes, cells)

    @staticmethod
    def ball(size: int) -> NDArray[np.float32]:
        """Return a shaded ball (size, size, 3), NaN around it."""
        y, x = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
        z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
        image = np.stack([0.2 + z, 0.2 + 0.5 * z + 0.3 * np.clip(x, 0, 1), 0.3 + 0.5 * np.clip(-y, 0, 1)], axis=-1)
        image[x**2 + y**2 >= 1] = np.nan
        return image.astype(np.float32)

    @staticmethod
    def scene(light: str = "studio", material: str = "phong", **changes: Any) -> SceneResult:
        made = SceneResult(
            name=f"{light}/{material}/sphere/image",
            light=light,
            material=material,
            geometry="sphere",
            view="image",
            specs={},
            effects=("view dependence",),
            points=200,
            reference_key="0123456789abcdef" * 4,
            reference_floor=8.1e-4,
            reference_target=1e-3,
            reference_samples=4096,
            reference_replicates=8,
            reference_seconds=1.25,
            reference_from_cache=False,
            reference_rms=0.7,
            image=Synthetic.ball(16),
        )
        return replace(made, **changes)

    @staticmethod
    def timings(seconds: float, spread: float = 0.1) -> tuple[Timing, ...]:
        """Return timings of which relight + frame + shade is `seconds`, each round within +-`spread` of its median."""
        shares = {Phase.PREPARE: 2.0, Phase.RELIGHT: 0.7, Phase.FRAME: 0.1, Phase.SHADE: 0.2}
        return tuple(
            Timing(phase, 3 * share * seconds, tuple(share * seconds * f for f in (1 - spread, 1.0, 1 + spread)))
            for phase, share in shares.items()
        )

    @staticmethod
    def cell(of: SceneResult, error: float = 0.02, seconds: float = 1e-3, **changes: Any) -> CellResult:
        """Return a cell of NRMSE `error`, its interval 5 % to both sides."""
        method, settings = changes.pop("method", "shrm"), changes.pop("settings", {"eps": error})
        made = CellResult(
            key=f"{of.name} {method} {settings}",
            scene=of.name,
            method=method,
            settings=settings,
            status=Status.OK,
            timings=Synthetic.timings(seconds),
            scores=(
                Score("nrmse", error, 0.95 * error, 1.05 * error),
                Score("energy_ratio", 1 - error / 10, 1 - error / 9, 1 - error / 11),
                Score("captured_energy", 1 - error**2, 1 - 1.1 * error**2, 1 - 0.9 * error**2),
                Score("max_error", 8 * error),
                Score("ssim", 1 - error / 20),
                Score("psnr", -20 * math.log10(error)),
                Score("rmse", 0.7 * error, 0.95 * 0.7 * error, 1.05 * 0.7 * error),
            ),
            bytes=1_234_567,
            predictions={"captured BRDF energy": error**2},
            image=None if of.image is None else of.image * np.float32(1 + error),
        )
        return replace(made, **changes)

    @staticmethod
    def ended(of: SceneResult, status: Status, reason: str, **changes: Any) -> CellResult:
        """Return a cell that gave no result."""
        nothing = {"timings": (), "scores": (), "bytes": 0, "predictions": {}, "image": None}
        return Synthetic.cell(of, status=status, reason=reason, **nothing, **changes)


@pytest.fixture(scope="session")
def make() -> type[Synthetic]:
    """Makers of synthetic records."""
    return Synthetic
