"""How long a step may be for its stages to see all that is given as a function of time.

A step knows an expression by its values at three stages: what else it does, a pulse between them or a fast oscillation,
the step misses. What is missed of an expression f, at most the integral of |f - p| with the parabola p through these
values, is bounded (:meth:`softdyn.particles.time_functions.TimeFunction.missed`) before the step is tried. Of a force
it is an impulse J, which moves a gap by J/(zeta h) relative to it and a particle by J/Z. Of a velocity it is a length
l, which changes a gap by l/h, but where the contact is stiffer than its film is fast, by the part C dt/zeta of that. Of
a shear rate it is a strain, and of a stress the strain for which the fluid's viscosity lets it through. A step is
shortened until none of it exceeds the error that is allowed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import directions, lattice
from softdyn.particles.state import State
from softdyn.particles.step import weight
from softdyn.particles.system import PreparedScene, System, contact_state

Array = NDArray[np.float64]

#: A step is not made shorter than this part of the run for what has no bound; then the run warns.
SHORTEST = 1e-12
#: What the bound grows with near its end: the power of the step's length.
POWER = 4
#: Of what is allowed, and the shortest that a trial makes of a step.
AIM, LEAST = 0.8, 0.2


@dataclass(frozen=True)
class Sensitivity:
    """Errors, in units of what is allowed, that a unit of what is missed makes.

    Attributes
    ----------
    force : array, shape (N,)
        Of an impulse on each particle.
    lengths : tuple of array
        Of a displacement, for each contact: in all, and per unit of a step's length.
    length, strain : float
        Of a displacement, and of a strain of the box, whatever the contacts.
    diameter : float
        Of the largest particle.
    """

    force: Array
    lengths: tuple[Array, Array]
    length: float
    strain: float
    diameter: float

    def of_length(self, dt: float) -> float:
        """Of a displacement within a step."""
        return max(self.length, _norm(np.minimum(self.lengths[0], self.lengths[1] * dt)))

    def of_strain(self, dt: float) -> float:
        """Of a strain of the box within a step."""
        return max(self.strain, self.diameter * self.of_length(dt))


def _norm(errors: Array) -> float:
    """Root of the mean square, and a tenth of the largest, as of the errors of a step."""
    if not len(errors):
        return 0.0
    return max(float(np.sqrt(np.mean(errors**2))), float(errors.max()) / 10)


def sensitivity(system: System, state: State) -> Sensitivity:
    """Sensitivity of a state."""
    contacts, d = state.contacts, system.dimension
    near = contacts.h < system.reach
    _, r = directions(contacts, state.x, lattice(system.box, state.t), system.walls)
    values = contact_state(system, contacts, contacts.S - r, contacts.h)
    w, h = weight(contacts.h, system.reach)[near], contacts.h[near]
    with np.errstate(divide="ignore", invalid="ignore"):
        zeta = values["friction"][near] / w  # without what fades of it
        gaps = [w / (zeta * h), w / h, w / h * values["C"][near] / values["friction"][near]]
    gaps = [np.where(np.isfinite(values), values, 0.0) / system.rtol for values in gaps]
    force = np.full(len(state.x), _norm(gaps[0]))
    strain = 1 / system.rtol
    if system.dragged:
        with np.errstate(divide="ignore"):
            drag = system.resistance[:, 0]
            alone = np.where(drag > 0, 1 / (drag * system.radii * system.rtol), 0.0)
        force = np.maximum(force, alone)
        if d > 1:
            strain *= max(1.0, float((np.abs(state.x[:, 1]) / system.radii).max()))
    for mechanism in system.having["per_impulse"]:
        own = mechanism.per_impulse(system)
        force = force if own is None else np.maximum(force, own)
    return Sensitivity(
        force, (gaps[1], gaps[2]), 1 / (float(system.radii.min()) * system.rtol), strain, 2 * float(system.radii.max())
    )


def breaks(system: PreparedScene) -> Array:
    """Times at which any of it has a kink or a jump, in order."""
    return np.unique(np.concatenate([np.empty(0), *(function.breaks for function in system.functions)]))


def missed(system: System, to: Sensitivity, t: float, dt: float) -> tuple[float, str]:
    """Largest error, in units of what is allowed, that what a step misses may make; and of which function.

    Parameters
    ----------
    system : System
    to : Sensitivity
    t, dt : float
        Start and length of the step.
    """
    found = [(0.0, "")]
    for mechanism in system.having["driven"]:
        for function, factor in mechanism.driven():
            bound = function.missed(t, dt)
            found.append((bound * factor(to, dt) if bound else 0.0, function.name))
    return max(found)


def resolved(system: System, state: State, dt: float, shortest: float) -> tuple[float, str]:
    """Length of a step, at most dt, whose stages see all that is given; and what they may miss in the shortest.

    Parameters
    ----------
    system : System
    state : State
    dt : float
        A length of the step.
    shortest : float
        The least that it may be.
    """
    if all(function.expression is None for function in system.functions):
        return dt, ""
    to = sensitivity(system, state)
    while True:
        error, name = missed(system, to, state.t, dt)
        if error <= 1.0:
            return dt, ""
        if dt <= shortest:
            return dt, name
        shorter = AIM * error ** (-1 / POWER) if math.isfinite(error) else LEAST
        dt = max(dt * max(LEAST, shorter), shortest)
