"""What stays the same over a run of many particles, and what follows from it alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.geometry import Box, Contacts, Wall, crossing, flow
from softdyn.particles.imposed import Imposed
from softdyn.particles.kernel import ContactKernel
from softdyn.particles.loads import Driven
from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


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
    radii : array, shape (N,)
    resistance : array, shape (N, d + rotations)
        What resists the motion of each coordinate through the fluid: force/velocity.
    fixed : array of bool, shape (N, d + rotations)
        Coordinates whose velocity is given.
    force, velocity : Driven
        External force on each particle, and velocity of the fixed coordinates, shape (N, d + rotations).
    x0 : array, shape (N, d + rotations)
        Coordinates at the start; the fixed ones are moved from there.
    rtol : float
        Error of a gap, relative to it, and of a position, relative to the radius, allowed in one step.
    imposed : Imposed, optional
        Stress imposed on the box.
    shear : TimeFunction, optional
        The shear rate, if it changes.
    wall_velocity : Driven, optional
        Velocities of the walls, shape (walls, d).
    walls0 : array, shape (walls, d)
        A point of each at the start.
    lean0 : array, shape (2,), optional
        Of a box whose strain is the integral of a given shear rate: tilt, and length along y, over that along x at the
        start.
    """

    kernel: ContactKernel
    p: Array
    reach: float
    box: Box
    walls: tuple[Wall, ...]
    radii: Array
    resistance: Array
    fixed: Flags
    force: Driven
    velocity: Driven
    x0: Array
    walls0: Array
    rtol: float
    imposed: Imposed | None = None
    wall_velocity: Driven | None = None
    shear: TimeFunction | None = None
    lean0: Array | None = None

    def place(self, t: float) -> Array:
        """Where fixed coordinates are at a time, shape (N, d + rotations)."""
        return self.x0 + self.velocity.integral(t)

    def wall_place(self, t: float) -> Array:
        """Where the walls are at a time, shape (walls, d)."""
        assert self.wall_velocity is not None
        return self.walls0 + self.wall_velocity.integral(t)

    def lean(self, t: float) -> float:
        """Tilt of a box with a given shear rate over its length along x."""
        assert self.lean0 is not None
        strain = self.box.shear_rate * t if self.shear is None else self.shear.integral(t)
        return float(self.lean0[0] + self.lean0[1] * strain)

    @property
    def box_rates(self) -> Array:
        """Rates of the box that the imposed stress makes unknown, as they are."""
        if self.imposed is None:
            return np.empty(0)
        G = self.box.gradient
        places = ["xx" if name == "pressure" else name for name in self.imposed.names]
        return np.array([G["xyz".index(place[0]), "xyz".index(place[1])] for place in places])

    @property
    def dimension(self) -> int:
        """Of space."""
        return len(self.box.lengths)

    @property
    def drag(self) -> Array:
        """What resists the motion of each particle through the fluid, shape (N,)."""
        return self.resistance[:, 0]

    @property
    def dragged(self) -> bool:
        """Whether the fluid resists any particle by itself; if not, positions are in elastic equilibrium."""
        return bool(np.any(self.drag > 0))

    @property
    def force_tolerance(self) -> float:
        """Residual of the force balance, relative to the largest force, at which Newton's iteration ends."""
        return 1e-3 * self.rtol


#: Energy put in by external forces and by what holds fixed coordinates, by the flow, and by the moving box; energy
#: lost in the gaps, by drag, to remote forces, and what the dependence of F_ela on h takes (the U_h term).
WORKS = ("external", "flow", "box", "gaps", "drag", "remote", "U_h")
#: Besides, with tangential motion: lost in sliding and in rolling, and what a change of the tangential stiffness takes.
TANGENTIAL_WORKS = ("sliding", "rolling", "k_t")


def works(system: System) -> tuple[str, ...]:
    """Kinds of energy that are exchanged."""
    return (*WORKS, *TANGENTIAL_WORKS) if system.kernel.tangential else WORKS


def gauge_axes(system: System) -> list[int]:
    """Axes along which nothing resists a motion of all particles together."""
    d = system.dimension
    if system.dragged or (system.kernel.tangential and system.walls):
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
    """Contacts with an image that moves with the box, or with a moving wall; and its velocity, shape (those, d)."""
    rows = crossing(contacts.shift)
    velocities = contacts.shift[rows] @ system.box.rate.T
    if system.wall_velocity is None:
        return rows, velocities
    count = len(system.radii)
    on = np.flatnonzero(contacts.j >= count)
    of_walls = system.wall_velocity(t)[contacts.j[on] - count]
    return np.concatenate([rows, on]), np.concatenate([velocities, of_walls])


def image_velocities(system: System, contacts: Contacts, t: float) -> Array:
    """Velocity of the image of particle j with the box, or of the wall, shape (contacts, d)."""
    velocities = np.zeros(contacts.shift.shape)
    rows, moving = moving_images(system, contacts, t)
    velocities[rows] = moving
    return velocities


def contact_state(system: System, contacts: Contacts, overlap: Array, h: Array) -> dict[str, Array]:
    """Return what the kernel says of each contact: delta, a, F, friction (w zeta), remote (w F_adh), C, ..."""
    kernel = system.kernel
    out = np.empty((len(kernel.outputs), len(h)))
    reach = (system.reach,) if kernel.fading else ()
    kernel.state(len(h), *reach, overlap, h, system.p, contacts.q.reshape(-1), out.reshape(-1))
    return dict(zip(kernel.outputs, out, strict=True))
