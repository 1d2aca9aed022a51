"""No step passes over what an expression of time does: pulses, gates, chirps, sums of sines are right, or warned of.

The reference is exact: between rigid spheres whose friction goes as 1/h, ln h falls by the impulse of the force over
6 pi eta R^2, and the impulse of each of these forces is known in closed form.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf, fresnel, ive
from sympy import oo, pi

import softdyn
from softdyn.derive import ContactLaw, R, eta, h

RIGID = ContactLaw(name="rigid", a=R, F_ela=oo, zeta=6 * pi * eta * R**2 / h)
T = 1e5
FRICTION = 6 * math.pi
RTOL = 1e-9


def check(force: str, constants: dict[str, float], impulse: Callable[[float], float], rtol: float = RTOL) -> None:
    """Compare ln h at four times; an error must be told by a warning."""
    times = [0.3 * T, 0.5 * T, 0.77 * T, T]
    result = softdyn.simulate(
        law=RIGID, parameters={"R": 1.0, "eta": 1.0}, h=1.0, force=force, constants=constants, until_t=T, times=times,
        rtol=rtol,
    )  # fmt: skip
    expected = np.array([-(impulse(t) - impulse(0.0)) / FRICTION for t in times])
    error = float(np.max(np.abs(np.expm1(np.log(result.h) - expected))))
    # the impulse itself rounds
    allowed = 10 * rtol + 1e-14 * float(np.max(np.abs(expected))) + 1e-14
    warned = [text for text in result.warnings if "known" in text]
    assert error <= allowed or (warned and (error <= result.stats["error"] or "unresolved" in result.stats))
    # each of these forces can be followed
    assert "unresolved" not in result.stats


def check_pulse(width: float, place: float, effect: float, rtol: float = RTOL) -> None:
    w, c = width * T, place * T
    A = FRICTION * effect / (w * math.sqrt(math.pi))
    constants = {"F0": 1e-5, "A": A, "c": c, "w": w}
    check(
        "F0 + A*exp(-((t - c)/w)**2)",
        constants,
        lambda t: 1e-5 * t + A * w * math.sqrt(math.pi) / 2 * float(erf((t - c) / w)),
        rtol,
    )


def check_gates(count: float, q: float, phase: float, rtol: float = RTOL) -> None:
    w = math.pi * count / T
    A = 3 * FRICTION / T * math.sqrt(q)

    def impulse(t: float) -> float:
        k = np.arange(1, int(20 * math.sqrt(q) + 60))
        x = w * t + phase
        terms = np.concatenate([[ive(0, q / 2) * x], 2 * ive(k, q / 2) * np.sin(2 * k * x) / (2 * k)])
        return A / w * math.fsum(terms)

    check("A*exp(-q*sin(w*t + p)**2)", {"A": A, "q": q, "w": w, "p": phase}, impulse, rtol)


def check_chirp(turns: float, rtol: float = RTOL) -> None:
    b = 2 * math.pi * turns / T**2
    A = 2 * FRICTION / T
    scale = math.sqrt(math.pi / (2 * b))
    check(
        "A*(1 + sin(b*t*t))",
        {"A": A, "b": b},
        lambda t: A * (t + scale * float(fresnel(t / scale)[0])),
        rtol,
    )


def check_sines(turns: tuple[float, float, float], small: float, rtol: float = RTOL) -> None:
    A = 2 * FRICTION / T
    w = [2 * math.pi * n / T for n in turns]
    sizes = [1.0, 0.7, small]
    constants = {"A": A, **{f"a{i}": a for i, a in enumerate(sizes)}, **{f"w{i}": x for i, x in enumerate(w)}}

    def impulse(t: float) -> float:
        return A * (t - math.fsum(a / x * (math.cos(x * t) - 1) for a, x in zip(sizes, w, strict=True)))

    check("A*(1 + a0*sin(w0*t) + a1*sin(w1*t) + a2*sin(w2*t))", constants, impulse, rtol)


widths = st.floats(-8, -1).map(lambda x: 10**x)
places = st.floats(0.0, 1.0)
effects = st.floats(-6, 0.5).map(lambda x: 10**x) | st.floats(-6, 0.5).map(lambda x: -(10**x))
few_turns = st.floats(0.1, 60.0) | st.sampled_from([1.0, 8.0, 16.0, 32.0, 64.0])


@pytest.mark.slow
@given(widths, places, effects)
@settings(deadline=None, max_examples=40)
def test_a_pulse_of_any_width_anywhere_is_not_missed(width: float, place: float, effect: float) -> None:
    check_pulse(width, place, effect)


@pytest.mark.slow
@given(st.floats(1.0, 60.0) | st.sampled_from([16.0, 64.0, 128.0]), st.floats(0.5, 500.0), st.floats(0.0, 3.0))
@settings(deadline=None, max_examples=15)
def test_gates_are_not_aliased(count: float, q: float, phase: float) -> None:
    check_gates(count, q, phase)


@given(st.floats(0.1, 300.0))
@settings(deadline=None, max_examples=15)
def test_chirps_are_followed(turns: float) -> None:
    check_chirp(turns)


@pytest.mark.slow
@given(st.tuples(few_turns, few_turns, few_turns), st.floats(-9, 0).map(lambda x: 10**x))
@settings(deadline=None, max_examples=20)
def test_sums_of_sines_are_followed(turns: tuple[float, float, float], small: float) -> None:
    """Commensurate or not; of any amplitude."""
    check_sines(turns, small)


@pytest.mark.slow
@given(
    widths, places, effects, st.floats(1.0, 300.0), st.floats(0.1, 3e3), st.floats(0.1, 3e3),
    st.tuples(*[st.floats(0.1, 300.0)] * 3), st.floats(-9, 0).map(lambda x: 10**x),
    st.sampled_from([1e-4, 1e-6, 1e-11]),
)  # fmt: skip
@settings(deadline=None, max_examples=300)
def test_nothing_is_missed_at_any_tolerance(
    width: float,
    place: float,
    effect: float,
    count: float,
    q: float,
    turns: float,
    three: Any,
    small: float,
    rtol: float,
) -> None:
    check_pulse(width, place, effect, rtol)
    check_gates(count, q, place, rtol)
    check_chirp(turns, rtol)
    check_sines(three, small, rtol)


SOFT: dict[str, Any] = {"law": "rognon_gay", "parameters": {"R": 1.0, "E": 1.0, "eta": 1.0}, "h": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=pytest.mark.slow)])
@pytest.mark.parametrize("drive", ["force", "velocity", "position", "base"])
def test_every_drive_sees_a_pulse_as_the_same_table_does(drive: str, target: str) -> None:
    """A pulse of a thousandth of the run, given as an expression and as 20 000 rows."""
    c, w = 0.41234 * T, 1e-3 * T
    size, mean = {"force": (0.05, 1e-5), "velocity": (-1e-3, 0.0)}.get(drive, (-0.2, 3.0))
    t = np.concatenate([[0.0], c + w * np.linspace(-7, 7, 20_001), [T]])
    table = (t, mean + size * np.exp(-(((t - c) / w) ** 2)))
    text = "mean + size*exp(-((t - c)/w)**2)"
    constants = {"mean": mean, "size": size, "c": c, "w": w}

    def run(value: Any, **more: Any) -> Any:
        given = {"spring": {"stiffness": 0.3, "base": value}} if drive == "base" else {drive: value}
        return softdyn.simulate(**SOFT, **given, until_t=T, times=[0.42 * T, T], target=target, **more)

    found, expected = run(text, constants=constants), run(table)
    assert not found.warnings
    # the table is linear between its rows: off by (7e-4)^2/8 of what bends most
    np.testing.assert_allclose(found.h, expected.h, rtol=2e-6)


@pytest.mark.slow
def test_a_batch_sees_what_a_run_sees() -> None:
    """In the kernel's own loop over runs, with no look at each."""
    c = np.linspace(0.1, 0.9, 17) * T
    many = softdyn.simulate(
        **SOFT, force="1e-5 + 0.05*exp(-((t - c)/w)**2)", constants={"c": c, "w": 1.0}, until_t=T, times=[T]
    )
    single = [
        softdyn.simulate(
            **SOFT, force="1e-5 + 0.05*exp(-((t - c)/w)**2)", constants={"c": x, "w": 1.0}, until_t=T, times=[T]
        ).h[0]
        for x in c.tolist()
    ]
    np.testing.assert_allclose(many.h[:, 0], single, rtol=1e-12)
    unpushed = softdyn.simulate(**SOFT, force=1e-5, until_t=T, times=[T])
    assert (np.abs(many.h[:, 0] / unpushed.h[0] - 1) > 1e-3).all()


@pytest.mark.slow
@pytest.mark.parametrize("form", ["1e-3*step(sin(w*t))", "5e-4*(1 + sign(sin(w*t)))"])
def test_an_expression_jumps_as_a_table_does(form: str) -> None:
    edges = T / 8 * np.arange(9)
    t = np.repeat(edges, 2)[1:-1]
    F = np.array([1e-3 if k % 2 == 0 else 0.0 for k in np.repeat(np.arange(8), 2)])
    found = softdyn.simulate(**SOFT, force=form, constants={"w": 8 * math.pi / T}, until_t=T, times=20)
    expected = softdyn.simulate(**SOFT, force=(t, F), until_t=T, times=20)
    np.testing.assert_allclose(found.h, expected.h, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "form", ["1e-3*max(sin(w*t), 0.2)", "1e-3*min(2, 1.3 + sin(w*t), 0.7)", "1e-3*abs(sin(w*t) - 0.999)"]
)
def test_kinks_are_met_where_a_run_may_end_at_any_time(form: str) -> None:
    """With an end in h alone, and the same with one in t: events and outputs agree."""
    constants = {"w": 3e-5}
    by_gap = softdyn.simulate(**SOFT, force=form, constants=constants, until_h=0.05, gaps=10)
    end = 1.5 * by_gap.t[-1]
    both = softdyn.simulate(**SOFT, force=form, constants=constants, until_h=0.05, until_t=end, gaps=10)
    np.testing.assert_allclose(by_gap.t, both.t, rtol=1e-9)
    times = [[event.t for event in result.events[:-1]] for result in (by_gap, both)]
    assert len(times[0]) > 1
    np.testing.assert_allclose(times[0], times[1], rtol=1e-12)


def test_what_cannot_be_bounded_is_warned_of() -> None:
    """A pole: the force has no bound within the step that holds it, however short."""
    result = softdyn.simulate(**SOFT, force="1e-3/(t - c)**2", constants={"c": 5e4}, until_t=T, times=[T])
    assert any("cannot be bounded" in text for text in result.warnings)


@pytest.mark.slow
def test_millions_of_kinks_in_one_place_are_passed_and_told_of() -> None:
    """abs(sin(T/(t - c))) has ten million kinks about c: the run follows it but for a ten-thousandth of the time."""

    def integral(x: float) -> float:
        """Of abs(sin(1/x)) from 0: of abs(sin(u))/u^2 from 1/x on, whose mean far out is that of 2/pi/u^2."""
        u = np.unique(np.concatenate([[1 / x], np.pi * np.arange(math.ceil(1 / (x * np.pi)), 20_001)]))
        points, weights = np.polynomial.legendre.leggauss(20)
        middle, half = (u[1:] + u[:-1]) / 2, np.diff(u) / 2
        at = middle[:, None] + half[:, None] * points
        return float(np.sum(half * (np.abs(np.sin(at)) / at**2 @ weights))) + 2 / math.pi / float(u[-1])

    c, F0 = 0.37, FRICTION / T
    result = softdyn.simulate(
        law=RIGID, parameters={"R": 1.0, "eta": 1.0}, h=1.0, force="F0*abs(sin(T/(t - c)))",
        constants={"F0": F0, "c": c * T, "T": T}, until_t=T, times=[0.2 * T, 0.5 * T, T],
    )  # fmt: skip
    signed = [math.copysign(integral(abs(t / T - c)), t / T - c) for t in result.t]
    wrong = np.log(result.h) + (integral(c) + np.array(signed))
    assert abs(wrong[0]) < 1e-8
    assert np.abs(wrong).max() < 1e-4
    assert any("cannot be bounded" in text for text in result.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("terms", [330, pytest.param(1500, marks=pytest.mark.slow)])
def test_long_sums_are_run(terms: int) -> None:
    """Too long for recursion, and for what compilers nest."""
    text = "1e-8*(" + "+".join(["t"] * terms) + ")"
    found = softdyn.simulate(**SOFT, force=text, until_t=10.0, times=[10.0])
    expected = softdyn.simulate(**SOFT, force=f"{terms * 1e-8:.17g}*t", until_t=10.0, times=[10.0])
    assert found.h[0] == pytest.approx(expected.h[0], rel=1e-12)


@pytest.mark.slow
def test_no_result_depends_on_how_an_expression_is_written() -> None:
    """The same pulse in forms whose plain intervals differ by orders of magnitude."""
    constants = {"c": 4.1234e4, "w": 1.0}
    forms = ["-((t - c)/w)**2", "-(t*t - 2*c*t + c*c)/w**2", "(2*c*t - t*t - c**2)/(w*w)", "-(t - c)*(t - c)/w**2"]
    h = [
        softdyn.simulate(**SOFT, force=f"1e-5 + 0.05*exp({form})", constants=constants, until_t=T, times=[T]).h[0]
        for form in forms
    ]
    # t*t rounds: the exponent by 4e-7
    assert all(abs(a / b - 1) < 1e-6 for a, b in itertools.pairwise(h))
