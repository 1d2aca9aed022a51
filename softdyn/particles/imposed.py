"""The stress that is imposed on a box; see :mod:`softdyn.particles.surroundings` for what follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Imposed:
    """Components of the stress that are imposed on the box.

    Attributes
    ----------
    names : tuple of str
        "xy", "xx", "yy", "zz", or "pressure".
    values : function of t
        Their values, > 0 in tension; for the pressure, minus it.
    viscosity : float
        Of the fluid: resists the box.
    """

    names: tuple[str, ...]
    values: Callable[[float], Array]
    viscosity: float

    def gradients(self, d: int) -> Array:
        """Velocity gradient of a unit rate of each, shape (names, d, d)."""
        found = np.zeros((len(self.names), d, d))
        for gradient, name in zip(found, self.names, strict=True):
            if name == "pressure":
                gradient[:] = np.eye(d)
            else:
                gradient["xyz".index(name[0]), "xyz".index(name[1])] = 1.0
        return found

    def weights(self, d: int) -> Array:
        """E of each: what of the stress tensor it is, shape (names, d, d)."""
        weights = self.gradients(d)
        for weight, name in zip(weights, self.names, strict=True):
            weight /= d if name == "pressure" else 1
        return weights
