"""The linear systems of Newton's iteration: symmetric without tangential motion; blocks of particles and contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array
from scipy.sparse.linalg import LinearOperator, lobpcg, splu

from softdyn.particles.portions import gathering

Array = NDArray[np.float64]
Integers = NDArray[np.signedinteger[Any]]

#: What Krylov's methods leave of a residual, where nothing else is asked: Newton's iteration corrects it.
TOLERANCE = 1e-2
MOST_ITERATIONS = 2000
#: Nonzeros of a factor beyond which there is none: 1 GB, and as much again for the copy that scipy keeps of it, once
#: its pivots are looked at.
LARGEST_FACTOR = 40_000_000
#: Nanoseconds of some machine for each nonzero or multiplication: what is chosen must not depend on a clock, since the
#: same scene gives the same result; ratios matter, and to a factor of two at most.
PER_PRODUCT, PER_BLOCK, PER_ITERATION = 1.0, 3.0, 25_000.0
PER_FACTOR, PER_FACTOR_NONZERO, PER_FACTOR_PRODUCT, PER_SOLVED_NONZERO = 200_000.0, 30.0, 0.2, 2.0
#: Solutions for which a factor serves, before that is known.
SOLUTIONS = 8


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
    indptr: Integers
    indices: Integers
    diagonal: Integers
    upper: Integers
    lower: Integers
    i: Integers
    j: Integers
    pair: NDArray[np.bool_]

    @property
    def single(self) -> bool:
        """Whether each pair of particles has one contact: two, through different images, share a place."""
        return len(self.indices) == self.count + 2 * len(self.upper)

    @cached_property
    def sums(self) -> tuple[csr_array, csr_array]:
        """What sums over the contacts of each particle, as the first and as the second."""
        return gathering(self.i, self.count), gathering(self.j, self.count)


def pattern_of(count: int, i: Integers, j: Integers) -> Pattern:
    """Pattern of a list of contacts between ``count`` particles; partners from ``count`` on are walls.

    Parameters
    ----------
    count : int
    i, j : array of int, shape (contacts,)
        The partners.
    """
    pair = j < count
    a, b = i[pair].astype(np.int64), j[pair].astype(np.int64)
    own = np.arange(count)
    keys = np.concatenate([own * count + own, a * count + b, b * count + a])
    places, where = np.unique(keys, return_inverse=True)
    rows, indices = np.divmod(places, count)
    diagonal, upper, lower = np.split(where, [count, count + len(a)])
    indptr = np.searchsorted(rows, np.arange(count + 1))
    return Pattern(
        count,
        indptr.astype(np.int32),
        indices.astype(np.int32),
        diagonal.astype(np.int32),
        upper.astype(np.int32),
        lower.astype(np.int32),
        i,
        j,
        pair,
    )


def assemble(
    pattern: Pattern, component: Callable[[int, int], Array], own: Array, fixed: NDArray[np.bool_]
) -> bsr_array:
    """Matrix from the stiffness of each contact and what resists each particle by itself.

    Parameters
    ----------
    pattern : Pattern
    component : function of two axes
        That component of the symmetric block of each contact, shape (contacts,): added to the diagonal blocks of both
        particles, taken from those off the diagonal. One at a time, since all of them take much memory.
    own : array, shape (N, d), or (N, d, d)
        Added to the diagonal of the matrix, or to the blocks there.
    fixed : array of bool, shape (N, d)
        Unknowns that are none: their rows and columns become those of the unit matrix, scaled.
    """
    d = own.shape[1]
    data = np.zeros((len(pattern.indices), d, d))
    every = bool(pattern.pair.all())
    of_i, of_j = pattern.sums
    for a in range(d):
        for b in range(a, d):
            values, place = component(a, b), data[:, a, b]
            between = values if every else values[pattern.pair]
            if pattern.single:
                place[pattern.upper] = place[pattern.lower] = -between
            else:
                np.subtract.at(place, pattern.upper, between)
                np.subtract.at(place, pattern.lower, between)
            place[pattern.diagonal] = of_i @ values + of_j @ values
            data[:, b, a] = place
    _add_own(pattern, data, own)
    return _finished(pattern, data, fixed)


def _add_own(pattern: Pattern, data: Array, own: Array) -> None:
    if own.ndim == 3:
        data[pattern.diagonal] += own
        return
    for a in range(own.shape[1]):
        data[pattern.diagonal, a, a] += own[:, a]


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


def assemble_quarters(pattern: Pattern, quarters: Iterable[Array], own: Array, fixed: NDArray[np.bool_]) -> bsr_array:
    """Matrix of which the blocks of a contact are given one by one: ii, ij, ji, jj; else as :func:`assemble`.

    Parameters
    ----------
    pattern : Pattern
    quarters : iterable of array, shape (contacts, w, w)
        Blocks ii, ij, ji, jj, force over length.
    own : array, shape (N, w) or (N, w, w)
        Of each coordinate, or of each particle, by itself.
    fixed : array of bool, shape (N, w)
        Coordinates that do not follow from forces.
    """
    width = own.shape[1]
    data = np.zeros((len(pattern.indices), width, width))
    of_i, of_j = pattern.sums
    every = bool(pattern.pair.all())
    ends = ((of_i, pattern.diagonal), (None, pattern.upper), (None, pattern.lower), (of_j, pattern.diagonal))
    for (sums, place), block in zip(ends, quarters, strict=True):
        if sums is not None:
            data[place] += (sums @ block.reshape(len(block), width**2)).reshape(-1, width, width)
            continue
        between = block if every else block[pattern.pair]
        if pattern.single:
            data[place] = between
        else:
            np.add.at(data, place, between)
    _add_own(pattern, data, own)
    return _finished(pattern, data, fixed)


@dataclass(frozen=True)
class Factor:
    """A factorised matrix.

    Attributes
    ----------
    solve : function of a right-hand side
    nonzeros : int
        Of L.
    products : float
        Multiplications that it took.
    """

    solve: Callable[[Array], Array]
    nonzeros: int
    products: float

    @property
    def cost(self) -> float:
        """Of making it."""
        return PER_FACTOR + PER_FACTOR_NONZERO * self.nonzeros + PER_FACTOR_PRODUCT * self.products

    @property
    def cost_of_solution(self) -> float:
        """Of using it once."""
        return PER_SOLVED_NONZERO * self.nonzeros


@dataclass
class Solver:
    """Solves one linear system after another, each close to the one before.

    A system is solved by Krylov's method, preconditioned by its blocks on the diagonal or by the factor of an earlier
    one, or by its own factor: whichever costs least, by counts of operations. A factor is replaced as a machine is that
    wears out: when the next solution costs more than the average over its life, its making included.

    Attributes
    ----------
    d, width : int
        Dimension of space, and unknowns of a particle.
    symmetric : bool
    certain : bool
        Whether each matrix is factorised (as long as it is not too large), so that no direction is missed along which
        nothing resists.
    matrix : bsr_array or None
        The present one.
    factor : Factor or None
    recalls : bool
        Whether the matrix that the factor is of is kept: a run that goes on from a file makes the factor again.
    factored : bsr_array or None
        That matrix.
    exact : bool
        Whether that is the present one, not an earlier one.
    by_blocks : float
        Cost of the last solution without a factor; 0 before there is any.
    spent, solutions, last : float, int, float
        Cost of all solutions with the factor and of making it, their number, cost of the last one.
    counts : dict
        ``factorisations`` and ``krylov``, iterations of Krylov's methods.
    """

    d: int
    width: int
    symmetric: bool = True
    certain: bool = False
    matrix: bsr_array | None = None
    factor: Factor | None = None
    recalls: bool = False
    factored: bsr_array | None = None
    exact: bool = False
    by_blocks: float = 0.0
    spent: float = 0.0
    solutions: int = 0
    last: float = 0.0
    counts: dict[str, int] = field(default_factory=lambda: {"factorisations": 0, "krylov": 0})
    _precondition: Callable[[Array], Array] | None = None

    @property
    def method(self) -> str:
        """Words for what the last solution was found by."""
        krylov = "conjugate gradients" if self.symmetric else "BiCGStab"
        if self.factor is None:
            return f"{krylov}, preconditioned by blocks on the diagonal" if self.by_blocks else ""
        direct = "sparse LDL^T" if self.symmetric else "sparse LU"
        return direct if self.exact else f"{krylov}, preconditioned by {direct}"


def prepare(solver: Solver, matrix: bsr_array) -> None:
    """Take a matrix to solve with.

    Raises
    ------
    Indefinite
        Where a factorisation, or a block on the diagonal, shows a direction along which nothing resists.
    """
    solver.matrix, solver.exact, solver._precondition = matrix, False, None
    if _is_worth_a_factor(solver):
        _factorise(solver)


def solve(solver: Solver, b: Array, tolerance: float = TOLERANCE) -> Array:
    """Solution of the present system, to a residual of ``tolerance`` at most, relative to b; of the shape of b.

    Parameters
    ----------
    solver : Solver
    b : array
        Right side, of as many numbers as the matrix has rows.
    tolerance : float

    Raises
    ------
    Indefinite
        As :func:`prepare`, and where conjugate gradients meet a direction of negative curvature.
    """
    assert solver.matrix is not None
    if solver.factor is not None and solver.exact:
        _count(solver, solver.factor.cost_of_solution)
        return solver.factor.solve(b)
    iterate = conjugate_gradients if solver.symmetric else stabilised
    if solver.factor is None:
        if solver._precondition is None:
            solver._precondition = block_diagonal(solver.matrix, solver.width, definite=solver.symmetric)
        precondition, each = solver._precondition, PER_BLOCK * solver.width * solver.matrix.shape[0]
    else:
        precondition, each = solver.factor.solve, solver.factor.cost_of_solution
    each += PER_PRODUCT * solver.matrix.data.size + PER_ITERATION
    each *= 1 if solver.symmetric else 2
    expected = _expected(solver)
    most = MOST_ITERATIONS
    if expected.nonzeros <= LARGEST_FACTOR:
        most = min(most, 1 + int(expected.cost / each))
    x, iterations, done = iterate(solver.matrix, precondition, b, solver.width, tolerance, most)
    solver.counts["krylov"] += iterations
    _count(solver, iterations * each)
    if not done and most < MOST_ITERATIONS:
        _factorise(solver)
        return solve(solver, b)
    return x


def _count(solver: Solver, cost: float) -> None:
    if solver.factor is None:
        solver.by_blocks = cost
    else:
        solver.spent, solver.solutions, solver.last = solver.spent + cost, solver.solutions + 1, cost


def _expected(solver: Solver) -> Factor:
    """What a factor would cost: as the last one, or as fits packings of spheres."""
    assert solver.matrix is not None
    if solver.factor is not None:
        return solver.factor
    size = solver.matrix.shape[0]
    count = size / solver.width
    # blocks in a row of L
    blocks = {1: 3.0, 2: max(3.0, 2.75 * math.log2(count) - 5), 3: max(3.0, count ** (2 / 3))}[solver.d]
    row = solver.width * blocks
    return Factor(lambda b: b, int(size * row), 2.3 * size * row**2)


def _is_worth_a_factor(solver: Solver) -> bool:
    expected = _expected(solver)
    if expected.nonzeros > LARGEST_FACTOR:
        return False
    if solver.certain:
        return True
    if solver.factor is None:
        return solver.by_blocks > expected.cost / SOLUTIONS + expected.cost_of_solution
    average = solver.spent / solver.solutions if solver.solutions else math.inf
    if solver.last <= average:
        return False
    if solver.by_blocks < average:
        solver.factor = solver.factored = None
        return False
    solver.by_blocks *= 0.8  # what was found long ago is tried again one day
    return True


def _factorise(solver: Solver) -> None:
    assert solver.matrix is not None
    solver.factor = solver.factored = None  # not two at a time
    solver.factor = direct(solver.matrix, solver.width)
    solver.factored, solver.exact = solver.matrix if solver.recalls else None, True
    solver.counts["factorisations"] += 1
    solver.spent, solver.solutions, solver.last = solver.factor.cost, 0, 0.0


def direct(matrix: bsr_array, width: int) -> Factor:
    """Factorise a matrix that is symmetric, or nearly.

    The part of a matrix that is not symmetric comes with the change of the tangential forces along the distance, and is
    small where little slides in a step. So pivots stay on the diagonal, and their signs still tell where nothing
    resists.

    Raises
    ------
    Indefinite
    """
    size = matrix.shape[0]
    rows = matrix.tocsr()
    # its rows are the columns of the transposed one: SuperLU solves with a factor's transpose in less time
    transposed = csc_array((rows.data, rows.indices, rows.indptr), shape=rows.shape)
    try:
        # pivots from the diagonal, as the matrix is symmetric: then the signs of U's are those of the eigenvalues
        factor = splu(transposed, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # a pivot is exactly zero
        raise Indefinite(lambda: _softest(matrix).reshape(-1, width)) from None
    upper = factor.U
    pivots = upper.diagonal()
    small = 1e-13 * float(np.abs(rows.diagonal()).max(initial=0.0))
    if not np.array_equal(factor.perm_r, factor.perm_c) or not float(pivots.min()) > small:
        raise Indefinite(lambda: _softest(matrix).reshape(-1, width))
    columns = np.diff(upper.indptr).astype(float)

    def solve(b: Array) -> Array:
        return np.asarray(factor.solve(b.reshape(size), trans="T").reshape(b.shape))

    return Factor(solve, upper.nnz, float(columns @ columns))


def _softest(matrix: bsr_array) -> Array:
    """Direction of the lowest eigenvalue of a matrix that is not positive definite."""
    size = matrix.shape[0]
    if size <= 600:
        return np.linalg.eigh(matrix.toarray())[1][:, 0]
    start = np.random.default_rng(0).standard_normal((size, 1))
    diagonal = np.abs(matrix.diagonal())
    scaled = LinearOperator((size, size), matvec=lambda v: v.reshape(-1) / np.maximum(diagonal, 1e-300))
    _, vectors = lobpcg(matrix, start, M=scaled, largest=False, maxiter=200, tol=1e-6)
    return np.asarray(vectors[:, 0])


def block_diagonal(matrix: bsr_array, width: int, definite: bool = True) -> Callable[[Array], Array]:
    """Preconditioner by the inverse of each particle's own block.

    Parameters
    ----------
    matrix : bsr_array, shape (N width, N width)
    width : int
        Of a block.
    definite : bool

    Raises
    ------
    Indefinite
        If one of them is not positive definite, and ``definite`` asks for it.
    """
    count = matrix.shape[0] // width
    rows = np.repeat(np.arange(count), np.diff(matrix.indptr))
    own = matrix.data[rows == matrix.indices]
    if definite:
        try:
            np.linalg.cholesky(own)
        except np.linalg.LinAlgError:
            lowest, directions = np.linalg.eigh(own)
            worst = int(np.argmin(lowest[:, 0]))
            direction = np.zeros((count, width))
            direction[worst] = directions[worst, :, 0]
            raise Indefinite(lambda: direction) from None
    inverse = np.linalg.inv(own)

    def precondition(v: Array) -> Array:
        return np.asarray(np.einsum("iab,ib->ia", inverse, v.reshape(count, width)).reshape(-1))

    return precondition


def conjugate_gradients(
    matrix: bsr_array, precondition: Callable[[Array], Array], b: Array, width: int, tolerance: float, most: int
) -> tuple[Array, int, bool]:
    """Conjugate gradients; returns x, the number of iterations, and whether the tolerance is met.

    Parameters
    ----------
    matrix : bsr_array, shape (N width, N width)
    precondition : function of an array
        Multiplies by an approximate inverse.
    b : array
        Right side, of as many numbers as the matrix has rows.
    width : int
        Of a block.
    tolerance : float
        Norm of the residual over that of b.
    most : int
        Iterations.

    Raises
    ------
    Indefinite
    """
    x, residual = np.zeros(b.size), b.reshape(-1).copy()
    goal = tolerance**2 * _inner(residual, residual)
    direction = np.zeros(b.size)
    before = 1.0
    for iteration in range(most + 1):
        if _inner(residual, residual) <= goal:
            return x.reshape(b.shape), iteration, True
        towards = precondition(residual)
        now = _inner(residual, towards)
        direction = towards + now / before * direction
        before = now
        image = matrix @ direction
        curvature = _inner(direction, image)
        if not curvature > 0:
            raise Indefinite(partial(np.reshape, direction, (-1, width)))
        x += now / curvature * direction
        residual -= now / curvature * image
    return x.reshape(b.shape), most, False


def stabilised(
    matrix: bsr_array, precondition: Callable[[Array], Array], b: Array, width: int, tolerance: float, most: int
) -> tuple[Array, int, bool]:
    """Van der Vorst's BiCGStab; as :func:`conjugate_gradients`.

    Parameters
    ----------
    matrix : bsr_array, shape (N width, N width)
    precondition : function of an array
        Multiplies by an approximate inverse.
    b : array
        Right side, of as many numbers as the matrix has rows.
    width : int
        Of a block.
    tolerance : float
        Norm of the residual over that of b.
    most : int
        Iterations.
    """
    x, residual = np.zeros(b.size), b.reshape(-1).copy()
    shadow, direction, image = residual.copy(), np.zeros(b.size), np.zeros(b.size)
    goal = tolerance**2 * _inner(residual, residual)
    before = length = weight = 1.0
    for iteration in range(most + 1):
        if _inner(residual, residual) <= goal:
            return x.reshape(b.shape), iteration, True
        now = _inner(shadow, residual)
        direction = residual + now / before * length / weight * (direction - weight * image)
        towards = precondition(direction)
        image = matrix @ towards
        along = _inner(shadow, image)
        if now == 0 or along == 0:  # broken down: Newton's iteration corrects what is left, or says that it cannot
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
    return x.reshape(b.shape), most, False


def _inner(a: Array, b: Array) -> float:
    """Product, not by the BLAS, whose threads cost more than it."""
    return float(np.einsum("i,i->", a, b))
