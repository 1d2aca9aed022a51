"""Figures 3 and 4 of Rognon & Gay, arXiv 0803.1573, from a law and from the simulations of it.

Every formula is typeset from the law's declaration and derivation, every curve comes from a run, and every boundary
from the equality of two leading forms.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, style
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import MathTextParser
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Polygon
from matplotlib.path import Path as Path2D
from matplotlib.patheffects import withStroke
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from sympy import Expr, Mul, Pow, S, Symbol, latex

from softdyn.colours import AMBER, BLUE, GREEN, ORANGE, PURPLE, SKY
from softdyn.derive.dynamics import F_a, F_delta, a_delta, a_h, generic_dynamics, partials
from softdyn.derive.forms import force, force_unit
from softdyn.derive.law import expressions
from softdyn.derive.regimes import Crossover, Diagram, Regime
from softdyn.derive.symbols import R, eta, h
from softdyn.derive.typeset import symbol_latex
from softdyn.mathtext import displayed, literal
from softdyn.results.whole_files import written_whole
from softdyn.study.plane import Plane, boundaries, holds, logarithm, monomial, ordering, parameter_values, region

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d.axes3d import Axes3D

    from softdyn.derive.law import ContactLaw

Array = NDArray[np.float64]
Interval = tuple[float, float]

DPI = 150
STYLE = {
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.linewidth": 0.7,
    "mathtext.fontset": "stix",
    "font.family": "sans-serif",
    "savefig.dpi": DPI,
    # the same figure gives the same file
    "svg.hashsalt": "softdyn",
    "svg.fonttype": "path",
}
#: Colours of the regimes, in the order of the law's limits.
COLOURS = (SKY, AMBER, GREEN, PURPLE, BLUE, ORANGE)
#: Colours of the forces; the ends of the map, too light and too dark for lines, are left out.
FORCES = colormaps["magma"]
FORCE_SPAN = (0.05, 0.75)
#: Elevation and azimuth of the views.
VIEW = (23, -114)
INK = "#222222"
HALO = [withStroke(linewidth=2.5, foreground="white")]


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw and save within this context: matplotlib's own defaults, whatever the user's, and :data:`STYLE`."""
    with style.context(["default", STYLE]):
        yield


def save(figure: Figure, path: Path) -> None:
    """Write a figure, whole or not at all, with nothing in it that changes from run to run.

    Raises
    ------
    SceneError
        If the file cannot be written.
    """
    form = path.suffix[1:]
    with written_whole(path) as temporary:
        figure.savefig(temporary, format=form, metadata={"Date": None} if form == "svg" else {"Software": None})


# ---------------------------------------------------------------------------------------------------- typesetting

#: The order in which factors are written.
RANK = {name: i for i, name in enumerate(("pi", "eta", "E", "F", "R", "a", "h", "delta"))}


def mathtext(expr: Expr) -> str:
    """Mathtext of an expression, without the dollars; plain text where mathtext cannot set its LaTeX."""
    joined = expr.replace(lambda part: isinstance(part, Mul), join_roots)
    text = latex(joined, symbol_names=_names(joined), fold_frac_powers=True, mul_symbol=r"\,")
    # mathtext grows a bar with what it encloses, and ignores spaces
    text = text.replace(r"\left|{\delta}\right|", r"|\delta|").replace(r" \operatorname", r"\,\operatorname")
    return text if _parses(text) else r"\mathtt{" + _plain(str(expr)) + "}"


def _names(expr: Expr) -> dict[Symbol, str]:
    """The paper's names; but F as a size, positive, is plain F."""
    return {s: "F" if s == force else symbol_latex(s.name) for s in expr.free_symbols}


def _plain(text: str) -> str:
    return "".join(rf"\{c}" if c in " _%$#&{}" else c for c in text)


def _parses(text: str) -> bool:
    try:
        MathTextParser("path").parse(f"${text}$")
    except ValueError:
        return False
    return True


def join_roots(product: Expr) -> Expr:
    """Write sqrt(2)*sqrt(R)*sqrt(h), as sympy holds it, under one root."""
    roots = [factor for factor in product.args if isinstance(factor, Pow) and factor.exp == S.Half]
    if len(roots) < 2:
        return product
    rest = [factor for factor in product.args if factor not in roots]
    root = Pow(Mul(*(factor.base for factor in roots), evaluate=False), S.Half, evaluate=False)
    return Mul(*rest, root, evaluate=False) if rest else root


def monomial_text(number: Expr, powers: Mapping[str, Expr]) -> str:
    """Mathtext of a number times powers; those with a negative whole exponent go under the bar."""
    if number.could_extract_minus_sign():
        return "-" + monomial_text(-number, powers)
    numerator, denominator = number.as_numer_denom()
    top = [latex(numerator)] if numerator != 1 else []
    bottom = [latex(denominator)] if denominator != 1 else []
    for base, power in powers.items():
        if power != 0:
            (bottom if _below(power) else top).append(_power_text(base, -power if _below(power) else power))
    if not bottom:
        return r"\,".join(top) or "1"
    return rf"\dfrac{{{_side(top) or 1}}}{{{_side(bottom)}}}"


def _side(parts: list[str]) -> str:
    """One side of a fraction: a sum that is alone needs no brackets."""
    text = r"\,".join(parts)
    alone = len(parts) == 1 and text.startswith(r"\left(") and text.endswith(r"\right)")
    return text[len(r"\left(") : -len(r"\right)")] if alone else text


def _below(power: Expr) -> bool:
    return bool(power.is_integer and power < 0)


def _power_text(base: str, power: Expr) -> str:
    return base if power == 1 else rf"{base}^{{{latex(power, fold_short_frac=True)}}}"


def product_text(expr: Expr) -> str:
    """Mathtext of a product of powers, its factors in the customary order; of anything else as :func:`mathtext`."""
    if expr.is_Add:
        return mathtext(expr)
    number, powers = S.One, {}
    for factor in Mul.make_args(expr):
        base, power = factor.as_base_exp()
        if factor.is_number and not factor.has(S.Pi):
            number *= factor
        elif (base.is_Symbol or base.is_Add or base == S.Pi) and power.is_integer:
            powers[base] = power
        else:
            return mathtext(expr)
    ordered = sorted(powers, key=lambda base: (RANK.get(str(base), len(RANK) + base.is_Add), str(base)))
    texts = {base: rf"\left({mathtext(base)}\right)" if base.is_Add else mathtext(base) for base in ordered}
    return monomial_text(number, {texts[base]: powers[base] for base in ordered})


# ----------------------------------------------------------------------------------------------- the phase diagram


def centre(corners: Array) -> tuple[float, float]:
    """Centroid of a polygon."""
    X, Y = np.array(corners).T
    cross = X * np.roll(Y, -1) - np.roll(X, -1) * Y
    area = cross.sum() / 2
    return (
        float(((X + np.roll(X, -1)) * cross).sum() / (6 * area)),
        float(((Y + np.roll(Y, -1)) * cross).sum() / (6 * area)),
    )


def model_edge(diagram: Diagram) -> Expr:
    """The value of kappa at which delta = R in the leading forms, kappa*; 1 if that is not one value."""
    inside = {regime.name: regime for regime in diagram.regimes if regime.inside and regime.side == "compression"}
    edges = {regime.edge for regime in inside.values() if regime.edge is not None}
    edges |= {
        crossover.line.rhs
        for crossover in diagram.crossovers
        if crossover.side == "compression"
        and crossover.line.lhs == force
        and (crossover.first in inside) != (crossover.second in inside)
    }
    unit = force_unit(diagram.law)
    values = {(edge / unit).simplify() for edge in edges}
    return values.pop() if len(values) == 1 and not next(iter(values)).free_symbols else S.One


# ------------------------------------------------------------------------------------------------------- figure 3


def figure3(diagram: Diagram, table: Mapping[str, NDArray[Any]]) -> Figure:
    """Figure 3: the regimes of a law, and the simulations that pass through them.

    Parameters
    ----------
    diagram : Diagram
        The regimes discovered of a law whose only parameters are R, E and eta.
    table : mapping from str to array of shape (forces, gaps)
        As of :class:`softdyn.study.reproduce.Study`: ``h/R``, ``kappa``, ``delta/R``, ``dh_dt``, ``lambda1``,
        ``lambda2``, in units R = E = eta = 1.

    Returns
    -------
    Figure
        (a) leading forms, (b) crossovers, (c) deflection, (d) its exponent, (e) gap rate, (f) its exponent.
    """
    figure = Figure(figsize=(1600 / DPI, 1900 / DPI))
    found = [regime for regime in diagram.regimes if regime.inside and regime.side == "compression"]
    grid = figure.add_gridspec(
        3, 20, height_ratios=(0.62, 1, 1), left=0.012, right=0.988, top=0.975, bottom=0.012, hspace=0.1, wspace=0
    )
    draw_table(figure.add_subplot(grid[0, :12]), diagram, found)
    draw_phases(figure.add_subplot(grid[0, 13:]), diagram, found, table)
    rate = -table["dh_dt"] / table["kappa"]  # V = F/(eta R) is kappa in these units
    panels = (
        ("(c) deflection", r"$\log_{10}\,\delta/R$; dotted: limits", np.log10(table["delta/R"]), "delta", True),
        (
            "(d) exponent of the deflection",
            r"$\lambda_1 = d\,\ln\delta\,/\,d\,\ln h$",
            table["lambda1"],
            "delta",
            False,
        ),
        ("(e) gap rate", r"$\log_{10}\,(-\dot{h}/V)$; dotted: limits", np.log10(rate), "dh_dt", True),
        ("(f) exponent of the gap rate", r"$\lambda_2 = d\,\ln\dot{h}\,/\,d\,\ln h$", table["lambda2"], "dh_dt", False),
    )
    for i, (title, label, values, quantity, is_log) in enumerate(panels):
        axes = figure.add_subplot(grid[1 + i // 2, 10 * (i % 2) : 10 * (i % 2) + 10], projection="3d")
        draw_over_phases(axes, f"{title}: {label}", values, quantity, is_log, diagram, found, table)
    return figure


def force_colour(force: float, table: Mapping[str, NDArray[Any]]) -> Any:
    """Colour of a run, by the logarithm of its kappa."""
    scale = Normalize(*np.log10([table["kappa"].min(), table["kappa"].max()]))
    low, high = FORCE_SPAN
    return FORCES(low + (high - low) * float(scale(math.log10(force))))


def draw_table(axes: Axes, diagram: Diagram, found: Sequence[Regime]) -> None:
    """Panel (a): the leading forms of each regime, with their exact prefactors.

    Parameters
    ----------
    axes : Axes
    diagram : Diagram
    found : sequence of Regime
        Those that have a row, from the top.
    """
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    axes.set_title("(a) limits of the law")
    unit, edge = force_unit(diagram.law), model_edge(diagram)
    names = ("condition", "$a$", r"$\zeta$", r"$\delta/R$", r"$-\dot{h}/V$", r"$\lambda_1$", r"$\lambda_2$")
    centres = (0.225, 0.37, 0.49, 0.635, 0.81, 0.93, 0.98)
    height = 0.88 / (len(found) + 0.6)
    for name, at in zip(names, centres, strict=True):
        axes.text(at, 0.94, name, ha="center", va="center", fontsize=9.5)
    for i, (regime, colour) in enumerate(zip(found, COLOURS, strict=False)):
        y = 0.88 - (i + 0.5) * height
        axes.add_patch(Polygon(
            [(0, y - 0.45 * height), (1, y - 0.45 * height), (1, y + 0.45 * height), (0, y + 0.45 * height)],
            facecolor=colour, alpha=0.25, edgecolor="none",
        ))  # fmt: skip
        axes.text(0.012, y, literal(regime.name), ha="left", va="center", weight="bold", fontsize=9.5)
        cells = (
            " \\ll ".join(mathtext(length) for length in ordering(regime) or ()),
            product_text(regime.forms["a"].state),
            product_text(regime.forms["zeta"].state),
            scaled_text(regime.delta / R, unit, edge),
            scaled_text(-regime.dh_dt * eta * R / force, unit, edge),
            latex(regime.lambda1, fold_short_frac=True),
            latex(regime.lambda2, fold_short_frac=True),
        )
        for cell, at in zip(cells, centres, strict=True):
            if cell:
                axes.text(at, y, f"${cell}$", ha="center", va="center", fontsize=10)
    note = r"$\kappa = F/(E R^2),\;\; V = F/(\eta R)$"
    if edge != 1:
        note += rf"$,\;\; \kappa_\ast = {latex(edge)}$, where $\delta = R$"
    axes.text(0.012, 0.04, note, ha="left", va="center", fontsize=9.5)


def scaled_text(form: Expr, unit: Expr, edge: Expr) -> str:
    """Mathtext of a dimensionless form in h/R and kappa = F/unit over its value at the edge of the model.

    Parameters
    ----------
    form : Expr
        A product of powers of h, F and the parameters.
    unit : Expr
        Of forces: kappa = F/unit.
    edge : Expr
        Value of kappa at the edge of the model, kappa*; 1 to write kappa itself.
    """
    number, gap_power, power = monomial(form, unit)
    number = (number * edge**power).simplify()
    kappa = r"\kappa" if edge == 1 else r"\kappa/\kappa_\ast"
    parts = [latex(number).replace(r"\frac", r"\dfrac")] if number != 1 else []
    parts += [_quotient_power(base, to) for base, to in ((kappa, power), ("h/R", gap_power)) if to != 0]
    return r"\,".join(parts) or "1"


def _quotient_power(base: str, power: Expr) -> str:
    return base if power == 1 else _power_text(rf"({base})" if "/" in base else base, power)


def window(diagram: Diagram, xlim: Interval, ylim: Interval) -> Plane:
    """Return the plane of a law, seen through a window of log10(h/R) and log10(kappa).

    Parameters
    ----------
    diagram : Diagram
        Of a law with typical values of all of its own parameters.
    xlim, ylim : (low, high)
        Of log10(h/R) and log10(kappa).
    """
    values = parameter_values(diagram.law)
    return Plane(diagram.law, values, float(force_unit(diagram.law).subs(values)), xlim, ylim)


def draw_phases(axes: Axes, diagram: Diagram, found: Sequence[Regime], table: Mapping[str, NDArray[Any]]) -> None:
    """Panel (b): where each regime is, and the way of each run through them, from the right to the left.

    Parameters
    ----------
    axes : Axes
    diagram : Diagram
    found : sequence of Regime
        Those that are drawn.
    table : mapping from str to array, shape (forces, gaps)
        With ``h/R`` and ``kappa`` of the runs; see :func:`figure3`.
    """
    X, Y = np.log10(table["h/R"]), np.log10(table["kappa"])
    xlim, ylim = (float(X.min()), float(X.max())), (float(Y.min()) - 0.4, 0.4)
    plane = window(diagram, xlim, ylim)
    axes.set(xlim=xlim, ylim=ylim)
    axes.set_title("(b) crossovers")
    axes.set_xlabel(r"$\log_{10}\, h/R$", labelpad=1)
    axes.set_ylabel(r"$\log_{10}\, \kappa$", labelpad=1)
    axes.tick_params(length=2.5)
    for regime, colour in zip(found, COLOURS, strict=False):
        for corners in region(regime, plane):
            axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.35, edgecolor="none"))
            axes.text(
                *centre(corners),
                literal(regime.name),
                ha="center",
                va="center",
                weight="bold",
                fontsize=10,
                path_effects=HALO,
            )
    edge = model_edge(diagram)
    for crossover, x_line, y_line in boundaries(diagram, "compression", plane):
        axes.plot(x_line, y_line, color=INK, lw=1.3, zorder=2)
        if crossover is not None:
            label_line(axes, x_line, y_line, crossover_text(crossover, force_unit(diagram.law), edge))
    outside = r"outside the model: $\delta > R$" + (r", $\kappa > \kappa_\ast$" if edge != 1 else "")
    axes.text(sum(xlim) / 2, (math.log10(edge) + ylim[1]) / 2, outside, ha="center", va="center")
    for x_run, y_run in zip(X, Y, strict=True):
        colour = force_colour(10 ** float(y_run[0]), table)
        axes.plot(x_run, y_run, color=colour, lw=0.8, marker="<", ms=3.2, markevery=(10, 20), zorder=1.5)


def label_line(axes: Axes, X: Array, Y: Array, text: str) -> None:
    """Set a formula along a straight line.

    Parameters
    ----------
    axes : Axes
    X, Y : array, shape (points,)
        Of the line, in the coordinates of the axes.
    text : str
        Mathtext, without the dollars.
    """
    along = np.array([X[-1] - X[0], Y[-1] - Y[0]])
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    axes.text(
        X[0] + 0.3 * along[0] + 0.1 * across[0], Y[0] + 0.3 * along[1] + 0.1 * across[1], f"${text}$",
        rotation=math.degrees(math.atan2(along[1], along[0])), rotation_mode="anchor", transform_rotates_text=True,
        ha="center", va="bottom", zorder=3, path_effects=HALO, fontsize=9.5,
    )  # fmt: skip


def crossover_text(crossover: Crossover, unit: Expr, edge: Expr) -> str:
    """Mathtext of a crossover, as h = R or kappa = kappa* (h/R)^power.

    Parameters
    ----------
    crossover : Crossover
    unit : Expr
        Of forces: kappa = F/unit.
    edge : Expr
        Value of kappa at the edge of the model, kappa*; 1 to write kappa itself.
    """
    if crossover.line.lhs == h:
        return f"h = {product_text(crossover.line.rhs)}"
    parts = [] if edge == 1 else [r"\kappa_\ast"]
    form = scaled_text((crossover.line.rhs / unit / edge).simplify(), unit, S.One)
    return r"\kappa = " + r"\,".join([*parts, *([form] if form != "1" else [])])


def draw_over_phases(
    axes: Axes3D,
    title: str,
    values: Array,
    quantity: str,
    is_log: bool,
    diagram: Diagram,
    found: Sequence[Regime],
    table: Mapping[str, NDArray[Any]],
) -> None:
    """Panels (c) to (f): one quantity along each run, above the phase diagram.

    Parameters
    ----------
    axes : Axes3D
    title : str
    values : array, shape (forces, gaps)
        log10 of delta/R, or of the rate over V, or the exponent of either.
    quantity : "delta" or "dh_dt"
        Of whose leading forms it is.
    is_log : bool
        Whether values are logarithms, beside which leading forms are drawn, and not exponents.
    diagram : Diagram
    found : sequence of Regime
        Those that are drawn.
    table : mapping from str to array, shape (forces, gaps)
        With ``h/R`` and ``kappa`` of the runs; see :func:`figure3`.
    """
    X, Y = np.log10(table["h/R"]), np.log10(table["kappa"])
    xlim, ylim = (float(X.min()), float(X.max())), (float(Y.min()), 0.0)
    plane = window(diagram, xlim, ylim)
    exponents = {regime.lambda1 if quantity == "delta" else regime.lambda2 for regime in found}
    expected: list[Expr] = sorted((value for value in exponents if value is not None), key=float)
    low, high = float(values.min()), float(values.max())
    if not is_log:
        low, high = min(low, float(expected[0])), max(high, float(expected[-1]))
    floor = low - 0.35 * (high - low)
    axes.computed_zorder = False
    draw_floor(axes, floor, diagram, found, plane)
    # the farthest first: the view is from small kappa
    for x_run, y_run, z_run in list(zip(X, Y, values, strict=True))[::-1]:
        colour = force_colour(10 ** float(y_run[0]), table)
        axes.plot(x_run, y_run, floor, color=colour, lw=0.5, alpha=0.6, zorder=2, clip_on=False)
        axes.plot(x_run, y_run, z_run, color=colour, lw=1.3, zorder=4, clip_on=False)
        if is_log:
            for regime in found:
                # the rate is shown over V = F/(eta R)
                form = regime.delta / R if quantity == "delta" else regime.dh_dt * eta * R / force
                draw_leading_form(axes, form, regime, plane, x_run, y_run)
    axes.set(xlim=xlim, ylim=ylim, zlim=(floor, high))
    axes.text2D(0.03, 0.97, title, transform=axes.transAxes, ha="left", va="top", fontsize=10)
    axes.set_xlabel(r"$\log_{10}\, h/R$", labelpad=-4)
    axes.set_ylabel(r"$\log_{10}\, \kappa$", labelpad=-4)
    axes.tick_params(pad=-2, labelsize=7.5)
    axes.tick_params(axis="z", pad=1)
    axes.set_xticks(range(math.ceil(xlim[0]), math.floor(xlim[1]) + 1))
    axes.set_yticks(range(math.ceil(ylim[0]) + 1, math.floor(ylim[1]), 2))
    if is_log:
        step = max(1, round((high - low) / 5))
        axes.set_zticks(range(math.ceil(low / step) * step, math.floor(high) + 1, step))
    else:
        axes.set_zticks([float(value) for value in expected], [f"${latex(v, fold_short_frac=True)}$" for v in expected])
    axes.view_init(*VIEW)
    axes.set_box_aspect((1.3, 1, 0.85), zoom=1.2)


def draw_floor(axes: Axes3D, z: float, diagram: Diagram, found: Sequence[Regime], plane: Plane) -> None:
    """Replot the phase diagram at the height z.

    Parameters
    ----------
    axes : Axes3D
    z : float
    diagram : Diagram
    found : sequence of Regime
        Those that are drawn.
    plane : Plane
    """
    for regime, colour in zip(found, COLOURS, strict=False):
        for corners in region(regime, plane):
            flat = [[(px, py, z) for px, py in corners]]
            axes.add_collection3d(
                Poly3DCollection(flat, facecolors=colour, alpha=0.35, edgecolors="none", zorder=1, clip_on=False)
            )
            at = centre(corners)
            axes.text(*at, z, literal(regime.name), ha="center", va="center", fontsize=7.5, zorder=6, path_effects=HALO)
    for _, px, py in boundaries(diagram, "compression", plane):
        axes.plot(px, py, z, color=INK, lw=1, zorder=2, clip_on=False)


def draw_leading_form(axes: Axes3D, form: Expr, regime: Regime, plane: Plane, X: Array, Y: Array) -> None:
    """Leading form of a quantity along one run, where it is inside the regime.

    Parameters
    ----------
    axes : Axes3D
    form : Expr
        Dimensionless, in h, F and the parameters.
    regime : Regime
    plane : Plane
    X, Y : array, shape (gaps,)
        log10(h/R) and log10(kappa) of the run.
    """
    inside = holds(regime, plane, X, Y)
    Z = logarithm(form, plane)(X, Y)
    axes.plot(X[inside], Y[inside], Z[inside], color=INK, lw=0.7, ls=(0, (1, 1.5)), zorder=5, clip_on=False)


# ------------------------------------------------------------------------------------------------------- figure 4

#: The figure's coordinates are points (1/72 inch), so that text can be fitted to boxes.
WIDTH, HEIGHT = 768.0, 505.0
LARGEST, SMALLEST = 13.0, 6.5
LAW_COLOUR, DERIVED_COLOUR, LOOP_COLOUR, OUTPUT_COLOUR = "#FBE8C5", "#D5EFE4", "#DCEEFA", "#EEEEEE"


def figure4(law: ContactLaw) -> Figure:
    """Figure 4: the method as a flow chart, with the law's own expressions."""
    figure = Figure(figsize=(WIDTH / 72, HEIGHT / 72))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, HEIGHT))
    axes.set_axis_off()
    generic, derived = generic_dynamics(), partials(law)
    arguments = {"a": "(h, \\delta)", "F_ela": "(a, \\delta)", "zeta": "(a, h)", "F_adh": "(a, h)"}
    declared = [formula(symbol_latex(name) + arguments[name], expr) for name, expr in expressions(law).items()]
    # left: what is declared, and what follows from it, once
    box(axes, (12, 265, 400, 228), f"declared: the law {law.name}", declared, LAW_COLOUR)
    consequences = [formula(symbol_latex(symbol.name), derived[symbol]) for symbol in (a_h, a_delta, F_a, F_delta)]
    consequences += [formula("C", generic.stiffness.together()), formula("D", generic.friction)]
    box(axes, (12, 12, 400, 208), "derived from eqs. 1 and 2", consequences, DERIVED_COLOUR, columns=2)
    # right: what is done at each step, and with its results
    balance = [r"F_\mathrm{ela}(a(h, \delta), \delta) = F_\mathrm{ext}\;\Rightarrow\;\delta"]
    steps = r"\dfrac{d\,\ln h}{dt} = \dfrac{\dot{h}}{h}\,,\quad t \to t + \Delta t"
    gap_lines = [formula(symbol_latex("dh_dt"), generic.dh_dt)]
    geometry = dict(generic.steps)["geometry"].rhs
    centre_lines = [formula("X", geometry), formula(symbol_latex("dX_dt"), generic.dX_dt)]
    outputs = [r"t,\; h,\; \delta,\; X,\; \dot{h},\; \dot{X},\; \lambda_1,\; \lambda_2"]
    left, width = 486, 232
    box(axes, (left, 459, width, 34), "given", [r"F_\mathrm{ext}(t),\; h(0)"], OUTPUT_COLOUR, beside=True)
    box(axes, (left, 382, width, 54), "force balance (eq. 1)", balance, LOOP_COLOUR)
    box(axes, (left, 289, width, 70), "gap dynamics (eq. 7)", gap_lines, LOOP_COLOUR)
    box(axes, (left, 197, width, 69), "integration", [steps], LOOP_COLOUR)
    box(axes, (left, 70, width, 104), "centre (eqs. 2 and 9)", centre_lines, OUTPUT_COLOUR)
    box(axes, (left, 12, width, 35), "output", outputs, OUTPUT_COLOUR, beside=True)
    middle = left + width / 2
    for top, bottom in ((459, 436), (382, 359), (289, 266), (197, 174), (70, 47)):
        arrow(axes, [(middle, top), (middle, bottom)])
    arrow(
        axes, [(left + width, 231), (746, 231), (746, 409), (left + width, 409)], "next step", (754, 320), rotation=90
    )
    arrow(axes, [(212, 265), (212, 220)], "differentiated by sympy", (218, 242), ha="left")
    arrow(axes, [(412, 409), (left, 409)], r"$a,\,F_\mathrm{ela}$", (449, 416))
    arrow(axes, [(412, 324), (left, 324)], r"$\zeta,\,F_\mathrm{adh}$", (449, 331))
    arrow(axes, [(412, 122), (left, 122)], r"$C,\,D$", (449, 129))
    return figure


def formula(name: str, expr: Expr) -> str:
    """Mathtext of "name = expression", in the form that is easiest to read."""
    return f"{name} = {displayed(product_text(expr))}"


def box(
    axes: Axes,
    frame: tuple[float, float, float, float],
    title: str,
    formulas: Sequence[str],
    colour: str,
    columns: int = 1,
    beside: bool = False,
) -> None:
    """Draw a box (left, bottom, width, height) with a title and, below or beside it, formulas that fit into it.

    Parameters
    ----------
    axes : Axes
        Whose coordinates are points.
    frame : tuple of float
        Left, bottom, width and height, in points.
    title : str
    formulas : sequence of str
        Mathtext, without the dollars.
    colour : str
        Of the area.
    columns : int
        In which the formulas stand.
    beside : bool
        Whether they stand beside the title.
    """
    left, bottom, width, height = frame
    axes.add_patch(FancyBboxPatch(
        (left + 4, bottom + 4), width - 8, height - 8, boxstyle="round,pad=4", facecolor=colour, edgecolor=INK, lw=0.8
    ))  # fmt: skip
    if beside:
        axes.text(left + 10, bottom + height / 2, title, ha="left", va="center", weight="bold")
        left, width = left + 50, width - 50
    else:
        axes.text(left + 10, bottom + height - 14, title, ha="left", va="center", weight="bold")
        height -= 20
    rows = math.ceil(len(formulas) / columns)
    cell = (width / columns, height / rows)
    sizes = [fitting_size(text, cell[0] - 16, cell[1] - 4) for text in formulas]
    for i, (text, size) in enumerate(zip(formulas, sizes, strict=True)):
        at = (left + (i % columns + 0.5) * cell[0], bottom + height - (i // columns + 0.5) * cell[1])
        if size >= SMALLEST:
            axes.text(*at, f"${text}$", ha="center", va="center", fontsize=size)
        else:
            axes.text(*at, f"${text.partition(' = ')[0]}$: too long to be shown here", ha="center", va="center")


def fitting_size(text: str, width: float, height: float) -> float:
    """Return the font size, in points, at which mathtext fits into a box in points; at most LARGEST.

    Parameters
    ----------
    text : str
        Mathtext, without the dollars.
    width, height : float
        Of the box, in points.
    """
    parsed = MathTextParser("path").parse(f"${text}$", dpi=72, prop=FontProperties(size=LARGEST))
    # the height of what is parsed includes its depth
    return float(LARGEST * min(1.0, width / parsed.width, height / parsed.height))


def arrow(
    axes: Axes, points: Sequence[tuple[float, float]], label: str = "", at: tuple[float, float] = (0, 0), **text: Any
) -> None:
    """Arrow along straight pieces, with a label.

    Parameters
    ----------
    axes : Axes
    points : sequence of (x, y)
        Corners of the line, the first and the last its ends.
    label : str
        Text, with dollars around formulas.
    at : (x, y)
        Where the label is.
    **text
        What ``Axes.text`` takes besides, for the label.
    """
    path = Path2D([*points])
    axes.add_patch(
        FancyArrowPatch(path=path, arrowstyle="-|>", mutation_scale=10, color=INK, lw=1.1, shrinkA=0, shrinkB=0)
    )
    if label:
        axes.text(*at, label, **{"ha": "center", "va": "center", **text})
