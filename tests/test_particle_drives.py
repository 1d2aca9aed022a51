"""What is given as a function of time in scenes of many particles: seen by every step, however narrow, and integrated.

A free sphere under Stokes' drag is displaced by the integral of its push over 6 pi eta R, and a box whose fluid alone
resists is strained by that of the stress over eta; what is held, walls and sheared boxes are where the integral says.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import erf, fresnel

import softdyn
from softdyn.errors import IntegrationError, SceneError
from softdyn.particles import Hold, ParticleScene, Push, Wall
from softdyn.particles import energy as energies
from softdyn.particles import step as steps
from softdyn.particles.files import read_particle_scene
from softdyn.particles.observables import strain
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult
from softdyn.particles.time_functions import time_function

Array = NDArray[np.float64]
T = 1000.0
RTOL = 1e-4
STOKES = 6 * math.pi


@dataclass(frozen=True)
class Given:
    """An expression of t with values of the order of 1 where it is not 0, its constants, and its integral from 0."""

    text: str
    constants: dict[str, float]
    integral: Callable[[Array], Array]


def pulse(place: float, width: float) -> Given:
    """A Gaussian."""
    c, w = place * T, width * T

    def integral(t: Array) -> Array:
        return np.asarray(math.sqrt(math.pi) * w / 2 * (erf((t - c) / w) - erf(-c / w)))

    return Given("exp(-((t - c)/w)**2)", {"c": c, "w": w}, integral)


def gate(place: float, length: float, edge: float) -> Given:
    """On and off again, by tanh."""
    a, b, w = place * T, place * T + length * T, edge * length * T

    def integral(t: Array) -> Array:
        def one(t: Array, at: float) -> Array:  # of 1/(1 + exp(-2 (t - at)/w)), from 0 on
            return np.asarray(w / 2 * (np.logaddexp(0, 2 * (t - at) / w) - np.logaddexp(0, -2 * at / w)))

        return one(t, a) - one(t, b)

    return Given("(tanh((t - a)/w) - tanh((t - b)/w))/2", {"a": a, "b": b, "w": w}, integral)


def chirp(turns: float) -> Given:
    """sin(k t^2), of so many turns."""
    k = 2 * math.pi * turns / T**2

    def integral(t: Array) -> Array:
        scale = math.sqrt(2 * k / math.pi)
        return np.asarray(fresnel(scale * t)[0] / scale)

    return Given("sin(k*t*t)", {"k": k}, integral)


def sines(parts: list[tuple[float, float]]) -> Given:
    """Sum of sines of so many turns and phases, squared amplitudes of the same size."""
    constants = {f"w{i}": 2 * math.pi * turns / T for i, (turns, _) in enumerate(parts)}
    constants |= {f"p{i}": phase for i, (_, phase) in enumerate(parts)}
    text = " + ".join(f"sin(w{i}*t + p{i})" for i in range(len(parts)))

    def integral(t: Array) -> Array:
        w, p = ([constants[f"{name}{i}"] for i in range(len(parts))] for name in "wp")
        return np.asarray(sum((math.cos(b) - np.cos(a * t + b)) / a for a, b in zip(w, p, strict=True)))

    return Given(text, constants, integral)


def kinked(place: float, width: float) -> Given:
    """A tent of two flanks, with three kinks."""
    c, w = place * T, width * T

    def integral(t: Array) -> Array:
        s = np.clip((t - c) / w, -1, 1)
        return np.asarray(w * (s + 1 - (s * np.abs(s) + 1) / 2))

    return Given("(abs(t - c + w) + abs(t - c - w) - 2*abs(t - c))/(2*w)", {"c": c, "w": w}, integral)


places, widths = st.floats(0.001, 0.999), st.floats(-8, -1).map(lambda x: 10**x)
smooth = st.one_of(
    st.builds(pulse, places, widths),
    st.builds(gate, places, widths, st.floats(0.01, 0.3)),
    st.builds(chirp, st.floats(0.1, 20)),
    st.builds(sines, st.lists(st.tuples(st.floats(0.01, 30), st.floats(0, 6)), min_size=1, max_size=3)),
)
#: Tents as wide as their place can tell.
every = st.one_of(smooth, st.builds(kinked, st.floats(0.2, 0.8), st.floats(-4, -1).map(lambda x: 10**x)))
WORST = [pulse(0.5, 1e-8), pulse(0.37123, 1e-4), gate(0.7, 1e-6, 0.1), chirp(17.3), sines([(16.0, 0.7), (25.01, 0)])]


def free(**changes: Any) -> ParticleScene:
    """Two spheres too far from one another to meet, in Stokes' drag."""
    settings: dict[str, Any] = {
        "law": "rognon_gay",
        "parameters": {"E": 1.0, "eta": 1.0},
        "positions": [[0.0, 0.0], [1000.0, 0.0]],
        "radii": 1.0,
        "range": 0.5,
        "drag": 1.0,
        "until_t": T,
        "times": 14,
        "rtol": RTOL,
        **changes,
    }
    return ParticleScene(**settings)


def pushed(f: Given, impulse: float = 1.0) -> tuple[Array, ParticleResult]:
    """Displacement of a free sphere of which the push displaces it by some length in all, and the run."""
    size = float(np.abs(f.integral(np.linspace(0, T, 1001))).max())
    constants = {**f.constants, "F": impulse * STOKES / size if size else 1.0}
    result = simulate_particles(free(push=[Push([0], [f"F*({f.text})", 0.0])], constants=constants))
    return result.x[:, 0, 0] - impulse * f.integral(result.t) / size if size else result.x[:, 0, 0], result


def check_push(f: Given) -> None:
    wrong, result = pushed(f)
    assert np.abs(wrong).max() < 10 * RTOL
    assert not result.stats["warnings"]


@pytest.mark.parametrize("f", WORST[:4], ids=lambda f: f.text)
def test_a_free_sphere_is_displaced_by_the_integral_of_its_push(f: Given) -> None:
    check_push(f)


@pytest.mark.slow
@given(f=every)
@settings(max_examples=60, deadline=None)
def test_no_push_is_stepped_over(f: Given) -> None:
    check_push(f)


def check_integrals(f: Given) -> None:
    """A sphere and a wall that are driven, and a box that is sheared, by one expression of 2 in all.

    A width w is told from the time to a relative rounding of t/w, by the expression and by what is expected.
    """
    rounding = 1e-13 + 1e-15 * T / f.constants.get("w", T)
    size = float(np.abs(f.integral(np.linspace(0, T, 1001))).max()) / 2
    exact = f.integral(np.linspace(0, T, 14)) / size
    text, constants = f"A*({f.text})", {**f.constants, "A": 1 / size}
    driven = free(
        hold=[Hold([0], "x", [text])], wall=[Wall([0.0, 90.0], [0.0, 1.0], velocity=[0.0, text])],
        constants=constants,
    )  # fmt: skip
    result = simulate_particles(driven)
    np.testing.assert_allclose(result.x[:, 0, 0], exact, atol=rounding)
    np.testing.assert_allclose(result.wall_point[:, 0, 1], 90 + exact, atol=rounding + 1e-13)
    box = free(positions=[[10.0, 10.0], [30.0, 30.0]], box=[40.0, 50.0], tilt=3.0, shear_rate=text, constants=constants)
    np.testing.assert_allclose(simulate_particles(box).cell[:, 0, 1], 3 + 50 * exact, atol=50 * rounding + 1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("f", WORST[1:3], ids=lambda f: f.text)
def test_what_is_given_by_its_rate_is_where_the_integral_says(f: Given) -> None:
    """To rounding: held particles, walls and sheared boxes know no steps."""
    check_integrals(f)


@pytest.mark.slow
@given(f=every)
@settings(max_examples=25, deadline=None)
def test_given_rates_are_integrated_to_rounding(f: Given) -> None:
    check_integrals(f)


def strained(f: Given, **changes: Any) -> tuple[Array, ParticleResult]:
    """Error of the strain of a box of spheres that do not meet, under a shear stress."""
    size = max(float(np.abs(f.integral(np.linspace(0, T, 1001))).max()), 1e-300)
    scene = free(
        positions=[[10.0, 10.0], [30.0, 30.0]], box=[40.0, 50.0], stress={"xy": f"S*({f.text})"},
        constants={**f.constants, "S": 1 / size}, **changes,
    )  # fmt: skip
    result = simulate_particles(scene)
    return strain(result) - f.integral(result.t) / size, result


@pytest.mark.parametrize("f", WORST[1:3], ids=lambda f: f.text)
def test_a_stress_strains_the_fluid_by_its_integral(f: Given) -> None:
    wrong, result = strained(f)
    assert np.abs(wrong).max() < 10 * RTOL
    assert not result.stats["warnings"]


@pytest.mark.slow
@given(f=every)
@settings(max_examples=25, deadline=None)
def test_no_stress_is_stepped_over(f: Given) -> None:
    wrong, result = strained(f)
    assert np.abs(wrong).max() < 10 * RTOL
    assert not result.stats["warnings"]


@pytest.mark.parametrize("width", [1e3, 30.0, 1e-2])
def test_a_pulse_of_force_closes_a_gap_as_a_table_of_it_does(width: float) -> None:
    """Against the engine of pairs, whose steps end at every row."""
    c, end = 41234.0, 1e5
    text = "1e-5 + 0.05*exp(-((t - c)/w)**2)"
    pushes = [Push([0], [text, 0.0]), Push([1], [f"-({text})", 0.0])]
    result = simulate_particles(
        free(
            positions=[[0.0, 0.0], [2.5, 0.0]],
            range=None,
            drag=0.0,
            push=pushes,
            times=2,
            until_t=end,
            constants={"c": c, "w": width},
        )
    )
    t = np.unique(np.concatenate([[0.0, end], c + width * np.linspace(-7, 7, 2001)]))
    F = 1e-5 + 0.05 * np.exp(-(((t - c) / width) ** 2))
    pair = softdyn.simulate(
        law="rognon_gay", parameters={"R": 1.0, "E": 1.0, "eta": 1.0}, h=0.5, force=(t, F), until_t=end, times=[end]
    )
    # straight lines between the rows leave out 1e-5 of the impulse
    np.testing.assert_allclose(result.contacts(-1)["h"], pair.h, rtol=10 * RTOL)


def test_frames_are_as_good_as_the_steps() -> None:
    """Between the steps, too, the pulse is where it is: none runs ahead, none comes back."""
    f = pulse(0.5, 1e-2)
    few, many = (simulate_particles(replace(_pulsed(f), times=times)) for times in (2, 401))
    assert few.stats["steps"] == many.stats["steps"]
    exact = f.integral(many.t) / f.integral(np.float64(T))
    np.testing.assert_allclose(many.x[:, 0, 0], exact, atol=10 * RTOL)


def _pulsed(f: Given) -> ParticleScene:
    size = float(f.integral(np.float64(T)))
    return free(push=[Push([0], [f"F*({f.text})", 0.0])], constants={**f.constants, "F": STOKES / size})


def test_what_changes_faster_than_any_step_is_not_passed_over() -> None:
    force = "1e10*exp(-((t - 500)/1e-9)**2)*sin(1/(abs(t - 500) + 1e-15))"
    with pytest.raises(IntegrationError, match="cannot go on at t=500, however short the step"):
        simulate_particles(free(push=[Push([0], [force, 0.0])], times=2))


# Tables


STEPS: dict[str, tuple[list[float], list[float]]] = {
    "tent": ([0.0, 300.0, 500.0, 700.0, T], [0.0, 0.0, 1.0, 0.0, 0.0]),
    "jumps": ([0.0, 200.0, 200.0, 600.0, 600.0, T], [1.0, 2.0, -1.0, -1.0, 0.5, 0.0]),
    "earlier": ([-50.0, 100.0, 5000.0], [1.0, -1.0, 3.0]),
}


@pytest.mark.parametrize("name", STEPS)
def test_every_drive_may_be_a_table(name: str) -> None:
    t, values = (np.array(column) for column in STEPS[name])
    table = (t, 1e-2 * values)
    frames = np.linspace(0, T, 21)

    def area(upper: float) -> float:
        inside = np.concatenate([[0.0], t[(t > 0) & (t < upper)], [upper]])
        middles = (inside[1:] + inside[:-1]) / 2
        return float(np.sum(np.diff(inside) * np.interp(middles, t, values)))

    exact = np.array([area(upper) for upper in frames])
    forces = free(push=[Push([0], [(t, 1e-2 * STOKES * values), 0.0])], times=21)
    np.testing.assert_allclose(simulate_particles(forces).x[:, 0, 0], 1e-2 * exact, atol=RTOL)
    moved = free(hold=[Hold([0], "xy", [0.0, table])], wall=[Wall([-50, 0], [-1, 0], velocity=[table, 0.0])], times=21)
    result = simulate_particles(moved)
    np.testing.assert_allclose(result.x[:, 0, 1], 1e-2 * exact, atol=1e-14)
    np.testing.assert_allclose(result.wall_point[:, 0, 0], -50 + 1e-2 * exact, atol=1e-13)
    rows = t[(t > 0) & (t < T)]
    assert np.isin(rows, result.step_t).all()
    spheres = {"positions": [[10.0, 10.0], [30.0, 30.0]], "box": [40.0, 50.0], "times": 21}
    sheared = simulate_particles(free(**spheres, shear_rate=(t, 1e-3 * values)))
    np.testing.assert_allclose(strain(sheared), 1e-3 * exact, atol=1e-13)
    stressed = simulate_particles(free(**spheres, stress={"xy": (t, 1e-3 * values)}))
    np.testing.assert_allclose(strain(stressed), 1e-3 * exact, atol=RTOL)


def test_tables_are_read_from_scene_files(tmp_path: Path) -> None:
    """In every place, with their headings."""
    (tmp_path / "f.csv").write_text("t,F_x\n0,1\n500,1\n500,0\n1000,0\n")
    (tmp_path / "v.csv").write_text("velocity;time\n0;0\n1e-3;1000\n")
    (tmp_path / "g.csv").write_text("time,shear_rate\n0,1e-3\n1000,0\n")
    text = """
law = "rognon_gay"
parameters = {E = 1.0, eta = 1.0}
particles = {positions = [[0.0, 0.0], [1000.0, 0.0]], radii = 1.0}
contacts = {range = 0.5}
flow = {drag = 1.0, shear_rate = {file = "g.csv"}}
push = [{particles = [0], force = [{file = "f.csv"}, 0.0]}]
hold = [{particles = [1], axes = "xy", velocity = [{file = "v.csv"}, 0.0]}]
until = {t = 1000.0}
output = {times = 3}
"""
    (tmp_path / "scene.toml").write_text(text)
    result = simulate_particles(read_particle_scene(tmp_path / "scene.toml"))
    np.testing.assert_allclose(result.x[:, 0, 0], np.array([0, 500, 500]) / STOKES, rtol=1e-6)
    np.testing.assert_allclose(result.x[:, 1, 0] - 1000, [0, 0.125, 0.5], rtol=1e-12)
    assert result.gradient[:, 0, 1] == pytest.approx([1e-3, 5e-4, 0])
    for old, new, words in (
        ('{file = "f.csv"}', '{file = "none.csv"}', "none.csv"),
        ('{file = "f.csv"}', '{path = "f.csv"}', r'\[\[push\]\] 0 force: a table is \{file = "force.csv"\}'),
        ('{file = "g.csv"}', '{file = "f.csv"}', "f.csv"),
        ("t = 1000.0", "t = 1001.0", "ends at t = 1000; extend it"),
    ):
        (tmp_path / "wrong.toml").write_text(text.replace(old, new))
        with pytest.raises(SceneError, match=words):
            simulate_particles(read_particle_scene(tmp_path / "wrong.toml"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"shear_rate": ([1.0, T], [0.0, 0.0])}, r"\[flow\] shear_rate: the table starts at t = 1, after the run"),
        ({"shear_rate": ([0.0, 1.0], [0.0, 0.0])}, r"\[flow\] shear_rate: the table ends at t = 1"),
        ({"shear_rate": ([0.0, T, T / 2], [0.0, 0.0, 0.0])}, "times must increase"),
        ({"push": [Push([0], [([0.0, T], [0.0, math.nan]), 0.0])]}, r"force along x.*finite"),
        ({"push": [Push([0], [[1.0], 0.0])]}, "must be a number, an expression of t, or a table"),
    ],
)
def test_what_is_no_table_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate_particles(free(**changes))


def test_steps_end_at_the_kinks_of_expressions() -> None:
    result = simulate_particles(free(push=[Push([0], ["1e-3*(abs(t - 123.4) - abs(t - 777.7))", 0.0])]))
    assert np.isin([123.4, 777.7], result.step_t).all()


# Jumps of the forces, where nothing resists


def couple(force: Any, **changes: Any) -> ParticleScene:
    """Two spheres, pressed together without drag."""
    settings: dict[str, Any] = {
        "positions": [[0.0, 0.0], [2.1, 0.0]],
        "drag": 0.0,
        "range": None,
        "push": [Push([0], [force(1.0), 0.0]), Push([1], [force(-1.0), 0.0])],
        **changes,
    }
    return free(**settings)


@pytest.mark.slow
@pytest.mark.parametrize("law", [{}, {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": 1.0, "nu": 0.5}}])
@pytest.mark.parametrize("tangential", [False, True])
def test_a_jump_of_the_forces_moves_particles_at_once(law: dict[str, Any], tangential: bool) -> None:
    """From there on the run is one that starts with these gaps and the other force; work is that of a fast ramp."""
    if tangential and not law:
        pytest.skip("its contacts are normal only")
    at = T / 2

    def jump(sign: float) -> Any:
        return ([0.0, at, at, T], [1e-2 * sign, 1e-2 * sign, 3e-2 * sign, 3e-2 * sign])

    def ramp(sign: float) -> Any:  # in many steps
        part = np.linspace(0, 1, 101)
        t = np.concatenate([[0.0], at + 1e-6 * part, [T]])
        return (t, 1e-2 * sign * np.concatenate([[1.0], 1 + 2 * part, [3.0]]))

    times = [0.0, at, at + 1, T]
    fine = {**law, "tangential": tangential, "rtol": 1e-6}
    both, slow = (simulate_particles(couple(force, times=times, **fine)) for force in (jump, ramp))
    np.testing.assert_allclose(both.contacts(1)["F"], 3e-2, rtol=1e-6)  # behind the jump
    for frame in (2, 3):
        np.testing.assert_allclose(both.contacts(frame)["h"], slow.contacts(frame)["h"], rtol=1e-5)
    for name in ("external", "stored", "gaps"):
        assert both.energy[name] == pytest.approx(slow.energy[name], rel=1e-4)
    assert abs(both.energy["imbalance"]) < 1e-4
    assert not both.stats["warnings"]


@pytest.mark.parametrize("law", ["rognon_gay", "equal_spheres"])
@pytest.mark.parametrize(("before", "after"), [(1e-3, 5e-3), (1e-3, -1e-3), (2e-3, -1e-4), (-1e-4, 3e-3)])
def test_energy_balances_over_a_jump_that_turns_pressing_into_pulling(law: str, before: float, after: float) -> None:
    """On the way the deflection has a kink, which a rule of one panel misses by 2e-5 of the energy."""

    def force(sign: float) -> Any:
        return ([0.0, T / 2, T / 2, T], [sign * before, sign * before, sign * after, sign * after])

    parameters = {"E": 1.0, "eta": 1.0} | ({"nu": 0.5} if law == "equal_spheres" else {})
    result = simulate_particles(couple(force, law=law, parameters=parameters, times=3, rtol=1e-6))
    assert abs(result.energy["imbalance"] - result.stats["energy_error"]) < 1e-6
    assert not result.stats["warnings"]


def test_forces_that_do_not_balance_behind_a_jump_are_refused() -> None:
    scene = couple(lambda sign: ([0.0, 5.0, 5.0, T], [1e-2, 1e-2, 2e-2, 2e-2]) if sign > 0 else -1e-2)
    with pytest.raises(IntegrationError, match=r"forces along x sum to 0\.01 at t=5"):
        simulate_particles(scene)


# The balance of energy


def crowd(**changes: Any) -> ParticleScene:
    """A periodic packing of pressed spheres."""
    draw = np.random.default_rng(2)
    place = np.array([[i + 0.5 * (j % 2), j * np.sqrt(3) / 2] for j in range(6) for i in range(6)]) * 1.8
    box = np.array([6, 3 * np.sqrt(3)]) * 1.8
    settings: dict[str, Any] = {
        "law": "equal_spheres",
        "parameters": {"E": 1.0, "eta": 1.0, "nu": 0.5},
        "positions": np.mod(place + 0.05 * draw.uniform(-1, 1, place.shape), box),
        "radii": 1.0,
        "box": list(box),
        "range": 0.4,
        "gap": 0.05,
        "until_t": 200.0,
        "shear_rate": "g*w*cos(w*t)",
        "constants": {"g": 0.1, "w": 0.02},
        **changes,
    }
    return free(**settings)


def sediment(**changes: Any) -> ParticleScene:
    """Spheres that fall to a floor between walls."""
    draw = np.random.default_rng(0)
    place = np.array([[2.3 * i + 1.3, 2.3 * j + 1.3] for i in range(3) for j in range(4)])
    walls = [Wall([0, 0], [0, -1]), Wall([0, 0], [-1, 0]), Wall([7.3, 0], [1, 0])]
    settings: dict[str, Any] = {
        "positions": place + draw.uniform(-0.1, 0.1, place.shape),
        "wall": walls,
        "push": [Push("all", [0.0, -1e-2])],
        "until_t": 2e4,
        **changes,
    }
    return free(**settings)


def left_over(result: ParticleResult) -> float:
    """Part of the imbalance that the steps do not make."""
    return abs(float(result.energy["imbalance"]) - float(result.stats["energy_error"]))


@pytest.mark.parametrize("drag", [0.0, 1.0])
@pytest.mark.parametrize("tangential", [False, True])
def test_ordinary_runs_keep_their_energy_to_what_newton_leaves(drag: float, tangential: bool) -> None:
    """Steps of 1e-4 make some 1e-3 where energy comes and goes: that is told, and explained."""
    result = simulate_particles(crowd(drag=drag, tangential=tangential))
    assert left_over(result) < RTOL
    assert not any("energy" in warning for warning in result.stats["warnings"])


def test_a_restarted_run_and_a_sediment_keep_their_energy(tmp_path: Path) -> None:
    first = simulate_particles(crowd(shear_rate=1e-3, constants={}, until_t=200.0))
    first.save(tmp_path / "first.npz")
    again = softdyn.particles.read_particles(tmp_path / "first.npz")
    turned = simulate_particles(crowd(shear_rate=-1e-3, constants={}, until_t=200.0, gap=None, **again))
    for result in (first, turned, simulate_particles(sediment())):
        assert left_over(result) < 0.1 * RTOL
        assert not any("energy" in warning for warning in result.stats["warnings"])


@pytest.mark.parametrize("name", ["drag", "gaps", "box", "external"])
def test_a_false_power_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One per cent more of any that matters."""
    true = energies.powers

    def false(*arguments: Any) -> dict[str, float]:
        found = true(*arguments)
        return {**found, name: 1.01 * found[name]}

    monkeypatch.setattr(steps, "powers", false)
    scene = sediment(until_t=2000.0) if name == "external" else crowd(shear_rate=1e-3, constants={}, until_t=100.0)
    result = simulate_particles(scene)
    assert any("which no error of the steps explains" in warning for warning in result.stats["warnings"])


# Clusters that nothing resists


def forces_along_sides(x: Array, seed: int) -> Array:
    """Forces on the corners of a polygon along its sides, which balance with their torques."""
    draw = np.random.default_rng(seed)
    force = np.zeros_like(x)
    for i in range(len(x)):
        for j in range(i):
            n = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i])
            size = draw.uniform(0.02, 0.08)
            force[i] += size * n
            force[j] -= size * n
    return force


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("tangential", [False, True])
def test_forces_that_balance_where_particles_are_given_are_borne(seed: int, tangential: bool) -> None:
    """Relaxation moves the points where they act: nothing is felt of the torque that this makes."""
    draw = np.random.default_rng(seed)
    x = np.array([[0.0, 0.0], [2.05, 0.0], [1.0, 1.8]]) + draw.uniform(0, 0.1, (3, 2))
    force = forces_along_sides(x, seed)
    pushes = [Push([k], list(force[k])) for k in range(3)]
    law = {"law": "equal_spheres", "parameters": {"E": 1.0, "eta": 1.0, "nu": 0.5}}
    result = simulate_particles(
        free(**law, positions=x, gap=0.05, drag=0.0, push=pushes, tangential=tangential, range=None)
    )
    assert 1e-4 < result.stats["torque_removed"] < 0.05
    assert left_over(result) < 0.1 * RTOL
    assert not result.stats["warnings"]
    contacts = result.contacts(-1)
    pull = np.zeros((3, 2))
    for i, j, F, n in zip(contacts["i"], contacts["j"], contacts["F"], contacts["n"], strict=True):
        pull[i] += F * n
        pull[j] -= F * n
    if not tangential:
        wrong = pull - force
        assert np.abs(wrong).max() < 0.05 * np.abs(force).max()
    sideways = [Push([0], list(force[0] + [0, 1e-3])), Push([1], list(force[1] - [0, 1e-3])), pushes[2]]
    unbalanced = free(**law, positions=x, gap=0.05, drag=0.0, push=sideways, range=None)
    with pytest.raises(IntegrationError, match=r"have the torque .* about the given positions"):
        simulate_particles(unbalanced)


def test_forces_that_cease_to_balance_end_the_run_by_name() -> None:
    swing = [Push([0], ["1e-3", "1e-6*t"]), Push([1], ["-1e-3", "-1e-6*t"])]
    scene = free(positions=[[0.0, 0.0], [2.02, 0.0]], drag=0.0, push=swing, range=None)
    with pytest.raises(IntegrationError, match=r"have the torque .* about the given positions"):
        simulate_particles(scene)


# Functions of time by themselves


@given(f=every, at=st.floats(0, 1))
@settings(max_examples=40, deadline=None)
def test_integrals_are_exact_and_additive(f: Given, at: float) -> None:
    found = time_function(f.text, "f", f.constants, T)
    scale = max(float(np.abs(f.integral(np.linspace(0, T, 201))).max()), abs(found.integral(T)), 1e-12)
    digits = 1e-13 + 1e-15 * T / f.constants.get("w", T)
    assert found.integral(at * T) == pytest.approx(float(f.integral(np.float64(at * T))), abs=digits * scale)


@given(f=smooth, at=st.floats(1e-3, 1), length=st.floats(-5, -4).map(lambda x: 10**x))
@settings(max_examples=60, deadline=None)
def test_rates_are_derivatives(f: Given, at: float, length: float) -> None:
    """The mean of the rate over a short time, by Gauss's rule, is the change of the value."""
    found, w = time_function(f.text, "f", f.constants, T), f.constants.get("w", T)
    end, dt = at * T, length * min(at * T, 100 * w)
    points, weights = np.polynomial.legendre.leggauss(3)
    mean = sum(weight / 2 * found.rate(end + (x - 1) / 2 * dt) for x, weight in zip(points, weights, strict=True))
    # values are rounded, and times: that moves values by the slope
    rounding = 2e-16 * (1 + T * (abs(mean) + 1 / w)) / dt
    assert mean == pytest.approx((found(end) - found(end - dt)) / dt, rel=1e-6, abs=10 * rounding)


def test_the_rate_at_a_kink_is_that_before_it_and_at_the_start_that_behind() -> None:
    table = time_function(([0.0, 2.0, T], [0.0, 4.0, 4.0 - (T - 2)]), "f", {}, T)
    bent = time_function("abs(t - 2)", "f", {}, T)
    assert [table.rate(t) for t in (0.0, 1.0, 2.0, 3.0, T)] == [2, 2, 2, -1, -1]
    assert [bent.rate(t) for t in (0.0, 2.0, 3.0)] == [-1, -1, 1]
    assert time_function(3.0, "f", {}, T).rate(1.0) == 0


def test_where_a_force_has_no_finite_rate_there_is_no_velocity() -> None:
    """Of particles that nothing resists: sqrt(t) rises infinitely fast at 0, and the run goes on."""
    pull = [Push([0], ["-1e-3*sqrt(t)", 0.0]), Push([1], ["1e-3*sqrt(t)", 0.0])]
    scene = free(positions=[[0.0, 0.0], [2.02, 0.0]], drag=0.0, push=pull, range=None, until_t=1.0, times=[0.0, 1.0])
    result = simulate_particles(scene)
    assert np.isnan(result.v[0]).all()
    assert np.isfinite(result.v[1]).all()


@pytest.mark.slow
@given(f=smooth, start=st.floats(0, 0.9), length=st.floats(-9, -1).map(lambda x: 10**x))
@settings(max_examples=60, deadline=None)
def test_what_a_step_misses_is_bounded(f: Given, start: float, length: float) -> None:
    """The bound is above what is found on a fine grid, and falls as steps do: as their fourth power at last."""
    found = time_function(f.text, "f", f.constants, T)
    t, dt = start * T, length * T
    theta = np.linspace(0, 1, 4001)
    nodes = steps.NODES
    values = np.array([found(t + c * dt) for c in nodes])
    parabola = sum(
        values[k] * np.prod([(theta - nodes[j]) / (nodes[k] - nodes[j]) for j in range(3) if j != k], axis=0)
        for k in range(3)
    )
    missed = dt * np.mean(np.abs(np.array([found(t + part * dt) for part in theta]) - parabola))
    assert missed <= found.missed(t, dt) * (1 + 1e-9) + (1e-13 + 1e-15 * T / f.constants.get("w", T)) * dt


def test_a_drive_whose_kinks_are_in_doubt_is_told_of() -> None:
    """Where two arguments of max are the same but for rounding, nobody can say which holds: the result warns."""

    def told(text: str) -> list[str]:
        scene = ParticleScene(
            law="equal_spheres", parameters={"E": 1.0, "eta": 1.0, "nu": 0.5}, positions=[[0.0], [2.1]], radii=1.0,
            drag=1.0, push=[Push([0], [text])], until_t=10.0, rtol=1e-3,
        )  # fmt: skip
        return list(simulate_particles(scene).stats["warnings"])

    (warning,) = told("1e-4*max(sin(t)**2 + cos(t)**2, 1)")
    assert warning.startswith("[[push]] 0: force along x has kinks or jumps too many, or too close, to be told")
    assert told("1e-4*max(sin(t), sin(2*t), 0.3)") == []


def test_a_force_without_a_bound_is_told_of() -> None:
    """x^2/x^2 is 1, but at x = 0 alone it has no value: bounds of its parts say nothing of it."""
    constants = {"F": STOKES / T, "c": 0.37123 * T}
    push = Push([0], ["F*(t - c)**2/(t - c)**2", 0.0])
    result = simulate_particles(free(push=[push], constants=constants))
    (warning,) = result.stats["warnings"]
    assert warning.startswith("[[push]] 0: force along x changes too fast to be bounded near t=371.23, however short")
    assert np.abs(result.x[:, 0, 0] - result.t / T).max() < 10 * RTOL


@settings(deadline=None)
@given(decades=st.floats(0, 12), place=st.floats(0.3, 0.7))
def test_the_integral_of_a_pulse_of_any_width_is_exact(decades: float, place: float) -> None:
    """Also where the argument of the exponential is so large that sums of its terms have no digit left."""
    width = 0.03 * 10.0**-decades
    function = time_function("1 + h*exp(-((t - p)/w)**2)", "f", {"h": 1 / width, "p": place, "w": width}, 1.0)
    wrong = 4 * np.finfo(float).eps / width  # times are rounded
    assert function.integral(1.0) == pytest.approx(1 + math.sqrt(math.pi), rel=1e-12 + wrong)
