"""Pictures of a run of many particles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from softdyn.particles.observables import coordination
from softdyn.plots import BLUE, GREEN, ORANGE, PURPLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def plot_particles(result: ParticleResult) -> Figure:
    """Draw the contact network at the end, and stress, coordination, gaps and forces.

    Parameters
    ----------
    result : ParticleResult

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    grid = figure.add_gridspec(2, 3, width_ratios=[1.4, 1, 1])
    network = figure.add_subplot(grid[:, 0])
    if result.x.shape[2] == 2:
        draw_network(network, result, -1)
    else:
        _draw_profile(network, result)
    _draw_stress(figure.add_subplot(grid[0, 1]), result)
    _draw_coordination(figure.add_subplot(grid[1, 1]), result)
    _draw_distribution(figure.add_subplot(grid[0, 2]), result, "h", "gap $h$", BLUE)
    _draw_distribution(figure.add_subplot(grid[1, 2]), result, "F", "force $F$, compression", ORANGE)
    figure.suptitle(f"{result.law}: {result.x.shape[1]} particles, t = {result.t[-1]:.4g}", fontsize="medium")
    return figure


def draw_network(axes: Axes, result: ParticleResult, frame: int) -> None:
    """Draw the particles and contacts of a frame in two dimensions: orange pushes, blue pulls, width by force."""
    x, radii, lengths = result.x[frame], result.radii, result.box
    if np.isfinite(lengths).all():
        tilt = float(result.arrays["shear_rate"]) * float(result.t[frame])
        rows = np.floor(x[:, 1] / lengths[1])
        x = x - np.column_stack([rows * lengths[1] * tilt, rows * lengths[1]])
        # into the least tilted cell; drawn as the rectangle, which the images fill as well
        x[:, 0] = np.mod(x[:, 0], lengths[0])
        axes.set(xlim=(0, lengths[0]), ylim=(0, lengths[1]))
    else:
        low, high = (x - radii[:, None]).min(axis=0), (x + radii[:, None]).max(axis=0)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.add_collection(
        EllipseCollection(
            2 * radii,
            2 * radii,
            np.zeros(len(x)),
            units="xy",
            offsets=x,
            offset_transform=axes.transData,
            facecolor="0.93",
            edgecolor="0.6",
            linewidth=0.5,
        )
    )
    contacts = result.contacts(frame)
    size = np.abs(contacts["F"])
    largest = float(size.max(initial=0.0))
    if largest > 0:
        start = x[contacts["i"]]
        reach = np.append(radii, np.zeros(max(0, int(contacts["j"].max(initial=0)) + 1 - len(radii))))[contacts["j"]]
        end = start + contacts["n"] * (radii[contacts["i"]] + reach)[:, None]
        colours = [ORANGE if force > 0 else BLUE for force in contacts["F"]]
        widths = 4 * np.sqrt(size / largest)
        axes.add_collection(LineCollection(list(np.stack([start, end], axis=1)), colors=colours, linewidths=widths))
    axes.set_aspect("equal")
    axes.set(xlabel="$x$", ylabel="$y$")


def _draw_profile(axes: Axes, result: ParticleResult) -> None:
    """Velocity along x against the last coordinate but x, at the end."""
    height = result.x[-1][:, min(1, result.x.shape[2] - 1)]
    axes.plot(result.v[-1][:, 0], height, ".", color=GREEN, markersize=2)
    axes.set(xlabel="velocity along $x$", ylabel="$y$" if result.x.shape[2] > 1 else "$x$")
    axes.grid(alpha=0.3)


def _draw_stress(axes: Axes, result: ParticleResult) -> None:
    d = result.stress.shape[1]
    styles: list[tuple[int, int, str]] = [(0, 0, BLUE), (1, 1, ORANGE), (0, 1, PURPLE)] if d > 1 else [(0, 0, BLUE)]
    for a, b, colour in styles:
        axes.plot(result.t, result.stress[:, a, b], color=colour, label=rf"$\sigma_{{{'xyz'[a]}{'xyz'[b]}}}$")
    axes.set(xlabel="time $t$", ylabel="stress" if np.isfinite(result.box).all() else "virial")
    axes.legend()
    axes.grid(alpha=0.3)


def _draw_coordination(axes: Axes, result: ParticleResult) -> None:
    axes.plot(result.t, coordination(result), color=GREEN)
    axes.set(xlabel="time $t$", ylabel="pressed contacts per particle")
    axes.grid(alpha=0.3)


def _draw_distribution(axes: Axes, result: ParticleResult, name: str, label: str, colour: str) -> None:
    values: NDArray[Any] = result.contacts(-1)[name]
    values = values[values > 0]
    if len(values):
        bins = np.geomspace(values.min(), values.max() * (1 + 1e-9), max(5, math.isqrt(len(values)) // 2) + 1)
        axes.hist(values, bins=list(bins), color=colour)
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel=label, ylabel="contacts")
