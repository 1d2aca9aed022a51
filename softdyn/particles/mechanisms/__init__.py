"""The rooms of the mechanisms: what acts in a scene of many particles, one module each.

A room has a function ``check``, which takes what is known of a scene, tells faults, and returns the room's
:class:`Mechanism`, bound to its numbers. The engine asks the mechanisms of a scene, in the order of :data:`ROOMS`, for
what they have, and knows none of them by name. The room of a mechanism that a scene does not have is not imported.

How to add one is told in ``.docs/mechanisms.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softdyn.traits import traits_of

if TYPE_CHECKING:
    from softdyn.particles.contact_kernels import ContactKernel
    from softdyn.particles.driven import Driven
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance, Newton, StageInput
    from softdyn.particles.geometry import Box, Contacts, Integers, Wall
    from softdyn.particles.particle_keys import ParticleScene
    from softdyn.particles.resolve import Sensitivity
    from softdyn.particles.results import Frame
    from softdyn.particles.state import State
    from softdyn.particles.system import PreparedScene, System, ValidatedScene
    from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Modules here, and the fields of a scene that ask for it: each that is given, and neither 0 nor empty.
ROOMS: dict[str, tuple[str, ...]] = {
    "soft_films": ("law",),
    "dry_contacts": ("law",),
    "rigid_films": ("law",),
    "no_contacts": ("potential", "bond", "noise"),
    "potentials": ("potential",),
    "bonds": ("bond",),
    "drag": ("drag",),
    "pushes": ("push",),
    "gravity": ("gravity",),
    "inertia": ("inertia",),
    "coulomb": ("friction",),
    "noise": ("noise",),
    "holds": ("hold",),
    "walls": ("wall",),
    "shear": ("shear_rate",),
    "stress": ("stress", "stress_viscosity"),
    "sliding": ("tangential",),
}


#: Of which a scene has one: the contacts of its law, by what they are.
CONTACTS = {"soft_films": "film", "dry_contacts": "dry", "rigid_films": "rigid", "no_contacts": "none"}


@dataclass(frozen=True)
class Action:
    """What a mechanism does to the particles at a stage.

    Attributes
    ----------
    reaction : array, shape (N, d + rotations)
        Forces, and torques over radii, that the particles exert on what resists them.
    largest : float
        Of these forces: what the balance is judged by.
    friction, stiffness : float
        Largest force for each length that a coordinate moves in the stage, of a particle by itself and of a contact:
        what rounding of positions makes of it.
    T : array, shape (contacts, d), optional
        Forces of the contacts besides those along the normals, from i to j.
    rubbed : array, shape (contacts, d or more), optional
        Of these, what surfaces that touch bear by friction, and what resists rolling and twisting: a contact keeps it.
    notes : mapping
        What else was found, for the mechanism itself; names are its own.
    """

    reaction: Array
    largest: float
    friction: float = 0.0
    stiffness: float = 0.0
    T: Array | None = None
    rubbed: Array | None = None
    notes: Mapping[str, Any] = field(default_factory=dict)


class Mechanism:
    """What a mechanism may have. A room defines what it has, and leaves out the rest.

    Attributes
    ----------
    gives, takes : tuple of str
        Kinds of energy that it puts in, and that it takes. Several mechanisms may share one.
    symmetric : bool
        Whether its tangents are.
    moves_freely : bool
        Whether positions follow from rates, even where nothing resists them, as with inertia.
    touching : bool
        Of what solves the contacts: whether surfaces touch, and gaps may be 0.
    closed : str
        Likewise: the remedy where a gap would be 0 at the start.
    leads : bool
        Whether rates of the box are unknown, and its ``lead`` finds them.
    load : Driven, optional
        External forces, and torques over radii, that depend on time alone, shape (N, d + rotations).
    held : tuple of (array of bool, Driven), optional
        Coordinates that do not follow from forces, and their velocities, shape (N, d + rotations) each.
    walls : tuple of Wall
        Flat walls that the particles touch.
    wall_velocity : Driven, optional
        Their velocities, shape (walls, d).
    moves_box : bool
        Whether the box moves with it otherwise than by a constant shear rate.
    keeps_shape : bool
        Whether all lengths of the box change alike by it.
    farthest : float
        Distance of two centres within which it acts on them; such pairs are listed.
    skin : float
        By how much further pairs are listed at least, in smallest radii, where it moves particles past one another.
    timed : int
        How many columns of ``Contacts.since`` it has: times since which two particles are near.
    rubbed : int
        How many columns of ``Contacts.rubbed`` it has.
    made_by : tuple of str
        Kernels of its own, by their names in the cache.
    """

    gives: ClassVar[tuple[str, ...]] = ()
    takes: ClassVar[tuple[str, ...]] = ()
    symmetric: ClassVar[bool] = True
    moves_freely: ClassVar[bool] = False
    touching: ClassVar[bool] = False
    closed: ClassVar[str] = ""
    leads: ClassVar[bool] = False
    load: Driven | None = None
    held: tuple[Flags, Driven] | None = None
    walls: tuple[Wall, ...] = ()
    wall_velocity: Driven | None = None
    moves_box: bool = False
    keeps_shape: bool = True
    farthest: float = 0.0
    skin: float = 0.0
    timed: int = 0
    rubbed: int = 0
    made_by: tuple[str, ...] = ()

    def ready(self, facts: ValidatedScene, kernel: ContactKernel, p: Array) -> Mechanism:
        """The same, once the kernel of the contacts and the values of its uniform parameters are known.

        Parameters
        ----------
        facts : ValidatedScene
        kernel : ContactKernel
        p : array, shape (uniform parameters,)
        """
        return self

    def driven(self) -> Iterator[tuple[TimeFunction, Callable[[Sensitivity, float], float]]]:
        """What is given as a function of time; and the error that a unit of what a step misses of it makes.

        That error is in units of what is allowed, from the sensitivity of the state and the length of the step.
        """
        return iter(())

    # what it integrates, beside the positions and the gaps

    def kept(self, system: System) -> dict[str, Array]:
        """Numbers of the particles that it integrates from step to step, at the start of the run, by its own names."""
        return {}

    def begin(self, system: System, contacts: Contacts, t: float, x: Array) -> tuple[dict[str, Any], dict[str, Array]]:
        """What it notes as a step begins, and numbers that it integrates within this step alone, as they are there.

        Parameters
        ----------
        system : System
        contacts : Contacts
        t : float
            Start of the step.
        x : array, shape (N, d)
        """
        return {}, {}

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        """Rates of all that it integrates, at the end of a stage.

        Parameters
        ----------
        system : System
        given : StageInput
        at : Balance
            At the end of the stage.
        """
        return {}

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        """Errors of a step relative to what is allowed, from those that the method estimates, by names of the rates.

        Parameters
        ----------
        system : System
        at : Balance
            At the end of the step.
        errors : mapping from str to array
        """
        return []

    def per_impulse(self, system: System) -> Array | None:
        """Errors, in units of what is allowed, that a unit of an impulse on each particle makes."""
        return None

    def unfelt(self, system: System, at: Balance, stiffness: Array) -> Array | float:
        """Errors of the force of springs of some stiffnesses, shape (n,), which the motion is allowed to have.

        Parameters
        ----------
        system : System
        at : Balance
        stiffness : array, shape (n,)
            Force over length.
        """
        return 0.0

    # contacts

    def solve(
        self, system: System, contacts: Contacts, x: Array, cell: Array, given: StageInput, y: Array
    ) -> tuple[Array, Array, Array, Array, Array, dict[str, Array]]:
        """Of one mechanism of a scene: normals, distances, gaps, forces and dF/dr of the contacts at the positions x.

        Besides, what it gives for tangential motion. ``y`` is a guess of the gaps' state, and then the solution.

        Parameters
        ----------
        system : System
        contacts : Contacts
        x : array, shape (N, d)
        cell : array, shape (d, d)
            Lattice vectors of the box, as columns.
        given : StageInput
        y : array, shape (contacts,)
            As ``y_star`` of the stage; changed in place.
        """
        raise NotImplementedError

    def gaps_at_sight(self, system: System, apart: Array, at_start: bool) -> Array:
        """Where it solves the contacts: gaps of pairs seen first, whose surfaces are ``apart`` undeflected.

        Parameters
        ----------
        system : System
        apart : array, shape (pairs,)
            Distances of the surfaces, < 0 where they overlap.
        at_start : bool
            Whether the run begins with them.
        """
        raise NotImplementedError

    def require(self, system: System, state: State, at: Balance, when: float) -> None:
        """Refuse a step that ends where what it says does not hold; raises IntegrationError.

        Parameters
        ----------
        system : System
        state : State
        at : Balance
            At the end of the step.
        when : float
            Its time.
        """

    # forces along the lines of the centres

    def pairs(self) -> tuple[Integers, Integers, Integers] | None:
        """Pairs that are always listed: i < j, and the lattice vectors by which j is displaced."""
        return None

    def central(self, system: System, contacts: Contacts, t: float, r: Array) -> tuple[Array, Array] | None:
        """Of each listed pair a force that depends on the distance r, > 0 apart, and its slope, shape (contacts,).

        Parameters
        ----------
        system : System
        contacts : Contacts
        t : float
        r : array, shape (contacts,)
            Distances of the centres.
        """
        return None

    def central_energy(self, system: System, contacts: Contacts, t: float, r: Array) -> float:
        """Energy of these forces.

        Parameters
        ----------
        system : System
        contacts : Contacts
        t : float
        r : array, shape (contacts,)
            Distances of the centres.
        """
        return 0.0

    def ends(self, system: System, state: State, at: Balance, when: float) -> float | None:
        """Length of a step that would end at something that happens within one that ends here; None if nothing does.

        Parameters
        ----------
        system : System
        state : State
        at : Balance
            At its end.
        when : float
            The time then.
        """
        return None

    def note(self, system: System, state: State) -> bool:
        """Take notice of where the run is, at its start and after each step; tells whether a force has jumped."""
        return False

    # forces

    def resistance(self, shape: tuple[int, int]) -> Array | None:
        """What resists the motion of each coordinate by itself, force over velocity, where nothing moves yet."""
        return None

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action | None:
        """Forces that depend on positions and velocities, (x - x*)/s, at a stage; ``at`` has no residual yet.

        Parameters
        ----------
        system : System
        contacts : Contacts
        given : StageInput
        at : Balance
        """
        return None

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array | None:
        """Derivative of these forces by x: of each coordinate by itself, (N, w), or of each particle, (N, w, w).

        Parameters
        ----------
        system : System
        contacts : Contacts
        given : StageInput
        at : Balance
        """
        return None

    def contact_tangents(
        self, system: System, contacts: Contacts, given: StageInput, at: Balance
    ) -> Iterator[Array] | None:
        """The same of each contact, shape (contacts, w, w): blocks ii, ij, ji, jj in turn.

        Parameters
        ----------
        system : System
        contacts : Contacts
        given : StageInput
        at : Balance
        """
        return None

    def unresisted(self, system: System, contacts: Contacts, near: Integers, n: Array, moved: Array) -> Array | None:
        """Part of a motion, or of forces, shape (N, w), that nothing but drag resists.

        ``near`` are the contacts within range, ``n`` their normals.

        Parameters
        ----------
        system : System
        contacts : Contacts
        near : array of int
        n : array, shape (near, d)
        moved : array, shape (N, w)
            The motion, or the forces.
        """
        return None

    def follow(
        self,
        system: System,
        newton: Newton,
        contacts: Contacts,
        x: Array,
        t: float,
        before: Array | None,
        after: Array,
    ) -> tuple[Balance, float, str] | None:
        """Elastic equilibrium behind a jump of the forces on particles that nothing resists, if it depends on the way.

        ``before`` is None where something has held the particles until then. Besides, the work of the forces, and the
        kind of energy that takes what of it is not stored.

        Parameters
        ----------
        system : System
        newton : Newton
        contacts : Contacts
        x : array, shape (N, d)
            Positions before the jump.
        t : float
        before : array, shape (N, w), optional
        after : array, shape (N, w)
            External forces, and torques over radii, on both sides of the jump.
        """
        return None

    # the box

    def gradient(self, t: float, rates: Array) -> Array | None:
        """Velocity gradient of the background flow that it makes, shape (d, d); ``rates`` are unknown ones."""
        return None

    def strain(self, t: float) -> float:
        """Shear strain that is given, at a time."""
        return 0.0

    def box_rates(self, box: Box) -> Array:
        """Where it leads: the unknown rates, as a box has them."""
        raise NotImplementedError

    def box_with(self, box: Box, z_rate: Array) -> Box:
        """Where it leads: a box with the rates that its coordinates have."""
        raise NotImplementedError

    def lead(
        self,
        system: System,
        contacts: Contacts,
        newton: Newton,
        t: float,
        s: float,
        z_star: Array,
        rates: Array,
        solve: Callable[[System, Array], Balance],
        x: Array,
    ) -> tuple[Balance, System, Array, Array]:
        """Where it leads: the balance, box and walls, dz/dt, and the rates; see the room ``stress``.

        Parameters
        ----------
        system : System
        contacts : Contacts
        newton : Newton
        t, s : float
            End of the stage, and gamma dt.
        z_star : array
            Known part of the coordinates of box and walls, as x* is of the positions: see
            :func:`softdyn.particles.surroundings.coordinates`.
        rates : array, shape (unknown rates,)
            Guess of those of the box, 1/time.
        solve : function of a System and positions
            Balances the particles' forces in a given box, from a guess of the positions.
        x : array, shape (N, w)
            Guess of the positions.
        """
        raise NotImplementedError

    def flux(self, system: PreparedScene, x: Array, v: Array) -> Array | float:
        """Momentum that the particles of a periodic box carry by fluctuating, times its volume, shape (d, d).

        Parameters
        ----------
        system : PreparedScene
        x, v : array, shape (N, d)
            Positions and velocities.
        """
        return 0.0

    # energy, and what is told

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """Power of each kind that it gives or takes, at one stage, and of what it stores, ``ELASTIC``.

        Parameters
        ----------
        system : System
        contacts : Contacts
        at : Balance
        rates : Rates
        """
        return {}

    def stored(self, system: System, contacts: Contacts, overlap: Array) -> float:
        """Energy that it stores in some contacts, as they are.

        Parameters
        ----------
        system : System
        contacts : Contacts
        overlap : array, shape (contacts,)
            Sums of the radii less the distances of the centres.
        """
        return 0.0

    def carried(self, system: System, kept: Mapping[str, Array]) -> float:
        """Energy that the particles have with them, of whose rounding small changes of it are."""
        return 0.0

    def marks(self) -> dict[str, Array]:
        """Numbers that it has noted, by its own names: a checkpoint holds them, and they are read into these arrays."""
        return {}

    def columns(self, system: PreparedScene, frames: Sequence[Frame]) -> dict[str, NDArray[Any]]:
        """Arrays of its own in the result, by name; those of one number a frame have the shape (frames,)."""
        return {}

    def stats(self) -> dict[str, Any]:
        """What a result tells of it besides its arrays."""
        return {}

    def untold(self) -> str:
        """What frames alone do not tell of it, for a warning; "" if they tell all."""
        return ""


def having(mechanisms: Sequence[Mechanism], name: str) -> tuple[Mechanism, ...]:
    """Those of some mechanisms that define one of the functions above."""
    return tuple(one for one in mechanisms if getattr(type(one), name) is not getattr(Mechanism, name))


def untold(mechanisms: Sequence[Mechanism]) -> list[str]:
    """What the frames of a run that has not ended do not tell."""
    return [words for one in mechanisms if (words := one.untold())]


#: What the engine asks for again and again.
ASKED = (
    "driven", "begin", "rates_of", "errors", "act", "tangent", "contact_tangents", "unresisted", "follow", "gradient",
    "strain", "powers", "stored", "kept", "stats", "require", "solve", "pairs", "central", "central_energy", "ends",
    "note", "marks", "columns", "per_impulse", "unfelt",
    "carried", "flux",
)  # fmt: skip


#: Values of a scene that ask for nothing where they are 0 or empty.
PLAIN = (bool, int, float, np.number, np.bool_, tuple, list, dict)


def rooms_of(scene: ParticleScene) -> Iterator[Any]:
    """Modules of the mechanisms that a scene asks for, in order."""
    for name, wanted in ROOMS.items():
        asked = any(_asks(getattr(scene, field)) for field in wanted)
        if asked and (name not in CONTACTS or CONTACTS[name] == _kind(scene)):
            yield import_module(f"{__name__}.{name}")


def _kind(scene: ParticleScene) -> str:
    """What the contacts of a scene are; of rigid grains, without a law, nothing."""
    from softdyn.particles.loose_particles import is_loose

    return "none" if is_loose(scene) else "" if scene.law is None else traits_of(scene.law).kind


def _asks(value: Any) -> bool:
    """Whether a field is given, and neither 0 nor empty."""
    return value is not None and not (isinstance(value, PLAIN) and not value)
