"""Soft films: what the generated kernel says of each contact, its force at a gap that obeys the law, and its energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles.contact_kernels import energies
from softdyn.particles.energy import ELASTIC
from softdyn.particles.force_balance import Balance, pair_named
from softdyn.particles.geometry import Contacts, directions, some_of
from softdyn.particles.in_tables import require_in_tables
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.system import System, contact_state

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import StageInput
    from softdyn.particles.state import State
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]

#: Gap, relative to the radius, below which a film is drained: the distance of two centres tells no smaller one.
DRAINED = float(np.finfo(float).eps)
#: Overlap over the smaller radius below which no contact is as wide as the smaller sphere.
SHALLOW = 0.25
#: Where no time passes films hold for an instant: gaps within their range stay, pressed ones beyond it follow the
#: centres.
INSTANT = 1e-100


@dataclass(frozen=True)
class Films(Mechanism):
    """The films between the surfaces."""

    takes = ("gaps", "remote", "U_h")
    closed = "give the initial gap of pressed particles, [contacts] gap"

    def gaps_at_sight(self, system: System, apart: Array, at_start: bool) -> Array:
        """Those of the scene, at the start; else undeformed."""
        gap = system.scene.gap
        return apart.copy() if gap is None or not at_start else np.maximum(apart, float(gap))

    def solve(
        self, system: System, contacts: Contacts, x: Array, cell: Array, given: StageInput, y: Array
    ) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
        """See :class:`Mechanism`."""
        count, d = len(contacts), x.shape[1]
        n = np.empty((count, d))
        r, h, F, F_r = (np.empty(count) for _ in range(4))  # each by itself: h outlives the others
        values = dict(zip(system.kernel.tangential, np.empty((len(system.kernel.tangential), count)), strict=True))

        def solve(part: slice) -> None:
            some = portion(contacts, part)
            n[part], r[part] = directions(some, x, cell, system.walls)
            overlap = some.S - r[part]
            h[part], F[part], F_r[part], more = solve_contacts(
                system, overlap, given.s or INSTANT, some.h, given.y_star[part], y[part], some.q
            )
            for name, value in more.items():
                values[name][part] = value

        in_portions(solve, count)
        return n, r, h, F, F_r, values

    def require(self, system: System, state: State, at: Balance, when: float) -> None:
        """See :class:`Mechanism`."""
        require_films(system, state, at.h, when)
        require_shallow(system, state, at, when)
        require_in_tables(system, state, at.r, at.h, when)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What is lost in the gaps, what remote forces and the U_h term take, and what is stored."""
        gaps, remote, U_h = _gap_powers(system, contacts, at, rates.t, rates.h)
        elastic = float(np.sum(at.of_contacts * (rates.h - rates.r)))
        return {"gaps": gaps, "remote": remote, "U_h": U_h, ELASTIC: elastic - U_h}

    def stored(self, system: System, contacts: Contacts, overlap: Array) -> float:
        """See :class:`Mechanism`."""
        U, _ = energies(system.kernel, system.reach, overlap, contacts.h, system.p, contacts.q.reshape(-1))
        return float(U.sum())


def check(facts: ValidatedScene, faults: list[str]) -> Films:
    """Films of a scene: what its law says is checked with the law."""
    return Films()


def solve_contacts(
    system: System, overlap: Array, s: float, start: Array, target: Array, y: Array, q: Array
) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Gap, force and consistent tangent of each contact at given overlaps; y is a guess, and then the solution.

    Besides what the kernel gives of tangential motion, by name.

    Parameters
    ----------
    system : System
    overlap : array, shape (contacts,)
        Sums of the radii less the distances of the centres.
    s : float
        gamma dt of the stage, > 0.
    start : array, shape (contacts,)
        Gaps as the step began.
    target : array, shape (contacts,)
        Known part y* of their state, y = sinh(ln(h/g)) with the gap g as the step began.
    y : array, shape (contacts,)
        Guess of y, changed in place.
    q : array, shape (parameters, contacts)
        Varying parameters of the law.
    """
    kernel = system.kernel
    h, F, F_r = np.empty_like(overlap), np.empty_like(overlap), np.empty_like(overlap)
    reach = (system.reach,) if kernel.fading else ()
    out = np.empty((len(kernel.tangential), len(overlap)))
    more = (out.reshape(-1),) if kernel.tangential else ()
    kernel.contacts(
        len(overlap), float(s), *reach, overlap, start, target, system.p, q.reshape(-1), y, h, F, F_r, *more
    )
    return h, F, F_r, dict(zip(kernel.tangential, out, strict=True))


def require_films(system: System, state: State, h: Array, when: float) -> None:
    """No film is drained: attraction without anything at short range to stop it closes a gap within a finite time.

    Parameters
    ----------
    system : System
    state : State
    h : array, shape (contacts,)
        Gaps, lengths.
    when : float
        The time, for errors.
    """
    contacts, count = state.contacts, len(state.x)
    drained = np.flatnonzero(h < DRAINED * system.radii[contacts.i])
    if len(drained):
        c = int(drained[np.argmin(h[drained])])
        raise IntegrationError(
            f"at t={when:.6g} the film of {pair_named(contacts, c, count)} is drained: its gap of {h[c]:.3g} is below "
            f"the rounding of the radius {system.radii[contacts.i[c]]:.6g}, where no law holds, and the energy of an "
            "attraction is without bound; let the law repel at short range (as steric does), weaken what draws the "
            "surfaces together (as A does in dlvo), or end the run before"
        )


def require_shallow(system: System, state: State, at: Balance, when: float) -> None:
    """No surfaces are pressed until centres could pass one another, or are flattened as widely as a sphere is.

    The first is an overlap of the smaller radius. The second is the radius of the law's contact, without what it is of
    surfaces that are not deflected, above the smaller radius: what matters of unequal spheres, and of walls, is not how
    unequal they are. A cap of the height delta has a^2 = 2 R delta, with R below twice the smaller radius: contacts
    that are pressed by less than SHALLOW need not be asked.

    Parameters
    ----------
    system : System
    state : State
    at : Balance
    when : float
        The time, for errors.
    """
    contacts, count = state.contacts, len(state.x)
    smaller = np.minimum(system.radii[contacts.i], np.append(system.radii, np.inf)[np.minimum(contacts.j, count)])
    pressed = (contacts.S - at.r + at.h) / smaller
    if not len(pressed) or pressed.max() < SHALLOW:
        return
    remedy = "use weaker forces, slower motion, or a stiffer law"
    c = int(np.argmax(pressed))
    if pressed[c] > 1:
        raise IntegrationError(
            f"at t={when:.6g} {pair_named(contacts, c, count)} is pressed until its surfaces overlap by "
            f"{pressed[c]:.3g} radii, where no law of contacts holds: {remedy}"
        )
    deep = np.flatnonzero(pressed >= SHALLOW)
    some, h = some_of(contacts, deep), at.h[deep]
    whole, round_ = (contact_state(system, some, overlap, h)["a"] for overlap in (contacts.S[deep] - at.r[deep], -h))
    flat = np.sqrt(np.maximum(whole**2 - round_**2, 0.0)) / smaller[deep]
    k = int(np.argmax(flat))
    if flat[k] > 1:
        raise IntegrationError(
            f"at t={when:.6g} {pair_named(contacts, int(deep[k]), count)} is pressed until its surfaces are flattened "
            f"over a radius of {flat[k]:.3g} times that of the smaller particle, {smaller[deep[k]]:.6g}, where no law "
            f"of contacts holds: {remedy}"
        )


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
