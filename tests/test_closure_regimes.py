"""Regimes of closures: leading forms, exact crossovers, what they become at the ends, signs, pictures."""

import json
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from sympy import Rational, Symbol, exp, pi, sin

from softdyn.cli import main
from softdyn.derive.closure import Closure, Re, c, densest, eta, phi, r
from softdyn.derive.closure_dynamics import derived
from softdyn.derive.closure_regimes import ClosureDiagram, discover_closure
from softdyn.derive.closure_signs import signs_of_closure
from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.errors import LawError
from softdyn.study.closure_plane import in_numbers, margins, points, presence_of_closure
from softdyn.study.closure_text import signs_of_closure_text

FOLDER = Path(import_module("softdyn.derive.closures").__path__[0])
STOCK = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")


def stock(name: str) -> Closure:
    """A stock closure."""
    return import_module(f"softdyn.derive.closures.{name}").closure


@cache
def diagram_of(name: str) -> ClosureDiagram:
    """The regimes of a stock closure, found once."""
    return discover_closure(stock(name))


def same(one, other) -> bool:
    """Whether two expressions have the same value at a point that is no simple one."""
    at = {phi: Rational(3, 10), Re: 7, eta: 2, r: 3}
    return abs(complex((one - other).subs({c: 1 - phi}).subs(at).evalf())) < 1e-12


def test_ergun_goes_from_blake_and_kozeny_to_burke_and_plummer():
    diagram = diagram_of("ergun")
    slow, fast = diagram.regime("Blake-Kozeny"), diagram.regime("Burke-Plummer")
    assert same(slow.form.leading, 50 * pi * eta * r * phi / c)
    assert same(fast.form.leading, 7 * pi * eta * r * Re / 12)
    # 150 phi/(18 c) = 1.75 Re/18
    (crossover,) = diagram.crossovers
    assert same(crossover.line.rhs, 600 * phi / (7 * c))
    assert [str(x) for x in (*slow.conditions, *fast.conditions)] == [
        "Re << 600*phi/(7*c)",
        "600*phi/(7*c) << Re",
    ]
    assert slow.ends["dilute"].verdict == slow.ends["dense"].verdict == "proved"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dallavalle_di_felice", "migflow_drag"])
def test_dallavalles_forms_cross_where_both_terms_are_equal(name):
    # 0.63 sqrt(c Re) = 4.8
    (crossover,) = diagram_of(name).crossovers
    assert same(crossover.line.rhs, (Rational(480, 63)) ** 2 / c)


def test_a_case_that_ends_has_a_regime_between():
    diagram = diagram_of("schiller_naumann")
    assert [regime.name for regime in diagram.regimes] == ["Stokes", "inertial", "Newton"]
    # 0.15 Re^0.687 = 1, well before Re = 1000
    (crossover,) = diagram.crossovers
    assert float(crossover.line.rhs) == pytest.approx(0.15 ** (-1 / 0.687), rel=1e-12)
    between = 6 * pi * eta * r * Rational(15, 100) * Re ** Rational(687, 1000)
    assert same(diagram.regime("inertial").form.leading, between)
    assert diagram.regime("Newton").exact


@pytest.mark.slow
def test_gidaspow_has_the_regimes_of_both_laws_each_in_its_case():
    diagram = diagram_of("gidaspow")
    assert len(diagram.regimes) == 5
    ergun, wen_yu = diagram.regime("Blake-Kozeny"), diagram.regime("Stokes")
    assert "dilute" not in ergun.ends
    assert wen_yu.ends["dilute"].name == "Stokes"
    assert "dense" not in wen_yu.ends
    assert {str(jump.at) for jump in diagram.jumps} == {"1000/c", "4/5"}


def test_where_re_is_of_order_one_a_case_stands_as_it_is():
    diagram = diagram_of("richardson_zaki")
    between = [regime for regime in diagram.regimes if regime.name.startswith("between")]
    assert len(between) == 2
    assert all(regime.exact for regime in between)


@pytest.mark.slow
def test_a_term_that_is_the_largest_between_is_a_regime():
    # dilute, between Re = 16 and phi^-9.6, 0.15 Re^0.687 is the largest term of Tenneti's drag
    diagram = diagram_of("tenneti")
    viscous, between, _ = diagram.regimes
    assert same(between.form.leading, 6 * pi * eta * r / c * Rational(15, 100) * (c * Re) ** Rational(687, 1000))
    assert all(one.verdict == "proved" for regime in diagram.regimes for one in regime.ends.values())
    assert viscous.ends["dilute"].name == "Stokes"
    # in dense packings it is the largest nowhere
    pairs = [("viscous", "between"), ("viscous", "inertial"), ("between", "inertial")]
    assert [(x.first, x.second) for x in diagram.crossovers] == pairs
    first = diagram.crossovers[0].line.rhs.subs({c: 1 - phi})
    assert float(first.subs(phi, Rational(1, 10**15))) == pytest.approx((1 / 0.15) ** (1 / 0.687), rel=1e-4)


@pytest.mark.slow
def test_a_form_that_fails_at_an_end_is_told():
    # where c vanishes, for 1 << Re << 1/c, Beetstra's denominator is large
    dense = diagram_of("beetstra").regime("inertial").ends["dense"]
    assert dense.verdict == "disproved"
    assert "Re**(5/2)*c**(5/2)/1000" in dense.reason


def test_viscosities_have_ends_dilute_and_dense():
    (regime,) = diagram_of("krieger_dougherty").regimes
    (packing, B) = stock("krieger_dougherty").parameters
    assert densest(stock("krieger_dougherty")) == packing
    assert regime.ends["dilute"].form.corrections == (B * phi,)
    assert regime.ends["dense"].verdict == "proved"
    assert regime.ends["dense"].small == packing - phi


@pytest.mark.slow
@pytest.mark.parametrize("name", STOCK)
def test_every_point_of_the_plane_lies_in_a_regime_of_a_stock_closure(name):
    diagram = diagram_of(name)
    numbers, grains = points(diagram.closure, 41)
    inside = [margins(diagram.closure, regime, numbers, grains) >= 0 for regime in diagram.regimes]
    assert np.sum(inside, axis=0).min() >= 1
    assert all(regime.form is not None for regime in diagram.regimes)


@pytest.mark.slow
@pytest.mark.parametrize("name", STOCK)
def test_forms_are_right_far_within_their_regimes(name):
    diagram = diagram_of(name)
    closure = diagram.closure
    for regime in diagram.regimes:
        if regime.conditions and any(one.verdict != "proved" for one in regime.ends.values()):
            continue
        numbers = np.logspace(-40, 40, 321)
        grains = np.full(numbers.shape, 0.3 if "c >" not in str(regime.case) else 0.1)
        far = margins(closure, regime, numbers, grains) > 20
        ratio = in_numbers(closure, closure.expression / regime.form.state)(numbers, grains)
        assert np.allclose(ratio[far], 1, rtol=1e-4)


def test_errors_are_those_of_the_other_term():
    # of a sum of two terms, each is off by Re/line: 10 % at a factor of ten
    found = presence_of_closure(diagram_of("ergun"))
    for presence in found.values():
        assert presence.factors[0.1] == pytest.approx(10, rel=0.15)
        assert presence.share == 0


def drag(**given) -> Closure:
    return Closure(**{"name": "mine", "gives": "drag", **given})


def test_a_power_that_is_a_parameter_has_no_line_but_two_forms():
    n = Symbol("n", positive=True)
    diagram = discover_closure(
        drag(expression=eta * r * (1 + Re**n), parameters={n: DIMENSIONLESS}, typical={n: Rational(1, 2)})
    )
    assert [str(x.form.leading) for x in diagram.regimes] == ["eta*r", "Re**n*eta*r"]
    assert diagram.crossovers[0].line is None or float(diagram.crossovers[0].line.rhs) == 1


def test_what_the_method_cannot_decide_is_told():
    slow, fast = discover_closure(drag(expression=eta * r * (2 + sin(Re)))).regimes
    assert str(slow.form.leading) == "2*eta*r"
    assert fast.form is None
    assert "sin(Re)" in fast.undecided


@pytest.mark.parametrize("name", STOCK)
def test_the_sign_of_every_stock_closure_is_proved(name):
    assert all(sign.verdict == "proved" for sign in signs_of_closure(stock(name)))


def test_a_closure_that_is_negative_somewhere_is_refused_with_numbers():
    # only for 0.99 < phi, between the points that are looked at
    with pytest.raises(LawError, match="must be positive, but at c="):
        drag(expression=eta * r * (Rational(99, 100) - phi + (1 - phi) / 1000))


def test_what_the_prover_cannot_decide_is_sampled_and_said():
    # exp outgrows every power, which bounds on boxes without end do not show
    hidden = drag(expression=eta * r * (exp(Re) - Re**3 / 10))
    (sign,) = signs_of_closure(hidden)
    assert sign.verdict == "sampled"
    told = signs_of_closure_text(hidden, [sign])
    assert told.startswith(f"drag > 0: not proved; it is so at the {sign.points} points looked at; left: ")


def test_permeability_and_drag_tell_of_each_other():
    # Ergun's viscous term is Carman's with 150 for 180
    (of_drag,) = [x.value for x in derived(stock("ergun")) if x.name == "k"]
    assert same(of_drag, stock("carman_kozeny").expression * Rational(180, 150))
    (resistance,) = [x.value for x in derived(stock("carman_kozeny")) if x.name == "drag"]
    assert same(resistance, 60 * pi * eta * r * phi / c)


def test_the_force_grows_with_the_slip_as_its_derivative_says():
    closure = stock("schiller_naumann")
    (slope,) = [x.value for x in derived(closure) if x.name == "dF_dslip"]

    def force(number: float) -> float:
        return number * float(closure.expression.subs({Re: number, eta: 1, r: 1}))

    step = 1e-5
    assert float(slope.subs({Re: 10, eta: 1, r: 1})) == pytest.approx(
        (force(10 + step) - force(10 - step)) / (2 * step), rel=1e-8
    )


def test_einsteins_coefficient_is_the_intrinsic_viscosity():
    for name in ("einstein", "batchelor", "slides_viscosity"):
        (found,) = [x.value for x in derived(stock(name)) if x.name == "intrinsic"]
        assert found == Rational(5, 2)


def test_the_drag_of_a_sphere_alone_stands_in_one_place():
    from softdyn.derive.law import Drag
    from softdyn.derive.symbols import R

    assert Drag().translation == stock("stokes").expression.subs(r, R)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gidaspow", "schiller_naumann", "maron_pierce", "stokes"])
def test_regimes_are_told_and_drawn(name, tmp_path, capsys):
    picture = tmp_path / "map.png"
    assert main(["regimes", name, "--plot", str(picture)]) == 0
    assert capsys.readouterr().out.startswith(f"{name}: ")
    assert picture.stat().st_size > 10_000
    assert main(["regimes", name, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["closure"] == name
    assert len(data["regimes"]) == len(diagram_of(name).regimes)


def test_values_of_laws_are_refused_of_closures(capsys):
    assert main(["regimes", "ergun", "--numeric"]) == 2
    assert "--numeric is of laws" in capsys.readouterr().err
    assert main(["regimes", "ergun", "--at", "R=1"]) == 2
    said = capsys.readouterr().err
    assert all(words in said for words in ("--at R: ergun is told at values of Re and phi", "Re is missing"))


def test_a_closure_is_told_at_a_point(capsys):
    """Ergun's two terms stand to each other as 150 phi/c to 1.75 Re: at Re = 6, phi = 0.4, as 100 to 10.5."""
    assert main(["regimes", "ergun", "--at", "Re=6,c=0.6", "--json"]) == 0
    there = json.loads(capsys.readouterr().out)["at"]
    # 50 pi eta r (phi/c + 7 Re/600), over 6 pi eta r
    assert there["value"] == pytest.approx((50 * 2 / 3 + 3.5) / 6)
    slow, fast = there["regimes"]
    assert (slow["error"], fast["error"]) == pytest.approx((0.105, 100 / 10.5))
    assert slow["decades"] == pytest.approx(-fast["decades"]) == pytest.approx(np.log10(100 / 10.5))


@pytest.mark.parametrize("form", ["text", "latex", "json"])
def test_what_follows_from_a_closure_is_told(form, capsys):
    assert main(["derive", "ergun", "--format", form]) == 0
    told = capsys.readouterr().out
    assert "75" in told  # k = 2 c^3 r^2/(75 phi^2)
