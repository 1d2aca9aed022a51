"""Claims with an error are proved on a whole box of ratios, or numbers in it refute them; or the box is found."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest
from sympy import Abs, Expr, Rational, Symbol, log, pi, sqrt

from softdyn.derive import LENGTH, ContactLaw, E, F, Limit, R, a, delta, eta, h
from softdyn.derive.error_bounds import check_errors
from softdyn.errors import LawError

hbar = R * h / (R + h)
near = 6 * pi * eta * R**2 / h
small = {h / R: 1e-3, delta / h: 1e-2}


def claiming(within: dict[str, Any], where: dict[Any, Any], **claims: Any) -> ContactLaw:
    limit = Limit("Poiseuille", order=(delta, h, R), claims={"zeta": near, **claims}, within=within, where=where)
    return ContactLaw(
        name="trial",
        a=sqrt(2 * R * (hbar + Abs(delta))),
        F_ela=Rational(4, 9) * E * a * delta,
        zeta=3 * pi * eta * a**4 / (2 * hbar**3),
        limits=(limit,),
    )


def test_an_error_is_proved_on_the_whole_box() -> None:
    """zeta/near = (1 + d (1 + x))^2 (1 + x), x = h/R and d = delta/h: at most 1.0211 here."""
    (finding,) = check_errors(claiming({"zeta": 0.0212}, small))
    assert finding.verdict == "proved"
    assert str(finding) == "within 2.12 % for h/R < 0.001 and delta/h < 0.01"


def test_a_smaller_one_is_refuted_by_numbers_in_the_box() -> None:
    (finding,) = check_errors(claiming({"zeta": 0.02}, small))
    assert finding.verdict == "disproved"
    assert "found/claimed is 1.02" in finding.reason


def test_a_form_that_is_off_by_a_factor_is_refuted() -> None:
    findings = check_errors(claiming({"zeta": 0.5, "dh_dt": 0.05}, small, dh_dt=-Rational(11, 10) * F / near))
    assert [finding.verdict for finding in findings] == ["proved", "disproved"]


b = Symbol("b", positive=True)
#: Friction of surfaces with slip over that without it (Vinogradova 1995), and what is left of it at h << b.
slip = h / (3 * b) * ((1 + h / (6 * b)) * log(1 + 6 * b / h) - 1)


def slipping(form: Expr, error: float, where: dict[Any, Any]) -> ContactLaw:
    limit = Limit("slip", order=(delta, h, b, R), claims={"zeta": near * h / (3 * b) * form}, within={"zeta": error})
    common = claiming({}, {})
    limits = (replace(limit, where=where),)
    return replace(common, zeta=near * slip, parameters={b: LENGTH}, typical={b: R / 100}, limits=limits)


@pytest.mark.parametrize(
    ("form", "error", "verdict"),
    [
        (log(6 * b / h) - 1, 0.001, "proved"),
        (log(6 * b / h) - 1, 1e-4, "disproved"),
        (log(6 * b / h), 0.15, "proved"),
        (log(6 * b / h), 0.1, "disproved"),
    ],
    ids=str,
)
def test_a_logarithm_without_end_is_bounded(form: Expr, error: float, verdict: str) -> None:
    """With x = h/b < 1e-3: found/claimed - 1 is x (L + 1)/6/(L - 1) < 2.2e-4, L = log(6/x), and 1/L < 0.115."""
    (finding,) = check_errors(slipping(form, error, {h / b: 1e-3}))
    assert finding.verdict == verdict


def test_the_box_of_an_error_with_a_logarithm_is_found() -> None:
    """What is left out is x (L + 1)/6/(L - 1): 0.05 at x = 0.167."""
    (finding,) = check_errors(slipping(log(6 * b / h) - 1, 0.05, {}))
    assert finding.verdict == "proved"
    assert 0.09 < float(finding.where[h / b]) < 0.167


@pytest.mark.slow
def test_the_box_of_an_error_is_found() -> None:
    """All ratios below y: (1 + y (1 + y))^2 (1 + y) = 1.05 at y = 0.0163."""
    (finding,) = check_errors(claiming({"zeta": 0.05}, {}))
    assert finding.verdict == "proved"
    assert set(finding.where) == {delta / h, h / R}
    assert all(Fraction(9, 1000) < Fraction(str(bound)) < Fraction(163, 10000) for bound in finding.where.values())


def test_an_error_of_what_is_not_claimed_is_refused() -> None:
    with pytest.raises(LawError, match="'C' is not claimed"):
        claiming({"C": 0.05}, small)
