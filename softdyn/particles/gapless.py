"""Contacts without a gap state, as their kernel solves them: dry ones, and those of rigid particles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import Contacts, directions
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.system import System, opening_rates

if TYPE_CHECKING:
    from softdyn.particles.force_balance import StageInput

Array = NDArray[np.float64]

#: Where no time passes, what tangential motion takes for gamma dt.
INSTANT = 1e-100


def solve_gapless(
    system: System, contacts: Contacts, x: Array, cell: Array, given: StageInput
) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
    """Normals, distances, gaps, forces, dF/dr, and what there is of tangential motion, of contacts at the positions x.

    Parameters
    ----------
    x : array, shape (N, d)
    cell : array, shape (d, d)
        Lattice vectors of the box.
    given : StageInput
    """
    kernel, (count, d) = system.kernel, (len(contacts), x.shape[1])
    n = np.empty((count, d))
    r, h, F, F_r = (np.empty(count) for _ in range(4))
    more = np.empty((len(kernel.tangential), count))
    s, pace = given.s or INSTANT, 1 / given.s if given.s > 0 else 0.0
    v = (x - given.x_star[:, :d]) * pace
    reach = (system.reach,) if kernel.fading else ()

    def solve(part: slice) -> None:
        some = portion(contacts, part)
        n[part], r[part] = directions(some, x, cell, system.walls)
        rate = opening_rates(system, some, given.t, v, n[part]) if pace else np.zeros(len(some))
        of_part = np.empty((len(more), len(some)))
        sliding = (of_part.reshape(-1),) if kernel.tangential else ()
        q = some.q.reshape(-1)
        kernel.contacts(
            len(some), s, pace, *reach, some.S - r[part], rate, system.p, q, h[part], F[part], F_r[part], *sliding
        )
        more[:, part] = of_part

    in_portions(solve, count)
    return n, r, h, F, F_r, dict(zip(kernel.tangential, more, strict=True))
