"""What is measured on a run of many particles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def is_sheared(result: ParticleResult) -> bool:
    """Whether there is a shear flow."""
    return bool(result.x.shape[2] > 1 and result.gradient[:, 0, 1].any())


def strain(result: ParticleResult) -> Array:
    """Shear strain of the background flow at each frame: the integral of its rate."""
    if np.isfinite(result.box[1]):
        lean: Array = result.cell[:, 0, 1] / result.cell[:, 1, 1]
        return lean
    rate: Array = result.gradient[:, 0, 1] * result.t
    return rate


def relative_viscosity(result: ParticleResult) -> Array:
    """Viscosity relative to the fluid's, at each frame: 1 + sigma_xy/(eta shear_rate), the particles' part added.

    The symmetric part of the stress is taken, which does the work: where drag resists rotations, there is another. In
    two dimensions the spheres are a layer one unit of length deep. What each sphere does to the flow by itself,
    Einstein's 5/2 of the volume fraction, is not in it. Where nothing shears, as at the start under an
    imposed stress, it is nan.

    Raises
    ------
    ValueError
        If the run has no shear flow, or no periodic box to take a stress of.
    """
    if not is_sheared(result) or not np.isfinite(result.box).all():
        raise ValueError("a relative viscosity needs a shear flow in a periodic box")
    viscous = float(result.parameters["eta"]) * result.gradient[:, 0, 1]
    shear = (result.stress[:, 0, 1] + result.stress[:, 1, 0]) / 2
    return 1 + np.divide(shear, viscous, out=np.full(len(result), np.nan), where=viscous != 0)


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


def swap_time(result: ParticleResult, parting: tuple[int, int], meeting: tuple[int, int]) -> float:
    """Time at which the gap of one pair grows beyond that of another: the middle of a T1 process.

    Between frames, the logarithm of the ratio of both gaps is taken as linear; pairs that are not in contact are
    infinitely far apart.

    Parameters
    ----------
    result : ParticleResult
    parting, meeting : pair of int
        Numbers of the particles, the smaller first.

    Returns
    -------
    float
        nan if it does not happen within the run.
    """
    ratios = np.empty(len(result))
    for frame in range(len(result)):
        contacts = result.contacts(frame)
        gaps = [
            float(np.min(contacts["h"][(contacts["i"] == i) & (contacts["j"] == j)], initial=np.inf))
            for i, j in (parting, meeting)
        ]
        ratios[frame] = np.log(gaps[0]) - np.log(gaps[1]) if np.isfinite(gaps).any() else np.nan
    over = np.flatnonzero((ratios[1:] >= 0) & (ratios[:-1] < 0))
    if not len(over):
        return float("nan")
    k = int(over[0])
    before, after = ratios[k], ratios[k + 1]
    fraction = before / (before - after) if np.isfinite([before, after]).all() else 0.5
    return float(result.t[k] + fraction * (result.t[k + 1] - result.t[k]))
