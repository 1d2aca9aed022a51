"""Inertia: masses and moments of inertia of the particles.

They are solid spheres, of the mass density 4/3 pi R^3 and the moment 2/5 m R^2, in two dimensions too; or, there,
discs: cylinders as deep as the layer, density pi R^2 depth and 1/2 m R^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.densities import DENSITY, densities, volumes
from softdyn.particles.force_balance import largest
from softdyn.particles.geometry import flow
from softdyn.particles.mechanisms import Action, Mechanism
from softdyn.particles.names import which
from softdyn.particles.until import run_end
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import choice

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance, StageInput
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import PreparedScene, System, ValidatedScene

Array = NDArray[np.float64]

#: Moment of inertia over m R^2 of each shape.
GYRATION = {"sphere": 0.4, "disc": 0.5}


@with_keys
@dataclass(frozen=True)
class Inertia:
    """The mass of the particles."""

    density: Annotated[
        float | Mapping[str, float],
        Key(
            "[inertia] density",
            DENSITY,
            "Density of the particles, which gives them mass and a moment of inertia.",
            "force time^2/length^4",
        ),
    ]
    shape: Annotated[
        str,
        Key(
            "[inertia] shape",
            choice("shape", tuple(GYRATION)),
            "Shape of the particles in two dimensions: solid spheres, as in three, or discs, which are as deep as the "
            "layer ([box] depth, twice the mean radius by default).",
        ),
    ] = "sphere"


@dataclass(frozen=True)
class Masses(Mechanism):
    """Masses and moments of inertia, shape (N,) each.

    An implicit step integrates the velocities beside the positions, coordinates (x, R theta) as these. At a stage x =
    x* + s v and v = v* + s dv/dt, so that dv/dt = ((x - x*)/s - v*)/s resists the positions with m/s^2. The rate that
    is kept is that of the forces, whatever Newton's iteration leaves: those of a contact cancel, and momentum is
    conserved to rounding.

    The stages do without the rate at the start of a step, and would not see a force that is there from before the first
    of them on, as that of a dashpot whose surfaces come to touch. So accelerations are kept, too: what the embedded
    method makes of them over a step, times s, is an error of the velocities, of their own order where all is smooth.
    """

    mass: Array
    moment: Array

    takes = ("kinetic",)
    moves_freely = True

    def inertia(self, system: ValidatedScene) -> Array:
        """Force over acceleration of each coordinate, shape (N, d + rotations)."""
        whole = np.repeat(self.mass[:, None], system.width, axis=1)
        whole[:, system.x.shape[1] :] = (self.moment / system.radii**2)[:, None]
        return whole

    def kept(self, system: System) -> dict[str, Array]:
        """Velocities, and radii times angular velocities."""
        v, spin = start_velocities(system, [])
        if system.scene.velocities is None:
            v = flow(system.box, system.x)
        whole = np.concatenate([v, spin * system.radii[:, None]], axis=1)
        return {"velocity": whole, "acceleration": np.zeros_like(whole)}

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action | None:
        """See :class:`Mechanism`."""
        if given.s <= 0:
            return None
        v, mass = (at.x - given.x_star) / given.s, self.inertia(system)
        force = mass * (v - given.own["velocity"]) / given.s
        return Action(force, largest(force), largest(mass) / given.s**2, notes={"inertia": v, "stage": given.s})

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array | None:
        """See :class:`Mechanism`."""
        return self.inertia(system) / given.s**2 if given.s > 0 else None

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        """Accelerations: those of the forces where these move a coordinate, and those that are given elsewhere.

        And velocities, as follows from them.
        """
        before = given.own["velocity"]
        rate = (at.notes["inertia"] - before) / given.s - np.where(system.fixed, 0.0, at.reaction) / self.inertia(
            system
        )
        v = np.where(system.fixed, at.notes["inertia"], before + given.s * rate)
        return {"velocity": rate, "acceleration": (rate - given.own["acceleration"]) / given.s, "x": v}

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        """Of the velocities, relative to the largest, or to one that takes the whole run for a radius."""
        unseen = at.notes["stage"] * np.abs(errors["acceleration"])
        wrong = np.where(system.fixed, 0.0, np.maximum(np.abs(errors["velocity"]), unseen))
        slowest = float(system.radii.min()) / run_end(system.scene)
        relative = np.linalg.norm(wrong, axis=1) / (system.rtol * max(largest(at.notes["inertia"]), slowest))
        return [float(np.sqrt(np.mean(relative**2))), float(relative.max()) / 10]

    def per_impulse(self, system: System) -> Array:
        """See :class:`Mechanism`. An impulse J changes a velocity by J/m, and until the end a place by that times t."""
        return run_end(system.scene) / (self.mass * system.radii * system.rtol)

    def unfelt(self, system: System, at: Balance, stiffness: Array) -> Array:
        """See :class:`Mechanism`. A spring k lets a force act on a mass m for (m/k)^(1/2)."""
        speed = max(largest(at.notes["inertia"]), float(system.radii.min()) / run_end(system.scene))
        return np.asarray(system.rtol * speed * np.sqrt(float(self.mass.min()) * stiffness))

    def carried(self, system: System, kept: Mapping[str, Array]) -> float:
        """The kinetic energy."""
        return float(np.sum(self.inertia(system) * kept["velocity"] ** 2)) / 2

    def flux(self, system: PreparedScene, x: Array, v: Array) -> Array:
        """See :class:`Mechanism`."""
        return momentum_flux(self.mass, x, v, system.box.gradient)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """The rate of the kinetic energy."""
        return {"kinetic": float(np.sum(self.inertia(system) * rates.own["velocity"] * rates.v))}


def momentum_flux(mass: Array, x: Array, v: Array, gradient: Array) -> Array:
    """Sum of m u u over the particles, u the velocity less that of the flow, and less the mean of what is left.

    Parameters
    ----------
    mass : array, shape (N,)
    x, v : array, shape (N, d)
        Positions, never wrapped, and velocities.
    gradient : array, shape (d, d)
        Of the velocity of the background flow.

    Returns
    -------
    array, shape (d, d)
        Over the volume of a periodic box, the part of the pressure tensor that is as that of a gas
        (Irving & Kirkwood 1950, doi:10.1063/1.1747782).
    """
    own = v - x @ gradient.T
    own = own - np.average(own, axis=0, weights=mass)
    return np.asarray(np.einsum("i,ia,ib->ab", mass, own, own))


def check(facts: ValidatedScene, faults: list[str]) -> Masses | None:
    """Inertia of a scene."""
    given, d = facts.scene.inertia, facts.x.shape[1]
    assert given is not None
    before = len(faults)
    if given.shape == "disc" and d != 2:
        faults.append(f'[inertia] shape = "disc" is for two dimensions, and there are {d}: leave it out')
    density = densities(facts, given.density, "[inertia] density", faults)
    if len(faults) == before and not density.all():
        faults.append(f"[inertia] density of {which(density == 0)} is 0: without mass there is no inertia")
    if len(faults) > before:
        return None
    with np.errstate(over="ignore", under="ignore"):
        mass = density * volumes(facts)
        moment = GYRATION[given.shape] * mass * facts.radii**2
    start_velocities(facts, faults)
    odd = ~(np.isfinite(mass) & np.isfinite(moment) & (moment > 0))
    if odd.any():
        faults.append(f"[inertia] the mass or the moment of inertia of {which(odd)} is no number: choose other units")
    return Masses(mass, moment)


def start_velocities(facts: ValidatedScene, faults: list[str]) -> tuple[Array, Array]:
    """Velocities at the start, shape (N, d), and angular ones, shape (N, rotations).

    At rest where none are given; in a box that is sheared, with the flow.
    """
    scene, (count, d) = facts.scene, facts.x.shape
    turning = facts.width - d
    found = [np.zeros((count, d)), np.zeros((count, turning))]
    for k, (name, given, columns) in enumerate((("velocities", scene.velocities, d), ("spins", scene.spins, turning))):
        if given is None:
            continue
        if not columns:
            faults.append(f"[particles] {name}: particles turn with [friction] or tangential motion, in two dimensions")
            continue
        try:
            array = np.array(given, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape == (count, columns) and np.isfinite(array).all():
            found[k] = array
        else:
            faults.append(f"[particles] {name} must be {columns} finite numbers for each of {count} particles")
    return found[0], found[1]
