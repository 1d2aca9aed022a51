"""Closures: what the stock ones give, and what a declaration is told that is wrong."""

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest
from sympy import Float, Piecewise, Rational, Symbol, pi, sqrt

from softdyn.cli import main
from softdyn.derive.closure import ARGUMENTS, Closure, Re, c, eta, phi, r, rho, settling, slip, viscosity
from softdyn.derive.closure_limits import check_closure_limits, jumps_of
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.law import Limit
from softdyn.errors import LawError

FOLDER = Path(import_module("softdyn.derive.closures").__path__[0])
STOCK = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")


def stock(name: str) -> Closure:
    """A stock closure."""
    return import_module(f"softdyn.derive.closures.{name}").closure


def value(name: str, **at: float) -> float:
    """A stock closure at eta = r = 1 and typical values, but for what is given."""
    closure = stock(name)
    known = {symbol.name: symbol for symbol in (*ARGUMENTS, *closure.parameters)}
    given = {"eta": 1, "r": 1, **at}
    if "c" in given:
        given["phi"] = 1 - given["c"]
    elif "phi" in given:
        given["c"] = 1 - given["phi"]
    values = {**closure.typical, **{known[name]: number for name, number in given.items() if name in known}}
    return float(closure.expression.subs(values))


# a drag over 6 pi, as a multiple of Stokes'; each by hand
@pytest.mark.parametrize(
    ("name", "at", "expected"),
    [
        ("stokes", {}, 1),
        # C_d = 24/Re (1 + 0.15 Re^0.687): 10^0.687 = 4.86407, C_d = 4.15107 at Re = 10
        ("schiller_naumann", {"Re": 10}, 4.15107 * 10 / 24),
        ("schiller_naumann", {"Re": 1e4}, 0.44 * 1e4 / 24),
        # at c = 1: C_d(100) = (0.63 + 0.48)^2 = 1.2321
        ("dallavalle_di_felice", {"Re": 100, "c": 1}, 1.2321 * 100 / 24),
        ("migflow_drag", {"Re": 100, "c": 1}, 1.2321 * 100 / 24),
        # c Re = 10^1.5, where beta is 3.05: (0.63 10^0.75 + 4.8)^2 = 69.6015, over 24, times 2^2.05
        ("dallavalle_di_felice", {"Re": 2 * 10**1.5, "c": 0.5}, 69.6015 / 24 * 2**2.05),
        # c Re = e^1.5: (0.63 e^0.75 + 4.8)^2 = 37.623, over 24, times 2^2.15
        ("migflow_drag", {"Re": 2 * 2.718281828459045**1.5, "c": 0.5}, 37.623 / 24 * 2**2.15),
        # 150 phi/(18 c) + 1.75 Re/18
        ("ergun", {"Re": 18, "c": 0.6}, 150 * 0.4 / (18 * 0.6) + 1.75),
        ("gidaspow", {"Re": 18, "c": 0.6}, 150 * 0.4 / (18 * 0.6) + 1.75),
        # c Re = 10 at c = 0.9: (1 + 0.15 * 4.86407) 0.9^-2.65
        ("gidaspow", {"Re": 10 / 0.9, "c": 0.9}, 1.729611 * 0.9**-2.65),
        # c (10 phi/c^2 + c^2 (1 + 1.5 sqrt(phi))), phi = 0.36: 5.625 + 0.64^3 1.9
        ("beetstra", {"Re": 1e-14, "c": 0.64}, 5.625 + 0.64**3 * 1.9),
        # phi = 0.25, c Re = 1: 0.413/(24 c) (1/c + 3 c phi + 8.4)/(1 + 10^0.75), besides 3.33333 + 0.738281
        ("beetstra", {"Re": 4 / 3, "c": 0.75}, 3.333333 + 0.738281 + 0.413 / 18 * 10.295833 / 6.623413),
        # (c Re = 10, phi = 0.5): c^2 ((1 + 0.15 10^0.687)/c^3 + 23.24 + 6.095699 + 1.25 (0.95 + 0.305))
        ("tenneti", {"Re": 20, "c": 0.5}, 0.25 * (1.729611 * 8 + 23.24 + 0.48 * 0.5 ** (1 / 3) * 16 + 1.25 * 1.255)),
        # 10 phi/c^3 = 40 at phi = 0.5; F_3 = 0.0673 + 0.106 + 0.7424 = 0.9157, Re_s/2 = 5
        ("koch_hill", {"Re": 20, "c": 0.5}, 0.25 * (40 + 5 * 0.9157)),
        # phi = 0.2: (1 + 0.948683 - 0.678967 + 3.228)/(1 + 0.1362 - 0.3392 + 0.06528), at Re = 0
        ("koch_hill", {"Re": 0, "c": 0.8}, 0.64 * 4.497716 / 0.86228),
    ],
)
def test_the_drag_is_what_its_authors_have(name, at, expected):
    assert value(name, **at) == pytest.approx(6 * 3.14159265358979 * expected, rel=2e-5)


@pytest.mark.parametrize(
    ("name", "at", "expected"),
    [
        ("einstein", {"phi": 0.02}, 1.05),
        ("batchelor", {"phi": 0.1}, 1.312),
        ("batchelor", {"phi": 0.1, "B": 7.6}, 1.326),
        ("slides_viscosity", {"phi": 0.1}, 1.3),
        ("krieger_dougherty", {"phi": 0.32}, 2**1.6),
        ("maron_pierce", {"phi": 0.32}, 4),
        ("richardson_zaki", {"Re": 0.1, "c": 0.5}, 2**-4.65),
        ("richardson_zaki", {"Re": 1, "c": 0.5}, 2**-4.45),
        ("richardson_zaki", {"Re": 1e3, "c": 0.5}, 2**-2.39),
        ("carman_kozeny", {"c": 0.5}, 2 / 180),
    ],
)
def test_other_closures_are_what_their_authors_have(name, at, expected):
    assert value(name, **at) == pytest.approx(expected, rel=1e-12)


def test_a_disc_has_the_drag_of_migflow_in_the_plane():
    # A = d in place of pi r^2: the ratio is 2/(pi r)
    closure = stock("migflow_drag")
    assert (closure.in_plane / closure.expression).simplify() == 2 / (pi * r)


@pytest.mark.parametrize("name", STOCK)
def test_every_stock_closure_says_what_it_is(name):
    closure = stock(name)
    assert closure.name == name
    assert closure.description
    assert closure.source
    assert closure.limits


phi_max = Symbol("phi_max", positive=True)
WRONG = {
    "dimension": ({"expression": pi * eta * r**2}, "friction (force/velocity) is expected"),
    "sum": ({"expression": pi * eta * r + rho * slip}, "combines"),
    "misspelt": ({"expression": pi * eta * r * Symbol("Rey", positive=True)}, "did you mean 'Re'?"),
    "assumptions": ({"expression": pi * eta * r * Symbol("Re")}, "another symbol than softdyn's"),
    "inexact": ({"expression": Float("0.15") * eta * r}, "is inexact"),
    "gives": ({"gives": "lift", "expression": eta * r}, "one of drag, viscosity, permeability, settling"),
    "undeclared": ({"expression": eta * r * phi_max}, "'phi_max' is not allowed here"),
    "taken": ({"expression": eta * r, "parameters": {Symbol("slip", positive=True): DIMENSIONLESS}}, "already"),
    "negative": ({"expression": eta * r * (1 - 2 * phi)}, "must be positive, but at c="),
    "plane": ({"gives": "viscosity", "expression": eta, "in_plane": eta}, "in_plane is of a drag"),
    "order": ({"expression": eta * r, "limits": (Limit("x", (Re,), {}),)}, "order must hold sizes"),
    "both": ({"expression": eta * r, "limits": (Limit("x", ((c, 1), (phi, 1)), {}),)}, "both c and phi"),
    "compared": (
        {"expression": eta * r, "limits": (Limit("x", (r, 1), {}),)},
        "order compares dimensionless with length",
    ),
    "claim": ({"expression": eta * r, "limits": (Limit("x", (Re, 1), {"Cd": Re}),)}, "cannot claim 'Cd'"),
    "claimed": (
        {"expression": eta * r, "limits": (Limit("x", (Re, 1), {"drag": eta}),)},
        "friction (force/velocity) is expected",
    ),
    "other": (
        {"expression": eta * r, "limits": (Limit("x", (Re, 1), {viscosity: eta}),)},
        "one can claim 'drag', 'C_d'",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_declaration_is_told_what_is_wrong(name):
    declared, words = WRONG[name]
    with pytest.raises(LawError) as told:
        Closure(**{"name": "wrong", "gives": "drag", **declared})
    assert words in str(told.value)


def test_all_faults_are_told_at_once():
    with pytest.raises(LawError) as told:
        Closure(
            name="Wrong",
            gives="drag",
            expression=eta * r * sqrt(r),
            typical={phi: Rational(1, 2)},
            limits=(Limit("x", (Re, 1), {"Cd": Re}),),
        )
    assert len(told.value.faults) == 4


# ---------------------------------------------------------------------------------------------------------- limits


@pytest.mark.parametrize("name", STOCK)
def test_every_limit_of_a_stock_closure_is_proved(name):
    for finding in check_closure_limits(stock(name)):
        assert finding.verdict == "proved", f"{finding.limit}, {finding.quantity}: {finding.reason}"
        assert finding.samples > 0


def claiming(name: str, order, claims) -> Closure:
    """A stock closure that claims something else."""
    return replace(stock(name), limits=(Limit("other", order=order, claims=claims),))


STOKES = 6 * pi * eta * r
ERGUN = 50 * pi * eta * r * phi / c


@pytest.mark.parametrize(
    ("name", "order", "claims", "ratio"),
    [
        # 4.8^2/24: Dallavalle does not tend to Stokes
        ("dallavalle_di_felice", ((Re, 1), (phi, 1)), {"drag": STOKES}, Rational(24, 25)),
        ("migflow_drag", ((Re, 1), (phi, 1)), {"drag": STOKES}, Rational(24, 25)),
        # Di Felice, and MigFlow, over Ergun
        ("dallavalle_di_felice", (Re, 1), {"drag": ERGUN}, Rational(72, 625) * c ** -Rational(17, 10) / (1 - c)),
        ("migflow_drag", (Re, 1), {"drag": ERGUN}, Rational(72, 625) * c ** -Rational(18, 10) / (1 - c)),
        # 0.63^2 = 0.3969 against Newton's 0.44
        ("dallavalle_di_felice", ((1, Re), (phi, 1)), {"C_d": Rational(44, 100)}, Rational(3969, 4400)),
        # Ergun's viscous drag against that of Carman and Kozeny
        ("ergun", (Re, 1), {"drag": 60 * pi * eta * r * phi / c}, Rational(5, 6)),
        ("slides_viscosity", (phi, 1), {viscosity / eta - 1 - 5 * phi / 2: 31 * phi**2 / 5}, Rational(25, 31)),
        ("einstein", (phi, 1), {viscosity / eta - 1: 2 * phi}, Rational(5, 4)),
        ("richardson_zaki", ((phi, 1), (1, Re)), {1 - settling: 5 * phi}, Rational(239, 500)),
    ],
)
def test_a_wrong_claim_is_disproved_with_its_ratio(name, order, claims, ratio):
    (finding,) = check_closure_limits(claiming(name, order, claims))
    assert finding.verdict == "disproved"
    assert (finding.ratio - ratio).simplify() == 0


def test_what_vanishes_against_its_claim_is_told():
    # dilute, Ergun's drag vanishes
    (finding,) = check_closure_limits(claiming("ergun", ((Re, 1), (phi, 1), (Re, phi)), {"drag": STOKES}))
    assert finding.verdict == "disproved"
    assert finding.reason.endswith("which tends to 0")


def test_a_dense_limit_is_in_what_is_left_to_the_densest_packing():
    law = stock("maron_pierce")
    (packing,) = law.parameters
    (finding,) = check_closure_limits(
        claiming("maron_pierce", (packing - phi, 1), {"viscosity": eta / (packing - phi)})
    )
    assert finding.verdict == "disproved"
    assert (finding.ratio - packing**2 / (packing - phi)).simplify() == 0
    assert finding.reason.endswith("which tends to infinity")


def test_gidaspows_switch_jumps():
    jumps = {(jump.symbol, jump.at): jump for jump in jumps_of(stock("gidaspow"))}
    jump = jumps[c, Rational(4, 5)]
    # at Re = 0: Ergun's 150 0.2/(18 0.8) over Wen & Yu's 0.8^-2.65
    assert float(jump.ratio.subs(Re, Rational(1, 10**20))) == pytest.approx(
        150 * 0.2 / (18 * 0.8) * 0.8**2.65, rel=1e-9
    )
    assert (jump.left / jump.right / jump.ratio).subs(Re, 10).evalf() == pytest.approx(1)


def test_schiller_naumann_and_newton_do_not_quite_meet():
    (jump,) = jumps_of(stock("schiller_naumann"))
    # C_d = 0.024 (1 + 0.15 1000^0.687) against 0.44
    assert float(jump.ratio) == pytest.approx(0.024 * (1 + 0.15 * 1000**0.687) / 0.44, rel=1e-12)


def test_cases_that_meet_do_not_jump():
    drag = eta * r * Piecewise((1 + Re, Re < 1), (2 * Re, True))
    assert jumps_of(Closure(name="met", gives="drag", expression=drag)) == []
    assert jumps_of(stock("stokes")) == []


# ------------------------------------------------------------------------------------------------ the command line

OSEEN = """
from sympy import Rational, pi
from softdyn.derive.closure import Closure, Re, eta, r
from softdyn.derive.law import Limit

oseen = Closure(
    name="oseen", gives="drag",
    expression=6*pi*eta*r*(1 + Rational(3, 16)*Re),
    limits=[Limit("Stokes", order=(Re, 1), claims={{"C_d": {claim}/Re}})],
)
"""


@pytest.mark.parametrize(("claim", "verdict", "status"), [(24, "proved", 0), (25, "disproved", 1)])
def test_a_closure_of_a_user_is_checked(claim, verdict, status, tmp_path, capsys):
    file = tmp_path / "oseen.py"
    file.write_text(OSEEN.format(claim=claim))
    assert main(["check", str(file)]) == status
    told = capsys.readouterr().out
    assert f"  {verdict:10}C_d ~ {claim}/Re" in told
    assert f"found/claimed -> {'1' if claim == 24 else '24/25'} as 1 + (3*Re/16)" in told
    assert main(["check", f"{file}:oseen", "--json"]) == status
    assert json.loads(capsys.readouterr().out)[verdict] == 1


def test_a_stock_closure_is_checked_with_its_jumps(capsys):
    assert main(["check", "richardson_zaki"]) == 0
    told = capsys.readouterr().out
    assert "3 proved" in told
    # 0.6^-0.1 at c = 3/5
    assert "richardson_zaki jumps at Re = 1: below/above = c**(-1/10), 1.0524 at c = 3/5" in told


def test_stock_closures_are_listed(capsys):
    assert main(["closures"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == STOCK


def test_where_a_law_is_asked_for_a_closure_is_refused(capsys):
    assert main(["generate", "stokes", "--target", "c"]) == 2
    assert "'stokes' is a closure, and a law is asked for" in capsys.readouterr().err
    assert main(["check", "ergum"]) == 2
    assert "did you mean 'ergun'?" in capsys.readouterr().err


def test_a_faulty_closure_of_a_user_is_told_its_faults(tmp_path, capsys):
    file = tmp_path / "wrong.py"
    file.write_text(OSEEN.format(claim=24).replace("eta*r*", "eta*r**2*"))
    assert main(["check", str(file)]) == 2
    assert "closure 'oseen' has 1 fault" in capsys.readouterr().err
