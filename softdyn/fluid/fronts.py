"""Sparse factors by dense fronts: the multifrontal method of Duff & Reid, ACM Trans. Math. Softw. 9 (1983) 302.

Unknowns are eliminated part after part, those of a part at once: its rows and columns, and those of the later unknowns
that they are coupled to, are one dense matrix, a front. What elimination leaves of it for the later ones is added to
the front of the part that comes first among them. All work is that of dense matrices, at the speed of these. Rows are
exchanged within a part alone: what is lost by that refinement gives back, or the residual tells. So it does with what
single precision loses, in which a factor takes half of the memory and two thirds of the time.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetri, sgetrf, sgetri
from scipy.sparse import csc_matrix

Array = NDArray[np.floating]
Indices = NDArray[np.int64]


#: Columns that LAPACK works on at once.
BLOCK = 64
#: First and end of some places, and where the first of them is elsewhere.
Run = tuple[int, int, int]


class Front(NamedTuple):
    """Where a front takes its entries from.

    Attributes
    ----------
    first, end : int
        Its part of the unknowns.
    border : array of int
        Later unknowns that are coupled to these, in order.
    entries, places : array of int
        Entries of the matrix, and where they stand in the front, a column after another.
    before : list of (int, list of (int, int, int))
        Fronts that leave something for this one, and where in it: first and end of each run of their border that is
        one here, too, and where it begins here.
    """

    first: int
    end: int
    border: Indices
    entries: Indices
    places: Indices
    before: list[tuple[int, list[Run]]]


class Eliminated(NamedTuple):
    """What is left of a front: the inverse of its part, the rows below, and that inverse times the columns behind."""

    inverse: Array
    below: Array
    behind: Array


@dataclass(frozen=True)
class Fronts:
    """Fronts of all matrices of one pattern.

    Attributes
    ----------
    indices, indptr : array of int
        The pattern, by columns.
    fronts : list of Front
        In the order of elimination.
    """

    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    fronts: list[Front]

    def fit(self, matrix: csc_matrix) -> bool:
        """Whether a matrix has this pattern."""
        return np.array_equal(matrix.indptr, self.indptr) and np.array_equal(matrix.indices, self.indices)


def fronts_of(matrix: csc_matrix, starts: Indices) -> Fronts:
    """Fronts of a pattern.

    Parameters
    ----------
    matrix : sparse matrix, shape (n, n)
        Whose pattern is symmetric.
    starts : array of int
        First unknown of each part, and n.
    """
    count, parts = matrix.shape[0], len(starts) - 1
    column = np.repeat(np.arange(count), np.diff(matrix.indptr))
    row = matrix.indices.astype(np.int64)
    part = np.repeat(np.arange(parts), np.diff(starts))
    owner = part[np.minimum(row, column)]
    by_owner = np.argsort(owner, kind="stable")
    ends = np.searchsorted(owner[by_owner], np.arange(parts + 1))
    local = np.zeros(count, dtype=np.int64)
    below: list[list[int]] = [[] for _ in range(parts)]
    fronts: list[Front] = []
    for k in range(parts):
        first, end = int(starts[k]), int(starts[k + 1])
        entries = by_owner[ends[k] : ends[k + 1]]
        rows, columns = row[entries], column[entries]
        seen = [rows, columns, *(fronts[other].border for other in below[k])]
        border = np.unique(np.concatenate([one[one >= end] for one in seen]))
        size = end - first + len(border)
        local[first:end] = np.arange(end - first)
        local[border] = np.arange(end - first, size)
        before = [(other, _runs(local[fronts[other].border])) for other in below[k]]
        fronts.append(Front(first, end, border, entries, local[rows] + size * local[columns], before))
        if len(border):
            below[int(part[border[0]])].append(k)
    return Fronts(matrix.indices, matrix.indptr, fronts)


def front_factor(fronts: Fronts, entries: Array) -> FrontFactor | None:
    """Factor of one matrix, in the precision of its entries; None if a part of it is singular by itself."""
    try:
        with np.errstate(all="ignore"):
            return FrontFactor(fronts, entries)
    except RuntimeError:
        return None


class FrontFactor:
    """Factor of one matrix.

    Parameters
    ----------
    fronts : Fronts
        Of its pattern.
    entries : array
        Those of the matrix, by columns: float32 or float64, as the factor is, too.

    Raises
    ------
    RuntimeError
        If a part is singular by itself.
    """

    def __init__(self, fronts: Fronts, entries: Array) -> None:
        self.fronts, self.precision = fronts.fronts, entries.dtype
        self.parts: list[Eliminated] = []
        left: dict[int, Array] = {}
        for k, front in enumerate(self.fronts):
            own, size = front.end - front.first, front.end - front.first + len(front.border)
            # rows of these arrays are columns of the front, as Fortran has them
            flat = np.zeros(size * size, entries.dtype)
            flat[front.places] = entries[front.entries]
            whole = flat.reshape(size, size)
            for other, runs in front.before:
                _add(whole, left.pop(other), runs)
            inverse = _inverse(whole[:own, :own].copy().T)
            below = whole[:own, own:].copy().T
            behind = inverse @ whole[own:, :own].T
            if len(front.border):
                left[k] = whole[own:, own:]
                left[k] -= behind.T @ below.T
            self.parts.append(Eliminated(inverse, below, behind))

    def solve(self, right: Array) -> Array:
        """Solution, without refinement."""
        # single precision has no numbers as large, or as small, as those of some units
        unit = float(np.exp2(np.frexp(np.max(np.abs(right), initial=0.0))[1]))
        # what overflows is no solution, which the residual tells
        with np.errstate(all="ignore"):
            return self._solved((right / unit).astype(self.precision)).astype(float, copy=False) * unit

    def _solved(self, x: Array) -> Array:
        for front, part in zip(self.fronts, self.parts, strict=True):
            own = part.inverse @ x[front.first : front.end]
            x[front.first : front.end] = own
            x[front.border] -= part.below @ own
        for front, part in zip(reversed(self.fronts), reversed(self.parts), strict=True):
            x[front.first : front.end] -= part.behind @ x[front.border]
        return x


def _inverse(matrix: Array) -> Array:
    """Inverse of a matrix, which is overwritten.

    Raises
    ------
    RuntimeError
    """
    getrf, getri = (sgetrf, sgetri) if matrix.dtype == np.float32 else (dgetrf, dgetri)
    factor, pivots, singular = getrf(matrix, overwrite_a=1)
    if singular:
        raise RuntimeError("a part of the matrix is singular")
    inverse, _ = getri(factor, pivots, lwork=BLOCK * len(matrix), overwrite_lu=1)
    return np.asarray(inverse)


def _runs(places: Indices) -> list[Run]:
    """Runs of places that follow each other."""
    cuts = [0, *(np.flatnonzero(np.diff(places) != 1) + 1).tolist(), len(places)]
    return [(a, b, int(places[a])) for a, b in itertools.pairwise(cuts)]


def _add(whole: Array, part: Array, runs: list[Run]) -> None:
    """Add what a front leaves; blocks that are contiguous are added much faster than rows and columns one by one."""
    for a, b, at in runs:
        for c, d, beside in runs:
            whole[at : at + b - a, beside : beside + d - c] += part[a:b, c:d]
