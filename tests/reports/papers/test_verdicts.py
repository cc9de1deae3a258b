"""Each rule, held and broken; what is missing; what needs data."""

from __future__ import annotations

import json

import numpy as np
import pytest

from envbench.records import Study
from reports.papers.verdicts import Verdict, fit
from tests.reports.papers.conftest import HEAD, study


def value(**changes: object) -> str:
    """Return a [[values]] table; `where` is TOML, all else as Python has it."""
    keys = {"what": "w", "column": "rms", "kind": "claim"} | changes
    lines = [f"{key} = {entry if key == 'where' else json.dumps(entry)}" for key, entry in keys.items()]
    return "\n".join(["[[values]]", *lines, ""])


@pytest.mark.parametrize(
    ("changes", "came", "words"),
    [
        ({"kind": "exact", "column": "N", "where": "{ N = 2 }", "printed": 2}, "agrees", ""),
        (
            {"kind": "exact", "column": "N", "where": "{ N = 2 }", "printed": 3},
            "differs",
            "by −1.00, -33.3%; its cause",
        ),
        ({"kind": "exact", "column": "N", "where": "{ N = 2 }", "printed": 3, "tolerance": 1.0}, "agrees", ""),
        ({"kind": "exact", "column": "parity", "where": "{ N = 2 }", "printed": "even"}, "agrees", ""),
        (
            {"kind": "exact", "column": "parity", "where": "{ N = 2 }", "printed": "odd"},
            "differs",
            "even instead of odd",
        ),
        ({"where": "{ N = 2 }", "printed": 0.05, "rule": "at most"}, "meets the claim", ""),
        ({"printed": 0.05, "rule": "at most"}, "differs", "by 0.0300, +60.0%"),  # the worst of all rows
        ({"printed": 0.02, "rule": "at least"}, "meets the claim", ""),
        ({"printed": 0.03, "rule": "at least"}, "differs", "by −0.01"),
        ({"where": "{ N = 2 }", "printed": 0.044, "rule": "within", "tolerance": 0.1}, "meets the claim", ""),
        ({"where": "{ N = 2 }", "printed": 0.05, "rule": "within", "tolerance": 0.1}, "differs", "-20.0%"),
        ({"column": "well", "where": "{ parity = 'even' }", "rule": "holds"}, "meets the claim", ""),
        ({"column": "well", "rule": "holds"}, "differs", "does not hold"),
        ({"column": "well", "take": "count", "printed": 3, "rule": "equal"}, "meets the claim", ""),
        ({"take": "mean", "printed": 0.05, "rule": "at most"}, "meets the claim", ""),
        ({"kind": "timing", "printed": 0.05, "rule": "at most", "where": "{ N = 4 }"}, "trend holds", ""),
        ({"where": "{ N = 9 }", "printed": 1, "rule": "at most"}, "failed", "no row with N = 9"),
        ({"column": "none", "printed": 1, "rule": "at most"}, "failed", "no column 'none'; it has N, rms"),
        ({"printed": 1, "rule": "within"}, "failed", "4 rows"),
        ({"column": "parity", "printed": 1, "rule": "at most"}, "failed", "holds no number"),
        ({"column": "rms", "rule": "holds"}, "failed", "neither holds nor differs"),
    ],
)
def test_a_value(verdict, changes: dict[str, object], came: str, words: str) -> None:
    judged = verdict(value(**changes))
    assert (judged.verdict, judged.parts[0].verdict) == (came, came)
    assert words in judged.parts[0].words
    if came == "differs":
        assert words in judged.words


def test_a_number_says_where_it_is_from(verdict) -> None:
    (part,) = verdict(value(where="{ N = 2 }", printed=0.05, rule="at most")).parts
    assert part.ours == 0.04
    said = "run 20250301-101500-ab12, study errors, row 2, column rms, commit 0123456789ab"
    assert [str(source) for source in part.sources] == [said]


def test_a_difference_is_explained_by_what_was_measured(verdict) -> None:
    text = value(printed=0.01, rule="at most", why="few lobes")
    text += 'because = { column = "seconds", where = { N = 2 } }\n'
    assert verdict(text).parts[0].words == "by 0.0700, +700.0%; few lobes (seconds, N = 2: 0.0120)"


def test_timings_without_a_rule_are_shown(verdict) -> None:
    judged = verdict(value(kind="timing", where="{ N = 2 }", printed=3) + value(printed=1, rule="at most"))
    assert [part.verdict for part in judged.parts] == [None, "meets the claim"]
    assert judged.verdict is Verdict.MEETS


def test_the_worst_part_decides(verdict) -> None:
    good, bad = value(printed=1, rule="at most"), value(printed=0.001, rule="at most", what="too much")
    judged = verdict(good + bad)
    assert judged.verdict is Verdict.DIFFERS
    assert judged.words.startswith("too much: by ")


def trend(law: str, y: str = "seconds", more: str = "") -> str:
    return f'[[trends]]\nwhat = "t"\nx = "N"\ny = "{y}"\nlaw = "{law}"\n{more}\n'


@pytest.mark.parametrize(
    ("text", "came", "words"),
    [
        (trend("rises"), "trend holds", ""),
        (trend("falls", "rms"), "trend holds", ""),
        (trend("falls"), "differs", "at N = 2 by 0.009"),
        (trend("power", more="exponent = 2\nlow = 1.9\nhigh = 2.1"), "trend holds", "95 % interval 2.00 to 2.00"),
        (trend("power", more="exponent = 1\nlow = 0.8\nhigh = 1.2"), "differs", "by 0.800 from the range"),
        (trend("power", more="low = 1\nhigh = 3\nstart = 3.0"), "trend holds", ""),
        (trend("power", more="low = 1\nhigh = 3\nstart = 4.0"), "failed", "fewer than two rows"),
        (trend("power", "well", "low = 1\nhigh = 3"), "failed", "holds no number"),
    ],
)
def test_a_trend(verdict, text: str, came: str, words: str) -> None:
    judged = verdict(text)
    assert judged.verdict == came
    assert words in judged.parts[0].words


def test_a_printed_curve_is_fitted_beside_ours(verdict) -> None:
    text = trend("power", more="low = 1\nhigh = 3\nprinted = { x = [1, 2, 4], y = [1, 8, 64] }")
    (part,) = verdict(text).parts
    assert part.printed == 3.0
    assert part.ours == pytest.approx(2.0)


@pytest.mark.parametrize(("side", "told"), [("above", True), ("below", False)])
def test_the_cause_of_a_difference_is_told_on_its_side_only(verdict, side: str, told: bool) -> None:
    text = trend("power", more=f'low = 0.8\nhigh = 1.2\nwhy = "squares"\nwhy_if = "{side}"')
    words = verdict(text).parts[0].words
    assert ("squares" in words, "its cause was not measured" in words) == (told, not told)


def ratio(more: str = "") -> str:
    return f'[[ratios]]\nwhat = "r"\ncolumn = "seconds"\nof = {{ N = 4 }}\nover = {{ N = 2 }}\n{more}\n'


def test_ratios(verdict) -> None:
    judged = verdict(
        ratio("printed = 5") + ratio("low = 3") + ratio("high = 3") + ratio("low = 3\nover_column = 'well'")
    )
    assert [part.verdict for part in judged.parts] == [None, "trend holds", "differs", "failed"]
    assert [part.ours for part in judged.parts[:3]] == pytest.approx([4.0, 4.0, 4.0])
    assert "1.33 times what is allowed" in judged.parts[2].words


SUBSTITUTE = HEAD + 'substitute = "own"\n'


def test_absent_data_ask_for_it_and_name_what_ran_instead(verdict) -> None:
    absent = Study.missing("errors", "probe.exr is not there: get it.", needs_data=True)
    text = value(printed=0.1, rule="at most")
    alone = verdict(text, absent)
    assert (alone.verdict, alone.words, alone.parts) == ("needs data", "probe.exr is not there: get it.", ())
    other = verdict(text, absent, study("own", "Errors of our own"), head=SUBSTITUTE)
    assert other.verdict is Verdict.NEEDS_DATA
    assert other.substituted
    assert "get it. In its place: study 'own' (Errors of our own)." in other.words
    assert other.parts[0].sources[0].study == "own"


def test_a_study_that_failed_or_never_ran_is_said_to_have(verdict) -> None:
    text = value(printed=0.1, rule="at most")
    assert verdict(text, Study.missing("errors", "timed out: no answer")).words == "timed out: no answer"
    never = verdict(text, study("other"))
    assert (never.verdict, never.words) == ("failed", "study 'errors' has not been run")


def test_the_interval_of_an_exponent_covers_it_as_often_as_it_says() -> None:
    rng, x = np.random.default_rng(0), np.geomspace(1, 100, 7)
    fits = [fit(x, 2 * x**1.5 * np.exp(rng.normal(0, 0.2, 7))) for _ in range(1000)]
    covered = sum(found.low <= 1.5 <= found.high for found in fits)
    assert abs(covered - 950) < 4 * np.sqrt(1000 * 0.95 * 0.05)  # four standard deviations
