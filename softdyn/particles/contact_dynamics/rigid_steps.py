"""Steps of rigid grains, of one length between two output times.

A step is that of implicit Euler, and of first order: with the gaps g and directions at its start, impulses P of the
contacts and velocities v' at its end satisfy M (v' - v) = J + H^T P, J the impulse of the external forces, and

    0 <= P_n ,  U_n' + g/dt >= 0 ,  one of them 0 ;      |P_t| <= mu P_n , opposite to U_t' .

Then x' = x + dt v'. The distance of two centres is a convex function of their positions, so that no pair overlaps at
the end that satisfies this. A contact with restitution e that closes in the step has U_n' >= -e U_n instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles.contact_dynamics.impulses import Problem, Solution, solve
from softdyn.particles.contact_dynamics.loose_box import LooseBox, box_after, loose_box
from softdyn.particles.contact_dynamics.rigid_system import RigidState, RigidSystem
from softdyn.particles.driven import Driven
from softdyn.particles.force_balance import pair_named
from softdyn.particles.geometry import (
    Box,
    Contacts,
    Wall,
    bare_contacts,
    crossing,
    directions,
    dot,
    find_pairs,
    lattice,
    some_of,
)
from softdyn.particles.mechanisms.inertia import momentum_flux
from softdyn.particles.neighbours import SKIN, Listed, common, travelled
from softdyn.particles.resolve import breaks
from softdyn.particles.results import Frame
from softdyn.signals import undisturbed

Array = NDArray[np.float64]
Progress = Callable[[float, int, int], None]

#: Contacts that would still be this far apart, in smallest radii, at the end of a step without impulses are left out
#: at first.
MARGIN = 0.02
#: Steps of a run, and attempts at one: of which contacts there are, and how far they reach.
MOST_STEPS, ATTEMPTS = 10_000_000, 40


#: Part of its length that a box whose stress is imposed keeps in a step, at least.
SHRUNK = 0.5
#: Part of the longest step that a step which does not converge is shortened to, before the run ends.
SHORTEST = 0.1


def integrate(
    system: RigidSystem,
    state: RigidState,
    progress: Progress | None = None,
    after_step: Callable[[], None] | None = None,
    on_frame: Callable[[Frame], None] | None = None,
) -> None:
    """Carry a state on to the end of the scene, in place.

    Parameters
    ----------
    system : RigidSystem
    state : RigidState
    progress : function of (t, steps, Newton steps), optional
    after_step : function, optional
    on_frame : function of a Frame, optional

    Raises
    ------
    IntegrationError
        The state is then the last good one.
    """
    until = float(system.scene.until_t)  # type: ignore[arg-type]
    goals = np.unique(np.concatenate([system.times[system.times > 0], breaks(system), [until]]))
    goals = goals[goals <= until]
    if not len(state.frames) and system.times[0] == 0.0:
        state.frames.append(frame_of(system, state))
    while state.t < until:
        told = len(state.frames)
        made = _step(system, state, float(goals[np.searchsorted(goals, state.t, side="right")]))
        with undisturbed():
            _accept(system, state, made)
            if state.t in system.times:
                state.frames.append(frame_of(system, state))
        if progress is not None:
            progress(state.t, state.counts["steps"], state.effort.newton_steps)
        if on_frame is not None:
            for frame in range(told, len(state.frames)):
                on_frame(state.frames[frame])
        if after_step is not None:
            after_step()


def list_contacts(system: RigidSystem, state: RigidState, skin: float) -> None:
    """List the pairs that are nearer than a skin; those already listed keep their impulses.

    Parameters
    ----------
    system : RigidSystem
    state : RigidState
    skin : float
        Distance of the surfaces, a length.

    Raises
    ------
    SceneError
        If the box is too small.
    """
    i, j, shift = find_pairs(state.x, system.radii, state.box, state.t, state.walls, skin)
    contacts = bare_contacts(i, j, shift, system.radii)
    d = system.dimension
    impulses = np.zeros((len(contacts), d))
    normals, distances = directions(contacts, state.x, lattice(state.box, state.t), state.walls)
    mine, source = common(contacts, state.contacts)
    impulses[mine] = state.impulses[source]
    kept = len(source)
    pressed = int(np.count_nonzero(state.impulses.any(axis=1)))
    lost = pressed - int(np.count_nonzero(state.impulses[source].any(axis=1)))
    state.counts["made"] += len(contacts) - kept
    state.counts["dropped"] += lost
    state.counts["listings"] += 1
    state.contacts, state.impulses = contacts, impulses
    state.normals, state.distances = normals, distances
    walls = np.array([wall.point for wall in state.walls]).reshape(len(state.walls), d)
    state.listed = Listed(state.x.copy(), lattice(state.box, state.t), walls, skin)


class _NotConverged(Exception):
    """No impulses were found that satisfy the laws."""


@dataclass(frozen=True)
class _Made:
    """A step that is made, but not yet taken over.

    Attributes
    ----------
    t, dt : float
        Its end, and its length.
    x, v : arrays
        At its end.
    impulses : array, shape (contacts, d)
        Of all listed contacts.
    normals, distances : arrays
    work : dict
    solution : Solution
    pressed : int
    box : Box
        At its end.
    """

    t: float
    dt: float
    x: Array
    v: Array
    impulses: Array
    normals: Array
    distances: Array
    work: dict[str, float]
    solution: Solution
    pressed: int
    box: Box


def take_step(system: RigidSystem, state: RigidState, goal: float) -> None:
    """Carry a state on by a step towards a goal.

    Parameters
    ----------
    system : RigidSystem
    state : RigidState
    goal : float
        The time at which a step must end.

    Raises
    ------
    IntegrationError
    """
    _accept(system, state, _step(system, state, goal))


def _step(system: RigidSystem, state: RigidState, goal: float) -> _Made:
    """Make a step; contacts that it turns out to need are added, and it is made again."""
    if goal != state.goal:
        state.began, state.goal, state.step = state.t, goal, 0
        state.steps = max(1, math.ceil((goal - state.t) / system.dt * (1 - 1e-12)))
        if state.steps + state.counts["steps"] > MOST_STEPS:
            raise IntegrationError(
                f"{MOST_STEPS} steps of {system.dt:.3g} are not enough: t={state.t:.6g} is reached, and {goal:.6g} is "
                "next; give longer steps, [method] step, or end the run before"
            )
    skin = SKIN * float(system.radii.min())
    for _ in range(ATTEMPTS):
        end = state.goal
        if state.step + 1 < state.steps:
            end = state.began + (state.goal - state.began) * ((state.step + 1) / state.steps)
        dt = (state.goal - state.began) / state.steps
        try:
            made = _attempt(system, state, end, dt)
        except _NotConverged as error:
            if dt < SHORTEST * system.dt:
                raise IntegrationError(str(error)) from None
            # up to the next output time steps are half as long
            state.counts["rejected"] += 1
            state.began, state.step, state.steps = state.t, 0, 2 * (state.steps - state.step)
            continue
        walls = _walls_at(system, state, end)
        farthest = 2 * float(system.radii.max()) + state.listed.skin
        moved = travelled(state.listed, made.x, made.box, end, farthest, walls)
        if moved <= 1.0:
            return made
        state.counts["rejected"] += 1
        skin = max(skin, 1.5 * moved * state.listed.skin if (state.x == state.listed.x).all() else 0.0)
        list_contacts(system, state, skin)
    raise IntegrationError(
        f"the step from t={state.t:.6g} of the length {dt:.3g} moves grains by more than {state.listed.skin:.3g}, "
        "however many contacts are looked at: give shorter steps, [method] step"
    )


def _attempt(system: RigidSystem, state: RigidState, end: float, dt: float) -> _Made:
    """Make a step with the contacts that are listed."""
    contacts, d = state.contacts, system.dimension
    cell = lattice(state.box, state.t)
    normals, distances = directions(contacts, state.x, cell, state.walls)
    gaps = distances - contacts.S
    box = loose_box(system, state, end, dt)
    drifts = _drifts(system, state, end, dt) if box is None else box.drifts()
    impulse = {kind: impulse_of(load, state.t, dt) for kind, load in system.loads.items()}
    total = sum(impulse.values(), np.zeros_like(state.v))
    before = np.zeros(system.free.shape)
    before[: len(state.x)] = state.v
    ahead = before.copy()
    moving = system.free[: len(state.x)] > 0
    given = _given(system, state.t, dt, state.v)
    ahead[: len(state.x)] = np.where(moving, state.v + total / system.masses, given)
    whole = _problem(system, contacts, normals, drifts, gaps / dt, ahead)
    approach, free = dot(whole.slips(before), normals), dot(whole.slips(ahead), normals)
    bounds = gaps / dt
    if system.restitution:
        # those that close by themselves, sooner or later in the step
        closing = (approach < 0) & (gaps + dt * np.minimum(approach, free) <= 0)
        bounds = np.where(closing, system.restitution * approach, bounds)
    movable = whole.mobilities[:, 0] > 0
    scale = dt / state.last_dt if state.last_dt else 0.0
    impulses = state.impulses * scale
    margin = MARGIN * float(system.radii.min()) / dt
    chosen = movable & ((bounds + np.minimum(approach, free) < margin) | impulses.any(axis=1))
    for _ in range(ATTEMPTS):
        rows = np.flatnonzero(chosen)
        problem = _problem(
            system,
            replace_rows(contacts, rows),
            normals[rows],
            drifts[rows],
            bounds[rows],
            ahead,
            None if box is None else box.some(rows),
        )
        solution = solve(problem, impulses[rows], system.rtol, state.effort)
        _require_converged(system, state, contacts, rows, solution)
        if box is not None and problem.box is not None:
            box.rates = problem.box.rates
            drifts[:] = box.drifts()
        left = ~chosen & movable
        missed = left & (dot(whole.slips(solution.v), normals) + gaps / dt < 0)
        if not missed.any():
            break
        impulses = np.zeros_like(impulses)
        impulses[rows] = solution.impulses
        chosen |= missed
    impulses = np.zeros_like(impulses)
    impulses[rows] = solution.impulses
    v = solution.v[: len(state.x)].copy()
    work = _works(system, state, whole, impulses, impulse, before, solution.v)
    pressed = int(np.count_nonzero(impulses.any(axis=1)))
    x = state.x + dt * v[:, :d]
    after = _box_at(system, state, end) if box is None else box_after(system, state, end, dt, box.rates)
    if box is not None and not (after.lengths > SHRUNK * np.diag(cell)).all():
        raise _NotConverged(
            f"the imposed stress makes the box shrink to less than half within the step from t={state.t:.6g}: give "
            "shorter steps, [method] step, or a larger [stress] viscosity"
        )
    return _Made(end, dt, x, v, impulses, normals, distances, work, solution, pressed, after)


def replace_rows(contacts: Contacts, rows: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Both bodies of some contacts."""
    return contacts.i[rows].astype(np.int32), contacts.j[rows].astype(np.int32)


def _require_converged(
    system: RigidSystem, state: RigidState, contacts: Contacts, rows: NDArray[np.int64], solution: Solution
) -> None:
    if solution.converged and np.isfinite(solution.v).all():
        return
    named = pair_named(contacts, int(rows[solution.worst]), len(state.x)) if len(rows) else "no contact"
    raise _NotConverged(
        f"contact dynamics does not converge in the step from t={state.t:.6g}: after {state.effort.sweeps} sweeps and "
        f"{state.effort.newton_steps} steps of Newton's method the impulses are off by {solution.residual:.2g} of the "
        f"largest, most of all at {named}; rtol = {system.rtol:g} is asked for: give shorter steps, [method] step, or "
        "a larger [accuracy] rtol; or nothing can keep the grains apart, as where they are driven together, or jam in "
        "a box of a constant volume"
    )


def _problem(
    system: RigidSystem,
    contacts: Contacts | tuple[NDArray[np.int32], NDArray[np.int32]],
    normals: Array,
    drifts: Array,
    bounds: Array,
    v: Array,
    box: LooseBox | None = None,
) -> Problem:
    """Contacts as the kernel takes them."""
    first, second = (
        contacts if isinstance(contacts, tuple) else (contacts.i.astype(np.int32), contacts.j.astype(np.int32))
    )
    kernel, d = system.kernel, system.dimension
    lights, looses = np.zeros((2, len(v)))
    count = len(system.masses)
    # of grains that are held along some axes mobilities are bounded: those of the free grain
    held = ~system.free[:count].any(axis=1)
    lights[:count] = np.where(held, 0.0, 1 / system.masses[:, 0])
    if system.masses.shape[1] > d:
        looses[:count] = np.where(held, 0.0, 1 / system.masses[:, -1])
    mobilities = np.empty((len(first), 2))
    kernel.mobilities(len(first), first, second, lights, looses, mobilities.reshape(-1))
    frictions = np.full(len(first), system.mu)
    return Problem(
        kernel, first, second, np.ascontiguousarray(normals), np.ascontiguousarray(drifts),
        np.ascontiguousarray(bounds), mobilities, frictions, system.masses, system.free, v, box,
    )  # fmt: skip


def impulse_of(load: Driven, t: float, dt: float) -> Array:
    """Impulse of given forces, or displacement by given velocities, from t on for dt.

    Parameters
    ----------
    load : Driven
        Forces, or velocities.
    t, dt : float
    """
    if any(True for _ in load.changing()):
        return load.integral(t + dt) - load.integral(t)
    return load(t) * dt


def _given(system: RigidSystem, t: float, dt: float, v: Array) -> Array:
    """Mean velocities of what is held or driven in a step, shape (N, width)."""
    given = np.zeros_like(v)
    if system.fixed.any():
        given[:, : system.width] = impulse_of(system.velocity, t, dt) / dt
    return given


def _drifts(system: RigidSystem, state: RigidState, end: float, dt: float) -> Array:
    """Mean velocities of images and of walls, shape (contacts, d)."""
    contacts, count = state.contacts, len(state.x)
    drifts = np.zeros((len(contacts), system.dimension))
    rows = crossing(contacts.shift)
    if state.box.shear_rate or system.box_moves:
        rate = (lattice(_box_at(system, state, end), end) - lattice(state.box, state.t)) / dt
        drifts[rows] = contacts.shift[rows] @ rate.T
    if system.wall_velocity is not None:
        on = np.flatnonzero(contacts.j >= count)
        drifts[on] = (impulse_of(system.wall_velocity, state.t, dt) / dt)[contacts.j[on] - count]
    return drifts


def _box_at(system: RigidSystem, state: RigidState, t: float) -> Box:
    """The box at a time: of a shear rate that changes, by its integral."""
    if not system.box_moves:
        return state.box
    return replace(state.box, tilt=system.lean(t) * float(system.box.lengths[0]), since=t)


def _walls_at(system: RigidSystem, state: RigidState, t: float) -> tuple[Wall, ...]:
    if system.wall_velocity is None:
        return state.walls
    place = system.wall_place(t)
    return tuple(replace(wall, point=point) for wall, point in zip(state.walls, place, strict=True))


def _works(
    system: RigidSystem,
    state: RigidState,
    problem: Problem,
    impulses: Array,
    loads: dict[str, Array],
    before: Array,
    after: Array,
) -> dict[str, float]:
    """Energies that are exchanged in a step; they sum up to rounding."""
    count = len(state.x)
    v0, v1 = before[:count], after[:count]
    mean = (v0 + v1) / 2
    work = dict.fromkeys(system.works, 0.0)
    work["kinetic"] = float(np.sum(system.masses * (v1 - v0) * mean))
    for kind, impulse in loads.items():
        work[kind] += float(np.sum(impulse * v1))
        work["steps"] += float(np.sum(impulse * (v1 - mean)))
    slips = (problem.slips(before) + problem.slips(after)) / 2
    normal = dot(impulses, problem.normals)
    along = dot(slips, problem.normals)
    work["collisions"] = -float(np.sum(normal * along))
    work["friction"] = -float(np.sum(dot(impulses, slips) - normal * along))
    drift = dot(impulses, problem.drifts)
    on_walls = problem.second >= count
    work["external"] -= float(np.sum(drift[on_walls]))
    work["box"] -= float(np.sum(drift[~on_walls]))
    if system.fixed.any():
        pushed = np.zeros_like(before)
        ones = np.ones(before.size)
        problem.kernel.kicks(
            len(problem), problem.first, problem.second, problem.laws[0], impulses.reshape(-1), ones, pushed.reshape(-1)
        )
        reaction = system.masses * (v1 - v0) - pushed[:count] - sum(loads.values(), np.zeros_like(v0))
        work["external"] += float(np.sum(np.where(system.free[:count] > 0, 0.0, reaction) * mean))
    return work


def _accept(system: RigidSystem, state: RigidState, made: _Made) -> None:
    """Take a step over."""
    state.box = made.box
    state.walls = _walls_at(system, state, made.t)
    state.t, state.x, state.v, state.impulses = made.t, made.x, made.v, made.impulses
    state.normals, state.distances, state.last_dt = made.normals, made.distances, made.dt
    state.step += 1
    for kind, amount in made.work.items():
        state.work[kind] += amount
    state.counts["steps"] += 1
    error = made.solution.residual / system.rtol
    state.history.append((made.t, made.dt, made.solution.residual, error, made.pressed))
    farthest = 2 * float(system.radii.max()) + state.listed.skin
    if travelled(state.listed, state.x, state.box, state.t, farthest, state.walls) > 0.8:
        list_contacts(system, state, SKIN * float(system.radii.min()))


def frame_of(system: RigidSystem, state: RigidState) -> Frame:
    """Frame of the present state; forces are the impulses of the last step over its length."""
    d, contacts = system.dimension, state.contacts
    rows = np.flatnonzero(state.impulses.any(axis=1))
    forces = state.impulses[rows] / state.last_dt if state.last_dt else np.zeros((len(rows), d))
    n = state.normals[rows]
    F = dot(forces, n)
    stress = -np.einsum("c,ca,cb->ab", state.distances[rows], forces, n)
    if state.box.periodic.all():
        flux = momentum_flux(system.masses[:, 0], state.x, state.v[: len(state.x), :d], state.box.gradient)
        stress = (stress - flux) / state.box.volume
    cell = lattice(state.box, state.t)
    shown = some_of(contacts, rows)
    _, r = directions(shown, state.x, cell, state.walls)
    energy = np.array([*(state.work[name] for name in system.works), 0.0])
    turning = system.width > d
    return Frame(
        state.t,
        state.x.copy(),
        state.v[:, :d].copy(),
        shown.i,
        shown.j,
        shown.shift,
        np.maximum(r - shown.S, 0.0),
        F,
        stress,
        cell,
        np.array([wall.point for wall in state.walls]).reshape(len(state.walls), d),
        state.box.gradient,
        energy,
        forces - F[:, None] * n if turning else np.zeros((len(rows), 0)),
        state.v[:, d:] / system.radii[:, None] if turning else np.zeros((len(state.x), 0)),
    )
