"""Tangential motion of many particles: sliding and rolling contacts, and what they ask of the particles' rotations.

A particle's coordinates are then (x, R theta), its rotation since the start of the step times its radius, so that all
have one unit; forces on them are (force, torque/R). One rotation in two dimensions, three in three; a sphere needs
none of them before the step.

The force T of a contact, from i to j, and its known part T* are kept in the frame of the step's start: the shortest
rotation from the normal there to the present one, and the angle psi about it, take them to where the contact is. With
dn/dt that rotation spins about n itself, by -n0.(n x dn/dt)/(1 + n0.n), so that psi, whose rate is the spin of the
contact less that, is integrated with the rest; in two dimensions there is no psi. See :mod:`softdyn.derive.tangential`
for levers and coefficients.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.energy import ELASTIC
from softdyn.particles.force_balance import Balance, Newton, StageInput, largest
from softdyn.particles.geometry import (
    Contacts,
    Integers,
    cross,
    curvatures,
    directions,
    dot,
    lattice,
    rotations,
    torque,
)
from softdyn.particles.mechanisms import Action, Mechanism
from softdyn.particles.portions import gatherings, in_portions, portion
from softdyn.particles.system import System, contact_state, image_velocities

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]

#: Of the stiffest contact: what resists, in Newton's matrix alone, a rotation that nothing resists.
IDLE = 1e-9
#: Estimates of errors of tangential forces without drag are counted so many times.
UNDRAGGED = 5.0

#: Of what :class:`TangentialForces` has, what is of both particles.
OF_BOTH = ("beta", "rotation")
#: Stiffness of rolling where no time passes, in units of that of sliding: surfaces shear, and roll so much less than
#: that of what they roll as little is left each time that a stage is solved for anew, with the moments that it had.
BLOCKED = 1e5


@dataclass(frozen=True)
class Sliding(Mechanism):
    """Sliding and rolling contacts; a step integrates T, psi and, for the errors, the slip."""

    takes = ("sliding", "rolling", "k_t")
    symmetric = False

    def begin(self, system: System, contacts: Contacts, t: float, x: Array) -> tuple[dict[str, Any], dict[str, Array]]:
        """See :class:`Mechanism`."""
        normal, _ = directions(contacts, x, lattice(system.box, t), system.walls)
        start = {"T": of_films(contacts), "angle": np.zeros(len(contacts)), "slip": np.zeros_like(contacts.T)}
        return {"sliding": starting(contacts, system.radii, normal, start["T"])}, start

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action:
        """See :class:`Mechanism`."""
        known, count = known_of(given), len(at.x)
        images = given.s * image_velocities(system, contacts, given.t)
        turning_by = curvatures(contacts, at.r, count)
        found = slide(known, contacts, at.values, at.n, at.r, turning_by, at.x - given.x_star, images, given.s)
        reaction = reactions(contacts, known, found, at.n, count)
        stiffness = largest(at.values["stiff"])
        return Action(reaction, largest(found.force), stiffness=stiffness, T=found.force, notes={"sliding": found})

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array:
        """What spins without any resistance, as a particle about the line of its only contacts, does not."""
        known, own = known_of(given), np.zeros(at.x.shape)
        rolling = largest(rolling_stiffness(known, at.values, given.s) / known.radii.min(axis=0) ** 2)
        own[:, system.dimension :] = IDLE * max(largest(at.F_r), largest(at.values["stiff"]), rolling)
        return own

    def contact_tangents(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Iterator[Array]:
        """See :class:`Mechanism`."""
        curvature = curvatures(contacts, at.r, len(at.x))
        return tangents(known_of(given), at.values, at.notes["sliding"], at.n, curvature, given.s)

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        """See :class:`Mechanism`."""
        known, found = known_of(given), at.notes["sliding"]
        slip = turned_back(known, found.slip, at.n, found.angle)
        return {
            "T": (found.turned - known.force) / given.s,
            "angle": (found.angle - known.angle) / given.s,
            "slip": slip / given.s,
        }

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        """Of T, relative to the largest force, or to what would shear the contact's surfaces by its gap.

        Of what it has not from slips without an error: where positions are algebraic they, and slips, have none; rates
        are differences of them, and have.
        """
        active = at.h < system.reach
        if not active.any():
            return []
        k_t = at.values["stiff"][active] / at.values["keep"][active]
        allowed = np.maximum(k_t * at.h[active], max(largest(at.notes["sliding"].force), largest(at.F)))
        if system.dragged:
            wrong = errors["T"][active]
        else:  # the estimate is of the order of the error itself there, not of a lower one
            wrong = UNDRAGGED * (errors["T"][active] - k_t[:, None] * errors["slip"][active])
        relative = np.linalg.norm(wrong, axis=1) / (system.rtol * allowed)
        return [float(np.sqrt(np.mean(relative**2))), float(relative.max()) / 10]

    def unresisted(self, system: System, contacts: Contacts, near: Integers, n: Array, moved: Array) -> Array:
        """The rotation of a particle about the line of its only contacts, and of one without contacts."""
        d, moved = system.dimension, np.where(system.fixed, 0.0, moved)
        twist = np.zeros_like(moved)
        twist[:, d:] = unresisted(contacts.i[near], contacts.j[near], n, moved[:, d:])
        return np.where(system.fixed, 0.0, twist)

    def follow(
        self,
        system: System,
        newton: Newton,
        contacts: Contacts,
        x: Array,
        t: float,
        before: Array | None,
        after: Array,
    ) -> tuple[Balance, float, str]:
        """See :class:`Mechanism`. Nothing slides or rolls within an instant."""
        from softdyn.particles.mechanisms.sliding_ramp import holding, ramped

        start = holding(system, contacts, x, t) if before is None else before
        return *ramped(system, newton, contacts, x, t, start, after), "k_t"

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What is lost in sliding and in rolling, what a change of the tangential stiffness takes, what is stored."""
        values = contact_state(system, contacts, contacts.S - at.r, at.h)
        found = _powers(system, contacts, at, values, rates)
        stored = float(np.sum(dot(at.notes["sliding"].turned, rates.own["T"]) / values["k_t"]))
        return {**found, ELASTIC: stored - found["k_t"]}

    def stored(self, system: System, contacts: Contacts, overlap: Array) -> float:
        """See :class:`Mechanism`."""
        k_t = contact_state(system, contacts, overlap, contacts.h)["k_t"]
        return float(np.sum(of_films(contacts) ** 2 / (2 * k_t[:, None])))


def check(facts: ValidatedScene, faults: list[str]) -> Sliding:
    """Tangential motion of a scene."""
    if facts.x.shape[1] == 1:
        faults.append("[contacts] tangential: in one dimension there is no tangential motion")
    return Sliding()


@dataclass(frozen=True)
class Known:
    """What is known of the tangential forces as a stage begins.

    Attributes
    ----------
    normal : array, shape (contacts, d)
        Normals at the start of the step.
    force : array, shape (contacts, d)
        T*, in the frame of the start.
    angle : array, shape (contacts,)
        Known part of psi.
    radii : array, shape (2, contacts)
        Of i and of j; walls have 1, which nothing depends on.
    unlike : array, shape (contacts,)
        D = (R_i - R_j)/(R_i + R_j); -1 for walls.
    rolled : array, shape (contacts, rotations), optional
        Of the relative rotation, where no time passes.
    part : array, shape (contacts,), optional
        Of what is between the surfaces, or of what they overlap by, how much the lever of each is longer or shorter by.
    """

    normal: Array
    force: Array
    angle: Array
    radii: Array
    unlike: Array
    rolled: Array | float = 0.0
    part: Array | float = 0.5


@dataclass(frozen=True)
class TangentialForces:
    """Tangential forces at a stage, shape (contacts, ...) each.

    Attributes
    ----------
    force : array
        T, from i to j.
    turned, angle : array
        The same in the frame of the step's start; psi.
    moment : array
        Moment of rolling, from i to j, without that of T.
    beta : array, shape (2, contacts)
        Levers over radii.
    kept : array
        T* where the contact is now.
    slip, relative, turn, roll : array
        Slip in the implicit part of the stage; displacement of the centres, i less j; sum of the rotations weighted
        with the levers; relative rotation.
    rotation : array, shape (2, contacts, rotations)
        R theta of i and of j.
    """

    force: Array
    turned: Array
    angle: Array
    moment: Array
    beta: Array
    kept: Array
    slip: Array
    relative: Array
    turn: Array
    roll: Array
    rotation: Array


def known_of(given: StageInput) -> Known:
    """What is known at a stage."""
    begun: Known = given.begun["sliding"]
    return replace(begun, force=given.own["T"], angle=given.own["angle"])


def of_films(contacts: Contacts) -> Array:
    """Tangential forces of the films, shape (contacts, d): all, but for what surfaces bear that touch."""
    return contacts.T - contacts.rubbed[:, : contacts.T.shape[1]] if contacts.rubbed.size else contacts.T


def starting(contacts: Contacts, radii: Array, normal: Array, force: Array) -> Known:
    """What is known at the start of a step, with the forces there.

    Parameters
    ----------
    contacts : Contacts
    radii : array, shape (N,)
    normal : array, shape (contacts, d)
        Directions from i to j.
    force : array, shape (contacts, d)
        Tangential forces.
    """
    wall = contacts.j >= len(radii)
    one = radii[contacts.i]
    other = radii[np.where(wall, contacts.i, contacts.j)]  # a wall, which does not turn, may have any
    unlike = np.where(wall, -1.0, (one - other) / (one + other))
    return Known(normal, force, np.zeros(len(contacts)), np.array([one, other]), unlike)


def carry(force: Array, start: Array, end: Array) -> Array:
    """Turn vectors normal to ``start`` by the shortest rotation that takes ``start`` to ``end``.

    Parameters
    ----------
    force : array, shape (n, d)
        The vectors.
    start, end : array, shape (n, d)
        Of unit length.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # of opposite ones none is: no step ends with such a force
        return force - (dot(end, force) / (1 + dot(start, end)))[:, None] * (start + end)


def spin(force: Array, n: Array, angle: Array) -> Array:
    """Turn vectors normal to n about it.

    Parameters
    ----------
    force : array, shape (n, 3)
        The vectors.
    n : array, shape (n, 3)
        Of unit length.
    angle : array, shape (n,)
        In radians.
    """
    return np.cos(angle)[:, None] * force + np.sin(angle)[:, None] * cross(n, force)


def slide(
    known: Known,
    contacts: Contacts,
    values: dict[str, Array],
    n: Array,
    r: Array,
    curvature: Array,
    moved: Array,
    images: Array,
    s: float,
) -> TangentialForces:
    """Tangential forces at a stage.

    Parameters
    ----------
    values : dict
        What the kernel gives: keep, stiff, roll, lever.
    n, r, curvature : array
        As from :func:`softdyn.particles.geometry.directions`.
    moved : array, shape (N, d + rotations)
        Motion of the particles in the implicit part of the stage.
    images : array, shape (contacts, d)
        Motion of the image of particle j with the box.
    s : float
        gamma dt; 0 where no time passes: then sliding is elastic, and nothing rolls.
    """
    c, d = n.shape
    walls = int(contacts.j.max(initial=0)) + 1 - len(moved)
    padded = np.concatenate([moved, np.zeros((max(walls, 0), moved.shape[1]))])
    m = rotations(d)
    whole = TangentialForces(
        force=np.empty((c, d)),
        turned=np.empty((c, d)),
        angle=np.empty(c),
        moment=np.empty((c, m)),
        beta=np.empty((2, c)),
        kept=np.empty((c, d)),
        slip=np.empty((c, d)),
        relative=np.empty((c, d)),
        turn=np.empty((c, m)),
        roll=np.empty((c, m)),
        rotation=np.empty((2, c, m)),
    )

    def work(part: slice) -> None:
        some, given = portion(contacts, part), {name: value[part] for name, value in values.items()}
        found = _slide(
            _known_part(known, part), some, given, n[part], r[part], curvature[part], padded, images[part], s
        )
        for name, array in _arrays(whole).items():
            _rows(name, array, part)[...] = getattr(found, name)

    in_portions(work, c)
    return whole


def _arrays(slid: TangentialForces) -> dict[str, Array]:
    return {field.name: getattr(slid, field.name) for field in fields(TangentialForces)}


def _rows(name: str, array: Array, part: slice) -> Array:
    """What an array has of some contacts: of those that have a row for i and one for j, in both."""
    return array[:, part] if name in OF_BOTH else array[part]


def _slid_part(slid: TangentialForces, part: slice) -> TangentialForces:
    return TangentialForces(**{name: _rows(name, array, part) for name, array in _arrays(slid).items()})


def _known_part(known: Known, part: slice) -> Known:
    return Known(
        known.normal[part],
        known.force[part],
        known.angle[part],
        known.radii[:, part],
        known.unlike[part],
        known.rolled[part] if isinstance(known.rolled, np.ndarray) else known.rolled,
        known.part[part] if isinstance(known.part, np.ndarray) else known.part,
    )


def _slide(
    known: Known,
    contacts: Contacts,
    values: dict[str, Array],
    n: Array,
    r: Array,
    curvature: Array,
    padded: Array,
    images: Array,
    s: float,
) -> TangentialForces:
    """As :func:`slide`, of some contacts, with the motion of the walls behind that of the particles.

    Components come first here, so that numpy's inner loops are as long as there are contacts.
    """
    n, start, given, moved_images = map(_first, (n, known.normal, known.force, images))
    d = len(n)
    one, other = (_first(padded.take(ends, axis=0)) for ends in (contacts.i, contacts.j))
    relative, rotation = one[:d] - other[:d] - moved_images, (one[d:], other[d:])
    excess = (r - contacts.S) * known.part
    shift = known.unlike * values["lever"] if "lever" in values else 0.0
    beta = 1 + np.array([excess + shift, excess - shift]) / known.radii
    turn = beta[0] * rotation[0] + beta[1] * rotation[1]
    turned = turn[0] * np.stack([-n[1], n[0]]) if d == 2 else _torque(turn, n)
    slip = relative - np.sum(n * relative, axis=0) * n + turned
    by_radius = rotation[0] / known.radii[0], rotation[1] / known.radii[1]
    kept, angle = _carry(given, start, n), known.angle
    if d == 3:
        swung = np.sum(start * _torque(n, relative), axis=0) * curvature / (1 + np.sum(start * n, axis=0))
        angle = angle + np.sum((by_radius[0] + by_radius[1]) * n, axis=0) / 2 - swung
        kept = np.cos(angle) * kept + np.sin(angle) * _torque(n, kept)
    force = values["keep"] * kept + values["stiff"] * slip
    roll = (known.rolled.T if isinstance(known.rolled, np.ndarray) else known.rolled) + by_radius[0] - by_radius[1]
    moment = rolling_stiffness(known, values, s) * (roll if d == 2 else roll - np.sum(n * roll, axis=0) * n)
    back = force if d == 2 else np.cos(angle) * force - np.sin(angle) * _torque(n, force)
    return TangentialForces(
        force=force.T,
        turned=_carry(back, n, start).T,
        angle=angle,
        moment=moment.T,
        beta=beta,
        kept=kept.T,
        slip=slip.T,
        relative=relative.T,
        turn=turn.T,
        roll=roll.T,
        rotation=np.array([one.T for one in rotation]),
    )


def _carry(force: Array, start: Array, end: Array) -> Array:
    """As :func:`carry`, components first."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(force - np.sum(end * force, axis=0) / (1 + np.sum(start * end, axis=0)) * (start + end))


def turned_back(known: Known, vectors: Array, n: Array, angle: Array) -> Array:
    """Vectors of the contacts in the frame of the step's start.

    Parameters
    ----------
    known : Known
    vectors : array, shape (contacts, d)
    n : array, shape (contacts, d)
        Directions from i to j, at the stage.
    angle : array, shape (contacts,)
        psi there, in radians.
    """
    back = spin(vectors, n, -angle) if n.shape[1] == 3 else vectors
    return carry(back, n, known.normal)


def resisted(roll: Array, n: Array) -> Array:
    """What films resist of relative rotations: all, but for a twist about the normal."""
    return roll if n.shape[1] == 2 else roll - dot(n, roll)[:, None] * n


def rolling_stiffness(known: Known, values: dict[str, Array], s: float) -> Array:
    """Moment for each relative rotation in a stage; where no time passes none of what films resist.

    Parameters
    ----------
    known : Known
    values : mapping from str to array, shape (contacts,)
        What the kernel gives of tangential motion.
    s : float
        gamma dt of the stage; 0 where no time passes.
    """
    if s > 0:
        return values["roll"] / s
    return np.where(values["roll"] > 0, BLOCKED * values["stiff"] * known.radii[0] ** 2, 0.0)


def reactions(contacts: Contacts, known: Known, slid: TangentialForces, n: Array, count: int) -> Array:
    """Force and torque/R that each particle exerts through its contacts, shape (N, d + rotations).

    Parameters
    ----------
    contacts : Contacts
    known : Known
    slid : TangentialForces
    n : array, shape (contacts, d)
        Directions from i to j.
    count : int
        N.
    """
    twist, d = torque(n, slid.force), n.shape[1]
    of_i, of_j = gatherings(contacts, count)
    total = np.empty((count, d + twist.shape[1]))
    for column, out in enumerate(total.T):
        if column < d:
            along = slid.force[:, column].copy()
            out[:] = of_i @ along - of_j @ along
        else:
            about, moment = twist[:, column - d], slid.moment[:, column - d]
            on_i = slid.beta[0] * about + moment / known.radii[0]
            on_j = slid.beta[1] * about - moment / known.radii[1]
            out[:] = of_i @ on_i + of_j @ on_j
    return total


def unresisted(i: Integers, j: Integers, n: Array, torques: Array) -> Array:
    """Parts of some torques on the particles, shape (N, rotations), that contacts between i and j do not resist.

    Of a particle without a contact all of it; in three dimensions, with contacts along one line, what turns it about
    that line: no film resists a twist.

    Parameters
    ----------
    i, j : array of int, shape (contacts,)
    n : array, shape (contacts, d)
        Directions from i to j.
    torques : array, shape (N, rotations)
    """
    count, m = torques.shape
    resists = np.zeros((count, m, m))
    across = np.eye(3) - n[:, :, None] * n[:, None, :] if m == 3 else np.ones((len(n), 1, 1))
    pair = j < count
    np.add.at(resists, i, across)
    np.add.at(resists, j[pair], across[pair])
    size, direction = np.linalg.eigh(resists)
    along = np.einsum("nab,na->nb", direction, torques)
    return np.asarray(np.einsum("nab,nb->na", direction, np.where(size < 1e-9, along, 0.0)))


def _skew(v: Array) -> Array:
    """Matrices of ``v x``, components first."""
    out = np.zeros((3, *v.shape))
    out[0, 1], out[0, 2], out[1, 2] = -v[2], v[1], -v[0]
    return out - out.transpose(1, 0, 2)


@dataclass(frozen=True)
class Bounded:
    """How a force follows from that of a spring, of which it is a part: see :mod:`softdyn.derive.coulomb`.

    Attributes
    ----------
    trial : array, shape (contacts, d)
        That of the spring.
    passed : array, shape (contacts, d, d)
        Derivative by it.
    along : array, shape (contacts, d)
        Derivative by the distance r, besides.
    """

    trial: Array
    passed: Array
    along: Array


def tangents(
    known: Known,
    values: dict[str, Array],
    slid: TangentialForces,
    n: Array,
    curvature: Array,
    s: float,
    bounded: Bounded | None = None,
) -> Iterator[Array]:
    """Derivatives of the forces and torques/R on i and j by the coordinates of i and j: blocks ii, ij, ji, jj in turn.

    Exact where n has not turned since the start of the step; what is left out is of second order in that turn.

    Parameters
    ----------
    known : Known
    values : mapping from str to array, shape (contacts,)
        What the kernel gives of tangential motion.
    slid : TangentialForces
    n : array, shape (contacts, d)
        Directions from i to j.
    curvature : array, shape (contacts,)
        1/r, or 0 of walls.
    s : float
        gamma dt of the stage; 0 where no time passes.
    bounded : Bounded, optional
        Of surfaces that rub.
    """
    c, d = n.shape
    width = d + slid.turn.shape[1]

    def begun(part: slice) -> Iterator[Array]:
        some = None
        if bounded is not None:
            some = Bounded(bounded.trial[part], bounded.passed[part], bounded.along[part])
        given = {name: value[part] for name, value in values.items()}
        return _tangents(_known_part(known, part), given, _slid_part(slid, part), n[part], curvature[part], s, some)

    parts = dict(in_portions(lambda part: (part.start, begun(part)), c))
    for _ in range(4):
        block = np.empty((c, width, width))

        def fill(part: slice, block: Array = block) -> None:
            block[part] = next(parts[part.start])

        in_portions(fill, c)
        yield block


def _tangents(
    known: Known,
    values: dict[str, Array],
    slid: TangentialForces,
    n: Array,
    curvature: Array,
    s: float,
    bounded: Bounded | None,
) -> Iterator[Array]:
    """As :func:`tangents`, of some contacts.

    Components come first here, so that numpy's inner loops are as long as there are contacts.
    """
    trial = _first(slid.force if bounded is None else bounded.trial)
    n, force, relative, turn, roll = map(_first, (n, slid.force, slid.relative, slid.turn, slid.roll))
    rotation, radii, stiff = [_first(one) for one in slid.rotation], known.radii, values["stiff"]
    d, m = len(n), len(turn)
    dyad = n[:, None] * n[None]
    across = np.eye(d)[:, :, None] - dyad
    by_turn = np.stack([-n[1], n[0]])[:, None] if d == 2 else -_skew(n)  # rotation x n
    lever_r = known.unlike * values["lever_r"] if "lever_r" in values else 0.0
    beta_r = (known.part + lever_r) / radii[0], (known.part - lever_r) / radii[1]
    twist = _torque(n, force)
    spun = values["keep"] * _torque(n, _first(slid.kept))

    # along the distance r: of the coefficients, and of the levers
    turn_r = beta_r[0] * rotation[0] + beta_r[1] * rotation[1]
    along = values["keep_r"] * _first(slid.kept) + values["stiff_r"] * _first(slid.slip)
    along = along + stiff * (turn_r[0] * by_turn[:, 0] if d == 2 else _torque(turn_r, n))
    # by x_j - x_i, which changes r and turns n
    apart = along[:, None] * n[None] - curvature * n[:, None] * trial[None]
    apart -= stiff * curvature * np.sum(n * relative, axis=0) * across
    rolled = rolling_stiffness(known, values, s)
    rolled_r = values["roll_r"] / s if s > 0 else np.zeros(len(rolled))
    if d == 2:
        resisted = np.ones((1, 1, 1))
        moment_r = (rolled_r * roll)[:, None] * n[None]
        turned_r = np.zeros((m, d, 1))
    else:
        resisted = across
        apart += stiff * curvature * np.sum(n * turn, axis=0) * _skew(n)
        spinning = rotation[0] / radii[0] + rotation[1] / radii[1]
        spinning -= np.sum(spinning * n, axis=0) * n
        apart += curvature / 2 * spun[:, None] * spinning[None]
        facing = np.sum(n * roll, axis=0)
        aslant = roll - facing * n
        moment_r = (rolled_r * aslant)[:, None] * n[None]
        moment_r -= rolled * curvature * (facing * across + n[:, None] * aslant[None])
        turned_r = -curvature * (_skew(force) - _torque(force, n)[:, None] * n[None])
    for row in range(2):
        sign = 1.0 - 2.0 * row
        aside = beta_r[row] * twist[:, None] * n[None] + slid.beta[row] * turned_r + sign * moment_r / radii[row]
        for column in range(2):
            other = 1.0 - 2.0 * column
            block = np.empty((d + m, d + m, n.shape[1]))
            by_x = other * (stiff * across - apart)
            by_rotation = stiff * slid.beta[column] * by_turn
            if d == 3:  # what is known of the force spins with the particles
                by_rotation = by_rotation + spun[:, None] * n[None] / (2 * radii[column])
            if bounded is not None:
                passed = np.ascontiguousarray(bounded.passed.transpose(1, 2, 0))
                by_x = np.sum(passed[:, :, None] * by_x[None], axis=1)
                by_x -= other * _first(bounded.along)[:, None] * n[None]
                by_rotation = np.sum(passed[:, :, None] * by_rotation[None], axis=1)
            block[:d, :d] = sign * by_x
            block[:d, d:] = sign * by_rotation
            block[d:, :d] = slid.beta[row] * _torque(n, by_x) - other * aside
            block[d:, d:] = slid.beta[row] * _torque(n, by_rotation)
            block[d:, d:] += sign * other * rolled / (radii[row] * radii[column]) * resisted
            yield block.transpose(2, 0, 1)


def _first(vectors: Array) -> Array:
    """Components first, contacts last."""
    return np.ascontiguousarray(vectors.T)


def _torque(n: Array, force: Array) -> Array:
    """``n x force``, components first; of the columns, if force is a matrix."""
    if len(n) == 2:
        return np.asarray((n[0] * force[1] - n[1] * force[0])[None])
    (ax, ay, az), (bx, by, bz) = n, force
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _powers(
    system: System, contacts: Contacts, at: Balance, values: dict[str, Array], rates: Rates
) -> dict[str, float]:
    """Power lost in sliding and in rolling, and taken by a change of the tangential stiffness, at one stage."""
    d, v, force = system.dimension, rates.v, at.notes["sliding"].force
    walls = np.zeros((len(system.walls), v.shape[1]))
    one, other = (np.concatenate([v, walls])[ends] for ends in (contacts.i, contacts.j))
    square = dot(force, force)
    slides = values["friction_t"] > 0
    radii = np.append(system.radii, np.ones(len(walls)))
    turn = one[:, d:] / radii[contacts.i, None] - other[:, d:] / radii[contacts.j, None]
    if d == 3:
        turn = turn - dot(turn, at.n)[:, None] * at.n
    k_rate = values["k_t_h"] * rates.h + values["k_t_delta"] * (rates.h - rates.r) / 2
    return {
        "sliding": float(np.sum(square[slides] / values["friction_t"][slides])),
        "rolling": float(np.sum(values["roll"] * dot(turn, turn))),
        "k_t": float(np.sum(square * k_rate / (2 * values["k_t"] ** 2))),
    }
