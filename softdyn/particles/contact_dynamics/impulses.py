"""Impulses of all contacts of a step together, with Signorini's law and Coulomb's at every contact.

Sweeps solve one contact after another (non-linear Gauss-Seidel), from the impulses of the step before. Their error
falls by a factor for each sweep that is near to 1 in a column or a dense packing: a column of n grains takes n^2 of
them. Newton's method on both laws' projections takes a few sparse factors instead, once the sweeps have told which
contacts are pressed and which slide. Which of the two goes on is chosen by what each is expected to cost, in counted
operations: the same scene takes the same way on every machine, and with any number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import splu

from softdyn.particles.contact_dynamics.rigid_kernel import RigidKernel
from softdyn.particles.geometry import dot
from softdyn.particles.linear import (
    PER_FACTOR,
    PER_FACTOR_NONZERO,
    PER_PRODUCT,
    PER_SOLVED_NONZERO,
    Pattern,
    pattern_of,
)

if TYPE_CHECKING:
    from softdyn.particles.contact_dynamics.loose_box import LooseBox

Array = NDArray[np.float64]
Integers = NDArray[np.int32]

#: Sweeps before anything is decided, of all at most, and after which those that get nowhere are damped.
FIRST_SWEEPS, MOST_SWEEPS, CIRCLING = 20, 20_000, 1_000
#: Steps of Newton's method, on the laws as they are and on smoothed ones: expected, and at most.
EXPECTED_STEPS, MOST_STEPS = {"exact": 5, "smoothed": 40}, {"exact": 15, "smoothed": 80}
KINDS = ("exact", "smoothed")
#: Steps at most without getting nearer.
MOST_WORSE = 4
#: What each step on smoothed laws takes of the smoothing at most, and how little of it is none.
SHARPER, SHARP = 0.2, 1e-14
#: How much an attempt tells of the odds of the next one, and their least.
LESSON, LONG_ODDS = 0.2, 0.02
#: Residual, relative to the largest impulse, at which Newton's method ends: it gets there at once from the tolerance.
NEWTON_ENDS = 1e-13
#: Weight of the proximal term: what of a change of impulses is put off to the next step is 1/rho of it, or less.
PROXIMAL = 1e8
#: Nonzeros of a factor, over those of the matrix, before there was one.
FILL = 4.0
#: Sweeps that go in circles, as they may where friction is large, are damped ever more, so many at a time, up to the
#: largest damping, and then again from none, twice as many at a time.
CIRCLE, MOST_DAMPING = 300, 128.0
#: Part of the error that a doubling of the sweeps leaves if they get nowhere; in a column it leaves less.
STALLED = 0.8
#: Change of the impulses that is none.
ROUNDING = 1e-12
#: Velocity at which contacts that must not close may do so, over the largest that there is.
CLOSING = 0.2


@dataclass(frozen=True)
class Problem:
    """The contacts of a step; nothing of it changes while it is solved, but for the rates of a box, and so the drifts.

    Attributes
    ----------
    kernel : RigidKernel
    first, second : array of int32, shape (n,)
        Bodies of each contact: grains, and from their number on walls.
    normals : array, shape (n, d)
        From the first to the second.
    drifts : array, shape (n, d)
        Velocity of the wall, or of the image of the second, beside its own.
    bounds : array, shape (n,)
        U_n + bound must not be negative: g/dt, or -e |U_n| before.
    mobilities : array, shape (n, 2)
    frictions : array, shape (n,)
    masses : array, shape (grains, width)
        Masses and I/R^2.
    free : array, shape (bodies, width)
        1 for velocities that are unknown, 0 for those that are given, as of walls.
    v : array, shape (bodies, width)
        Velocities at the end of the step if there were no contacts.
    box : LooseBox, optional
        The box, if its rates are unknown.
    """

    kernel: RigidKernel
    first: Integers
    second: Integers
    normals: Array
    drifts: Array
    bounds: Array
    mobilities: Array
    frictions: Array
    masses: Array
    free: Array
    v: Array
    box: LooseBox | None = None

    def __len__(self) -> int:
        return len(self.first)

    @cached_property
    def inverse(self) -> Array:
        """Inverse masses, 0 of what is given, shape (bodies, width)."""
        inverse = np.zeros_like(self.free)
        inverse[: len(self.masses)] = self.free[: len(self.masses)] / self.masses
        return inverse

    @cached_property
    def pattern(self) -> Pattern:
        """Pattern of Newton's matrix."""
        return pattern_of(len(self.masses), self.first, self.second)

    @cached_property
    def places(self) -> tuple[Integers, Integers, Integers]:
        """Places of the blocks of each body, and of each contact above and below the diagonal, 0 at walls."""
        pattern = self.pattern
        upper, lower = np.zeros((2, len(self)), np.int32)
        upper[pattern.pair], lower[pattern.pair] = pattern.upper, pattern.lower
        return pattern.diagonal, upper, lower

    @cached_property
    def laws(self) -> tuple[Array, ...]:
        """What the kernel takes of the laws of the contacts."""
        arrays = (self.normals, self.drifts, self.bounds, self.mobilities, self.frictions)
        return tuple(np.ascontiguousarray(array).reshape(-1) for array in arrays)

    def velocities(self, impulses: Array) -> Array:
        """Velocities of all bodies, with these impulses, shape (bodies, width)."""
        v = self.v.copy()
        given = (self.laws[0], impulses.reshape(-1), self.inverse.reshape(-1), v.reshape(-1))
        self.kernel.kicks(len(self), self.first, self.second, *given)
        return v

    def slips(self, v: Array) -> Array:
        """Velocities of the second body of each contact against the first, where they touch, shape (n, d)."""
        slips = np.empty_like(self.normals)
        self.kernel.slips(
            len(self), self.first, self.second, *self.laws[:2], np.ascontiguousarray(v).reshape(-1), slips.reshape(-1)
        )
        return slips

    @cached_property
    def speed(self) -> float:
        """Largest relative velocity that there would be without contacts, or that is asked for."""
        free = float(np.abs(self.slips(self.v)).max(initial=0.0))
        if self.box is not None:
            free = max(free, self.box.fastest())
        return max(free, float(np.abs(self.bounds[self.bounds < 0]).max(initial=0.0)))

    def closes(self, v: Array) -> bool:
        """Whether some contact closes that must not, by a velocity that is none of rounding.

        Where there is no solution, as for a grain between two others that are driven together, impulses grow without
        bound, and what they are off by vanishes beside them.
        """
        apart = dot(self.slips(v), self.normals) + self.bounds
        return bool(apart.min(initial=0.0) < -CLOSING * self.speed)

    def residual(self, impulses: Array, v: Array) -> tuple[float, int]:
        """How far the impulses are from both laws at the worst contact, relative to the largest; and which that is."""
        found = np.empty(2)
        which = self.kernel.residual(
            len(self), self.first, self.second, *self.laws, impulses.reshape(-1), v.reshape(-1), found
        )
        off = 0.0 if self.box is None else self.box.off(impulses)
        apart = float(found[0] / found[1]) if found[0] and found[1] else math.inf if found[0] else 0.0
        return max(apart, off), int(which)

    @cached_property
    def answers(self) -> Array:
        """What the contacts answer to the rates of the box."""
        assert self.box is not None
        return self.box.answers(self.mobilities)

    def lead(self, impulses: Array) -> float:
        """Let the rates of the box follow the impulses; by how much, relative to their size."""
        if self.box is None:
            return 0.0
        change = self.box.follow(impulses, self.answers)
        self.drifts[:] = self.box.drifts()
        return float(np.abs(change).max() / max(np.abs(self.box.rates).max(), 1e-300))


@dataclass
class Effort:
    """What solving has taken so far, in a run.

    Attributes
    ----------
    sweeps, newton_steps : int
    newton_solved, newton_failed : int
        Times that Newton's method did and did not get to the end.
    operations : float
        Of all of it, in counted operations.
    fill : float
        Nonzeros of the last factor over those of the matrix.
    odds, odds_smoothed : float
        How often, lately, Newton's method got to the end, on the laws as they are and on smoothed ones.
    """

    sweeps: int = 0
    newton_steps: int = 0
    newton_solved: int = 0
    newton_failed: int = 0
    operations: float = 0.0
    fill: float = FILL
    odds: float = 1.0
    odds_smoothed: float = 1.0

    def learn(self, kind: str, solved: bool) -> None:
        """Note how an attempt of Newton's method has ended."""
        self.newton_solved += solved
        self.newton_failed += not solved
        name = "odds" if kind == "exact" else "odds_smoothed"
        setattr(self, name, max(LONG_ODDS, (1 - LESSON) * getattr(self, name) + LESSON * solved))

    def told(self) -> dict[str, Any]:
        """Numbers for a result and a checkpoint."""
        return dict(vars(self))


@dataclass(frozen=True)
class Solution:
    """Impulses, and what they make of the velocities.

    Attributes
    ----------
    impulses : array, shape (n, d)
        On the second body of each contact.
    v : array, shape (bodies, width)
    residual : float
        Distance to the laws at the worst contact, relative to the largest impulse.
    worst : int
        That contact.
    converged : bool
    """

    impulses: Array
    v: Array
    residual: float
    worst: int
    converged: bool


@dataclass
class _Sweeping:
    """Gauss-Seidel's iteration, as it goes.

    Attributes
    ----------
    done : int
        Sweeps.
    error : float
        By how much the last half of them has changed a velocity, relative to the largest change by all impulses; or the
        residual of the last one, if that is larger.
    damping : float
        Factor of the mobilities that the projections take: of large ones they change less, and go in no circles.
    """

    impulses: Array
    v: Array
    done: int = 0
    error: float = math.inf
    damping: float = 1.0

    def left(self, tolerance: float) -> float:
        """How many sweeps are still to come: as many again for each power of ten, and more where there was none."""
        return self.done * max(1.0, math.log10(self.error / tolerance)) if 0 < self.error < math.inf else MOST_SWEEPS


def solve(problem: Problem, guess: Array, tolerance: float, effort: Effort) -> Solution:
    """Find the impulses of a step.

    Parameters
    ----------
    problem : Problem
    guess : array, shape (n, d)
        Impulses to start from.
    tolerance : float
        Residual that is allowed, relative to the largest impulse; and of sweeps error of a velocity, relative to the
        largest change by the impulses.
    effort : Effort
        What it took is added.
    """
    if not len(problem):
        problem.lead(guess)
        return Solution(guess, problem.v, 0.0, 0, True)
    impulses = np.ascontiguousarray(guess, dtype=float).copy()
    state = _Sweeping(impulses, problem.velocities(impulses))
    stubborn, batch = 1.0, 0
    per_sweep = len(problem) * problem.kernel.operations["sweep"] * PER_PRODUCT
    while state.done < MOST_SWEEPS:
        before = state.error
        _sweep(problem, state, min(batch or max(FIRST_SWEEPS, state.done), MOST_SWEEPS - state.done), tolerance, effort)
        if state.error <= tolerance and not problem.closes(state.v):
            break
        ahead = state.left(tolerance)
        for kind in KINDS if problem.box is None else ():
            odds = effort.odds if kind == "exact" else effort.odds_smoothed
            if stubborn * _newton_cost(problem, effort, kind) < odds * ahead * per_sweep:
                found = _newton(problem, state, kind, tolerance, effort)
                effort.learn(kind, found is not None)
                if found is not None:
                    return found
                stubborn *= 2
        if state.done >= CIRCLING and not state.error < STALLED * before:
            # impulses that are not unique may go in circles: how far they are from the laws counts
            if problem.residual(state.impulses, problem.velocities(state.impulses))[0] <= tolerance:
                break
            if not batch or state.damping >= MOST_DAMPING:
                batch, state.damping = 2 * batch or CIRCLE, 0.5
            # from where other sweeps lead Newton's method may get on
            state.damping, stubborn = 2 * state.damping, 1.0
    v = problem.velocities(state.impulses)
    residual, worst = problem.residual(state.impulses, v)
    converged = state.error <= tolerance or residual <= tolerance
    return Solution(state.impulses, v, residual, worst, converged and not problem.closes(v))


def _sweep(problem: Problem, state: _Sweeping, count: int, tolerance: float, effort: Effort) -> None:
    """Go on by some sweeps, and judge the error by what they have changed.

    The last change by itself would not tell: in a column of n grains it is smaller than the error by n^2.
    """
    changes, before, drifted = np.empty((count, 2)), state.v.copy(), problem.drifts.copy()
    done, led = 0, math.inf
    while done < count and led:
        # as many as there are, or two before the rates of the box follow
        most = count if problem.box is None else min(2, count - done)
        made = problem.kernel.sweeps(
            len(problem),
            most,
            ROUNDING,
            problem.first,
            problem.second,
            *problem.laws[:3],
            state.damping * problem.laws[3],
            problem.laws[4],
            problem.inverse.reshape(-1),
            state.impulses.reshape(-1),
            state.v.reshape(-1),
            changes[done:].reshape(-1),
        )
        done += made
        led = problem.lead(state.impulses)
        if made < most and led <= ROUNDING:
            break
    effort.sweeps += done
    effort.operations += done * len(problem) * problem.kernel.operations["sweep"]
    changed, largest = changes[done - 1]
    if not changed or done < count:
        state.error = 0.0
    else:
        moved, whole = float(np.abs(state.v - before).max()), float(np.abs(state.v - problem.v).max())
        moved = max(moved, float(np.abs(problem.drifts - drifted).max()))
        last = state.damping * float(changed / largest) if largest else math.inf
        state.error = max(moved / whole if whole else math.inf, last)
    state.done += done


def _newton_cost(problem: Problem, effort: Effort, kind: str) -> float:
    """What Newton's method is expected to cost, in the operations of the sweeps."""
    matrix = problem.kernel.width**2 * len(problem.pattern.indices)
    factor = PER_FACTOR + effort.fill * matrix * (PER_FACTOR_NONZERO + PER_SOLVED_NONZERO)
    return EXPECTED_STEPS[kind] * (factor + len(problem) * problem.kernel.operations["linearise"] * PER_PRODUCT)


def _newton(problem: Problem, state: _Sweeping, kind: str, tolerance: float, effort: Effort) -> Solution | None:
    """Newton's method from where the sweeps are; None if it does not get to the tolerance, with the best of it kept.

    Where the laws as they are do not lead there, smoothed ones may, ever less of it: a shock through a column closes
    contact after contact, and takes as many steps otherwise.
    """
    start = state.impulses
    path = {"exact": _as_they_are, "smoothed": _smoothed}[kind]
    best = _best(problem, path(problem, start.copy(), effort), tolerance)
    if not len(best.v) or problem.closes(best.v):
        return None
    if best.residual <= 1e-3 * tolerance:
        return Solution(best.impulses, best.v, best.residual, best.worst, True)
    if best.residual < problem.residual(start, problem.velocities(start))[0]:
        state.impulses, state.v = best.impulses, best.v
    return None


def _best(problem: Problem, steps: Iterator[tuple[Array, Array, bool]], tolerance: float) -> Solution:
    """The nearest to the laws of some steps, of which as many are made as have a use."""
    best = Solution(np.empty(0), np.empty(0), math.inf, 0, False)
    worse = 0
    for impulses, v, exact in steps:
        residual, worst = problem.residual(impulses, v)
        if residual < best.residual:
            best, worse = Solution(impulses, v, residual, worst, False), 0
        else:
            worse += exact
        if best.residual <= NEWTON_ENDS or worse >= (1 if best.residual <= tolerance else MOST_WORSE):
            break
    return best


def _as_they_are(problem: Problem, impulses: Array, effort: Effort) -> Iterator[tuple[Array, Array, bool]]:
    """Steps of Newton's method."""
    v = problem.velocities(impulses)
    for _ in range(MOST_STEPS["exact"]):
        found = _linearised(problem, impulses, v, 0.0)
        stepped = _newton_step(problem, found, v, effort)
        if stepped is None:
            return
        impulses, v = stepped
        yield impulses, v, True


def _smoothed(problem: Problem, impulses: Array, effort: Effort) -> Iterator[tuple[Array, Array, bool]]:
    """Steps of Newton's method on laws that are smoothed, at first over the largest impulse that there may be."""
    v = problem.velocities(impulses)
    momentum = problem.masses * np.abs(problem.v[: len(problem.masses)])
    soft = max(float(np.abs(impulses).max()), float(momentum.max()))
    least = SHARP * soft
    for _ in range(MOST_STEPS["smoothed"]):
        found = _linearised(problem, impulses, v, soft)
        if found.distance <= soft:
            soft = SHARPER * soft if soft > least else 0.0
            found = _linearised(problem, impulses, v, soft)
        stepped = _newton_step(problem, found, v, effort)
        if stepped is None:
            return
        impulses, v = stepped
        yield impulses, v, soft == 0.0


@dataclass(frozen=True)
class _Linear:
    """Newton's equations: P' = held - slopes (U' - U), the blocks of the matrix, and the right-hand side."""

    held: Array
    slopes: Array
    data: Array
    rest: Array
    distance: float


def _linearised(problem: Problem, impulses: Array, v: Array, soft: float) -> _Linear:
    kernel, n, pattern = problem.kernel, len(problem), problem.pattern
    d, width, count = kernel.dimension, kernel.width, len(problem.masses)
    held, slopes = np.empty((n, d)), np.empty((n, d, d))
    data, rest = np.zeros((len(pattern.indices), width, width)), np.zeros_like(v)
    own = np.arange(width)
    data[pattern.diagonal[:, None], own, own] = np.where(problem.free[:count] > 0, problem.masses, 1.0)
    distance = kernel.linearise(
        n,
        count,
        PROXIMAL,
        soft,
        problem.first,
        problem.second,
        *problem.laws,
        impulses.reshape(-1),
        v.reshape(-1),
        problem.free.reshape(-1),
        *problem.places,
        held.reshape(-1),
        slopes.reshape(-1),
        data.reshape(-1),
        rest.reshape(-1),
    )
    return _Linear(held, slopes, data, rest, float(distance))


def _newton_step(problem: Problem, found: _Linear, v: Array, effort: Effort) -> tuple[Array, Array] | None:
    """One step: the impulses, on Coulomb's cones, and the velocities; None where the matrix is singular."""
    kernel, pattern, count = problem.kernel, problem.pattern, len(problem.masses)
    size = count * kernel.width
    rows = bsr_array((found.data, pattern.indices, pattern.indptr), shape=(size, size)).tocsr()
    effort.newton_steps += 1
    try:
        # rows of the matrix are the columns of its transpose
        factor = splu(
            csc_array((rows.data, rows.indices, rows.indptr), shape=rows.shape),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.1,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
    effort.fill = float(factor.nnz) / rows.nnz
    effort.operations += len(problem) * kernel.operations["linearise"]
    effort.operations += factor.nnz * (PER_FACTOR_NONZERO + PER_SOLVED_NONZERO)
    change = np.zeros_like(v)
    change[:count] = factor.solve(found.rest[:count].reshape(-1), "T").reshape(count, kernel.width)
    if not np.isfinite(change).all():
        return None
    impulses = np.empty_like(found.held)
    kernel.follow(
        len(problem),
        problem.first,
        problem.second,
        problem.laws[0],
        problem.laws[4],
        found.held.reshape(-1),
        found.slopes.reshape(-1),
        change.reshape(-1),
        impulses.reshape(-1),
    )
    return impulses, problem.velocities(impulses)
