"""One step of many particles: positions and gaps, implicit together.

Positions x and gaps h obey, with n from i to j (eqs. 1 and 7 of Rognon & Gay, arXiv 0803.1573)::

    Z (dx_i/dt - u(x_i)) + sum_j F_ij n_ij = F_i^ext ,      zeta dh/dt = -(F_ela - F_adh)

The generated kernel solves each contact's gap at given positions, and gives F and dF/dr; Newton's iteration for the
positions has the blocks -(dF/dr) n n^T - (F/r)(1 - n n^T) of the contacts and Z/(gamma dt) on the diagonal. Without
drag, Z = 0, positions are algebraic: the elastic equilibrium at the given gaps. Then a free cluster may be moved as a
whole at no cost; its mean velocity is set to zero, and the line between two of its particles does not turn. External
forces that would turn it are refused, and what rounding leaves of their torque is taken away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softdyn.particles import linear
from softdyn.particles.geometry import Box, Contacts, Wall, directions, flow, lattice
from softdyn.particles.kernel import ContactKernel, energies
from softdyn.particles.method import ERROR, GAMMA, NODES, STAGES, WEIGHTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_ITERATIONS = 40
#: A factorisation is used again as long as each iteration with it leaves less than this of the residual.
CONTRACTION = 0.2
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
    radii, drag : array, shape (N,)
        Radius of each particle, and what resists its motion through the fluid: force/velocity.
    fixed : array of bool, shape (N, d)
        Coordinates whose velocity is given.
    force, velocity : function of t
        External force on each particle, and velocity of the fixed coordinates, shape (N, d).
    rtol : float
        Error of a gap, relative to it, and of a position, relative to the radius, allowed in one step.
    """

    kernel: ContactKernel
    p: Array
    reach: float
    box: Box
    walls: tuple[Wall, ...]
    radii: Array
    drag: Array
    fixed: Flags
    force: Callable[[float], Array]
    velocity: Callable[[float], Array]
    rtol: float

    @property
    def force_tolerance(self) -> float:
        """Residual of the force balance, relative to the largest force, at which Newton's iteration ends."""
        return min(1e-3 * self.rtol, 1e-6)


@dataclass
class Newton:
    """What one Newton iteration leaves for the next: the factorised matrix; and how much work there was."""

    solve: Callable[[Array], Array] | None = None
    s: float = 0.0
    pattern: linear.Pattern | None = None
    gauge_pairs: list[tuple[int, int]] = field(default_factory=list)
    method: str = ""
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("iterations", "factorisations", "contacts"), 0)
    )

    def forget(self) -> None:
        """Another list of contacts: nothing of the old matrix holds."""
        self.solve = self.pattern = None


@dataclass(frozen=True)
class Balance:
    """Positions and gaps that balance all forces.

    Attributes
    ----------
    x : array, shape (N, d)
    y, h, F, F_r : array, shape (contacts,)
        State and gap, force, and consistent tangent.
    n : array, shape (contacts, d)
    r : array, shape (contacts,)
    reaction : array, shape (N, d)
        Residual of the balance: what holds the fixed coordinates, below tolerance elsewhere.
    residual : float
        Largest of the others, relative to the largest force.
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


@dataclass(frozen=True)
class Step:
    """A step that has been taken.

    Attributes
    ----------
    end : Balance
    error : float
        Estimated error in units of what is allowed.
    x_rates : array, shape (stages, N, d)
    y_rates : array, shape (stages, contacts)
    work : dict
        Energy of each kind, exchanged over the step; see :data:`WORKS`.
    """

    end: Balance
    error: float
    x_rates: Array
    y_rates: Array
    work: dict[str, float]


#: Energy put in by external forces and by what holds fixed coordinates, by the flow, and by the moving box; energy
#: lost in the gaps, by drag, to remote forces, and what the dependence of F_ela on h takes (the U_h term).
WORKS = ("external", "flow", "box", "gaps", "drag", "remote", "U_h")


def gauge_axes(system: System) -> list[int]:
    """Axes along which nothing resists a motion of all particles together."""
    d = system.fixed.shape[1]
    if np.any(system.drag > 0):
        return []
    held = [axis for axis in range(d) if system.fixed[:, axis].any()]
    facing = [axis for axis in range(d) if any(wall.normal[axis] for wall in system.walls)]
    return [axis for axis in range(d) if axis not in held and axis not in facing]


def turns_freely(system: System) -> bool:
    """Whether nothing resists a rotation of all particles together."""
    count, d = system.fixed.shape
    alone = not system.fixed.any() and not system.walls and not system.box.periodic.any()
    return alone and d > 1 and count > 1 and not np.any(system.drag > 0)


def _turns(x: Array) -> Array:
    """Orthonormal motions of the particles that turn all of them together, shape (turns, N, d)."""
    count, d = x.shape
    away = x - x.mean(axis=0)
    planes = [(a, b) for a in range(d) for b in range(a + 1, d)]
    turns = np.zeros((len(planes), count, d))
    for turn, (a, b) in zip(turns, planes, strict=True):
        turn[:, a], turn[:, b] = -away[:, b], away[:, a]
    _, sizes, rows = np.linalg.svd(turns.reshape(len(planes), -1), full_matrices=False)
    return rows[sizes > 1e-9 * sizes[0]].reshape(-1, count, d)  # particles in a line do not turn about it


def _held_torque(x: Array, force: Array) -> Array:
    """Part of some forces that would turn all particles together."""
    turns = _turns(x)
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
) -> tuple[Array, Array, Array]:
    """Gap, force and consistent tangent of each contact at given overlaps; y is a guess, and then the solution."""
    h, F, F_r = np.empty_like(overlap), np.empty_like(overlap), np.empty_like(overlap)
    reach = (system.reach,) if system.kernel.fading else ()
    system.kernel.contacts(
        len(overlap), float(s), *reach, overlap, start, target, system.p, q.reshape(-1), y, h, F, F_r
    )
    return h, F, F_r


def contact_forces(contacts: Contacts, F: Array, n: Array, count: int) -> Array:
    """Sum of F n over the contacts of each particle: the force that it exerts through them, shape (N, d)."""
    total = np.empty((count, n.shape[1]))
    pair = contacts.j < count
    every = bool(pair.all())
    i, j = contacts.i, contacts.j if every else contacts.j[pair]
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
) -> Balance:
    """Solve one implicit stage: positions and gaps with x = x* + s dx/dt and y = y* + s dy/dt; gaps stay where s = 0.

    Parameters
    ----------
    t, s : float
        Time, and gamma dt.
    x_star, x : array, shape (N, d)
        Known part, and a guess.
    start : array, shape (contacts,)
        Gap at the start of the step, which defines y.
    y_star, y : array, shape (contacts,)
        Known part, and a guess.

    Raises
    ------
    StepFailed
        If Newton's iteration does not converge, naming the particle or contact where it fails.
    softdyn.particles.linear.Indefinite
        If the matrix has a direction along which nothing resists.
    """
    count = len(x)
    cell, external = lattice(system.box, t), system.force(t)
    gauge = gauge_axes(system)
    drag = system.drag[:, None]
    moving = bool(np.any(system.drag > 0)) and s > 0
    free = ~system.fixed
    turning = turns_freely(system)

    def evaluate(x: Array, y: Array) -> tuple[Balance, Array]:
        n, r, curvature = directions(contacts, x, cell, system.walls)
        h, F, F_r = solve_contacts(system, contacts.S - r, s, start, y_star, y, contacts.q)
        newton.counts["contacts"] += len(r)
        reaction = contact_forces(contacts, F, n, count) - external
        resisting = drag * ((x - x_star) / s - flow(system.box, x)) if moving else np.zeros_like(x)
        reaction += resisting
        if turning:
            reaction -= _held_torque(x, reaction)
        largest = max(_largest(external), _largest(F), _largest(resisting))
        wrong = _largest(np.where(free, reaction, 0.0))
        noise = ROUNDING * _largest(F_r) * (_largest(x) + float(system.radii.max()))
        relative = max(wrong - noise, 0.0) / largest if largest > 0 else wrong
        return Balance(x, y, h, F, F_r, n, r, reaction, relative), curvature

    now, curvature = evaluate(x, y.copy())
    for attempt in range(4):
        if math.isfinite(now.residual):
            break
        # the guess has gone too far: come closer to the known part
        x = x_star + 0.25 * (x - x_star) if attempt < 3 else x_star.copy()
        now, curvature = evaluate(x, y_star.copy())
    if not math.isfinite(now.residual):
        raise StepFailed(_unsolved(contacts, now, count))
    if newton.solve is not None and (newton.s == 0 or not 0.8 < s / newton.s < 1.25):
        newton.solve = None
    fresh = False
    for _ in range(MOST_ITERATIONS):
        if now.residual <= system.force_tolerance:
            return _in_gauge(now, gauge, x_star)
        newton.counts["iterations"] += 1
        if newton.solve is None:
            _factorise(system, contacts, newton, now, curvature, s if moving else 0.0, gauge)
            newton.s, fresh = s, True
        assert newton.solve is not None
        change = newton.solve(np.where(free, -now.reaction, 0.0))
        size = _largest(change)
        if not math.isfinite(size):
            raise StepFailed(f"the linear system has no finite solution at t={t:.6g}")
        # half of the smallest radius is further than any contact's force is nearly linear
        factor = min(1.0, 0.5 * float(system.radii.min()) / size) if size > 0 else 1.0
        for _ in range(10):
            trial, trial_curvature = evaluate(now.x + factor * change, now.y.copy())
            if trial.residual < now.residual or trial.residual <= system.force_tolerance:
                break
            if not fresh:
                break
            factor *= 0.4
        better = trial.residual < now.residual or trial.residual <= system.force_tolerance
        if better:
            slow = trial.residual > CONTRACTION * now.residual
            now, curvature = trial, trial_curvature
        elif fresh:
            raise StepFailed(_unbalanced(system, now, free))
        if not better or slow:
            newton.solve, fresh = None, False
    raise StepFailed(_unbalanced(system, now, free))


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0


def _in_gauge(found: Balance, gauge: list[int], x_star: Array) -> Balance:
    """Take away the mean motion along axes where nothing resists it; no force changes."""
    for axis in gauge:
        found.x[:, axis] -= np.mean(found.x[:, axis] - x_star[:, axis])
    return found


def _factorise(
    system: System, contacts: Contacts, newton: Newton, now: Balance, curvature: Array, s: float, gauge: list[int]
) -> None:
    """Prepare Newton's matrix at the present positions."""
    count, d = now.x.shape
    if newton.pattern is None:
        newton.gauge_pairs = _gauge_pairs(now.x) if turns_freely(system) else []
        ends = np.array(newton.gauge_pairs, dtype=np.int64).reshape(-1, 2)
        newton.pattern = linear.pattern_of(
            count, np.concatenate([contacts.i, ends[:, 0]]), np.concatenate([contacts.j, ends[:, 1]])
        )
    across = (now.F * curvature)[:, None, None]
    springs = _gauge_springs(newton.gauge_pairs, now.x)
    dyads = now.n[:, :, None] * now.n[:, None, :]
    blocks = (across[:, 0, 0] - now.F_r)[:, None, None] * dyads - across * np.eye(d)
    scale = _largest(now.F_r)
    if springs:
        blocks = np.concatenate([blocks, [scale * spring for spring in springs]])
    diagonal = np.repeat((system.drag / s if s > 0 else np.zeros(count))[:, None], d, axis=1)
    for axis in gauge:
        diagonal[0, axis] += scale
    matrix = linear.assemble(newton.pattern, blocks, diagonal, system.fixed)
    newton.counts["factorisations"] += 1
    newton.solve, newton.method = linear.solver(matrix, d)


def _pair(contacts: Contacts, c: int, count: int) -> str:
    i, j = int(contacts.i[c]), int(contacts.j[c])
    return f"the contact of particles {i} and {j}" if j < count else f"the contact of particle {i} and wall {j - count}"


def _unsolved(contacts: Contacts, now: Balance, count: int) -> str:
    bad = np.flatnonzero(~np.isfinite(now.F) | ~np.isfinite(now.F_r))
    if not len(bad):
        return "positions are not finite"
    c = int(bad[0])
    return f"{_pair(contacts, c, count)}, at r={now.r[c]:.6g}, has no gap that solves its equation"


def _unbalanced(system: System, now: Balance, free: Flags) -> str:
    worst = int(np.argmax(np.abs(np.where(free, now.reaction, 0.0)).max(axis=1)))
    return (
        f"Newton's iteration for the positions does not converge: the forces on particle {worst} balance to "
        f"{now.residual:.1e} of the largest force only"
    )


def state_of(gap: Array, start: Array) -> Array:
    """Return y(h) = (h/g - g/h)/2."""
    return (gap / start - start / gap) / 2


def gap_of(y: Array, start: Array) -> Array:
    """Return h(y), the inverse of :func:`state_of`, without loss at either end."""
    factor = np.abs(y) + np.sqrt(1 + y * y)
    return np.where(y > 0, start * factor, start / factor)


def take_step(
    system: System, contacts: Contacts, newton: Newton, t: float, x: Array, v: Array, y_rate: Array, dt: float
) -> Step:
    """Try a step of the given length from time t, with v and y_rate as guesses of the rates.

    Raises
    ------
    StepFailed, softdyn.particles.linear.Indefinite
    """
    s = GAMMA * dt
    start = contacts.h
    x_rates = np.zeros((3, *x.shape))
    y_rates = np.zeros((3, len(start)))
    work = dict.fromkeys(WORKS, 0.0)
    guess_x, guess_y = v, y_rate
    for stage in range(3):
        when = t + NODES[stage] * dt
        x_star = x + dt * np.tensordot(STAGES[stage, :stage], x_rates[:stage], 1)
        y_star = dt * (STAGES[stage, :stage] @ y_rates[:stage])
        first = x_star + s * guess_x
        if system.fixed.any():
            first = np.where(system.fixed, x_star + s * system.velocity(when), first)
        found = balance(system, contacts, newton, when, s, x_star, first, start, y_star, y_star + s * guess_y)
        x_rates[stage] = guess_x = (found.x - x_star) / s
        y_rates[stage] = guess_y = (found.y - y_star) / s
        for name, power in powers(system, contacts, found, when, x_rates[stage], y_rates[stage]).items():
            work[name] += dt * WEIGHTS[stage] * power
    error = _error(system, contacts, found, dt * (ERROR @ y_rates), dt * np.tensordot(ERROR, x_rates, 1))
    return Step(found, error, x_rates, y_rates, work)


def _error(system: System, contacts: Contacts, end: Balance, y_error: Array, x_error: Array) -> float:
    """Error of a step relative to what is allowed.

    The root of the mean square over contacts within their range, and a tenth of the largest; likewise over particles,
    where their positions are integrated.
    """
    active = end.h < system.reach
    found = [0.0]
    if active.any():
        relative = (y_error / np.sqrt(1 + end.y**2))[active] / system.rtol
        found += [float(np.sqrt(np.mean(relative**2))), float(np.abs(relative).max()) / 10]
    dragged = system.drag > 0
    if dragged.any():
        relative = (x_error[dragged] / system.radii[dragged, None]).reshape(-1) / system.rtol
        found += [float(np.sqrt(np.mean(relative**2))), float(np.abs(relative).max()) / 10]
    return max(found) if all(map(math.isfinite, found)) else math.inf


def contact_state(system: System, contacts: Contacts, overlap: Array, h: Array) -> dict[str, Array]:
    """Return what the kernel says of each contact: delta, a, F_ela, friction (w zeta), remote (w F_adh), C, ..."""
    kernel = system.kernel
    out = np.empty((len(kernel.outputs), len(h)))
    reach = (system.reach,) if kernel.fading else ()
    kernel.state(len(h), *reach, overlap, h, system.p, contacts.q.reshape(-1), out.reshape(-1))
    return dict(zip(kernel.outputs, out, strict=True))


def powers(system: System, contacts: Contacts, at: Balance, t: float, v: Array, y_rate: Array) -> dict[str, float]:
    """Power of each kind in :data:`WORKS`, at one stage."""
    overlap = contacts.S - at.r
    values = contact_state(system, contacts, overlap, at.h)
    _, U_h = energies(system.kernel, overlap, at.h, system.p, contacts.q.reshape(-1))
    # y = sinh(ln(h/g)): dy = cosh(ln(h/g)) dh/h
    h_rate = at.h * y_rate / np.sqrt(1 + at.y**2)
    u = flow(system.box, at.x)
    resisting = system.drag[:, None] * (v - u)
    held = np.where(system.fixed, at.reaction, 0.0)
    cell_rate = (lattice(system.box, t + 1.0) - lattice(system.box, t)) if system.box.shear_rate else None
    carried = 0.0
    if cell_rate is not None and cell_rate.any():
        images = contacts.shift @ cell_rate.T
        carried = -float(np.sum(at.F * np.einsum("ij,ij->i", at.n, images)))
    return {
        "external": float(np.sum((system.force(t) + held) * v)),
        "flow": -float(np.sum(resisting * u)),
        "box": carried,
        "gaps": float(np.sum(values["friction"] * h_rate**2)),
        "drag": float(np.sum(resisting * (v - u))),
        "remote": -float(np.sum(values["remote"] * h_rate)),
        "U_h": -float(np.sum(U_h * h_rate)),
    }
