"""One step of many particles: positions and gaps, implicit together.

Positions x and gaps h obey, with n from i to j (eqs. 1 and 7 of Rognon & Gay, arXiv 0803.1573)::

    Z (dx_i/dt - u(x_i)) + sum_j F_ij n_ij = F_i^ext ,      zeta dh/dt = -(F_ela - F_adh)

The generated kernel solves each contact's gap at given positions, and gives F and dF/dr; Newton's iteration for the
positions has the blocks -(dF/dr) n n^T - (F/r)(1 - n n^T) of the contacts and Z/(gamma dt) on the diagonal. Without
drag, Z = 0, positions are algebraic: the elastic equilibrium at the given gaps. Then a free cluster may be moved as a
whole at no cost; its mean velocity is set to zero, and the line between two of its particles does not turn. External
forces that would turn it are refused, and what rounding leaves of their torque is taken away.

With tangential motion, :mod:`softdyn.particles.sliding`, a particle's rotation stands beside its position: coordinates
(x, R theta) with theta counted from the start of the step, forces (force, torque/R). Without it nothing below has more
than positions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear, sliding
from softdyn.particles.geometry import Box, Contacts, Wall, curvatures, directions, flow, lattice
from softdyn.particles.kernel import ContactKernel, energies
from softdyn.particles.method import ERROR, GAMMA, NODES, ROWS, dense_row, rate_weights
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.surroundings import Imposed, balance_under_stress, coordinates, moves, placed

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_ITERATIONS = 40
#: A matrix is used again as long as each iteration with it leaves less than this of the residual.
CONTRACTION = 0.1
#: What the linear solver may leave: of what Newton's iteration may, and of the present residual.
AIM, LEAST = 0.3, 0.1
#: Of the stiffest contact: what resists, in Newton's matrix alone, a rotation that nothing resists.
IDLE = 1e-9
#: Where no time passes films hold for an instant: gaps within their range stay, pressed ones beyond it follow the
#: centres.
INSTANT = 1e-100
#: Rounding of positions makes forces uncertain by the stiffness times this fraction of the coordinates.
ROUNDING = 16 * float(np.finfo(float).eps)


class StepFailed(Exception):
    """A step cannot be taken at this size; the message says where it failed."""


@dataclass(frozen=True)
class System:
    """What stays the same over a run.

    Attributes
    ----------
    kernel : ContactKernel
    p : array
        Uniform parameters of the law.
    reach : float
        Range of the contacts; inf without one.
    box : Box
    walls : tuple of Wall
    radii : array, shape (N,)
    resistance : array, shape (N, d + rotations)
        What resists the motion of each coordinate through the fluid: force/velocity.
    fixed : array of bool, shape (N, d + rotations)
        Coordinates whose velocity is given.
    force, velocity : function of t
        External force on each particle, and velocity of the fixed coordinates, shape (N, d + rotations).
    rtol : float
        Error of a gap, relative to it, and of a position, relative to the radius, allowed in one step.
    imposed : Imposed, optional
        Stress imposed on the box.
    wall_velocity : function of t, optional
        Velocities of the walls, shape (walls, d).
    """

    kernel: ContactKernel
    p: Array
    reach: float
    box: Box
    walls: tuple[Wall, ...]
    radii: Array
    resistance: Array
    fixed: Flags
    force: Callable[[float], Array]
    velocity: Callable[[float], Array]
    rtol: float
    imposed: Imposed | None = None
    wall_velocity: Callable[[float], Array] | None = None

    @property
    def box_rates(self) -> Array:
        """Rates of the box that the imposed stress makes unknown, as they are."""
        if self.imposed is None:
            return np.empty(0)
        G = self.box.gradient
        return np.array(
            [
                G[0, 0] if name == "pressure" else G["xyz".index(name[0]), "xyz".index(name[1])]
                for name in self.imposed.names
            ]
        )

    @property
    def dimension(self) -> int:
        """Of space."""
        return len(self.box.lengths)

    @property
    def drag(self) -> Array:
        """What resists the motion of each particle through the fluid, shape (N,)."""
        return self.resistance[:, 0]

    @property
    def force_tolerance(self) -> float:
        """Residual of the force balance, relative to the largest force, at which Newton's iteration ends."""
        return 1e-3 * self.rtol


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
    """

    solver: linear.Solver | None = None
    s: float = 0.0
    pattern: linear.Pattern | None = None
    gauge_pairs: list[tuple[int, int]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("iterations", "matrices", "contacts"), 0))

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
        State and gap, force, and consistent tangent.
    n : array, shape (contacts, d)
    r : array, shape (contacts,)
    reaction : array, shape (N, d + rotations)
        Residual of the balance: what holds the fixed coordinates, below tolerance elsewhere.
    residual : float
        Largest of the others, relative to the largest force.
    slid : Slid or None
        Tangential forces.
    values : dict
        What the kernel gives of tangential motion.
    """

    x: Array
    y: Array
    h: Array
    F: Array
    F_r: Array
    n: Array
    r: Array
    reaction: Array
    residual: float
    slid: sliding.Slid | None = None
    values: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Output:
    """State within a step: time, balance, velocities, energies exchanged since the start of the step; box and walls."""

    t: float
    at: Balance
    v: Array
    work: dict[str, float]
    system: System


@dataclass(frozen=True)
class Step:
    """A step that has been taken.

    Attributes
    ----------
    end : Balance
    error : float
        Estimated error in units of what is allowed.
    v : array, shape (N, d + rotations)
    y_rate : array, shape (contacts,)
        Rates at the end.
    work : dict
        Energy of each kind, exchanged over the step; see :data:`WORKS`.
    system : System
        With the box and the walls as they are at the end.
    first_v : array, shape (N, d + rotations)
        Velocities at the start, extrapolated from within.
    outputs : tuple of Output
    power : dict
        Of each kind, at the end.
    """

    end: Balance
    error: float
    v: Array
    y_rate: Array
    work: dict[str, float]
    system: System
    first_v: Array
    outputs: tuple[Output, ...]
    power: dict[str, float]


@dataclass(frozen=True)
class _Stage:
    """One implicit stage: what was found, with box and walls; all rates; the unknown ones of the box."""

    found: Balance
    system: System
    rates: tuple[Array, ...]
    box_rates: Array


#: Energy put in by external forces and by what holds fixed coordinates, by the flow, and by the moving box; energy
#: lost in the gaps, by drag, to remote forces, and what the dependence of F_ela on h takes (the U_h term).
WORKS = ("external", "flow", "box", "gaps", "drag", "remote", "U_h")
#: Besides, with tangential motion: lost in sliding and in rolling, and what a change of the tangential stiffness takes.
TANGENTIAL_WORKS = ("sliding", "rolling", "k_t")


def works(system: System) -> tuple[str, ...]:
    """Kinds of energy that are exchanged."""
    return (*WORKS, *TANGENTIAL_WORKS) if system.kernel.tangential else WORKS


def gauge_axes(system: System) -> list[int]:
    """Axes along which nothing resists a motion of all particles together."""
    d = system.dimension
    if np.any(system.drag > 0) or (system.kernel.tangential and system.walls):
        return []
    held = [axis for axis in range(d) if system.fixed[:, axis].any()]
    facing = [axis for axis in range(d) if any(wall.normal[axis] for wall in system.walls)]
    return [axis for axis in range(d) if axis not in held and axis not in facing]


def turns_freely(system: System) -> bool:
    """Whether nothing resists a rotation of all particles together."""
    count, d = len(system.fixed), system.dimension
    alone = not system.fixed.any() and not system.walls and not system.box.periodic.any()
    return alone and d > 1 and count > 1 and not np.any(system.drag > 0)


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
    return rows[sizes > 1e-9 * sizes[0]].reshape(-1, count, width)  # particles in a line do not turn about it


def _held_torque(x: Array, radii: Array, force: Array) -> Array:
    """Part of some forces that would turn all particles together."""
    turns = _turns(x, radii, force.shape[1])
    return np.tensordot(np.tensordot(turns, force, 2), turns, 1)


def _gauge_pairs(x: Array) -> list[tuple[int, int]]:
    """Pairs of distant particles whose lines tell how the whole is turned."""
    away = x - x.mean(axis=0)
    first = int(np.argmax(np.linalg.norm(away, axis=1)))
    to = x - x[first]
    second = int(np.argmax(np.linalg.norm(to, axis=1)))
    line = to[second] / np.linalg.norm(to[second])
    aside = np.linalg.norm(to - np.outer(to @ line, line), axis=1)
    third = int(np.argmax(aside))
    return [(first, second), *([(first, third)] if x.shape[1] == 3 and aside[third] > 0 else [])]


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


def solve_contacts(
    system: System, overlap: Array, s: float, start: Array, target: Array, y: Array, q: Array
) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Gap, force and consistent tangent of each contact at given overlaps; y is a guess, and then the solution.

    Besides what the kernel gives of tangential motion, by name.
    """
    kernel = system.kernel
    h, F, F_r = np.empty_like(overlap), np.empty_like(overlap), np.empty_like(overlap)
    reach = (system.reach,) if kernel.fading else ()
    out = np.empty((len(kernel.tangential), len(overlap)))
    more = (out.reshape(-1),) if kernel.tangential else ()
    kernel.contacts(
        len(overlap), float(s), *reach, overlap, start, target, system.p, q.reshape(-1), y, h, F, F_r, *more
    )
    return h, F, F_r, dict(zip(kernel.tangential, out, strict=True))


def solve_at(
    system: System, contacts: Contacts, x: Array, cell: Array, s: float, start: Array, target: Array, y: Array
) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
    """Directions n and distances r of the contacts at the positions x, and what :func:`solve_contacts` gives."""
    count, d = len(contacts), x.shape[1]
    n, (r, h, F, F_r) = np.empty((count, d)), np.empty((4, count))
    values = dict(zip(system.kernel.tangential, np.empty((len(system.kernel.tangential), count)), strict=True))

    def solve(part: slice) -> None:
        some = portion(contacts, part)
        n[part], r[part], _ = directions(some, x, cell, system.walls)
        overlap = some.S - r[part]
        h[part], F[part], F_r[part], more = solve_contacts(
            system, overlap, s or INSTANT, start[part], target[part], y[part], some.q
        )
        for name, value in more.items():
            values[name][part] = value

    in_portions(solve, count)
    return n, r, h, F, F_r, values


def contact_forces(contacts: Contacts, F: Array, n: Array, count: int) -> Array:
    """Sum of F n over the contacts of each particle: the force that it exerts through them, shape (N, d)."""
    total = np.empty((count, n.shape[1]))
    pair = contacts.j < count
    every = bool(pair.all())
    i, j = contacts.i.astype(np.intp), (contacts.j if every else contacts.j[pair]).astype(np.intp)
    for axis in range(n.shape[1]):
        along = F * n[:, axis]
        total[:, axis] = np.bincount(i, along, minlength=count)
        total[:, axis] -= np.bincount(j, along if every else along[pair], minlength=count)
    return total


def balance(
    system: System,
    contacts: Contacts,
    newton: Newton,
    t: float,
    s: float,
    x_star: Array,
    x: Array,
    start: Array,
    y_star: Array,
    y: Array,
    known: sliding.Known | None = None,
) -> Balance:
    """Solve one implicit stage: positions and gaps with x = x* + s dx/dt and y = y* + s dy/dt; gaps stay where s = 0.

    Parameters
    ----------
    t, s : float
        Time, and gamma dt.
    x_star, x : array, shape (N, d + rotations)
        Known part, and a guess.
    start : array, shape (contacts,)
        Gap at the start of the step, which defines y.
    y_star, y : array, shape (contacts,)
        Known part, and a guess, which is overwritten.
    known : Known, optional
        What is known of the tangential forces.

    Raises
    ------
    StepFailed
        If Newton's iteration does not converge, naming the particle or contact where it fails.
    softdyn.particles.linear.Indefinite
        If the matrix has a direction along which nothing resists.
    """
    count, d = len(x), system.dimension
    cell, external = lattice(system.box, t), system.force(t)
    gauge = gauge_axes(system)
    drag = system.resistance
    images = s * image_velocities(system, contacts, t) if known is not None else None
    moving = bool(np.any(system.drag > 0)) and s > 0
    free = ~system.fixed
    turning = turns_freely(system)

    def evaluate(x: Array, y: Array) -> Balance:
        n, r, h, F, F_r, values = solve_at(system, contacts, x[:, :d], cell, s, start, y_star, y)
        newton.counts["contacts"] += len(r)
        reaction = _forces_on(system, contact_forces(contacts, F, n, count)) - external
        resisting = drag * ((x - x_star) / s - background(system, x)) if moving else np.zeros_like(x)
        reaction += resisting
        slid = None
        if known is not None:
            assert images is not None
            turning_by = curvatures(contacts, r, count)
            slid = sliding.slide(known, contacts, values, n, r, turning_by, x - x_star, images, s)
            reaction += sliding.reactions(contacts, known, slid, n, count)
        if turning:
            reaction -= _held_torque(x[:, :d], system.radii, reaction)
        largest = max(_largest(external), _largest(F), _largest(resisting), _largest(slid.force) if slid else 0.0)
        wrong = _largest(np.where(free, reaction, 0.0))
        stiffest = max(_largest(F_r), _largest(values["stiff"])) if known is not None else _largest(F_r)
        noise = ROUNDING * stiffest * (_largest(x) + float(system.radii.max()))
        if wrong - noise > system.force_tolerance * largest:
            noise += _uncertainty(contacts, h, F, r)
            noise += ROUNDING * _largest(drag) / s * _largest(x) if moving else 0.0
        relative = max(wrong - noise, 0.0) / largest if largest > 0 else wrong
        return Balance(x, y, h, F, F_r, n, r, reaction, relative, slid, values)

    now = evaluate(x, y)
    for attempt in range(4):
        if math.isfinite(now.residual):
            break
        # the guess has gone too far: come closer to the known part
        x = x_star + 0.25 * (x - x_star) if attempt < 3 else x_star.copy()
        now = evaluate(x, y_star.copy())
    if not math.isfinite(now.residual):
        raise StepFailed(_unsolved(contacts, now, count))
    target = system.force_tolerance
    if newton.s > 0 and not 0.8 < s / newton.s < 1.25:
        newton.s = 0.0
    fresh = False
    for _ in range(MOST_ITERATIONS):
        if now.residual <= target:
            return _in_gauge(now, gauge, x_star)
        newton.counts["iterations"] += 1
        if newton.s == 0 or newton.solver is None:
            _linearise(system, contacts, newton, now, s, moving, gauge, known)
            newton.s, fresh = s, True
        assert newton.solver is not None
        wanted = min(max(AIM * target / now.residual, linear.TOLERANCE), LEAST)
        change = linear.solve(newton.solver, np.where(free, -now.reaction, 0.0), wanted)
        size = _largest(change)
        if not math.isfinite(size):
            raise StepFailed(f"the linear system has no finite solution at t={t:.6g}")
        # half of the smallest radius is further than any contact's force is nearly linear
        factor = min(1.0, 0.5 * float(system.radii.min()) / size) if size > 0 else 1.0
        for _ in range(10):
            trial = evaluate(now.x + factor * change, now.y.copy())
            better = trial.residual < now.residual or trial.residual <= target
            if better or not fresh:
                break
            factor *= 0.4
        if better:
            slow = trial.residual > CONTRACTION * now.residual
            now = trial
        elif fresh:
            raise StepFailed(_unbalanced(now, free))
        if not better or slow:
            newton.s, fresh = 0.0, False
    raise StepFailed(_unbalanced(now, free))


def _forces_on(system: System, force: Array) -> Array:
    """Forces with no torque."""
    width = system.fixed.shape[1]
    return force if width == force.shape[1] else np.pad(force, ((0, 0), (0, width - force.shape[1])))


def background(system: System, x: Array) -> Array:
    """Velocity of the background flow, and of rotation with it, in each coordinate."""
    d = system.dimension
    u = flow(system.box, x[:, :d])
    if x.shape[1] == d:
        return u
    rotation = np.zeros((len(x), x.shape[1] - d))
    rotation[:, -1] = -0.5 * system.box.shear_rate * system.radii
    return np.concatenate([u, rotation], axis=1)


def image_velocities(system: System, contacts: Contacts, t: float) -> Array:
    """Velocity of the image of particle j with the box, or of the wall, shape (contacts, d)."""
    velocities = np.zeros(contacts.shift.shape)
    across = np.flatnonzero(contacts.shift.any(axis=1))
    velocities[across] = contacts.shift[across] @ (lattice(system.box, t + 1.0) - lattice(system.box, t)).T
    if system.wall_velocity is not None:
        count = len(system.radii)
        on = contacts.j >= count
        velocities[on] = system.wall_velocity(t)[contacts.j[on] - count]
    return velocities


def _uncertainty(contacts: Contacts, h: Array, F: Array, r: Array) -> float:
    """By how much forces are uncertain, as gaps are found to 1e-12: more than little, where forces start from none."""
    deflection = np.abs(contacts.S - r + h) / 2
    stiffness = np.divide(np.abs(F), deflection, out=np.zeros_like(F), where=deflection > 0)
    return float((stiffness * h).max(initial=0.0)) * 1e-12


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0


def _in_gauge(found: Balance, gauge: list[int], x_star: Array) -> Balance:
    """Take away the mean motion along axes where nothing resists it; no force changes."""
    for axis in gauge:
        found.x[:, axis] -= np.mean(found.x[:, axis] - x_star[:, axis])
    return found


def _linearise(
    system: System,
    contacts: Contacts,
    newton: Newton,
    now: Balance,
    s: float,
    moving: bool,
    gauge: list[int],
    known: sliding.Known | None,
) -> None:
    """Prepare Newton's matrix at the present positions."""
    count, width = now.x.shape
    d = system.dimension
    if newton.pattern is None:
        newton.gauge_pairs = _gauge_pairs(now.x[:, :d]) if turns_freely(system) else []
        ends = np.array(newton.gauge_pairs, dtype=np.int64).reshape(-1, 2)
        i, j = contacts.i, contacts.j
        if len(ends):
            i, j = np.concatenate([i, ends[:, 0]]), np.concatenate([j, ends[:, 1]])
        newton.pattern = linear.pattern_of(count, i, j)
    if newton.solver is None:
        certain = not np.any(system.drag > 0)
        newton.solver = linear.Solver(d, width, symmetric=known is None, certain=certain)
    newton.solver.matrix = None  # not two at a time
    curvature = curvatures(contacts, now.r, count)
    across = now.F * curvature
    springs = _gauge_springs(newton.gauge_pairs, now.x[:, :d])
    scale = _largest(now.F_r)

    def component(a: int, b: int) -> Array:
        block = (across - now.F_r) * now.n[:, a] * now.n[:, b]
        if a == b:
            block -= across
        return np.append(block, [scale * spring[a, b] for spring in springs]) if springs else block

    diagonal = system.resistance / s if moving else np.zeros((count, width))
    for axis in gauge:
        diagonal[0, axis] += scale
    newton.counts["matrices"] += 1
    slid = now.slid
    if slid is None or known is None:
        matrix = linear.assemble(newton.pattern, component, diagonal, system.fixed)
        linear.prepare(newton.solver, matrix)
        return
    # what spins without any resistance, as a particle about the line of its only contacts, does not
    diagonal[:, d:] += IDLE * max(scale, _largest(now.values["stiff"]))

    def quarters() -> Iterator[Array]:
        """One after the other: all of them at once would take most of the memory."""
        parts = sliding.tangents(known, now.values, slid, now.n, curvature, s)
        for part, sign in zip(parts, (1.0, -1.0, -1.0, 1.0), strict=True):
            whole = np.concatenate([part, np.zeros((len(springs), width, width))]) if springs else part
            for a in range(d):
                for b in range(d):
                    whole[:, a, b] += sign * component(a, b)
            yield whole

    matrix = linear.assemble_quarters(newton.pattern, quarters(), diagonal, system.fixed)
    linear.prepare(newton.solver, matrix)


def pair_named(contacts: Contacts, c: int, count: int) -> str:
    """Words for one contact."""
    i, j = int(contacts.i[c]), int(contacts.j[c])
    return f"the contact of particles {i} and {j}" if j < count else f"the contact of particle {i} and wall {j - count}"


def _unsolved(contacts: Contacts, now: Balance, count: int) -> str:
    bad = np.flatnonzero(~np.isfinite(now.F) | ~np.isfinite(now.F_r))
    if not len(bad):
        return "positions are not finite"
    c = int(bad[0])
    return f"{pair_named(contacts, c, count)}, at r={now.r[c]:.6g}, has no gap that solves its equation"


def _unbalanced(now: Balance, free: Flags) -> str:
    worst = int(np.argmax(np.abs(np.where(free, now.reaction, 0.0)).max(axis=1)))
    return (
        f"Newton's iteration for the positions does not converge: the forces on particle {worst} balance to "
        f"{now.residual:.1e} of the largest force only"
    )


def take_step(
    system: System,
    contacts: Contacts,
    newton: Newton,
    t: float,
    x: Array,
    v: Array,
    y_rate: Array,
    dt: float,
    outputs: Sequence[float] | Array = (),
    power: dict[str, float] | None = None,
) -> Step:
    """Try a step of the given length from time t, with v and y_rate as guesses of the rates.

    Parameters
    ----------
    outputs : sequence of float
        Times within the step at which the state is wanted too, if the error allows the step.
    power : dict, optional
        Power of each kind at t, if v and y_rate are the rates there, and not only guesses of them.

    Raises
    ------
    StepFailed, softdyn.particles.linear.Indefinite
    """
    s = GAMMA * dt
    start = contacts.h
    sliding_start = None
    if system.kernel.tangential:
        normal, _, _ = directions(contacts, x, lattice(system.box, t), system.walls)
        sliding_start = sliding.starting(contacts, system.radii, normal)
        x = _forces_on(system, x)  # rotations count from here
    surround = moves(system)
    z = coordinates(system, t) if surround else np.empty(0)
    z_rate = placed(system, t, 0.0, z, system.box_rates)[1] if surround else z
    # at the start, and at each stage: of positions, of gaps, of box and walls, of tangential forces and their frames
    still = np.zeros_like(contacts.T), np.zeros(len(start) if system.kernel.tangential else 0)
    rates: list[tuple[Array, ...]] = [(v, y_rate, z_rate, *still)]

    def combined(weights: Array, which: int) -> Array:
        total = np.zeros_like(rates[0][which])
        for weight, of_stage in zip(weights, rates, strict=False):
            if weight:
                total += weight * of_stage[which]
        return total

    def stage(
        row: Array, when: float, guess_x: Array, guess_y: Array, box_rates: Array, sliding_row: Array | None = None
    ) -> _Stage:
        x_star, y_star = x + dt * combined(row, 0), dt * combined(row, 1)
        first = x_star + s * guess_x
        if system.fixed.any():
            first = np.where(system.fixed, x_star + s * system.velocity(when), first)
        known = None
        if sliding_start is not None:
            own = row if sliding_row is None else sliding_row
            T_star, angle_star = contacts.T + dt * combined(own, 3), dt * combined(own, 4)
            known = replace(sliding_start, force=T_star, angle=angle_star)
        here, at_z, guess = system, z_rate, y_star + s * guess_y

        def solve(here: System, x: Array) -> Balance:
            return balance(here, contacts, newton, when, s, x_star, x, start, y_star, guess, known)

        if surround:
            z_star = z + dt * combined(row, 2)
            here, at_z = placed(system, when, s, z_star, box_rates)
        if system.imposed is None:
            found = solve(here, first)
        else:
            found, here, at_z, box_rates = balance_under_stress(
                system, contacts, newton, when, s, z_star, box_rates, solve, first
            )
        turned = still
        if known is not None and found.slid is not None:
            turned = (found.slid.turned - known.force) / s, (found.slid.angle - known.angle) / s
        return _Stage(found, here, ((found.x - x_star) / s, (found.y - y_star) / s, at_z, *turned), box_rates)

    guess_x, guess_y, box_rates = v, y_rate, system.box_rates
    spent = [power or dict.fromkeys(works(system), 0.0)]
    at: _Stage | None = None
    for row, node in zip(ROWS, NODES, strict=True):
        at = None  # many numbers that the next stage has no use for
        at = stage(row, t + node * dt, guess_x, guess_y, box_rates)
        rates.append(at.rates)
        guess_x, guess_y, box_rates = at.rates[0], at.rates[1], at.box_rates
        spent.append(powers(at.system, contacts, at.found, t + node * dt, guess_x, guess_y))

    assert at is not None

    def work(weights: Sequence[float], last: dict[str, float]) -> dict[str, float]:
        pairs = list(zip(weights, [*spent, last], strict=True))
        return {name: dt * sum(float(w) * powers[name] for w, powers in pairs) for name in last}

    x_error, y_error, z_error, T_error = (dt * combined(np.array([0.0, *ERROR]), k) for k in range(4))
    error = _error(system, at.found, y_error, x_error, T_error)
    if surround and system.imposed is not None:
        # errors of the strains of the box, as of positions
        error = max(error, _largest(z_error[: system.dimension + 1]) / system.rtol)
    between = []
    for when in outputs if error <= 1.0 else ():
        theta = (float(when) - t) / dt
        near = np.array([0.0, *rate_weights(theta)])
        row = dense_row(theta, power is not None)
        # the rates of tangential forces at the start are not known
        other = stage(row, when, combined(near, 0), combined(near, 1), box_rates, dense_row(theta, False))
        own = powers(other.system, contacts, other.found, when, *other.rates[:2])
        between.append(Output(float(when), other.found, other.rates[0], work([*row, GAMMA], own), other.system))
    first_v = combined(np.array([0.0, *rate_weights(0.0)]), 0)
    whole = work([*ROWS[-1], 0.0], spent[-1])
    return Step(at.found, error, at.rates[0], at.rates[1], whole, at.system, first_v, tuple(between), spent[-1])


def _error(system: System, end: Balance, y_error: Array, x_error: Array, T_error: Array) -> float:
    """Error of a step relative to what is allowed.

    The root of the mean square over contacts within their range, each as much as there is of it, and a tenth of the
    largest. Likewise over particles, where their positions are integrated; likewise over tangential forces, relative to
    the largest force, or to what would shear the contact's surfaces by its gap.
    """
    active = end.h < system.reach
    found = [0.0]
    if active.any():
        relative = (y_error / np.sqrt(1 + end.y**2))[active] * weight(end.h[active], system.reach) / system.rtol
        found += [float(np.sqrt(np.mean(relative**2))), float(np.abs(relative).max()) / 10]
    dragged = system.drag > 0
    if dragged.any():
        relative = (x_error[dragged, : system.dimension] / system.radii[dragged, None]).reshape(-1) / system.rtol
        found += [float(np.sqrt(np.mean(relative**2))), float(np.abs(relative).max()) / 10]
    if end.slid is not None and active.any():
        k_t = end.values["stiff"][active] / end.values["keep"][active]
        allowed = np.maximum(k_t * end.h[active], max(_largest(end.slid.force), _largest(end.F)))
        relative = np.linalg.norm(T_error[active], axis=1) / (system.rtol * allowed)
        found += [float(np.sqrt(np.mean(relative**2))), float(relative.max()) / 10]
    return max(found) if all(map(math.isfinite, found)) else math.inf


def weight(h: Array, reach: float) -> Array:
    """What there is of a contact: 1 up to half of its range, 0 at its range, as in the kernel."""
    ahead = np.clip(2 * (1 - h / reach), 0.0, 1.0)
    return np.asarray(ahead**2 * (3 - 2 * ahead))


def contact_state(system: System, contacts: Contacts, overlap: Array, h: Array) -> dict[str, Array]:
    """Return what the kernel says of each contact: delta, a, F, friction (w zeta), remote (w F_adh), C, ..."""
    kernel = system.kernel
    out = np.empty((len(kernel.outputs), len(h)))
    reach = (system.reach,) if kernel.fading else ()
    kernel.state(len(h), *reach, overlap, h, system.p, contacts.q.reshape(-1), out.reshape(-1))
    return dict(zip(kernel.outputs, out, strict=True))


def powers(system: System, contacts: Contacts, at: Balance, t: float, v: Array, y_rate: Array) -> dict[str, float]:
    """Power of each kind in :data:`WORKS`, at one stage."""
    # y = sinh(ln(h/g)): dy = cosh(ln(h/g)) dh/h
    h_rate = at.h * y_rate / np.sqrt(1 + at.y**2)
    images = image_velocities(system, contacts, t)
    more = {}
    if at.slid is not None:
        values = contact_state(system, contacts, contacts.S - at.r, at.h)
        more = tangential_powers(system, contacts, at, values, v, images, h_rate)
        del values
    moved = np.flatnonzero(images.any(axis=1))
    pushed = at.F[moved, None] * at.n[moved]
    if at.slid is not None:
        pushed = pushed + at.slid.force[moved]
    carried = -np.sum(pushed * images[moved], axis=1)
    box = contacts.j[moved] < len(v)
    del images, pushed
    u = background(system, at.x)
    resisting = system.resistance * (v - u)
    held = np.where(system.fixed, at.reaction, 0.0)
    gaps, remote, U_h = _gap_powers(system, contacts, at, h_rate)
    return {
        "external": float(np.sum((system.force(t) + held) * v)) + float(carried[~box].sum()),
        "flow": -float(np.sum(resisting * u)),
        "box": float(carried[box].sum()),
        "gaps": gaps,
        "drag": float(np.sum(resisting * (v - u))),
        "remote": remote,
        "U_h": U_h,
        **more,
    }


def forces_of(system: System, contacts: Contacts, overlap: Array, h: Array) -> Array:
    """Force of each contact."""

    def of(part: slice) -> Array:
        return contact_state(system, portion(contacts, part), overlap[part], h[part])["F"]

    return np.concatenate(in_portions(of, len(h)))


def _gap_powers(system: System, contacts: Contacts, at: Balance, h_rate: Array) -> tuple[float, float, float]:
    """Power lost in the gaps, and taken by remote forces and the U_h term."""

    def of(part: slice) -> tuple[float, float, float]:
        some = portion(contacts, part)
        overlap, h, rate = some.S - at.r[part], at.h[part], h_rate[part]
        values = contact_state(system, some, overlap, h)
        _, U_h = energies(system.kernel, system.reach, overlap, h, system.p, some.q.reshape(-1))
        lost, remote = np.sum(values["friction"] * rate**2), -np.sum(values["remote"] * rate)
        return float(lost), float(remote), -float(np.sum(U_h * rate))

    gaps, remote, taken = zip(*in_portions(of, len(h_rate)), strict=True)
    return sum(gaps), sum(remote), sum(taken)


def tangential_powers(
    system: System, contacts: Contacts, at: Balance, values: dict[str, Array], v: Array, images: Array, h_rate: Array
) -> dict[str, float]:
    """Power lost in sliding and in rolling, and taken by a change of the tangential stiffness, at one stage."""
    assert at.slid is not None
    d = system.dimension
    walls = np.zeros((len(system.walls), v.shape[1]))
    one, other = (np.concatenate([v, walls])[ends] for ends in (contacts.i, contacts.j))
    square = sliding.dot(at.slid.force, at.slid.force)
    slides = values["friction_t"] > 0
    radii = np.append(system.radii, np.ones(len(walls)))
    turn = one[:, d:] / radii[contacts.i, None] - other[:, d:] / radii[contacts.j, None]
    if d == 3:
        turn = turn - sliding.dot(turn, at.n)[:, None] * at.n
    r_rate = sliding.dot(other[:, :d] + images - one[:, :d], at.n)
    k_rate = values["k_t_h"] * h_rate + values["k_t_delta"] * (h_rate - r_rate) / 2
    return {
        "sliding": float(np.sum(square[slides] / values["friction_t"][slides])),
        "rolling": float(np.sum(values["roll"] * sliding.dot(turn, turn))),
        "k_t": float(np.sum(square * k_rate / (2 * values["k_t"] ** 2))),
    }
