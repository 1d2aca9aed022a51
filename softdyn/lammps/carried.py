"""Which scenes LAMMPS can run, with which time step, and when that is worth it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.force_balance import Newton
from softdyn.particles.mechanisms import ROOMS, rooms_of
from softdyn.particles.method import ORDER
from softdyn.particles.names import is_number, listed
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import kernel_needs, prepare
from softdyn.particles.start import start
from softdyn.particles.state import State, overlaps
from softdyn.particles.system import System, ValidatedScene, contact_state

Array = NDArray[np.float64]

#: Rooms of the mechanisms that the plugin knows.
KNOWN = ("soft_films", "drag", "pushes", "holds", "gravity", "shear", "sliding")
#: Of the longest time step that is stable at the start: errors are of the first order, and contacts become stiffer.
SHARE = 0.25
#: Of a dense suspension, measured: microseconds of an implicit step for each contact, and such steps in a strain of 1
#: with [accuracy] rtol = 1e-4; nanoseconds of an explicit step for each contact.
IMPLICIT_US, IMPLICIT_STEPS, EXPLICIT_NS = 9.0, 100, 80.0


@dataclass(frozen=True)
class Prepared:
    """A scene that LAMMPS can run, as it starts.

    Attributes
    ----------
    system : System
    state : State
    limit : float
        Longest time step that is stable at the start.
    loads : array, shape (N, d + rotations)
        External forces, and torques over radii, without those that change with time.
    """

    system: System
    state: State
    limit: float
    loads: Array


def explicit_needs(facts: ValidatedScene) -> dict[str, object]:
    """What a plugin needs of the kernel of its contacts; radii are looked up pair by pair, whatever they are."""
    needs = kernel_needs(facts)
    varying = tuple(sorted({*needs["varying"], "R", "size_ratio"}))
    return {**needs, "varying": varying, "drag": True, "explicit": True}


def faults_of(scene: ParticleScene) -> list[str]:
    """What LAMMPS cannot run of a scene, or only otherwise than softdyn does."""
    faults = []
    if scene.law is None or scene.method not in (None, "implicit"):
        faults.append("the plugin for LAMMPS is of a law of contacts, and of films that are implicit")
    for room in rooms_of(scene):
        name = room.__name__.rpartition(".")[2]
        if name not in KNOWN:
            keys = ", ".join(ROOMS.get(name, (name,)))
            faults.append(f"{keys}: of this the plugin for LAMMPS knows nothing")
    if not scene.drag:
        faults.append("steps of LAMMPS are explicit, which needs a drag of each particle: [flow] drag = 1")
    if scene.range is None:
        faults.append("neighbour lists of LAMMPS need a range of the contacts: [contacts] range")
    if np.asarray(scene.positions).shape[1] == 1:
        faults.append("LAMMPS has two dimensions or three: add a coordinate")
    if not is_number(scene.shear_rate):
        faults.append("[flow] shear_rate: the plugin for LAMMPS takes a number")
    return faults


def prepared(scene: ParticleScene) -> Prepared:
    """Check a scene, and make its start.

    Raises
    ------
    SceneError
        If it cannot be used, or not by LAMMPS: all that stands against it at once.
    """
    faults = faults_of(scene)
    if faults:
        raise SceneError("LAMMPS cannot run this scene:\n" + listed(faults))
    system = prepare(scene)
    state = start(system, Newton())
    return Prepared(system, state, explicit_limit(system, state), system.force.unchanging())


def explicit_limit(system: System, state: State) -> float:
    """Longest time step for which no force is overshot, by Gershgorin's circles; inf without contacts.

    A step multiplies a force by 1 - dt k (b_i + b_j), b the mobilities, if its gap stays as it is. The plugin asks the
    same of every step, with what gaps give way in it.
    """
    contacts, d = state.contacts, system.dimension
    values = contact_state(system, contacts, overlaps(system, state), contacts.h)
    near = contacts.h < system.reach
    if not near.any():
        return math.inf
    i, j = contacts.i[near], contacts.j[near]
    r = (contacts.S - overlaps(system, state))[near]
    # what is held along all axes yields to no force
    moves = np.where(system.fixed[:, :d].all(axis=1), 0.0, 1 / system.resistance[:, 0])
    stiff, across = np.abs(values["F_by_distance"])[near] / 2, np.abs(values["F"])[near] / r / 2
    both = (moves[i] + moves[j]) / 2
    rows = [np.maximum(stiff, across) * (moves[end] + both) for end in (i, j)]
    if system.width > d:
        turns = moves + np.where(system.fixed[:, d], 0.0, 1 / system.resistance[:, d])
        sliding, mean = values["k_t"][near] / 2, (turns[i] + turns[j]) / 2
        by_turns = [sliding * (turns[end] + mean) + across * (moves[end] + both) for end in (i, j)]
        rows = [np.maximum(*pair) for pair in zip(rows, by_turns, strict=True)]
    total = sum(np.bincount(end, row, len(moves)) for end, row in zip((i, j), rows, strict=True))
    largest = float(np.max(total))
    return 1 / largest if largest > 0 else math.inf


def crossover(ready: Prepared, dt: float, ns: float = EXPLICIT_NS, ranks: int = 1) -> float:
    """Shear rate at which explicit steps take as long as implicit ones; below it these are faster.

    Parameters
    ----------
    ready : Prepared
    dt : float
        Of the explicit steps.
    ns : float
        Nanoseconds of processor time of one of them, for each contact.
    ranks : int
        Processes of LAMMPS, against one of softdyn's own engine.
    """
    steps = IMPLICIT_STEPS * (1e-4 / ready.system.rtol) ** (1 / ORDER)
    return float(ns * 1e-9 / (ranks * dt * steps * IMPLICIT_US * 1e-6))


def crossover_words(ready: Prepared, dt: float, ns: float = EXPLICIT_NS, ranks: int = 1) -> str:
    """The same, and what it says of the scene.

    Parameters
    ----------
    ready : Prepared
    dt : float
        Of the explicit steps.
    ns : float
        Nanoseconds of processor time of one of them, for each contact.
    ranks : int
        Processes of LAMMPS.
    """
    rate, at = abs(float(ready.system.scene.shear_rate)), crossover(ready, dt, ns, ranks)  # type: ignore[arg-type]
    text = (
        f"steps of {dt:.3g} (stable up to {ready.limit:.3g} at the start), {ns:.3g} ns a contact; the implicit steps "
        f"of softdyn's own engine are about as fast at a shear rate of {at:.2g}"
    )
    if not rate:
        return text
    faster = "faster here" if rate > at else "slower here, unless there are more processes"
    return f"{text}: at {rate:.3g} LAMMPS is {faster}"
