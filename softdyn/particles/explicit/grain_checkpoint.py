"""Checkpoints of a run of grains: all that changes, so that a run that goes on does what it would have done."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.checkpoint import LEFT_OUT
from softdyn.particles.explicit.grains import Grains, GrainSystem
from softdyn.particles.results import HISTORY, Frame
from softdyn.results.frame_file import go_on
from softdyn.results.state_file import frames_beside, plain, read_state, reading_checkpoint, write_state

#: Numbers of a state, and its arrays, by their names.
NUMBERS = ("t", "listed_tilt", "turns", "stiffest", "fastest", "moved", "kinetic0", "stored0")
ARRAYS = (
    "order", "x", "v", "spin", "rate_v", "home", "listed", "start", "partner", "image", "in_start", "in_at", "history",
    "touch", "wall_history", "wall_touch", "sums", "given_force", "x0",
)  # fmt: skip


def fingerprint(system: GrainSystem) -> str:
    """Digest of what a run depends on, but for when it ends and how much it tells."""
    scene, total = system.scene, sha256(system.kernel.key.encode())
    for array in (system.x, system.radii, system.species, system.p, system.q):
        total.update(np.ascontiguousarray(array).tobytes())
    given = {field.name: plain(getattr(scene, field.name)) for field in fields(scene) if field.name not in LEFT_OUT}
    total.update(json.dumps([given, system.names], default=str, sort_keys=True).encode())
    return total.hexdigest()


def told(state: Grains) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Numbers and arrays of a state: all that the steps to come depend on."""
    about = {name: getattr(state, name) for name in NUMBERS} | {"counts": state.counts}
    return about, {name: getattr(state, name) for name in ARRAYS}


def told_again(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], before: str = "") -> Grains:
    """State of numbers and arrays as :func:`told` gives them, the names of the arrays with something before them.

    Parameters
    ----------
    about : mapping
        Numbers.
    arrays : mapping from str to array
    before : str
        What the names of the arrays begin with.

    Raises
    ------
    KeyError, TypeError, ValueError
        If there is one missing, or of another kind.
    """
    numbers = {name: float(about[name]) for name in NUMBERS if name != "turns"}
    return Grains(
        **{name: arrays[before + name] for name in ARRAYS},  # type: ignore[arg-type]
        **numbers,  # type: ignore[arg-type]
        turns=int(about["turns"]),
        counts={name: int(value) for name, value in about["counts"].items()},
    )


def save(path: Path, state: Grains, key: str) -> None:
    """Write a checkpoint.

    Parameters
    ----------
    path : Path
    state : Grains
    key : str
        Of the scene, which the file belongs to.

    Raises
    ------
    SceneError
        If it cannot be written; then the one before it is still there.
    """
    about, arrays = told(state)
    about["frames"] = len(state.frames)
    arrays["steps"] = np.array(state.history_rows, dtype=float).reshape(-1, len(HISTORY))
    write_state(path, key, about, arrays)


def load(path: Path, key: str) -> Grains:
    """Read a checkpoint.

    Raises
    ------
    SceneError
        If the file is none, or belongs to another scene.
    """
    with reading_checkpoint(path):
        about, arrays = read_state(path, key)
        rows = [(float(a), float(b), float(c), float(d), int(e)) for a, b, c, d, e in arrays["steps"]]
        frames = go_on(frames_beside(path), Frame, key, int(about["frames"]))
        return replace(told_again(about, arrays), history_rows=rows, frames=frames)
