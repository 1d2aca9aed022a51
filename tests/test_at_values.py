"""Regimes at real values: in SI units, whatever these are; what is said of errors holds; what is absent is told."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Abs, Expr, LambertW, Rational, Symbol, erf, erfc, exp, lambdify, log, oo, pi, sign, sin, sqrt

from softdyn.cli import main
from softdyn.derive import ENERGY, FORCE, LENGTH, PRESSURE, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.cones import shared_facets
from softdyn.derive.law import sizes_asked
from softdyn.derive.laws.dlvo import law as dlvo
from softdyn.derive.laws.droplet import law as droplet
from softdyn.derive.laws.droplet import sigma
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.regimes import Diagram, discover
from softdyn.errors import SceneError
from softdyn.findings import films_of, regimes_of
from softdyn.study import phases, presence
from softdyn.study.findings_text import regimes_data, regimes_text
from softdyn.study.law_page import page
from softdyn.study.notation import Numbers
from softdyn.study.plane import margins, plane_of, states
from softdyn.study.presence import presence_of
from softdyn.study.values import RealValues, at_values, read_values, require_sizes, si_unit

Pi0, kD, s0 = (Symbol(name, positive=True) for name in ("Pi0", "kD", "s0"))
BUBBLES = "R=50e-6,sigma=.03,Pi0=1e5,kD=5e-9"


def bubbles(**changes: Any) -> ContactLaw:
    """Droplets with a disjoining pressure, and nothing that is typical."""
    about: dict[str, Any] = {
        "name": "bubbles", "a": droplet.a, "F_ela": droplet.F_ela, "zeta": droplet.zeta,
        "F_adh": pi * a**2 * Pi0 * exp(-h / kD),
        "parameters": {sigma: FORCE / LENGTH, Pi0: PRESSURE, kD: LENGTH},
    }  # fmt: skip
    return ContactLaw(**{**about, **changes})


bare = bubbles()


def real(law: ContactLaw, text: str) -> RealValues:
    found = at_values(law, read_values([text]))
    assert isinstance(found, RealValues)
    return found


@cache
def diagram_at(text: str) -> tuple[RealValues, Diagram]:
    values = real(bare, text)
    return values, regimes_of(values.law)


# --------------------------------------------------------------------------------------------------------- the values


@settings(deadline=None)
@given(st.integers(-9, 9), st.integers(-9, 9), st.integers(-9, 9))
def test_units_of_length_force_and_time_change_nothing_but_the_units(length: int, load: int, time: int) -> None:
    """Values in micrometres and nanonewtons are the same values in units of R, E and eta."""
    powers = {"R": (1, 0, 0), "E": (-2, 1, 0), "eta": (-2, 1, 1), "A": (1, 1, 0), "ell": (1, 0, 0), "Pi0": (-2, 1, 0)}
    si = {"R": 1e-5, "E": 1e5, "eta": 1e-3, "A": 1e-20, "ell": 1e-8, "Pi0": 3e4}
    unit = {n: Rational(10) ** (p * length + q * load + r * time) for n, (p, q, r) in powers.items()}
    exact = read_values([",".join(f"{name}={value}" for name, value in si.items())])
    one, other = at_values(dlvo, exact), at_values(dlvo, {name: exact[name] * unit[name] for name in exact})
    assert isinstance(one, RealValues)
    assert isinstance(other, RealValues)
    assert one.law.typical == other.law.typical


def test_what_is_not_given_is_typical_of_what_is() -> None:
    """Without E in the law, typical values in E are over the one that sigma stands for."""
    from softdyn.derive.laws.soap_film import law

    found = real(law, "R=1e-4,sigma=.03")
    assert found.values == pytest.approx(
        {R: 1e-4, sigma: 0.03, **{s: {"Pi0": 333 * 300, "ell": 1e-8}[s.name] for s in found.taken}}
    )
    assert {s.name for s in found.taken} == {"Pi0", "ell"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "NAME=VALUE is expected"),
        ("R", "NAME=VALUE is expected"),
        ("R=nan", "a decimal number is expected"),
        ("R=inf", "a decimal number is expected"),
        ("R=1e999", "must lie between"),
        ("R=1_0", "a decimal number is expected"),
        ("R=__import__('os').getpid()", "a decimal number is expected"),
        ("R=" + "9" * 10_000, "a decimal number is expected"),
        ("R=-1", "must be positive"),
        ("R=0", "must be positive"),
        ("R=1,R=2", "is given twice"),
        ("sgima=.03", "did you mean 'sigma'"),
        ("E=1e5", "has no such parameter: leave it out; there are R, eta, Pi0, kD, sigma"),
        ("R=50e-6", r"Pi0 \(Pa\), kD \(m\), sigma \(N/m\) are not given"),
        ("R=50e-6,sigma=.03,Pi0=1e5", r"kD \(m\) is not given.*write --at R=5e-05,sigma=0.03,Pi0=100000,kD=\.\.\."),
        ("R=1,sigma=1,Pi0=1e90,kD=1", "are all values in SI units"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_with_the_reason(text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        at_values(bare, read_values([text]))


def test_a_value_outside_its_range_is_refused() -> None:
    with pytest.raises(SceneError, match=r"--at nu=0.7 lies outside of its range, -1 < nu <= 1/2"):
        at_values(dlvo, read_values(["nu=.7"]))


def test_units_are_written_as_by_hand() -> None:
    assert [si_unit(d) for d in (LENGTH, FORCE / LENGTH, PRESSURE, 1 / LENGTH, FORCE**2 / LENGTH)] == [
        "m", "N/m", "Pa", "1/m", "N^2/m",
    ]  # fmt: skip


# ----------------------------------------------------------------------------------------------------------- in numbers


def number(text: str, x: float, kappa: float) -> float:
    """Value of a form as it is written: a number, its unit, powers of kappa and x."""
    value = float(text.split()[0])
    for name, power in re.findall(r"\b(kappa|x)\b(?:\^\(?(-?\d+(?:/\d+)?)\)?)?", text):
        value *= {"kappa": kappa, "x": x}[name] ** float(Rational(power or 1))
    return value


@pytest.mark.slow
@pytest.mark.parametrize("side", [1, -1])
def test_forms_in_numbers_are_the_laws_own_in_SI_units(side: int) -> None:
    """Deep in a regime, against the four expressions with all values in SI units."""
    values, diagram = diagram_at(BUBBLES)
    at = {**values.values, eta: 1.0}
    words = Numbers(values)
    exact = {name: lambdify((h, delta), form.subs(a, bare.a).subs(at)) for name, form in
             {"zeta": bare.zeta, "F_adh": bare.F_adh, "F_ela": bare.F_ela, "a": bare.a}.items()}  # fmt: skip
    gap, deflection = 1e-12, side * 1e-18
    load = exact["F_ela"](gap, deflection)
    x, kappa = gap / 50e-6, abs(load) / (50e-6 * 0.03)
    shown = plane_of(diagram)
    (regime,) = [
        regime for regime in diagram.regimes
        if (regime.side == "compression") == (side > 0) and regime.inside
        and margins(regime, shown, np.array([math.log10(x)]), np.array([math.log10(kappa)]))[0] > 0
    ]  # fmt: skip
    for name in ("zeta", "F_adh", "a"):
        written = number(words.form(name, regime.forms[name].leading), x, kappa)
        assert written == pytest.approx(exact[name](gap, deflection), rel=2e-3)
    assert number(words.form("delta", regime.forms["delta"].leading), x, kappa) == pytest.approx(
        abs(deflection), rel=2e-3
    )
    rate = -(load - exact["F_adh"](gap, deflection)) / exact["zeta"](gap, deflection)
    assert number(words.form("dh_dt", regime.forms["dh_dt"].leading), x, kappa) == pytest.approx(rate, rel=2e-3)


@pytest.mark.slow
def test_everything_is_told_in_numbers() -> None:
    values, diagram = diagram_at(BUBBLES)
    text = regimes_text(diagram, films_of(diagram), presence_of(diagram), values)
    assert "at R = 5e-05 m, Pi0 = 100000 Pa, kD = 5e-09 m, sigma = 0.03 N/m" in text
    assert "eta is not given: friction is told over eta, and rates times eta" in text
    assert "1 | 2: h = 2.5e-05 m" in text
    body = text[: text.index("films, where")]
    assert not re.search(r"\b(sigma|Pi0|kD)\b", body[body.index("compression, F > 0") :])
    assert " E " not in text


@pytest.mark.slow
def test_the_films_are_at_the_real_values() -> None:
    """The disjoining pressure is Laplace's, 2 sigma/R: h = kD ln(Pi0 R/(2 sigma)), 22 nm."""
    values, diagram = diagram_at(BUBBLES)
    films = films_of(diagram)
    assert films is not None
    assert films.branches
    thinnest = min(branch.h[0] for branch in films.branches if branch.stable) * values.length
    assert thinnest == pytest.approx(5e-9 * math.log(1e5 * 50e-6 / (2 * 0.03)), rel=0.01)


def test_json_holds_the_values_and_is_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["regimes", "rognon_gay", "--at", "R=1e-3,E=1e5,eta=1e-3", "--json"]) == 0
    data = json.loads(capsys.readouterr().out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert data["at"]["values"] == {"R": 1e-3, "E": 1e5, "eta": 1e-3}
    assert all(regime["numbers"]["forms"] for regime in data["regimes"])


# ------------------------------------------------------------------------------------------------------ what is there


@pytest.mark.parametrize("law", [rognon_gay, real(bare, BUBBLES).law], ids=["paper", "bubbles"])
def test_forms_are_off_by_no_more_than_is_said(law: ContactLaw) -> None:
    """At random points inside by the factor that is told, up to what lies between the points of its grid."""
    diagram = regimes_of(law)
    shown = plane_of(diagram)
    rng = np.random.default_rng(5)
    X, Y = rng.uniform(*shown.xlim, 4000), rng.uniform(*shown.ylim, 4000)
    compared = 0
    for (side, name), found in presence_of(diagram).items():
        regime = diagram.regime(name, side)
        exact = states(law, side, 10**X, shown.unit * 10**Y)
        off = presence.errors_at(regime, shown, exact, X, Y)
        for error, factor in found.factors.items():
            if factor is not None:
                margin = margins(regime, shown, X, Y, within_model=error in found.shallow)
                inside = (margin > math.log10(factor) + 2 / presence.DENSITY) & np.isfinite(exact["delta"])
                assert all(np.all(np.abs(values[inside]) < error) for values in off.values())
                compared += int(inside.sum())
    assert compared > 500


@pytest.mark.slow
def test_a_regime_that_real_values_leave_no_room_is_absent() -> None:
    """The repulsion ends within the rim's own width: kD << h << R is not to be had at kD = R/4."""
    wide = real(bare, "R=50e-6,sigma=.03,Pi0=1e5,kD=1.2e-5")
    diagram = regimes_of(wide.law)
    found = presence_of(diagram)
    narrow = [
        (side, name) for (side, name), one in found.items()
        if not one.there or one.off > 0.3
    ]  # fmt: skip
    assert narrow
    text = regimes_text(diagram, None, found, wide)
    assert text.count("absent there: ") == sum(not one.there for one in found.values())


@pytest.mark.slow
def test_what_is_absent_is_told_with_how_far_it_is_off() -> None:
    """In dlvo a film drawn together needs h >> ell where F << A R/(12 h^2) and F >> E sqrt(R) h^(3/2)."""
    diagram = regimes_of(dlvo)
    found = presence_of(diagram)
    assert not found["compression", "drawn together"].there
    text = regimes_text(diagram, None, found)
    assert "absent there: its conditions hold together at none of the points looked at" in text
    data = regimes_data(diagram, None, found)
    there = {(r["side"], r["name"]): r["presence"]["there"] for r in data["regimes"] if "presence" in r}
    assert there == {key: one.there for key, one in found.items()}


@pytest.mark.slow
def test_a_number_of_order_one_does_not_count_as_small() -> None:
    """A Poisson ratio of 0.3 stays where it is: 1 - nu^2 is not 1."""
    found = regimes_of(at_values(equal_spheres, read_values(["nu=.3"])))  # type: ignore[arg-type]
    nu = next(symbol for symbol in equal_spheres.parameters if symbol.name == "nu")
    assert nu not in found.scales
    assert found.regimes[0].forms["C"].leading.has(nu)


@pytest.mark.slow
def test_values_alike_give_a_sum_of_them_its_sign() -> None:
    """2 sigma - Pi0 R at Pi0 R = 4 sigma, and at sigma = 4 Pi0 R: thresholds are positive either way."""
    for pressure, tension in ((2, 1), (1, 4)):
        law = bubbles(typical={sigma: E * R * tension, Pi0: E * pressure, kD: R / 1000})
        diagram = regimes_of(law)
        shown = plane_of(diagram)
        for regime in diagram.regimes:
            for condition in regime.conditions:
                threshold = condition.large if condition.small in (h, Symbol("F", positive=True)) else condition.small
                assert threshold.subs({**shown.values, h: Rational(1, 7)}).evalf() > 0


# -------------------------------------------------------------------------------------- what is not known is not drawn


def test_a_law_whose_sizes_are_not_known_is_asked_for_them(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Thresholds such as 2 sigma - Pi0 R have no sign without them."""
    with pytest.raises(
        SceneError, match=r"no typical value of Pi0, kD, sigma.*--at R=\.\.\.,Pi0=\.\.\..*Pi0: number\*E"
    ):
        require_sizes(bare)
    diagram = regimes_of(bare)
    assert not any(regime.forms for regime in diagram.regimes)
    assert all("no typical value of Pi0, kD, sigma" in regime.undecided["delta"] for regime in diagram.regimes)
    file = tmp_path / "bare.py"
    file.write_text(
        "from sympy import Symbol, exp\nfrom softdyn.derive import E, R, LENGTH, ContactLaw, h\n"
        "from softdyn.derive.laws.rognon_gay import law as paper\nell = Symbol('ell', positive=True)\n"
        "law = ContactLaw(name='bare', a=paper.a, F_ela=paper.F_ela, zeta=paper.zeta,\n"
        "                 F_adh=E*R**2*exp(-h/ell), parameters={ell: LENGTH})\n"
    )
    assert main(["regimes", str(file)]) == 2
    assert "--at R=...,E=...,ell=..." in capsys.readouterr().err


def test_a_tension_that_nothing_is_compared_with_is_not_asked_for() -> None:
    assert not sizes_asked(replace(droplet, typical={}))
    assert not sizes_asked(rognon_gay)
    assert sizes_asked(replace(dlvo, typical={Symbol("nu", real=True): Rational(1, 3)}, limits=()))


def doubtful(**changes: Any) -> ContactLaw:
    return replace(rognon_gay, **{"name": "doubtful", "limits": (), **changes})


HALF_DECIDED = {"F_ela": E * a * delta * (2 + sin(log(1 + R / a)))}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "sides"),
    [
        ({"F_ela": E * delta * a * (1 + exp(delta / R))}, ("compression",)),
        pytest.param(HALF_DECIDED, ("compression", "tension"), marks=pytest.mark.slow),
    ],
)
def test_no_condition_is_dropped_against_an_undecided_neighbour(
    changes: dict[str, Any], sides: tuple[str, ...]
) -> None:
    """Every face of a regime is among its conditions."""
    diagram = discover(doubtful(**changes))
    for side in sides:
        here = [regime for regime in diagram.regimes if regime.side == side]
        assert any(regime.forms for regime in here)
        assert any(not regime.forms for regime in here)
        for regime in here:
            faces = [
                normal for other in here if other is not regime for normal in shared_facets(regime.cones, other.cones)
            ]
            assert len(regime.conditions) >= len(set(faces))


@pytest.mark.slow
def test_what_is_undecided_is_hatched_and_named() -> None:
    diagram = discover(doubtful(**HALF_DECIDED))
    figure = phases.phase_diagram(diagram)
    axes = figure.axes[0]
    hatched = [one for one in axes.collections if getattr(one, "hatches", None)]
    assert hatched
    words = " ".join(text.get_text() for text in axes.texts)
    assert "undecided: 2, 3" in words
    assert "has a logarithm" in words


@pytest.mark.slow
def test_a_regime_without_a_rate_is_hatched_and_says_so() -> None:
    diagram = discover(doubtful(zeta=eta * R * (2 + sin(h / R))))
    axes = phases.phase_diagram(diagram).axes[0]
    assert [one for one in axes.collections if getattr(one, "hatches", None)]
    assert any("undecided" in text.get_text() and "dh/dt" in text.get_text() for text in axes.texts)


@pytest.mark.slow
def test_the_axes_have_units(tmp_path: Path) -> None:
    values, diagram = diagram_at(BUBBLES)
    figure = phases.draw(diagram, None, presence_of(diagram), values)
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
    assert labels[0] == ("$h$ (m)", "$F$ (N)")
    assert all(x == "$h$ (m)" for x, _ in labels)
    shown = plane_of(diagram, values)
    # a tick that says 1e-8 m is at log10(1e-8/R)
    axes = figure.axes[0]
    ticks = {text.get_text(): at for at, text in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)}
    assert ticks["$10^{-8}$"] == pytest.approx(math.log10(1e-8 / 50e-6))
    ticks = {text.get_text(): at for at, text in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)}
    assert ticks["$10^{-8}$"] == pytest.approx(math.log10(1e-8 / (0.03 * 50e-6)))
    assert shown.unit == pytest.approx(1)
    assert "at real values" in figure.get_suptitle()


@pytest.mark.parametrize("function", [erf, erfc], ids=["erf", "erfc"])
def test_functions_that_numpy_has_not_are_evaluated(function: Any) -> None:
    """States of a law with a special function, against its own expression in 30 digits."""
    law = bubbles(F_adh=pi * R * kD * Pi0 * function(h / kD), typical={sigma: E * R, Pi0: 100 * E, kD: R / 1000})
    gaps = np.array([1e-5, 1e-3, 3e-3])
    found = states(law, "compression", gaps, np.full(3, 1e-4))["F_adh"]
    exact = [(pi * Rational(100, 1000) * function(Rational(str(gap)) * 1000)).evalf(30) for gap in gaps]
    assert found == pytest.approx([float(value) for value in exact], rel=1e-12)


@pytest.mark.slow
def test_a_law_with_erfc_has_a_report() -> None:
    law = bubbles(F_adh=pi * R * kD * Pi0 * erfc(h / kD), typical={sigma: E * R, Pi0: 100 * E, kD: R / 1000})
    text = page(law)
    assert "Not drawn" not in text
    assert text.count("data:image/svg+xml") >= 2


A = Symbol("A", positive=True)
#: Charged rigid spheres: R = 1 um, a barrier of 2 nN at 2 nm.
rigid = ContactLaw(
    name="rigid_charged", a=sqrt(R * h), F_ela=oo, zeta=6 * pi * eta * R**2 / h,
    F_adh=pi * R * Pi0 * kD * exp(-h / kD) - A * R / (12 * h**2),
    parameters={Pi0: PRESSURE, kD: LENGTH, A: ENERGY},
)  # fmt: skip


def test_films_of_rigid_particles_carry_any_force() -> None:
    """Up to the barrier, wherever the unit of force is; with leading forms where F_adh changes its own."""
    values = real(rigid, "R=1e-6,Pi0=1e5,kD=1e-8,A=1e-20,eta=1e-3")
    diagram = regimes_of(values.law)
    films = films_of(diagram)
    assert films is not None
    assert films.branches
    gaps = np.geomspace(1e-10, 1e-6, 20_000)
    barrier = np.max(math.pi * 1e-6 * 1e5 * 1e-8 * np.exp(-gaps / 1e-8) - 1e-20 * 1e-6 / (12 * gaps**2))
    largest = max(max(branch.force) for branch in films.branches) * values.unit(FORCE)
    assert largest == pytest.approx(barrier, rel=0.01)
    stable = {film.stable for film in films.films if film.side == "compression"}
    assert {True, False} <= stable
    assert not [branch for branch in films.without_form() if branch.side == "compression"]
    # what happens lies within the window
    shown = plane_of(diagram, values)
    assert 10 ** shown.ylim[1] * values.unit(FORCE) * shown.unit > barrier


@pytest.mark.slow
def test_a_notebook_marks_what_is_absent() -> None:
    text = regimes_of(dlvo)._repr_html_()
    assert re.search(r"drawn together</span> \(absent there\)", text)
    assert text.count("absent there") == sum(not one.there for one in presence_of(regimes_of(dlvo)).values())


@pytest.mark.slow
@pytest.mark.parametrize(
    "spring", [log(1 + Abs(delta) / R), Abs(delta / R) ** Rational(3, 2), LambertW(Abs(delta) / R)]
)
def test_a_spring_that_is_written_with_a_sign_is_looked_at_like_any(spring: Expr) -> None:
    """The derivative of sign(delta) holds one that no array has a value of."""
    law = replace(rognon_gay, name="spring", F_ela=E * a * R * sign(delta) * spring, limits=())
    found = presence_of(discover(law))
    assert found
    assert any(one.there for one in found.values())
