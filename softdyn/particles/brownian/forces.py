"""Forces on particles without contacts, and how stiff they are, at given positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.force_balance import contact_forces
from softdyn.particles.geometry import Contacts, directions, flow, lattice
from softdyn.particles.system import System, moving_images

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Forces:
    """What acts at a time.

    Attributes
    ----------
    drift : array, shape (N, d)
        Velocities without noise: the flow's, and forces over drags; of what is held, the given one.
    external, inner : array, shape (N, d)
        Forces from outside, and between the particles.
    stiffness : array, shape (N,)
        Bound of how fast a particle's force changes with the positions, over its drag: 1/time.
    box : float
        Power of the images that move with the box.
    """

    drift: Array
    external: Array
    inner: Array
    stiffness: Array
    box: float


def forces_at(system: System, contacts: Contacts, drag: Array, x: Array, t: float) -> Forces:
    """Forces at some positions; nan where a potential does not hold.

    Parameters
    ----------
    drag : array, shape (N, 1)
        Force over velocity of each particle.
    """
    count, d = x.shape
    n, r = directions(contacts, x, lattice(system.box, t), ())
    F, slope = np.zeros(len(r)), np.zeros(len(r))
    for mechanism in system.having["central"]:
        more = mechanism.central(system, contacts, t, r)
        if more is not None:
            F, slope = F + more[0], slope + more[1]
    external, inner = system.force(t), -contact_forces(contacts, F, n, count)
    with np.errstate(divide="ignore", invalid="ignore"):
        stiff = np.maximum(np.abs(slope), np.where(F == 0, 0.0, np.abs(F) / r) if d > 1 else 0.0)
    rate = np.bincount(contacts.i, stiff, count) + np.bincount(contacts.j, stiff, count)
    drift = flow(system.box, x) + (external + inner) / drag
    if system.fixed.any():
        drift = np.where(system.fixed, system.velocity(t), drift)
    rows, velocities = moving_images(system, contacts, t)
    box = -float(np.sum(F[rows, None] * n[rows] * velocities))
    # of a matrix of springs, the largest eigenvalue is twice the largest sum of a particle at most
    return Forces(drift, external, inner, 2 * rate / drag[:, 0], box)
