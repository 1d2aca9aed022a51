"""A jump of the forces on particles that nothing resists, where surfaces stick.

Positions move at once to another elastic equilibrium, at the gaps as they are. Tangential forces are then not those of
the new place alone: surfaces have sheared on the way there, each bit with the stiffness that it had where it was. The
way is that of a ramp within an instant, in which nothing slides, and nothing rolls: films resist both. Its steps are
those of :mod:`softdyn.particles.method`, and so is their error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.driven import constant
from softdyn.particles.force_balance import Balance, Newton, StageInput, StepFailed, balance, largest, with_torques
from softdyn.particles.force_balance import contact_forces as sum_of
from softdyn.particles.geometry import Contacts, curvatures, directions, lattice
from softdyn.particles.mechanisms import sliding
from softdyn.particles.method import ERROR, GAMMA, NODES, ORDER, STAGES
from softdyn.particles.step import error_of
from softdyn.particles.system import System

Array = NDArray[np.float64]

#: Of the ramp: its first step; and the shortest.
FIRST, SHORTEST = 0.25, 1e-6
#: Times that a stage is solved for, each with some thousandth of what rolled before: then only rounding does.
MOST_ROLLS = 10
#: Error of a step of the ramp, relative to that of a step in time: all together are to have no more than one of these.
SHARE = 0.1
#: Of the step that the error allows; and by how much steps grow at most.
SAFETY, LARGEST_GROWTH = 0.8, 3.0


@dataclass(frozen=True)
class Ramp:
    """A ramp: its time, the forces before it and their jump, and where particles are before it."""

    t: float
    before: Array
    jump: Array
    x: Array

    def force(self, part: float) -> Array:
        """Forces at a part of it; slow at both ends, where a contact may have no force yet."""
        return self.before + part**2 * (3 - 2 * part) * self.jump

    def spent(self, part: float, x: Array) -> float:
        """Rate of [F x] - W there: the change of the forces times the way of the particles."""
        return 6 * part * (1 - part) * float(np.sum(self.jump * (x - self.x)))


@dataclass(frozen=True)
class Part:
    """A part of the ramp: what is found at its end, positions and rotations, contacts, what stands for their moments.

    ``spent`` is the integral of :meth:`Ramp.spent`; ``error`` the worse of its and of that of tangential forces.
    """

    end: Balance
    x: Array
    contacts: Contacts
    rolled: Array | float
    spent: float
    error: float


def holding(system: System, contacts: Contacts, x: Array, t: float) -> Array:
    """Forces that hold particles where they are, with the contacts as they are, shape (N, d + rotations).

    Parameters
    ----------
    system : System
    contacts : Contacts
    x : array, shape (N, d)
    t : float
    """
    cell, nothing, count = lattice(system.box, t), np.zeros(len(contacts)), len(x)
    (films,) = system.having["solve"]
    n, r, _, F, _, values = films.solve(system, contacts, x, cell, StageInput(t, 0.0, x, nothing), nothing.copy())
    force = with_torques(system, sum_of(contacts, F, n, count))
    known, still = sliding.starting(contacts, system.radii, n, contacts.T), np.zeros(force.shape)
    images, curvature = np.zeros(contacts.T.shape), curvatures(contacts, r, count)
    slid = sliding.slide(known, contacts, values, n, r, curvature, still, images, 0.0)
    return force + sliding.reactions(contacts, known, slid, n, count)


def ramped(
    system: System, newton: Newton, contacts: Contacts, x: Array, t: float, before: Array, after: Array
) -> tuple[Balance, float]:
    """Elastic equilibrium behind a ramp of the forces within an instant; and their work.

    Parameters
    ----------
    contacts : Contacts
        At its start.
    x : array, shape (N, d)
    before, after : array, shape (N, d + rotations)
        Forces, which balance at the start.

    Raises
    ------
    StepFailed, softdyn.particles.linear.Indefinite
        If there is no equilibrium on the way.
    """
    place = with_torques(system, x)
    ramp = Ramp(t, before, after - before, place)
    done, ahead, spent = 0.0, FIRST, 0.0
    rolled: Array | float = 0.0
    while True:
        end = 1.0 if done + 1.01 * ahead > 1.0 else done + ahead
        try:
            part = _part(system, newton, contacts, place, ramp, (done, end), rolled)
            error = part.error
        except (StepFailed, linear.Indefinite):
            newton.forget()
            if 0.5 * (end - done) < SHORTEST:
                raise
            error = math.inf
        if error <= 1.0:
            contacts, place, rolled, done = part.contacts, part.x, part.rolled, end
            spent += part.spent
            if done == 1.0:
                return part.end, float(np.sum(after * (place - ramp.x))) - spent
        growth = SAFETY * max(error, 1e-12) ** (-1 / ORDER) if math.isfinite(error) else 0.5
        ahead *= min(LARGEST_GROWTH, max(0.2, growth))
        if ahead < SHORTEST:
            raise StepFailed(f"forces that jump cannot be followed to the tolerance rtol={system.rtol:g}")


def _part(
    system: System,
    newton: Newton,
    contacts: Contacts,
    place: Array,
    ramp: Ramp,
    ends: tuple[float, float],
    rolled: Array | float,
) -> Part:
    """One step of the ramp; rates are by its parameter."""
    start, width = ends[0], ends[1] - ends[0]
    x = place[:, : system.dimension]
    turned = place - with_torques(system, x)  # in a step rotations count from its start
    normal, _ = directions(contacts, x, lattice(system.box, ramp.t), system.walls)
    begun = sliding.starting(contacts, system.radii, normal, contacts.T)
    s, nothing = GAMMA * width, np.zeros(len(contacts))
    zeros = np.zeros_like(place), np.zeros_like(contacts.T), nothing, np.zeros_like(contacts.T)
    rates: list[tuple[Array, ...]] = []
    spent: list[float] = []
    guess = zeros[0]

    def summed(weights: Array, which: int) -> Array:
        return np.asarray(width * sum((w * rate[which] for w, rate in zip(weights, rates, strict=False)), zeros[which]))

    for row, node in zip(STAGES, start + NODES * width, strict=True):
        x_star, angle = place - turned + summed(row, 0), summed(row, 2)
        own = {"T": contacts.T + summed(row, 1), "angle": angle}
        given = StageInput(ramp.t, 0.0, x_star, nothing, own, {"sliding": replace(begun, rolled=rolled)})
        here = replace(system, force=constant(ramp.force(node)))
        found = _blocked(here, newton, contacts, given, x_star + s * guess)
        slid, known = found.notes["sliding"], sliding.known_of(given)
        rolled = sliding.resisted(slid.roll, found.n)
        slip = sliding.turned_back(known, slid.slip, found.n, slid.angle)
        moved = found.x - x_star, slid.turned - known.force, slid.angle - angle, slip
        rates.append(tuple(change / s for change in moved))
        guess = rates[-1][0]
        spent.append(ramp.spent(node, found.x + turned))
    errors = {"x": zeros[0], "y": nothing, "T": summed(ERROR, 1), "slip": summed(ERROR, 3)}
    error = error_of(system, found, errors) if errors["T"].any() else 0.0
    there = found.x + turned
    size = float(np.abs(ramp.jump * (there - ramp.x)).sum())
    if size > 0:
        error = max(error, width * abs(float(ERROR @ spent)) / (system.rtol * size))
    after = replace(contacts, h=found.h, T=slid.force)
    return Part(found, there, after, rolled, width * float(STAGES[-1] @ spent), error / SHARE)


def _blocked(system: System, newton: Newton, contacts: Contacts, given: StageInput, guess: Array) -> Balance:
    """A stage in which nothing rolls: solved for anew with the moments that it took, until these are what they were."""
    for _ in range(MOST_ROLLS):
        found = balance(system, contacts, newton, given, guess, np.zeros(len(contacts)))
        known, slid = sliding.known_of(given), found.notes["sliding"]
        rolled = sliding.resisted(slid.roll, found.n)
        sheared = largest((found.values["stiff"] * known.radii[0])[:, None] * (rolled - known.rolled))
        sizes = largest(system.force(given.t)), largest(found.F), largest(slid.force)
        if sheared <= system.force_tolerance * max(sizes):
            break
        guess, given = found.x, replace(given, begun={"sliding": replace(known, rolled=rolled)})
    return found
