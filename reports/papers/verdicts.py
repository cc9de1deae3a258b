"""Verdicts: a paper's numbers against ours, taken from stored studies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from envbench.papers import Found
from envbench.records import Study
from reports.numerals import three
from reports.papers.items import Because, Entry, Item, Kind, Law, Paper, Ratio, Rule, Side, Take, Trend, Value, Where

Cell = str | float | int | bool | None


class Verdict(StrEnum):
    """What came of a comparison, from best to worst."""

    AGREES = "agrees"
    MEETS = "meets the claim"
    TREND = "trend holds"
    DIFFERS = "differs"
    NEEDS_DATA = "needs data"
    FAILED = "failed"


_GOOD = {Kind.EXACT: Verdict.AGREES, Kind.CLAIM: Verdict.MEETS, Kind.TIMING: Verdict.TREND}


@dataclass(frozen=True)
class Source:
    """Where a number of ours stands: rows are counted from 1."""

    run: str
    study: str
    rows: tuple[int, ...]
    column: str
    commit: str

    def __str__(self) -> str:
        rows = ", ".join(map(str, self.rows)) if len(self.rows) <= 4 else f"{self.rows[0]} to {self.rows[-1]}"
        return f"run {self.run}, study {self.study}, row {rows}, column {self.column}, commit {self.commit}"


@dataclass(frozen=True)
class Part:
    """One comparison.

    Attributes
    ----------
    ours : Cell
        Of a trend, the fitted exponent.
    rule : str
        How they were held against each other, in words; empty where the two are only shown.
    verdict : Verdict or None
    words : str
        By how much and why it differs, or what else is to say.
    sources : tuple of Source
    """

    what: str
    kind: Kind
    printed: Entry | None
    ours: Cell
    rule: str
    verdict: Verdict | None
    words: str = ""
    sources: tuple[Source, ...] = ()


@dataclass(frozen=True)
class Judged:
    """An item with what was found: `found` is the study, or its `substitute` where data are absent."""

    item: Item
    verdict: Verdict
    words: str
    parts: tuple[Part, ...]
    found: Found | None
    substituted: bool = False


@dataclass(frozen=True)
class JudgedPaper:
    """A paper with the verdicts on its items."""

    paper: Paper
    items: tuple[Judged, ...]

    @property
    def counts(self) -> dict[Verdict, int]:
        """How many items came to which verdict."""
        return {v: n for v in Verdict if (n := sum(entry.verdict is v for entry in self.items))}


class MissingEntry(Exception):
    """A selector that finds nothing in a table."""


def judge(paper: Paper, found: Mapping[str, Found]) -> JudgedPaper:
    """Judge every item by the studies `found`, by name."""
    return JudgedPaper(paper, tuple(_item(item, found) for item in paper.items))


def _item(item: Item, found: Mapping[str, Found]) -> Judged:
    main = found.get(item.study)
    if main is None:
        return Judged(item, Verdict.FAILED, f"study '{item.study}' has not been run", (), None)
    if not main.study.reason:
        parts = _parts(item, main)
        verdicts = [part.verdict for part in parts if part.verdict]
        worst = max(verdicts, key=list(Verdict).index)
        words = (
            "; ".join(f"{p.what}: {p.words}" for p in parts if p.verdict is worst and p.words) if _bad(worst) else ""
        )
        return Judged(item, worst, words, parts, main)
    if not main.study.needs_data:
        return Judged(item, Verdict.FAILED, main.study.reason, (), main)
    instead = found.get(item.substitute)
    if instead is None or instead.study.reason:
        return Judged(item, Verdict.NEEDS_DATA, main.study.reason, (), None)
    words = f"{main.study.reason} In its place: study '{item.substitute}' ({instead.study.title})."
    return Judged(item, Verdict.NEEDS_DATA, words, _parts(item, instead), instead, substituted=True)


def _bad(verdict: Verdict) -> bool:
    return list(Verdict).index(verdict) >= list(Verdict).index(Verdict.DIFFERS)


def _parts(item: Item, found: Found) -> tuple[Part, ...]:
    parts: list[Part] = []
    for entry in (*item.values, *item.trends, *item.ratios):
        try:
            match entry:
                case Value():
                    parts.append(_value(entry, found))
                case Trend():
                    parts.append(_trend(entry, found))
                case Ratio():
                    parts.append(_ratio(entry, found))
        except MissingEntry as missing:
            printed = None if isinstance(entry, Trend) else entry.printed
            parts.append(Part(entry.what, entry.kind, printed, None, "", Verdict.FAILED, str(missing)))
    return tuple(parts)


# Reading tables


def column(study: Study, heading: str) -> int:
    """Return the place of a column; raises `MissingEntry`."""
    if heading not in study.columns:
        raise MissingEntry(f"study '{study.name}' has no column '{heading}'; it has {', '.join(study.columns)}")
    return study.columns.index(heading)


def rows(study: Study, where: Where | None) -> list[int]:
    """Return the places of the rows that a selector leaves."""
    wanted = [(column(study, heading), value) for heading, value in (where or {}).items()]
    return [i for i, row in enumerate(study.rows) if all(_same(row[c], value) for c, value in wanted)]


def _same(ours: Cell, wanted: Entry) -> bool:
    if isinstance(ours, bool | str) or isinstance(wanted, bool | str):
        return type(ours) is type(wanted) and ours == wanted
    return ours is not None and math.isclose(ours, wanted, rel_tol=1e-9, abs_tol=1e-12)


def _some(found: Found, where: Where | None, heading: str) -> list[tuple[int, Cell]]:
    c = column(found.study, heading)
    places = rows(found.study, where)
    if not places:
        raise MissingEntry(f"study '{found.study.name}' has no row with {_told(where)}")
    return [(i, found.study.rows[i][c]) for i in places]


def _one(found: Found, where: Where | None, heading: str) -> tuple[float, Source]:
    entries = _some(found, where, heading)
    if len(entries) > 1:
        raise MissingEntry(f"{len(entries)} rows of study '{found.study.name}' have {_told(where)}")
    ((place, value),) = entries
    return _number(value, heading), _source(found, [place], heading)


def _number(value: Cell, heading: str) -> float:
    if isinstance(value, bool | str) or value is None:
        raise MissingEntry(f"column '{heading}' holds no number there but {value!r}")
    return value


def _source(found: Found, places: Sequence[int], heading: str) -> Source:
    return Source(found.run.id, found.study.name, tuple(i + 1 for i in places), heading, found.run.commit)


def _told(where: Where | None) -> str:
    return ", ".join(f"{key} = {value}" for key, value in (where or {}).items()) or "anything"


# Judging


def _value(entry: Value, found: Found) -> Part:
    entries = _some(found, entry.where, entry.column)
    places = [i for i, _ in entries]
    place, ours = entries[0]
    match entry.rule:
        case _ if entry.take is Take.COUNT:
            ours = sum(value is True for _, value in entries)
        case _ if entry.take is Take.MEAN:
            ours = sum(_number(value, entry.column) for _, value in entries) / len(entries)
        case Rule.HOLDS:
            if any(not isinstance(value, bool) for _, value in entries):
                raise MissingEntry(f"column '{entry.column}' says neither holds nor differs")
            place, ours = next((one for one in entries if not one[1]), entries[0])
        case Rule.AT_MOST:
            place, ours = max(entries, key=lambda one: _number(one[1], entry.column))
        case Rule.AT_LEAST:
            place, ours = min(entries, key=lambda one: _number(one[1], entry.column))
        case _ if len(entries) > 1:
            raise MissingEntry(f"{len(entries)} rows of study '{found.study.name}' have {_told(entry.where)}")
        case _:
            pass
    holds, rule, off = _held(entry, ours)
    sources = (_source(found, places if holds or entry.take else [place], entry.column),)
    if entry.rule is None:
        return Part(entry.what, entry.kind, entry.printed, ours, "", None, "", sources)
    if holds:
        return Part(entry.what, entry.kind, entry.printed, ours, rule, _GOOD[entry.kind], "", sources)
    words = _differs(off, entry.why, entry.because, found)
    return Part(entry.what, entry.kind, entry.printed, ours, rule, Verdict.DIFFERS, words, sources)


def _held(entry: Value, ours: Cell) -> tuple[bool, str, str]:
    """Return whether a rule holds, the rule in words, and by how much it does not."""
    printed, slack = entry.printed, entry.tolerance
    if entry.rule is None:
        return True, "", ""
    if entry.rule is Rule.HOLDS:
        return ours is True, "holds", "does not hold"
    if isinstance(printed, str | bool) or isinstance(ours, str | bool):
        return ours == printed, "equal", f"{ours} instead of {printed}"
    assert printed is not None
    ours = _number(ours, entry.column)
    off = ours - printed
    by = f"by {three(off)}" if printed == 0 else f"by {three(off)}, {off / abs(printed):+.1%}"
    match entry.rule:
        case Rule.EQUAL:
            return abs(off) <= slack + 1e-12, f"equal{_within(slack)}", by
        case Rule.AT_MOST:
            return off <= slack, f"at most {printed:g}{_within(slack)}", by
        case Rule.AT_LEAST:
            return -off <= slack, f"at least {printed:g}{_within(slack)}", by
        case _:
            return abs(off) <= slack * abs(printed), f"within {slack:.0%} of {printed:g}", by


def _within(slack: float) -> str:
    return f", tolerance {slack:g}" if slack else ""


def _differs(off: str, why: str, because: Because | None, found: Found) -> str:
    words = f"{off}; {why}" if why else f"{off}; its cause was not measured"
    if because is None:
        return words
    value = _some(found, because.where, because.column)[0][1]
    told = f", {_told(because.where)}" if because.where else ""
    return f"{words} ({because.column}{told}: {worded(value)})"


def worded(value: Cell) -> str:
    """Word an entry as plain text."""
    match value:
        case None:
            return "–"
        case bool():
            return "holds" if value else "differs"
        case int() | str():
            return str(value)
        case float():
            return three(value)


@dataclass(frozen=True)
class Fit:
    """y ~ x^exponent by least squares in the logarithms, with the 95 % interval of the exponent (NaN of two points)."""

    exponent: float
    low: float
    high: float


def fit(x: Sequence[float], y: Sequence[float]) -> Fit:
    """Fit a power law to positive points, two at least.

    Examples
    --------
    >>> found = fit([1, 2, 4, 8], [3, 1.5, 0.75, 0.375])
    >>> round(found.exponent, 9), round(found.high - found.low, 6)
    (-1.0, 0.0)
    """
    from scipy.special import stdtrit

    u, v = np.log(np.asarray(x, float)), np.log(np.asarray(y, float))
    spread = float(((u - u.mean()) ** 2).sum())
    slope = float(((u - u.mean()) * (v - v.mean())).sum()) / spread
    free = len(u) - 2
    if free < 1:
        return Fit(slope, math.nan, math.nan)
    left = v - v.mean() - slope * (u - u.mean())
    half = float(stdtrit(free, 0.975)) * math.sqrt(float((left**2).sum()) / free / spread)
    return Fit(slope, slope - half, slope + half)


def _trend(entry: Trend, found: Found) -> Part:
    xs = dict(_some(found, entry.where, entry.x))
    ys = dict(_some(found, entry.where, entry.y))
    there = [i for i, x in xs.items() if x is not None and ys[i] is not None]
    pairs = sorted((_number(xs[i], entry.x), _number(ys[i], entry.y), i) for i in there)
    pairs = [pair for pair in pairs if _between(pair[0], entry)]
    if len(pairs) < 2:
        raise MissingEntry(f"study '{found.study.name}' has fewer than two rows with {_told(entry.where)}")
    x, y, places = (list(part) for part in zip(*pairs, strict=True))
    sources = (_source(found, places, entry.y),)
    if entry.law is not Law.POWER:
        sign = -1 if entry.law is Law.FALLS else 1
        steps = [(x1, sign * (y1 - y0), abs(y0)) for y0, y1, x1 in zip(y, y[1:], x[1:], strict=False)]
        wrong = [
            f"at {entry.x} = {x1:g} by {three(-d)}" for x1, d, size in steps if d <= -entry.slack * size and d <= 0
        ]
        rule = f"{entry.law.value} with {entry.x}" + (f", steps back up to {entry.slack:.0%}" if entry.slack else "")
        ours = f"{three(y[0])} → {three(y[-1])}"
        printed = f"{entry.printed.y[0]:g} → {entry.printed.y[-1]:g}" if entry.printed else None
        verdict = Verdict.DIFFERS if wrong else Verdict.TREND
        words = _differs(f"it does not, {'; '.join(wrong)}", entry.why, entry.because, found) if wrong else ""
        return Part(entry.what, entry.kind, printed, ours, rule, verdict, words, sources)
    if min(*x, *y) <= 0:
        raise MissingEntry(f"a power law needs positive '{entry.x}' and '{entry.y}'")
    assert entry.low is not None
    assert entry.high is not None
    ours = fit(x, y)
    predicted = "" if entry.exponent is None else f"{entry.exponent:g} predicted, "
    rule = f"exponent: {predicted}{entry.low:g} to {entry.high:g} allowed"
    interval = "" if math.isnan(ours.low) else f"95 % interval {three(ours.low)} to {three(ours.high)}"
    printed = None
    if entry.printed:
        theirs = fit(entry.printed.x, entry.printed.y)
        printed = round(theirs.exponent, 3)
        if not math.isnan(theirs.low):
            interval += f"; printed points {three(theirs.low)} to {three(theirs.high)}"
    holds = entry.low <= ours.exponent <= entry.high
    words = interval
    if not holds:
        edge = entry.low if ours.exponent < entry.low else entry.high
        side = Side.BELOW if ours.exponent < entry.low else Side.ABOVE
        why, because = (entry.why, entry.because) if entry.why_if in (None, side) else ("", None)
        words = _differs(f"by {three(ours.exponent - edge)} from the range ({interval})", why, because, found)
    return Part(entry.what, entry.kind, printed, ours.exponent, rule, _trend_verdict(holds), words, sources)


def _trend_verdict(holds: bool) -> Verdict:
    return Verdict.TREND if holds else Verdict.DIFFERS


def _between(x: float, entry: Trend) -> bool:
    return (entry.start is None or x >= entry.start) and (entry.end is None or x <= entry.end)


def _ratio(entry: Ratio, found: Found) -> Part:
    below = entry.over_column or entry.column
    top, source = _one(found, entry.of, entry.column)
    bottom, other = _one(found, entry.over, below)
    if bottom == 0:
        raise MissingEntry(f"column '{below}' is zero where {_told(entry.over)}")
    ours, sources = top / bottom, (source, other)
    if entry.low is None and entry.high is None:
        return Part(entry.what, entry.kind, entry.printed, ours, "", None, "", sources)
    low, high = entry.low if entry.low is not None else -math.inf, entry.high if entry.high is not None else math.inf
    rule = " and ".join(
        f"{word} {bound:g}" for word, bound in (("at least", low), ("at most", high)) if math.isfinite(bound)
    )
    if low <= ours <= high:
        return Part(entry.what, entry.kind, entry.printed, ours, rule, _GOOD[entry.kind], "", sources)
    edge = low if ours < low else high
    words = _differs(f"{three(ours / edge)} times what is allowed", entry.why, entry.because, found)
    return Part(entry.what, entry.kind, entry.printed, ours, rule, Verdict.DIFFERS, words, sources)
