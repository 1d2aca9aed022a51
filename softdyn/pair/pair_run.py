"""The pair engine: two particles, pushed or moved.

Where the force is given, the state is u = ln h: the force balance (eq. 1) gives the deflection at every gap and force,
so delta is not integrated and cannot drift; at a jump of the force it moves at once, at fixed h, as it must. Where the
centres are moved, or pushed by a spring, the state is (ln h, delta). The distance of the centres,
X = 2R + h - 2 delta (eq. 2), is an output only: integrating it would cancel.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.enclosure import Interval, intervals
from softdyn.errors import IntegrationError, SceneError, pressed_only_words
from softdyn.expression import pieces
from softdyn.kernels import Kernel, get_kernel
from softdyn.pair.quadrature import integrate_constant_force
from softdyn.pair.states import deflection, drive_at, evaluate, initial_deflection
from softdyn.pair_layout import AT, STATE
from softdyn.results.origin import origin_now
from softdyn.results.pair_result import Event, PairResult
from softdyn.scene.pair_drive import Drive, drive_of
from softdyn.scene.pair_scene import Scene, check_scene, parameter_values

Array = NDArray[np.float64]

#: Steps between two looks at the progress, and at whether the user interrupts.
CHUNK = 2048
#: Of the first of these looks, which most runs do not outlast.
FIRST_CHUNK = 128
#: A solved force balance holds to rounding times the stiffness of the law in delta.
LARGEST_RESIDUAL = 1e-9
MOST_STEPS = 2_000_000
#: Numbers of a step in time: its start, its length, what ends it, ln h and its 8 stages; then its estimated errors.
IN_TIME = 12

#: An estimated error of an output is let pass up to so many times rtol; else the run is repeated at a tolerance so much
#: tighter, and as much again: tighter than rounding there is nothing to gain.
ALLOWED_ERROR = 10.0
REPEATS = 2
#: Steps that a repeated run may take at least.
FURTHER_STEPS = 50_000
TIGHTEST = 1e-16
#: Of rtol, for steps of a law with kinks or jumps: a step that ends just beyond one errs by more than its defect tells.
OVER_KINKS = 0.1
#: Errors grow as the linearised equation has it while they are small.
SMALL_ERROR = 0.1
#: Stands for an estimate that overflows.
LARGEST_ERROR = 1e300

#: Deflection over R below which surfaces that a law knows pressed alone are about to part.
PARTED = 1e-6
#: Deflection over R of a pulled surface, from which a result warns.
PULLED = 0.1

#: What ends a step, by its number in the steps.
WHAT = ("", "a row of the table", "the force crosses zero", "the gap comes to rest on a film", "the drive has a kink")
KINK = WHAT.index("the drive has a kink")

Progress = Callable[[float, float], None]


@dataclass(frozen=True)
class Trajectory:
    """What a run was made of: its kernel and what that takes, and the steps that it has made.

    Attributes
    ----------
    kernel : Kernel
    p : array
        The kernel's parameters.
    drive : Drive
    delta0 : float
        Deflection at the start.
    steps : array, shape (steps, numbers of a step)
    """

    kernel: Kernel
    p: Array
    drive: Drive
    delta0: float
    steps: Array


def simulate_pair(
    scene: Scene, progress: Progress | None = None, kernel_of: Callable[..., Kernel] = get_kernel
) -> PairResult:
    """Integrate eq. 7 with the deflection from the force balance.

    Parameters
    ----------
    scene : Scene
    progress : function of (t, h), optional
        Called now and then.
    kernel_of : function, optional
        In the place of :func:`get_kernel`, by whoever makes many runs and looks a kernel up but once.

    Raises
    ------
    SceneError
        If the scene cannot be used.
    IntegrationError
        If it cannot be carried to its end at the asked accuracy.
    """
    return simulated(scene, progress, kernel_of)[0]


def simulated(
    scene: Scene,
    progress: Progress | None = None,
    kernel_of: Callable[..., Kernel] = get_kernel,
    most: float = MOST_STEPS,
) -> tuple[PairResult, Trajectory]:
    """Return the result of :func:`simulate_pair`, and the steps that it comes from, ``most`` of them at most.

    Parameters
    ----------
    scene : Scene
    progress : function of (t, h), optional
        Called now and then.
    kernel_of : function
        Gives the kernel, as :func:`softdyn.kernels.get_kernel` does.
    most : float
        Steps that are made at most.
    """
    check_scene(scene)
    drive = drive_of(scene)
    kernel = kernel_of(scene.law, scene.target, **kernel_needs(scene, drive))
    p = kernel_parameters(scene, kernel, drive)
    R = float(p[kernel.parameters.index("R")])
    start = time.perf_counter()
    if scene.until_t is not None and scene.until_t <= drive.start:
        raise SceneError(f"[until] t = {scene.until_t:g} is not after the start, t = {drive.start:g}")
    require_few_rows(scene, drive)

    if kernel.dry and (scene.until_t is None or scene.gaps is not None or scene.method == "quadrature"):
        raise SceneError(
            f"law {kernel.law!r} is that of a dry contact, which has no gap: end the run by [until] t, with outputs at "
            "times"
        )
    delta0 = initial_deflection(scene, kernel, drive, p, R)
    if scene.method == "quadrature":
        if drive.control != "force" or drive.shape != "constant":
            raise SceneError("[accuracy] method = 'quadrature' is for a constant force; this one depends on time")
        steps = np.empty((0, kernel.width))
        t, h, stopped_by, stats = integrate_constant_force(scene, kernel, p, float(drive.constants[0]))
    else:
        steps, t, h, stopped_by, stats = _integrate_to_tolerance(scene, kernel, p, drive, delta0, progress, most)
    if kernel.dry:
        h = np.zeros(len(t))  # closed from the start, whatever h was given
    given, given_rate = drive_at(kernel, drive, t)
    inputs = {"F": given, "dF_dt": given_rate, "dX_dt": given if drive.control == "velocity" else given_rate}
    if drive.control == "force":
        delta = deflection(kernel, h, given, p)
    else:
        delta = states_at(kernel, steps, t)[1]
        delta[t == drive.start] = delta0
    if kernel.tabulated:
        _require_in_tables(scene, kernel, drive, p, steps, (float(scene.h), delta0), (t, h, delta))
    values = evaluate(kernel, h, delta, inputs, p)
    if drive.control == "force":
        values |= {"F": given, "dF_dt": given_rate}
        stats["force_residual"] = _force_residual(values["F_ela"], given, t, h)
    elif drive.control != "velocity":
        stats["drift"] = _drift(drive, values["F_ela"], 2 * R + h - 2 * delta - given, R)
    arrays = {"t": t, "h": h, "delta": delta, **{name: values[name] for name in scene.quantities}}
    largest = float(np.max(np.abs(values["F_ela"]), initial=0.0))
    result = PairResult(
        law=kernel.law,
        target=kernel.target,
        parameters=dict(zip(kernel.parameters, p.tolist(), strict=True)),
        arrays=arrays,
        stopped_by=stopped_by,
        stats={
            **stats,
            "wall_s": time.perf_counter() - start,
            "compile_s": kernel.compile_s,
            "kernel": kernel.key,
        },
        events=_events(kernel, drive, p, steps, stopped_by, t, h, delta),
        warnings=(
            *model_warnings(kernel, p, largest, t, delta),
            *_unreached(scene, t),
            *_ill_conditioned(scene, stats),
            *_unresolved(drive, stats),
        ),
        origin=origin_now(scene, kernel.fingerprint),
    )
    return result, Trajectory(kernel, p, drive, delta0, steps)


def require_few_rows(scene: Scene, drive: Drive) -> None:
    """Refuse a table with more rows than a run may take steps, before it is run: a step ends at each.

    Raises
    ------
    SceneError
        Naming how many there are, and by when there would be as many as there may be.
    """
    if drive.table is None or len(drive.table.t) <= MOST_STEPS:
        return
    t = drive.table.t
    end = t[-1] if scene.until_t is None else scene.until_t
    inside = int(np.searchsorted(t, end) - np.searchsorted(t, drive.start, side="right"))
    if inside >= MOST_STEPS:
        raise SceneError(
            f"[drive] {drive.control}: the table has {inside} rows between t = {drive.start:g} and {end:g}, without "
            f"those that only repeat a value, a step ends at each, and a run takes {MOST_STEPS} steps at most: end it "
            f"by [until] t = {t[MOST_STEPS - 1]:.6g} or before, or take fewer rows (every "
            f"{math.ceil(len(t) / MOST_STEPS) + 1}th, or means)"
        )


def kernel_parameters(scene: Scene, kernel: Kernel, drive: Drive) -> Array:
    """What a kernel takes for p: the law's parameters, and of a spring its compliance.

    Parameters
    ----------
    scene : Scene
    kernel : Kernel
    drive : Drive
        Which says whether a spring drives the pair.
    """
    if drive.control != "spring":
        return parameter_values(scene, kernel.parameters, kernel.positive, kernel.ranges)
    *names, _ = kernel.parameters
    return np.append(parameter_values(scene, names, kernel.positive, kernel.ranges), 1 / drive.stiffness)


def kernel_needs(scene: Scene, drive: Drive) -> dict[str, Any]:
    """What a scene needs of its kernel: the outputs asked for, and F_ela, to report how the force balance holds."""
    wanted = {*scene.quantities, "F_ela"} | ({"dh_dt"} if scene.method == "quadrature" else set())
    if drive.control == "force":
        wanted -= {"F", "dF_dt"}  # these are given
    elif drive.control == "spring":
        wanted |= {"C"}  # for the balance at the start
    return {
        "drive": drive.shape,
        "control": drive.control,
        "deflection": drive.deflection,
        "outputs": tuple(sorted(wanted)),
    }


#: States in each step at which a law with tables is asked whether it is in their range.
LOOKS = 8


def _require_in_tables(
    scene: Scene,
    kernel: Kernel,
    drive: Drive,
    p: Array,
    steps: Array,
    start: tuple[float, float],
    told: tuple[Array, ...],
) -> None:
    """No state, at an output or within a step, is where a table of the law has no value.

    Raises
    ------
    IntegrationError
        Naming the time, the quantity, its value and the range.
    """
    from softdyn.table_ranges import TANGENTIAL, law_once, outside

    t, h, delta = (np.append(first, rest) for first, rest in zip((drive.start, *start), told, strict=True))
    if len(steps):
        parts = np.arange(1, LOOKS + 1) / LOOKS
        times = (steps[:, :1] + steps[:, 1:2] * parts).ravel()
        times = times[times <= told[0][-1]]
        states = states_at(kernel, steps, times)
        gaps = np.exp(states[0])
        deltas = states[1] if len(states) > 1 else deflection(kernel, gaps, drive_at(kernel, drive, times)[0], p)
        t, h, delta = (np.append(some, more) for some, more in ((t, times), (h, gaps), (delta, deltas)))
    order = np.argsort(t, kind="stable")
    values = dict(zip(kernel.parameters, p.tolist(), strict=True))
    found = outside(law_once(scene.law, kernel.key), values, h[order], delta[order], ("unequal", TANGENTIAL))
    if found is not None:
        raise IntegrationError(f"at t={t[order][found.number]:.6g} the law has no value: {found.words}")


def _force_residual(F_ela: Array, F: Array, t: Array, h: Array) -> float:
    """Largest abs(F_ela - F), relative to the largest force."""
    balanced = np.isfinite(F_ela)
    if not balanced.all():
        at = int(np.argmin(balanced))
        raise IntegrationError(f"the force balance has no solution at t={t[at]:g}, h={h[at]:g}, F={F[at]:g}")
    largest = float(np.max(np.abs(F), initial=0.0))
    residual = float(np.max(np.abs(F_ela - F), initial=0.0)) / largest if largest else 0.0
    if residual > LARGEST_RESIDUAL:
        raise IntegrationError(
            f"the force balance holds to {residual:.1e} only: the law is too stiff in delta to be solved"
        )
    return residual


def _drift(drive: Drive, F_ela: Array, stretch: Array, R: float) -> float:
    """Largest distance, over R, between where the centres are and where the drive has them; both are outcomes."""
    return float(np.max(np.abs(stretch - F_ela / drive.stiffness), initial=0.0)) / R


def _events(
    kernel: Kernel, drive: Drive, p: Array, steps: Array, stopped_by: str, t: Array, h: Array, delta: Array
) -> tuple[Event, ...]:
    """What happened on the way, in order: where steps had to end, and what ended the run."""
    ends = steps[:, 0] + steps[:, 1]
    at = np.flatnonzero((steps[:, 2] > 0) & (ends <= t[-1])) if len(steps) else np.zeros(0, dtype=int)
    found = []
    if len(at):
        states = states_at(kernel, steps, ends[at])
        forces = drive_at(kernel, drive, ends[at])[0]
        deltas = states[1] if len(states) > 1 else deflection(kernel, np.exp(states[0]), forces, p)
        found = [
            Event(WHAT[int(steps[i, 2])], float(ends[i]), math.exp(u), float(d))
            for i, u, d in zip(at, states[0], deltas, strict=True)
        ]
    if stopped_by == "h":
        found.append(Event("the gap at which the run ends", float(t[-1]), float(h[-1]), float(delta[-1])))
    return tuple(found)


def step_rtol(scene: Scene, kernel: Kernel) -> float:
    """What a step is held to: less where a kink of the law may lie between the last nodes of a step and its end."""
    return max(float(scene.rtol) * (OVER_KINKS if kernel.kinked else 1.0), TIGHTEST)


def _integrate_to_tolerance(
    scene: Scene, kernel: Kernel, p: Array, drive: Drive, delta0: float, progress: Progress | None, allowed: float
) -> tuple[Array, Array, Array, str, dict[str, Any]]:
    """Steps, times and gaps of the outputs, what stopped the run, and statistics; errors that grow on the way included.

    A step is held to rtol, and what it errs may grow: where the estimate of that at an output exceeds ALLOWED_ERROR
    times rtol, the run is repeated with steps held to less.
    """
    asked = float(scene.rtol)
    rtol = step_rtol(scene, kernel)
    steps, stopped_by, stats = _integrate(scene, kernel, p, drive, delta0, rtol, progress, allowed)
    t, h = _sample(scene, kernel, drive, steps, stopped_by)
    stats["error"] = error = _estimated_error(scene, steps, t)
    for _ in range(REPEATS):
        if error <= ALLOWED_ERROR * asked or rtol <= TIGHTEST or "unresolved" in stats:
            break
        # errors of the steps go as the tolerance; half of what would just do
        rtol = max(rtol * 0.5 * min(ALLOWED_ERROR * asked / error, 0.2), TIGHTEST)
        try:
            # a tighter tolerance takes some more steps; where it takes far more, they are what cannot be held to it
            most = min(allowed, FURTHER_STEPS + 20 * stats["steps"])
            again, stopped_again, stats_again = _integrate(scene, kernel, p, drive, delta0, rtol, progress, most)
            t_again, h_again = _sample(scene, kernel, drive, again, stopped_again)
        except IntegrationError:
            break  # steps cannot be held to so little: the result says what its error is
        error = _estimated_error(scene, again, t_again)
        stats_again["evaluations"] += stats["evaluations"]
        if error < stats["error"]:
            steps, t, h, stopped_by, stats = again, t_again, h_again, stopped_again, stats_again | {"error": error}
        else:
            stats["evaluations"] = stats_again["evaluations"]
    return steps, t, h, stopped_by, stats


def _estimated_error(scene: Scene, steps: Array, t: Array) -> float:
    """Largest estimated error of an output, relative.

    Of h at a given time. Where the outputs are not at given times, an output is a point of the curve (t, h), and is as
    far from it as the smaller of its error of h and of that of t: one of the two may be ill-conditioned.
    """
    at = np.searchsorted(steps[:, 0], t, side="right") - 1
    error = steps[at, -2]
    if scene.times is None:
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.fmin(error, steps[at, -1] / (t - steps[0, 0]))
    # written so that an overflow on the way is an error, too
    largest = float(np.max(error, initial=0.0))
    return largest if largest < LARGEST_ERROR else LARGEST_ERROR


def _integrate(
    scene: Scene,
    kernel: Kernel,
    p: Array,
    drive: Drive,
    delta0: float,
    rtol: float,
    progress: Progress | None,
    most: float = MOST_STEPS,
) -> tuple[Array, str, dict[str, Any]]:
    """Run the kernel's integrator to the end; returns its steps, what stopped it, and statistics."""
    t_end = math.inf if scene.until_t is None else float(scene.until_t)
    u_stop = math.nan if scene.until_h is None else math.log(scene.until_h)
    start, ends = (float(scene.h), delta0), (t_end, u_stop)
    steps, state = integrate_steps(kernel, drive, p, start, ends, rtol, scene.method, progress, most)
    status = int(state[-1])
    if status not in (0, 1):
        raise IntegrationError(_what_happened(status, scene, rtol, state, kernel))
    stats = {
        "method": _method(drive, int(state[AT["accepted"]]), int(state[AT["steps_in_gap"]])),
        "steps": int(state[AT["accepted"]]),
        "rejected": int(state[AT["rejected"]]),
        "evaluations": int(8 * state[AT["iterations"]] + state[AT["single_rates"]]),
        "stiffness": float(state[AT["fastest"]]),
        "rtol": rtol,
    }
    if state[AT["unresolved"]] > 0:
        stats |= {"unresolved": int(state[AT["unresolved"]]), "unresolved_from": float(state[AT["unresolved_from"]])}
    return steps, "h" if status == 1 else "t", stats


def integrate_steps(
    kernel: Kernel,
    drive: Drive,
    p: Array,
    start: tuple[float, float],
    ends: tuple[float, float],
    rtol: float,
    method: str,
    progress: Progress | None = None,
    most: float = MOST_STEPS,
) -> tuple[Array, Array]:
    """Integrate from h and delta to a time or to a value of ln h (nan: none).

    Parameters
    ----------
    kernel : Kernel
    drive : Drive
    p : array, shape (parameters,)
        What the kernel takes: the law's parameters, and of a spring its compliance.
    start : (float, float)
        Gap and deflection at the start, lengths.
    ends : (float, float)
        The time, and the value of ln h, at which it ends; nan where there is none.
    rtol : float
        Relative error allowed in h at each step.
    method : str
        Name of the integrator.
    progress : function of (t, h), optional
        Called now and then.
    most : float
        Steps that are made at most.

    Returns
    -------
    steps : array, shape (steps, numbers of a step)
    state : array, shape (21,)
        As the kernel left it (:data:`softdyn.pair_layout.STATE`), and last its status: 0 at the time, 1 past ln h,
        else why it ended.
    """
    t_end, u_stop = ends
    state = np.zeros(len(STATE))
    state[:3] = drive.start, math.log(start[0]), start[1]
    state[AT["longest"]] = math.inf
    state[AT["in_gap"]] = float(method == "auto")
    width = kernel.width
    recorded: list[Array] = []
    for interval in _intervals(drive, t_end):
        arguments = drive.arguments if drive.table is not None else (interval.constants,)
        status, capacity = 2, FIRST_CHUNK
        while status == 2:
            chunk = np.empty(capacity * width)
            status = kernel.functions.integrate(interval.end, u_stop, rtol, p, *arguments, capacity, state, chunk)
            recorded.append(chunk[: int(state[AT["recorded"]]) * width].reshape(-1, width))
            if progress is not None:
                progress(float(state[AT["t"]]), math.exp(min(state[AT["u"]], 700.0)))
            if status == 2:
                status, capacity = _stuck(state, most), CHUNK
        if status != 0:
            break
        if interval.kink and len(recorded[-1]):
            recorded[-1][-1, 2] = KINK
        if interval.doubtful:
            state[AT["unresolved_from"]] = (
                state[AT["t"]] if state[AT["unresolved"]] == 0 else state[AT["unresolved_from"]]
            )
            state[AT["unresolved"]] += 1
    return recorded[0] if len(recorded) == 1 else np.concatenate(recorded), np.append(state, status)


def _intervals(drive: Drive, end: float) -> Iterable[Interval]:
    """Between the kinks of an expression, at which steps end, as they do at the rows of a table."""
    if not isinstance(drive.shape, tuple):
        return (Interval(end, False, drive.constants, False),)
    return intervals(pieces(drive.shape), drive.constants, drive.start, end)


def _method(drive: Drive, steps: int, by_gap: int) -> str:
    """What was done, in words, for the result."""
    in_time = f"Radau IIA of 8 stages in ln h{'' if drive.control == 'force' else ' and delta'}"
    if not by_gap:
        return in_time
    in_gap = "quadrature in steps of ln h (constant force)"
    return in_gap if by_gap == steps else f"{in_gap}, then {in_time}"


TOO_MANY, RUNAWAY = -10, -11


def _stuck(state: Array, most: float) -> int:
    """Status of a run that has not ended: 2 to go on."""
    if state[AT["accepted"]] + state[AT["rejected"]] > most:
        return TOO_MANY
    # ln h at which h overflows, or vanishes, in double precision
    return 2 if abs(state[AT["u"]]) < 690 else RUNAWAY


def _what_happened(status: int, scene: Scene, rtol: float, state: Array, kernel: Kernel) -> str:
    t, u, delta = state[:3]
    h = math.exp(min(max(u, -745.0), 709.0))
    where = f"at t={t:.6g}, h={h:.6g}, delta={delta:.6g}"
    if status in (-1, -3) and kernel.pressed_only and abs(delta) < PARTED * scene.parameters["R"]:
        return f"{pressed_only_words(kernel.law)} ({where})"
    toward = "" if scene.until_h is None else f" before the gap reached until.h = {scene.until_h:g}"
    away = _moves_away(scene, h)
    end_by_time = "end the run by a time, until.t"
    taken = int(state[AT["accepted"]] + state[AT["rejected"]])
    if away:
        long = f"the force moves the gap the other way; {end_by_time}"
    elif scene.until_t is None:
        long = (
            "where F_adh balances the force the gap settles on a film, and under a force without mean it goes nowhere: "
            + end_by_time
        )
    else:
        long = "the equation is stiff there, or the force varies fast; ask for a shorter time or a larger rtol"
    slow = "the gap hardly moves, since the force vanishes or is balanced, or the friction diverges"
    slow = "the gap settles on a film, where F_adh balances the force" if state[AT["settled"]] else slow
    why = f"{'the force moves the gap the other way' if away else slow}; {end_by_time}"
    reasons = {
        3: f"the table ends {where}{toward}; extend it, or end the run earlier",
        -1: f"the step fell below the rounding of t {where}: the tolerance rtol={rtol:g} cannot be met, or the "
        "law or the force has a singularity there",
        -2: f"the time overflows {where}{toward}: {why}",
        -3: f"the gap has no finite rate {where}: the force or the law has no value there",
        TOO_MANY: f"{taken} steps were not enough, {where}{toward}; {long}",
        RUNAWAY: f"the gap leaves the range of double precision {where}{toward}: {why}",
    }
    return reasons[status]


def _moves_away(scene: Scene, h: float) -> bool:
    """Whether the gap has moved away from the gap at which the run was to end."""
    moved = math.log(h / scene.h)
    return scene.until_h is not None and abs(moved) > 1e-6 and (moved > 0) != (scene.until_h > scene.h)


def _sample(scene: Scene, kernel: Kernel, drive: Drive, steps: Array, stopped_by: str) -> tuple[Array, Array]:
    """Times and gaps of the asked outputs, from the dense output of the steps."""
    if stopped_by == "h":
        end = float(_passages(kernel, steps, np.array([len(steps) - 1]), np.log([float(scene.until_h or 0)]))[0])
    else:
        end = float(scene.until_t or 0)
    if scene.gaps is not None:
        return _at_gaps(scene, kernel, steps, end, stopped_by)
    if scene.times is None:
        t = np.append(_reached(kernel, steps), end)
        t = t[(t < end) | (np.arange(len(t)) == len(t) - 1)]
    elif isinstance(scene.times, (int, np.integer)):
        t = np.linspace(drive.start, end, int(scene.times))
    else:
        t = np.array(scene.times, dtype=float)
        if t[0] < drive.start or (scene.until_t is not None and t[-1] > scene.until_t):
            raise SceneError(f"[output] times must lie within the run, {drive.start:g} .. {scene.until_t or end:g}")
        t = t[t <= end]
        if not len(t):
            raise SceneError(f"[output] none of the times lies within the run, {drive.start:g} .. {end:g}")
    h = np.exp(states_at(kernel, steps, t)[0])
    if stopped_by == "h" and len(t) and t[-1] == end:
        h[-1] = float(scene.until_h or 0)
    if len(t) and t[0] == drive.start:
        h[0] = scene.h
    return t, h


def _reached(kernel: Kernel, steps: Array) -> Array:
    """Times of the starts of the steps, and of the nodes of panels of the gap, which are few and wide."""
    if not _has_panels(kernel):
        return steps[:, 0]
    inside = [row[0] + row[4:-4] if row[-3] != 0 else row[:0] for row in steps]
    return np.concatenate([np.append(row[:1], times) for row, times in zip(steps, inside, strict=True)])


def _has_panels(kernel: Kernel) -> bool:
    """Whether steps may be panels of the gap: then there is room for more than a step in time and its two errors."""
    return kernel.components == 1 and kernel.width > IN_TIME + 2


def states_at(kernel: Kernel, steps: Array, t: Array) -> Array:
    """State at each of increasing times, from the polynomials of the steps: shape (components, times).

    Parameters
    ----------
    kernel : Kernel
    steps : array, shape (steps, numbers of a step)
        As :func:`integrate_steps` returns them.
    t : array, shape (times,)
        Increasing times, within these steps.
    """
    out = np.empty(len(t) * kernel.components)
    kernel.functions.sample(len(t), t, len(steps), steps.ravel(), out)
    return out.reshape(-1, len(t))


def _passages(kernel: Kernel, steps: Array, index: Array, u: Array) -> Array:
    """Times at which ln h passes each u within the step of each index."""
    out = np.empty(len(u))
    kernel.functions.passages(len(u), u, index.astype(float), steps.ravel(), out)
    return out


def _ends(kernel: Kernel, steps: Array) -> Array:
    """Return ln h at the start of each step, and at the end of the last."""
    last = steps[-1]
    # of a panel of the gap its length comes last but for the errors; of a step in time, the last stage is at its end
    by_gap = _has_panels(kernel) and last[-3] != 0
    return np.append(steps[:, 3], last[3] + (last[-3] if by_gap else last[IN_TIME - 1]))


def _at_gaps(scene: Scene, kernel: Kernel, steps: Array, end: float, stopped_by: str) -> tuple[Array, Array]:
    """Times at which the gaps are passed, each after the one before; gaps that are not passed are an error."""
    if isinstance(scene.gaps, (int, np.integer)):
        gaps = np.geomspace(scene.h, float(scene.until_h or 0), int(scene.gaps))
    else:
        gaps = np.array(scene.gaps, dtype=float)
    u = _ends(kernel, steps)
    targets = np.log(gaps)
    index, passed = _passing_steps(u, targets, gaps == scene.h, (gaps == scene.until_h) & (stopped_by == "h"))
    times = _passages(kernel, steps, index.astype(float), targets)
    times[(gaps == scene.h) & (index == 0)] = steps[0, 0]
    for wrong in np.flatnonzero(passed & (np.diff(times, prepend=times[0]) < 0)):
        raise SceneError(
            f"[output] gaps must come in the order in which the run passes them; h = {gaps[wrong]:g} does not"
        )
    # the last step may pass what lies beyond the end, and rounding the end itself
    late = ~passed | ((times > end + 1e-14 * abs(end)) & (gaps != scene.until_h))
    if late.any():
        inside = np.append(u[:-1], states_at(kernel, steps, np.array([end]))[0])
        reached = math.exp(float(np.min(inside))), math.exp(float(np.max(inside)))
        raise SceneError(
            f"[output] gaps: h = {gaps[int(np.argmax(late))]:g} is not passed, in this order, before the run ends; "
            f"the gap stays within {reached[0]:.6g} .. {reached[1]:.6g}"
        )
    return np.minimum(times, end), gaps


def _passing_steps(
    u: Array, targets: Array, at_start: NDArray[np.bool_], at_end: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Step within which each target is passed, the first from that of the target before it on.

    Targets that fall, or rise, one after the other are looked up at once: the first step to reach one is where the
    least (greatest) u so far reaches it.

    Parameters
    ----------
    u : array, shape (steps + 1,)
        Where steps begin and end.
    targets : array, shape (n,)
    at_start, at_end : array of bool, shape (n,)
        Targets that are the start of the run, unless it has moved on, or its end: not to be looked for.

    Returns
    -------
    index : array of int, shape (n,)
    passed : array of bool, shape (n,)
        Whether there is such a step.
    """
    index, passed = np.zeros(len(targets), dtype=np.int64), np.ones(len(targets), dtype=bool)
    steps = len(u) - 1
    slopes = np.sign(np.diff(targets))
    special = at_start | at_end
    # monotonic rows of targets, each up to where the next one goes the other way, or is not looked for
    cut = special[:-1] | special[1:] | np.append(False, slopes[1:] != slopes[:-1])[: len(targets) - 1]
    ends = np.append(np.flatnonzero(cut), len(targets) - 1)
    at = i = 0
    while i < len(targets):
        if at_start[i] and at == 0:
            i += 1
            continue
        if at_end[i]:
            at = index[i] = steps - 1
            i += 1
            continue
        last = int(ends[np.searchsorted(ends, i)]) + 1
        sign = -1.0 if last > i + 1 and targets[i + 1] > targets[i] else 1.0
        if last == i + 1 or sign * u[at] <= sign * targets[i]:
            found = np.flatnonzero((u[at:-1] - targets[i]) * (u[at + 1 :] - targets[i]) <= 0)
            passed[i] = len(found) > 0
            at += int(found[0]) if len(found) else 0
            index[i] = at
            i += 1
            continue
        reached = np.minimum.accumulate(sign * u[at + 1 :])
        found = at + np.searchsorted(-reached, -sign * targets[i:last])
        passed[i:last] = found < steps
        index[i:last] = np.maximum.accumulate(np.where(found < steps, found, at))
        at = int(index[last - 1])
        i = last
    return index, passed


def _unreached(scene: Scene, t: Array) -> tuple[str, ...]:
    if scene.times is None or isinstance(scene.times, (int, np.integer)) or len(t) == len(scene.times):
        return ()
    return (f"{len(scene.times) - len(t)} of the {len(scene.times)} output times lie after the end of the run",)


def _ill_conditioned(scene: Scene, stats: dict[str, Any]) -> tuple[str, ...]:
    error = stats.get("error", 0.0)
    if error <= ALLOWED_ERROR * scene.rtol:
        return ()
    what = "the gap at a given time is" if scene.times is not None else "the outputs, t and h, are"
    # estimates are of small errors: beyond them they tell no more than that
    known = f"known to {error:.1e} only, relative, and rtol is {scene.rtol:g}" if error < SMALL_ERROR else "not known"
    aside = "; the times of given gaps may be better conditioned ([output] gaps)" if scene.times is not None else ""
    return (f"{what} {known}: on the way errors, of rounding if no other, grow by as much{aside}",)


def _unresolved(drive: Drive, stats: dict[str, Any]) -> tuple[str, ...]:
    if "unresolved" not in stats:
        return ()
    what = "base of the spring" if drive.control == "spring" else drive.control
    where = f"{stats['unresolved']} steps, the first at t={stats['unresolved_from']:.6g}"
    return (
        f"the {what} varies too fast to be followed, or cannot be bounded, within {where}: what it does between the "
        "points of these steps, and what comes of it, is not known",
    )


def model_warnings(kernel: Kernel, p: Array, largest: float, t: Array, delta: Array) -> tuple[str, ...]:
    """What is outside the model in a run with this largest force and these deflections at some times.

    Parameters
    ----------
    kernel : Kernel
    p : array, shape (parameters,)
    largest : float
        Largest size of the force.
    t : array, shape (times,)
    delta : array, shape (times,)
        Deflections at these times, lengths.
    """
    R = float(p[kernel.parameters.index("R")])
    found = []
    if "E" in kernel.parameters:
        kappa = largest / (float(p[kernel.parameters.index("E")]) * R**2)
        if kappa > 1 + 1e-9:  # F_ela rounds
            found.append(
                f"kappa = F/(E R^2) reaches {kappa:.3g} > 1: outside the model, deflections are of the order of R"
            )
    if not found and np.max(np.abs(delta), initial=0.0) >= R:
        found.append(f"the deflection reaches {np.max(np.abs(delta)) / R:.3g} R: outside the model")
    if np.max(-delta, initial=0.0) > PULLED * R:
        first, worst = int(np.argmax(-delta > PULLED * R)), int(np.argmin(delta))
        found.append(
            f"the surfaces are pulled by {-delta[worst] / R:.3g} R at t={t[worst]:.6g} (first above {PULLED:g} R at "
            f"t={t[first]:.6g}): laws of contacts are for small deflections, and one that is meant for pressed "
            "surfaces, as rognon_gay, holds pulled films shut"
        )
    return tuple(found)
