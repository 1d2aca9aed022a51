"""No contacts: particles whose surfaces have no force, in scenes of potentials and bonds alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import Contacts, directions
from softdyn.particles.mechanisms import Mechanism

if TYPE_CHECKING:
    from softdyn.particles.force_balance import StageInput
    from softdyn.particles.system import System, ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoContacts(Mechanism):
    """Surfaces that have no force on one another."""

    touching = True

    def gaps_at_sight(self, system: System, apart: Array, at_start: bool) -> Array:
        """See :class:`Mechanism`."""
        return np.maximum(apart, 0.0)

    def solve(
        self, system: System, contacts: Contacts, x: Array, cell: Array, given: StageInput, y: Array
    ) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
        """See :class:`Mechanism`."""
        n, r = directions(contacts, x, cell, system.walls)
        nothing = np.zeros(len(r))
        y[:] = 0.0
        return n, r, np.maximum(r - contacts.S, 0.0), nothing, nothing, {}


def check(facts: ValidatedScene, faults: list[str]) -> NoContacts:
    """Particles without contacts: walls would not hold them."""
    if facts.scene.wall:
        faults.append("[[wall]] acts through the contacts of a law, and there is none: give a law, or no walls")
    return NoContacts()
