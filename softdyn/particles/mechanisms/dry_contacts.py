"""Dry contacts: surfaces that touch, without a film; their force follows from the distance and its rate.

F = F_ela where surfaces touch, less that of a dashpot beside it, and a remote force with or without touch: see
:mod:`softdyn.derive.gapless_equations`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles.contact_kernels import energies
from softdyn.particles.energy import ELASTIC
from softdyn.particles.force_balance import Balance, pair_named
from softdyn.particles.gapless import solve_gapless
from softdyn.particles.geometry import Contacts
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.system import System, contact_state
from softdyn.traits import traits_of

if TYPE_CHECKING:
    from softdyn.particles.contact_kernels import ContactKernel
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import StageInput
    from softdyn.particles.state import State
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DryContacts(Mechanism):
    """Contacts without a film."""

    takes = ("dashpots", "remote")
    touching = True

    def gaps_at_sight(self, system: System, apart: Array, at_start: bool) -> Array:
        """See :class:`Mechanism`."""
        return np.maximum(apart, 0.0)

    def solve(
        self, system: System, contacts: Contacts, x: Array, cell: Array, given: StageInput, y: Array
    ) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
        """See :class:`Mechanism`."""
        return solve_gapless(system, contacts, x, cell, given)

    def ready(self, facts: ValidatedScene, kernel: ContactKernel, p: Array) -> DryContacts:
        """Refuse a dashpot, whose force is no function of the positions, where nothing says how these move."""
        if traits_of(facts.scene.law).dashpot and not moves(facts):
            raise SceneError(
                "the dashpots of the contacts alone do not say how particles without a contact move: give them a drag "
                "([flow] drag = 1), or leave the dashpot out: then they are in elastic equilibrium"
            )
        return self

    def require(self, system: System, state: State, at: Balance, when: float) -> None:
        """Centres do not pass one another."""
        contacts, count = state.contacts, len(state.x)
        smaller = np.minimum(system.radii[contacts.i], np.append(system.radii, np.inf)[np.minimum(contacts.j, count)])
        deep = (contacts.S - at.r) / smaller
        if len(deep) and deep.max() > 1:
            c = int(np.argmax(deep))
            raise IntegrationError(
                f"at t={when:.6g} {pair_named(contacts, c, count)} overlaps by {deep[c]:.3g} radii, where no law of "
                "contacts holds: use weaker forces, slower motion, or a stiffer law"
            )

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What dashpots and remote forces take, and what is stored."""
        values = contact_state(system, contacts, contacts.S - at.r, at.h, rates.r)
        lost, remote = float(np.sum(values["friction"] * rates.r**2)), -float(np.sum(values["remote"] * rates.r))
        elastic = at.of_contacts + values["friction"] * rates.r - values["remote"]
        return {"dashpots": lost, "remote": remote, ELASTIC: -float(np.sum(elastic * rates.r))}

    def stored(self, system: System, contacts: Contacts, overlap: Array) -> float:
        """See :class:`Mechanism`."""
        return float(
            energies(system.kernel, system.reach, overlap, contacts.h, system.p, contacts.q.reshape(-1))[0].sum()
        )


def moves(facts: ValidatedScene) -> bool:
    """Whether positions follow from rates, since something resists every particle by itself, or has inertia."""
    return bool(facts.scene.drag) or any(mechanism.moves_freely for mechanism in facts.mechanisms)


def check(facts: ValidatedScene, faults: list[str]) -> DryContacts:
    """Dry contacts of a scene."""
    if facts.scene.gap is not None:
        faults.append("[contacts] gap: the surfaces of a dry contact touch, without a gap of their own: leave it out")
    return DryContacts()
