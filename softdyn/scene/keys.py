"""The one table of keys: what a scene may say, where, in which unit, and what it means.

A key is declared once, with the field of the class that takes it::

    range: Annotated[float | None, Key("[contacts] range", POSITIVE, "No contact beyond this gap.", "length")] = None

Whatever else speaks of keys follows from these declarations: the reader of scene files (:mod:`softdyn.scene.reading`),
checks, the classes' docstrings, ``softdyn keys``, the schema for editors, and the reference page. A field that is a
section of its own, or a list of sections, is a class that declares its keys likewise, wherever it stands: a
:class:`Section` says where, so that what a scene does not have is not imported.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, InitVar, dataclass
from functools import wraps
from importlib import import_module
from inspect import get_annotations
from typing import Any, TypeVar, get_type_hints, is_typeddict

from softdyn.errors import SceneError
from softdyn.scene.kinds import Kind, choice
from softdyn.scene.units import plain, powers_of
from softdyn.words import suggestion

T = TypeVar("T")

_ROWS: dict[type, tuple[Row, ...]] = {}


@dataclass(frozen=True)
class Key:
    """What is known of a key.

    Attributes
    ----------
    place : str
        In a scene file: "[contacts] range", "[[push]] force"; "law" above all sections, "[parameters]" a whole section.
    kind : Kind
    text : str
        What it means: one sentence that can stand alone, and more.
    unit : str
        Its dimension, a product of powers of force, length and time: "length", "force/length^2"; of each number, if
        these are several.
    headings : tuple of str
        Of the column of its table, besides its own name.
    of_axes : bool
        Whether headings may also end in the name of an axis, as "force_x" does.
    in_files : bool
        Whether scene files have it; else it is of Python alone.
    """

    place: str
    kind: Kind
    text: str
    unit: str = ""
    headings: tuple[str, ...] = ()
    of_axes: bool = False
    in_files: bool = True

    @property
    def section(self) -> str:
        """Its section, "" above all of them."""
        return self.place.partition("]")[0].strip("[") if self.place.startswith("[") else ""

    @property
    def name(self) -> str:
        """Its name there, "" if it is the whole section."""
        return self.place.rpartition("]")[2].strip()


@dataclass(frozen=True)
class Section:
    """A section, or a list of sections, whose keys a class of its own declares.

    Attributes
    ----------
    place : str
        "[gravity]"; "[[push]]", if it is a list; "[drive] spring", if it is a table within a section.
    home : str
        Module and class, "softdyn.particles.packing:Packing", imported when it is needed.
    text : str
        What it is: one sentence that can stand alone, and more.
    """

    place: str
    home: str
    text: str

    @property
    def many(self) -> bool:
        """Whether it is a list."""
        return self.place.startswith("[[")

    @property
    def section(self) -> str:
        """Its own name, or that of the section that it is in."""
        return self.place.partition("]")[0].strip("[")

    @property
    def name(self) -> str:
        """Its name within a section, "" if it is one."""
        return self.place.rpartition("]")[2].strip()

    @property
    def kind(self) -> Kind:
        """What Python takes."""
        name = self.home.rpartition(":")[2]
        return Kind(f"a list of {name}" if self.many else f"a {name}", {})

    @property
    def cls(self) -> type:
        """The class."""
        module, _, name = self.home.partition(":")
        found: type = getattr(import_module(module), name)
        return found


@dataclass(frozen=True)
class Row:
    """A row of the table: a key or a section, and the field that takes it.

    Attributes
    ----------
    field : str
        Its name in Python.
    what : Key or Section
    default : Any
        ``MISSING`` where it must be given.
    """

    field: str
    what: Key | Section
    default: Any = MISSING

    @property
    def last(self) -> str:
        """Name of the key within the section, or the table, of its class."""
        return self.what.name.rpartition(" ")[2]


def rows(cls: type) -> tuple[Row, ...]:
    """All rows that a class declares, in their order.

    Parameters
    ----------
    cls : type
        A dataclass or a TypedDict whose annotations hold a Key or a Section.
    """
    if cls not in _ROWS:
        _ROWS[cls] = _declared(cls)
    return _ROWS[cls]


def _declared(cls: type) -> tuple[Row, ...]:
    # of a class and of those that it is made of, in the order of their fields
    hints = {name: hint for one in reversed(cls.__mro__) for name, hint in get_annotations(one).items()}
    if any(isinstance(hint, str) for hint in hints.values()):
        hints = get_type_hints(cls, include_extras=True)
    optional: frozenset[str] = getattr(cls, "__optional_keys__", frozenset())
    found = []
    for field, hint in hints.items():
        held = hint.type if isinstance(hint, InitVar) else hint
        said = [what for what in getattr(held, "__metadata__", ()) if isinstance(what, (Key, Section))]
        found += [Row(field, what, _default(cls, field, field in optional)) for what in said]
    return tuple(found)


def _default(cls: type, field: str, optional: bool) -> Any:
    declared = getattr(cls, "__dataclass_fields__", {}).get(field)
    if declared is None:
        return None if optional else MISSING
    return declared.default_factory() if declared.default_factory is not MISSING else declared.default


def all_keys(cls: type) -> list[tuple[Row, type]]:
    """All keys of a scene's class and of its sections, with the class that declares each; imports all of these."""
    found = []
    for row in rows(cls):
        if isinstance(row.what, Key):
            found.append((row, cls))
        else:
            found += all_keys(row.what.cls)
    return found


def key_faults(values: Any, where: str = "") -> list[str]:
    """What is wrong with values, each by itself, and with those of sections; ``where`` is the place of an entry."""
    faults = []
    for row in rows(type(values)):
        value = getattr(values, row.field, None)
        if value is None and row.default is None:
            continue
        if isinstance(row.what, Key):
            faults += value_faults(row.what, value, f"{where}: {row.last}" if where else row.what.place)
        elif not row.what.name and not _is_empty(value):
            faults += _section_faults(row.what, row.field, value)
    return faults


def _is_empty(value: Any) -> bool:
    return isinstance(value, (tuple, list, dict)) and not value


def _section_faults(section: Section, field: str, value: Any) -> list[str]:
    cls = section.cls
    if section.many:
        if not isinstance(value, (list, tuple)) or not all(isinstance(entry, cls) for entry in value):
            return [f"{field} must be a list of {cls.__name__}(...), not {value!r}"]
        return [fault for k, entry in enumerate(value) for fault in key_faults(entry, f"{section.place} {k}")]
    if is_typeddict(cls):
        return [] if isinstance(value, Mapping) else [f"{section.place} must map names to values, not {value!r}"]
    return key_faults(value) if isinstance(value, cls) else [f"{field} must be a {cls.__name__}(...), not {value!r}"]


def driven_values(values: Any, cls: type | None = None) -> Iterator[Any]:
    """All that may change in time: what a scene gives for keys that take an expression or a table.

    Parameters
    ----------
    values : object of a class that declares keys, or a mapping
    cls : type, optional
        The class that declares the keys of a mapping.
    """
    for row in rows(cls or type(values)):
        value = values.get(row.field) if isinstance(values, Mapping) else getattr(values, row.field, None)
        what = row.what
        if value is None or (isinstance(what, Key) and not what.kind.tabled):
            continue
        if isinstance(what, Key):
            yield from value if what.kind.tabled == "list" and isinstance(value, (list, tuple)) else (value,)
        elif not _is_empty(value):
            for entry in value if what.many else (value,):
                yield from driven_values(entry, what.cls)


def value_faults(key: Key, value: Any, where: str) -> list[str]:
    """What is wrong with a value of a key: a sentence that starts with the key's name, or nothing.

    Parameters
    ----------
    key : Key
    value : Any
    where : str
        Name of the key.
    """
    try:
        value = in_numbers(key, value, where)
    except SceneError as error:
        return [str(error)]
    fault = None if key.kind.fault is None else key.kind.fault(value)
    return [] if fault is None else [where + fault]


#: The key that says so of a scene.
UNITS = Key(
    "units",
    choice("units", ("SI",)),
    'In which units all numbers are, as pictures tell it; a number with a unit, as "50 um", says so, too.',
)


def in_numbers(key: Key, value: Any, where: str) -> Any:
    """The value of a key, with a number in SI units in the place of a quantity, as "50 um".

    Parameters
    ----------
    key : Key
    value : Any
    where : str
        Name of the key.

    Raises
    ------
    SceneError
        If its unit is unknown, or of another dimension.
    """
    return plain(where, value, powers_of(key.unit)) if key.unit else value


def _of_field(row: Row, value: Any) -> Any:
    """The same of a field, which may be a table of keys of its own."""
    if isinstance(row.what, Key):
        return in_numbers(row.what, value, row.what.place)
    if not isinstance(value, Mapping):
        return value
    own = {inner.field: inner for inner in rows(row.what.cls)}
    return {name: _of_field(own[name], one) if name in own else one for name, one in value.items()}


def _parameters_of_law(law: Any, values: Any) -> Any:
    """Parameters of a law as numbers, by the dimensions that it declares; it is looked up if there is a unit alone."""
    if not isinstance(values, Mapping) or plain("[parameters]", values, None) == values:
        return values
    from softdyn.derive.law import dimensions_for
    from softdyn.laws import law_of

    known = {symbol.name: (of.mass, of.length, of.time) for symbol, of in dimensions_for(law_of(law)).items()}
    return {name: plain(f"[parameters] {name}", value, known.get(name)) for name, value in values.items()}


def with_keys(cls: type[T]) -> type[T]:
    """Let a dataclass say in its docstring what its fields are, and suggest a field in the place of an unknown one."""
    fields = [row.field for row in rows(cls)]
    of = {row.field: row for row in rows(cls)}
    order = list(getattr(cls, "__dataclass_fields__", fields))
    made = cls.__init__

    @wraps(made)
    def init(self: T, *values: Any, **named: Any) -> None:
        faults = [f"{cls.__name__}: {hint}" for name in named if name not in fields for hint in [unknown(name, fields)]]
        if faults:
            raise SceneError("; ".join(faults))
        by_place = dict(zip(order, values, strict=False))
        if len(values) > len(order) or set(by_place) & set(named):
            made(self, *values, **named)  # says so
        given = {**by_place, **named}
        numbers = {name: _of_field(of[name], value) if name in of else value for name, value in given.items()}
        if {"law", "parameters"} <= set(given):
            numbers["parameters"] = _parameters_of_law(given["law"], given["parameters"])
        if "units" in order and given.get("units") is None and _had_units(given, numbers):
            numbers["units"] = "SI"
        made(self, **numbers)

    # what help() shows of each keyword: its type, without what is known of the key
    made.__annotations__ = {name: _bare(hint) for name, hint in made.__annotations__.items()}
    cls.__init__ = init  # type: ignore[assignment, method-assign]
    cls.__doc__ = f"{(cls.__doc__ or '').rstrip()}\n\n    Parameters\n    ----------\n{_parameters(cls)}    "
    return cls


def _had_units(given: Any, numbers: Any) -> bool:
    """Whether a number of what was given had a unit."""
    if isinstance(given, Mapping) and isinstance(numbers, Mapping):
        return any(_had_units(value, numbers[name]) for name, value in given.items() if name in numbers)
    if isinstance(given, (list, tuple)) and isinstance(numbers, (list, tuple)):
        return given is not numbers and any(map(_had_units, given, numbers))
    return given is not numbers and (not isinstance(given, str) or not isinstance(numbers, str))


def _bare(hint: Any) -> Any:
    held = hint.type if isinstance(hint, InitVar) else hint
    return getattr(held, "__origin__", held) if hasattr(held, "__metadata__") else held


def _parameters(cls: type) -> str:
    lines = []
    for row in rows(cls):
        unit = f", {row.what.unit}" if isinstance(row.what, Key) and row.what.unit else ""
        optional = "" if row.default is MISSING else ", optional"
        lines.append(f"    {row.field} : {row.what.kind.words}{unit}{optional}\n")
        lines.append(textwrap.fill(row.what.text, 120, initial_indent=" " * 8, subsequent_indent=" " * 8) + "\n")
    return "".join(lines)


#: Names that are likely meant otherwise, and how.
MEANT = {
    "diameter": "radii are half of it",
    "diameters": "radii are half of them",
    "tilt_xy": "[box] tilt",
    "reach": "it is range",
    "pushes": "it is push",
    "holds": "it is hold",
    "walls": "it is wall",
    "until": "it is until_t, or until_strain",
    "contacts": "a section of scenes of many particles, with [particles] or [packing]",
    "flow": "a section of scenes of many particles, with [particles] or [packing]",
    "box": "a section of scenes of many particles, with [particles] or [packing]",
    "drive": "a section of scenes of two particles; many are driven by [[push]], [[hold]], [flow] and [stress]",
}


def unknown(name: str, known: Sequence[str]) -> str:
    """Words about a name that there is not, with the one that is meant."""
    hint = f"; {MEANT[name]}" if name in MEANT else suggestion(name, known)
    return f"unknown key {name!r}{hint}"
