"""What a run of rigid grains has, and what changes during it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.contact_dynamics.impulses import Effort
from softdyn.particles.contact_dynamics.rigid_kernel import RigidKernel
from softdyn.particles.driven import Driven
from softdyn.particles.geometry import Box, Contacts, Wall
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.neighbours import Listed
from softdyn.particles.results import Frame
from softdyn.particles.system import PreparedScene
from softdyn.results.frame_file import FrameFile

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Collisions(Mechanism):
    """What rigid contacts take of the energy: normal impulses, and friction; and steps, which forces act at the end of.

    A force acts over a displacement dt v', v' the velocity at the end of the step, and changes the kinetic energy by
    that over dt (v + v')/2: the difference is ``steps``, which vanishes in proportion to dt.
    """

    takes = ("collisions", "friction", "steps")


@dataclass(frozen=True)
class RigidSystem(PreparedScene):
    """A scene of rigid grains, ready to run.

    Attributes
    ----------
    kernel : RigidKernel
    masses : array, shape (N, width)
        Masses, and moments of inertia over R^2: of all velocities of a grain.
    free : array, shape (N + walls, width)
        1 for velocities that follow from forces, 0 for those that are given.
    loads : mapping from str to Driven
        External forces, by the kind of energy that they give.
    mu, restitution : float
    dt : float
        Longest step.
    """

    kernel: RigidKernel
    masses: Array
    free: Array
    loads: Mapping[str, Driven]
    mu: float
    restitution: float
    dt: float


@dataclass
class RigidState:
    """Everything that changes during a run; it is all that a checkpoint holds.

    Attributes
    ----------
    t : float
    began, goal : float
        Ends of the stretch of equal steps that it is in.
    step, steps : int
        How many of them are made, and are to be made.
    x : array, shape (N, d)
    v : array, shape (N, width)
        Velocities, and radius times angular velocity.
    contacts : Contacts
        Pairs that are listed.
    impulses : array, shape (contacts, d)
        Of the last step, on the second of each.
    last_dt : float
        Length of the last step.
    normals, distances : arrays, shape (contacts, d) and (contacts,)
        As they were at the start of the last step.
    listed : Listed
    box : Box
    walls : tuple of Wall
    work : dict
        Energies exchanged since the start.
    effort : Effort
    counts : dict
    history : list of tuple
        For each step: time, length, residual, error, contacts that are pressed.
    frames : list of Frame, or FrameFile
    """

    t: float
    began: float
    goal: float
    step: int
    steps: int
    x: Array
    v: Array
    contacts: Contacts
    impulses: Array
    last_dt: float
    normals: Array
    distances: Array
    listed: Listed
    box: Box
    walls: tuple[Wall, ...]
    work: dict[str, float]
    effort: Effort = field(default_factory=Effort)
    counts: dict[str, int] = field(default_factory=dict)
    history: list[tuple[float, float, float, float, int]] = field(default_factory=list)
    frames: list[Frame] | FrameFile[Frame] = field(default_factory=list)
