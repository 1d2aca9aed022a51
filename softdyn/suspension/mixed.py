"""Faster repetitions of a step: Anderson's mixing of what was tried with what came out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Repetitions that are remembered.
KEPT = 6


@dataclass
class Mixing:
    """Repetitions of a map z -> g(z) so far (Anderson, J. ACM 12 (1965) 547).

    Attributes
    ----------
    tried, found : list of array
        Values of z, and of g there, the latest last.
    """

    tried: list[Array] = field(default_factory=list)
    found: list[Array] = field(default_factory=list)

    def next(self, z: Array, g: Array) -> Array:
        """Where to try next: the combination of what was found whose changes g - z come closest to 0.

        Parameters
        ----------
        z, g : arrays, shape (n,)
            What was tried, and what came out.
        """
        self.tried, self.found = [*self.tried, z][-KEPT:], [*self.found, g][-KEPT:]
        tried, found = np.array(self.tried), np.array(self.found)
        changes = found - tried
        if len(changes) < 2:
            return g
        weights, *_ = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=1e-8)
        return np.asarray(g - weights @ np.diff(found, axis=0))
