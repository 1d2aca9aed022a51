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

#: Contacts up to which each is drawn over time; more are drawn as a distribution at the end.
FEW = 20


def plot_particles(result: ParticleResult) -> Figure:
    """Draw the contact network at the end, and stress, coordination, gaps and forces.

    Gaps and forces of a few contacts are drawn over time, those of many as they are distributed at the end.

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
    few = max(len(result.contacts(frame)["h"]) for frame in range(len(result.t))) <= FEW
    if few or result.x.shape[2] < 3:
        draw_network(network, result, -1)
    else:
        _draw_profile(network, result)
    _draw_stress(figure.add_subplot(grid[0, 1]), result)
    _draw_coordination(figure.add_subplot(grid[1, 1]), result)
    draw = _draw_histories if few else _draw_distribution
    draw(figure.add_subplot(grid[0, 2]), result, "h", "gap $h$", BLUE)
    draw(figure.add_subplot(grid[1, 2]), result, "F", "force $F$, compression", ORANGE)
    figure.suptitle(f"{result.law}: {result.x.shape[1]} particles, t = {result.t[-1]:.4g}", fontsize="medium")
    return figure


def draw_network(axes: Axes, result: ParticleResult, frame: int) -> None:
    """Draw the particles and contacts of a frame, seen along z: orange pushes, blue pulls, width by force."""
    x, radii, lengths = _in_plane(result.x[frame]), result.radii, result.box[:2]
    if len(lengths) == 2 and np.isfinite(lengths).all():
        cell = result.cell[frame]
        x = x - np.floor(x[:, 1] / cell[1, 1])[:, None] * cell[:, 1][:2]
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
        end = start + _in_plane(contacts["n"]) * (radii[contacts["i"]] + reach)[:, None]
        colours = [ORANGE if force > 0 else BLUE for force in contacts["F"]]
        widths = 4 * np.sqrt(size / largest)
        axes.add_collection(LineCollection(list(np.stack([start, end], axis=1)), colors=colours, linewidths=widths))
    axes.set_aspect("equal")
    axes.set(xlabel="$x$", ylabel="$y$")


def _in_plane(vectors: Array) -> Array:
    """Give vectors two dimensions."""
    return np.pad(vectors[:, :2], ((0, 0), (0, max(0, 2 - vectors.shape[1]))))


def _draw_profile(axes: Axes, result: ParticleResult) -> None:
    """Velocity along x against y, at the end."""
    axes.plot(result.v[-1][:, 0], result.x[-1][:, 1], ".", color=GREEN, markersize=2)
    axes.set(xlabel="velocity along $x$", ylabel="$y$")
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
    axes.set(xlabel="time $t$", ylabel="pressed contacts per particle", ylim=(0, None))
    axes.grid(alpha=0.3)


def _draw_histories(axes: Axes, result: ParticleResult, name: str, label: str, colour: str) -> None:
    """One line for each pair that is ever in contact, with gaps where it is not."""
    frames = [result.contacts(frame) for frame in range(len(result.t))]
    values = [
        {(i, j): value for i, j, value in zip(frame["i"], frame["j"], frame[name], strict=True)} for frame in frames
    ]
    for pair in dict.fromkeys(pair for of_frame in values for pair in of_frame):
        axes.plot(result.t, [of_frame.get(pair, math.nan) for of_frame in values], color=colour, alpha=0.7)
    if name == "h":
        axes.set_yscale("log")
    else:
        axes.axhline(0, color="0.6", linewidth=0.5)
    axes.set(xlabel="time $t$", ylabel=label)
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
