"""Figures of a run of two particles: of the width of a column, with the panels asked for, in axes of one's own."""

from __future__ import annotations

from functools import cache

import pytest
from matplotlib.figure import Figure

import softdyn
from softdyn.errors import SceneError


@cache
def run() -> softdyn.PairResult:
    result: softdyn.PairResult = softdyn.simulate(
        law="rognon_gay", parameters={"R": 1.0, "E": 1.0, "eta": 1.0}, h=0.1, force=1.02e-4, until_t=3e5, times=20
    )
    return result


def test_a_figure_has_the_width_and_the_panels_asked_for() -> None:
    figure = run().plot(width="column", panels=["h", "F"])
    assert figure.get_size_inches()[0] == pytest.approx(3.4)
    assert [axes.get_ylabel() for axes in figure.axes] == ["gap $h$", "force $F$"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "time $t$"]
    assert run().plot(width=5.0).get_size_inches()[0] == pytest.approx(5.0)


def test_a_panel_goes_into_axes_of_ones_own() -> None:
    figure = Figure()
    axes = figure.add_subplot()
    assert run().plot(panels=["X"], ax=axes) is figure
    assert axes.lines
    with pytest.raises(SceneError, match="ax takes a single panel"):
        run().plot(ax=axes)


def test_ticks_read() -> None:
    """A power of ten once, and few digits at each tick: 0.0001020 is neither."""
    figure = run().plot(panels=["X", "F"])
    figure.draw_without_rendering()
    for axes in figure.axes:
        for label in axes.get_yticklabels():
            assert len(label.get_text().strip("$\N{MINUS SIGN}-").removeprefix(r"\mathdefault{").rstrip("}")) <= 7
    assert "10^" in figure.axes[1].yaxis.get_offset_text().get_text()


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(SceneError, match="unknown panel 'G'"):
        run().plot(panels=["G"])
    with pytest.raises(SceneError, match="the result has no lambda1 or lambda2"):
        run().plot(panels=["exponents"])
    with pytest.raises(SceneError, match="width must be one of column, page"):
        run().plot(width="wide")
