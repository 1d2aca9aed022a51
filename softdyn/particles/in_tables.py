"""Whether the contacts of many particles are where the tables of their law have values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles.force_balance import pair_named

if TYPE_CHECKING:
    from softdyn.particles.state import State
    from softdyn.particles.system import System

Array = NDArray[np.float64]


def require_in_tables(system: System, state: State, r: Array, h: Array, when: float) -> None:
    """No contact is where a table of the law has no value.

    Parameters
    ----------
    system : System
    state : State
        Whose contacts are meant.
    r, h : array, shape (contacts,)
        Distances of the centres, and gaps.
    when : float
        The time.

    Raises
    ------
    IntegrationError
        Naming the particles, the quantity, its value and the range.
    """
    if not system.kernel.tabulated:
        return
    from softdyn.table_ranges import TANGENTIAL, law_once, outside

    contacts = state.contacts
    close = np.flatnonzero(h < system.reach)
    values: dict[str, Array | float] = dict(zip(system.kernel.uniform, system.p.tolist(), strict=True))
    values |= dict(zip(system.kernel.varying, contacts.q[:, close], strict=True))
    law, delta = law_once(system.scene.law, system.kernel.key), (contacts.S - r + h) / 2
    used = {"unequal": "size_ratio" in values, TANGENTIAL: system.scene.tangential}
    unused = tuple(name for name, is_used in used.items() if not is_used)
    found = outside(law, values, h[close], delta[close], unused)
    if found is not None:
        who = pair_named(contacts, int(close[found.number]), len(state.x))
        raise IntegrationError(f"at t={when:.6g} {who} is where the law has no value: {found.words}")
