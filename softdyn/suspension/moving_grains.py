"""Grains that do something to one another, by whichever engine: explicit steps of dry contacts, or implicit ones.

Bonds, potentials, films, and what else explicit steps do not know, are for implicit ones. A scene loads what it needs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.explicit import grain_checkpoint
from softdyn.particles.explicit.grains import Grains, GrainSystem
from softdyn.suspension import grain_contacts
from softdyn.traits import traits_of

if TYPE_CHECKING:
    from softdyn.fluid.mesh import Mesh
    from softdyn.particles.system import System
    from softdyn.suspension.grain_contacts import Passage
    from softdyn.suspension.soft_grains import SoftGrains
    from softdyn.suspension.suspension_result import SuspensionFrame
    from softdyn.suspension.suspension_scene import GrainArrays, SuspensionScene

    Engine = GrainSystem | System
    Moving = Grains | SoftGrains

Array = NDArray[np.float64]


def is_soft(scene: SuspensionScene) -> bool:
    """Whether it takes the implicit engine."""
    if len(scene.bond) or len(scene.potential):
        return True
    if scene.law is None:
        return False
    traits = traits_of(scene.law)
    return traits.kind != "dry" or traits.remote or (traits.rubs and scene.friction is not None)


def engine_of(scene: SuspensionScene, mesh: Mesh, grains: GrainArrays, mass: Array) -> Engine | None:
    """Put together what moves the grains within a step; None of those that do nothing to one another.

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
    if not len(mass):
        if len(scene.bond):
            raise SceneError("[[bond]] pairs: there are no grains, and so no pairs of them: leave it out")
        return None
    if is_soft(scene):
        from softdyn.suspension.soft_grains import soft_system

        return soft_system(scene, mesh, grains, mass)
    return grain_contacts.grain_system(scene, mesh, grains, mass)


def _of(one: Engine | Moving) -> Any:
    """The module of an engine, or of a state of one."""
    if isinstance(one, (GrainSystem, Grains)):
        return grain_contacts
    from softdyn.suspension import soft_grains

    return soft_grains


def moving_at_start(system: Engine | None, grains: GrainArrays) -> Moving | None:
    """State of the grains before the first step."""
    return None if system is None else _of(system).grains_at_start(system, grains)


def asks_shear_rates(system: Engine | None) -> bool:
    """Whether forces between grains depend on the shear rate of the fluid there."""
    return system is not None and not isinstance(system, GrainSystem) and bool(_of(system).asks_shear_rates(system))


def set_shear_rates(system: Engine, rates: Array) -> None:
    """Tell an engine that asks for it the shear rate of the fluid at each grain, shape (grains,)."""
    _of(system).set_shear_rates(system, rates)


def passed(system: Engine, before: Moving, t: float, friction: Array, fluid_v: Array, push: Array) -> Passage:
    """Carry grains on to a time.

    Parameters
    ----------
    system : GrainSystem or System
    before : Grains or SoftGrains
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
    found: Passage = _of(system).passed(system, before, t, friction, fluid_v, push)
    return found


def moved_on(grains: Moving, v: Array) -> None:
    """Give grains other velocities, shape (grains, d), by their numbers."""
    _of(grains).moved_on(grains, v)


def counted(system: Engine, before: Moving, after: Moving) -> tuple[int, int]:
    """Contacts at the end of a step, and the steps into which they have divided it.

    Parameters
    ----------
    system : GrainSystem or System
    before, after : Grains or SoftGrains
    """
    found: tuple[int, int] = _of(system).counted(system, before, after)
    return found


def told_of_contacts(
    system: Engine | None, grains: Moving | None, volume: float, d: int, walls: int
) -> tuple[Array, Array]:
    """Stress of what grains do to one another, shape (d, d), and forces on the walls, shape (walls, d).

    Parameters
    ----------
    system : GrainSystem or System, optional
    grains : Grains or SoftGrains, optional
    volume : float
        Of the fluid.
    d : int
        Dimensions.
    walls : int
        How many there are.
    """
    if system is None or grains is None:
        return np.zeros((d, d)), np.zeros((walls, d))
    stress, forces = _of(system).told_of_contacts(system, grains, volume, d)
    return stress, forces


def columns_of_bonds(
    system: Engine | None, grains: Moving | None, frames: Sequence[SuspensionFrame]
) -> dict[str, NDArray[Any]]:
    """What bonds and potentials tell of the frames of a run, by the names that they have in results.

    Parameters
    ----------
    system : GrainSystem or System, optional
    grains : Grains or SoftGrains, optional
        At the end of the run, if that is known.
    frames : sequence of SuspensionFrame
    """
    if system is None or isinstance(system, GrainSystem):
        return {}
    found: dict[str, NDArray[Any]] = _of(system).columns(system, grains, frames)
    return found


def told(grains: Moving) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Numbers and arrays of a state: all that the steps to come depend on."""
    if isinstance(grains, Grains):
        return grain_checkpoint.told(grains)
    found: tuple[dict[str, Any], dict[str, NDArray[Any]]] = _of(grains).told(grains)
    return found


def told_again(
    system: Engine, about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], before: str = ""
) -> Moving:
    """State of numbers and arrays as :func:`told` gives them, the names of the arrays with something before them.

    Parameters
    ----------
    system : GrainSystem or System
    about : mapping
    arrays : mapping from str to array
    before : str
    """
    if isinstance(system, GrainSystem):
        return grain_checkpoint.told_again(about, arrays, before)
    own = {name.removeprefix(before): array for name, array in arrays.items() if name.startswith(before)}
    found: SoftGrains = _of(system).told_again(system, about, own)
    return found
