"""Pictures of a closure: where its regimes are in the plane of Re and volume fraction, and what it gives along cuts.

Input: the regimes discovered of a closure. Output: figures, at typical values of its own parameters. Regions and lines
come from the leading forms; curves are the closure itself, and dashed its leading forms, each where it holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from scipy.ndimage import distance_transform_edt
from sympy import And
from sympy.core.relational import Relational

from softdyn.derive.closure import Re, c, phi, sample_values
from softdyn.derive.closure_regimes import ClosureDiagram, ClosureRegime, end_of
from softdyn.derive.typeset import to_latex
from softdyn.mathtext import literal
from softdyn.study.closure_plane import (
    DECADES,
    NEAR,
    Array,
    Flags,
    errors_of,
    fractions_of,
    in_numbers,
    margins,
    points,
    unit_of,
)
from softdyn.study.closure_text import TOLD
from softdyn.study.figures import COLOURS, FORCE_SPAN, FORCES, HALO, INK, paper_style
from softdyn.study.phases import Labels, decade_ticks
from softdyn.study.presence import MOST

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Points along a curve.
FINE = 600
#: How strongly regions are coloured, on white.
STRENGTH = 0.45
#: Characters of LaTeX beyond which a line is not written beside it.
MOST_WRITTEN = 60
#: Levels of what the closure gives that are drawn as thin lines in a map.
LEVELS = tuple(range(-12, 13))
OVER = {"drag": r"$6\pi\eta r$", "viscosity": r"$\eta$", "permeability": "$r^2$", "settling": ""}


def draw(diagram: ClosureDiagram) -> Figure:
    """Draw where the regimes of a closure are, and what it gives: a map and curves, or curves alone.

    Parameters
    ----------
    diagram : ClosureDiagram

    Returns
    -------
    Figure
        Two panels, if what the closure gives depends on Re and on the fraction; else one.
    """
    expr = diagram.closure.expression
    by_number, by_fraction = _depends(diagram, Re), _depends(diagram, c)
    with paper_style():
        both = by_number and by_fraction
        figure = Figure(figsize=(13, 5.6) if both else (6.8, 5.2))
        FigureCanvasAgg(figure)
        figure.suptitle(caption(diagram), x=0.06, y=0.985, ha="left", va="top", fontsize=10)
        room = {"left": 0.06 if both else 0.13, "right": 0.985, "top": 0.86, "bottom": 0.11, "wspace": 0.17}
        grid = figure.add_gridspec(1, 2 if both else 1, **room)
        if both:
            draw_map(figure.add_subplot(grid[0]), diagram)
        axes = figure.add_subplot(grid[-1])
        if by_number or not expr.free_symbols & {c, phi}:
            draw_by_number(axes, diagram)
        else:
            draw_by_fraction(axes, diagram)
    return figure


def _depends(diagram: ClosureDiagram, symbol: object) -> bool:
    names = {phi, c} if symbol == c else {symbol}
    rest = diagram.closure.expression / unit_of(diagram.closure)
    return bool(rest.free_symbols & names)


def caption(diagram: ClosureDiagram) -> str:
    """Title: the closure, what it is, and its parameters."""
    closure = diagram.closure
    text = f"{closure.name}: {closure.description or closure.gives}"
    values = sample_values(closure)
    own = [f"${to_latex(symbol)} = {to_latex(values[symbol])}$" for symbol in closure.parameters]
    return f"{literal(text)}" + (f"\nat {', '.join(own)}" if own else "")


def _colours(diagram: ClosureDiagram) -> dict[str, str]:
    return {regime.name: COLOURS[i % len(COLOURS)] for i, regime in enumerate(diagram.regimes)}


def _label(diagram: ClosureDiagram) -> str:
    over = OVER[diagram.closure.gives]
    return f"{diagram.closure.gives}{' over ' + over if over else ''}"


def draw_map(axes: Axes, diagram: ClosureDiagram) -> None:
    """Regions, crossovers, the edges of cases, where forms are off, and levels of what the closure gives."""
    closure = diagram.closure
    numbers, grains = points(closure)
    X = np.log10(numbers)
    low, high = fractions_of(closure)
    axes.set(xlim=DECADES, ylim=(low, high))
    axes.set_xlabel(r"$\mathrm{Re}$")
    axes.set_ylabel(r"$\phi = 1 - c$")
    axes.set_title("regimes")
    decade_ticks(axes.xaxis, DECADES)
    image = np.ones((*X.shape, 3))
    regions: dict[str, Flags] = {}
    off = np.zeros(X.shape, bool)
    for regime in diagram.regimes:
        here = margins(closure, regime, numbers, grains) >= 0
        regions[regime.name] = here
        image[here] = 1 - STRENGTH * (1 - np.array(to_rgb(_colours(diagram)[regime.name])))
        if regime.form is not None:
            off |= here & (errors_of(closure, regime, numbers, grains) > MOST)
    axes.imshow(image, extent=(*DECADES, low, high), origin="lower", aspect="auto", zorder=0, interpolation="nearest")
    if off.any():
        hatched = axes.contourf(X, grains, off.astype(float), levels=[0.5, 1.5], colors="none", hatches=["////"])
        hatched.set_edgecolor("#777777")
        hatched.set_linewidth(0.0)
        note = "hatched: a form is off by more than its own size"
        axes.text(1, 1.01, note, transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5)
    for X_edge, edge in _edges(diagram, numbers, grains):
        axes.contour(X_edge, grains, edge, levels=[0.0], colors=INK, linewidths=2.0, zorder=2)
    value = np.log10(_values(diagram, numbers, grains))
    levels = axes.contour(
        X, grains, value, levels=LEVELS, colors="#555555", linewidths=0.6, linestyles="dotted", zorder=1.5
    )
    labels = Labels(axes)
    _name_regions(labels, regions, X, grains)
    for X_line, Y_line, text in _lines(diagram):
        axes.plot(X_line, Y_line, color=INK, lw=1.2, zorder=3)
        if text and len(X_line) > 2:
            labels.along(X_line, Y_line, text, INK)
    for told in axes.clabel(levels, fmt=lambda n: f"$10^{{{n:g}}}$", fontsize=7) or ():
        told.set_zorder(4)


def _edges(diagram: ClosureDiagram, numbers: Array, grains: Array) -> Iterator[tuple[Array, Array]]:
    """What changes sign at the edges of cases, where the rest of each case's conditions hold."""
    closure = diagram.closure
    seen: set[object] = set()
    for case in dict.fromkeys(regime.case for regime in diagram.regimes):
        parts = set(case.args) if isinstance(case, And) else {case}
        for one in parts:
            if not isinstance(one, Relational) or one in seen:
                continue
            seen |= {one, one.negated}
            rest = in_numbers(closure, And(*(parts - {one})))(numbers, grains).astype(bool)
            left, right = (in_numbers(closure, side)(numbers, grains) for side in (one.lhs, one.rhs))
            with np.errstate(all="ignore"):
                yield np.log10(numbers), np.where(rest, left / right - 1.0, np.nan)


def _values(diagram: ClosureDiagram, numbers: Array, grains: Array) -> Array:
    """What a closure gives, over its unit."""
    closure = diagram.closure
    with np.errstate(all="ignore"):
        return np.asarray(in_numbers(closure, closure.expression / unit_of(closure))(numbers, grains), float)


def _name_regions(labels: Labels, regions: dict[str, Flags], X: Array, Y: Array) -> None:
    """Set each name where its region is widest."""
    for name, here in regions.items():
        if not here.any():
            continue
        framed = np.pad(here, 1)
        depth = distance_transform_edt(framed)[1:-1, 1:-1]
        for size in (11, 9, 7.5):
            at = np.unravel_index(int(np.argmax(depth)), depth.shape)
            text = labels.axes.text(
                X[at], Y[at], literal(name), fontsize=size, ha="center", va="center", path_effects=HALO, zorder=5
            )
            if labels.place(text):
                break


def _lines(diagram: ClosureDiagram) -> Iterator[tuple[Array, Array, str]]:
    """Crossovers in the plane, each where its case applies, with what is written beside it."""
    closure = diagram.closure
    grains = np.linspace(*fractions_of(closure), FINE)
    for one in diagram.crossovers:
        if one.line is None:
            continue
        numbers = in_numbers(closure, one.line.rhs)(np.ones(FINE), grains)
        X = np.log10(np.asarray(numbers, float))
        shown = in_numbers(closure, one.case)(numbers, grains).astype(bool) & (DECADES[0] < X) & (DECADES[1] > X)
        # where a third form is larger, the two do not meet
        for name in (one.first, one.second):
            shown &= margins(closure, diagram.regime(name), np.asarray(numbers, float), grains) > -NEAR
        written = to_latex(one.line.rhs)
        text = rf"$\mathrm{{Re}} = {written}$" if len(written) <= MOST_WRITTEN else ""
        yield X[shown], grains[shown], text


def draw_by_number(axes: Axes, diagram: ClosureDiagram) -> None:
    """What a closure gives against Re, at several fractions; dashed, the leading forms."""
    closure = diagram.closure
    numbers = np.logspace(*DECADES, FINE)
    low, high = fractions_of(closure)
    fractions = [x for x in TOLD if low < x < high] if _depends(diagram, c) else [high / 2]
    least, most = np.inf, -np.inf
    for i, fraction in enumerate(fractions):
        place = FORCE_SPAN[0] + (FORCE_SPAN[1] - FORCE_SPAN[0]) * i / max(1, len(fractions) - 1)
        grains = np.full(FINE, fraction)
        value = _values(diagram, numbers, grains)
        least, most = min(least, np.nanmin(value)), max(most, np.nanmax(value))
        label = rf"$\phi = {fraction:g}$" if len(fractions) > 1 else None
        axes.plot(numbers, value, color=FORCES(place), lw=1.6, label=label)
        _draw_forms(axes, diagram, diagram.regimes, numbers, grains)
    axes.set(xscale="log", yscale="log", xlim=tuple(10.0**x for x in DECADES), xlabel=r"$\mathrm{Re}$")
    axes.set(ylabel=_label(diagram), ylim=(least / 2, most * 2))
    axes.set_title("dashed: leading forms")
    if len(fractions) > 1:
        axes.legend(frameon=False, fontsize=8)
    else:
        _name_stretches(axes, diagram, numbers, fractions[0])


def _draw_forms(
    axes: Axes, diagram: ClosureDiagram, regimes: Sequence[ClosureRegime], numbers: Array, grains: Array
) -> None:
    closure = diagram.closure
    for regime in regimes:
        if regime.form is None or regime.exact:
            continue
        form = in_numbers(closure, regime.form.state / unit_of(closure))(numbers, grains)
        here = margins(closure, regime, numbers, grains) >= 0
        axes.plot(numbers, np.where(here, form, np.nan), color=INK, lw=0.9, ls=(0, (4, 2)))


def _name_stretches(axes: Axes, diagram: ClosureDiagram, numbers: Array, fraction: float) -> None:
    """Colour the stretches of Re that regimes have, and name them."""
    labels = Labels(axes)
    for regime in diagram.regimes:
        inside = numbers[margins(diagram.closure, regime, numbers, np.full(len(numbers), fraction)) >= 0]
        if len(inside):
            axes.axvspan(inside[0], inside[-1], color=_colours(diagram)[regime.name], alpha=0.3, lw=0, zorder=0)
            middle = np.sqrt(inside[0] * inside[-1])
            text = axes.text(
                middle, 0.95, literal(regime.name), transform=axes.get_xaxis_transform(), ha="center", va="top"
            )
            labels.place(text)


def draw_by_fraction(axes: Axes, diagram: ClosureDiagram) -> None:
    """What a closure that does not depend on Re gives against the fraction; dashed, what it becomes at the ends."""
    closure = diagram.closure
    grains = np.linspace(*fractions_of(closure), FINE)
    ones = np.ones(FINE)
    value = _values(diagram, ones, grains)
    axes.plot(grains, value, color=COLOURS[0], lw=2)
    for style, (end, found) in zip(
        ("dashed", "dotted"), [(e, x) for regime in diagram.regimes for e, x in regime.ends.items()], strict=False
    ):
        if found.form is None:
            continue
        _, small, _ = end_of(closure, end)
        form = in_numbers(closure, found.form.state / unit_of(closure))(ones, grains)
        written = to_latex(small)
        axes.plot(grains, form, color=INK, lw=1, ls=style, label=rf"{end}: ${written} \ll 1$")
    axes.set(yscale="log", xlim=(0, grains[-1]), ylim=(value.min() / 1.5, value.max() * 1.5))
    axes.set(xlabel=r"$\phi$", ylabel=_label(diagram))
    axes.set_title("with its leading forms at the ends")
    axes.legend(frameon=False, fontsize=9)
