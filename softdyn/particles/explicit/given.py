"""What is given of grains as functions of time: forces, torques, velocities; and walls and box, at the ends of steps.

Particles of which the same is given are one group: a step looks up what its group has, and computes nothing of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.expression import values as expression_values

if TYPE_CHECKING:
    from softdyn.particles.driven import Term
    from softdyn.particles.system import PreparedScene
    from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Groups:
    """Groups of particles of which the same is given; of the first nothing is.

    Attributes
    ----------
    of : array of int, shape (N,)
        The group of each particle.
    free : array, shape (groups, width)
        1 where a coordinate follows from forces, 0 where it is given.
    forces, velocities : sequences of (group, column, TimeFunction)
    """

    of: NDArray[np.int32]
    free: Array
    forces: Sequence[tuple[int, int, TimeFunction]]
    velocities: Sequence[tuple[int, int, TimeFunction]]

    @property
    def shape(self) -> tuple[int, int]:
        """How many, and coordinates of a particle."""
        return self.free.shape[0], self.free.shape[1]


def groups_of(system: PreparedScene) -> Groups:
    """Groups of the particles of a scene."""
    terms: list[Term] = [*system.force.terms, *system.velocity.terms]
    count, width = system.fixed.shape
    flags = np.zeros((count, len(terms) + width), dtype=bool)
    for k, (those, _, _) in enumerate(terms):
        flags[those, k] = True
    flags[:, len(terms) :] = system.fixed
    plain = np.zeros((1, flags.shape[1]), dtype=bool)
    kinds, of = np.unique(np.concatenate([plain, flags]), axis=0, return_inverse=True)
    of = np.asarray(of).reshape(-1)
    # of the first group nothing is given: nothing sorts before it
    assert of[0] == 0
    free = 1.0 - kinds[:, len(terms) :]
    first = len(system.force.terms)

    def found(numbers: range) -> list[tuple[int, int, TimeFunction]]:
        return [(int(group), terms[k][1], terms[k][2]) for k in numbers for group in np.flatnonzero(kinds[:, k])]

    return Groups(of[1:].astype(np.int32), free, found(range(first)), found(range(first, len(terms))))


@dataclass(frozen=True)
class Given:
    """What is given over some steps, at the ends of each: row 0 is their start.

    Attributes
    ----------
    force, end : array, shape (steps + 1, groups, width)
        Forces, and velocities of given coordinates.
    moved : array, shape (steps, groups, width)
        Mean velocities of given coordinates.
    walls : array, shape (steps + 1, walls, d)
    tilt : array, shape (steps + 1,)
    """

    force: Array
    end: Array
    moved: Array
    walls: Array
    tilt: Array


def given_over(system: PreparedScene, groups: Groups, times: Array, tilts: Array) -> Given:
    """Tables of what is given at some times; at the first of them what is behind a jump.

    Parameters
    ----------
    system : PreparedScene
    groups : Groups
        Of particles for which the same is given.
    times : array, shape (steps + 1,)
        Increasing.
    tilts : array, shape (steps + 1,)
        How far the top of the box is displaced along x at these times, a length, never wrapped.
    """
    steps = len(times) - 1
    force, end = np.zeros((steps + 1, *groups.shape)), np.zeros((steps + 1, *groups.shape))
    moved = np.zeros((steps, *groups.shape))
    dt = np.diff(times)
    for group, column, function in groups.forces:
        force[:, group, column] += _values(function, times)
    for group, column, function in groups.velocities:
        end[:, group, column] += _values(function, times)
        moved[:, group, column] += np.diff(_integrals(function, times)) / dt
    d = system.dimension
    walls = np.empty((steps + 1, len(system.walls0), d))
    walls[:] = system.walls0
    if system.wall_velocity is not None:
        for those, column, function in system.wall_velocity.terms:
            walls[:, those, column] += _integrals(function, times)[:, None]
    return Given(force, end, moved, walls, tilts)


def _values(function: TimeFunction, times: Array) -> Array:
    if function.constant:
        return np.full(len(times), function.number)
    if function.expression is not None and len(times) > 2:  # no stretch has a jump within
        inner = expression_values(function.expression.shape, times[1:-1], function.expression.constants)
        return np.array([function.after(float(times[0])), *inner, function(float(times[-1]))])
    return np.array([function.after(float(times[0])), *(function(float(t)) for t in times[1:])])


def _integrals(function: TimeFunction, times: Array) -> Array:
    if function.constant:
        return np.asarray(function.number * times)
    return np.array([function.integral(float(t)) for t in times])
