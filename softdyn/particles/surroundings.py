"""Where box and walls are: what surrounds the particles and moves.

The edges of a periodic box move with the velocity gradient G of the background flow u = G x, which mechanisms make, and
walls with velocities that are given. Where a mechanism leads, rates of G are unknown, and found with the balance of
forces (see :mod:`softdyn.particles.mechanisms.stress`): then the box moves by the same Runge-Kutta stages as the
particles. Walls, and a box whose shear rate is given, are where the integral of what is given says, to rounding; so are
held particles.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import lattice
from softdyn.particles.system import System

Array = NDArray[np.float64]


def coordinates(system: System, t: float) -> Array:
    """Coordinates z of all that moves: logarithms of lengths, tilt over the first length, points of walls."""
    cell = lattice(system.box, t)
    edges = np.log(np.where(system.box.periodic, np.diag(cell), 1.0))
    lean = [cell[0, 1] / cell[0, 0] if len(cell) > 1 and cell[0, 0] else 0.0]
    return np.concatenate([edges, lean, *(wall.point for wall in system.walls)])


def placed(system: System, t: float, s: float, z_star: Array, rates: Array) -> tuple[System, Array]:
    """Box and walls at the end of a stage, and dz/dt there.

    Parameters
    ----------
    t, s : float
        End of the stage, and gamma dt.
    z_star : array
        Known part of the coordinates.
    rates : array
        The unknown rates of the box, where a mechanism leads.
    """
    box, d = system.box, len(system.box.lengths)
    z_rate = np.zeros_like(z_star)
    made = (mechanism.gradient(t, rates) for mechanism in system.having["gradient"])
    G = sum((gradient for gradient in made if gradient is not None), np.zeros((d, d)))
    stretch, shear = np.diag(G).copy(), float(G[0, 1]) if d > 1 else 0.0
    z_rate[:d] = stretch
    edges = np.exp(z_star[:d] + s * stretch)
    if d > 1 and box.periodic[:2].all():
        z_rate[d] = shear * edges[1] / edges[0]
    walls = system.walls
    z = z_star + s * z_rate
    if system.lean0 is not None:
        z[d] = system.lean(t)
    if system.wall_velocity is not None:
        z_rate[d + 1 :] = system.wall_velocity(t).reshape(-1)
        z[d + 1 :] = system.wall_place(t).reshape(-1)
        walls = tuple(replace(wall, point=point) for wall, point in zip(walls, z[d + 1 :].reshape(-1, d), strict=True))
    if system.box_moves:
        tilt = float(z[d] * edges[0]) if d > 1 else 0.0
        lengths = np.where(box.periodic, edges, math.inf)
        stretching = stretch if stretch.any() else None
        box = replace(box, lengths=lengths, shear_rate=shear, tilt=tilt, since=t, stretch=stretching)
    return replace(system, box=box, walls=walls), z_rate
