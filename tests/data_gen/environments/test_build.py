"""Lights by specification: every preset builds, every mistake is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data_gen.environments import CAPTURED, KINDS, LIGHTS, build
from envbench.errors import BadInput


@pytest.mark.parametrize("name", LIGHTS)
def test_every_preset_builds(name: str) -> None:
    light = build(LIGHTS[name])
    assert light.radiance.dtype == np.float32
    assert light.mean.min() > 0
    assert light.key == build(LIGHTS[name]).key


def test_every_kind_has_a_preset_but_files() -> None:
    assert {spec["kind"] for spec in LIGHTS.values()} == set(KINDS) - {"file"}


def test_captured_maps_carry_their_licence() -> None:
    assert (CAPTURED / "LICENSE").is_file()
    credits = (CAPTURED / "CREDITS.md").read_text()
    assert all(path.name in credits for path in CAPTURED.glob("*.exr"))
    (note,) = build(LIGHTS["esplanade"]).notes
    assert "negative" in note


def test_file_relative_to_where_you_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "mine.npy", np.ones((8, 16, 3), np.float32))
    monkeypatch.chdir(tmp_path)
    light = build({"kind": "file", "path": "mine.npy", "scale": 3, "size": 4})
    np.testing.assert_array_equal(light.radiance, np.full((4, 8, 3), 3, np.float32))
    assert "reduced from 16 x 8 to 4 rows" in light.notes[0]


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ({}, "unknown kind of light 'None'"),
        ({"kind": "constnt"}, "did you mean 'constant'"),
        ({"kind": ["lamps"]}, "unknown kind of light"),
        ({"kind": "constant", "radince": 1}, "unknown setting of light 'constant' 'radince': did you mean 'radiance'"),
        ({"kind": "captured"}, "needs the setting 'name'"),
        ({"kind": "captured", "name": "studios"}, "did you mean 'studio'"),
        ({"kind": "captured", "name": "studio", "size": 1}, "'size' of light 'captured' must be an int in [2, 4096]"),
        ({"kind": "file", "path": 3}, "'path' of light 'file'"),
        ({"kind": "file", "path": "no.exr"}, "no.exr is neither there"),
        ({"kind": "constant", "scale": 0}, "'scale' of light 'constant'"),
        ({"kind": "constant", "scale": float("nan")}, "'scale' of light 'constant'"),
        ({"kind": "constant", "radiance": -1}, "'radiance' of light 'constant' must be a number in [0, 1000000000.0]"),
        ({"kind": "constant", "radiance": [1, 2]}, "must be a number or three"),
        ({"kind": "constant", "size": 8.0}, "Got 8.0 instead"),
        ({"kind": "pixel", "size": 8, "row": 8}, "must be an int in [0, 7]. Got 8 instead."),
        ({"kind": "pixel", "radiance": float("inf")}, "Got inf instead"),
        ({"kind": "noise", "size": [3, 2]}, "must be an int in"),
        ({"kind": "noise", "size": "large"}, "must be an int or [columns, rows]. Got 'large' instead."),
        ({"kind": "lamps", "count": 0}, "'count' of light 'lamps'"),
        ({"kind": "lamps", "lamps": 3}, "'lamps' of light 'lamps'"),
        ({"kind": "lamps", "lamps": [{"direction": [0, 0, 1]}]}, "has direction, width and radiance"),
        ({"kind": "lamps", "lamps": [{"direction": [0, 0, 0], "width": 1, "radiance": 1}]}, "not all 0"),
        ({"kind": "lamps", "lamps": [{"direction": "up", "width": 1, "radiance": 1}]}, "three numbers"),
        ({"kind": "band-limited", "order": 200}, "must be > its order 200"),
        ({"kind": "hall", "windows": 9}, "'windows' of light 'hall' must be an int in [1, 8]"),
        ({"kind": "sunsky", "sun": [1, 0, 0]}, "above the horizon"),
        ({"kind": "sunsky", "turbidity": 11}, "must be a number in [1, 10]. Got 11 instead."),
    ],
)
def test_mistakes_are_named(spec: dict[str, Any], words: str) -> None:
    with pytest.raises(BadInput) as caught:
        build(spec)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
