"""What ``[[methods]]`` tables ask for: methods with their settings made, swept, labelled and turned."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from envbench.errors import BadInput, unknown
from envbench.method import Method
from envbench.root import Workbench
from envbench.settings import check, construct, plain

_OWN_KEYS = ("name", "label", "sweep")


@dataclass(frozen=True)
class Choice:
    """A method with its settings.

    Attributes
    ----------
    identity : str
        Class and all settings, in full.
    label : str
        What a suite's scenes know it by.
    settings : mapping
        As rows show them.
    """

    identity: str
    label: str
    method: Method
    settings: Mapping[str, Any]

    def turned(self, setting: str, value: Any, what: str) -> Choice:
        """Return the choice with one `setting` at another value; raises `BadInput` if the method has or wants none."""
        full = values(self.method) | {setting: value}
        method = construct(type(self.method), full, f"{what}: method '{self.method.name}'")
        shown = {**self.settings, setting: plain(value)}
        return replace(self, identity=identity(method), method=method, settings=shown)


def choices(tables: Iterable[Mapping[str, Any]], bench: Workbench) -> tuple[Choice, ...]:
    """Return what all tables ask for, in order; what two tables ask for stands under both labels."""
    found = (choice for table in tables for choice in _choices(table, bench))
    return tuple({(choice.label, choice.identity): choice for choice in found}.values())


def selected(every: Sequence[Choice], labels: Sequence[str] | None, what: str) -> tuple[Choice, ...]:
    """Return those with one of `labels`, or all, each once; raises `BadInput` for an unknown label."""
    known = {choice.label for choice in every}
    for label in labels or ():
        if label not in known:
            raise unknown(f"method of {what}:", label, known)
    chosen = [choice for choice in every if labels is None or choice.label in labels]
    return tuple({choice.identity: choice for choice in reversed(chosen)}.values())[::-1]


def _choices(table: Mapping[str, Any], bench: Workbench) -> Iterator[Choice]:
    """Yield what a ``[[methods]]`` table asks for."""
    if not isinstance(table.get("name"), str):
        raise BadInput(f"a [[methods]] table needs a name in quotes. Got {dict(table)} instead.")
    cls, what = bench.method(table["name"]), f"method '{table['name']}'"
    label, sweep = table.get("label", table["name"]), table.get("sweep", False)
    given = {k: v for k, v in table.items() if k not in _OWN_KEYS}
    if not isinstance(label, str):
        raise BadInput(f"{what}: label must be text in quotes. Got {label!r} instead.")
    if not isinstance(sweep, bool):
        raise BadInput(f"{what}: sweep must be true or false. Got {sweep!r} instead.")
    if sweep and given:
        raise BadInput(f"{what}: '{min(given)}' stands beside sweep = true; leave one of them out.")
    axes = {key: _axis(cls, key, value, what) for key, value in given.items()}
    combinations = (dict(zip(axes, chosen, strict=True)) for chosen in itertools.product(*axes.values()))
    instances = cls.sweep() if sweep else [construct(cls, settings, what) for settings in combinations]
    yield from _labelled(cls, list(instances), given, label)


def _axis(cls: type[Method], key: str, value: Any, what: str) -> list[Any]:
    """Return the values of one setting: a list is swept, unless the setting itself is a list."""
    if not isinstance(value, list):
        return [value]
    try:
        check(cls, key, value, what)
    except BadInput:
        if not value:
            raise BadInput(f"{what}: {key} is an empty list; give it at least one value.") from None
        return list(value)
    return [value]


def _labelled(cls: type[Method], instances: Sequence[Method], given: Iterable[str], label: str) -> Iterator[Choice]:
    """Name each instance by the settings that were given, differ from their default, or vary among the instances."""
    entries: Sequence[Any] = [f for f in fields(cls) if f.init]  # pyright: ignore[reportArgumentType]
    found = [values(method) for method in instances]
    shown = {
        f.name
        for f in entries
        if f.name in given or any(v[f.name] != plain(f.default) or v[f.name] != found[0][f.name] for v in found)
    }
    for method, every in zip(instances, found, strict=True):
        yield Choice(identity(method), label, method, {k: v for k, v in every.items() if k in shown})


def values(method: Method) -> dict[str, Any]:
    """Return all settings by name, as plain values."""
    entries: Sequence[Any] = [f for f in fields(method) if f.init]  # pyright: ignore[reportArgumentType]
    return {f.name: plain(getattr(method, f.name)) for f in entries}


def identity(method: Method) -> str:
    """Return class and all settings, in full."""
    cls = type(method)
    return f"{cls.__module__}.{cls.__qualname__} {json.dumps(values(method), sort_keys=True)}"
