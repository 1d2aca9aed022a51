"""Grains of a suspension with bonds, potentials or soft films: implicit sub-steps within a step of the fluid.

Over a step, a grain feels its weight, the pressure -V grad p and the drag K (v_f - v), with v_f, grad p and K as they
stand at an attempt at the step, and what its neighbours do: all that the implicit engine of many particles knows. Its
steps are as long as their error allows, of order 3, and have no limit of stability: of a stiff bond, or a thin film, a
step sees what it comes to. Where the error asks for it, a step of the fluid is divided. The impulse of the drag is
integrated beside the velocities: it is, to rounding, what the grains have had.

A film's friction contains what the fluid resists of two spheres far apart. The drag is the closure's here, so that a
contact carries what exceeds its own limit, and ends within its range: the fluid does what is further away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles import checkpoint
from softdyn.particles.force_balance import Balance, Newton, StageInput, largest
from softdyn.particles.geometry import Contacts, directions, lattice
from softdyn.particles.integrate import integrate
from softdyn.particles.mechanisms import Action, Mechanism
from softdyn.particles.mechanisms.drag import Drag
from softdyn.particles.mechanisms.inertia import GYRATION, Inertia, Masses
from softdyn.particles.mechanisms.potentials import Potentials
from softdyn.particles.particle_run import ready
from softdyn.particles.particle_scene import check
from softdyn.particles.start import start
from softdyn.particles.state import State
from softdyn.particles.system import System, contact_state, opening_rates
from softdyn.suspension.grain_contacts import Passage, parameters_of_law, particles_of, refuse_range
from softdyn.traits import traits_of

if TYPE_CHECKING:
    from softdyn.fluid.mesh import Mesh
    from softdyn.suspension.suspension_result import SuspensionFrame
    from softdyn.suspension.suspension_scene import GrainArrays, SuspensionScene

Array = NDArray[np.float64]

#: Error of a position, relative to the radius, allowed in a sub-step.
RTOL = 1e-3
#: What the viscosities of a law and of the fluid may differ by.
SAME = 1e-9
#: Width of the skin of lists of pairs, in smallest radii: flows carry grains past one another fast.
SKIN = 3.0
#: Of a run without frames of its own: no output time is ever reached.
NO_TIMES = np.array([-1.0])


@dataclass(frozen=True)
class InFluid(Mechanism):
    """What the fluid does to the grains within a step; each attempt at one fills the arrays anew.

    Attributes
    ----------
    friction : array, shape (N,)
        Drag over the velocity of the fluid less theirs.
    velocity, push : arrays, shape (N, d)
        Of the fluid; forces that last.
    """

    friction: Array
    velocity: Array
    push: Array

    skin = SKIN

    def kept(self, system: System) -> dict[str, Array]:
        """The impulse of the drag."""
        return {"impulse": np.zeros_like(self.velocity)}

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action | None:
        """See :class:`Mechanism`."""
        if given.s <= 0:
            return None
        d = self.velocity.shape[1]
        drag = self.friction[:, None] * (self.velocity - ((at.x - given.x_star) / given.s)[:, :d])
        reaction = np.zeros_like(at.x)
        reaction[:, :d] = -drag - self.push
        size = max(largest(drag), largest(self.push))
        return Action(reaction, size, largest(self.friction) / given.s, notes={"in_fluid": drag})

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array | None:
        """See :class:`Mechanism`."""
        if given.s <= 0:
            return None
        found = np.zeros_like(at.x)
        found[:, : self.velocity.shape[1]] = self.friction[:, None] / given.s
        return found

    def rates_of(self, system: System, given: StageInput, at: Balance) -> dict[str, Array]:
        """The drag, as the balance of the stage has it."""
        return {"impulse": at.notes["in_fluid"]}


class MassesInFluid(Masses):
    """Masses of grains whose velocities follow the fluid, within a step or less.

    Each attempt at a step begins with a jump of what the fluid does, to which velocities come within m/K. Errors of the
    positions say whether that matters; those of the velocities would divide every step for it.
    """

    def errors(self, system: System, at: Balance, errors: Mapping[str, Array]) -> list[float]:
        """None of its own.

        Parameters
        ----------
        system : System
        at : Balance
        errors : mapping from str to array
        """
        return []


@dataclass
class SoftGrains:
    """Everything that changes of the grains.

    Attributes
    ----------
    state : State
        Of the implicit engine.
    noted : mapping from str to array
        What the mechanisms have noted, in arrays of its own.
    """

    state: State
    noted: dict[str, Array] = field(default_factory=dict)


def soft_system(scene: SuspensionScene, mesh: Mesh, grains: GrainArrays, mass: Array) -> System:
    """Put together what the implicit engine needs.

    Parameters
    ----------
    scene : SuspensionScene
    mesh : Mesh
    grains : GrainArrays
    mass : array, shape (grains,)

    Raises
    ------
    SceneError, LawError, CompileError
    """
    d = mesh.dimension
    shape = "disc" if d == 2 else "sphere"
    if scene.law is None:
        # what resists is replaced below: the engine asks for something that does
        more: dict[str, Any] = {"drag": 1.0, "parameters": {"eta": scene.viscosity}}
    else:
        more = {"inertia": Inertia(float(scene.grain_density or 0.0), shape), **_of_films(scene, grains, d)}
    facts = check(particles_of(scene, mesh, grains, rtol=RTOL, **more))
    own = [one for one in facts.mechanisms if not isinstance(one, (Drag, Masses))]
    at = next((k for k, one in enumerate(own) if isinstance(one, Potentials)), None)
    if at is not None:
        own[at] = replace(own[at], local=np.zeros(len(mass)))  # type: ignore[type-var]
    # in two dimensions all is per depth
    masses = MassesInFluid(mass, GYRATION[shape] * mass * grains.radii**2)
    drag = InFluid(np.zeros(len(mass)), np.zeros((len(mass), d)), np.zeros((len(mass), d)))
    return ready(replace(facts, mechanisms=(*own, drag, masses), times=NO_TIMES))


def _of_films(scene: SuspensionScene, grains: GrainArrays, d: int) -> dict[str, Any]:
    """What films and remote forces need: their range, the viscosity, and that the closure has each grain's own drag.

    Raises
    ------
    SceneError
    """
    traits = traits_of(scene.law)
    if traits.kind == "dry" and not traits.remote:
        refuse_range(scene)
        return {}
    more: dict[str, Any] = {"range": scene.range or float(grains.radii.min())}
    if traits.kind == "dry":
        return more
    named = parameters_of_law(scene)
    if "eta" not in named:
        return more
    # discs stand for spheres, one in each 4/3 of their radius of depth; forces are those per depth
    eta = scene.viscosity if d == 3 else scene.viscosity / (4 / 3 * float(grains.radii.mean()))
    if "eta" in scene.parameters and abs(float(scene.parameters["eta"]) / eta - 1) > SAME:
        raise SceneError(
            f"[parameters] eta = {scene.parameters['eta']:g}: of films in this fluid it is {eta:.6g}, its viscosity"
            f"{', per depth of a sphere' if d == 2 else ''}: leave it out"
        )
    given = {name: scene.parameters[name] for name in named if name in scene.parameters}
    return {**more, "drag": 1.0, "parameters": {**given, "eta": eta}}


def grains_at_start(system: System, grains: GrainArrays) -> SoftGrains:
    """State of the grains before the first step, none of which turns."""
    state = start(system, Newton())
    state.kept["velocity"][:, : system.dimension] = grains.v
    state.v[:, : system.dimension] = grains.v
    return SoftGrains(state, {name: values.copy() for name, values in state.marks.items()})


def set_shear_rates(system: System, rates: Array) -> None:
    """Tell potentials the shear rate of the fluid at each grain, shape (grains,)."""
    for one in _potentials(system):
        assert one.local is not None
        one.local[:] = rates


def asks_shear_rates(system: System) -> bool:
    """Whether an activation may depend on the shear rate at the grains."""
    return any(one.timed for one in _potentials(system))


def _potentials(system: System) -> list[Potentials]:
    return [one for one in system.mechanisms if isinstance(one, Potentials)]


def passed(system: System, before: SoftGrains, t: float, friction: Array, fluid_v: Array, push: Array) -> Passage:
    """Carry grains on to a time; see :func:`softdyn.suspension.grain_contacts.passed`.

    Parameters
    ----------
    system : System
    before : SoftGrains
        Is left as it is.
    t : float
    friction : array, shape (grains,)
        Drag over the velocity of the fluid less theirs.
    fluid_v, push : arrays, shape (grains, d)
        Velocity of the fluid, and forces that last.

    Raises
    ------
    IntegrationError
    """
    (drag,) = (one for one in system.mechanisms if isinstance(one, InFluid))
    (masses,) = (one for one in system.mechanisms if isinstance(one, Masses))
    d, dt = system.dimension, t - before.state.t
    drag.friction[:], drag.velocity[:], drag.push[:] = friction, fluid_v, push
    state = _with_marks(system, before)
    state.kept["impulse"][:] = 0.0
    state.power = None
    here = replace(system, scene=replace(system.scene, until_t=t))
    integrate(here, Newton(), state)
    # the next attempt, and the next step, begin as this one
    state.dt = state.history[0][1] if len(state.history) > 1 else dt
    v, impulse = state.kept["velocity"][:, :d], state.kept["impulse"]
    gained = masses.mass @ (v - before.state.kept["velocity"][:, :d])
    state.history.clear()
    grains = SoftGrains(state, {name: values.copy() for name, values in state.marks.items()})
    walls = (gained - impulse.sum(axis=0)) / dt - push.sum(axis=0)
    return Passage(grains, state.x.copy(), v.copy(), impulse / dt, walls, _touched(system, state))


def _with_marks(system: System, grains: SoftGrains) -> State:
    """A state to go on from, with what mechanisms have noted as it was then."""
    state = replace(grains.state, marks={})
    state = deepcopy(state)
    state.marks = {name: values for one in system.having["marks"] for name, values in one.marks().items()}
    for name, values in state.marks.items():
        values[:] = grains.noted[name]
    return state


def _touched(system: System, state: State) -> NDArray[np.bool_]:
    """Which grains touch another one, or a wall; those of potentials alone have no surfaces that do."""
    found = np.zeros(len(state.x) + len(system.walls), dtype=bool)
    if system.scene.law is not None:
        near = _overlap(system, state) > 0
        found[state.contacts.i[near]] = True
        found[state.contacts.j[near]] = True
    return found[: len(state.x)]


def _overlap(system: System, state: State) -> Array:
    _, r = directions(state.contacts, state.x, lattice(system.box, state.t), system.walls)
    return state.contacts.S - r


def moved_on(grains: SoftGrains, v: Array) -> None:
    """Give grains other velocities, shape (grains, d), by their numbers."""
    grains.state.kept["velocity"][:, : v.shape[1]] = v


def counted(system: System, before: SoftGrains, after: SoftGrains) -> tuple[int, int]:
    """Contacts at the end of a step, and the steps into which they have divided it.

    Parameters
    ----------
    system : System
    before, after : SoftGrains
    """
    touching = 0 if system.scene.law is None else int(np.sum(_overlap(system, after.state) > 0))
    return touching, after.state.counts["steps"] - before.state.counts["steps"]


def told_of_contacts(system: System, grains: SoftGrains, volume: float, d: int) -> tuple[Array, Array]:
    """Stress of all forces between grains in the volume of the fluid, shape (d, d), and forces on the walls.

    Parameters
    ----------
    system : System
    grains : SoftGrains
    volume : float
        Of the fluid.
    d : int
        Dimensions.
    """
    state = _with_marks(system, grains)
    contacts, count = state.contacts, len(state.x)
    n, r = directions(contacts, state.x, lattice(system.box, state.t), system.walls)
    rate = None if system.kernel.contact == "film" else opening_rates(system, contacts, state.t, state.v, n)
    F = contact_state(system, contacts, contacts.S - r, contacts.h, rate)["F"]
    for mechanism in system.having["central"]:
        more = mechanism.central(system, contacts, state.t, r)
        F = F if more is None else F + more[0]
    force = F[:, None] * n + (contacts.T if contacts.T.size else 0.0)
    walls, on = np.zeros((len(system.walls), d)), contacts.j >= count
    np.add.at(walls, contacts.j[on] - count, force[on])
    return -np.einsum("ca,cb->ab", force, r[:, None] * n) / volume, walls


def columns(system: System, grains: SoftGrains | None, frames: Sequence[SuspensionFrame]) -> dict[str, NDArray[Any]]:
    """What bonds and potentials tell of the frames of a run, by the names that they have in results.

    Parameters
    ----------
    system : System
    grains : SoftGrains, optional
        At the end of the run.
    frames : sequence of SuspensionFrame
    """
    if grains is not None:
        _with_marks(system, grains)
    cell = lattice(system.box, 0.0)
    seen: Any = [SimpleNamespace(t=frame.t, x=frame.x, cell=cell) for frame in frames]
    told_by = (mechanism.columns(system, seen) for mechanism in system.having["columns"])
    return {name: array for each in told_by for name, array in each.items()}


def told(grains: SoftGrains) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Numbers and arrays of a state: all that the steps to come depend on."""
    return checkpoint.told(replace(grains.state, marks=grains.noted), Newton())


def told_again(system: System, about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> SoftGrains:
    """State of numbers and arrays as :func:`told` gives them.

    Parameters
    ----------
    system : System
    about : mapping
    arrays : mapping from str to array
    """
    state, _ = checkpoint.told_again(about, arrays, system)
    return SoftGrains(state, {name: values.copy() for name, values in state.marks.items()})
