"""The stress that is imposed on a box; see :mod:`softdyn.particles.surroundings` for what follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from softdyn.particles.loads import Driven

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Imposed:
    """Components of the stress that are imposed on the box.

    Attributes
    ----------
    names : tuple of str
        "xy", "xx", "yy", "zz", or "pressure".
    driven : Driven
        Their values, > 0 in tension; for the pressure, minus it; shape (names, 1).
    viscosity : float
        Of the fluid: resists the box.
    """

    names: tuple[str, ...]
    driven: Driven
    viscosity: float

    def values(self, t: float) -> Array:
        """Values at a time."""
        return self.driven(t)[:, 0]

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
