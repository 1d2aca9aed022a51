"""Checkpoints: everything that a run needs to go on, in one file that is there whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from softdyn.particles.force_balance import Newton, pattern_of, solver_of
from softdyn.particles.geometry import Contacts
from softdyn.particles.linear import direct
from softdyn.particles.neighbours import Listed
from softdyn.particles.pulled_films import Pulled
from softdyn.particles.results import HISTORY, Frame
from softdyn.particles.state import State
from softdyn.particles.system import System
from softdyn.results.frame_file import go_on
from softdyn.results.state_file import frames_beside, plain, read_state, reading_checkpoint, write_state

#: Arrays of a state, by the names they have there.
STATE = ("x", "v", "y_rate")
LISTED = ("x", "cell", "walls")
CONTACTS = tuple(field.name for field in fields(Contacts))


#: Fields of a scene that say when it ends and how much it tells, and those that stand in the other arrays.
LEFT_OUT = ("law", "target", "units", "until_t", "until_strain", "times", "positions", "radii", "species", "films")


def fingerprint(system: System) -> str:
    """Digest of what a run depends on, but for when it ends and how much it tells."""
    scene, total = system.scene, sha256(system.kernel.key.encode())
    total.update(" ".join(key for mechanism in system.mechanisms for key in mechanism.made_by).encode())
    for array in (system.x, system.radii, system.species, system.p):
        total.update(np.ascontiguousarray(array).tobytes())
    for name, array in sorted((scene.films or {}).items()):
        total.update(name.encode() + np.ascontiguousarray(array).tobytes())
    given = {field.name: plain(getattr(scene, field.name)) for field in fields(scene) if field.name not in LEFT_OUT}
    total.update(json.dumps([given, system.names], default=str, sort_keys=True).encode())
    return total.hexdigest()


def save(path: Path, state: State, newton: Newton, key: str) -> None:
    """Write a checkpoint. A run that goes on from it does, to the last bit, what this one does.

    Only where a step was broken off, what Newton's iteration leaves for the next is left out: that starts anew.

    Parameters
    ----------
    path : Path
    state : State
    newton : Newton
        What its iteration leaves for the next step.
    key : str
        Of the scene, which the file belongs to.

    Raises
    ------
    SceneError
        If it cannot be written; then the one before it is still there.
    """
    about, arrays = told(state, newton)
    write_state(path, key, about, arrays)


def told(state: State, newton: Newton) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Numbers and arrays of a state, and of what Newton's iteration leaves: all that the steps to come depend on."""
    about = {
        "t": state.t,
        "dt": state.dt,
        "grow": state.grow,
        "recovery": state.recovery,
        "newton": _newton_data(newton),
        "stored0": state.stored0,
        "work": state.work,
        "work_error": state.work_error,
        "unseen": state.unseen,
        "settled": state.settled,
        "turned": state.turned,
        "power": state.power,
        "counts": state.counts,
        "skin": state.listed.skin,
        "box": [state.box.shear_rate, state.box.tilt, state.box.since],
        "pulled": state.pulled.kinds,
        "frames": len(state.frames),
    }
    arrays = {
        "history": np.array(state.history, dtype=float).reshape(-1, len(HISTORY)),
        "pressures": np.array(state.pulled.pressures, dtype=float).reshape(-1, 3),
        "box_lengths": state.box.lengths,
        "box_stretch": np.zeros_like(state.box.lengths) if state.box.stretch is None else state.box.stretch,
        "wall_point": np.array([wall.point for wall in state.walls]),
        **{name: getattr(state, name) for name in STATE},
        **{f"listed_{name}": getattr(state.listed, name) for name in LISTED},
        **{f"contacts_{name}": getattr(state.contacts, name) for name in CONTACTS},
        **_newton_arrays(newton),
        **{f"kept_{name}": values for name, values in state.kept.items()},
        **{f"mark_{name}": values for name, values in state.marks.items()},
    }
    return about, arrays


#: Numbers of a linear solver.
SOLVER = ("exact", "by_blocks", "spent", "solutions", "last", "counts")


def _newton_data(newton: Newton) -> dict[str, Any] | None:
    if not newton.whole:
        return None
    solver = None if newton.solver is None else {name: getattr(newton.solver, name) for name in SOLVER}
    pairs = [[int(one), int(other)] for one, other in newton.gauge_pairs]
    listed = newton.pattern is not None
    return {"s": newton.s, "pairs": pairs, "listed": listed, "counts": newton.counts, "solver": solver}


def _newton_arrays(newton: Newton) -> dict[str, NDArray[Any]]:
    """Matrices: the present one, and the one that the factor is of."""
    solver = newton.solver if newton.whole else None
    if solver is None:
        return {}
    kept = {"matrix": solver.matrix, "factored": None if solver.exact else solver.factored}
    return {
        f"{name}_{part}": getattr(matrix, part)
        for name, matrix in kept.items()
        if matrix is not None
        for part in ("data", "indices", "indptr")
    }


def _newton_from(told: Any, arrays: Mapping[str, NDArray[Any]], contacts: Contacts, system: System) -> Newton:
    """What Newton's iteration has left; patterns and factors are made again, as they were."""
    if told is None:
        return Newton(recalls=True)
    count, width = system.fixed.shape
    pairs = [(int(one), int(other)) for one, other in told["pairs"]]
    solver = None
    if told["solver"] is not None:
        solver = solver_of(system, recalls=True)
        numbers = told["solver"]
        solver.exact, solver.counts = bool(numbers["exact"]), {k: int(v) for k, v in numbers["counts"].items()}
        solver.by_blocks, solver.spent, solver.last = (float(numbers[name]) for name in ("by_blocks", "spent", "last"))
        solver.solutions = int(numbers["solutions"])
        solver.matrix = _matrix("matrix", arrays, count, width)
        solver.factored = solver.matrix if solver.exact else _matrix("factored", arrays, count, width)
        solver.factor = None if solver.factored is None else direct(solver.factored, width)
    return Newton(
        solver=solver,
        s=float(told["s"]),
        pattern=pattern_of(contacts, pairs, count) if told["listed"] else None,
        gauge_pairs=pairs,
        counts={name: int(number) for name, number in told["counts"].items()},
        recalls=True,
    )


def _matrix(name: str, arrays: Mapping[str, NDArray[Any]], count: int, width: int) -> bsr_array | None:
    if f"{name}_data" not in arrays:
        return None
    parts = tuple(arrays[f"{name}_{part}"] for part in ("data", "indices", "indptr"))
    return bsr_array(parts, shape=(count * width, count * width))


def load(path: Path, key: str, system: System) -> tuple[State, Newton]:
    """Read a checkpoint.

    Parameters
    ----------
    path : Path
    key : str
        Of the scene, which the file must belong to.
    system : System

    Raises
    ------
    SceneError
        If the file is none, or belongs to another scene.
    """
    with reading_checkpoint(path):
        about, arrays = read_state(path, key)
        state, newton = told_again(about, arrays, system)
        state.frames = go_on(frames_beside(path), Frame, key, int(about["frames"]))
        return state, newton


def told_again(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], system: System) -> tuple[State, Newton]:
    """State of numbers and arrays as :func:`told` gives them, without its frames.

    Parameters
    ----------
    about : mapping
    arrays : mapping from str to array
    system : System
    """
    stretch = arrays["box_stretch"]
    rate, tilt, since = map(float, about["box"])
    stretching = stretch if stretch.any() else None
    box = replace(
        system.box,
        lengths=arrays["box_lengths"],
        shear_rate=rate,
        tilt=tilt,
        since=since,
        stretch=stretching,
    )
    walls = [replace(wall, point=point) for wall, point in zip(system.walls, arrays["wall_point"], strict=True)]
    history = [(float(a), float(b), float(c), float(d), int(e)) for a, b, c, d, e in arrays["history"]]
    contacts = Contacts(**{name: arrays[f"contacts_{name}"] for name in CONTACTS})
    newton = _newton_from(about["newton"], arrays, contacts, system)
    state = State(
        t=float(about["t"]),
        dt=float(about["dt"]),
        grow=float(about["grow"]),
        recovery=float(about["recovery"]),
        **{name: arrays[name] for name in STATE},
        contacts=contacts,
        listed=Listed(**{name: arrays[f"listed_{name}"] for name in LISTED}, skin=float(about["skin"])),
        box=box,
        walls=tuple(walls),
        work={name: float(value) for name, value in about["work"].items()},
        work_error=float(about["work_error"]),
        unseen={name: float(when) for name, when in about["unseen"].items()},
        settled=float(about["settled"]),
        turned=float(about["turned"]),
        power=about["power"] and {name: float(value) for name, value in about["power"].items()},
        stored0=float(about["stored0"]),
        counts={name: int(value) for name, value in about["counts"].items()},
        pulled=Pulled(
            {kind: dict(found) for kind, found in about["pulled"].items()},
            [(float(a), float(b), float(c)) for a, b, c in arrays["pressures"]],
        ),
        history=history,
        frames=[],
        kept={name[5:]: values for name, values in arrays.items() if name.startswith("kept_")},
        marks={name: values for mechanism in system.having["marks"] for name, values in mechanism.marks().items()},
    )
    for name, values in state.marks.items():
        values[:] = arrays[f"mark_{name}"]
    return state, newton
