"""Expressions of time: a grammar of their own, hostile text refused with the position, nothing evaluated as code."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softdyn.errors import SceneError
from softdyn.expression import FUNCTIONS, derivative, evaluate, parse, values


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1e-2*(1 + 0.5*sin(w*t))", 1e-2 * (1 + 0.5 * math.sin(3 * 2.0))),
        ("-t**2", -4.0),
        ("2**-t", 0.25),
        ("2**t**2", 16.0),
        ("(2**t)**2", 16.0),
        ("1 - 2 - 3", -4.0),
        ("8/4/2", 1.0),
        ("--t", 2.0),
        ("- + -t", 2.0),
        ("2*-t", -4.0),
        (".5 + 1. + 1E1", 11.5),
        ("abs(-t)*pi", 2 * math.pi),
        ("min(t, 3, 1) + max(t, 3)", 4.0),
        ("coth(t)", 1 / math.tanh(2.0)),
        ("sign(-t) + sign(0*t) + sign(t)*10", 9.0),
        ("step(t - 2) + 10*heaviside(t - 3)", 1.0),
        ("smoothstep(t, 3, 4) + 10*smoothstep(t, 0, 1) + 100*smoothstep(t, 1.5, 3.5)", 10 + 100 * 0.0625 * 2.5),
        ("smoothstep(-t, -3, -1)", 0.5),
    ],
)
def test_the_grammar_means_what_it_means_in_python(text: str, expected: float) -> None:
    assert evaluate(parse(text, {"w": 3.0}), 2.0) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "position", "message"),
    [
        ("1e-2*sin(w t)", 12, "not closed"),
        ("1 +", 4, "the end"),
        ("2*(t", 5, "opened at position 3 is not closed"),
        ("sin t", 1, "argument in parentheses"),
        ("sine(t)", 1, "did you mean 'sin'"),
        ("ln(t)", 1, "did you mean 'log'"),
        ("Heaviside(t)", 1, "did you mean 'heaviside'"),
        ("Max(t, 0)", 1, "did you mean 'max'"),
        ("sgn(t)", 1, "did you mean 'sign'"),
        ("arctan(t)", 1, "did you mean 'atan'"),
        ("min(t)", 1, "takes two arguments or more"),
        ("sin(t, 1)", 1, "takes one argument, not 2"),
        ("t + omga", 5, "did you mean 'omega'"),
        ("smoothstep(t)", 1, "takes 3 arguments, x, a and b, not 1"),
        ("smooth_step(t, 0, 1)", 1, "did you mean 'smoothstep'"),
        ("x*t", 1, "unknown name 'x'"),
        ("t @ 2", 3, "'@' is not part of the grammar"),
        ("t.real", 2, "'.' is not part of the grammar"),
        ("__import__('os')", 12, "not part of the grammar"),
        ("__import__(t)", 1, "unknown function"),
        ("(lambda: 1)()", 8, "not part of the grammar"),
        ("t[0]", 2, "not part of the grammar"),
        ("1e999", 1, "larger than a double"),
        ("", 1, "the end"),
        ("t t", 3, "does not belong here"),
        ("1_000", 2, "does not belong here"),
    ],
)
def test_text_outside_the_grammar_is_refused_with_its_position(text: str, position: int, message: str) -> None:
    with pytest.raises(SceneError) as refusal:
        parse(text, {"w": 1.0, "omega": 1.0})
    assert f"position {position}:" in str(refusal.value)
    assert message in str(refusal.value)


@pytest.mark.parametrize(
    "text", ["(" * 5000 + "t", "-" * 9000 + "t", "2**" * 3000 + "t", "t+" * 6000 + "t", "9**9**9**9**9"]
)
def test_deep_long_or_huge_text_neither_crashes_nor_hangs(text: str) -> None:
    said = ""
    try:
        evaluate(parse(text), 1.0)
    except SceneError as refusal:
        said = str(refusal)
    assert len(said) < 400  # a hostile text is not echoed whole


def test_sums_of_thousands_of_terms_are_flat() -> None:
    """No recursion, however long: the derivative of 4900 terms, and its value."""
    expression = parse("t" + "+t" * 4900)
    t = np.array([2.0])
    assert evaluate(expression, 2.0) == 9802.0
    assert values(derivative(expression.shape), t, expression.constants)[0] == 4901.0


def test_numbers_are_kept_apart_from_the_shape() -> None:
    """One kernel serves all expressions of a shape, whatever the numbers."""
    one, other = parse("1e-2*sin(w*t)", {"w": 1.0}), parse("3*sin(7*t)")
    assert one.shape == other.shape
    assert one.constants == (1e-2, 1.0)
    assert other.constants == (3.0, 7.0)


numbers = st.floats(0.1, 9.0).map(lambda x: f"{x:.3f}")
expressions = st.recursive(
    numbers | st.just("t"),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/"]), inner).map(lambda x: f"({x[0]} {x[1]} {x[2]})"),
        st.tuples(st.sampled_from(["sin", "cos", "atan", "tanh", "abs"]), inner).map(lambda x: f"{x[0]}({x[1]})"),
        inner.map(lambda x: f"-{x}"),
        inner.map(lambda x: f"({x})**2"),
    ),
    max_leaves=12,
)


@given(expressions, st.floats(0.1, 5.0))
def test_random_expressions_agree_with_python(text: str, t: float) -> None:
    """Python's own evaluation is the reference here, on text that hypothesis made and not a user."""
    found = evaluate(parse(text), t)
    try:
        expected = float(eval(text, {"__builtins__": {}}, {**FUNCTIONS, "t": t}))
    except (ZeroDivisionError, OverflowError):
        expected = math.nan
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_a_root_of_what_is_negative_has_no_value_in_any_function() -> None:
    """Python makes it complex, and of that abs made a real number that kernels do not have."""
    assert math.isnan(evaluate(parse("abs(t**0.5)"), -4.0))


def test_an_expression_of_place_has_a_value_at_each_point() -> None:
    found = parse("2*U*y*(1 - y) + x*t", {"U": 3.0}, "xy")
    at = np.random.default_rng(0).uniform(size=(2, 7))
    assert values(found.shape, np.float64(2.0), found.constants, at) == pytest.approx(
        6 * at[1] * (1 - at[1]) + 2 * at[0]
    )
    assert (found.of_place, found.of_time) == (True, True)
    flat = parse("4", {}, "xy")
    assert values(flat.shape, np.array(0.0), flat.constants, at).shape == (7,)
    assert (flat.of_place, flat.of_time) == (False, False)


def test_places_have_the_axes_that_there_are() -> None:
    with pytest.raises(SceneError, match="unknown name 'z'"):
        parse("z", {}, "xy")
    assert parse("z", {"z": 1.0}, "xy").constants == (1.0,)
