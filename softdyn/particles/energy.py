"""Power of each kind at a stage, and how the balance of energy is judged.

At each stage the forces balance, so that all that is given less all that is taken is the rate at which the contacts
store elastic energy,

    sum over contacts of  F_ela (dh/dt - dr/dt) + U_h dh/dt + T . (dT/dt)/k_t - T^2 (dk_t/dt)/(2 k_t^2) ,

to what Newton's iteration leaves. This power, ``ELASTIC``, is integrated beside the others. What it differs by from all
of theirs is wrong, whatever the steps are; what its integral differs by from the energy that is stored at the end is
the error of the steps' quadrature, and says nothing of the powers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles import sliding
from softdyn.particles.balance import Balance, held_torque, pair_named
from softdyn.particles.driven import Driven
from softdyn.particles.geometry import Contacts, crossing
from softdyn.particles.kernel import energies
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.system import System, contact_state, given_works, moving_images, turns_freely, works

Array = NDArray[np.float64]


#: The rate of the stored energy, beside :func:`softdyn.particles.system.works`.
ELASTIC = "elastic"
#: What resistance would take in a fluid at rest: of particles that go with the flow, the others are rounding of this.
CARRIED = "carried"


@dataclass(frozen=True)
class Rates:
    """How everything moves at a stage.

    Attributes
    ----------
    t : float
    v : array, shape (N, d + rotations)
        Velocities, and radius times angular velocity.
    h, r : array, shape (contacts,)
        Rates of the gaps, and of the distances.
    T : array, shape (contacts, d)
        Rates of the tangential forces, in the frame of the step's start.
    """

    t: float
    v: Array
    h: Array
    r: Array
    T: Array


def powers(
    system: System, contacts: Contacts, at: Balance, t: float, v: Array, y_rate: Array, T_rate: Array
) -> dict[str, float]:
    """Power of each kind of :func:`softdyn.particles.system.works`, and of elastic energy, at one stage."""
    # y = sinh(ln(h/g)): dy = cosh(ln(h/g)) dh/h
    h_rate = at.h * y_rate / np.sqrt(1 + at.y**2)
    r_rate = np.einsum("ca,ca->c", _apart(system, contacts, t, v), at.n)
    rates = Rates(t, v, h_rate, r_rate, T_rate)
    found = dict.fromkeys(works(system), 0.0)
    for mechanism in system.mechanisms:
        for name, power in mechanism.powers(system, contacts, at, rates).items():
            found[name] += power
    more, elastic = {}, float(np.sum(at.F * (h_rate - r_rate)))
    if at.slid is not None:
        values = contact_state(system, contacts, contacts.S - at.r, at.h)
        more = tangential_powers(system, contacts, at, values, v, r_rate, h_rate)
        elastic += float(np.sum(sliding.dot(at.slid.turned, T_rate) / values["k_t"])) - more["k_t"]
        del values
    gaps, remote, U_h = _gap_powers(system, contacts, at, t, h_rate)
    return {
        **found,
        "gaps": gaps,
        "remote": remote,
        "U_h": U_h,
        **more,
        ELASTIC: elastic - U_h,
        CARRIED: float(np.sum(system.resistance * v**2)),
    }


def power_of(system: System, load: Driven, at: Balance, rates: Rates) -> float:
    """Power of external forces."""
    force = load(rates.t)
    if turns_freely(system):  # what would turn all particles together is taken away
        force = force - held_torque(at.x[:, : system.dimension], system.radii, force)
    return float(np.sum(force * rates.v))


def forces_at(at: Balance, which: NDArray[np.int64]) -> Array:
    """Forces of some contacts, from i to j, shape (those, d)."""
    pushed = at.F[which, None] * at.n[which]
    return pushed if at.slid is None else pushed + at.slid.force[which]


def power_of_box(system: System, contacts: Contacts, at: Balance, gradient: Array) -> float:
    """Power of what moves the images of the particles with a velocity gradient of the box."""
    across = crossing(contacts.shift)
    velocities = contacts.shift[across] @ (gradient @ system.box.cell).T
    return -float(np.sum(np.sum(forces_at(at, across) * velocities, axis=1)))


def _apart(system: System, contacts: Contacts, t: float, v: Array) -> Array:
    """Velocity of particle j, or of the wall, as seen from particle i, shape (contacts, d)."""
    d = system.dimension
    ends = np.concatenate([v[:, :d], np.zeros((len(system.walls), d))])
    apart = ends.take(contacts.j, axis=0)
    apart -= ends.take(contacts.i, axis=0)
    rows, velocities = moving_images(system, contacts, t)
    np.add.at(apart, rows, velocities)
    return apart


def net_power(system: System, powers: Mapping[str, float]) -> float:
    """What of the power is left for elastic energy: what is given less what is taken."""
    given = given_works(system)
    return sum(powers[name] for name in given) - sum(
        power for name, power in powers.items() if name not in (*given, ELASTIC, CARRIED)
    )


def _gap_powers(
    system: System, contacts: Contacts, at: Balance, when: float, h_rate: Array
) -> tuple[float, float, float]:
    """Power lost in the gaps, and taken by remote forces and the U_h term."""

    def of(part: slice) -> tuple[float, float, float]:
        some = portion(contacts, part)
        overlap, h, rate = some.S - at.r[part], at.h[part], h_rate[part]
        values = contact_state(system, some, overlap, h)
        beyond = np.flatnonzero(~np.isfinite(values["friction"]))
        if len(beyond):
            who = pair_named(some, int(beyond[0]), len(system.radii))
            raise IntegrationError(
                f"at t={when:.6g} the friction of {who} is beyond the largest number that there is: choose units in "
                "which sizes, moduli and viscosities are nearer to 1"
            )
        _, U_h = energies(system.kernel, system.reach, overlap, h, system.p, some.q.reshape(-1))
        lost, remote = np.sum(values["friction"] * rate**2), -np.sum(values["remote"] * rate)
        return float(lost), float(remote), -float(np.sum(U_h * rate))

    gaps, remote, taken = zip(*in_portions(of, len(h_rate)), strict=True)
    return sum(gaps), sum(remote), sum(taken)


def tangential_powers(
    system: System, contacts: Contacts, at: Balance, values: dict[str, Array], v: Array, r_rate: Array, h_rate: Array
) -> dict[str, float]:
    """Power lost in sliding and in rolling, and taken by a change of the tangential stiffness, at one stage."""
    assert at.slid is not None
    d = system.dimension
    walls = np.zeros((len(system.walls), v.shape[1]))
    one, other = (np.concatenate([v, walls])[ends] for ends in (contacts.i, contacts.j))
    square = sliding.dot(at.slid.force, at.slid.force)
    slides = values["friction_t"] > 0
    radii = np.append(system.radii, np.ones(len(walls)))
    turn = one[:, d:] / radii[contacts.i, None] - other[:, d:] / radii[contacts.j, None]
    if d == 3:
        turn = turn - sliding.dot(turn, at.n)[:, None] * at.n
    k_rate = values["k_t_h"] * h_rate + values["k_t_delta"] * (h_rate - r_rate) / 2
    return {
        "sliding": float(np.sum(square[slides] / values["friction_t"][slides])),
        "rolling": float(np.sum(values["roll"] * sliding.dot(turn, turn))),
        "k_t": float(np.sum(square * k_rate / (2 * values["k_t"] ** 2))),
    }
