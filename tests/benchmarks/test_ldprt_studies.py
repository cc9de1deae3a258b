"""Studies of LDPRT that need no data: every comparison in them holds."""

from __future__ import annotations

import pytest

from benchmarks.studies import STUDIES


@pytest.mark.parametrize("name", ["zonal-random-vectors", "sh-rotation", "thin-membrane"])
def test_every_comparison_holds(name: str) -> None:
    study = STUDIES[name]()
    judged = [cell for row in study.rows for cell in row if isinstance(cell, bool)]
    assert judged
    assert all(judged)
    assert all(len(row) == len(study.columns) for row in study.rows)
