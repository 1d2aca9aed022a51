"""Formulas: the customary order, nothing lost on the way, and what notebooks show."""

import math
import re
from fractions import Fraction
from functools import cache

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from latex_values import value
from matplotlib.mathtext import MathTextParser
from sympy import Abs, Expr, Matrix, Mul, Rational, S, Symbol, exp, log, pi, simplify, sqrt, tanh

from softdyn.derive import FORCE, LENGTH, ContactLaw, E, Limit, R, a, delta, eta, h
from softdyn.derive.dynamics import generic_dynamics
from softdyn.derive.forms import force, force_unit
from softdyn.derive.limits import check_limits, side_of
from softdyn.derive.regimes import Diagram, discover
from softdyn.derive.symbols import F
from softdyn.derive.typeset import (
    RATES,
    condition_latex,
    correction_latex,
    declaration_latex,
    derivation,
    form_latex,
    name_latex,
    symbol_latex,
    tangential_sections,
    to_latex,
)
from softdyn.laws import find, law_of, load, stock_laws

A, lam, kT = Symbol("A", positive=True), Symbol("lam", positive=True), Symbol("kT", positive=True)
nu = Symbol("nu", positive=True)


@cache
def film() -> ContactLaw:
    """A law with a remote force, and a limit whose name is hostile."""
    hbar = R * h / (R + h)
    return ContactLaw(
        name="film",
        a=sqrt(2 * R * (hbar + Abs(delta))),
        F_ela=Rational(4, 9) * E * a * delta,
        zeta=3 * pi * eta * a**4 / (2 * hbar**3),
        F_adh=A * exp(-h / lam),
        parameters={A: FORCE, lam: LENGTH},
        typical={A: E * R**2 / 10**4, lam: R / 1000},
        limits=(
            Limit("<b>$x$", order=(delta, h, R), claims={"zeta": 6 * pi * eta * R**2 / h}),
            Limit("twice", order=(delta, h, R), claims={"zeta": 12 * pi * eta * R**2 / h}),
        ),
    )


@pytest.fixture(scope="module")
def law() -> ContactLaw:
    return load(find("rognon_gay"))[0]


@pytest.fixture(scope="module")
def diagram(law: ContactLaw) -> Diagram:
    return discover(law)


# ------------------------------------------------------------------------------------------------------------- names


@pytest.mark.parametrize(
    ("name", "typeset"),
    [
        ("kT", r"\mathrm{kT}"),
        ("sigma", r"\sigma"),
        ("Pi_0", r"\Pi_{0}"),
        ("k_B", "k_{B}"),
        ("lambda_D", r"\lambda_{D}"),
        ("sigma0", r"\sigma_{0}"),
        ("lam", r"\lambda"),
        ("ell", r"\ell"),
        ("beta", r"\beta"),
        ("bet", r"\mathrm{bet}"),
        ("grafting_density", r"\mathrm{grafting}_{\mathrm{density}}"),
        ("F_adh", r"F_\mathrm{adh}"),
    ],
)
def test_words_are_upright_and_greek_is_greek(name: str, typeset: str) -> None:
    assert symbol_latex(name) == typeset


# ------------------------------------------------------------------------------------------------------------- order


@pytest.mark.parametrize(
    ("expr", "latex"),
    [
        (6 * pi * eta * R**2 / h, r"\frac{6 \pi \eta R^{2}}{h}"),
        (sqrt(2 * R * h), r"\sqrt{2 R h}"),
        (2 * R + h - 2 * delta, r"2 R + h - 2 \delta"),
        (sqrt(2 * R * (h + Abs(delta))), r"\sqrt{2 R \left(h + |\delta|\right)}"),
        (kT * R, r"\mathrm{kT}\,R"),
        (A * exp(-h / lam), r"A e^{-h/\lambda}"),
        (-(1 - nu**2) / 3, r"-\frac{1 - \nu^{2}}{3}"),
        ((nu**2 - 1) * h, r"-h \left(1 - \nu^{2}\right)"),
        (E * R**2 / 10**4, r"10^{-4}\,E R^{2}"),
        (Rational(-1, 2), r"-\frac{1}{2}"),
        (6 ** Rational(2, 3) * R / 4, r"\frac{\sqrt[3]{36}\,R}{4}"),
    ],
)
def test_expressions_are_written_in_the_customary_order(expr: Expr, latex: str) -> None:
    assert to_latex(expr) == latex


POWERS = st.sampled_from([Fraction(n, d) for d in (1, 2, 3, 5) for n in range(-4, 5)])
NUMBERS = st.builds(
    lambda n, d, root, q: Rational(n, d) * Rational(root) ** Rational(1, q),
    st.integers(-40, 40).filter(bool),
    st.integers(1, 2000),
    st.integers(1, 12),
    st.sampled_from((1, 2, 3, 4)),
)


def typeset_values(symbols: dict[Symbol, float]) -> dict[str, float]:
    return {to_latex(symbol): number for symbol, number in symbols.items()}


AT = {E: 3.7, R: 0.31, eta: 11.3, h: 0.057, force: 0.83, A: 2.9, nu: 0.37, delta: -0.19, a: 1.7, lam: 0.41}
#: Values of what forms are written in.
IN_UNITS = {
    **typeset_values(AT),
    r"\kappa": AT[force] / (AT[E] * AT[R] ** 2),
    "V": AT[force] / (AT[eta] * AT[R]),
}


def close(latex: str, expr: Expr) -> bool:
    """Whether a formula has the value of an expression; each rounds some twenty operations."""
    return math.isclose(value(latex, IN_UNITS), float(S(expr).subs(AT)), rel_tol=1e-12)


@pytest.mark.slow
@settings(deadline=None)
@given(NUMBERS, st.lists(POWERS, min_size=6, max_size=6), POWERS, st.booleans())
@example(Rational(1), [Fraction(0)] * 6, Fraction(0), True)
@example(Rational(-1), [Fraction(0)] * 6, Fraction(2, 3), False)
def test_a_leading_form_keeps_its_value(number: Expr, powers: list[Fraction], inner: Fraction, rate: bool) -> None:
    """Whatever is paired with whatever, the product is the same."""
    factors = [s ** Rational(p.numerator, p.denominator) for s, p in zip((E, R, eta, h, force, A), powers, strict=True)]
    form = Mul(number, *factors, (1 - nu**2) ** Rational(inner.numerator, inner.denominator))
    balance = Rational(4, 3) * E * sqrt(R) * delta ** Rational(3, 2) / (1 - nu**2)
    for known in (None, balance):
        latex = form_latex(form, film(), rate, known)
        assert close(latex, form), latex


@pytest.mark.parametrize(
    "expr",
    [
        A * exp(-2 * h / lam) - F / 3,
        tanh(h / lam) * (R - 2 * h) ** 2 / (R + h) ** 3,
        log(20 * R / (9 * h)) * (nu**2 - 1) / 7 - 2,
        sqrt(R * (h * R / (R + h) + Abs(delta))) / (h / 2 - R / 2),
        (Rational(1, 2) - nu**2 / 2) ** 3 * Abs(delta) ** Rational(3, 2),
        -sqrt(2) * 3 ** Rational(1, 4) * (a - h) ** Rational(-3, 2) / R,
    ],
)
def test_any_expression_keeps_its_value(expr: Expr) -> None:
    numbers = {**AT, F: 0.23}
    assert math.isclose(value(to_latex(expr), typeset_values(numbers)), float(expr.subs(numbers)), rel_tol=1e-12)


@pytest.mark.parametrize("expr", [sqrt(2 * kT) * sqrt(-F) / 3, (-F) ** Rational(1, 3) * kT, sqrt(kT) * sqrt(1 - F / 2)])
def test_a_negative_force_keeps_its_sign_within_a_root(expr: Expr) -> None:
    """Beside other factors, -F read as a difference."""
    numbers = {kT: 1.3, F: -0.23}
    assert math.isclose(value(to_latex(expr), typeset_values(numbers)), float(expr.subs(numbers)), rel_tol=1e-12)


@pytest.mark.parametrize("name", sorted(stock_laws()))
def test_every_claim_of_a_stock_law_keeps_its_value(name: str) -> None:
    stock, _ = load(find(name))
    own = {symbol: 0.31 + 0.07 * i for i, symbol in enumerate(stock.parameters)}
    for limit in stock.limits:
        side = side_of(limit)
        numbers = {E: 3.7, R: 0.31, eta: 11.3, h: 0.057, delta: side * 0.19, F: side * 0.83, **own}
        for claim in limit.claims.values():
            expected = complex(claim.subs(numbers))
            assert expected.imag == 0
            assert math.isclose(value(to_latex(claim), typeset_values(numbers)), expected.real, rel_tol=1e-12), claim


# ----------------------------------------------------------------------------------------------------- leading forms


def test_the_forms_of_the_paper_are_written_as_in_its_table(law: ContactLaw, diagram: Diagram) -> None:
    """physics.md, section 1: powers of (9/(4 sqrt 2)) kappa and h/R."""
    hertz = diagram.regime("Hertz")
    written = {n: form_latex(f.leading, law, n in RATES, hertz.balance) for n, f in hertz.forms.items()}
    number = r"\left(\frac{9 \sqrt{2}\,\kappa}{8}\right)"
    assert written["delta"] == rf"R {number}^{{2/3}}"
    assert written["zeta"] == rf"6 \pi \eta R {number}^{{4/3}} \left(\frac{{R}}{{h}}\right)^{{3}}"
    assert written["dh_dt"] == rf"-\frac{{V}}{{6 \pi}} {number}^{{-4/3}} \left(\frac{{h}}{{R}}\right)^{{3}}"
    poiseuille = diagram.regime("Poiseuille")
    assert form_latex(poiseuille.delta, law) == r"\frac{9 \sqrt{2}\,\kappa R}{8}\,\sqrt{\frac{R}{h}}"
    assert form_latex(poiseuille.dh_dt, law, rate=True) == r"-\frac{V h}{6 \pi R}"


def test_every_form_and_correction_of_a_law_keeps_its_value(law: ContactLaw, diagram: Diagram) -> None:
    for regime in diagram.regimes:
        for name, form in regime.forms.items():
            assert close(form_latex(form.leading, law, name in RATES, regime.balance), form.leading)
            factor = correction_latex(form.corrections, True, law, regime.balance)
            assert close(factor, 1 + sum(form.corrections))


def test_conditions_name_gap_or_force_first(law: ContactLaw, diagram: Diagram) -> None:
    written = [condition_latex(c.small, c.large, law) for c in diagram.regime("Hertz").conditions]
    assert set(written) == {
        r"h \ll R",
        r"\kappa \gg \frac{4 \sqrt{2}}{9} \left(\frac{h}{R}\right)^{3/2}",
    }
    assert condition_latex(force, A, film()) == r"F \ll A"
    assert force_unit(law) == E * R**2


# --------------------------------------------------------------------------------------------------------- notebooks


def balanced(text: str) -> bool:
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        if depth < 0:
            return False
    return depth == 0 and text.count(r"\left") == text.count(r"\right")


@pytest.mark.slow
def test_mathtext_sets_every_formula_of_a_derivation() -> None:
    parser = MathTextParser("path")
    for lines in (*derivation(film()).values(), *tangential_sections(law_of("equal_spheres")).values()):
        for name, expr in lines:
            if not isinstance(expr, Matrix):
                parser.parse(f"${to_latex(expr)}$")
                assert balanced(to_latex(expr))
            assert balanced(name_latex(name))


def test_a_derivation_has_tangential_motion_if_the_law_declares_it() -> None:
    assert tangential_sections(film()) == {}
    declared, steps = tangential_sections(law_of("equal_spheres")).values()
    assert [name for name, _ in declared] == ["sliding", "coupling", "rolling", "k_t"]
    # a Maxwell element: the friction of sliding in series with the stiffness, where nothing rolls
    (rate,) = (step.rhs for _, step in steps if step.lhs == Symbol("dT_dt", real=True))
    T, sigma = Symbol("T", real=True), Symbol("sigma", real=True)
    stiffness, friction = Symbol("k_t", positive=True), Symbol("sliding", positive=True)
    assert simplify(rate.subs(Symbol("w", real=True), 0) - stiffness * (sigma - T / friction)) == 0


def test_a_law_and_a_derivation_are_latex_in_a_notebook(law: ContactLaw) -> None:
    for shown in (law._repr_latex_(), generic_dynamics()._repr_latex_()):
        assert shown.startswith(r"$\displaystyle \begin{aligned}")
        assert shown.endswith(r"\end{aligned}$")
        assert balanced(shown)
    assert declaration_latex(law).count(r"\\") == 3
    assert r"\dot{X} &= -\frac{\dot{F}_\mathrm{ext}}{C} - \frac{F_\mathrm{ext} - F_\mathrm{adh}}{D}" in (
        generic_dynamics()._repr_latex_()
    )
    html = derivation(law)._repr_html_()
    assert html.count("$$") == 2 * len(derivation(law))
    # the browser must see ampersands, and no tag but those of the titles
    assert set(re.findall(r"<(\w+)", html)) == {"p", "b"}
    assert "&amp;=" in html


@pytest.mark.slow
def test_verdicts_are_a_table_in_a_notebook_and_a_list_elsewhere() -> None:
    findings = check_limits(film())
    assert [finding.verdict for finding in findings] == ["proved", "disproved"]
    html = findings._repr_html_()
    assert html.count("<tr>") == 3
    assert r"$\zeta \simeq \frac{6 \pi \eta R^{2}}{h}$" in html
    assert r"<td style=" in html
    assert ">disproved<" in html
    assert r"$\frac{1}{2}$" in html, "the ratio found"


def test_names_are_neither_markup_nor_formulas_in_a_notebook() -> None:
    html = check_limits(film())._repr_html_()
    assert "<b>" not in html
    assert '<span class="tex2jax_ignore mathjax_ignore">&lt;b&gt;$x$</span>' in html


def test_regimes_are_a_table_in_a_notebook(law: ContactLaw, diagram: Diagram) -> None:
    html = diagram._repr_html_()
    for regime in diagram.regimes:
        assert f">{regime.name}</span>" in html
    assert html.count("<tr>") == 2 + len(diagram.regimes) + len(diagram.crossovers)
    assert r"U_h \neq 0" in html
    assert all(balanced(formula) for formula in re.findall(r"\$(.*?)\$", html))
