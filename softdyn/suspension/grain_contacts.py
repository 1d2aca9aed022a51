"""Grains of a suspension that touch one another and walls: explicit sub-steps within a step of the fluid.

Over a step, a grain feels its weight W, the pressure -V grad p and the drag K (v_f - v), with v_f, grad p and K as they
stand at an attempt at the step. Contacts need shorter steps than these: as many as the stability of the explicit method
asks for. The drag is renewed in stretches that are shorter than half of the time m/K in which a grain follows the
fluid: so it is exact where grains rest and where they move steadily, and contacts carry all of what they must.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid.boundary_keys import periodic_pairs
from softdyn.fluid.mesh import Mesh, periods_of
from softdyn.laws import law_of
from softdyn.particles.explicit.explicit_run import prepare
from softdyn.particles.explicit.grain_checkpoint import ARRAYS
from softdyn.particles.explicit.grains import Grains, GrainSystem, by_number
from softdyn.particles.explicit.steps import carry_to, start_of, threads_for, walls_at
from softdyn.particles.explicit.touching import touching
from softdyn.particles.geometry import Wall
from softdyn.particles.mechanisms.inertia import GYRATION, Inertia
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_scene import check
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.suspension.suspension_scene import GrainArrays, SuspensionScene

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Longest stretch with the same drag, over m/K; and how many of them there may be in a step.
DRAGGED, MOST = 0.5, 100_000
#: Error of the frequency of a contact: good enough for flows.
RTOL = 1e-2
#: How far from a plane the points of a boundary may be, over its size.
FLAT = 1e-9


@dataclass(frozen=True)
class Passage:
    """What a step with some drag and pressure makes of the grains.

    Attributes
    ----------
    grains : Grains, or SoftGrains
        At its end.
    x, v, drag : arrays, shape (grains, d)
        Places and velocities there; mean drag.
    walls : array, shape (d,)
        Mean force of the walls on all grains.
    touch : array of bool, shape (grains,)
        Which touch another one, or a wall, at its end.
    """

    grains: Any
    x: Array
    v: Array
    drag: Array
    walls: Array
    touch: Flags


def parameters_of_law(scene: SuspensionScene) -> set[str]:
    """Names of the parameters of the contact law; none without one."""
    if scene.law is None:
        return set()
    from softdyn.derive.law import parameters_of

    return {symbol.name for symbol in parameters_of(law_of(scene.law), True)} - {"R"}


def refuse_range(scene: SuspensionScene) -> None:
    """Refuse a range of contacts that have none of their own: those of a dry law without a remote force.

    Raises
    ------
    SceneError
    """
    if scene.range is not None:
        raise SceneError("[contacts] range: contacts of this law end where surfaces part: leave it out")


def walls_of(mesh: Mesh, names: tuple[str, ...]) -> list[Wall]:
    """Flat walls at parts of a mesh's boundary.

    Raises
    ------
    SceneError
        If there is no such part, or it is not flat, or the mesh reaches through its plane.
    """
    found = []
    for name in names:
        where = f"[contacts] walls: boundary {name!r}"
        if name not in mesh.boundaries:
            raise SceneError(f"{where} is none of the mesh's{suggestion(name, list(mesh.boundaries))}")
        facets = mesh.boundaries[name]
        corners = mesh.at[facets]
        if mesh.dimension == 2:
            way = corners[:, 1] - corners[:, 0]
            normals = np.column_stack([way[:, 1], -way[:, 0]])
        else:
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
        point = corners.reshape(-1, mesh.dimension)[0]
        size = float(np.ptp(mesh.at, axis=0).max())
        if np.abs((corners - point) @ normal).max() > FLAT * size or ((mesh.at - point) @ normal).max() > FLAT * size:
            raise SceneError(f"{where} is not flat, or the mesh goes on behind its plane: grains touch flat walls only")
        found.append(Wall(point, normal))
    return found


def grain_system(scene: SuspensionScene, mesh: Mesh, grains: GrainArrays, mass: Array) -> GrainSystem | None:
    """Put together what the contacts of the grains need; None of a scene without a contact law.

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
    if scene.law is None or not len(mass):
        return None
    refuse_range(scene)
    d = mesh.dimension
    inertia = Inertia(float(scene.grain_density or 0.0), "disc" if d == 2 else "sphere")
    system = prepare(check(particles_of(scene, mesh, grains, inertia=inertia, velocities=grains.v, rtol=RTOL)))
    # in two dimensions all is per depth
    moment = GYRATION["disc" if d == 2 else "sphere"] * mass * grains.radii**2
    return replace(system, mass=mass, moment=moment, load=np.zeros((len(mass), d)))


def particles_of(scene: SuspensionScene, mesh: Mesh, grains: GrainArrays, **more: Any) -> ParticleScene:
    """The grains of a scene as a scene of their own, with the walls and the periods of the mesh.

    Parameters
    ----------
    scene : SuspensionScene
    mesh : Mesh
    grains : GrainArrays
    more
        Further fields.

    Raises
    ------
    SceneError
    """
    box: list[float | None] = [None] * mesh.dimension
    for axis, length in periods_of(mesh, periodic_pairs(scene.boundary)).items():
        box[axis] = length
    given = {name: scene.parameters[name] for name in parameters_of_law(scene) if name in scene.parameters}
    fields: dict[str, Any] = {
        "law": scene.law,
        "parameters": given,
        "positions": grains.x,
        "radii": grains.radii,
        "friction": scene.friction,
        "gap": scene.gap,
        "species": scene.species,
        "potential": scene.potential,
        "bond": grains.bonds,
        "box": box if any(box) else None,
        "wall": walls_of(mesh, tuple(scene.walls)),
        "until_t": scene.until_t,
        "target": scene.target,
    }
    return ParticleScene(**{**fields, **more})


def grains_at_start(system: GrainSystem, grains: GrainArrays) -> Grains:
    """State of the grains before the first step, none of which turns."""
    return start_of(system, grains.v, np.zeros((len(grains.v), system.kernel.rotations)))


def passed(system: GrainSystem, before: Grains, t: float, friction: Array, fluid_v: Array, push: Array) -> Passage:
    """Carry grains on to a time.

    Parameters
    ----------
    system : GrainSystem
    before : Grains
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
    copies = {name: getattr(before, name).copy() for name in ARRAYS}
    grains = replace(before, **copies, counts=dict(before.counts), history_rows=[])
    dt, fastest = t - before.t, friction / system.mass
    parts = max(1, math.ceil(dt * float(fastest.max()) / DRAGGED))
    if parts > MOST:
        k = int(np.argmax(fastest))
        raise IntegrationError(
            f"grain {k} follows the fluid within {1 / fastest[k]:.2g}, and the step from t={before.t:.6g} lasts "
            f"{dt:.2g}: its drag would have to be renewed {parts} times; give a shorter [steps] dt, or denser grains"
        )
    times = [*(before.t + dt * np.arange(1, parts) / parts), t]
    drag, given = np.zeros_like(fluid_v), np.zeros(fluid_v.shape[1])
    momentum = system.mass @ by_number(grains, grains.v)
    with ThreadPoolExecutor(max(1, threads_for(system) - 1)) as pool:
        for goal in times:
            now = friction[:, None] * (fluid_v - by_number(grains, grains.v))
            _load(system, grains, now + push)
            last = grains.t
            carry_to(system, grains, float(goal), pool)
            drag += (grains.t - last) / dt * now
            given += (grains.t - last) * (now + push).sum(axis=0)
        # the next attempt starts from accelerations without any of it
        _load(system, grains, np.zeros_like(push))
    x, v = by_number(grains, grains.x), by_number(grains, grains.v)
    return Passage(grains, x, v, drag, (system.mass @ v - momentum - given) / dt, _touched(system, grains))


def _load(system: GrainSystem, grains: Grains, load: Array) -> None:
    """Give the grains other forces that last, and accelerations that fit these."""
    d = load.shape[1]
    change = (load - system.load) / system.mass[:, None]
    grains.rate_v[:, :d] += change[grains.order]
    system.load[:] = load


def moved_on(grains: Grains, v: Array) -> None:
    """Give grains other velocities, shape (grains, d), by their numbers."""
    grains.v = np.ascontiguousarray(v[grains.order])
    grains.fastest = float(np.sqrt(np.max(np.sum(v**2, axis=1))))


def _touched(system: GrainSystem, grains: Grains) -> Flags:
    """Which grains touch something, by their numbers."""
    count = len(grains.x)
    found = np.zeros(count, dtype=bool)
    at = np.flatnonzero(grains.touch)
    found[np.searchsorted(grains.start, at, side="right") - 1] = True
    found[grains.partner[at]] = True
    found |= grains.wall_touch.reshape(count, system.walled).any(axis=1)
    return by_number(grains, found) > 0


def counted(system: GrainSystem, before: Grains, after: Grains) -> tuple[int, int]:
    """Contacts at the end of a step, and the steps into which they have divided it.

    Parameters
    ----------
    system : GrainSystem
    before, after : Grains
    """
    touching = int(after.touch.sum() + after.wall_touch.sum())
    return touching, after.counts["steps"] - before.counts["steps"]


def told_of_contacts(system: GrainSystem, grains: Grains, volume: float, d: int) -> tuple[Array, Array]:
    """Stress of the contacts in the volume of the fluid, shape (d, d), and forces on the walls, shape (walls, d).

    Parameters
    ----------
    system : GrainSystem
    grains : Grains
    volume : float
        Of the fluid.
    d : int
        Dimensions.
    """
    contacts = touching(system, grains, *walls_at(system, grains.t))
    tangential = contacts.tangential()
    force = contacts.N[:, None] * contacts.n + (tangential if tangential.shape[1] else 0.0)
    walls, on = np.zeros((system.walled, d)), contacts.j >= len(grains.x)
    np.add.at(walls, contacts.j[on] - len(grains.x), force[on])
    return -np.einsum("ca,cb->ab", force, contacts.r[:, None] * contacts.n) / volume, walls
