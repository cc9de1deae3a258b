"""What a suite may say of effects, and how it is told what is wrong."""

from __future__ import annotations

import pytest

from envbench import suite
from envbench.effects import EffectSettings
from envbench.errors import BadInput
from envbench.scene import Effect, Plan


def test_defaults() -> None:
    settings = suite.parse("", "s").effects
    assert (settings.plan, settings.limit, settings.order) == (Plan.AUTO, pytest.approx(0.005), 6)
    assert suite.parse("[effects]\naccuracy = 0.2\n", "s").effects.limit == pytest.approx(0.02)
    assert suite.parse("[effects]\naccuracy = 0.2\ntolerance = 0.1", "s").effects.limit == 0.1


def test_a_plan_or_a_list() -> None:
    grid = "[[scenes]]\nlights = []\nmaterials = []\neffects = "
    assert suite.parse(grid + '"all"', "s").scenes[0].effects is Plan.ALL
    listed = suite.parse(grid + '["self-shadowing", "anisotropy", "anisotropy"]', "s").scenes[0].effects
    assert listed == (Effect.ANISOTROPY, Effect.SELF_SHADOWING)
    assert EffectSettings(plan=["deformation"]).plan == (Effect.DEFORMATION,)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("tolerance = 0.0", "tolerance must be a finite number > 0. Got 0.0 instead"),
        ("tolerance = -0.1", "tolerance must be a finite number > 0. Got -0.1 instead"),
        ("tolerance = inf", "tolerance"),
        ("tolerance = nan", "tolerance"),
        ("accuracy = 0.0", "accuracy must be a finite number > 0"),
        ("budget = -1.0", "budget must be a finite number > 0"),
        ("order = 0", "order must lie in"),
        ('plan = "al"', "did you mean 'all'"),
        ('plan = ["self-shadow"]', "unknown effect 'self-shadow': did you mean 'self-shadowing'"),
        ('probe = "some"', "unknown probe of effects 'some'"),
        ("tolerence = 0.1", "did you mean 'tolerance'"),
    ],
)
def test_bad_input(line: str, message: str) -> None:
    with pytest.raises(BadInput, match=message.replace("(", "\\(")) as error:
        suite.parse(f"[effects]\n{line}\n", "s")
    assert "\n" not in str(error.value)
