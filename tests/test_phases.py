"""Where the regimes of a law are drawn, and what is drawn of them, against the law's own equations."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline
from numpy.typing import NDArray
from scipy.optimize import brentq
from sympy import Abs, Piecewise, Rational, Symbol, exp, lambdify, pi, sqrt

from softdyn.derive import FORCE, LENGTH, ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.checks import pressed_only
from softdyn.derive.forms import force
from softdyn.derive.regimes import SIGN, Diagram, Side, discover
from softdyn.errors import SceneError
from softdyn.laws import find, load, stock_laws
from softdyn.study import figures, phases, plane
from softdyn.study.exponents import Measurement, Run

hbar = R * h / (R + h)
A, lam = Symbol("A", positive=True), Symbol("lam", positive=True)
SIDES: tuple[Side, ...] = ("compression", "tension")


def repelled(**about: object) -> ContactLaw:
    """The paper's law with an exponential repulsion."""
    return ContactLaw(
        name="film",
        a=sqrt(2 * R * (hbar + Abs(delta))),
        F_ela=Rational(4, 9) * E * a * delta,
        zeta=3 * pi * eta * a**4 / (2 * hbar**3),
        F_adh=A * exp(-h / lam),
        parameters={A: FORCE, lam: LENGTH},
        **about,
    )


@cache
def diagram_of(name: str) -> Diagram:
    if name == "film":
        return discover(repelled(typical={A: E * R**2 / 10**4, lam: R / 1000}))
    return discover(load(find(name))[0])


#: Those that take longer to discover are drawn with the slow tests.
QUICK = ("rognon_gay", "film", "cone")
SLOW = tuple(name for name in stock_laws() if name not in QUICK)
EVERY = [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)]


def window(name: str, count: int) -> tuple[plane.Plane, NDArray, NDArray]:
    """Plane of a law, and points spread evenly over its window."""
    shown = plane.plane_of(diagram_of(name))
    points = np.random.default_rng(7).uniform(size=(count, 2))
    return shown, *(low + (high - low) * points[:, i] for i, (low, high) in enumerate((shown.xlim, shown.ylim)))


def number(form: object, shown: plane.Plane, X: NDArray, Y: NDArray) -> NDArray:
    """Value of a form in h, F and the parameters at points of the plane."""
    value = lambdify((h, force), form.subs(shown.values), "numpy")(10**X, shown.unit * 10**Y)
    return np.broadcast_to(value, X.shape)


# ------------------------------------------------------------------------------------------------------------ regions


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_inside_the_polygon_of_a_regime_its_inequalities_hold_and_outside_they_do_not(name: str) -> None:
    shown, X, Y = window(name, 2000)
    for regime in diagram_of(name).regimes:
        if not regime.forms:
            continue
        holding = np.ones(len(X), dtype=bool)
        for condition in regime.conditions:
            holding &= number(condition.small, shown, X, Y) < number(condition.large, shown, X, Y)
        drawn = np.zeros(len(X), dtype=bool)
        for polygon in plane.region(regime, shown, within_model=False):
            drawn |= Outline(polygon).contains_points(np.c_[X, Y])
        assert np.array_equal(drawn, holding)
        if regime.edge is not None:
            holding &= shown.unit * 10**Y < number(regime.edge, shown, X, Y)
            drawn[:] = False
            for polygon in plane.region(regime, shown):
                drawn |= Outline(polygon).contains_points(np.c_[X, Y])
            assert np.array_equal(drawn, holding)


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("side", SIDES)
def test_regions_fill_the_window_without_overlap_but_near_points_where_constants_disagree(
    name: str, side: Side
) -> None:
    diagram = diagram_of(name)
    shown, X, Y = window(name, 2000)
    regimes = [regime for regime in diagram.regimes if regime.side == side]
    if not regimes:  # of a law of pressed surfaces
        assert side == "tension"
        assert pressed_only(diagram.law)
        return
    assert all(regime.forms or regime.undecided for regime in regimes)
    covered = np.zeros(len(X), dtype=int)
    for regime in regimes:
        for polygon in plane.region(regime, shown, within_model=False):
            covered += Outline(polygon).contains_points(np.c_[X, Y])
    clear = np.ones(len(X), dtype=bool)
    if name not in ("rognon_gay", "film"):  # there all lines of a point go through it exactly
        for point in diagram.points:
            if point.side == side:
                at = (number(point.h, shown, X[:1], Y[:1]), number(point.force, shown, X[:1], Y[:1]) / shown.unit)
                clear &= np.hypot(X - np.log10(at[0]), Y - np.log10(at[1])) > 1.5
    assert clear.mean() > 0.3
    assert np.all(covered[clear] <= 1)
    # what is undecided in terms of delta is not drawn
    assert all(regime.forms for regime in regimes) <= bool(np.all(covered[clear] == 1))


@pytest.mark.parametrize("name", EVERY)
def test_on_a_crossover_the_leading_forms_of_both_regimes_agree(name: str) -> None:
    diagram, shown = diagram_of(name), plane.plane_of(diagram_of(name))
    drawn = 0
    for crossover in diagram.crossovers:
        X, Y = plane.line_points(crossover, diagram, shown)
        if len(X) and crossover.quantity:
            forms = [
                diagram.regime(regime, crossover.side).forms[crossover.quantity].leading
                for regime in (crossover.first, crossover.second)
            ]
            one, other = (np.abs(number(form, shown, X, Y)) for form in forms)
            assert np.max(np.abs(one / other - 1)) < 1e-9
            drawn += 1
    decided = [regime.side for regime in diagram.regimes if regime.forms]
    assert drawn or len(decided) == len(set(decided))  # at most one on each side


def test_curved_boundaries_are_drawn_too() -> None:
    # no law is needed: any condition of F and h will do
    diagram = diagram_of("film")
    regime = diagram.regime("1")
    bent = A * exp(-h / lam)
    condition = type(regime.conditions[0])(force, bent)
    curved = type(regime)(**{**vars(regime), "conditions": (condition,), "edge": None})
    shown, X, Y = window("film", 4000)
    (polygon,) = plane.region(curved, shown)
    drawn = Outline(polygon).contains_points(np.c_[X, Y])
    holding = shown.unit * 10**Y < number(bent, shown, X, Y)
    # polygon and curve differ by the sagitta of a step: (width/400)^2/8 times the curvature, ln(10)^2 h/lam
    assert np.mean(drawn != holding) < 5e-3
    assert 0.1 < holding.mean() < 0.9


# ------------------------------------------------------------------------------------------------------- exact states


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", ["rognon_gay", "film", "cone", "droplet"])
def test_states_solve_the_laws_own_equations(name: str, side: Side) -> None:
    law, sign = diagram_of(name).law, SIGN[side]
    values = plane.parameter_values(law)
    balance = lambdify((h, delta), law.F_ela.subs(a, law.a).subs(values), "math")
    radius = lambdify((h, delta), law.a.subs(values), "math")
    zeta = lambdify((a, h, delta), law.zeta.subs(values), "math")
    remote = lambdify((a, h), law.F_adh.subs(values), "math")
    for gap in (1e-3, 0.2, 30.0):
        for push in (1e-7, 1e-4, 0.05):
            found = plane.states(law, side, np.array([gap]), np.array([push]))
            expected = brentq(lambda x: sign * balance(gap, sign * x) - push, 0, 1, xtol=1e-300, rtol=1e-14)  # noqa: B023
            assert found["delta"][0] == pytest.approx(expected, rel=1e-12)
            wide = radius(gap, sign * expected)
            assert found["dh_dt"][0] == pytest.approx(
                -(sign * push - remote(wide, gap)) / zeta(wide, gap, sign * expected), rel=1e-11
            )


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", ["rognon_gay", "film", "cone"])
def test_exact_exponents_are_the_slopes_of_the_exact_curves(name: str, side: Side) -> None:
    law = diagram_of(name).law
    step = 1e-3
    u = np.log(np.geomspace(1e-5, 50, 40))[:, None] + step * np.arange(-2, 3)
    found = plane.states(law, side, np.exp(u), np.array(3e-3))
    for exponent, quantity in (("lambda1", "delta"), ("lambda2", "dh_dt")):
        y = np.log(np.abs(found[quantity]))
        slope = (y[:, 0] - 8 * y[:, 1] + 8 * y[:, 3] - y[:, 4]) / (12 * step)
        # rounding of the logarithms, 1e-14, over the step; the stencil's own error, step^4, is less
        assert np.max(np.abs(slope - found[exponent][:, 2])) < 1e-10


def test_beyond_the_model_there_is_no_state() -> None:
    law = diagram_of("rognon_gay").law
    # F_ela(delta = R) = (4/9) E sqrt(2 R (hbar + R)) R
    edge = 4 / 9 * np.sqrt(2 * (0.5 + 1))
    found = plane.states(law, "compression", np.array([1.0, 1.0]), np.array([0.999 * edge, 1.001 * edge]))
    assert found["delta"][0] == pytest.approx(1, abs=1e-2)
    assert np.isnan(found["delta"][1])
    assert np.isnan(found["dh_dt"][1])


# --------------------------------------------------------------------------------------------------------------- films


def drawn_films(name: str, side: Side) -> list[tuple[NDArray, NDArray, bool]]:
    """Films as they are drawn, and whether they are as stable ones."""
    axes = Figure().add_subplot()
    phases.draw_films(axes, diagram_of(name), plane.plane_of(diagram_of(name)), side)
    return [(*map(np.asarray, line.get_data()), line.get_linestyle() == "-") for line in axes.lines]


def test_films_lie_where_the_repulsion_carries_the_force() -> None:
    ((X, Y, stable),) = drawn_films("film", "compression")
    assert stable
    # h_eq = lam ln(A/F), the force being that at the gap, to rounding
    np.testing.assert_allclose(10**Y, 1e-4 * np.exp(-(10**X) / 1e-3), rtol=1e-12)
    shown = plane.plane_of(diagram_of("film"))
    assert Y.min() < shown.ylim[0]
    assert Y.max() == pytest.approx(-4, abs=1e-6)
    assert drawn_films("film", "tension") == []


@pytest.mark.slow
def test_a_film_is_stable_where_the_gap_returns_to_it() -> None:
    diagram = diagram_of("dlvo")
    shown = plane.plane_of(diagram)
    kinds = set()
    for side in SIDES:
        for X, Y, stable in drawn_films("dlvo", side):
            kinds.add((side, stable))
            # where two branches meet, at the largest force that a film bears, the gap returns from one side alone
            inner = (X[0] + 0.03 < X) & (X[-1] - 0.03 > X) & (shown.ylim[0] < Y)
            x_film, y_film = X[inner][::5], Y[inner][::5]
            assert len(x_film) > 0
            above, below = (
                plane.states(diagram.law, side, 10 ** (x_film + shift), shown.unit * 10**y_film)["dh_dt"]
                for shift in (0.003, -0.003)
            )
            sign = -1 if stable else 1
            solved = np.isfinite(above) & np.isfinite(below)
            assert solved.sum() > len(solved) / 2
            assert np.all(sign * above[solved] > 0)
            assert np.all(sign * below[solved] < 0)
    # the contact is unstable, and so is the barrier; the double layer holds a stable film, as does the second minimum
    assert kinds == {("compression", True), ("compression", False), ("tension", True), ("tension", False)}


# ------------------------------------------------------------------------------------------------------------ drawings


def texts_of(figure: Figure) -> list[tuple[str, Outline]]:
    """Texts of a figure and their outlines on the page, turned as they are."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    found = []
    for axes in figure.axes:
        for text in axes.texts:
            turn = text.get_rotation()
            anchor = text.get_transform().transform(text.get_position())
            text.set_rotation(0)
            box = text.get_window_extent(renderer)
            text.set_rotation(turn)
            corners = np.array([(box.x0, box.y0), (box.x1, box.y0), (box.x1, box.y1), (box.x0, box.y1)]) - anchor
            c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
            found.append((text.get_text(), Outline(corners @ np.array([[c, s], [-s, c]]) + anchor)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_the_picture_of_any_law_is_tidy(name: str, tmp_path: Path) -> None:
    diagram = diagram_of(name)
    figure = phases.draw(diagram)
    texts = texts_of(figure)
    for (one, first), (other, second) in combinations(texts, 2):
        assert not first.intersects_path(second, filled=True), f"{one} overlaps {other}"
    width, height = figure.canvas.get_width_height()
    for text, outline in texts:
        assert np.all(outline.vertices > 0), text
        assert np.all(outline.vertices < (width, height)), text
    shown = plane.plane_of(diagram)
    named = [text.replace("\n", " ") for text, _ in texts]
    for side in phases.sides_of(diagram):
        for regime in diagram.regimes:
            if regime.side == side and plane.region(regime, shown):
                assert regime.name in named
    assert len(figure.axes) == 5 * len(phases.sides_of(diagram))


def test_the_maps_of_laws_that_differ_in_tension_are_two() -> None:
    assert phases.sides_of(diagram_of("rognon_gay")) == ("compression",)
    assert phases.sides_of(diagram_of("film")) == SIDES


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rognon_gay", "film"])
def test_parts_are_drawn_alone_for_a_report(name: str, tmp_path: Path) -> None:
    diagram = diagram_of(name)
    sides = len(phases.sides_of(diagram))
    for part, panels in ((phases.phase_diagram, 1), (phases.exponent_plots, 4)):
        figure = part(diagram)
        assert len(figure.axes) == panels * sides
        with figures.paper_style():
            figures.save(figure, tmp_path / "one.svg")
            figures.save(part(diagram), tmp_path / "other.svg")
        assert ElementTree.parse(tmp_path / "one.svg").getroot().tag == "{http://www.w3.org/2000/svg}svg"
        assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()


def test_the_curves_are_the_laws_own_equations() -> None:
    diagram = diagram_of("rognon_gay")
    figure = phases.draw(diagram)
    kappas = plane.shown_forces(diagram, plane.plane_of(diagram))
    assert np.allclose(np.log10(kappas), np.round(np.log10(kappas)))
    panel = figure.axes[1]
    for kappa in kappas:
        drawn = [line for line in panel.lines if line.get_linestyle() == "-"][list(kappas).index(kappa)]
        X, Z = drawn.get_data()
        for i in range(0, len(X), 40):
            gap = 10 ** X[i] / (1 + 10 ** X[i])
            expected = brentq(lambda x: 4 / 9 * np.sqrt(2 * (gap + x)) * x - kappa, 0, 1, xtol=1e-300, rtol=1e-14)  # noqa: B023
            assert Z[i] == pytest.approx(np.log10(expected), abs=1e-11)


def test_crossovers_are_told_by_their_formulas() -> None:
    told = {
        (crossover.side, phases.line_text(crossover, diagram_of("film")))
        for crossover in diagram_of("film").crossovers
        if diagram_of("film").regime(crossover.second, crossover.side).inside
    }
    of_hertz = r"\kappa = (4 \sqrt{2} / 9)\,(h/R)^{3 / 2}"
    assert told == {
        *((side, text) for side in SIDES for text in ("h = R", r"h = \lambda")),
        *(("compression", text) for text in (of_hertz, "F = A")),
        *(("tension", f"-{text}") for text in (of_hertz, "F = A")),
    }


def test_measured_exponents_are_laid_over() -> None:
    run = Run("compression", 1e-3, (0.01, 0.1, 1.0), (1e-3,) * 3, (-1e-4,) * 3, (-0.3, -0.4, -0.1), (2.0, 1.0, 0.5))
    measured = Measurement("rognon_gay", "c", {"R": 1.0, "E": 1.0, "eta": 1.0}, (), (run,), ())
    figure = phases.draw(diagram_of("rognon_gay"), measured)
    for panel, values in ((figure.axes[3], run.lambda1), (figure.axes[4], run.lambda2)):
        (circles,) = [line for line in panel.lines if line.get_marker() == "o"]
        assert np.allclose(circles.get_xdata(), [-2, -1, 0])
        assert tuple(circles.get_ydata()) == values


def test_a_law_without_typical_values_is_told_what_to_declare() -> None:
    with pytest.raises(SceneError, match=r"no typical value of A, lam.*typical=\{A: \.\.\.\}"):
        phases.draw(discover(repelled()))


@pytest.mark.slow
def test_a_law_with_branches_is_drawn() -> None:
    brush = ContactLaw(
        name="brush",
        a=sqrt(R * h + delta**2),
        F_ela=E * R * delta,
        zeta=eta * R**2 / h,
        F_adh=Piecewise((A * (1 - h / lam), h < lam), (0, True)),
        parameters={A: FORCE, lam: LENGTH},
        typical={A: E * R**2 / 1000, lam: R / 100},
    )
    figure = phases.phase_diagram(discover(brush))
    assert figure.axes
