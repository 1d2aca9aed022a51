"""From the start of a run of grains to its end: stretches of equal steps, each bounded by accuracy and stability.

Verlet's method turns a frequency omega into omega (1 + (omega dt)^2/24): a step is so short that this is within rtol.
The largest frequency is bounded by the contacts: with the sum S of the stiffnesses at each particle, omega^2 is at most
the largest of S_i/m_i + S_j/m_j over all contacts (each is a spring between its shares of the masses, in proportion to
stiffness), a tangential stiffness counting with the inertia of rotation, a dashpot with 2/dt of its coefficient. The
kernel finds S in every step, and stops where it grows beyond what the step was chosen for; a stretch in which it came
near the limit of stability, omega dt = 2, is done again. Where nothing touches yet, the stiffness is that of a
collision at the largest speed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.particles.explicit.given import Given, given_over
from softdyn.particles.explicit.grains import SUMS, Grains, GrainSystem, tilt_at
from softdyn.particles.explicit.lists import list_again, reach_of, skin_of
from softdyn.particles.explicit.touching import (
    accelerations,
    frame_of,
    inertia_of,
    kinetic_energy,
    law_of_contacts,
    shear_rate_at,
    stored_energies,
    touching,
)
from softdyn.particles.portions import processors
from softdyn.particles.resolve import breaks
from softdyn.particles.results import Frame
from softdyn.signals import undisturbed

Array = NDArray[np.float64]
Progress = Callable[[float, int, int], None]

#: Steps of a stretch, at most, and entries of the tables of what is given over it.
STRETCH, ENTRIES = 500, 2_000_000
#: Largest omega dt, whatever the tolerance.
LONGEST = 0.5
#: A stretch ends where omega^2 exceeds what its steps were chosen for by this factor, and is done again where
#: (omega dt)^2 exceeds that number; 4 is the limit of stability.
GROWTH, UNSTABLE = 1.5, 3.0
#: Part of the skin that nothing moves more than in a step; and of the way that the list allows, at which it is renewed.
HURRY, STALE = 0.05, 0.8
#: Blocks of particles, whose sums are taken in order, and fewest particles of one.
BLOCKS, SMALLEST_BLOCK = 64, 64
#: Particles from which on threads share the work.
SHARED = 2000
#: Part of a step with which a pair that is pressed too deep is tried once more, before that is held for the truth.
CROSSING = 0.2
#: Attempts at a stretch.
ATTEMPTS = 60


def threads_for(system: GrainSystem) -> int:
    """Threads that share a step: as many as there are processors, or OMP_NUM_THREADS; one for few particles."""
    if system.kernel.target != "c" or len(system.x) < SHARED:
        return 1
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return min(processors(), int(asked)) if asked.isdigit() and int(asked) > 0 else processors()


def integrate(
    system: GrainSystem,
    state: Grains,
    progress: Progress | None = None,
    after_stretch: Callable[[], None] | None = None,
    on_frame: Callable[[Frame], None] | None = None,
) -> None:
    """Carry a state on to the end of the scene, in place.

    Parameters
    ----------
    system : GrainSystem
    state : Grains
    progress : function of (t, steps, 0), optional
    after_stretch : function, optional
        Called after every stretch of steps.
    on_frame : function of a Frame, optional

    Raises
    ------
    IntegrationError
        The state is then the last good one.
    """
    until = float(system.scene.until_t)  # type: ignore[arg-type]
    goals = np.unique(np.concatenate([system.times[system.times > 0], breaks(system), [until]]))
    goals = goals[goals <= until]
    with ThreadPoolExecutor(max(1, threads_for(system) - 1)) as pool:
        while state.t < until:
            told = len(state.frames)
            goal = float(goals[np.searchsorted(goals, state.t, side="right")])
            _stretch(system, state, goal, pool)
            with undisturbed():
                if state.t in system.times:
                    state.frames.append(frame_now(system, state))
            if progress is not None:
                progress(state.t, state.counts["steps"], 0)
            if on_frame is not None:
                for number in range(told, len(state.frames)):
                    on_frame(state.frames[number])
            if after_stretch is not None:
                after_stretch()


def carry_to(system: GrainSystem, state: Grains, goal: float, pool: ThreadPoolExecutor) -> None:
    """Carry a state on to a time, in place, without anything told: for who has the grains in something else.

    Parameters
    ----------
    system : GrainSystem
    state : Grains
    goal : float
        The time.
    pool : ThreadPoolExecutor
        Which shares the work.

    Raises
    ------
    IntegrationError
        The state is then the last good one.
    """
    while state.t < goal:
        _stretch(system, state, goal, pool)


def frame_now(system: GrainSystem, state: Grains) -> Frame:
    """Frame of the present state."""
    walls, speeds = walls_at(system, state.t)
    return frame_of(system, state, touching(system, state, walls, speeds), walls)


def walls_at(system: GrainSystem, t: float) -> tuple[Array, Array]:
    """A point of each wall, and its velocity."""
    if system.wall_velocity is None:
        return system.walls0, np.zeros_like(system.walls0)
    return system.wall_place(t), system.wall_velocity(t)


def _stretch(system: GrainSystem, state: Grains, goal: float, pool: ThreadPoolExecutor) -> None:
    """Some steps towards a goal: a jump, an output time, or the end."""
    if state.moved > STALE**2 or not _way(system, state, state.t) > 0:
        list_again(system, state)
    shrink = 1.0
    for _ in range(ATTEMPTS):
        dt, longest = _length(system, state, goal)
        dt *= shrink
        if not state.t + dt > state.t:
            raise IntegrationError(f"the run cannot go on at t={state.t:.6g}: no step is short enough")
        left = goal - state.t
        needed = max(1, math.ceil(left / dt * (1 - 1e-12)))
        most = max(1, min(STRETCH, ENTRIES // max(1, system.groups.shape[0] * system.groups.shape[1])))
        whole = needed <= most
        steps = min(needed, most)
        dt = left / needed if whole else dt
        before = replace(state, counts=dict(state.counts))
        for name in ("x", "v", "spin", "rate_v", "history", "touch", "wall_history", "wall_touch", "sums"):
            setattr(before, name, getattr(state, name).copy())
        done, marks = _run(system, state, dt, steps, goal if whole else None, pool)
        worst = 2 * marks[:, 1].max() * dt**2
        if np.isfinite(marks).all() and worst < UNSTABLE and marks[:, 0].max() <= 1.0 and marks[:, 4].max() <= 0.5:
            state.counts["steps"] += done
            state.history_rows.append((state.t, dt, 0.0, dt / longest, int(state.touch.sum() + state.wall_touch.sum())))
            return
        deep = int(np.argmax(marks[:, 4]))
        words = _words(system, state, marks[deep])
        for name in vars(before):
            setattr(state, name, getattr(before, name))
        state.counts["rejected"] += 1
        if not marks[deep, 4] <= 0.5 and shrink < CROSSING:
            raise IntegrationError(words)
        if marks[:, 0].max() > 1.0 and state.moved > 0:
            list_again(system, state)
        shrink *= 0.5
    raise IntegrationError(
        f"the run cannot go on at t={state.t:.6g}, however short the step: contacts get stiffer, or grains faster, "
        "within every step than it allows"
    )


def _words(system: GrainSystem, state: Grains, mark: Array) -> str:
    """Who overlaps too deeply."""
    i, j = int(mark[2]), int(mark[3])
    other = f"particle {state.order[j]}" if j >= 0 else f"wall {-1 - j}"
    return (
        f"particle {state.order[i]} and {other} overlap by {mark[4]:.3g} of the smaller radius near t={state.t:.6g}: "
        "one is about to pass through the other, and no law holds there; give the grains a stiffer law, or less speed "
        "or load"
    )


def _way(system: GrainSystem, state: Grains, t: float) -> float:
    """How far a particle may be from where it was when pairs were listed, apart from the motion of the box."""
    return (skin_of(system) - abs(_strain(system, state, t)) * reach_of(system)) / 2


def _strain(system: GrainSystem, state: Grains, t: float) -> float:
    """Strain of the box since pairs were listed."""
    if not system.kernel.sheared:
        return 0.0
    return (tilt_at(system, t) - state.listed_tilt) / float(system.box.lengths[1])


def _length(system: GrainSystem, state: Grains, goal: float) -> tuple[float, float]:
    """Length of the next steps, and the longest that the tolerance allows, whatever else bounds them."""
    accuracy = min(LONGEST, math.sqrt(24 * system.rtol))
    # contacts push for a short while, and are seen to by the kernel; weights and pushes act on
    d = system.dimension
    given = system.load[state.order] + state.given_force[system.groups.of[state.order], :d]
    pull = float((np.abs(given) / system.mass[state.order][:, None]).max(initial=0.0))
    speed = state.fastest + float(np.linalg.norm(walls_at(system, state.t)[1], axis=1).max(initial=0.0))
    skin, left = skin_of(system), goal - state.t
    dt = left
    for _ in range(3):  # the speed at the end of the stretch is that of its steps
        square = max(2 * state.stiffest, _collision(system, 2 * (speed + pull * min(left, STRETCH * dt))))
        longest = accuracy / math.sqrt(square) if square > 0 else math.inf
        dt = min(left, longest)
        ahead = speed + pull * min(left, STRETCH * dt)
        dt = min(dt, HURRY * skin / ahead) if ahead > 0 else dt
    rate = abs(shear_rate_at(system, state.t)) if system.kernel.sheared else 0.0
    dt = min(dt, HURRY * skin / (rate * reach_of(system))) if rate else dt
    return dt, longest if math.isfinite(longest) else dt


def _collision(system: GrainSystem, speed: float) -> float:
    """Largest omega^2 of a collision of two equal grains, the lightest or the heaviest, at a relative speed."""
    if not speed > 0:
        return 0.0
    found = 0.0
    for which_one in (int(np.argmin(system.mass)), int(np.argmax(system.mass))):
        mass, radius = float(system.mass[which_one]), float(system.radii[which_one])
        kind = int(system.species[which_one]) * (system.kinds + 1)
        # overlaps up to the radius: the first at which the force has taken the energy
        overlap = radius * np.logspace(-12, 0, 121)
        law = law_of_contacts(system, overlap, np.full(len(overlap), radius), np.full(len(overlap), kind))
        energy = np.concatenate([[0.0], np.cumsum(np.diff(overlap) * (law["F_ela"][1:] + law["F_ela"][:-1]) / 2)])
        at = min(int(np.searchsorted(energy, 0.25 * mass * speed**2)), len(overlap) - 1)
        stiffness = float(law["stiffness"][: at + 1].max())
        if "k_t" in law:
            stiffness = max(stiffness, system.spun * float(law["k_t"][: at + 1].max()))
        found = max(found, 2 * stiffness / mass)
    return found


def _run(
    system: GrainSystem, state: Grains, dt: float, steps: int, goal: float | None, pool: ThreadPoolExecutor
) -> tuple[int, Array]:
    """Run the kernel for some steps; returns how many it made, and the marks of the blocks."""
    kernel, (count, d), width = system.kernel, state.x.shape, system.groups.shape[1]
    times = np.asarray(state.t + dt * np.arange(steps + 1))
    if goal is not None:
        times[-1] = goal
    tilts = (
        np.array([tilt_at(system, float(t)) for t in times]) if kernel.sheared else np.full(steps + 1, system.box.tilt)
    )
    given = given_over(system, system.groups, times, tilts)
    _behind_jump(system, state, given)
    length = float(system.box.lengths[0]) if system.box.periodic[0] else 0.0
    reduced = tilts - state.turns * length
    strains = (tilts - state.listed_tilt) / float(system.box.lengths[1]) if kernel.sheared else np.zeros(steps + 1)
    allowed = np.maximum((skin_of(system) - np.abs(strains) * reach_of(system)) / 2, 1e-3 * skin_of(system))
    starts = _blocks(state.start)
    blocks = len(starts) - 1
    threads = min(threads_for(system), blocks)
    accuracy = min(LONGEST, math.sqrt(24 * system.rtol))
    soft = GROWTH * max(accuracy**2, 2 * state.stiffest * dt**2) / (2 * dt**2)
    numbers = np.array([dt, soft, STALE**2, system.mu, system.rolling, system.twisting, system.spun])
    seen = np.empty((count, kernel.seen))
    seen[:, d] = system.radii[state.order]
    inverse = np.column_stack([1 / system.mass[state.order], 1 / system.moment[state.order]])
    lengths = np.where(system.box.periodic, system.box.lengths, 0.0)
    sums, marks = np.zeros((blocks, len(SUMS))), np.zeros((blocks, 8))
    out, row = np.empty((len(state.partner), width + 1)), np.empty((count, width + 1))
    sync = np.zeros(8 * threads, dtype=np.int64)
    species = np.ascontiguousarray(system.species[state.order], dtype=np.int32)
    group = np.ascontiguousarray(system.groups.of[state.order])
    arrays = (
        given.force, given.moved, given.end, system.walled, given.walls, system.wall_normal, system.wall_part, lengths,
        reduced, strains, allowed, state.listed, state.start, state.partner, state.image, state.history, out,
        state.touch, state.in_start, state.in_at, state.wall_history, state.wall_touch, row, sums, marks,
    )  # fmt: skip
    fixed = (
        system.p, system.q, system.kinds, species, state.x, state.v, state.spin, state.rate_v, seen, inverse,
        system.load[state.order], state.home, group, system.groups.shape[0], system.groups.free,
    )  # fmt: skip
    flat = [value.reshape(-1) if isinstance(value, np.ndarray) else value for value in (*fixed, *arrays)]
    bounds = [blocks * thread // threads for thread in range(threads + 1)]

    def work(thread: int) -> int:
        return kernel.run(
            thread, threads, bounds[thread], bounds[thread + 1], blocks, starts, sync, steps, numbers, *flat
        )  # fmt: skip

    others = [pool.submit(work, thread) for thread in range(1, threads)]
    done = work(0)
    for other in others:
        other.result()
    state.t = float(times[done])
    state.sums += sums.sum(axis=0)
    state.stiffest, state.fastest = float(marks[:, 1].max()), math.sqrt(float(marks[:, 5].max()))
    state.moved = float(marks[:, 0].max())
    state.given_force = given.force[done].copy()
    return done, marks


def _behind_jump(system: GrainSystem, state: Grains, given: Given) -> None:
    """Take forces and given velocities as they are behind a jump at the start of a stretch, and accelerations so."""
    group = system.groups.of[state.order]
    change = given.force[0] - state.given_force
    if change.any():
        state.rate_v += change[group] / inertia_of(system, state)
    held = system.groups.free[group] == 0
    if held.any():
        d, inertia = system.dimension, inertia_of(system, state)
        now = np.concatenate([state.v, state.spin], axis=1)
        new = np.where(held, given.end[0][group], now)
        state.sums[2] += 0.5 * float(np.sum(inertia * (new**2 - now**2)))
        state.v, state.spin = np.ascontiguousarray(new[:, :d]), np.ascontiguousarray(new[:, d:])


def _blocks(start: NDArray[np.int32]) -> NDArray[np.int32]:
    """Where blocks of particles start: with about as many pairs each, whatever the threads."""
    count = len(start) - 1
    blocks = min(BLOCKS, max(1, count // SMALLEST_BLOCK))
    work = start[1:] + 4 * np.arange(1, count + 1)
    inner = np.searchsorted(work, work[-1] * np.arange(1, blocks) / blocks)
    return np.concatenate([[0], inner, [count]]).astype(np.int32)


def begin(system: GrainSystem, v: Array, spin: Array) -> Grains:
    """State at the start.

    Parameters
    ----------
    system : GrainSystem
    v : array, shape (N, d)
        Velocities.
    spin : array, shape (N, rotations)
        Angular velocities, 1/time.
    """
    count, d = system.x.shape
    kernel, none = system.kernel, np.zeros(0, dtype=np.int32)
    state = Grains(
        t=0.0, order=np.arange(count), x=system.x.copy(), v=v.copy(), spin=spin.copy(),
        rate_v=np.zeros((count, d + kernel.rotations)), home=np.zeros((count, d), np.int32), listed=system.x.copy(),
        listed_tilt=0.0, turns=0, start=np.zeros(count + 1, np.int32), partner=none, image=none, in_start=none,
        in_at=none,
        history=np.zeros((0, kernel.kept)), touch=none, wall_history=np.zeros((count * system.walled, kernel.kept)),
        wall_touch=np.zeros(count * system.walled, np.int32), sums=np.zeros(len(SUMS)), stiffest=0.0, fastest=0.0,
        moved=0.0, x0=system.x.copy(), kinetic0=0.0, stored0=0.0, given_force=np.zeros(system.groups.shape),
        counts={"steps": 0, "rejected": 0, "listings": 0},
    )  # fmt: skip
    return state


def start_of(system: GrainSystem, v: Array, spin: Array) -> Grains:
    """State at the start, with the accelerations there.

    Parameters
    ----------
    system : GrainSystem
    v : array, shape (N, d)
        Velocities.
    spin : array, shape (N, rotations)
        Angular velocities, 1/time.

    Raises
    ------
    SceneError
    """
    state = begin(system, v, spin)
    list_again(system, state)
    times = np.zeros(2)
    times[1] = 1e-300
    walls, speeds = walls_at(system, 0.0)
    given = given_over(system, system.groups, times, np.full(2, system.box.tilt))
    _behind_jump(system, state, given)
    state.sums[:] = 0.0
    contacts = touching(system, state, walls, speeds)
    state.rate_v = accelerations(system, state, contacts, given)
    state.given_force = given.force[0].copy()
    state.kinetic0, state.stored0 = kinetic_energy(system, state), sum(stored_energies(system, contacts))
    state.fastest = float(np.sqrt(np.max(np.sum(state.v**2, axis=1))))
    total = np.zeros(len(state.x))
    kappa = np.maximum(contacts.stiffness, system.spun * contacts.k_t)
    np.add.at(total, contacts.i, kappa)
    pair = contacts.j < len(total)
    np.add.at(total, contacts.j[pair], kappa[pair])
    state.stiffest = float((total / system.mass[state.order]).max())
    return state
