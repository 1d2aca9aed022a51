"""What a run of grains has: what stays the same, and what changes from step to step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.explicit.given import Groups
from softdyn.particles.explicit.grain_kernels import GrainKernel
from softdyn.particles.results import Frame
from softdyn.particles.system import PreparedScene
from softdyn.results.frame_file import FrameFile

Array = NDArray[np.float64]
Short = NDArray[np.int32]

#: Sums over the contacts of a run: what slips, rolls and twists put into the springs of friction and into what rubs;
#: what dashpots take; what walls, pushes and holds give; what the sheared box gives; what rubs.
SUMS = ("rubbed", "dashpot", "external", "box", "heat")


@dataclass(frozen=True)
class GrainSystem(PreparedScene):
    """The facts of a scene of grains, in the order of the particles' numbers.

    Attributes
    ----------
    kernel : GrainKernel
    p, q : array
        Uniform parameters; those of each pair of kinds, shape (parameters, kinds, kinds).
    kinds : int
        Species, and behind them the walls.
    mass, moment : array, shape (N,)
    load : array, shape (N, d)
        Forces that never change: weights.
    groups : Groups
        What is given of particles as functions of time.
    wall_normal, wall_part : array, shape (walls, d) and (walls,)
        Part of an overlap that the surface of a particle gives in by: all of it at a rigid wall, half at a soft one.
    mu, rolling, twisting : float
    spun : float
        Of a tangential stiffness, what it comes to with the inertia of rotation.
    """

    kernel: GrainKernel
    p: Array
    q: Array
    kinds: int
    mass: Array
    moment: Array
    load: Array
    groups: Groups
    wall_normal: Array
    wall_part: Array
    mu: float
    rolling: float
    twisting: float
    spun: float

    @property
    def walled(self) -> int:
        """How many walls."""
        return len(self.wall_normal)


@dataclass
class Grains:
    """Everything that changes during a run, particles in the order of their cells; all that a checkpoint holds.

    Attributes
    ----------
    t : float
    order : array of int, shape (N,)
        Numbers of the particles.
    x, v : array, shape (N, d)
    spin : array, shape (N, rotations)
    rate_v : array, shape (N, d + rotations)
        Accelerations, linear and angular.
    home : array of int, shape (N, d)
        The cell of the lattice that each is in.
    listed, listed_tilt, turns : array, float, int
        Positions and tilt of the box when neighbours were last looked for, and lengths of the box taken off the tilt.
    start, partner, image : arrays of int
        Pairs near one another: those of particle i from start[i] on.
    in_start, in_at : arrays of int
        The same pairs by their second particle.
    history, touch : array (pairs, kept), array of int (pairs,)
        Tangential forces of the pairs, and whether they touch.
    wall_history, wall_touch : array (N walls, kept), array of int (N walls,)
    sums : array
        See :data:`SUMS`.
    stiffest, fastest, moved : float
        Largest sum of stiffnesses over mass, largest speed, and what part of the way that the list allows was made.
    given_force : array, shape (groups, width)
        Forces that are given, at the present time, before a jump.
    x0, kinetic0, stored0 : array, float, float
        Positions, in the order of the numbers, and energies at the start.
    counts : dict
    history_rows : list of tuple
        For each stretch of steps: time, length of a step, residual (0), what the step is of the longest that is good
        enough, contacts.
    frames : list of Frame, or FrameFile
    """

    t: float
    order: NDArray[np.int64]
    x: Array
    v: Array
    spin: Array
    rate_v: Array
    home: Short
    listed: Array
    listed_tilt: float
    turns: int
    start: Short
    partner: Short
    image: Short
    in_start: Short
    in_at: Short
    history: Array
    touch: Short
    wall_history: Array
    wall_touch: Short
    sums: Array
    stiffest: float
    fastest: float
    moved: float
    given_force: Array
    x0: Array
    kinetic0: float
    stored0: float
    counts: dict[str, int]
    history_rows: list[tuple[float, float, float, float, int]] = field(default_factory=list)
    frames: list[Frame] | FrameFile[Frame] = field(default_factory=list)


def by_number(state: Grains, values: NDArray[Any]) -> NDArray[Any]:
    """Rows in the order of the particles' numbers, from those in the order of their cells."""
    sorted_back = np.empty_like(values)
    sorted_back[state.order] = values
    return sorted_back


def tilt_at(system: PreparedScene, t: float) -> float:
    """How far the top of the periodic box is displaced along x."""
    return system.box.tilt if system.lean0 is None else system.lean(t) * float(system.box.lengths[0])


def edges(system: PreparedScene) -> Array:
    """Lengths of the box, 0 along axes that are not periodic."""
    return np.where(system.box.periodic, system.box.lengths, 0.0)
