"""Coulomb friction in implicit steps: surfaces that touch are joined by a spring, and slide where it bears too much.

Springs that resist rolling and twisting stand beside it: :mod:`softdyn.particles.mechanisms.resisting`.

A step integrates the force T of that spring in the frame of its start, as :mod:`softdyn.particles.mechanisms.sliding`
does the force of a film, beside which it stands; a stage cuts what the spring would bear at mu N, by the return map of
:mod:`softdyn.derive.coulomb`, which the kernel has generated. Surfaces touch halfway: levers are the radii less half of
what they overlap by. Dry surfaces touch a rigid wall where that is: the lever is the distance from it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.energy import ELASTIC
from softdyn.particles.force_balance import Balance, StageInput, largest
from softdyn.particles.geometry import Contacts, curvatures, directions, dot, lattice
from softdyn.particles.loose_particles import is_loose
from softdyn.particles.mechanisms import Action, Mechanism
from softdyn.particles.mechanisms.dry_contacts import moves
from softdyn.particles.mechanisms.resisting import Resisted, Spring, moment_slopes, pair_radii, resist, springs_of
from softdyn.particles.mechanisms.sliding import (
    Bounded,
    Known,
    TangentialForces,
    reactions,
    slide,
    starting,
    tangents,
    turned_back,
)
from softdyn.particles.system import System, contact_state, image_velocities

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.mechanisms.coulomb import Rubbing
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Found:
    """Friction at a stage.

    Attributes
    ----------
    slid : TangentialForces
        With the forces that friction leaves.
    trial : array, shape (contacts, d)
        Forces of the springs without it.
    size : array, shape (contacts,)
        Of these.
    bound : mapping from str to array
        What the kernel gives: keep, by_load, by_h, by_rate.
    s : float
        gamma dt of the stage.
    resisted : list of Resisted
        What resists rolling and twisting.
    """

    slid: TangentialForces
    trial: Array
    size: Array
    bound: Mapping[str, Array]
    s: float
    resisted: list[Resisted]

    @property
    def turned(self) -> Array:
        """All that a contact keeps, in the frame of the step's start."""
        return np.concatenate([self.slid.turned, *(one.turned for one in self.resisted)], axis=1)

    @property
    def cut(self) -> list[tuple[Mapping[str, Array], Array]]:
        """Bounds, and sizes of the trial forces, of all springs."""
        return [(self.bound, self.size), *((one.bound, one.size) for one in self.resisted)]


@dataclass(frozen=True)
class Springs(Mechanism):
    """Surfaces that touch, and rub with the coefficient mu; what resists rolling and twisting."""

    mu: float
    resisting: tuple[Spring, ...] = ()
    rubbed: int = 0

    takes = ("friction", "k_t")
    symmetric = False

    def begin(self, system: System, contacts: Contacts, t: float, x: Array) -> tuple[dict[str, Any], dict[str, Array]]:
        """See :class:`Mechanism`."""
        normal, _ = directions(contacts, x, lattice(system.box, t), system.walls)
        known = starting(contacts, system.radii, normal, contacts.rubbed[:, : system.dimension])
        known = replace(known, part=_given_in(system, contacts))
        return {"friction": known}, {"rubbed": contacts.rubbed, "rubbed_angle": np.zeros(len(contacts))}

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action:
        """See :class:`Mechanism`."""
        known, count = _known_of(given), len(at.x)
        images = given.s * image_velocities(system, contacts, given.t)
        turning_by, values = curvatures(contacts, at.r, count), _spring(at.values)
        slid = slide(known, contacts, values, at.n, at.r, turning_by, at.x - given.x_star, images, given.s)
        size = np.linalg.norm(slid.force, axis=1)
        speed = np.linalg.norm(slid.slip, axis=1) / given.s if given.s > 0 else np.zeros(len(size))
        bound = _bounds(system, contacts, self.mu, at.values["load"], size, speed, at.h)
        force = bound["keep"][:, None] * slid.force
        kept = replace(slid, force=force, turned=turned_back(known, force, at.n, slid.angle))
        reaction = reactions(contacts, known, kept, at.n, count)
        nothing = np.zeros_like(speed)

        def bounds(limit: float, size: Array) -> dict[str, Array]:
            return _bounds(system, contacts, limit, at.values["load"], size, nothing, at.h)

        radii = pair_radii(contacts, system.radii)
        whole = given.own["rubbed"]
        resisted = resist(self.resisting, known, whole, slid, at.n, at.values["k_rub"] * radii, bounds)
        for one in resisted:
            reaction += _moments(contacts, known, radii[:, None] * one.force, count, system.dimension)
        found = Found(kept, slid.force, size, bound, given.s, resisted)
        rubbed = np.concatenate([force, *(_kept(one, at.n) for one in resisted)], axis=1)
        stiffness = largest(at.values["k_rub"])
        return Action(reaction, largest(force), stiffness=stiffness, T=force, rubbed=rubbed, notes={"friction": found})

    def contact_tangents(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Iterator[Array]:
        """See :class:`Mechanism`."""
        found: Found = at.notes["friction"]
        curvature, values = curvatures(contacts, at.r, len(at.x)), at.values
        bound, slides = found.bound, found.bound["keep"] < 1
        along = np.divide(found.trial, found.size[:, None], out=np.zeros_like(found.trial), where=slides[:, None])
        dyad = along[:, :, None] * along[:, None, :]
        speed = np.linalg.norm(found.slid.slip, axis=1)
        ahead = np.divide(found.slid.slip, speed[:, None], out=np.zeros_like(along), where=speed[:, None] > 0)
        by_slip = np.divide(
            bound["by_rate"], found.s * values["k_rub"], out=np.zeros(len(speed)), where=slides & (values["k_rub"] > 0)
        )
        # the trial force changes with the slip as its spring is stiff, and so the bound with the speed of it
        passed = bound["keep"][:, None, None] * (np.eye(at.n.shape[1]) - dyad)
        passed += by_slip[:, None, None] * along[:, :, None] * ahead[:, None, :]
        by_r = bound["by_load"] * values["load_r"] + bound["by_h"] * values["h_r"]
        bounded = Bounded(found.trial, passed, by_r[:, None] * along)
        known = _known_of(given)
        blocks = tangents(known, _spring(values), found.slid, at.n, curvature, given.s, bounded)
        if not found.resisted:
            return blocks
        radii = pair_radii(contacts, system.radii)
        slopes = []
        for one in found.resisted:
            by_r = one.bound["by_load"] * values["load_r"] + one.bound["by_h"] * values["h_r"]
            k, k_r = values["k_rub"] * radii, values["k_rub_r"] * radii
            slopes.append(moment_slopes(one, known, found.slid, at.n, curvature, k, by_r, k_r))
        return _with_moments(blocks, [sum(parts) for parts in zip(*slopes, strict=True)], known, radii)

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        """See :class:`Mechanism`."""
        known, found = _known_of(given), at.notes["friction"]
        return {
            "rubbed": (found.turned - given.own["rubbed"]) / given.s,
            "rubbed_angle": (found.slid.angle - known.angle) / given.s,
        }

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        """Of T, relative to the largest force; where surfaces slide, what the return map lets through of it.

        As surfaces come to touch all forces are small, and T is as uncertain as it is large however short the step: it
        matters as much as the motion feels of it.
        """
        found: Found = at.notes["friction"]
        active = np.flatnonzero(at.values["load"] > 0)
        allowed = np.full(len(active), system.rtol * max(largest(found.slid.force), largest(at.F)))
        if not allowed.any():  # without any force nothing rubs
            return []
        for mechanism in system.having["unfelt"]:
            allowed = np.maximum(allowed, mechanism.unfelt(system, at, at.values["k_rub"][active]))
        d = system.dimension
        columns = [slice(0, d), *(spring.columns for spring in self.resisting)]
        wrong = np.zeros(len(active))
        for part, (bound, _) in zip(columns, found.cut, strict=True):
            own = np.linalg.norm(errors["rubbed"][active, part], axis=1) * bound["keep"][active]
            wrong = np.maximum(wrong, own)
        relative = wrong / allowed
        return [float(np.sqrt(np.mean(relative**2))), float(relative.max()) / 10]

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What is lost in rubbing, what a change of the stiffness takes, and what is stored."""
        found: Found = at.notes["friction"]
        rate = None if system.kernel.contact == "film" else rates.r
        values = contact_state(system, contacts, contacts.S - at.r, at.h, rate)
        k = values["k_rub"]
        joined = k > 0
        yielding = np.divide(1.0, k, out=np.zeros_like(k), where=joined)
        k_rate = values["k_rub_h"] * rates.h + values["k_rub_delta"] * (rates.h - rates.r) / 2
        lost = taken = 0.0
        for bound, trial in found.cut:
            size = bound["keep"] * trial
            lost += float(np.sum(size * (trial - size) * yielding)) / found.s if found.s > 0 else 0.0
            taken += float(np.sum((size * yielding) ** 2 * k_rate / 2))
        stored = float(np.sum(dot(found.turned, rates.own["rubbed"]) * yielding))
        return {"friction": lost, "k_t": taken, ELASTIC: stored - taken}

    def stored(self, system: System, contacts: Contacts, overlap: Array) -> float:
        """See :class:`Mechanism`."""
        k = contact_state(system, contacts, overlap, contacts.h)["k_rub"]
        square = dot(contacts.rubbed, contacts.rubbed)
        return float(np.sum(np.divide(square, 2 * k, out=np.zeros_like(k), where=k > 0)))


def implicit(rubbing: Rubbing, facts: ValidatedScene) -> Springs:
    """Friction of a scene as implicit steps have it.

    Raises
    ------
    SceneError
        If the scene asks for what they do not know.
    """
    if is_loose(facts.scene):
        raise SceneError("[friction] is of contacts with a law: leave it out, or give a law")
    if not moves(facts):
        raise SceneError(
            "[friction] where nothing but contacts resists the particles, how they move depends on the way: give them "
            "a drag ([flow] drag = 1), or inertia ([inertia] density)"
        )
    d = facts.x.shape[1]
    springs = springs_of(facts.scene.friction, d)
    return Springs(rubbing.mu, springs, springs[-1].columns.stop if springs else d)


def _moments(contacts: Contacts, known: Known, moment: Array, count: int, d: int) -> Array:
    """What particles exert by moments of the contacts, from i to j: torques over radii, shape (N, d + rotations).

    Parameters
    ----------
    contacts : Contacts
    known : Known
    moment : array, shape (contacts, rotations)
    count : int
        N.
    d : int
        Dimensions.
    """
    total = np.zeros((count, d + moment.shape[1]))
    pair = contacts.j < count
    np.add.at(total[:, d:], contacts.i, moment / known.radii[0][:, None])
    np.subtract.at(total[:, d:], contacts.j[pair], (moment / known.radii[1][:, None])[pair])
    return total


def _with_moments(blocks: Iterator[Array], slopes: list[Array], known: Known, radii: Array) -> Iterator[Array]:
    """Blocks of the tangent with those of the moments, from the slopes by R theta of i and j, and by x_j - x_i."""
    by_i, by_j, apart = slopes
    d = apart.shape[2]
    for number, block in enumerate(blocks):
        row, column = divmod(number, 2)
        lever = ((1.0 - 2.0 * row) * radii / known.radii[row])[:, None, None]
        block[:, d:, :d] += (2.0 * column - 1.0) * lever * apart
        block[:, d:, d:] += lever * (by_i, by_j)[column]
        yield block


def _kept(one: Resisted, n: Array) -> Array:
    """What is kept of a spring at the end of a step: of twisting the size along the normal."""
    return dot(one.force, n)[:, None] if one.spring.about else one.force


def _given_in(system: System, contacts: Contacts) -> Array:
    """Part of an overlap that the surface of each particle gives in by."""
    rigid = np.array([system.kernel.contact == "dry" and wall.rigid for wall in system.walls], dtype=bool)
    wall = np.maximum(contacts.j - len(system.radii), -1)
    return np.where(np.append(rigid, False)[wall], 1.0, 0.5)


def _known_of(given: StageInput) -> Known:
    """What is known at a stage."""
    begun: Known = given.begun["friction"]
    return replace(begun, force=given.own["rubbed"][:, : begun.force.shape[1]], angle=given.own["rubbed_angle"])


def _spring(values: Mapping[str, Array]) -> dict[str, Array]:
    """The spring of each contact, as what it does without friction is computed from: nothing relaxes, nothing rolls."""
    k, nothing = values["k_rub"], np.zeros_like(values["k_rub"])
    whole = {"keep": np.ones_like(k), "stiff": k, "roll": nothing}
    return {**whole, "keep_r": nothing, "stiff_r": values["k_rub_r"], "roll_r": nothing}


def _bounds(
    system: System, contacts: Contacts, mu: float, load: Array, size: Array, speed: Array, h: Array
) -> dict[str, Array]:
    """What the kernel says of friction: what is kept of the trial forces, and the slopes of their bounds."""
    assert system.kernel.rub is not None
    names = ("keep", "by_load", "by_h", "by_rate")
    out = np.empty((len(names), len(load)))
    system.kernel.rub(
        len(load), mu, np.ascontiguousarray(load), size, speed, h, system.p, contacts.q.reshape(-1), out.reshape(-1)
    )
    return dict(zip(names, out, strict=True))
