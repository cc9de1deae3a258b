"""Effects on the page: decisions with their grounds, warnings, and what an error consists of."""

from __future__ import annotations

import math

import pytest

from envbench.records import Score
from envbench.scene import Basis, Decision, Effect
from reports import render
from reports.effects import effects, warnings
from reports.table import cause, table
from tests.reports.test_page import Page

CHOSEN = (
    Decision(Effect.ANISOTROPY, False, Basis.FACT, "all lobes are <isotropic>", 0.0, 0.0, 0.0),
    Decision(
        Effect.SELF_SHADOWING, True, Basis.PROBE, "at 64 points", 0.14, 0.13, 0.15, cost=2.5, seconds=0.25,
        tolerance=0.01,
    ),
    Decision(
        Effect.INTERREFLECTION, True, Basis.PROBE, "the second bounce matters", 0.05, 0.04, 0.06, cost=5.0, bounces=2,
        tolerance=0.01,
    ),
    Decision(Effect.DEFORMATION, False, Basis.USER, "not named", 0.03, 0.02, 0.04, saved=7.5, tolerance=0.01),
    Decision(Effect.SUBSURFACE, False, Basis.USER, "not named", 0.003, 0.001, 0.004, tolerance=0.01),
    Decision(Effect.PERSPECTIVE, True, Basis.USER, "named; nothing was measured"),
)  # fmt: skip
WARNING = "deformation switched off, and it matters: 3.00\N{NO-BREAK SPACE}% (2.00 – 4.00\N{NO-BREAK SPACE}%)"


@pytest.fixture
def scene(make):
    return make.scene(decisions=CHOSEN)


def spaced(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_only_a_user_misses_what_surely_matters():
    assert [decision.effect for decision in CHOSEN if decision.missed] == [Effect.DEFORMATION]
    off = Decision(Effect.SUBSURFACE, False, Basis.USER, "", 0.003, 0.001, 0.004)
    assert off.missed  # no tolerance was asked for: whatever is surely there
    assert not Decision(Effect.SUBSURFACE, False, Basis.USER, "", 0.003, -0.001, 0.004).missed
    assert not Decision(Effect.SUBSURFACE, False, Basis.USER, "").missed
    assert not Decision(Effect.SUBSURFACE, False, Basis.PROBE, "", 0.003, 0.001, 0.004).missed


def test_decisions_are_told_with_their_grounds(make, scene):
    page = Page(render(make.records([scene, make.scene("hall")], [make.cell(scene)]), "latest"))
    rows = [[spaced(entry) for entry in row] for row in page.rows]
    assert ["anisotropy", "no", "fact", "none", "–", "–", "–", "all lobes are <isotropic>"] in rows
    assert ["self-shadowing", "yes", "probe", "14.0 %13.0 – 15.0 %", "2.50 s", "–", "250 ms", "at 64 points"] in rows
    assert "yes, 2 bounces" in page.text
    assert ["deformation", "no", "user", "3.00 %2.00 – 4.00 %", "–", "7.50 s", "–", "not named"] in rows
    assert ["perspective", "yes", "user", "–", "–", "–", "–", "named; nothing was measured"] in rows
    said = "6 decisions on 1 scene: 1 by fact, 2 by probe, 3 by user. 3 effects were left out, which saved 7.50 s"
    assert said in spaced(page.text)
    assert "effects" in page.ids
    assert "#effects" in page.references
    assert effects([scene]).scenes[0].tolerance == "1.00\N{NO-BREAK SPACE}%"


def test_without_decisions_there_is_no_such_section(make):
    assert effects([make.scene()]) is None
    assert "effects" not in Page(render(make.records([make.scene()], []), "latest")).ids


def test_what_a_user_misses_is_said_in_the_row_and_with_the_scene(make, scene):
    assert warnings(scene) == (WARNING,)
    (row,) = table([scene], [make.cell(scene)]).rows
    assert (row.entries[0].note, row.entries[0].kind) == (WARNING, "warn")
    page = Page(render(make.records([scene], [make.cell(scene)]), "latest"))
    assert spaced(page.text).count(spaced(WARNING)) == 2
    assert not warnings(make.scene())


def split(make, scene, **changes):
    scores = {
        "nrmse": Score("nrmse", 0.142, 0.141, 0.143),
        "missing_effects": Score("missing_effects", 0.14, 0.139, 0.141),
        "approximation": Score("approximation", 0.021, 0.0205, 0.0215),
        "cross": Score("cross", -1e-4, -2e-4, 3e-5),
    } | changes
    return make.cell(scene, method="ldprt", scores=tuple(scores.values()), lacks=("self-shadowing",))


def test_an_error_is_split_into_what_is_done_and_what_is_ignored(make):
    scene = make.scene()
    cells = [split(make, scene), make.cell(scene)]
    assert spaced(cause(cells[0])) == "2.10 % in what it does, 14.0 % in what it ignores (self-shadowing)"
    assert cause(cells[1]) == ""
    found = table([scene], cells)
    headings = [column.heading for column in found.columns]
    place = headings.index("error by cause")
    assert headings[place - 1] == "NRMSE"
    assert not {"missing effects", "approximation", "cross term"} & set(headings)
    entry, none = (row.entries[place] for row in found.rows)
    assert spaced(entry.note) == "2.05 – 2.15 %; 13.9 – 14.1 %; cross term −0.000100 (−0.000200 – 3.00×10⁻⁵)"
    assert (entry.order, none.order) == (0.14, None)
    page = Page(render(make.records([scene], cells), "latest"))
    said = "2.10 % in what it does, 14.0 % in what it ignores (self-shadowing)"
    assert spaced(page.text).count(said) == 2  # in its row, and under its image
    assert "error by cause" not in [column.heading for column in table([scene], cells[1:]).columns]


def test_parts_below_the_floor_are_bounds_and_undefined_ones_are_said_to_be(make):
    scene = make.scene()
    low = split(make, scene, missing_effects=Score("missing_effects", 0.002, 0.0, 0.007, below_floor=True))
    assert spaced(cause(low)) == "2.10 % in what it does, < 0.700 % in what it ignores (self-shadowing)"
    black = split(make, scene, **{n: Score(n, math.nan) for n in ("missing_effects", "approximation", "cross")})
    found = table([scene], [black])
    place = [column.heading for column in found.columns].index("error by cause")
    assert found.rows[0].entries[place].text == "undefined"
