"""What made a result: the tool, the law, and the scene, with which it can be made again.

A scene is kept as plain data that JSON holds: the fields that differ from their defaults. What JSON has no word for is
a mapping whose key says what it is: ``array``, ``table``, ``mapping``, ``section``. Large arrays are kept beside, and
named. Reading back makes nothing but scenes, their sections, tables and arrays, and the scene is checked as any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from numbers import Number
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import softdyn
from softdyn.errors import SceneError
from softdyn.scene.time_tables import Table

#: Version of the files of results: what a later softdyn writes may mean something else.
FORMAT = 1
#: Arrays of more numbers than this are kept beside the plain data, where that is possible.
INLINE = 64
#: Fields that hold a law or a closure: a name, a path, or an object.
LAWS = ("law", "mixture", "drag")


@dataclass(frozen=True)
class Origin:
    """What made a result.

    Attributes
    ----------
    softdyn : str
        Version of the tool.
    law : str
        Digest of the law's equations.
    scene : Scene, ParticleScene or mapping
        A mapping, of plain data, where the result was read from a file; see :func:`softdyn.scene_of`.
    """

    softdyn: str
    law: str
    scene: Any


def origin_now(scene: Any, law: str) -> Origin:
    """Origin of a run of this tool; ``law`` is the digest of its equations."""
    return Origin(softdyn.__version__, law, scene)


def about(origin: Origin | None, beside: dict[str, NDArray[Any]] | None = None) -> dict[str, Any]:
    """Origin as plain data, for a file; large arrays are put into ``beside``, if that is given."""
    if origin is None:
        return {"format": FORMAT}
    scene = _set_aside(origin.scene, beside) if isinstance(origin.scene, Mapping) else _fields(origin.scene, beside)
    return {"format": FORMAT, "origin": {"softdyn": origin.softdyn, "law": origin.law, "scene": scene}}


def origin_in(content: Mapping[str, Any], beside: Mapping[str, NDArray[Any]] | None = None) -> Origin | None:
    """Origin that a file tells, with the arrays that it keeps beside; None of files of earlier versions.

    Raises
    ------
    ValueError
        If it is of a later version, or is none.
    """
    version = content.get("format", FORMAT)
    if not isinstance(version, int) or version > FORMAT:
        raise ValueError(f"it is of version {version}, which a later softdyn writes: this one reads up to {FORMAT}")
    told = content.get("origin")
    if told is None:
        return None
    if not isinstance(told, Mapping) or not isinstance(told.get("scene"), Mapping):
        raise ValueError("what it says of the scene that made it is none")
    return Origin(str(told["softdyn"]), str(told["law"]), _joined(told["scene"], beside or {}))


def scene_from(origin: Origin, kind: type[Any]) -> Any:
    """Return the scene, of a kind, that made a result.

    Raises
    ------
    SceneError
        If the law was an object of a program that has ended, or the data are not those of such a scene.
    """
    if isinstance(origin.scene, kind):
        return origin.scene
    known = {field.name for field in fields(kind)}
    other = [name for name in origin.scene if name not in known]
    if other:
        raise SceneError(f"the scene that made it has {', '.join(map(repr, other))}, which this version does not know")
    try:
        return kind(**{name: _value(value) for name, value in origin.scene.items()})
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise SceneError(f"what it says of the scene that made it is none: {error}") from None


def _fields(scene: Any, beside: dict[str, NDArray[Any]] | None) -> dict[str, Any]:
    """Fields of a dataclass that differ from their defaults."""
    given = {field.name: getattr(scene, field.name) for field in fields(scene) if not _is_default(field, scene)}
    # of particles, drag is a number
    named = {name: value for name, value in given.items() if name in LAWS and not isinstance(value, Number)}
    laws = {name: _law(value) for name, value in named.items() if value is not None}
    return {name: laws[name] if name in laws else _plain(value, beside) for name, value in given.items()}


def _is_default(field: Any, scene: Any) -> bool:
    value = getattr(scene, field.name)
    default = field.default if field.default_factory is MISSING else field.default_factory()
    return type(value) is type(default) and not isinstance(value, np.ndarray) and bool(value == default)


def _law(law: Any) -> Any:
    """A law by its name, or by the full path of its file; an object by its name, which nobody can find again."""
    if not isinstance(law, (str, Path)):
        return {"object": str(law.name)}
    file, _, name = str(law).rpartition(":") if ".py:" in str(law) else (str(law), "", "")
    return f"{Path(file).expanduser().resolve()}{':' if name else ''}{name}" if file.endswith(".py") else str(law)


def _plain(value: Any, beside: dict[str, NDArray[Any]] | None) -> Any:
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Table):
        return {"table": [_plain(value.t, beside), _plain(value.F, beside)]}
    if isinstance(value, np.ndarray):
        return _set_aside({"array": value}, beside)
    if isinstance(value, Mapping):
        return {"mapping": {str(key): _plain(one, beside) for key, one in value.items()}}
    if isinstance(value, (list, tuple, range)):
        return [_plain(one, beside) for one in value]
    if type(value).__name__ == "Term":
        return _law(value)
    if is_dataclass(value) and not isinstance(value, type):
        return {"section": type(value).__name__, "fields": _fields(value, beside)}
    return {"object": repr(value)[:200]}


def _set_aside(plain: Any, beside: dict[str, NDArray[Any]] | None) -> Any:
    """Plain data whose arrays are lists, or are put aside and named."""
    if isinstance(plain, np.ndarray):
        if beside is None or plain.size <= INLINE or plain.dtype.kind not in "biufU":
            return plain.tolist()
        name = f"scene_{len(beside)}"
        beside[name] = plain
        return name
    if isinstance(plain, list):
        return [_set_aside(one, beside) for one in plain]
    return {key: _set_aside(one, beside) for key, one in plain.items()} if isinstance(plain, Mapping) else plain


def _joined(plain: Any, beside: Mapping[str, NDArray[Any]]) -> Any:
    """The opposite: arrays in the place of their names."""
    if isinstance(plain, list):
        return [_joined(one, beside) for one in plain]
    if not isinstance(plain, Mapping):
        return plain
    if isinstance(plain.get("array"), str):
        return {"array": beside[plain["array"]]}
    return {key: _joined(one, beside) for key, one in plain.items()}


def _value(plain: Any) -> Any:
    if isinstance(plain, list):
        return [_value(one) for one in plain]
    if not isinstance(plain, Mapping):
        return plain
    if "object" in plain:
        raise SceneError(f"it was made with {plain['object']!r}, an object of a program: run that program again")
    if "array" in plain:
        return np.array(plain["array"])
    if "table" in plain:
        return Table(*(np.asarray(_value(one), dtype=float) for one in plain["table"]))
    if "section" in plain:
        return _section(plain["section"])(**{name: _value(one) for name, one in plain["fields"].items()})
    return {str(name): _value(one) for name, one in plain["mapping"].items()}


def _section(name: Any) -> type[Any]:
    """A section of a scene, by its name: one of those that softdyn.particles and softdyn.fluid offer, and no other."""
    from softdyn import fluid, particles

    home = next((module for module in (particles, fluid) if name in module.__all__), None)
    found = None if home is None else getattr(home, name)
    if not isinstance(found, type) or not is_dataclass(found):
        raise ValueError(f"there is no section {name!r}")
    return found
