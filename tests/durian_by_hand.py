"""The bubble model in numpy alone, all pairs, by Heun's steps, which the engine is held against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def stress_by_hand(
    x: Array, radii: Array, side: float, rate: float, strain: float, dt: float, depth: float, tilt: float = 0.0
) -> tuple[Array, Array]:
    """Strains, and shear stresses of the springs, of bubbles in a periodic square that is sheared along x.

    F = R_i + R_j - r where bubbles overlap, v_i = rate y_i + sum of the forces, in units of the spring and the drag.

    Parameters
    ----------
    x : array, shape (N, 2)
    radii : array, shape (N,)
    side : float
        Of the box.
    rate, strain, dt : float
        Shear rate, strain at the end, and time step.
    depth : float
        Of the layer, by which the stress is divided.
    tilt : float
        Of the box at the start.
    """
    x, lean = x.copy(), tilt
    sums = radii[:, None] + radii

    def forces(x: Array, lean: float) -> tuple[Array, float]:
        apart = x[None] - x[:, None]
        across = np.round(apart[..., 1] / side)
        apart[..., 0] -= across * lean
        apart[..., 1] -= across * side
        apart[..., 0] -= side * np.round(apart[..., 0] / side)
        r = np.sqrt((apart**2).sum(axis=2))
        np.fill_diagonal(r, np.inf)
        push = np.maximum(sums - r, 0.0) / r
        shear = -float((push * apart[..., 0] * apart[..., 1]).sum()) / 2
        return -(push[..., None] * apart).sum(axis=1), shear / (side**2 * depth)

    steps = round(strain / (rate * dt))
    strains, stresses = np.empty(steps), np.empty(steps)
    for k in range(steps):
        push, stresses[k] = forces(x, lean)
        strains[k] = k * rate * dt
        v = push + np.stack([rate * x[:, 1], np.zeros(len(x))], axis=1)
        moved, ahead = x + dt * v, lean + rate * dt * side
        push, _ = forces(moved, ahead)
        w = push + np.stack([rate * moved[:, 1], np.zeros(len(x))], axis=1)
        x, lean = x + dt * (v + w) / 2, ahead
    return strains, stresses
