"""Running a scene of Brownian particles.

Without inertia, dx = (u + F/Z) dt + sqrt(2 kT/Z) dW, with the drag Z of each particle by itself, which does not depend
on where it is: the noise needs no drift of its own. Euler's and Maruyama's step is of weak order 1; that of Heun, with
the same noise in both of its stages, of weak order 2, since the noise is additive (Kloeden & Platen, Numerical Solution
of Stochastic Differential Equations, 1992, section 15.1).

Steps have a fixed length but for the last before an output time: a step that would be longer or shorter by what the
noise has done would spoil its statistics. Noise is drawn by the seed and the number of the step alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError
from softdyn.kernels import choose_target
from softdyn.particles import checkpoint as checkpoints
from softdyn.particles.brownian.forces import Forces, forces_at
from softdyn.particles.brownian.step_length import UNSTABLE, longest_step
from softdyn.particles.force_balance import Newton
from softdyn.particles.integrate import MOST_STEPS, Progress
from softdyn.particles.loose_particles import no_contact_kernel
from softdyn.particles.mechanisms.noise import SCHEMES, Bath, Noise
from softdyn.particles.neighbours import find_contacts, travelled
from softdyn.particles.parameters import uniform_values
from softdyn.particles.resolve import breaks
from softdyn.particles.results import Frame, ParticleResult, gather
from softdyn.particles.start import start
from softdyn.particles.state import State, frame_now, stored_energy
from softdyn.particles.system import System, ValidatedScene, with_mechanisms
from softdyn.particles.until import run_end
from softdyn.results.carried import carried
from softdyn.results.frame_file import begin
from softdyn.results.origin import about, origin_now
from softdyn.results.state_file import frames_beside, remove

Array = NDArray[np.float64]

#: Of the skin, how far particles go before neighbours are looked for again.
FAR = 0.8
#: Steps that a run may take: they are cheap.
MOST = 100 * MOST_STEPS


def prepare(facts: ValidatedScene) -> System:
    """Make all ready that a run needs.

    Raises
    ------
    SceneError
    """
    kernel = no_contact_kernel(choose_target(facts.scene.target), True)
    return with_mechanisms(facts, kernel, uniform_values(facts, kernel), facts.mechanisms)


def simulate(
    facts: ValidatedScene,
    progress: Progress | None = None,
    checkpoint: Path | str | None = None,
    resume: bool = False,
    keep: bool = False,
    on_frame: Callable[[Frame], None] | None = None,
) -> ParticleResult:
    """Integrate a scene with noise; see :func:`softdyn.particles.particle_run.simulate_particles`.

    Parameters
    ----------
    facts : ValidatedScene
    progress, checkpoint, resume, keep, on_frame
        See :func:`softdyn.particles.particle_run.simulate_particles`.

    Raises
    ------
    SceneError, IntegrationError
    """
    began = time.perf_counter()
    checkpoint = None if checkpoint is None else Path(checkpoint)
    system = prepare(facts)
    key = "" if checkpoint is None else checkpoints.fingerprint(system)
    if resume and checkpoint is not None and checkpoint.exists():
        state, _ = checkpoints.load(checkpoint, key, system)
    else:
        state = start(system, Newton())
        if checkpoint is not None:
            beside: dict[str, NDArray[Any]] = {}
            made = about(origin_now(facts.scene, system.kernel.fingerprint), beside)
            state.frames = begin(frames_beside(checkpoint), Frame, {"key": key, **made}, beside)

    def go(after: Callable[[], None] | None) -> None:
        _carry_on(system, state, progress, after, on_frame)

    def save() -> None:
        checkpoints.save(cast(Path, checkpoint), state, Newton(whole=False), key)

    carried(go, checkpoint, save, lambda: _result(system, state, began), lambda: state.t)
    result = _result(system, state, began)
    if checkpoint is not None and not keep:
        remove(checkpoint)
    return result


def _noise(system: System) -> Noise:
    return next(one.noise for one in system.mechanisms if isinstance(one, Bath))


def _carry_on(
    system: System,
    state: State,
    progress: Progress | None,
    after_step: Callable[[], None] | None,
    on_frame: Callable[[Frame], None] | None,
) -> None:
    """Carry a state on to the end of the scene, in place."""
    noise, until = _noise(system), run_end(system.scene)
    drag = system.resistance[:, :1]
    spread = np.where(system.fixed, 0.0, np.sqrt(2 * noise.temperature / drag))
    allowed = step_of(system)
    if until / allowed > MOST:
        raise IntegrationError(
            f"steps of {allowed:.3g} are {until / allowed:.3g} to the end of the run, and {MOST:.0e} are the most: "
            "soften the potentials, or give [noise] step"
        )
    goals = np.unique(np.concatenate([system.times[system.times > 0], breaks(system), [until]]))
    goals = goals[goals <= until]
    now = forces_at(system, state.contacts, drag, state.x, state.t)
    if not len(state.frames) and system.times[0] == 0.0:
        _keep(system, state, now, on_frame)
    while state.t < until:
        goal = float(goals[np.searchsorted(goals, state.t, side="right")])
        left = goal - state.t
        count = max(1, math.ceil(left / allowed * (1 - 1e-12)))
        dt, when = left / count, goal if count == 1 else state.t + left / count
        _require_stable(now, noise, dt, state.t)
        kicks = spread * math.sqrt(dt) * drawn(noise, state.counts["steps"], state.x.shape)
        ahead = state.x + dt * now.drift + kicks
        if _travelled(system, state, ahead, when) > 1.0:
            _list_again(system, state, state.x, state.t)
            if _travelled(system, state, ahead, when) > 1.0:
                raise IntegrationError(
                    f"at t={state.t:.6g} particles move further in a step of {dt:.3g} than neighbours are looked for: "
                    "give a shorter [noise] step"
                )
        x = ahead
        if SCHEMES[noise.scheme] == 2:
            predicted = forces_at(system, state.contacts, drag, ahead, when)
            x = state.x + dt / 2 * (now.drift + predicted.drift) + kicks
        if _travelled(system, state, x, when) > FAR:
            _list_again(system, state, x, when)
        after = forces_at(system, state.contacts, drag, x, when)
        if not np.isfinite(after.drift).all():
            who = int(np.argmin(np.isfinite(after.drift).all(axis=1)))
            raise IntegrationError(
                f"at t={state.t:.6g} a step of {dt:.3g} takes particle {who} to where its potential does not hold: "
                "give a shorter [noise] step"
            )
        _account(state, now, after, x - state.x, dt)
        state.t, state.x, now = when, x, after
        state.counts["steps"] += 1
        jumped = [mechanism.note(system, state) for mechanism in system.having["note"]]
        if any(jumped):
            now = forces_at(system, state.contacts, drag, x, when)
        if when in system.times:
            state.history.append((when, dt, 0.0, 0.0, 0))
            _keep(system, state, now, on_frame)
        if progress is not None:
            progress(state.t, state.counts["steps"], 0)
        if after_step is not None:
            after_step()


def step_of(system: System) -> float:
    """Length of the steps: as it is given, or by the stiffness of the forces; at most the whole run."""
    noise, until = _noise(system), run_end(system.scene)
    if noise.step is not None:
        return float(noise.step)
    return min(longest_step(system, system.resistance[:, :1], noise.temperature), until)


def drawn(noise: Noise, step: int, shape: tuple[int, ...]) -> Array:
    """Normal numbers of a step, by the seed and the number of the step alone, each of the variance 1.

    Parameters
    ----------
    noise : Noise
    step : int
        Its number.
    shape : tuple of int
    """
    source = np.random.Philox(key=int(noise.seed or 0), counter=[0, 0, step, 0])
    return np.random.Generator(source).standard_normal(shape)


def _require_stable(now: Forces, noise: Noise, dt: float, t: float) -> None:
    fastest = float(now.stiffness.max(initial=0.0))
    if dt * fastest > UNSTABLE:
        who = int(np.argmax(now.stiffness))
        raise IntegrationError(
            f"at t={t:.6g} steps of {dt:.3g} are above the limit of stability, {UNSTABLE / fastest:.3g}, by the forces "
            f"on particle {who}: give a shorter [noise] step"
        )


def _travelled(system: System, state: State, x: Array, t: float) -> float:
    """By how much surfaces have come closer since pairs were listed, in units of the skin; 0 where all are listed."""
    if not system.searches or math.isinf(system.listing):
        return 0.0
    farthest = 2 * float(system.radii.max()) + system.listing + state.listed.skin
    return travelled(state.listed, x, system.box, t, farthest, ())


def _list_again(system: System, state: State, x: Array, t: float) -> None:
    state.contacts, state.listed, _, _ = find_contacts(system, x, t, state.contacts)
    state.counts["listings"] += 1


def _account(state: State, before: Forces, after: Forces, moved: Array, dt: float) -> None:
    """Works of a step, by the mean of the forces at its ends: heat is what the fluid does against all of them."""
    external = 0.5 * float(np.sum((before.external + after.external) * moved))
    inner = 0.5 * float(np.sum((before.inner + after.inner) * moved))
    state.work["external"] += external
    state.work["box"] += 0.5 * dt * (before.box + after.box)
    state.work["bath"] -= external + inner


def _keep(system: System, state: State, now: Forces, on_frame: Callable[[Frame], None] | None) -> None:
    state.v = np.zeros(system.fixed.shape)
    state.v[:, : system.dimension] = now.drift
    state.frames.append(frame_now(system, state))
    if on_frame is not None and len(state.frames) > 1:
        on_frame(state.frames[len(state.frames) - 1])


def _result(system: System, state: State, began: float) -> ParticleResult:
    stored = stored_energy(system, state) - state.stored0
    work = {name: state.work[name] for name in system.works}
    given = sum(work[name] for name in system.given)
    taken = stored + sum(amount for name, amount in work.items() if name not in system.given)
    size = sum(abs(value) for value in work.values()) + abs(stored)
    noise = _noise(system)
    stats: dict[str, Any] = {
        "method": f"Brownian motion, steps of {_NAMES[noise.scheme]}, weak order {SCHEMES[noise.scheme]}",
        **state.counts,
        "newton_iterations": 0,
        "linear_solver": "",
        "force_residual": 0.0,
        "step": step_of(system),
        "wall_s": time.perf_counter() - began,
        "compile_s": system.kernel.compile_s,
        "kernel": system.kernel.key,
        "given": list(system.given),
        "warnings": [],
    }
    for mechanism in system.having["stats"]:
        stats |= mechanism.stats()
    energy = {**work, "stored": stored, "imbalance": (given - taken) / size if size else 0.0}
    return gather(system, list(state.frames), state.history, energy, stats)


_NAMES = {"euler": "Euler and Maruyama", "heun": "Heun"}
