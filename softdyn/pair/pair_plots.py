"""Pictures of a run of two particles."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE, PURPLE
from softdyn.errors import SceneError
from softdyn.mathtext import literal
from softdyn.results.axis_units import tell_units
from softdyn.results.chosen_panels import NARROW, inches, root_of
from softdyn.words import suggestion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.results.pair_result import PairResult

#: An axis is logarithmic where half of its values are smaller than the largest by more than this factor.
CROWDED = 20.0
#: An axis that is logarithmic on both sides of zero is linear below this fraction of its largest value at least.
SMALLEST = 1e-15
#: Fewer points than this are marked: the lines between outputs are no outputs.
FEW = 200


#: Panels that can be asked for: of the arrays over time, and of the local exponents.
LINES = {
    "h": ("gap $h$", {"h": ("$h$", BLUE)}),
    "delta": (r"deflection $\delta$", {"delta": (r"$\delta$", ORANGE)}),
    "X": ("distance of centres $X$", {"X": ("$X$", GREEN)}),
    "F": ("force $F$", {"F": ("$F$", PURPLE)}),
}
UNITS = {"time $t$": "s", r"gap $h$, deflection $\delta$": "m", **{LINES[name][0]: "m" for name in ("h", "delta", "X")}}
UNITS |= {LINES["F"][0]: "N"}
EXPONENTS = {"lambda1": (r"$\lambda_1$", ORANGE), "lambda2": (r"$\lambda_2$", BLUE)}
PANELS = (*LINES, "exponents")


def plot_pair(
    result: PairResult,
    *,
    width: str | float = "page",
    panels: Sequence[str] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw a run of two particles.

    Gap and deflection against time; distance of the centres X and force F, where the result has them; the local
    exponents lambda1 and lambda2 against h/R, where it has them. Axes are logarithmic where a linear one would crowd
    the values.

    Parameters
    ----------
    result : PairResult
    width : "column", "page" or number
        Of the figure; a number is in inches.
    panels : sequence of str, optional
        Which panels, in their order: of "h", "delta", "X", "F" and "exponents"; all that there are without it, gap and
        deflection in one where they compare.
    ax : matplotlib Axes, optional
        Where to draw a single panel, in a figure of one's own.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; ``figure.savefig(path)`` writes it, and a notebook shows it.

    Raises
    ------
    SceneError
        If a panel is unknown, or if the result lacks what it shows.
    """
    drawn = _default_panels(result) if panels is None else [_panel(result, name) for name in panels]
    wide = inches(width)
    if ax is not None:
        if len(drawn) != 1:
            raise SceneError(f"ax takes a single panel, as panels=['h'], and here there are {len(drawn)}")
        _draw_panel(ax, result, *drawn[0])
        return root_of(ax)
    narrow = wide < NARROW
    figure = Figure(figsize=(wide, 0.6 + 0.6 * (not narrow) + min(2.2, 0.62 * wide) * len(drawn)), layout="constrained")
    if not narrow:  # else the caption says it
        figure.suptitle(_title(result), fontsize="medium")
    grid = figure.add_gridspec(max(1, len(drawn)), 1)
    over_time = [k for k, (_, _, over) in enumerate(drawn) if over == "t"]
    first: Axes | None = None
    for k, panel in enumerate(drawn):
        axes = figure.add_subplot(grid[k], sharex=first if panel[2] == "t" else None)
        _draw_panel(axes, result, *panel)
        if panel[2] == "t":
            first = first or axes
            if k != over_time[-1]:
                axes.tick_params(labelbottom=False)
                axes.set_xlabel("")
    return figure


#: A panel: its label, its lines, and what these are drawn over.
Panel = tuple[str, dict[str, tuple[str, str]], str]


def _default_panels(result: PairResult) -> list[Panel]:
    """All that the result has."""
    # gap and deflection compare on one axis, unless only one of them can be logarithmic
    together = bool(np.all(result.delta > 0))
    both = {**LINES["h"][1], **LINES["delta"][1]}
    drawn: list[Panel] = [(r"gap $h$, deflection $\delta$", both, "t")] if together else []
    rest = ("X", "F") if together else tuple(LINES)
    drawn += [(*LINES[name], "t") for name in rest if set(LINES[name][1]) <= set(result.arrays)]
    exponents = {name: style for name, style in EXPONENTS.items() if name in result.arrays}
    return [*drawn, *([("local exponents", exponents, "h/R")] if exponents else [])]


def _panel(result: PairResult, name: str) -> Panel:
    """A panel by its name."""
    if name not in PANELS:
        raise SceneError(f"unknown panel {name!r}{suggestion(name, PANELS)}")
    label, lines, over = ("local exponents", EXPONENTS, "h/R") if name == "exponents" else (*LINES[name], "t")
    held = {key: style for key, style in lines.items() if key in result.arrays}
    if not held:
        raise SceneError(f"panel {name!r}: the result has no {' or '.join(lines)}; ask for it: [output] quantities")
    return label, held, over


def _draw_panel(axes: Axes, result: PairResult, label: str, lines: dict[str, tuple[str, str]], over: str) -> None:
    draw_lines(axes, result, over, lines)
    axes.set_ylabel(label)
    axes.set_xlabel("time $t$" if over == "t" else "$h/R$")
    tell_units([axes], result, UNITS)
    for axis, scale in ((axes.xaxis, axes.get_xscale()), (axes.yaxis, axes.get_yscale())):
        if scale == "linear":
            # 1.02 x 10^-4, once, in the place of 0.0001020 at each tick
            formatter = ScalarFormatter(useMathText=True)
            formatter.set_powerlimits((-2, 4))
            axis.set_major_formatter(formatter)


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
