"""The reproduction of the paper, against what can be worked out by hand, and against its own files."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from invented_laws import LAWS
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray
from PIL import Image
from scipy.integrate import quad
from scipy.optimize import brentq
from sympy import Eq, Rational, exp, simplify, sqrt

from softdyn.derive import ContactLaw, E, R, a, delta, eta, h
from softdyn.derive.forms import force
from softdyn.derive.laws.rognon_gay import law
from softdyn.derive.limits import check_limits
from softdyn.errors import SceneError
from softdyn.study import figures, reproduce
from softdyn.study.plane import boundaries, edge_points, region
from softdyn.targets import c

TARGET = "c" if c.available() else "numba"
EDGE = 4 * np.sqrt(2) / 9  # of the model, where delta = R: (9/(4 sqrt 2)) kappa = 1


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str]:
    """Folder, exit code and summary of one reproduction."""
    folder = tmp_path_factory.mktemp("results") / "new" / "folder"
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        code = reproduce.reproduce(folder, target=TARGET)
    return folder, code, printed.getvalue()


@pytest.fixture(scope="module")
def table(outcome: tuple[Path, int, str]) -> dict[str, NDArray]:
    """The columns of figure3.csv, of shape (forces, gaps)."""
    with (outcome[0] / "figure3.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    forces = len({row["kappa"] for row in rows})
    return {
        name: np.array([row[name] if name == "regime" else float(row[name]) for row in rows]).reshape(forces, -1)
        for name in rows[0]
    }


@pytest.fixture(scope="module")
def study() -> reproduce.Study:
    return reproduce.run(TARGET)


def balanced(force: float, gap: float) -> float:
    """The deflection, from the paper's eqs. 3 and 4 with R = E = 1."""
    hbar = gap / (1 + gap)
    return brentq(lambda d: 4 / 9 * np.sqrt(2 * (hbar + d)) * d - force, 0, 10, xtol=1e-300, rtol=1e-15)


def rate_of_gap(force: float, gap: float) -> float:
    """-dh/dt, from the paper's eqs. 5 and 7 with R = E = eta = 1."""
    hbar = gap / (1 + gap)
    return force * 2 * hbar**3 / (3 * np.pi * (2 * (hbar + balanced(force, gap))) ** 2)


# ------------------------------------------------------------------------------------------------------ the files


@pytest.mark.slow
def test_the_folder_holds_the_promised_files_and_no_others(outcome: tuple[Path, int, str]) -> None:
    folder, code, _ = outcome
    assert code == 0
    assert sorted(path.name for path in folder.iterdir()) == sorted(reproduce.FILES)


@pytest.mark.parametrize("name", ["figure3", "figure4"])
def test_pictures_are_whole_and_wide_enough_for_a_readme(outcome: tuple[Path, int, str], name: str) -> None:
    with Image.open(outcome[0] / f"{name}.png") as picture:
        picture.load()  # raises if the file is cut short
        assert picture.width == 1600
        inked = np.mean(np.asarray(picture.convert("L")) < 128)
    assert 0.005 < inked < 0.3
    root = ElementTree.parse(outcome[0] / f"{name}.svg").getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert len(root.findall(".//{http://www.w3.org/2000/svg}path")) > 50


@pytest.mark.slow
def test_the_same_numbers_give_the_same_bytes(
    outcome: tuple[Path, int, str], table: dict[str, NDArray], tmp_path: Path
) -> None:
    with figures.paper_style():
        for name, figure in (
            ("figure3", figures.figure3(reproduce.diagram(), table)),
            ("figure4", figures.figure4(law)),
        ):
            for ending in (".png", ".svg"):
                figures.save(figure, tmp_path / (name + ending))
                assert (tmp_path / (name + ending)).read_bytes() == (outcome[0] / (name + ending)).read_bytes()


def test_the_users_matplotlib_settings_change_nothing_and_are_kept(tmp_path: Path) -> None:
    import matplotlib

    with figures.paper_style():
        figures.save(figures.figure4(law), tmp_path / "plain.svg")
    with matplotlib.rc_context({"font.size": 30, "mathtext.fontset": "cm", "axes.facecolor": "red"}):
        with figures.paper_style():
            figures.save(figures.figure4(law), tmp_path / "set.svg")
        assert matplotlib.rcParams["font.size"] == 30
    assert (tmp_path / "plain.svg").read_bytes() == (tmp_path / "set.svg").read_bytes()


# ---------------------------------------------------------------------------------------------------- the numbers


def test_the_runs_cover_the_plane(table: dict[str, NDArray]) -> None:
    kappas, gaps = table["kappa"][:, 0], table["h/R"]
    assert len(kappas) >= 12
    assert (kappas[0], kappas[-1]) == (1e-6, 0.3)
    assert np.allclose(np.diff(np.log(kappas)), np.log(kappas[1] / kappas[0]), rtol=1e-9)
    assert gaps.shape[1] >= 120
    assert np.all(gaps[:, 0] == 1e2)
    assert np.all(gaps[:, -1] == 1e-4)
    assert np.all(np.diff(gaps) < 0)
    assert np.all(np.diff(table["t"]) > 0)


def test_errors_in_time_are_within_what_the_tolerance_allows(table: dict[str, NDArray]) -> None:
    # rtol for each step, over some hundred steps
    assert np.all(table["relative error"] < 1e-7)
    # and they are what they say
    t, exact = table["t"][:, 1:], table["t_quadrature"][:, 1:]
    assert np.array_equal(table["relative error"][:, 1:], np.abs(t - exact) / exact)
    # the two were worked out in two ways: they do not agree to the last digit everywhere
    assert np.count_nonzero(t != exact) > t.size / 2


@pytest.mark.parametrize("row", [0, 6, -1])
def test_the_quadrature_is_the_integral_of_the_papers_equations(table: dict[str, NDArray], row: int) -> None:
    force, gaps = table["kappa"][row, 0], table["h/R"][row]
    for i in (1, 60, len(gaps) - 1):
        ends = np.log(gaps[[i, 0]])
        t, _ = quad(lambda u: np.exp(u) / rate_of_gap(force, np.exp(u)), *ends, epsrel=1e-12, epsabs=0, limit=500)
        assert table["t_quadrature"][row, i] == pytest.approx(t, rel=1e-11)


def test_deflection_and_rate_are_those_of_the_papers_equations(table: dict[str, NDArray]) -> None:
    for row in range(0, len(table["kappa"]), 4):
        for i in range(0, table["h/R"].shape[1], 15):
            force, gap = table["kappa"][row, i], table["h/R"][row, i]
            assert table["delta/R"][row, i] == pytest.approx(balanced(force, gap), rel=1e-13)
            assert table["dh_dt"][row, i] == pytest.approx(-rate_of_gap(force, gap), rel=1e-13)
    assert np.allclose(table["X/R"], 2 + table["h/R"] - 2 * table["delta/R"], rtol=1e-15, atol=0)


@pytest.mark.parametrize(("exponent", "quantity"), [("lambda1", "delta/R"), ("lambda2", "dh_dt")])
def test_exponents_are_the_slopes_of_the_curves(table: dict[str, NDArray], exponent: str, quantity: str) -> None:
    u, y = np.log(table["h/R"]), np.log(np.abs(table[quantity]))
    # five-point slope on an even grid of step 0.115: the error is step^4/30 times the fifth derivative, of order 1
    step = u[0, 1] - u[0, 0]
    slope = (y[:, :-4] - 8 * y[:, 1:-3] + 8 * y[:, 3:-1] - y[:, 4:]) / (12 * step)
    assert np.max(np.abs(slope - table[exponent][:, 2:-2])) < step**4


def test_each_point_is_in_the_regime_of_its_lengths(table: dict[str, NDArray]) -> None:
    gaps, k = table["h/R"], table["kappa"] / EDGE
    expected = np.where(gaps > 1, "Stokes", np.where(k > gaps**1.5, "Hertz", "Poiseuille"))
    # on a boundary, such as h = R, either is right
    clear = (np.abs(np.log(gaps)) > 1e-9) & (np.abs(np.log(k / gaps**1.5)) > 1e-9)
    assert np.array_equal(table["regime"][clear], expected[clear])
    assert set(table["regime"].ravel()) == {"Stokes", "Poiseuille", "Hertz"}


# By hand, from the paper's eqs. 3 to 5: the two next terms, in the small ratios of the leading lengths, of delta and of
# dh/dt relative to the leading form, and of their exponents.
CORRECTIONS = {
    # r1 = delta/R, r2 = R/h
    ("Stokes", "delta/R"): ((-1 / 2, 1 / 2), (0, -1 / 2)),
    ("Stokes", "-dh/dt / V"): ((-2, -1), (0, 1)),
    # r1 = delta/h, r2 = h/R
    ("Poiseuille", "delta/R"): ((-1 / 2, 1 / 2), (3 / 4, 1 / 2)),
    ("Poiseuille", "-dh/dt / V"): ((-2, -1), (3, -1)),
    # r1 = h/delta, r2 = delta/R
    ("Hertz", "delta/R"): ((-1 / 3, 0), (-1 / 3, 0)),
    ("Hertz", "-dh/dt / V"): ((-4 / 3, 0), (-4 / 3, 0)),
}


def test_limits_are_approached_as_the_next_terms_say(study: reproduce.Study) -> None:
    found = reproduce.compare(study)
    assert {(one.regime, one.quantity) for one in found} == set(CORRECTIONS)
    for one in found:
        k = one.kappa / EDGE
        deflection = {"Stokes": k, "Poiseuille": k / np.sqrt(one.h), "Hertz": k ** (2 / 3)}[one.regime]
        lengths = np.sort([one.h, deflection, 1])
        ratios = lengths[:-1] / lengths[1:]
        of_value, of_exponent = CORRECTIONS[one.regime, one.quantity]
        assert ratios.max() < 0.02  # deep inside
        # what is left is of second order; the largest coefficient of the expansions is below 10
        second_order = 10 * ratios.sum() ** 2
        assert one.prefactor_found / one.prefactor - 1 == pytest.approx(np.dot(of_value, ratios), abs=second_order)
        assert one.exponent_found - one.exponent == pytest.approx(np.dot(of_exponent, ratios), abs=second_order)


def test_expected_prefactors_and_exponents_are_the_known_ones(study: reproduce.Study) -> None:
    expected = {
        ("Stokes", "delta/R"): (0, 1 / EDGE),
        ("Stokes", "-dh/dt / V"): (0, 1 / (6 * np.pi)),
        ("Poiseuille", "delta/R"): (-0.5, 1 / EDGE),
        ("Poiseuille", "-dh/dt / V"): (1, 1 / (6 * np.pi)),
        ("Hertz", "delta/R"): (0, EDGE ** (-2 / 3)),
        ("Hertz", "-dh/dt / V"): (3, EDGE ** (4 / 3) / (6 * np.pi)),
    }
    for one in reproduce.compare(study):
        assert (one.exponent, one.prefactor) == pytest.approx(expected[one.regime, one.quantity], rel=1e-14)


# ---------------------------------------------------------------------------------------------------- the summary


def test_the_summary_tells_limits_exponents_errors_and_time(
    outcome: tuple[Path, int, str], table: dict[str, NDArray]
) -> None:
    text = outcome[2]
    assert text.count(" proved ") == sum(len(limit.claims) for limit in law.limits)
    for regime in ("Stokes", "Poiseuille", "Hertz"):
        assert len([line for line in text.splitlines() if line.split()[:1] == [regime]]) == 4 + 2
    assert f"{table['relative error'].max():.2e}" in text
    assert "run time" in text
    assert "C = F_a*a_delta/2 + F_delta/2" in text


def test_an_error_beyond_what_is_allowed_is_a_failure(
    study: reproduce.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    strict = replace(study, allowed=np.where(np.arange(len(study.allowed)) == 2, 1e-30, study.allowed))
    monkeypatch.setattr(reproduce, "run", lambda *_: strict)
    monkeypatch.setattr(reproduce, "_write", lambda *_: None)
    assert reproduce.reproduce(tmp_path) == 1
    assert f"exceeded for kappa = {study.table['kappa'][2, 0]:.3g}" in capsys.readouterr().out


@pytest.mark.parametrize("verdict", ["disproved", "undecided"])
def test_a_limit_that_is_not_proved_is_a_failure(
    study: reproduce.Study,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    verdict: str,
) -> None:
    finding = replace(check_limits(law)[0], verdict=verdict, reason="a reason given")
    monkeypatch.setattr(reproduce, "derive", lambda: [finding])
    monkeypatch.setattr(reproduce, "run", lambda *_: study)
    monkeypatch.setattr(reproduce, "_write", lambda *_: None)
    assert reproduce.reproduce(tmp_path) == 1
    assert "a reason given" in capsys.readouterr().out


# ---------------------------------------------------------------------------------------------------- the failures


def test_a_folder_that_cannot_be_made_is_an_error_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setattr(reproduce, "derive", lambda: pytest.fail("work was done"))
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(SceneError, match="cannot write to the folder"):
            reproduce.reproduce(folder)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "in the way"
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_a_full_disk_is_an_error_that_leaves_no_half_file(
    outcome: tuple[Path, int, str], study: reproduce.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = Figure.savefig

    def fill_up(figure: Figure, path: Path, **options: object) -> None:
        written(figure, path, **options)
        with path.open("r+b") as file:
            file.truncate(1000)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", fill_up)
    monkeypatch.setattr(reproduce, "derive", lambda: [])
    monkeypatch.setattr(reproduce, "run", lambda *_: study)
    with pytest.raises(SceneError, match=r"figure3\.png: No space left on device"):
        reproduce.reproduce(tmp_path)
    # what was finished before is whole
    assert [path.name for path in tmp_path.iterdir()] == ["figure3.csv"]
    assert (tmp_path / "figure3.csv").read_bytes() == (outcome[0] / "figure3.csv").read_bytes()


# ---------------------------------------------------------------------------------------------------- the regimes


def lines_within_the_model() -> dict[tuple[str, str], Eq]:
    """Crossovers in compression by their regimes; with an empty second name, where a regime ends at delta = R."""
    inside = {regime.name: regime for regime in reproduce.regimes()}
    lines = {
        (crossover.first, crossover.second if crossover.second in inside else ""): crossover.line
        for crossover in reproduce.diagram().crossovers
        if crossover.side == "compression" and crossover.first in inside
    }
    # beyond its edge, Hertz has a neighbour outside the model
    lines.pop(("Hertz", ""))
    ends = {(name, ""): Eq(force, regime.edge) for name, regime in inside.items() if regime.edge is not None}
    return lines | ends


def test_boundaries_are_the_closed_forms() -> None:
    lines = lines_within_the_model()
    assert set(lines) == {("Stokes", "Poiseuille"), ("Poiseuille", "Hertz"), ("Stokes", ""), ("Hertz", "")}
    assert lines["Stokes", "Poiseuille"] == Eq(h, R)
    k = 9 * force / (4 * sqrt(2) * E * R**2)
    curve = lines["Poiseuille", "Hertz"]
    assert curve.lhs == force
    assert simplify(k.subs(force, curve.rhs) - (h / R) ** Rational(3, 2)) == 0
    for edge in (lines["Stokes", ""], lines["Hertz", ""]):
        assert edge.lhs == force
        assert simplify(k.subs(force, edge.rhs) - 1) == 0


def test_on_a_boundary_both_leading_forms_agree() -> None:
    forms = {regime.name: regime for regime in reproduce.regimes()}
    for (first, second), line in lines_within_the_model().items():
        if second:
            for quantity in ("delta", "dh_dt"):
                difference = getattr(forms[first], quantity) - getattr(forms[second], quantity)
                assert simplify(difference.subs(line.lhs, line.rhs)) == 0


def area(corners: NDArray) -> float:
    X, Y = corners.T
    return abs(float(np.dot(X, np.roll(Y, -1)) - np.dot(Y, np.roll(X, -1)))) / 2


def test_regions_fill_the_model_without_overlap() -> None:
    plane = figures.window(reproduce.diagram(), (-4.0, 2.0), (-6.5, 0.5))
    regions = {regime.name: region(regime, plane) for regime in reproduce.regimes()}
    areas = {name: area(corners) for name, (corners,) in regions.items()}
    edge = np.log10(EDGE)
    assert areas["Stokes"] == pytest.approx(2 * (edge + 6.5))
    # Hertz: above the line of slope 3/2 that ends in (0, edge)
    assert areas["Hertz"] == pytest.approx(4 * 6 / 2)
    assert sum(areas.values()) == pytest.approx(6 * (edge + 6.5))


def test_boundaries_are_drawn_where_they_bound() -> None:
    plane = figures.window(reproduce.diagram(), (-4.0, 2.0), (-6.5, 0.5))
    edge = np.log10(EDGE)
    sides = {
        "Stokes": lambda X, Y: np.abs(X) + np.maximum(Y - edge, 0),
        "Poiseuille": lambda X, Y: np.abs(Y - edge - 1.5 * X) + np.maximum(X, 0),
        "": lambda X, Y: np.abs(Y - edge),
    }
    found = list(boundaries(reproduce.diagram(), "compression", plane))
    assert sorted(crossover.first if crossover else "" for crossover, *_ in found) == ["", "", "Poiseuille", "Stokes"]
    for crossover, X, Y in found:
        assert len(X) > 100
        assert np.max(sides[crossover.first if crossover else ""](X, Y)) < 1e-8
    # the edge of the model, from one end of the window to the other
    edges = np.concatenate([X for crossover, X, _ in found if crossover is None])
    assert (edges.min(), edges.max()) == (-4, 2)
    assert sum(len(edge_points(regime, plane)[0]) > 0 for regime in reproduce.regimes()) == 1


# ---------------------------------------------------------------------------------------------------- the drawings


def visible_texts(figure: Figure) -> list[tuple[str, NDArray]]:
    """Texts of a figure and their boxes on the page, in pixels: left, bottom, right, top."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    texts = [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]
    return [(text.get_text(), text.get_window_extent(renderer).extents) for text in texts]


def assert_tidy(texts: list[tuple[str, NDArray]], width: float, height: float) -> None:
    for text, (left, bottom, right, top) in texts:
        assert min(left, bottom, width - right, height - top) >= 0, f"{text} leaves the page"
    for (one, first), (other, second) in combinations(texts, 2):
        overlap = np.minimum(first[2:], second[2:]) - np.maximum(first[:2], second[:2])
        # a pixel of slack for the rounding of boxes to pixels
        assert not np.all(overlap > 1), f"{one} overlaps {other}"


@pytest.fixture(params=[*LAWS, "long"])
def any_law(request: pytest.FixtureRequest) -> ContactLaw:
    if request.param in LAWS:
        return LAWS[request.param]
    return ContactLaw(
        name="long",
        a=sqrt(R * h),
        F_ela=E * a * delta * sum((Rational(12345 + i, 67891) * (delta / R) ** (2 * i) for i in range(9)), start=R / R),
        zeta=eta * R**2 / h * sum((exp(-i * h / R) for i in range(12)), start=R / R),
    )


def test_figure_4_holds_any_law_without_overlap(any_law: ContactLaw) -> None:
    with figures.paper_style():
        figure = figures.figure4(any_law)
        texts = visible_texts(figure)
    assert_tidy(texts, *figure.canvas.get_width_height())
    shown = [text for text, _ in texts]
    for name in (r"a(h, \delta)", r"F_\mathrm{ela}(a, \delta)", r"\zeta(a, h)", r"F_\mathrm{adh}(a, h)"):
        assert sum(text.startswith(f"${name}") for text in shown) == 1


def test_figure_4_shows_the_laws_own_expressions() -> None:
    with figures.paper_style():
        shown = [text for text, _ in visible_texts(figures.figure4(law))]
    assert r"$F_\mathrm{ela}(a, \delta) = \dfrac{4\,E\,a\,\delta}{9}$" in shown
    assert r"$C = \dfrac{F_a\,a_\delta + F_\delta}{2}$" in shown
    assert r"$D = \dfrac{C\,\zeta}{C + F_a\,a_h}$" in shown


def test_the_flat_panels_of_figure_3_are_tidy(table: dict[str, NDArray]) -> None:
    with figures.paper_style():
        figure = figures.figure3(reproduce.diagram(), table)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        for axes in figure.axes[:2]:
            renderer = canvas.get_renderer()
            named = [text for text in axes.texts if text.get_text()]
            boxes = [(text.get_text(), text.get_window_extent(renderer).extents) for text in named]
            assert_tidy(boxes, *canvas.get_width_height())
    assert len(figure.axes) == 6
    assert [axes.name for axes in figure.axes] == ["rectilinear"] * 2 + ["3d"] * 4


def test_the_curves_of_figure_3_are_the_simulated_ones(table: dict[str, NDArray]) -> None:
    with figures.paper_style():
        figure = figures.figure3(reproduce.diagram(), table)
    values = {
        2: np.log10(table["delta/R"]),
        3: table["lambda1"],
        4: np.log10(-table["dh_dt"] / table["kappa"]),
        5: table["lambda2"],
    }
    for panel, expected in values.items():
        axes = figure.axes[panel]
        curves = [np.array(line.get_data_3d()) for line in axes.lines]
        for row in range(len(expected)):
            run = np.array([np.log10(table["h/R"][row]), np.log10(table["kappa"][row]), expected[row]])
            assert sum(curve.shape == run.shape and np.array_equal(curve, run) for curve in curves) == 1
        # the floor, with the phase diagram, is below them all
        assert axes.get_zlim()[0] < expected.min()


@pytest.fixture
def mathtext_context() -> Iterator[None]:
    with figures.paper_style():
        yield


@pytest.mark.usefixtures("mathtext_context")
@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (sqrt(2 * R * h), r"\sqrt{2\,R\,h}"),
        (6 * figures.S.Pi * eta * R**2 / h, r"\dfrac{6\,\pi\,\eta\,R^{2}}{h}"),
        (-h, "-h"),
        (R / 2 + h / 2, r"\frac{R}{2} + \frac{h}{2}"),
        (h / (R + h), r"\dfrac{h}{R + h}"),
        (h - h, "0"),
    ],
)
def test_products_are_typeset_in_the_customary_order(expression: object, text: str) -> None:
    assert figures.product_text(expression) == text


def test_fractions_in_exponents_stay_small() -> None:
    assert figures.displayed(r"\frac{a}{b} e^{- \frac{h}{b}} + \sqrt{\frac{a}{b}}") == (
        r"\dfrac{a}{b} e^{- \frac{h}{b}} + \sqrt{\dfrac{a}{b}}"
    )
