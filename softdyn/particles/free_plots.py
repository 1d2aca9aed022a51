"""Panels of runs without contacts: of potentials, bonds and Brownian motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE
from softdyn.particles.geometry import Box, bare_contacts, directions, find_pairs
from softdyn.particles.observables import is_periodic, mean_square_displacement

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softdyn.particles.results import ParticleResult
    from softdyn.results.result import Result

Array = NDArray[np.float64]

#: Bins of the pair distribution, and how far it goes in mean radii, at most.
BINS, FARTHEST = 80, 10.0
TITLE: dict[str, Any] = {"loc": "left", "fontsize": "medium"}


def bonds_at(result: ParticleResult, frame: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Bonds that hold at a frame: particles i and j, the vector from one to the other, and the tension."""
    if "bond_i" not in result.arrays:
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, result.x.shape[2])), np.empty(0)
    held = np.flatnonzero(result.bond_broken > result.t[frame])
    i, j = result.bond_i[held], result.bond_j[held]
    along = result.x[frame, j] - result.x[frame, i] + result.bond_shift[held] @ result.cell[frame].T
    return i, j, along, result.bond_tension[frame, held]


def pair_distribution(result: ParticleResult) -> tuple[Array, Array]:
    """Distances, and how many pairs there are at each over that of particles without order, in the later half.

    Of a box that is periodic along all axes.
    """
    count, d = result.x.shape[1:]
    edges = np.diagonal(result.cell[-1])
    farthest = min(FARTHEST * float(result.radii.mean()), 0.24 * float(edges.min()))
    bins = np.linspace(0.0, farthest, BINS + 1)
    frames = range(len(result) // 2, len(result))
    found = np.zeros(BINS)
    for frame in frames:
        cell = result.cell[frame]
        box = Box(np.diagonal(cell).copy(), 0.0, float(cell[0, 1]) if d > 1 else 0.0)
        points = np.full(count, 1e-9 * farthest)
        i, j, shift = find_pairs(result.x[frame], points, box, 0.0, (), farthest)
        _, r = directions(bare_contacts(i, j, shift, points), result.x[frame], cell, ())
        found += np.histogram(r, bins)[0]
    ball = {1: 2.0, 2: np.pi, 3: 4 * np.pi / 3}[d]
    shells = ball * np.diff(bins**d)
    even = len(frames) * count * (count - 1) / 2 * shells / float(np.prod(edges))
    return (bins[1:] + bins[:-1]) / 2, found / even


def draw_pair_distribution(axes: Axes, result: ParticleResult) -> None:
    """Draw g(r) over the later half of a run."""
    r, g = pair_distribution(result)
    axes.axhline(1.0, color="0.6", linewidth=0.8)
    axes.plot(r, g, color=BLUE)
    axes.set(xlabel="distance $r$", ylabel="$g(r)$", xlim=(0, r[-1]), ylim=(0, None))
    axes.set_title("pairs at a distance, over the later half", **TITLE)
    axes.grid(color="0.9")


def draw_spread(axes: Axes, result: ParticleResult) -> None:
    """Draw the mean square of the displacements from the start."""
    if is_periodic(result):
        squares = mean_square_displacement(result).sum(axis=1)
    else:
        squares = np.sum((result.x - result.x[0]) ** 2, axis=2).mean(axis=1)
    axes.plot(result.t, squares, color=GREEN)
    axes.set(xlabel="time $t$", ylabel=r"$\langle\Delta r^2\rangle$", xlim=(0, float(result.t[-1]) or None))
    axes.set_title("mean square displacement", **TITLE)
    axes.grid(color="0.9")


def draw_bond_lengths(axes: Axes, result: Result) -> None:
    """Draw the lengths of the bonds that hold: their mean, and the shortest and longest."""
    held = result.bond_broken[None, :] > result.t[:, None]
    r = np.where(held, result.bond_r, np.nan)
    some = held.any(axis=1)
    low, mean, high = (of(r[some], axis=1) for of in (np.nanmin, np.nanmean, np.nanmax))
    axes.fill_between(result.t[some], low, high, color=ORANGE, alpha=0.25, linewidth=0, label="shortest to longest")
    axes.plot(result.t[some], mean, color=ORANGE, label="mean")
    broken = int(np.isfinite(result.bond_broken).sum())
    axes.set(xlabel="time $t$", ylabel="$r$", xlim=(0, float(result.t[-1]) or None))
    axes.set_title(f"lengths of {held.shape[1]} bonds" + (f", of which {broken} broke" if broken else ""), **TITLE)
    axes.grid(color="0.9")
    axes.legend(frameon=False, fontsize="small")
