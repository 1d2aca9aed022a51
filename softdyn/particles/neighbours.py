"""The list of contacts: made before a pair comes within range, dropped beyond it, without a jump in any force.

A contact at its range or beyond has the weight 0 in the kernel: its force is 0, its surfaces are undeformed, its gap
follows the centres. So the list may hold pairs beyond the range, and does, a skin wide: within the skin nothing depends
on whether a pair is listed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import (
    ROWS,
    Box,
    Contacts,
    Integers,
    Wall,
    bare_contacts,
    directions,
    find_pairs,
    lattice,
    some_of,
)
from softdyn.particles.parameters import mixed_parameters
from softdyn.particles.system import System

Array = NDArray[np.float64]

#: Width of the skin, in radii.
SKIN = 0.4


@dataclass(frozen=True)
class Listed:
    """Where everything was when the contacts were last looked for.

    Attributes
    ----------
    x : array, shape (N, d)
    cell : array, shape (d, d)
    walls : array, shape (walls, d)
        A point of each.
    skin : float
    """

    x: Array
    cell: Array
    walls: Array
    skin: float


def travelled(listed: Listed, x: Array, box: Box, t: float, farthest: float, walls: tuple[Wall, ...]) -> float:
    """By how much, at most, two surfaces have come closer since, in units of the skin.

    Parameters
    ----------
    farthest : float
        Distance of the centres at which two particles are looked for.
    """
    loose = np.diag(np.where(box.periodic, 0.0, 1.0))
    affine = (lattice(box, t) - listed.cell) @ np.linalg.inv(listed.cell + loose)
    # motion apart from that of the box
    moved = x - listed.x - listed.x @ affine.T
    if not walls:
        moved = moved - moved.mean(axis=0)
    own = float(np.linalg.norm(moved, axis=1).max())
    closer = own + max(own, _moved(walls, listed.walls) if walls else 0.0)
    return (closer + float(np.linalg.norm(affine)) * farthest) / listed.skin


def _moved(walls: tuple[Wall, ...], listed: Array) -> float:
    """How far the farthest of the walls has moved from the points given."""
    return max(
        (float(np.linalg.norm(wall.point - point)) for wall, point in zip(walls, listed, strict=True)), default=0.0
    )


def find_contacts(system: System, x: Array, t: float, old: Contacts | None) -> tuple[Contacts, Listed, int, int]:
    """List the contacts at the given positions; those already listed keep their gaps.

    Parameters
    ----------
    system : System
    x : array, shape (N, d)
    t : float
    old : Contacts, optional
        Those that are listed.

    Returns
    -------
    contacts : Contacts
    listed : Listed
    made, dropped : int
        New ones that are within range, and those left behind that had been.
    """
    reach, box, walls = system.reach, system.box, system.walls
    skin = max([SKIN, *(mechanism.skin for mechanism in system.mechanisms)]) * float(system.radii.min())
    nothing = (np.empty(0, np.int32), np.empty(0, np.int32), np.empty((0, x.shape[1]), np.int16))
    found = find_pairs(x, system.radii, box, t, walls, system.listing + skin) if system.searches else nothing
    i, j, shift = with_pairs(system, *found)
    contacts = bare_contacts(i, j, shift, system.radii)
    contacts.q = mixed_parameters(system, system.kernel, i, j)
    cell = lattice(box, t)
    _, r = directions(contacts, x, cell, walls)
    listed = Listed(x.copy(), cell, np.array([wall.point for wall in walls]).reshape(len(walls), x.shape[1]), skin)
    apart = r - contacts.S
    (solver,) = system.having["solve"]
    contacts.h = solver.gaps_at_sight(system, apart, old is None)
    contacts.T = np.zeros((len(contacts), x.shape[1] if system.width > x.shape[1] else 0))
    contacts.rubbed = np.zeros((len(contacts), system.rubbed))
    contacts.since = np.full((len(contacts), system.timed), np.inf)
    if old is None:
        contacts.touched = contacts.h < reach
        return contacts, listed, int(contacts.touched.sum()), 0
    contacts, dropped = taken_over(contacts, old, reach)
    return contacts, listed, 0, dropped


def with_pairs(system: System, i: Integers, j: Integers, shift: Integers) -> tuple[Integers, Integers, Integers]:
    """Pairs in order, with those that mechanisms always have listed.

    Parameters
    ----------
    system : System
    i, j : array of int, shape (n,)
        Pairs that are near.
    shift : array of int, shape (n, d)
        Lattice vectors by which j is displaced.
    """
    more = [found for one in system.having["pairs"] if (found := one.pairs()) is not None]
    if not more:
        return i, j, shift
    every = [np.concatenate([part, *(found[k] for found in more)]) for k, part in enumerate((i, j, shift))]
    rows = np.unique(np.column_stack(every).astype(np.int64), axis=0)
    return rows[:, 0].astype(i.dtype), rows[:, 1].astype(j.dtype), np.ascontiguousarray(rows[:, 2:])


def taken_over(contacts: Contacts, old: Contacts, reach: float) -> tuple[Contacts, int]:
    """Contacts with the gaps and forces of those that were there before; and how many of these are left behind.

    Parameters
    ----------
    contacts : Contacts
        New ones, which are changed in place.
    old : Contacts
    reach : float
        Range of the contacts, a length.
    """
    mine, source = common(contacts, old)
    contacts.h[mine] = old.h[source]
    contacts.touched[mine] = old.touched[source]
    contacts.T[mine] = old.T[source]
    contacts.rubbed[mine] = old.rubbed[source]
    contacts.since[mine] = old.since[source]
    left = np.ones(len(old), bool)
    left[source] = False
    # a pair still within the range keeps its contact, however far its centres are: it is listed anew
    held = np.flatnonzero(left & (old.h < reach))
    if len(held):
        contacts = _joined(contacts, old, held)
        left[held] = False
    return contacts, int(np.sum(old.touched & left))


def common(contacts: Contacts, old: Contacts) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the contacts that are in both lists, in each of them."""
    both = [np.concatenate(ends) for ends in ((contacts.i, old.i), (contacts.j, old.j), (contacts.shift, old.shift))]
    order = np.lexsort((*both[2].T, both[1], both[0]))  # stable: of two equal rows, that of the new list comes first
    equal = np.ones(max(0, len(order) - 1), dtype=bool)
    for column in (both[0], both[1], *both[2].T):
        ordered = column[order]
        equal &= ordered[1:] == ordered[:-1]
    same = np.flatnonzero(equal)
    return order[same], order[same + 1] - len(contacts)


def _joined(contacts: Contacts, old: Contacts, rows: NDArray[np.int64]) -> Contacts:
    """Contacts with some of the old ones, in order."""
    held = some_of(old, rows)
    both = {name: np.concatenate([getattr(contacts, name), getattr(held, name)]) for name in ROWS}
    every = Contacts(q=np.concatenate([contacts.q, held.q], axis=1), **both)
    return some_of(every, np.lexsort((*every.shift.T, every.j, every.i)))
