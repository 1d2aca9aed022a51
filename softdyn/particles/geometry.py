"""Where contacts are: the box, the list of neighbours, distances and directions.

Positions are never wrapped: a particle keeps its coordinates when it leaves the box, and a contact knows by which
lattice vector of the box its second particle is displaced. In a sheared box the lattice moves with the flow
(Lees-Edwards), and so do the images, without a jump.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from softdyn.errors import SceneError
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import COORDINATES, DRIVEN_LIST, FLAG, Kind
from softdyn.scene.time_tables import OverTime

Array = NDArray[np.float64]
Integers = NDArray[np.signedinteger[Any]]

#: Walls are checked where their dimension is known.
WALL_FLAG = Kind(FLAG.words, FLAG.schema)


@dataclass(frozen=True)
class Box:
    """A periodic box, or none, and how it deforms.

    Attributes
    ----------
    lengths : array, shape (d,)
        Edges along the axes; ``inf`` along those that are not periodic.
    shear_rate : float
        The flow is u = shear_rate y along x; 0 without flow.
    tilt, since : float
        By how much the second edge leans along x, and the time at which that and the lengths hold.
    stretch : array, shape (d,), optional
        Rates at which the lengths grow, relative to them.
    depth : float, optional
        Extent along each of the dimensions that are missing from three: spheres in two dimensions are a layer of that
        depth, those in one a column of that width and depth.
    """

    lengths: Array
    shear_rate: float = 0.0
    tilt: float = 0.0
    since: float = 0.0
    stretch: Array | None = None
    depth: float | None = None

    @property
    def volume(self) -> float:
        """Volume of a box that is periodic along all its axes: what a virial, force times length, is divided by."""
        d = len(self.lengths)
        area = float(np.prod(self.lengths))
        if d == 3:
            return area
        assert self.depth is not None, "a box of fewer than three dimensions has a stress only with a depth"
        return area * self.depth ** (3 - d)

    @property
    def rate(self) -> Array:
        """Rate at which the lattice vectors change, as columns; constant from the time ``since`` on."""
        return self.gradient @ self.cell

    @property
    def cell(self) -> Array:
        """Lattice vectors at the time ``since``."""
        cell = np.diag(np.where(self.periodic, self.lengths, 0.0))
        if len(cell) > 1:
            cell[0, 1] = self.tilt
        return cell

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Axes along which the box repeats itself."""
        return np.isfinite(self.lengths)

    @property
    def gradient(self) -> Array:
        """Velocity gradient G of the background flow u = G x, with which the box moves, shape (d, d)."""
        d = len(self.lengths)
        gradient = np.zeros((d, d)) if self.stretch is None else np.diag(self.stretch)
        if d > 1:
            gradient[0, 1] = self.shear_rate
        return gradient


@with_keys
@dataclass(frozen=True)
class Wall:
    """A flat wall: particles are on the side that ``normal`` points away from.

    A run has point and normal as arrays, and the normal as a unit vector.
    """

    point: Annotated[
        Any, Key("[[wall]] point", COORDINATES, "A point of the wall, one number for each axis.", "length")
    ]
    normal: Annotated[
        Any, Key("[[wall]] normal", COORDINATES, "Normal of the wall, from the particles into it, of any length.")
    ]
    rigid: Annotated[
        bool,
        Key(
            "[[wall]] rigid",
            Kind("true or false", FLAG.schema),
            "Whether the wall does not give in at all, or as the particles do.",
        ),
    ] = True
    velocity: Annotated[
        Sequence[OverTime] | None,
        Key(
            "[[wall]] velocity",
            DRIVEN_LIST,
            "Velocity of the wall, one number for each axis; at rest without.",
            "length/time",
            ("v", "V"),
            of_axes=True,
        ),
    ] = None


@dataclass
class Contacts:
    """Pairs in touch or near it; arrays of one length n, in an order that follows from the particles' numbers.

    Attributes
    ----------
    i, j : array of int
        The particles; a wall w has j = N + w.
    shift : array of int, shape (n, d)
        The lattice vector by which particle j is displaced.
    S : array
        Sum of the radii.
    q : array, shape (parameters, n)
        The varying parameters of the law.
    h : array
        Gaps.
    touched : array of bool
        Whether the contact has been within its range.
    T : array, shape (n, d)
        Tangential forces, from i to j; of no columns without tangential motion.
    rubbed : array, shape (n, d or more)
        Of these, what surfaces that touch bear by friction; and what resists rolling and twisting.
    since : array, shape (n, potentials with an age)
        Times since which the two have been within the cut-off of each; inf beyond it.
    """

    i: Integers
    j: Integers
    shift: Integers
    S: Array
    q: Array
    h: Array
    touched: NDArray[np.bool_]
    T: Array
    rubbed: Array
    since: Array

    def __len__(self) -> int:
        return len(self.i)


#: What has a row for each contact; q has a column.
ROWS = tuple(field.name for field in fields(Contacts) if field.name != "q")


def bare_contacts(i: Integers, j: Integers, shift: Integers, radii: Array) -> Contacts:
    """Contacts of which only the geometry is known.

    Parameters
    ----------
    i, j : array of int, shape (n,)
        The particles; a wall w has j = N + w.
    shift : array of int, shape (n, d)
        Lattice vectors by which j is displaced.
    radii : array, shape (N,)
    """
    walls = max(0, int(j.max(initial=0)) + 1 - len(radii))
    with_walls = np.append(radii, np.zeros(walls))
    n = len(i)
    touched, nothing = np.zeros(n, bool), np.zeros((n, 0))
    return Contacts(
        i, j, shift, radii[i] + with_walls[j], np.empty((0, n)), np.full(n, np.nan), touched, nothing, nothing, nothing
    )


def some_of(contacts: Contacts, which: slice | NDArray[np.int64]) -> Contacts:
    """Some of the contacts; of a slice, all arrays but q are parts of the whole ones."""
    rows = {name: getattr(contacts, name)[which] for name in ROWS}
    return Contacts(q=np.ascontiguousarray(contacts.q[:, which]), **rows)


def lattice(box: Box, t: float) -> Array:
    """Lattice vectors of the box at time t, as columns; 0 along axes that are not periodic."""
    if box.shear_rate or box.stretch is not None:
        return box.cell + (t - box.since) * box.rate
    return box.cell


def flow(box: Box, x: Array) -> Array:
    """Velocity of the background flow at the positions x, shape (N, d)."""
    u = np.zeros_like(x)
    if box.stretch is not None:
        u = x * box.stretch
    if box.shear_rate:
        u[:, 0] += box.shear_rate * x[:, 1]
    return u


def directions(contacts: Contacts, x: Array, cell: Array, walls: tuple[Wall, ...]) -> tuple[Array, Array]:
    """Directions and distances of the contacts.

    Parameters
    ----------
    contacts : Contacts
    x : array, shape (N, d)
    cell : array, shape (d, d)
    walls : tuple of Wall

    Returns
    -------
    n : array, shape (contacts, d)
        Unit vectors from particle i to particle j, or into the wall.
    r : array
        Distances of the centres, or of the centre from the wall.
    """
    count = len(x)
    if not walls:
        along = _along(x, contacts.i, contacts.j, contacts.shift, cell)
        r = np.sqrt(np.einsum("ij,ij->i", along, along))
        # a trial of a step may put two centres in one place: what has no direction is nan, and no step ends there
        with np.errstate(invalid="ignore"):
            along /= r[:, None]
        return along, r
    pair = contacts.j < count
    along = np.ones((len(contacts), x.shape[1]))
    along[pair] = _along(x, contacts.i[pair], contacts.j[pair], contacts.shift[pair], cell)
    r = np.sqrt(np.einsum("ij,ij->i", along, along))
    for w, wall in enumerate(walls):
        mine = contacts.j == count + w
        r[mine] = (wall.point - x[contacts.i[mine]]) @ wall.normal
    with np.errstate(invalid="ignore"):
        along /= np.where(pair, r, 1.0)[:, None]
    for w, wall in enumerate(walls):
        along[contacts.j == count + w] = wall.normal
    return along, r


def curvatures(contacts: Contacts, r: Array, count: int) -> Array:
    """By how much directions turn with a motion across them: 1/r for pairs of ``count`` particles, 0 for walls.

    Parameters
    ----------
    contacts : Contacts
    r : array, shape (contacts,)
        Distances of the centres.
    count : int
        N.
    """
    with np.errstate(divide="ignore"):
        return np.where(contacts.j < count, 1 / r, 0.0)


def crossing(shift: Integers) -> NDArray[np.int64]:
    """Contacts that reach across the faces of the box; ``any(axis=1)`` of so few columns takes four times as long."""
    moved = shift[:, 0].copy()
    for axis in range(1, shift.shape[1]):
        moved |= shift[:, axis]
    return np.flatnonzero(moved)


def _along(x: Array, i: Integers, j: Integers, shift: Integers, cell: Array) -> Array:
    """Vectors from particle i to the image of particle j; few contacts reach across the faces of the box."""
    along = x.take(j, axis=0)
    along -= x.take(i, axis=0)
    across = crossing(shift)
    along[across] += np.einsum("cb,ab->ca", shift[across], cell)
    return along


def find_pairs(
    x: Array, radii: Array, box: Box, t: float, walls: tuple[Wall, ...], within: float
) -> tuple[Integers, Integers, Integers]:
    """All pairs, and particles and walls, whose surfaces are closer than ``within``, ordered by their numbers.

    Parameters
    ----------
    x : array, shape (N, d)
    radii : array, shape (N,)
    box : Box
    t : float
    walls : tuple of Wall
    within : float
        A length.

    Returns
    -------
    i, j : array of int
        i < j; a wall w has j = N + w.
    shift : array of int, shape (n, d)

    Raises
    ------
    SceneError
        If a particle could touch one of its own images, or another one twice, around the box.
    """
    count, d = x.shape
    cell = lattice(box, t)
    if math.isinf(within):
        i, j = np.triu_indices(count, 1)
        shift = np.zeros((len(i), d), dtype=np.int64)
    else:
        i, j, shift = _near(x, radii, box, cell, within)
    found_i, found_j, found_shift = [i], [j], [shift]
    for w, wall in enumerate(walls):
        near = np.flatnonzero((wall.point - x) @ wall.normal - radii < within)
        found_i.append(near)
        found_j.append(np.full(len(near), count + w))
        found_shift.append(np.zeros((len(near), d), dtype=np.int64))
    i, j, shift = (np.concatenate(parts) for parts in (found_i, found_j, found_shift))
    order = np.lexsort((*shift.T, j, i))
    small = np.int16 if np.abs(shift).max(initial=0) <= np.iinfo(np.int16).max else np.int64
    return i[order].astype(np.int32), j[order].astype(np.int32), shift[order].astype(small)


def close_pairs(place: Array, radii: Array, within: float, period: float | None = None) -> tuple[Integers, Integers]:
    """Pairs of places, the first number the smaller, among which are all whose surfaces are closer than ``within``.

    Particles of like size are looked for together, within a factor of two: small ones do not look as far as large ones,
    however wide the distribution.

    Parameters
    ----------
    place : array, shape (n, d)
    radii : array, shape (n,)
    within : float
    period : float, optional
        Edge of the periodic box, a cube, in which all places are.
    """
    size = np.floor(np.log2(radii / radii.min())).astype(np.int64)
    members = [np.flatnonzero(size == one) for one in np.unique(size)]
    trees = [cKDTree(place[those], boxsize=period) for those in members]
    largest = [float(radii[those].max()) for those in members]
    found: list[Integers] = []
    for a, (those, tree) in enumerate(zip(members, trees, strict=True)):
        found.append(those[tree.query_pairs(2 * largest[a] + within, output_type="ndarray")].reshape(-1, 2))
        for b in range(a):
            cut = largest[a] + largest[b] + within
            near = tree.sparse_distance_matrix(trees[b], cut, output_type="ndarray")
            found.append(np.column_stack([those[near["i"]], members[b][near["j"]]]))
    pairs = np.sort(np.concatenate(found), axis=1)
    return pairs[:, 0], pairs[:, 1]


def _near(x: Array, radii: Array, box: Box, cell: Array, within: float) -> tuple[Integers, Integers, Integers]:
    count, d = x.shape
    cut = 2 * float(radii.max()) + within
    periodic = np.flatnonzero(box.periodic)
    home = np.zeros((count, d), dtype=np.int64)
    reduced = cell.copy()
    if len(periodic):
        if d > 1 and box.periodic[1] and cell[0, 1] and not box.periodic[0]:
            raise SceneError("a sheared periodic box must be periodic along x")
        if d > 1 and cell[0, 1]:
            reduced[0, 1] -= cell[0, 0] * round(cell[0, 1] / cell[0, 0])  # the least tilted cell of the same lattice
        small = [axis for axis in periodic if box.lengths[axis] < 2 * cut]
        if small:
            raise SceneError(
                f"[box] is too small along {', '.join('xyz'[axis] for axis in small)}: a particle would meet another "
                f"one twice; at least {2 * cut:.6g} is needed, twice the largest diameter and range (under an imposed "
                "stress the box may have shrunk to this: more particles)"
            )
        full = reduced + np.diag(np.where(box.periodic, 0.0, 1.0))
        fractions = np.linalg.solve(full, x.T).T
        home[:, periodic] = np.floor(fractions[:, periodic]).astype(np.int64)
        wrapped = x - home @ reduced.T
        places, owners, images = [wrapped], [np.arange(count)], [np.zeros((count, d), dtype=np.int64)]
        fractions = fractions - home
        # heights of the cell: how deep a layer next to each face has to be repeated
        depth = cut * np.linalg.norm(np.linalg.inv(full), axis=1)
        for image in itertools.product(*((-1, 0, 1) if repeats else (0,) for repeats in box.periodic)):
            if not any(image):
                continue
            vector = np.array(image, dtype=np.int64)
            close = np.ones(count, dtype=bool)
            for axis in periodic:
                if image[axis] == 1:
                    close &= fractions[:, axis] < depth[axis]
                elif image[axis] == -1:
                    close &= fractions[:, axis] > 1 - depth[axis]
            chosen = np.flatnonzero(close)
            places.append(wrapped[chosen] + reduced @ vector)
            owners.append(chosen)
            images.append(np.tile(vector, (len(chosen), 1)))
        place, owner, image_of = np.concatenate(places), np.concatenate(owners), np.concatenate(images)
    else:
        place, owner, image_of = x, np.arange(count), np.zeros((count, d), dtype=np.int64)
    first, second = close_pairs(place, radii[owner], within)
    mine = first < count
    first, second = first[mine], second[mine]
    i, j = owner[first], owner[second]
    # an image and its mirror are one contact: kept where i < j
    keep = i < j
    swapped = i > j
    i, j = np.where(swapped, j, i), np.where(swapped, i, j)
    distance = np.linalg.norm(place[second] - place[first], axis=1)
    near = (keep | swapped) & (distance - radii[i] - radii[j] < within)
    image = np.where(swapped[:, None], -image_of[second], image_of[second])
    i, j, image = i[near], j[near], image[near]
    # from wrapped positions and the least tilted cell to positions and cell as they are
    shift = image - home[j] + home[i]
    if len(periodic) and d > 1 and cell[0, 1]:
        turns = round(cell[0, 1] / cell[0, 0])
        shift[:, 0] -= turns * shift[:, 1]
    if len(i):
        order = np.lexsort((*shift.T, j, i))
        i, j, shift = i[order], j[order], shift[order]
        another = np.append(True, (i[1:] != i[:-1]) | (j[1:] != j[:-1]) | (shift[1:] != shift[:-1]).any(axis=1))
        i, j, shift = i[another], j[another], shift[another]
    return i, j, shift


def rotations(d: int) -> int:
    """How many rotations a particle has in d dimensions."""
    return {1: 0, 2: 1, 3: 3}[d]


def dot(a: Array, b: Array) -> Array:
    """Product of the vectors of each contact."""
    return np.asarray(np.einsum("ca,ca->c", a, b))


def cross(a: Array, b: Array) -> Array:
    """Cross product of the vectors of each contact, in three dimensions."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def turning(rotation: Array, n: Array) -> Array:
    """Displacement ``rotation x n``."""
    if n.shape[1] == 2:
        return rotation * np.stack([-n[:, 1], n[:, 0]], axis=1)
    return cross(rotation, n)


def torque(n: Array, force: Array) -> Array:
    """Torque ``n x force``."""
    if n.shape[1] == 2:
        return (n[:, 0] * force[:, 1] - n[:, 1] * force[:, 0])[:, None]
    return cross(n, force)
