"""Large linear systems of the flow: GMRES with a block-triangular preconditioner, from algebraic multigrid (pyamg).

Of the matrix [[F, G], [D, 0]] of velocities and pressures the preconditioner is [[F, G], [0, S]], with S that of the
pressures alone, -D F^-1 G. F^-1 is a cycle of multigrid by smoothed aggregation. S^-1 is by least squares,

    S^-1 ~ -(D M G)^-1 D M F M G (D M G)^-1 ,     M = diag(F)^-1 ,

as C is 0 for elements of Taylor and Hood (Elman, Howle, Shadid, Shuttleworth & Tuminaro, SIAM J. Sci. Comput. 27 (2006)
1651). D M G is inverted by some cycles, too: its factor would cost more than all else from 1e5 tetrahedra on.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, diags

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Residual that GMRES goes for, over that of zero; what is missing refinement gives.
GOAL = 1e-10
#: Vectors kept, and how often it starts anew.
RESTART, MOST_RESTARTS = 80, 4
#: Cycles that stand for (D M G)^-1, and a residual that ends none of them: what precedes GMRES must not change.
CYCLES, NEVER = 4, 1e-300
#: Free unknowns from which factors cost more, by dimension. In two dimensions their work grows with the power 1.5, and
#: GMRES takes twice as many iterations of four times the unknowns: there it is memory that ends them, at 17 GB.
LARGE = {2: 4_000_000, 3: 30_000}


def is_there() -> bool:
    """Whether pyamg is installed."""
    from importlib.util import find_spec

    return find_spec("pyamg") is not None


def block_solver(matrix: csc_matrix, kinds: Indices, motions: Array) -> BlockSolver | None:
    """Solver of a matrix; None if its preconditioner cannot be made, as of a matrix that is singular.

    Parameters
    ----------
    matrix : csc_matrix, shape (unknowns, unknowns)
    kinds : array of int, shape (unknowns,)
        0 of velocities, else of pressures.
    motions : array, shape (unknowns, axes)
        Even motions along each axis.
    """
    try:
        return BlockSolver(matrix, kinds, motions)
    except (ValueError, RuntimeError, np.linalg.LinAlgError):
        return None


class BlockSolver:
    """Solver of one matrix, as a factor is; its residual is to be looked at.

    Attributes
    ----------
    iterations : int
        Those of all solutions.
    """

    def __init__(self, matrix: csc_matrix, kinds: Indices, motions: Array) -> None:
        self.velocities, self.pressures = np.flatnonzero(kinds == 0), np.flatnonzero(kinds == 1)
        self.iterations = 0
        whole = csr_matrix(matrix)
        force = float(np.median(np.abs(whole.diagonal()[self.velocities])))
        coupling = abs(whole[self.velocities][:, self.pressures]).max()
        self.rows = np.where(kinds == 0, 1 / force, 1 / coupling)
        self.columns = np.where(kinds == 0, 1.0, force / coupling)
        self.matrix = csr_matrix(diags(self.rows) @ whole @ diags(self.columns))
        of_u, of_p = self.matrix[self.velocities], self.matrix[self.pressures]
        self.F, self.G = csr_matrix(of_u[:, self.velocities]), csr_matrix(of_u[:, self.pressures])
        self.D = csr_matrix(of_p[:, self.velocities])
        self.M = 1 / self.F.diagonal()
        laplacian = self.D @ diags(self.M) @ self.G
        # of an enclosed flow it is singular but for the pressure that is held
        self.inner = _multigrid(csr_matrix(laplacian + 1e-12 * diags(laplacian.diagonal())), None, CYCLES)
        self.cycle = _multigrid(self.F, motions[self.velocities], 1)

    def solve(self, right: Array) -> Array:
        """Solution, as far as GMRES comes."""
        from scipy.sparse.linalg import LinearOperator, gmres

        def count(_: float) -> None:
            self.iterations += 1

        scaled = self.rows * right
        if not scaled.any():
            return np.zeros_like(right)
        before = LinearOperator(self.matrix.shape, self._preconditioned, dtype=float)
        found, _ = gmres(
            self.matrix, scaled, M=before, rtol=GOAL, restart=RESTART, maxiter=MOST_RESTARTS, callback=count,
            callback_type="pr_norm",
        )  # fmt: skip
        return np.asarray(self.columns * found)

    def _preconditioned(self, right: Array) -> Array:
        found = np.empty_like(right)
        pressure = -self.inner(right[self.pressures])
        pressure = self.inner(self.D @ (self.M * (self.F @ (self.M * (self.G @ pressure)))))
        found[self.pressures] = pressure
        found[self.velocities] = self.cycle(right[self.velocities] - self.G @ pressure)
        return found


def _multigrid(matrix: csr_matrix, motions: Array | None, cycles: int) -> Callable[[Array], Array]:
    """Some cycles of multigrid, whose smooth errors are even motions along each axis; of a scalar, constants."""
    from pyamg import smoothed_aggregation_solver

    smoother = ("gauss_seidel", {"sweep": "symmetric"})
    # it draws numbers of numpy's own to estimate eigenvalues: the same ones at any time
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(1)  # noqa: NPY002
    try:
        levels = smoothed_aggregation_solver(
            matrix, B=motions, symmetry="nonsymmetric", strength=("symmetric", {"theta": 0.0}), smooth="jacobi",
            presmoother=smoother, postsmoother=smoother, max_coarse=500,
        )  # fmt: skip
    finally:
        np.random.set_state(state)  # noqa: NPY002

    def solved(right: Array) -> Array:
        return np.asarray(levels.solve(right, tol=NEVER, maxiter=cycles, cycle="V"))

    return solved
