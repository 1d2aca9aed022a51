"""Lists of pairs near one another: particles in the order of their cells, histories taken over from list to list."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.explicit.grains import Grains, GrainSystem, edges, tilt_at

Array = NDArray[np.float64]
Short = NDArray[np.int32]

#: Width of the skin, in smallest radii: pairs are listed up to that distance of their surfaces.
SKIN = 0.3
#: Cells for each particle, at most.
MOST_CELLS = 4


def skin_of(system: GrainSystem) -> float:
    """Distance of surfaces up to which pairs are listed."""
    return SKIN * float(system.radii.min())


def reach_of(system: GrainSystem) -> float:
    """Largest distance of the centres of a listed pair."""
    return 2 * float(system.radii.max()) + skin_of(system)


def list_again(system: GrainSystem, state: Grains) -> None:
    """Sort the particles by cells, list the pairs that are near one another, and take over their histories.

    Raises
    ------
    SceneError
        If the box is so small that a particle would meet another one twice.
    """
    kernel, count, d = system.kernel, len(state.x), system.dimension
    lengths, cut = edges(system), reach_of(system)
    small = [axis for axis in range(d) if 0 < lengths[axis] < 2 * cut]
    if small:
        raise SceneError(
            f"[box] is too small along {', '.join('xyz'[axis] for axis in small)}: a particle would meet another one "
            f"twice; at least {2 * cut:.6g} is needed"
        )
    tilt = tilt_at(system, state.t)
    turns = round(tilt / lengths[0]) if d > 1 and lengths[0] else 0
    tilt -= turns * (lengths[0] if turns else 0.0)
    home, cells, cell_of = _cells(state.x, lengths, tilt, cut)
    number = cell_of[:, 0].copy()
    size = 1
    for axis in range(1, d):
        size *= int(cells[axis - 1])
        number += size * cell_of[:, axis]
    order = np.argsort(number, kind="stable")
    starts = np.zeros(int(np.prod(cells)) + 1, dtype=np.int32)
    starts[1:] = np.cumsum(np.bincount(number, minlength=int(np.prod(cells))))
    sorted_to = np.empty(count, dtype=np.int32)
    sorted_to[order] = np.arange(count, dtype=np.int32)
    old = _touching(state, sorted_to)
    walls = system.walled
    for name in ("order", "x", "v", "spin", "rate_v"):
        setattr(state, name, np.ascontiguousarray(getattr(state, name)[order]))
    for name in ("wall_history", "wall_touch"):
        rows = getattr(state, name).reshape(count, -1)[order]
        setattr(state, name, np.ascontiguousarray(rows.reshape(getattr(state, name).shape)))
    assert walls * count == len(state.wall_touch)
    state.home = np.ascontiguousarray(home[order])
    place = state.x - state.home * lengths
    if d > 1:
        place[:, 0] -= state.home[:, 1] * tilt
    radii = system.radii[state.order]
    capacity = max(64, int(1.1 * len(state.partner)), 4 * count)
    start = np.empty(count + 1, dtype=np.int32)
    cell_rows = np.ascontiguousarray(cell_of[order])
    repeats = (lengths > 0).astype(np.int32)
    while True:
        partner, image = np.empty(capacity, dtype=np.int32), np.empty(capacity, dtype=np.int32)
        found = kernel.neighbours(
            count, capacity, skin_of(system), lengths, tilt, cells, repeats, starts, cell_rows.reshape(-1),
            np.ascontiguousarray(place).reshape(-1), radii, start, partner, image,
        )  # fmt: skip
        if found <= capacity:
            break
        capacity = int(1.1 * found)
    state.start, state.partner, state.image = start, partner[:found].copy(), image[:found].copy()
    state.in_start, state.in_at = np.empty(count + 1, dtype=np.int32), np.empty(found, dtype=np.int32)
    kernel.incoming(count, state.start, state.partner, state.in_start, state.in_at)
    state.history, state.touch = np.zeros((found, kernel.kept)), np.zeros(found, dtype=np.int32)
    _carry(system, state, *old)
    state.listed, state.listed_tilt, state.turns, state.moved = state.x.copy(), tilt_at(system, state.t), turns, 0.0
    state.counts["listings"] += 1


def _cells(x: Array, lengths: Array, tilt: float, cut: float) -> tuple[Short, Short, Short]:
    """Cell of the lattice of each particle, how many cells for the search along each axis, and those of each."""
    count, d = x.shape
    home, cells = np.zeros((count, d), dtype=np.int32), np.ones(d, dtype=np.int32)
    cell_of = np.zeros((count, d), dtype=np.int32)
    fractions, sizes = np.zeros((count, d)), np.zeros(d)
    for axis in reversed(range(d)):
        place = x[:, axis]
        if axis == 0 and d > 1 and lengths[1]:
            height = x[:, 1] / lengths[1]
            place = place - tilt * height
        if lengths[axis]:
            along = place / lengths[axis]
            home[:, axis] = np.floor(along)
            fractions[:, axis] = along - home[:, axis]
            slant = np.hypot(1.0, tilt / lengths[1]) if axis == 0 and d > 1 and lengths[1] else 1.0
            sizes[axis] = lengths[axis] / slant
        else:
            low, high = float(place.min()), float(place.max())
            sizes[axis] = high - low
            fractions[:, axis] = (place - low) / sizes[axis] if high > low else 0.0
    wanted = np.maximum(1.0, np.floor(sizes / cut))
    most = max(27.0, MOST_CELLS * count)
    while np.prod(wanted) > most:  # a thin gas: fewer, larger cells
        wanted[np.argmax(wanted)] = max(1.0, np.floor(wanted.max() / 2))
    cells[:] = wanted
    cell_of[:] = np.minimum((fractions * cells).astype(np.int64), cells - 1)
    return home, cells, cell_of


def _touching(state: Grains, sorted_to: Short) -> tuple[Short, Short, Array, NDArray[np.bool_]]:
    """Pairs that touch, by their places in the new order, with their histories; and which change their roles."""
    at = np.flatnonzero(state.touch)
    i = (np.searchsorted(state.start, at, side="right") - 1).astype(np.int64)
    one, other = sorted_to[i], sorted_to[state.partner[at]]
    swapped = one > other
    return (
        np.ascontiguousarray(np.where(swapped, other, one).astype(np.int32)),
        np.ascontiguousarray(np.where(swapped, one, other).astype(np.int32)),
        state.history[at],
        swapped,
    )


def _carry(
    system: GrainSystem, state: Grains, one: Short, other: Short, history: Array, swapped: NDArray[np.bool_]
) -> None:
    """Give the pairs of a new list the histories that they had."""
    kernel = system.kernel
    if not len(one):
        return
    at = np.empty(len(one), dtype=np.int32)
    kernel.carry(len(one), one, other, state.start, state.partner, at)
    there = at >= 0
    if kernel.rotations == 3:  # the force of i on j
        history[swapped, :3] *= -1
    elif kernel.rotations == 1 and kernel.rolling:  # along n turned by a right angle
        history[swapped, 1] *= -1
    state.touch[at[there]] = 1
    state.history[at[there]] = history[there]
