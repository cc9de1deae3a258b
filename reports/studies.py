"""Studies: tables that belong to no scene and method, as the page shows them."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

from envbench.records import Picture, Study
from reports.numerals import three
from reports.table import Entry

NONE = "–"


@dataclass(frozen=True)
class StudyTable:
    """A study: its headings, each with whether a column is of numbers, entries row by row, pictures with their URIs."""

    study: Study
    headings: tuple[tuple[str, bool], ...]
    rows: tuple[tuple[Entry, ...], ...]
    pictures: tuple[tuple[Picture, str], ...] = ()


def studies(found: Sequence[Study]) -> tuple[StudyTable, ...]:
    """Return the tables of a run's studies, in their order."""
    return tuple(_table(study) for study in found)


def _table(study: Study) -> StudyTable:
    numbers = [all(not isinstance(row[i], str | bool) for row in study.rows) for i in range(len(study.columns))]
    rows = tuple(tuple(map(entry, row)) for row in study.rows)
    pictures = tuple((one, f"data:image/png;base64,{base64.b64encode(one.png).decode()}") for one in study.pictures)
    return StudyTable(study, tuple(zip(study.columns, numbers, strict=True)), rows, pictures)


def entry(value: str | float | int | bool | None) -> Entry:
    """Word an entry of a study.

    Examples
    --------
    >>> [entry(value).text for value in (0.0123456, 17575, True, False, None, "skin")]
    ['0.0123', '17575', 'holds', 'differs', '–', 'skin']
    """
    match value:
        case None:
            return Entry(NONE)
        case bool():
            return Entry("holds", kind="holds") if value else Entry("differs", kind="differs")
        case int():
            return Entry(str(value), order=value)
        case float():
            return Entry(three(value), order=value)
        case _:
            return Entry(value)
