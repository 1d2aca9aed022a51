"""Closures compared, and a closure of a user from its declaration to its report."""

from importlib import import_module

import pytest

import softdyn
from softdyn.cli import main
from softdyn.derive.closure import Closure
from softdyn.errors import SceneError
from softdyn.laws import stock_closures
from softdyn.study.two_closures import compare_closures


def stock(name: str) -> Closure:
    """A stock closure."""
    return import_module(f"softdyn.derive.closures.{name}").closure


@pytest.mark.slow
def test_di_felice_over_ergun_is_what_is_known_of_it():
    # as Re -> 0, 0.1152 c^-1.7/phi: 5.76/50 times c^-2.7 over phi/c
    compared = compare_closures(stock("dallavalle_di_felice"), stock("ergun"))
    (slow, fast) = compared.regions
    assert slow.ratio == "72/(625*c**(17/10)*phi)"
    assert fast.ratio == "1701/(10000*c**(17/10))"
    row = compared.ratios[compared.fractions.index(0.6)]
    assert row[0] == pytest.approx(0.1152 * 0.4**-1.7 / 0.6, rel=0.01)


def test_a_bed_of_ergun_is_a_fifth_more_permeable_than_carmans():
    compared = compare_closures(stock("carman_kozeny"), stock("ergun"))
    assert compared.gives == "permeability"
    assert compared.regions[0].ratio == "5/6"
    assert compared.ratios[-1][0] == pytest.approx(5 / 6, rel=1e-3)


def test_viscosities_are_compared_by_the_fraction_alone():
    compared = compare_closures(stock("einstein"), stock("maron_pierce"))
    assert len(compared.numbers) == 1
    # 1.25 against (1 - 0.1/0.64)^-2 at phi = 0.1
    row = compared.ratios[compared.fractions.index(0.1)]
    assert row[0] == pytest.approx(1.25 * (1 - 0.1 / 0.64) ** 2)


def test_what_cannot_be_compared_is_refused(capsys):
    with pytest.raises(SceneError, match="einstein gives viscosity, and stokes gives drag"):
        compare_closures(stock("einstein"), stock("stokes"))
    with pytest.raises(SceneError, match="B is 31/5 in batchelor, and 5/2 in krieger_dougherty"):
        compare_closures(stock("batchelor"), stock("krieger_dougherty"))
    assert main(["compare", "stokes", "rognon_gay"]) == 2
    assert "stokes is a closure, and the other is a law" in capsys.readouterr().err


OSEEN = """
from sympy import Rational, pi
from softdyn.derive.closure import Closure, Re, eta, r
from softdyn.derive.law import Limit

oseen = Closure(
    name="oseen", gives="drag",
    expression=6*pi*eta*r*(1 + Rational(3, 16)*Re),
    limits=[Limit("Stokes", order=(Re, 1), claims={"C_d": 24/Re})],
)
"""


def test_a_closure_in_ten_lines_goes_through_all_that_there_is(tmp_path, capsys):
    file, page, picture = tmp_path / "oseen.py", tmp_path / "oseen.html", tmp_path / "oseen.png"
    file.write_text(OSEEN)
    assert main(["check", str(file)]) == 0
    told = capsys.readouterr().out
    assert "1 proved" in told
    assert "drag > 0: proved for Re > 0" in told
    assert main(["regimes", str(file), "--plot", str(picture)]) == 0
    # 3/16 Re = 1
    assert "Stokes | inertial: Re = 16/3" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000
    assert main(["compare", str(file), "stokes"]) == 0
    assert "3*Re/16" in capsys.readouterr().out
    assert main(["derive", str(file)]) == 0
    assert "k = 2*c**2*r**2/(9*phi)" in capsys.readouterr().out
    assert main(["report", str(file), "-o", str(page)]) == 0
    text = page.read_text()
    assert "Closure oseen" in text
    assert 'aria-label="Re = 16/3"' in text
    assert "<script" not in text


def test_closures_are_taken_as_objects_too():
    closure = stock("ergun")
    assert all(finding.verdict == "proved" for finding in softdyn.check(closure))
    assert [regime.name for regime in softdyn.regimes(closure).regimes] == ["Blake-Kozeny", "Burke-Plummer"]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(stock_closures()))
def test_every_stock_closure_has_a_report_with_all_formulas_set(name, tmp_path):
    page = tmp_path / "page.html"
    softdyn.write_report(name, page)
    text = page.read_text()
    assert f"Closure {name}" in text
    assert '<code class="formula">' not in text
