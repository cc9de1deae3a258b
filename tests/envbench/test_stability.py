"""Verdicts on hard cases: known errors, known verdicts; and the knobs of a suite, turned."""

from __future__ import annotations

import math

import pytest

from envbench import root, suite
from envbench.errors import BadInput
from envbench.plan import plan
from envbench.records import CellResult, SceneResult, Score, Status
from envbench.stability import FACTOR, LEVEL, Outcome, verdicts
from tests.envbench.conftest import SUITE, UserFolder


def scene(step: int, vary: str = "material.exponent") -> SceneResult:
    return SceneResult(
        name=f"step {step}", light="l", material="m", geometry="g", view="v", specs={"knob": {"vary": vary}},
        effects=(), points=1, reference_key="", reference_floor=1e-3, reference_target=1e-3, reference_samples=1,
        reference_replicates=8, reference_seconds=0.0, reference_from_cache=False, reference_rms=1.0,
        knob="gloss", step=step, setting=str(10**step),
    )  # fmt: skip


def cell(step: int, error: float, *, below: bool = False, **settings: object) -> CellResult:
    score = Score("nrmse", error, 0.0 if below else 0.9 * error, 1.1 * error, below)
    return CellResult(f"{step} {settings}", f"step {step}", "own", dict(settings), Status.OK, scores=(score,))


def ended(step: int, status: Status, reason: str) -> CellResult:
    return CellResult(str(step), f"step {step}", "own", {}, status, reason)


def judged(*cells: CellResult):
    (verdict,) = verdicts([scene(step) for step in range(len(cells))], cells)
    return verdict


def test_an_error_may_grow_by_the_factor_and_not_more() -> None:
    easy = 0.05
    # The lower end, .9 of the error, is held against FACTOR times the easy step's upper end, 1.1 of its error.
    edge = FACTOR * 1.1 * easy / 0.9
    assert judged(cell(0, easy), cell(1, 0.99 * edge)).outcome is Outcome.STABLE
    worse = judged(cell(0, easy), cell(1, 0.02), cell(2, 1.01 * edge))
    assert worse.outcome is Outcome.DEGRADES
    assert worse.first(Outcome.DEGRADES).setting == "100"
    assert "degrades from 100" in worse.text


def test_small_errors_and_those_below_the_floor_are_well() -> None:
    assert judged(cell(0, 1e-5), cell(1, LEVEL)).outcome is Outcome.STABLE
    assert judged(cell(0, 1e-5), cell(1, 3 * LEVEL, below=True)).outcome is Outcome.STABLE


@pytest.mark.parametrize("status", [status for status in Status if status not in (Status.OK, Status.DECLINED)])
def test_whatever_ends_a_cell_breaks_and_so_does_worse_than_black(status: Status) -> None:
    assert judged(cell(0, 0.1), ended(1, status, "why")).outcome is Outcome.BREAKS
    assert judged(cell(0, 0.9), cell(1, 1.2)).outcome is Outcome.BREAKS
    assert judged(cell(0, 0.9), cell(1, 1.1)).outcome is Outcome.STABLE  # its interval begins at .99


def test_the_worst_is_the_verdict_and_every_turn_is_told() -> None:
    verdict = judged(
        cell(0, 0.01), cell(1, 0.5), ended(2, Status.DECLINED, "too narrow"), ended(3, Status.CRASHED, "x")
    )
    assert verdict.outcome is Outcome.BREAKS
    assert [word for word in ("degrades from 10 ", "declines from 100 (too narrow)", "breaks from 1000 (crashed: x)")
            if word not in verdict.text] == []  # fmt: skip
    recovered = judged(cell(0, 0.01), cell(1, 0.5), cell(2, 0.01))
    assert "degrades at 10 " in recovered.text  # not from there on


def test_a_black_step_is_judged_by_its_status_alone() -> None:
    verdict = judged(cell(0, math.nan), cell(1, 0.02))
    assert verdict.outcome is Outcome.DEGRADES  # there is no easy error: LEVEL alone
    assert judged(cell(0, 0.01), cell(1, math.nan)).outcome is Outcome.STABLE


def test_settings_apart_are_judged_apart_but_what_is_turned_is_left_out() -> None:
    scenes = [scene(0, "method.order"), scene(1, "method.order")]
    cells = [cell(step, 0.01, eps=eps, order=4 + step) for step in (0, 1) for eps in (0.1, 0.2)]
    assert [verdict.settings for verdict in verdicts(scenes, cells)] == [{"eps": 0.1}, {"eps": 0.2}]
    assert all(len(verdict.steps) == 2 for verdict in verdicts(scenes, cells))


KNOB = """
[[methods]]
name = "own"
[[knobs]]
name = "gloss"
light = "grey"
material = {{ lobes = [{{ kind = "lambertian" }}, {{ kind = "phong", exponent = 8 }}] }}
view = "tiny"
vary = "{vary}"
values = {values}
"""


def turned(user: UserFolder, vary: str, values: str):
    user.method("own")
    text = SUITE + KNOB.format(vary=vary, values=values)
    return plan(suite.parse(text, "t.toml", user.path), root.load(user.path))


def test_a_knob_is_a_scene_a_step(user: UserFolder) -> None:
    work = turned(user, "material.lobes.1.exponent", "[8, 1e3]")
    steps = [spec for spec in work.scenes if spec.turn]
    assert [spec.name for spec in steps] == [f"grey/gloss = {value}/sphere/tiny" for value in ("8", "1000")]
    assert [spec.specs["material"]["lobes"][1]["exponent"] for spec in steps] == [8, 1000.0]
    assert [spec.place() for spec in steps] == [
        {"position": 1 + i, "knob": "gloss", "step": i, "setting": setting} for i, setting in enumerate(("8", "1000"))
    ]


def test_a_setting_of_the_methods_and_a_whole_part_can_be_turned(user: UserFolder) -> None:
    work = turned(user, "method.number", "[1, 5]")
    cells = [cell for cell in work.cells if cell.scene.turn]
    assert [(cell.scene.view, cell.method.number) for cell in cells] == [("gloss = 1", 1), ("gloss = 5", 5)]
    assert len({cell.key for cell in cells}) == 2
    work = turned(user, "light", '["grey", { kind = "constant" }]')
    assert [spec.light for spec in work.scenes if spec.turn] == ["gloss = grey", "gloss = kind constant"]


@pytest.mark.parametrize(("vary", "values", "said"), [
    ("exponent", "[1, 2]", "vary must begin with light, material"),
    ("method", "[1, 2]", "vary must begin with light, material"),
    ("material.lobes.7.exponent", "[1, 2]", "leads nowhere in the material's table"),
    ("material.lobes.1.exponent", "[1]", "values must hold two steps at least"),
    ("material.lobes.1.exponent", "[1, -1]", "exponent"),
    ("method.numbr", "[1, 2]", "'numbr': did you mean 'number'?"),
    ("view", "[1, 2]", "a view is a name or a table. Got 1 instead."),
])  # fmt: skip
def test_a_knob_that_cannot_be_turned_is_refused_in_a_line(user: UserFolder, vary: str, values: str, said: str) -> None:
    with pytest.raises(BadInput, match=r"^[^\n]*$") as refused:
        turned(user, vary, values)
    assert said in str(refused.value)
