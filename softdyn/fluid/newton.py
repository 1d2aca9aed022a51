"""Newton's method with the exact Jacobian, and a line search; its residual is reported, and must be met.

The residual of each row is counted relative to the largest sum of the sizes of the terms J_ij x_j of a row of its kind,
forces or fluxes, so that no unit matters. A factor serves, in later steps too, as long as the residual falls quickly
enough with it: what the last steps did to the residual is combined so that least of it is left, which is then solved
for (Washio & Oosterlee, Electron. Trans. Numer. Anal. 6 (1997) 271; of linear equations it is GMRES).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from softdyn.errors import IntegrationError
from softdyn.fluid.linear_solvers import LinearSolver, relative, scales_of
from softdyn.fluid.unknowns import Unknowns

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Residual that is gone for, and the one that must be met: between them lies rounding of large flows.
GOAL, MUST = 1e-13, 1e-10
MOST_ITERATIONS = 40
#: Shortest step along Newton's direction.
SHORTEST = 2.0**-12
#: Fall of the residual in one iteration from which a factor of an earlier matrix serves on: a factor costs as much as
#: some twelve solutions.
QUICK = 0.1
#: Steps with one factor that are combined.
MOST_COMBINED = 8


class NewtonFailed(IntegrationError):
    """Newton's method does not meet the residual.

    Attributes
    ----------
    row : int
        Of all unknowns, that whose residual is largest.
    measure : float
        The residual, relative.
    """

    def __init__(self, words: str, row: int, measure: float) -> None:
        super().__init__(words)
        self.row, self.measure = row, measure


class Equations(Protocol):
    """Equations of all unknowns x."""

    def residual(self, x: Array) -> Array:
        """The residual."""
        ...

    def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
        """The residual and its exact Jacobian."""
        ...


@dataclass(frozen=True)
class Solution:
    """Where the residual is met.

    Attributes
    ----------
    x, residual : array, shape (unknowns,)
        The residual of unknowns that are not free is the reaction of the boundary.
    measure : float
        Relative residual of the free ones.
    iterations : int
    scales : array, shape (2,)
        Largest sizes of forces and of fluxes, of the last matrix: what the residual is relative to.
    """

    x: Array
    residual: Array
    measure: float
    iterations: int
    scales: Array


def solve(
    equations: Equations,
    unknowns: Unknowns,
    solver: LinearSolver,
    x: Array,
    scales: Array | None = None,
    watch: Callable[[int, float], None] | None = None,
    goal: float = GOAL,
) -> Solution:
    """Solve equations, from a guess that has the given values.

    Parameters
    ----------
    equations : Equations
    unknowns : Unknowns
    solver : LinearSolver
    x : array, shape (unknowns,)
    scales : array, shape (2,), optional
        Those of a solution of equations like these, whose factor the solver holds and which may serve here.
    watch : function of (iteration, residual), optional
    goal : float
        Relative residual at which it ends.

    Raises
    ------
    NewtonFailed
        If the residual is not met.
    LinearFailed
        If a matrix is singular.
    """
    serves = scales is not None and solver.factor is not None
    residual, matrix = (equations.residual(x), None) if serves else equations.linearised(x)
    last, served = np.inf, Served()
    for iteration in range(MOST_ITERATIONS + 1):
        if matrix is not None:
            scales = scales_of(abs(matrix), x, residual, unknowns.kinds, solver.least)
        assert scales is not None
        free = unknowns.free_of(residual)
        measure = _largest(free, scales, unknowns.free_kinds)
        if watch is not None:
            watch(iteration, measure)
        if measure <= goal or (measure <= MUST and not measure < 0.5 * last):
            return Solution(x, residual, measure, iteration, scales)
        if iteration == MOST_ITERATIONS or not np.isfinite(measure):
            raise _failed("it does not converge", free, scales, measure, unknowns)
        last = measure
        if matrix is None:
            found = _full_step(equations, unknowns, solver, x, free, scales, served)
            if found is not None:
                x, residual = found
                continue
            residual, matrix = equations.linearised(x)
            scales = scales_of(abs(matrix), x, residual, unknowns.kinds, solver.least)
        solver.factorise(unknowns.free_matrix(matrix))
        step = -(unknowns.basis @ solver.solve(unknowns.free_of(residual)))
        better = _searched(equations, unknowns, x, step, free, scales)
        if better is None:
            if measure <= MUST:
                return Solution(x, residual, measure, iteration, scales)
            raise _failed("no step makes it smaller", free, scales, measure, unknowns)
        quick, served = better[2] < QUICK, Served()
        if quick:
            served.note(better[0] - x, relative(unknowns.free_of(better[1]) - free, scales, unknowns.free_kinds))
        x = better[0]
        residual, matrix = (better[1], None) if quick else equations.linearised(x)
    raise AssertionError


def _full_step(
    equations: Equations,
    unknowns: Unknowns,
    solver: LinearSolver,
    x: Array,
    free: Array,
    scales: Array,
    served: Served,
) -> tuple[Array, Array] | None:
    """A whole step with the factor of another matrix, and the residual there; None if that falls too slowly."""
    kinds = unknowns.free_kinds
    before = relative(free, scales, kinds)
    along, left = served.combined(before)
    new = x + along - unknowns.basis @ solver.approximate(left * scales[kinds])
    residual = equations.residual(new)
    after = relative(unknowns.free_of(residual), scales, kinds)
    with np.errstate(over="ignore"):
        fall = np.linalg.norm(after) / np.linalg.norm(before)
    if not fall < QUICK:
        return None
    served.note(new - x, after - before)
    return new, residual


class Served:
    """Steps with one factor, and what they did to the residual, relative: changes that are orthogonal, and of size 1.

    What they do to another residual is taken to be the same: so it is of linear equations.
    """

    def __init__(self) -> None:
        self.steps: list[Array] = []
        self.changes: list[Array] = []

    def combined(self, residual: Array) -> tuple[Array | float, Array]:
        """The sum of these steps that leaves least of a residual, and what it leaves."""
        along: Array | float = 0.0
        for step, change in zip(self.steps, self.changes, strict=True):
            part = change @ residual
            along, residual = along - part * step, residual - part * change
        return along, residual

    def note(self, step: Array, change: Array) -> None:
        """Add a step, and its change of the residual, without what is along earlier ones."""
        along, change = self.combined(change)
        size = float(np.linalg.norm(change))
        if size and np.isfinite(size):
            self.steps, self.changes = self.steps[1 - MOST_COMBINED :], self.changes[1 - MOST_COMBINED :]
            self.steps.append((step + along) / size)
            self.changes.append(change / size)


def _searched(
    equations: Equations, unknowns: Unknowns, x: Array, step: Array, free: Array, scales: Array
) -> tuple[Array, Array, float] | None:
    """Where along a step the residual falls enough, the residual there, and its fall; None if it does nowhere."""
    before, length = _norm(free, scales, unknowns.free_kinds), 1.0
    while length >= SHORTEST:
        new = x + length * step
        residual = equations.residual(new)
        after = _norm(unknowns.free_of(residual), scales, unknowns.free_kinds)
        if after <= (1 - 1e-4 * length) * before:
            return new, residual, after / before if length == 1 else 1.0
        length /= 2
    return None


def _norm(free: Array, scales: Array, kinds: Indices) -> float:
    with np.errstate(over="ignore"):
        return float(np.linalg.norm(relative(free, scales, kinds)))


def _largest(free: Array, scales: Array, kinds: Indices) -> float:
    return float(np.max(np.abs(relative(free, scales, kinds)), initial=0.0))


def _failed(words: str, free: Array, scales: Array, measure: float, unknowns: Unknowns) -> NewtonFailed:
    row = int(np.argmax(np.abs(relative(free, scales, unknowns.free_kinds))))
    return NewtonFailed(words, int(np.argmax(np.abs(unknowns.basis[:, [row]].toarray()))), measure)
