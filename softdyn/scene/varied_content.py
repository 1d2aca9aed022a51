"""The content of a scene file with some of its numbers replaced, by their names in the table of keys.

A name is "section.key" as in the file, or the key alone where one section has it: "packing.fraction", "shear_rate".
Parameters of the law and constants are "parameters.E" and "constants.w", or "E" and "w".
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, NamedTuple

from softdyn.errors import SceneError
from softdyn.scene.keys import Key, Section, rows, value_faults
from softdyn.words import suggestion

#: Sections whose names are those of numbers.
OF_NUMBERS = ("parameters", "constants")


class Place(NamedTuple):
    """Where a number stands: section, name there, and its key, if it has one of its own."""

    section: str
    name: str
    key: Key | None


def places(cls: type, content: Mapping[str, Any]) -> dict[str, list[Place]]:
    """All names that numbers have, each with the places that it may mean.

    Parameters
    ----------
    cls : type
        Class of the scene, which declares its keys.
    content : mapping
        Of a scene file.
    """
    found: dict[str, list[Place]] = {}
    for row in rows(cls):
        what = row.what
        if isinstance(what, Section):
            if not what.many and not what.name:
                for inner in rows(what.cls):
                    if isinstance(inner.what, Key):
                        _add(found, Place(what.section, inner.last, inner.what))
        elif what.in_files and what.section and what.name:
            _add(found, Place(what.section, what.name, what))
            if row.field not in (what.name, what.section):
                found.setdefault(row.field, []).append(Place(what.section, what.name, what))
    for section in OF_NUMBERS:
        given = content.get(section)
        for name in given if isinstance(given, Mapping) else ():
            _add(found, Place(section, name, None))
    return found


def _add(found: dict[str, list[Place]], place: Place) -> None:
    found.setdefault(f"{place.section}.{place.name}", []).append(place)
    found.setdefault(place.name, []).append(place)


def with_values(cls: type, content: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """Content of a scene file with numbers in the place of what it says, or added to it.

    Parameters
    ----------
    cls : type
    content : mapping
        Of a scene file; it is left as it is.
    values : mapping from str to float

    Raises
    ------
    SceneError
        Naming what is unknown, may mean two things, or takes no such number.
    """
    known = places(cls, content)
    made = copy.deepcopy(dict(content))
    for name, value in values.items():
        place = _place(name, known, content)
        if place.key is None:
            made[place.section][place.name] = float(value)
            continue
        section = made.setdefault(place.section, {})
        if not isinstance(section, dict):
            raise SceneError(f"{place.section} must be a section, [{place.section}]")
        section[place.name] = _fitting(name, place.key, value)
    return made


def _place(name: str, known: Mapping[str, list[Place]], content: Mapping[str, Any]) -> Place:
    """The place that a name means: of several, the one whose section the scene has."""
    there = known.get(name, [])
    if len(there) > 1:
        there = [place for place in there if place.section in content] or there
    if not there:
        section = name.partition(".")[0]
        if section in ("push", "hold", "wall"):
            raise SceneError(
                f"{name} cannot be varied: [[{section}]] is a list; write an expression with a name of [constants] "
                "there, and vary that"
            )
        near = [full for full in known if "." in full]
        if "." not in name:
            near = [*near, *(short for short in known if "." not in short)]
        raise SceneError(f"{name} is no number of this scene that can be varied{_suggested(name, near)}")
    if len(there) > 1:
        full = " or ".join(f"{place.section}.{place.name}" for place in there)
        raise SceneError(f"{name} may mean {full}: say which")
    return there[0]


def _suggested(name: str, near: list[str]) -> str:
    found = suggestion(name, near)
    return found if "did you mean" in found else "; softdyn keys lists what there is, as section.key"


def _fitting(name: str, key: Key, value: float) -> float | int:
    """A number as the key takes it: whole, where it must be."""
    if key.kind.schema.get("type") in ("array", "boolean", "string", "object"):
        raise SceneError(f"{name} cannot be varied: it is {key.kind.words}")
    faults = value_faults(key, float(value), name)
    if faults and float(value).is_integer() and not value_faults(key, int(value), name):
        return int(value)
    if faults:
        raise SceneError(faults[0])
    return float(value)
