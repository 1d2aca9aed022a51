"""Elements that contain points, and values there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: How far outside of an element a point may be, over the element's size: rounding.
ROUNDING = 1e-9
#: Pairs of a point and an element that are looked at together.
TOGETHER = 1_000_000


@dataclass(frozen=True)
class Locator:
    """A grid of cells, each with the elements whose bounding boxes reach into it.

    Attributes
    ----------
    at : array, shape (points, d)
    corners : array of int, shape (elements, d + 1)
    inverse : array, shape (elements, d, d)
        Of the matrix whose columns are an element's edges from its first corner.
    low, size : arrays, shape (d,)
        Of the grid, and of a cell.
    counts : array of int, shape (d,)
    start : array of int, shape (cells + 1,)
        Where each cell's elements begin in ``elements``.
    elements : array of int
    """

    at: Array
    corners: Ints
    inverse: Array
    low: Array
    size: Array
    counts: Ints
    start: Ints
    elements: Ints


def locator(at: Array, corners: Ints) -> Locator:
    """Grid of about as many cells as there are elements, for a mesh."""
    d = at.shape[1]
    low, high = at.min(axis=0), at.max(axis=0)
    wide = high - low
    edge = float(np.prod(wide) / len(corners)) ** (1 / d)
    counts = np.maximum(1, np.floor(wide / edge)).astype(np.int64)
    size = wide / counts
    first, last = (
        np.clip(np.floor((bound - low) / size), 0, counts - 1).astype(np.int64)
        for bound in (at[corners].min(axis=1), at[corners].max(axis=1))
    )
    spans = last - first + 1
    covered = np.prod(spans, axis=1)
    element = np.repeat(np.arange(len(corners)), covered)
    within = np.arange(len(element)) - np.repeat(np.cumsum(covered) - covered, covered)
    cell = np.zeros(len(element), dtype=np.int64)
    for axis in range(d):
        cell = cell * counts[axis] + first[element, axis] + within % spans[element, axis]
        within //= spans[element, axis]
    order = np.argsort(cell, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=int(np.prod(counts))))])
    edges = np.swapaxes(at[corners[:, 1:]] - at[corners[:, :1]], 1, 2)
    inverse = np.asarray(np.linalg.inv(edges), dtype=np.float64)
    return Locator(at, corners, inverse, low, size, counts, start, element[order])


def located(grid: Locator, points: Array) -> tuple[Ints, Array]:
    """Elements that contain points, and the points' barycentric coordinates there.

    Parameters
    ----------
    grid : Locator
    points : array, shape (n, d)

    Returns
    -------
    element : array of int, shape (n,)
        -1 of points in no element; where elements meet, the one in which a point is deepest.
    shares : array, shape (n, d + 1)
    """
    d = grid.at.shape[1]
    place = np.floor((points - grid.low) / grid.size)
    inside = np.all((place >= -1) & (place <= grid.counts), axis=1) & np.isfinite(points).all(axis=1)
    place = np.clip(np.where(inside[:, None], place, 0), 0, grid.counts - 1).astype(np.int64)
    cell = np.ravel_multi_index(tuple(place.T), tuple(grid.counts))
    candidates = np.where(inside, grid.start[cell + 1] - grid.start[cell], 0)
    element = np.full(len(points), -1)
    shares = np.full((len(points), d + 1), np.nan)
    ends = np.cumsum(candidates)
    begin = 0
    while begin < len(points):
        offset = ends[begin] - candidates[begin]
        end = max(begin + 1, int(np.searchsorted(ends, offset + TOGETHER, "right")))
        own = candidates[begin:end]
        point = np.repeat(np.arange(begin, end), own)
        within = np.arange(len(point)) - np.repeat(np.cumsum(own) - own, own)
        tried = grid.elements[grid.start[cell[point]] + within]
        found = _barycentric(grid, tried, points[point])
        depth = found.min(axis=1)
        order = np.lexsort((-tried, depth, point))
        best = order[np.append(np.diff(point[order]) > 0, True)] if len(order) else order
        best = best[depth[best] >= -ROUNDING]
        element[point[best]], shares[point[best]] = tried[best], found[best]
        begin = end
    return element, shares


def _barycentric(grid: Locator, element: Ints, points: Array) -> Array:
    rest = np.einsum("nij,nj->ni", grid.inverse[element], points - grid.at[grid.corners[element, 0]])
    return np.concatenate([1 - rest.sum(axis=1, keepdims=True), rest], axis=1)


def sampled(values: Array, nodes: Ints, element: Ints, shares: Array) -> Array:
    """Values of a field at points that were located, shape (n, ...): nan in no element.

    Parameters
    ----------
    values : array, shape (nodes, ...)
    nodes : array of int, shape (elements, nodes of an element)
        Of order 1 or 2, as :class:`softdyn.fluid.numbering.Nodes` has them.
    element, shares : arrays
        See :func:`located`.
    """
    shapes = shares
    if nodes.shape[1] > shares.shape[1]:
        pairs = combinations(range(shares.shape[1]), 2)
        middles = [4 * shares[:, i] * shares[:, j] for i, j in pairs]
        shapes = np.column_stack([shares * (2 * shares - 1), *middles])
    found: Array = np.einsum("nk,nk...->n...", shapes, values[nodes[element]])
    found[element < 0] = np.nan
    return found
