"""Regimes of laws with exponents that are parameters are those of the law with numbers in their place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from sympy import Abs, Expr, Integer, Rational, S, Symbol, pi, sqrt

from softdyn.cli import main
from softdyn.derive import DIMENSIONLESS, FORCE, LENGTH, ContactLaw, E, F, Limit, R, a, delta, eta, h
from softdyn.derive.films import find_films
from softdyn.derive.limits import check_limits
from softdyn.derive.regimes import discover
from softdyn.study.findings_text import regimes_text

n, m = Symbol("n", positive=True), Symbol("m", positive=True)
A, ell = Symbol("A", positive=True), Symbol("ell", positive=True)
hbar = R * h / (R + h)


def power_law(power: Expr, remote: Expr = S.Zero, order: Any = (h, delta, R), **more: Any) -> ContactLaw:
    """Spheres whose force grows as a power of the deflection: Hertz's have 3/2."""
    stiffening = Rational(1, 2) if power == Rational(3, 2) else power - 1
    return ContactLaw(
        name="power_law",
        a=sqrt(2 * R * (hbar + Abs(delta))),
        F_ela=E * R * delta * (Abs(delta) / R) ** stiffening,
        zeta=3 * pi * eta * a**4 / (2 * hbar**3),
        F_adh=remote,
        limits=(Limit("thin", order, {"delta": R * (F / (E * R**2)) ** (1 / power)}),),
        **more,
    )


@pytest.mark.slow
def test_an_exponent_has_its_typical_value_and_the_text_says_so() -> None:
    symbolic = power_law(n, parameters={n: DIMENSIONLESS}, ranges={n: (1, 3)}, typical={n: Rational(3, 2)})
    found, numeric = discover(symbolic), discover(power_law(Rational(3, 2)))
    assert found.law is symbolic
    assert found.exponents == {n: Rational(3, 2)}
    assert numeric.exponents == {}
    for part in ("regimes", "crossovers", "points", "conservative", "scales"):
        assert getattr(found, part) == getattr(numeric, part)
    assert "n at its typical value 3/2\n" in regimes_text(found)
    assert regimes_text(found).replace("n at its typical value 3/2\n", "") == regimes_text(numeric)


def test_limits_are_proved_at_any_exponent() -> None:
    (claim,) = check_limits(
        power_law(n, parameters={n: DIMENSIONLESS}, ranges={n: (1, 3)}, typical={n: Rational(3, 2)})
    )
    assert claim.verdict == "proved"
    assert "at any fixed n" in claim.holds


@pytest.mark.parametrize("power", [pi, n])
def test_what_has_no_rational_value_is_undecided(power: Expr) -> None:
    """Pi is no rational number, and n without a typical value is none that is known."""
    found = discover(power_law(power, parameters={n: DIMENSIONLESS} if power == n else {}))
    assert found.exponents == {}
    for regime in found.regimes:
        assert "delta" not in regime.forms
        assert "no rational number" in regime.undecided["delta"]


@pytest.mark.slow
def test_exponents_of_a_remote_force_have_their_values_too() -> None:
    """Films as well; an exponent far from 1, as 12, is no size that scales."""
    given: dict[str, Any] = {"parameters": {A: FORCE, ell: LENGTH}, "typical": {A: E * R**2 / 10**6, ell: R / 100}}

    def law(power: Expr, steepness: Expr, **own: Any) -> ContactLaw:
        more = {key: {**value, **own.get(key, {})} for key, value in given.items()}
        return power_law(power, A * (ell / (ell + h)) ** steepness, ((ell, h, delta, R), (A, F)), **more)

    known = {n: Rational(3, 2), m: Integer(12)}
    found = discover(law(n, m, parameters=dict.fromkeys(known, DIMENSIONLESS), typical=known))
    numeric = discover(law(*known.values()))
    assert found.exponents == known
    for part in ("regimes", "crossovers", "points", "conservative", "scales"):
        assert getattr(found, part) == getattr(numeric, part)
    assert "thin" in {regime.name for regime in found.regimes}
    films = find_films(found)
    assert films is not None
    assert films.films
    assert films == find_films(numeric)


LAW = """
from sympy import Abs, Rational, Symbol, pi, sqrt
from softdyn.derive import DIMENSIONLESS, ContactLaw, E, R, a, delta, eta, h
n, hbar = Symbol("n", positive=True), R*h/(R + h)
law = ContactLaw(
    name="spheres", a=sqrt(2*R*(hbar + Abs(delta))), F_ela=E*R*delta*(Abs(delta)/R)**(n - 1),
    zeta=3*pi*eta*a**4/(2*hbar**3), parameters={n: DIMENSIONLESS}, ranges={n: (1, 3)}, typical={n: Rational(3, 2)},
)
"""


@pytest.mark.slow
def test_the_command_finds_them_at_a_given_exponent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "spheres.py"
    file.write_text(LAW, encoding="utf-8")
    assert main(["regimes", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["exponents"] == {"n": "3/2"}
    assert main(["regimes", str(file), "--at", "R=50e-6,E=1e5,eta=1e-3,n=2"]) == 0
    told = capsys.readouterr().out
    assert "n = 2" in told
    assert "delta  ~ 5e-05 m kappa^(1/2)" in told
    assert main(["report", str(file), "-o", str(tmp_path / "spheres.html")]) == 0
    assert "Exponents are at their typical values" in (tmp_path / "spheres.html").read_text(encoding="utf-8")
