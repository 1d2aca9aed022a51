"""A law's own figure 3: where its regimes are, and what happens along lines of constant force through them.

Input: the regimes discovered of a law. Output: figures, drawn at the law's typical parameters. Regions and crossovers
come from the leading forms; the curves are the law's own equations, solved; the films are those found in numbers.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from sympy import Expr, S, diff, latex, powsimp, simplify

from softdyn.colours import BLUE
from softdyn.derive.dimensions import DIMENSIONLESS, FORCE, LENGTH
from softdyn.derive.films import branches
from softdyn.derive.forms import force, force_unit
from softdyn.derive.law import dimensions_for, is_dry, is_rigid
from softdyn.derive.regimes import FORMS, SIGN, Crossover, Diagram, Regime, Side
from softdyn.derive.symbols import R, eta, h
from softdyn.derive.typeset import symbol_latex
from softdyn.mathtext import literal
from softdyn.study.figures import COLOURS, FORCE_SPAN, FORCES, HALO, INK, mathtext, paper_style
from softdyn.study.notation import Numbers
from softdyn.study.plane import (
    Plane,
    boundaries,
    holds,
    largest_forces,
    logarithm,
    margins,
    parameter_values,
    plane_of,
    region,
    shown_forces,
    sides_of,
    states,
)
from softdyn.study.presence import ANYWHERE, MOST, Presence, Presences, misfit, presence_of
from softdyn.study.values import RealValues, si_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

    from softdyn.derive.law import ContactLaw
    from softdyn.study.exponents import Measurement

Array = NDArray[np.float64]

#: Gaps per decade of the exact curves.
DENSITY = 40
#: Exponents beyond this are not joined by a line.
POLE = 30.0
#: Typical values in a line of the caption.
PER_LINE = 5
#: Points along each side of a map at which forms are looked at, to be hatched.
HATCHED = 240
#: What is drawn of a regime: where it is undecided, it is hatched.
DRAWN = {"delta", "dh_dt"}
#: How quantities are named in a map, where not by their names.
UNDECIDED_NAMES = {"dh_dt": "dh/dt", "dX_dt": "dX/dt"}
#: One of so many measured points is drawn.
EVERY = 3
#: Inches above the axes, and for each further line of the caption.
HEAD, LINE = 0.75, 0.19
OUTSIDE = "#D9D9D9"
FILM = BLUE
TITLES = {"compression": "compression, $F > 0$", "tension": "tension, $F < 0$"}


def draw(
    diagram: Diagram,
    measured: Measurement | None = None,
    found: Presences | None = None,
    real: RealValues | None = None,
) -> Figure:
    """Draw the regimes of a law, and deflection, gap rate and their local exponents along lines of constant force.

    Parameters
    ----------
    diagram : Diagram
    measured : Measurement, optional
        Of :func:`softdyn.study.exponents.measure`: its points are laid over the exponents.
    found : mapping, optional
        Of :func:`softdyn.study.presence.presence_of`, if it is known already.
    real : RealValues, optional
        Of the diagram's law: axes then have SI units.

    Returns
    -------
    Figure
        For each side that has regimes of its own, a map and four panels.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own parameters.
    """
    sides, plane = sides_of(diagram), plane_of(diagram, real)
    found = presence_of(diagram) if found is None else found
    with paper_style():
        figure, margins = _captioned(diagram, plane, 14, 6.4 * len(sides), left=0.05)
        grids = figure.add_gridspec(len(sides), 1, **margins, right=0.985, hspace=0.2)
        for i, side in enumerate(sides):
            grid = grids[i].subgridspec(2, 3, width_ratios=(1.5, 1, 1), wspace=0.24, hspace=0.3)
            draw_map(figure.add_subplot(grid[:, 0]), diagram, plane, side, len(sides) == 1, found)
            panels = [figure.add_subplot(grid[k // 2, 1 + k % 2]) for k in range(4)]
            draw_curves(panels, diagram, plane, side, measured)
        force_key(figure, diagram, plane)
    return figure


def phase_diagram(diagram: Diagram) -> Figure:
    """Draw where the regimes of a law are: one map, or two if those in tension differ.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own parameters.
    """
    sides, plane = sides_of(diagram), plane_of(diagram)
    width = 0.9 + 6.1 * len(sides)
    with paper_style():
        figure, margins = _captioned(diagram, plane, width, 5.8, left=0.7 / width)
        grid = figure.add_gridspec(1, len(sides), **margins, right=1 - 0.2 / width, wspace=0.15)
        for i, side in enumerate(sides):
            draw_map(figure.add_subplot(grid[i]), diagram, plane, side, len(sides) == 1, presence_of(diagram))
    return figure


def exponent_plots(diagram: Diagram) -> Figure:
    """Draw deflection, gap rate and their local exponents against the gap, at several forces.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own parameters.
    """
    sides, plane = sides_of(diagram), plane_of(diagram)
    with paper_style():
        figure, margins = _captioned(diagram, plane, 11, 6.4 * len(sides), left=0.065)
        grids = figure.add_gridspec(len(sides), 1, **margins, right=0.985, hspace=0.2)
        for i, side in enumerate(sides):
            grid = grids[i].subgridspec(2, 2, wspace=0.18, hspace=0.28)
            panels = [figure.add_subplot(grid[k // 2, k % 2]) for k in range(4)]
            draw_curves(panels, diagram, plane, side, None)
        force_key(figure, diagram, plane)
    return figure


def _captioned(
    diagram: Diagram, plane: Plane, width: float, below: float, left: float
) -> tuple[Figure, dict[str, float]]:
    """Figure with its caption, and the margins of what comes below it; in inches, but for the left one."""
    title = caption(diagram, plane.real)
    head = HEAD + LINE * title.count("\n")
    height = head + below
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=left, y=1 - 0.15 / height, ha="left", va="top", fontsize=10)
    return figure, {"left": left, "top": 1 - head / height, "bottom": 0.5 / height}


def caption(diagram: Diagram, real: RealValues | None = None) -> str:
    """Title: the law, the parameters that it is drawn for, and what the axes are in."""
    if real is not None:
        units = {symbol: _upright(si_unit(dimensions_for(real.law)[symbol])) for symbol in real.values}
        own = [
            rf"${mathtext(symbol)} = {_number(value)}\,\mathrm{{{units[symbol]}}}$"
            for symbol, value in real.values.items()
        ]
        lines = [",  ".join(own[i : i + PER_LINE]) for i in range(0, len(own), PER_LINE)]
        return f"{diagram.law.name}, at real values:\n" + ",\n".join(lines)
    text = f"{diagram.law.name}:  $\\kappa = {_over('F', force_unit(diagram.law))}$"
    own = [rf"${mathtext(symbol)} = {_folded(S(value))}$" for symbol, value in diagram.law.typical.items()]
    for i in range(0, len(own), PER_LINE):
        text += ("\nat the typical " if i == 0 else ",\n") + ",  ".join(own[i : i + PER_LINE])
    return text


def _folded(value: Expr) -> str:
    """Mathtext of a typical value, on one line: a number, powers of ten apart, over what it is in units of."""
    number, rest = value.as_coeff_Mul()
    power = math.floor(math.log10(abs(float(number)))) if number else 0
    if abs(power) < 3:
        return str(latex(value, fold_short_frac=True, fold_frac_powers=True))
    mantissa = float(number / S(10) ** power)
    parts = [f"{mantissa:.4g}" + r"\cdot"] if abs(mantissa - 1) > 1e-9 else []
    return "".join([*parts, rf"10^{{{power}}}", *([r"\," + mathtext(rest)] if rest != 1 else [])])


def _number(value: float) -> str:
    """Mathtext of a number to four digits."""
    mantissa, _, power = f"{value:.4g}".partition("e")
    if not power:
        return mantissa
    return rf"10^{{{int(power)}}}" if mantissa == "1" else rf"{mantissa}\cdot10^{{{int(power)}}}"


def _upright(unit: str) -> str:
    """Mathtext of a unit, as N/m^2."""
    return re.sub(r"\^\(?(-?[\d/]+)\)?", r"^{\1}", unit).replace(" ", r"\,")


def _over(top: str, unit: Expr) -> str:
    return rf"{top}/({mathtext(unit)})" if unit.is_Mul else rf"{top}/{mathtext(unit)}"


def colours(diagram: Diagram, side: Side) -> dict[str, tuple[str, float]]:
    """Colour and opacity of each regime of one side."""
    inside = [regime.name for regime in diagram.regimes if regime.side == side and regime.inside]
    strength = (0.4, 0.17, 0.65)
    return {
        name: (COLOURS[i % len(COLOURS)], strength[i // len(COLOURS) % len(strength)]) for i, name in enumerate(inside)
    }


def force_colour(kappa: float, plane: Plane) -> Any:
    """Colour of a curve, by the logarithm of its force."""
    low, high = FORCE_SPAN
    place = (math.log10(kappa) - plane.ylim[0]) / (plane.ylim[1] - plane.ylim[0])
    return FORCES(low + (high - low) * min(1.0, max(0.0, place)))


# ------------------------------------------------------------------------------------------------------------ the map


def draw_map(axes: Axes, diagram: Diagram, plane: Plane, side: Side, alone: bool, found: Presences) -> None:
    """Regions, crossovers, points where several meet, the edge of the model, films; with no text over another.

    Parameters
    ----------
    axes : Axes
    diagram : Diagram
    plane : Plane
    side : "compression" or "tension"
    alone : bool
        Whether it is the only side that is drawn: then tension, if there is any, is said to be the same.
    found : mapping
        Of :func:`softdyn.study.presence.presence_of`.
    """
    axes.set(xlim=plane.xlim, ylim=plane.ylim)
    mirrored = alone and any(regime.side == "tension" for regime in diagram.regimes)
    title = "compression; in tension the same" if mirrored else TITLES[side]
    axes.set_title(f"regimes: {title}")
    sign = "" if side == "compression" else "-"
    axes.set_xlabel(_gap_label(plane))
    axes.set_ylabel(rf"${sign}\kappa$" if plane.real is None else f"${sign}F$ (N)", labelpad=1)
    decade_ticks(axes.xaxis, plane.xlim, plane.shift[0])
    decade_ticks(axes.yaxis, plane.ylim, plane.shift[1])
    regimes = [regime for regime in diagram.regimes if regime.side == side]
    X = np.linspace(*plane.xlim, 200)
    edge = np.log10(largest_forces(diagram.law, 10**X, side) / plane.unit)
    axes.fill_between(X, np.minimum(edge, plane.ylim[1]), plane.ylim[1], color=OUTSIDE, lw=0, zorder=0.4)
    for regime in regimes:
        for corners in region(regime, plane, within_model=False):
            axes.add_patch(Polygon(corners, facecolor=OUTSIDE, edgecolor=OUTSIDE, lw=0.5, zorder=0.5))
    shown = {regime.name: region(regime, plane) for regime in regimes}
    # where the constants of three crossovers do not agree on a point, regions overlap: the smaller is seen
    for i, name in enumerate(sorted(shown, key=lambda name: -sum(map(_area, shown[name])))):
        for corners in shown[name]:
            colour, strength = colours(diagram, side)[name]
            axes.add_patch(Polygon(corners, facecolor="white", edgecolor="none", zorder=0.6 + i / 1000))
            axes.add_patch(
                Polygon(corners, facecolor=colour, alpha=strength, edgecolor="none", zorder=0.6005 + i / 1000)
            )
    doubts = hatch_doubts(axes, diagram, plane, side)
    lines = list(boundaries(diagram, side, plane))
    for crossover, X, Y in lines:
        axes.plot(X, Y, color=INK, lw=1.1 if crossover is not None else 2.0, zorder=2)
    for kappa in shown_forces(diagram, plane):
        axes.axhline(math.log10(kappa), color=force_colour(kappa, plane), lw=0.7, ls=(0, (4, 2)), zorder=1.2)
    for point in diagram.points:
        if point.side == side and any(diagram.regime(name, side).inside for name in point.regimes):
            at = (logarithm(point.h, plane)(0, 0), logarithm(point.force, plane)(0, 0) - math.log10(plane.unit))
            axes.plot(*map(float, at), "o", color=INK, ms=4.5, zorder=4)
    longest_film = draw_films(axes, diagram, plane, side)
    labels = Labels(axes)
    names = {name: _said(diagram.regime(name, side), found.get((side, name))) for name in shown}
    _name_regions(labels, shown, names, plane)
    _name_undecided(labels, diagram, side, doubts.undecided, plane)
    _label_outside(labels, regimes, plane)
    if longest_film:
        labels.along(*longest_film, r"$h_\mathrm{eq}(F)$", FILM, 1.4)
    said: set[str] = set()
    for crossover, X, Y in sorted(lines, key=lambda line: -float(np.hypot(np.ptp(line[1]), np.ptp(line[2])))):
        text = "" if crossover is None else f"${line_text(crossover, diagram, plane.real)}$"
        # a line that bounds several regimes is told once
        if text and text not in said and labels.along(X, Y, text, INK):
            said.add(text)
    unseen = [name for name, polygons in shown.items() if not polygons and not found.get((side, name), ANYWHERE).there]
    notes = [f"absent there: {', '.join(map(literal, unseen))}"] if unseen else []
    notes += ["hatched: a form is off by more than its own size"] if doubts.off else []
    axes.text(1, 1.01, "\n".join(notes), transform=axes.transAxes, ha="right", va="bottom", fontsize=7.5)


@dataclass(frozen=True)
class Doubts:
    """What is hatched in a map: whether forms are off anywhere, and the points where nothing is decided."""

    off: bool
    undecided: Array


def hatch_doubts(axes: Axes, diagram: Diagram, plane: Plane, side: Side) -> Doubts:
    """Hatch where a regime's forms are off by more than their own size, and where nothing, or not all, is decided.

    Parameters
    ----------
    axes : Axes
    diagram : Diagram
    plane : Plane
    side : "compression" or "tension"
    """
    X, Y = np.meshgrid(np.linspace(*plane.xlim, HATCHED), np.linspace(*plane.ylim, HATCHED))
    regimes = [regime for regime in diagram.regimes if regime.side == side]
    exact = {} if is_dry(diagram.law) else states(diagram.law, side, 10**X, plane.unit * 10**Y)
    off, partly, known = (np.zeros(X.shape, bool) for _ in range(3))
    for regime in regimes:
        if not regime.forms:
            continue
        inside = margins(regime, plane, X, Y, within_model=regime.inside) >= 0
        known |= inside
        if regime.inside and DRAWN & regime.undecided.keys():
            partly |= inside
        elif regime.inside and exact:
            with np.errstate(invalid="ignore"):
                off |= misfit(regime, plane, exact, X, Y) > MOST
    # where constants do not agree on a point, some of the plane is no regime's; that is no doubt
    undecided = ~known if any(not regime.forms for regime in regimes) else np.zeros(X.shape, bool)
    if exact:
        undecided &= np.isfinite(exact["delta"])
    for where, hatch, colour in ((off, "////", "#777777"), (partly, "xx", "#999999"), (undecided, "xxx", "#555555")):
        if where.any():
            filled = axes.contourf(
                X, Y, where.astype(float), levels=[0.5, 1.5], colors="none", hatches=[hatch], zorder=1.1
            )
            filled.set_edgecolor(colour)
            filled.set_linewidth(0.0)
    return Doubts(bool(off.any()), np.c_[X[undecided], Y[undecided]])


def _said(regime: Regime, presence: Presence | None) -> str:
    """Name of a regime in the map, with what is doubtful of it."""
    if presence is not None and not presence.there:
        return f"{regime.name}, absent there"
    missing = [UNDECIDED_NAMES.get(name, name) for name in FORMS if name in regime.undecided]
    return regime.name if not DRAWN & regime.undecided.keys() else f"{regime.name}, undecided: {', '.join(missing)}"


def _name_undecided(labels: Labels, diagram: Diagram, side: Side, points: Array, plane: Plane) -> None:
    """Write the names of undecided regimes, and why, where nothing is decided."""
    undecided = [regime for regime in diagram.regimes if regime.side == side and not regime.forms]
    if not undecided or not len(points):
        return
    undecided = [regime for regime in undecided if regime.inside] or undecided
    names = ", ".join(literal(regime.name) for regime in undecided)
    reasons = dict.fromkeys(reason for regime in undecided for reason in regime.undecided.values())
    why = "\n".join(textwrap.wrap(next(iter(reasons), ""), 34)[:4])
    middle = np.median(points, axis=0)
    near = points[np.argsort(np.hypot(*((points - middle) / [np.ptp(plane.xlim), np.ptp(plane.ylim)]).T))]
    style: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 6}
    style["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
    for text, size in ((f"undecided: {names}\n{literal(why)}", 8.0), (f"undecided: {names}", 8.0), ("undecided", 7.0)):
        for at in near[:: max(1, len(near) // 40)]:
            if labels.place(labels.axes.text(float(at[0]), float(at[1]), text, fontsize=size, **style)):
                return


def _gap_label(plane: Plane) -> str:
    return "$h/R$" if plane.real is None else "$h$ (m)"


def decade_ticks(axis: Any, limits: tuple[float, float], shift: float = 0.0) -> None:
    """Ticks at powers of ten on an axis of logarithms.

    Parameters
    ----------
    axis : Axis
    limits : (low, high)
        Of the axis.
    shift : float
        What is added to the axis' own numbers to have log10 of what is written.
    """
    first, last = math.ceil(limits[0] + shift - 1e-9), math.floor(limits[1] + shift + 1e-9)
    step = max(1, math.ceil((last - first) / 8))
    at = [n for n in range(first, last + 1) if n % step == 0]
    axis.set_ticks([n - shift for n in at], [_power_of_ten(n) for n in at])
    axis.set_tick_params(length=2.5)


def line_text(crossover: Crossover, diagram: Diagram, real: RealValues | None = None) -> str:
    """Mathtext of a crossover, on one line: kappa = c (h/R)^p, or F = ... where c would not be a pure number.

    In numbers, with real values: F = 3e-7 N (h/R)^p.

    Parameters
    ----------
    crossover : Crossover
    diagram : Diagram
    real : RealValues, optional
        Of the diagram's law.
    """
    law, value, sign = diagram.law, crossover.line.rhs, "-" if crossover.side == "tension" else ""
    if real is not None and (said := _line_in_numbers(value, real, crossover.line.lhs == h)):
        return f"{'h' if crossover.line.lhs == h else sign + 'F'} = {said}"
    if crossover.line.lhs == h:
        return f"h = {_inline(value)}"
    power = simplify(h * diff(value, h) / value)
    factor = powsimp(value / force_unit(law) * (R / h) ** power) if power.is_number else value
    if any(law.parameters.get(symbol) != DIMENSIONLESS for symbol in factor.free_symbols):
        return f"{sign}F = {_inline(value)}"
    number = _inline(factor)
    parts = [rf"({number})" if power != 0 and "/" in number else number] if factor != 1 or power == 0 else []
    parts += [r"(h/R)" + (f"^{{{_inline(power)}}}" if power != 1 else "")] if power != 0 else []
    return rf"{sign}\kappa = " + r"\,".join(parts)


def _line_in_numbers(value: Expr, real: RealValues, gap: bool) -> str:
    """Mathtext of a gap, or of a force that is a power of it; empty, if it is none."""
    dimension = LENGTH if gap else FORCE
    power = simplify(h * diff(value, h) / value)
    if not power.is_number:
        return ""
    at = {**parameter_values(real.law), h: 1.0}
    number = _number(float(f"{abs(float(value.subs(at))) * real.unit(dimension):.3g}"))
    after = "" if power == 0 else rf"\,(h/R)^{{{_inline(power)}}}" if power != 1 else r"\,h/R"
    return rf"{number}\,\mathrm{{{si_unit(dimension)}}}{after}"


def _inline(expr: Expr) -> str:
    names = {symbol: "F" if symbol == force else symbol_latex(symbol.name) for symbol in expr.free_symbols}
    return str(latex(expr, symbol_names=names, fold_short_frac=True, fold_frac_powers=True))


def draw_films(axes: Axes, diagram: Diagram, plane: Plane, side: Side) -> tuple[Array, Array] | None:
    """Films of one side, stable ones solid and unstable ones dashed.

    Parameters
    ----------
    axes : Axes
    diagram : Diagram
    plane : Plane
    side : "compression" or "tension"

    Returns
    -------
    tuple of two arrays, shape (points,), or None
        log10(h/R) and log10(kappa) of the longest piece within the window; None if there is none.
    """
    pieces = []
    for branch in branches(diagram.law):
        if branch.force[0] * SIGN[side] > 0:
            X, Y = np.log10(branch.h), np.log10(np.abs(branch.force) / plane.unit)
            axes.plot(X, Y, color=FILM, lw=2.2, ls="-" if branch.stable else (0, (3, 1.5)), zorder=3)
            inside = (plane.xlim[0] < X) & (plane.xlim[1] > X) & (plane.ylim[0] < Y) & (plane.ylim[1] > Y)
            pieces.append((X[inside], Y[inside]))
    return max(
        (piece for piece in pieces if len(piece[0]) > 1),
        key=lambda piece: float(np.hypot(np.ptp(piece[0]), np.ptp(piece[1]))),
        default=None,
    )


# ------------------------------------------------------------------------------------------------------------- labels


@dataclass
class Labels:
    """Texts on one pair of axes, set only where they overlap no other."""

    axes: Axes

    def __post_init__(self) -> None:
        figure: Any = self.axes.figure
        figure.draw_without_rendering()
        self.renderer = figure.canvas.get_renderer()
        self.taken: list[Array] = []

    def place(self, text: Text, within: Sequence[Array] | None = None, spare: float = 2.0) -> bool:
        """Keep a text if it overlaps none, and lies in the frame and in one of some polygons; else remove it.

        Parameters
        ----------
        text : Text
        within : sequence of array, shape (corners, 2), optional
            Convex polygons, in the coordinates of the axes.
        spare : float
            What is kept free around the text, in pixels.
        """
        box = corners_of(text, self.renderer, spare)
        frame = self.axes.get_window_extent(self.renderer)
        fits = bool(np.all(box >= [frame.x0 + 1, frame.y0 + 1]) and np.all(box <= [frame.x1 - 1, frame.y1 - 1]))
        fits = fits and not any(overlapping(box, other) for other in self.taken)
        if fits and within is not None:
            fits = any(contains(self.axes.transData.transform(polygon), box) for polygon in within)
        if fits:
            self.taken.append(box)
        else:
            text.remove()
        return fits

    def along(self, X: Array, Y: Array, label: str, colour: str, distance: float = 1.0) -> bool:
        """Set a label along a line, close beside it; whether there was room: it is left out if there is none.

        Parameters
        ----------
        X, Y : array, shape (points,)
            Of the line, in the coordinates of the axes.
        label : str
            With dollars around formulas.
        colour : str
        distance : float
            From the line to the middle of the label, in units of one at which it is just beside.
        """
        pixels = self.axes.transData.transform(np.c_[X, Y])
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))])
        for size in (9.5, 8, 7):
            for place in (0.5, 0.35, 0.65, 0.2, 0.8):
                for beside in (1, -1):
                    here, ahead = (
                        np.array([np.interp(s * lengths[-1], lengths, pixels[:, k]) for k in (0, 1)])
                        for s in (place, min(1.0, place + 0.02))
                    )
                    way = ahead - here
                    way = -way if way[0] < 0 or (abs(way[0]) < 1e-9 and way[1] < 0) else way
                    way = way / (np.hypot(*way) or 1.0)
                    to_data = self.axes.transData.inverted().transform
                    text = self.axes.text(
                        0, 0, label, color=colour, fontsize=size,
                        ha="center", va="center", rotation=math.degrees(math.atan2(way[1], way[0])),
                        rotation_mode="anchor", path_effects=HALO, zorder=6,
                    )  # fmt: skip
                    text.set_position(tuple(to_data(here)))
                    box = corners_of(text, self.renderer, 0)
                    width, height = (float(np.hypot(*(box[k] - box[1]))) for k in (0, 2))
                    if width > 0.9 * lengths[-1]:
                        text.remove()
                        break
                    away = beside * distance * (height / 2 + 0.3 * size) * np.array([-way[1], way[0]])
                    text.set_position(tuple(to_data(here + away)))
                    if self.place(text):
                        return True
        return False


def corners_of(text: Text, renderer: Any, spare: float) -> Array:
    """Corners of a text's box in pixels, turned with it, shape (4, 2).

    Parameters
    ----------
    text : Text
    renderer : Renderer
        That of the figure.
    spare : float
        By which the box is wider on each side, in pixels.
    """
    turn = text.get_rotation()
    text.set_rotation(0)
    box = text.get_window_extent(renderer)
    text.set_rotation(turn)
    anchor = text.get_transform().transform(text.get_position())
    flat = np.array([
        [box.x0 - spare, box.y0 - spare], [box.x1 + spare, box.y0 - spare],
        [box.x1 + spare, box.y1 + spare], [box.x0 - spare, box.y1 + spare],
    ])  # fmt: skip
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    return np.asarray(anchor + (flat - anchor) @ np.array([[c, s], [-s, c]]))


def overlapping(one: Array, other: Array) -> bool:
    """Whether two convex polygons overlap: no edge of either has them on its two sides."""
    for polygon in (one, other):
        for edge in np.roll(polygon, -1, axis=0) - polygon:
            normal = np.array([-edge[1], edge[0]])
            if (one @ normal).max() <= (other @ normal).min() or (other @ normal).max() <= (one @ normal).min():
                return False
    return True


def contains(polygon: Array, points: Array) -> bool:
    """Whether all points lie in a convex polygon."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    from_corners = points[:, None, :] - polygon[None, :, :]
    turns = edges[None, :, 0] * from_corners[:, :, 1] - edges[None, :, 1] * from_corners[:, :, 0]
    return bool(np.all(turns >= -1e-6) or np.all(turns <= 1e-6))


def _name_regions(labels: Labels, shown: dict[str, list[Array]], names: dict[str, str], plane: Plane) -> None:
    """Write the name of each regime into its region; beside it, with a line, where it is too small."""
    axes = labels.axes
    for name, polygons in sorted(shown.items(), key=lambda item: sum(map(_area, item[1]))):
        if not polygons:
            continue
        name = literal(names[name])
        largest = max(polygons, key=_area)
        style: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold", "path_effects": HALO, "zorder": 6}
        if any(
            labels.place(axes.text(float(at[0]), float(at[1]), written, fontsize=size, **style), [largest])
            for size in (11, 9, 7.5)
            for written in dict.fromkeys((name, name.replace(", ", ",\n"), name.replace(" ", "\n")))
            for at in _places_in(largest)
        ):
            continue
        middle = largest.mean(axis=0)
        for at in _places_around(middle, plane):
            text = axes.text(float(at[0]), float(at[1]), name, fontsize=8, **style)
            if labels.place(text):
                axes.plot([middle[0], at[0]], [middle[1], at[1]], color=INK, lw=0.6, zorder=5)
                break


def _area(polygon: Array) -> float:
    X, Y = polygon.T
    return abs(float(np.dot(X, np.roll(Y, -1)) - np.dot(Y, np.roll(X, -1)))) / 2


def _places_in(polygon: Array) -> Iterator[Array]:
    """Points of a polygon, from its centre outwards."""
    X, Y = polygon.T
    cross = X * np.roll(Y, -1) - np.roll(X, -1) * Y
    centre = np.array([((X + np.roll(X, -1)) * cross).sum(), ((Y + np.roll(Y, -1)) * cross).sum()]) / (3 * cross.sum())
    for part in (0.0, 0.2, 0.4, 0.6):
        for corner in polygon if part else polygon[:1]:
            yield centre + part * (corner - centre)


def _places_around(middle: Array, plane: Plane) -> Iterator[Array]:
    for distance in (0.07, 0.11, 0.16, 0.22):
        for angle in np.linspace(0, 2 * math.pi, 16, endpoint=False):
            yield middle + distance * np.array([
                math.cos(angle) * (plane.xlim[1] - plane.xlim[0]), math.sin(angle) * (plane.ylim[1] - plane.ylim[0])
            ])  # fmt: skip


def _label_outside(labels: Labels, regimes: Sequence[Regime], plane: Plane) -> None:
    """Name what lies beyond the edge of the model."""
    beyond = [polygon for regime in regimes for polygon in _beyond(regime, plane)]
    if not beyond:
        return
    top = max(float(polygon[:, 1].max()) for polygon in beyond)
    said = rf"outside the model: ${'-' if regimes[0].side == 'tension' else ''}\delta > R$"
    for height in (0.5, 0.3, 0.15):
        for place in (0.5, 0.3, 0.7):
            at = (plane.xlim[0] + place * (plane.xlim[1] - plane.xlim[0]), top - height)
            text = labels.axes.text(at[0], at[1], said, ha="center", va="center", fontsize=8.5, zorder=6)
            if labels.place(text):
                return


def _beyond(regime: Regime, plane: Plane) -> list[Array]:
    return region(regime, plane, within_model=False) if not regime.inside or regime.edge is not None else []


# --------------------------------------------------------------------------------------------------------- the curves


def draw_curves(
    panels: Sequence[Axes], diagram: Diagram, plane: Plane, side: Side, measured: Measurement | None
) -> None:
    """Deflection, gap rate and exponents over the gap: exact, leading forms dotted; measured exponents as circles.

    Gaps are in units of R, but for real values.

    Parameters
    ----------
    panels : sequence of Axes
        Four: of the deflection, of the gap rate, and of the exponents of both.
    diagram : Diagram
    plane : Plane
    side : "compression" or "tension"
    measured : Measurement or None
        Of :func:`softdyn.study.exponents.measure`.
    """
    X = np.linspace(*plane.xlim, round(DENSITY * (plane.xlim[1] - plane.xlim[0])) + 1)
    kappas = shown_forces(diagram, plane)
    exact = states(diagram.law, side, 10 ** X[None], plane.unit * kappas[:, None])
    regimes = [regime for regime in diagram.regimes if regime.side == side and regime.inside and regime.forms]
    # V = F/(eta R)
    rates = np.abs(exact["dh_dt"]) / (plane.unit * kappas[:, None])
    sign = "" if side == "compression" else "-"
    rate = rf"$\left|\dot{{h}}\right|/V,\;\; V = {sign}F/(\eta R)$"
    sizes = [("delta", exact["delta"], rf"${sign}\delta/R$", 1.0), ("dh_dt", rates, rate, 1.0)]
    if plane.real is not None:
        words = Numbers(plane.real)
        (length, _), (speed, unit) = words.scale("delta"), words.scale("dh_dt")
        timed = "" if plane.real.timed else r"\eta\,"
        sizes = [
            ("delta", exact["delta"], rf"${sign}\delta$ (m)", length),
            ("dh_dt", np.abs(exact["dh_dt"]), rf"${timed}\left|\dot{{h}}\right|$ ({unit})", speed),
        ]
    for axes, (quantity, values, label, factor) in zip(panels, sizes, strict=False):
        _draw_sizes(axes, X, kappas, values, quantity, regimes, plane, factor)
        axes.set_title(f"{label}: exact; dotted: leading forms")
    exponents = [
        ("lambda1", r"$\lambda_1 = d\,\ln\delta\,/\,d\,\ln h$"),
        ("lambda2", r"$\lambda_2 = d\,\ln\dot{h}\,/\,d\,\ln h$"),
    ]
    for axes, (name, label) in zip(panels[2:], exponents, strict=False):
        _draw_exponents(axes, X, kappas, exact[name], name, regimes, plane)
        circles = _draw_measured(axes, measured, name, side, plane)
        axes.set_title(label + ("; circles: measured" if circles else ""))
    for axes in panels:
        if not any(np.isfinite(line.get_ydata()).any() for line in axes.lines):
            axes.set_yticks([])
            axes.text(0.5, 0.5, f"none: {_one_sided(diagram.law)}", transform=axes.transAxes, ha="center", va="center")
        axes.set_xlim(plane.xlim)
        axes.set_xlabel(_gap_label(plane), labelpad=1)
        decade_ticks(axes.xaxis, plane.xlim, plane.shift[0])


def _one_sided(law: ContactLaw) -> str:
    if is_rigid(law):
        return "the law is rigid"
    return "the law has no gap" if is_dry(law) else "the model holds nowhere here"


def force_key(figure: Figure, diagram: Diagram, plane: Plane) -> None:
    """Colours of the forces, in the upper right corner of a figure.

    Parameters
    ----------
    figure : Figure
    diagram : Diagram
    plane : Plane
    """
    handles = [
        Line2D(
            [],
            [],
            color=force_colour(kappa, plane),
            lw=2,
            label=_power_of_ten(round(math.log10(kappa) + plane.shift[1])),
        )
        for kappa in shown_forces(diagram, plane)
    ]
    sign = "" if len(sides_of(diagram)) == 1 else r"\pm"
    what = rf"${sign}\kappa$" if plane.real is None else rf"${sign} F$ (N)"
    figure.legend(
        handles=handles, title=f"{what} of the curves", ncols=len(handles), fontsize=8, title_fontsize=8,
        loc="upper right", bbox_to_anchor=(0.99, 1 - 0.05 / figure.get_figheight()), handlelength=1.2,
        columnspacing=1.2, frameon=False, borderaxespad=0,
    )  # fmt: skip


def _power_of_ten(n: int) -> str:
    return rf"$10^{{{n}}}$" if n not in (0, 1) else f"${10**n}$"


def _draw_sizes(
    axes: Axes,
    X: Array,
    kappas: Array,
    values: Array,
    quantity: str,
    regimes: Sequence[Regime],
    plane: Plane,
    factor: float,
) -> None:
    values, shift = factor * values, math.log10(factor)
    for kappa, row in zip(kappas, values, strict=True):
        with np.errstate(divide="ignore"):
            axes.plot(X, np.log10(row), color=force_colour(kappa, plane), lw=1.3, zorder=2)
        Y = np.full(len(X), math.log10(kappa))
        for regime in regimes:
            if quantity not in regime.forms:
                continue
            leading = regime.forms[quantity].leading
            over_force = quantity == "dh_dt" and plane.real is None
            form = logarithm(leading * eta * R / force if over_force else leading / R, plane)
            inside = holds(regime, plane, X, Y)
            Z = np.where(inside, np.broadcast_to(form(X, Y), X.shape) + shift, np.nan)
            axes.plot(X, Z, color=INK, lw=0.8, ls=(0, (1, 1.5)), zorder=3)
    seen = values[np.isfinite(values) & (values > 0)]
    if len(seen):
        low, high = np.log10(np.quantile(seen, 0.002)), np.log10(seen.max())
        axes.set_ylim(max(low, high - 40) - 0.5, high + 0.5)
        decade_ticks(axes.yaxis, axes.get_ylim())


def _draw_exponents(
    axes: Axes, X: Array, kappas: Array, values: Array, name: str, regimes: Sequence[Regime], plane: Plane
) -> None:
    plateaus = sorted({float(value) for value in _plateaus(regimes, name)})
    for kappa, row in zip(kappas, values, strict=True):
        # at a film the rate changes sign, and its exponent has a pole
        drawn = np.where(np.abs(row) < POLE, row, np.nan)
        axes.plot(X, drawn, color=force_colour(kappa, plane), lw=1.3, zorder=2)
        Y = np.full(len(X), math.log10(kappa))
        for regime in regimes:
            value = getattr(regime, name)
            if value is not None and value.is_number:
                Z = np.where(holds(regime, plane, X, Y), float(value), np.nan)
                axes.plot(X, Z, color=INK, lw=0.8, ls=(0, (1, 1.5)), zorder=1.5)
    low, high = (min(plateaus), max(plateaus)) if plateaus else (-1.0, 1.0)
    within = values[np.isfinite(values)]
    # a film makes an exponent diverge: what is shown is at most half as far from the plateaus as these are apart
    span = 0.5 * (high - low) + 0.5
    low = min(low, max(float(within.min()), low - span)) if len(within) else low
    high = max(high, min(float(within.max()), high + span)) if len(within) else high
    margin = 0.08 * (high - low) + 0.02
    axes.set_ylim(low - margin, high + margin)
    exact = {float(value): value for value in _plateaus(regimes, name)}
    for value in plateaus:
        axes.axhline(value, color="#BBBBBB", lw=0.6, zorder=0.5)
    apart = 0.045 * float(np.ptp(axes.get_ylim()))
    told: list[float] = []
    # whole numbers first; what would run into them is not told
    for value in sorted(plateaus, key=lambda value: (value % 1 != 0, abs(value))):
        if all(abs(value - other) > apart for other in told):
            told.append(value)
    axes.set_yticks(told, [f"${latex(exact[value], fold_short_frac=True)}$" for value in told])


def _plateaus(regimes: Sequence[Regime], name: str) -> list[Expr]:
    values = (getattr(regime, name) for regime in regimes)
    return [value for value in values if value is not None and value.is_number]


def _draw_measured(axes: Axes, measured: Measurement | None, name: str, side: Side, plane: Plane) -> bool:
    """Measured exponents, as circles in the colour of their force; whether there are any in the window."""
    runs = [
        run
        for run in (measured.runs if measured is not None else ())
        if run.side == side and plane.ylim[0] <= math.log10(run.kappa) <= plane.ylim[1]
    ]
    for run in runs:
        axes.plot(
            np.log10(run.h), getattr(run, name), "o", ms=3.2, mew=0.8, mfc="white", mec=force_colour(run.kappa, plane),
            markevery=EVERY, zorder=4, ls="none",
        )  # fmt: skip
    return bool(runs)
