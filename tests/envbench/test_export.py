"""The three formats hold the same rows, and a place that cannot be written is left as it was."""

import csv
import json
import math
import subprocess
import sys

import pyarrow.parquet as pq
import pytest

from envbench.errors import BadInput
from envbench.export import columns, export, rows
from envbench.metrics import METRICS
from envbench.records import CellResult, Phase, RunInfo, SceneResult, Score, Status, Timing
from envbench.store import Store

SCENE = SceneResult(
    name="grace", light="grace", material="phong", geometry="sphere", view="front", specs={}, effects=("a", "b"),
    points=9, reference_key="f00d", reference_floor=1e-3, reference_target=1e-3, reference_samples=512,
    reference_replicates=8, reference_seconds=1.5, reference_from_cache=False, reference_rms=1.0,
)  # fmt: skip
CELL = CellResult(
    "k1", "grace", "shrm", {"epsilon": 0.1}, Status.OK, timings=(Timing(Phase.RELIGHT, 0.5, (0.1, 0.3, 0.2)),),
    scores=(Score("nrmse", 0.1, 0.05, 0.15, True), Score("psnr", math.inf), Score("energy_ratio", math.nan)),
    bytes=7, predictions={"captured BRDF energy": 0.01}, description={"F": 12}, lacks=("interreflection",),
)  # fmt: skip
FAILED = CellResult("k2", "gone", "angular", {}, Status.FAILED, 'said "no", twice\nand again')


@pytest.fixture
def store(tmp_path):
    with Store.open(tmp_path / "results.sqlite", create=True) as store:
        store.begin(RunInfo("r1", "quick", "", "2026-01-02T03:04:05", {}, {}))
        store.save_scene("r1", SCENE)
        store.save_cell("r1", CELL)
        store.save_cell("r1", FAILED)
        yield store


def test_a_row_holds_the_cell_with_units_in_the_names(store):
    row, failed = rows(store, store.run("latest"))
    expected = {
        "run": "r1", "scene": "grace", "light": "grace", "effects": "a; b", "points": 9, "reference_floor": 1e-3,
        "reference_s": 1.5, "method": "shrm", "settings": '{"epsilon": 0.1}', "status": "ok", "memory_bytes": 7,
        "lacks": "interreflection", "relight_first_s": 0.5, "relight_median_s": 0.2, "relight_fastest_s": 0.1,
        "relight_slowest_s": 0.3, "shade_median_s": None, "nrmse": 0.1, "nrmse_low": 0.05, "nrmse_high": 0.15,
        "nrmse_below_floor": True, "psnr": math.inf, "psnr_low": None, "energy_ratio": None, "mse": None,
        "predicted_energy_errors": '{"captured BRDF energy": 0.01}', "description": '{"F": 12}',
    }  # fmt: skip
    assert {name: row[name] for name in expected} == expected
    assert list(row) == list(failed) == list(columns())
    assert set(METRICS) <= set(row)
    assert (failed["status"], failed["light"], failed["nrmse"]) == ("failed", None, None)


def test_every_format_holds_the_rows(store, tmp_path):
    expected = rows(store, store.run("r1"))
    table = pq.read_table(export(store, "latest", tmp_path / "cells.parquet"))
    assert table.to_pylist() == expected
    assert {str(table.schema.field(name).type) for name in ("nrmse", "mse", "shade_median_s")} == {"double"}

    with export(store, "r", tmp_path / "cells.csv").open(newline="") as file:
        found = list(csv.DictReader(file))
    assert found == [{k: "" if v is None else str(v) for k, v in row.items()} for row in expected]

    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    text = export(store, "r1", tmp_path / "CELLS.JSON").read_text()
    unbounded = [{k: None if v == math.inf else v for k, v in row.items()} for row in expected]
    assert json.loads(text, parse_constant=refuse) == unbounded


def test_a_run_without_cells_has_columns(store, tmp_path):
    store.begin(RunInfo("r2", "quick", "", "later", {}, {}))
    assert export(store, "latest", tmp_path / "none.csv").read_text().count("\n") == 1
    assert pq.read_table(export(store, "latest", tmp_path / "none.parquet")).num_rows == 0


def test_unknown_suffix(store, tmp_path):
    with pytest.raises(BadInput, match=r"unknown suffix '.parket': did you mean '.parquet'\? Known: .csv"):
        export(store, "latest", tmp_path / "cells.parket")


def test_places_that_cannot_be_written(store, tmp_path):
    (tmp_path / "folder.csv").mkdir()
    for path in (tmp_path / "none" / "cells.csv", tmp_path / "folder.csv", "/proc/cells.csv"):
        with pytest.raises(BadInput, match=r"cannot write .*\.csv: .* nothing was changed") as caught:
            export(store, "latest", path)
        assert "\n" not in str(caught.value)


FULL = """
import resource, signal, sys
from envbench.errors import BadInput
from envbench.export import export
from envbench.store import Store

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))  # as if the disk had no more room
with Store.open(sys.argv[1]) as store:
    for path in sys.argv[2:]:
        try:
            export(store, "latest", path)
        except BadInput as error:
            print(error)
"""


def test_a_full_disk_leaves_the_earlier_file(store, tmp_path):
    paths = [tmp_path / f"cells.{suffix}" for suffix in ("csv", "json", "parquet")]
    for path in paths:
        path.write_text("earlier")
    done = subprocess.run(
        [sys.executable, "-c", FULL, store.path, *paths], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.count("cannot write") == len(done.stdout.splitlines()) == 3, done.stdout + done.stderr
    assert [path.read_text() for path in paths] == ["earlier"] * 3
    assert not list(tmp_path.glob(".cells*"))
