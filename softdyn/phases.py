"""A law's own figure 3: where its regimes are, and what happens along lines of constant force through them.

Input: the regimes discovered of a law. Output: figures, drawn at the law's typical parameters. Regions and crossovers
come from the leading forms; the curves are the law's own equations, solved; the films are those found in numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from sympy import Eq, Expr, S, latex

from softdyn.derive.films import Branch, branches
from softdyn.derive.forms import force, force_unit
from softdyn.derive.regimes import SIGN, Crossover, Diagram, Regime, Side
from softdyn.derive.symbols import R, eta
from softdyn.figures import COLOURS, FORCE_SPAN, FORCES, HALO, INK, crossover_text, mathtext, paper_style
from softdyn.plane import Plane, boundaries, holds, logarithm, plane_of, region, shown_forces, sides_of, states

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

    from softdyn.exponents import Measurement

Array = NDArray[np.float64]

#: Gaps per decade of the exact curves.
DENSITY = 40
#: Exponents beyond this are not joined by a line.
POLE = 30.0
#: Typical values in a line of the caption.
PER_LINE = 5
#: Inches above the axes, and for each further line of the caption.
HEAD, LINE = 0.75, 0.19
OUTSIDE = "#D9D9D9"
FILM = "#0072B2"
TITLES = {"compression": "compression, $F > 0$", "tension": "tension, $F < 0$"}


def draw(diagram: Diagram, measured: Measurement | None = None) -> Figure:
    """Draw the regimes of a law, and deflection, gap rate and their local exponents along lines of constant force.

    Parameters
    ----------
    diagram : Diagram
    measured : Measurement, optional
        Of :func:`softdyn.exponents.measure`: its points are laid over the exponents.

    Returns
    -------
    Figure
        For each side that has regimes of its own, a map and four panels.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own parameters.
    """
    sides, plane = sides_of(diagram), plane_of(diagram)
    with paper_style():
        title = caption(diagram)
        head = HEAD + LINE * title.count("\n")
        height = head + 6.4 * len(sides)
        figure = Figure(figsize=(14, height))
        FigureCanvasAgg(figure)
        grids = figure.add_gridspec(
            len(sides), 1, left=0.05, right=0.985, top=1 - head / height, bottom=0.5 / height, hspace=0.2
        )
        for i, side in enumerate(sides):
            grid = grids[i].subgridspec(2, 3, width_ratios=(1.5, 1, 1), wspace=0.24, hspace=0.3)
            draw_map(figure.add_subplot(grid[:, 0]), diagram, plane, side, len(sides) == 1)
            panels = [figure.add_subplot(grid[k // 2, 1 + k % 2]) for k in range(4)]
            draw_curves(panels, diagram, plane, side, measured)
        figure.suptitle(title, x=0.05, y=1 - 0.15 / height, ha="left", va="top", fontsize=10)
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
    with paper_style():
        title = caption(diagram)
        head = HEAD + LINE * title.count("\n")
        width, height = 0.9 + 6.1 * len(sides), head + 5.8
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(
            1, len(sides), left=0.7 / width, right=1 - 0.2 / width, top=1 - head / height, bottom=0.5 / height,
            wspace=0.15,
        )  # fmt: skip
        for i, side in enumerate(sides):
            draw_map(figure.add_subplot(grid[i]), diagram, plane, side, len(sides) == 1)
        figure.suptitle(title, x=0.7 / width, y=1 - 0.15 / height, ha="left", va="top", fontsize=10)
    return figure


def exponent_plots(diagram: Diagram, measured: Measurement | None = None) -> Figure:
    """Draw deflection, gap rate and their local exponents against the gap, at several forces.

    Raises
    ------
    SceneError
        If the law gives no typical value of one of its own parameters.
    """
    sides, plane = sides_of(diagram), plane_of(diagram)
    with paper_style():
        title = caption(diagram)
        head = HEAD + LINE * title.count("\n")
        height = head + 6.4 * len(sides)
        figure = Figure(figsize=(11, height))
        FigureCanvasAgg(figure)
        grids = figure.add_gridspec(
            len(sides), 1, left=0.065, right=0.985, top=1 - head / height, bottom=0.5 / height, hspace=0.2
        )
        for i, side in enumerate(sides):
            grid = grids[i].subgridspec(2, 2, wspace=0.18, hspace=0.28)
            panels = [figure.add_subplot(grid[k // 2, k % 2]) for k in range(4)]
            draw_curves(panels, diagram, plane, side, measured)
        figure.suptitle(title, x=0.065, y=1 - 0.15 / height, ha="left", va="top", fontsize=10)
        force_key(figure, diagram, plane)
    return figure


def caption(diagram: Diagram) -> str:
    """Title: the law, the parameters that it is drawn for, and what the axes are in."""
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
        return latex(value, fold_short_frac=True, fold_frac_powers=True)
    mantissa = float(number / S(10) ** power)
    parts = [f"{mantissa:.4g}" + r"\cdot"] if abs(mantissa - 1) > 1e-9 else []
    return "".join([*parts, rf"10^{{{power}}}", *([r"\," + mathtext(rest)] if rest != 1 else [])])


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


def draw_map(axes: Axes, diagram: Diagram, plane: Plane, side: Side, alone: bool) -> None:
    """Regions, crossovers, points where several meet, the edge of the model, films; with no text over another."""
    axes.set(xlim=plane.xlim, ylim=plane.ylim)
    title = TITLES[side] if not alone else "compression; in tension the same"
    axes.set_title(f"regimes: {title}")
    axes.set_xlabel("$h/R$")
    axes.set_ylabel(r"$\kappa$" if side == "compression" else r"$|\kappa|$", labelpad=1)
    decade_ticks(axes.xaxis, plane.xlim)
    decade_ticks(axes.yaxis, plane.ylim)
    regimes = [regime for regime in diagram.regimes if regime.side == side]
    for regime in regimes:
        for corners in region(regime, plane, within_model=False):
            axes.add_patch(Polygon(corners, facecolor=OUTSIDE, edgecolor=OUTSIDE, lw=0.5, zorder=0.5))
    shown: dict[str, list[Array]] = {}
    for regime in regimes:
        shown[regime.name] = region(regime, plane)
        for corners in shown[regime.name]:
            colour, strength = colours(diagram, side)[regime.name]
            axes.add_patch(Polygon(corners, facecolor="white", edgecolor="none", zorder=0.6))
            axes.add_patch(Polygon(corners, facecolor=colour, alpha=strength, edgecolor="none", zorder=0.7))
    lines = list(boundaries(diagram, side, plane))
    for crossover, X, Y in lines:
        axes.plot(X, Y, color=INK, lw=1.1 if crossover is not None else 2.0, zorder=2)
    for kappa in shown_forces(diagram, plane):
        axes.axhline(math.log10(kappa), color=force_colour(kappa, plane), lw=0.7, ls=(0, (4, 2)), zorder=1.2)
    for point in diagram.points:
        if point.side == side and any(diagram.regime(name, side).inside for name in point.regimes):
            at = (logarithm(point.h, plane)(0, 0), logarithm(point.force, plane)(0, 0) - math.log10(plane.unit))
            axes.plot(*map(float, at), "o", color=INK, ms=4.5, zorder=4)
    films = draw_films(axes, diagram, plane, side)
    labels = Labels(axes)
    _name_regions(labels, shown, [regime for regime in regimes if not regime.inside], plane)
    _label_outside(labels, regimes, plane)
    if films:
        labels.along(*films, r"$h_\mathrm{eq}(F)$", FILM, 1.3)
    for crossover, X, Y in lines:
        if crossover is not None:
            labels.along(X, Y, f"${line_text(crossover, diagram)}$", INK)
    undecided = sum(not regime.forms for regime in regimes)
    if undecided:
        axes.text(
            1, 1.01, f"undecided, not drawn: {undecided}", transform=axes.transAxes, ha="right", va="bottom", fontsize=8
        )


def decade_ticks(axis: Any, limits: tuple[float, float]) -> None:
    """Ticks at powers of ten on an axis of logarithms."""
    first, last = math.ceil(limits[0] - 1e-9), math.floor(limits[1] + 1e-9)
    step = max(1, math.ceil((last - first) / 8))
    at = [n for n in range(first, last + 1) if n % step == 0]
    axis.set_ticks(at, [_power_of_ten(n) for n in at])
    axis.set_tick_params(length=2.5)


def line_text(crossover: Crossover, diagram: Diagram) -> str:
    """Mathtext of a crossover's formula: kappa = c (h/R)^p; F = ... in the parameters, where there are others."""
    try:
        return crossover_text(crossover, force_unit(diagram.law), _ONE)
    except ValueError:
        line: Eq = crossover.line
        return f"{mathtext(line.lhs)} = {mathtext(line.rhs)}"


_ONE = R / R


def draw_films(axes: Axes, diagram: Diagram, plane: Plane, side: Side) -> tuple[Array, Array] | None:
    """Films of one side, stable ones solid and unstable ones dashed; returns the longest piece in the window."""
    pieces = []
    for branch in branches(diagram.law) if diagram.law.F_adh != 0 else ():
        X, Y = film_points(branch, plane, side)
        if len(X) > 1:
            axes.plot(X, Y, color=FILM, lw=2.2, ls="-" if branch.stable else (0, (3, 1.5)), zorder=3)
            pieces.append((X, Y))
    return max(pieces, key=lambda piece: float(np.hypot(np.ptp(piece[0]), np.ptp(piece[1]))), default=None)


def film_points(branch: Branch, plane: Plane, side: Side) -> tuple[Array, Array]:
    """Points of a film in the window, on one side: log10(h/R) and log10(kappa)."""
    gaps, forces = np.array(branch.h), np.array(branch.force) * SIGN[side]
    pushed = forces > 0
    X, Y = np.log10(gaps[pushed]), np.log10(forces[pushed] / plane.unit)
    seen = (plane.xlim[0] <= X) & (plane.xlim[1] >= X) & (plane.ylim[0] <= Y) & (plane.ylim[1] >= Y)
    # one point more at each end, cut by the frame
    seen[1:] |= seen[:-1].copy()
    seen[:-1] |= seen[1:].copy()
    return X[seen], Y[seen]


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
        """Keep a text if it overlaps none, and lies in the frame and in one of some polygons; else remove it."""
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

    def along(self, X: Array, Y: Array, label: str, colour: str, distance: float = 0.85) -> bool:
        """Set a label along a line, so many times its size beside it, where there is room; leave it out if not."""
        pixels = self.axes.transData.transform(np.c_[X, Y])
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))])
        for size in (9.5, 8, 7):
            for place in (0.5, 0.35, 0.65, 0.2, 0.8):
                for offset in (1, -1):
                    here, ahead = (
                        np.array([np.interp(s * lengths[-1], lengths, pixels[:, k]) for k in (0, 1)])
                        for s in (place, min(1.0, place + 0.02))
                    )
                    way = ahead - here
                    way = -way if way[0] < 0 or (abs(way[0]) < 1e-9 and way[1] < 0) else way
                    way = way / (np.hypot(*way) or 1.0)
                    at = here + offset * distance * size * self.axes.figure.dpi / 72 * np.array([-way[1], way[0]])
                    x, y = self.axes.transData.inverted().transform(at)
                    text = self.axes.text(
                        float(x), float(y), label, color=colour, fontsize=size,
                        ha="center", va="center", rotation=math.degrees(math.atan2(way[1], way[0])),
                        rotation_mode="anchor", path_effects=HALO, zorder=6,
                    )  # fmt: skip
                    width = np.hypot(*(corners_of(text, self.renderer, 0)[1] - corners_of(text, self.renderer, 0)[0]))
                    if width > 0.9 * lengths[-1]:
                        text.remove()
                        break
                    if self.place(text):
                        return True
        return False


def corners_of(text: Text, renderer: Any, spare: float) -> Array:
    """Corners of a text's box in pixels, turned with it, wider by ``spare``."""
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
    return anchor + (flat - anchor) @ np.array([[c, s], [-s, c]])


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


def _name_regions(labels: Labels, shown: dict[str, list[Array]], outside: Sequence[Regime], plane: Plane) -> None:
    """Write the name of each regime into its region; beside it, with a line, where it is too small."""
    axes = labels.axes
    for name, polygons in sorted(shown.items(), key=lambda item: sum(map(_area, item[1]))):
        if not polygons:
            continue
        largest = max(polygons, key=_area)
        style: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold", "path_effects": HALO, "zorder": 6}
        if any(
            labels.place(axes.text(float(at[0]), float(at[1]), name, fontsize=size, **style), [largest])
            for size in (11, 9, 7.5)
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
    for height in (0.5, 0.3, 0.15):
        for place in (0.5, 0.3, 0.7):
            at = (plane.xlim[0] + place * (plane.xlim[1] - plane.xlim[0]), top - height)
            text = labels.axes.text(
                *at, r"outside the model: $|\delta| > R$", ha="center", va="center", fontsize=8.5, zorder=6
            )
            if labels.place(text):
                return


def _beyond(regime: Regime, plane: Plane) -> list[Array]:
    return region(regime, plane, within_model=False) if not regime.inside or regime.edge is not None else []


# --------------------------------------------------------------------------------------------------------- the curves


def draw_curves(
    panels: Sequence[Axes], diagram: Diagram, plane: Plane, side: Side, measured: Measurement | None
) -> None:
    """Deflection, gap rate and their exponents against h/R: exact, leading forms dotted; measured exponents as dots."""
    X = np.linspace(*plane.xlim, round(DENSITY * (plane.xlim[1] - plane.xlim[0])) + 1)
    kappas = shown_forces(diagram, plane)
    exact = states(diagram.law, side, 10 ** X[None], plane.unit * kappas[:, None])
    regimes = [regime for regime in diagram.regimes if regime.side == side and regime.inside and regime.forms]
    # V = F/(eta R)
    rates = np.abs(exact["dh_dt"]) / (plane.unit * kappas[:, None])
    sizes = [("delta", exact["delta"], r"$|\delta|/R$"), ("dh_dt", rates, r"$|\dot{h}|/V,\;\; V = |F|/(\eta R)$")]
    for axes, (quantity, values, label) in zip(panels, sizes, strict=False):
        _draw_sizes(axes, X, kappas, values, quantity, regimes, plane)
        axes.set_title(f"{label}: exact; dotted: leading forms")
    exponents = [
        ("lambda1", r"$\lambda_1 = d\,\ln|\delta|\,/\,d\,\ln h$"),
        ("lambda2", r"$\lambda_2 = d\,\ln|\dot{h}|\,/\,d\,\ln h$"),
    ]
    for axes, (name, label) in zip(panels[2:], exponents, strict=False):
        _draw_exponents(axes, X, kappas, exact[name], name, regimes, plane)
        dots = _draw_measured(axes, measured, name, side, plane)
        axes.set_title(label + ("; dots: measured" if dots else ""))
    for axes in panels:
        axes.set_xlim(plane.xlim)
        axes.set_xlabel("$h/R$", labelpad=1)
        decade_ticks(axes.xaxis, plane.xlim)


def force_key(figure: Figure, diagram: Diagram, plane: Plane) -> None:
    """Colours of the forces, in the upper right corner of a figure."""
    handles = [
        Line2D([], [], color=force_colour(kappa, plane), lw=2, label=_power_of_ten(round(math.log10(kappa))))
        for kappa in shown_forces(diagram, plane)
    ]
    figure.legend(
        handles=handles, title=r"$|\kappa|$ of the curves", ncols=len(handles), fontsize=8, title_fontsize=8,
        loc="upper right", bbox_to_anchor=(0.99, 1 - 0.05 / figure.get_figheight()), handlelength=1.2,
        columnspacing=1.2, frameon=False, borderaxespad=0,
    )  # fmt: skip


def _power_of_ten(n: int) -> str:
    return rf"$10^{{{n}}}$" if n not in (0, 1) else f"${10**n}$"


def _draw_sizes(
    axes: Axes, X: Array, kappas: Array, values: Array, quantity: str, regimes: Sequence[Regime], plane: Plane
) -> None:
    for kappa, row in zip(kappas, values, strict=True):
        with np.errstate(divide="ignore"):
            axes.plot(X, np.log10(row), color=force_colour(kappa, plane), lw=1.3, zorder=2)
        Y = np.full(len(X), math.log10(kappa))
        for regime in regimes:
            if quantity not in regime.forms:
                continue
            leading = regime.forms[quantity].leading
            form = logarithm(leading / R if quantity == "delta" else leading * eta * R / force, plane)
            inside = holds(regime, plane, X, Y)
            Z = np.where(inside, np.broadcast_to(form(X, Y), X.shape), np.nan)
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
    # a film makes an exponent diverge: what is shown is at most as far from the plateaus as they are from each other
    span = high - low + 1.0
    low = min(low, max(float(within.min()), low - span)) if len(within) else low
    high = max(high, min(float(within.max()), high + span)) if len(within) else high
    margin = 0.08 * (high - low) + 0.02
    axes.set_ylim(low - margin, high + margin)
    exact = {float(value): value for value in _plateaus(regimes, name)}
    for value in plateaus:
        axes.axhline(value, color="#BBBBBB", lw=0.6, zorder=0.5)
    axes.set_yticks(plateaus, [f"${latex(exact[value], fold_short_frac=True)}$" for value in plateaus])


def _plateaus(regimes: Sequence[Regime], name: str) -> list[Expr]:
    values = (getattr(regime, name) for regime in regimes)
    return [value for value in values if value is not None and value.is_number]


def _draw_measured(axes: Axes, measured: Measurement | None, name: str, side: Side, plane: Plane) -> bool:
    """Measured exponents, as dots in the colour of their force; whether there are any."""
    runs = [run for run in measured.runs if run.side == side] if measured is not None else []
    for run in runs:
        axes.plot(
            np.log10(run.h), getattr(run, name), ".", ms=2.5, color=force_colour(run.kappa, plane), zorder=4, alpha=0.7
        )
    return bool(runs)
