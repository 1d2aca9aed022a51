"""The duration of a T1 process against the first separations: the headline of Rognon & Gay's part 2, arXiv 0901.0171.

Four equal spheres in a rhombus: two in touch, parted by the two beside them, which are pushed together until they have
taken their place. All five pairs that touch start at one gap h0. Units: R, E and eta are 1, so that F = kappa.

What it should be, found another way: the pair in touch is pulled apart by F/sqrt(3), as forces balance in a rhombus of
angles 60 and 120 degrees, and two particles alone (the pair engine) take so long from h0 to the gap at which the swap
happens. The rhombus changes its shape on the way, and deflects, so that they agree where most of the time is spent at
the start: for small gaps and forces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.api import simulate
from softdyn.colours import BLUE, GREEN, ORANGE
from softdyn.errors import IntegrationError
from softdyn.particles.observables import swap_time
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.reproduced import reproduce, told

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]

LAW = "rognon_gay"
FORCES = (5e-4, 5e-3, 5e-2)
GAPS = np.geomspace(1e-3, 1e-1, 9)
#: Numbers of the particles that part and that meet.
PARTING, MEETING = (2, 3), (0, 1)
#: In the middle of the swap both gaps are the same: 4 sin(45 deg) = 2 + h, for rigid spheres in contact.
MIDDLE = 2 * math.sqrt(2) - 2
#: The run whose states are shown.
SHOWN = (FORCES[1], float(GAPS[4]))
FRAMES = 201
FILES = ("t1.png", "t1.svg", "t1.csv")
COLUMNS = ("kappa", "h0/R", "duration", "pair alone", "steps")


@dataclass(frozen=True)
class Swaps:
    """Durations, one row for each force, one column for each first gap; and the run that is shown.

    Attributes
    ----------
    duration, pair : array, shape (forces, gaps)
        Of the swap; of two particles alone, pulled apart by F/sqrt(3) to the gap of the middle of the swap.
    steps : array of int, shape (forces, gaps)
    shown : ParticleResult
    """

    duration: Array
    pair: Array
    steps: NDArray[np.int64]
    shown: ParticleResult


def rhombus(force: float, gap: float, until: float, target: str) -> ParticleScene:
    """Scene of a T1 process: two particles in touch, and two beside them that are pushed together.

    Parameters
    ----------
    force : float
        On the two that are pushed, over E R^2.
    gap : float
        Over R.
    until : float
        End of the run, in eta/E.
    target : str
    """
    side = 2 + gap
    half = side * math.sqrt(3) / 2
    return ParticleScene(
        law=LAW,
        parameters={"E": 1.0, "eta": 1.0},
        positions=[[-half, 0.0], [half, 0.0], [0.0, side / 2], [0.0, -side / 2]],
        radii=1.0,
        # of pairs closer than that, lest rounding make some of them a little farther
        gap=gap * (1 + 1e-9),
        push=[Push([0], [force, 0.0]), Push([1], [-force, 0.0])],
        until_t=until,
        times=FRAMES,
        target=target,
    )


def pair_alone(force: float, gap: float, target: str = "auto") -> float:
    """Time that two particles take from a gap to that of the middle of the swap, pulled by F/sqrt(3).

    Parameters
    ----------
    force : float
        Of the T1 process, over E R^2.
    gap : float
        Over R.
    target : str
    """
    parameters = {"R": 1.0, "E": 1.0, "eta": 1.0}
    pull = -force / math.sqrt(3)
    return float(simulate(law=LAW, parameters=parameters, h=gap, force=pull, until_h=MIDDLE, target=target).t[-1])


def swap(force: float, gap: float, target: str = "auto") -> tuple[float, ParticleResult]:
    """Run a T1 process to well beyond its middle; its duration, and the result.

    Parameters
    ----------
    force : float
        Over E R^2.
    gap : float
        Over R.
    target : str

    Raises
    ------
    IntegrationError
        If it does not come to its middle in eight times what the pair alone takes.
    """
    until = 1.6 * pair_alone(force, gap, target)
    for longer in (1, 2, 5):
        result = simulate_particles(rhombus(force, gap, longer * until, target))
        duration = swap_time(result, PARTING, MEETING)
        if math.isfinite(duration):
            return duration, result
    raise IntegrationError(f"no swap until t={longer * until:.6g} under F = {force:g} from a gap of {gap:g}")


def measure(
    forces: Sequence[float] = FORCES,
    gaps: Sequence[float] | Array = GAPS,
    target: str = "auto",
    progress: bool = False,
) -> Swaps:
    """Run all T1 processes.

    Parameters
    ----------
    forces : sequence of float
        Over E R^2.
    gaps : sequence of float
        Over R.
    target : str
    progress : bool
        Whether to show how far it is.
    """
    shape = (len(forces), len(gaps))
    duration, pair, steps = np.empty(shape), np.empty(shape), np.empty(shape, dtype=np.int64)
    bar = told(list(np.ndindex(shape)), progress)
    for at in bar:
        force, gap = float(forces[at[0]]), float(gaps[at[1]])
        duration[at], result = swap(force, gap, target)
        pair[at], steps[at] = pair_alone(force, gap, target), result.stats["steps"]
    return Swaps(duration, pair, steps, swap(*SHOWN, target)[1])


def reproduce_t1(folder: Path, target: str = "auto") -> int:
    """Run the T1 processes, print how long they take, and draw it.

    Parameters
    ----------
    folder : Path
        Where to write :data:`FILES`.
    target : "auto", "c" or "numba"

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    CompileError, IntegrationError
    """
    return reproduce(folder, FILES, partial(measure, target=target, progress=True), summary, _table, draw)


def summary(swaps: Swaps) -> Iterator[str]:
    """Durations, beside those of the pair alone, and what minute changes of the first gap do."""
    yield f"{LAW}: duration of a T1 process of four spheres, in eta/E (of the parting pair alone, under F/sqrt(3))"
    yield "  h0/R    " + "".join(f"{f'kappa = {force:g}':>26}" for force in FORCES)
    for column, gap in enumerate(GAPS):
        cells = zip(swaps.duration[:, column], swaps.pair[:, column], strict=True)
        yield f"  {gap:<8.3g}" + "".join(f"{f'{here:.4g} ({alone:.4g})':>26}" for here, alone in cells)
    row, low, high = FORCES.index(SHOWN[0]), 2, 4
    yield (
        f"from h0 = {GAPS[high]:.3g} R to {GAPS[low]:.3g} R, under kappa = {FORCES[row]:g}: "
        f"{swaps.duration[row, low] / swaps.duration[row, high]:.3g} times as long"
    )


def _table(swaps: Swaps) -> Iterator[str]:
    yield ",".join(COLUMNS)
    for row, force in enumerate(FORCES):
        for column, gap in enumerate(GAPS):
            at = row, column
            yield f"{force!r},{float(gap)!r},{float(swaps.duration[at])!r},{float(swaps.pair[at])!r},{swaps.steps[at]}"


def draw(swaps: Swaps) -> Figure:
    """Draw the durations, and three states of one of the runs: at the start, in the middle, and at the end."""
    from matplotlib.figure import Figure

    from softdyn.particles.particle_plots import draw_network, largest_force

    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=[3.2, 1])
    axes = figure.add_subplot(grid[:, 0])
    for force, colour, row in zip(FORCES, (GREEN, BLUE, ORANGE), range(len(FORCES)), strict=True):
        # the same values of kappa t for all forces, where films are thick and nothing deflects
        axes.loglog(GAPS, force * swaps.duration[row], "o", color=colour, markersize=4, label=rf"$\kappa = {force:g}$")
        axes.loglog(GAPS, force * swaps.pair[row], "-", color=colour, linewidth=1)
    axes.plot([], [], "-", color="0.4", linewidth=1, label=r"parting pair alone, pulled by $F/\sqrt{3}$")
    # as a flattened film thickens, dh/dt ~ h^3
    base = FORCES[2] * swaps.pair[2, 0]
    ends = GAPS[[0, 3]]
    axes.loglog(ends, 2 * base * (ends / ends[0]) ** -2, color="0.4", linestyle=":", linewidth=1)
    axes.annotate("$h_0^{-2}$", (ends[1], 2 * base * (ends[1] / ends[0]) ** -2), color="0.4")
    axes.set(xlabel="first gap $h_0/R$", ylabel=r"duration of the swap, $\kappa\, t\, E/\eta$")
    axes.legend()
    axes.grid(alpha=0.3, which="both", linewidth=0.4)
    result = swaps.shown
    middle = swap_time(result, PARTING, MEETING)
    frames = [0, int(np.argmin(np.abs(result.t - middle))), len(result) - 1]
    largest = largest_force(result, frames)
    window = np.array([[-3.0, -2.85], [3.0, 2.85]])
    for place, frame in enumerate(frames):
        state = figure.add_subplot(grid[place, 1])
        draw_network(state, result, frame, largest, window)
        state.set(xlabel="", ylabel="", xticks=[], yticks=[])
        state.set_title(f"$t\\,E/\\eta = {result.t[frame]:.0f}$", fontsize="small")
    return figure
