"""Plans: what a suite's names and sweeps come to."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from envbench import root, suite
from envbench.errors import BadInput
from envbench.plan import Plan, overridden, plan
from envbench.settings import construct
from tests.envbench.conftest import SCENE, SUITE, UserFolder


@pytest.fixture
def planned(user: UserFolder):
    """Give a function from TOML to its plan, with a method 'own' beside ours."""
    user.method("own")

    def make(table: str, text: str = SUITE, **narrowed: tuple[str, ...]) -> Plan:
        return plan(suite.parse(text + table, "t.toml", user.path), root.load(user.path), **narrowed)

    return make


def test_lists_are_swept_as_a_grid_in_order(planned) -> None:
    cells = planned('[[methods]]\nname = "own"\nnumber = [1, 2]\nfactor = [0.5, 1.0]').cells
    assert [dict(cell.settings) for cell in cells] == [{"number": n, "factor": f} for n in (1, 2) for f in (0.5, 1.0)]
    assert {cell.scene.name for cell in cells} == {SCENE}
    assert cells[0].label == "own(number=1, factor=0.5)"


def test_scenes_are_the_product_of_lights_and_materials(planned) -> None:
    scenes = SUITE.replace('["lambertian"]', '["lambertian", "phong"]').replace('["grey"]', '["grey", "constant"]')
    names = [scene.name for scene in planned('[[methods]]\nname = "own"', scenes).scenes]
    lights, materials = ("grey", "constant"), ("lambertian", "phong")
    assert names == [f"{light}/{material}/sphere/tiny" for light in lights for material in materials]


def test_keys_tell_every_ingredient_apart_and_nothing_else(planned) -> None:
    table = '[[methods]]\nname = "own"\n'
    (key,) = (cell.key for cell in planned(table).cells)
    same = [table + "factor = 1", table + "factor = 1.0\nnumber = 0"]
    assert {planned(text).cells[0].key for text in same} == {key}
    assert planned(table, SUITE.replace("rounds = 3", "rounds = 4")).cells[0].key == key
    others = [
        planned(table + "factor = 2.0"),
        planned(table, SUITE.replace("0.05", "0.06")),
        planned(table, SUITE.replace("[0.5, 1.0, 2.0]", "[0.5, 1.0, 2.5]")),
        planned(table, SUITE.replace("size = 16", "size = 17")),
        planned(table, SUITE.replace('"lambertian"', '"phong"')),
    ]
    keys = {other.cells[0].key for other in others}
    assert len(keys) == len(others)
    assert key not in keys


def test_a_cell_asked_for_twice_is_planned_once(planned) -> None:
    assert len(planned('[[methods]]\nname = "own"\nnumber = [1, 1]\n[[methods]]\nname = "own"\nnumber = 1').cells) == 1


def test_own_sweep_shows_the_settings_that_vary(planned, user: UserFolder) -> None:
    user.method("swept", more="sweep = classmethod(lambda cls: [cls(number=n) for n in (0, 3)])")
    cells = planned('[[methods]]\nname = "swept"\nsweep = true').cells
    assert [dict(cell.settings) for cell in cells] == [{"number": 0}, {"number": 3}]


def test_narrowing_and_overriding(planned, user: UserFolder) -> None:
    user.method("other")
    both = '[[methods]]\nname = "own"\n[[methods]]\nname = "other"\n'
    assert [cell.method.name for cell in planned(both, methods=("other",)).cells] == ["other"]
    with pytest.raises(BadInput, match="unknown scene of this suite: 'grey/lambert': did you mean"):
        planned(both, scenes=("grey/lambert",))
    read = suite.parse(SUITE, "t.toml")
    changed = overridden(read, floor=0.5, variant="scalar_rgb", rounds=1)
    assert (changed.reference.floor, changed.reference.variant, changed.timing.rounds) == (0.5, "scalar_rgb", 1)


def test_a_path_in_a_suite_begins_at_the_suite(planned, user: UserFolder) -> None:
    import numpy as np

    np.save(user.path / "map.npy", np.ones((4, 8, 3), np.float32))
    scenes = SUITE.replace('kind = "constant"\nradiance = [0.5, 1.0, 2.0]', 'kind = "file"\npath = "map.npy"')
    assert planned('[[methods]]\nname = "own"', scenes).cells


def test_types_are_as_strict_as_json() -> None:
    @dataclass(frozen=True)
    class Thing:
        count: int
        ratio: float = 1.0
        size: tuple[int, int] = (1, 1)
        flag: bool = False

    thing = construct(Thing, {"count": 2, "ratio": 3, "size": [4, 5]}, "thing")
    assert thing == Thing(2, 3.0, (4, 5))
    for bad in (
        {"count": 2.5},
        {"count": "2"},
        {"count": True},
        {"count": 1, "flag": 1},
        {"count": 1, "size": [1]},
        {},
    ):
        with pytest.raises(BadInput, match=r"^thing"):
            construct(Thing, bad, "thing")
