"""The equations of a few particles, written down once more, in plain numpy, and integrated by scipy.

Nothing of the engine is in them but the declaration of the law, as sympy makes functions of it. The state holds
positions, ln h of every contact, its tangential force, and what surrounds the particles: logarithms of the lengths of
the box, its tilt, points of the walls. Everything is a vector of three components, whatever the dimension.

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
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import Expr, Symbol, diff, lambdify

from softdyn.derive import E, R, a, delta, eta, h, size_ratio
from softdyn.derive.law import ContactLaw, tangential_expressions
from softdyn.particles.scene import ParticleScene

Array = NDArray[np.float64]
#: A contact: particle i, particle j or wall j - N, and the lattice vector by which j is displaced.
Pair = tuple[int, int, tuple[int, int, int]]

#: Weight of a film that has none, lest its equation be algebraic; forces are off by as much.
THIN = 1e-7
#: Singular values below this part of the largest belong to motions that nothing resists.
FREE = 1e-9
ACROSS = np.eye(3)
#: Beyond this effort a scene is left without a reference.
MOST_EVALUATIONS = 20_000


@dataclass(frozen=True)
class Case:
    """A scene, and its drives as functions.

    Attributes
    ----------
    scene : ParticleScene
    drives : mapping from str to sympy expression of t
        By the text that stands for each in the scene.
    law : ContactLaw
    kind : str
        For the report.
    """

    scene: ParticleScene
    drives: Mapping[str, Expr]
    law: ContactLaw
    kind: str


def values_of(law: ContactLaw, names: tuple[str, ...], tangential: bool) -> Callable[..., Any]:
    """Function of h, delta and ``names``: F_ela, its slopes in h and delta, zeta, F_adh, and A, B, G, k_t."""
    elastic = law.F_ela.subs(a, law.a)
    found = [
        elastic,
        diff(elastic, h),
        diff(elastic, delta),
        (law.zeta * law.unequal).subs(a, law.a),
        law.F_adh.subs(a, law.a),
    ]
    if tangential:
        assert law.tangential is not None
        found += [expr.subs(a, law.a) for expr in tangential_expressions(law.tangential).values()]
    symbols = {symbol.name: symbol for symbol in (R, E, eta, size_ratio, *law.parameters)}
    return lambdify([h, delta, *(symbols[name] for name in names)], found, modules="numpy", cse=True)


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
    law_of : function
        See :func:`values_of`.
    unlike : array
        D = (R_i - R_j)/(R_i + R_j), -1 at walls.
    fixed, turned : array of bool, shape (N, 3), (N,)
        Coordinates whose velocity is given, and particles whose spin is.
    drag, spin_drag : array, shape (N,)
    rate_of : function of t
        External force, torque, its rate, given velocities and spins, velocities of walls, shear rate, stress.
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
    unlike: Array
    fixed: NDArray[np.bool_]
    turned: NDArray[np.bool_]
    drag: Array
    spin_drag: Array
    normals: Array
    imposed: tuple[str, ...]
    given: Callable[[float], dict[str, Array]]
    periodic: NDArray[np.bool_]

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
        return not (self.dragged or self.fixed.any() or self.walls or self.periodic.any())


def _numbers(particles: Any, count: int, scene: ParticleScene) -> list[int]:
    if isinstance(particles, str):
        return [k for k in range(count) if particles == "all" or list(scene.species or [])[k] == particles]
    return list(particles)


def _drives(case: Case, d: int, count: int) -> Callable[[float], dict[str, Array]]:
    """All that is given as a function of t, by name."""
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
    expressions = [case.drives[value] if isinstance(value, str) else value for _, _, value in entries]
    functions = lambdify(t, expressions, modules="math", cse=True)
    rates = lambdify(
        t, [diff(expr, t) if isinstance(expr, Expr) else 0.0 for expr in expressions], modules="math", cse=True
    )
    shapes = {"force": (count, 3), "torque": (count, 3), "velocity": (count, 3), "spin": (count, 3), "shear": (1,)}
    shapes |= {"wall": (len(scene.walls), 3), "stress": (len(scene.stress),)}

    def given(when: float) -> dict[str, Array]:
        found = {name: np.zeros(shape) for name, shape in shapes.items()}
        found["force_rate"] = np.zeros((count, 3))
        for (name, where, _), value, rate in zip(entries, functions(when), rates(when), strict=True):
            found[name][where] += value
            if name == "force":
                found["force_rate"][where] += rate
        return found

    return given


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
    return Equations(
        case=case, d=d, count=count, walls=len(scene.walls), radii=radii, pairs=pairs, i=i, j=j,
        shift=np.array([p[2] for p in pairs], dtype=float).reshape(-1, 3),
        S=radii[i] + np.where(wall, 0.0, other), q=list(own.values()),
        law_of=values_of(case.law, tuple(own), bool(scene.tangential)),
        unlike=np.where(wall, -1.0, (one - other) / (one + other)), fixed=fixed, turned=turned,
        drag=6 * math.pi * viscosity * radii * scene.drag, spin_drag=8 * math.pi * viscosity * radii**3 * scene.drag,
        normals=normals, imposed=tuple(scene.stress), given=_drives(case, d, count),
        periodic=np.array([length is not None for length in (scene.box or [None] * d)] + [False] * (3 - d)),
    )  # fmt: skip


def unpack(eq: Equations, state: Array) -> tuple[Array, Array, Array, Array]:
    """Positions (N, 3), ln h, tangential forces (contacts, 3), surroundings."""
    n, c = eq.count * eq.d, len(eq.pairs)
    x = np.zeros((eq.count, 3))
    x[:, : eq.d] = state[:n].reshape(eq.count, eq.d)
    T = state[n + c : n + 4 * c].reshape(c, 3) if eq.slides else np.zeros((c, 3))
    return x, state[n : n + c], T, state[n + (4 * c if eq.slides else c) :]


def pack(eq: Equations, x: Array, u: Array, T: Array, z: Array) -> Array:
    """State, or its rates."""
    return np.concatenate([x[:, : eq.d].reshape(-1), u, T.reshape(-1) if eq.slides else [], z])


def first_surroundings(scene: ParticleScene, d: int) -> Array:
    """Logarithms of the lengths of the box (0 where there are none), tilt, points of the walls."""
    lengths = [1.0 if length is None else float(length) for length in (scene.box or [None] * d)]
    points = np.zeros((len(scene.walls), 3))
    for w, wall in enumerate(scene.walls):
        points[w, :d] = wall.point
    return np.concatenate([np.log([*lengths, *[1.0] * (3 - d)]), [float(scene.tilt)], points.reshape(-1)])


def cell_of(eq: Equations, z: Array) -> Array:
    """Lattice vectors as columns."""
    cell = np.diag(np.where(eq.periodic, np.exp(z[:3]), 0.0))
    cell[0, 1] = z[3]
    return cell


def geometry(eq: Equations, x: Array, z: Array) -> tuple[Array, Array]:
    """Normals and distances."""
    wall = eq.j >= eq.count
    points = z[4:].reshape(-1, 3)
    along = x[np.where(wall, eq.i, eq.j)] - x[eq.i] + eq.shift @ cell_of(eq, z).T
    r = np.linalg.norm(along, axis=1)
    n = along / np.where(wall, 1.0, r)[:, None]
    for c in np.flatnonzero(wall):
        n[c] = eq.normals[eq.j[c] - eq.count]
        r[c] = (points[eq.j[c] - eq.count] - x[eq.i[c]]) @ n[c]
    return n, r


def weights(eq: Equations, gap: Array, deflection: Array) -> tuple[Array, Array, Array, Array]:
    """Weight w, falling from 1 to 0 between half of the range and the range; film, grip, and the slope of grip in h.

    Of pressed surfaces the film fades, of pulled ones the force.
    """
    ahead = np.clip(2 * (1 - gap / eq.reach), 0.0, 1.0)
    w = ahead**2 * (3 - 2 * ahead)
    pulled = deflection < 0
    slope = np.where(pulled, 6 * ahead * (1 - ahead) * -2 / eq.reach, 0.0)
    return w, np.where(pulled, 1.0, np.maximum(w, THIN)), np.where(pulled, w, 1.0), slope


@dataclass
class Now:
    """All that the equations say of a state."""

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


@dataclass
class Contacts:
    """What the contacts are at a state.

    Attributes
    ----------
    n, T, push, far : array, shape (contacts, 3)
        Normals, tangential forces, forces from i to j; velocity of the image of j or of the wall.
    r, gap, deflection, w, grip, grip_h, gap_rate : array, shape (contacts,)
    elastic : tuple of array
        F_ela and its slopes in h and delta.
    tangential : list of array
        A, B, G, k_t.
    pair : array of bool
        Whether j is a particle.
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
    pair: NDArray[np.bool_]


@dataclass
class Sliding:
    """Tangential motion of the contacts, linear in velocities and spins.

    Attributes
    ----------
    lever : array, shape (2, contacts)
    rolling, by_v : array, shape (contacts, 3, 3)
        Moment by a relative rotation; dT/dt by v_i - v_j.
    by_spin : list of two arrays, shape (contacts, 3, 3)
        dT/dt by the spins of i and j.
    still : array, shape (contacts, 3)
        dT/dt where nothing moves.
    """

    lever: Array
    rolling: Array
    by_v: Array
    by_spin: list[Array]
    still: Array


def tell(eq: Equations, t: float, state: Array) -> Now:
    """Forces, velocities and rates of a state."""
    x, u, T, z = unpack(eq, state)
    given, cell = eq.given(t), cell_of(eq, z)
    n, r = geometry(eq, x, z)
    gap = np.exp(u)
    deflection = (eq.S - r + gap) / 2
    found = np.broadcast_arrays(*eq.law_of(gap, deflection, *eq.q), gap)[:-1]
    elastic, by_gap, by_delta, zeta, remote, *tangential = found
    if eq.dragged:  # a contact carries what exceeds the drags of its particles by themselves
        alone, far_away = (eq.law_of(size, 0 * gap, *eq.q)[3] for size in (gap, 1e10 * eq.S))
        zeta = zeta * (1 - min(float(eq.case.scene.drag), 1.0) * far_away / alone)
    w, film, grip, grip_h = weights(eq, gap, deflection)
    F, T = grip * elastic, T - np.einsum("ca,ca->c", T, n)[:, None] * n
    push = F[:, None] * n + T

    stress = -np.einsum("c,ca,cb->ab", r, push, n)
    depth = float(eq.case.scene.depth or 2 * eq.radii.mean())
    boxed = eq.periodic[: eq.d].all()
    volume = float(np.prod(np.exp(z[:3])[: eq.d])) * depth ** (3 - eq.d) if boxed else 1.0
    gradient = box_gradient(eq, given, (stress + stress.T) / (2 * volume))
    cell_rate = gradient @ cell
    far = np.concatenate([np.zeros((eq.count, 3)), given["wall"]])[eq.j] + eq.shift @ cell_rate.T

    at = Contacts(
        n, r, gap, deflection, w, grip, grip_h, -(elastic / film - remote) / zeta, (elastic, by_gap, by_delta),
        tangential, T, push, far, eq.j < eq.count,
    )  # fmt: skip
    slides = _sliding(eq, at) if eq.slides else None
    move = _through_fluid if eq.dragged else _in_balance
    v, spin = move(eq, given, at, slides, x @ gradient.T, -gradient[0, 1] / 2)
    T_rate = np.zeros_like(n)
    if slides is not None:
        every, turns = np.concatenate([v, np.zeros((eq.walls, 3))]), np.concatenate([spin, np.zeros((eq.walls, 3))])
        T_rate = slides.still + np.einsum("cab,cb->ca", slides.by_v, every[eq.i] - every[eq.j] - far)
        for end, by_spin in zip((eq.i, eq.j), slides.by_spin, strict=True):
            T_rate += np.einsum("cab,cb->ca", by_spin, turns[end])
    z_rate = np.concatenate([np.diag(gradient), [cell_rate[0, 1]], given["wall"].reshape(-1)])
    rates = pack(eq, v, at.gap_rate / gap, T_rate, z_rate)
    return Now(n, r, gap, deflection, F, T, v, spin, stress / volume, cell, gradient, rates)


def box_gradient(eq: Equations, given: Mapping[str, Array], stress: Array) -> Array:
    """Velocity gradient: given, or such that 2 eta D and the stress of the contacts are the imposed one."""
    gradient = np.zeros((3, 3))
    gradient[0, 1] = given["shear"][0]
    scene = eq.case.scene
    viscosity = float(scene.stress_viscosity or scene.parameters.get("eta", 0.0))  # type: ignore[arg-type]
    for name, value in zip(eq.imposed, given["stress"], strict=True):
        if name == "pressure":
            mean = np.trace(stress[: eq.d, : eq.d]) / eq.d
            gradient[range(eq.d), range(eq.d)] = (-value - mean) / (2 * viscosity)
        else:
            row, column = "xyz".index(name[0]), "xyz".index(name[1])
            gradient[row, column] = (value - stress[row, column]) / (viscosity if row != column else 2 * viscosity)
    return gradient


def _skew(vectors: Array) -> Array:
    """Matrices of v x."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return out - out.transpose(0, 2, 1)


def _sliding(eq: Equations, at: Contacts) -> Sliding:
    """dT/dt = k_t (slip - T/(w A)) + turning x T."""
    A, B, G, k_t = at.tangential
    dyad = at.n[:, :, None] * at.n[:, None, :]
    excess, shift = (at.r - eq.S) / 2, eq.unlike * B / A
    radius_j = np.append(eq.radii, np.zeros(eq.walls))[eq.j]
    lever = np.array([eq.radii[eq.i] + excess + shift, radius_j + excess - shift])
    rolling = (at.w * (G - (eq.unlike * B) ** 2 / A))[:, None, None] * (ACROSS - dyad)
    spun = -_skew(at.T) @ dyad / 2  # ((spin . n)/2) n x T
    turn = np.where(at.pair, 1 / at.r, 0.0)[:, None, None] * (_skew(at.T) @ _skew(at.n))  # -(n x apart)/r x T
    stiff = k_t[:, None, None]
    by_spin = [-stiff * arm[:, None, None] * _skew(at.n) + spun for arm in lever]
    still = -(k_t / (np.maximum(at.w, THIN) * A))[:, None] * at.T
    return Sliding(lever, rolling, stiff * (ACROSS - dyad) + turn, by_spin, still)


def _torques(eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding) -> tuple[Array, Array]:
    """Torques on the particles, shape (N, 3), and what resists their spins, shape (3 N, 3 N)."""
    torque, resist = given["torque"].copy(), np.zeros((eq.count, 3, eq.count, 3))
    twist = np.cross(at.n, at.T)
    np.subtract.at(torque, eq.i, slides.lever[0][:, None] * twist)
    np.subtract.at(torque, eq.j[at.pair], (slides.lever[1][:, None] * twist)[at.pair])
    for c, (one, other) in enumerate(zip(eq.i, eq.j, strict=True)):
        resist[one, :, one, :] += slides.rolling[c]
        if at.pair[c]:
            resist[other, :, other, :] += slides.rolling[c]
            resist[one, :, other, :] -= slides.rolling[c]
            resist[other, :, one, :] -= slides.rolling[c]
    return torque, resist.reshape(3 * eq.count, -1)


def _through_fluid(
    eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding | None, flow: Array, turn: float
) -> tuple[Array, Array]:
    """Velocities and spins of particles that the fluid resists; it flows so, and turns at this rate about z."""
    force = given["force"].copy()
    np.subtract.at(force, eq.i, at.push)
    np.add.at(force, eq.j[at.pair], at.push[at.pair])
    v = np.where(eq.fixed, given["velocity"], flow + force / eq.drag[:, None])
    spin = np.where(eq.turned[:, None], given["spin"], 0.0)
    if slides is not None:
        torque, resist = _torques(eq, given, at, slides)
        resist += np.diag(np.repeat(eq.spin_drag, 3))
        torque[:, 2] += eq.spin_drag * turn
        unknown = np.repeat(~eq.turned, 3)
        right = torque.reshape(-1) - resist @ spin.reshape(-1)
        spin.reshape(-1)[unknown] = np.linalg.solve(resist[np.ix_(unknown, unknown)], right[unknown])
    return v, spin


def _in_balance(
    eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding | None, flow: Array, turn: float
) -> tuple[Array, Array]:
    """Velocities and spins that keep forces and torques balanced where nothing resists the particles by themselves."""
    count = eq.count
    F_ela, by_gap, by_delta = at.elastic
    dyad = at.n[:, :, None] * at.n[:, None, :]
    F_r = (-at.grip * by_delta / 2)[:, None, None]
    F_h = at.grip * (by_gap + by_delta / 2) + at.grip_h * F_ela
    curved = np.where(at.pair, at.grip * F_ela / at.r, 0.0)[:, None, None]
    # rate of the push from i to j: a matrix times (v_i - v_j - far), and the rest
    by_apart, rest = -(F_r * dyad + curved * (ACROSS - dyad)), (F_h * at.gap_rate)[:, None] * at.n
    if slides is not None:
        by_apart, rest = by_apart + slides.by_v, rest + slides.still
    rest = rest - np.einsum("cab,cb->ca", by_apart, at.far)
    width = 3 if slides is None else 6
    matrix, right = np.zeros((width * count, width * count)), np.zeros(width * count)
    right[: 3 * count] = given["force_rate"].reshape(-1)

    def add(row: int, column: int, block: Array) -> None:
        matrix[3 * row : 3 * row + 3, 3 * column : 3 * column + 3] += block

    for c, (one, other) in enumerate(zip(eq.i.tolist(), eq.j.tolist(), strict=True)):
        for end, sign in ((one, 1.0), (other, -1.0)) if at.pair[c] else ((one, 1.0),):
            right[3 * end : 3 * end + 3] -= sign * rest[c]
            add(end, one, sign * by_apart[c])
            if at.pair[c]:
                add(end, other, -sign * by_apart[c])
            if slides is not None:
                add(end, count + one, sign * slides.by_spin[0][c])
                if at.pair[c]:
                    add(end, count + other, sign * slides.by_spin[1][c])
    known, fixed = np.where(eq.fixed, given["velocity"], 0.0).reshape(-1), eq.fixed.reshape(-1)
    if slides is not None:
        torque, matrix[3 * count :, 3 * count :] = _torques(eq, given, at, slides)
        right[3 * count :] = torque.reshape(-1)
        stays = np.repeat(eq.turned[:, None], 3, axis=1)
        stays[:, :2] |= eq.d == 2
        fixed = np.concatenate([fixed, stays.reshape(-1)])
        known = np.concatenate([known, np.where(eq.turned[:, None], given["spin"], 0.0).reshape(-1)])
    right = right - matrix @ known
    # rows and columns of force and torque have units of their own: spins times the radius, each row to size one
    unit = np.concatenate([np.ones(3 * count), np.repeat(1 / eq.radii, 3)])[: len(known)][~fixed]
    left = matrix[np.ix_(~fixed, ~fixed)] * unit
    size = np.abs(left).max(axis=1, initial=0.0)
    size = np.where(size > 0, size, 1.0)
    known[~fixed] = unit * np.linalg.lstsq(left / size[:, None], right[~fixed] / size, rcond=FREE)[0]
    return known[: 3 * count].reshape(count, 3), known[3 * count :].reshape(-1, 3)


def images(scene: ParticleScene, d: int) -> Iterator[tuple[int, int, int]]:
    """Lattice vectors to look for neighbours at."""
    spans = [(0,) if length is None else (-2, -1, 0, 1, 2) for length in (scene.box or [None] * d)] + [(0,)] * (3 - d)
    yield from ((p, q, s) for p in spans[0] for q in spans[1] for s in spans[2])


def near(case: Case, x: Array, z: Array) -> set[Pair]:
    """Pairs whose surfaces are within the range of one another."""
    scene, (count, d) = case.scene, x.shape
    reach = math.inf if scene.reach is None else float(scene.reach)
    radii = np.broadcast_to(np.array(scene.radii, dtype=float), (count,))
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


def balanced(eq: Equations, t: float, state: Array) -> Array:
    """Without drag: positions in elastic equilibrium at the gaps of a state."""
    x, u, T, z = unpack(eq, state)
    given = eq.given(t)
    gap, free = np.exp(u), ~eq.fixed.reshape(-1)
    for _ in range(60):
        n, r = geometry(eq, x, z)
        deflection = (eq.S - r + gap) / 2
        elastic, _, by_delta, *_ = np.broadcast_arrays(*eq.law_of(gap, deflection, *eq.q), gap)[:-1]
        _, _, grip, _ = weights(eq, gap, deflection)
        pair = eq.j < eq.count
        left = given["force"].copy()
        push = (grip * elastic)[:, None] * n + T
        np.subtract.at(left, eq.i, push)
        np.add.at(left, eq.j[pair], push[pair])
        dyad = n[:, :, None] * n[:, None, :]
        block = (grip * by_delta / 2)[:, None, None] * dyad - np.where(pair, grip * elastic / r, 0.0)[:, None, None] * (
            ACROSS - dyad
        )
        matrix = np.zeros((eq.count, 3, eq.count, 3))
        for c, (one, other) in enumerate(zip(eq.i, eq.j, strict=True)):
            matrix[one, :, one, :] += block[c]
            if pair[c]:
                matrix[other, :, other, :] += block[c]
                matrix[one, :, other, :] -= block[c]
                matrix[other, :, one, :] -= block[c]
        flat = matrix.reshape(3 * eq.count, -1)[np.ix_(free, free)]
        change = np.linalg.lstsq(flat, left.reshape(-1)[free], rcond=FREE)[0]
        factor = min(1.0, 0.1 * float(eq.radii.min()) / max(float(np.abs(change).max(initial=0.0)), 1e-300))
        x.reshape(-1)[free] += factor * change
        if np.abs(change).max(initial=0.0) < 1e-14 * eq.radii.max():
            return pack(eq, x, u, T, z)
    raise Beyond("no elastic equilibrium is found")


def integrate(eq: Equations, first: Array, times: Array, rtol: float) -> Array:
    """States at the times, the first of which is that of ``first``, shape (times, ...)."""
    force = max(float(np.abs(tell(eq, float(times[k]), first).F).max(initial=0.0)) for k in (0, -1))
    stiff = float(np.abs(eq.law_of(np.exp(unpack(eq, first)[1]), 0 * eq.S, *eq.q)[2]).max()) if len(eq.pairs) else 1.0
    scale = max(force, 1e-5 * stiff * float(eq.radii.min()))
    c, length = len(eq.pairs), float(eq.radii.min())
    around = np.concatenate([np.ones(3), np.full(1 + 3 * eq.walls, length)])
    size = pack(eq, np.full((eq.count, 3), length), np.ones(c), np.full((c, 3), scale), around)
    taken = 0

    def rates(t: float, state: Array) -> Array:
        nonlocal taken
        taken += 1
        if taken > MOST_EVALUATIONS:
            raise Beyond(f"{MOST_EVALUATIONS} evaluations of the equations are not enough: t={t:.4g} is reached")
        return tell(eq, t, state).rates

    with np.errstate(all="ignore"):
        done = solve_ivp(
            rates, (float(times[0]), float(times[-1])), first, method="LSODA", t_eval=times, rtol=rtol,
            atol=0.1 * rtol * size,
        )  # fmt: skip
    if not done.success or not np.isfinite(done.y).all():
        raise Beyond(f"scipy gives up at t={done.t[-1] if len(done.t) else 0:.4g}: {done.message}")
    return np.asarray(done.y.T)


def solve(case: Case, times: Array, rtol: float, looks: int = 8) -> tuple[Equations, Array]:
    """States of a case at the output times.

    Contacts that come within range on the way are found by looking ``looks`` times between two outputs, and the whole
    is integrated once more with them.
    """
    scene = case.scene
    x = np.array(scene.positions, dtype=float)
    d = x.shape[1]
    z = first_surroundings(scene, d)
    pairs = near(case, x, z)
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
            first = balanced(eq, 0.0, first)
        states = integrate(eq, first, fine, rtol)
        met = set(pairs)
        for state in states:
            place, _, _, around = unpack(eq, state)
            met |= near(case, place[:, :d], around)
        if met == pairs:
            return eq, states[::looks]
        pairs = met
    raise Beyond("new contacts are found without end")
