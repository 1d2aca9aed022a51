"""Reading of TOML files, and the faults of keys that they should not have."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from softdyn.errors import SceneError
from softdyn.scene.keys import Key, Row, Section, rows, unknown, value_faults
from softdyn.words import listed

S = TypeVar("S")

_RESULT = 'a result: softdyn plot and convert read it, and a scene may go on from it, [particles] file = "..."'
_TABLE = "a table: a scene names it, as [particles] file, or as what drives a pair"
_PARTICLES = 'particles of another program: a scene starts from them, [particles] file = "..."'
#: Endings of files that are no scenes, and what they are.
NO_SCENES = {
    ".npz": _RESULT,
    ".json": _RESULT,
    ".csv": _TABLE,
    ".gsd": _PARTICLES,
    ".xyz": _PARTICLES,
    ".data": _PARTICLES,
    ".dump": _PARTICLES,
    ".pvd": "what other programs show",
    ".py": 'a law: a scene names it, law = "FILE.py"',
}


def scene_of_file(path: str | Path, scene_from: Callable[[Mapping[str, Any], Path], S]) -> S:
    """Scene of a file.

    Parameters
    ----------
    path : str or Path
    scene_from : callable
        Gives the scene from the content of a file and the folder that paths in it are relative to.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds what ``scene_from`` refuses.
    """
    path = Path(path)
    data = read_toml(path)
    try:
        return scene_from(data, path.parent)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a scene file.

    Raises
    ------
    SceneError
        If the file cannot be read, or is not TOML (with the line).
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise SceneError(f"cannot read the scene {path}: {error.strerror}") from None
    if path.suffix.lower() in NO_SCENES:
        raise SceneError(f"{path} is no scene, which is TOML, but {NO_SCENES[path.suffix.lower()]}")
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise SceneError(f"{path} is text in UTF-16, and TOML is in UTF-8: save it as such")
    try:
        text = raw.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise SceneError(
            f"{path} is not text in UTF-8: {error.reason} at byte {error.start}, line {line}; save it as such"
        ) from None
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise SceneError(f"{path} is nested too deeply") from None
    except ValueError as error:
        raise SceneError(f"{path} is not valid TOML: {error}") from None
    if "\\" in text and _holds_nul(content):
        raise SceneError(f"{path}: a text in it holds a NUL character, which no name and no path has")
    return content


def _holds_nul(content: Any) -> bool:
    if isinstance(content, Mapping):
        return any(_holds_nul(key) or _holds_nul(value) for key, value in content.items())
    return "\0" in content if isinstance(content, str) else isinstance(content, list) and any(map(_holds_nul, content))


def is_particle_scene(data: Mapping[str, Any]) -> bool:
    """Whether the content of a scene file is a scene of many particles (:mod:`softdyn.particles.files`)."""
    return "particles" in data or "packing" in data or "chains" in data


def is_fluid_scene(data: Mapping[str, Any]) -> bool:
    """Whether the content of a scene file is a scene of a fluid (:mod:`softdyn.fluid.fluid_scene`)."""
    return "fluid" in data


def is_suspension_scene(data: Mapping[str, Any]) -> bool:
    """Whether it is one of grains in a fluid (:mod:`softdyn.suspension.suspension_scene`); then it is both others."""
    return is_fluid_scene(data) and is_particle_scene(data)


@dataclass
class _Place:
    """What stands under one name at the top of a scene file: a key, a section, a list of sections."""

    whole: Row | None = None
    inner: dict[str, Row] = field(default_factory=dict)


@cache
def _places(cls: Any) -> dict[str, _Place]:
    places: dict[str, _Place] = {}
    for row in rows(cls):
        what = row.what
        if isinstance(what, Key) and not what.in_files:
            continue
        if not what.section:
            places[what.name] = _Place(row)
        elif what.name:
            places.setdefault(what.section, _Place()).inner[what.name] = row
        else:
            places.setdefault(what.section, _Place()).whole = row
    return places


def fields_from(
    cls: type, data: Mapping[str, Any], folder: Path, needed: Sequence[str] = (), besides: Sequence[str] = ()
) -> dict[str, Any]:
    """Fields of a scene's class from the content of a scene file.

    Parameters
    ----------
    cls : type
        A class that declares keys.
    data : mapping
    folder : Path
        Paths in the content are relative to it.
    needed : sequence of str
        Sections that cannot be left out, though none of their keys is needed by itself.
    besides : sequence of str
        Faults that are known already.

    Raises
    ------
    SceneError
        Listing unknown and missing keys, and what is no section; or naming a table that cannot be read.
    """
    places = _places(cls)
    faults = unknown_keys(data, places, "")
    for name, place in places.items():
        faults += _section_faults(name, place, data, places)
    faults += [*_missing(places, data, needed), *besides]
    if faults:
        # without these, values are judged with what they mean together, by the check of the scene
        values = [fault for name, place in places.items() for fault in _inner_faults(name, place, data)]
        raise SceneError(listed(faults + values))
    found = {}
    for name, place in places.items():
        if name not in data:
            continue
        if place.whole is not None and isinstance(place.whole.what, Section) and place.whole.what.many:
            found[place.whole.field] = [
                place.whole.what.cls(**_values(place.whole.what.cls, entry, folder, f"[[{name}]] {number}"))
                for number, entry in enumerate(data[name])
            ]
            continue
        if place.whole is not None and isinstance(place.whole.what, Section):
            content = {key: value for key, value in data[name].items() if key not in place.inner}
            if content or not place.inner:
                made = place.whole.what.cls
                found[place.whole.field] = made(**_values(made, content, folder, f"[{name}]"))
        elif place.whole is not None:
            where = name if not place.whole.what.section else f"[{name}]"
            found[place.whole.field] = _value(place.whole.what, data[name], folder, where)
        found |= {
            row.field: _value(row.what, data[name][key], folder, f"[{name}] {key}")
            for key, row in place.inner.items()
            if key in data[name]
        }
    return found


def _section_faults(name: str, place: _Place, data: Mapping[str, Any], top: Iterable[str]) -> list[str]:
    """What is wrong with the form of a section, and with the names of its keys."""
    if name not in data or (place.whole is not None and not place.whole.what.section):
        return []
    content, whole = data[name], None if place.whole is None else place.whole.what
    if isinstance(whole, Section) and whole.many:
        if not isinstance(content, list) or not all(isinstance(entry, Mapping) for entry in content):
            return [f"{name} must be a list of sections, [[{name}]]"]
        faults = []
        for number, entry in enumerate(content):
            known = {row.last: row for row in rows(whole.cls)}
            faults += unknown_keys(entry, known, f"[[{name}]] {number} ", top)
            lacking = [key for key, row in known.items() if row.default is MISSING and key not in entry]
            faults += [f"[[{name}]] {number}: {key} is missing" for key in lacking]
        return faults
    if not isinstance(content, Mapping):
        return [f"{name} must be a section, [{name}]"]
    if isinstance(whole, Key):
        return []
    known = place.inner | ({row.last: row for row in rows(whole.cls)} if whole is not None else {})
    return unknown_keys(content, known, f"[{name}] ", top)


def _inner_faults(name: str, place: _Place, data: Mapping[str, Any]) -> list[str]:
    """What is wrong with values, each by itself."""
    given = data.get(name)
    whole = None if place.whole is None else place.whole.what
    if isinstance(whole, Section) and whole.many:
        entries = given if isinstance(given, list) else []
        return [
            fault
            for number, entry in enumerate(entries)
            if isinstance(entry, Mapping)
            for fault in _row_faults({row.last: row for row in rows(whole.cls)}, entry, f"[[{name}]] {number}: ")
        ]
    if isinstance(whole, Key) and not whole.section:
        return _row_faults({name: place.whole}, {name: given}, "") if name in data else []
    if not isinstance(given, Mapping):
        return []
    inner = place.inner | ({row.last: row for row in rows(whole.cls)} if isinstance(whole, Section) else {})
    return _row_faults(inner, given, f"[{name}] ")


def _row_faults(known: Mapping[str, Row | None], content: Mapping[str, Any], where: str) -> list[str]:
    faults = []
    for name, value in content.items():
        row = known.get(name)
        if row is not None and isinstance(row.what, Key):
            read = value if row.what.kind.read is None else row.what.kind.read(value)
            faults += value_faults(row.what, read, where + name)
    return faults


def _missing(places: Mapping[str, _Place], data: Mapping[str, Any], needed: Sequence[str]) -> list[str]:
    faults = []
    for name, place in places.items():
        section = None if place.whole is None or name not in data else place.whole.what
        inner = {row.last: row for row in rows(section.cls)} if isinstance(section, Section) else place.inner
        lacking = [key for key, row in inner.items() if row.default is MISSING]
        alone = place.whole is not None and place.whole.default is MISSING
        if name not in data:
            if name == "law" and alone:
                faults.append('law is missing: law = "NAME"')
            elif alone or lacking or name in needed:
                faults.append(f"[{name}] is missing")
        elif isinstance(data[name], Mapping):
            faults += [f"[{name}] {key} is missing" for key in lacking if key not in data[name]]
    return faults


def _values(cls: type, content: Mapping[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """Fields of a section's class."""
    known = {row.last: row for row in rows(cls)}
    return {
        known[key].field if key in known else key: _value(known[key].what, value, folder, f"{where} {key}")
        if key in known
        else value
        for key, value in content.items()
    }


def _value(what: Key | Section, value: Any, folder: Path, where: str) -> Any:
    """Python's value of what a scene file says: paths from its folder, tables read."""
    if isinstance(what, Section):
        return _values(what.cls, value, folder, f"{where}:") if isinstance(value, Mapping) else value
    kind = what.kind
    if kind.path is not None:
        return str(folder / value) if isinstance(value, str) and kind.path(value) else value
    if kind.tabled == "list" and isinstance(value, list):
        return [_tabled(what, one, folder, where) for one in value]
    if kind.tabled == "value":
        return _tabled(what, value, folder, where)
    return value if kind.read is None else kind.read(value)


def _tabled(key: Key, value: Any, folder: Path, where: str) -> Any:
    """What says how something changes, with the table that it names in its place."""
    if not isinstance(value, Mapping):
        return value
    name = key.name.rpartition(" ")[2]
    if set(value) != {"file"}:
        raise SceneError(f'{where}: a table is {{file = "{name}.csv"}}, with no other key')
    if not isinstance(value["file"], str):
        raise SceneError(f"{where}: file must be a path, not {value['file']!r}")
    from softdyn.scene.time_tables import read_table

    axes = [f"{heading}_{axis}" for heading in (name, *key.headings) for axis in "xyz"] if key.of_axes else []
    try:
        return read_table(folder / value["file"], name, (*key.headings, *axes))
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from None


def unknown_keys(given: Iterable[str], allowed: Collection[str], where: str, above: Iterable[str] = ()) -> list[str]:
    """Faults of the keys of a section that it does not have.

    Parameters
    ----------
    given : iterable of str
        Keys of the section.
    allowed : collection of str
        Keys that it may have.
    where : str
        The section, as each fault begins.
    above : iterable of str
        Keys of the top level.
    """
    faults = []
    for key in given:
        if key in allowed:
            continue
        if key in above:
            hint = "; it is a key of the scene itself: write it before the first section, or as a section of its own"
            faults.append(f"{where}unknown key {key!r}{hint}")
        else:
            faults.append(f"{where}{unknown(key, list(allowed))}")
    return faults
