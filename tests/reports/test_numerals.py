"""Numbers as the report words them."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reports import numerals

MINUS, SPACE = "−", "\N{NO-BREAK SPACE}"
_PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹" + MINUS, "-0123456789-")


@given(st.floats(-1e300, 1e300))
def test_three_significant_digits_are_the_value_to_half_a_unit_in_the_third(value):
    text = numerals.three(value)
    back = float(text.translate(_PLAIN).replace("×10", "e"))
    # Half a unit in the third digit is at most .5 % of the value; denormals have fewer digits than that themselves.
    assert back == pytest.approx(value, rel=0.005001, abs=1e-321)
    digits = re.sub(r"[^0-9]", "", text.split("×")[0]).lstrip("0")
    assert value == 0 or len(digits) == 3 or abs(value) >= 1000


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (0.1, "0.100"), (0.9999, "1.00"), (9.996, "10.0"), (123456, "123000"), (math.nan, "undefined")],
)
def test_three(value, text):
    assert numerals.three(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.5, "1.50 s"), (0.0123, "12.3 ms"), (0.99996, "1.00 s"), (4.2e-6, "4.20 µs"), (3e-9, "3.00 ns"), (0, "0 s")],
)
def test_seconds(value, text):
    assert numerals.seconds(value) == text.replace(" ", SPACE)


def test_a_range_names_a_shared_unit_once():
    assert numerals.between(numerals.seconds(0.001), numerals.seconds(0.002)) == f"1.00 – 2.00{SPACE}ms"
    assert numerals.between(numerals.seconds(0.0009), numerals.seconds(0.002)) == f"900{SPACE}µs – 2.00{SPACE}ms"


def test_near_one_keeps_the_digits_that_matter():
    assert numerals.ratio(0.99987) == "0.9999"
    assert numerals.ratio(math.nan) == "undefined"
