"""The linear systems of Newton's iteration: symmetric without tangential motion; blocks of particles and contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import LinearOperator, splu

Array = NDArray[np.float64]

#: Unknowns up to which a sparse factorisation is faster than conjugate gradients, in two dimensions and in three.
LARGEST_DIRECT = {1: 100_000, 2: 40_000, 3: 6_000}
#: Newton's iteration corrects what conjugate gradients leave.
CG_TOLERANCE = 1e-3
CG_ITERATIONS = 2000


class Indefinite(Exception):
    """The matrix has a direction along which nothing resists; ``direction()`` finds one, shape (N, d)."""

    def __init__(self, direction: Callable[[], Array]) -> None:
        super().__init__("the matrix is not positive definite")
        self.direction = direction


@dataclass(frozen=True)
class Pattern:
    """Where the blocks of the contacts go in a block-sparse matrix.

    Attributes
    ----------
    indptr, indices : array of int
        Rows of blocks.
    diagonal : array, shape (N,)
        Place of each particle's own block.
    upper, lower : array, shape (pairs,)
        Places of the blocks (i, j) and (j, i) of each pair of particles.
    i, j : array, shape (contacts,)
    pair : array of bool, shape (contacts,)
        Contacts of two particles, not of one and a wall.
    """

    count: int
    indptr: NDArray[np.int64]
    indices: NDArray[np.int64]
    diagonal: NDArray[np.int64]
    upper: NDArray[np.int64]
    lower: NDArray[np.int64]
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    pair: NDArray[np.bool_]


def pattern_of(count: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> Pattern:
    """Pattern of a list of contacts between ``count`` particles; partners from ``count`` on are walls."""
    pair = j < count
    a, b = i[pair], j[pair]
    own = np.arange(count)
    keys = np.concatenate([own * count + own, a * count + b, b * count + a])
    places, where = np.unique(keys, return_inverse=True)
    rows, indices = np.divmod(places, count)
    indptr = np.searchsorted(rows, np.arange(count + 1))
    return Pattern(
        count,
        indptr.astype(np.int32),
        indices.astype(np.int32),
        where[:count],
        where[count : count + len(a)],
        where[count + len(a) :],
        i,
        j,
        pair,
    )


def assemble(
    pattern: Pattern, component: Callable[[int, int], Array], diagonal: Array, fixed: NDArray[np.bool_]
) -> bsr_array:
    """Matrix from the stiffness of each contact and what resists each particle by itself.

    Parameters
    ----------
    pattern : Pattern
    component : function of two axes
        That component of the symmetric block of each contact, shape (contacts,): added to the diagonal blocks of both
        particles, taken from those off the diagonal. One at a time, since all of them take much memory.
    diagonal : array, shape (N, d)
        Added to the diagonal of the matrix.
    fixed : array of bool, shape (N, d)
        Unknowns that are none: their rows and columns become those of the unit matrix, scaled.
    """
    d = diagonal.shape[1]
    data = np.empty((len(pattern.indices), d, d))
    every = bool(pattern.pair.all())
    j = pattern.j if every else pattern.j[pattern.pair]
    for a in range(d):
        for b in range(a, d):
            values = component(a, b)
            between = values if every else values[pattern.pair]
            # two contacts between the same particles, through different images, share a place
            column = np.zeros(len(data))
            column -= np.bincount(pattern.upper, between, minlength=len(data))
            column -= np.bincount(pattern.lower, between, minlength=len(data))
            own = np.bincount(pattern.i, values, minlength=pattern.count)
            column[pattern.diagonal] = own + np.bincount(j, between, minlength=pattern.count)
            data[:, a, b] = data[:, b, a] = column
        data[pattern.diagonal, a, a] += diagonal[:, a]
    return _finished(pattern, data, fixed)


def _finished(pattern: Pattern, data: Array, fixed: NDArray[np.bool_]) -> bsr_array:
    """Take out the unknowns that are none."""
    d = data.shape[1]
    if fixed.any():
        rows = np.repeat(np.arange(pattern.count), np.diff(pattern.indptr))
        scale = max(float(np.abs(data[pattern.diagonal]).max(initial=0.0)), 1e-300)
        data[fixed[rows][:, :, None] | fixed[pattern.indices][:, None, :]] = 0.0
        for a in range(d):
            data[pattern.diagonal[fixed[:, a]], a, a] = scale
    size = pattern.count * d
    return bsr_array((data, pattern.indices, pattern.indptr), shape=(size, size))


def assemble_quarters(
    pattern: Pattern, quarters: Iterable[Array], diagonal: Array, fixed: NDArray[np.bool_]
) -> bsr_array:
    """Matrix of which the blocks of a contact are given one by one: ii, ij, ji, jj; else as :func:`assemble`."""
    width = diagonal.shape[1]
    data = np.zeros((len(pattern.indices), width, width))
    places = (pattern.diagonal[pattern.i], pattern.upper, pattern.lower, pattern.diagonal[pattern.j[pattern.pair]])
    for number, (place, block) in enumerate(zip(places, quarters, strict=True)):
        given = block if number == 0 else block[pattern.pair]
        for a in range(width):
            for b in range(width):
                data[:, a, b] += np.bincount(place, given[:, a, b], minlength=len(data))
    for a in range(width):
        data[pattern.diagonal, a, a] += diagonal[:, a]
    return _finished(pattern, data, fixed)


def solver(matrix: bsr_array, d: int) -> tuple[Callable[[Array], Array], str]:
    """Prepare solving with a matrix; returns the function and the name of the method.

    The function raises :class:`Indefinite` where conjugate gradients meet a direction of negative curvature, and so
    does this one where the factorisation shows one.
    """
    size = matrix.shape[0]
    if size <= LARGEST_DIRECT[d]:
        return direct(matrix, d), "sparse LDL^T"
    return conjugate_gradients(matrix, d), "conjugate gradients, block-diagonal preconditioner"


def unsymmetric_solver(matrix: bsr_array, d: int, width: int) -> tuple[Callable[[Array], Array], str]:
    """Prepare solving with a matrix that is nearly symmetric; as :func:`solver`.

    The part of it that is not symmetric comes with the change of the tangential forces along the distance, and is small
    where little slides in a step. So pivots stay on the diagonal, and their signs still tell where nothing resists.
    """
    if matrix.shape[0] <= LARGEST_DIRECT[d]:
        return direct(matrix, width), "sparse LU"
    return _stabilised(matrix, width), "BiCGStab, block-diagonal preconditioner"


def direct(matrix: bsr_array, d: int) -> Callable[[Array], Array]:
    size = matrix.shape[0]
    full = csc_array(matrix)
    try:
        # pivots from the diagonal, as the matrix is symmetric: then the signs of U's are those of the eigenvalues
        factor = splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # a pivot is exactly zero
        raise Indefinite(lambda: _softest(matrix).reshape(-1, d)) from None
    pivots = factor.U.diagonal()
    small = 1e-13 * float(np.abs(full.diagonal()).max(initial=0.0))
    if not np.array_equal(factor.perm_r, factor.perm_c) or not float(pivots.min()) > small:
        raise Indefinite(lambda: _softest(matrix).reshape(-1, d))

    def solve(b: Array) -> Array:
        return factor.solve(b.reshape(size)).reshape(b.shape)

    return solve


def _softest(matrix: bsr_array) -> Array:
    """Direction of the lowest eigenvalue of a matrix that is not positive definite."""
    size = matrix.shape[0]
    if size <= 600:
        return np.linalg.eigh(matrix.toarray())[1][:, 0]
    from scipy.sparse.linalg import lobpcg

    start = np.random.default_rng(0).standard_normal((size, 1))
    diagonal = np.abs(matrix.diagonal())
    scaled = LinearOperator((size, size), matvec=lambda v: v.reshape(-1) / np.maximum(diagonal, 1e-300))
    _, vectors = lobpcg(matrix, start, M=scaled, largest=False, maxiter=200, tol=1e-6)
    return vectors[:, 0]


def _inner(a: Array, b: Array) -> float:
    """Product, not by the BLAS, whose threads cost more than it."""
    return float(np.einsum("i,i->", a, b))


def _stabilised(matrix: bsr_array, width: int) -> Callable[[Array], Array]:
    """Van der Vorst's BiCGStab."""
    count = matrix.shape[0] // width
    rows = np.repeat(np.arange(count), np.diff(matrix.indptr))
    inverse = np.linalg.inv(matrix.data[rows == matrix.indices])

    def precondition(v: Array) -> Array:
        return np.einsum("iab,ib->ia", inverse, v.reshape(count, width)).reshape(-1)

    def solve(b: Array) -> Array:
        x, residual = np.zeros(b.size), b.reshape(-1).copy()
        shadow, direction, image = residual.copy(), np.zeros(b.size), np.zeros(b.size)
        goal = CG_TOLERANCE**2 * _inner(residual, residual)
        before = length = weight = 1.0
        for _ in range(CG_ITERATIONS):
            if _inner(residual, residual) <= goal:
                break
            now = _inner(shadow, residual)
            direction = residual + now / before * length / weight * (direction - weight * image)
            towards = precondition(direction)
            image = matrix @ towards
            along = _inner(shadow, image)
            if along == 0:  # broken down: Newton's iteration corrects what is left, or says that it cannot
                break
            length = now / along
            half = residual - length * image
            aside = precondition(half)
            turned = matrix @ aside
            size = _inner(turned, turned)
            weight = _inner(turned, half) / size if size > 0 else 0.0
            x += length * towards + weight * aside
            residual = half - weight * turned
            before = now
            if weight == 0:
                break
        return x.reshape(b.shape)

    return solve


def conjugate_gradients(matrix: bsr_array, d: int) -> Callable[[Array], Array]:
    count = matrix.shape[0] // d
    rows = np.repeat(np.arange(count), np.diff(matrix.indptr))
    own = matrix.data[rows == matrix.indices]
    if float(np.linalg.eigvalsh(own).min()) <= 0:
        worst = int(np.argmin(np.linalg.eigvalsh(own)[:, 0]))
        direction = np.zeros((count, d))
        direction[worst] = np.linalg.eigh(own[worst])[1][:, 0]
        raise Indefinite(lambda: direction)
    inverse = np.linalg.inv(own)

    def precondition(v: Array) -> Array:
        return np.einsum("iab,ib->ia", inverse, v.reshape(count, d)).reshape(-1)

    def solve(b: Array) -> Array:
        x, residual = np.zeros(b.size), b.reshape(-1).copy()
        goal = CG_TOLERANCE**2 * _inner(residual, residual)
        direction = np.zeros(b.size)
        before = 1.0
        for _ in range(CG_ITERATIONS):
            if _inner(residual, residual) <= goal:
                break
            towards = precondition(residual)
            now = _inner(residual, towards)
            direction = towards + now / before * direction
            before = now
            image = matrix @ direction
            curvature = _inner(direction, image)
            if not curvature > 0:
                raise Indefinite(partial(np.reshape, direction, (count, d)))
            x += now / curvature * direction
            residual -= now / curvature * image
        return x.reshape(b.shape)

    return solve
