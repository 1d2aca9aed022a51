"""A periodic box of rigid grains that stretches or shears as an imposed stress makes it.

Its edges are a piston without mass, which the fluid resists. In a step of the length dt the unknown rates g of the box
satisfy, with the impulses P of the contacts through its faces, and the lattice vector s by which each reaches across::

    sigma_k + 2 eta D_k = imposed_k ,     sigma_k = -(1/(V dt)) sum over contacts of P . E_k s ,

E_k and the velocity gradient G_k of a unit rate as in :mod:`softdyn.particles.mechanisms.stress`. The images at the
other side move with G s, so that a rate is one more velocity that contacts see. Sweeps take it in turn with them: after
each pair of sweeps the rates follow the impulses, by so much of the way that what the contacts answer is less than
that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.contact_dynamics.rigid_system import RigidState, RigidSystem
from softdyn.particles.geometry import Box, lattice

if TYPE_CHECKING:
    from softdyn.particles.mechanisms.stress import ImposedStress

Array = NDArray[np.float64]


@dataclass
class LooseBox:
    """Rates of a box in a step, as they are found.

    Attributes
    ----------
    base : array, shape (n, d)
        Velocities of the images that the contacts reach, without the unknown rates.
    moves : array, shape (rates, n, d)
        G_k s: what a unit of each rate adds to them.
    presses : array, shape (rates, n, d)
        E_k s/(V dt): what a unit of each impulse takes of each stress.
    resistance : array, shape (rates, rates)
        What the fluid takes of the imposed stresses, for a unit of each rate.
    wanted : array, shape (rates,)
        Imposed stresses, less what the fluid takes of them by the given rates.
    rates : array, shape (rates,)
    met : array of bool, shape (n,)
        Contacts that have been pressed, at any of the sweeps: a rate that forgot them would go in circles.
    """

    base: Array
    moves: Array
    presses: Array
    resistance: Array
    wanted: Array
    rates: Array
    met: NDArray[np.bool_]

    def some(self, rows: NDArray[np.int64]) -> LooseBox:
        """The same box, as some of the contacts see it."""
        return replace(
            self, base=self.base[rows], moves=self.moves[:, rows], presses=self.presses[:, rows], met=self.met[rows]
        )

    def drifts(self) -> Array:
        """Velocities of the images, shape (n, d)."""
        return np.asarray(self.base + np.tensordot(self.rates, self.moves, 1))

    def fastest(self) -> float:
        """How fast an image would move, if the fluid alone bore the stress."""
        free = np.abs(np.linalg.solve(self.resistance, self.wanted))
        return float(np.tensordot(free, np.abs(self.moves), 1).max(initial=0.0))

    def lacking(self, impulses: Array) -> Array:
        """By how much the imposed stresses exceed those of the contacts and of the fluid, shape (rates,)."""
        borne = self.presses.reshape(len(self.rates), -1) @ impulses.reshape(-1)
        return np.asarray(self.wanted + borne - self.resistance @ self.rates)

    def off(self, impulses: Array) -> float:
        """How far the stresses are from the imposed ones, relative to all that makes one."""
        every = np.abs(self.presses * impulses).sum(axis=(1, 2)) + np.abs(self.wanted)
        every += np.abs(self.resistance @ self.rates)
        lacking = np.abs(self.lacking(impulses))
        return float(np.max(lacking[every > 0] / every[every > 0], initial=0.0))

    def answers(self, mobilities: Array) -> Array:
        """What each contact answers to a unit of each rate, over what the fluid does, shape (rates, n).

        At most: two sweeps turn a velocity u into impulses of 2 u/w.

        Parameters
        ----------
        mobilities : array, shape (n, 2)
        """
        each = np.einsum("kca,kca->kc", self.presses, self.moves) * (2 / mobilities[:, 0])
        return np.asarray(each / np.diag(self.resistance)[:, None])

    def follow(self, impulses: Array, answers: Array) -> Array:
        """Let the rates follow the impulses; by how much they changed.

        Parameters
        ----------
        impulses : array, shape (n, d)
        answers : array, shape (rates, n)
        """
        self.met = self.met | impulses.any(axis=1)
        change = np.linalg.solve(self.resistance, self.lacking(impulses)) / (1 + answers @ self.met)
        self.rates = self.rates + change
        return np.asarray(change)


def loose_box(system: RigidSystem, state: RigidState, end: float, dt: float) -> LooseBox | None:
    """The box of a step, at the rates of the step before; None if no stress is imposed.

    Parameters
    ----------
    system : RigidSystem
    state : RigidState
    end, dt : float
        End of the step, and its length.
    """
    if system.leader is None:
        return None
    from softdyn.particles.mechanisms.stress import fluid_stress

    imposed = cast("ImposedStress", system.leader)
    E, G, eta = imposed.weights, imposed.gradients, imposed.viscosity
    rates = imposed.box_rates(state.box)
    cell = lattice(state.box, state.t)
    images = state.contacts.shift @ cell.T
    given = _ahead(system, state, end, dt, 0 * rates)
    fluid = np.einsum("kab,ab->k", E, fluid_stress(given, eta))
    resistance = np.einsum("kab,lab->kl", E, eta * (G + G.transpose(0, 2, 1)))
    return LooseBox(
        base=images @ given.gradient.T,
        moves=np.einsum("kab,cb->kca", G, images),
        presses=np.einsum("kab,cb->kca", E, images) / (state.box.volume * dt),
        resistance=resistance,
        wanted=imposed.values(end) - fluid,
        rates=rates,
        met=np.zeros(len(images), dtype=bool),
    )


def box_after(system: RigidSystem, state: RigidState, end: float, dt: float, rates: Array) -> Box:
    """The box at the end of a step, with the rates that it had.

    Parameters
    ----------
    system : RigidSystem
    state : RigidState
    end, dt : float
        End of the step, and its length.
    rates : array, shape (rates,)
        The unknown ones.
    """
    box = _ahead(system, state, end, dt, rates)
    return _at(box, lattice(box, end), end)


def _ahead(system: RigidSystem, state: RigidState, end: float, dt: float, rates: Array) -> Box:
    """The box from the start of a step on, which moves with constant rates."""
    G = np.tensordot(rates, cast("ImposedStress", system.leader).gradients, 1)
    if len(G) > 1:
        strain = sum(mechanism.strain(end) - mechanism.strain(state.t) for mechanism in system.having["strain"])
        G[0, 1] += strain / dt
    box = _at(state.box, lattice(state.box, state.t), state.t)
    return replace(box, shear_rate=float(G[0, 1]) if len(G) > 1 else 0.0, stretch=np.diag(G).copy())


def _at(box: Box, cell: Array, t: float) -> Box:
    """A box with these lattice vectors at a time."""
    return replace(box, lengths=np.diag(cell).copy(), tilt=float(cell[0, 1]) if len(cell) > 1 else 0.0, since=t)
