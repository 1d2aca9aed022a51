"""What resists rolling and twisting in implicit steps: springs beside that of friction, cut by the same return map.

With the relative rotation z = theta_i - theta_j and R = 2 R1 R2/(R1 + R2) (of a wall 2 R1), the forces of the springs
are ::

    M_trial = M_0 + k_t R (z - (n.z) n) ,   Q_trial = Q_0 + k_t R (n.z) n ,   |M| <= rolling N ,   |Q| <= twisting N

and the moment R (M + Q), from i to j. In two dimensions there is M alone. What is known of M turns with the normal, and
about it with both particles; Q lies along the normal. Both are kept from step to step: M as it is, Q by its size. The
bounds are those of :mod:`softdyn.derive.coulomb` at rest: where a law declares a mu of its own, they have it, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import Contacts, cross, dot, rotations
from softdyn.particles.mechanisms.sliding import Known, TangentialForces, carry, spin, turned_back

if TYPE_CHECKING:
    from softdyn.particles.mechanisms.coulomb import Friction

Array = NDArray[np.float64]
#: What the kernel gives of a bound, from the coefficient and the sizes of trial forces: see ``derive/coulomb.py``.
Bounds = Callable[[float, Array], dict[str, Array]]


@dataclass(frozen=True)
class Spring:
    """A spring that resists rolling, or twisting.

    Attributes
    ----------
    limit : float
        Its largest moment over N R.
    about : bool
        Whether it resists twisting about the normal.
    columns : slice
        Where it is in what a contact keeps.
    """

    limit: float
    about: bool
    columns: slice


@dataclass(frozen=True)
class Resisted:
    """Such a spring at a stage; shape (contacts, rotations) of its vectors.

    Attributes
    ----------
    spring : Spring
    known, trial, force : array
        What is known of its force where the contact is now; its force without a bound, and with it.
    size : array, shape (contacts,)
        Of the trial force.
    bound : mapping from str to array
        What the kernel gives: keep, by_load, by_h.
    turned : array, shape (contacts, columns)
        The force as it is kept, in the frame of the step's start.
    """

    spring: Spring
    known: Array
    trial: Array
    force: Array
    size: Array
    bound: Mapping[str, Array]
    turned: Array


def springs_of(friction: Friction | None, d: int) -> tuple[Spring, ...]:
    """Return the springs of a scene in d dimensions."""
    found, at = [], d
    if friction is not None and friction.rolling:
        found.append(Spring(float(friction.rolling), False, slice(at, at + rotations(d))))
        at += rotations(d)
    if friction is not None and friction.twisting:
        found.append(Spring(float(friction.twisting), True, slice(at, at + 1)))
    return tuple(found)


def pair_radii(contacts: Contacts, radii: Array) -> Array:
    """2 R1 R2/(R1 + R2) of each contact, of a wall 2 R1, shape (contacts,)."""
    wall = contacts.j >= len(radii)
    one, other = radii[contacts.i], radii[np.where(wall, contacts.i, contacts.j)]
    return np.where(wall, 2 * one, 2 * one * other / (one + other))


def resist(
    springs: Sequence[Spring],
    known: Known,
    kept: Array,
    slid: TangentialForces,
    n: Array,
    stiffness: Array,
    bounds: Bounds,
) -> list[Resisted]:
    """Forces of the springs at a stage.

    Parameters
    ----------
    springs : sequence of Spring
    known : Known
        Normals at the start of the step.
    kept : array, shape (contacts, columns)
        What is known of all that a contact keeps, in the frame of the step's start.
    slid : TangentialForces
        Relative rotations in the stage, and psi.
    n : array, shape (contacts, d)
    stiffness : array, shape (contacts,)
        k_t R.
    bounds : function
        Of a coefficient and the sizes of trial forces.
    """
    found = []
    for spring in springs:
        before = kept[:, spring.columns]
        if spring.about:
            before = before * n
        elif n.shape[1] == 3:
            before = spin(carry(before, known.normal, n), n, slid.angle)
        trial = before + stiffness[:, None] * _part(spring, slid.roll, n)
        size = np.linalg.norm(trial, axis=1)
        bound = bounds(spring.limit, size)
        force = bound["keep"][:, None] * trial
        turned = force
        if n.shape[1] == 3:
            turned = dot(force, n)[:, None] if spring.about else turned_back(known, force, n, slid.angle)
        found.append(Resisted(spring, before, trial, force, size, bound, turned))
    return found


def _part(spring: Spring, roll: Array, n: Array) -> Array:
    """What a spring resists of relative rotations."""
    if n.shape[1] == 2:
        return roll
    along = dot(n, roll)[:, None] * n
    return along if spring.about else roll - along


def moment_slopes(
    one: Resisted,
    known: Known,
    slid: TangentialForces,
    n: Array,
    curvature: Array,
    stiffness: Array,
    by_r: Array,
    stiffness_r: Array,
) -> tuple[Array, Array, Array]:
    """Derivatives of a spring's force by R theta of i and of j, and by x_j - x_i, shape (contacts, rotations, ...).

    Exact where n has not turned since the start of the step, as those of the tangential force are.

    Parameters
    ----------
    one : Resisted
    known, slid, n, curvature
        See :func:`softdyn.particles.mechanisms.sliding.slide`.
    stiffness, stiffness_r : array, shape (contacts,)
        k_t R, and its slope in r.
    by_r : array, shape (contacts,)
        Slope of the bound in r.
    """
    (c, d), m = n.shape, one.trial.shape[1]
    slides = one.bound["keep"] < 1
    along = np.divide(one.trial, one.size[:, None], out=np.zeros_like(one.trial), where=slides[:, None])
    passed = one.bound["keep"][:, None, None] * (np.eye(m) - along[:, :, None] * along[:, None, :])
    dyad = n[:, :, None] * n[:, None, :]
    part = np.broadcast_to(np.eye(1), (c, 1, 1)) if d == 2 else dyad if one.spring.about else np.eye(3) - dyad
    by_roll = stiffness[:, None, None] * (passed @ part)
    own = by_roll / known.radii[0][:, None, None], -by_roll / known.radii[1][:, None, None]
    apart = (passed @ (stiffness_r[:, None] * _part(one.spring, slid.roll, n))[:, :, None]) * n[:, None, :]
    apart = apart + (by_r[:, None] * along)[:, :, None] * n[:, None, :]
    if d == 2:
        return *own, apart
    across, facing = np.eye(3) - dyad, dot(n, slid.roll)[:, None, None]
    turned = stiffness[:, None, None] * (facing * across + n[:, :, None] * (slid.roll[:, None, :] @ across))
    if one.spring.about:
        turned = turned + dot(one.known, n)[:, None, None] * across
    else:
        spun = cross(n, one.known)
        sum_of = slid.rotation[0] / known.radii[0][:, None] + slid.rotation[1] / known.radii[1][:, None]
        turned = -turned - n[:, :, None] * (one.known[:, None, :] @ across)
        turned = turned + spun[:, :, None] * (sum_of[:, None, :] @ across) / 2
        spinning = passed @ (spun[:, :, None] * n[:, None, :]) / 2
        own = own[0] + spinning / known.radii[0][:, None, None], own[1] + spinning / known.radii[1][:, None, None]
    return *own, apart + curvature[:, None, None] * (passed @ turned)
