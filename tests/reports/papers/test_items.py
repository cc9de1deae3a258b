"""Items' files: what may stand in them, and what is said of what may not."""

from __future__ import annotations

from pathlib import Path

import pytest

from envbench import root
from envbench.errors import BadInput
from reports import papers
from reports.papers.items import Kind, Rule

CLAIM = """
[[values]]
what = "error at N = 2"
where = { N = 2 }
column = "rms"
printed = 0.05
kind = "claim"
rule = "at most"
"""


def test_an_item_is_read(make) -> None:
    plots = '[[plots]]\ntitle = "t"\nx = "N"\ny = ["rms"]\nprinted = [{ x = [1], y = [0.1] }]\n'
    found = make(CLAIM + plots)
    assert (found.item, found.study, found.slug) == ("Table 1", "errors", "table-1")
    (value,) = found.values
    assert (value.kind, value.rule, value.where, value.printed) == (Kind.CLAIM, Rule.AT_MOST, {"N": 2}, 0.05)
    assert found.plots[0].printed[0].y == (0.1,)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CLAIM.replace("at most", "below"), ("[[values]] 1", "rule", "'below'")),
        (CLAIM.replace("at most", "holds").replace("kind", "knid"), ("[[values]] 1", "'knid'", "did you mean 'kind'")),
        (CLAIM.replace('rule = "at most"', ""), ("rule must be one of", "Got none")),
        (CLAIM.replace("printed = 0.05", ""), ("printed must be given", "at most")),
        (CLAIM.replace("0.05", '"five"'), ("printed must be a number", "'five'")),
        (CLAIM + "tolerance = -1.0", ("tolerance must be >= 0", "-1.0")),
        (CLAIM + "because = { colum = 'rms' }", ("because", "'colum'")),
        ("values = 3", ("[[values]] must be a list of tables", "3")),
        ("", ("judges nothing",)),
        ("[[values", ("TOML",)),
        ('[[trends]]\nwhat = "w"\nx = "N"\ny = "rms"\nlaw = "power"', ("low and high", "None")),
        (CLAIM + '[[plots]]\ntitle = "t"\nx = "N"\ny = ["rms"]\nlog = "z"', ("log must be", "'z'")),
        (CLAIM + '[[plots]]\ntitle = "t"\nx = "N"\ny = []\nprinted = [{ x = [1], y = [] }]', ("one length",)),
    ],
)
def test_a_bad_file_is_refused_in_a_line_that_names_it(make, text: str, words: tuple[str, ...]) -> None:
    with pytest.raises(BadInput) as refused:
        make(text)
    message = str(refused.value)
    assert "papers/tiny/table-1.toml" in message
    assert all(word in message for word in words), message


def test_a_missing_key_is_named(make) -> None:
    with pytest.raises(BadInput, match="lacks 'study'"):
        make(CLAIM, head='item = "Table 1"\ntitle = "t"\ntext = "x"\n')


def test_papers_of_a_users_own_folder(make, tmp_path: Path) -> None:
    make(CLAIM)
    own = tmp_path / "own"
    (own / "papers").mkdir(parents=True)
    (tmp_path / "tiny").rename(own / "papers" / "tiny")
    assert "tiny" in papers.names(own)
    assert [one.item for one in papers.read("tiny", own).items] == ["Table 1"]
    with pytest.raises(BadInput, match="unknown paper 'tinny': did you mean 'tiny'"):
        papers.read("tinny", own)


@pytest.mark.parametrize("name", papers.names())
def test_every_paper_reads_and_names_studies_that_there_are(name: str) -> None:
    paper = papers.read(name)
    known = root.load().catalogue.studies
    assert paper.items
    assert {*paper.studies, *paper.substitutes.values()} <= set(known)
