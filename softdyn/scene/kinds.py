"""Kinds of values that keys take: in words, as a check, and as a fragment of a JSON schema."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softdyn.words import suggestion

Schema = Mapping[str, Any]


@dataclass(frozen=True)
class Kind:
    """What a value may be.

    Attributes
    ----------
    words : str
        With an article: "a positive number".
    schema : mapping
        What a JSON schema says of it.
    fault : function, optional
        What is wrong with a value, to stand behind the name of its key, or None. Without it, what takes the value
        checks it, knowing more than the value.
    tabled : "", "value" or "list"
        Whether a scene file may give a table in the place of the value, or of each of a list.
    path : function, optional
        Whether a text is a path, which in a scene file is relative to the file's folder.
    read : function, optional
        Of a scene file's value that makes Python's, where they differ.
    """

    words: str
    schema: Schema
    fault: Callable[[Any], str | None] | None = None
    tabled: str = ""
    path: Callable[[str], bool] | None = None
    read: Callable[[Any], Any] | None = None


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, and no bool."""
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    try:
        return number and math.isfinite(value)
    except OverflowError:  # of a whole number beyond all doubles
        return False


def of_kind(words: str, schema: Schema, good: Callable[[Any], bool]) -> Kind:
    """Kind of the values that a function holds for good.

    Parameters
    ----------
    words : str
        What a value must be, after "must be".
    schema : mapping
        The same in JSON schema.
    good : function of a value
        Whether it is of the kind.
    """

    def fault(value: Any) -> str | None:
        return None if good(value) else f" must be {words}, not {shown(value)}"

    return Kind(words, schema, fault)


def shown(value: Any) -> str:
    """A value, for a message; its beginning, if it is long."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def between(low: float, high: float, why: str = "", below: bool = False) -> Kind:
    """Numbers from the least to the greatest, or below that; ``why`` there is a least.

    Parameters
    ----------
    low, high : float
    why : str
        After the least, in words.
    below : bool
        Whether the greatest is left out.
    """

    def fault(value: Any) -> str | None:
        if not is_number(value):
            return f" must be a number, not {shown(value)}"
        good = low <= value and (value < high if below else value <= high)
        return None if good else f" must lie between {low:g}{why} and {high:g}, not {value:g}"

    schema = {"type": "number", "minimum": low, "exclusiveMaximum" if below else "maximum": high}
    return Kind(f"a number between {low:g} and {high:g}", schema, fault)


def choice(what: str, known: Sequence[str]) -> Kind:
    """One of some names."""

    def fault(value: Any) -> str | None:
        return None if value in known else f": unknown {what} {value!r}{suggestion(value, known)}"

    return Kind(f"one of {', '.join(known)}", {"enum": list(known)}, fault)


def count_or_list(most: int, words: str = "numbers") -> Kind:
    """How many, or which; the list is checked where it is known what it lists."""

    def fault(value: Any) -> str | None:
        if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
            return None if 2 <= value <= most else f" must be 2 to {most}, or a list, not {value}"
        good = isinstance(value, (list, tuple, np.ndarray, range))
        return None if good else f" must be a count or a list of {words}, not {shown(value)}"

    listed = {"type": "array", "items": NUMBER.schema, "minItems": 1}
    counted = {"type": "integer", "minimum": 2, "maximum": most}
    return Kind(f"a count, or a list of {words}", {"anyOf": [counted, listed]}, fault)


def whole_number(least: int) -> Kind:
    """Whole numbers from the least on."""

    def good(value: Any) -> bool:
        return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and bool(value >= least)

    return of_kind(f"a whole number, {least} or larger", {"type": "integer", "minimum": least}, good)


def _is_mapping(value: Any) -> str | None:
    return None if isinstance(value, Mapping) else f" must map names to values, not {shown(value)}"


NUMBER = of_kind("a finite number", {"type": "number"}, is_number)


def _not_positive(value: Any) -> str | None:
    if not is_number(value) or not value > 0:
        return f" must be a positive number, not {shown(value)}"
    tiny = value < np.finfo(float).tiny
    return f" = {value!r} is below the smallest normal double; choose other units" if tiny else None


POSITIVE = Kind("a positive number", {"type": "number", "exclusiveMinimum": 0}, _not_positive)
NOT_NEGATIVE = of_kind(
    "0 or a positive number", {"type": "number", "minimum": 0}, lambda value: is_number(value) and value >= 0
)
NOT_ZERO = of_kind(
    "a number other than 0", {"type": "number", "not": {"const": 0}}, lambda value: is_number(value) and value != 0
)
FLAG = of_kind("true or false", {"type": "boolean"}, lambda value: isinstance(value, (bool, np.bool_)))

_TEXT: Schema = {"type": "string"}
_FILE: Schema = {
    "type": "object",
    "properties": {"file": _TEXT},
    "required": ["file"],
    "additionalProperties": False,
}
_DRIVEN: Schema = {"anyOf": [NUMBER.schema, _TEXT, _FILE]}


def _path_fault(value: Any) -> str | None:
    return None if isinstance(value, (str, Path)) else f" must be a path, not {shown(value)}"


PATH = Kind("a path", _TEXT, _path_fault, path=lambda text: True)
LAW = Kind(
    'a stock law, "path/law.py", "path/law.py:name", in Python a law, too', _TEXT, path=lambda text: ".py" in text
)
#: What changes: what takes it knows the constants of its expression, and how far its table must reach.
DRIVEN = Kind("a number, an expression of t, or a table", _DRIVEN, tabled="value")
DRIVEN_LIST = Kind("a list of numbers, expressions of t, or tables", {"type": "array", "items": _DRIVEN}, tabled="list")
#: What depends on the place: what takes it knows how many axes there are.
_FIELD: Schema = {"anyOf": [NUMBER.schema, _TEXT]}
FIELD = Kind("a number, or an expression of x, y, z and t", _FIELD)
FIELD_LIST = Kind("a list of numbers, or of expressions of x, y, z and t", {"type": "array", "items": _FIELD})
COORDINATES = Kind("a list of numbers", {"type": "array", "items": NUMBER.schema})
NUMBERS_BY_NAME = Kind("numbers by name", {"type": "object", "additionalProperties": NUMBER.schema}, _is_mapping)
NUMBERS_BY_SPECIES = Kind(
    "numbers by name; in the place of a number, numbers by species",
    {"type": "object", "additionalProperties": {"anyOf": [NUMBER.schema, NUMBERS_BY_NAME.schema]}},
    _is_mapping,
)
NAMES_BY_NAME = Kind("names by name", {"type": "object", "additionalProperties": _TEXT}, _is_mapping)
NAMES = Kind("a list of names", {"type": "array", "items": _TEXT})


def _names_fault(value: Any) -> str | None:
    names = [value] if isinstance(value, str) else value
    good = isinstance(names, (list, tuple)) and len(names) and all(isinstance(name, str) and name for name in names)
    return None if good else f" must be a name, or a list of names, not {shown(value)}"


NAME_OR_NAMES = Kind("a name, or a list of names", {"anyOf": [_TEXT, NAMES.schema]}, _names_fault)


def _without_zeros(lengths: Any) -> Any:
    return [None if length == 0 else length for length in lengths] if isinstance(lengths, list) else lengths


def _is_list(value: Any) -> str | None:
    return None if isinstance(value, (list, tuple, np.ndarray)) else f" must be a list of numbers, not {shown(value)}"


#: TOML has no null: 0 stands for an axis along which the box is not periodic.
LENGTHS = Kind(
    "a list of numbers",
    COORDINATES.schema,
    _is_list,
    read=_without_zeros,
)
