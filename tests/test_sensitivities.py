"""How a trajectory depends on its parameters: derived, and exact along the steps that were taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from sympy import Dummy, Expr, Symbol, lambdify

from softdyn import Scene
from softdyn.derive import ContactLaw
from softdyn.derive.dimensions import FORCE, LENGTH, TIME, Dimension
from softdyn.derive.law import dimensions_for, parameters_of
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.radau import radau_iia
from softdyn.derive.symbols import a, delta, h
from softdyn.errors import LawError, SceneError
from softdyn.kernels import get_kernel
from softdyn.laws import law_of
from softdyn.pair.pair_run import simulated
from softdyn.pair.sensitivities import Sensitivities, sensitivities

Array = np.ndarray[Any, Any]
PAPER = {"R": 1.0, "E": 1.0, "eta": 1.0}
BRUSHES = {**PAPER, "nu": 0.4, "Pi0": 0.3, "L": 1e-2}
CHARGED = {**PAPER, "nu": 0.4, "Pi0": 0.3, "ell": 1e-2, "A": 1e-6}


def approach(law: str, parameters: dict[str, float], **drive: Any) -> Scene:
    """Two particles brought together from a tenth of the radius, at a rate that lets the film flatten."""
    times = np.linspace(0.0, 2000.0, 9).tolist()
    given = {"law": law, "parameters": parameters, "h": 0.1, "until_t": 2000.0, "times": times, "rtol": 1e-12}
    return Scene(**{**given, **drive})


#: A scene for each way to drive a pair, and what its trajectory depends on besides the law.
DRIVES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "force": (
        {"force": "f0*(2 - cos(w*t))", "constants": {"f0": 1e-3, "w": 0.01}, "rtol": 1e-12},
        ("h", "f0", "w"),
    ),
    "velocity": ({"velocity": -8e-5, "delta": 1e-5}, ("h", "delta", "velocity")),
    "position": ({"position": "x0 - v*t", "constants": {"x0": 2.0999, "v": 8e-5}}, ("h", "x0", "v")),
    "spring": (
        {"spring": {"stiffness": 0.1, "base": "b0 - v*t"}, "constants": {"b0": 2.0995, "v": 8e-5}},
        ("h", "b0", "v", "stiffness"),
    ),
}


#: Each has a kernel of its own: by default those of a force, and of a spring, which has all that the others have.
BY_DEFAULT = [pytest.param(kind, marks=() if kind in ("force", "spring") else pytest.mark.slow) for kind in DRIVES]


def changed(scene: Scene, name: str, by: float) -> Scene:
    """The scene with one of its numbers larger by a part of itself."""
    if name in scene.parameters:
        return replace(scene, parameters={**scene.parameters, name: scene.parameters[name] * (1 + by)})
    if name in scene.constants:
        return replace(scene, constants={**scene.constants, name: scene.constants[name] * (1 + by)})
    if name == "stiffness":
        return replace(scene, spring={**scene.spring, "stiffness": scene.spring["stiffness"] * (1 + by)})
    return replace(scene, **{name: getattr(scene, name) * (1 + by)})


def value_of(scene: Scene, name: str) -> Any:
    if name == "stiffness":
        return scene.spring["stiffness"]
    return {**scene.parameters, **scene.constants}.get(name) or getattr(scene, name)


#: The kernels that have the slopes, for runs without them too.
with_slopes = partial(get_kernel, sensitive=tuple(PAPER))


# --- complex steps: the law itself, and nothing that is derived for the kernel ---


def pressed(law: ContactLaw) -> dict[str, Callable[..., Any]]:
    """The law at delta > 0 as functions of complex numbers: all of h, delta and the parameters, in their order."""
    size = Dummy("delta", positive=True)
    names = [h, size, *parameters_of(law)]
    radius = law.a.subs(delta, size)

    def whole(expr: Expr) -> Expr:
        return expr.subs(delta, size).subs(a, radius)

    elastic = whole(law.F_ela)
    found = {"elastic": elastic, "by_h": elastic.diff(h), "by_delta": elastic.diff(size)}
    found |= {"zeta": whole(law.zeta), "remote": whole(law.F_adh)}
    return {name: lambdify(names, expr, "numpy") for name, expr in found.items()}


def in_complex(
    scene: Scene, law: ContactLaw, steps: Array, start: Array, given: Callable[[Any], Any], known: list[Array]
) -> Array:
    """The end of the steps of a scene whose numbers are complex: its collocation equations, solved anew.

    ``given`` is the force, or the velocity of the centres or of the base, in time; ``known`` keeps, of each step, the
    matrix of the iteration, which only has to be near.
    """
    of, p = pressed(law), [scene.parameters[s.name] for s in parameters_of(law)]
    compliance = 1 / scene.spring["stiffness"] if scene.spring is not None else 0.0
    nodes, inverse = np.array(radau_iia().nodes[1:]), np.array(radau_iia().inverse).reshape(8, 8).T
    deflection = np.full(8, 1e-3 + 0j)

    def rates(t: Array, y: Array) -> Array:
        nonlocal deflection
        gap, V = np.exp(y[0]), given(t)
        if len(y) == 1:
            change = 1.0
            while np.max(np.abs(change)) > 1e-8:  # and once more, by which it is exact
                change = (of["elastic"](gap, deflection, *p) - V) / of["by_delta"](gap, deflection, *p) / deflection
                deflection = deflection * (1 - change)
            deflection -= (of["elastic"](gap, deflection, *p) - V) / of["by_delta"](gap, deflection, *p)
            rate = -(V - of["remote"](gap, deflection, *p)) / of["zeta"](gap, deflection, *p)
            return np.array([rate / gap])
        d = y[1]
        rate = -(of["elastic"](gap, d, *p) - of["remote"](gap, d, *p)) / of["zeta"](gap, d, *p)
        # compliance dF/dt = dX/dt - V, and X = 2 R + h - 2 delta
        stiffness = of["by_delta"](gap, d, *p) * compliance
        return np.array([rate / gap, (rate - V - compliance * of["by_h"](gap, d, *p) * rate) / (2 + stiffness)])

    y, parts = start.astype(complex), len(start)
    for n, step in enumerate(steps):
        t, dt = step[0] + step[1] * nodes, step[1]
        z = np.array([step[4 + 9 * k : 12 + 9 * k] for k in range(parts)]).astype(complex)

        def left(z: Array, y: Array = y, t: Array = t, dt: float = dt) -> Array:
            return (z @ inverse.T - dt * rates(t, y[:, None] + z)).ravel()

        if n == len(known):
            # by differences: the iteration converges all the same, by some 1e-6 a turn
            J = np.empty((8 * parts, 8 * parts))
            for j in range(8 * parts):
                size = 1e-6 * (1.0 if j < 8 else abs(y[1]) + 1e-6)
                moved = z.copy().ravel()
                moved[j] += size
                J[:, j] = (left(moved.reshape(parts, 8)) - left(z)).real / size
            known.append(np.linalg.inv(J))
        for _ in range(4):
            z = z - (known[n] @ left(z)).reshape(parts, 8)
        y = y + z[:, -1]
    return y


@pytest.mark.slow
@pytest.mark.parametrize("kind", BY_DEFAULT)
def test_slopes_are_those_of_a_complex_step_along_the_same_steps(kind: str) -> None:
    # h, delta and all numbers of the scene in complex arithmetic, of the law as it is declared
    given, others = DRIVES[kind]
    scene = approach("rognon_gay", PAPER, **{**given, "times": [2000.0], "rtol": 1e-9})
    names = ("R", "E", "eta", *others)
    found = sensitivities(scene, names)
    law = law_of("rognon_gay")
    _, run = simulated(replace(scene, method="integrate"), None, with_slopes)
    matrices: list[Array] = []
    for i, name in enumerate(names):
        turned = changed(scene, name, 1e-30j)
        numbers = {**turned.parameters, **turned.constants}
        if kind == "force":
            start = np.array([np.log(turned.h)])
            drive = lambda t, c=numbers: c["f0"] * (2 - np.cos(c["w"] * t))  # noqa: E731
        elif kind == "velocity":
            start = np.array([np.log(turned.h), turned.delta])
            drive = lambda t, v=turned.velocity: v + 0 * t  # noqa: E731
        else:
            stretch = 2 * numbers["R"] + turned.h - numbers["x0" if kind == "position" else "b0"]
            start = np.array([np.log(turned.h), stretch / 2])
            drive = lambda t, c=numbers: -c["v"] + 0 * t  # noqa: E731
        if kind == "spring":
            of, p, k = pressed(law), [numbers[s.name] for s in parameters_of(law)], turned.spring["stiffness"]
            balanced = start[1] + 0j
            for _ in range(30):
                off = of["elastic"](turned.h, balanced, *p) - k * (stretch - 2 * balanced)
                balanced = balanced - off / (of["by_delta"](turned.h, balanced, *p) + 2 * k)
            start = np.array([start[0], balanced])
        end = in_complex(turned, law, run.steps, start, drive, matrices)
        exact = np.exp(end[0]).imag / 1e-30 / value_of(scene, name)
        # the engine's stages obey their equations to a hundredth of rtol, and what depends on them less by its slopes
        assert found.slopes["h"][-1, i] == pytest.approx(exact, rel=1e-8), name
        if len(end) == 2:
            assert found.slopes["delta"][-1, i] == pytest.approx(end[1].imag / 1e-30 / value_of(scene, name), rel=1e-8)


# --- differences, and what must hold of any law ---


def by_differences(scene: Scene, name: str, quantity: str, part: float = 1e-4) -> tuple[Array, float]:
    """Slope of an output by a number of the scene, of fourth order, and how far it is known."""
    kernels = partial(get_kernel, sensitive=tuple(scene.parameters))
    runs = [simulated(changed(scene, name, k * part), None, kernels)[0].arrays[quantity] for k in (1, -1, 2, -2)]
    size = part * value_of(scene, name)
    near, far = (runs[0] - runs[1]) / (2 * size), (runs[2] - runs[3]) / (4 * size)
    # the error of the first is a third of what the two differ by; what is left is of its square, and of rounding
    known = np.max(np.abs(near - far)) * 0.1 + 1e-11 * np.max(np.abs(runs[0])) / abs(size)
    return (4 * near - far) / 3, float(known)


def require_as_differences(scene: Scene, names: tuple[str, ...]) -> Sensitivities:
    found = sensitivities(scene, names)
    # where the deflection at the start is a difference of lengths it is to change by a part of itself
    part = 1e-4 if scene.position is None and scene.spring is None else 1e-6
    for i, name in enumerate(names):
        for quantity in ("h", "delta", "X", "a", "F"):
            slope, known = by_differences(replace(scene, method="integrate"), name, quantity, part)
            assert found.slopes[quantity][:, i] == pytest.approx(slope, abs=known, rel=1e-6), (name, quantity)
    return found


@pytest.mark.parametrize("kind", BY_DEFAULT)
def test_slopes_of_all_outputs_are_as_differences(kind: str) -> None:
    given, others = DRIVES[kind]
    require_as_differences(approach("rognon_gay", PAPER, **given), (*PAPER, *others))


@pytest.mark.slow
@pytest.mark.parametrize("kind", DRIVES)
def test_slopes_of_charged_spheres_are_as_differences(kind: str) -> None:
    given, others = DRIVES[kind]
    require_as_differences(approach("dlvo", CHARGED, **given), (*CHARGED, *others))


def test_slopes_go_through_a_jump_of_the_force_and_a_crossing_of_zero() -> None:
    # pressed, jumping to a pull, and pressed again: steps end where the table has rows, and where F passes zero
    t, F = [0.0, 500.0, 500.0, 900.0, 2000.0], [2e-4, 2e-4, -1e-4, -1e-4, 3e-4]
    found = require_as_differences(approach("rognon_gay", PAPER, force=(t, F)), (*PAPER, "h"))
    assert len(found.result.events) >= 3


@pytest.mark.slow
def test_slopes_go_through_a_turn_of_the_centres() -> None:
    drive = {"position": "x0 - v*(t0 - abs(t - t0))", "constants": {"x0": 2.0999, "v": 8e-5, "t0": 1000.0}}
    require_as_differences(approach("rognon_gay", PAPER, **drive), (*PAPER, "h", "x0", "v"))


def units_of(scene: Scene, names: tuple[str, ...]) -> dict[str, Dimension]:
    law = law_of(scene.law)
    return {symbol.name: dimension for symbol, dimension in dimensions_for(law).items() if symbol.name in names} | {
        "h": LENGTH,
        "force": FORCE,
        "velocity": LENGTH / TIME,
    }


def require_free_of_units(scene: Scene) -> None:
    """In other units of mass, length or time the same happens: three sums of slopes are known, to rounding."""
    drive = "force" if scene.force is not None else "velocity"
    names = (*scene.parameters, "h", drive)
    found = sensitivities(replace(scene, quantities=("X", "a", "F", "dh_dt")), names)
    units, t = units_of(scene, names), found.result.t
    for unit in ("mass", "length", "time"):
        powers = [float(getattr(units[name], unit)) for name in names]
        numbers = [value_of(scene, name) for name in names]
        terms = found.slopes["h"] * np.array(powers) * np.array(numbers)
        moved = (unit == "time") * t * found.result.dh_dt
        total = terms.sum(axis=1) + moved - (unit == "length") * found.result.h
        largest = np.max(np.abs(np.column_stack([terms, moved, found.result.h])), axis=1)
        # where all slopes vanish but for rounding nothing is known of them
        assert np.all(np.abs(total) <= 1e-8 * largest), unit


def test_slopes_do_not_depend_on_units_under_a_force() -> None:
    require_free_of_units(approach("rognon_gay", {"R": 2.0, "E": 3.0, "eta": 0.5}, force=1e-3))


@pytest.mark.slow
def test_slopes_of_rigid_spheres_and_of_a_dry_contact_are_known() -> None:
    # rigid and far apart, 3 pi eta R dh/dt = -F nearly: by F and by eta the gap moves in opposite ways, equally
    rigid = approach("lubrication_rigid", {"R": 1.0, "eta": 1.0}, force=1e-3)
    require_free_of_units(rigid)
    found = sensitivities(rigid, ["eta", "force"])
    assert found.slopes["h"][:, 0] == pytest.approx(-1e-3 * found.slopes["h"][:, 1], rel=1e-9)
    # dry: F = E ... delta^(3/2), so that d ln(delta)/d ln(E) = -2/3 = -d ln(delta)/d ln(F)
    dry = approach("hertz_dry", {"R": 1.0, "E": 1.0, "nu": 0.5}, force=1e-3)
    found = sensitivities(dry, ["E", "force"])
    assert found.slopes["delta"][:, 0] / found.result.delta == pytest.approx(-2 / 3, rel=1e-9)
    assert found.slopes["delta"][:, 1] * 1e-3 / found.result.delta == pytest.approx(2 / 3, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "parameters"), [("steric", BRUSHES), ("dlvo", CHARGED)])
@pytest.mark.parametrize("drive", [{"force": 1e-3}, {"velocity": -8e-5}])
def test_slopes_of_no_law_depend_on_units(law: str, parameters: dict[str, float], drive: dict[str, float]) -> None:
    require_free_of_units(approach(law, parameters, **drive))


@pytest.mark.slow
def test_targets_agree_on_slopes() -> None:
    scene = approach("rognon_gay", PAPER, force=1e-3)
    ours = [sensitivities(replace(scene, target=target), ("R", "E", "eta", "h")) for target in ("c", "numba")]
    assert ours[0].slopes["h"] == pytest.approx(ours[1].slopes["h"], rel=1e-9)


# --- what is asked for, and what is refused ---


def test_a_kernel_has_slopes_only_when_asked_for() -> None:
    law = law_of("rognon_gay")
    without, with_E = kernel_ir(law, Needs("table")), kernel_ir(law, Needs("table", sensitive=("E",)))
    assert not any("_by_" in name for name in without.settings["outputs"])
    assert {"u_rate_by_E", "delta_by_E", "X_by_E", "a_by_E"} <= set(with_E.settings["outputs"])
    assert not any(name.endswith("_by_eta") for name in with_E.settings["outputs"])
    with pytest.raises(LawError, match="no slope by 'ell': it is no parameter of the law"):
        kernel_ir(law, Needs(sensitive=("ell",)))
    with pytest.raises(LawError, match="no slope by 'E': it is fixed"):
        kernel_ir(law, Needs(sensitive=("E",), fixed={"E": "1"}))


@pytest.mark.slow
def test_own_parameters_keep_their_names() -> None:
    D = Symbol("D", positive=True)  # the name of what is derived
    law = replace(law_of("rognon_gay"), name="own", F_adh=D / h, parameters={D: FORCE * LENGTH})
    names = [*PAPER, "D"]
    found = sensitivities(approach(law, {**PAPER, "D": 1e-8}, force=1e-3), names)  # type: ignore[arg-type]
    slope, known = by_differences(approach(law, {**PAPER, "D": 1e-8}, force=1e-3), "D", "h")  # type: ignore[arg-type]
    assert found.slopes["h"][:, 3] == pytest.approx(slope, abs=known, rel=1e-5)


def test_what_a_trajectory_does_not_depend_on_is_told() -> None:
    scene = approach("rognon_gay", PAPER, force=1e-3)
    with pytest.raises(SceneError, match="nothing called 'stiffness' to depend on"):
        sensitivities(scene, ["stiffness"])
    with pytest.raises(SceneError, match="nothing called 'etta' to depend on; did you mean 'eta'"):
        sensitivities(scene, ["etta"])
    turning = approach("rognon_gay", PAPER, velocity="-v*sign(t0 - t)", constants={"v": 1e-5, "t0": 900.0}, delta=0.0)
    with pytest.raises(SceneError, match=r"t0 says when .* has a kink or jumps"):
        sensitivities(turning, ["t0"])
