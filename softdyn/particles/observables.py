"""What is measured on a run of many particles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def relative_viscosity(result: ParticleResult) -> Array:
    """Viscosity relative to the fluid's, at each frame: 1 + sigma_xy/(eta shear_rate), the particles' part added.

    In two dimensions the spheres are a layer one unit of length deep.

    Raises
    ------
    ValueError
        If the run has no shear flow, or no periodic box to take a stress of.
    """
    rate = float(result.arrays["shear_rate"])
    if not rate or not np.isfinite(result.box).all():
        raise ValueError("a relative viscosity needs a shear flow in a periodic box")
    eta = float(result.parameters["eta"])
    return 1 + result.stress[:, 0, 1] / (eta * rate)


def normal_stress_differences(result: ParticleResult) -> tuple[Array, Array]:
    """N1 = sigma_xx - sigma_yy and N2 = sigma_yy - sigma_zz at each frame, stresses > 0 in tension; N2 = 0 in two."""
    stress = result.stress
    second = stress[:, 1, 1] - stress[:, 2, 2] if stress.shape[1] == 3 else np.zeros(len(result))
    return stress[:, 0, 0] - stress[:, 1, 1], second


def coordination(result: ParticleResult) -> Array:
    """Mean number of pressed contacts of a particle at each frame: those with F > 0; walls count once."""
    count = result.x.shape[1]
    numbers = np.empty(len(result))
    for frame in range(len(result)):
        contacts = result.contacts(frame)
        pressed = contacts["F"] > 0
        numbers[frame] = (np.sum(pressed) + np.sum(pressed & (contacts["j"] < count))) / count
    return numbers
