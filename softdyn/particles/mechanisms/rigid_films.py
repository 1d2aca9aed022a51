"""Films between rigid particles: their gap is the distance of the surfaces, their force the film's alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.force_balance import Balance
from softdyn.particles.gapless import solve_gapless
from softdyn.particles.geometry import Contacts
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.mechanisms.dry_contacts import moves
from softdyn.particles.mechanisms.soft_films import require_films
from softdyn.particles.system import System, contact_state, opening_rates

if TYPE_CHECKING:
    from softdyn.particles.contact_kernels import ContactKernel
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import StageInput
    from softdyn.particles.state import State
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigidFilms(Mechanism):
    """Contacts without elasticity."""

    takes = ("gaps", "remote")
    closed = "rigid particles cannot be pressed into one another: move them apart, or take a law with elasticity"

    def gaps_at_sight(self, system: System, apart: Array, at_start: bool) -> Array:
        """See :class:`Mechanism`."""
        return apart.copy()

    def solve(
        self, system: System, contacts: Contacts, x: Array, cell: Array, given: StageInput, y: Array
    ) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
        """See :class:`Mechanism`."""
        return solve_gapless(system, contacts, x, cell, given)

    def begin(self, system: System, contacts: Contacts, t: float, x: Array) -> tuple[dict[str, Any], dict[str, Array]]:
        """What ln h changes by in a step is integrated for its error, that of a gap relative to it."""
        return {"rigid_films": contacts}, {"ln_h": np.zeros(len(contacts))}

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        """See :class:`Mechanism`."""
        v = (at.x - given.x_star) / given.s
        return {"ln_h": opening_rates(system, given.begun["rigid_films"], given.t, v, at.n) / at.h}

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        """Of the gaps within the range, relative to each."""
        relative = np.abs(errors["ln_h"][at.h < system.reach]) / system.rtol
        return [float(np.sqrt(np.mean(relative**2))), float(relative.max()) / 10] if len(relative) else []

    def ready(self, facts: ValidatedScene, kernel: ContactKernel, p: Array) -> RigidFilms:
        """Refuse particles that nothing but their films resists."""
        if not moves(facts):
            raise SceneError(
                "films of rigid particles alone do not say how particles without one move, and there is no elastic "
                "equilibrium: give the particles a drag ([flow] drag = 1, or as little as 1e-6)"
            )
        return self

    def require(self, system: System, state: State, at: Balance, when: float) -> None:
        """See :class:`Mechanism`."""
        require_films(system, state, at.h, when)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What is lost in the gaps, and taken by remote forces."""
        values = contact_state(system, contacts, contacts.S - at.r, at.h, rates.r)
        lost, remote = np.sum(values["friction"] * rates.r**2), -np.sum(values["remote"] * rates.r)
        return {"gaps": float(lost), "remote": float(remote)}


def check(facts: ValidatedScene, faults: list[str]) -> RigidFilms:
    """Films of a scene of rigid particles."""
    if facts.scene.gap is not None:
        faults.append("[contacts] gap: that of rigid particles is the distance of their surfaces: leave it out")
    return RigidFilms()
