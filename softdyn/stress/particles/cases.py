"""A scene as arrays: the law as functions, drives piece by piece, contacts and what is given of the particles.

Nothing of the engine is in them but the declaration of the law, as sympy makes functions of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Abs, Expr, Float, Max, Min, Piecewise, Symbol, diff, lambdify

from softdyn.derive import E, R, a, delta, eta, h, size_ratio
from softdyn.derive.law import ContactLaw, tangential_expressions
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.until import run_end

Array = NDArray[np.float64]
#: A contact: particle i, particle j or wall j - N, and the lattice vector by which j is displaced.
Pair = tuple[int, int, tuple[int, int, int]]
#: A function of t: where each piece begins, and what it is from there on. A piece may be the same as the one before,
#: where an integrator should look anew.
Pieces = Sequence[tuple[float, Expr]]
#: Singular values below this part of the largest belong to motions that nothing resists.
FREE = 1e-9
ACROSS = np.eye(3)


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
    """Function of h, delta and ``names``: F_ela, its slopes in h and delta, zeta, F_adh, and A, B, G, k_t.

    Parameters
    ----------
    law : ContactLaw
    names : tuple of str
        Of the parameters that the law has in a contact, in the order in which the function takes them.
    tangential : bool
        Whether A, B, G and k_t are wanted, which the law must declare then.
    """
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
    arguments = [h, delta, *(symbols[name] for name in names)]
    function: Callable[..., Any] = lambdify(arguments, found, modules=modules, cse=True)
    return function


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
        return math.inf if self.case.scene.range is None else float(self.case.scene.range)

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
    for push in scene.push:
        for k in _numbers(push.particles, count, scene):
            entries += [("force", (k, axis), value) for axis, value in enumerate(push.force or ())]
            entries += [("torque", (k, axis), value) for axis, value in zip(_spins(d), push.torque or (), strict=False)]
    for hold in scene.hold:
        for k in _numbers(hold.particles, count, scene):
            entries += [
                ("velocity", (k, "xyz".index(axis)), value)
                for axis, value in zip(hold.axes, hold.velocity or (), strict=False)
            ]
            entries += [("spin", (k, axis), value) for axis, value in zip(_spins(d), hold.spin or (), strict=False)]
    for w, wall in enumerate(scene.wall):
        entries += [("wall", (w, axis), value) for axis, value in enumerate(wall.velocity or ())]
    entries.append(("shear", 0, scene.shear_rate))
    entries += [("stress", k, value) for k, value in enumerate(scene.stress.values())]
    breaks = sorted({when for *_, value in entries for when, _ in pieces_of(case, value)[1:]})
    middles = [(one + other) / 2 for one, other in zip([0.0, *breaks], [*breaks, 2 * run_end(scene)], strict=True)]
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
    shapes |= {"wall": (len(scene.wall), 3), "stress": (len(scene.stress),)}

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
    rigid = np.array([w.rigid for w in scene.wall] or [False])[np.where(wall, j - count, 0)] & wall
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
    for hold in scene.hold:
        for k in _numbers(hold.particles, count, scene):
            fixed[k, ["xyz".index(axis) for axis in hold.axes]] = True
            turned[k] |= hold.spin is not None
    normals = np.zeros((len(scene.wall), 3))
    for w, entry in enumerate(scene.wall):
        normals[w, :d] = np.array(entry.normal, float) / np.linalg.norm(entry.normal)
    viscosity = float(scene.parameters.get("eta", 0.0))  # type: ignore[arg-type]
    S = radii[i] + np.where(wall, 0.0, other)
    friction_of = _function(case.law, tuple(own), _by_cases((case.law.zeta * case.law.unequal).subs(a, case.law.a)))
    given, breaks = _drives(case, d, count)
    periodic = np.array([length is not None for length in (scene.box or [None] * d)] + [False] * (3 - d))
    first, second = (np.equal.outer(end, np.arange(count)).astype(float) for end in (i, j))
    loose = not (scene.drag or fixed[:, :d].any() or len(scene.wall) or periodic.any())
    return Equations(
        case=case, d=d, count=count, walls=len(scene.wall), radii=radii, pairs=pairs, i=i, j=j,
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


def first_surroundings(scene: ParticleScene, d: int) -> Array:
    """Logarithms of the lengths of the box (0 where there are none), tilt, points of the walls."""
    lengths = [1.0 if length is None else float(length) for length in (scene.box or [None] * d)]
    points = np.zeros((len(scene.wall), 3))
    for w, wall in enumerate(scene.wall):
        points[w, :d] = wall.point
    return np.concatenate([np.log([*lengths, *[1.0] * (3 - d)]), [float(scene.tilt)], points.reshape(-1)])
