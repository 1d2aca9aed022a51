"""Running a scene of grains in a fluid.

A step: the share of the grains and its change since the last one; the flow at the end of the step with the drag on the
grains implicit, repeated until the drag is that at the speeds that come out; the grains on by what they then feel.

Where grains touch, each repetition carries them on through their contacts first, at the velocity of the fluid that the
one before has found, and the fluid makes room for them as they then move: if it did so a step later, dense beds of
grains that follow it within less than a step would swing ever more. A grain's drag changes with that velocity by K
where contacts hold it, and by K/(1 + dt K/m) where it is free. What the drag of the fluid still exceeds that of the
grains by, they get as an impulse at the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid.balances import Measures, mean_stress, measured, measures_of
from softdyn.fluid.boundary_keys import periodic_pairs
from softdyn.fluid.fields import AXES, fields_of, vectors_at
from softdyn.fluid.flow_system import FlowEquations, FluidSystem, closure_faults, closure_of, prepared, without_level
from softdyn.fluid.fluid_result import HISTORY, frame_of
from softdyn.fluid.fluid_run import fingerprint, output_times, solver_arrays, solver_from, solver_of
from softdyn.fluid.linear_solvers import NAMES, LinearFailed, LinearSolver
from softdyn.fluid.mesh import place
from softdyn.fluid.newton import GOAL, NewtonFailed, Solution, solve
from softdyn.one_thread import in_one_thread
from softdyn.particles.mechanisms import untold
from softdyn.particles.packing import BALL
from softdyn.results.carried import carried
from softdyn.results.frame_file import FrameFile, begin, go_on, unended
from softdyn.results.origin import about, origin_now, scene_from
from softdyn.results.state_file import frames_beside, read_state, reading_checkpoint, remove, write_state
from softdyn.suspension.exchange import (
    Cloud,
    Exchange,
    Projections,
    drags,
    exchanged,
    known_of,
    misfit,
    porosity,
    projections,
    seen,
    shares_at,
    shear_rates,
    tried_of,
)
from softdyn.suspension.filter import Filter, filter_of, require_inside, spread, weights_at
from softdyn.suspension.grain_contacts import Passage, parameters_of_law
from softdyn.suspension.mixed import Mixing
from softdyn.suspension.moving_grains import (
    asks_shear_rates,
    columns_of_bonds,
    counted,
    engine_of,
    moved_on,
    moving_at_start,
    passed,
    set_shear_rates,
    told,
    told_again,
    told_of_contacts,
)
from softdyn.suspension.suspension_result import SuspensionFrame, SuspensionResult, gather_suspension
from softdyn.suspension.suspension_scene import WIDTH, SuspensionScene, check_suspension, grains_of
from softdyn.suspension.undisturbed import DragLaw, Mixture, drag_law, mixture_of, require_mixture
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.suspension.moving_grains import Engine, Moving

Array = NDArray[np.float64]
Progress = Callable[[float, int, int, float], None]

#: Repetitions of a step until the drag fits; with contacts, whose collisions come sooner or later as the drag changes,
#: so many are enough, and the result tells what is left.
MOST, ENOUGH = 50, 12
#: Flows that are tried in each; what does not fit then, over the drag, is in what is left, too.
FLOWS = 20
#: Misfit at which none is tried any more: of forces that add up to nothing, which the width of the filter spreads.
FITS = 1e-4
#: Residual of flows that are tried, over what is asked of the drag.
ROUGH = 1e-2
#: Friction that flows which are tried are weighed with at least, over the largest.
SLIGHT = 1e-3
#: Relative change of the length of a step from which sizes are told anew.
STEADY = 1e-9
#: What may be left then, over the largest drag, without a warning.
LEFT = 0.05
#: Speeds over those at which a factor was made, up and down, from which sizes are told anew.
OTHER = 2.0
#: Imbalance from which a result warns.
IMBALANCE = 1e-9
#: Part of the grains' volume that may as well have moved in a step, where nothing does.
STILL = 1e-6
#: What is counted over a run.
COUNTED = ("steps", "iterations", "repeats", "flows")
#: What is told of a step behind what is told of the flow: by axes, tensors, and numbers.
SUMS = ("grain_drag", "grain_pressure", "grain_weight", "grain_momentum", "grain_contact")
STRESSES = ("fluid_stress", "grain_stress")
NUMBERS = (
    "grain_volume", "volume_imbalance", "exchange_imbalance", "contacts", "substeps", "coupling_repeats",
    "coupling_change",
)  # fmt: skip


@dataclass(frozen=True)
class Suspension:
    """A scene made ready to run.

    Attributes
    ----------
    fluid : FluidSystem
    filter : Filter
    maps : Projections
    law : DragLaw
    radii, volume, mass : arrays, shape (grains,)
    acceleration : array, shape (d,)
        Of gravity.
    start : tuple of two arrays, shape (grains, d)
        Places and velocities.
    times : array
        Ends of all steps.
    contacts : GrainSystem or System, optional
        Of grains that touch, or do something else to one another.
    grains : Grains or SoftGrains, optional
        Their state at the start.
    mixture : Mixture, optional
        The viscosity of fluid and grains together, by a closure.
    """

    fluid: FluidSystem
    filter: Filter
    maps: Projections
    law: DragLaw
    radii: Array
    volume: Array
    mass: Array
    acceleration: Array
    start: tuple[Array, Array]
    times: Array
    contacts: Engine | None = None
    grains: Moving | None = None
    mixture: Mixture | None = None


@dataclass
class State:
    """Where a run is, with all that the next step needs."""

    step: int
    flow: Array
    x: Array
    v: Array
    share: Array
    drag: Array
    grains: Moving | None = None
    scales: Array | None = None
    rate: float = 0.0
    size: float = 0.0
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))


@dataclass
class Run:
    """A run: what is told of it so far."""

    system: Suspension
    measures: Measures
    solver: LinearSolver
    frames: list[SuspensionFrame] | FrameFile[SuspensionFrame]
    state: State
    history: list[list[float]] = field(default_factory=list)

    @property
    def t(self) -> float:
        """The time that it has reached."""
        return 0.0 if not self.state.step else float(self.system.times[self.state.step - 1])


def made_ready(scene: SuspensionScene) -> Suspension:
    """Check a scene, make its mesh, filter and kernels.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    check_suspension(scene)
    fluid = prepared(replace(scene, parameters=_of_fluid(scene)), moving=True)
    d = fluid.dimension
    grains = grains_of(scene, fluid.mesh)
    width = scene.width or WIDTH * float(grains.radii.max(initial=0.0))
    if not width:
        raise SceneError("[coupling] width is missing: without grains it does not follow from their radii")
    one = filter_of(fluid.mesh, fluid.pressure, width, periodic_pairs(scene.boundary))
    _, lost = weights_at(one, grains.x)
    require_inside(grains.x, lost)
    closure = closure_of(scene.drag, "[closures] drag", "drag")
    missing = [symbol.name for symbol in closure.parameters if symbol.name not in scene.parameters]
    if missing:
        raise SceneError(f"[parameters] {missing[0]} is missing: the closure {closure.name} needs it")
    if faults := closure_faults(closure, scene.parameters):
        raise SceneError(listed(faults))
    numbers = {**fluid.numbers, **{s.name: float(scene.parameters[s.name]) for s in closure.parameters}}
    extent = float(np.ptp(fluid.mesh.at, axis=0).min())
    law = drag_law(closure, numbers, d, one.length, extent)
    volume = BALL[d] * grains.radii**d
    mass = np.full(len(volume), math.inf) if scene.held else float(scene.grain_density or 0.0) * volume
    acceleration = np.zeros(d) if scene.gravity is None else np.array(scene.gravity, dtype=float)
    contacts = engine_of(scene, fluid.mesh, grains, mass)
    return Suspension(
        fluid,
        one,
        projections(fluid),
        law,
        grains.radii,
        volume,
        mass,
        acceleration,
        (grains.x, grains.v),
        _times(scene),
        contacts,
        moving_at_start(contacts, grains),
        None if fluid.mixture is None else mixture_of(fluid.mixture, fluid.numbers),
    )


def _of_fluid(scene: SuspensionScene) -> dict[str, Any]:
    """Parameters of a scene but for those of the drag and of the contacts alone."""
    drag = closure_of(scene.drag, "[closures] drag", "drag")
    own = {symbol.name for symbol in drag.parameters} | parameters_of_law(scene)
    if scene.mixture is not None:
        own -= {symbol.name for symbol in closure_of(scene.mixture, "[fluid] mixture", "viscosity").parameters}
    return {name: value for name, value in scene.parameters.items() if name not in own}


def _times(scene: SuspensionScene) -> Array:
    """Ends of the steps: equal ones up to each output time, none longer than is asked for."""
    assert scene.dt is not None
    goals = np.unique(np.append(output_times(scene), float(scene.until_t or 0.0)))
    parts, last = [], 0.0
    for goal in goals[goals > 0]:
        count = max(1, math.ceil((goal - last) / scene.dt * (1 - 1e-12)))
        parts.append(last + (goal - last) * np.arange(1, count + 1) / count)
        parts[-1][-1] = goal
        last = float(goal)
    return np.concatenate(parts)


@in_one_thread
def simulate_suspension(
    scene: SuspensionScene,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    keep: bool = False,
) -> SuspensionResult:
    """Run a scene of grains in a fluid; see :func:`softdyn.fluid.fluid_run.simulate_fluid`.

    Parameters
    ----------
    scene : SuspensionScene
    progress : function of (t, steps, Newton iterations, residual), optional
        Called after every step.
    checkpoint : str or Path, optional
        File to which the state is written now and then; it is removed at the end.
    resume : bool
        Whether to go on from that file, if it is there.
    keep : bool
        Whether to leave it at the end.

    Raises
    ------
    SceneError, LawError, CompileError
        If the scene cannot be used.
    IntegrationError
        If it cannot be carried to its end: naming the time, and the grain or the place. Its attribute ``partial`` is
        the result up to the last good state.

    Examples
    --------
    >>> from softdyn.suspension import simulate
    >>> settled = simulate(read_scene("settling.toml"))
    >>> bool(settled.x[-1, 0, 2] < settled.x[0, 0, 2])
    True
    """
    began = time.perf_counter()
    system = made_ready(scene)
    solver = solver_of(system.fluid)
    run = Run(system, measures_of(system.fluid), solver, [], _begin(system))
    checkpoint = None if checkpoint is None else Path(checkpoint)
    key = "" if checkpoint is None else _key(system, scene)
    if resume and checkpoint is not None and checkpoint.exists():
        _load(run, checkpoint, key)
    else:
        if checkpoint is not None:
            beside: dict[str, NDArray[Any]] = {}
            head = {
                "kind": SuspensionResult.kind,
                "key": key,
                **about(origin_now(scene, system.fluid.kernel.key), beside),
            }
            run.frames = begin(frames_beside(checkpoint), SuspensionFrame, head, beside)
        if output_times(scene)[0] == 0:
            run.frames.append(_frame(run))

    def go(after: Callable[[], None] | None) -> None:
        goals = set(output_times(scene).tolist())
        while run.state.step < len(system.times):
            solution = _step(run)
            if run.t in goals:
                run.frames.append(_frame(run))
            if progress is not None:
                progress(run.t, run.state.step, run.state.counts["iterations"], solution.measure)
            if after is not None:
                after()

    carried(
        go,
        checkpoint,
        lambda: _save(run, cast(Path, checkpoint), key),
        lambda: _result(run, scene, began),
        lambda: run.t,
    )
    result = _result(run, scene, began)
    if checkpoint is not None and not keep:
        remove(checkpoint)
    return result


def _begin(system: Suspension) -> State:
    """State at the start."""
    fluid, scene = system.fluid, system.fluid.scene
    x, v = system.start
    weights, _ = weights_at(system.filter, x)
    share = spread(system.filter, weights, system.volume)
    c = np.asarray(system.maps.up @ porosity(system.filter, share, 0.0))
    flow = np.zeros(len(fluid.unknowns.kinds))
    fluid.moving = {"c": c, "us": np.zeros((len(c), fluid.dimension))}
    if scene.start is not None:
        fields = fields_of(scene.start, fluid.dimension, scene.constants, "[start] velocity")
        flow[: fluid.velocities] = (c[:, None] * vectors_at(fields, fluid.velocity.at, 0.0)).T.reshape(-1)
    flow = fluid.unknowns.all_of(fluid.unknowns.free_of(flow), fluid.given(0.0))
    return State(0, flow, x.copy(), v.copy(), share, np.zeros_like(x), system.grains)


@dataclass(frozen=True)
class Stretch:
    """The step that is to be made.

    Attributes
    ----------
    t, dt : float
        Its end, and its length.
    cloud : Cloud
        Grains at its start, as if they touched nothing.
    shares : array, shape (grains,)
        Share of the grains in the volume at each.
    growth : array, shape (nodes of the filter,)
        dc/dt over the step before, which is that of this one where nothing touches.
    """

    t: float
    dt: float
    cloud: Cloud
    shares: Array
    growth: Array


@dataclass(frozen=True)
class Attempt:
    """What a repetition of a step takes from the one before.

    Attributes
    ----------
    whole, friction : array, shape (grains,)
        K, and its share K' where the step slows the grain down.
    fluid_v, push : array, shape (grains, d)
        Velocity of the fluid at the grains, and force of its pressure.
    """

    whole: Array
    friction: Array
    fluid_v: Array
    push: Array


@dataclass(frozen=True)
class Found:
    """What a repetition has found.

    Attributes
    ----------
    equations : FlowEquations
    solution : Solution
    cloud : Cloud
    friction : array, shape (grains,)
        K'.
    passage : Passage, optional
        Through the contacts.
    forces : Exchange
    growth : array, shape (nodes of the filter,)
    misfit : float
        Of the flow that was tried last; see :func:`softdyn.suspension.exchange.misfit`.
    """

    equations: FlowEquations
    solution: Solution
    cloud: Cloud
    friction: Array
    passage: Passage | None
    forces: Exchange
    growth: Array
    misfit: float


def _step(run: Run) -> Solution:
    """A step of both phases.

    Raises
    ------
    IntegrationError
    """
    system, state = run.system, run.state
    one = _stretch(run)
    attempt = _first_attempt(run, one)
    mixing, usual = Mixing(), attempt.whole[:, None]
    flow, repeats = state.flow, 0
    if state.rate and abs(1 / one.dt / state.rate - 1) >= STEADY:
        state.scales = None
    while True:
        found = _attempted(run, one, attempt, flow)
        flow, repeats = found.solution.x, repeats + 1
        new, change = _drag_after(system, one, attempt, found)
        passage = found.passage
        if change <= system.fluid.scene.rtol or (passage is not None and repeats == ENOUGH):
            break
        if repeats == MOST:
            raise IntegrationError(
                f"the drag on the grains does not settle at t={one.t:.6g}: after {MOST} repetitions of the step it "
                f"changes by {change:.1e}, and rtol={system.fluid.scene.rtol:g} is asked for; give a shorter [steps] dt"
            )
        if passage is not None:
            fluid_v, push = found.forces.fluid_v, found.forces.pressure
            tried = _tried_next(mixing, usual, (attempt.fluid_v, attempt.push), (fluid_v, push))
            new = Attempt(new.whole, new.friction, *tried)
        attempt = new
    found = _solved_to_rounding(run, one, found)
    forces = found.forces
    if passage is not None:
        forces = _given_the_rest(system, passage, forces, attempt.push, one.dt)
    _note(run, one, replace(found, forces=forces), repeats, change)
    return found.solution


def _stretch(run: Run) -> Stretch:
    """The next step.

    Raises
    ------
    IntegrationError
    """
    system, state = run.system, run.state
    t, before = float(system.times[state.step]), run.t
    dt = t - before
    weights, share = _shared(system, state.x, before)
    cloud = _cloud(run, weights, share, dt)
    return Stretch(t, dt, cloud, shares_at(system.filter, cloud), (state.share - share) / dt)


def _first_attempt(run: Run, one: Stretch) -> Attempt:
    """Drag and pressure on the grains as they are at the start of a step."""
    system, state, cloud = run.system, run.state, one.cloud
    fluid_v, slope = seen(system.filter, system.maps, cloud, *_fields(system.fluid, state.flow))
    whole, friction = drags(system.law, cloud, fluid_v, state.v, one.shares)
    if system.contacts is not None and asks_shear_rates(system.contacts):
        flux, _ = _fields(system.fluid, state.flow)
        set_shear_rates(system.contacts, shear_rates(system.filter, system.maps, cloud, flux))
    return Attempt(whole, friction, fluid_v, -cloud.volume[:, None] * slope)


def _attempted(run: Run, one: Stretch, attempt: Attempt, flow: Array) -> Found:
    """Repeat a step: carry the grains through their contacts, then solve for the flow.

    Parameters
    ----------
    run : Run
    one : Stretch
    attempt : Attempt
    flow : array, shape (unknowns,)
        The best known.
    """
    system, passage, cloud = run.system, None, one.cloud
    friction, growth = attempt.friction, one.growth
    if run.state.grains is not None:
        passage = _passage(run, one.t, attempt)
        cloud, friction = _met(cloud, passage, system.mass, one.dt, attempt)
        growth = (cloud.share - _shared(system, passage.x, one.t)[1]) / one.dt
    equations, solution, off = _flow_among(run, one, cloud, friction, growth, flow)
    forces = exchanged(system.filter, system.maps, cloud, friction, *_fields(system.fluid, solution.x))
    return Found(equations, solution, cloud, friction, passage, forces, growth, off)


def _solved_to_rounding(run: Run, one: Stretch, found: Found) -> Found:
    """The flow of the last repetition, and what it does to the grains, to rounding: before, it need not balance."""
    system = run.system
    solution = _solved(run, one, found.equations, found.solution.x)
    forces = exchanged(system.filter, system.maps, found.cloud, found.friction, *_fields(system.fluid, solution.x))
    return replace(found, solution=solution, forces=forces)


def _flow_among(
    run: Run, one: Stretch, cloud: Cloud, friction: Array, growth: Array, flow: Array
) -> tuple[FlowEquations, Solution, float]:
    """The flow among grains of a friction, solved again until they feel the mean of the flow that comes out.

    Parameters
    ----------
    run : Run
    one : Stretch
    cloud : Cloud
    friction : array, shape (grains,)
        K'.
    growth : array, shape (nodes of the filter,)
    flow : array, shape (unknowns,)
        The best known.

    Returns
    -------
    equations : FlowEquations
    solution : Solution
    misfit : float
        What is left of it.
    """
    system, fluid, state = run.system, run.system.fluid, run.state
    about = (system.filter, system.maps, cloud, friction)
    known = known_of(*about, growth)
    mixing, weight = Mixing(), known["friction"] + SLIGHT * known["friction"].max(initial=0.0)
    tried, goal = _fields(fluid, flow)[0], ROUGH * min(fluid.scene.rtol, FITS)
    for count in range(1, FLOWS + 1):
        fluid.moving = {**known, **tried_of(*about, tried)}
        equations = fluid.equations(one.t, 1 / one.dt, -state.flow / one.dt)
        solution = _solved(run, one, equations, flow, goal)
        flow = solution.x
        found = _fields(fluid, flow)[0]
        off = misfit(*about, found, tried)
        if off <= max(fluid.scene.rtol, FITS) or count == FLOWS:
            break
        z = mixing.next((weight[:, None] * tried).reshape(-1), (weight[:, None] * found).reshape(-1))
        tried = z.reshape(found.shape) / weight[:, None]
    state.counts["flows"] += count
    return equations, solution, off


def _solved(run: Run, one: Stretch, equations: FlowEquations, flow: Array, goal: float = GOAL) -> Solution:
    """Solve for the flow, with the factor of a matrix before where that serves.

    Parameters
    ----------
    run : Run
    one : Stretch
    equations : FlowEquations
    flow : array, shape (unknowns,)
        The best known.
    goal : float
        Relative residual.

    Raises
    ------
    IntegrationError
    """
    fluid, state = run.system.fluid, run.state
    guess = fluid.unknowns.all_of(fluid.unknowns.free_of(flow), fluid.given(one.t))
    factors = run.solver.counts["factorisations"]
    try:
        solution = solve(equations, fluid.unknowns, run.solver, guess, state.scales, goal=goal)
    except (NewtonFailed, LinearFailed) as error:
        run.solver.forget()
        state.scales = None
        worst = f", at {fluid.where(error.row)}" if isinstance(error, NewtonFailed) else ""
        raise IntegrationError(
            f"a step of the length {one.dt:.4g} from t={one.t - one.dt:.6g} fails: {error}{worst}; give a shorter "
            "[steps] dt"
        ) from None
    state.scales = solution.scales
    if run.solver.counts["factorisations"] > factors:
        state.rate, state.size = 1 / one.dt, float(np.abs(solution.x[: fluid.velocities]).max(initial=0.0))
    state.counts["iterations"] += solution.iterations
    return solution


def _drag_after(system: Suspension, one: Stretch, attempt: Attempt, found: Found) -> tuple[Attempt, float]:
    """The drag at the velocities that a repetition has found, and its change over the largest.

    Parameters
    ----------
    system : Suspension
    one : Stretch
    attempt : Attempt
        With which they were found.
    found : Found
    """
    forces, passage = found.forces, found.passage
    v, off = forces.v, 0.0
    if passage is not None:
        off = float(np.sqrt(np.sum((forces.drag - passage.drag) ** 2, axis=1)).max(initial=0.0))
        v = attempt.fluid_v - passage.drag / attempt.whole[:, None]
    whole, friction = drags(system.law, found.cloud, forces.fluid_v, v, one.shares)
    speeds = np.sqrt(np.sum((forces.fluid_v - v) ** 2, axis=1))
    change = max(off, float(np.max(np.abs(whole - attempt.whole) * speeds, initial=0.0)))
    largest = float(np.max(whole * speeds, initial=0.0))
    return replace(attempt, whole=whole, friction=friction), change / largest if largest else 0.0


def _note(run: Run, one: Stretch, found: Found, repeats: int, change: float) -> None:
    """Note what is told of a step, and go on to its end.

    Parameters
    ----------
    run : Run
    one : Stretch
    found : Found
        In its last repetition.
    repeats : int
    change : float
        Of the drag, in the last one.
    """
    state, system, forces, passage = run.state, run.system, found.forces, found.passage
    solution = found.solution
    told = _told(run, one, found)
    told += _told_of_contacts(run, passage)
    head = [one.t, one.dt, float(solution.iterations), solution.measure, math.nan]
    run.history.append([*head, *told, float(repeats), max(change, found.misfit)])
    size = float(np.abs(solution.x[: system.fluid.velocities]).max(initial=0.0))
    if not (size < OTHER * state.size and size * OTHER > state.size):
        state.scales = None
    state.flow, state.v, state.share, state.drag = solution.x, forces.v, found.cloud.share, forces.drag
    state.x = state.x + one.dt * forces.v if passage is None else passage.x
    state.grains = None if passage is None else passage.grains
    state.step += 1
    state.counts["steps"] += 1
    state.counts["repeats"] += repeats


def _shared(system: Suspension, x: Array, t: float) -> tuple[csr_matrix, Array]:
    """Weights of the filter at the grains, and their share of the volume at its nodes.

    Raises
    ------
    IntegrationError
        If a grain is not in the mesh, or they leave no room to the fluid, or the mixture has no viscosity.
    """
    weights, lost = weights_at(system.filter, x)
    if len(lost):
        raise IntegrationError(
            f"grain {lost[0]} has left the mesh, at {place(x[lost[0]])}, t={t:.6g}: give a contact law and "
            "[contacts] walls that keep grains in, end the run earlier, or make the mesh larger"
        )
    share = spread(system.filter, weights, system.volume)
    porosity(system.filter, share, t)
    if system.mixture is not None and len(share):
        k = int(np.argmax(share))
        require_mixture(system.mixture, float(share[k]), place(system.filter.nodes.at[k]), t)
    return weights, share


def _cloud(run: Run, weights: csr_matrix, share: Array, dt: float) -> Cloud:
    """Grains at the start of a step, as if they touched nothing."""
    system, state = run.system, run.state
    held = np.isinf(system.mass)
    ease = np.where(held, 0.0, dt / system.mass)
    aim = state.v + np.where(held[:, None], 0.0, dt * system.acceleration)
    return Cloud(state.x, state.v, aim, ease, system.volume, system.radii, weights, share)


def _passage(run: Run, t: float, attempt: Attempt) -> Passage:
    """Carry the grains on through their contacts."""
    system, grains = run.system, run.state.grains
    assert system.contacts is not None
    assert grains is not None
    force = attempt.push + system.mass[:, None] * system.acceleration
    return passed(system.contacts, grains, t, attempt.whole, attempt.fluid_v, force)


def _met(cloud: Cloud, passage: Passage, mass: Array, dt: float, attempt: Attempt) -> tuple[Cloud, Array]:
    """Grains whose drag is that of their passage, and changes from there with the velocity of the fluid.

    Parameters
    ----------
    cloud : Cloud
    passage : Passage
    mass : array, shape (grains,)
    dt : float
    attempt : Attempt
        With which it was made.
    """
    ease = np.where(passage.touch, 0.0, dt / mass)
    friction = attempt.whole / (1 + ease * attempt.whole)
    aim = attempt.fluid_v - passage.drag / friction[:, None] - ease[:, None] * attempt.push
    return replace(cloud, ease=ease, aim=aim, v=(passage.x - cloud.x) / dt), friction


def _tried_next(
    mixing: Mixing, friction: Array, tried: tuple[Array, Array], found: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Velocity of the fluid and pressure to try next, of which the first is weighed by a friction, as forces are."""
    (v, push), (found_v, found_push) = tried, found
    z = mixing.next(np.stack([friction * v, push]).reshape(-1), np.stack([friction * found_v, found_push]).reshape(-1))
    force, pushed = z.reshape(2, *v.shape)
    return force / friction, pushed


def _given_the_rest(system: Suspension, passage: Passage, forces: Exchange, push: Array, dt: float) -> Exchange:
    """Give the grains what the fluid has lost beyond what they have had in their passage."""
    rest = forces.drag - passage.drag + forces.pressure - push
    v = passage.v + dt / system.mass[:, None] * rest
    moved_on(passage.grains, v)
    return replace(forces, v=v)


def _told_of_contacts(run: Run, passage: Passage | None) -> list[float]:
    """Contacts at the end of a step, and the steps into which they have divided it."""
    before = run.state.grains
    if passage is None or before is None:
        return [0.0, 0.0]
    assert run.system.contacts is not None
    touching, steps = counted(run.system.contacts, before, passage.grains)
    return [float(touching), float(steps)]


def _fields(fluid: FluidSystem, x: Array) -> tuple[Array, Array]:
    """Flux at the nodes of the velocity, and pressure."""
    return x[: fluid.velocities].reshape(fluid.dimension, -1).T, x[fluid.velocities :]


def _told(run: Run, one: Stretch, found: Found) -> list[float]:
    """What is told of a step: of the flow, then of the grains and of what the two exchange."""
    equations, solution, cloud, forces = found.equations, found.solution, found.cloud, found.forces
    growth, dt = found.growth, one.dt
    walls, after = np.zeros(cloud.x.shape[1]), None
    if found.passage is not None:
        walls, after = found.passage.walls, found.passage.grains
    system, measures = run.system, run.measures
    fluid, maps, mass = system.fluid, system.maps, system.filter.mass
    x, d, columns = without_level(fluid, solution.x), fluid.dimension, measures.columns
    told = measured(fluid, measures, equations, x, solution.residual, run.solver.least)
    # what flows out of the fluid is what grains displace
    fluxes = told[[columns.index(f"flux_{name}") for name in measures.names]]
    made = float(mass @ growth)
    # grains at rest displace nothing, but for the rounding of their volume
    moving = float(mass @ np.abs(growth)) + STILL * float(mass @ cloud.share) / dt
    flowing = float(np.abs(fluxes).sum()) + moving
    told[columns.index("mass_imbalance")] = abs(fluxes.sum() + made) / flowing if flowing else 0.0
    # of the force on the grains the fluid feels all, but for the pressure, of which it has p grad c
    p = x[fluid.velocities :]
    steep = np.array([p @ (part @ (1 - cloud.share)) for part in maps.slopes])
    bed = told[[columns.index(f"bed_force_{axis}") for axis in AXES[:d]]]
    # the pressure may be large, and what it does to the grains little
    pushed = sum(float(np.abs(p) @ np.abs(part @ (1 - cloud.share))) for part in maps.slopes)
    sizes = float(np.abs(forces.drag).sum() + np.abs(bed).sum()) + pushed
    off = float(np.abs(bed + steep - forces.drag.sum(axis=0)).max())
    free = np.where(np.isinf(system.mass), 0.0, system.mass)[:, None]
    by_axes = [forces.drag, forces.pressure, free * system.acceleration, free * forces.v, walls[None]]
    volume, whole = float(mass @ cloud.share), float(system.volume.sum())
    numbers = [volume, abs(volume - whole) / whole if whole else 0.0, off / sizes if whole and sizes else 0.0]
    stresses = [mean_stress(fluid, measures, equations, x), _of_contacts(system, after)[0]]
    sums = np.concatenate([one.sum(axis=0) for one in by_axes] + [one.reshape(-1) for one in stresses])
    return [*told.tolist(), *sums.tolist(), *numbers]


def _columns(run: Run) -> Measures:
    """Measures with the names of all that is told of a step."""
    axes = AXES[: run.system.fluid.dimension]
    sums = (f"{name}_{axis}" for name in SUMS for axis in axes)
    tensors = (f"{name}_{one}{other}" for name in STRESSES for one in axes for other in axes)
    names = (*run.measures.columns, *sums, *tensors, *NUMBERS)
    return replace(run.measures, columns=names)


def _of_contacts(system: Suspension, grains: Moving | None) -> tuple[Array, Array]:
    """Stress of the contacts, and forces on the walls."""
    volume, walls = float(system.filter.mass.sum()), len(getattr(system.fluid.scene, "walls", ()))
    return told_of_contacts(system.contacts, grains, volume, system.fluid.dimension, walls)


def _frame(run: Run) -> SuspensionFrame:
    system, state, flow = run.system, run.state, frame_of(run.system.fluid, run.t, run.state.flow)
    of_contacts = _of_contacts(system, state.grains)
    of_grains = (state.x.copy(), state.v.copy(), state.drag.copy())
    return SuspensionFrame(flow.t, flow.u, flow.p, flow.c, flow.us, *of_grains, *of_contacts)


def _result(run: Run, scene: SuspensionScene, began: float) -> SuspensionResult:
    system, measures, solver = run.system.fluid, _columns(run), run.solver
    columns = (*HISTORY, *measures.columns)
    rows = np.array(run.history, dtype=float).reshape(-1, len(columns))
    kinds = ("mass", "momentum", "volume", "exchange")
    worst = {f"{what}_imbalance": float(rows[:, columns.index(f"{what}_imbalance")].max(initial=0.0)) for what in kinds}
    stats: dict[str, Any] = {
        "method": "Euler",
        "elements": scene.elements,
        "unknowns": len(system.unknowns.kinds),
        "free": system.unknowns.basis.shape[1],
        "grains": len(run.system.radii),
        "width": 2 * run.system.filter.length,
        "rejected": 0,
        **run.state.counts,
        **{f"linear_{name}": number for name, number in solver.counts.items()},
        "linear_residual": solver.worst,
        "linear_solver": NAMES[solver.way],
        "residual": float(rows[:, columns.index("step_residual")].max(initial=0.0)),
        **worst,
        "energy_imbalance": float(rows[:, columns.index("energy_imbalance")].max(initial=0.0)),
        "wall_s": time.perf_counter() - began,
        "kernel": system.kernel.key,
    }
    stats["warnings"] = [f"{words} (first at t = {t:g})" for words, t in system.warnings.items()]
    stats["warnings"] += [
        f"the balance of {what} is off by {worst[f'{what}_imbalance']:.1e}"
        for what in kinds
        if worst[f"{what}_imbalance"] > IMBALANCE
    ]
    left = float(rows[:, columns.index("coupling_change")].max(initial=0.0))
    if run.system.contacts is not None:
        stats["substeps"] = int(rows[:, columns.index("substeps")].sum())
        stats["coupling_change"] = left
    if left > max(LEFT, scene.rtol):
        stats["warnings"].append(
            f"the drag on the grains and that of the fluid differed by {left:.1e} after {ENOUGH} repetitions of a "
            "step: give a shorter [steps] dt"
        )
    more = columns_of_bonds(run.system.contacts, run.state.grains, list(run.frames))
    plain = gather_suspension(system, measures, run.system.radii, run.frames, run.history, stats, scene.walls, more)
    return replace(plain, origin=origin_now(scene, system.kernel.key))


def _key(system: Suspension, scene: SuspensionScene) -> str:
    """Digest of what a run depends on: all of the scene, and its steps."""
    whole = fingerprint(replace(system.fluid, scene=scene))
    return sha256(whole.encode() + system.times.tobytes()).hexdigest()


def _save(run: Run, path: Path, key: str) -> None:
    """Write a checkpoint: a run that goes on from it does, to the last bit, what this one does."""
    state, kept, beside = run.state, *solver_arrays(run.solver)
    said = {name: getattr(state, name) for name in ("step", "rate", "size", "counts")}
    said |= {"frames": len(run.frames), "scaled": state.scales is not None, "warnings": run.system.fluid.warnings}
    arrays = {name: getattr(state, name) for name in ("flow", "x", "v", "share", "drag")}
    arrays["history"] = np.array(run.history, dtype=float).reshape(-1, len(HISTORY) + len(_columns(run).columns))
    if state.scales is not None:
        arrays["scales"] = state.scales
    if state.grains is not None:
        about, own = told(state.grains)
        said["grains"] = about
        arrays |= {f"grains_{name}": array for name, array in own.items()}
    write_state(path, key, {**said, **kept}, {**arrays, **beside})


def _load(run: Run, path: Path, key: str) -> None:
    """Go on from a checkpoint.

    Raises
    ------
    SceneError
        If the file is none, or belongs to another scene.
    """
    with reading_checkpoint(path):
        said, arrays = read_state(path, key)
        system = run.system.contacts
        given = {name: arrays[name] for name in ("flow", "x", "v", "share", "drag")}
        run.state = State(
            step=int(said["step"]),
            **given,
            grains=None if system is None else told_again(system, said["grains"], arrays, "grains_"),
            scales=arrays["scales"] if said["scaled"] else None,
            rate=float(said["rate"]),
            size=float(said["size"]),
            counts={name: int(number) for name, number in said["counts"].items()},
        )
        solver_from(run.solver, said, arrays)
        run.system.fluid.warnings.update({str(words): float(t) for words, t in said["warnings"].items()})
        run.history = [list(row) for row in arrays["history"].tolist()]
        run.frames = go_on(frames_beside(path), SuspensionFrame, key, int(said["frames"]))


def load_suspension_frames(path: Path) -> SuspensionResult:
    """Return a result of the frames that a run has written so far.

    Raises
    ------
    SceneError
        If the file is no such file, holds no frame, or tells of a scene that cannot be made ready.
    LawError, CompileError
    """
    system, frames, words = unended(
        path, SuspensionFrame, lambda origin: made_ready(scene_from(origin, SuspensionScene))
    )
    more_words = [] if system.contacts is None else untold(system.contacts.mechanisms)
    stats = {"elements": system.fluid.scene.elements, "warnings": [words, *more_words]}
    walls = tuple(scene.walls) if isinstance(scene := system.fluid.scene, SuspensionScene) else ()
    more = columns_of_bonds(system.contacts, None, list(frames))
    return gather_suspension(system.fluid, measures_of(system.fluid), system.radii, frames, [], stats, walls, more)
