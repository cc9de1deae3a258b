"""Claims of papers judged by known records."""

from __future__ import annotations

import pytest

from envbench import suite
from envbench.errors import BadInput
from envbench.records import Status
from reports import render
from reports.claims import claims
from tests.reports.test_page import Page

TEXT = """
name = "velvet"
[[claims]]
text = "averages err on velvet"
source = "a paper, fig. 1"
materials = ["velvet"]
method = { name = "kautz-mccool", polar = 8 }
beside = { name = "shrm" }
"""


def cells(make, scene, averaged, harmonic):
    """Two settings of each method; of the averaged one, the better is not among those that the claim asks for."""
    return [
        make.cell(scene, 0.001, method="kautz-mccool", settings={"polar": 16}),
        make.cell(scene, averaged, method="kautz-mccool", settings={"polar": 8, "eps": 0.1}),
        make.cell(scene, 2 * averaged, method="kautz-mccool", settings={"polar": 8, "eps": 0.3}),
        make.cell(scene, harmonic, settings={"eps": 0.01}),
        make.cell(scene, 2 * harmonic, settings={"eps": 0.1}),
    ]


@pytest.mark.parametrize(
    ("averaged", "harmonic", "verdict"),
    [(0.2, 0.01, "holds"), (0.04, 0.01, "holds in part"), (0.01, 0.01, "does not hold")],
)
def test_each_side_is_taken_at_its_best(make, averaged, harmonic, verdict):
    scene = make.scene(material="velvet")
    (found,) = claims(TEXT, [scene, make.scene()], cells(make, scene, averaged, harmonic))
    assert found.judgement == verdict
    assert found.method.error.value == pytest.approx(averaged)
    assert found.beside.error.value == pytest.approx(harmonic)
    assert "eps=0.01" in found.beside.settings


def test_a_claim_without_measurements_is_undecided(make):
    scene = make.scene(material="velvet")
    (nothing,) = claims(TEXT, [make.scene()], [])
    assert (nothing.judgement, nothing.words) == ("undecided", "no scene of it ran")
    ended = [make.ended(scene, Status.FAILED, "why", method="kautz-mccool", settings={"polar": 8})]
    (failed,) = claims(TEXT, [scene], ended)
    assert failed.words == "kautz-mccool was not scored on all of its scenes"


def test_the_page_shows_both_sides(make):
    scene = make.scene(material="velvet")
    page = Page(render(make.records([scene], cells(make, scene, 0.2, 0.01), suite_text=TEXT), "latest"))
    assert "averages err on velvet" in page.text
    assert "holds" in page.text


def test_a_claim_names_its_methods():
    with pytest.raises(BadInput, match="the name of a method"):
        suite.parse(TEXT.replace('name = "shrm"', "eps = 0.1"), "velvet.toml")
    with pytest.raises(BadInput, match="level must lie in"):
        suite.parse(TEXT + "level = 2.0\n", "velvet.toml")
