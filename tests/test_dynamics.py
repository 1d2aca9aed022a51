"""The derived dynamics against the force balance itself, differentiated numerically in high precision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from invented_laws import GENERAL, layered
from invented_laws import LAWS as RESTRICTED
from sympy import Abs, Expr, Integer, Symbol, exp, expand, lambdify, log, sign, simplify, sqrt, tanh
from sympy.codegen.cfunctions import expm1, log1p

from softdyn.derive import ContactLaw, E, F, R, a, delta, eta, h
from softdyn.derive.dynamics import (
    RESTRICTION,
    C,
    D,
    F_a,
    F_adh,
    F_adh_delta,
    F_delta,
    F_h,
    a_delta,
    a_h,
    ddelta_dt,
    dF_dt,
    dh_dt,
    generic_dynamics,
    zeta,
)
from softdyn.derive.law import parameters_of
from softdyn.derive.law_dynamics import law_jacobians, law_quantities
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.soundness import cancelling_sums, sound, tidy

DIGITS = 60
#: Relative steps of central differences: errors of step**2 and of 10**-DIGITS/step.
STEP = "1e-15"
OUTER_STEP = "1e-10"
#: Of a difference, relative to the largest term: 1e-30; of one of a difference: 1e-20 (outer) and 1e-30/1e-10.
ONCE, TWICE = 1e-25, 1e-17

VALUES = {
    "R": "1.37",
    "E": "2.7",
    "eta": "0.9",
    "strength": "-0.003",
    "ell": "0.4",
    "tilt": "0.8",
    "rim": "0.3",
    "brush": "0.25",
    "thickness": "0.15",
    "softness": "0.7",
    "work": "0.013",
}
LAWS = {**RESTRICTED, **GENERAL}
#: (h, delta): every regime, both signs.
POINTS = (("1e-5", "0.02"), ("0.01", "3e-6"), ("30", "0.2"), ("0.4", "-0.3"), ("2e-4", "-0.05"), ("7", "-1e-7"))


@dataclass(frozen=True)
class Balance:
    """A law as functions of (h, delta) in mpmath, its parameters filled in: all that eq. 1 needs."""

    elastic: Callable[..., Any]
    remote: Callable[..., Any]
    friction: Callable[..., Any]
    radius: Callable[..., Any]
    parameters: tuple[Any, ...]

    def gap_rate(self, h: Any, delta: Any, F: Any) -> Any:
        """Return dh/dt: F = -zeta dh/dt + F_adh."""
        return -(F - self.remote(h, delta)) / self.friction(h, delta)

    def deflection(self, h: Any, F: Any, near: Any) -> Any:
        """Solve F_ela(a(h, delta), delta) = F for delta, close to a solution."""
        start = (near * (1 - mpmath.mpf("1e-9")), near * (1 + mpmath.mpf("1e-9")))
        return mpmath.findroot(
            lambda d: (self.elastic(h, d) - F) / F, start, solver="secant", tol=mpmath.mpf(10) ** -100
        )

    def deflection_rate(self, h: Any, delta: Any, F: Any, dF_dt: Any) -> Any:
        """Return d(delta)/dt such that F_ela follows F as h moves, from differences of F_ela."""
        by_h = difference(lambda x: self.elastic(x, delta), h, STEP)
        by_delta = difference(lambda x: self.elastic(h, x), delta, STEP)
        return (dF_dt - by_h * self.gap_rate(h, delta, F)) / by_delta


def difference(function: Callable[[Any], Any], x: Any, relative_step: str) -> Any:
    """Central difference."""
    step = abs(x) * mpmath.mpf(relative_step)
    return (function(x + step) - function(x - step)) / (2 * step)


@cache
def balance_of(name: str) -> Balance:
    """Return the balance of a law at :data:`VALUES`."""
    law = LAWS[name]
    with mpmath.workdps(DIGITS):
        numbers = {symbol: mpmath.mpf(VALUES[symbol.name]) for symbol in parameters_of(law)}

        def function(expr: Expr) -> Callable[..., Any]:
            return lambdify([h, delta], expr.subs(a, law.a).subs(numbers), "mpmath")

        parts = (function(expr) for expr in (law.F_ela, law.F_adh, law.zeta, law.a))
        return Balance(*parts, tuple(numbers.values()))


@cache
def derived(name: str) -> dict[str, Callable[..., Any]]:
    """Return the derived quantities as functions of (a, h, delta, F, dF_dt, parameters)."""
    law = LAWS[name]
    arguments = [a, h, delta, F, dF_dt, *parameters_of(law)]
    return {key: lambdify(arguments, expr, "mpmath") for key, expr in law_quantities(law).items()}


@cache
def derived_jacobians(name: str) -> dict[str, Callable[..., Any]]:
    """Return the Jacobians as functions of (a, h, delta, dh_dt, ddelta_dt, C, zeta, parameters)."""
    law = LAWS[name]
    arguments = [a, h, delta, dh_dt, ddelta_dt, C, zeta, *parameters_of(law)]
    return {state: lambdify(arguments, matrix.tolist(), "mpmath") for state, matrix in law_jacobians(law).items()}


def close(found: Any, expected: Any, tolerance: float, scale: Any = None) -> bool:
    """Whether two numbers agree relatively, or against a scale where the number itself may vanish."""
    return bool(abs(found - expected) <= tolerance * (abs(expected) if scale is None else scale))


def state_at(name: str, point: tuple[str, str]) -> tuple[Balance, Any, Any, Any, Any]:
    """Return a balance with h, delta, the F that they balance, and a dF_dt of the size of its other rates."""
    balance = balance_of(name)
    gap, deflection = mpmath.mpf(point[0]), mpmath.mpf(point[1])
    force = balance.elastic(gap, deflection)
    return balance, gap, deflection, force, force * balance.gap_rate(gap, deflection, force) / gap * mpmath.mpf("0.7")


# ---------------------------------------------------------------- for any law


def test_the_stiffness_and_the_friction_are_the_papers() -> None:
    """C = (F_a a_delta + F_delta)/2 and D = C zeta/(C + F_a a_h), derived for undefined functions."""
    generic = generic_dynamics()
    assert generic.stiffness == (F_a * a_delta + F_delta) / 2
    assert generic.friction == C * zeta / (C + F_a * a_h)


def test_the_gap_dynamics_is_eq_7_and_the_centre_dynamics_eq_9() -> None:
    generic = generic_dynamics()
    assert simplify(generic.dh_dt + (F - F_adh) / zeta) == 0
    assert simplify(generic.dX_dt + dF_dt / C + (F - F_adh) / D) == 0
    # eq. 2 differentiated: dX/dt = dh/dt - 2 d(delta)/dt
    by_parts = generic.dh_dt - 2 * generic.ddelta_dt.subs(dh_dt, generic.dh_dt)
    explicit = generic.dX_dt.subs(D, generic.friction).subs(C, generic.stiffness)
    assert simplify(expand(by_parts - explicit)) == 0


def test_the_paper_is_a_special_case_of_the_general_law() -> None:
    """F_ela(a, delta, h) and F_adh(a, h, delta): eq. 9 is what is left where F_h and F_adh_delta vanish."""
    general, special = generic_dynamics(general=True), generic_dynamics()
    assert simplify(general.friction - C * zeta / (C + F_a * a_h + F_h)) == 0
    for name in (
        "by_gap",
        "stiffness",
        "friction",
        "remote_along",
        "dh_dt",
        "ddelta_dt",
        "dX_dt",
        "lambda1",
        "lambda2",
    ):
        assert simplify(getattr(general, name).subs(RESTRICTION) - getattr(special, name)) == 0, name
    for state, jacobian in general.jacobians.items():
        assert simplify(jacobian.subs(RESTRICTION) - special.jacobians[state]).is_zero_matrix, state
    # and nothing of it vanishes without them
    assert general.ddelta_dt.has(F_h)
    assert general.lambda2.has(F_adh_delta)


def test_every_step_of_the_derivation_is_an_equation_that_is_kept() -> None:
    steps = generic_dynamics().steps
    assert [what for what, _ in steps][:2] == ["force balance, viscous part", "solved for dh/dt (eq. 7)"]
    viscous, solved = steps[0][1], steps[1][1]
    assert simplify(viscous.rhs.subs(solved.lhs, solved.rhs) - viscous.lhs) == 0


# ---------------------------------------------------------------- for a law


@pytest.mark.parametrize("point", POINTS, ids=lambda p: f"h={p[0]},delta={p[1]}")
@pytest.mark.parametrize("name", list(LAWS))
class TestRates:
    """Each derived quantity against the force balance, moved a little."""

    def quantities(self, name: str, point: tuple[str, str]) -> tuple[Any, ...]:
        """Return the state and a function for the value of each derived quantity there."""
        balance, gap, deflection, force, force_rate = state_at(name, point)
        arguments = (balance.radius(gap, deflection), gap, deflection, force, force_rate, *balance.parameters)
        return balance, gap, deflection, force, force_rate, lambda key: derived(name)[key](*arguments)

    def test_the_gap_closes_as_the_viscous_force_says(self, name: str, point: tuple[str, str]) -> None:
        with mpmath.workdps(DIGITS):
            balance, gap, deflection, force, _, value = self.quantities(name, point)
            remote = balance.remote(gap, deflection)
            viscous = -balance.friction(gap, deflection) * value("dh_dt")
            assert close(viscous + remote, force, 1e-50, abs(force) + abs(remote))
            assert close(value("F_ela"), force, 1e-50)
            assert close(value("a"), balance.radius(gap, deflection), 1e-50)

    def test_the_deflection_follows_gap_and_force(self, name: str, point: tuple[str, str]) -> None:
        """The force balance is solved anew an instant before and after."""
        with mpmath.workdps(DIGITS):
            balance, gap, deflection, force, force_rate, value = self.quantities(name, point)
            gap_rate = balance.gap_rate(gap, deflection, force)
            instant = mpmath.mpf(STEP) * abs(gap / gap_rate)
            before, after = (
                balance.deflection(gap + s * instant * gap_rate, force + s * instant * force_rate, deflection)
                for s in (-1, 1)
            )
            rate = (after - before) / (2 * instant)
            scale = abs(deflection / instant) * mpmath.mpf(STEP)
            assert close(value("ddelta_dt"), rate, ONCE, abs(rate) + scale)
            # eq. 2 at both instants
            centre_rate = gap_rate - 2 * rate
            assert close(value("dX_dt"), centre_rate, ONCE, abs(gap_rate) + 2 * abs(rate) + scale)

    def test_the_stiffness_is_that_of_the_centre_distance(self, name: str, point: tuple[str, str]) -> None:
        """At fixed h, dX = -2 d(delta): C = -dF/dX."""
        with mpmath.workdps(DIGITS):
            balance, gap, deflection, _, _, value = self.quantities(name, point)
            assert close(value("C"), difference(lambda d: balance.elastic(gap, d), deflection, STEP) / 2, ONCE)

    def test_the_friction_D_is_that_of_the_centre_distance(self, name: str, point: tuple[str, str]) -> None:
        """At constant force, F - F_adh = -D dX/dt."""
        with mpmath.workdps(DIGITS):
            balance, gap, deflection, force, _, value = self.quantities(name, point)
            rate = balance.deflection_rate(gap, deflection, force, 0)
            centre_rate = balance.gap_rate(gap, deflection, force) - 2 * rate
            assert close(value("D") * centre_rate, -(force - balance.remote(gap, deflection)), 1e3 * ONCE)

    def test_the_local_exponents_are_slopes_at_constant_force(self, name: str, point: tuple[str, str]) -> None:
        """lambda1 = dln(delta)/dln(h) and lambda2 = dln(-dh/dt)/dln(h), delta solved for at each h."""
        with mpmath.workdps(DIGITS):
            balance, gap, deflection, force, _, value = self.quantities(name, point)

            def along(x: Any) -> tuple[Any, Any]:
                moved = balance.deflection(x, force, deflection)
                return mpmath.log(abs(moved)), mpmath.log(abs(balance.gap_rate(x, moved, force)))

            step = gap * mpmath.mpf(STEP)
            before, after = along(gap - step), along(gap + step)
            slopes = [(y - x) / (2 * mpmath.mpf(STEP)) for x, y in zip(before, after, strict=True)]
            assert close(value("lambda1"), slopes[0], ONCE, 1 + abs(slopes[0]) ** 3)
            assert close(value("lambda2"), slopes[1], ONCE, 1 + abs(slopes[1]))

    def test_every_entry_of_the_jacobians(self, name: str, point: tuple[str, str]) -> None:
        """By the state, at given F and dF/dt."""
        with mpmath.workdps(DIGITS):
            balance, gap, deflection, force, force_rate, value = self.quantities(name, point)

            def rates(x: Any, d: Any) -> tuple[Any, Any]:
                return balance.gap_rate(x, d, force), balance.deflection_rate(x, d, force, force_rate)

            def by(function: Callable[[Any, Any], Any]) -> tuple[Any, Any]:
                return (
                    difference(lambda x: function(x, deflection), gap, OUTER_STEP),
                    difference(lambda d: function(gap, d), deflection, OUTER_STEP),
                )

            now = rates(gap, deflection)
            arguments = (balance.radius(gap, deflection), gap, deflection, *now, value("C"), value("zeta"))
            found = {state: f(*arguments, *balance.parameters) for state, f in derived_jacobians(name).items()}

            dh_by, ddelta_by = by(lambda x, d: rates(x, d)[0]), by(lambda x, d: rates(x, d)[1])
            log_by = by(lambda x, d: rates(x, d)[0] / x)
            expected = {
                "h, delta": [[*dh_by], [*ddelta_by]],
                # d/d(ln h) = h d/dh
                "ln h, delta": [[gap * log_by[0], log_by[1]], [gap * ddelta_by[0], ddelta_by[1]]],
            }
            for state, matrix in expected.items():
                for i, row in enumerate(matrix):
                    for j, entry in enumerate(row):
                        size = abs(now[i]) / (1, abs(deflection))[j] / ((gap if state == "h, delta" else 1), 1)[j]
                        if state != "h, delta" and i == 0:
                            size /= gap
                        assert close(found[state][i][j], entry, TWICE, abs(entry) + size), (state, i, j)

            def alone(x: Any) -> Any:
                return balance.gap_rate(x, balance.deflection(x, force, deflection), force) / x

            entry = gap * difference(alone, gap, OUTER_STEP)
            ((single,),) = found["ln h, delta from the force balance"]
            assert close(single, entry, TWICE, abs(entry) + abs(now[0] / gap))


def test_the_law_of_the_paper_has_the_exponents_of_its_table() -> None:
    """lambda1 = 0, -1/2, 0 and lambda2 = 0, 1, 3 in Stokes, Poiseuille and Hertz; corrections are 1e-10."""
    with mpmath.workdps(40):
        p = [mpmath.mpf(1)] * 3
        for gap, deflection, first, second in (
            ("1e12", "1e-12", 0, 0),
            ("1e-10", "1e-20", mpmath.mpf(-1) / 2, 1),
            ("1e-20", "1e-10", 0, 3),
        ):
            x, d = mpmath.mpf(gap), mpmath.mpf(deflection)
            radius = balance_free_radius(x, d)
            arguments = (radius, x, d, mpmath.mpf(1), mpmath.mpf(0), *p)
            assert derived("rognon_gay")["lambda1"](*arguments) == pytest.approx(first, abs=1e-9)
            assert derived("rognon_gay")["lambda2"](*arguments) == pytest.approx(second, abs=1e-9)


def balance_free_radius(x: Any, d: Any) -> Any:
    """Return a of the paper, for R = 1."""
    return mpmath.sqrt(2 * (x / (1 + x) + abs(d)))


@pytest.mark.parametrize("name", [*RESTRICTED, layered.name])
def test_nothing_is_0_over_0_without_deflection(name: str) -> None:
    """Every quantity has a value at delta = 0, its limit from either side."""
    balance = balance_of(name)
    with mpmath.workdps(DIGITS):
        gap = mpmath.mpf("0.3")

        def at(d: Any) -> dict[str, Any]:
            arguments = (balance.radius(gap, d), gap, d, mpmath.mpf("0.1"), mpmath.mpf("0.2"), *balance.parameters)
            return {key: function(*arguments) for key, function in derived(name).items()}

        middle, sides = at(mpmath.mpf(0)), [at(mpmath.mpf(d)) for d in ("1e-30", "-1e-30")]
        for key, value in middle.items():
            for side in sides:
                assert mpmath.isfinite(value), key
                assert close(side[key], value, 1e-27, 1 + abs(value)), key


# ---------------------------------------------------------------- sound forms

POSITIVE = (R, h, a, eta)


def trees(signed: bool) -> st.SearchStrategy[Expr]:
    """Random expressions in R, h, a, eta > 0 and, if signed, delta; without poles for positive lengths."""
    leaves: st.SearchStrategy[Expr] = st.sampled_from(POSITIVE) | st.integers(1, 3).map(Integer)
    if signed:
        leaves = leaves | st.sampled_from((delta, Abs(delta), sign(delta)))

    def larger(inner: st.SearchStrategy[Expr]) -> st.SearchStrategy[Expr]:
        pairs = st.tuples(inner, inner)
        positive = st.recursive(
            st.sampled_from(POSITIVE), lambda x: st.tuples(x, x).map(lambda p: p[0] + p[1]), max_leaves=3
        )
        return st.one_of(
            pairs.map(lambda p: p[0] + p[1]),
            pairs.map(lambda p: p[0] - p[1]),
            pairs.map(lambda p: p[0] * p[1]),
            st.tuples(inner, positive).map(lambda p: p[0] / p[1]),
            st.tuples(inner, positive).map(lambda p: p[0] * sqrt(p[1])),
            st.tuples(inner, positive).map(lambda p: p[0] / p[1] ** 2),
        )

    return st.recursive(leaves, larger, max_leaves=7)


def value_at(expr: Expr, point: dict[Symbol, Any]) -> Any:
    """Evaluate in 50 digits, with the size of the largest of its terms."""
    symbols = list(point)
    return lambdify(symbols, expr, "mpmath")(*point.values())


def points() -> st.SearchStrategy[dict[Symbol, Any]]:
    """Random values of all symbols, over ten decades and both signs of delta."""
    decades = st.floats(-5, 5)
    return st.tuples(decades, decades, decades, decades, decades, st.sampled_from((-1, 1))).map(
        lambda t: {
            **{symbol: mpmath.mpf(10) ** x for symbol, x in zip(POSITIVE, t[:4], strict=True)},
            delta: t[5] * mpmath.mpf(10) ** t[4],
        }
    )


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(trees(signed=True), points())
def test_a_sound_form_is_the_same_expression(expr: Expr, point: dict[Symbol, Any]) -> None:
    with mpmath.workdps(120):
        # terms span up to 10**(5*14); what is left of 120 digits after cancelling is far more than 1e-20
        before, after = value_at(expr, point), value_at(sound(expr), point)
        assert abs(after - before) <= mpmath.mpf("1e-20") * (abs(before) + mpmath.mpf("1e-25"))


@settings(max_examples=60, deadline=None)
@given(trees(signed=True))
def test_a_sound_form_never_cancels_more(expr: Expr) -> None:
    assert cancelling_sums(sound(expr)) <= cancelling_sums(tidy(expr))


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(trees(signed=False), st.sampled_from((R, h, a)))
def test_of_two_forms_of_a_derivative_the_value_is_one(expr: Expr, variable: Symbol) -> None:
    assume(expr.has(variable))
    derivative = expr.diff(variable)
    point = dict.fromkeys(POSITIVE, mpmath.mpf(1)) | {R: mpmath.mpf(3) / 7, h: mpmath.mpf(11) / 5, delta: mpmath.mpf(1)}
    with mpmath.workdps(60):
        found = value_at(sound(derivative, derivative.expand()), point)
        assert abs(found - value_at(derivative, point)) <= mpmath.mpf(10) ** -50 * (1 + abs(found))


def test_the_slope_of_the_smaller_of_gap_and_radius_does_not_cancel() -> None:
    """d/dh R h/(R + h) is R/(R + h) - R h/(R + h)^2 as it comes, and R^2/(R + h)^2 in fact."""
    plain = (R * h / (R + h)).diff(h)
    form = sound(plain)
    assert form == R**2 / (R + h) ** 2
    far = np.geomspace(1e3, 1e12, 200)
    with mpmath.workdps(50):
        exact = [1 / (1 + mpmath.mpf(x)) ** 2 for x in far.tolist()]
    errors = {}
    for name, expr in (("plain", plain), ("sound", form)):
        values = lambdify([R, h], expr, "numpy")(1.0, far)
        with mpmath.workdps(50):
            errors[name] = max(float(abs(v / e - 1)) for v, e in zip(values.tolist(), exact, strict=True))
    # R + h and its square round three times, the quotient once; the difference of two near 1/h loses h/R digits
    assert errors["sound"] <= 4 * 2**-53
    assert errors["plain"] > 1e-5


def test_differences_that_cancel_at_small_arguments_are_library_functions() -> None:
    assert sound(exp(h / R) - 1) == expm1(h / R)
    assert sound(log(1 + h / R)) == log1p(h / R)


def test_the_slope_of_a_saturating_function_does_not_cancel() -> None:
    """The slope of tanh(x), 1 - tanh(x)^2, is 1/cosh(x)^2: at x = 20 the difference has no digit left."""
    value = lambdify([h, R], sound(tanh(h / R).diff(h)), "math")(20.0, 1.0)
    with mpmath.workdps(40):
        expected = float(1 / mpmath.cosh(20) ** 2)
    # cosh errs by a unit, its square by two more, the quotient by one
    assert value == pytest.approx(expected, rel=4 * 2**-52)


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (delta * sign(delta), Abs(delta)),
        (Abs(delta) * sign(delta), delta),
        (E * delta**2 * sign(delta), E * delta * Abs(delta)),
        (sign(delta) ** 2 * delta, sign(delta) * Abs(delta)),
        (R * sign(delta), R * sign(delta)),
    ],
)
def test_signs_are_merged(expr: Expr, expected: Expr) -> None:
    found = tidy(expr)
    for side in (-2, 2, 0):
        assert (found - expected).subs(delta, side) == 0
    assert found.count_ops() <= expr.count_ops()


def test_a_law_without_deflection_dependence_has_none() -> None:
    """With a independent of delta, F_a a_delta drops out of C altogether."""
    law = ContactLaw("disc", a=sqrt(R * h), F_ela=E * a * delta, zeta=eta * R**2 / h)
    assert law_quantities(law)["C"] == E * a / 2
    assert law_quantities(rognon_gay)["C"].has(Abs)
