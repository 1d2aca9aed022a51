"""Contacts as they are at an instant: for frames, energies, and the accelerations at the start. None of it per step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.explicit.given import Given
from softdyn.particles.explicit.grains import Grains, GrainSystem, by_number, edges, tilt_at
from softdyn.particles.geometry import cross, dot, flow, rotations, torque
from softdyn.particles.mechanisms.inertia import momentum_flux
from softdyn.particles.results import Frame

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Gauss points of the elastic energy, over the square root of the overlap.
POINTS = 12


@dataclass(frozen=True)
class Touching:
    """Contacts, in the order of the cells; a row each.

    Attributes
    ----------
    i, j : array of int
        Places of the particles; a wall w has j = N + w.
    shift : array of int, shape (n, d)
        The lattice vector by which j is displaced.
    n : array, shape (n, d)
    r, overlap, R : array
    kind : array of int
        Row of each in the table of varying parameters.
    force, stiffness, dashpot, k_t : array
        What the law says of it.
    N : array
        The normal force, with that of the dashpot.
    history : array, shape (n, kept)
    """

    i: Integers
    j: Integers
    shift: Integers
    n: Array
    r: Array
    overlap: Array
    R: Array
    kind: NDArray[np.int32]
    force: Array
    stiffness: Array
    dashpot: Array
    k_t: Array
    N: Array
    history: Array

    def __len__(self) -> int:
        return len(self.i)

    def tangential(self) -> Array:
        """Tangential forces, from i to j, shape (n, d)."""
        n = self.n
        if not self.history.shape[1]:
            return np.zeros((len(n), 0))
        if n.shape[1] == 2:
            return self.history[:, :1] * np.stack([-n[:, 1], n[:, 0]], axis=1)
        return self.history[:, :3]


def cell_at(system: GrainSystem, t: float) -> Array:
    """Lattice vectors, as columns; 0 along axes that are not periodic."""
    cell = np.diag(edges(system))
    if len(cell) > 1:
        cell[0, 1] = tilt_at(system, t)
    return cell


def touching(system: GrainSystem, state: Grains, walls: Array, wall_v: Array) -> Touching:
    """Contacts at the present positions; ``walls`` are points of these, ``wall_v`` their velocities.

    Parameters
    ----------
    system : GrainSystem
    state : Grains
    walls, wall_v : array, shape (walls, d)
    """
    kernel, (count, d) = system.kernel, state.x.shape
    radii, cell = system.radii[state.order], cell_at(system, state.t)
    i = np.repeat(np.arange(count), np.diff(state.start))
    j = state.partner.astype(np.int64)
    code = state.image.astype(np.int64)
    shift = np.zeros((len(i), d), dtype=np.int64)
    if system.box.periodic.any():
        for axis in range(d):
            shift[:, axis] = code % 3 - 1
            code //= 3
        shift += state.home[i] - state.home[j]
        if d > 1:
            shift[:, 0] -= state.turns * shift[:, 1]
    along = state.x[j] - state.x[i] + shift @ cell.T
    r = np.sqrt(dot(along, along))
    overlap = radii[i] + radii[j] - r
    near = np.flatnonzero(overlap > 0)
    i, j, shift, r, overlap = i[near], j[near], shift[near], r[near], overlap[near]
    n = along[near] / r[:, None]
    R = 2 * radii[i] * radii[j] / (radii[i] + radii[j])
    kinds = system.species[state.order]
    kind = kinds[i] * system.kinds + kinds[j]
    history = state.history[near]
    moving = state.v[i] - state.v[j] - shift @ rate_of_cell(system, state.t).T
    parts = [(i, j, shift, n, r, overlap, R, kind, history, moving)]
    for w in range(system.walled):
        normal = system.wall_normal[w]
        r = (walls[w] - state.x) @ normal
        on = np.flatnonzero(radii - r > 0)
        own = on * system.walled + w
        parts.append(
            (
                on, np.full(len(on), count + w), np.zeros((len(on), d), np.int64), np.tile(normal, (len(on), 1)), r[on],
                radii[on] - r[on], 2 * radii[on], kinds[on] * system.kinds + system.kinds - system.walled + w,
                state.wall_history[own], state.v[on] - wall_v[w],
            )
        )  # fmt: skip
    i, j, shift, n, r, overlap, R, kind, history, moving = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    out = law_of_contacts(system, overlap, R, kind)
    force, dashpot = out["F_ela"], out.get("dashpot", np.zeros(len(r)))
    N = force + dashpot * dot(moving, n) if kernel.damped else force
    k_t = out.get("k_t", np.zeros(len(r)))
    return Touching(
        i, j, shift, n, r, overlap, R, kind.astype(np.int32), force, out["stiffness"], dashpot, k_t, N, history
    )


def rate_of_cell(system: GrainSystem, t: float) -> Array:
    """Rate of the lattice vectors."""
    rate = np.zeros((system.dimension, system.dimension))
    if len(rate) > 1 and system.box.periodic[:2].all():
        rate[0, 1] = shear_rate_at(system, t) * float(system.box.lengths[1])
    return rate


def shear_rate_at(system: GrainSystem, t: float) -> float:
    """Shear rate of the periodic box."""
    found = [mechanism.gradient(t, np.empty(0)) for mechanism in system.having["gradient"]]
    return sum(float(gradient[0, 1]) for gradient in found if gradient is not None)


def law_of_contacts(system: GrainSystem, overlap: Array, R: Array, kind: NDArray[np.integer]) -> dict[str, Array]:
    """What the law says of contacts: F_ela, stiffness, and dashpot and k_t where it has these.

    Parameters
    ----------
    system : GrainSystem
    overlap : array, shape (n,)
        Sums of the radii less the distances of the centres.
    R : array, shape (n,)
        Radius of each contact, as the law has it.
    kind : array of int, shape (n,)
        Which of the sets of parameters each has.
    """
    kernel = system.kernel
    out = np.empty((len(kernel.outputs), len(overlap)))
    kernel.contact(
        len(overlap), system.kinds, np.ascontiguousarray(overlap), np.ascontiguousarray(R),
        np.ascontiguousarray(kind, dtype=np.int32), system.p, system.q.reshape(-1), out.reshape(-1),
    )  # fmt: skip
    return dict(zip(kernel.outputs, out, strict=True))


def stored_energies(system: GrainSystem, contacts: Touching) -> tuple[float, float]:
    """Elastic energy of the contacts, and that of the springs of friction."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    fraction, weight = ((1 + nodes) / 2) ** 2, weights * (1 + nodes) / 2
    normal = 0.0
    for part, share in zip(fraction, weight, strict=True):
        force = law_of_contacts(system, part * contacts.overlap, contacts.R, contacts.kind)["F_ela"]
        normal += share * float(force @ contacts.overlap)
    if not contacts.history.shape[1]:
        return normal, 0.0
    return normal, float(np.sum(contacts.history**2 / (2 * contacts.k_t[:, None])))


def accelerations(system: GrainSystem, state: Grains, contacts: Touching, given: Given) -> Array:
    """Accelerations at the present positions, linear and angular, shape (N, d + rotations).

    Parameters
    ----------
    system : GrainSystem
    state : Grains
    contacts : Touching
    given : Given
        Forces at the present time.
    """
    (count, d), turning = state.x.shape, system.kernel.rotations
    force = np.zeros((count, d + turning))
    T = contacts.tangential()
    pull = contacts.N[:, None] * contacts.n + (T if T.shape[1] else 0.0)
    pair = np.flatnonzero(contacts.j < count)
    np.subtract.at(force[:, :d], contacts.i, pull)
    np.add.at(force[:, :d], contacts.j[pair], pull[pair])
    if turning:
        radii = system.radii[state.order]
        part = np.full(len(contacts), 0.5)
        on = contacts.j >= count
        part[on] = system.wall_part[contacts.j[on] - count]
        turn = torque(contacts.n, T)
        lever = (radii[contacts.i] - part * contacts.overlap)[:, None]
        np.subtract.at(force[:, d:], contacts.i, lever * turn)
        lever = (radii[contacts.j[pair]] - 0.5 * contacts.overlap[pair])[:, None]
        np.subtract.at(force[:, d:], contacts.j[pair], lever * turn[pair])
        _resist(system, contacts, force, pair)
    force[:, :d] += system.load[state.order]
    force += given.force[0][system.groups.of[state.order]]
    return force / inertia_of(system, state)


def _resist(system: GrainSystem, contacts: Touching, force: Array, pair: Integers) -> None:
    """Moments that resist rolling and twisting."""
    kernel, d = system.kernel, contacts.n.shape[1]
    at = 1 if d == 2 else 3
    moment = np.zeros((len(contacts), kernel.rotations))
    if kernel.rolling:
        M = contacts.history[:, at : at + kernel.rotations]
        moment += M if d == 2 else cross(contacts.n, M)
        at += kernel.rotations
    if kernel.twisting:
        moment += contacts.history[:, at : at + 1] * contacts.n
    moment *= contacts.R[:, None]
    np.subtract.at(force[:, d:], contacts.i, moment)
    np.add.at(force[:, d:], contacts.j[pair], moment[pair])


def inertia_of(system: GrainSystem, state: Grains) -> Array:
    """Mass or moment of inertia of each coordinate, shape (N, d + rotations)."""
    d, turning = system.dimension, system.kernel.rotations
    mass, moment = system.mass[state.order][:, None], system.moment[state.order][:, None]
    return np.concatenate([np.repeat(mass, d, axis=1), np.repeat(moment, turning, axis=1)], axis=1)


def kinetic_energy(system: GrainSystem, state: Grains) -> float:
    """Energy of motion and of rotation."""
    mass, moment = system.mass[state.order], system.moment[state.order]
    return 0.5 * float(mass @ dot(state.v, state.v) + moment @ np.sum(state.spin**2, axis=1))


def exchanged(system: GrainSystem, state: Grains, contacts: Touching) -> dict[str, float]:
    """Energies exchanged since the start, by kind, and what is stored.

    Parameters
    ----------
    system : GrainSystem
    state : Grains
    contacts : Touching
    """
    work = dict.fromkeys((*system.works, "stored"), 0.0)
    normal, tangential = stored_energies(system, contacts)
    rubbed, dashpot, external, box, heat = (float(value) for value in state.sums)
    work["external"], work["box"] = external, box
    work["gravity"] = float(np.sum(system.load * (by_number(state, state.x) - state.x0)))
    work["kinetic"] = kinetic_energy(system, state) - state.kinetic0
    work["stored"] = normal + tangential - state.stored0
    work["dashpots"] = dashpot
    work["friction"] = heat
    # what went into the springs of friction, is not in them, and did not rub: their stiffness changes
    work["k_t"] = rubbed - tangential - heat
    return {name: amount for name, amount in work.items() if name in system.works or name == "stored"}


def frame_of(system: GrainSystem, state: Grains, contacts: Touching, walls: Array) -> Frame:
    """Frame of the present state, particles and contacts in the order of the particles' numbers.

    Parameters
    ----------
    system : GrainSystem
    state : Grains
    contacts : Touching
    walls : array, shape (walls, d)
        Points of these.
    """
    count, d = state.x.shape
    x, v, spin = (by_number(state, values) for values in (state.x, state.v, state.spin))
    T = contacts.tangential()
    virial = np.einsum("c,ca,cb->ab", contacts.N * contacts.r, contacts.n, contacts.n)
    if T.shape[1]:
        virial += np.einsum("c,ca,cb->ab", contacts.r, T, contacts.n)
    rate = shear_rate_at(system, state.t)
    gradient = np.zeros((d, d))
    if d > 1:
        gradient[0, 1] = rate
    stress = -virial
    if system.box.periodic.all():
        stress = (stress - momentum_flux(system.mass, x, v, gradient)) / system.box.volume
    of = np.append(state.order, count + np.arange(system.walled))
    i, j = of[contacts.i], of[contacts.j]
    turned = i > j
    sign = np.where(turned, -1, 1)[:, None]
    i, j = np.where(turned, j, i), np.where(turned, i, j)
    shift = contacts.shift * sign
    rows = np.lexsort((*shift.T, j, i))
    energy = exchanged(system, state, contacts)
    return Frame(
        t=state.t,
        x=x,
        v=v,
        i=i[rows].astype(np.int64),
        j=j[rows].astype(np.int64),
        shift=shift[rows],
        h=np.zeros(len(rows)),
        F=contacts.N[rows],
        stress=stress,
        cell=cell_at(system, state.t),
        walls=walls.copy(),
        gradient=gradient,
        energy=np.array([*(energy[name] for name in system.works), energy["stored"]]),
        T=(T * sign)[rows] if T.shape[1] else np.empty((len(rows), 0)),
        spin=spin if spin.shape[1] else np.empty((count, rotations(d) if system.width > d else 0)),
    )


def flow_velocities(system: GrainSystem, x: Array) -> Array:
    """Velocity of the flow that the box is sheared with."""
    return flow(system.box, x)
