"""Linear systems of the flow: sparse factors, ordered by nested dissection of the places of the unknowns.

SuperLU, which scipy has, orders columns by a minimum degree of A^T A, as it must where it may exchange any rows. The
matrices of a flow have a symmetric pattern, and places: cut in halves along their longer side, again and again, the
unknowns on each cut behind those of its halves (George, SIAM J. Numer. Anal. 10 (1973) 345), they are factorised with
less than half of the fill and a seventh of the time, at 64 x 64 squares of P2-P1. The parts of the dissection are
eliminated by fronts, in two thirds of SuperLU's time in that order. Rows are exchanged within a part alone, and numbers
have single precision; what is lost by that, refinement gives back. Where it does not, double precision takes over, and
SuperLU then, which exchanges other rows; a residual that is not met is an error.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix

from softdyn.errors import IntegrationError
from softdyn.fluid.fronts import Fronts, front_factor, fronts_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Residual of a linear system, relative to the sizes of its terms, that must be met.
LINEAR_RESIDUAL = 1e-9
#: Part of the largest force whose velocities make no flux that counts.
SILENT = 1e-5
#: Below this it is rounding, and is not refined further.
ROUNDING = 1e-15
MOST_REFINEMENTS = 5
#: Part of the largest entry of a column that a pivot on the diagonal needs to have.
PIVOT = 1e-3
#: Ways to solve: by blocks, by fronts in single and in double precision, by SuperLU in the order that there is, and
#: with all pivots free.
BLOCKS, SINGLE, FRONTS, ORDERED, FREE = range(5)
NAMES = {
    BLOCKS: "GMRES, by blocks",
    SINGLE: "fronts, in single precision",
    FRONTS: "fronts",
    ORDERED: "SuperLU",
    FREE: "SuperLU",
}
#: What to try where the residual is not met. By blocks it is the direct solution that is left.
SAFER = {BLOCKS: FRONTS, SINGLE: FRONTS, FRONTS: ORDERED, ORDERED: FREE}
#: What such a way has to be refined to: what is better costs another solution, and helps Newton's method little.
ROUGH = {BLOCKS: 0.1 * LINEAR_RESIDUAL, SINGLE: 1e-13}
#: Nodes of a part that is not cut any more.
LEAF = 40


class LinearFailed(IntegrationError):
    """A linear system that cannot be solved to its residual."""


def dissected(graph: csr_matrix, places: Array) -> tuple[Indices, Indices]:
    """Order of the nodes of a graph by nested dissection: what stands first is eliminated first.

    Parameters
    ----------
    graph : sparse matrix, shape (nodes, nodes)
        Whose nonzero entries are the edges, in both directions.
    places : array, shape (nodes, axes)

    Returns
    -------
    order : array of int, shape (nodes,)
    starts : array of int
        First place of each part that is eliminated at once, and the count of nodes.
    """
    parts: list[Indices] = []
    # parts that are open, last one first; a cut waits below the halves that it separates
    waiting: list[tuple[bool, Indices]] = [(True, np.arange(len(places)))]
    graph, beyond = abs(graph), np.zeros(len(places))
    while waiting:
        whole, nodes = waiting.pop()
        low = _lower_half(places[nodes]) if whole and len(nodes) > LEAF else None
        if low is None:
            parts.append(nodes)
            continue
        first, second = nodes[low], nodes[~low]
        beyond[second] = 1.0
        touching = (graph[first] @ beyond) > 0
        beyond[second] = 0.0
        waiting += [(False, first[touching]), (True, second), (True, first[~touching])]
    parts = [part for part in parts if len(part)]
    starts = np.cumsum([0, *map(len, parts)])
    return (np.concatenate(parts) if parts else np.empty(0, dtype=np.int64)), starts


def _lower_half(places: Array) -> NDArray[np.bool_] | None:
    """Which places lie below the middle along the longest side; None if they cannot be told apart."""
    along = places[:, int(np.argmax(np.ptp(places, axis=0)))]
    low = along <= np.median(along)
    return None if low.all() else low


@dataclass
class LinearSolver:
    """Solver of systems whose unknowns stand in an order that is good for factors.

    Attributes
    ----------
    kinds : array of int, shape (unknowns,)
        0 of velocities, whose rows are forces; 1 of pressures, whose rows are fluxes.
    motions : array, shape (unknowns, axes), optional
        Even motions of the whole fluid along each axis: with them, matrices are not factorised but solved by blocks.
    starts : array of int, optional
        First unknown of each part that is eliminated at once, and their count: with it, factors are made by fronts.
    fronts : Fronts, optional
        Of the last pattern.
    factor : object, optional
        That of the matrix.
    matrix, sizes : sparse matrix, optional
        The last one that was factorised, and the sizes of its entries.
    pattern : Pattern, optional
        The last one.
    units : array, shape (2,), optional
        By which rows and columns of velocities and of pressures are multiplied before a factor is taken.
    counts : dict
        Factorisations, solutions, refinements, and those made with all pivots free.
    worst : float
        Largest linear residual so far.
    least : float
        Size of velocities below which they do not matter.
    way, direct : int
        That of the factor; and the first to try of those that are no blocks, of those that did not fail here yet.
    """

    kinds: Indices
    motions: Array | None = None
    starts: Indices | None = None
    fronts: Fronts | None = None
    factor: Any = None
    matrix: csc_matrix | None = None
    sizes: csc_matrix | None = None
    pattern: Pattern | None = None
    units: Array | None = None
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("factorisations", "solutions", "refinements", "pivoted"), 0)
    )
    worst: float = 0.0
    least: float = 0.0
    way: int = ORDERED
    direct: int = SINGLE

    def factorise(self, matrix: csc_matrix, way: int | None = None) -> None:
        """Take the factor of a matrix.

        Parameters
        ----------
        matrix : sparse matrix, shape (unknowns, unknowns)
        way : int, optional
            Instead of the one that serves best.

        Raises
        ------
        LinearFailed
            If it is singular.
        """
        self.matrix, self.sizes, self.factor = matrix, _with_entries(matrix, np.abs(matrix.data)), None
        self.counts["factorisations"] += 1
        if not np.isfinite(matrix.data).all():
            raise LinearFailed("the matrix of the flow holds entries that are no numbers")
        if self.pattern is None or not self.pattern.fits(matrix):
            self.pattern = _pattern(matrix, self.kinds)
        self.units = _balance(self.sizes.data, self.pattern.pairs)
        if way is None:
            way = BLOCKS if self.motions is not None else ORDERED if self.starts is None else self.direct
        self.factor = self._factor(way)

    def _factor(self, way: int) -> Any:
        """Factor of the matrix in balanced units, or what solves by blocks; None if there is none."""
        assert self.matrix is not None
        assert self.pattern is not None
        assert self.units is not None
        forces, fluxes = self.units
        scaled = self.matrix.data * np.array([forces**2, forces * fluxes, fluxes**2])[self.pattern.pairs]
        self.way = way
        if way == BLOCKS:
            from softdyn.fluid.krylov import block_solver

            assert self.motions is not None
            return block_solver(_with_entries(self.matrix, scaled), self.kinds, self.motions)
        if way in (SINGLE, FRONTS):
            if self.starts is None:
                return None
            if self.fronts is None or not self.fronts.fit(self.matrix):
                self.fronts = fronts_of(self.matrix, self.starts)
            with np.errstate(over="ignore"):
                return front_factor(self.fronts, scaled.astype(np.float32) if way == SINGLE else scaled)
        return _factor(_with_entries(self.matrix, scaled), free=way == FREE)

    def approximate(self, right: Array) -> Array:
        """Solve with the factor alone, whatever matrix it is of: how far off that is the next residual tells.

        Parameters
        ----------
        right : array, shape (unknowns,)
        """
        self.counts["solutions"] += 1
        return self._by_factor(right)

    def _by_factor(self, right: Array) -> Array:
        assert self.units is not None
        balance = self.units[self.kinds]
        found: Array = balance * self.factor.solve(balance * right)
        return found

    def forget(self) -> None:
        """Leave the factor, so that the next system makes its own."""
        self.factor = self.matrix = self.sizes = None

    def solve(self, right: Array) -> Array:
        """Solve with the matrix that was factorised.

        Raises
        ------
        LinearFailed
            If the residual is not met, however rows are exchanged.
        """
        assert self.matrix is not None
        self.counts["solutions"] += 1
        x, left = (right, np.inf) if self.factor is None else self._refined(right)
        while not left <= LINEAR_RESIDUAL and self.way != FREE:
            # single precision gives way to double without another exchange of rows
            self.counts["pivoted"] += self.way != SINGLE
            self.factor = self._factor(SAFER[self.way])
            self.direct = max(self.direct, min(self.way, FRONTS))
            if self.factor is not None:
                x, left = self._refined(right)
        if self.factor is None:
            raise LinearFailed("the matrix of the flow is singular")
        if not left <= LINEAR_RESIDUAL:
            raise LinearFailed(f"a linear system is solved to {left:.1e} only; {LINEAR_RESIDUAL:g} is needed")
        self.worst = max(self.worst, left)
        return x

    def _refined(self, right: Array) -> tuple[Array, float]:
        """Solution, and its residual."""
        x = self._by_factor(right)
        left, remainder = self._residual(x, right)
        for _ in range(MOST_REFINEMENTS):
            if not left > ROUGH.get(self.way, ROUNDING):
                break
            better = x + self._by_factor(remainder)
            new, other = self._residual(better, right)
            if not new < 0.5 * left:
                break
            self.counts["refinements"] += 1
            x, left, remainder = better, new, other
        return x, left

    def _residual(self, x: Array, right: Array) -> tuple[float, Array]:
        """Residual of a solution, relative to the sizes of its terms, and what is left over."""
        assert self.matrix is not None
        remainder = right - self.matrix @ x
        scales = scales_of(self.sizes, x, right, self.kinds, self.least)
        return float(np.max(np.abs(relative(remainder, scales, self.kinds)), initial=0.0)), remainder


class Pattern(NamedTuple):
    """Where a matrix has entries.

    Attributes
    ----------
    indices, indptr : array of int
        By columns.
    pairs : array of int8
        Of each entry the kinds of its row and of its column together: 0 of forces by velocities, 1 of mixed ones.
    """

    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    pairs: NDArray[np.int8]

    def fits(self, matrix: csc_matrix) -> bool:
        """Whether a matrix has this pattern."""
        return np.array_equal(matrix.indptr, self.indptr) and np.array_equal(matrix.indices, self.indices)


def _pattern(matrix: csc_matrix, kinds: Indices) -> Pattern:
    short = kinds.astype(np.int8)
    return Pattern(matrix.indices, matrix.indptr, short[matrix.indices] + np.repeat(short, np.diff(matrix.indptr)))


def _with_entries(matrix: csc_matrix, entries: Array) -> csc_matrix:
    """A matrix of the same pattern, of which no copy is made."""
    return csc_matrix((entries, matrix.indices, matrix.indptr), shape=matrix.shape)


def _balance(sizes: Array, pairs: NDArray[np.int8]) -> Array:
    """Units of velocity and pressure in which their blocks are alike, whatever those of the scene: two numbers.

    Powers of two, so that no digit changes.
    """
    forces = float(np.max(sizes * (pairs == 0), initial=0.0))
    mixed = float(np.max(sizes * (pairs == 1), initial=0.0))
    if not forces:
        return np.ones(2)
    units = [-np.log2(forces) / 2, np.log2(forces) / 2 - np.log2(mixed) if mixed else 0.0]
    return np.asarray(np.exp2(np.round(units)))


def _factor(matrix: csc_matrix, free: bool) -> Any:
    """SuperLU's factor, in the order that there is or, with all pivots free, in its own; None if it finds none."""
    from scipy.sparse.linalg import splu

    if not matrix.shape[0]:
        return _Nothing()
    try:
        if free:
            return splu(matrix)
        return splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})
    except RuntimeError as error:
        if "singular" not in str(error):
            raise
        return None


class _Nothing:
    """Factor of a system without unknowns."""

    def solve(self, right: Array) -> Array:
        return right


def scales_of(sizes: Any, x: Array, right: Array, kinds: Indices, least: float = 0.0) -> Array:
    """Largest size of the terms of a row, of forces and of fluxes: what a residual is relative to, in any units.

    Fluxes are not told from rounding where they are as small as those of the velocities that SILENT of the largest
    force would make: without that, a fluid at rest would have to be so to all digits.

    Parameters
    ----------
    sizes : sparse matrix, shape (unknowns, unknowns)
        Those of the entries of a matrix.
    x, right : array, shape (unknowns,)
        Unknowns, and what else is in the rows.
    kinds : array of int, shape (unknowns,)
        0 of velocities, whose rows are forces; 1 of pressures, whose rows are fluxes.
    least : float
        Size of velocities below which they count as such.

    Returns
    -------
    array, shape (2,)
    """
    forces = kinds == 0
    size = np.maximum(np.abs(x), np.where(forces, least, 0.0))
    largest = float(np.max((sizes @ size + np.abs(right))[forces], initial=0.0))
    diagonal = sizes.diagonal()
    silent = np.divide(SILENT * largest, diagonal, out=np.zeros_like(diagonal), where=forces & (diagonal > 0))
    return np.array([largest, np.max((sizes @ np.maximum(size, silent))[~forces], initial=0.0)])


def relative(residual: Array, scales: Array, kinds: Indices) -> Array:
    """Residuals over the scale of their kind; inf where only this is 0, or where it is no number.

    Parameters
    ----------
    residual : array, shape (unknowns,)
    scales : array, shape (kinds,)
    kinds : array of int, shape (unknowns,)
        Kind of each.
    """
    scale = scales[kinds]
    found = np.divide(residual, scale, out=np.where(residual != 0, np.inf, 0.0), where=scale > 0)
    found[~np.isfinite(residual)] = np.inf
    return found
