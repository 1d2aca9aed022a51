"""Velocities where nothing resists the particles themselves: positions are the elastic equilibrium at the gaps.

There the rates of a stage are those of the method, not of the positions, which no equation integrates. The velocities
follow from the balance of forces, differentiated as gaps, box, walls and held particles move and external forces change
(reference 20 of Rognon & Gay, arXiv 0803.1573, with its sign and tensors right: see
:mod:`softdyn.particles.velocity`)::

    sum_j [ F_r n n^T + (F/r) (1 - n n^T) ] (v_j - v_i + u) = dF_i^ext/dt - sum_j (dF/dh) (dh/dt) n ,

F_r at fixed gap, u the velocity of an image or of a wall.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.balance import Balance, Newton, contact_forces, held_torque, linearise
from softdyn.particles.geometry import Contacts, curvatures, directions, lattice
from softdyn.particles.system import System, contact_state, gauge_axes, image_velocities, turns_freely

Array = NDArray[np.float64]

#: Steps of finite differences: of a gap, relative to it, and of time, relative to the run's step.
STEP = 1e-6
#: Of the residual, where the system is too large to be factorised.
TOLERANCE = 1e-8


def velocities(system: System, contacts: Contacts, x: Array, t: float, dt: float) -> Array:
    """Velocities of particles that nothing resists, shape (N, d).

    Parameters
    ----------
    contacts : Contacts
        With their gaps.
    x : array, shape (N, d)
    t, dt : float
        Time, and length of a step, within whose ten-thousandth part external forces hardly bend.

    Raises
    ------
    softdyn.particles.linear.Indefinite
        If there is a motion that nothing resists.
    """
    count = len(x)
    n, r = directions(contacts, x, lattice(system.box, t), system.walls)
    h, overlap = contacts.h, contacts.S - r

    def force(gap: Array, more_overlap: Array) -> Array:
        return contact_state(system, contacts, overlap + more_overlap, gap)["F"]

    values = contact_state(system, contacts, overlap, h)
    gap_rate = np.where(np.isfinite(values["dh_dt"]) & (h < system.reach), values["dh_dt"], 0.0)
    small, still = STEP * h, np.zeros_like(h)
    by_gap = (force(h + small, still) - force(h - small, still)) / (2 * small)
    F_r = -(force(h, small) - force(h, -small)) / (2 * small)  # the overlap falls as r rises

    given = np.where(system.fixed, system.velocity(t), 0.0)
    walls = np.zeros((len(system.walls), x.shape[1]))
    ends = np.concatenate([given, walls])
    apart = ends[contacts.j] - ends[contacts.i] + image_velocities(system, contacts, t)
    along = np.einsum("ca,ca->c", apart, n)
    F, curvature = values["F"], curvatures(contacts, r, count)
    changed = (by_gap * gap_rate + (F_r - F * curvature) * along)[:, None] * n + (F * curvature)[:, None] * apart
    e = 1e-4 * dt if t == 0 else -1e-4 * dt  # on the side where expressions are known to have values
    external = (-3 * system.force(t) + 4 * system.force(t + e) - system.force(t + 2 * e)) / (2 * e)
    right = external - contact_forces(contacts, np.ones(len(h)), changed, count)

    if turns_freely(system):
        right -= held_torque(x, system.radii, right)
    newton, nothing = Newton(), np.zeros(len(h))
    linearise(system, contacts, newton, Balance(x, nothing, h, F, F_r, n, r, right, 0.0, 0.0), 0.0, None)
    assert newton.solver is not None
    found = linear.solve(newton.solver, np.where(system.fixed, 0.0, right), TOLERANCE) + given
    for axis in gauge_axes(system):
        found[:, axis] -= np.mean(found[:, axis])
    return found
