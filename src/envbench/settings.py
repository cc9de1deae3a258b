"""Tables of a user's file become frozen dataclasses, checked: the only edge where types are not yet trusted."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, TypeVar, get_type_hints

from envbench.errors import BadInput, unknown

T = TypeVar("T")


def construct(kind: type[T], table: Mapping[str, Any], what: str) -> T:
    """Make a `kind`, a dataclass, from a table whose keys are its fields.

    Values are held to the fields' annotations as strictly as JSON allows: no string becomes a number and no number a
    truth value, but an integer may stand for a float, a list for a tuple and a string for an enum.

    Parameters
    ----------
    what : str
        How messages name the table, e.g. "method 'shrm'".

    Raises
    ------
    BadInput
        For an unknown or missing key, a value of the wrong type, and whatever `kind` itself refuses.

    Examples
    --------
    >>> from envbench.reference import ReferenceSettings
    >>> construct(ReferenceSettings, {"floor": 1}, "[reference]").floor
    1.0
    """
    known = {f.name: f for f in fields(kind) if f.init}  # pyright: ignore[reportArgumentType]
    values = {key: check(kind, key, value, what) for key, value in table.items()}
    for name, entry in known.items():
        if name not in values and entry.default is MISSING and entry.default_factory is MISSING:
            raise BadInput(f"{what} lacks '{name}': add it.")
    try:
        return kind(**values)
    except BadInput as error:
        raise error if str(error).startswith(what) else BadInput(f"{what}: {error}") from None
    except (TypeError, ValueError) as error:
        raise BadInput(f"{what} with {dict(table)}: {error}") from error


def check(kind: type[Any], key: str, value: Any, what: str) -> Any:
    """Return `value` as field `key` of the dataclass `kind` has it; raises `BadInput` if it is not one."""
    from pydantic import TypeAdapter, ValidationError

    known = {f.name for f in fields(kind) if f.init}
    if key not in known:
        raise unknown(f"setting of {what}:", key, known)
    adapter = TypeAdapter[Any](get_type_hints(kind)[key])
    try:
        return adapter.validate_json(json.dumps(value, default=str), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = "".join(f"[{part!r}]" for part in first["loc"] if isinstance(part, int) or part in str(value))
        needed = first["msg"].removeprefix("Input should be ")
        raise BadInput(f"{what}: {key}{where} must be {needed}. Got {value!r} instead.") from None


def plain(value: Any) -> Any:
    """Return `value` as JSON has it: tuples as lists, enums by value, NumPy scalars as numbers, the rest as text."""

    def other(item: Any) -> Any:
        return item.tolist() if hasattr(item, "tolist") else str(item)

    return json.loads(json.dumps(value, default=other))
