"""Films are where F_adh carries F: against an independent search for the gap, and the rate of a small disturbance."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import mpmath
import pytest
from exactly import deflection, quantities
from sympy import Expr, Rational, Symbol, asinh, coth, exp, lambdify, log, pi, sinh, sqrt, tanh
from test_regimes import changed

from softdyn.derive import FORCE, LENGTH, ContactLaw, E, R, a, eta, h
from softdyn.derive.films import GAPS, Film, Films, branches, find_films, inverted
from softdyn.derive.forms import force
from softdyn.derive.law import typical_values
from softdyn.derive.regimes import discover
from softdyn.study.findings_text import regimes_text
from softdyn.study.law_page import summary

A, B, ell, far = (Symbol(name, positive=True) for name in ("strength", "pull", "ell", "far"))

LAWS: dict[str, dict[str, Any]] = {
    "exponential": {
        "F_adh": A * exp(-h / ell),
        "parameters": {A: FORCE, ell: LENGTH},
        "typical": {A: E * R**2 / 10**4, ell: R / 1000},
    },
    "power": {
        "F_adh": A * (ell / h) ** 2,
        "parameters": {A: FORCE, ell: LENGTH},
        "typical": {A: E * R**2 / 10**6, ell: R / 1000},
    },
    "attractive": {
        "F_adh": -A * (ell / h) ** 2,
        "parameters": {A: FORCE, ell: LENGTH},
        "typical": {A: E * R**2 / 10**6, ell: R / 1000},
    },
    "two films": {
        "F_adh": A * exp(-h / ell) - B * R**2 / h**2,
        "parameters": {A: FORCE, B: FORCE, ell: LENGTH},
        "typical": {A: E * R**2 / 10**4, B: E * R**2 / 10**12, ell: R / 1000},
    },
    "on the area": {
        "F_adh": B * (a / R) ** 2 * (ell / h) ** 3,
        "parameters": {B: FORCE, ell: LENGTH},
        "typical": {B: E * R**2 / 10**2, ell: R / 1000},
    },
}


@cache
def law_of(name: str) -> ContactLaw:
    return changed(**LAWS[name])


@cache
def films_of(name: str) -> Films:
    found = find_films(discover(law_of(name)))
    assert found is not None
    return found


def own_of(law: ContactLaw) -> dict[Symbol, Any]:
    return {symbol: mpmath.mpf(value.p) / value.q for symbol, value in typical_values(law).items()}


def speed(law: ContactLaw, gap: Any, pressed: Any) -> Any:
    """Return dh/dt at a gap and a force."""
    own = own_of(law)
    return quantities(law, gap, deflection(law, gap, pressed, own), own)["dh_dt"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(LAWS))
def test_each_branch_is_a_film_with_its_rate(name: str) -> None:
    """At a branch's gap and force dh/dt vanishes; near it, it is -rate (h - h_eq)."""
    law = law_of(name)
    found = films_of(name)
    assert found.branches
    for branch in found.branches:
        assert all((rate > 0) == branch.stable for rate in branch.rate)
        for i in (len(branch.h) // 3, 2 * len(branch.h) // 3):
            gap, pressed, rate = branch.h[i], branch.force[i], branch.rate[i]
            with mpmath.workdps(60):
                off = mpmath.mpf(10) ** -4
                up, down = (speed(law, mpmath.mpf(gap) * (1 + s * off), mpmath.mpf(pressed)) for s in (1, -1))
                slope = (up - down) / (2 * off * mpmath.mpf(gap))
                # a difference over 1e-4 of the gap, which holds up to 1e2 ranges of the force: (1e-4 1e2)^2
                assert abs(-slope / rate - 1) < 1e-3
                # and the film is where the speed changes sign: the force is given to 16 digits
                assert abs((up + down) / (up - down)) < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["exponential", "power", "attractive"])
def test_a_film_in_closed_form_carries_the_force(name: str) -> None:
    law = law_of(name)
    films = [film for film in films_of(name).films if film.h_eq is not None]
    assert films
    own = own_of(law)
    for film in films:
        sign = 1 if film.side == "compression" else -1
        pressed = 1e-5 if name == "exponential" else 1e-9
        gap = number(film.h_eq, {**own, force: pressed})
        assert law.F_adh.subs({**own, h: gap, E: 1, R: 1}).evalf() == pytest.approx(sign * pressed, rel=1e-12)
        assert film.stable is (name != "attractive")


x = h / ell
repelling = {"parameters": {A: FORCE, ell: LENGTH}, "typical": {A: E * R**2 / 10**4, ell: R / 1000}}
constant_charge = {
    "parameters": {B: FORCE / LENGTH**2, ell: LENGTH}, "typical": {B: E / 1000, ell: R / 1000},
}  # fmt: skip
slip = {
    "F_adh": A * exp(-x),
    "zeta": 2 * pi * eta * R**2 / far * ((1 + h / (6 * far)) * log(1 + 6 * far / h) - 1),
    "parameters": {A: FORCE, ell: LENGTH, far: LENGTH},
    "typical": {A: E * R**2 / 10**4, ell: R / 1000, far: R / 100},
}
#: Laws that repel at every gap, less so the wider it is.
REPEL: dict[str, dict[str, Any]] = {
    "constant charge": {"F_adh": -pi * R * ell * B * log(1 - exp(-x)), **constant_charge},
    "constant charge, written otherwise": {"F_adh": pi * R * ell * B * log(1 / (1 - exp(-x))), **constant_charge},
    "on the area": {"F_adh": -pi * a**2 * B * log(1 - exp(-x)), **constant_charge},
    "on the area, written otherwise": {"F_adh": pi * a**2 * B * log(1 / (1 - exp(-x))), **constant_charge},
    "mobile surfaces": {"F_adh": A * exp(-x), "zeta": eta * R * log(1 + R / h), **repelling},
    "surfaces that slip": slip,
    "hydration": {
        "F_adh": A * exp(-(h - far) / ell),
        "parameters": {A: FORCE, ell: LENGTH, far: LENGTH},
        "typical": {A: E * R**2 / 10**4, ell: R / 1000, far: R / 500},
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(REPEL))
def test_what_repels_at_every_gap_has_films_in_compression(name: str) -> None:
    """Signs are taken within a regime: log(ell/h) is positive below ell, whatever numbers ell and h are."""
    found = find_films(discover(changed(**REPEL[name])))
    assert found is not None
    assert found.branches
    assert {branch.side for branch in found.branches} == {film.side for film in found.films} == {"compression"}
    assert not found.without_form()
    stable = [film for film in found.films if film.stable]
    assert stable
    assert all(film.found for film in stable)
    # on the area a film may be unstable, where delta << h << ell, a strip that is not there at the typical values
    assert all(film.stable is not False or (film.found is False and "area" in name) for film in found.films)


CLOSED: dict[str, tuple[Expr, Expr]] = {
    "exponential": (A * exp(-x), ell * log(A / force)),
    "coth": (A * (coth(x / 2) - 1), ell * log(1 + 2 * A / force)),
    "Bose": (2 * A * exp(-x) / (1 - exp(-x)), ell * log(1 + 2 * A / force)),
    "tanh": (A * (1 - tanh(x)), ell * log(2 * A / force - 1) / 2),
    "sinh": (A / sinh(x), ell * asinh(A / force)),
    "sinh in exponentials": (2 * A * exp(-x) / (1 - exp(-2 * x)), ell * asinh(A / force)),
    "log": (-A * log(1 - exp(-x)), -ell * log(1 - exp(-force / A))),
    "power": (A / x**2, ell * sqrt(A / force)),
}


@pytest.mark.parametrize("name", list(CLOSED))
def test_a_film_is_in_closed_form_where_there_is_one(name: str) -> None:
    """And carries the force: F_adh(h_eq(F)) = F."""
    remote, expected = CLOSED[name]
    found = inverted(remote, h, force)
    assert found is not None
    for strength in (Rational(1, 10), Rational(3, 4)):
        at = {A: Rational(7, 5), ell: Rational(1, 30), force: strength}
        gap = found.subs(at).evalf(30)
        assert abs(gap / expected.subs(at).evalf(30) - 1) < 1e-25
        assert abs(remote.subs(h, gap).subs(at).evalf(30) / strength - 1) < 1e-25


def test_what_has_no_closed_form_is_not_inverted() -> None:
    for remote in (A * exp(-x) - B / h, A * exp(-x) * (1 + x), A * exp(-x) + A * exp(-h / far), A * (x + x**2)):
        assert inverted(remote, h, force) is None


@pytest.mark.slow
def test_films_without_a_leading_form_and_forms_without_a_film_are_told() -> None:
    """The two lists are of one law: where they differ, the text says so."""
    found = films_of("power")
    (film,) = {film.side: film for film in found.films if film.stable}.values()
    text = regimes_text(discover(law_of("power")), replace(found, films=(replace(film, stable=False, found=False),)))
    assert "none such at the typical parameters" in text
    assert "found in numbers only" in text


def number(form: Expr, at: dict[Symbol, Any]) -> float:
    values = {R: 1, E: 1, Symbol("eta", positive=True): 1, **at}
    arguments = sorted(form.free_symbols, key=str)
    return float(lambdify(arguments, form, "mpmath")(*(values[symbol] for symbol in arguments)))


@pytest.mark.slow
def test_a_saddle_parts_stable_films_from_unstable_ones() -> None:
    """A exp(-h/ell) - B (R/h)^2 is attractive up to 1e-4 R and beyond about 9 ell, and largest in between.

    With the gap, unstable where it grows (pulled, then pressed), stable where it falls (pressed, then pulled), and
    unstable where the attraction fades.
    """
    found = [(branch.stable, branch.force[0] > 0) for branch in films_of("two films").branches]
    assert found == [(False, False), (False, True), (True, True), (True, False), (False, False)]


@pytest.mark.parametrize("side", [1, -1])
def test_a_film_as_deep_as_the_model_reaches_is_found(side: int) -> None:
    """At gaps far below its range, F_adh is that of delta = 0.9 R: (4/9) E a delta with a = sqrt(2 R delta)."""
    strength = side * Rational(4, 9) * sqrt(Rational(18, 10)) * Rational(9, 10)
    law = changed(F_adh=strength * E * R**2 * exp(-h / ell), parameters={ell: LENGTH}, typical={ell: R / 1000})
    (branch,) = branches(law)
    assert branch.h[0] == GAPS[0]
    # h/ell = 1e-7 there
    assert branch.force[0] == pytest.approx(float(strength), rel=2e-7)
    assert branch.stable is (side > 0)


@pytest.mark.slow
def test_a_law_without_a_remote_force_has_no_film() -> None:
    assert find_films(discover(changed())) is None


def test_nothing_is_said_in_numbers_of_a_law_that_gives_none() -> None:
    """Neither in the text nor on the page."""
    law = changed(**{**LAWS["exponential"], "typical": {A: E * R**2 / 10**4}})
    diagram = discover(law)
    found = find_films(diagram)
    assert found is not None
    assert found.branches is None
    assert "in numbers: unknown, since the law gives no typical values of all of its parameters" in regimes_text(
        diagram, found
    )
    assert "typical parameters" not in " ".join(summary([], diagram, found))


@pytest.mark.slow
def test_an_edge_without_a_force_is_told_as_one() -> None:
    films = replace(films_of("power"), films=(Film("1", "2", "compression", None, None, None, None),))
    text = regimes_text(discover(law_of("power")), films)
    assert "1 (closing) | 2 (opening): no film beyond this line" in text
    assert "None" not in text
