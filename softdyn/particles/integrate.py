"""From the start of a run of many particles to its end: steps, their lengths, and lists of contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles import linear
from softdyn.particles.faults import fastest, require_balanced, why
from softdyn.particles.force_balance import Balance, Newton, StepFailed, pair_named
from softdyn.particles.geometry import Box, lattice
from softdyn.particles.in_tables import require_in_tables
from softdyn.particles.method import ORDER
from softdyn.particles.neighbours import common, find_contacts, travelled
from softdyn.particles.pulled_films import At, look
from softdyn.particles.resolve import SHORTEST, breaks, resolved
from softdyn.particles.results import Frame
from softdyn.particles.start import pass_break
from softdyn.particles.state import LARGEST_GROWTH, State, frame_now, frame_within, overlaps, present
from softdyn.particles.step import Step, take_step
from softdyn.particles.system import System, contact_state
from softdyn.particles.until import ends_at_strain, run_end
from softdyn.signals import undisturbed

Array = NDArray[np.float64]
#: Called after every step with the time, the number of steps, and that of Newton iterations.
Progress = Callable[[float, int, int], None]

MOST_STEPS = 1_000_000
SMALLEST_STEP = 1e-12
#: Of the step that the error allows: with less of it fewer are rejected, which costs least on the stock scenes.
SAFETY = 0.8
#: After a step that could not be solved for, that limit starts from 1 and grows so: what was too long a step still is.
RECOVERY = 1.1
#: Of the first step: velocities at the start are those of a step of this part of it.
BRIEF = 1e-3
#: A strain is reached to this fraction of it.
STRAINED = 1e-9


def integrate(
    system: System,
    newton: Newton,
    state: State,
    progress: Progress | None = None,
    after_step: Callable[[], None] | None = None,
    on_frame: Callable[[Frame], None] | None = None,
) -> None:
    """Carry a state on to the end of the scene, in place.

    Each of the functions is called after every step; ``on_frame`` with each frame that the step made.

    Parameters
    ----------
    system : System
    newton : Newton
    state : State
    progress : function of (t, steps, Newton iterations), optional
    after_step : function, optional
    on_frame : function of a Frame, optional

    Raises
    ------
    IntegrationError
        The state is then the last good one.
    """
    system = present(system, state)
    until = run_end(system.scene)
    goals = np.append(breaks(system), until)
    within = int(np.searchsorted(goals, until))
    if within > MOST_STEPS:
        raise IntegrationError(
            f"what is given has {within} kinks before t={until:.6g}, as the rows of its tables are, a step ends at "
            f"each, and a run takes {MOST_STEPS} steps at most: give tables fewer rows, or end the run at "
            f"t={goals[MOST_STEPS - 1]:.6g} or before"
        )
    if not len(state.frames) and system.times[0] == 0.0:
        state.frames.append(frame_now(system, state))
        _look_at_start(system, state)
    step: Step | None = None
    strained = ends_at_strain(system.scene)
    while state.t < until and not (strained and _has_strained(system, state)):
        step = None  # many numbers that the next one has no use for
        told = len(state.frames)
        newton.whole = False
        if state.counts["steps"] + state.counts["rejected"] > MOST_STEPS:
            raise IntegrationError(f"{MOST_STEPS} steps were not enough: t={state.t:.6g} of {until:.6g} is reached")
        require_balanced(system, state)
        dt, when = _length(system, state, float(goals[np.searchsorted(goals, state.t, side="right")]), until)
        ahead = state.x + dt * state.v[:, : system.dimension]
        if _drift(system, state, ahead, system, when) > 1.0 and _drift(system, state) > 0:
            _list_again(system, newton, state)
        step, failure = _attempt(system, newton, state, dt, when)
        if step is None or not step.error <= 1.0:
            _shorten(system, state, until, dt, math.inf if step is None else step.error, failure)
            newton.s, state.grow = newton.s if failure is None else 0.0, 1.0
            state.recovery = math.inf if failure is None else RECOVERY
            continue
        if _drift(system, state, step.end.x[:, : system.dimension], step.system, when) > 1.0:
            # further than the list of contacts reaches, and than was expected
            if _drift(system, state) > 0:
                _list_again(system, newton, state)
            else:
                newton.forget()
                state.dt = 0.5 * dt
            continue
        over = _beyond(system, state, step, when) if strained else None
        if over is not None:
            state.dt = over
            continue
        over = _happens(system, state, step, when)
        if over is not None:
            state.dt = over
            continue
        for mechanism in system.having["require"]:
            mechanism.require(system, state, step.end, when)
        with undisturbed():
            system = _accept(system, newton, state, step, dt, when)
            jumped = [mechanism.note(system, state) for mechanism in system.having["note"]]
            if any(jumped):
                state.power = None
                newton.forget()
            if state.t in goals[:-1]:
                pass_break(system, newton, state)
            if _drift(system, state) > 0.5:
                _list_again(system, newton, state)
            if state.t in system.times or (strained and _has_strained(system, state)):
                state.frames.append(frame_now(system, state))
            state.grow = min(LARGEST_GROWTH, state.recovery * state.grow)
            newton.whole = True
        if progress is not None:
            progress(state.t, state.counts["steps"], newton.counts["iterations"])
        if on_frame is not None:
            for frame in range(told, len(state.frames)):
                on_frame(state.frames[frame])
        if after_step is not None:
            after_step()


def _look_at_start(system: System, state: State) -> None:
    overlap = overlaps(system, state)
    F = contact_state(system, state.contacts, overlap, state.contacts.h)["F"]
    now = At(state.contacts.S - overlap, state.contacts.h, F)
    require_in_tables(system, state, now.r, now.h, 0.0)
    look(state.pulled, system, state.contacts, 0.0, 0.0, now)


def _length(system: System, state: State, goal: float, until: float) -> tuple[float, float]:
    """Length of the next step, and its end: all that is given is seen, and no sliver is left before the goal."""
    left = goal - state.t
    dt, unseen = resolved(system, state, min(state.dt, left), SHORTEST * until)
    if unseen and unseen not in state.unseen:
        state.unseen[unseen] = state.t
    if dt >= 0.99 * left:
        return left, goal
    dt = min(dt, 0.5 * left) if dt > 0.5 * left else dt
    return dt, state.t + dt


def _drift(
    system: System,
    state: State,
    x: Array | None = None,
    at: System | None = None,
    t: float | None = None,
) -> float:
    """By how much surfaces have come closer, or will have at x, since contacts were listed, in units of the skin."""
    if math.isinf(system.listing):  # all are listed; but none may pass another within a step
        moved = np.zeros_like(state.x) if x is None else x - state.x
        moved = moved if state.walls else moved - moved.mean(axis=0)
        return 2 * float(np.linalg.norm(moved, axis=1).max()) / state.listed.skin
    where = system if at is None else at
    farthest = 2 * float(system.radii.max()) + system.listing + state.listed.skin
    place, when = (state.x, state.t) if x is None or t is None else (x, t)
    return travelled(state.listed, place, where.box, when, farthest, where.walls)


def _attempt(
    system: System, newton: Newton, state: State, dt: float, when: float
) -> tuple[Step | None, Exception | None]:
    """Try a step; or what it failed of."""
    within = system.times[(system.times > state.t) & (system.times < when)]
    try:
        step = take_step(
            system,
            state.contacts,
            newton,
            state.t,
            state.x,
            state.v,
            state.y_rate,
            dt,
            within,
            state.power,
            when,
            state.kept,
        )
    except (StepFailed, linear.Indefinite) as refused:
        return None, refused
    return step, None


def _shorten(system: System, state: State, until: float, dt: float, error: float, failure: Exception | None) -> None:
    """Make the next attempt shorter, after one that was not good enough.

    Raises
    ------
    IntegrationError
        If no step is short enough.
    """
    state.counts["rejected"] += 1
    # after a failure nothing is known but that the step was too long
    state.dt = dt * (max(0.2, SAFETY * error ** (-1 / ORDER)) if math.isfinite(error) else 0.5)
    if state.dt < SMALLEST_STEP * until or state.t + 0.1 * state.dt == state.t:
        tolerance = f"the tolerance rtol={system.rtol:g} cannot be met; {fastest(system, state)}"
        cause = tolerance if failure is None else why(system, state, failure)
        raise IntegrationError(f"the run cannot go on at t={state.t:.6g}, however short the step: {cause}")
    if failure is not None:
        state.v, state.y_rate, state.power = np.zeros_like(state.v), np.zeros_like(state.y_rate), None


def _accept(system: System, newton: Newton, state: State, step: Step, dt: float, when: float) -> System:
    """Take the end of a step for the state; returns the system with box and walls as they are there."""
    if state.t == 0.0 and len(state.frames) and state.frames[0].t == 0.0:
        state.frames[0] = _first_frame(system, newton, state, step, dt)
    for output in step.outputs:
        state.frames.append(frame_within(output, state))
        look(state.pulled, output.system, state.contacts, output.t, 0.0, _pressed(output.at))
    look(state.pulled, step.system, state.contacts, when, dt, _pressed(step.end))
    state.t, state.x, state.v = when, step.end.x[:, : system.dimension], step.v
    state.box, state.walls = step.system.box, step.system.walls
    # the state y is counted from the gap at the start of a step: its rate is that of ln h at the next
    state.y_rate = step.y_rate / np.sqrt(1 + step.end.y**2)
    state.contacts.h = step.end.h
    if step.end.T is not None:
        state.contacts.T = step.end.T
    if step.end.rubbed is not None:
        state.contacts.rubbed = step.end.rubbed
    state.kept = step.kept
    for name, amount in step.work.items():
        state.work[name] += amount
    state.work_error += step.work_error
    touching = step.end.h < system.reach
    state.counts["made"] += int(np.sum(touching & ~state.contacts.touched))
    state.contacts.touched |= touching
    state.counts["steps"] += 1
    state.history.append((state.t, dt, step.end.residual, step.error, int(touching.sum())))
    longer = dt * min(state.grow, SAFETY * max(step.error, 1e-12) ** (-1 / ORDER))
    # a step shortened to end says nothing against a longer one
    state.dt = max(longer, state.dt) if dt < state.dt and longer > dt else longer
    state.power = step.power
    return step.system


def _pressed(found: Balance) -> At | Balance:
    """Forces of the contacts by themselves."""
    return found if found.film is None else At(found.r, found.h, found.film)


def _first_frame(system: System, newton: Newton, state: State, step: Step, dt: float) -> Frame:
    """Frame of the start of a run: velocities and rates of the box by a step in which nothing has time to relax."""
    # a factor is worth keeping; a matrix without is made anew, as two at a time would be most of the memory of a run
    used = Newton() if newton.solver is None or newton.solver.factor is not None else newton
    v, box = step.first_v, step.first_box
    with suppress(StepFailed, linear.Indefinite):
        brief = take_step(
            system, state.contacts, used, state.t, state.x, step.first_v, state.y_rate, BRIEF * dt, kept=state.kept
        )
        v, box = brief.first_v, brief.first_box
        del brief
    used.s = 0.0
    return frame_now(replace(system, box=box), replace(state, v=v))


def _strain(system: System, box: Box, t: float) -> float:
    """Size of the shear strain of the box since the start."""
    assert system.scene.box is not None
    cell = lattice(box, t)
    return abs(float(cell[0, 1] / cell[1, 1] - system.scene.tilt / np.float64(system.scene.box[1])))


def _has_strained(system: System, state: State) -> bool:
    """Whether the strain is reached at which the run ends."""
    return _strain(system, state.box, state.t) >= abs(system.scene.until_strain) * (1 - STRAINED)  # type: ignore[arg-type]


def _beyond(system: System, state: State, step: Step, when: float) -> float | None:
    """A shorter step, if this one goes beyond the strain at which the run ends; None if not."""
    goal = abs(system.scene.until_strain)  # type: ignore[arg-type]
    start, end = _strain(system, state.box, state.t), _strain(system, step.system.box, when)
    if end <= goal * (1 + STRAINED):
        return None
    return (when - state.t) * (goal - start) / (end - start)


def _happens(system: System, state: State, step: Step, when: float) -> float | None:
    """A shorter step, if something happens within this one at which a step has to end."""
    found = [mechanism.ends(step.system, state, step.end, when) for mechanism in system.having["ends"]]
    return min((dt for dt in found if dt is not None), default=None)


@undisturbed()
def _list_again(system: System, newton: Newton, state: State) -> None:
    """Look for contacts at the present positions; gaps, guesses and forces stay.

    Raises
    ------
    IntegrationError
        If a pair that was not listed is past its range; the state is as it was.
    """
    contacts, listed, _, dropped = find_contacts(system, state.x, state.t, state.contacts)
    (solver,) = system.having["solve"]
    closed = np.empty(0, np.int64) if solver.touching else np.flatnonzero(~(contacts.h > 0))
    if len(closed):
        c = int(closed[0])
        who = pair_named(contacts, c, len(state.x))
        raise IntegrationError(
            f"{who} was passed through within one step at t={state.t:.6g}, before it was found: ask for a smaller rtol"
        )
    new, known = common(contacts, state.contacts)
    y_rate = np.zeros(len(contacts))
    y_rate[new] = state.y_rate[known]
    fresh = (contacts.h < system.reach) & ~contacts.touched
    contacts.touched |= fresh
    with undisturbed():
        state.contacts, state.listed, state.y_rate = contacts, listed, y_rate
        state.counts["made"] += int(fresh.sum())
        state.counts["dropped"] += dropped
        state.counts["listings"] += 1
        newton.forget()
