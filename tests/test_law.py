"""A faulty law is refused with every fault at once, each named with what is allowed; a sound one is taken as it is."""

from __future__ import annotations

import re
from typing import Any

import mpmath
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from invented_laws import LAWS
from sympy import (
    Abs,
    Float,
    Function,
    I,
    Interval,
    Max,
    Min,
    Piecewise,
    Rational,
    Symbol,
    besselj,
    exp,
    log,
    oo,
    sqrt,
    zoo,
)

from softdyn.derive import (
    DIMENSIONLESS,
    FORCE,
    LENGTH,
    PRESSURE,
    TIME,
    ContactLaw,
    Dimension,
    E,
    F,
    Limit,
    R,
    a,
    delta,
    eta,
    h,
    kappa,
)
from softdyn.derive.law import law_hash, parameters_of, plain_ranges
from softdyn.errors import LawError

hbar = R * h / (R + h)
GOOD: dict[str, Any] = {
    "name": "trial",
    "a": hbar + Abs(delta),
    "F_ela": E * a * delta,
    "zeta": eta * R**2 / h,
}
sigma = Symbol("sigma", positive=True)
q = Symbol("q", positive=True)
number = Symbol("q", real=True)


def law_with(**changes: Any) -> ContactLaw:
    """Return a sound law with some of its parts replaced."""
    return ContactLaw(**{**GOOD, **changes})


def faults(**changes: Any) -> tuple[str, ...]:
    """Return what is said of a law that must be refused."""
    with pytest.raises(LawError) as refused:
        law_with(**changes)
    assert all(fault in str(refused.value) for fault in refused.value.faults)
    return refused.value.faults


def the_fault(**changes: Any) -> str:
    """Return the one fault of a law."""
    (fault,) = faults(**changes)
    return fault


# ---------------------------------------------------------------- arguments


RESTRICTED = "; that is the paper's restriction, which a law with general=True lifts"


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        (
            {"zeta": eta * R * (1 + delta**2 / R**2)},
            "zeta(a, h): symbol 'delta' is not allowed here: the friction depends on the deflection through a only; "
            "allowed: a, h, R, E, eta",
        ),
        (
            {"zeta": eta * R * (1 + eta * Symbol("dh_dt", real=True) / (E * R))},
            "zeta(a, h): symbol 'dh_dt' is not allowed here: the viscous force must be linear in dh/dt (eq. 1), so "
            "zeta cannot depend on it; allowed: a, h, R, E, eta",
        ),
        ({"a": a + h}, "a(h, delta): symbol 'a' is not allowed here; allowed: h, delta, R, E, eta"),
        (
            {"F_ela": E * h * delta},
            "F_ela(a, delta): symbol 'h' is not allowed here; allowed: a, delta, R, E, eta" + RESTRICTED,
        ),
        (
            {"F_adh": E * R * delta},
            "F_adh(a, h): symbol 'delta' is not allowed here; allowed: a, h, R, E, eta" + RESTRICTED,
        ),
        ({"zeta": eta * F / (E * R)}, "zeta(a, h): symbol 'F' is not allowed here; allowed: a, h, R, E, eta"),
    ],
    ids=["zeta of delta", "zeta of dh_dt", "a of a", "F_ela of h", "F_adh of delta", "zeta of F"],
)
def test_an_expression_of_the_wrong_argument_is_refused(changes: dict[str, Any], fault: str) -> None:
    assert the_fault(**changes) == fault


@pytest.mark.parametrize("name", ["dh_dt", "hdot", "h_dot", "dhdt", "v", "velocity", "rate"])
def test_a_friction_of_the_velocity_is_told_why(name: str) -> None:
    """Eq. 1 is solved for dh/dt in one step only because the viscous force is linear in it."""
    assert "must be linear in dh/dt" in the_fault(zeta=eta * R * (1 + Symbol(name) * eta / (E * R)))


@pytest.mark.parametrize(
    ("typed", "meant"), [("dleta", "delta"), ("Eta", "eta"), ("sigm", "sigma"), ("deltta", "delta")]
)
def test_a_misspelt_symbol_gets_the_likely_spelling(typed: str, meant: str) -> None:
    fault = the_fault(F_ela=E * a * delta + E * R * Symbol(typed, positive=True), parameters={sigma: LENGTH})
    assert fault.endswith(f"allowed: a, delta, R, E, eta, sigma; did you mean {meant!r}?")


def test_an_unknown_symbol_is_a_parameter_to_declare() -> None:
    assert the_fault(F_ela=E * a * delta * q).endswith("declare it in parameters={symbol: dimension}")


@pytest.mark.parametrize("assumptions", [{}, {"real": True}, {"negative": True}])
def test_another_symbol_that_looks_like_the_papers_is_told_apart(assumptions: dict[str, bool]) -> None:
    """Sympy prints both as R; only their assumptions differ."""
    assert the_fault(a=Symbol("R", **assumptions) + h) == (
        "a: this 'R' is another symbol than softdyn's (its assumptions differ); use 'from softdyn.derive import R'"
    )


def test_another_symbol_that_looks_like_a_parameter_is_told_apart() -> None:
    assert the_fault(F_adh=Symbol("sigma") * R, parameters={sigma: FORCE / LENGTH}) == (
        "F_adh: this 'sigma' has other assumptions than the one declared in parameters"
    )


# ---------------------------------------------------------------- dimensions


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"a": R * h}, "a: R*h has the dimension L^2; length is expected"),
        ({"F_ela": E * delta}, "F_ela: E*delta has the dimension M T^-2; force is expected"),
        ({"zeta": eta}, "zeta: eta has the dimension viscosity; friction (force/velocity) is expected"),
        ({"F_adh": E}, "F_adh: E has the dimension pressure; force is expected"),
        ({"F_adh": 1}, "F_adh: 1 has the dimension dimensionless; force is expected"),
        ({"a": R + h**2}, "a: R + h**2 combines R (length) with h**2 (L^2)"),
        ({"a": sqrt(R) * h}, "a: sqrt(R)*h has the dimension L^(3/2); length is expected"),
        ({"F_adh": E * R**2 * exp(-h)}, "F_adh: the argument of exp(-h) must be dimensionless; -h is a length"),
        ({"F_adh": E * R**2 * log(h)}, "F_adh: the argument of log(h) must be dimensionless; h is a length"),
        (
            {"F_adh": E * R**2 * Piecewise((1, h < R**2), (0, True))},
            "F_adh: h < R**2 combines h (length) with R**2 (L^2)",
        ),
        (
            {"F_adh": E * R**2 * (h / R) ** (h**2 / R)},
            "F_adh: the exponent of (h/R)**(h**2/R) must be dimensionless; h**2/R is a length",
        ),
    ],
    ids=lambda value: None if isinstance(value, str) else next(iter(value)),
)
def test_a_wrong_dimension_is_named(changes: dict[str, Any], fault: str) -> None:
    assert the_fault(**changes) == fault


def test_eulers_number_for_the_modulus_is_recognised() -> None:
    """``from sympy import *`` after softdyn's import replaces the modulus by 2.718..., unnoticed otherwise."""
    assert the_fault(F_ela=sympy.E * a * delta) == (
        "F_ela: E*a*delta has the dimension L^2; force is expected; "
        "its E is Euler's number: import E from softdyn.derive"
    )


@given(st.fractions(-4, 4), st.fractions(-4, 4), st.fractions(-4, 4), st.fractions(-3, 3))
def test_dimensions_are_a_vector_space(mass: Any, length: Any, time: Any, power: Any) -> None:
    one = Dimension(mass, length, time)
    assert one / one == DIMENSIONLESS
    assert (one**power) ** 2 == one ** (2 * power)
    assert (one * LENGTH) / LENGTH == one
    assert one**0 == DIMENSIONLESS


def test_a_parameter_carries_its_dimension_into_the_check() -> None:
    tension = Symbol("tension", positive=True)
    assert law_with(F_adh=-tension * R, parameters={tension: FORCE / LENGTH}).F_adh == -tension * R
    assert the_fault(F_adh=-tension * R, parameters={tension: PRESSURE}) == (
        "F_adh: -R*tension has the dimension M T^-2; force is expected"
    )


# ---------------------------------------------------------------- numbers and functions


@pytest.mark.parametrize(
    ("number", "exact"), [(0.5, "1, 2"), (0.4444, "1111, 2500"), (1e-3, "1, 1000"), (Float("0.1", 30), "1, 10")]
)
def test_an_inexact_constant_is_refused_with_the_exact_one(number: Any, exact: str) -> None:
    fault = the_fault(F_ela=number * E * a * delta)
    assert fault.startswith("F_ela: ")
    assert fault.endswith(f"is inexact; numbers stay exact in a law: write Rational({exact})")
    p, q_ = (int(part) for part in exact.split(", "))
    law_with(F_ela=Rational(p, q_) * E * a * delta)


@pytest.mark.slow
@given(st.floats(1e-6, 1e6))
def test_the_rational_proposed_is_the_number_meant(number: float) -> None:
    found = re.search(r"write Rational\((-?\d+), (\d+)\)", the_fault(F_ela=number * E * a * delta))
    assert found is not None
    # sympy shows 15 digits of a Float: what it shows is what is proposed
    assert int(found[1]) / int(found[2]) == pytest.approx(number, rel=1e-14)


@pytest.mark.parametrize(
    ("wrong", "shown"),
    [
        (besselj(3, delta / R), "besselj(3, delta/R)"),
        (sympy.DiracDelta(delta), "DiracDelta(delta)"),
        (sympy.floor(delta / R), "floor(delta/R)"),
        (sympy.Integral(q**2, (q, 0, delta / R)), "Integral(q**2, (q, 0, delta/R))"),
        (I * delta / R, "I"),
        (zoo, "zoo"),
        (sympy.nan, "nan"),
        (-oo, "-oo"),
    ],
)
def test_a_function_or_value_that_no_target_prints_is_refused_with_those_that_are(wrong: Any, shown: str) -> None:
    fault = next(fault for fault in faults(F_ela=E * R**2 * wrong) if "no target can print" in fault)
    assert fault.startswith(f"F_ela: no target can print {shown}; allowed functions: sqrt, Abs, sign, exp")


def test_a_function_that_resembles_a_printable_one_is_suggested() -> None:
    assert the_fault(F_adh=E * R**2 * sympy.sinc(h / R)).endswith("did you mean sin?")


def test_an_undefined_function_is_refused() -> None:
    assert the_fault(F_ela=Function("g")(delta / R) * E * R**2) == (
        "F_ela: g(delta/R) is an undefined function; write it out, or declare a parameter"
    )


@pytest.mark.parametrize(
    ("wrong", "kind"), [(0.0, "float"), (None, "NoneType"), ("E*a*delta", "str"), (h > R, "StrictGreaterThan")]
)
def test_what_is_no_expression_is_refused_by_its_type(wrong: Any, kind: str) -> None:
    assert the_fault(F_adh=wrong) == f"F_adh = {wrong!r} is a {kind}, not a sympy expression"


def test_what_is_no_tangential_part_is_refused_by_its_type() -> None:
    assert the_fault(tangential=3) == "tangential = 3 is a int, not a Tangential(sliding=..., k_t=...)"


# ---------------------------------------------------------------- parameters, names, limits


def test_a_parameter_that_may_be_complex_is_refused() -> None:
    bare = Symbol("q")
    assert the_fault(F_adh=bare, parameters={bare: FORCE}) == (
        "parameters: 'q' may be complex as declared; write Symbol('q', positive=True), "
        "or real=True if it may be negative"
    )


@pytest.mark.parametrize("wrong", ["sigma", 2 * sigma, 3])
def test_a_parameter_that_is_no_symbol_is_refused(wrong: Any) -> None:
    assert the_fault(parameters={wrong: FORCE}).startswith(f"parameters: {wrong!r} is not a symbol; write Symbol(")


def test_a_dimension_that_is_none_is_refused() -> None:
    """A plain number is easily taken for "dimensionless"."""
    assert "sigma" in the_fault(F_adh=E * R**2 * sigma, parameters={sigma: 1})


@pytest.mark.parametrize("name", ["R", "E", "eta", "h", "delta", "a", "F"])
def test_the_papers_symbols_cannot_be_declared_anew(name: str) -> None:
    own = Symbol(name, positive=True, integer=True)
    assert the_fault(parameters={own: FORCE}) == (
        f"parameters: {name!r} is one of the paper's symbols; choose another name for one of your own"
    )


@pytest.mark.parametrize("name", ["my par", "2x", "", "a-b", "k'", "h/R"])
def test_a_parameter_is_named_by_an_identifier(name: str) -> None:
    fault = the_fault(parameters={Symbol(name, positive=True): LENGTH})
    assert fault == f"parameters: {name!r} is no identifier: letters, digits and _, no digit first"


@pytest.mark.parametrize(
    ("name", "meaning"),
    [("kappa", "F/(E R^2)"), ("size_ratio", "of a pair"), ("force", "sweeps"), ("velocity", "sweeps")],
)
def test_a_parameter_has_no_name_that_means_something_else_beside_it(name: str, meaning: str) -> None:
    assert meaning in the_fault(parameters={Symbol(name, positive=True): LENGTH})


def test_a_parameter_is_declared_once() -> None:
    twice = {Symbol("w", positive=True): LENGTH, Symbol("w", real=True): LENGTH}
    assert the_fault(parameters=twice) == "parameters: 'w' is there 2 times, with different assumptions"


@pytest.mark.parametrize("name", ["", "Big", "two words", "é", "9lives", "_x", "a-b", "a" * 80, 3, None])
def test_a_law_is_named_by_an_identifier(name: Any) -> None:
    assert the_fault(name=name) == (
        f"name {name!r} must be a lower-case identifier: it names the generated files and functions"
    )


@pytest.mark.parametrize(
    "bounds",
    [(2, 1), (1, 1), (0, 1, 2), (1, oo), (1, float("inf")), (float("nan"), 1), (0, sigma), ("0", "1"), 3, None,
     Interval(1, oo), Interval(2, 1)],
    ids=str,
)  # fmt: skip
@pytest.mark.parametrize("typical", [{}, {sigma: 3}])
def test_a_range_must_be_one(bounds: Any, typical: Any) -> None:
    assert the_fault(parameters={sigma: DIMENSIONLESS}, ranges={sigma: bounds}, typical=typical) == (
        f"ranges: sigma needs (low, high), finite numbers with low < high, or an Interval of such, not {bounds}"
    )


def test_a_range_may_hold_its_ends() -> None:
    """1 - q is positive at q = 0, and nowhere beyond q = 1: only an end that is left out may be where it vanishes."""
    changes = {"zeta": eta * R * (1 - number), "parameters": {number: DIMENSIONLESS}}
    law = law_with(**changes, ranges={number: Interval.Ropen(0, 1)}, typical={number: Rational(1, 10**6)})
    assert plain_ranges(law) == {"q": [0.0, 1.0, False, True]}
    assert law_hash(law) != law_hash(law_with(**changes, ranges={number: (0, 1)}))
    assert witness_of(the_fault(**changes, ranges={number: Interval(0, 1)}))["q"] == 1
    assert the_fault(**changes, ranges={number: Interval.Ropen(0, 1)}, typical={number: 1}) == (
        "typical: q = 1 lies outside its range"
    )


def test_a_typical_value_has_an_order_of_magnitude() -> None:
    assert the_fault(parameters={number: DIMENSIONLESS}, typical={number: 0}) == (
        "typical: q = 0 has no order of magnitude; leave it out, or give a number that is small"
    )


def test_a_range_of_no_parameter_is_refused() -> None:
    assert the_fault(ranges={sigma: (0, 1)}) == "ranges: sigma is not among the law's own parameters"


def limited(order: Any = (h, delta, R), **claims: Any) -> tuple[Limit, ...]:
    """Return the limits of a law that claims one thing."""
    return (Limit("Hertz", order, claims),)


@pytest.mark.parametrize(
    ("limits", "fault"),
    [
        (
            limited((h,), a=R),
            "limit 'Hertz': order must hold sizes, from smallest to largest, such as (h, delta, R), not (h,): "
            "products of powers of h, delta (-delta in tension), F, R and the parameters, exponentials, logarithms",
        ),
        (
            limited((h, R + delta), a=R),
            "limit 'Hertz': order must hold sizes, from smallest to largest, such as (h, delta, R), not [R + delta]: "
            "products of powers of h, delta (-delta in tension), F, R and the parameters, exponentials, logarithms",
        ),
        (
            limited((h, h**q), a=R),
            "limit 'Hertz': order must hold sizes, from smallest to largest, such as (h, delta, R), not [h**q]: "
            "products of powers of h, delta (-delta in tension), F, R and the parameters, exponentials, logarithms",
        ),
        (
            limited(((h, delta, R), (a, R)), a=R),
            "limit 'Hertz': order must hold sizes, from smallest to largest, such as (h, delta, R), not [a]: "
            "products of powers of h, delta (-delta in tension), F, R and the parameters, exponentials, logarithms",
        ),
        (
            limited(3, a=R),
            "limit 'Hertz': order must hold sizes, from smallest to largest, such as (h, delta, R), not 3: "
            "products of powers of h, delta (-delta in tension), F, R and the parameters, exponentials, logarithms",
        ),
        (
            limited((h, delta, -R), a=R),
            "limit 'Hertz': order holds sizes, which are positive on one side, of compression or tension; "
            "(h, delta, -R) is not",
        ),
        (
            limited(((h, delta), (-F, E * R**2)), a=R),
            "limit 'Hertz': order holds sizes, which are positive on one side, of compression or tension; "
            "((h, delta), (-F, E*R**2)) is not",
        ),
        (
            limited((R, 2 * R), a=R),
            "limit 'Hertz': order must say how h and delta compare, as in (h, delta, R); (R, 2*R) does not",
        ),
        (limited(((h, delta), (F, R)), a=R), "limit 'Hertz': order compares force with length in (F, R)"),
        (
            limited(zetta=eta * R),
            "limit 'Hertz': cannot claim 'zetta'; one can claim a, zeta, delta, F, F_ela, F_adh, C, D, dh_dt, dX_dt; "
            "did you mean 'zeta'?",
        ),
        (limited(zeta=eta * q), "limit 'Hertz', zeta: unknown symbol q"),
        (limited(zeta=eta * a), "limit 'Hertz', zeta: unknown symbol a"),
    ],
)
def test_a_claim_that_cannot_be_checked_is_refused(limits: Any, fault: str) -> None:
    assert the_fault(limits=limits) == fault


@pytest.mark.parametrize(
    ("value", "fault"),
    [
        (R / 1000, None),
        (R, None),
        (sqrt(2) * R, "typical: q = sqrt(2)*R must be an exact number times powers of R, E and eta"),
        (R + E, "typical: q = E + R must be an exact number times powers of R, E and eta"),
        (0.1 * R, "typical: q = 0.1*R must be an exact number times powers of R, E and eta"),
        (h, "typical: q = h must be an exact number times powers of R, E and eta"),
        ("R", "typical: q = R must be an exact number times powers of R, E and eta"),
        (E, "typical: q = E has the dimension pressure; length is expected"),
        (-R, "typical: q = -R lies outside its range"),
        (0, "typical: q = 0 lies outside its range"),
        (3 * R, "typical: q = 3*R lies outside its range"),
    ],
    ids=str,
)
def test_a_typical_value_is_a_number_of_the_right_kind(value: Any, fault: str | None) -> None:
    changes = {"parameters": {q: LENGTH}, "ranges": {q: (0, 3)}, "typical": {q: value}}
    if fault is None:
        assert law_with(**changes).typical == {q: value}
    else:
        assert the_fault(**changes) == fault


def test_a_typical_value_of_no_parameter_is_refused() -> None:
    assert the_fault(typical={sigma: R}) == "typical: sigma is not among the law's own parameters"


def test_a_claim_of_nothing_is_a_claim() -> None:
    """F_adh = 0 is written as the number that it is."""
    assert law_with(limits=limited(F_adh=0)).limits[0].claims["F_adh"] == 0


def test_the_size_of_a_tension_is_written_with_a_sign() -> None:
    law = law_with(limits=limited((h, -delta, R), a=sqrt(-2 * R * delta)))
    assert law.limits[0].order == (h, -delta, R)


# ---------------------------------------------------------------- positivity


def witness_of(fault: str) -> dict[str, mpmath.mpf]:
    """Return the point at which a fault says that a quantity is not positive."""
    point = re.search(r"but at (.*?) \(R = E = eta = 1\)", fault)
    assert point is not None, fault
    return {name: mpmath.mpf(value) for name, value in (part.split("=") for part in point[1].split(", "))}


@pytest.mark.parametrize(
    ("quantity", "changes"),
    [
        ("C", {"F_ela": -E * a * delta}),
        ("C", {"F_ela": E * delta**2}),
        ("C", {"F_ela": E * a * delta - 2 * E * delta**2}),
        ("C", {"F_ela": E * R * delta * (1 - 3 * delta**2 / R**2)}),
        ("zeta", {"zeta": eta * R * (1 - h / R)}),
        ("zeta", {"zeta": -eta * R}),
        ("zeta", {"zeta": eta * R * (1 - q), "parameters": {q: DIMENSIONLESS}}),
        ("zeta", {"zeta": eta * R * log(h / R)}),
        ("a", {"a": R - h, "F_ela": E * R * delta}),
        ("a", {"a": sqrt(2 * R * (hbar + delta)), "F_ela": E * R * delta}),
    ],
    ids=[
        "pulls when pushed",
        "quadratic force",
        "softens",
        "turns back",
        "friction vanishes",
        "negative friction",
        "parameter of any size",
        "logarithm",
        "radius vanishes",
        "abs forgotten",
    ],
)
def test_a_quantity_that_is_not_positive_everywhere_is_refused_with_a_point(
    quantity: str, changes: dict[str, Any]
) -> None:
    (fault,) = faults(**changes)
    assert fault.startswith(f"{quantity} must be positive for h > 0 and |delta| < R, but at ")
    point = witness_of(fault)
    assert point["h"] > 0
    assert abs(point.get("delta", 0)) < 1
    # what is said of the point is true of the law as it was declared
    law = unchecked(**changes)
    own = {symbol: point[symbol.name] for symbol in law.parameters}
    at = {h: point["h"], delta: point.get("delta", 0), R: 1, E: 1, eta: 1, **own}
    expressions = {
        "a": law.a,
        "zeta": law.zeta.subs(a, law.a),
        "C": (law.F_ela.diff(a) * law.a.diff(delta) + law.F_ela.diff(delta)).subs(a, law.a) / 2,
    }
    value = expressions[quantity].subs(at).evalf(30)
    # the point is shown to three digits: a zero may come out as a rounding error of one
    assert not value.is_real or value <= 1e-15


def unchecked(**changes: Any) -> ContactLaw:
    """Return a law without asking whether it is sound."""
    parts = {
        "F_adh": sympy.S.Zero,
        "parameters": {},
        "ranges": {},
        "limits": (),
        "source": "",
        "description": "",
        "typical": {},
    }
    law = object.__new__(ContactLaw)
    for name, value in {**parts, **GOOD, **changes}.items():
        object.__setattr__(law, name, value)
    return law


def test_the_witness_names_each_variable_as_it_is_called() -> None:
    """A name that ends like another must not be taken for it."""
    kd = Symbol("kd", positive=True)
    point = witness_of(the_fault(zeta=eta * R * (1 - kd), parameters={kd: DIMENSIONLESS}))
    assert "kd" in point
    assert set(point) <= {"h", "delta", "kd"}


def test_at_zero_deflection_the_witness_has_none() -> None:
    found = faults(a=sqrt(2 * R * Abs(delta)), F_ela=E * R * delta)
    assert all("(delta = 0)" in fault for fault in found)
    assert {name for fault in found for name in witness_of(fault)} == {"h"}


def test_a_force_that_does_not_vanish_without_deflection_is_refused() -> None:
    """The deflection has the sign of the force (eq. 1 is solved on that side only), so F_ela(a, 0) must be 0."""
    assert "F_ela" in the_fault(F_ela=E * a * delta + E * R**2)


# ---------------------------------------------------------------- all at once


def test_all_faults_are_reported_at_once() -> None:
    found = faults(
        name="Bad Name",
        a=R * h * a,
        F_ela=Rational(1, 2) * 0.5 * E * a * delta,
        zeta=eta * delta,
        F_adh=besselj(3, h / R),
        parameters={Symbol("f o r", positive=True): LENGTH},
        ranges={q: (0, 1)},
        limits=limited(zetta=R),
    )
    subjects = [re.split(r"[ :(]", fault)[0] for fault in found]
    assert sorted(subjects) == sorted(["name", "parameters", "ranges", "a", "F_ela", "zeta", "F_adh", "limit"])
    assert str(LawError("x", found)).startswith("law 'x' has 8 faults:\n  - name 'Bad Name'")


# ---------------------------------------------------------------- what is accepted


def test_sound_laws_are_taken_to_the_letter() -> None:
    for law in LAWS.values():
        assert law.F_ela.free_symbols <= {a, delta, R, E, eta, *law.parameters}


@pytest.mark.parametrize(
    "changes",
    [
        {"F_adh": 0},
        {"F_adh": E * R**2 * Piecewise((1 - h / R, h < R), (0, True))},
        {"zeta": eta * Max(R, R**2 / h)},
        {"zeta": eta * R * Min(1, R / h)},
        {"F_adh": -sigma * exp(-h / q), "parameters": {sigma: FORCE, q: LENGTH}},
        {"zeta": eta * R * (1 - q), "parameters": {q: DIMENSIONLESS}, "ranges": {q: (0, 1)}},
        {"zeta": eta * R * (1 - q), "parameters": {q: DIMENSIONLESS}, "ranges": {q: (Rational(1, 3), Rational(2, 3))}},
        {"F_ela": E * a * delta * exp(-Abs(delta) / (10 * R))},
        {"zeta": eta * R * (1 + eta / (E * q)), "parameters": {q: TIME}},
        {"zeta": eta * R * kappa.subs(F, E * R**2)},
    ],
    ids=["no remote force", "Piecewise", "Max", "Min", "exp", "range", "exact range", "softer", "time", "kappa"],
)
def test_a_sound_law_is_accepted(changes: dict[str, Any]) -> None:
    law = law_with(**changes)
    for name in ("a", "F_ela", "zeta", "F_adh"):
        assert getattr(law, name) == sympy.sympify(changes.get(name, GOOD.get(name, 0)))


def test_a_sharper_range_may_still_be_too_wide() -> None:
    fault = the_fault(zeta=eta * R * (1 - q), parameters={q: DIMENSIONLESS}, ranges={q: (0, 2)})
    assert 1 <= witness_of(fault)["q"] < 2


def test_parameters_come_in_one_order_whatever_that_of_declaration() -> None:
    first = law_with(F_adh=sigma * exp(-h / q), parameters={sigma: FORCE, q: LENGTH})
    second = law_with(F_adh=sigma * exp(-h / q), parameters={q: LENGTH, sigma: FORCE})
    assert (
        [s.name for s in parameters_of(first)]
        == ["R", "E", "eta", "q", "sigma"]
        == [s.name for s in parameters_of(second)]
    )


def test_R_is_a_parameter_of_every_law_and_what_is_not_used_is_none() -> None:
    """X = 2R + h - 2 delta needs R, whatever the law."""
    law = law_with(a=h, F_ela=E * a * delta, zeta=eta * h, parameters={sigma: FORCE})
    assert [s.name for s in parameters_of(law)] == ["R", "E", "eta"]


def test_the_fingerprint_of_a_law_follows_what_its_kernels_depend_on() -> None:
    base = {"F_adh": sigma, "parameters": {sigma: FORCE}}
    changed = [
        {},
        {"name": "other"},
        {"source": "elsewhere"},
        {"a": R},
        {"F_ela": 2 * E * a * delta},
        {"zeta": eta * R},
        {"F_adh": 2 * sigma},
        {"parameters": {sigma: FORCE, q: LENGTH}},
        {"ranges": {sigma: (0, 1)}},
    ]
    prints = [law_hash(law_with(**{**base, **change})) for change in changed]
    assert len(set(prints)) == len(prints)
    assert law_hash(law_with(**base, description="words", limits=limited(a=R))) == prints[0]
