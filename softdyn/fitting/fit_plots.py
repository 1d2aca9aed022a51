"""Pictures of fits: data and fit, what is left, profiles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from numpy.typing import NDArray

from softdyn.colours import AMBER, BLUE, GREEN, ORANGE, PURPLE, SKY
from softdyn.mathtext import literal
from softdyn.rheology.rheology_plots import STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.fitting.fit_result import Fit

Array = NDArray[np.float64]

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY)
LABELS = {
    "t": "time $t$", "h": "gap $h$", "X": "distance of centres $X$", "delta": r"deflection $\delta$",
    "a": "radius $a$", "F": "force $F$", "rate": "shear rate", "stress": "shear stress",
}  # fmt: skip
UNITS = {"t": "s", "rate": "1/s", "stress": "Pa", "F": "N", **dict.fromkeys(("h", "X", "delta", "a"), "m")}
#: Prefixes of units on axes, by powers of a thousand.
PREFIXES = {-5: "f", -4: "p", -3: "n", -2: "\N{MICRO SIGN}", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}
#: An axis of a profile is logarithmic where its ends differ by more than this factor.
CROWDED = 10.0
#: Profiles in a row.
IN_ROW = 4
#: Size of a panel, in inches.
WIDE, HIGH, FLAT, LOW = 3.6, 2.4, 1.0, 1.7


def plot_fit(fit: Fit) -> Figure:
    """Draw data and fit, what is left in standard errors of the data, and the profiles."""
    curves = list(enumerate(fit.about["curves"], start=1))
    quantities = list(dict.fromkeys(name for _, curve in curves for name in curve["quantities"]))
    profiles = [name for name in fit.names if f"profile_{name}" in fit.arrays]
    rows = math.ceil(len(profiles) / IN_ROW)
    columns = max(len(quantities), min(IN_ROW, len(profiles)), 1)
    wide = max(WIDE * len(quantities), 1.9 * columns, 5.0)
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(wide, HIGH + FLAT + LOW * rows + 0.3), layout="constrained")
        halves = figure.add_gridspec(2 if rows else 1, 1, height_ratios=[HIGH + FLAT, LOW * rows][: 2 if rows else 1])
        top = halves[0].subgridspec(2, len(quantities), height_ratios=[HIGH, FLAT])
        for k, name in enumerate(quantities):
            upper = figure.add_subplot(top[0, k])
            lower = figure.add_subplot(top[1, k], sharex=upper)
            _draw_curves(fit, name, upper, lower)
        if rows:
            across = min(IN_ROW, len(profiles))
            below = halves[1].subgridspec(rows, across)
            for k, name in enumerate(profiles):
                _draw_profile(fit, name, figure.add_subplot(below[k // across, k % across]), first=k % across == 0)
    return figure


def _draw_curves(fit: Fit, quantity: str, upper: Axes, lower: Axes) -> None:
    there = [(n, c) for n, c in enumerate(fit.about["curves"], start=1) if quantity in c["quantities"]]
    abscissa = there[0][1]["abscissa"]
    known = bool(fit.about["units"])
    x_unit, x_scale = _unit(abscissa, [fit.arrays[f"{abscissa}_{n}"] for n, _ in there], known)
    y_unit, y_scale = _unit(quantity, [fit.arrays[f"{quantity}_{n}"] for n, _ in there], known)
    for i, (n, curve) in enumerate(there):
        colour = COLOURS[i % len(COLOURS)]
        x = fit.arrays[f"{abscissa}_{n}"] / x_scale
        measured, fitted, error = (
            fit.arrays[key] / y_scale for key in (f"{quantity}_{n}", f"{quantity}_{n}_fit", f"{quantity}_{n}_error")
        )
        order = np.argsort(x, kind="stable")
        label = literal(curve["name"]) if len(there) > 1 else "measured"
        upper.errorbar(x, measured, yerr=error, fmt=".", ms=3, lw=0.6, color=colour, alpha=0.5, label=label, zorder=1)
        upper.plot(
            x[order], fitted[order], "-", lw=1.4, color="0.1", label="fit" if i == len(there) - 1 else None, zorder=2
        )
        lower.plot(x, (measured - fitted) / error, ".", ms=3, color=colour, alpha=0.7)
    lower.axhline(0, lw=0.8, color="0.1")
    if abscissa == "rate":
        upper.set_xscale("log")
        if all((fit.arrays[f"{quantity}_{n}"] > 0).all() for n, _ in there):
            upper.set_yscale("log")
    upper.tick_params(labelbottom=False)
    upper.set_ylabel(f"{LABELS[quantity]}{y_unit}")
    lower.set_ylabel("left, in s.e.")
    lower.set_xlabel(f"{LABELS[abscissa]}{x_unit}")
    upper.legend(loc="best")


def _unit(name: str, arrays: list[Array], known: bool) -> tuple[str, float]:
    """Words behind a label, and what values are divided by: a prefix that makes numbers that read."""
    if not known:
        return "", 1.0
    largest = max(float(np.max(np.abs(array))) for array in arrays) or 1.0
    if UNITS[name] == "1/s":
        return " [1/s]", 1.0
    power = min(max(math.floor(math.log10(largest) / 3), min(PREFIXES)), max(PREFIXES))
    if name == "t":
        power = min(power, 0)
    return f" [{PREFIXES[power]}{UNITS[name]}]", 1000.0**power


def _draw_profile(fit: Fit, name: str, axes: Axes, *, first: bool) -> None:
    """The rise of chi2, the interval, and the parabola of the standard error."""
    values, rise = fit.arrays[f"profile_{name}"], fit.arrays[f"profile_{name}_chi2"]
    best, error = fit.values[name], fit.errors[name]
    unit: str = fit.about["units"].get(name, "")
    power = math.floor(math.log10(abs(best)) / 3) if best else 0
    words = unit
    if unit and " " not in unit[:2] and power in PREFIXES and not unit.startswith("1/"):
        words = PREFIXES[power] + unit
    elif -1 <= power <= 0 and 1e-2 < abs(best) < 1e3:
        power = 0
    else:
        words = f"10$^{{{3 * power}}}$ {unit}".strip()
    scale = 1000.0**power
    axes.plot(values / scale, rise, "o-", ms=3, lw=1.2, color=BLUE)
    # the parabola of the standard error: of a positive parameter, of its logarithm
    by_log = bool((values > 0).all() and best > 0 and name not in fit.about["linear"])
    x = np.geomspace(values.min(), values.max(), 101) if by_log else np.linspace(values.min(), values.max(), 101)
    if math.isfinite(error) and error > 0:
        off = np.log(x / best) * best / error if by_log else (x - best) / error
        axes.plot(x / scale, off**2, ":", lw=1.0, color="0.5")
    for end in fit.intervals[name]:
        if math.isfinite(end) and values.min() <= end <= values.max():
            axes.axvline(end / scale, lw=0.8, color=ORANGE)
    if by_log and values.max() > CROWDED * values.min():
        axes.set_xscale("log")
    else:
        axes.locator_params(axis="x", nbins=4)
    axes.set_ylim(0, 9)
    axes.set_xlabel(f"{literal(name)}{f' [{words}]' if words else ''}")
    if first:
        axes.set_ylabel(r"rise of $\chi^2$")
