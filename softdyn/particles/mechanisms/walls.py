"""Walls: flat, rigid or as soft as the particles, at rest or driven. What touches one is a contact like others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.driven import Driven, terms_of
from softdyn.particles.energy import forces_at
from softdyn.particles.geometry import Wall
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import AXES, components, is_list

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.resolve import Sensitivity
    from softdyn.particles.system import System, ValidatedScene
    from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Walls(Mechanism):
    """Walls as they are at the start, and their velocities, shape (walls, d), if any of them moves."""

    walls: tuple[Wall, ...]
    wall_velocity: Driven | None

    gives = ("external",)

    def driven(self) -> Iterator[tuple[TimeFunction, Callable[[Sensitivity, float], float]]]:
        """Of a velocity, a displacement is missed."""
        for _, _, function in () if self.wall_velocity is None else self.wall_velocity.changing():
            yield function, lambda to, dt: to.of_length(dt)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What moves the walls exerts the forces of their contacts."""
        if self.wall_velocity is None:
            return {}
        count = len(system.radii)
        on = np.flatnonzero(contacts.j >= count)
        velocities = self.wall_velocity(rates.t)[contacts.j[on] - count]
        return {"external": -float(np.sum(np.sum(forces_at(at, on) * velocities, axis=1)))}


def check(facts: ValidatedScene, faults: list[str]) -> Walls:
    """Walls of a scene; those that are faulty are left out."""
    scene, d = facts.scene, facts.x.shape[1]
    walls = []
    for number, wall in enumerate(scene.wall):
        point, normal = _coordinates(wall.point, d), _coordinates(wall.normal, d)
        size = 0.0 if normal is None else float(np.linalg.norm(normal))
        if point is None or normal is None or not 0 < size < math.inf:
            faults.append(f"wall {number} needs a point and a normal of {d} finite coordinates each, the normal not 0")
            continue
        if not isinstance(wall.rigid, (bool, np.bool_)):
            faults.append(f"wall {number}: rigid must be true or false, not {wall.rigid!r}")
            continue
        if wall.velocity is not None and not is_list(wall.velocity, d):
            faults.append(f"wall {number}: velocity needs {components(d)}, one for each axis")
            continue
        numbers = _coordinates(wall.velocity, d) if wall.velocity is not None else None
        if numbers is not None and numbers.any() and not numbers @ normal and not scene.turns:
            faults.append(
                f"wall {number} moves along itself, which nothing feels where contacts are normal only: give "
                "[contacts] tangential = true, [friction], or a velocity along its normal"
            )
        walls.append(Wall(point, normal / size, bool(wall.rigid), wall.velocity))
    for number, wall in enumerate(walls):
        across = [AXES[axis] for axis in range(d) if facts.box.periodic[axis] and wall.normal[axis]]
        if across:
            faults.append(f"wall {number} stands across {', '.join(across)}, along which the box is periodic")
    terms = []
    for number, wall in enumerate(scene.wall):
        if wall.velocity is not None and is_list(wall.velocity, d):
            labels = [f"wall {number}: velocity along {axis}" for axis in AXES[:d]]
            terms += terms_of(scene, np.array([number]), range(d), wall.velocity, labels)
    return Walls(tuple(walls), Driven(terms, np.ones((len(scene.wall), d))) if terms else None)


def _coordinates(values: Any, d: int) -> Array | None:
    """A point's finite coordinates; None for anything else."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        return None
    return array if array.shape == (d,) and np.isfinite(array).all() else None
