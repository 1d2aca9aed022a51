"""Balance of all forces at an implicit stage: positions and gaps, found together.

Positions x and gaps h obey, with n from i to j (eqs. 1 and 7 of Rognon & Gay, arXiv 0803.1573)::

    Z (dx_i/dt - u(x_i)) + sum_j F_ij n_ij = F_i^ext ,      zeta dh/dt = -(F_ela - F_adh)

The generated kernel solves each contact's gap at given positions, and gives F and dF/dr; Newton's iteration for the
positions has the blocks -(dF/dr) n n^T - (F/r)(1 - n n^T) of the contacts and Z/(gamma dt) on the diagonal. Without
drag, Z = 0, positions are algebraic: the elastic equilibrium at the given gaps. Then a free cluster may be moved as a
whole at no cost; its mean velocity is set to zero, and the line between two of its particles does not turn. External
forces that would turn it are refused, and what rounding leaves of their torque is taken away.

With tangential motion, :mod:`softdyn.particles.mechanisms.sliding`, a particle's rotation stands beside its position:
coordinates (x, R theta) with theta counted from the start of the step, forces (force, torque/R). Without it nothing
below has more than positions. What resists, and what integrates numbers of its own, the mechanisms of the scene say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.geometry import Contacts, curvatures, lattice
from softdyn.particles.portions import gatherings, in_portions
from softdyn.particles.system import System, gauge_axes, turns_freely

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_ITERATIONS = 40
#: A matrix is used again as long as each iteration with it leaves less than this of the residual.
CONTRACTION = 0.1
#: What the linear solver may leave: of what Newton's iteration may, and of the present residual.
AIM, LEAST = 0.3, 0.1
#: Particles are in a line that are no further from it than this part of its length: then none turns about it.
IN_LINE = 1e-9
#: Rounding of positions makes forces uncertain by the stiffness times this fraction of the coordinates.
ROUNDING = 16 * float(np.finfo(float).eps)


class StepFailed(Exception):
    """A step cannot be taken at this size; the message says where it failed."""


@dataclass
class Newton:
    """What one Newton iteration leaves for the next: the linear solver with its matrix; and how much work there was.

    Attributes
    ----------
    solver : linear.Solver or None
    s : float
        gamma dt of its matrix; 0 where that does not hold any more.
    pattern : Pattern or None
        Of the present list of contacts.
    gauge_pairs : list of pair of int
    counts : dict
    recalls : bool
        Whether all is kept that a run which goes on from a file needs.
    whole : bool
        Whether no step is on its way: then another run can go on from here.
    """

    solver: linear.Solver | None = None
    s: float = 0.0
    pattern: linear.Pattern | None = None
    gauge_pairs: list[tuple[int, int]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("iterations", "matrices", "contacts"), 0))
    recalls: bool = False
    whole: bool = True

    def forget(self) -> None:
        """Another list of contacts: nothing of the old matrix holds."""
        self.s, self.pattern = 0.0, None


@dataclass(frozen=True)
class Balance:
    """Positions and gaps that balance all forces.

    Attributes
    ----------
    x : array, shape (N, d + rotations)
    y, h, F, F_r : array, shape (contacts,)
        State and gap; force along the line of the centres, and its consistent tangent.
    n : array, shape (contacts, d)
    r : array, shape (contacts,)
    reaction : array, shape (N, d + rotations)
        Residual of the balance: what holds the fixed coordinates, below tolerance elsewhere.
    off : float
        Largest of the others, less what rounding makes of it.
    residual : float
        That relative to the largest force.
    values : dict
        What the kernel gives of tangential motion.
    T : array, shape (contacts, d), optional
        Forces of the contacts besides those along the normals, from i to j.
    rubbed : array, shape (contacts, d or more), optional
        Of these, what surfaces that touch bear by friction; and what resists rolling and twisting.
    notes : dict
        What mechanisms found, for themselves.
    film : array, shape (contacts,), optional
        Of F that of the contact itself, where there is more: potentials, bonds.
    """

    x: Array
    y: Array
    h: Array
    F: Array
    F_r: Array
    n: Array
    r: Array
    reaction: Array
    off: float
    residual: float
    values: dict[str, Array] = field(default_factory=dict)
    T: Array | None = None
    rubbed: Array | None = None
    notes: dict[str, Any] = field(default_factory=dict)
    film: Array | None = None

    @property
    def of_contacts(self) -> Array:
        """Forces of the contacts by themselves."""
        return self.F if self.film is None else self.film


@dataclass(frozen=True)
class StageInput:
    """What is given of a stage, in which x = x* + s dx/dt and y = y* + s dy/dt at its end.

    Attributes
    ----------
    t, s : float
        Its time, and gamma dt. Gaps stay where s = 0.
    x_star : array, shape (N, d + rotations)
    y_star : array, shape (contacts,)
    own : mapping from str to array
        Known part of what mechanisms integrate, as x_star is of the positions.
    begun : mapping from str to Any
        What they noted as the step began.
    """

    t: float
    s: float
    x_star: Array
    y_star: Array
    own: Mapping[str, Array] = field(default_factory=dict)
    begun: Mapping[str, Any] = field(default_factory=dict)


def _turns(x: Array, radii: Array, width: int) -> Array:
    """Orthonormal motions of the particles that turn all of them together, shape (turns, N, width)."""
    count, d = x.shape
    away = x - x.mean(axis=0)
    planes = [(a, b) for a in range(d) for b in range(a + 1, d)]
    turns = np.zeros((len(planes), count, width))
    for turn, (a, b) in zip(turns, planes, strict=True):
        turn[:, a], turn[:, b] = -away[:, b], away[:, a]
        if width > d:  # about x from y to z, about y from z to x, about z from x to y
            turn[:, d if d == 2 else d + 3 - a - b] = -radii if (a, b) == (0, 2) else radii
    _, sizes, rows = np.linalg.svd(turns.reshape(len(planes), -1), full_matrices=False)
    return np.asarray(rows[sizes > IN_LINE * sizes[0]].reshape(-1, count, width))


def held_torque(x: Array, radii: Array, force: Array) -> Array:
    """Part of some forces that would turn all particles together.

    Parameters
    ----------
    x : array, shape (N, d)
    radii : array, shape (N,)
    force : array, shape (N, w)
        Forces, and torques over radii.
    """
    turns = _turns(x, radii, force.shape[1])
    return np.tensordot(np.tensordot(turns, force, 2), turns, 1)


def unturned(x: Array, radii: Array, moved: Array) -> Array:
    """A motion of the particles less the rotation of all together that is in that of their centres.

    Parameters
    ----------
    x : array, shape (N, d)
    radii : array, shape (N,)
    moved : array, shape (N, w)
        Displacements or velocities, and rotations times radii.
    """
    turns = _turns(x, radii, moved.shape[1])
    of_centres = turns[:, :, : x.shape[1]].reshape(len(turns), -1)
    amount = np.linalg.lstsq(of_centres.T, moved[:, : x.shape[1]].reshape(-1), rcond=IN_LINE)[0]
    return np.asarray(moved - np.tensordot(amount, turns, 1))


def _gauge_pairs(x: Array) -> list[tuple[int, int]]:
    """Pairs of distant particles whose lines tell how the whole is turned."""
    away = x - x.mean(axis=0)
    first = int(np.argmax(np.linalg.norm(away, axis=1)))
    to = x - x[first]
    second = int(np.argmax(np.linalg.norm(to, axis=1)))
    line = to[second] / np.linalg.norm(to[second])
    aside = np.linalg.norm(to - np.outer(to @ line, line), axis=1)
    third = int(np.argmax(aside))
    # particles in a line do not turn about it
    apart = x.shape[1] == 3 and aside[third] > IN_LINE * np.linalg.norm(to[second])
    return [(first, second), *([(first, third)] if apart else [])]


def _gauge_springs(pairs: list[tuple[int, int]], x: Array) -> list[Array]:
    """Springs between these pairs that only a rotation of the whole would stretch.

    They change the path of Newton's iteration, not its end: there the forces balance without them.
    """
    lines = [x[j] - x[i] for i, j in pairs]
    lines = [line / np.linalg.norm(line) for line in lines]
    springs = [np.eye(x.shape[1]) - np.outer(line, line) for line in lines[:1]]
    if len(lines) == 2:
        normal = np.cross(*lines)
        springs.append(np.outer(normal, normal) / float(normal @ normal))
    return springs


def contact_forces(contacts: Contacts, F: Array, n: Array, count: int) -> Array:
    """Sum of F n over the contacts of each particle: the force that it exerts through them, shape (N, d).

    Parameters
    ----------
    contacts : Contacts
    F : array, shape (contacts,)
        Normal forces, > 0 apart.
    n : array, shape (contacts, d)
        Directions from i to j.
    count : int
        N, the number of particles.
    """
    of_i, of_j = gatherings(contacts, count)
    along = F[:, None] * n
    return np.asarray(of_i @ along - of_j @ along)


def balance(system: System, contacts: Contacts, newton: Newton, given: StageInput, x: Array, y: Array) -> Balance:
    """Solve one implicit stage: positions and gaps that balance all forces.

    Parameters
    ----------
    contacts : Contacts
        With the gaps at the start of the step, which define y.
    given : StageInput
    x : array, shape (N, d + rotations)
        A guess.
    y : array, shape (contacts,)
        A guess, which is overwritten.

    Raises
    ------
    StepFailed
        If Newton's iteration does not converge, naming the particle or contact where it fails.
    softdyn.particles.linear.Indefinite
        If the matrix has a direction along which nothing resists.
    """
    t, s, x_star, y_star = given.t, given.s, given.x_star, given.y_star
    count, d = len(x), system.dimension
    cell, external = lattice(system.box, t), system.force(t)
    free, (films,) = ~system.fixed, system.having["solve"]
    turning = turns_freely(system)

    def evaluate(x: Array, y: Array) -> Balance:
        n, r, h, F, F_r, values = films.solve(system, contacts, x[:, :d], cell, given, y)
        newton.counts["contacts"] += len(r)
        film = F
        for mechanism in system.having["central"]:
            more = mechanism.central(system, contacts, t, r)
            if more is not None:
                F, F_r = F + more[0], F_r + more[1]
        reaction = with_torques(system, contact_forces(contacts, F, n, count)) - external
        at = Balance(x, y, h, F, F_r, n, r, reaction, math.nan, math.nan, values, film=None if F is film else film)
        found = (mechanism.act(system, contacts, given, at) for mechanism in system.having["act"])
        actions = [action for action in found if action is not None]
        T: Array | None = None
        rubbed: Array | None = None
        notes: dict[str, Any] = {}
        for action in actions:
            reaction += action.reaction
            notes |= action.notes
            if action.T is not None:
                T = action.T if T is None else T + action.T
            rubbed = action.rubbed if action.rubbed is not None else rubbed
        if turning:
            reaction -= held_torque(x[:, :d], system.radii, reaction)
        biggest = max([largest(external), largest(F), *(action.largest for action in actions)])
        wrong = largest(np.where(free, reaction, 0.0))
        stiffest = max([largest(F_r), *(action.stiffness for action in actions)])
        noise = ROUNDING * stiffest * (largest(x) + float(system.radii.max()))
        if wrong - noise > system.force_tolerance * biggest:
            noise += _uncertainty(contacts, h, film, r)
            noise += sum(ROUNDING * action.friction * largest(x) for action in actions)
        off = wrong if math.isnan(wrong) else max(wrong - noise, 0.0)
        relative = off / biggest if biggest > 0 else wrong
        return replace(at, off=off, residual=relative, T=T, rubbed=rubbed, notes=notes)

    now = evaluate(x, y)
    for attempt in range(4):
        if math.isfinite(now.residual):
            break
        # the guess has gone too far: come closer to the known part; where a coordinate is given it stays
        x = np.where(free, x_star + 0.25 * (x - x_star) if attempt < 3 else x_star, x)
        now = evaluate(x, y_star.copy())
    if not math.isfinite(now.residual):
        raise StepFailed(_unsolved(contacts, now, count))
    target = system.force_tolerance
    if newton.s > 0 and not 0.8 < s / newton.s < 1.25:
        newton.s = 0.0
    fresh = False
    for _ in range(MOST_ITERATIONS):
        if now.residual <= target:
            return _in_gauge(system, now, x_star)
        newton.counts["iterations"] += 1
        if newton.s == 0 or newton.solver is None:
            linearise(system, contacts, newton, now, given)
            newton.s, fresh = s, True
        assert newton.solver is not None
        wanted = min(max(AIM * target / now.residual, linear.TOLERANCE), LEAST)
        change = linear.solve(newton.solver, np.where(free, -now.reaction, 0.0), wanted)
        size = largest(change)
        if not math.isfinite(size):
            raise StepFailed(f"the linear system has no finite solution at t={t:.6g}")
        # half of the smallest radius is further than any contact's force is nearly linear
        factor = min(1.0, 0.5 * float(system.radii.min()) / size) if size > 0 else 1.0
        x, y, off = now.x, now.y, now.off
        del now  # not two at a time
        for _ in range(10):
            trial = evaluate(x + factor * change, y.copy())
            better = trial.off < off or trial.residual <= target
            if better or not fresh:
                break
            factor *= 0.4
        slow = trial.off > CONTRACTION * off
        now = trial if better else evaluate(x, y)
        del trial
        if not better and fresh:
            raise StepFailed(_unbalanced(now, free))
        if not better or slow:
            newton.s, fresh = 0.0, False
    raise StepFailed(_unbalanced(now, free))


def with_torques(system: System, force: Array) -> Array:
    """Forces with no torque."""
    width = system.fixed.shape[1]
    return force if width == force.shape[1] else np.pad(force, ((0, 0), (0, width - force.shape[1])))


def _uncertainty(contacts: Contacts, h: Array, F: Array, r: Array) -> float:
    """By how much forces are uncertain, as gaps are found to 1e-12: more than little, where forces start from none."""
    deflection = np.abs(contacts.S - r + h) / 2
    stiffness = np.divide(np.abs(F), deflection, out=np.zeros_like(F), where=deflection > 0)
    return float((stiffness * h).max(initial=0.0)) * 1e-12


def largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0


def _in_gauge(system: System, found: Balance, x_star: Array) -> Balance:
    """Take away the mean motion along axes where nothing resists it; no force changes."""
    for axis in gauge_axes(system):
        found.x[:, axis] -= np.mean(found.x[:, axis] - x_star[:, axis])
    return found


def linearise(
    system: System,
    contacts: Contacts,
    newton: Newton,
    now: Balance,
    given: StageInput,
) -> None:
    """Prepare Newton's matrix at the present positions.

    Parameters
    ----------
    system : System
    contacts : Contacts
    newton : Newton
        Which keeps the matrix.
    now : Balance
        At the present positions.
    given : StageInput
    """
    count, width = now.x.shape
    d = system.dimension
    if newton.pattern is None:
        newton.gauge_pairs = _gauge_pairs(now.x[:, :d]) if turns_freely(system) else []
        newton.pattern = pattern_of(contacts, newton.gauge_pairs, count)
    if newton.solver is None:
        newton.solver = solver_of(system, newton.recalls)
    newton.solver.matrix = None  # not two at a time
    across = now.F * curvatures(contacts, now.r, count)
    springs = _gauge_springs(newton.gauge_pairs, now.x[:, :d]) if newton.gauge_pairs else []
    scale = largest(now.F_r)

    def component(a: int, b: int) -> Array:
        block = (across - now.F_r) * now.n[:, a] * now.n[:, b]
        if a == b:
            block -= across
        return np.append(block, [scale * spring[a, b] for spring in springs]) if springs else block

    own = own_tangents(system, contacts, given, now)
    for axis in gauge_axes(system):
        own[(0, axis) if own.ndim == 2 else (0, axis, axis)] += scale
    newton.counts["matrices"] += 1
    found = (one.contact_tangents(system, contacts, given, now) for one in system.having["contact_tangents"])
    others = [tangents for tangents in found if tangents is not None]
    if not others:
        matrix = linear.assemble(newton.pattern, component, own, system.fixed)
        linear.prepare(newton.solver, matrix)
        return

    def quarters() -> Iterator[Array]:
        """One after the other: all of them at once would take most of the memory."""
        for sign in (1.0, -1.0, -1.0, 1.0):
            whole: Array = reduce(np.add, map(next, others))

            def along(part: slice, whole: Array = whole, sign: float = sign) -> None:
                n, turned = now.n[part], across[part, None, None]
                stiffness = (turned - now.F_r[part, None, None]) * n[:, :, None] * n[:, None, :] - turned * np.eye(d)
                whole[part, :d, :d] += sign * stiffness

            in_portions(along, len(whole))
            if springs:
                more = np.zeros((len(springs), width, width))
                more[:, :d, :d] = sign * scale * np.array(springs)
                whole = np.concatenate([whole, more])
            yield whole

    matrix = linear.assemble_quarters(newton.pattern, quarters(), own, system.fixed)
    linear.prepare(newton.solver, matrix)


def pattern_of(contacts: Contacts, gauge_pairs: list[tuple[int, int]], count: int) -> linear.Pattern:
    """Pattern of the matrix: of contacts, and of the pairs whose rotation is taken away.

    Parameters
    ----------
    contacts : Contacts
    gauge_pairs : list of (int, int)
        Numbers of these pairs.
    count : int
        Particles.
    """
    ends = np.array(gauge_pairs, dtype=np.int64).reshape(-1, 2)
    i, j = contacts.i, contacts.j
    if len(ends):
        i, j = np.concatenate([i, ends[:, 0]]), np.concatenate([j, ends[:, 1]])
    return linear.pattern_of(count, i, j)


def solver_of(system: System, recalls: bool = False) -> linear.Solver:
    """A solver of the systems of Newton's iteration; ``recalls`` is that of :class:`Newton`."""
    symmetric = all(mechanism.symmetric for mechanism in system.mechanisms)
    return linear.Solver(
        system.dimension, system.width, symmetric=symmetric, certain=not system.dragged, recalls=recalls
    )


def own_tangents(system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array:
    """Derivative of what acts on each particle by itself: shape (N, w), or (N, w, w) where coordinates are coupled.

    Parameters
    ----------
    system : System
    contacts : Contacts
    given : StageInput
    at : Balance
    """
    total: Array = np.zeros(at.x.shape)
    unit = np.eye(system.width)
    for mechanism in system.having["tangent"]:
        more = mechanism.tangent(system, contacts, given, at)
        if more is None:
            continue
        if more.ndim > total.ndim:
            total = total[:, :, None] * unit
        total = total + (more if more.ndim == total.ndim else more[:, :, None] * unit)
    return total


def unresisted(system: System, contacts: Contacts, near: NDArray[np.int64], n: Array, moved: Array) -> Array | None:
    """Part of a motion that no contact resists, as far as a mechanism tells; near are those within range.

    Parameters
    ----------
    system : System
    contacts : Contacts
    near : array of int
        Contacts within range.
    n : array, shape (near, d)
        Their directions, from i to j.
    moved : array, shape (N, w)
        The motion.
    """
    for mechanism in system.having["unresisted"]:
        part = mechanism.unresisted(system, contacts, near, n, moved)
        if part is not None:
            return part
    return None


def pair_named(contacts: Contacts, c: int, count: int) -> str:
    """Words for one contact.

    Parameters
    ----------
    contacts : Contacts
    c : int
        Number of the contact.
    count : int
        Particles; what is beyond is a wall.
    """
    i, j = int(contacts.i[c]), int(contacts.j[c])
    return f"the contact of particles {i} and {j}" if j < count else f"the contact of particle {i} and wall {j - count}"


def _unsolved(contacts: Contacts, now: Balance, count: int) -> str:
    bad = np.flatnonzero(~np.isfinite(now.F) | ~np.isfinite(now.F_r))
    if not len(bad):
        return "positions are not finite"
    c = int(bad[0])
    if now.film is not None and np.isfinite(now.film[c]):
        i, j = int(contacts.i[c]), int(contacts.j[c])
        return f"particles {i} and {j}, at r={now.r[c]:.6g}, are beyond the distances at which their potential holds"
    return f"{pair_named(contacts, c, count)}, at r={now.r[c]:.6g}, has no gap that solves its equation"


def _unbalanced(now: Balance, free: Flags) -> str:
    worst = int(np.argmax(np.abs(np.where(free, now.reaction, 0.0)).max(axis=1)))
    return (
        f"Newton's iteration for the positions does not converge: the forces on particle {worst} balance to "
        f"{now.residual:.1e} of the largest force only"
    )
