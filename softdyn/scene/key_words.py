"""What is told of keys: ``softdyn keys``, the reference page ``.docs/keys.md``, and the schema for editors."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass
from typing import Any

from softdyn.errors import SceneError
from softdyn.scene.keys import Key, Row, Section, rows
from softdyn.scene.kinds import Schema
from softdyn.words import suggestion

PAGE_HEAD = """# Keys of scenes

Every key of a scene file, and its name in Python. Numbers are in any consistent units; beside a kind stands its
dimension. A number that has one may have a unit, too, "50 um", "1 mN/m" or "0.89 mPa s", and so may parameters of a
law; Python takes quantities of pint as well. It becomes a number in SI units; plain numbers beside it stay as they are.
`softdyn keys KEY` tells the same of one key, and `softdyn keys --schema` writes a JSON schema, with which editors
complete and check scene files (of TOML by taplo, for one: `#:schema FILE` in the first line).

Written by `softdyn keys --markdown`, from the declarations: do not edit.
"""

TWO, MANY, FLUID = "Scenes of two particles", "Scenes of many particles", "Scenes of a fluid"
BOTH = "Scenes of grains in a fluid"


@dataclass(frozen=True)
class Entry:
    """A key, as it is told.

    Attributes
    ----------
    title : str
        Of the scenes that have it.
    row : Row
    key : Key
    place : str
        In a scene file, "" if none has it.
    python : str
        As Python takes it: "range", "Push(force)", 'stress["xy"]'.
    """

    title: str
    row: Row
    key: Key
    place: str
    python: str

    @property
    def takes(self) -> str:
        """Kind, unit and default."""
        value = self.row.default
        nothing = value is None or (isinstance(value, (tuple, list, Mapping)) and not value)
        default = "" if nothing else f"; {_text(value)} by default"
        need = "; must be given" if value is MISSING else default
        return self.key.kind.words + (f"; {self.key.unit}" if self.key.unit else "") + need


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return ", ".join(map(str, value)) if isinstance(value, (tuple, list)) else f"{value}"


def scene_classes() -> dict[str, type]:
    """The classes of scenes, by what they are."""
    from softdyn.fluid.fluid_scene import FluidScene
    from softdyn.particles.particle_keys import ParticleScene
    from softdyn.scene.pair_scene import Scene
    from softdyn.suspension.suspension_scene import SuspensionScene

    return {TWO: Scene, MANY: ParticleScene, FLUID: FluidScene, BOTH: SuspensionScene}


def entries() -> list[Entry]:
    """All keys of all scenes, section by section, in the order of their declarations."""
    found = []
    for title, cls in scene_classes().items():
        own = list(_entries(title, cls, None))
        sections = list(dict.fromkeys(entry.key.section if entry.place else None for entry in own))
        found += sorted(own, key=lambda entry: sections.index(entry.key.section if entry.place else None))
    return found


def _entries(title: str, cls: type, within: Row | None) -> Iterator[Entry]:
    for row in rows(cls):
        if isinstance(row.what, Section):
            yield from _entries(title, row.what.cls, row)
            continue
        python = row.field
        if within is not None:
            named = hasattr(cls, "__total__")  # a dictionary, whose names are checked
            python = f'{within.field}["{row.field}"]' if named else f"{cls.__name__}({row.field})"
        yield Entry(title, row, row.what, row.what.place if row.what.in_files else "", python)


def told(name: str) -> str:
    """What is known of a key, by its name in files or in Python, with or without its section; or of a whole section.

    Raises
    ------
    SceneError
        If there is none of that name, with the one that is meant.
    """
    all_of_them = entries()
    names: dict[str, list[Entry]] = {}
    for entry in all_of_them:
        key = entry.key
        own = {entry.row.field, entry.python, key.place, entry.row.last or key.section, key.section}
        own |= {f"{key.section}.{entry.row.last}"} if key.section else set()
        for one in own - {""}:
            names.setdefault(one, []).append(entry)
    if name not in names:
        raise SceneError(f"there is no key {name!r}{suggestion(name, sorted(names))}")
    return "\n\n".join(_paragraph(entry) for entry in names[name])


def _paragraph(entry: Entry) -> str:
    place = entry.place or "(in Python alone)"
    head = f"{place}    in Python: {entry.python}    {entry.title[0].lower()}{entry.title[1:]}"
    lines = (textwrap.fill(text, 100, initial_indent="  ", subsequent_indent="  ") for text in _sentences(entry))
    return "\n".join([head, *lines])


def _sentences(entry: Entry) -> list[str]:
    takes = entry.takes
    return [f"{takes[0].upper()}{takes[1:]}.", entry.key.text]


def listed_keys() -> str:
    """All keys, one a line: place, and what it means in one sentence."""
    lines: list[str] = []
    for title in scene_classes():
        lines += [*([""] if lines else []), f"{title}:", ""]
        for entry in entries():
            if entry.title == title and entry.place:
                first = entry.key.text.partition(". ")[0].partition(": ")[0].rstrip(".")
                lines.append(f"  {entry.place:26} {first}")
    return "\n".join([*lines, "", "softdyn keys KEY tells more of one, or of a section"])


def page() -> str:
    """The reference page, in Markdown."""
    lines = [PAGE_HEAD]
    for title in scene_classes():
        lines.append(f"## {title}\n")
        section = None
        for entry in entries():
            if entry.title != title:
                continue
            where = (
                entry.key.place.partition("]")[0] + "]" * ("[" in entry.key.place) if entry.place else "Python alone"
            )
            where += "]" * where.startswith("[[")
            where = where if "[" in where or not entry.place else "Above all sections"
            if where != section:
                head = f"`{where}`" if "[" in where else where
                lines += [*([""] if section else []), f"### {head}\n"]
                lines += ["| key | in Python | takes | meaning |", "|---|---|---|---|"]
                section = where
            name = f"`{entry.key.name}`" if entry.key.name and entry.place else ""
            lines.append("| " + " | ".join(map(_cell, (name, f"`{entry.python}`", entry.takes, entry.key.text))) + " |")
        lines.append("")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def schema() -> dict[str, Any]:
    """A JSON schema of scene files, of two particles, of many, of a fluid, or of both."""
    kinds = []
    for title, cls in scene_classes().items():
        found = _object_of(cls, title)
        found["required"] += ["until"] + (["pair", "drive"] if title == TWO else [])
        if title == MANY:
            found["oneOf"] = [{"required": [name]} for name in ("particles", "packing", "chains")]
        kinds.append(found)
    return {"$schema": "http://json-schema.org/draft-07/schema#", "title": "A scene of softdyn", "anyOf": kinds}


def _object_of(cls: type, title: str) -> dict[str, Any]:
    """Schema of the whole of a scene file."""
    top: dict[str, Any] = {}
    required = []
    for row in rows(cls):
        what = row.what
        if isinstance(what, Key) and not what.in_files:
            continue
        if not what.section or not what.name:
            name = what.section or what.name
            if isinstance(what, Section):
                own = _object_of_section(what)
                at = top.setdefault(name, own)
                if at is not own:
                    at["properties"] |= own["properties"]
            else:
                top[name] = _described(what)
            required += [name] if row.default is MISSING else []
            continue
        section = top.setdefault(what.section, _empty())
        section["properties"][what.name] = _described(what) if isinstance(what, Key) else _object_of_section(what)
        section["required"] += [what.name] if row.default is MISSING else []
    return {**_empty(title), "properties": top, "required": required}


def _empty(text: str = "") -> dict[str, Any]:
    described = {"description": text} if text else {}
    return {"type": "object", **described, "properties": {}, "required": [], "additionalProperties": False}


def _object_of_section(section: Section) -> dict[str, Any]:
    found = _empty(section.text)
    for row in rows(section.cls):
        if isinstance(row.what, Key):
            found["properties"][row.last] = _described(row.what)
            found["required"] += [row.last] if row.default is MISSING else []
    return {"type": "array", "items": found} if section.many else found


def _described(key: Key) -> dict[str, Any]:
    unit = f" ({key.unit})" if key.unit else ""
    with_unit = bool(key.unit) or key.place == "[parameters]"
    return {"description": f"{key.text}{unit}", **(_or_quantity(key.kind.schema) if with_unit else key.kind.schema)}


#: A number with a unit.
QUANTITY = {"type": "string", "pattern": r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*[^\s0-9(*/+.-].*$"}


def _or_quantity(schema: Schema) -> dict[str, Any]:
    """A schema in which each number may have a unit."""
    if schema.get("type") == "number":
        return {"anyOf": [dict(schema), QUANTITY]}
    found = dict(schema)
    for name in ("items", "additionalProperties"):
        if isinstance(schema.get(name), Mapping):
            found[name] = _or_quantity(schema[name])
    if "anyOf" in schema:
        found["anyOf"] = [_or_quantity(one) for one in schema["anyOf"]]
    return found
