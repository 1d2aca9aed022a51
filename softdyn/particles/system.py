"""The facts of a scene of many particles, what its mechanisms make of them, and what follows from it alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.contact_kernels import ContactKernel
from softdyn.particles.driven import Driven, sum_of
from softdyn.particles.geometry import Box, Contacts, Wall, crossing, flow, rotations
from softdyn.particles.mechanisms import ASKED, Mechanism, having
from softdyn.particles.time_functions import TimeFunction

if TYPE_CHECKING:
    from softdyn.particles.particle_keys import ParticleScene

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class ValidatedScene:
    """The facts of a scene, as arrays: nothing in it contradicts anything else.

    Attributes
    ----------
    scene : ParticleScene
        As it was given.
    x : array, shape (N, d)
        Positions at the start.
    radii : array, shape (N,)
    species : array of int, shape (N,)
    names : tuple of str
        Names of the species.
    reach : float
        Range of the contacts; inf without one.
    rtol : float
        Error of a gap, relative to it, and of a position, relative to the radius, allowed in one step.
    times : array
        Of the output.
    box : Box
    walls : tuple of Wall
        Both as they are at the start; in a run, where they are now.
    mechanisms : tuple of Mechanism
    """

    scene: ParticleScene
    x: Array
    radii: Array
    species: NDArray[np.int64]
    names: tuple[str, ...]
    reach: float
    rtol: float
    times: Array
    box: Box
    walls: tuple[Wall, ...]
    mechanisms: tuple[Mechanism, ...]

    @property
    def width(self) -> int:
        """Coordinates of a particle: its position, and with tangential motion or friction its rotation."""
        d = self.x.shape[1]
        return int(d + rotations(d) if self.scene.turns else d)

    def coordinates_scale(self, power: int) -> Array:
        """Factor of each coordinate of the particles: 1, and that power of the radius for rotations."""
        scale = np.ones((len(self.x), self.width))
        scale[:, self.x.shape[1] :] = (1 / self.radii if power < 0 else self.radii)[:, None]
        return scale


@dataclass(frozen=True)
class PreparedScene(ValidatedScene):
    """What every run has, whatever its method: the facts of its scene, and what the mechanisms give together.

    Attributes
    ----------
    law, target, fingerprint : str
        What the result tells of its kernel: the law, what it is compiled by, and the digest of its equations.
    force : Driven
        External forces, shape (N, d + rotations).
    fixed : array of bool, shape (N, d + rotations)
        Coordinates whose velocity is given.
    velocity : Driven
        Velocity of these, shape (N, d + rotations).
    walls0 : array, shape (walls, d)
        A point of each at the start.
    wall_velocity : Driven, optional
        Velocities of the walls, shape (walls, d).
    functions : tuple of TimeFunction
        All that is given as a function of time.
    given, works : tuple of str
        Kinds of energy that are put in, and of all that is exchanged.
    having : mapping from str to tuple of Mechanism
        By the name of each function of a mechanism, those that define it.
    leader : Mechanism, optional
        The one that finds unknown rates of the box.
    box_moves, surrounded : bool
        Whether the box, and box or walls, move otherwise than by a constant shear rate.
    lean0 : array, shape (2,), optional
        Of a box whose strain is the integral of a given shear rate: tilt, and length along y, over that along x at the
        start.
    """

    law: str
    target: str
    fingerprint: str
    force: Driven
    fixed: Flags
    velocity: Driven
    walls0: Array
    wall_velocity: Driven | None
    functions: tuple[TimeFunction, ...]
    given: tuple[str, ...]
    works: tuple[str, ...]
    having: Mapping[str, tuple[Mechanism, ...]]
    leader: Mechanism | None
    box_moves: bool
    surrounded: bool
    lean0: Array | None

    def place(self, t: float) -> Array:
        """Where fixed coordinates are at a time, shape (N, d + rotations)."""
        place = self.velocity.integral(t)
        place[:, : self.dimension] += self.x
        return place

    def wall_place(self, t: float) -> Array:
        """Where the walls are at a time, shape (walls, d)."""
        assert self.wall_velocity is not None
        return self.walls0 + self.wall_velocity.integral(t)

    def lean(self, t: float) -> float:
        """Tilt of a box with a given shear rate over its length along x."""
        assert self.lean0 is not None
        return float(self.lean0[0] + self.lean0[1] * sum(mechanism.strain(t) for mechanism in self.having["strain"]))

    @property
    def box_rates(self) -> Array:
        """Rates of the box that are unknown, as they are."""
        return np.empty(0) if self.leader is None else self.leader.box_rates(self.box)

    @property
    def dimension(self) -> int:
        """Of space."""
        return len(self.box.lengths)


@dataclass(frozen=True)
class System(PreparedScene):
    """What a run of soft contacts has besides: their kernel, and what resists the particles.

    Attributes
    ----------
    kernel : ContactKernel
    p : array
        Uniform parameters of the law.
    resistance : array, shape (N, d + rotations)
        What resists the motion of each coordinate by itself, where nothing moves yet: force/velocity.
    integrated : array of bool, shape (N,)
        Particles whose positions follow from rates, since something resists them by itself.
    dragged : bool
        Whether there are any; if not, positions are in elastic equilibrium.
    """

    kernel: ContactKernel
    p: Array
    resistance: Array
    integrated: Flags
    dragged: bool

    @property
    def listing(self) -> float:
        """Distance of two surfaces within which pairs are listed: that of the contacts, or of other forces."""
        apart = max((mechanism.farthest for mechanism in self.mechanisms), default=0.0)
        return max(self.reach, apart - 2 * float(self.radii.min()))

    @property
    def searches(self) -> bool:
        """Whether pairs are looked for at all: where there are contacts, or forces within a distance."""
        return self.reach > 0 or any(mechanism.farthest > 0 for mechanism in self.mechanisms)

    @property
    def timed(self) -> int:
        """How many potentials ask for how long two particles have been near."""
        return sum(mechanism.timed for mechanism in self.mechanisms)

    @property
    def rubbed(self) -> int:
        """How many numbers a contact keeps of friction."""
        return sum(mechanism.rubbed for mechanism in self.mechanisms)

    @property
    def force_tolerance(self) -> float:
        """Residual of the force balance, relative to the largest force, at which Newton's iteration ends."""
        return 1e-3 * self.rtol


def prepared(
    facts: ValidatedScene, mechanisms: Sequence[Mechanism], law: str, target: str, fingerprint: str
) -> PreparedScene:
    """Put together what the mechanisms give, once they are ready.

    Parameters
    ----------
    facts : ValidatedScene
    mechanisms : sequence of Mechanism
        Ready ones.
    law, target, fingerprint : str
        Name of the law, its target, and the digest of its equations.
    """
    ready = tuple(mechanisms)
    shape, d = (len(facts.x), facts.width), facts.x.shape[1]
    held = [mechanism.held for mechanism in ready if mechanism.held is not None]
    driven_walls = [mechanism.wall_velocity for mechanism in ready if mechanism.wall_velocity is not None]
    leaders = [mechanism for mechanism in ready if mechanism.leads]
    gradients = [one.gradient(0.0, np.empty(0)) for one in having(ready, "gradient") if not one.leads]
    shear_rate = sum(float(gradient[0, 1]) for gradient in gradients if gradient is not None)
    box, lean0 = replace(facts.box, shear_rate=shear_rate), None
    if d > 1 and box.periodic[:2].all() and all(mechanism.keeps_shape for mechanism in ready):
        lean0 = np.array([box.tilt, box.lengths[1]]) / box.lengths[0]
    known = {field.name: getattr(facts, field.name) for field in fields(ValidatedScene)}
    box_moves = any(mechanism.moves_box for mechanism in ready)
    given = dict.fromkeys([*GIVEN, *(kind for mechanism in ready for kind in mechanism.gives)])
    taken = [*TAKEN, *(kind for mechanism in ready for kind in mechanism.takes)]
    return PreparedScene(
        **{**known, "box": box, "mechanisms": ready},
        law=law,
        target=target,
        fingerprint=fingerprint,
        force=sum_of([mechanism.load for mechanism in ready if mechanism.load is not None], shape),
        fixed=np.any([which for which, _ in held] or [np.zeros(shape, dtype=bool)], axis=0),
        velocity=sum_of([velocity for _, velocity in held], shape),
        walls0=np.array([wall.point for wall in facts.walls]).reshape(len(facts.walls), d),
        wall_velocity=driven_walls[0] if driven_walls else None,
        functions=tuple(function for each in having(ready, "driven") for function, _ in each.driven()),
        given=tuple(given),
        works=tuple(dict.fromkeys([*given, *taken])),
        having={name: having(ready, name) for name in ASKED},
        leader=leaders[0] if leaders else None,
        box_moves=box_moves,
        surrounded=box_moves or bool(driven_walls),
        lean0=lean0,
    )


def with_mechanisms(facts: ValidatedScene, kernel: ContactKernel, p: Array, mechanisms: Sequence[Mechanism]) -> System:
    """Put a run of soft contacts together: the facts of a scene, its kernel, and what the mechanisms give together.

    Parameters
    ----------
    facts : ValidatedScene
    kernel : ContactKernel
    p : array, shape (uniform parameters,)
    mechanisms : sequence of Mechanism
    """
    ready = tuple(mechanism.ready(facts, kernel, p) for mechanism in mechanisms)
    shape = (len(facts.x), facts.width)
    resisting = [mechanism.resistance(shape) for mechanism in having(ready, "resistance")]
    resistance = sum((each for each in resisting if each is not None), np.zeros(shape))
    integrated = (resistance[:, 0] > 0) | any(mechanism.moves_freely for mechanism in ready)
    whole = prepared(facts, ready, kernel.law, kernel.target, kernel.fingerprint)
    return System(
        **{field.name: getattr(whole, field.name) for field in fields(PreparedScene)},
        kernel=kernel,
        p=p,
        resistance=resistance,
        integrated=integrated,
        dragged=bool(integrated.any()),
    )


#: Kinds of energy that every result tells of, given and taken, with or without a mechanism that exchanges them: by
#: external forces and what holds fixed coordinates, by the flow, and by the moving box; in the gaps, by drag, by remote
#: forces, and by the dependence of F_ela on h (the U_h term).
GIVEN, TAKEN = ("external", "flow", "box"), ("gaps", "drag", "remote", "U_h")


def gauge_axes(system: System) -> list[int]:
    """Axes along which nothing resists a motion of all particles together."""
    d = system.dimension
    if system.dragged or (system.width > d and system.walls):
        return []
    held = [axis for axis in range(d) if system.fixed[:, axis].any()]
    facing = [axis for axis in range(d) if any(wall.normal[axis] for wall in system.walls)]
    return [axis for axis in range(d) if axis not in held and axis not in facing]


def turns_freely(system: System) -> bool:
    """Whether nothing resists a rotation of all particles together."""
    count, d = len(system.fixed), system.dimension
    alone = not system.fixed.any() and not system.walls and not system.box.periodic.any()
    return alone and d > 1 and count > 1 and not system.dragged


def background(system: System, x: Array) -> Array:
    """Velocity of the background flow, and of rotation with it, in each coordinate."""
    d = system.dimension
    u = flow(system.box, x[:, :d])
    if x.shape[1] == d:
        return u
    rotation = np.zeros((len(x), x.shape[1] - d))
    rotation[:, -1] = -0.5 * system.box.shear_rate * system.radii
    return np.concatenate([u, rotation], axis=1)


def moving_images(system: System, contacts: Contacts, t: float) -> tuple[NDArray[np.int64], Array]:
    """Contacts with an image that moves with the box, or with a moving wall; and its velocity, shape (those, d).

    Parameters
    ----------
    system : System
    contacts : Contacts
    t : float
    """
    rows = crossing(contacts.shift)
    velocities = contacts.shift[rows] @ system.box.rate.T
    if system.wall_velocity is None:
        return rows, velocities
    count = len(system.radii)
    on = np.flatnonzero(contacts.j >= count)
    of_walls = system.wall_velocity(t)[contacts.j[on] - count]
    return np.concatenate([rows, on]), np.concatenate([velocities, of_walls])


def image_velocities(system: System, contacts: Contacts, t: float) -> Array:
    """Velocity of the image of particle j with the box, or of the wall, shape (contacts, d).

    Parameters
    ----------
    system : System
    contacts : Contacts
    t : float
    """
    velocities = np.zeros(contacts.shift.shape)
    rows, moving = moving_images(system, contacts, t)
    velocities[rows] = moving
    return velocities


def relative_velocities(system: System, contacts: Contacts, t: float, v: Array) -> Array:
    """Velocity of particle j, or of the wall, as seen from particle i, shape (contacts, d).

    Parameters
    ----------
    system : System
    contacts : Contacts
    t : float
    v : array, shape (N, w)
        Velocities, of which rotations are left out.
    """
    d = system.dimension
    ends = np.concatenate([v[:, :d], np.zeros((len(system.walls), d))])
    apart = ends.take(contacts.j, axis=0)
    apart -= ends.take(contacts.i, axis=0)
    rows, velocities = moving_images(system, contacts, t)
    np.add.at(apart, rows, velocities)
    return apart


def opening_rates(system: System, contacts: Contacts, t: float, v: Array, n: Array) -> Array:
    """Rates dr/dt of the distances of the centres, with the directions n of the contacts, shape (contacts,).

    Parameters
    ----------
    system : System
    contacts : Contacts
    t : float
    v : array, shape (N, w)
        Velocities.
    n : array, shape (contacts, d)
    """
    return np.asarray(np.einsum("ca,ca->c", relative_velocities(system, contacts, t, v), n))


def contact_state(
    system: System, contacts: Contacts, overlap: Array, h: Array, rate: Array | None = None
) -> dict[str, Array]:
    """Return what the kernel says of each contact: delta, a, F, friction (w zeta), remote (w F_adh), C, ...

    Where gaps are no states, forces depend on the rate dr/dt of the distance, which is 0 if it is not given.

    Parameters
    ----------
    system : System
    contacts : Contacts
    overlap : array, shape (contacts,)
        Sum of the radii less the distance of the centres.
    h : array, shape (contacts,)
        Gaps, lengths.
    rate : array, shape (contacts,), optional
        A velocity.
    """
    kernel = system.kernel
    out = np.empty((len(kernel.outputs), len(h)))
    reach = (system.reach,) if kernel.fading else ()
    state = h if kernel.contact == "film" else np.zeros(len(h)) if rate is None else rate
    kernel.state(len(h), *reach, overlap, state, system.p, contacts.q.reshape(-1), out.reshape(-1))
    return dict(zip(kernel.outputs, out, strict=True))
