"""Scenes that come with softdyn, by name: where they are, and what each says of itself."""

from __future__ import annotations

from pathlib import Path

from softdyn.errors import SceneError
from softdyn.words import suggestion

HOME = Path(__file__).parent.parent


def _in(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def particle_scenes() -> dict[str, Path]:
    """Files of those of many particles, by name."""
    return _in(HOME / "particles" / "scenes")


def fluid_scenes() -> dict[str, Path]:
    """Files of those of a fluid, by name."""
    return _in(HOME / "fluid" / "scenes")


def suspension_scenes() -> dict[str, Path]:
    """Files of those of grains in a fluid, by name."""
    return _in(HOME / "suspension" / "scenes")


def stock_scenes() -> dict[str, Path]:
    """Files of all of them, by name."""
    return {**particle_scenes(), **fluid_scenes(), **suspension_scenes()}


def found_scene(path: Path) -> Path:
    """The file of a scene, which may be given by the name of one that comes with softdyn.

    Raises
    ------
    SceneError
        If there is neither.
    """
    if path.suffix or path.is_file():  # a folder may be the one of a .pvd of that scene
        return path
    stock = stock_scenes()
    if str(path) not in stock:
        raise SceneError(
            f"there is no scene {path}, neither a file nor one that comes with softdyn, as softdyn scenes lists them"
            f"{suggestion(str(path), list(stock))}"
        )
    return stock[str(path)]


def about(path: Path) -> str:
    """First sentence of what a scene file says of itself, in its comment at the top."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("# ").strip())
    text = " ".join(lines)
    ends = [place for place in (text.find(mark) for mark in (". ", ": ", "; ")) if place > 0]
    return text[: min(ends)] if ends else text.rstrip(".")
