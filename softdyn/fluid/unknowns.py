"""Which unknowns of the flow are free, and in which order they are solved for.

All unknowns x follow from the free ones y: x = basis y + offset. A fixed unknown has a row of zeros in the basis; where
the velocity along a normal is given, as at a wall with slip, the free ones of that node are the velocities along the
tangents. The residual of the free ones is basis^T R, its matrix basis^T J basis; what is left in R is the reaction: the
force by which a boundary keeps the velocity that it gives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

from softdyn.fluid.linear_solvers import dissected

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Sine of the angle between normals that are one direction.
PARALLEL = 1e-9


@dataclass(frozen=True)
class Unknowns:
    """The unknowns of a flow.

    Attributes
    ----------
    kinds : array of int, shape (unknowns,)
        0 of velocities, whose rows are forces; 1 of pressures, whose rows are fluxes.
    basis : sparse matrix, shape (unknowns, free ones)
        Its columns stand in the order in which a factor is taken.
    free_kinds : array of int, shape (free ones,)
    starts : array of int
        First of the free ones in each part that is eliminated at once, and their count.
    entries : array of int, or None
        Entries of the whole matrix that make the one of the free unknowns, where no column of the basis has two.
    indices, indptr : array of int
        Its pattern, by columns, with ``entries``.
    lift : sparse matrix, shape (unknowns, given values)
        What a given value adds to the unknowns.
    """

    kinds: Indices
    basis: csr_matrix
    free_kinds: Indices
    starts: Indices
    lift: csr_matrix
    entries: Indices | None = None
    indices: Indices | None = None
    indptr: Indices | None = None

    def all_of(self, y: Array, values: Array) -> Array:
        """All unknowns, of the free ones and the given values."""
        x: Array = self.basis @ y + self.lift @ values
        return x

    def free_of(self, x: Array) -> Array:
        """Free unknowns of all of them: the basis is orthonormal."""
        y: Array = self.basis.T @ x
        return y

    def free_matrix(self, matrix: csr_matrix) -> csc_matrix:
        """Matrix of the free unknowns."""
        count = self.basis.shape[1]
        if self.entries is None:
            return csc_matrix(self.basis.T @ matrix @ self.basis)
        return csc_matrix((matrix.data[self.entries], self.indices, self.indptr), shape=(count, count))


def unknowns_of(
    pattern: csr_matrix,
    kinds: Indices,
    places: Array,
    fixed: Indices,
    slipping: Indices,
    normals: Array,
) -> Unknowns:
    """Unknowns of a flow.

    Parameters
    ----------
    pattern : sparse matrix, shape (unknowns, unknowns)
        The matrix, or one of its pattern.
    kinds : array of int, shape (unknowns,)
    places : array, shape (unknowns, axes)
    fixed : array of int, shape (fixed,)
        Unknowns whose values are given, each once.
    slipping : array of int, shape (slipping, axes)
        Components of the velocity of each node whose velocity along a normal is given; a node may stand several times.
    normals : array, shape (slipping, axes)

    Returns
    -------
    Unknowns
        Its given values are those of the fixed, then those of the slipping.
    """
    count = len(kinds)
    open_ = np.ones(count, dtype=bool)
    open_[fixed] = False
    lift = [(fixed, np.arange(len(fixed)), np.ones(len(fixed)))]
    columns: list[tuple[Indices, Array]] = []
    for node in np.unique(slipping[:, 0]) if len(slipping) else ():
        rows = np.flatnonzero(slipping[:, 0] == node)
        own = slipping[rows[0]]
        if not open_[own].all():  # a node that is fixed as a whole does not slip
            continue
        open_[own] = False
        tangents, inverse = _tangents(normals[rows])
        columns += [(own, tangent) for tangent in tangents]
        a, b = np.meshgrid(own, len(fixed) + rows, indexing="ij")
        lift.append((a.ravel(), b.ravel(), inverse.ravel()))
    single = np.flatnonzero(open_)
    row = np.concatenate([single, *(own for own, _ in columns)])
    column = np.concatenate(
        [np.arange(len(single)), *(np.full(len(own), len(single) + k) for k, (own, _) in enumerate(columns))]
    )
    value = np.concatenate([np.ones(len(single)), *(tangent for _, tangent in columns)])
    size = len(single) + len(columns)
    basis = csr_matrix(coo_matrix((value, (row, column)), shape=(count, size)))
    first = np.concatenate([single, np.array([own[0] for own, _ in columns], dtype=np.int64)])
    order, starts = _order(
        csr_matrix((np.ones(pattern.nnz), pattern.indices, pattern.indptr), pattern.shape),
        basis,
        places[first],
        kinds[first],
    )
    basis = csr_matrix(basis[:, order])
    given = [np.concatenate(parts) for parts in zip(*lift, strict=True)]
    lifted = csr_matrix(coo_matrix((given[2], (given[0], given[1])), shape=(count, len(fixed) + len(slipping))))
    if columns:
        return Unknowns(kinds, basis, kinds[first][order], starts, lifted)
    numbered = csr_matrix((np.arange(1.0, pattern.nnz + 1), pattern.indices, pattern.indptr), pattern.shape)
    taken = csc_matrix(numbered[single[order]][:, single[order]])
    taken.sort_indices()
    entries = np.rint(taken.data).astype(np.int64) - 1
    return Unknowns(kinds, basis, kinds[first][order], starts, lifted, entries, taken.indices, taken.indptr)


def _tangents(normals: Array) -> tuple[Array, Array]:
    """Directions in which a node is free, shape (free, axes), and its velocity by those along its normals."""
    _, sizes, right = np.linalg.svd(normals)
    tangents: Array = right[int(np.sum(sizes > PARALLEL * sizes[0])) :]
    return tangents, np.asarray(np.linalg.pinv(normals, rcond=PARALLEL), dtype=float)


def _order(pattern: csr_matrix, basis: csr_matrix, places: Array, kinds: Indices) -> tuple[Indices, Indices]:
    """Order of the free unknowns, and where parts of it start that are eliminated at once.

    It is by nested dissection of their nodes, at each node velocities before the pressure.
    """
    _, node = np.unique(np.column_stack([places]), axis=0, return_inverse=True)
    node = np.asarray(node).ravel()
    nodes = int(node.max()) + 1 if len(node) else 0
    where = np.zeros((nodes, places.shape[1]))
    where[node] = places
    of_node = csr_matrix((np.ones(len(node)), (node, np.arange(len(node)))), shape=(nodes, len(node)))
    held = of_node @ abs(basis).T
    graph = csr_matrix(held @ pattern @ held.T)
    rank = np.empty(nodes, dtype=np.int64)
    dissection, starts = dissected(csr_matrix(graph + graph.T), where)
    rank[dissection] = np.arange(nodes)
    order = np.lexsort((kinds, rank[node]))
    return order, np.searchsorted(rank[node][order], starts)
