"""How a trajectory of two particles depends on its parameters: the variational equations, along the steps it took.

A step in time is a polynomial whose stages z obey A^-1 z = dt f(y0 + z, t; p), with A the matrix of Radau IIA. Where
the steps stand, the derivative of that by a parameter is linear,

    (A^-1 - dt df/dy) dz/dp = dt (df/dy dy0/dp + df/dp),

and gives the derivative of the polynomial, exact for these steps: no step of its own, no difference. df/dy and df/dp
come from the kernel, which has them of the derivation (:mod:`softdyn.derive.parameter_slopes`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.expression import derivative, parse, pieces, places_of, values
from softdyn.kernels import Kernel, get_kernel
from softdyn.pair.pair_run import MOST_STEPS, Trajectory, simulated, states_at
from softdyn.pair.states import deflection, drive_at, evaluate
from softdyn.results.pair_result import PairResult
from softdyn.scene.pair_drive import Drive
from softdyn.scene.pair_scene import Scene
from softdyn.words import suggestion

Array = NDArray[np.float64]

STAGES = 8
#: The last stage is looked at so much before the end of its step, of its length: what is given may jump there.
BEFORE_END = 1e-12
EPS = float(np.finfo(float).eps)
#: Of a scene, what else than parameters of its law a trajectory may depend on.
OF_SCENE = ("h", "delta", "force", "velocity", "position", "stiffness")


@dataclass(frozen=True)
class Sensitivities:
    """A run, and the derivatives of its outputs by some of its parameters, at fixed time.

    Attributes
    ----------
    result : PairResult
    names : tuple of str
    slopes : mapping from str to array, shape (outputs, parameters)
        Of ``h``, ``delta``, ``X``, ``a`` and ``F``, each by each of the parameters, in units of the one over the other.
    """

    result: PairResult
    names: tuple[str, ...]
    slopes: Mapping[str, Array]


def sensitivities(
    scene: Scene,
    names: Sequence[str],
    *,
    kernel_of: Callable[..., Kernel] = get_kernel,
    relative: bool = False,
    most: float = MOST_STEPS,
) -> Sensitivities:
    """Simulate a scene, and tell how its outputs depend on some of its parameters.

    Parameters
    ----------
    scene : Scene
        Of one run. It is integrated in time (``method="integrate"``).
    names : sequence of str
        Parameters of the law; constants of the drive; "h" or "delta", at the start; "force", "velocity" or "position",
        where it is a number; "stiffness", of a spring.
    kernel_of : function, optional
        In the place of :func:`get_kernel`.
    relative : bool
        A position, or the base of a spring, is such that the deflection at the start does not depend on R and h: it is
        known up to a constant.
    most : number
        Of steps.

    Raises
    ------
    SceneError
        If one of the names is unknown, or if the trajectory is not differentiable by it.

    Examples
    --------
    Two spheres of twice the radius, or of twice the viscosity:

    >>> from softdyn.pair.sensitivities import sensitivities
    >>> from softdyn import Scene
    >>> scene = Scene(
    ...     law="rognon_gay", parameters={"R": 1, "E": 1, "eta": 1}, h=0.1, force=1e-3, until_t=1e4, times=[1e4]
    ... )
    >>> found = sensitivities(scene, ["R", "eta"])
    >>> found.slopes["h"].shape
    (1, 2)
    """
    names = tuple(names)
    scene = replace(scene, method="integrate")
    _require_known(scene, names)
    of_law = tuple(name for name in names if name in scene.parameters)
    of_kernel = (*of_law, *(("compliance_p1",) if "stiffness" in names else ()))
    # what the state alone tells comes with any kernel: one parameter at least
    asked = of_kernel or (next(iter(scene.parameters)),)
    result, run = simulated(scene, None, partial(kernel_of, sensitive=asked), most)
    drive = _DriveSlopes(scene, run.drive, names)
    start = _at_start(scene, run, drive, names, asked, relative)
    own = _of_parameters(scene, names, asked)
    stages = _along_steps(run, drive, start, own)
    return Sensitivities(result, names, _of_outputs(result, run, drive, own, stages))


def _require_known(scene: Scene, names: Sequence[str]) -> None:
    text = _text_of_drive(scene)
    constant = [name for name in ("force", "velocity", "position") if _is_number(getattr(scene, name))]
    there = [*scene.parameters, *scene.constants, "h", *constant]
    there += ["stiffness"] if scene.spring is not None else []
    there += ["delta"] if scene.velocity is not None and scene.X is None else []
    for name in names:
        if name not in there:
            raise SceneError(f"there is nothing called {name!r} to depend on{suggestion(name, there)}")
    both = [name for name in names if name in scene.constants and name in (*scene.parameters, *OF_SCENE)]
    if both:
        raise SceneError(f"[constants] {', '.join(both)} is the name of something else too: call it otherwise")
    for name in names:
        if name in scene.constants and isinstance(text, str):
            _require_fixed_kinks(name, text, scene.constants)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def _text_of_drive(scene: Scene) -> Any:
    """What is given: a number, a text, a table."""
    if scene.spring is not None:
        return scene.spring["base"]
    return next(value for value in (scene.force, scene.velocity, scene.position) if value is not None)


def _require_fixed_kinks(name: str, text: str, constants: Mapping[str, Any]) -> None:
    """Refuse a constant that says when a drive has a kink or jumps.

    A state just after would depend on it by a jump of its own.
    """
    shape = parse(text, {key: float(value) for key, value in constants.items()}).shape
    by = places_of(name, text, {key: float(value) for key, value in constants.items()})
    for switch in pieces(shape).switches:
        slope = derivative(switch, by)
        if slope[-1] != ("number", 0.0):
            raise SceneError(
                f"[constants] {name} says when {text!r} has a kink or jumps: how a run depends on it is not computed; "
                "take it as known"
            )


class _DriveSlopes:
    """Derivatives of what is given, and of its rate, by each of the names."""

    def __init__(self, scene: Scene, drive: Drive, names: tuple[str, ...]) -> None:
        self.control = drive.control
        self.names = names
        self.shapes: dict[int, tuple[Any, Any]] = {}
        text = _text_of_drive(scene)
        self.constants: tuple[float, ...] = ()
        self.ones = tuple(i for i, name in enumerate(names) if name == drive.control)
        if isinstance(text, str):
            known = {key: float(value) for key, value in scene.constants.items()}
            expression = parse(text, known)
            self.constants = expression.constants
            for i, name in enumerate(names):
                if name in known and name not in scene.parameters:
                    value = derivative(expression.shape, places_of(name, text, known))
                    self.shapes[i] = value, derivative(value)

    def at(self, t: Array, *, rate: bool) -> Array:
        """Of the value, or of its rate: shape (times, names)."""
        found = np.zeros((len(t), len(self.names)))
        for i, shapes in self.shapes.items():
            found[:, i] = values(shapes[int(rate)], t, self.constants)
        for i in self.ones:
            found[:, i] = 0.0 if rate else 1.0
        return found

    def given(self, t: Array) -> Array:
        """Of what the integration takes: the force, or the velocity of the centres or of the base."""
        return self.at(t, rate=self.control in ("position", "spring"))


def _of_parameters(scene: Scene, names: tuple[str, ...], asked: tuple[str, ...]) -> Array:
    """What each of the kernel's slopes by a parameter adds to that by each name: shape (asked, names)."""
    own = np.zeros((len(asked), len(names)))
    for i, name in enumerate(names):
        if name in asked:
            own[asked.index(name), i] = 1.0
        elif name == "stiffness" and scene.spring is not None:
            own[asked.index("compliance_p1"), i] = -1 / float(scene.spring["stiffness"]) ** 2
    return own


@dataclass(frozen=True)
class _Slopes:
    """Slopes that a kernel gives at some states.

    Attributes
    ----------
    state : mapping from str to array, shape (states,)
    by_parameter : mapping from str to array, shape (states, parameters)
    """

    state: Mapping[str, Array]
    by_parameter: Mapping[str, Array]


def _slopes_at(run: Trajectory, t: Array, h: Array, delta: Array, F: Array, rate: Array) -> _Slopes:
    """What the kernel says of states: the slopes stand behind its other outputs, in a known order."""
    from softdyn.derive.parameter_slopes import parameter_outputs, state_outputs

    by_force = run.drive.control == "force"
    inputs = {"F": F, "dF_dt": rate, "dX_dt": F if run.drive.control == "velocity" else rate}
    out = np.column_stack(list(evaluate(run.kernel, h, delta, inputs, run.p).values()))
    kinds = [name.removesuffix("_by_p") for name in parameter_outputs(by_force, "p")]
    state = state_outputs(by_force)
    first = next(i for i, name in enumerate(run.kernel.outputs) if f"{kinds[0]}_by_" in name)
    block = out[:, first:].reshape(len(t), -1, len(kinds))
    named = dict(zip(run.kernel.outputs, out.T, strict=True))
    return _Slopes({name: named[name] for name in state}, {kind: block[:, :, i] for i, kind in enumerate(kinds)})


def _at_start(
    scene: Scene, run: Trajectory, drive: _DriveSlopes, names: tuple[str, ...], asked: tuple[str, ...], relative: bool
) -> Array:
    """Derivatives of the state at the start: ln h, and delta where it is integrated; shape (components, names)."""
    start = np.zeros((run.kernel.components, len(names)))
    by_h = np.array([float(name == "h") for name in names])
    start[0] = by_h / float(scene.h)
    if run.kernel.components == 1:
        return start
    t = np.array([run.drive.start])
    by_R = np.array([float(name == "R") for name in names])
    # of 2 R + h - X, or of 2 R + h less the place of the base: twice the deflection, or what the spring is pressed by
    stretch = 0.0 * by_h if relative else 2 * by_R + by_h - drive.at(t, rate=False)[0]
    if run.drive.control == "position":
        start[1] = stretch / 2
    elif run.drive.control == "velocity":
        start[1] = [float(name == "delta") for name in names]
        if scene.X is not None:
            start[1] = by_R + by_h / 2
    else:
        value, rate = drive_at(run.kernel, run.drive, t)
        at = _slopes_at(run, t, np.array([float(scene.h)]), np.array([run.delta0]), value, rate)
        k = run.drive.stiffness
        by_k = np.array([float(name == "stiffness") for name in names])
        force = float(_elastic(run, scene, value, rate))
        own = at.by_parameter["F_ela"][0] @ _of_parameters(scene, names, asked)
        own = own + at.state["F_ela_by_h"][0] * by_h
        # F_ela(h, delta; p) = k (stretch - 2 delta)
        start[1] = (k * stretch + by_k * force / k - own) / (at.state["F_ela_by_delta"][0] + 2 * k)
    return start


def _elastic(run: Trajectory, scene: Scene, value: Array, rate: Array) -> float:
    """F_ela at the start."""
    inputs = {"F": value, "dF_dt": rate, "dX_dt": rate}
    found = evaluate(run.kernel, np.array([float(scene.h)]), np.array([run.delta0]), inputs, run.p)
    return float(found["F_ela"][0])


def _along_steps(run: Trajectory, drive: _DriveSlopes, start: Array, own: Array) -> Array:
    """Derivatives of the state at the start of each step, and of its stages: shape (steps, components, 9, names)."""
    from softdyn.derive.radau import radau_iia

    steps, parts = run.steps, run.kernel.components
    method = radau_iia()
    nodes = np.array(method.nodes[1:])
    inverse = np.array(method.inverse).reshape(STAGES, STAGES).T
    begin, length = steps[:, 0], steps[:, 1]
    t = begin[:, None] + length[:, None] * nodes
    before = np.maximum(BEFORE_END * length, 4 * EPS * np.abs(t[:, -1]))
    t[:, -1] -= np.minimum(before, (1 - nodes[-2]) / 2 * length)
    flat = t.ravel()
    stage = [(steps[:, 3 + 9 * k, None] + steps[:, 4 + 9 * k : 12 + 9 * k]).ravel() for k in range(parts)]
    h = np.exp(stage[0])
    value, rate = drive_at(run.kernel, run.drive, flat)
    delta = deflection(run.kernel, h, value, run.p) if parts == 1 else stage[1]
    at = _slopes_at(run, flat, h, delta, value, rate)
    moved = drive.given(flat)
    if parts == 1:
        jacobian = [[at.state["slope_p11"]]]
        rates = [at.by_parameter["u_rate"] @ own + at.state["by_force_p1"][:, None] * moved]
    else:
        jacobian = [[at.state[f"slope_p{i}{j}"] for j in (1, 2)] for i in (1, 2)]
        by_given = at.state["delta_rate_by_given"][:, None] * moved
        rates = [at.by_parameter["u_rate"] @ own, at.by_parameter["delta_rate"] @ own + by_given]

    count, size = len(steps), parts * STAGES
    J = np.zeros((count, size, size))
    for i in range(parts):
        for j in range(parts):
            for s in range(STAGES):
                J[:, STAGES * i + s, STAGES * j + s] = length * jacobian[i][j].reshape(count, STAGES)[:, s]
    matrix = np.kron(np.eye(parts), inverse) - J
    # stages answer to each component of the start, and to the parameters themselves
    ones = np.kron(np.eye(parts), np.ones((STAGES, 1)))
    forced = np.concatenate([length[:, None, None] * part.reshape(count, STAGES, -1) for part in rates], axis=1)
    answer = np.linalg.solve(matrix, np.concatenate([J @ ones, forced], axis=2))

    found = np.empty((count, parts, STAGES + 1, start.shape[1]))
    now = start
    for n in range(count):
        dz = (answer[n, :, :parts] @ now + answer[n, :, parts:]).reshape(parts, STAGES, -1)
        found[n, :, 0], found[n, :, 1:] = now, dz
        now = now + dz[:, -1]
    return found


def _of_outputs(
    result: PairResult, run: Trajectory, drive: _DriveSlopes, own: Array, stages: Array
) -> dict[str, Array]:
    """Derivatives of the outputs, from those of the state, which the polynomials of the steps have at any time."""
    t, h, delta = result.t, result.h, result.delta
    value, rate = drive_at(run.kernel, run.drive, t)
    at = _slopes_at(run, t, h, delta, value, rate)
    parts, names = run.kernel.components, stages.shape[3]
    state = np.empty((parts, len(t), names))
    for i in range(names):
        turned = run.steps.copy()
        for k in range(parts):
            turned[:, 3 + 9 * k : 12 + 9 * k] = stages[:, k, :, i]
        state[:, :, i] = states_at(run.kernel, turned, t)
    by_h = h[:, None] * state[0]
    forces = drive.at(t, rate=False)
    if parts == 1:
        by_delta = at.state["slope_p21"][:, None] * state[0] + at.state["delta_by_force"][:, None] * forces
        by_delta = by_delta + at.by_parameter["delta"] @ own
    else:
        by_delta = state[1]

    def through_state(name: str) -> Array:
        own_slopes = at.by_parameter[name] @ own
        by_state: Array = at.state[f"{name}_by_h"][:, None] * by_h + at.state[f"{name}_by_delta"][:, None] * by_delta
        return by_state + own_slopes

    F = forces if parts == 1 else through_state("F_ela")
    return {"h": by_h, "delta": by_delta, "X": through_state("X"), "a": through_state("a"), "F": F}
