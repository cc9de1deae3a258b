"""Which method is best at a given error: known records, known answers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from envbench.records import Score, Status
from reports.verdict import LEVELS, verdicts


def answers(scenes, cells):
    (verdict,) = verdicts(scenes, cells)
    return {answer.level: answer for answer in verdict.answers["changing light"] if answer.level}


def test_the_fastest_whose_upper_bound_is_below_the_level_wins(make):
    scene = make.scene()
    cells = [make.cell(scene, e, t) for e, t in [(0.009, 5e-3), (0.04, 1e-3), (0.045, 2e-3), (0.09, 1e-4)]]
    found = answers([scene], cells)
    # Upper bounds are 1.05 times the errors: .00945, .042, .04725, .0945.
    assert {level: answer.best.settings for level, answer in found.items()} == {
        0.01: "eps=0.009",
        0.05: "eps=0.04",
        0.10: "eps=0.09",
    }
    assert found[0.05].best.seconds == pytest.approx(1e-3)
    assert sum(time for _, time in found[0.05].best.phases) == pytest.approx(1e-3)


def test_the_upper_bound_decides_and_not_the_value(make):
    scene = make.scene()
    found = answers([scene], [make.cell(scene, 0.0099)])  # its interval ends at .0104
    assert found[0.01].best is None
    assert found[0.01].closest.bound == pytest.approx(0.010395)
    assert found[0.05].best.settings == "eps=0.0099"


def test_the_level_must_hold_on_every_light_and_time_is_their_mean(make):
    scenes = [make.scene("studio"), make.scene("hall")]
    settings = {"eps": 0.1}
    cells = [
        make.cell(scene, error, seconds, settings=settings)
        for scene, error, seconds in zip(scenes, (0.005, 0.03), (1e-3, 3e-3), strict=True)
    ]
    found = answers(scenes, cells)
    assert found[0.01].best is None
    assert found[0.05].best.worst == "hall"
    assert found[0.05].best.seconds == pytest.approx(2e-3)


@pytest.mark.parametrize("status", [status for status in Status if status is not Status.OK])
def test_a_method_that_fails_on_one_scene_answers_for_none(make, status):
    scenes = [make.scene("studio"), make.scene("hall")]
    settings = {"eps": 0.1}
    cells = [make.cell(scenes[0], 0.001, settings=settings), make.ended(scenes[1], status, "why", settings=settings)]
    assert all(answer.best is None and answer.closest is None for answer in answers(scenes, cells).values())
    # Nor does one that an unfinished run has not reached yet.
    assert all(answer.best is None for answer in answers(scenes, cells[:1]).values())


def test_without_timings_or_interval_nothing_is_claimed(make):
    scene = make.scene()
    untimed = make.cell(scene, 0.001, timings=())
    unsure = make.cell(scene, 0.001, scores=(Score("nrmse", 0.001),), settings={"eps": 1})
    assert all(answer.best is None for answer in answers([scene], [untimed, unsure]).values())


def test_rounds_that_overlap_are_a_tie(make):
    scene = make.scene()
    cells = [make.cell(scene, e, t) for e, t in [(0.001, 1.0e-3), (0.002, 1.15e-3), (0.003, 1.3e-3)]]
    best = answers([scene], cells)[0.01]
    # +-10 %: 1.1 ms against 1.035 ms overlaps, against 1.17 ms does not.
    assert best.best.settings == "eps=0.001"
    assert [other.settings for other in best.tied] == ["eps=0.002"]


def test_a_black_reference_has_no_relative_error_and_does_not_spoil_the_others(make):
    black, lit = make.scene("black", reference_rms=0.0), make.scene("studio")
    settings = {"eps": 0.1}
    cells = [
        make.cell(black, settings=settings, scores=(Score("nrmse", float("nan")), Score("rmse", 0.0))),
        make.cell(lit, 0.005, settings=settings),
    ]
    (verdict,) = verdicts([black, lit], cells)
    assert verdict.undefined == ("black",)
    assert verdict.answers["changing light"][0].best.settings == "eps=0.1"
    (only,) = verdicts([black], cells[:1])
    assert only.undefined == ("black",)
    assert all(answer.best is None for answer in only.answers["changing light"])


def test_materials_are_answered_apart_and_shapes_where_there_are_several(make):
    scenes = [make.scene(material=material) for material in ("phong", "lambertian")]
    assert [verdict.title for verdict in verdicts(scenes, [])] == ["phong", "lambertian"]
    both = [*scenes, replace(scenes[0], name="bunny", geometry="bunny")]
    assert [verdict.title for verdict in verdicts(both, [])] == [
        "phong · sphere",
        "lambertian · sphere",
        "phong · bunny",
    ]


def test_the_levels_are_those_of_the_headings():
    assert LEVELS == (0.01, 0.05, 0.1)
    assert verdicts([], []) == ()
