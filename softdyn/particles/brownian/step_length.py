"""How long a step may be: by the stiffness of what particles reach at a temperature.

A pair reaches distances at which its energy is within :data:`REACHED` kT of the lowest. There the slope K of its force
bounds how fast it relaxes, 2 K/Z. A step is :data:`PART` of that time at most, for all potentials and the bonds of a
particle together. The bound knows nothing of the state: the noise cannot depend on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.mechanisms.bonds import Bonds
from softdyn.particles.mechanisms.potentials import Potentials
from softdyn.particles.pair_forces import PairForce
from softdyn.particles.system import System

Array = NDArray[np.float64]

#: Energies, in kT, that pairs reach; steps over the time of relaxation; neighbours that are as near at once.
REACHED, PART, NEAR = 8.0, 0.1, 2
#: Distances that are looked at.
POINTS = 20000
#: Beyond this times rate, steps do not damp but grow: Euler's and Heun's alike.
UNSTABLE = 2.0


def longest_step(system: System, drag: Array, temperature: float) -> float:
    """Length that steps may have; inf where nothing but noise moves the particles.

    Parameters
    ----------
    drag : array, shape (N, 1)
    temperature : float
        k_B T.
    """
    rate, size = 0.0, 2 * float(system.radii.max())
    span = float(np.ptp(system.x, axis=0).max()) + 10 * size
    least = float(drag.min())
    for mechanism in system.mechanisms:
        if isinstance(mechanism, Potentials):
            for one in mechanism.every:
                rate += 2 * NEAR * _stiffest(one.force, min(one.cut, span), size, temperature) / least
        if isinstance(mechanism, Bonds):
            ends = np.concatenate([mechanism.ends_of.i, mechanism.ends_of.j])
            most = int(np.bincount(ends).max(initial=0))
            stiffest = max((_stiffest(force, span, size, temperature) for force in mechanism.forces), default=0.0)
            rate += 2 * most * stiffest / least
    return PART / rate if rate > 0 else np.inf


def _stiffest(force: PairForce, farthest: float, size: float, temperature: float) -> float:
    """Largest slope of a force where it is reached."""
    r = np.linspace(0.0, farthest, POINTS + 1)[1:]
    with np.errstate(all="ignore"):
        energy, _, slope = force(r, np.full(POINTS, size))
    there = np.isfinite(energy) & np.isfinite(slope)
    if not there.any():
        return 0.0
    reached = there & (energy <= np.min(energy[there]) + REACHED * temperature)
    return float(np.abs(slope[reached]).max())
