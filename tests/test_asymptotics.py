"""A series converges to its expression at the rate of what was left out, throughout the cone it was made for."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import mpmath
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from sympy import (
    Abs,
    Expr,
    I,
    Integer,
    Max,
    Min,
    Piecewise,
    Rational,
    S,
    Symbol,
    cosh,
    coth,
    exp,
    factorial,
    lambdify,
    log,
    pi,
    simplify,
    sin,
    sinh,
    sqrt,
    tanh,
)

from softdyn.derive.asymptotics import (
    OutOfEffortError,
    Scale,
    Series,
    SplitError,
    UndecidedError,
    expand,
    first_terms,
    is_apart_from_zero,
    is_zero,
    leading,
    minimal,
    negligible,
    scale_of,
    sign_by_parts,
)
from softdyn.derive.cones import Cone, split
from softdyn.derive.patience import within

r1, r2 = (Symbol(name, positive=True) for name in ("r1", "r2"))
own = Symbol("own", positive=True)
AXES = {r1: (1, 0), r2: (0, 1)}
#: Both small; and two parts of it, r2 between r1^2 and r1^3, or r2 >> r1.
QUARTER, WEDGE, SIDE = ((1, 0), (0, 1)), ((1, 2), (1, 3)), ((0, 1), (1, 1))
CONES = (QUARTER, WEDGE, SIDE[::-1], ((1, 0), (1, 1)), ((-1, 0), (0, 1)), ((-1, 2), (-2, 1)))


def scale_in(cone: Cone, kept: int = 8) -> Scale:
    return scale_of(cone, AXES, kept)


def total(series: Series) -> Expr:
    return sum(series.terms.values(), start=S.Zero)


def point(cone: Cone, weights: tuple[Rational, ...], decades: int) -> list[mpmath.mpf]:
    """Return r1 and r2 on a ray inside a cone."""
    powers = [sum(w * ray[i] for w, ray in zip(weights, cone, strict=True)) for i in range(2)]
    return [mpmath.mpf(10) ** (-decades * mpmath.mpf(p.p) / p.q) for p in powers]


def expressions(*, branches: bool = False) -> st.SearchStrategy[Expr]:
    """Random sums, products, quotients and roots of the ratios and small numbers, and a few differences."""
    leaves = st.sampled_from((r1, r2)) | st.integers(1, 5).map(Integer)
    powers = st.sampled_from([Rational(x) for x in ("1/2", "-1/2", "3/2", "-1", "2", "1/3")])

    def larger(inner: st.SearchStrategy[Expr]) -> st.SearchStrategy[Expr]:
        pairs = st.tuples(inner, inner)
        kinds = [
            pairs.map(lambda p: p[0] + p[1]),
            pairs.map(lambda p: p[0] * p[1]),
            pairs.map(lambda p: p[0] / (1 + p[1])),
            pairs.map(lambda p: p[0] - p[1]),
            st.tuples(inner, powers).map(lambda p: p[0] ** p[1] if p[0] != 0 else p[0]),
        ]
        if branches:
            kinds += [
                pairs.map(lambda p: Max(*p)),
                pairs.map(lambda p: Min(*p)),
                inner.map(Abs),
                st.tuples(inner, inner, inner, inner).map(lambda p: Piecewise((p[0], p[1] < p[2]), (p[3], True))),
                inner.map(lambda x: log(1 + x**2)),
                inner.map(lambda x: tanh(x**2)),
                inner.map(lambda x: exp(-(x**2))),
            ]
        return st.one_of(kinds)

    return st.recursive(leaves, larger, max_leaves=6)


#: Weights of the two rays of a cone.
WEIGHTS = ((Integer(1), Integer(1)), (Integer(1), Rational(1, 3)), (Rational(2, 5), Integer(1)))
relaxed = settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)


def converges(expr: Expr, cone: Cone) -> None:
    assume(expr.free_symbols and not expr.has(I))
    try:
        series = expand(expr, scale_in(cone))
    except UndecidedError:
        assume(False)
    function = lambdify((r1, r2), [expr, total(series)], "mpmath")
    with mpmath.workdps(900):
        for weights in WEIGHTS:
            errors = []
            for decades in (30, 60):
                exact, summed = function(*point(cone, weights, decades))
                errors.append(abs(mpmath.mpf(exact) - mpmath.mpf(summed)))
            if not series.remainder:
                # nothing was cut off but what is smaller than any power
                assert errors[1] <= mpmath.mpf(10) ** -500
                continue
            predicted = min(
                float(sum(x * w for x, w in zip(order, weights, strict=True))) for order in series.remainder
            )
            if errors[1] > mpmath.mpf(10) ** -700:
                slope = float(mpmath.log10(errors[0] / errors[1])) / 30
                # constants up to 1e3, logarithms and terms of nearby powers move the slope by less than 4.5/30
                assert slope >= predicted - 0.15


@relaxed
@given(expressions(), st.sampled_from(CONES))
def test_a_series_converges_at_the_rate_of_its_remainder(expr: Expr, cone: Cone) -> None:
    converges(expr, cone)


@pytest.mark.slow
@relaxed
@given(expressions(branches=True), st.sampled_from(CONES))
def test_a_series_of_branches_and_functions_does_too(expr: Expr, cone: Cone) -> None:
    converges(expr, cone)


@pytest.mark.slow
@relaxed
@given(expressions(branches=True), st.sampled_from(CONES))
def test_the_leading_term_is_the_limit_in_every_part_of_a_cone(expr: Expr, cone: Cone) -> None:
    """Where two terms compete, the cone is cut; after a few cuts there is a leading term in each part."""
    assume(expr.free_symbols and not expr.has(I))
    waiting, decided = [cone], 0
    while waiting and decided < 6:
        part = waiting.pop()
        try:
            _, coefficient = leading(expand(expr, scale_in(part)))
        except SplitError as competing:
            above, below = split(part, competing.values)
            assert above
            assert below
            waiting += above + below
            assume(len(waiting) < 8)
            continue
        except UndecidedError:
            continue
        decided += 1
        ratio = lambdify((r1, r2), expr / coefficient, "mpmath")
        size = max(abs(x) for ray in part for x in ray)
        with mpmath.workdps(1000 * size):
            for weights in WEIGHTS:
                # the smallest step between orders is 1/12 (half, third, twice), at the weight 1/3: 10**-2.7
                assert abs(ratio(*point(part, weights, 100)) - 1) < 0.1


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (log(r1), log(r1)),
        (log(3 * r1**2 / r2), log(3) + 2 * log(r1) - log(r2)),
        (log(1 + r1), r1),
        (exp(r1) - 1, r1),
        (exp(2 + r1), exp(2)),
        (exp(-1 / r1) + r2**9, r2**9),
        (tanh(1 / r1), S.One),
        (sinh(r1) / r1, S.One),
        ((1 - cosh(r1)) / r1**2, -S.Half),
        (sqrt(1 + r1) - 1, r1 / 2),
        (Abs(r1 - r1**2), r1),
        (Max(r1, r1**2, r1 * r2), r1),
        (Min(1, 2 - r1), S.One),
        (Piecewise((r1, r1 < r1 * r2), (r2, r1 > r1 * r2)), r2),
        (r1 / (r1 + r1 * r2), S.One),
        # a logarithm is less than any power, however the ratios compare
        (r1 * log(r2) + r1 * r2 - r1 * log(r2), r1 * r2),
        (1 + r1 * log(r2), S.One),
        (sqrt(-log(r1)), sqrt(-log(r1))),
        (own - r1, own),
        (sqrt(r1 + r2), None),
    ],
    ids=str,
)
def test_known_series_start_as_they_do(expr: Expr, expected: Expr | None) -> None:
    if expected is None:
        with pytest.raises(SplitError, match="it must be split"):
            expand(expr, scale_in(QUARTER))
        return
    assert simplify(leading(expand(expr, scale_in(QUARTER)))[1] - expected) == 0


def test_a_cut_decides_which_of_two_terms_dominates() -> None:
    assert leading(expand(sqrt(r1 + r2), scale_in(WEDGE)))[1] == sqrt(r1)
    assert leading(expand(sqrt(r1 + r2), scale_in(((0, 1), (-1, 1)))))[1] == sqrt(r1)
    assert leading(expand(sqrt(r1**3 + r2), scale_in(WEDGE)))[1] == sqrt(r2)


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (r1 - r1 * (1 + r2), -r1 * r2),
        (sqrt(r1**2 + r1**3) - r1, r1**2 / 2),
        (sqrt(1 + r1) - 1 - r1 / 2, -(r1**2) / 8),
        (1 / (1 - r1) - 1 / (1 + r1) - 2 * r1, 2 * r1**3),
        (exp(r1) - 1 - r1 - r1**2 / 2, r1**3 / 6),
        (log(1 + r1) - r1, -(r1**2) / 2),
        (sin(r1) - tanh(r1), r1**3 / 6),
        (sqrt(2) * sqrt(3) * r1 - sqrt(6) * r1 * (1 + r2), -sqrt(6) * r1 * r2),
    ],
    ids=str,
)
def test_what_is_left_of_a_difference_is_found(expr: Expr, expected: Expr) -> None:
    assert simplify(leading(expand(expr, scale_in(QUARTER)))[1] - expected) == 0


#: Functions less the start of their series, and the first term that is left.
REMAINDERS = {
    "log": (lambda x: log(1 + x) - x, lambda x: -(x**2) / 2),
    "product": (lambda x: (1 + 1 / x) * log(1 + x) - 1, lambda x: x / 2),
    "exp": (lambda x: exp(x) - 1 - x - x**2 / 2, lambda x: x**3 / 6),
    "sinh": (lambda x: sinh(x) / x - 1, lambda x: x**2 / 6),
    "Langevin": (lambda x: coth(x) - 1 / x, lambda x: x / 3),
    "root": (lambda x: sqrt(1 + x) - 1 - x / 2 + x**2 / 8, lambda x: x**3 / 16),
    "quotient": (lambda x: 1 / (1 + x) - 1 + x - x**2, lambda x: -(x**3)),
}
#: Small ratios that hold another, of which every power cancels.
INNER = (
    1 / (1 + r2), 1 + r2, sqrt(1 + r2**2), 1 + r2 + r2**2, (1 + 2 * r2) / (1 + r2), 1 / (1 + sqrt(r2)), exp(-r2) + r2,
)  # fmt: skip


@relaxed
@given(
    st.sampled_from(sorted(REMAINDERS)),
    st.sampled_from(INNER),
    st.fractions(Fraction(1, 4), 4, max_denominator=4),
    st.sampled_from((QUARTER, WEDGE, SIDE)),
)
def test_what_cancels_at_every_power_of_another_ratio_cancels(
    name: str, inner: Expr, number: Fraction, cone: Cone
) -> None:
    """Of log(1 + x) - x with x = r1/(1 + r2), -x^2/2 is left, however small r1 is beside all powers of r2."""
    function, left = REMAINDERS[name]
    x = Rational(number.numerator, number.denominator) * r1 * inner
    found = leading(expand(function(x), scale_in(cone)))[1]
    expected = leading(expand(left(x), scale_in(cone)))[1]
    assert simplify(found / expected) == 1


def test_terms_are_taken_until_one_is_left() -> None:
    """Of sin x less the first twelve terms of its series, the thirteenth."""
    start = sum((-1) ** k * r1 ** (2 * k + 1) / factorial(2 * k + 1) for k in range(12))
    assert leading(expand(sin(r1) - start, scale_in(QUARTER, 30)))[1] == r1**25 / factorial(25)


def test_a_name_does_not_hide_what_cancels_with_it() -> None:
    """With s = 1 + r2, s - 1 is no term of order one."""
    s = 1 + r2
    found = leading(expand((s * log(1 + r1 / s) - r1) / r1 + (s**3 - 3 * s + 2), scale_in(((1, 0), (2, 1)))))
    assert found[1] == 3 * r2**2


@pytest.mark.parametrize(
    ("expr", "reason"),
    [
        (sin(1 / r1), "neither small nor of order one"),
        (exp(1 / r1), "neither small nor of order one"),
        (exp(r1 / r2), "must be split"),
        (sqrt(r1 - r2), "must be split"),
        (sqrt(r1**2 - r1), "negative under a root"),
        (log(r1**2 - r1), "logarithm of a negative number"),
        (log(sin(r1) - r1 + r1**3 / 6 - r1**5 / 120 + r1**7 / 5040), "cancel"),
        (sqrt(own - 2 + r1), "the sign of"),
        (1 / (log(r1) - log(r2)), "the sign of"),
        (r1**own, "is no rational number"),
        (sin(log(r1)), "logarithm"),
        ((1 + own) ** 7 - (1 + own) ** 8 + own * (1 + own) ** 7 + exp(1 / r1), "neither small"),
    ],
    ids=str,
)
def test_the_method_says_why_it_does_not_apply(expr: Expr, reason: str) -> None:
    with pytest.raises(UndecidedError, match=reason):
        leading(expand(expr, scale_in(QUARTER)))


def test_a_coefficient_without_a_simple_sign_of_zero_ends_soon() -> None:
    """Multiplying out (1 + own)^(10^6), or giving it in digits, would not."""
    power = 10**6
    assert is_zero((1 + own) ** 20 * own + (1 + own) ** 20 - (1 + own) ** 21)
    with pytest.raises(UndecidedError, match="is not known"):
        is_zero((1 + own) ** power * own + (1 + own) ** power - (1 + own) ** (power + 1))
    assert not is_zero((1 + own) ** power - (2 + own) ** power)


def test_a_series_that_is_cut_keeps_its_largest_terms() -> None:
    """1/(1 - r1) + r2^9: with three terms, 1, r1 and r2^9, none of which is negligible against both others."""
    series = expand(1 / (1 - r1) + r2**9, scale_in(QUARTER, 3))
    assert set(series.terms) == {(0, 0), (1, 0), (0, 9)}
    assert series.remainder == {(2, 0)}
    assert all(negligible(order, (1, 0)) for order in series.remainder)


def test_the_effort_is_over_when_it_is() -> None:
    with pytest.raises(OutOfEffortError), within(0, OutOfEffortError):
        expand(r1 + r2, scale_of(QUARTER, AXES))


# ------------------------------------------------------------------------------------------ what need not be worked out


def all_first(terms, remainder, kept):
    """The same as first_terms, with every coefficient worked out before anything is cut."""
    least = minimal(remainder)
    known = {e: c for e, c in terms.items() if c is not None and not any(e == r or negligible(e, r) for r in least)}
    if len(known) <= kept:
        return known, frozenset(least)
    ordered, rest = [], set(known)
    while len(ordered) < kept:
        layer = minimal(rest)
        ordered += sorted(layer, key=lambda e: (sum(e), e))
        rest.difference_update(layer)
    return {e: known[e] for e in ordered[:kept]}, frozenset(minimal([*least, *ordered[kept:], *rest]))


def test_terms_that_are_cut_are_not_worked_out_and_change_nothing() -> None:
    draw, spared = Random(3), 0
    for _ in range(600):
        orders = [(draw.randint(-2, 4), draw.randint(-2, 4)) for _ in range(draw.randint(0, 12))]
        terms = {e: None if draw.random() < 0.3 else Symbol(f"c{i}") for i, e in enumerate(orders)}
        remainder = [(draw.randint(0, 5), draw.randint(0, 5)) for _ in range(draw.randint(0, 2))]
        asked: list = []

        def coefficient_of(coefficient, asked=asked):
            asked.append(coefficient)
            return coefficient

        found = first_terms(terms, coefficient_of, remainder, kept := draw.randint(1, 5))
        assert (dict(found.terms), found.remainder) == all_first(terms, remainder, kept)
        assert len(asked) <= len(terms)
        spared += len(terms) - len(asked)
    assert spared > 800


def test_signs_and_zeros_seen_in_parts_are_those_that_sympy_finds() -> None:
    x, y, n = Symbol("x", positive=True), Symbol("y", negative=True), Symbol("n", real=True)
    draw = Random(5)

    def made(depth: int):
        if depth == 0:
            return draw.choice([x, y, n, S(draw.randint(-3, 3)), Rational(1, 3), pi])
        parts = [made(depth - 1) for _ in range(2)]
        return draw.choice([parts[0] + parts[1], parts[0] * parts[1], parts[0] ** 2, log(parts[0] ** 2 + 1)])

    told = 0
    for expr in (made(draw.randint(1, 3)) for _ in range(400)):
        side = sign_by_parts(expr)
        told += side is not None
        assert side is None or (expr.is_positive, expr.is_negative) == (side == 1, side == -1), expr
        assert expr != 0 or not is_apart_from_zero(expr)
    assert told > 50
    hidden = (1 + x) ** 2 - 1 - 2 * x - x**2
    assert not is_apart_from_zero(hidden)
    assert not is_apart_from_zero(x * hidden)
    assert is_apart_from_zero(x - sqrt(2) * log(1 + x))
    for name in "xyzERLs":  # the logarithm of one, which is 1e-16 at some numbers
        symbol = Symbol(name, positive=True)
        one = (sqrt(symbol + 1) - 1) * (sqrt(symbol + 1) + 1) / symbol
        assert not is_apart_from_zero(symbol * log(one))
        assert is_zero(symbol * log(one))
    assert not is_apart_from_zero(n + 1)
    # of a sum that nearly cancels that is seen of which rounding is a small part; the rest is left to exact numbers
    assert is_apart_from_zero(log(1 + x) - log(1 + x * Rational(10**6 + 1, 10**6)))
    assert not is_apart_from_zero(log(1 + x) - log(1 + x * Rational(10**14 + 1, 10**14)))
    # each sum here loses three digits of the one within it, which is nothing but rounding, and six of them all
    for name in "xyzERLs":
        symbol = Symbol(name, positive=True)
        within = (sqrt(symbol + 1) - 1) * (sqrt(symbol + 1) + 1) - symbol
        for _ in range(6):
            within = (log(1 + within / 999 + symbol) - log(1 + symbol)) * 1000
        assert not is_apart_from_zero(within)
