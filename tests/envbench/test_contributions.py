"""The command that shows what effects contribute to a scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from envbench import contributions
from envbench.effects import EffectSettings
from envbench.errors import BadInput
from envbench.reference import ReferenceSettings


def show(name: str, out: Path) -> None:
    contributions.show(name, EffectSettings(), ReferenceSettings(floor=1e-2), out, None)


def test_facts_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show("constant/lambertian/sphere/uniform", tmp_path)
    said = capsys.readouterr().out
    assert "self-shadowing" in said
    assert "convex" in said
    assert "no images" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("constant/lambertian", "four names"),
        ("constant/lambertian/spere/image", "did you mean 'sphere'"),
        ("constnt/lambertian/sphere/image", "did you mean 'constant'"),
    ],
)
def test_bad_names(name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=message):
        show(name, tmp_path)
