"""The gate fails for each way of becoming worse, and for nothing else."""

import math
import re
from dataclasses import replace

import pytest

from envbench.errors import BadInput
from envbench.gate import gate
from envbench.records import CellResult, Phase, RunInfo, SceneResult, Score, Status, Timing
from envbench.store import Store

FLOOR = 1e-3
SCENE = SceneResult(
    name="grace", light="grace", material="phong", geometry="sphere", view="front", specs={}, effects=(), points=9,
    reference_key="f00d", reference_floor=FLOOR, reference_target=1e-3, reference_samples=1, reference_replicates=8,
    reference_seconds=1.0, reference_from_cache=False, reference_rms=1.0,
)  # fmt: skip


def cell(nrmse=0.1, energy=1.0, status=Status.OK, seconds=0.25, **changes):
    scores = (Score("nrmse", nrmse), Score("energy_ratio", energy), Score("rmse", 0.5))
    found = CellResult(
        "k", "grace", "shrm", {"epsilon": 0.1, "F": 3}, status, timings=(Timing(Phase.RELIGHT, seconds),), scores=scores
    )
    return replace(found, **changes)


@pytest.fixture
def judge(tmp_path):
    """Judge `new` cells against `old` ones."""
    with Store.open(tmp_path / "results.sqlite", create=True) as store:

        def save(run, cells, scenes):
            store.begin(RunInfo(run, "quick", "", "now", {}, {}, finished="then"))
            for scene in scenes:
                store.save_scene(run, scene)
            for number, one in enumerate(cells):
                store.save_cell(run, replace(one, key=f"{run} {number}"))

        def judge(new, old, scenes=(SCENE,), old_scenes=(SCENE,), **options):
            save("old", old, old_scenes)
            save("new", new, scenes)
            return gate(store, "new", store, "old", **options)

        yield judge


def test_a_run_passes_against_itself(judge):
    report = judge([cell()], [cell()])
    assert report.ok
    assert report.lines() == [
        "time  grace / shrm(epsilon=0.1, F=3): relight 250 ms, was 250 (not judged)",
        "gate: run new against baseline old: 1 cells compared, ok.",
    ]


@pytest.mark.parametrize(
    ("new", "old"),
    [
        (cell(0.1009), cell(0.1)),  # within 1 %
        (cell(0.05, 1.0), cell(0.1, 1.2)),  # better
        (cell(0.1, 0.991), cell(0.1, 1.0)),  # energy within .01
        (cell(0.1, 0.86), cell(0.1, 1.15)),  # on the other side of 1, within .01
        (cell(FLOOR / 101), cell(0.0)),  # within 1 % of the floor
        (cell(seconds=9.0), cell()),  # slower: not judged
        (cell(settings={"F": 3, "epsilon": 0.1}), cell()),  # the order of settings means nothing
        (cell(math.nan, math.nan), cell(math.nan, math.nan)),  # all black, the same RMSE
        (cell(), cell(status=Status.CRASHED)),
        (cell(status=Status.FAILED), cell(status=Status.FAILED)),
        (cell(status=Status.DECLINED), cell(status=Status.DECLINED)),
    ],
)
def test_open(judge, new, old):
    assert judge([new], [old]).ok


@pytest.mark.parametrize(
    ("new", "old", "said"),
    [
        (cell(0.1011), cell(0.1), "nrmse 0.1011, was 0.1: allowed is at most 0.101"),
        (cell(FLOOR / 99), cell(0.0), "nrmse .* was 0: allowed is at most 1e-05"),
        (cell(energy=0.989), cell(), r"energy_ratio 0.989, was 1: allowed is \|ratio - 1\| at most 0.01"),
        (cell(energy=1.17), cell(energy=0.85), "energy_ratio 1.17"),
        (cell(math.nan), cell(), "nrmse nan, was 0.1"),
        (cell(scores=(Score("energy_ratio", 1.0),)), cell(), "nrmse nan, was 0.1"),
        (cell(math.nan, scores=(Score("rmse", 0.51),)), cell(math.nan, math.nan), "rmse 0.51, was 0.5"),
        (cell(status=Status.TIMED_OUT, reason="after 120 s"), cell(), r"timed out \(after 120 s\), was ok"),
        (cell(status=Status.DECLINED), cell(), "declined, was ok"),
        (cell(status=Status.CRASHED), cell(status=Status.DECLINED), "crashed, was declined"),
        (cell(settings={}), cell(), "is missing, the baseline has it"),
        (cell(method="angular"), cell(), "is missing, the baseline has it"),
    ],
)
def test_shut(judge, new, old, said):
    report = judge([new], [old])
    assert not report.ok
    (line,) = report.failures
    assert re.search(said, line), line


def test_energy_margin_is_absolute_and_each_margin_can_be_set(judge):
    report = judge(
        [cell(0.104, 0.95)], [cell(0.1, 1.0)], margin=0.03, margins={"energy_ratio": 0.06, "nrmse": 0.05}
    )  # fmt: skip
    assert report.ok


def test_references_must_be_the_same(judge):
    other = replace(SCENE, reference_key="beef")
    report = judge([cell(0.5)], [cell(0.1)], scenes=[other])
    assert report.failures == (
        "grace: reference differs (beef, was f00d): run the baseline again with the present references",
    )
    assert report.compared == 0


def test_a_reference_of_one_address_may_have_come_out_otherwise(judge):
    again = replace(SCENE, reference_samples=SCENE.reference_samples + 1)
    report = judge([cell(0.1)], [cell(0.1)], scenes=[again])
    assert report.failures == (
        "grace: reference was made anew and came out otherwise: let both runs share one cache folder",
    )


@pytest.mark.parametrize("scenes", [(), (replace(SCENE, reference_key=""),)])
def test_a_missing_reference_is_a_failure(judge, scenes):
    report = judge([], [cell()], scenes=scenes)
    assert report.failures == (
        "grace: has no reference in the run",
        "grace / shrm(epsilon=0.1, F=3): is missing, the baseline has it",
    )
    assert report.lines()[-1].endswith("0 cells compared, 2 failures.")


def test_new_cells_are_told_not_judged(judge):
    report = judge([cell(), cell(0.9, method="angular")], [cell()])
    assert report.ok
    assert report.notes == ("grace / angular(epsilon=0.1, F=3): new (ok), not judged",)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"margin": -0.1}, r"margin for nrmse must be a number >= 0\. Got -0\.1"),
        ({"margin": math.nan}, "Got nan"),
        ({"margins": {"nrsme": 0.1}}, "unknown margin 'nrsme': did you mean 'nrmse'"),
    ],
)
def test_bad_margins(judge, options, said):
    with pytest.raises(BadInput, match=said):
        judge([cell()], [cell()], **options)


def test_an_empty_baseline_proves_nothing(judge):
    with pytest.raises(BadInput, match=r"baseline run 'old' of .* holds no cell"):
        judge([cell()], [])
