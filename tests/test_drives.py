"""Centres that are moved, springs, jumps: against scipy, and against one another where they must agree."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from invented_laws import LAWS
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import softdyn
from softdyn.errors import SceneError
from softdyn.scene.pair_scene import read_scene

UNIT = {"R": 1.0, "E": 1.0, "eta": 1.0}
TIMES = list(np.linspace(0.0, 2000.0, 21))
SWING = {"velocity": "v*sin(w*t)", "constants": {"v": -3e-3, "w": 2 * math.pi / 1000}}
Array = NDArray[np.float64]


def run(**scene: Any) -> softdyn.PairResult:
    return softdyn.simulate(**{"law": "rognon_gay", "parameters": UNIT, "h": 1.0, **scene})


def scipy_states(V: Callable[[float], float], compliance: float = 0.0) -> tuple[Array, Array]:
    """Gap and deflection at TIMES from h = 1, delta = 0: eq. 7, and compliance dF/dt = dX/dt - V, written anew."""

    def rates(t: float, y: Array) -> list[float]:
        gap, d = math.exp(y[0]), y[1]
        bar = gap / (1 + gap)
        a = math.sqrt(2 * (bar + abs(d)))
        h_dot = -4 / 9 * a * d / (1.5 * math.pi * a**4 / bar**3)
        F_d, F_h = 4 / 9 * (a + abs(d) / a), 4 / 9 * d / a / (1 + gap) ** 2
        return [h_dot / gap, (h_dot - V(t) - compliance * F_h * h_dot) / (2 + compliance * F_d)]

    found = solve_ivp(rates, (0, TIMES[-1]), [0.0, 0.0], method="Radau", rtol=1e-9, atol=1e-13, t_eval=TIMES)
    return np.exp(found.y[0]), found.y[1]


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=pytest.mark.slow)])
def test_an_approach_at_a_given_velocity_against_scipy(target: str) -> None:
    h, delta = scipy_states(lambda t: -1e-3)
    for rtol in (1e-5, 1e-8):
        found = run(velocity=-1e-3, times=TIMES, until_t=TIMES[-1], rtol=rtol, target=target)
        np.testing.assert_allclose(found.h, h, rtol=10 * rtol)
        np.testing.assert_allclose(found.delta, delta, rtol=10 * rtol)


@pytest.mark.slow
@given(start=st.floats(-3, 1).map(lambda x: 10**x), part=st.floats(-2, 0.9), time=st.floats(0, 6).map(lambda x: 10**x))
@settings(max_examples=15, deadline=None)
def test_both_targets_agree(start: float, part: float, time: float) -> None:
    """One algorithm, roundings alike to a few units: steps that these tip over differ by what a run may err."""
    scene = {"h": start, "velocity": -part * min(start, 0.3) / time, "until_t": time, "times": 5, "rtol": 1e-8}
    c, numba = run(**scene, target="c"), run(**scene, target="numba")
    np.testing.assert_allclose(numba.h, c.h, rtol=c.stats["error"] + numba.stats["error"] + 1e-15)


@pytest.mark.slow
def test_approach_and_retraction_against_scipy_with_the_force_crossing_zero() -> None:
    """Three times over; a relative error of delta is one of its size where it passes zero."""
    h, delta = scipy_states(lambda t: -3e-3 * math.sin(SWING["constants"]["w"] * t))
    for rtol in (1e-5, 1e-8):
        found = run(**SWING, times=TIMES, until_t=TIMES[-1], rtol=rtol)
        np.testing.assert_allclose(found.h, h, rtol=30 * rtol)
        np.testing.assert_allclose(found.delta, delta, atol=30 * rtol * np.max(np.abs(delta)), rtol=0)
        crossings = [event for event in found.events if event.what == "the force crosses zero"]
        assert len(crossings) == 3
        assert all(event.delta == 0.0 for event in crossings)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_the_force_crosses_zero_where_the_deflection_does(rtol: float) -> None:
    """Not where a polynomial says so that has the law's kink within it: errors were 100 times those estimated."""
    h, delta = scipy_states(lambda t: -3e-3 * math.sin(SWING["constants"]["w"] * t), 1 / 0.02)
    base = {"spring": {"stiffness": 0.02, "base": "3 + v/w*(1 - cos(w*t))"}, "constants": SWING["constants"]}
    found = run(**base, times=TIMES, until_t=TIMES[-1], rtol=rtol)
    assert sum(event.what == "the force crosses zero" for event in found.events) >= 3
    # scipy's own tolerance is 1e-9 at a step
    assert np.max(np.abs(np.log(found.h / h))) <= found.stats["error"] + 1e-8
    assert np.max(np.abs(found.delta - delta)) <= rtol * np.max(np.abs(delta)) + 1e-8


@pytest.mark.parametrize("stiffness", [1e-6, 1e-2, 1.0, 1e6])
def test_a_spring_against_scipy(stiffness: float) -> None:
    h, delta = scipy_states(lambda t: -1e-3, 1 / stiffness)
    found = run(
        spring={"stiffness": stiffness, "base": "3 - 1e-3*t"}, times=TIMES, until_t=TIMES[-1], rtol=1e-8,
        quantities=("X", "F"),
    )  # fmt: skip
    np.testing.assert_allclose(found.h, h, rtol=1e-7)
    np.testing.assert_allclose(found.delta, delta, rtol=1e-7)
    # the force is that of the spring; X - base is rounded to 3 units in its last place
    if stiffness < 1:
        np.testing.assert_allclose(
            found.F, stiffness * (found.X - 3 + 1e-3 * found.t), rtol=1e-6, atol=stiffness * 1e-14
        )
    assert found.stats["drift"] < 1e-7


@pytest.mark.slow
def test_a_position_and_its_velocity_are_one_drive() -> None:
    moved = run(**SWING, times=TIMES, until_t=TIMES[-1])
    placed = run(
        position="3 + v/w*(1 - cos(w*t))", constants=SWING["constants"], times=TIMES, until_t=TIMES[-1],
        quantities=("X",),
    )  # fmt: skip
    np.testing.assert_allclose(placed.h, moved.h, rtol=1e-8)
    # X is an outcome, and keeps to what was asked of it
    w = SWING["constants"]["w"]
    np.testing.assert_allclose(placed.X, 3 - 3e-3 / w * (1 - np.cos(w * placed.t)), rtol=1e-8)
    table = np.linspace(0, 2000, 5)
    by_table = run(position=(table, 3 - 5e-4 * table), times=TIMES, until_t=TIMES[-1])
    by_text = run(velocity=-5e-4, times=TIMES, until_t=TIMES[-1])
    np.testing.assert_allclose(by_table.h, by_text.h, rtol=1e-8)
    assert [event.t for event in by_table.events] == [500.0, 1000.0, 1500.0]


@pytest.mark.slow
@pytest.mark.parametrize("law", [name for name in LAWS if name != "rognon_gay"])
def test_a_soft_spring_far_away_is_a_constant_force(law: str) -> None:
    """With base = X - F/k the force changes by k (X - X0), 1e-9 of it. Every invented law, remote forces included."""
    own = {
        "screened": {"strength": 1e-3, "ell": 0.4},
        "cone": {"tilt": 0.8},
        "rimmed": {"rim": 0.3},
        "branched": {"brush": 0.25},
    }
    scene = {"law": LAWS[law], "parameters": {**UNIT, **own[law]}, "until_t": 5.0, "times": 6, "rtol": 1e-9}
    pushed = run(**scene, force=1e-2)
    k = 1e-12
    X = 3 - 2 * pushed.delta[0]
    held = run(**scene, spring={"stiffness": k, "base": X - 1e-2 / k})
    np.testing.assert_allclose(held.h, pushed.h, rtol=1e-7)
    np.testing.assert_allclose(held.delta, pushed.delta, rtol=1e-7)


@pytest.mark.parametrize("v", [1e-280, -1e-300, 1e-306, -2.2e-308, 7e-309, -1e-310, 2e-313, 5e-324])
def test_a_velocity_of_any_smallness_deflects_in_proportion(v: float) -> None:
    """To the digits that such numbers have: below 2.2e-308 they are multiples of 5e-324."""
    asked: dict[str, Any] = {"h": 3.0, "until_t": 3e5, "times": 11, "rtol": 1e-11}
    tiny, known = run(velocity=v, **asked), run(velocity=1e-20, **asked)
    # what the deflection is made of are as many roundings as evaluations
    digits = 1e-9 + 200 * 5e-324 / abs(v)
    np.testing.assert_allclose(tiny.delta / v, known.delta / 1e-20, rtol=digits)
    assert tiny.stats["steps"] < 2 * known.stats["steps"]


@pytest.mark.slow
def test_a_slow_approach_stays_in_balance_however_stiff_it_is() -> None:
    """At a crawl the friction force is -zeta V: delta relaxes in lam << h/V, and explicit steps would be hopeless."""
    result = run(velocity=-1e-10, until_t=5e9, times=5, quantities=("F", "zeta", "dh_dt"), rtol=1e-8)
    np.testing.assert_allclose(result.F[1:], -result.zeta[1:] * result.dh_dt[1:], rtol=1e-12)
    np.testing.assert_allclose(result.dh_dt[1:], -1e-10, rtol=1e-5)
    assert result.stats["evaluations"] < 2000
    assert result.stats["stiffness"] > 1e4


@pytest.mark.slow
def test_a_jump_of_the_force_moves_delta_at_once_at_a_fixed_gap() -> None:
    """From the row after the jump on, the run is one that starts there with the other force."""
    t, F = [0.0, 100.0, 100.0, 300.0], [1e-2, 1e-2, -2e-2, -2e-2]
    both = run(force=(t, F), until_t=250.0, times=[0.0, 50.0, 100.0, 175.0, 250.0], rtol=1e-11)
    first = run(force=1e-2, until_t=100.0, times=2, rtol=1e-11)
    second = run(force=-2e-2, h=first.h[-1], until_t=150.0, times=3, rtol=1e-11)
    np.testing.assert_allclose(both.h[2:], second.h, rtol=1e-10)
    np.testing.assert_allclose(both.delta[2:], second.delta, rtol=1e-10)
    assert [(event.what, event.t) for event in both.events] == [("a row of the table", 100.0)]


@pytest.mark.slow
def test_events_tell_when_the_force_crosses_zero(tmp_path: Path) -> None:
    result = run(force="1e-3*cos(w*t)", constants={"w": 1e-2}, until_t=1000.0, rtol=1e-6)
    zeros = [event for event in result.events if event.what == "the force crosses zero"]
    np.testing.assert_allclose([event.t for event in zeros], [50 * math.pi, 150 * math.pi, 250 * math.pi], rtol=1e-12)
    # and files keep them
    for suffix in (".json", ".npz"):
        assert softdyn.load_result(result.save(tmp_path / f"result{suffix}")).events == result.events


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ({"velocity": -1e-3, "force": 1e-2}, r"takes one of .*velocity, spring, and has force and velocity"),
        ({"position": ([0, 1, 1, 2], [3, 3, 2, 2])}, r"a jump, at t = 1, takes an infinite velocity"),
        ({"force": ([0, 0, 2], [1e-2, 1e-3, 1e-2])}, r"neither starts nor ends with a jump"),
        ({"force": ([0, 1, 1, 1, 2], [1, 1, 1, 1, 1])}, r"must increase, or come twice"),
        ({"spring": {"stiffness": 1.0}}, r"spring is \{stiffness = NUMBER, base"),
        ({"spring": {"stiffness": -1.0, "base": 3.0}}, r"stiffness must be positive"),
        ({"position": 2.9, "delta": 0.01}, r"delta = 0.01 contradicts .*position, 2.9 .*makes it 0.05"),
        ({"position": 2.9, "X": 2.8}, r"X = 2.8 contradicts h = 1 and the initial position 2.9"),
        ({"force": 1e-2, "delta": 0.01}, r"delta follows from the force"),
        ({"velocity": "1/t"}, r"velocity has no finite value at the start"),
        ({"velocity": -1e-3, "method": "quadrature", "until_h": 0.5}, r"is for a constant force"),
    ],
)  # fmt: skip
def test_what_cannot_drive_a_pair_is_refused(scene: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        run(**{"until_t": 2.0, **scene})


@pytest.mark.slow
def test_every_drive_is_read_from_a_scene_file(tmp_path: Path) -> None:
    (tmp_path / "base.csv").write_text("t, base\n0, 3\n1000, 2\n3000, 2\n")
    head = 'law = "rognon_gay"\nparameters = {R = 1, E = 1, eta = 1}\n[pair]\nh = 1.0\n[until]\nt = 2000.0\n[drive]\n'
    drives = {
        'spring = {stiffness = 1.0, base = {file = "base.csv"}}': {
            "spring": {"stiffness": 1.0, "base": ([0, 1000, 3000], [3, 2, 2])}
        },
        'position = "3 - v*t"\n[constants]\nv = 1e-4': {"position": "3 - v*t", "constants": {"v": 1e-4}},
        "velocity = -1e-4": {"velocity": -1e-4},
    }
    for text, scene in drives.items():
        (tmp_path / "scene.toml").write_text(head + text)
        read = softdyn.simulate(read_scene(tmp_path / "scene.toml"))
        np.testing.assert_array_equal(read.h, run(**scene, until_t=2000.0).h)
