"""The start of a run of many particles: contacts, and positions that balance the forces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import linear
from softdyn.particles.driven import constant
from softdyn.particles.energy import CARRIED, ELASTIC
from softdyn.particles.faults import require_balanced, require_held, why
from softdyn.particles.force_balance import Balance, Newton, StageInput, StepFailed, balance, pair_named
from softdyn.particles.geometry import Contacts, bare_contacts
from softdyn.particles.method import ORDER
from softdyn.particles.neighbours import find_contacts, taken_over
from softdyn.particles.parameters import mixed_parameters
from softdyn.particles.state import State, overlaps, stored_energy
from softdyn.particles.system import System, contact_state
from softdyn.particles.until import run_end

Array = NDArray[np.float64]

#: Gauss's rule on a ramp from 0 to 1; and the most panels that it is cut into.
MOST_PANELS = 128
_RAMP = tuple((1 + points) / 2 if k == 0 else points / 2 for k, points in enumerate(np.polynomial.legendre.leggauss(8)))
#: Change of the work of a jump, relative to it and to rtol, at which panels are small enough.
SETTLED = 0.1
#: Relative change of a gap in the first step, in units of the root of rtol of which the error of a step is the power.
FIRST_CHANGE = 0.5


def start(system: System, newton: Newton) -> State:
    """Initial state: gaps from the scene and its films; without drag, positions in elastic equilibrium at these gaps.

    Raises
    ------
    SceneError
        If surfaces overlap and no gap is given, or external forces have nothing to balance them.
    IntegrationError
        If there is no equilibrium to start from.
    """
    x, films = system.x.copy(), system.scene.films
    contacts, listed, made, _ = find_contacts(system, x, 0.0, None)
    if films is not None:
        contacts, _ = taken_over(contacts, _films(system, films), system.reach)
        made = int(contacts.touched.sum())
    (solver,) = system.having["solve"]
    closed = np.empty(0, np.int64) if solver.touching else np.flatnonzero(~(contacts.h > 0))
    if len(closed):
        c = int(closed[0])
        raise SceneError(f"{len(closed)} contacts overlap, first {pair_named(contacts, c, len(x))}: {solver.closed}")
    state = State(
        t=0.0,
        dt=0.0,
        x=x,
        v=np.zeros(system.fixed.shape),
        y_rate=np.zeros(len(contacts)),
        contacts=contacts,
        listed=listed,
        box=system.box,
        walls=system.walls,
        work=dict.fromkeys((*system.works, ELASTIC, CARRIED), 0.0),
        counts={"made": made, "dropped": 0, "steps": 0, "rejected": 0, "listings": 1},
        kept={name: values for one in system.having["kept"] for name, values in one.kept(system).items()},
        marks={name: values for one in system.having["marks"] for name, values in one.marks().items()},
    )
    if not system.dragged and not system.fixed.all():
        if films is not None:
            state.settled = float(
                np.abs(overlaps(system, state) + contacts.h)[contacts.h < system.reach].max(initial=0.0)
            )
        require_balanced(system, state)
        require_held(system, state)
        try:
            _take(state, _let_go(system, newton, state))
        except (StepFailed, linear.Indefinite) as error:
            raise IntegrationError(
                f"at the start, with the gaps as given, the forces have no equilibrium: {why(system, state, error)}"
            ) from None
        newton.forget()
    for mechanism in system.having["note"]:
        mechanism.note(system, state)
    state.dt = _first_step(system, state)
    state.stored0 = stored_energy(system, state)
    return state


def _let_go(system: System, newton: Newton, state: State) -> Balance:
    """Equilibrium that particles go to at once which something has held at their places until now."""
    followed = _followed(system, newton, state, None, system.force(state.t))
    return relaxed(system, newton, state) if followed is None else followed[0]


def _followed(
    system: System, newton: Newton, state: State, before: Array | None, after: Array
) -> tuple[Balance, float, str] | None:
    """What a mechanism says of a jump of the forces, where it depends on the way."""
    for mechanism in system.having["follow"]:
        found = mechanism.follow(system, newton, state.contacts, state.x, state.t, before, after)
        if found is not None:
            return found
    return None


def relaxed(system: System, newton: Newton, state: State) -> Balance:
    """Elastic equilibrium at the gaps as they are, which nothing but films resists for an instant.

    Parameters
    ----------
    system : System
    newton : Newton
    state : State
    """
    nothing = np.zeros(len(state.contacts))
    given = StageInput(state.t, 0.0, state.x, nothing)
    return balance(system, state.contacts, newton, given, state.x.copy(), nothing.copy())


def _take(state: State, found: Balance) -> None:
    state.x = found.x[:, : state.x.shape[1]]
    state.contacts.h = found.h  # beyond the range pressed gaps follow the centres
    if found.T is not None:
        state.contacts.T = found.T
    if found.rubbed is not None:
        state.contacts.rubbed = found.rubbed


def pass_break(system: System, newton: Newton, state: State) -> None:
    """Go on behind a kink or a jump of what is given: rates before it are no rates behind it.

    A jump of the forces moves particles that nothing resists at once, at the gaps as they are. The work of the forces
    is that of a fast ramp.

    Parameters
    ----------
    system : System
    newton : Newton
    state : State
        At the break, which is changed in place.

    Raises
    ------
    IntegrationError
        If there is no equilibrium behind the jump.
    """
    state.power = None
    before, after = system.force(state.t), system.force.after(state.t)
    if system.dragged or system.fixed.all() or np.array_equal(before, after):
        return
    require_balanced(replace(system, force=constant(after)), state)
    stored = stored_energy(system, state)
    try:
        followed = _followed(system, newton, state, before, after)
        found, work, kind = followed or (*_passed(system, newton, state, before, after), "")
    except (StepFailed, linear.Indefinite) as error:
        raise IntegrationError(
            f"the forces jump at t={state.t:.6g}, and have no equilibrium behind: {why(system, state, error)}"
        ) from None
    _take(state, found)
    newton.forget()
    state.work["external"] += work
    stored = stored_energy(system, state) - stored
    state.work[ELASTIC] += stored
    if kind:
        state.work[kind] += work - stored


def _passed(system: System, newton: Newton, state: State, before: Array, after: Array) -> tuple[Balance, float]:
    """Equilibrium behind a jump of the forces, and their work, where neither depends on the way.

    The work is W = [F x] - (jump of F) . integral of x over a ramp, by Gauss's rule on panels. Where forces change
    their sign on the way x has kinks: panels are halved until it makes no difference.
    """
    jump = after - before

    def by_panels(count: int) -> tuple[float, float]:
        """The second term, and the sum of its sizes."""
        total, size = 0.0, 0.0
        for panel in range(count):
            for point, weight in zip(*_RAMP, strict=True):
                # slow at both ends, where a contact may have no force yet
                s = (panel + point) / count
                part, rate = s**2 * (3 - 2 * s), 6 * s * (1 - s)
                found = relaxed(replace(system, force=constant(before + part * jump)), newton, state)
                here = weight / count * rate * (jump * (found.x - state.x))
                total, size = total - float(here.sum()), size + float(np.abs(here).sum())
        return total, size

    (work, size), panels, change = by_panels(1), 1, math.inf
    while panels < MOST_PANELS and change > SETTLED * system.rtol * size:
        panels *= 2
        finer, size = by_panels(panels)
        work, change = finer, abs(finer - work)
    found = relaxed(replace(system, force=constant(after)), newton, state)
    return found, work + float(np.sum(after * (found.x - state.x)))


def _films(system: System, given: Mapping[str, Any]) -> Contacts:
    """Contacts of an earlier run that are within the range."""
    films = {name: np.asarray(values) for name, values in given.items()}
    near = (films["h"] < system.reach) & (films["j"] < len(system.x) + len(system.walls))
    i, j, h = films["i"][near].astype(np.int32), films["j"][near].astype(np.int32), films["h"][near].astype(float)
    shift = films["shift"][near] if "shift" in films else np.zeros((len(h), system.dimension), np.int64)
    contacts = bare_contacts(i, j, shift, system.radii)
    contacts.q = mixed_parameters(system, system.kernel, i, j)
    contacts.h, contacts.touched = h, np.ones(len(h), bool)
    contacts.T = np.zeros((len(h), system.dimension if system.width > system.dimension else 0))
    contacts.rubbed = np.zeros((len(h), system.rubbed))
    contacts.since = np.full((len(h), system.timed), np.inf)
    if contacts.T.size and "T" in films:
        contacts.T = films["T"][near].astype(float)
    return contacts


def _first_step(system: System, state: State) -> float:
    """A length over which no gap changes by more than the tolerance allows, as far as the present rates tell."""
    overlap = overlaps(system, state)
    values = contact_state(system, state.contacts, overlap, state.contacts.h)
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.abs(values["dh_dt"] / state.contacts.h)[state.contacts.h < system.reach]
    fastest = float(np.max(rates[np.isfinite(rates)], initial=abs(system.box.shear_rate)))
    longest = 1e-2 * run_end(system.scene)
    return min(longest, FIRST_CHANGE * system.rtol ** (1 / ORDER) / fastest) if fastest > 0 else longest
