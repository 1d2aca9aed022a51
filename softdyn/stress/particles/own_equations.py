"""The equations of a few particles, written down once more, in plain numpy.

Nothing of the engine is in them but the declaration of the law, as sympy makes functions of it. The state holds
positions, ln h of every contact, its tangential force, and what surrounds the particles: logarithms of the lengths of
the box, its tilt, points of the walls. Everything is a vector of three components, whatever the dimension.

The equations are stiff, so they are integrated by an implicit method with the exact Jacobian: all functions below take
many states at once, in front, and complex ones, and an imaginary step too small to matter gives the derivatives.

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
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.stress.particles.cases import ACROSS, Equations

Array = NDArray[np.float64]
#: Of each contact.
Mode = NDArray[np.int64]
#: Weight of a film that has none, lest its equation be algebraic; forces are off by as much.
THIN = 1e-6
#: Weight below which a contact resists no spin to speak of.
FAINT = 1e-6


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
    """State, or its rates; of many states at once, too.

    Parameters
    ----------
    eq : Equations
    x : array, shape (..., N, 3)
    u : array, shape (..., contacts)
        ln h.
    T : array, shape (..., contacts, 3)
        Tangential forces, from i to j; left out where nothing slides.
    z : array, shape (..., 4 + 3 walls)
        Logarithms of the lengths of the box, its tilt, points of the walls.
    """
    lead = x.shape[:-2]
    parts = [x[..., : eq.d].reshape(*lead, -1), u, T.reshape(*lead, -1) if eq.slides else np.zeros((*lead, 0)), z]
    return np.concatenate(parts, axis=-1)


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
    """Normals, shape (..., contacts, 3), and distances of the centres, or from the walls, shape (..., contacts).

    Parameters
    ----------
    eq : Equations
    x : array, shape (..., N, 3)
    z : array, shape (..., 4 + 3 walls)
        Logarithms of the lengths of the box, its tilt, points of the walls.
    """
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


def weights(eq: Equations, gap: Array, mode: Mode) -> tuple[Array, Array, Array, Array]:
    """Weight w, falling from 1 to 0 between half of the range and the range; film, grip, and the slope of grip in h.

    Of pressed surfaces the film fades, of pulled ones the force.

    Parameters
    ----------
    eq : Equations
    gap : array, shape (..., contacts)
    mode : array of int, shape (contacts,)
        PRESSED, PULLED or RIDES.
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
    """Forces, velocities and rates of a state, or of many at once.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array, shape (..., numbers)
        As of :func:`pack`; real or complex.
    part : int
        Number of the part between breaks of the drives, as of :func:`softdyn.stress.particles.cases.part_of`.
    mode : array of int, shape (contacts,)
        PRESSED, PULLED or RIDES.
    """
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
    """Velocity gradient: given, or such that 2 eta D and the stress of the contacts are the imposed one.

    Parameters
    ----------
    eq : Equations
    given : mapping from str to array
        As of ``given`` of the equations; its shear rate and stress are used.
    stress : array, shape (..., 3, 3)
        Of the contacts, force over area, > 0 in tension; it matters where a stress is imposed.
    """
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


def by(values: Array) -> Array:
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
    rolling = by(at.w * (G - (eq.unlike * B) ** 2 / A)) * (ACROSS - dyad)
    turning, pressing = _skew(at.n), _skew(at.T)
    spun = -pressing @ dyad / 2  # ((spin . n)/2) n x T
    turn = by(np.where(eq.j < eq.count, 1 / at.r, 0.0)) * (pressing @ turning)  # -(n x apart)/r x T
    by_spin = [-by(k_t * arm) * turning + spun for arm in lever]
    still = -(k_t / (_thin(at.w) * A))[..., None] * T
    return Sliding(lever, rolling, by(k_t) * (ACROSS - dyad) + turn, by_spin, still)


def spread(rows: Array, columns: Array, blocks: Array) -> Array:
    """Sum of blocks of the contacts, shape (..., N, 3, N, 3), by the parts that rows and columns have.

    Parameters
    ----------
    rows, columns : array, shape (contacts, N)
        How much each particle counts in each contact: 1 or -1 at its ends, else 0.
    blocks : array, shape (..., contacts, 3, 3)
    """
    outer = rows[:, :, None] * columns[:, None, :]
    return np.asarray(np.einsum("...abnm->...namb", np.tensordot(blocks, outer, axes=(-3, 0))))


def _torques(eq: Equations, given: Mapping[str, Array], at: Contacts, slides: Sliding) -> tuple[Array, Array]:
    """Torques on the particles, shape (N, 3), and what resists their spins, shape (3 N, 3 N)."""
    twist = np.cross(at.n, at.T)
    torque = given["torque"] - eq.first.T @ (slides.lever[0][..., None] * twist)
    torque = torque - eq.second.T @ (slides.lever[1][..., None] * twist)
    apart = eq.first - eq.second
    return torque, spread(apart, apart, slides.rolling).reshape(*twist.shape[:-2], 3 * eq.count, 3 * eq.count)


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
    by_apart = by(at.grip * by_delta / 2) * dyad - by(curved) * (ACROSS - dyad)
    rest = (F_h * at.gap_rate)[..., None] * at.n
    if slides is not None:
        by_apart, rest = by_apart + slides.by_v, rest + slides.still
    rest = rest - _times(by_apart, at.far)
    apart = eq.first - eq.second
    matrix = spread(apart, apart, by_apart).reshape(*lead, 3 * count, 3 * count)
    right = _flat(given["force_rate"] - apart.T @ rest)
    known, fixed = _flat(np.where(eq.fixed, given["velocity"], 0.0)), eq.fixed.reshape(-1)
    if slides is not None:
        torque, rolling = _torques(eq, given, at, slides)
        rolling = rolling + _idle(eq, at, slides)
        sides = zip((eq.first, eq.second), slides.by_spin, strict=True)
        by_spin = sum(spread(apart, part, block) for part, block in sides)
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
    along = by(strength) * at.n[..., :, None] * at.n[..., None, :]
    held = spread(only * eq.first, only * eq.first, along) + spread(only * eq.second, only * eq.second, along)
    largest = np.abs(strength).max(axis=-1)
    return np.reshape(held, (*at.r.shape[:-1], 3 * eq.count, -1)) + by(largest) * np.diag(np.repeat(number == 0, 3))


def jacobian(eq: Equations, t: float, state: Array, part: int, mode: Mode) -> Array:
    """Derivatives of the rates by the state, to rounding: by an imaginary step, all columns at once.

    Parameters
    ----------
    eq : Equations
    t : float
    state : array, shape (numbers,)
        One, and real.
    part : int
        Number of the part between breaks of the drives.
    mode : array of int, shape (contacts,)
        PRESSED, PULLED or RIDES.
    """
    step = 1e-40
    return np.asarray(tell(eq, t, state + 1j * step * np.eye(len(state)), part, mode).rates.imag.T / step)
