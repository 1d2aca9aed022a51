"""Soft films: what the generated kernel says of each contact, its force at a gap that obeys the law, and its energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles.balance import Balance, pair_named
from softdyn.particles.energy import ELASTIC
from softdyn.particles.kernel import energies
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.system import System, contact_state

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Films(Mechanism):
    """The films between the surfaces."""

    takes = ("gaps", "remote", "U_h")

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What is lost in the gaps, what remote forces and the U_h term take, and what is stored."""
        gaps, remote, U_h = _gap_powers(system, contacts, at, rates.t, rates.h)
        elastic = float(np.sum(at.F * (rates.h - rates.r)))
        return {"gaps": gaps, "remote": remote, "U_h": U_h, ELASTIC: elastic - U_h}

    def stored(self, system: System, contacts: Contacts, overlap: Array) -> float:
        """See :class:`Mechanism`."""
        U, _ = energies(system.kernel, system.reach, overlap, contacts.h, system.p, contacts.q.reshape(-1))
        return float(U.sum())


def check(facts: ValidatedScene, faults: list[str]) -> Films:
    """Films of a scene: what its law says is checked with the law."""
    return Films()


def _gap_powers(
    system: System, contacts: Contacts, at: Balance, when: float, h_rate: Array
) -> tuple[float, float, float]:
    """Power lost in the gaps, and taken by remote forces and the U_h term."""

    def of(part: slice) -> tuple[float, float, float]:
        some = portion(contacts, part)
        overlap, h, rate = some.S - at.r[part], at.h[part], h_rate[part]
        values = contact_state(system, some, overlap, h)
        beyond = np.flatnonzero(~np.isfinite(values["friction"]))
        if len(beyond):
            who = pair_named(some, int(beyond[0]), len(system.radii))
            raise IntegrationError(
                f"at t={when:.6g} the friction of {who} is beyond the largest number that there is: choose units in "
                "which sizes, moduli and viscosities are nearer to 1"
            )
        _, U_h = energies(system.kernel, system.reach, overlap, h, system.p, some.q.reshape(-1))
        lost, remote = np.sum(values["friction"] * rate**2), -np.sum(values["remote"] * rate)
        return float(lost), float(remote), -float(np.sum(U_h * rate))

    gaps, remote, taken = zip(*in_portions(of, len(h_rate)), strict=True)
    return sum(gaps), sum(remote), sum(taken)
