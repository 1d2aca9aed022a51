"""What changes during a run of many particles."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.equilibrium import velocities
from softdyn.particles.geometry import Box, Contacts, Wall, directions, lattice
from softdyn.particles.neighbours import Listed
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.pulled_films import Pulled
from softdyn.particles.results import Frame, frame_of
from softdyn.particles.step import Output
from softdyn.particles.system import System
from softdyn.results.frame_file import FrameFile

Array = NDArray[np.float64]

#: A step is longer than the one before by this factor at most.
LARGEST_GROWTH = 3.0


@dataclass
class State:
    """Everything that changes during a run; it is all that a checkpoint holds.

    Attributes
    ----------
    t, dt : float
        Time, and the step to try next.
    grow, recovery : float
        By how much a step may be longer than the one before; and by how much that limit grows in turn, after a step
        that could not be solved for.
    x : array, shape (N, d)
    v : array, shape (N, d + rotations)
        Velocities, and with tangential motion radius times angular velocity.
    y_rate : array, shape (contacts,)
        Guess of dy/dt for the next step.
    contacts : Contacts
    listed : Listed
    box : Box
    walls : tuple of Wall
    work : dict
        Energies exchanged since the start.
    power : dict or None
        Their rates, if v and y_rate are the rates at t, and not only guesses of them.
    work_error : float
        Estimated error of all of them together.
    unseen : dict
        Names of what is given as a function of time and could not be bounded, and the time of the first.
    settled : float
        Largest deflection of a contact of an earlier run, at the start: by so much the positions have relaxed.
    turned : float
        Largest torque of external forces that was taken away, relative to what it could be.
    stored0 : float
        Elastic energy at the start.
    counts : dict
    pulled : Pulled
        What the steps have had of pulled films.
    history : list of tuple
        For each step: time, length, residual, error, contacts within their range.
    frames : list of Frame, or FrameFile
    kept : dict
        Numbers of the particles that mechanisms integrate, by their names.
    marks : dict
        Numbers that mechanisms have noted, the arrays that they have.
    """

    t: float
    dt: float
    x: Array
    v: Array
    y_rate: Array
    contacts: Contacts
    listed: Listed
    box: Box
    walls: tuple[Wall, ...]
    work: dict[str, float]
    power: dict[str, float] | None = None
    work_error: float = 0.0
    grow: float = LARGEST_GROWTH
    recovery: float = math.inf
    unseen: dict[str, float] = field(default_factory=dict)
    settled: float = 0.0
    turned: float = 0.0
    stored0: float = 0.0
    counts: dict[str, int] = field(default_factory=dict)
    pulled: Pulled = field(default_factory=Pulled)
    history: list[tuple[float, float, float, float, int]] = field(default_factory=list)
    frames: list[Frame] | FrameFile[Frame] = field(default_factory=list)
    kept: dict[str, Array] = field(default_factory=dict)
    marks: dict[str, Array] = field(default_factory=dict)


def overlaps(system: System, state: State) -> Array:
    _, r = directions(state.contacts, state.x, lattice(system.box, state.t), system.walls)
    return state.contacts.S - r


def stored_energy(system: System, state: State) -> float:
    contacts, cell = state.contacts, lattice(system.box, state.t)

    def of(part: slice) -> float:
        some = portion(contacts, part)
        _, r = directions(some, state.x, cell, system.walls)
        overlap = some.S - r
        central = sum(one.central_energy(system, some, state.t, r) for one in system.having["central_energy"])
        return central + sum(mechanism.stored(system, some, overlap) for mechanism in system.having["stored"])

    return sum(in_portions(of, len(contacts)))


def free_positions(system: System) -> NDArray[np.bool_]:
    """Positions that follow from forces, shape (N, d)."""
    return np.asarray(~system.fixed[:, : system.dimension])


def present(system: System, state: State) -> System:
    """With the box and the walls as they are now."""
    return replace(system, box=state.box, walls=state.walls)


def exchanged(system: System, state: State) -> Array:
    """Energies exchanged since the start."""
    return np.array([*(state.work[name] for name in system.works), stored_energy(system, state) - state.stored0])


def frame_now(system: System, state: State) -> Frame:
    """Frame of the present state."""
    v = state.v
    if not system.dragged and system.width == system.dimension:
        # of these the rates of a step are no velocities; where there are none, the next step says why
        with suppress(linear.Indefinite):
            v = velocities(system, state.contacts, state.x, state.t)
    return frame_of(system, state.t, state.x, v, state.contacts, exchanged(system, state))


def frame_within(output: Output, state: State) -> Frame:
    """Frame of a state within the step from the present one."""
    at, d = output.at, output.system.dimension
    contacts = replace(state.contacts, h=at.h, T=state.contacts.T if at.T is None else at.T)
    work = {name: state.work[name] + amount for name, amount in output.work.items()}
    return frame_now(output.system, replace(state, t=output.t, x=at.x[:, :d], v=output.v, contacts=contacts, work=work))
