"""Pictures of results: what is drawn are the result's numbers, on axes that can show them."""

from __future__ import annotations

import io
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

import softdyn
from softdyn.pair.pair_plots import plot_pair, scale_for
from softdyn.results.pair_result import PairResult

ALL = ("X", "F", "lambda1", "lambda2")
BASE: dict[str, Any] = {"law": "rognon_gay", "parameters": {"R": 2.0, "E": 1.0, "eta": 1.0}, "quantities": ALL}
SCENES: dict[str, dict[str, Any]] = {
    "approach": {"h": 100.0, "force": 1e-2, "until_h": 1e-4, "gaps": 60},
    "every step": {"h": 100.0, "force": 1e-2, "until_h": 1e-4},
    "oscillation": {"h": 0.1, "force": "1e-2*sin(t/10)", "until_t": 300.0, "times": 200},
    "tension": {"h": 0.1, "force": -1e-2, "until_t": 1e5, "times": 50},
    "no force": {"h": 0.1, "force": 0.0, "until_t": 10.0, "times": 5},
    "one point": {"h": 100.0, "force": 1e-2, "until_h": 1e-3, "gaps": [1e-2]},
    "nothing asked for": {"h": 100.0, "force": 1e-2, "until_h": 1e-3, "gaps": 5, "quantities": ()},
}


@pytest.fixture(scope="module", params=SCENES)
def result(request: pytest.FixtureRequest) -> PairResult:
    return softdyn.simulate(**{**BASE, **SCENES[request.param]})


def synthetic(**arrays: Any) -> PairResult:
    """Return a result of arrays made up for the purpose."""
    values = {name: np.array(value, dtype=float) for name, value in arrays.items()}
    return PairResult("some_law$", "c", {"R": 2.0}, values, "h", {})


def drawn(figure: Figure) -> None:
    """Draw a figure to the end; warnings are errors here."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=50)
    with Image.open(file) as picture:
        assert np.asarray(picture.convert("L")).min() < 64


def curves(figure: Figure) -> dict[str, tuple[Axes, NDArray, NDArray]]:
    """Curves by their labels: axes, abscissae, ordinates."""
    return {
        line.get_label(): (axes, np.asarray(line.get_xdata()), np.asarray(line.get_ydata()))
        for axes in figure.axes
        for line in axes.lines
    }


def test_every_quantity_is_drawn_once_and_as_it_is(result: PairResult) -> None:
    figure = result.plot()
    drawn(figure)
    found = curves(figure)
    labels = {
        "h": "$h$",
        "delta": r"$\delta$",
        "X": "$X$",
        "F": "$F$",
        "lambda1": r"$\lambda_1$",
        "lambda2": r"$\lambda_2$",
    }
    assert set(found) == {label for name, label in labels.items() if name in result.arrays}
    for name, label in labels.items():
        if name in result.arrays:
            _, abscissae, ordinates = found[label]
            assert np.array_equal(abscissae, result.h / 2.0 if name.startswith("lambda") else result.t)
            assert np.array_equal(ordinates, result.arrays[name])


def test_axes_can_show_what_is_on_them(result: PairResult) -> None:
    figure = result.plot()
    drawn(figure)
    for axes, abscissae, ordinates in curves(figure).values():
        for scale, limits, values in (
            (axes.get_xscale(), axes.get_xlim(), abscissae),
            (axes.get_yscale(), axes.get_ylim(), ordinates),
        ):
            assert scale != "log" or np.all(values > 0)
            assert limits[0] <= values.min() <= values.max() <= limits[1]


def test_axes_have_names(result: PairResult) -> None:
    figure = result.plot()
    names = {axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()}
    assert names == ({"time $t$", "$h/R$"} if "lambda1" in result.arrays else {"time $t$"})
    assert all(axes.get_ylabel() for axes in figure.axes)
    assert "rognon_gay: R = 2, E = 1, eta = 1" in figure.get_suptitle()


def test_an_approach_is_drawn_on_logarithmic_axes() -> None:
    found = curves(softdyn.simulate(**{**BASE, **SCENES["approach"]}).plot())
    gap, deflection = found["$h$"][0], found[r"$\delta$"][0]
    assert gap is deflection  # where they cross, Hertz begins
    assert (gap.get_xscale(), gap.get_yscale()) == ("symlog", "log")  # the time starts at 0
    exponents = found[r"$\lambda_1$"][0]
    assert (exponents.get_xscale(), exponents.get_yscale()) == ("log", "linear")


@pytest.mark.parametrize("name", ["oscillation", "tension", "no force"])
def test_a_deflection_that_is_not_positive_has_an_axis_of_its_own(name: str) -> None:
    found = curves(softdyn.simulate(**{**BASE, **SCENES[name]}).plot())
    assert found["$h$"][0] is not found[r"$\delta$"][0]
    assert found[r"$\delta$"][0].get_yscale() == "linear"


def test_points_of_a_short_result_are_marked() -> None:
    marked = {}
    for name, gaps in (("one point", None), ("approach", 199), ("approach", 200)):
        more = {"gaps": gaps} if gaps else {}
        figure = softdyn.simulate(**{**BASE, **SCENES[name], **more}).plot()
        marked[gaps] = {line.get_marker() for axes in figure.axes for line in axes.lines}
    assert marked[None] == {"."}
    assert marked[199] == {"."}
    assert marked[200].isdisjoint({"."})


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        (np.geomspace(1, 1e4, 20), "log"),
        (-np.geomspace(1, 1e4, 20), "symlog"),
        (np.r_[0, np.geomspace(1, 1e4, 20)], "symlog"),
        (np.r_[-1, np.geomspace(1, 1e4, 20)], "linear"),
        (np.linspace(0, 1, 50), "linear"),
        (np.geomspace(1, 15, 20), "linear"),
        (np.r_[np.nan, np.geomspace(1, 1e4, 20), np.inf], "log"),
        (np.zeros(3), "linear"),
        (np.array([7.0]), "linear"),
        (np.array([np.nan]), "linear"),
        (np.array([]), "linear"),
    ],
)
def test_scales(values: NDArray, scale: str) -> None:
    assert scale_for(values)[0] == scale


def test_the_linear_part_of_an_axis_begins_at_the_smallest_value_but_not_ridiculously_low() -> None:
    assert scale_for(np.r_[0, np.geomspace(1e-3, 1e4, 20)])[1] == {"linthresh": pytest.approx(1e-3)}
    assert scale_for(np.r_[0, 1e-200, np.geomspace(1e-3, 1, 20)])[1]["linthresh"] == pytest.approx(1e-15)


@pytest.mark.parametrize("outputs", [0, 1, 2])
def test_short_and_odd_results_are_drawn(outputs: int) -> None:
    t = [0.0, 1.0][:outputs]
    figure = plot_pair(synthetic(t=t, h=[1.0, 0.5][:outputs], delta=[np.nan, 0.1][:outputs], F=[1.0, np.nan][:outputs]))
    drawn(figure)
    assert len(curves(figure)) == 3
    assert figure.get_suptitle() == r"some_law\$: R = 2"


def test_plotting_touches_no_global_state() -> None:
    program = """
import sys, numpy as np, matplotlib
from softdyn.results.pair_result import PairResult
def settings():  # to read the backend would choose one
    return {name: matplotlib.rcParams[name] for name in matplotlib.rcParams if name != "backend"}
before = settings()
arrays = {"t": np.arange(3.0), "h": np.arange(3.0, 0, -1), "delta": np.ones(3)}
PairResult("law", "c", {"R": 1.0}, arrays, "h", {}).plot()
assert "matplotlib.pyplot" not in sys.modules, "pyplot was imported"
assert settings() == before
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_importing_results_does_not_import_matplotlib() -> None:
    program = "import sys, softdyn.results.registry; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
