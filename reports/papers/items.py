"""Papers and their items (tables and figures), as files say them: what to run, what to look at, what was printed.

An item is one TOML file in the folder of its paper; ``docs/papers.md`` says what may stand in it. Printed values stand
here and nowhere else; ours come from the store.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from envbench.errors import BadInput, unknown
from envbench.settings import construct

Entry = int | float | bool | str
Where = dict[str, Entry]
"""Which rows of a study: heading of a column to what stands there."""

FOLDER = Path(__file__).parent


class Kind(StrEnum):
    """What a printed number is: a fact of the mathematics, a statement of accuracy, or measured on old hardware."""

    EXACT = "exact"
    CLAIM = "claim"
    TIMING = "timing"


class Rule(StrEnum):
    """How a number of ours is held against the printed one."""

    EQUAL = "equal"
    AT_MOST = "at most"
    AT_LEAST = "at least"
    WITHIN = "within"
    HOLDS = "holds"


class Take(StrEnum):
    """What may be made of a column: how many entries hold, or the mean."""

    COUNT = "count"
    MEAN = "mean"


class Law(StrEnum):
    """How one column follows another."""

    FALLS = "falls"
    RISES = "rises"
    POWER = "power"


class Side(StrEnum):
    """Of a range."""

    BELOW = "below"
    ABOVE = "above"


@dataclass(frozen=True)
class Because:
    """Where the number stands that was measured behind a `why`."""

    column: str
    where: Where | None = None


@dataclass(frozen=True)
class Value:
    """One entry of the study beside a printed one; of several rows that `where` leaves, the worst.

    Attributes
    ----------
    take : Take or None
        What is made of all rows that `where` leaves, in place of one of them.
    tolerance : float
        Absolute, or relative for "within".
    why : str
        The cause of a difference, in words.
    because : Because or None
        The measured number behind it.
    """

    what: str
    column: str
    kind: Kind
    where: Where | None = None
    printed: Entry | None = None
    rule: Rule | None = None
    take: Take | None = None
    tolerance: float = 0.0
    why: str = ""
    because: Because | None = None

    def __post_init__(self) -> None:
        if self.rule is None and self.kind is not Kind.TIMING:
            if self.kind is Kind.CLAIM:
                raise BadInput(f"rule must be one of {', '.join(Rule)} for a claim. Got none.")
            object.__setattr__(self, "rule", Rule.EQUAL)
        if self.rule not in (None, Rule.HOLDS) and self.printed is None:
            raise BadInput(f"printed must be given for the rule '{self.rule}'. Got none.")
        if self.rule in (Rule.AT_MOST, Rule.AT_LEAST, Rule.WITHIN) and not isinstance(self.printed, int | float):
            raise BadInput(f"printed must be a number for the rule '{self.rule}'. Got {self.printed!r} instead.")
        if not 0 <= self.tolerance < float("inf"):
            raise BadInput(f"tolerance must be >= 0. Got {self.tolerance} instead.")


@dataclass(frozen=True)
class Points:
    """Printed points of a curve."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    name: str = "printed"

    def __post_init__(self) -> None:
        if len(self.x) != len(self.y):
            raise BadInput(f"x and y must be of one length. Got {len(self.x)} and {len(self.y)} instead.")


@dataclass(frozen=True)
class Trend:
    """How column `y` follows column `x`, over the rows that `where` leaves and x in [`start`, `end`].

    Attributes
    ----------
    exponent, low, high : float
        Of a power law y ~ x^exponent: what theory says, and between what the fitted exponent must lie.
    slack : float
        Of "falls" and "rises": the share by which one step may go the other way.
    why_if : Side or None
        Where the exponent must lie, below or above its range, for `why` to be the cause; None: anywhere.
    """

    what: str
    x: str
    y: str
    law: Law
    kind: Kind = Kind.TIMING
    where: Where | None = None
    exponent: float | None = None
    low: float | None = None
    high: float | None = None
    start: float | None = None
    end: float | None = None
    slack: float = 0.0
    printed: Points | None = None
    why: str = ""
    why_if: Side | None = None
    because: Because | None = None

    def __post_init__(self) -> None:
        if self.law is Law.POWER and (self.low is None or self.high is None or not self.low < self.high):
            raise BadInput(f"low and high must be given for a power law, low < high. Got {self.low}, {self.high}.")


@dataclass(frozen=True)
class Ratio:
    """Ours of `column` in the row `of` over `over_column` (the same, if none) in the row `over`, beside the printed."""

    what: str
    column: str
    of: Where
    over: Where
    over_column: str | None = None
    kind: Kind = Kind.TIMING
    printed: float | None = None
    low: float | None = None
    high: float | None = None
    why: str = ""
    because: Because | None = None


@dataclass(frozen=True)
class Plot:
    """A figure drawn again: columns `y` over column `x`, a series more for each value of column `by`."""

    title: str
    x: str
    y: tuple[str, ...]
    log: str = ""
    style: str = "lines"
    by: str | None = None
    where: Where | None = None
    printed: tuple[Points, ...] = ()

    def __post_init__(self) -> None:
        if self.log not in ("", "x", "y", "xy"):
            raise BadInput(f'log must be "", "x", "y" or "xy". Got {self.log!r} instead.')
        if self.style not in ("lines", "points", "bars"):
            raise BadInput(f"style must be 'lines', 'points' or 'bars'. Got {self.style!r} instead.")


@dataclass(frozen=True)
class Header:
    """What an item's file says beside its lists.

    Attributes
    ----------
    study, substitute : str
        Studies of the catalogue: what is run, and what in its place where its data are absent.
    source : str
        The paper, where its folder holds no ``paper.toml``.
    """

    item: str
    title: str
    study: str
    text: str
    substitute: str = ""
    source: str = ""


@dataclass(frozen=True)
class Item(Header):
    """A table, a figure or a claim of a paper."""

    file: Path = Path()
    values: tuple[Value, ...] = ()
    trends: tuple[Trend, ...] = ()
    ratios: tuple[Ratio, ...] = ()
    plots: tuple[Plot, ...] = ()

    @property
    def slug(self) -> str:
        """The name of its files."""
        return self.file.stem


@dataclass(frozen=True)
class Paper:
    """A paper with its items, in order of their numbers; `hardware` is what its timings were measured on."""

    name: str
    title: str
    hardware: str = ""
    items: tuple[Item, ...] = ()

    @property
    def studies(self) -> tuple[str, ...]:
        """What is run, each once."""
        return tuple(dict.fromkeys(item.study for item in self.items))

    @property
    def substitutes(self) -> dict[str, str]:
        """What is run in the place of a study whose data are absent."""
        return {item.study: item.substitute for item in self.items if item.substitute}


@dataclass(frozen=True)
class _Title:
    title: str
    hardware: str = ""


def names(user: Path | None = None) -> tuple[str, ...]:
    """Return the papers that there are: folders here, and in ``papers/`` of the user's own folder."""
    return tuple(dict.fromkeys(folder.name for folder in _folders(user)))


def read(name: str, user: Path | None = None) -> Paper:
    """Read a paper: all files of its folder; raises `BadInput`, naming file, key and value."""
    found = [folder for folder in _folders(user) if folder.name == name]
    if not found:
        raise unknown("paper", name, names(user))
    title = _Title(name)
    items: list[Item] = []
    for path in sorted(path for folder in found for path in folder.glob("*.toml")):
        if path.name == "paper.toml":
            title = construct(_Title, _table(path), _short(path))
        else:
            items.append(item(path))
    if title.title == name and items and items[0].source:
        title = replace(title, title=items[0].source)
    return Paper(name, title.title, title.hardware, tuple(sorted(items, key=lambda one: _numbered(one.item))))


def item(path: Path) -> Item:
    """Read an item's file."""
    what, table = _short(path), _table(path)

    def several(key: str, kind: type[Any]) -> tuple[Any, ...]:
        entries = _list(table.pop(key, []), f"{what}: [[{key}]]")
        return tuple(_construct(kind, entry, f"{what}: [[{key}]] {i}") for i, entry in enumerate(entries, 1))

    lists: dict[str, Any] = {"values": several("values", Value), "trends": several("trends", Trend)}
    lists |= {"ratios": several("ratios", Ratio), "plots": several("plots", Plot)}
    header = construct(Header, table, what)
    judged = [v for v in lists["values"] if v.rule] + [*lists["trends"]]
    judged += [r for r in lists["ratios"] if r.low is not None or r.high is not None]
    if not judged:
        raise BadInput(
            f"{what} judges nothing: give it [[values]] with a rule, [[trends]], or [[ratios]] with low or high."
        )
    return Item(header.item, header.title, header.study, header.text, header.substitute, header.source, path, **lists)


_INNER: dict[type[Any], dict[str, type[Any]]] = {
    Value: {"because": Because},
    Trend: {"because": Because, "printed": Points},
    Ratio: {"because": Because},
    Plot: {"printed": Points},
}


def _construct(kind: type[Any], entry: Mapping[str, Any], what: str) -> Any:
    """Make a `kind`, its inner tables checked as strictly as itself."""
    made: dict[str, Any] = {}
    for key, inner in _INNER[kind].items():
        value = entry.get(key)
        if isinstance(value, Mapping):
            made[key] = construct(inner, value, f"{what}: {key}")
        elif isinstance(value, list) and all(isinstance(one, Mapping) for one in value):
            made[key] = tuple(construct(inner, one, f"{what}: {key} {i}") for i, one in enumerate(value, 1))
    found = construct(kind, {key: value for key, value in entry.items() if key not in made}, what)
    return replace(found, **made) if made else found


def _folders(user: Path | None) -> Iterable[Path]:
    for root in (FOLDER, *([user / "papers"] if user else [])):
        for folder in sorted(root.iterdir()) if root.is_dir() else ():
            if folder.is_dir() and any(folder.glob("*.toml")):
                yield folder


def _table(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f"{_short(path)}: {error}. A TOML file in UTF-8 is needed.") from None


def _list(value: Any, what: str) -> Sequence[Mapping[str, Any]]:
    if not isinstance(value, list) or not all(isinstance(entry, Mapping) for entry in value):
        raise BadInput(f"{what} must be a list of tables. Got {value!r} instead.")
    return value


def _short(path: Path) -> str:
    return f"papers/{path.parent.name}/{path.name}"


def _numbered(label: str) -> tuple[Any, ...]:
    """Return what sorts "Figure 10" after "Figure 9".

    Examples
    --------
    >>> sorted(["Table 2", "Figure 10", "Figure 9"], key=_numbered)
    ['Figure 9', 'Figure 10', 'Table 2']
    """
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", label) if part)
