"""Pictures of a run of two particles."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE, PURPLE
from softdyn.mathtext import literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.results.pair_result import PairResult

#: An axis is logarithmic where half of its values are smaller than the largest by more than this factor.
CROWDED = 20.0
#: An axis that is logarithmic on both sides of zero is linear below this fraction of its largest value at least.
SMALLEST = 1e-15
#: Fewer points than this are marked: the lines between outputs are no outputs.
FEW = 200


def plot_pair(result: PairResult) -> Figure:
    """Draw a run of two particles.

    Gap and deflection against time; distance of the centres X and force F, where the result has them; the local
    exponents lambda1 and lambda2 against h/R, where it has them. Axes are logarithmic where a linear one would crowd
    the values.

    Parameters
    ----------
    result : PairResult

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; ``figure.savefig(path)`` writes it, and a notebook shows it.
    """
    gap, deflection = {"h": ("$h$", BLUE)}, {"delta": (r"$\delta$", ORANGE)}
    # the two compare on one axis, unless only one of them can be logarithmic
    together = bool(np.all(result.delta > 0))
    series = (
        {r"gap $h$, deflection $\delta$": {**gap, **deflection}}
        if together
        else {"gap $h$": gap, r"deflection $\delta$": deflection}
    )
    series |= {"distance of centres $X$": {"X": ("$X$", GREEN)}, "force $F$": {"F": ("$F$", PURPLE)}}
    against_time = {label: lines for label, lines in series.items() if set(lines) <= set(result.arrays)}
    exponents = {
        name: style
        for name, style in {"lambda1": (r"$\lambda_1$", ORANGE), "lambda2": (r"$\lambda_2$", BLUE)}.items()
        if name in result.arrays
    }
    panels = len(against_time) + bool(exponents)
    figure = Figure(figsize=(7, 1.2 + 2.2 * panels), layout="constrained")
    figure.suptitle(_title(result), fontsize="medium")
    grid = figure.add_gridspec(panels, 1)
    first: Axes | None = None
    for i, (label, lines) in enumerate(against_time.items()):
        axes = figure.add_subplot(grid[i], sharex=first)
        draw_lines(axes, result, "t", lines)
        axes.set_ylabel(label)
        if i < len(against_time) - 1:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time $t$")
        first = first or axes
    if exponents:
        axes = figure.add_subplot(grid[-1])
        draw_lines(axes, result, "h/R", exponents)
        axes.set(xlabel="$h/R$", ylabel="local exponents")
    return figure


def _title(result: PairResult) -> str:
    values = ", ".join(f"{name} = {value:g}" for name, value in result.parameters.items())
    return fill(literal(f"{result.law}: {values}"), 90)


def draw_lines(axes: Axes, result: PairResult, over: str, lines: dict[str, tuple[str, str]]) -> None:
    """Draw some arrays of a result over time, or over h/R, and choose the scales of the axes.

    Parameters
    ----------
    axes : Axes
    result : PairResult
    over : "t" or "h/R"
    lines : dict
        From the array's name to its label and colour.
    """
    x = result.h / result.parameters["R"] if over == "h/R" else result.t
    for name, (label, colour) in lines.items():
        axes.plot(x, result.arrays[name], color=colour, label=label, marker="." if len(result) < FEW else "", ms=4)
    scale, options = scale_for(x)
    axes.set_xscale(scale, **options)
    if over == "t":
        scale, options = scale_for(np.concatenate([result.arrays[name] for name in lines]))
        axes.set_yscale(scale, **options)
    if len(lines) > 1:
        axes.legend()
    axes.grid(alpha=0.3)


def scale_for(values: NDArray[np.float64]) -> tuple[str, dict[str, float]]:
    """Return an axis' scale, and its options: where a linear one would crowd values of one sign, a logarithmic one.

    Values of both signs stay on a linear axis; zeros and negative values need one that is linear about zero.
    """
    values = values[np.isfinite(values)]
    sizes = np.abs(values[values != 0])
    both_signs = bool(np.any(values > 0) and np.any(values < 0))
    if len(sizes) == 0 or both_signs or float(np.median(np.abs(values))) * CROWDED > sizes.max():
        return "linear", {}
    if np.all(values > 0):
        return "log", {}
    return "symlog", {"linthresh": max(float(sizes.min()), SMALLEST * float(sizes.max()))}
