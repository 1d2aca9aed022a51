"""Scene files of many particles."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softdyn.errors import SceneError
from softdyn.particles.particle_keys import ParticleScene
from softdyn.scene.reading import fields_from, is_particle_scene, is_suspension_scene, scene_of_file


def read_particle_scene(path: str | Path) -> ParticleScene:
    """Read a scene file of many particles.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = '''
    ... law = "rognon_gay"
    ... parameters = {E = 1.0, eta = 1.0}
    ... particles = {positions = [[0, 0], [2.1, 0]], radii = 1.0}
    ... flow = {drag = 1.0}
    ... until = {t = 1.0}
    ... '''
    >>> _ = Path("two.toml").write_text(text, encoding="utf-8")
    >>> read_scene("two.toml").positions
    [[0, 0], [2.1, 0]]
    """
    return scene_of_file(path, particle_scene_from)


def particle_scene_from(data: Mapping[str, Any], folder: Path) -> ParticleScene:
    """Scene from the content of a scene file; paths in it are relative to ``folder``.

    Raises
    ------
    SceneError
        Listing unknown and missing keys.
    """
    if "pair" in data and not is_particle_scene(data):
        raise SceneError("it is a scene of two particles, with [pair]; here [particles] or [packing] is needed")
    if is_suspension_scene(data):
        raise SceneError(
            "it is a scene of grains in a fluid, with [fluid], which softdyn run takes; here a scene of many "
            "particles by themselves is needed"
        )
    # a packing, or a result that is gone on from, has lengths of its own
    box = data.get("box")
    endless = isinstance(box, Mapping) and "lengths" not in box and set(box) != {"depth"}
    lacking = ["[box] lengths is missing, one for each axis; 0 along those that are not periodic"] if endless else []
    if "law" not in data and not data.keys() & {"inertia", "potential", "bond", "noise"}:
        lacking.append('law is missing: law = "NAME"')
    if "parameters" not in data and ("law" in data or "inertia" not in data):
        lacking.append("[parameters] is missing")
    return ParticleScene(**fields_from(ParticleScene, data, folder, needed=("until",), besides=lacking))
