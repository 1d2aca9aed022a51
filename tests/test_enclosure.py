"""Enclosures of expressions of time: all values and slopes are within them, and nothing hides from a bisection."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from softdyn.enclosure import enclose, intervals, kinks, resolved, unseen
from softdyn.expression import Shape, derivative, evaluate, parse, pieces, values

MP: dict[str, Any] = {
    **{name: getattr(mp, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "sinh", "cosh", "tanh", "coth")},
    "atan": mp.atan,
    "abs": abs,
    "min": min,
    "max": max,
    "sign": mp.sign,
    "step": lambda x: mp.mpf(x >= 0),
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": lambda x, y: x / y,
    "**": lambda x, y: x**y,
}


def exact(shape: Shape, t: Any, constants: Any) -> Any:
    """The value in 40 digits; None where there is none."""
    found: list[Any] = []
    try:
        for kind, *parts in shape:
            if kind == "time":
                value = t
            elif kind in ("constant", "number"):
                value = mp.mpf(constants[parts[0]] if kind == "constant" else parts[0])
            elif kind == "neg":
                value = -found[parts[0]]
            elif kind == "power":
                value = found[parts[0]] ** parts[1]
            elif kind == "call":
                value = MP[parts[0]](*(found[x] for x in parts[1:]))
            elif kind == "select":
                value = found[parts[1]] if found[parts[0]] < 0 else found[parts[2]]
            else:
                value = MP[kind](found[parts[0]], found[parts[1]])
            if isinstance(value, mp.mpc) or not mp.isfinite(value) or abs(value) > mp.mpf(10) ** 300:
                return None
            found.append(mp.mpf(value))
    except (ValueError, ZeroDivisionError, OverflowError):
        return None
    return found[-1]


numbers = st.floats(0.1, 9.0).map(lambda x: f"{x:.3f}")
ONE = ["sin", "cos", "tan", "atan", "tanh", "coth", "exp", "log", "sqrt", "sinh", "cosh", "abs", "sign", "step"]
expressions = st.recursive(
    numbers | st.just("t"),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/"]), inner).map(lambda x: f"({x[0]} {x[1]} {x[2]})"),
        st.tuples(st.sampled_from(ONE), inner).map(lambda x: f"{x[0]}({x[1]})"),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(lambda x: f"{x[0]}({x[1]}, {x[2]})"),
        inner.map(lambda x: f"-{x}"),
        st.tuples(inner, st.sampled_from(["2", "3", "7", "-2", "0.5", "1.7", "t"])).map(lambda x: f"({x[0]})**{x[1]}"),
    ),
    max_leaves=8,
)
lengths = st.floats(-6, 1).map(lambda x: 10**x)
starts = st.integers(-5000, 5000).map(lambda k: k / 1000)
fractions = st.lists(st.floats(0, 1), min_size=3, max_size=6)


@pytest.mark.slow
@given(expressions, starts, lengths, fractions)
@example("(-1.000)**t", 0.0, 1.0, [])
@settings(deadline=None)
def test_values_and_slopes_are_within_their_bounds(text: str, start: float, length: float, at: list[float]) -> None:
    """In 40 digits, at any time of the interval, wherever there are any."""
    expression = parse(text)
    assume(expression.of_time)
    end = start + length
    bounds = enclose(expression, start, end), enclose((derivative(expression.shape), expression.constants), start, end)
    with mp.workdps(40):
        for x in (0.0, 1.0, *at):
            t = mp.mpf(start) + (mp.mpf(end) - mp.mpf(start)) * mp.mpf(x)
            value = exact(expression.shape, t, expression.constants)
            slope = exact(derivative(expression.shape), t, expression.constants)
            if value is None:
                continue
            assert bounds[0][0] <= value <= bounds[0][1]
            # a jump has no slope
            if slope is not None and not any(op[:2] in (("call", "sign"), ("call", "step")) for op in expression.shape):
                assert bounds[1][0] <= slope <= bounds[1][1]


@given(expressions, starts, lengths, st.integers(0, 8), fractions)
@example("min(t, 0.500)", 0.001, 1.0, 0, [0.0])
@settings(deadline=None)
def test_no_expression_is_further_from_polynomials_than_told(
    text: str, start: float, length: float, degree: int, at: list[float]
) -> None:
    """The polynomial through Chebyshev's points is off by less than 1 + L times the bound, at any time."""
    expression = parse(text)
    assume(expression.of_time)
    end = start + length
    bound = unseen(expression, start, end, degree)
    assume(math.isfinite(bound))
    points = [mp.cos(mp.pi * (2 * k + 1) / (2 * degree + 2)) for k in range(degree + 1)]
    with mp.workdps(40):

        def value(x: Any) -> Any:
            t = (mp.mpf(start) + mp.mpf(end)) / 2 + x * (mp.mpf(end) - mp.mpf(start)) / 2
            return exact(expression.shape, t, expression.constants)

        found = [value(x) for x in points]
        assume(all(one is not None for one in found))
        for fraction in at:
            x = mp.mpf(2 * fraction - 1)
            cardinals = [
                mp.fprod((x - other) / (point - other) for other in points if other != point) for point in points
            ]
            there = value(x)
            if there is None:
                continue
            off = abs(there - mp.fsum(c * f for c, f in zip(cardinals, found, strict=True)))
            # the bound itself is rounded, a few times at most
            rounded = bound * (1 + mp.mpf(2) ** -50)
            assert off <= (1 + mp.fsum(abs(c) for c in cardinals)) * rounded + mp.mpf(10) ** -30


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("t*t - 2*3*t + 9", 0.0, 0.01),
        ("exp(-(t*t - 2*3*t + 9)/1e-2)", math.exp(-1.0), 1.0),
        ("sin(t)**2 + cos(t)**2", 1.0, 1.0),
        ("(t - 3)*(t - 3)", 0.0, 0.01),
    ],
)
def test_bounds_are_close_where_plain_intervals_are_not(text: str, low: float, high: float) -> None:
    """Between 2.9 and 3.1, where t*t - 6*t + 9 has the plain bounds -1.2 and 1.2."""
    found = enclose(parse(text), 2.9, 3.1)
    assert found[0] == pytest.approx(low, abs=2e-3)
    assert found[1] == pytest.approx(high, abs=2e-3)


@given(st.floats(-8, 0), st.floats(0, 1), st.integers(2, 8))
@settings(deadline=None)
def test_a_pulse_is_found_wherever_it_is_and_however_narrow(width: float, place: float, degree: int) -> None:
    """Between the edges of what is resolved, a pulse is close to the polynomial: there are edges around it."""
    pulse = parse("1e-5 + A*exp(-((t - c)/w)**2)", {"A": 1.0, "c": 1e5 * place, "w": 1e5 * 10**width})
    found = resolved(pulse, 0.0, 1e5, 1e-3, degree)
    assert found.whole
    assert not found.doubtful.any()
    assert len(found.edges) < 200
    longest = np.diff(found.edges)[np.searchsorted(found.edges, 1e5 * place) - 1 if place > 0 else 0]
    assert longest <= 4e5 * 10**width


@pytest.mark.slow
@given(
    st.sampled_from(["abs(%s)", "min(%s, 0)", "max(0, %s)", "sign(%s)", "step(%s)"]),
    st.floats(0.1, 300),
    st.floats(1e-6, 0.999999) | st.floats(-0.999999, -1e-6),
)
@settings(max_examples=20, deadline=None)
def test_kinks_are_where_the_argument_changes_its_sign(form: str, w: float, level: float) -> None:
    """All of them, even two that lie closer than any sample."""
    found, certain = kinks(parse(form % "sin(w*t) - a", {"w": w, "a": level}), 0.0, 10.0)
    first, turns = math.asin(level), np.arange(-1, w * 10 / (2 * math.pi) + 2)
    expected = np.sort(np.concatenate([first + 2 * math.pi * turns, math.pi - first + 2 * math.pi * turns])) / w
    expected = expected[(expected > 1e-12) & (expected < 10.0)]
    assert certain
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_jump_within_what_decides_is_no_change_of_sign_less() -> None:
    """T - sign(t) vanishes at 0 and at 1, and its slope is 1 everywhere else."""
    t, certain = kinks(parse("min(t, sign(t))"), -1.5, 2.0)
    assert certain
    np.testing.assert_allclose(t, [-1.0, 0.0, 1.0], atol=1e-15)


def test_two_kinks_closer_than_any_sample_are_both_found() -> None:
    """They are 6e-8 of the run apart: 4097 points see no change of sign."""
    t, certain = kinks(parse("abs((t - 0.3141)**2 - 1e-15)"), 0.0, 1.0)
    assert certain
    np.testing.assert_allclose(t, [0.3141 - math.sqrt(1e-15), 0.3141 + math.sqrt(1e-15)], rtol=1e-8)


@pytest.mark.parametrize("text", ["abs((t-3)**2)", "abs(2 + sin(t) + sin(1.4*t))", "max(exp(-t), 0)"])
def test_no_kink_is_found_where_there_is_none(text: str) -> None:
    t, certain = kinks(parse(text), 0.0, 100.0)
    assert certain
    assert not len(t)


def test_what_cannot_be_decided_is_said() -> None:
    assert not kinks(parse("abs(t*sin(1/t))"), 0.0, 1.0)[1]


@pytest.mark.slow
@pytest.mark.parametrize("place", [0.37, pytest.param(0.8123, marks=pytest.mark.slow)])
def test_kinks_that_pile_up_are_passed_and_doubted_there_alone(place: float) -> None:
    """Those of abs(sin(1/(t - c))) are at c + 1/(n pi): all are found, but where there are millions."""
    expression = parse("abs(sin(1/(t - c)))", {"c": place})
    found = list(intervals(pieces(expression.shape), expression.constants, 0.0, 1.0))
    ends = np.array([one.end for one in found if one.kink])
    near = 1e-4
    n = np.arange(1, math.floor(1 / (near * math.pi)) + 1)
    there = np.concatenate([place - 1 / (n * math.pi), place + 1 / (n * math.pi)])
    far = np.sort(there[(there > 0) & (there < 1)])
    outside = ends[np.abs(ends - place) >= 1 / ((n[-1] + 0.5) * math.pi)]
    # t - c is rounded by half a unit of t: the zeros are known to that
    np.testing.assert_allclose(outside, far, rtol=0, atol=2 * np.finfo(float).eps)
    starts = np.array([0.0, *(one.end for one in found[:-1])])
    doubtful = starts[[one.doubtful for one in found]]
    assert len(doubtful) > 0
    assert np.abs(doubtful - place).max() < near
    assert len(ends) < 2e5


@pytest.mark.slow
@given(expressions, st.floats(0.01, 5), st.floats(0, 1))
@settings(max_examples=50, deadline=None)
def test_between_its_kinks_an_expression_is_its_smooth_piece(text: str, end: float, place: float) -> None:
    """The choices of an interval give the same values as the expression itself, everywhere inside."""
    expression = parse(text)
    assume(expression.of_time)
    of = pieces(expression.shape)
    last = 0.0
    for i, one in enumerate(intervals(of, expression.constants, 0.0, end)):
        if i == 20 or one.doubtful:
            break
        t = np.array([last + (one.end - last) * (0.01 + 0.98 * place)])
        np.testing.assert_array_equal(
            values(of.shape, t, one.constants), values(expression.shape, t, expression.constants)
        )
        last = one.end


def test_kinks_are_found_as_far_as_they_are_asked_for() -> None:
    """A run that may end at any time takes them one by one."""
    expression = parse("abs(sin(w*t))", {"w": 1e-5})
    found = []
    for one in intervals(pieces(expression.shape), expression.constants, 0.0, math.inf):
        found += [one.end] if one.kink else []
        if len(found) == 5:
            break
    np.testing.assert_allclose(found, math.pi * 1e5 * np.arange(1, 6), rtol=1e-14)


def test_steps_have_their_later_value_at_the_jump() -> None:
    assert [evaluate(parse("step(t - 1)"), t) for t in (0.0, 1.0, 2.0)] == [0.0, 1.0, 1.0]
    assert [evaluate(parse("sign(t - 1)"), t) for t in (0.0, 1.0, 2.0)] == [-1.0, 0.0, 1.0]
