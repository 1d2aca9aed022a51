"""Meshes that are built in: boxes in two and three dimensions, and a channel with a cylinder.

Both are made of quadrilaterals, or of cuboids, which are then cut. No element in a corner has all of its corners on
the boundary: pressures of order 1 would find no velocity there to act on.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.mesh import Mesh, all_facets, grouped, mesh_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Names of the sides of a box, at the start and the end of each axis.
SIDES = (("left", "right"), ("bottom", "top"), ("front", "back"))
#: Rings around a cylinder end in a square, or at a side of the channel that is at most this many times as far away.
NEAR = 1.5
#: Elements of a mesh, at most.
LARGEST = 20_000_000


def box_mesh(
    lengths: Sequence[float],
    cells: Sequence[int],
    origin: Sequence[float] | None = None,
    finer_at: Collection[str] = (),
    ratio: float = 1.0,
) -> Mesh:
    """Mesh of a rectangle or a cuboid: cells along each axis, cut into 2 triangles or 6 tetrahedra each.

    The cuts run towards the middle of the box, so that the mesh is its own mirror image where counts are even.

    Parameters
    ----------
    lengths, cells : sequences of 2 or 3 numbers
    origin : sequence of float, optional
        The lowest corner; 0 by default.
    finer_at : collection of str
        Sides towards which cells become finer: left, right (along x), bottom, top (y), front, back (z).
    ratio : float
        Of the largest cell to the smallest along such an axis.

    Raises
    ------
    SceneError
    """
    d = len(lengths)
    if d not in (2, 3) or len(cells) != d or (origin is not None and len(origin) != d):
        raise SceneError("[mesh] box, cells and origin need 2 or 3 numbers, as many each")
    if not all(math.isfinite(length) and length > 0 for length in lengths):
        raise SceneError(f"[mesh] box: lengths must be positive, not {list(lengths)}")
    if not all(n >= 2 for n in cells):
        raise SceneError(f"[mesh] cells: at least 2 along each axis, not {list(cells)}")
    count = math.prod(cells) * math.factorial(d)
    if count > LARGEST:
        raise SceneError(f"[mesh] cells: {count} elements are more than {LARGEST}")
    if not (math.isfinite(ratio) and ratio >= 1):
        raise SceneError(f"[mesh] ratio of the largest cell to the smallest must be 1 or larger, not {ratio:g}")
    unknown = [name for name in finer_at if name not in sum(SIDES[:d], ())]
    if unknown:
        raise SceneError(f"[mesh] finer_at: {unknown[0]!r} is none of {', '.join(sum(SIDES[:d], ()))}")
    start = np.zeros(d) if origin is None else np.array(origin, dtype=float)
    axes = [start[k] + lengths[k] * graded(cells[k], ratio, *(side in finer_at for side in SIDES[k])) for k in range(d)]
    at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    corners = _cut_cells(cells)
    outer = _outer(corners)
    place = np.stack(np.unravel_index(outer, [n + 1 for n in cells]), axis=-1)
    boundaries = {
        SIDES[k][end]: outer[(place[:, :, k] == end * cells[k]).all(axis=1)] for k in range(d) for end in (0, 1)
    }
    return mesh_of(at, corners, boundaries, "[mesh] box")


def graded(cells: int, ratio: float, first: bool, last: bool) -> Array:
    """Ends of cells between 0 and 1 whose sizes are a geometric sequence.

    Parameters
    ----------
    cells : int
    ratio : float
        Of the largest to the smallest.
    first, last : bool
        Whether cells are finer at 0, and at 1.
    """
    place = np.linspace(0.0, 1.0, cells)  # of each cell among all
    if first and last:
        place = 1 - np.abs(2 * place - 1)
        place /= max(place.max(), np.finfo(float).tiny)
    elif last:
        place = 1 - place
    sizes = ratio**place if first or last else np.ones(cells)
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    return np.asarray(ends / ends[-1])


def _cut_cells(cells: Sequence[int]) -> Ints:
    """Elements of a box, whose points are numbered with the last axis fastest."""
    d = len(cells)
    cell = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), axis=-1).reshape(-1, d)
    # from the corner of the cell that is away from the middle of the box, one axis after another
    flip = cell >= (np.array(cells) + 1) // 2
    steps = np.where(flip, -1, 1)
    start = cell + flip
    parts = []
    for order in permutations(range(d)):
        place, corner = start.copy(), [start]
        for axis in order:
            place = place.copy()
            place[:, axis] += steps[:, axis]
            corner.append(place)
        parts.append(np.stack(corner, axis=1))
    places = np.stack(parts, axis=1).reshape(-1, d + 1, d)
    return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(places, -1, 0)), [n + 1 for n in cells]), dtype=np.int64)


def _outer(corners: Ints) -> Ints:
    """Facets of one element alone."""
    every = all_facets(corners)
    first, group = grouped(np.sort(every, axis=1))
    return np.asarray(every[first[np.bincount(group) == 1]])


def cylinder_mesh(
    channel: Sequence[float] = (2.2, 0.41),
    centre: Sequence[float] = (0.2, 0.2),
    radius: float = 0.05,
    around: int = 64,
) -> Mesh:
    """Mesh of a plane channel with a cylinder across it; by default that of Schäfer and Turek [1]_.

    Rings of cells around the cylinder, nearly square each, from the circle to a square that reaches to the nearest
    side of the channel; elsewhere cells as large as the last of these. A quarter of the cells around the cylinder is
    how many there are along a side of the square. The cylinder is a regular polygon of the circle's area: its corners
    are outside of the circle by a fraction pi^2/(3 around^2) of the radius. So its drag is nearer to that of the circle
    by orders than with corners on it: at Re = 20 and 32 cells it errs by 0.02 % instead of 0.39 %.

    Boundaries: inlet (x = 0), outlet, walls (y = 0 and y = height), cylinder.

    Parameters
    ----------
    channel : sequence of 2 float
        Length and height.
    centre : sequence of 2 float
    radius : float
    around : int
        Cells around the cylinder, a multiple of 4, 16 or larger.

    Raises
    ------
    SceneError

    References
    ----------
    .. [1] M. Schäfer, S. Turek, Benchmark computations of laminar flow around a cylinder, 1996.
    """
    (length, height), (x, y) = (float(v) for v in channel), (float(v) for v in centre)
    if not all(map(math.isfinite, (length, height, x, y, radius))) or not radius > 0:
        raise SceneError("[mesh] channel, cylinder and radius must be finite, the radius positive")
    gap = min(x, length - x, y, height - y) - radius
    if not gap > 0.1 * radius:
        raise SceneError(
            f"[mesh] the cylinder at ({x:g}, {y:g}) of radius {radius:g} must be inside of the channel, "
            f"[0, {length:g}] x [0, {height:g}], a tenth of its radius away from its sides"
        )
    if around < 16 or around % 4:
        raise SceneError(f"[mesh] around must be a multiple of 4, 16 or larger, not {around}")
    x_ends, y_ends = _square(x, length, min(x, length - x, y, height - y)), _square(y, height, gap + radius)
    side = around // 4
    rings = _rings(x, y, radius, np.linspace(*x_ends, side + 1), np.linspace(*y_ends, side + 1))
    size = max(x_ends[1] - x_ends[0], y_ends[1] - y_ends[0]) / side
    columns, rows = (_strips(ends, total, side, size) for ends, total in ((x_ends, length), (y_ends, height)))
    count = 2 * (sum(map(len, columns)) * sum(map(len, rows)) + rings.size // 2)
    if count > LARGEST:
        raise SceneError(f"[mesh] the channel would have {count} elements, more than {LARGEST}: lower around")
    blocks = [_grid(c, r) for k, c in enumerate(columns) for m, r in enumerate(rows) if (k, m) != (1, 1)]
    at, quads = _joined([rings, *(block for block in blocks if min(block.shape[:2]) > 1)])
    corners = _cut_quads(at, quads)
    sides = _outer(corners)
    middle = at[sides].mean(axis=1)
    tiny = 1e-9 * (length + height)
    walls = (middle[:, 1] < tiny) | (middle[:, 1] > height - tiny)
    inlet, outlet = middle[:, 0] < tiny, middle[:, 0] > length - tiny
    parts = {"inlet": inlet, "outlet": outlet, "walls": walls, "cylinder": ~(inlet | outlet | walls)}
    return mesh_of(at, corners, {name: sides[part] for name, part in parts.items()}, "[mesh] channel")


def _square(middle: float, total: float, half: float) -> tuple[float, float]:
    """Where rings around the cylinder end along an axis: at the wall where that is not much farther than ``half``."""
    ends = (middle, total - middle)
    low, high = (distance if distance < NEAR * half else half for distance in ends)
    return middle - low, total if high == ends[1] else middle + high


def _strips(ends: tuple[float, float], total: float, side: int, size: float) -> list[Array]:
    """Ends of cells before, beside and behind the square, along an axis."""
    spans = ((0.0, ends[0]), ends, (ends[1], total))
    counts = [max(int(b > a), round((b - a) / size)) for a, b in spans]
    return [np.linspace(*span, (side if k == 1 else counts[k]) + 1) for k, span in enumerate(spans)]


def _rings(x: float, y: float, radius: float, along: Array, across: Array) -> Array:
    """Points of rings from the circle to a rectangle, shape (rings, cells around + 1, 2), each closed."""
    side = len(along) - 1
    # around the rectangle, against the clock, from its lower right corner
    rim = np.concatenate(
        [
            np.stack([np.full(side, along[-1]), across[:-1]], axis=1),
            np.stack([along[:0:-1], np.full(side, across[-1])], axis=1),
            np.stack([np.full(side, along[0]), across[:0:-1]], axis=1),
            np.stack([along[:-1], np.full(side, across[0])], axis=1),
        ]
    )
    corner = np.arctan2(rim[::side, 1] - y, rim[::side, 0] - x)
    step = 2 * math.pi / (4 * side)
    angle = float(np.mean(np.unwrap(corner) - step * side * np.arange(4))) + step * np.arange(4 * side)
    reach = radius * math.sqrt(step / math.sin(step))  # of corners of a polygon with the circle's area
    circle = np.array([x, y]) + reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # rings grow as the cells along them do, so that each cell is nearly a square
    inner, outer = 2 * math.pi * radius, float(np.ptp(along) + np.ptp(across)) * 2
    gap = float(np.mean(np.linalg.norm(rim - circle, axis=1)))
    grown = outer / inner
    layers = max(2, round(4 * side * gap * math.log(grown) / (outer - inner)))
    s = graded(layers, grown, True, False)[:, None, None]
    rings = (1 - s) * circle + s * rim
    return np.concatenate([rings, rings[:, :1]], axis=1)


def _grid(x: Array, y: Array) -> Array:
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)


def _joined(grids: Sequence[Array]) -> tuple[Array, Ints]:
    """Points and quadrilaterals of grids, shape (n, m, 2) each, points at one place being one."""
    points = np.concatenate([grid.reshape(-1, 2) for grid in grids])
    quads, start = [], 0
    for grid in grids:
        n, m = grid.shape[:2]
        number = start + np.arange(n * m).reshape(n, m)
        quads.append(np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4))
        start += n * m
    from scipy.spatial import cKDTree

    same = cKDTree(points).query_pairs(1e-9 * float(np.ptp(points)), output_type="ndarray")
    least = np.arange(len(points))
    np.minimum.at(least, same.max(axis=1), same.min(axis=1))
    kept, number = np.unique(least, return_inverse=True)
    return points[kept], number.reshape(-1)[np.concatenate(quads)]


def _cut_quads(at: Array, quads: Ints) -> Ints:
    """Triangles of quadrilaterals, cut along the shorter diagonal, or that from a corner of the boundary."""
    lengths = [np.linalg.norm(at[quads[:, k + 2]] - at[quads[:, k]], axis=1) for k in (0, 1)]
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, group = grouped(edges)
    alone = (np.bincount(group)[group] == 1).reshape(-1, 4)
    corner = alone & np.roll(alone, 1, axis=1)
    other = np.where(corner.any(axis=1), corner[:, 1] | corner[:, 3], lengths[1] < lengths[0] * (1 - 1e-9))
    turned = np.where(other[:, None], np.roll(quads, -1, axis=1), quads)
    return turned[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
