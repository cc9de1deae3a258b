"""Scenes on which decisions about effects are judged: known answers are among what facts allow; random ones repeat."""

from __future__ import annotations

import pytest

from benchmarks.studies.effect_scenes import Known, drawn, known
from benchmarks.studies.effect_trials import TOLERANCES, Tally
from envbench.errors import NeedsData
from envbench.scene import FREE, Basis, Decision, Effect
from references.effects.facts import occasions


@pytest.mark.parametrize("case", known(), ids=lambda case: case.name)
def test_what_is_known_to_matter_is_ruled_out_by_no_fact(case: Known) -> None:
    try:
        scene = case.build()
    except NeedsData as error:
        pytest.skip(str(error))
    assert case.effects <= occasions(scene)
    assert occasions(scene) & FREE <= case.effects  # effects that cost nothing are simulated unless facts rule them out


@pytest.mark.parametrize("seed", [0, 1, 11])
def test_a_random_scene_is_the_same_again(seed: int) -> None:
    one, two = drawn(seed), drawn(seed)
    assert (one.environment.key, one.material.key) == (two.environment.key, two.material.key)
    assert (one.geometry.key, one.points.key) == (two.geometry.key, two.points.key)


class _Truth:
    most = 4

    def contribution(self, effect: Effect, bounces: int = 0) -> float:
        return 0.03 if effect is Effect.SELF_SHADOWING else 0.001 / (1 + bounces)


def test_decisions_are_judged_by_what_effects_truly_contribute() -> None:
    tally, tolerance = Tally(), TOLERANCES[0]
    for decision in (
        Decision(Effect.SELF_SHADOWING, False, Basis.PROBE, ""),
        Decision(Effect.INTERREFLECTION, True, Basis.PROBE, "undecided within its budget", bounces=2),
        Decision(Effect.ANISOTROPY, False, Basis.FACT, ""),
    ):
        tally.count(decision, {Effect.SELF_SHADOWING}, _Truth(), tolerance)  # pyright: ignore[reportArgumentType]
    nothing_to_act_on = Decision(Effect.DEFORMATION, False, Basis.PROBE, "")
    tally.count(nothing_to_act_on, set[Effect](), _Truth(), tolerance)  # pyright: ignore[reportArgumentType]
    assert (tally.left_out, tally.missed, tally.simulated, tally.needless, tally.undecided) == (3, 1, 1, 1, 1)
    assert tally.worst == pytest.approx(1.5)
