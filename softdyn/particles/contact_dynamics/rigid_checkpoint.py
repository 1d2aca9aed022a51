"""Checkpoints of runs of rigid grains: a run that goes on from one does, to the last bit, what it would have done."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from softdyn.particles.checkpoint import LEFT_OUT
from softdyn.particles.contact_dynamics.impulses import Effort
from softdyn.particles.contact_dynamics.rigid_system import RigidState, RigidSystem
from softdyn.particles.geometry import bare_contacts
from softdyn.particles.neighbours import Listed
from softdyn.particles.results import HISTORY, Frame
from softdyn.results.frame_file import go_on
from softdyn.results.state_file import frames_beside, plain, read_state, reading_checkpoint, write_state

#: Arrays and numbers of a state, by the names they have there.
STATE = ("x", "v", "impulses", "normals", "distances")
NUMBERS = ("t", "began", "goal", "last_dt")
COUNTS = ("step", "steps")
PAIRS = ("i", "j", "shift")
LISTED = ("x", "cell", "walls")


def fingerprint(system: RigidSystem) -> str:
    """Digest of what a run depends on, but for when it ends and how much it tells."""
    scene, total = system.scene, sha256(system.kernel.key.encode())
    for array in (system.x, system.radii, system.species):
        total.update(np.ascontiguousarray(array).tobytes())
    given = {field.name: plain(getattr(scene, field.name)) for field in fields(scene) if field.name not in LEFT_OUT}
    total.update(json.dumps([given, system.names], default=str, sort_keys=True).encode())
    return total.hexdigest()


def save(path: Path, state: RigidState, key: str) -> None:
    """Write a checkpoint.

    Parameters
    ----------
    path : Path
    state : RigidState
    key : str
        Of the scene, which the file belongs to.

    Raises
    ------
    SceneError
        If it cannot be written; then the one before it is still there.
    """
    about: dict[str, Any] = {name: getattr(state, name) for name in (*NUMBERS, *COUNTS)}
    about |= {
        "work": state.work,
        "effort": state.effort.told(),
        "counts": state.counts,
        "skin": state.listed.skin,
        "box": [state.box.shear_rate, state.box.tilt, state.box.since],
        "box_lengths": [float(length) for length in state.box.lengths],
        "box_stretch": None if state.box.stretch is None else [float(rate) for rate in state.box.stretch],
        "frames": len(state.frames),
    }
    arrays = {
        "history": np.array(state.history, dtype=float).reshape(-1, len(HISTORY)),
        "wall_point": np.array([wall.point for wall in state.walls]),
        **{name: getattr(state, name) for name in STATE},
        **{f"contacts_{name}": getattr(state.contacts, name) for name in PAIRS},
        **{f"listed_{name}": getattr(state.listed, name) for name in LISTED},
    }
    write_state(path, key, about, arrays)


def load(path: Path, key: str, system: RigidSystem) -> RigidState:
    """Read a checkpoint.

    Parameters
    ----------
    path : Path
    key : str
        Of the scene, which the file must belong to.
    system : RigidSystem

    Raises
    ------
    SceneError
        If the file is none, or belongs to another scene.
    """
    with reading_checkpoint(path):
        about, arrays = read_state(path, key)
        rate, tilt, since = map(float, about["box"])
        lengths = np.array(about["box_lengths"], dtype=float)
        stretch = None if about["box_stretch"] is None else np.array(about["box_stretch"], dtype=float)
        walls = [replace(wall, point=point) for wall, point in zip(system.walls, arrays["wall_point"], strict=True)]
        usual = vars(Effort())
        effort: dict[str, Any] = {name: type(usual[name])(value) for name, value in about["effort"].items()}
        i, j, shift = (arrays[f"contacts_{name}"] for name in PAIRS)
        numbers: dict[str, Any] = {name: float(about[name]) for name in NUMBERS}
        numbers |= {name: int(about[name]) for name in COUNTS} | {name: arrays[name] for name in STATE}
        return RigidState(
            **numbers,
            contacts=bare_contacts(i, j, shift, system.radii),
            listed=Listed(**{name: arrays[f"listed_{name}"] for name in LISTED}, skin=float(about["skin"])),
            box=replace(system.box, shear_rate=rate, tilt=tilt, since=since, lengths=lengths, stretch=stretch),
            walls=tuple(walls),
            work={name: float(value) for name, value in about["work"].items()},
            effort=Effort(**effort),
            counts={name: int(value) for name, value in about["counts"].items()},
            history=[(float(a), float(b), float(c), float(d), int(e)) for a, b, c, d, e in arrays["history"]],
            frames=go_on(frames_beside(path), Frame, key, int(about["frames"])),
        )
