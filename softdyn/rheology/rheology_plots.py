"""Pictures of flow curves, oscillations, steps and compressions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from softdyn.colours import AMBER, BLUE, GREEN, ORANGE, PURPLE, SKY
from softdyn.results.whole_files import written_whole
from softdyn.rheology.column_units import tell_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.rheology.curves import Curves
    from softdyn.rheology.flow_curve import FlowCurve
    from softdyn.rheology.run_table import RunTable
    from softdyn.rheology.uncertainty import Indices

Array = NDArray[np.float64]

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, "0.3", "0.6")
STYLE: dict[str, Any] = {
    "font.size": 9.0, "axes.titlesize": 9.5, "axes.titlelocation": "left", "axes.linewidth": 0.7,
    "legend.fontsize": 8.0, "legend.frameon": False, "savefig.dpi": 150, "svg.hashsalt": "softdyn",
}  # fmt: skip
#: How each law of flow is drawn.
DASHES = {"Herschel-Bulkley": "-", "power law": ":"}
#: Width of a panel, and height of a figure, in inches.
WIDE, HIGH = 3.9, 3.4


def save_figure(figure: Figure, path: Path, units: str = "") -> None:
    """Write a figure, whole or not at all.

    Parameters
    ----------
    figure : Figure
    path : Path
    units : str
        "SI" if numbers are in SI units: titles and labels say so then.

    Raises
    ------
    SceneError
        If the file cannot be written.
    """
    tell_units(figure.axes, units)
    with written_whole(path) as temporary, style.context(["default", STYLE]):
        figure.savefig(temporary, format=path.suffix[1:])


def panels(count: int) -> tuple[Figure, Sequence[Axes]]:
    """A figure with panels side by side."""
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDE * count, HIGH), layout="constrained")
        return figure, [figure.add_subplot(1, count, k + 1) for k in range(count)]


def draw_uncertainty(table: RunTable, drawn: int, names: Sequence[str], indices: Mapping[str, Indices]) -> Figure:
    """How observables are distributed, and, below, by which parameter they vary.

    Parameters
    ----------
    table : RunTable
    drawn : int
        How many of the runs, from the first on, are samples of the distributions.
    names : sequence of str
        Of the observables.
    indices : mapping from str to Indices
        Of those that have some.
    """
    rows = 2 if indices else 1
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDE * max(1, len(names)) * 0.75, HIGH * rows * 0.8), layout="constrained")
        for k, name in enumerate(names):
            values = table.columns[name][:drawn]
            values = values[np.isfinite(values)]
            ax = figure.add_subplot(rows, len(names), k + 1)
            ax.hist(values, bins="auto" if np.ptp(values) > 0 else 1, color=SKY)
            for q, dash in zip(np.quantile(values, (0.05, 0.5, 0.95)), (":", "-", ":"), strict=True):
                ax.axvline(q, color="0.2", linewidth=0.9, linestyle=dash)
            ax.set_title(name)
            ax.xaxis.set_major_locator(MaxNLocator(4))
            if not k:
                ax.set_ylabel("runs")
            if name in indices:
                _draw_indices(figure.add_subplot(rows, len(names), len(names) + k + 1), indices[name], not k)
        return figure


def _draw_indices(ax: Axes, indices: Indices, named: bool) -> None:
    """First-order and total indices of each parameter, with their intervals."""
    for kind, of, colour, shift in (
        ("first order", indices.first, BLUE, -0.18),
        ("total", indices.total, ORANGE, 0.18),
    ):
        at, low, high = np.array(list(of.values())).T
        y = np.arange(len(at)) + shift
        ax.barh(y, at, 0.34, color=colour, label=kind)
        ax.errorbar(
            at, y, xerr=[np.maximum(at - low, 0), np.maximum(high - at, 0)], fmt="none", ecolor="0.2", elinewidth=0.8
        )
    ax.set_yticks(range(len(indices.first)), list(indices.first))
    ax.invert_yaxis()
    ax.set_xlabel("part of the variance")
    if named:
        ax.legend()


def draw_flow_curves(table: RunTable, curves: Sequence[FlowCurve]) -> Figure:
    """Shear stress with its parts and fits, pressure, and normal stress differences, over the shear rate.

    What is not steady is drawn open, without an error bar: it enters no fit.
    """
    with style.context(["default", STYLE]):
        figure, (stress, pressure, normal) = panels(3)
        for k, curve in enumerate(curves):
            _draw_curve(table, curve, COLOURS[k % len(COLOURS)], stress, pressure, normal)
        stress.set_title("shear stress")
        pressure.set_title("pressure of the particles")
        second = "N2" in table.columns
        normal.set_title("normal stress differences $N_1$, $N_2$" if second else "normal stress difference $N_1$")
        for ax in (stress, pressure, normal):
            ax.set_xscale("log")
            ax.set_xlabel("shear rate")
        for ax, name in ((stress, "contact_stress"), (pressure, "pressure")):
            values = table.columns[name]
            if (values[np.isfinite(values)] > 0).all():
                ax.set_yscale("log")
        normal.axhline(0.0, color="0.7", linewidth=0.7, zorder=0)
        _explain(stress, table, curves)
        if second:
            marks = [Line2D([], [], marker=mark, color="0.3", linestyle="") for mark in "o^"]
            normal.legend(marks, ["$N_1$", "$N_2$"])
        if len(curves) > 1:
            handles = [Line2D([], [], marker="o", color=COLOURS[k % len(COLOURS)]) for k in range(len(curves))]
            pressure.legend(handles, [curve.words for curve in curves])
        return figure


def _explain(ax: Axes, table: RunTable, curves: Sequence[FlowCurve]) -> None:
    """A legend of what is drawn, whatever its colour."""
    grey: dict[str, Any] = {"color": "0.3", "markersize": 4.5}
    shown = [(Line2D([], [], marker="o", linestyle="", **grey), "contacts and fluid")]
    if (table.columns["steady"] == 0).any():
        shown += [(Line2D([], [], marker="o", linestyle="", markerfacecolor="white", **grey), "not steady")]
    shown += [(Line2D([], [], marker="_", linestyle="", **grey), "contacts alone")]
    laws = dict.fromkeys(fit.law for curve in curves for fit in curve.fits)
    shown += [(Line2D([], [], linestyle=DASHES[law], color="0.3"), law) for law in laws]
    ax.legend(*zip(*shown, strict=True))


def _draw_curve(table: RunTable, curve: FlowCurve, colour: str, stress: Axes, pressure: Axes, normal: Axes) -> None:
    from softdyn.rheology.flow_curve import RATE

    columns, rates = table.columns, table.varied[RATE]
    made = curve.runs[np.isfinite(columns["steady"][curve.runs])]
    steady, other = made[columns["steady"][made] == 1], made[columns["steady"][made] == 0]
    shown = [(stress, "shear_stress", "o"), (pressure, "pressure", "o"), (normal, "N1", "o")]
    shown += [(normal, "N2", "^")] if "N2" in columns else []
    for ax, name, marker in shown:
        ax.errorbar(
            rates[steady], columns[name][steady], columns[f"{name}_error"][steady], fmt=marker, color=colour,
            markersize=4.5, capsize=2, linewidth=1,
        )  # fmt: skip
        ax.plot(rates[other], columns[name][other], marker, color=colour, markerfacecolor="white", markersize=4.5)
    stress.plot(rates[made], columns["contact_stress"][made], "_", color=colour, markersize=8)
    if curve.fits and len(steady):
        over = np.geomspace(rates[steady].min(), rates[steady].max(), 200)
        for fit in curve.fits:
            stress.plot(over, fit.stress(over), linestyle=DASHES[fit.law], color=colour, linewidth=1)


def draw_oscillations(table: RunTable, loops: Mapping[int, tuple[Array, Array, Array]]) -> Figure:
    """Moduli over frequency or amplitude, the harmonics, and Lissajous curves of the last cycles."""
    with style.context(["default", STYLE]):
        columns = table.columns
        swept = [name for name in table.varied if len(np.unique(table.varied[name])) > 1]
        over = [name for name in ("frequency", "amplitude") if name in swept] or ["frequency"]
        figure, axes = panels(len(over) + 2)
        for ax, name in zip(axes, over, strict=False):
            others = [other for other in table.varied if other != name]
            sets = np.column_stack([table.varied[other] for other in others] or [np.zeros(len(table))])
            for k, one in enumerate(np.unique(sets, axis=0)):
                rows = np.flatnonzero((sets == one).all(axis=1) & np.isfinite(columns["G_storage"]))
                rows = rows[np.argsort(table.varied[name][rows])]
                varied = [f"{other} = {value:g}" for other, value in zip(others, one, strict=False) if other in swept]
                _draw_moduli(ax, table, name, rows, COLOURS[k % len(COLOURS)], ", ".join(varied))
            _logarithmic(ax, np.concatenate([columns["G_storage"], columns["G_loss"]]))
            ax.set_xlabel("angular frequency" if name == "frequency" else "amplitude of the strain")
            ax.set_title("moduli $G'$ (filled) and $G''$ (open)")
            if len(swept) > 1:
                ax.legend()
        _draw_harmonics(axes[-2], table, over[-1])
        _draw_loops(axes[-1], table, loops, swept)
        return figure


def _draw_moduli(ax: Axes, table: RunTable, name: str, rows: Any, colour: str, label: str) -> None:
    for part, fill in (("G_storage", colour), ("G_loss", "white")):
        ax.errorbar(
            table.varied[name][rows], table.columns[part][rows], table.columns[f"{part}_error"][rows], fmt="o-",
            color=colour, markerfacecolor=fill, markersize=4.5, linewidth=0.8, capsize=2,
            label=label if part == "G_storage" else None,
        )  # fmt: skip


def _logarithmic(ax: Axes, values: Array) -> None:
    """Both axes logarithmic, where all values allow it."""
    ax.set_xscale("log")
    known = values[np.isfinite(values)]
    if len(known) and (known > 0).all():
        ax.set_yscale("log")


def _draw_harmonics(ax: Axes, table: RunTable, name: str) -> None:
    for k, harmonic in enumerate((3, 5, 7)):
        values = table.columns[f"I{harmonic}_I1"]
        ax.plot(table.varied[name], values, "o", color=COLOURS[k], markersize=4.5, label=f"$I_{harmonic}/I_1$")
    _logarithmic(ax, np.concatenate([table.columns[f"I{harmonic}_I1"] for harmonic in (3, 5, 7)]))
    ax.set_xlabel("angular frequency" if name == "frequency" else "amplitude of the strain")
    ax.set_title("harmonics of the stress")
    ax.legend()


def _draw_loops(
    ax: Axes, table: RunTable, loops: Mapping[int, tuple[Array, Array, Array]], swept: Sequence[str]
) -> None:
    numbers = list(loops)
    shown = [numbers[k] for k in np.unique(np.linspace(0, len(numbers) - 1, min(len(numbers), 6)).astype(int))]
    for k, number in enumerate(shown):
        strain, stress, _ = loops[number]
        middle = (stress.max() + stress.min()) / 2
        size = (stress.max() - stress.min()) / 2 or 1.0
        label = ", ".join(f"{name} = {table.varied[name][number]:.3g}" for name in swept) or f"run {number}"
        ax.plot(strain / np.abs(strain).max(), (stress - middle) / size, color=COLOURS[k], linewidth=1, label=label)
    ax.set_xlabel("strain over its amplitude")
    ax.set_ylabel("stress over its amplitude")
    ax.set_title("Lissajous curves of the last cycle")
    if len(shown) > 1:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7)


def draw_steps(curves: Curves, creeps: bool, time: float) -> Figure:
    """Relaxation modulus and stress after a step of strain, or compliance and strain under a step of stress.

    Parameters
    ----------
    curves : Curves
    creeps : bool
        Whether these are of a step of stress.
    time : float
        How long the stress is on.
    """
    with style.context(["default", STYLE]):
        figure, (left, right) = panels(2)
        for k, (number, curve) in enumerate(curves.curves.items()):
            colour, label = COLOURS[k % len(COLOURS)], curves.words(number)
            if creeps:
                under = (curve["time"] > 0) & (curve["time"] <= time * (1 + 1e-12))
                left.plot(curve["time"][under], curve["J"][under], color=colour, label=label)
                right.plot(curve["time"], curve["strain"], color=colour)
            else:
                after = curve["time"] > 0
                left.plot(curve["time"][after], curve["G"][after], color=colour, label=label)
                right.plot(curve["time"], curve["shear_stress"], color=colour)
        name = "J" if creeps else "G"
        _logarithmic(left, np.concatenate([curve[name][curve["time"] > 0] for curve in curves.curves.values()]))
        left.set_title("compliance, strain over stress" if creeps else "relaxation modulus $G(t)$")
        right.set_title("strain" if creeps else "shear stress")
        left.set_xlabel("time since the step" if creeps else "time since the end of the ramp")
        right.set_xlabel(left.get_xlabel())
        left.legend()
        return figure


def draw_compressions(curves: Curves, compressed: int) -> Figure:
    """Pressure, coordination and moduli over the fraction; and, where there was shear, stress over strain."""
    with style.context(["default", STYLE]):
        sheared = any(len(curve["fraction"]) > compressed for curve in curves.curves.values())
        figure, axes = panels(3 + sheared)
        for k, (number, curve) in enumerate(curves.curves.items()):
            colour, phi = COLOURS[k % len(COLOURS)], curve["fraction"][:compressed]
            axes[0].plot(phi, curve["pressure"][:compressed], "o-", color=colour, markersize=3, linewidth=0.8)
            axes[1].plot(
                phi, curve["coordination"][:compressed], "o-", color=colour, markersize=3, linewidth=0.8,
                label=curves.words(number) or None,
            )  # fmt: skip
            for name, fill in (("bulk_modulus", colour), ("shear_modulus", "white")):
                axes[2].plot(
                    phi, curve[name][:compressed], "o-", color=colour, markerfacecolor=fill, markersize=3.5,
                    linewidth=0.8,
                )  # fmt: skip
            if sheared:
                first = curve["shear_stress"][compressed - 1]
                strains = np.append(0.0, curve["strain"][compressed:])
                axes[3].plot(
                    strains, np.append(first, curve["shear_stress"][compressed:]), "o-", color=colour, markersize=3
                )
        for ax, title in zip(
            axes, ("pressure", "coordination without rattlers", "bulk (filled) and shear modulus (open)"), strict=False
        ):
            ax.set_title(title)
            ax.set_xlabel("fraction")
        if sheared:
            axes[3].set_title("shear stress")
            axes[3].set_xlabel("strain")
            axes[3].xaxis.set_major_locator(MaxNLocator(5))
        if axes[1].get_legend_handles_labels()[1]:
            axes[1].legend(fontsize=6.5)
        return figure
