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

from softdyn.particles.driven import Driven
from softdyn.particles.force_balance import Balance, held_torque
from softdyn.particles.geometry import Contacts, crossing
from softdyn.particles.system import System, opening_rates, turns_freely

Array = NDArray[np.float64]


#: The rate of the stored energy, beside ``system.works``.
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
    own : mapping from str to array
        Rates of what mechanisms integrate.
    """

    t: float
    v: Array
    h: Array
    r: Array
    own: Mapping[str, Array]


def powers(system: System, contacts: Contacts, at: Balance, t: float, rates: Mapping[str, Array]) -> dict[str, float]:
    """Power of each kind of ``system.works``, and of elastic energy, at one stage.

    Parameters
    ----------
    system : System
    contacts : Contacts
    at : Balance
        Of the stage.
    t : float
    rates : mapping from str to array
        Of positions ``x``, shape (N, w), of films ``y``, shape (contacts,), and of what mechanisms integrate.
    """
    v = rates["x"]
    r_rate = opening_rates(system, contacts, t, v, at.n)
    if system.kernel.contact == "film":  # y = sinh(ln(h/g)): dy = cosh(ln(h/g)) dh/h
        h_rate = at.h * rates["y"] / np.sqrt(1 + at.y**2)
    else:
        h_rate = np.where(at.h > 0, r_rate, 0.0)
    moving = Rates(t, v, h_rate, r_rate, rates)
    found = dict.fromkeys((*system.works, ELASTIC), 0.0)
    for mechanism in system.having["powers"]:
        for name, power in mechanism.powers(system, contacts, at, moving).items():
            found[name] += power
    return {**found, CARRIED: float(np.sum(system.resistance * v**2))}


def power_of(system: System, load: Driven, at: Balance, rates: Rates) -> float:
    """Power of external forces.

    Parameters
    ----------
    system : System
    load : Driven
        The forces, and torques over radii, shape (N, w).
    at : Balance
    rates : Rates
    """
    force = load(rates.t)
    if turns_freely(system):  # what would turn all particles together is taken away
        force = force - held_torque(at.x[:, : system.dimension], system.radii, force)
    return float(np.sum(force * rates.v))


def forces_at(at: Balance, which: NDArray[np.int64]) -> Array:
    """Forces of some contacts, from i to j, shape (those, d)."""
    pushed = at.F[which, None] * at.n[which]
    return pushed if at.T is None else pushed + at.T[which]


def power_of_box(system: System, contacts: Contacts, at: Balance, gradient: Array) -> float:
    """Power of what moves the images of the particles with a velocity gradient of the box.

    Parameters
    ----------
    system : System
    contacts : Contacts
    at : Balance
    gradient : array, shape (d, d)
        Velocity gradient, 1/time.
    """
    across = crossing(contacts.shift)
    velocities = contacts.shift[across] @ (gradient @ system.box.cell).T
    return -float(np.sum(np.sum(forces_at(at, across) * velocities, axis=1)))


def net_power(system: System, powers: Mapping[str, float]) -> float:
    """What of the power is left for elastic energy: what is given less what is taken."""
    given = system.given
    return sum(powers[name] for name in given) - sum(
        power for name, power in powers.items() if name not in (*given, ELASTIC, CARRIED)
    )
