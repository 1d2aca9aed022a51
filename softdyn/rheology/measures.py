"""What a rheologist reads off a run: each quantity as a series over its output times.

Stresses are > 0 in tension, a pressure > 0 in compression.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.observables import coordination, is_periodic, normal_stress_differences, pressure, strain
from softdyn.particles.packing import BALL
from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]

#: What each series is, for tables and pictures.
WORDS = {
    "shear_stress": "shear stress, of contacts and fluid",
    "contact_stress": "shear stress of the contacts",
    "fluid_stress": "shear stress of the fluid, eta times the shear rate",
    "pressure": "pressure of the particles",
    "N1": "first normal stress difference, xx less yy",
    "N2": "second normal stress difference, yy less zz",
    "shear_rate": "shear rate",
    "fraction": "fraction of the box that particles fill",
    "coordination": "pressed contacts of a particle",
}
#: Those that must be steady where a run is; means of the others are taken over the same times.
JUDGED = ("shear_stress", "pressure", "shear_rate", "fraction")


def fluid_viscosity(result: ParticleResult) -> float | None:
    """Viscosity of the fluid, if it has one for all particles: that of an imposed stress, or the law's eta."""
    eta = result.stats.get("viscosity", result.parameters.get("eta"))
    return None if eta is None or isinstance(eta, Mapping) else float(eta)


def series(result: ParticleResult) -> dict[str, Array]:
    """Stresses and what else is measured at each output time.

    Parameters
    ----------
    result : ParticleResult

    Returns
    -------
    dict from str to array, shape (frames,)
        Names as in ``WORDS``. Without a box that is periodic along all axes there is no stress: then the coordination
        alone. ``fluid_stress`` is there where the fluid's viscosity is known; else ``shear_stress`` is that of the
        contacts.
    """
    found: dict[str, Array] = {}
    d = result.x.shape[2]
    if is_periodic(result) and d > 1:
        found["contact_stress"] = (result.stress[:, 0, 1] + result.stress[:, 1, 0]) / 2
        eta = fluid_viscosity(result)
        rate: Array = result.gradient[:, 0, 1]
        if eta is not None:
            found["fluid_stress"] = eta * rate
        found["shear_stress"] = found["contact_stress"] + found.get("fluid_stress", 0.0)
        found["pressure"] = pressure(result)
        first, second = normal_stress_differences(result)
        found["N1"] = first
        if d == 3:
            found["N2"] = second
        found["shear_rate"] = rate
        found["fraction"] = fraction(result)
    found["coordination"] = coordination(result)
    return found


def fraction(result: ParticleResult) -> Array:
    """Fraction of the box that the particles fill at each frame: volumes, in two dimensions areas; overlaps twice."""
    d = result.x.shape[2]
    filled = BALL[d] * float(np.sum(result.radii**d))
    found: Array = filled / np.abs(np.linalg.det(result.cell))
    return found


def even_part(t: Array) -> int:
    """Output times at the beginning that are evenly spaced: all, but for a last one at the strain that ended the run.

    0 where they are not.
    """
    steps = np.diff(t)
    if not len(steps):
        return len(t)
    even = np.abs(steps - steps[0]) <= 1e-6 * steps[0]
    if even.all():
        return len(t)
    return len(t) - 1 if even[:-1].all() and len(steps) > 1 else 0


def sheared_by(result: ParticleResult) -> Array:
    """Shear strain since the start; zero in one dimension."""
    if result.x.shape[2] < 2:
        return np.zeros(len(result))
    found = strain(result)
    return found - found[0] if len(found) else found


def ratio(value: float, error: float, over: float, over_error: float) -> tuple[float, float]:
    """A ratio of two means and its error, as if these were independent; nan where it is none.

    Parameters
    ----------
    value, error : float
        Upper mean, and its error.
    over, over_error : float
        Lower mean, and its error.
    """
    if not over:
        return math.nan, math.nan
    return value / over, math.hypot(error / over, value * over_error / over**2)
