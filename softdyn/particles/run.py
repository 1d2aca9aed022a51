"""Running a scene of many particles."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import checkpoint as checkpoints
from softdyn.particles import linear, sliding
from softdyn.particles.geometry import Box, directions, lattice
from softdyn.particles.kernel import energies, get_contact_kernel
from softdyn.particles.method import ORDER
from softdyn.particles.neighbours import common, find_contacts, resistances, travelled
from softdyn.particles.results import Frame, ParticleResult, frame_of, gather
from softdyn.particles.scene import (
    AXES,
    Checked,
    ParticleScene,
    check,
    particles_named,
    uniform_values,
    varying_parameters,
    with_rotations,
)
from softdyn.particles.state import State
from softdyn.particles.step import (
    TANGENTIAL_WORKS,
    Newton,
    Output,
    Step,
    StepFailed,
    System,
    balance,
    contact_state,
    gauge_axes,
    pair_named,
    take_step,
    turns_freely,
    works,
)

Array = NDArray[np.float64]
Progress = Callable[[float, int, int], None]

MOST_STEPS = 1_000_000
#: Seconds between two checkpoints.
CHECKPOINT_EVERY = 30.0
SMALLEST_STEP = 1e-12
#: A step is longer than the one before by this factor at most.
LARGEST_GROWTH = 3.0
#: A strain is reached to this fraction of it.
STRAINED = 1e-9
#: Imbalance of the energy, in units of rtol, from which the result warns: errors of some steps may add up to a few.
IMBALANCE = 3.0
#: Gap, relative to the radius, below which a film is drained: the distance of two centres tells no smaller one.
DRAINED = float(np.finfo(float).eps)
#: External forces on what may move freely must balance to this fraction.
UNBALANCED = 1e-9
#: So must their torque; it depends on the positions, and is known to their accuracy.
UNTURNED = 1e-4


def simulate_particles(
    scene: ParticleScene, progress: Progress | None = None, checkpoint: str | Path | None = None, resume: bool = False
) -> ParticleResult:
    """Integrate a scene.

    Parameters
    ----------
    scene : ParticleScene
    progress : function of (t, steps, Newton iterations), optional
        Called after every step.
    checkpoint : str or Path, optional
        File to which the state is written now and then, and when the run is interrupted or cannot go on; it is removed
        at the end.
    resume : bool
        Whether to go on from that file, if it is there.

    Returns
    -------
    ParticleResult

    Raises
    ------
    SceneError
        If the scene cannot be used.
    IntegrationError
        If it cannot be carried to its end: naming the particles or the contact at fault. Its attribute ``partial`` is
        the result up to the last good state.
    """
    began = time.perf_counter()
    checkpoint = None if checkpoint is None else Path(checkpoint)
    checked, system = prepare(scene)
    newton = Newton()
    key = checkpoints.fingerprint(scene, checked, system)
    if resume and checkpoint is not None and checkpoint.exists():
        state = checkpoints.load(checkpoint, key, checked)
    else:
        state = start(scene, checked, system, newton)
    last = time.monotonic()

    def now_and_then(state: State) -> None:
        nonlocal last
        if checkpoint is not None and time.monotonic() - last > CHECKPOINT_EVERY:
            checkpoints.save(checkpoint, state, key)
            last = time.monotonic()

    try:
        integrate(scene, checked, system, newton, state, progress, now_and_then)
    except IntegrationError as error:
        error.partial = _result(scene, checked, system, newton, state, began)
        if checkpoint is None:
            raise
        checkpoints.save(checkpoint, state, key)
        stopped = IntegrationError(f"{error}; the last good state, at t={state.t:.6g}, is in {checkpoint}")
        stopped.partial = error.partial
        raise stopped from None
    except KeyboardInterrupt:
        if checkpoint is not None:
            checkpoints.save(checkpoint, state, key)
        raise
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return _result(scene, checked, system, newton, state, began)


def prepare(scene: ParticleScene) -> tuple[Checked, System]:
    """Check a scene, and get its kernel.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    checked = check(scene)
    varying = varying_parameters(scene, checked)
    kernel = get_contact_kernel(
        scene.law,
        scene.target,
        varying=varying,
        fading=scene.reach is not None,
        tangential=bool(scene.tangential),
        drag=bool(scene.drag),
    )
    p = uniform_values(scene, checked, kernel)
    fixed, force, velocity = checked.fixed, checked.force, checked.velocity
    if kernel.tangential:
        fixed, force, velocity = with_rotations(checked)
    system = System(
        kernel=kernel,
        p=p,
        reach=math.inf if scene.reach is None else float(scene.reach),
        box=checked.box,
        walls=checked.walls,
        radii=checked.radii,
        resistance=resistances(scene, checked, kernel, p),
        fixed=fixed,
        force=force,
        velocity=velocity,
        rtol=float(scene.rtol),
        imposed=checked.imposed,
        wall_velocity=checked.wall_velocity,
    )
    return checked, system


def start(scene: ParticleScene, checked: Checked, system: System, newton: Newton) -> State:
    """Initial state: gaps from the scene; without drag, positions in elastic equilibrium at these gaps.

    Raises
    ------
    SceneError
        If surfaces overlap and no gap is given, or external forces have nothing to balance them.
    IntegrationError
        If there is no equilibrium to start from.
    """
    x = checked.x.copy()
    contacts, listed, made, _ = find_contacts(scene, checked, system.kernel, x, 0.0, None, system.box, system.walls)
    closed = np.flatnonzero(~(contacts.h > 0))
    if len(closed):
        c = int(closed[0])
        raise SceneError(
            f"{len(closed)} pairs overlap, particles {contacts.i[c]} and {contacts.j[c]} first: give the initial gap "
            "of pressed particles, [contacts] gap"
        )
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
        work=dict.fromkeys(works(system), 0.0),
        counts={"made": made, "dropped": 0, "steps": 0, "rejected": 0, "listings": 1},
    )
    if not np.any(system.drag > 0) and not system.fixed.all():
        _require_balanced(system, 0.0, x)
        _require_held(system, state, np.asarray(_free(system).any(axis=1)))
        nothing, place, known = np.zeros(len(contacts)), x.copy(), None
        if system.kernel.tangential:  # surfaces stick for the instant in which it is reached
            normal, _, _ = directions(contacts, x, lattice(system.box, 0.0), system.walls)
            known, place = sliding.starting(contacts, system.radii, normal), np.zeros(system.fixed.shape)
            place[:, : x.shape[1]] = x
        try:
            found = balance(
                system, contacts, newton, 0.0, 0.0, place, place.copy(), contacts.h, nothing, nothing.copy(), known
            )
        except (StepFailed, linear.Indefinite) as error:
            raise IntegrationError(
                f"at the start, with the gaps as given, the forces have no equilibrium: {_why(system, state, error)}"
            ) from None
        state.x = found.x[:, : x.shape[1]]
        contacts.h = found.h  # beyond the range pressed gaps follow the centres
        if found.slid is not None:
            contacts.T = found.slid.force
        newton.forget()
    state.dt = _first_step(scene, system, state)
    state.stored0 = _stored(system, state)
    return state


def _overlaps(system: System, state: State) -> Array:
    _, r, _ = directions(state.contacts, state.x, lattice(system.box, state.t), system.walls)
    return state.contacts.S - r


def _stored(system: System, state: State) -> float:
    contacts, overlap = state.contacts, _overlaps(system, state)
    U, _ = energies(system.kernel, system.reach, overlap, contacts.h, system.p, contacts.q.reshape(-1))
    stored = float(U.sum())
    if system.kernel.tangential:
        k_t = contact_state(system, contacts, overlap, contacts.h)["k_t"]
        stored += float(np.sum(contacts.T**2 / (2 * k_t[:, None])))
    return stored


def _free(system: System) -> NDArray[np.bool_]:
    """Positions that follow from forces, shape (N, d)."""
    return np.asarray(~system.fixed[:, : system.dimension])


def _present(system: System, state: State) -> System:
    """With the box and the walls as they are now."""
    return replace(system, box=state.box, walls=state.walls)


def _exchanged(system: System, state: State) -> Array:
    """Energies exchanged since the start."""
    return np.array([*(state.work[name] for name in works(system)), _stored(system, state) - state.stored0])


def _frame(system: System, state: State) -> Frame:
    return frame_of(system, state.t, state.x, state.v, state.contacts, _exchanged(system, state))


def _frame_within(output: Output, state: State) -> Frame:
    """Frame of a state within the step from the present one."""
    at, d = output.at, output.system.dimension
    contacts = replace(state.contacts, h=at.h, T=state.contacts.T if at.slid is None else at.slid.force)
    work = {name: state.work[name] + amount for name, amount in output.work.items()}
    return _frame(output.system, replace(state, t=output.t, x=at.x[:, :d], v=output.v, contacts=contacts, work=work))


def _first_step(scene: ParticleScene, system: System, state: State) -> float:
    """A length over which no gap changes by more than a hundredth, as far as the present rates tell."""
    overlap = _overlaps(system, state)
    values = contact_state(system, state.contacts, overlap, state.contacts.h)
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.abs(values["dh_dt"] / state.contacts.h)[state.contacts.h < system.reach]
    fastest = float(np.max(rates[np.isfinite(rates)], initial=abs(scene.shear_rate)))
    longest = 1e-2 * float(scene.until)
    return min(longest, 1e-2 / fastest) if fastest > 0 else longest


def _require_held(system: System, state: State, free: NDArray[np.bool_]) -> None:
    """Without drag: every particle needs a contact, and all of them one cluster, under forces that balance."""
    contacts, count = state.contacts, len(state.x)
    active = contacts.h < system.reach
    touched = np.zeros(count, bool)
    pair = active & (contacts.j < count)
    touched[contacts.i[active]] = True
    touched[contacts.j[pair]] = True
    alone = np.flatnonzero(free & ~touched)
    remedy = "give the particles a drag ([flow] drag = 1), or hold them"
    if len(alone):
        raise IntegrationError(
            f"without drag nothing resists the motion of {particles_named(alone)}, without any contact within range, "
            f"at t={state.t:.6g}: {remedy}"
        )
    links = coo_array((np.ones(int(pair.sum())), (contacts.i[pair], contacts.j[pair])), shape=(count, count))
    clusters, label = connected_components(links, directed=False)
    anchored = set(label[~_free(system).all(axis=1)]) | set(label[contacts.i[active & (contacts.j >= count)]])
    loose = [k for k in range(clusters) if k not in anchored]
    if len(loose) > 1 or (loose and anchored):
        sizes = [np.flatnonzero(label == k) for k in loose]
        smallest = min(sizes, key=len)
        raise IntegrationError(
            f"without drag the cluster of {particles_named(smallest)} is connected to no other, at t={state.t:.6g}, "
            f"and nothing resists its motion: {remedy}"
        )


def _require_balanced(system: System, t: float, x: Array) -> None:
    """External forces along axes on which everything moves freely sum to zero; so do torques, with those of forces."""
    external, d = system.force(t), system.dimension
    force = external[:, :d]
    for axis in gauge_axes(system):
        total, size = float(force[:, axis].sum()), float(np.abs(force[:, axis]).sum())
        if abs(total) > UNBALANCED * size:
            raise IntegrationError(
                f"the external forces along {AXES[axis]} sum to {total:.6g} at t={t:.6g}, and without drag nothing "
                "balances them: give the particles a drag ([flow] drag = 1), hold one of them, or balance the forces"
            )
    if turns_freely(system) and external.any():
        away, torques = x - x.mean(axis=0), external[:, d:] * system.radii[:, None]
        total = sliding.torque(away, force).sum(axis=0)
        allowed = UNTURNED * float(np.linalg.norm(away, axis=1) @ np.linalg.norm(force, axis=1))
        if torques.size:
            total = total + torques.sum(axis=0)
            allowed += UNBALANCED * float(np.abs(torques).sum())
        torque = float(np.abs(total).max())
        if torque > allowed:
            raise IntegrationError(
                f"the external forces have the torque {torque:.6g} at t={t:.6g}, and without drag nothing resists it: "
                "give the particles a drag ([flow] drag = 1), hold two of them, or balance the forces"
            )


def integrate(
    scene: ParticleScene,
    checked: Checked,
    system: System,
    newton: Newton,
    state: State,
    progress: Progress | None = None,
    after_step: Callable[[State], None] | None = None,
) -> None:
    """Carry a state on to the end of the scene, in place.

    Raises
    ------
    IntegrationError
        The state is then the last good one.
    """
    system = _present(system, state)
    until, grow = float(scene.until), LARGEST_GROWTH
    if not state.frames and checked.times[0] == 0.0:
        state.frames.append(_frame(system, state))
    while state.t < until and not _has_strained(scene, state):
        if state.counts["steps"] + state.counts["rejected"] > MOST_STEPS:
            raise IntegrationError(f"{MOST_STEPS} steps were not enough: t={state.t:.6g} of {until:.6g} is reached")
        _require_balanced(system, state.t, state.x)
        dt, when = _length(state, until)
        ahead = state.x + dt * state.v[:, : system.dimension]
        if _drift(checked, system, state, ahead, system, when) > 1.0 and _drift(checked, system, state) > 0:
            _list_again(scene, checked, system, newton, state)
        step, failure = _attempt(checked, system, newton, state, dt, when)
        if step is None or not step.error <= 1.0:
            _shorten(system, state, until, dt, math.inf if step is None else step.error, failure)
            newton.s, grow = newton.s if failure is None else 0.0, 1.0
            continue
        if _drift(checked, system, state, step.end.x[:, : system.dimension], step.system, when) > 1.0:
            # further than the list of contacts reaches, and than was expected
            if _drift(checked, system, state) > 0:
                _list_again(scene, checked, system, newton, state)
            else:
                newton.forget()
                state.dt = 0.5 * dt
            continue
        over = _beyond(scene, state, step, when)
        if over is not None:
            state.dt = over
            continue
        _require_films(system, state, step.end.h, when)
        system = _accept(system, state, step, dt, when, grow)
        grow = LARGEST_GROWTH
        if _drift(checked, system, state) > 0.5:
            _list_again(scene, checked, system, newton, state)
        if state.t in checked.times or _has_strained(scene, state):
            state.frames.append(_frame(system, state))
        if progress is not None:
            progress(state.t, state.counts["steps"], newton.counts["iterations"])
        if after_step is not None:
            after_step(state)


def _length(state: State, until: float) -> tuple[float, float]:
    """Length of the next step, and its end: no sliver is left before the end of the run."""
    left = until - state.t
    if state.dt >= 0.99 * left:
        return left, until
    dt = min(state.dt, 0.5 * left) if state.dt > 0.5 * left else state.dt
    return dt, state.t + dt


def _drift(
    checked: Checked,
    system: System,
    state: State,
    x: Array | None = None,
    at: System | None = None,
    t: float | None = None,
) -> float:
    """By how much surfaces have come closer, or will have at x, since contacts were listed, in units of the skin."""
    if math.isinf(system.reach):
        return 0.0
    where = system if at is None else at
    farthest = 2 * float(checked.radii.max()) + system.reach + state.listed.skin
    place, when = (state.x, state.t) if x is None or t is None else (x, t)
    return travelled(state.listed, place, where.box, when, farthest, where.walls)


def _attempt(
    checked: Checked, system: System, newton: Newton, state: State, dt: float, when: float
) -> tuple[Step | None, Exception | None]:
    """Try a step; or what it failed of."""
    within = checked.times[(checked.times > state.t) & (checked.times < when)]
    try:
        step = take_step(
            system, state.contacts, newton, state.t, state.x, state.v, state.y_rate, dt, within, state.power
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
    state.dt = dt * (max(0.2, 0.9 * error ** (-1 / ORDER)) if math.isfinite(error) else 0.5)
    if state.dt < SMALLEST_STEP * until or state.t + 0.1 * state.dt == state.t:
        tolerance = f"the tolerance rtol={system.rtol:g} cannot be met"
        cause = tolerance if failure is None else _why(system, state, failure)
        raise IntegrationError(f"the run cannot go on at t={state.t:.6g}, however short the step: {cause}")
    if failure is not None:
        state.v, state.y_rate, state.power = np.zeros_like(state.v), np.zeros_like(state.y_rate), None


def _accept(system: System, state: State, step: Step, dt: float, when: float, grow: float) -> System:
    """Take the end of a step for the state; returns the system with box and walls as they are there."""
    if state.frames and state.frames[0].t == state.t == 0.0:
        state.frames[0] = _frame(system, replace(state, v=step.first_v))
    for output in step.outputs:
        state.frames.append(_frame_within(output, state))
    state.t, state.x, state.v = when, step.end.x[:, : system.dimension], step.v
    state.box, state.walls = step.system.box, step.system.walls
    # the state y is counted from the gap at the start of a step: its rate is that of ln h at the next
    state.y_rate = step.y_rate / np.sqrt(1 + step.end.y**2)
    state.contacts.h = step.end.h
    if step.end.slid is not None:
        state.contacts.T = step.end.slid.force
    for name, amount in step.work.items():
        state.work[name] += amount
    touching = step.end.h < system.reach
    state.counts["made"] += int(np.sum(touching & ~state.contacts.touched))
    state.contacts.touched |= touching
    state.counts["steps"] += 1
    state.history.append((state.t, dt, step.end.residual, step.error, int(touching.sum())))
    longer = dt * min(grow, 0.9 * max(step.error, 1e-12) ** (-1 / ORDER))
    # a step shortened to end says nothing against a longer one
    state.dt = max(longer, state.dt) if dt < state.dt and longer > dt else longer
    state.power = step.power
    return step.system


def _strain(box: Box, t: float) -> float:
    """Shear strain of the box."""
    cell = lattice(box, t)
    return float(cell[0, 1] / cell[1, 1])


def _has_strained(scene: ParticleScene, state: State) -> bool:
    """Whether the strain is reached at which the run ends."""
    if scene.until_strain is None:
        return False
    return abs(_strain(state.box, state.t)) >= abs(scene.until_strain) * (1 - STRAINED)


def _beyond(scene: ParticleScene, state: State, step: Step, when: float) -> float | None:
    """A shorter step, if this one goes beyond the strain at which the run ends; None if not."""
    if scene.until_strain is None:
        return None
    goal, end, start = abs(scene.until_strain), abs(_strain(step.system.box, when)), abs(_strain(state.box, state.t))
    if end <= goal * (1 + STRAINED):
        return None
    return (when - state.t) * (goal - start) / (end - start)


def _require_films(system: System, state: State, h: Array, when: float) -> None:
    """No film is drained: attraction without anything at short range to stop it closes a gap within a finite time."""
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


def _list_again(scene: ParticleScene, checked: Checked, system: System, newton: Newton, state: State) -> None:
    """Look for contacts at the present positions; gaps, guesses and forces stay."""
    old = state.contacts
    state.contacts, state.listed, _, dropped = find_contacts(
        scene, checked, system.kernel, state.x, state.t, old, system.box, system.walls
    )
    new, known = common(state.contacts, old)
    y_rate, state.y_rate = state.y_rate, np.zeros(len(state.contacts))
    state.y_rate[new] = y_rate[known]
    closed = np.flatnonzero(~(state.contacts.h > 0))
    if len(closed):
        c = int(closed[0])
        raise IntegrationError(
            f"particles {state.contacts.i[c]} and {state.contacts.j[c]} have passed through each other's range within "
            f"one step at t={state.t:.6g}: ask for a smaller rtol"
        )
    fresh = (state.contacts.h < system.reach) & ~state.contacts.touched
    state.contacts.touched |= fresh
    state.counts["made"] += int(fresh.sum())
    state.counts["dropped"] += dropped
    state.counts["listings"] += 1
    newton.forget()


def _twisted(system: System, state: State) -> NDArray[np.int64]:
    """Particles with an external torque that neither drag nor any contact resists."""
    if not system.kernel.tangential or np.any(system.drag > 0):
        return np.empty(0, dtype=np.int64)
    near = np.flatnonzero(state.contacts.h < system.reach)
    n, _, _ = directions(state.contacts, state.x, lattice(system.box, state.t), system.walls)
    torques = np.where(system.fixed, 0.0, system.force(state.t))[:, system.dimension :]
    left = sliding.unresisted(state.contacts.i[near], state.contacts.j[near], n[near], torques)
    return np.flatnonzero(np.abs(left).max(axis=1) > UNBALANCED * np.abs(torques).max())


def _why(system: System, state: State, error: Exception) -> str:
    """Words for what a step failed of."""
    twisted = _twisted(system, state)
    if len(twisted):
        return (
            f"nothing resists the external torque on {particles_named(twisted)}: without drag films do, but for a "
            "twist about their normal; give the particles a drag ([flow] drag = 1), or contacts along another line"
        )
    if not isinstance(error, linear.Indefinite):
        return str(error)
    if not np.any(system.drag > 0):
        _require_held(system, state, np.asarray(_free(system).any(axis=1)))
    size = np.linalg.norm(error.direction(), axis=1)
    worst = np.flatnonzero(size > 0.3 * size.max())
    worst = worst[np.argsort(-size[worst], kind="stable")]
    remedy = (
        "a shorter step does not help; the forces pull or press it over"
        if np.any(system.drag > 0)
        else "without drag such a motion has no resistance: give the particles a drag ([flow] drag = 1), hold them, or "
        "add contacts"
    )
    kind = "turn as a whole" if turns_freely(system) and len(worst) > 0.9 * len(size) else "give way"
    who = f"{particles_named(worst)} can {kind} without any force to resist"
    return f"{who} (floppy, or unstable under pressure); {remedy}"


def _result(
    scene: ParticleScene, checked: Checked, system: System, newton: Newton, state: State, began: float
) -> ParticleResult:
    stored = _stored(_present(system, state), state) - state.stored0
    work = state.work
    given = work["external"] + work["flow"] + work["box"]
    taken = stored + work["U_h"] + work["gaps"] + work["drag"] + work["remote"]
    taken += sum(work[name] for name in works(system) if name in TANGENTIAL_WORKS)
    size = sum(abs(value) for value in work.values()) + abs(stored)
    stats: dict[str, Any] = {
        "method": "SDIRK of order 3 in positions and gaps",
        **state.counts,
        **{f"newton_{name}": number for name, number in newton.counts.items()},
        **(newton.solver.counts if newton.solver else {}),
        "linear_solver": newton.solver.method if newton.solver else "",
        "force_residual": max((row[2] for row in state.history), default=0.0),
        "wall_s": time.perf_counter() - began,
        "compile_s": system.kernel.compile_s,
        "kernel": system.kernel.key,
    }
    energy = {**work, "stored": stored, "imbalance": (given - taken) / size if size else 0.0}
    stats["warnings"] = []
    if abs(energy["imbalance"]) > IMBALANCE * system.rtol:
        stats["warnings"].append(
            f"the balance of energy is off by {energy['imbalance']:.1e} of the sum of its terms, {size:.3g}: more than "
            f"{IMBALANCE:g} rtol"
        )
    return gather(scene, checked, system, state.frames, state.history, energy, stats)
