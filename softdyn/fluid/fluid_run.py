"""Running a scene of a fluid."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from softdyn.errors import SceneError
from softdyn.fluid.balances import Measures, measured, measures_of
from softdyn.fluid.fields import fields_of, vectors_at
from softdyn.fluid.flow_system import FluidSystem, prepared
from softdyn.fluid.fluid_result import HISTORY, FlowFrame, FluidResult, frame_of, gather_flow
from softdyn.fluid.fluid_scene import FluidScene
from softdyn.fluid.krylov import LARGE, is_there
from softdyn.fluid.linear_solvers import NAMES, LinearSolver
from softdyn.fluid.march import FlowState, FlowStep, Stepping, begun, march, restart
from softdyn.fluid.newton import Solution
from softdyn.fluid.steady import steady_flow
from softdyn.fluid.time_steps import METHODS
from softdyn.one_thread import in_one_thread
from softdyn.results.carried import carried
from softdyn.results.frame_file import FrameFile, begin, go_on, unended
from softdyn.results.origin import about, origin_now, scene_from
from softdyn.results.state_file import frames_beside, plain, read_state, reading_checkpoint, remove, write_state

if TYPE_CHECKING:
    from softdyn.fluid.watched import Watch

Array = NDArray[np.float64]
#: Imbalance of mass and of momentum from which a result warns.
IMBALANCE = 1e-9
#: Fields of a scene that say when it ends and how much it tells.
LEFT_OUT = ("target", "units", "until_t", "times")

#: Called with the time, the steps, Newton's iterations and the residual, after every step.
Progress = Callable[[float, int, int, float], None]


@dataclass
class Run:
    """A run: what is told of it so far."""

    system: FluidSystem
    measures: Measures
    solver: LinearSolver
    frames: list[FlowFrame] | FrameFile[FlowFrame]
    history: list[list[float]] = field(default_factory=list)
    state: FlowState | None = None
    fluids: int = 0


@in_one_thread
def simulate_fluid(
    scene: FluidScene,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    keep: bool = False,
) -> FluidResult:
    """Run a scene of a fluid.

    Parameters
    ----------
    scene : FluidScene
    progress : function of (t, steps, Newton iterations, residual), optional
        Called after every step; of a steady flow after every iteration.
    checkpoint : str or Path, optional
        File to which the state is written now and then, and when the run is interrupted or cannot go on; it is removed
        at the end.
    resume : bool
        Whether to go on from that file, if it is there.
    keep : bool
        Whether to leave it at the end, for who saves the result to remove it then.

    Raises
    ------
    SceneError, LawError, CompileError
        If the scene cannot be used.
    IntegrationError
        If it cannot be carried to its end: naming the time, the residual, and where that is largest. Its attribute
        ``partial`` is the result up to the last good state.

    Examples
    --------
    >>> from softdyn.fluid import simulate
    >>> flow = simulate(read_scene("channel.toml"))
    >>> flow.u[-1].max().round(9)
    np.float64(1.0)
    """
    began = time.perf_counter()
    system = prepared(scene)
    run = Run(system, measures_of(system), solver_of(system), [])
    if scene.steady:
        return _steady(run, progress, began)
    checkpoint = None if checkpoint is None else Path(checkpoint)
    key = "" if checkpoint is None else fingerprint(system)
    if resume and checkpoint is not None and checkpoint.exists():
        _load(run, checkpoint, key)
    elif checkpoint is not None:
        beside: dict[str, NDArray[Any]] = {}
        made = about(origin_now(scene, system.kernel.key), beside)
        head = {"kind": FluidResult.kind, "key": key, **made}
        run.frames = begin(frames_beside(checkpoint), FlowFrame, head, beside)

    def save() -> None:
        if run.state is not None:
            _save(run, cast(Path, checkpoint), key)

    carried(
        lambda after: _carry(run, progress, after),
        checkpoint,
        save,
        lambda: None if run.state is None else _result(run, began),
        lambda: math.nan if run.state is None else run.state.t,
    )
    result = _result(run, began)
    if checkpoint is not None and not keep:
        remove(checkpoint)
    return result


def solver_of(system: FluidSystem) -> LinearSolver:
    """Solver of the linear systems: factors, or from where these cost more, blocks, if pyamg is there for them.

    Blocks are for elements of Taylor and Hood alone.
    """
    kinds, basis, count = system.unknowns.free_kinds, system.unknowns.basis, system.velocity.count
    if len(kinds) < LARGE[system.dimension] or system.velocity.order != 2 or not is_there():
        return LinearSolver(kinds, starts=system.unknowns.starts)
    even = np.zeros((basis.shape[0], system.dimension))
    even[: system.velocities] = np.repeat(np.eye(system.dimension), count, axis=0)
    return LinearSolver(kinds, basis.T @ even, system.unknowns.starts)


def _steady(run: Run, progress: Progress | None, began: float) -> FluidResult:
    """Steady flow: one frame, one step."""
    iterations = 0

    def watch(iteration: int, residual: float) -> None:
        nonlocal iterations
        iterations += iteration > 0
        if progress is not None:
            progress(0.0, 0, iterations, residual)

    found, run.fluids = steady_flow(run.system, run.solver, 0.0, watch)
    _tell(run, 0.0, 0.0, found, 0.0, None, math.nan)
    run.history[-1][2] = iterations
    run.frames.append(frame_of(run.system, 0.0, found.x))
    return _result(run, began)


def output_times(scene: FluidScene) -> Array:
    """Times at which frames are kept.

    Raises
    ------
    SceneError
        If they do not increase from 0 at least to the end at most.
    """
    end, given = float(scene.until_t or 0.0), scene.times
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        return np.linspace(0.0, end, int(given))
    try:
        times = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise SceneError("[output] times must be a count or a list of numbers") from None
    good = times.ndim == 1 and len(times) and np.isfinite(times).all() and (np.diff(times) > 0).all()
    if not good or times[0] < 0 or times[-1] > end:
        raise SceneError(f"[output] times must increase, from 0 at least to the end of the run, {end:g}, at most")
    return times


def _carry(run: Run, progress: Progress | None, after: Callable[[], None] | None) -> None:
    """Carry a run to its end."""
    system, scene = run.system, run.system.scene
    until, outputs = float(scene.until_t or 0.0), output_times(scene)
    inert = scene.density == 0
    stepping = Stepping(METHODS[scene.method], float(scene.rtol), None if scene.dt is None else float(scene.dt))

    def done(solution: Solution, t: float, iterations: int) -> None:
        if progress is not None:
            progress(t, len(run.history), iterations, solution.measure)
        if after is not None:
            after()

    def after_step(step: FlowStep) -> None:
        assert run.state is not None
        _tell(run, step.t, step.dt, step.solution, step.rate, step.past, step.error)
        if step.t in goals:
            run.frames.append(frame_of(system, step.t, step.solution.x))
        done(step.solution, step.t, run.state.counts["iterations"])

    goals = {float(t) for t in outputs}
    if inert:
        _stand_alone(run, sorted(goals | {until}), goals, done)
        return
    if run.state is None:
        x = system.unknowns.all_of(np.zeros(system.unknowns.basis.shape[1]), system.given(0.0))
        if scene.start is not None:
            fields = fields_of(scene.start, system.dimension, scene.constants, "[start] velocity")
            v, c = vectors_at(fields, system.velocity.at, 0.0), system.coefficients(0.0).get("c")
            x[: system.velocities] = (v if c is None else c[:, None] * v).T.reshape(-1)
        run.state = begun(system, run.solver, x, until, stepping)
        if 0.0 in goals:
            run.frames.append(frame_of(system, 0.0, run.state.xs[0]))
    watched = _watch(run, until, stepping)
    seeing: Callable[[FlowState, float], float] | None = None
    breaks: set[float] = set()
    if watched is not None:
        run.solver.least = watched.least
        stepping = replace(stepping, least=watched.least)
        seeing, breaks = _seeing(run, watched, stepping), set(watched.ends)
    for goal in sorted(goals | {until} | breaks):
        if goal > run.state.t:
            march(system, run.solver, run.state, goal, until, stepping, after_step, seeing)
        if goal in breaks and goal == run.state.t:
            restart(run.state)


def _watch(run: Run, until: float, stepping: Stepping) -> Watch | None:
    """Watch of all that is given as a function of time; None where there is nothing."""
    if not run.system.of_time:
        return None
    from softdyn.fluid.watched import watch

    watched = watch(run.system, until, stepping.rtol)
    for name in watched.doubtful:
        run.system.warnings.setdefault(f"{name} has kinks or jumps too many, or too close, to be told", 0.0)
    return watched


def _seeing(run: Run, watched: Watch, stepping: Stepping) -> Callable[[FlowState, float], float]:
    """What shortens steps until they see all of it; where their length is given, it warns."""

    def seeing(state: FlowState, dt: float) -> float:
        if stepping.dt is None:
            dt, missed = watched.length(state, dt)
        else:
            error, name = watched.missed(state, dt)
            missed = name if error > 1 else ""
        if missed:
            words = f"{missed} changes too fast for the steps: what it does may be missed"
            run.system.warnings.setdefault(words, state.t)
        return dt

    return seeing


def _stand_alone(run: Run, times: list[float], goals: set[float], done: Callable[[Solution, float, int], None]) -> None:
    """Flow without inertia: at each output time what boundaries and forces make of it then."""
    if run.state is None:
        run.state = FlowState(-1.0, 0.0, [], [])
    for t in times:
        if t <= run.state.t:
            continue
        found, fluids = steady_flow(run.system, run.solver, t)
        run.fluids += fluids
        run.state.dt, run.state.t = t - max(run.state.t, 0.0), t
        run.state.counts["steps"] += 1
        run.state.counts["iterations"] += found.iterations
        _tell(run, t, run.state.dt, found, 0.0, None, math.nan)
        if t in goals:
            run.frames.append(frame_of(run.system, t, found.x))
        done(found, t, run.state.counts["iterations"])


def _tell(run: Run, t: float, dt: float, solution: Solution, rate: float, past: Array | None, error: float) -> None:
    """Keep what is told of a step."""
    equations = run.system.equations(t, rate, past)
    told = measured(run.system, run.measures, equations, solution.x, solution.residual, run.solver.least)
    run.history.append([t, dt, float(solution.iterations), solution.measure, error, *told.tolist()])


def _result(run: Run, began: float) -> FluidResult:
    system, state = run.system, run.state
    counts = {} if state is None else state.counts
    columns = (*HISTORY, *run.measures.columns)
    rows = np.array(run.history, dtype=float).reshape(-1, len(columns))
    worst = {
        name: float(rows[:, columns.index(name)].max(initial=0.0))
        for name in ("mass_imbalance", "momentum_imbalance", "energy_imbalance", "step_residual")
    }
    stats: dict[str, Any] = {
        "method": _method(system.scene),
        "elements": system.scene.elements,
        "unknowns": len(system.unknowns.kinds),
        "free": system.unknowns.basis.shape[1],
        **counts,
        **{f"linear_{name}": number for name, number in run.solver.counts.items()},
        "linear_residual": run.solver.worst,
        "linear_solver": NAMES[run.solver.way],
        "residual": worst.pop("step_residual"),
        **worst,
        "wall_s": time.perf_counter() - began,
        "kernel": system.kernel.key,
    }
    if run.fluids:
        stats["fluids"] = run.fluids
    stats["warnings"] = [f"{words} (first at t = {t:g})" for words, t in system.warnings.items()]
    stats["warnings"] += [
        f"the balance of {what} is off by {worst[f'{what}_imbalance']:.1e}"
        for what in ("mass", "momentum")
        if worst[f"{what}_imbalance"] > IMBALANCE
    ]
    return gather_flow(system, run.measures, run.frames, run.history, stats)


def _method(scene: FluidScene) -> str:
    if scene.steady:
        return "steady"
    return scene.method if scene.density else "each time by itself, without inertia"


def fingerprint(system: FluidSystem) -> str:
    """Digest of what a run depends on, but for when it ends and how much it tells."""
    scene, total = system.scene, sha256(system.kernel.key.encode())
    for array in (system.mesh.at, system.mesh.corners, *system.mesh.boundaries.values()):
        total.update(np.ascontiguousarray(array).tobytes())
    given = {field.name: plain(getattr(scene, field.name)) for field in fields(scene) if field.name not in LEFT_OUT}
    total.update(json.dumps(given, default=str, sort_keys=True).encode())
    return total.hexdigest()


#: Arrays of a sparse matrix.
FACTOR = ("data", "indices", "indptr")
#: Numbers of a state.
NUMBERS = ("t", "dt", "times", "largest", "rate", "size", "counts")


def _save(run: Run, path: Path, key: str) -> None:
    """Write a checkpoint: a run that goes on from it does, to the last bit, what this one does."""
    state, solver = run.state, run.solver
    assert state is not None
    told = {name: getattr(state, name) for name in NUMBERS}
    told |= {"frames": len(run.frames), "fluids": run.fluids, "warnings": run.system.warnings}
    kept, factor = solver_arrays(solver)
    told |= {**kept, "scaled": state.scales is not None}
    columns = len(HISTORY) + len(run.measures.columns)
    arrays: dict[str, NDArray[Any]] = {
        "xs": np.array(state.xs, dtype=float),
        "history": np.array(run.history, dtype=float).reshape(-1, columns),
    }
    if state.scales is not None:
        arrays["scales"] = state.scales
    write_state(path, key, told, {**arrays, **factor})


def solver_arrays(solver: LinearSolver) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What a checkpoint holds of a solver: its counts, and the matrix whose factor it has."""
    kept = solver.factor is not None and solver.matrix is not None
    told = {"solver": solver.counts, "worst": solver.worst, "kept": kept, "way": solver.way, "direct": solver.direct}
    return told, {f"factor_{part}": getattr(solver.matrix, part) for part in FACTOR} if kept else {}


def solver_from(solver: LinearSolver, told: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Bring a solver to where a checkpoint tells that it was.

    Parameters
    ----------
    solver : LinearSolver
    told : mapping
        Numbers of the checkpoint.
    arrays : mapping from str to array
        Arrays of it.
    """
    if told["kept"]:
        free = len(solver.kinds)
        matrix = csc_matrix(tuple(arrays[f"factor_{part}"] for part in FACTOR), shape=(free, free))
        solver.factorise(matrix, int(told["way"]))
    solver.counts = {name: int(number) for name, number in told["solver"].items()}
    solver.worst, solver.direct = float(told["worst"]), int(told["direct"])


def _load(run: Run, path: Path, key: str) -> None:
    """Go on from a checkpoint.

    Raises
    ------
    SceneError
        If the file is none, or belongs to another scene.
    """
    with reading_checkpoint(path):
        told, arrays = read_state(path, key)
        state = FlowState(
            t=float(told["t"]),
            dt=float(told["dt"]),
            times=[float(one) for one in told["times"]],
            xs=list(arrays["xs"]),
            largest=float(told["largest"]),
            scales=arrays["scales"] if told["scaled"] else None,
            rate=float(told["rate"]),
            size=float(told["size"]),
            counts={name: int(number) for name, number in told["counts"].items()},
        )
        solver_from(run.solver, told, arrays)
        run.system.warnings.update({str(words): float(t) for words, t in told["warnings"].items()})
        run.history = [list(row) for row in arrays["history"].tolist()]
        run.fluids = int(told["fluids"])
        run.state = state
        run.frames = go_on(frames_beside(path), FlowFrame, key, int(told["frames"]))


def load_flow_frames(path: Path) -> FluidResult:
    """Return a result of the frames that a run has written so far.

    Raises
    ------
    SceneError
        If the file is no such file, holds no frame, or tells of a scene that cannot be made ready.
    LawError, CompileError
    """
    system, frames, words = unended(path, FlowFrame, lambda origin: prepared(scene_from(origin, FluidScene)))
    stats = {"elements": system.scene.elements, "warnings": [words]}
    return gather_flow(system, measures_of(system), frames, [], stats)
