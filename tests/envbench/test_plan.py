"""Plans: what a suite's names and sweeps come to."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from envbench import root, suite
from envbench.errors import BadInput, NeedsData
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


def test_paths_within_tables_begin_at_the_suite_too(planned, user: UserFolder) -> None:
    import numpy as np

    np.save(user.path / "grey.npy", np.random.default_rng(0).uniform(size=(8, 8, 3)))
    patch = {"kind": '"patch"', "image": '"grey.npy"', "resolution": "9",
             "pose": '{ kind = "turn", degrees = 90, axis = [1, 0, 0] }'}  # fmt: skip
    table = "[geometries.patch]\n" + "".join(f"{key} = {value}\n" for key, value in patch.items())
    scenes = SUITE.replace('geometry = "sphere"', 'geometry = "patch"').replace("[[scenes]]", table + "[[scenes]]")
    assert planned('[[methods]]\nname = "own"', scenes).cells
    material = '[materials.wall]\nkind = "lambertian"\ntexture = { kind = "file", path = "grey.npy" }\n'
    scenes = SUITE.replace('["lambertian"]', '["wall"]').replace("[[scenes]]", material + "[[scenes]]")
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


TWO = """
[[methods]]
name = "own"
number = [1, 2]
[[methods]]
name = "own"
label = "other"
factor = 0.5
"""


def test_scenes_choose_among_the_methods_by_label(planned) -> None:
    text = SUITE + 'methods = ["other"]\n' + SUITE[SUITE.index("[[scenes]]") :].replace("lambertian", "phong")
    cells = planned(TWO, text).cells
    assert [(cell.scene.material, dict(cell.settings)) for cell in cells] == [
        ("lambertian", {"factor": 0.5}),
        ("phong", {"number": 1}),
        ("phong", {"number": 2}),
        ("phong", {"factor": 0.5}),
    ]
    with pytest.raises(BadInput, match=r"unknown method of \[\[scenes\]\] 1: 'othr': did you mean 'other'"):
        planned(TWO, SUITE + 'methods = ["othr"]\n')


def test_a_scene_of_two_grids_has_the_methods_of_both(planned) -> None:
    grid = SUITE[SUITE.index("[[scenes]]") :]
    cells = planned(TWO, SUITE + 'methods = ["other"]\n' + grid + 'methods = ["own"]\n').cells
    assert [dict(cell.settings) for cell in cells] == [{"factor": 0.5}, {"number": 1}, {"number": 2}]


def test_scenes_without_their_data_are_left_out_only_where_that_is_allowed(planned, monkeypatch) -> None:
    from data_gen import materials

    build = materials.build

    def absent(spec, name="material"):
        if name == "phong":
            raise NeedsData("brdfs/x.bsdf is not there: set ENVBENCH_DATA.")
        return build(spec, name)

    monkeypatch.setattr(materials, "build", absent)
    text = SUITE.replace('["lambertian"]', '["lambertian", "phong"]').replace('["grey"]', '["grey", "constant"]')
    with pytest.raises(NeedsData):
        planned(TWO, text)
    work = planned(TWO, text + "optional = true\n")
    assert {cell.scene.material for cell in work.cells} == {"lambertian"}
    assert work.notes == (
        "left out grey/phong/sphere/tiny and 1 more scene: brdfs/x.bsdf is not there: set ENVBENCH_DATA.",
    )
    with pytest.raises(BadInput, match="has no scene left"):
        planned(TWO, text.replace('"lambertian", ', "") + "optional = true\n")


def test_scenes_of_one_asset_are_carried_out_together_and_told_in_order(planned) -> None:
    text = SUITE.replace('["lambertian"]', '["lambertian", "phong"]').replace('["grey"]', '["grey", "constant"]')
    work = planned(TWO, text)
    assert [scene.position for scene in work.scenes] == [0, 1, 2, 3]
    assert [scene.material for scene in work.by_asset] == ["lambertian"] * 2 + ["phong"] * 2
    assert [scene.position for scene in work.by_asset] == [0, 2, 1, 3]


def test_studies_are_the_catalogues_each_once_and_need_no_scene(planned) -> None:
    work = planned('studies = ["claimed-orders", "microfacet-orders", "claimed-orders"]', "")
    assert (work.studies, work.cells) == (("claimed-orders", "microfacet-orders"), ())
    assert planned(TWO, 'studies = ["claimed-orders"]\n' + SUITE).studies == ("claimed-orders",)
    assert planned(TWO, 'studies = ["claimed-orders"]\n' + SUITE, methods=("own",)).studies == ()
    with pytest.raises(BadInput, match=r"unknown study 'orders': did you mean 'radial-orders'\? Known: "):
        planned('studies = ["orders"]', "")
    with pytest.raises(BadInput, match="studies must be a valid array"):
        planned('studies = "claimed-orders"', "")


def test_a_survey_is_of_presets_by_glob_and_of_what_the_scenes_use(planned) -> None:
    assert planned(TWO).survey == {}
    survey = planned(TWO, SUITE + '[survey]\nmaterials = ["phong*"]\n').survey
    assert list(survey) == ["lambertian", "phong", "phong-whole"]
    with pytest.raises(BadInput, match="unknown material of \\[survey\\]: 'phnog': did you mean 'phong'"):
        planned(TWO, SUITE + '[survey]\nmaterials = ["phnog"]\n')


def test_effects_that_a_suite_chooses_set_a_scene_apart(planned) -> None:
    table = '[[methods]]\nname = "own"\n'
    chosen = SUITE.replace("[[scenes]]", '[[scenes]]\neffects = ["self-shadowing"]')
    none = SUITE.replace("[[scenes]]", "[[scenes]]\neffects = []")
    plans = [planned(table, text) for text in (SUITE, chosen, none)]
    assert [p.scenes[0].name.removeprefix(SCENE) for p in plans] == ["", " [self-shadowing]", " [no effects]"]
    assert len({p.cells[0].key for p in plans}) == 3
    assert plans[1].scenes[0].meaning["effects"] == {"only": ["self-shadowing"]}


@pytest.mark.parametrize(
    ("effects", "named"),
    [
        ('["shadows"]', "self-shadowing"),
        ('["subsurface"]', "subsurface"),
        ('["deformation"]', "no pose"),
        ('["interreflection"]', "add self-shadowing"),
    ],
)
def test_effects_that_make_no_sense(planned, effects: str, named: str) -> None:
    with pytest.raises(BadInput, match=named):
        planned('[[methods]]\nname = "own"\n', SUITE.replace("[[scenes]]", f"[[scenes]]\neffects = {effects}"))


def test_a_grid_may_ask_for_a_floor_of_its_own(planned) -> None:
    """It is part of a cell's key; the command line's floor is that of all."""
    methods = '[[methods]]\nname = "own"'
    usual, finer = (
        planned(methods, SUITE.replace("[[scenes]]", "[[scenes]]\n" + line)) for line in ("", "floor = 0.002")
    )
    assert {spec.reference(finer.reference).floor for spec in finer.scenes} == {0.002}
    assert {cell.key for cell in usual.cells}.isdisjoint(cell.key for cell in finer.cells)
    with pytest.raises(BadInput, match="floor"):
        planned(methods, SUITE.replace("[[scenes]]", "[[scenes]]\nfloor = 0.0"))
    asked = overridden(
        suite.parse("[[scenes]]\nlights = []\nmaterials = []\nfloor = 0.1", "s"), floor=0.5, variant=None, rounds=None
    )
    assert asked.scenes[0].floor is None
