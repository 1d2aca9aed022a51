"""The run of a flow in time: a start that fits the boundaries, steps, and what they leave for the next.

A start need not be one: a fluid at rest whose inflow is already there is not divergence-free. So a brief step, in which
nothing but pressure acts, makes of it the nearest velocities that are; a second one gives the pressure of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.fluid.linear_solvers import LinearFailed, LinearSolver
from softdyn.fluid.newton import Equations, NewtonFailed, Solution, solve
from softdyn.fluid.time_steps import derivative, error_share, length_to, next_length, predicted, relative_error
from softdyn.fluid.unknowns import Unknowns

Array = NDArray[np.float64]

#: Length of the brief steps at the start, and shortest of all others, over the length of the run.
BRIEF, SHORTEST = 1e-8, 1e-10
#: Length of the first step that is tried, over that of the run.
FIRST = 1e-4
#: Change of the rate up to which a factor may serve.
ALIKE = 0.1
#: Part of the velocities to which these may fall until sizes are told anew.
FADED = 0.5


class MovingFlow(Protocol):
    """A flow that changes in time."""

    @property
    def unknowns(self) -> Unknowns:
        """Which unknowns are free."""
        ...

    def given(self, t: float) -> Array:
        """Values that boundaries give at a time."""
        ...

    def equations(self, t: float, rate: float, past: Array) -> Equations:
        """Equations at a time, where the derivative of the velocities is rate u + past.

        Parameters
        ----------
        t : float
        rate : float
            1/time.
        past : array
            Accelerations: what earlier velocities add.
        """
        ...


@dataclass(frozen=True)
class Stepping:
    """How to step.

    Attributes
    ----------
    order : int
        1 for implicit Euler, 2 for BDF2.
    rtol : float
        Error of the velocities that is allowed in a step, relative to the largest.
    dt : float, optional
        Length of all steps, which then follows from no error.
    least : float
        Size of velocities below which they do not matter: a fluid at rest may start as slowly as it likes.
    """

    order: int
    rtol: float
    dt: float | None = None
    least: float = 0.0


@dataclass
class FlowState:
    """Where a run is, with all that the next step needs.

    Attributes
    ----------
    t, dt : float
        The time, and the length that the next step may have.
    times : list of float
        Those of the last states, the latest first.
    xs : list of array
        Their unknowns.
    largest : float
        Velocity so far.
    scales : array, optional
        Sizes of forces and fluxes when the factor was made, at this rate and with velocities of this size.
    rate, size : float
    counts : dict
    """

    t: float
    dt: float
    times: list[float]
    xs: list[Array]
    largest: float = 0.0
    scales: Array | None = None
    rate: float = 0.0
    size: float = 0.0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("steps", "rejected", "iterations"), 0))


@dataclass(frozen=True)
class FlowStep:
    """A step.

    Attributes
    ----------
    t, dt : float
        Its end, and its length.
    solution : Solution
    rate, past : float, array
        The derivative of the velocities at its end is rate u + past.
    error : float
        Over what is allowed; nan where nothing tells.
    """

    t: float
    dt: float
    solution: Solution
    rate: float
    past: Array
    error: float


def begun(flow: MovingFlow, solver: LinearSolver, x: Array, until: float, stepping: Stepping) -> FlowState:
    """State at the start of a run: the nearest one to x that fits the boundaries, with its pressure.

    Parameters
    ----------
    flow : MovingFlow
    solver : LinearSolver
    x : array, shape (unknowns,)
    until : float
        End of the run.
    stepping : Stepping

    Raises
    ------
    IntegrationError
    """
    state = FlowState(0.0, stepping.dt or FIRST * until, [0.0], [x])
    brief, velocities = BRIEF * until, flow.unknowns.kinds == 0
    try:
        fitting = _solved(flow, solver, state, brief, 1, brief, at=0.0).solution.x
        state.xs = [fitting]
        pressed = _solved(flow, solver, state, brief, 1, brief).solution.x
    except (NewtonFailed, LinearFailed) as error:
        raise IntegrationError(f"the flow has no start: {error}") from None
    state.xs = [np.where(velocities, fitting, pressed)]
    state.largest = _size(state.xs[0], flow.unknowns)
    return state


def march(
    flow: MovingFlow,
    solver: LinearSolver,
    state: FlowState,
    goal: float,
    until: float,
    stepping: Stepping,
    after_step: Callable[[FlowStep], None],
    seeing: Callable[[FlowState, float], float] | None = None,
) -> None:
    """Step on until the goal, an output time.

    Parameters
    ----------
    flow : MovingFlow
    solver : LinearSolver
    state : FlowState
        Changed in place.
    goal, until : float
        Where to end here, and where the run ends.
    stepping : Stepping
    after_step : function of a FlowStep
    seeing : function of the state and a length, optional
        Length of a step, at most the given one, that sees all that is given as a function of time.

    Raises
    ------
    IntegrationError
        If no step is short enough: naming the time and the cause. The state is the last good one.
    """
    while state.t < goal:
        wanted = state.dt if seeing is None else seeing(state, min(state.dt, goal - state.t))
        dt, when = length_to(state.t, wanted, goal)
        first = len(state.times) == 1 and stepping.dt is None
        try:
            steps = (_halves if first else _whole)(flow, solver, state, dt, when, stepping)
        except (NewtonFailed, LinearFailed) as failure:
            solver.forget()
            state.scales = None
            _shorten(state, dt, 0.25 * dt, until, str(failure), stepping)
            continue
        error = steps[-1].error
        if stepping.dt is None:
            longer = next_length(dt, error, 1 if first else stepping.order)
            if error > 1:
                _shorten(state, dt, longer, until, f"the tolerance rtol={stepping.rtol:g} cannot be met", stepping)
                continue
            # a step that was shortened to end somewhere says nothing against a longer one
            state.dt = max(longer, state.dt) if dt < state.dt else longer
        for step in steps:
            state.t = step.t
            state.times, state.xs = [step.t, *state.times][:3], [step.solution.x, *state.xs][:3]
            state.largest = max(state.largest, _size(step.solution.x, flow.unknowns))
            state.counts["steps"] += 1
            after_step(step)


def restart(state: FlowState) -> None:
    """Go on behind a kink or a jump of what is given: the states before it tell no derivative behind it."""
    state.times, state.xs = state.times[:1], state.xs[:1]


def _shorten(state: FlowState, dt: float, new: float, until: float, cause: str, stepping: Stepping) -> None:
    """Try a shorter step.

    Raises
    ------
    IntegrationError
        If it is too short, or all steps have a given length.
    """
    if stepping.dt is not None:
        raise IntegrationError(f"a step of the given length {dt:.4g} from t={state.t:.6g} fails: {cause}")
    if new < SHORTEST * until:
        raise IntegrationError(f"the run cannot go on at t={state.t:.6g}, however short the step: {cause}")
    state.counts["rejected"] += 1
    state.dt = new


def _halves(
    flow: MovingFlow, solver: LinearSolver, state: FlowState, dt: float, when: float, stepping: Stepping
) -> list[FlowStep]:
    """The first step, in two halves, the second with the error of the whole."""
    middle = state.t + (when - state.t) / 2
    start = replace(state, times=list(state.times), xs=list(state.xs))
    whole = _solved(flow, solver, start, dt, 1, when)
    half = _solved(flow, solver, start, dt / 2, 1, middle)
    start.t, start.times, start.xs = middle, [middle, state.t], [half.solution.x, state.xs[0]]
    end = _solved(flow, solver, start, when - middle, 1, when)
    state.scales, state.rate, state.size = start.scales, start.rate, start.size
    velocities = flow.unknowns.kinds == 0
    wrong = (end.solution.x - whole.solution.x)[velocities]
    error = relative_error(wrong, end.solution.x[velocities], max(state.largest, stepping.least))
    return [half, replace(end, error=error / stepping.rtol)]


def _whole(
    flow: MovingFlow, solver: LinearSolver, state: FlowState, dt: float, when: float, stepping: Stepping
) -> list[FlowStep]:
    """A step, with its error where there are states enough to tell."""
    order = min(stepping.order, len(state.times))
    step = _solved(flow, solver, state, dt, order, when)
    if len(state.times) <= order:
        return [step]
    velocities = flow.unknowns.kinds == 0
    u = step.solution.x[velocities]
    wrong = u - predicted(state.times[: order + 1], [x[velocities] for x in state.xs[: order + 1]], step.t)
    error = error_share(state.times, step.t, order) * relative_error(wrong, u, max(state.largest, stepping.least))
    return [replace(step, error=error / stepping.rtol)]


def _solved(
    flow: MovingFlow,
    solver: LinearSolver,
    state: FlowState,
    dt: float,
    order: int,
    end: float,
    at: float | None = None,
) -> FlowStep:
    """Solution of a step; ``at`` is another time, at which its boundaries and coefficients are."""
    times, xs, unknowns = state.times[:order], state.xs[:order], flow.unknowns
    rate, weights = derivative(times, end)
    past = sum((weight * x for weight, x in zip(weights, xs, strict=True)), np.zeros_like(xs[0]))
    now = end if at is None else at
    guess = predicted(state.times, state.xs, end) if len(state.times) > 1 else state.xs[0]
    guess = unknowns.all_of(unknowns.free_of(guess), flow.given(now))
    alike = state.rate and abs(rate / state.rate - 1) < ALIKE and _size(state.xs[0], unknowns) > FADED * state.size
    before = solver.counts["factorisations"]
    found = solve(flow.equations(now, rate, past), unknowns, solver, guess, state.scales if alike else None)
    state.scales = found.scales
    if solver.counts["factorisations"] > before:
        state.rate, state.size = rate, _size(found.x, unknowns)
    state.counts["iterations"] += found.iterations
    return FlowStep(end, dt, found, rate, past, math.nan)


def _size(x: Array, unknowns: Unknowns) -> float:
    return float(np.abs(x[unknowns.kinds == 0]).max(initial=0.0))
