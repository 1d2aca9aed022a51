"""Certificates of what closures claim: every stock claim has one, it says what the closure says, no wrong one holds."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from sympy import Rational, Symbol, atan, exp, log

from softdyn.certificate_checker import Refused, check_certificate
from softdyn.cli import main
from softdyn.derive.certificate import certificates
from softdyn.derive.certificate_cases import UnknownSizeError
from softdyn.derive.closure import Closure, Re, c, claimed_of, in_fractions, phi, result_of, sample_values
from softdyn.derive.closure_certificate import closure_certificates
from softdyn.derive.closure_limits import check_closure_limits
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.law import Limit
from softdyn.laws import law_or_closure_of, stock_closures


def stock(name: str) -> Closure:
    closure = law_or_closure_of(name)
    assert isinstance(closure, Closure)
    return closure


#: Closures; those whose certificates take longer are for the slow run.
SLOW = ("beetstra", "gidaspow", "koch_hill", "richardson_zaki")
CLOSURES = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in stock_closures()]


@cache
def made(name: str) -> list[dict[str, Any]]:
    found, without = certificates(stock(name))
    assert without == []
    return json.loads(json.dumps(found))  # type: ignore[no-any-return]


def value_of(text: Any, at: dict[str, float]) -> float:
    """Value of an expression in prefix notation; exponents of named powers are expressions."""
    if isinstance(text, str):
        return at[text] if text in at else float(Fraction(text))
    parts = [value_of(part, at) for part in text[1:]]
    one = {"exp": math.exp, "log": math.log, "expm1": math.expm1}
    many = {"+": math.fsum, "*": math.prod, "^": lambda x: x[0] ** x[1]}
    return float(one[text[0]](parts[0]) if text[0] in one else many[text[0]](parts))


@pytest.mark.parametrize("name", CLOSURES)
def test_all_claims_of_stock_closures_have_certificates(name: str) -> None:
    """What is assumed to be positive is: sums and logarithms at any volume fraction of the case, by samples."""
    claims = {f"{name}: {limit.name}: {quantity}" for limit in stock(name).limits for quantity in limit.claims}
    assert {one["claim_of"].split(", where ")[0] for one in made(name)} == claims
    for one in made(name):
        check_certificate(one)
        for text in one["assumed"]:
            for fraction in (0.01, 0.1, 0.3, 0.5, 0.6, 0.7, 0.9, 0.99):
                assert value_of(text, {"c": 1 - fraction, "phi": fraction, "pi": math.pi}) > 0


@pytest.mark.parametrize("name", CLOSURES)
def test_what_a_certificate_of_a_closure_says_is_what_the_closure_says(name: str) -> None:
    """In numbers, to rounding: also in one case of several, and with powers and differences under names."""
    closure = stock(name)
    claims = {
        f"{name}: {x.name}: {quantity}": (quantity, x.claims[quantity]) for x in closure.limits for quantity in x.claims
    }
    for one in made(name):
        small = {pair[0] for pair in one["order"] if isinstance(pair[0], str)}
        exact = {**sample_values(closure), Re: Rational(1, 100) if "Re" in small else Rational(10**5)}
        # in the case that the certificate is of, and below the densest packing
        exact[c] = Rational(3 if "c" in small or "phi >= 2/5" in one["claim_of"] else 4 if "gap_0" in small else 9, 10)
        exact[phi] = 1 - exact[c]
        at = {symbol.name: float(value) for symbol, value in exact.items()} | {"pi": math.pi}
        at["gap_0"] = at.get("phi_max", 1.0) - at["phi"]
        for power, text in one["named"]:
            at[power] = value_of(text, at)
        quantity, claim = claims[one["claim_of"].split(", where ")[0]]
        about = claimed_of(closure, quantity)
        assert about is not None
        found = in_fractions(closure, about.subs(result_of(closure), closure.expression))
        assert value_of(one["definitions"][0][1], at) == pytest.approx(float(found.subs(exact)), rel=1e-12)
        assert value_of(one["claim"], at) == pytest.approx(float(in_fractions(closure, claim).subs(exact)), rel=1e-12)


def with_numbers_changed(text: Any) -> list[Any]:
    """An expression with one number changed, each of its numbers in turn."""
    if isinstance(text, str):
        return [str(Fraction(text) * Fraction(8, 7))] if text.lstrip("-")[:1].isdigit() and text != "0" else []
    return [[*text[:i], wrong, *text[i + 1 :]] for i in range(1, len(text)) for wrong in with_numbers_changed(text[i])]


@pytest.mark.parametrize("name", CLOSURES)
def test_a_certificate_of_a_closure_with_a_changed_number_is_refused(name: str) -> None:
    """Each number of the claim says something; what is assumed, and the order, are needed where they are."""
    for one in made(name):
        for claim in [*with_numbers_changed(one["claim"]), ["*", "2", one["claim"]]]:
            with pytest.raises(Refused):
                check_certificate({**one, "claim": claim})
        for i in range(len(one["assumed"])):
            with pytest.raises(Refused):
                check_certificate({**one, "assumed": one["assumed"][:i] + one["assumed"][i + 1 :]})
        if one["multipliers"]:
            for key, nothing in (("order", []), ("multipliers", {})):
                with pytest.raises(Refused):
                    check_certificate({**one, key: nothing})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "limit", "factor"),
    [
        ("krieger_dougherty", "dilute", 2),
        ("krieger_dougherty", "dense", Rational(9, 10)),
        ("richardson_zaki", "dilute, slow", Rational(239, 465)),
        ("dallavalle_di_felice", "viscous", c ** Rational(-65, 100)),
        ("dallavalle_di_felice", "Newton", c),
        ("migflow_drag", "viscous", c ** Rational(1, 10)),
        ("beetstra", "Stokes", 1 + Rational(413, 1000)),
        ("koch_hill", "Stokes", 1 + Rational(135, 64)),
        ("tenneti", "viscous", c),
    ],
)
def test_no_wrong_claim_of_a_closure_has_a_certificate(name: str, limit: str, factor: Any) -> None:
    closure = stock(name)
    right = next(one for one in closure.limits if one.name == limit)
    ((quantity, claim),) = right.claims.items()
    closure_certificates(closure, right, quantity)
    wrong = Limit(limit, right.order, {quantity: factor * claim})
    with pytest.raises(Refused):
        closure_certificates(closure, wrong, quantity)


#: What claims are multiplied by: some tend to 1 in some of the orders.
FACTORS = (
    Rational(999, 1000), c, 1 + phi, phi ** Rational(1, 7), Re ** Rational(1, 50), 1 + Re, 1 + 1 / Re, 1 + Re**2 * phi,
    exp(-Re), exp(-1 / Re), exp(-phi / c), log(10) / 2, c**phi, c**Re,
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ["beetstra", "krieger_dougherty", "dallavalle_di_felice", "ergun"])
def test_no_claim_has_a_certificate_that_is_not_proved(name: str) -> None:
    """The prover and the checker share nothing; some claims that are proved need not have one."""
    closure, certified = stock(name), 0
    for limit in closure.limits:
        for quantity, claim in limit.claims.items():
            for factor in FACTORS:
                one = replace(closure, limits=(Limit(limit.name, limit.order, {quantity: factor * claim}),))
                (finding,) = check_closure_limits(one)
                found, without = certificates(one)
                assert not found or finding.verdict == "proved", (limit.name, factor)
                assert found or without
                certified += bool(found)
    assert certified > 3


def test_a_power_of_unknown_size_proves_nothing_by_its_size() -> None:
    """What is known of (Re c)^n with any n is that it is positive: it may be large."""
    n = Symbol("n", positive=True)
    closure = viscous(1 + Re / (1 + (c * Re) ** -n), n)
    check_certificate(closure_certificates(closure, closure.limits[0], "drag")[0])
    larger = viscous(1 + Re**n, n)
    with pytest.raises(Refused):
        closure_certificates(larger, larger.limits[0], "drag")


def test_a_power_of_what_tends_to_1_does_so_too() -> None:
    """With an exponent that is fixed, or vanishes; (1 + Re)^(1/Re) tends to e."""
    n = Symbol("n", positive=True)
    for factor in ((1 + Re) ** n, (1 + Re) ** -n, (1 + Re) ** (n * Re)):
        closure = viscous(factor, n)
        check_certificate(closure_certificates(closure, closure.limits[0], "drag")[0])
    for factor in ((1 + Re) ** (n / Re), 2 * (1 + Re) ** n):
        closure = viscous(factor, n)
        with pytest.raises((Refused, UnknownSizeError)):
            closure_certificates(closure, closure.limits[0], "drag")


@pytest.mark.slow
def test_a_case_that_an_atom_shows_to_be_empty_is_left() -> None:
    """As where log(1/phi) is bounded although it grows: nothing belongs to it, and nothing more is asked there."""
    closure = stock("koch_hill")
    limit = Limit("Stokes", closure.limits[0].order, {"drag": stock("stokes").expression * c**phi})
    (one,) = closure_certificates(closure, limit, "drag")
    check_certificate(json.loads(json.dumps(one)))


def viscous(factor: Any, *own: Symbol) -> Closure:
    """Stokes' drag times a factor that tends to 1 as Re does to 0."""
    alone = stock("stokes").expression
    return Closure(
        name="viscous",
        gives="drag",
        expression=alone * factor,
        parameters=dict.fromkeys(own, DIMENSIONLESS),
        limits=(Limit("Stokes", order=(Re, 1), claims={"drag": alone}),),
    )


def test_an_exponential_less_one_is_led_by_its_argument_where_that_vanishes() -> None:
    """And nowhere else: nothing is known of exp(x) - 1 where x is not small."""
    (one,) = [x for x in made("krieger_dougherty") if ": dilute" in x["claim_of"]]
    text = one["definitions"][0][1]
    assert "expm1" in str(text)
    check_certificate(one)
    for order in ([], [["1", "phi"]]):
        with pytest.raises(Refused):
            check_certificate({**one, "order": order})
    for wrong in (["expm1"], ["expm1", "phi", "phi"], ["expm1", "1"], ["expm1", "B"]):
        with pytest.raises(Refused):
            check_certificate({**one, "definitions": [["found", ["*", "B", wrong]]]})


@pytest.mark.parametrize("name", ["ergun", "tenneti", pytest.param("koch_hill", marks=pytest.mark.slow)])
def test_the_command_tells_how_many_claims_of_a_closure_have_certificates(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A claim in two cases has two: one where phi < 2/5, and one where it is not."""
    file = tmp_path / "certificates.json"
    assert main(["check", name, "--certificates", str(file)]) == 0
    assert "certificates of 3 of 3 claims" in capsys.readouterr().err
    assert main(["verify", str(file)]) == 0
    count = len(made(name))
    told = capsys.readouterr().out
    assert f"{count} of {count} certificates hold" in told
    assert ("inertial: drag, where phi < 2/5" in told) == (name == "koch_hill")
    data = json.loads(file.read_text(encoding="utf-8"))
    data["certificates"][-1]["claim"] = with_numbers_changed(data["certificates"][-1]["claim"])[0]
    file.write_text(json.dumps(data), encoding="utf-8")
    assert main(["verify", str(file)]) == 1
    assert f"{count - 1} of {count} certificates hold" in capsys.readouterr().out


def test_which_claims_have_no_certificate_is_told_with_the_reason() -> None:
    found, without = certificates(viscous(1 + atan(Re)))
    assert found == []
    assert without == [("Stokes: drag", "certificates have no rule for atan(Re)")]
