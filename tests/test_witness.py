"""A claim holds on the whole set that its ordering describes, at whatever rates its inequalities sharpen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Expr, Rational, Symbol, cosh, erf, exp, log, pi, sqrt, tanh

from softdyn.derive import FORCE, LENGTH, ContactLaw, Limit, R, a, delta, h
from softdyn.derive.laws.dlvo import law as dlvo
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.laws.soap_film import law as soap_film
from softdyn.derive.limits import Finding, check_limits
from softdyn.derive.witness import inequalities, samples_of
from softdyn.errors import LawError

A, B, ell = Symbol("A", positive=True), Symbol("B", positive=True), Symbol("ell", positive=True)
Order = tuple[Any, ...]


def pushed(F_adh: Expr) -> ContactLaw:
    """The paper's law with a remote force."""
    parameters = {symbol: unit for symbol, unit in ((A, FORCE), (B, FORCE), (ell, LENGTH)) if F_adh.has(symbol)}
    return replace(rognon_gay, name="pushed", F_adh=F_adh, parameters=parameters, limits=())


def finding(law: ContactLaw, order: Order, quantity: str, claim: Expr) -> Finding:
    """Verdict on one claim."""
    (found,) = check_limits(replace(law, limits=(Limit("trial", order, {quantity: claim}),)))
    return found


def claim_of(law: ContactLaw, limit: str, quantity: str) -> Expr:
    return next(x for x in law.limits if x.name == limit).claims[quantity]


def test_a_difference_of_which_all_digits_are_lost_refutes_nothing() -> None:
    """cosh(h/ell) - 1 where (h/ell)^2 is below the digits that a point of the path has."""
    law = pushed(A * (cosh(h / ell) - 1))
    for number, verdict in ((1, "proved"), (2, "disproved")):
        order = ((delta, h, R), (h, ell))
        assert finding(law, order, "F_adh", number * A * h**2 / (2 * ell**2)).verdict == verdict


@pytest.mark.parametrize(
    "correction",
    [
        h / R * exp(-h / ell) * log(1 + R / h),
        1 / log(2 + R / h),
        1 / log(log(20 + R / h)),
        exp(-sqrt(log(1 + R / h))),
        (h / R) ** pi,
    ],
    ids=str,
)
def test_a_factor_of_one_percent_is_refuted_by_numbers_that_show_it(correction: Expr) -> None:
    """However slowly the correction vanishes: 1/log(log(20 + R/h)) is still 0.2 where h/R = 1e-60."""
    law = pushed(A * (1 + correction))
    order = ((delta, h, R), (ell, h)) if correction.has(ell) else (delta, h, R)
    assert finding(law, order, "F_adh", A).verdict == "proved"
    found = finding(law, order, "F_adh", A * Rational(101, 100))
    assert found.verdict == "disproved"
    assert found.witness is not None
    off = [abs(mpmath.mpf(ratio) - mpmath.mpf(100) / 101) for _, ratio in found.witness.points]
    assert off[-1] <= off[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost", "form"),
    [
        (1 - tanh(h / ell), 2 * exp(-2 * h / ell)),
        (1 - erf(h / ell), ell * exp(-((h / ell) ** 2)) / (sqrt(pi) * h)),
        (-log(1 - exp(-2 * h / ell)), exp(-2 * h / ell)),
        (log(1 + exp(-h / ell)), exp(-h / ell)),
    ],
    ids=str,
)
def test_what_no_number_of_digits_tells_from_zero_refutes_nothing(lost: Expr, form: Expr) -> None:
    """1 - tanh(h/ell) at h/ell = 1e27 is 0 in as many digits as anything can have."""
    order = ((delta, h, R), (ell, h))
    assert finding(pushed(A * lost), order, "F_adh", A * form).verdict == "proved"
    assert finding(pushed(A * lost), order, "F_adh", A * form / 2).verdict == "disproved"
    assert finding(pushed(A * (1 + lost)), order, "F_adh", A).verdict == "proved"


@pytest.mark.slow
@pytest.mark.parametrize(
    "correction",
    [exp(-sqrt(log(1 + R / h))) * log(1 + R / h), (h / R) ** Rational(1, 20) * log(1 + R / h)],
    ids=str,
)
def test_what_grows_at_first_refutes_nothing(correction: Expr) -> None:
    """L exp(-sqrt(L)), L = log(R/h), grows up to L = 4, and L exp(-L/20) up to 20: then both vanish."""
    assert finding(pushed(A * (1 + correction)), (delta, h, R), "F_adh", A).verdict == "proved"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("correction", "holds"),
    [(exp(-h / ell) * log(1 + R / h), False), (exp(-h / ell) * log(1 + R / h) * h / R, True)],
    ids=str,
)
def test_a_logarithm_may_outgrow_an_exponential(correction: Expr, holds: bool) -> None:
    """exp(-x) log(R/h) grows as x^2 = log10(log10(R/h)), where R/h = 10^(10^40) is no more than a point of the path."""
    found = finding(pushed(A * (1 + correction)), ((delta, h, R), (ell, h)), "F_adh", A)
    assert found.verdict == ("proved" if holds else "disproved")
    if found.witness is not None:
        x = [1 / mpmath.mpf(at["(ell)/(h)"]) for at, _ in found.witness.points]
        exact = [mpmath.exp(-y) * mpmath.mpf(10) ** (y**2) * mpmath.log(10) for y in x]
        ratios = [mpmath.mpf(ratio) for _, ratio in found.witness.points]
        # x is told to four digits, of which 10^(x^2) needs all
        assert [mpmath.log(r) for r in ratios] == pytest.approx([mpmath.log(r) for r in exact], rel=1e-3)


FADING = pushed(A * exp(-h / ell) + B)
SWELLING = pushed(A * (1 + (a / R) ** 2 * log(1 + R / h)))

#: Law, ordering that says too little, quantity, claim; and an ordering that says enough.
NEEDS_MORE: dict[str, tuple[ContactLaw, Order, str, Expr, Order]] = {
    "soap film": (
        soap_film,
        ((delta, h, R), (Symbol("ell", positive=True), h)),
        "dh_dt",
        claim_of(soap_film, "Poiseuille", "dh_dt"),
        next(x for x in soap_film.limits if x.name == "Poiseuille").order,
    ),
    "DLVO": (
        dlvo,
        next(x for x in dlvo.limits if x.name == "Poiseuille").order[:3],
        "dh_dt",
        claim_of(dlvo, "Poiseuille", "dh_dt"),
        next(x for x in dlvo.limits if x.name == "Poiseuille").order,
    ),
    "DLVO, drawn together": (
        dlvo,
        next(x for x in dlvo.limits if x.name == "drawn together").order[:3],
        "dh_dt",
        claim_of(dlvo, "drawn together", "dh_dt"),
        next(x for x in dlvo.limits if x.name == "drawn together").order,
    ),
    # an ordering that names Pi0 leaves it free: the rim's repulsion may be small, and the plane film's not
    "a plane film": (
        soap_film,
        next(x for x in soap_film.limits if x.name == "Poiseuille").order[:3],
        "dh_dt",
        claim_of(soap_film, "Poiseuille", "dh_dt"),
        next(x for x in soap_film.limits if x.name == "Poiseuille").order,
    ),
    "what is left of a force": (FADING, ((ell, h, R), (B, A)), "F_adh", B, ((ell, h, R), (A * exp(-h / ell), B))),
    "a logarithm": (SWELLING, (h, delta, R), "F_adh", A, ((h, delta, R), (delta * log(R / h), R))),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(NEEDS_MORE))
def test_what_fails_in_an_exponentially_small_corner_is_disproved_with_numbers(name: str) -> None:
    law, order, quantity, claim, _ = NEEDS_MORE[name]
    found = finding(law, order, quantity, claim)
    assert found.verdict == "disproved"
    assert found.witness is not None
    assert "found/claimed" in found.reason
    # the numbers of the witness, computed anew: each inequality holds, and the claim is off by more than a percent
    at, ratio = found.witness.points[-1]
    assert all(mpmath.mpf(at[f"({small})/({large})"]) < 0.5 for small, large in inequalities(Limit("", order, {})))
    assert abs(mpmath.mpf(ratio) - 1) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", list(NEEDS_MORE))
def test_the_algebra_alone_proves_nothing_false_and_finds_the_way_to_where_it_fails(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each exponential and each logarithm has an axis of its own: no random point is needed."""
    monkeypatch.setattr("softdyn.derive.limits.samples_of", lambda *_: [])
    law, order, quantity, claim, full = NEEDS_MORE[name]
    wrong = finding(law, order, quantity, claim)
    assert wrong.verdict == "disproved"
    assert wrong.witness is not None
    assert wrong.ratio is not None
    # along the path that is told, the claim is off by ever more
    off = [abs(mpmath.mpf(ratio) - 1) for _, ratio in wrong.witness.points]
    assert off[-1] > max(off[0], 1)
    assert finding(law, full, quantity, claim).verdict == "proved"


@pytest.mark.slow
@pytest.mark.parametrize("name", list(NEEDS_MORE))
def test_an_ordering_may_say_what_a_claim_needs(name: str) -> None:
    law, _, quantity, claim, order = NEEDS_MORE[name]
    found = finding(law, order, quantity, claim)
    assert (found.verdict, found.ratio) == ("proved", 1)
    assert found.samples > 0
    assert found.holds.startswith("as every inequality of")


def test_the_witness_is_a_point_of_the_law() -> None:
    """F_adh = A exp(-h/ell) + B over B, from the numbers that are told."""
    law, order, quantity, claim, _ = NEEDS_MORE["what is left of a force"]
    witness = finding(law, order, quantity, claim).witness
    assert witness is not None
    at, ratio = witness.points[0]
    value = {name: mpmath.mpf(text) for name, text in at.items()}
    exact = 1 + value["A"] / value["B"] * mpmath.exp(-value["h"] / value["ell"])
    assert mpmath.log(mpmath.mpf(ratio)) == pytest.approx(mpmath.log(exact), rel=0.05)  # three digits of h/ell


@pytest.mark.parametrize("order", [(h * sin_, R) for sin_ in (Symbol("unknown"), log(1 + h / R))], ids=str)
def test_an_ordering_holds_products_powers_exponentials_and_logarithms_only(order: Order) -> None:
    with pytest.raises(LawError, match="order must hold sizes"):
        replace(rognon_gay, limits=(Limit("trial", (order, (h, R)), {"a": R}),))


def test_the_same_points_are_taken_every_time() -> None:
    limit = soap_film.limits[0]
    first, second = ([sample.path for sample in samples_of(soap_film, limit)] for _ in range(2))
    assert first == second
    assert first


# ---------------------------------------------------------------- random laws with exponentials and logarithms

powers = st.sampled_from([Rational(x) for x in ("1/2", "1", "3/2", "2")])


@st.composite
def corrections(draw: st.DrawFn) -> tuple[Expr, bool]:
    """A factor that tends to 1, or only seems to: 1 + c x, and whether x vanishes on all of ell << h << delta << R."""
    p, q = draw(powers), draw(powers)
    number = Rational(draw(st.integers(1, 9)), draw(st.integers(1, 9)))
    term, vanishes = draw(
        st.sampled_from(
            [
                (exp(-((h / ell) ** p)), True),
                (exp(-((h / ell) ** p)) * (h / ell) ** q, True),
                (exp(-((h / ell) ** p)) * (delta / h) ** q, False),
                (exp(-((h / ell) ** p)) * (delta / R) ** q, True),
                (exp(-((h / ell) ** p)) * (R / delta) ** q, False),
                ((delta / R) ** p * log(1 + R / delta), True),
                ((delta / R) ** p * log(1 + R / h), False),
                ((h / R) ** p * log(1 + R / h), True),
                ((delta / R) ** p * log(1 + h / ell) ** 2, False),
                ((h / delta) ** p * log(1 + delta / h), True),
                ((ell / h) ** p * log(1 + delta / ell), False),
                ((ell / R) ** p * log(1 + delta / ell), True),
            ]
        )
    )
    return 1 + number * term, vanishes


#: What is claimed, over A: other leading coefficients are refuted, however near they are, whatever the corrections.
claimed = st.sampled_from([Rational(1), Rational(101, 100), Rational(100, 101), Rational(10001, 10000)])


def verdict_on(factor: Expr, claim: Expr) -> str:
    made = object.__new__(ContactLaw)
    base = pushed(A * exp(-h / ell))
    for name in ContactLaw.__dataclass_fields__:
        object.__setattr__(made, name, getattr(base, name))
    object.__setattr__(made, "F_adh", A * factor)
    object.__setattr__(made, "limits", (Limit("trial", (ell, h, delta, R), {"F_adh": A * claim}),))
    (found,) = check_limits(made)
    assert found.verdict != "disproved" or found.ratio is None or found.witness is not None
    return found.verdict


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(corrections(), claimed)
def test_no_verdict_on_a_random_law_is_false(drawn: tuple[Expr, bool], claim: Expr) -> None:
    factor, vanishes = drawn
    assert verdict_on(factor, claim) == ("proved" if vanishes and claim == 1 else "disproved")


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(corrections(), claimed)
def test_no_verdict_on_many_random_laws_is_false(drawn: tuple[Expr, bool], claim: Expr) -> None:
    factor, vanishes = drawn
    assert verdict_on(factor, claim) == ("proved" if vanishes and claim == 1 else "disproved")
