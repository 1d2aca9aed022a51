"""Reading of TOML files, and the faults of keys that they should not have."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from softdyn.errors import SceneError
from softdyn.words import suggestion

_RESULT = 'a result: softdyn plot and convert read it, and a scene may go on from it, [particles] file = "..."'
_TABLE = "a table: a scene names it, as [particles] file, or as what drives a pair"
#: Endings of files that are no scenes, and what they are.
NO_SCENES = {
    ".npz": _RESULT,
    ".json": _RESULT,
    ".csv": _TABLE,
    ".gsd": "what other programs show",
    ".pvd": "what other programs show",
    ".py": 'a law: a scene names it, law = "FILE.py"',
}


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
    return "particles" in data or "packing" in data


#: Keys that are likely meant otherwise, and how.
MEANT = {
    "diameter": "radii are half of it",
    "diameters": "radii are half of them",
    "tilt_xy": "[box] tilt",
    "contacts": "a section of scenes of many particles, with [particles] or [packing]",
    "flow": "a section of scenes of many particles, with [particles] or [packing]",
    "box": "a section of scenes of many particles, with [particles] or [packing]",
    "drive": "a section of scenes of two particles; many are driven by [[push]], [[hold]], [flow] and [stress]",
}


def unknown_keys(given: Iterable[str], allowed: Sequence[str], where: str, above: Sequence[str] = ()) -> list[str]:
    """Faults of the keys of a section that it does not have; ``above`` are those of the top level."""
    faults = []
    for key in given:
        if key in allowed:
            continue
        if key in above:
            hint = "; it is a key of the scene itself: write it before the first section, or as a section of its own"
        elif key in MEANT:
            hint = f"; {MEANT[key]}"
        else:
            hint = suggestion(key, allowed)
        faults.append(f"{where}unknown key {key!r}{hint}")
    return faults
