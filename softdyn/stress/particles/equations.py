"""The equations of a few particles, written down once more, in plain numpy, and integrated by scipy.

Nothing of the engine is in them but the declaration of the law, as sympy makes functions of it. The state holds
positions, ln h of every contact, its tangential force, and what surrounds the particles: logarithms of the lengths of
the box, its tilt, points of the walls. Everything is a vector of three components, whatever the dimension.

The equations are stiff, and have kinks where surfaces begin to be pulled. So they are integrated by an implicit method
with the exact Jacobian: all functions below take many states at once, in front, and complex ones, and an imaginary
step too small to matter gives the derivatives. Integration ends and begins anew at every break of the drives.

For a contact from i to j with the distance r of the centres, S = R_i + R_j, delta = (S - r + h)/2, weights film and
grip (see :func:`weights`), and n from i to j::

    film zeta dh/dt = -(F_ela - film F_adh) ,     F = grip F_ela
    dT/dt = k_t (slip - T/(w A)) + turning x T

Particles that the fluid resists have the velocities that balance forces and torques. Those that nothing resists stay in
balance: their velocities solve the balance of forces, differentiated in time, and that of torques as it is, since
rolling resists the spins themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import Abs, Expr, Float, Max, Min, Piecewise, Symbol, diff, lambdify

from softdyn.derive import E, R, a, delta, eta, h, size_ratio
from softdyn.derive.law import ContactLaw, tangential_expressions
from softdyn.particles.scene import ParticleScene

Array = NDArray[np.float64]
#: Of each contact.
Mode = NDArray[np.int64]
#: A contact: particle i, particle j or wall j - N, and the lattice vector by which j is displaced.
Pair = tuple[int, int, tuple[int, int, int]]

#: Weight of a film that has none, lest its equation be algebraic; forces are off by as much.
THIN = 1e-6
#: Weight below which a contact resists no spin to speak of.
FAINT = 1e-6
#: Singular values below this part of the largest belong to motions that nothing resists.
FREE = 1e-9
ACROSS = np.eye(3)
#: Beyond this effort a scene is left without a reference.
MOST_EVALUATIONS = 30_000
#: Contacts are looked for so far beyond their range, in radii, before it is known which will come within it.
BESIDE = 0.25
#: A function of t: where each piece begins, and what it is from there on. A piece may be the same as the one before,
#: where an integrator should look anew.
Pieces = Sequence[tuple[float, Expr]]


@dataclass(frozen=True)
class Case:
    """A scene, and its drives as functions.

    Attributes
    ----------
    scene : ParticleScene
    drives : mapping from str to Pieces
        Expressions of t, by the text that stands for each in the scene.
    law : ContactLaw
    kind : str
        For the report.
    """

    scene: ParticleScene
    drives: Mapping[str, Pieces]
    law: ContactLaw
    kind: str


def values_of(law: ContactLaw, names: tuple[str, ...], tangential: bool) -> Callable[..., Any]:
    """Function of h, delta and ``names``: F_ela, its slopes in h and delta, zeta, F_adh, and A, B, G, k_t."""
    elastic = _by_cases(law.F_ela.subs(a, law.a))
    found = [elastic, diff(elastic, h), diff(elastic, delta)]
    found += [_by_cases(expr.subs(a, law.a)) for expr in (law.zeta * law.unequal, law.F_adh)]
    if tangential:
        assert law.tangential is not None
        found += [_by_cases(expr.subs(a, law.a)) for expr in tangential_expressions(law.tangential).values()]
    return _function(law, names, found)


def _function(law: ContactLaw, names: tuple[str, ...], found: Any) -> Callable[..., Any]:
    symbols = {symbol.name: symbol for symbol in (R, E, eta, size_ratio, *law.parameters)}
    modules = [{"select": _select}, "numpy"]
    return lambdify([h, delta, *(symbols[name] for name in names)], found, modules=modules, cse=True)


def _select(conditions: list[Any], values: list[Any], default: float) -> Any:
    """The first value whose condition holds; numpy's own takes ten times as long."""
    for condition, value in zip(reversed(conditions), reversed(values), strict=True):
        default = np.where(condition, value, default)  # type: ignore[assignment]
    return default


def _by_cases(expr: Expr) -> Expr:
    """Without functions that complex numbers do not have."""
    expr = expr.replace(Abs, lambda x: Piecewise((x, x >= 0), (-x, True)))
    return expr.replace(lambda e: isinstance(e, (Max, Min)), lambda e: e.rewrite(Piecewise))


@dataclass
class Equations:
    """A case as arrays.

    Attributes
    ----------
    pairs : list of Pair
    i, j : array of int
        Ends of the contacts; the walls follow the particles.
    S : array
        Sum of the radii.
    q : list of array
        Parameters of the law in each contact.
    law_of, friction_of : function
        See :func:`values_of`; zeta alone.
    far_away : array
        zeta of particles that are far apart.
    unlike : array
        D = (R_i - R_j)/(R_i + R_j), -1 at walls.
    fixed, turned : array of bool, shape (N, 3), (N,)
        Coordinates whose velocity is given, and particles whose spin is.
    drag, spin_drag : array, shape (N,)
    first, second : array, shape (contacts, N)
        1 where a particle is i of a contact, and where it is j.
    motions : array, shape (motions, 3 N)
        Of all particles together, where nothing tells where they are and how they are turned.
    given : function of t and of a number
        External force, torque, its rate, given velocities and spins, velocities of walls, shear rate, stress, between
        two breaks of the drives.
    breaks : list of float
        Those.
    """

    case: Case
    d: int
    count: int
    walls: int
    radii: Array
    pairs: list[Pair]
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    shift: Array
    S: Array
    q: list[Array]
    law_of: Callable[..., Any]
    friction_of: Callable[..., Any]
    far_away: Array
    unlike: Array
    fixed: NDArray[np.bool_]
    turned: NDArray[np.bool_]
    drag: Array
    spin_drag: Array
    normals: Array
    imposed: tuple[str, ...]
    given: Callable[[float, int], dict[str, Array]]
    breaks: list[float]
    periodic: NDArray[np.bool_]
    first: Array
    second: Array
    motions: Array

    @property
    def slides(self) -> bool:
        """Whether there is tangential motion."""
        return bool(self.case.scene.tangential)

    @property
    def reach(self) -> float:
        """Range of the contacts."""
        return math.inf if self.case.scene.reach is None else float(self.case.scene.reach)

    @property
    def dragged(self) -> bool:
        """Whether the fluid resists the particles by themselves."""
        return bool(self.case.scene.drag)

    @property
    def gauge(self) -> bool:
        """Whether nothing tells where the whole is, or how it is turned."""
        return len(self.motions) > 0


def _numbers(particles: Any, count: int, scene: ParticleScene) -> list[int]:
    if isinstance(particles, str):
        return [k for k in range(count) if particles == "all" or list(scene.species or [])[k] == particles]
    return list(particles)


def pieces_of(case: Case, value: Any) -> Pieces:
    """What a number, the text of an expression or a table (times, values) in a scene stands for."""
    t = Symbol("t", real=True)
    if isinstance(value, str):
        return case.drives[value]
    if not isinstance(value, tuple):
        return [(0.0, Float(value, 17))]
    times, values = (np.array(column, dtype=float) for column in value)
    return [
        (a, Float(u, 17) + (t - Float(a, 17)) * Float((v - u) / (b - a), 17))
        for a, b, u, v in zip(times, times[1:], values, values[1:], strict=False)
        if b > a
    ]


def _drives(case: Case, d: int, count: int) -> tuple[Callable[[float, int], dict[str, Array]], list[float]]:
    """All that is given as a function of t, by name; and its breaks."""
    scene, t = case.scene, Symbol("t", real=True)
    entries: list[tuple[str, Any, Any]] = []  # name, where, value
    for push in scene.pushes:
        for k in _numbers(push.particles, count, scene):
            entries += [("force", (k, axis), value) for axis, value in enumerate(push.force or ())]
            entries += [("torque", (k, axis), value) for axis, value in zip(_spins(d), push.torque or (), strict=False)]
    for hold in scene.holds:
        for k in _numbers(hold.particles, count, scene):
            entries += [
                ("velocity", (k, "xyz".index(axis)), value)
                for axis, value in zip(hold.axes, hold.velocity or (), strict=False)
            ]
            entries += [("spin", (k, axis), value) for axis, value in zip(_spins(d), hold.spin or (), strict=False)]
    for w, wall in enumerate(scene.walls):
        entries += [("wall", (w, axis), value) for axis, value in enumerate(wall.velocity or ())]
    entries.append(("shear", 0, scene.shear_rate))
    entries += [("stress", k, value) for k, value in enumerate(scene.stress.values())]
    breaks = sorted({when for *_, value in entries for when, _ in pieces_of(case, value)[1:]})
    middles = [(one + other) / 2 for one, other in zip([0.0, *breaks], [*breaks, 2 * float(scene.until)], strict=True)]
    functions: dict[Expr, Callable[[float], tuple[float, float]]] = {}
    parts = []
    for middle in middles:
        part = []
        for name, where, value in entries:
            expr = [expr for when, expr in pieces_of(case, value) if when <= middle][-1]
            if expr not in functions:
                functions[expr] = lambdify(t, (expr, diff(expr, t)), modules="math", cse=True)
            part.append((name, where, functions[expr]))
        parts.append(part)
    shapes = {"force": (count, 3), "torque": (count, 3), "velocity": (count, 3), "spin": (count, 3), "shear": (1,)}
    shapes |= {"wall": (len(scene.walls), 3), "stress": (len(scene.stress),)}

    def given(when: float, number: int) -> dict[str, Array]:
        found = {name: np.zeros(shape) for name, shape in shapes.items()}
        found["force_rate"] = np.zeros((count, 3))
        for name, where, function in parts[number]:
            value, rate = function(when)
            found[name][where] += value
            if name == "force":
                found["force_rate"][where] += rate
        return found

    return given, breaks


def part_of(eq: Equations, t: float) -> int:
    """Number of the part between breaks of the drives in which a time is; of a break, of that before it."""
    return int(np.searchsorted(eq.breaks, t))


def _spins(d: int) -> tuple[int, ...]:
    return {1: (), 2: (2,), 3: (0, 1, 2)}[d]


def set_up(case: Case, pairs: list[Pair]) -> Equations:
    """A case as arrays, with the contacts that may come within range."""
    scene = case.scene
    x = np.array(scene.positions, dtype=float)
    count, d = x.shape
    radii = np.broadcast_to(np.array(scene.radii, dtype=float), (count,)).copy()
    i, j = np.array([p[0] for p in pairs], dtype=int), np.array([p[1] for p in pairs], dtype=int)
    wall = j >= count
    one, other = radii[i], radii[np.where(wall, i, j)]
    rigid = np.array([w.rigid for w in scene.walls] or [False])[np.where(wall, j - count, 0)] & wall
    own: dict[str, Array] = {}
    for name, value in scene.parameters.items():
        each = (
            np.array([value[s] for s in scene.species or ()]) if isinstance(value, Mapping) else np.full(count, value)
        )
        u, v = each[i], each[np.where(wall, i, j)]
        rule = "harmonic" if name == "E" else scene.mixing.get(name, "arithmetic")
        own[name] = {"arithmetic": (u + v) / 2, "geometric": np.sqrt(u * v), "harmonic": 2 / (1 / u + 1 / v)}[rule]
    if "E" in own:
        own["E"] = np.where(rigid, 2 * own["E"], own["E"])
    own["R"] = np.where(wall, 2 * one, 2 * one * other / (one + other))
    own["size_ratio"] = np.where(wall, 0.0, one * other / (one + other) ** 2)
    fixed, turned = np.zeros((count, 3), bool), np.zeros(count, bool)
    fixed[:, d:] = True
    for hold in scene.holds:
        for k in _numbers(hold.particles, count, scene):
            fixed[k, ["xyz".index(axis) for axis in hold.axes]] = True
            turned[k] |= hold.spin is not None
    normals = np.zeros((len(scene.walls), 3))
    for w, entry in enumerate(scene.walls):
        normals[w, :d] = np.array(entry.normal, float) / np.linalg.norm(entry.normal)
    viscosity = float(scene.parameters.get("eta", 0.0))  # type: ignore[arg-type]
    S = radii[i] + np.where(wall, 0.0, other)
    friction_of = _function(case.law, tuple(own), _by_cases((case.law.zeta * case.law.unequal).subs(a, case.law.a)))
    given, breaks = _drives(case, d, count)
    periodic = np.array([length is not None for length in (scene.box or [None] * d)] + [False] * (3 - d))
    first, second = (np.equal.outer(end, np.arange(count)).astype(float) for end in (i, j))
    loose = not (scene.drag or fixed[:, :d].any() or len(scene.walls) or periodic.any())
    return Equations(
        case=case, d=d, count=count, walls=len(scene.walls), radii=radii, pairs=pairs, i=i, j=j,
        shift=np.array([p[2] for p in pairs], dtype=float).reshape(-1, 3),
        S=S, q=list(own.values()),
        law_of=values_of(case.law, tuple(own), bool(scene.tangential)),
        friction_of=friction_of, far_away=friction_of(1e10 * S, 0 * S, *own.values()),
        unlike=np.where(wall, -1.0, (one - other) / (one + other)), fixed=fixed, turned=turned,
        drag=6 * math.pi * viscosity * radii * scene.drag, spin_drag=8 * math.pi * viscosity * radii**3 * scene.drag,
        normals=normals, imposed=tuple(scene.stress), given=given, breaks=breaks,
        periodic=periodic, first=first, second=second, motions=_rigid_motions(x) if loose else np.empty((0, 3 * count)),
    )  # fmt: skip


def _rigid_motions(x: Array) -> Array:
    """Motions of all particles together, shape (motions, 3 N), orthonormal."""
    count, d = x.shape
    away = np.pad(x - x.mean(axis=0), ((0, 0), (0, 3 - d)))
    shifts = [np.tile(ACROSS[axis], (count, 1)) for axis in range(d)]
    turns = [np.cross(ACROSS[axis], away) for axis in ((2,) if d == 2 else range(3 if d == 3 else 0))]
    _, sizes, rows = np.linalg.svd(np.reshape([*shifts, *turns], (-1, 3 * count)), full_matrices=False)
    return np.asarray(rows[sizes > FREE * sizes[0]])


def unpack(eq: Equations, state: Array) -> tuple[Array, Array, Array, Array]:
    """Positions (N, 3), ln h, tangential forces (contacts, 3), surroundings; of many states at once, too."""
    n, c, lead = eq.count * eq.d, len(eq.pairs), state.shape[:-1]
    x = np.zeros((*lead, eq.count, 3), state.dtype)
    x[..., : eq.d] = state[..., :n].reshape(*lead, eq.count, eq.d)
    T = np.zeros((*lead, c, 3), state.dtype)
    if eq.slides:
        T = state[..., n + c : n + 4 * c].reshape(*lead, c, 3)
    return x, state[..., n : n + c], T, state[..., n + (4 * c if eq.slides else c) :]


def pack(eq: Equations, x: Array, u: Array, T: Array, z: Array) -> Array:
    """State, or its rates."""
    lead = x.shape[:-2]
    parts = [x[..., : eq.d].reshape(*lead, -1), u, T.reshape(*lead, -1) if eq.slides else np.zeros((*lead, 0)), z]
    return np.concatenate(parts, axis=-1)


def first_surroundings(scene: ParticleScene, d: int) -> Array:
    """Logarithms of the lengths of the box (0 where there are none), tilt, points of the walls."""
    lengths = [1.0 if length is None else float(length) for length in (scene.box or [None] * d)]
    points = np.zeros((len(scene.walls), 3))
    for w, wall in enumerate(scene.walls):
        points[w, :d] = wall.point
    return np.concatenate([np.log([*lengths, *[1.0] * (3 - d)]), [float(scene.tilt)], points.reshape(-1)])


def cell_of(eq: Equations, z: Array) -> Array:
    """Lattice vectors as columns."""
    cell = np.zeros((*z.shape[:-1], 3, 3), z.dtype)
    for axis in np.flatnonzero(eq.periodic):
        cell[..., axis, axis] = np.exp(z[..., axis])
    cell[..., 0, 1] = z[..., 3]
    return cell


def _dot(u: Array, v: Array) -> Array:
    return np.asarray((u * v).sum(axis=-1))


def _norm(v: Array) -> Array:
    return np.asarray(np.sqrt(_dot(v, v)))


def _times(matrix: Array, v: Array) -> Array:
    """Matrices times vectors."""
    return np.asarray((matrix @ v[..., None])[..., 0])


def geometry(eq: Equations, x: Array, z: Array) -> tuple[Array, Array]:
    """Normals and distances."""
    points = z[..., 4:].reshape(*z.shape[:-1], -1, 3)
    pair = eq.j < eq.count
    every = np.concatenate([x, points], axis=-2)
    along = every[..., eq.j, :] - x[..., eq.i, :] + eq.shift @ np.swapaxes(cell_of(eq, z), -1, -2)
    facing = np.concatenate([np.zeros((eq.count, 3)), eq.normals])[eq.j]
    r = np.where(pair, _norm(along), _dot(along, facing))
    return np.where(pair[:, None], along / r[..., None], facing), r


#: What a contact is: pressed, pulled, or beyond its range with undeformed surfaces, so that its gap rides along with
#: the centres.
PRESSED, PULLED, RIDES = range(3)
#: Deflections over the radius below this are none; and how close to the range a contact is at it.
NONE, AT_RANGE = 1e-13, 1e-9


def weights(eq: Equations, gap: Array, mode: Mode) -> tuple[Array, Array, Array, Array]:
    """Weight w, falling from 1 to 0 between half of the range and the range; film, grip, and the slope of grip in h.

    Of pressed surfaces the film fades, of pulled ones the force.
    """
    if math.isinf(eq.reach):
        one = np.ones_like(gap)
        return one, one, one, np.zeros_like(gap)
    ahead = 2 * (1 - gap / eq.reach)
    ahead = np.where(ahead.real > 1, 1.0, np.where(ahead.real < 0, 0.0, ahead))
    w = ahead**2 * (3 - 2 * ahead)
    grip = np.where(mode == PULLED, w, np.where(mode == RIDES, 0.0, 1.0))
    slope = np.where(mode == PULLED, 6 * ahead * (1 - ahead) * -2 / eq.reach, 0.0)
    return w, np.where(mode == PRESSED, _thin(w), 1.0), grip, slope


def _thin(w: Array) -> Array:
    return np.where(w.real > THIN, w, THIN)


@dataclass
class Now:
    """All that the equations say of a state; ``opening``: d(2 delta)/dt where surfaces are not deflected."""

    n: Array
    r: Array
    gap: Array
    deflection: Array
    F: Array
    T: Array
    v: Array
    spin: Array
    stress: Array
    cell: Array
    gradient: Array
    rates: Array
    opening: Array


@dataclass
class Contacts:
    """What the contacts are at a state; of many states at once, with their number in front.

    Attributes
    ----------
    n, T, push, far : array, shape (contacts, 3)
        Normals, tangential forces, forces from i to j; velocity of the image of j or of the wall.
    r, gap, deflection, w, grip, grip_h, gap_rate : array, shape (contacts,)
    elastic : tuple of array
        F_ela and its slopes in h and delta.
    tangential : list of array
        A, B, G, k_t.
    """

    n: Array
    r: Array
    gap: Array
    deflection: Array
    w: Array
    grip: Array
    grip_h: Array
    gap_rate: Array
    elastic: tuple[Array, Array, Array]
    tangential: list[Array]
    T: Array
    push: Array
    far: Array


@dataclass
class Sliding:
    """Tangential motion of the contacts, linear in velocities and spins.

    Attributes
    ----------
    lever : two arrays, shape (contacts,)
    rolling, by_v : array, shape (contacts, 3, 3)
        Moment by a relative rotation; dT/dt by v_i - v_j.
    by_spin : list of two arrays, shape (contacts, 3, 3)
        dT/dt by the spins of i and j.
    still : array, shape (contacts, 3)
        dT/dt where nothing moves.
    """

    lever: tuple[Array, Array]
    rolling: Array
    by_v: Array
    by_spin: list[Array]
    still: Array


def tell(eq: Equations, t: float, state: Array, part: int, mode: Mode) -> Now:
    """Forces, velocities and rates of a state, or of many at once; ``part``: between which breaks of the drives."""
    x, u, T, z = unpack(eq, state)
    given, cell = eq.given(t, part), cell_of(eq, z)
    n, r = geometry(eq, x, z)
    gap = np.exp(u)
    deflection = (eq.S - r + gap) / 2
    found = [np.broadcast_to(value, gap.shape) for value in eq.law_of(gap, deflection, *eq.q)]
    elastic, by_gap, by_delta, zeta, remote, *tangential = found
    if eq.dragged:  # a contact carries what exceeds the drags of its particles by themselves
        zeta = zeta * (1 - min(float(eq.case.scene.drag), 1.0) * eq.far_away / eq.friction_of(gap, 0.0, *eq.q))
    w, film, grip, grip_h = weights(eq, gap, mode)
    rides = mode == RIDES
    T = np.where(rides[:, None], 0.0, T)
    whole, F, T = T, grip * elastic, T - _dot(T, n)[..., None] * n
    push = F[..., None] * n + T

    stress = -np.swapaxes(push * r[..., None], -1, -2) @ n
    depth = float(eq.case.scene.depth or 2 * eq.radii.mean())
    boxed = eq.periodic[: eq.d].all()
    volume = np.prod(np.exp(z[..., : eq.d]), axis=-1)[..., None, None] * depth ** (3 - eq.d) if boxed else 1.0
    gradient = box_gradient(eq, given, stress / volume)
    cell_rate = gradient @ cell
    far = np.concatenate([np.zeros((eq.count, 3)), given["wall"]])[eq.j] + eq.shift @ np.swapaxes(cell_rate, -1, -2)
    gap_rate = -(elastic / film - remote) / zeta

    at = Contacts(
        n, r, gap, deflection, w, grip, grip_h, gap_rate, (elastic, by_gap, by_delta), tangential, T, push, far
    )
    slides = _sliding(eq, at, whole, rides) if eq.slides else None
    if eq.dragged:
        turn = -gradient[..., 0, 1] / 2
        v, spin = _through_fluid(eq, given, at, slides, x @ np.swapaxes(gradient, -1, -2), turn)
    else:
        v, spin = _in_balance(eq, given, at, slides)
    still = np.zeros((*x.shape[:-2], eq.walls, 3))
    every, turns = np.concatenate([v, still], axis=-2), np.concatenate([spin, still], axis=-2)
    closing = every[..., eq.i, :] - every[..., eq.j, :] - far
    parting = -_dot(n, closing)
    gap_rate = np.where(rides, parting, gap_rate)
    T_rate = np.zeros_like(n)
    if slides is not None:
        T_rate = slides.still + _times(slides.by_v, closing)
        for end, by_spin in zip((eq.i, eq.j), slides.by_spin, strict=True):
            T_rate = T_rate + _times(by_spin, turns[..., end, :])
    walls = np.broadcast_to(given["wall"].reshape(-1), (*x.shape[:-2], 3 * eq.walls))
    stretch = np.diagonal(gradient, axis1=-2, axis2=-1)
    rates = pack(eq, v, gap_rate / gap, T_rate, np.concatenate([stretch, cell_rate[..., 0, 1, None], walls], axis=-1))
    return Now(n, r, gap, deflection, F, T, v, spin, stress / volume, cell, gradient, rates, remote / zeta - parting)


def box_gradient(eq: Equations, given: Mapping[str, Array], stress: Array) -> Array:
    """Velocity gradient: given, or such that 2 eta D and the stress of the contacts are the imposed one."""
    stress = (stress + np.swapaxes(stress, -1, -2)) / 2
    gradient = np.zeros_like(stress)
    gradient[..., 0, 1] = given["shear"][0]
    scene = eq.case.scene
    viscosity = float(scene.stress_viscosity or scene.parameters.get("eta", 0.0))  # type: ignore[arg-type]
    for name, value in zip(eq.imposed, given["stress"], strict=True):
        if name == "pressure":
            mean = sum(stress[..., axis, axis] for axis in range(eq.d)) / eq.d
            for axis in range(eq.d):
                gradient[..., axis, axis] = (-value - mean) / (2 * viscosity)
        else:
            row, column = "xyz".index(name[0]), "xyz".index(name[1])
            resisting = viscosity if row != column else 2 * viscosity
            gradient[..., row, column] = (value - stress[..., row, column]) / resisting
    return gradient


def _skew(v: Array) -> Array:
    """Matrices of v x."""
    out = np.zeros((*v.shape, 3), v.dtype)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return out - np.swapaxes(out, -1, -2)


def _by(values: Array) -> Array:
    """To be multiplied with matrices."""
    return values[..., None, None]


def _sliding(eq: Equations, at: Contacts, T: Array, rides: NDArray[np.bool_]) -> Sliding:
    """dT/dt = k_t (slip - T/(w A)) + turning x T.

    What rounding and the integrator leave of T along the normal relaxes, too: else what is stiff would turn with it.
    """
    A, B, G, k_t = at.tangential
    k_t = np.where(rides, 0.0, k_t)
    dyad = at.n[..., :, None] * at.n[..., None, :]
    excess, shift = (at.r - eq.S) / 2, eq.unlike * B / A
    radius_j = np.append(eq.radii, np.zeros(eq.walls))[eq.j]
    lever = eq.radii[eq.i] + excess + shift, radius_j + excess - shift
    rolling = _by(at.w * (G - (eq.unlike * B) ** 2 / A)) * (ACROSS - dyad)
    turning, pressing = _skew(at.n), _skew(at.T)
    spun = -pressing @ dyad / 2  # ((spin . n)/2) n x T
    turn = _by(np.where(eq.j < eq.count, 1 / at.r, 0.0)) * (pressing @ turning)  # -(n x apart)/r x T
    by_spin = [-_by(k_t * arm) * turning + spun for arm in lever]
    still = -(k_t / (_thin(at.w) * A))[..., None] * T
    return Sliding(lever, rolling, _by(k_t) * (ACROSS - dyad) + turn, by_spin, still)


def _spread(rows: Array, columns: Array, blocks: Array) -> Array:
    """Sum of blocks of the contacts, shape (N, 3, N, 3), by the parts (contacts, N) that rows and columns have."""
    outer = rows[:, :, None] * columns[:, None, :]
    return np.asarray(np.einsum("...abnm->...namb", np.tensordot(blocks, outer, axes=(-3, 0))))


def _torques(eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding) -> tuple[Array, Array]:
    """Torques on the particles, shape (N, 3), and what resists their spins, shape (3 N, 3 N)."""
    twist = np.cross(at.n, at.T)
    torque = given["torque"] - eq.first.T @ (slides.lever[0][..., None] * twist)
    torque = torque - eq.second.T @ (slides.lever[1][..., None] * twist)
    apart = eq.first - eq.second
    return torque, _spread(apart, apart, slides.rolling).reshape(*twist.shape[:-2], 3 * eq.count, 3 * eq.count)


def _flat(values: Array) -> Array:
    """Vectors of all particles in one."""
    return np.reshape(values, (*values.shape[:-2], -1))


def _solved(matrix: Array, right: Array, known: Array, given: NDArray[np.bool_]) -> Array:
    """Solution of equations of which some unknowns are given."""
    right = right - _times(matrix, known)
    found = np.broadcast_to(known, right.shape).astype(right.dtype)
    if not given.all():
        left = matrix[..., ~given, :][..., ~given]
        found[..., ~given] = np.linalg.solve(left, right[..., ~given, None])[..., 0]
    return found


def _through_fluid(
    eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding | None, flow: Array, turn: Array
) -> tuple[Array, Array]:
    """Velocities and spins of particles that the fluid resists; it flows so, and turns at this rate about z."""
    force = given["force"] - (eq.first - eq.second).T @ at.push
    v = np.where(eq.fixed, given["velocity"], flow + force / eq.drag[:, None])
    spin = np.where(eq.turned[:, None], given["spin"], np.zeros_like(v))
    if slides is not None:
        torque, resist = _torques(eq, given, at, slides)
        resist = resist + np.diag(np.repeat(eq.spin_drag, 3))
        torque[..., 2] += eq.spin_drag * turn[..., None]
        spin = _solved(resist, _flat(torque), _flat(spin), np.repeat(eq.turned, 3)).reshape(v.shape)
    return v, spin


def _in_balance(eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding | None) -> tuple[Array, Array]:
    """Velocities and spins that keep forces and torques balanced where nothing resists the particles by themselves."""
    count, lead = eq.count, at.r.shape[:-1]
    F_ela, by_gap, by_delta = at.elastic
    dyad = at.n[..., :, None] * at.n[..., None, :]
    F_h = at.grip * (by_gap + by_delta / 2) + at.grip_h * F_ela
    curved = np.where(eq.j < count, at.grip * F_ela / at.r, 0.0)
    # rate of the push from i to j: a matrix times (v_i - v_j - far), and the rest
    by_apart = _by(at.grip * by_delta / 2) * dyad - _by(curved) * (ACROSS - dyad)
    rest = (F_h * at.gap_rate)[..., None] * at.n
    if slides is not None:
        by_apart, rest = by_apart + slides.by_v, rest + slides.still
    rest = rest - _times(by_apart, at.far)
    apart = eq.first - eq.second
    matrix = _spread(apart, apart, by_apart).reshape(*lead, 3 * count, 3 * count)
    right = _flat(given["force_rate"] - apart.T @ rest)
    known, fixed = _flat(np.where(eq.fixed, given["velocity"], 0.0)), eq.fixed.reshape(-1)
    if slides is not None:
        torque, rolling = _torques(eq, given, at, slides)
        rolling = rolling + _idle(eq, at, slides)
        sides = zip((eq.first, eq.second), slides.by_spin, strict=True)
        by_spin = sum(_spread(apart, part, block) for part, block in sides)
        by_spin = np.reshape(by_spin, (*lead, 3 * count, 3 * count))
        zero = np.zeros_like(by_spin)
        matrix = np.concatenate(
            [np.concatenate([matrix, by_spin], axis=-1), np.concatenate([zero, rolling], axis=-1)], axis=-2
        )
        right = np.concatenate([right, _flat(torque)], axis=-1)
        stays = np.repeat(eq.turned[:, None], 3, axis=1)
        stays[:, :2] |= eq.d == 2
        fixed = np.concatenate([fixed, stays.reshape(-1)])
        known = np.concatenate([known, _flat(np.where(eq.turned[:, None], given["spin"], 0.0))])
    # rows and columns of force and torque have units of their own: spins times the radius, each row to size one
    unit = np.concatenate([np.ones(3 * count), np.repeat(1 / eq.radii, 3)])[: len(known)]
    matrix = matrix * unit
    size = np.abs(matrix).max(axis=-1)
    size = np.where(size > 0, size, 1.0)
    matrix, right = matrix / size[..., None], right / size
    motions = eq.motions
    if len(motions):  # nothing moves or turns all together
        rows = np.broadcast_to(motions, (*lead, *motions.shape))
        zero = np.zeros((*lead, len(motions), len(motions)))
        matrix = np.concatenate(
            [np.concatenate([matrix, np.swapaxes(rows, -1, -2)], axis=-1), np.concatenate([rows, zero], axis=-1)],
            axis=-2,
        )
        right = np.concatenate([right, zero[..., 0]], axis=-1)
        known, fixed = np.pad(known, (0, len(motions))), np.pad(fixed, (0, len(motions)))
        unit = np.pad(unit, (0, len(motions)))
    found = unit * _solved(matrix, right, known / np.where(unit > 0, unit, 1.0), fixed)
    v = found[..., : 3 * count].reshape(*lead, count, 3)
    return v, found[..., 3 * count : 6 * count].reshape(*lead, count, 3) if slides is not None else np.zeros_like(v)


def _idle(eq: Equations, at: Contacts, slides: Sliding) -> Array:
    """What holds those spins that nothing resists: about the line of an only contact, and without any.

    Nothing drives these, so that any resistance keeps them 0; all others are left alone.
    """
    active = at.w.real.reshape(-1, len(eq.pairs))[0] > FAINT
    number = active @ (eq.first + eq.second)
    only = active[:, None] * (number == 1)
    strength = np.trace(slides.rolling, axis1=-2, axis2=-1)
    along = _by(strength) * at.n[..., :, None] * at.n[..., None, :]
    held = _spread(only * eq.first, only * eq.first, along) + _spread(only * eq.second, only * eq.second, along)
    largest = np.abs(strength).max(axis=-1)
    return np.reshape(held, (*at.r.shape[:-1], 3 * eq.count, -1)) + _by(largest) * np.diag(np.repeat(number == 0, 3))


def jacobian(eq: Equations, t: float, state: Array, part: int, mode: Mode) -> Array:
    """Derivatives of the rates by the state, to rounding: by an imaginary step, all columns at once."""
    step = 1e-40
    return np.asarray(tell(eq, t, state + 1j * step * np.eye(len(state)), part, mode).rates.imag.T / step)


def images(scene: ParticleScene, d: int) -> Iterator[tuple[int, int, int]]:
    """Lattice vectors to look for neighbours at."""
    spans = [(0,) if length is None else (-2, -1, 0, 1, 2) for length in (scene.box or [None] * d)] + [(0,)] * (3 - d)
    yield from ((p, q, s) for p in spans[0] for q in spans[1] for s in spans[2])


def near(case: Case, x: Array, z: Array, beside: float = 0.0) -> set[Pair]:
    """Pairs whose surfaces are within the range of one another, or by so many radii beyond it."""
    scene, (count, d) = case.scene, x.shape
    reach = math.inf if scene.reach is None else float(scene.reach)
    radii = np.broadcast_to(np.array(scene.radii, dtype=float), (count,))
    reach += beside * float(radii.min())
    cell = np.diag([math.exp(z[k]) if k < d and (scene.box or [None] * d)[k] is not None else 0.0 for k in range(3)])
    cell[0, 1] = z[3]
    place = np.pad(x, ((0, 0), (0, 3 - d)))
    found: set[Pair] = set()
    for shift in images(scene, d):
        apart = np.linalg.norm(place[None, :] - place[:, None] + cell @ shift, axis=2) - radii[:, None] - radii
        found |= {(int(i), int(j), shift) for i, j in np.argwhere(apart < reach) if i < j}
    points = z[4:].reshape(-1, 3)
    for w, wall in enumerate(scene.walls):
        normal = np.array(wall.normal, float) / np.linalg.norm(wall.normal)
        apart = (points[w, :d] - x) @ normal - radii
        found |= {(int(i), count + w, (0, 0, 0)) for i in np.flatnonzero(apart < reach)}
    return found


class Beyond(ArithmeticError):
    """The reference itself cannot be computed."""


def balanced(eq: Equations, t: float, state: Array, part: int) -> Array:
    """Without drag: positions in elastic equilibrium at the gaps of a state.

    Beyond their range surfaces do not press, and the gap follows the centres, until it is the range.
    """
    x, u, T, z = unpack(eq, state.copy())
    given = eq.given(t, part)
    held, free = np.exp(u), ~eq.fixed.reshape(-1)
    pair = eq.j < eq.count
    apart = eq.first - eq.second
    for _ in range(60):
        n, r = geometry(eq, x, z)
        gap = np.where(held < eq.reach, held, np.where(r - eq.S < held, np.maximum(r - eq.S, eq.reach), held))
        deflection = (eq.S - r + gap) / 2
        elastic, _, by_delta, *_ = (np.broadcast_to(v, gap.shape) for v in eq.law_of(gap, deflection, *eq.q))
        _, _, grip, _ = weights(eq, gap, np.where(deflection < 0, PULLED, PRESSED))
        left = given["force"] - apart.T @ ((grip * elastic)[:, None] * n + T)
        dyad = n[:, :, None] * n[:, None, :]
        block = _by(grip * by_delta / 2) * dyad - _by(np.where(pair, grip * elastic / r, 0.0)) * (ACROSS - dyad)
        matrix = _spread(apart, apart, block).reshape(3 * eq.count, -1)[np.ix_(free, free)]
        change = np.linalg.lstsq(matrix, left.reshape(-1)[free], rcond=FREE)[0]
        factor = min(1.0, 0.1 * float(eq.radii.min()) / max(float(np.abs(change).max(initial=0.0)), 1e-300))
        x.reshape(-1)[free] += factor * change
        if np.abs(change).max(initial=0.0) < 1e-14 * eq.radii.max():
            return pack(eq, x, np.log(gap), T, z)
    raise Beyond("no elastic equilibrium is found")


def settled(eq: Equations, t: float, state: Array, part: int, before: Mode | None = None) -> tuple[Array, Mode]:
    """A state, and what its contacts are from then on; those that ride have exactly the gap that goes with it."""
    x, u, T, z = unpack(eq, state.copy())
    _, r = geometry(eq, x, z)
    gap, length = np.exp(u), float(eq.radii.min())
    deflection = (eq.S - r + gap) / 2
    if math.isinf(eq.reach):
        return state, np.full(len(gap), PRESSED)
    beyond = gap >= eq.reach * (1 - AT_RANGE)
    rides = beyond & (deflection >= -NONE * length)
    rides |= False if before is None else before == RIDES
    u, T = np.where(rides, np.log(np.where(rides, r - eq.S, 1.0)), u), np.where(rides[:, None], 0.0, T)
    state = pack(eq, x, u, T, z)
    mode = np.where(rides & beyond, RIDES, np.where(deflection < 0, PULLED, PRESSED))
    level = rides | (np.abs(deflection) <= NONE * length)
    if level.any():
        opening = tell(eq, t, state, part, mode).opening
        mode = np.where(level & (opening < 0), PULLED, np.where(level & ~beyond, PRESSED, mode))
    return state, mode


def lasting(eq: Equations, t: float, state: Array, part: int, mode: Mode) -> float:
    """Above 0 as long as all contacts are what they were."""
    now = tell(eq, t, state, part, mode)
    size, margin = now.deflection / float(eq.radii.min()), 2 * NONE
    pressed = np.minimum(size + margin, 1 - now.gap / eq.reach)
    rides = np.minimum(now.gap / eq.reach - 1 + 2 * AT_RANGE, now.opening / np.abs(now.rates).max() + margin)
    left = np.where(mode == PRESSED, pressed, np.where(mode == PULLED, margin - size, rides))
    return float(left.min(initial=1.0))


def integrate(eq: Equations, first: Array, times: Array, rtol: float) -> Array:
    """States at the times, the first of which is that of ``first``, shape (times, ...)."""
    ends = [float(times[0]), *(t for t in eq.breaks if times[0] < t < times[-1]), float(times[-1])]
    force = max(float(np.abs(now_of(eq, t, first).F).max(initial=0.0)) for t in ends)
    stiff = float(np.abs(eq.law_of(np.exp(unpack(eq, first)[1]), 0 * eq.S, *eq.q)[2]).max()) if len(eq.pairs) else 1.0
    scale = max(force, 1e-3 * stiff * float(eq.radii.min()))
    c, length = len(eq.pairs), float(eq.radii.min())
    around = np.concatenate([np.ones(3), np.full(1 + 3 * eq.walls, length)])
    size = pack(eq, np.full((eq.count, 3), length), np.ones(c), np.full((c, 3), scale), around)
    states, state, taken = [first], first, 0

    def rates(t: float, state: Array, part: int, mode: Mode) -> Array:
        nonlocal taken
        taken += 1
        if taken > MOST_EVALUATIONS:
            raise Beyond(f"{MOST_EVALUATIONS} evaluations of the equations are not enough: t={t:.4g} is reached")
        return tell(eq, t, state, part, mode).rates

    for start, end in pairwise(ends):
        part, t, mode = part_of(eq, (start + end) / 2), start, None
        if start > ends[0] and not eq.dragged:
            state = jumped(eq, start, state, part)
        while t < end:
            state, mode = settled(eq, t, state, part, mode)

            def changes(t: float, y: Array, *of: Any) -> float:
                return lasting(eq, t, y, *of)

            changes.terminal, changes.direction = True, -1  # type: ignore[attr-defined]
            wanted = [*times[(t < times) & (times < end)], end]
            with np.errstate(all="ignore"):
                done = solve_ivp(
                    rates, (t, end), state, method="Radau", t_eval=wanted, rtol=rtol,
                    atol=0.1 * rtol * size, max_step=(end - start) / 4, args=(part, mode),
                    jac=lambda t, y, *of: jacobian(eq, t, y, *of),
                    events=None if math.isinf(eq.reach) else changes,
                )  # fmt: skip
            found = np.reshape(done.y, (len(state), -1)).T  # empty, it is no array
            if not done.success or not np.isfinite(found).all():
                raise Beyond(f"scipy gives up at t={done.t[-1] if len(done.t) else t:.4g}: {done.message}")
            states += [y for when, y in zip(done.t, found, strict=True) if when < end]
            ended = done.status == 0
            t, state = (end, found[-1]) if ended else (float(done.t_events[0][0]), done.y_events[0][0])
        if end in times:
            states.append(state)
    return np.array(states)


def now_of(eq: Equations, t: float, state: Array) -> Now:
    """All that the equations say of a state by itself; at a break of the drives, before it."""
    part = part_of(eq, t)
    state, mode = settled(eq, t, state, part)
    return tell(eq, t, state, part, mode)


def jumped(eq: Equations, t: float, state: Array, after: int) -> Array:
    """State behind a jump of the forces, where nothing but films resists for an instant: these stay as they are.

    With tangential motion what surfaces stick by depends on the way: all forces change together.
    """
    jump = eq.given(t, after)["force"] - eq.given(t, part_of(eq, t))["force"]
    if np.abs(jump).max() < FREE * np.abs(eq.given(t, after)["force"]).max():
        return state
    if not eq.slides:
        return balanced(eq, t, state, after)
    raise Beyond("a jump of forces where surfaces slide")


def solve(case: Case, times: Array, rtol: float, looks: int = 8) -> tuple[Equations, Array]:
    """States of a case at the output times.

    Contacts that come within range on the way are found by looking ``looks`` times between two outputs, and the whole
    is integrated once more with them.
    """
    scene = case.scene
    x = np.array(scene.positions, dtype=float)
    d = x.shape[1]
    z = first_surroundings(scene, d)
    pairs = near(case, x, z, BESIDE)
    fine = np.interp(np.arange((len(times) - 1) * looks + 1) / looks, np.arange(len(times)), times)
    for _ in range(8):
        eq = set_up(case, sorted(pairs))
        place = np.pad(x, ((0, 0), (0, 3 - d)))
        apart = geometry(eq, place, z)[1] - eq.S
        gap = apart if scene.gap is None else np.maximum(apart, scene.gap)
        if (gap <= 0).any():
            raise Beyond("surfaces overlap, and no gap is given")
        first = pack(eq, place, np.log(gap), np.zeros((len(pairs), 3)), z)
        if not eq.dragged:
            first = balanced(eq, 0.0, first, 0)
        states = integrate(eq, first, fine, rtol)
        met = set(pairs)
        for state in states:
            place, _, _, around = unpack(eq, state)
            met |= near(case, place[:, :d], around)
        if met == pairs:
            return eq, states[::looks]
        pairs = met
    raise Beyond("new contacts are found without end")
