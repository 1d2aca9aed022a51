"""What drives a fluid as an expression of t acts whole, wherever steps happen to land.

A fluid between slippery walls, which goes round, moves as a body: its velocity is the integral of the force over its
density, whatever its viscosity.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

import softdyn
from softdyn.expression import evaluate, parse
from softdyn.fluid import Boundary, FluidResult, FluidScene, MeshSection
from softdyn.particles.time_functions import time_function

DENSITY, RTOL = 2.0, 1e-3
#: Errors of steps add up, to a few of what is allowed in one.
FEW = 10


def driven(force: str, **more: Any) -> FluidResult:
    given: dict[str, Any] = {
        "density": DENSITY,
        "viscosity": 1.0,
        "mesh": MeshSection(box=[1, 1], cells=[2, 2]),
        "boundary": [Boundary(on=["bottom", "top"], slip=True), Boundary(on=["left", "right"], periodic=True)],
        "until_t": 1.0,
        "rtol": RTOL,
        "times": 2,
    }
    scene = FluidScene(force=[force, 0], **{**given, **more})
    result: FluidResult = softdyn.simulate(scene)
    return result


def velocity(result: FluidResult) -> float:
    return float(result.u[-1][:, 0].mean())


def impulse(text: str, breaks: list[float]) -> float:
    expression = parse(text)
    parts = itertools.pairwise([0.0, *breaks, 1.0])
    return sum(quad(lambda t: evaluate(expression, t), a, b, limit=500, epsrel=1e-9)[0] for a, b in parts)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(place=st.floats(0.1, 0.9), decades=st.floats(0, 6), height=st.floats(-100, 100).filter(lambda F: abs(F) > 0.01))
def test_a_pulse_of_any_width_gives_its_impulse(place: float, decades: float, height: float) -> None:
    width = 0.03 * 10.0**-decades
    result = driven(f"{height!r}*exp(-((t - {place!r})/{width!r})**2)")
    assert velocity(result) == pytest.approx(math.sqrt(math.pi) * width * height / DENSITY, rel=FEW * RTOL)
    assert result.stats["warnings"] == []


@pytest.mark.slow
@pytest.mark.parametrize(("place", "width"), [(0.337, 1e-2), (0.71, 1e-6)])
def test_a_pulse_gives_its_impulse(place: float, width: float) -> None:
    result = driven(f"3*exp(-((t - {place})/{width})**2)")
    assert velocity(result) == pytest.approx(3 * math.sqrt(math.pi) * width / DENSITY, rel=FEW * RTOL)
    assert result.stats["warnings"] == []


@pytest.mark.parametrize(
    ("force", "breaks"),
    [
        ("4*step(t - 0.3)", [0.3]),
        ("4*step(sin(30*t))", [k * math.pi / 30 for k in range(1, 10)]),
        ("step(t - 0.5)*step(0.5001 - t)", [0.5, 0.5001]),
        ("abs(t - 0.4)", [0.4]),
    ],
)
def test_a_step_ends_at_each_jump_and_kink(force: str, breaks: list[float]) -> None:
    """Between jumps these forces are constant, or linear: what is left of an error is that of the first steps."""
    result = driven(force)
    assert velocity(result) == pytest.approx(impulse(force, breaks) / DENSITY, rel=2 * RTOL)
    times = result.step_t
    assert all(np.abs(times / at - 1).min() < 1e-15 for at in breaks)


@pytest.mark.slow
def test_a_gate_that_opens_for_short_whiles_lets_all_through() -> None:
    force = "exp(-50*sin(20*t + 0.7)**2)"
    assert velocity(driven(force)) == pytest.approx(impulse(force, []) / DENSITY, rel=FEW * RTOL)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_a_fluid_at_rest_may_start_as_slowly_as_it_likes(power: int) -> None:
    """The velocity of a start that has no scale is never small beside itself."""
    assert velocity(driven(f"t**{power}")) == pytest.approx(1 / (power + 1) / DENSITY, rel=FEW * RTOL)


@pytest.mark.slow
def test_a_pulse_of_the_pressure_acts_as_one_of_the_force() -> None:
    """In a channel without friction; on both sides of the pulse the flow is steady."""
    scene = FluidScene(
        density=DENSITY,
        viscosity=1.0,
        mesh=MeshSection(box=[2, 1], cells=[2, 2]),
        boundary=[
            Boundary(on=["bottom", "top"], slip=True),
            Boundary(on="left", pressure="6*exp(-((t - 0.6)/1e-4)**2)"),
            Boundary(on="right", pressure=0),
        ],
        until_t=0.7,
        rtol=RTOL,
        times=2,
    )
    result = softdyn.simulate(scene)
    assert velocity(result) == pytest.approx(6 * math.sqrt(math.pi) * 1e-4 / (2 * DENSITY), rel=FEW * RTOL)


@pytest.mark.slow
def test_an_expression_of_the_place_is_seen_there() -> None:
    """Only above a quarter of the height is there a pulse: three quarters of the fluid share it in the end."""
    text = "step(y - 0.25)*4*exp(-((t - 0.55)/1e-5)**2)"
    result = driven(text, mesh=MeshSection(box=[1, 1], cells=[2, 8]))
    flux = float(np.trapezoid(result.u[-1][:, 0][np.argsort(result.at[:, 1])], np.sort(result.at[:, 1])))
    assert flux == pytest.approx(0.75 * 4 * math.sqrt(math.pi) * 1e-5 / DENSITY, rel=0.1)


@pytest.mark.slow
def test_a_pulse_at_one_place_is_seen_between_the_points_that_are_always_watched() -> None:
    """It is 1 at three rows of nodes and 0 at all points that are watched anyway; all of the fluid shares it soon.

    Parabolas through 0, 0, 1 beside these rows add a third of an element's height to one.
    """
    text = "smoothstep(y, 0.5625, 0.575)*smoothstep(-y, -0.6125, -0.6)*4*exp(-((t - 0.55)/1e-5)**2)"
    result = driven(text, mesh=MeshSection(box=[1, 1], cells=[2, 40]), times=[0.6], until_t=0.6)
    rows, first = np.unique(result.u_at[:, 1], return_index=True)
    flux = float(np.trapezoid(result.u[-1][first, 0], rows))
    assert flux == pytest.approx(4 / 3 * 0.025 * 4 * math.sqrt(math.pi) * 1e-5 / DENSITY, rel=0.05)


def test_a_pulse_that_no_step_is_short_enough_for_is_told() -> None:
    (warning,) = driven("1 + 1e12*exp(-((t - 0.305)/1e-13)**2)").stats["warnings"]
    assert "[fluid] force, x changes too fast for the steps" in warning


def test_steps_of_a_given_length_that_miss_something_say_so() -> None:
    (warning,) = driven("exp(-((t - 0.305)/1e-3)**2)", dt=0.05, rtol=RTOL).stats["warnings"]
    assert "[fluid] force, x changes too fast for the steps: what it does may be missed" in warning


def test_steps_of_a_given_length_that_see_all_are_silent() -> None:
    assert driven("1 + t**2", dt=0.05).stats["warnings"] == []


@settings(deadline=None)
@given(
    a=st.floats(-3, 3),
    b=st.floats(0.1, 30),
    t=st.floats(0.2, 0.5),
    dt=st.floats(1e-3, 0.3),
    before=st.floats(1e-3, 0.2),
)
def test_what_a_parabola_misses_is_bounded(a: float, b: float, t: float, dt: float, before: float) -> None:
    function = time_function("exp(a*t)*sin(b*t)", "f", {"a": a, "b": b}, 1.0)
    seen = [t - before, t, t + dt]
    known = [function(when) for when in seen]
    parabola = np.polynomial.Polynomial.fit(seen, known, 2)
    fine = t + dt * (np.arange(2000) + 0.5) / 2000
    missed = float(np.mean(np.abs(np.exp(a * fine) * np.sin(b * fine) - parabola(fine)))) * dt
    assert missed <= function.missed(t, dt, seen) * (1 + 1e-6) + 1e-13
