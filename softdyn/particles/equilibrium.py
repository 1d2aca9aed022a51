"""Velocities where nothing resists the particles themselves: positions are the elastic equilibrium at the gaps.

There the rates of a stage are those of the method, not of the positions, which no equation integrates. The velocities
follow from the balance of forces, differentiated as gaps, box, walls and held particles move and external forces change
(reference 20 of Rognon & Gay, arXiv 0803.1573, with the right sign and its tensors)::

    sum_j [ F_r n n^T + (F/r) (1 - n n^T) ] (v_j - v_i + u) = dF_i^ext/dt - sum_j (dF/dh) (dh/dt) n ,

F_r at fixed gap, u the velocity of an image or of a wall.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.force_balance import Balance, Newton, StageInput, contact_forces, held_torque, linearise
from softdyn.particles.geometry import Contacts, curvatures, directions, lattice
from softdyn.particles.system import System, contact_state, gauge_axes, image_velocities, turns_freely

Array = NDArray[np.float64]

#: Of the residual, where the system is too large to be factorised.
TOLERANCE = 1e-8


def velocities(system: System, contacts: Contacts, x: Array, t: float) -> Array:
    """Velocities of particles that nothing resists, shape (N, d); nan where a force has no finite rate.

    Parameters
    ----------
    contacts : Contacts
        With their gaps.
    x : array, shape (N, d)
    t : float

    Raises
    ------
    softdyn.particles.linear.Indefinite
        If there is a motion that nothing resists.
    """
    count = len(x)
    n, r = directions(contacts, x, lattice(system.box, t), system.walls)
    h, overlap = contacts.h, contacts.S - r

    values = contact_state(system, contacts, overlap, h)
    gap_rate = np.where(np.isfinite(values["dh_dt"]) & (h < system.reach), values["dh_dt"], 0.0)
    by_gap, F_r = values["F_by_gap"], values["F_by_distance"]

    given = np.where(system.fixed, system.velocity(t), 0.0)
    walls = np.zeros((len(system.walls), x.shape[1]))
    ends = np.concatenate([given, walls])
    apart = ends[contacts.j] - ends[contacts.i] + image_velocities(system, contacts, t)
    along = np.einsum("ca,ca->c", apart, n)
    F, curvature = values["F"], curvatures(contacts, r, count)
    changed = (by_gap * gap_rate + (F_r - F * curvature) * along)[:, None] * n + (F * curvature)[:, None] * apart
    external = system.force.rate(t)
    if not np.isfinite(external).all():  # as of sqrt(t) at 0
        return np.full_like(x, np.nan)
    right = external - contact_forces(contacts, np.ones(len(h)), changed, count)

    if turns_freely(system):
        right -= held_torque(x, system.radii, right)
    newton, nothing = Newton(), np.zeros(len(h))
    still = StageInput(t, 0.0, x, nothing)
    linearise(system, contacts, newton, Balance(x, nothing, h, F, F_r, n, r, right, 0.0, 0.0), still)
    assert newton.solver is not None
    found = linear.solve(newton.solver, np.where(system.fixed, 0.0, right), TOLERANCE) + given
    for axis in gauge_axes(system):
        found[:, axis] -= np.mean(found[:, axis])
    return found
