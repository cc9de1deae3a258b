"""Hard cases, predictions, materials and furnaces on the page: known records, known words."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from envbench.records import Film, MaterialSheet, Score, Status, Study
from reports import render
from reports.hard import hard_cases
from reports.materials import materials
from reports.measured import ASKED, exception, held
from reports.plots import marks
from reports.verdict import glance, verdicts
from tests.reports.test_page import Page


def step(make, number, setting):
    return make.scene(
        name=f"gloss {number}", view=f"gloss = {setting}", knob="gloss", step=number, setting=setting, image=None,
        specs={"knob": {"vary": "material.exponent"}},
    )  # fmt: skip


@pytest.fixture
def knobs(make):
    scenes = [step(make, i, setting) for i, setting in enumerate(("8", "64", "512"))]
    cells = [make.cell(scene, error, settings={}) for scene, error in zip(scenes, (0.01, 0.02, 0.5), strict=True)]
    cells += [make.cell(scenes[0], 0.01, method="angular", settings={})]
    cells += [make.ended(scene, Status.DECLINED, "too narrow", method="angular", settings={}) for scene in scenes[1:]]
    return scenes, cells


def test_hard_cases_are_a_matrix_of_verdicts(make, knobs):
    scenes, cells = knobs
    found = hard_cases(scenes, cells, marks(cells))
    (row,) = found.rows
    assert (row.easy, row.extreme, row.steps) == ("8", "512", 3)
    assert [(name, entry.outcome, entry.where) for name in found.methods for entry in row.judged[name]] == [
        ("shrm", "degrades", "from 512"),
        ("angular", "declines", "from 64"),
    ]
    assert row.plot.count("<circle") == 4
    assert row.plot.count("too narrow") == 2
    assert hard_cases([make.scene()], [make.cell(make.scene())], {}) is None
    page = Page(render(make.records(scenes, cells), "latest"))
    assert "declines from 64" in page.text
    assert {"knob", "setting"} <= page.data["scenes"][0].keys()


def test_hard_cases_answer_no_material(make, knobs):
    scenes, cells = knobs
    assert verdicts(scenes, cells) == ()
    lit = make.scene()
    assert [verdict.scenes for verdict in verdicts([*scenes, lit], cells)] == [(lit.name,)]


def uniform(make, light="studio", **changes):
    return make.scene(light, image=None, specs={"view": {"kind": "uniform"}}, **changes)


def energy(error, spread=0.01):
    """Return scores whose energy error is `error`, its interval `spread` of it to both sides."""
    return (Score("captured_energy", 1 - error, 1 - error * (1 + spread), 1 - error * (1 - spread)),)


def test_predictions_are_counted_by_theory(make):
    scenes = [uniform(make, light) for light in ("a", "b", "c", "d")]
    cells = [
        make.cell(scene, settings={"eps": 0.1}, scores=energy(error), predictions={"by light": 0.05})
        for scene, error in zip(scenes, (0.05, 0.059, 0.061, 0.2), strict=True)
    ]
    asked, by_light = held(scenes, cells).theories
    assert (asked.name, asked.cells, asked.kept) == (ASKED, 4, 3)
    assert (by_light.kept, by_light.close, by_light.decided) == (1, 2, 4)
    assert by_light.ratio == pytest.approx(1.2)
    noisy = replace(cells[0], scores=(Score("captured_energy", 0.95, 0.9, 1.02),))
    assert held(scenes[:1], [noisy]).theories[1].decided == 0


def test_only_uniform_queries_count_where_there_are_any(make):
    seen, queried = make.scene("seen"), uniform(make)
    cells = [make.cell(seen), make.cell(queried)]
    assert [case.scene.name for case in held([seen, queried], cells).cases] == [queried.name]
    assert not held([seen], cells[:1]).uniform


def test_exceptions_are_explained_by_a_theory_that_fits_or_by_none(make):
    scene = uniform(make)
    cell = make.cell(scene, settings={"eps": 0.1}, scores=energy(0.2), predictions={"by light": 0.19})
    assert exception(cell, scene) == f"2 × {ASKED}; as by light says"
    assert exception(replace(cell, predictions={"by light": 0.02}), scene) == "10 × by light; no theory accounts for it"
    assert exception(cell, make.scene()) == ""  # an image is not what theory averages over


@pytest.mark.parametrize(("ratio", "said"), [(0.985, "furnace 0.9850: loses 1.50"), (1.02, "gains"), (0.9995, "")])
def test_a_furnace_says_what_is_lost(make, ratio, said):
    scene = make.scene(specs={"light": {"kind": "constant"}})
    cell = make.cell(scene, scores=(Score("energy_ratio", ratio, ratio - 2e-4, ratio + 2e-4),))
    text = Page(render(make.records([scene], [cell]), "latest")).text
    assert (said or "furnace") in text or not said
    assert ("furnace" in text) == bool(said)


def sheet(name, energies, **changes):
    made = MaterialSheet(
        name, {}, ("Phong, exponent 8, about R, clipped",), (), 0.1, 0.0, ((0.0, 0.9, 0.9, 0.9), (80.0, 1.2, 1.0, 1.0)),
        ((0.1, 0, 8, 1, 0.05), (0.01, 0, 13, 4, 0.02)), tuple((0, p, e) for p, e in enumerate(energies)),
        ((30.0, (-80.0, 0.0, 30.0, 80.0), (0.1, 0.5, 2.0, 0.3)),),
    )  # fmt: skip
    return replace(made, **changes)


def test_materials_are_listed_with_what_is_missing(make):
    sheets = [sheet("one", (0.5, 0.8, 0.85, 0.88, 0.89, 0.899)), sheet("gone", (), lobes=(), notes=("no file",))]
    found = materials(sheets)
    (row,) = found.rows
    assert found.absent == {"no file": ("gone",)}
    assert [entry.text for entry in row.entries[:3]] == ["8, 1", "13, 4", "0.8990"]
    assert row.entries[1].note == "lobe 1 leaves out 0.02"
    assert (row.entries[4].text, row.entries[4].note) == ("1.200", "at 80°")
    page = Page(render(replace(make.records([], []), sheet_results=sheets), "latest"))
    assert "Left out: gone. no file" in page.text
    assert materials([]) is None


def test_curet_is_counted_beside_the_paper(make):
    sheets = [sheet(f"curet-{i:02d}-x", (0.0, 0.85 + 0.02 * i)) for i in range(1, 8)]
    found = materials([*sheets, sheet("other", (0.1,))]).curet
    assert (found.above, found.samples) == (5, 7)  # .87 and .89 are not above .9
    assert [name for name, _ in found.worst] == [f"curet-{i:02d}-x" for i in range(1, 6)]
    page = Page(render(replace(make.records([], []), sheet_results=sheets), "latest"))
    assert "5 of 7 samples hold more than 90 %" in page.text
    assert "56 of 61" in page.text
    assert "57-peacock feather" in page.text


def test_studies_are_tables_with_their_notes_or_reasons(make):
    made = Study(
        "orders", "Orders beside <table 5>", "Least P, then F.", ("sigma (rad)", "F", "within 1", "kind"),
        ((0.123456, 17575, True, "whole"), (0.5, 4, False, None)), ("P = 3 is printed.",), 1.5,
    )  # fmt: skip
    gone = Study.missing("gone", "crashed: killed by SIGSEGV")
    page = Page(render(replace(make.records([], []), study_results=[made, gone]), "latest"))
    assert {"studies", "study-orders", "study-gone"} <= page.ids
    assert "#studies" in page.references
    assert ["sigma (rad)", "F", "within 1", "kind"] in page.rows
    assert ["0.123", "17575", "holds", "whole"] in page.rows
    assert ["0.500", "4", "differs", "–"] in page.rows
    for words in ("Orders beside <table 5>", "Least P, then F.", "P = 3 is printed.", "No table: crashed: killed by"):
        assert words in page.text
    assert "studies" not in Page(render(make.records([], []), "latest")).ids


def test_animations_are_pictures_with_captions_or_reasons(make):
    film = Film(
        "bat & wings", "irradiance-9, light studio; exposure +0.25 EV", "image/webp", b"RIFF", ("Not simulated",)
    )
    gone = Film("gone", "as asked", reason="EGL is not usable: apt install libegl1")
    page = Page(render(replace(make.records([], []), film_results=[film, gone]), "latest"))
    assert "animations" in page.ids
    assert "#animations" in page.references
    assert "data:image/webp;base64,UklGRg==" in page.references
    for words in ("bat & wings", "light studio; exposure +0.25 EV", "Not simulated", "Left out: EGL is not usable"):
        assert words in page.text
    assert "animations" not in Page(render(make.records([], []), "latest")).ids


def test_the_glance_names_winners_by_situation(make):
    scenes = [make.scene(material=material) for material in ("phong", "skin")]
    cells = [
        make.cell(scenes[0], 0.005, 1e-3, settings={}),
        make.cell(scenes[0], 0.005, 1e-2, method="angular", settings={}),
        make.cell(scenes[1], 0.04, 1e-2, settings={}),
        make.cell(scenes[1], 0.04, 1e-3, method="angular", settings={}),
    ]
    table = glance(verdicts(scenes, cells))
    assert table["changing light"][0] == {("shrm",): ("phong",), (): ("skin",)}
    assert table["static light"][1] == {("shrm",): ("phong",), ("angular",): ("skin",)}
    assert table["changing material"].__len__() == 4


def test_the_least_error_is_told_apart_by_paired_differences(make):
    scene = make.scene()

    def cell(method, jackknife, seconds):
        low, high = min(jackknife) - 0.01, max(jackknife) + 0.01
        score = Score("nrmse", sum(jackknife) / len(jackknife), low, high, jackknife=jackknife)
        return make.cell(scene, 0.1, seconds, method=method, settings={}, scores=(score,))

    base = tuple(0.1 + 0.001 * math.sin(i) for i in range(8))
    worse = tuple(value + 0.001 for value in base)  # always worse, though the intervals overlap
    other = tuple(value + 1e-5 * math.cos(3 * i) for i, value in enumerate(base))
    (verdict,) = verdicts([scene], [cell("a", base, 3e-3), cell("b", worse, 1e-3), cell("c", other, 2e-3)])
    least = verdict.answers["changing light"][-1]
    assert set(least.methods) == {"a", "c"}
    assert least.best.method == "c"  # the fastest of those that cannot be told apart
