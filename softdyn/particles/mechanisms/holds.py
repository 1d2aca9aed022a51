"""Holds: coordinates that are given, positions along some axes and rotations, at rest or driven."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from softdyn.errors import SceneError
from softdyn.particles.driven import Driven, Term, numbers_of, terms_of, turn_labels
from softdyn.particles.mechanisms import Flags, Mechanism
from softdyn.particles.names import AXES, is_list, particles_named

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.particle_keys import Hold
    from softdyn.particles.resolve import Sensitivity
    from softdyn.particles.system import System, ValidatedScene
    from softdyn.particles.time_functions import TimeFunction


@dataclass(frozen=True)
class Holds(Mechanism):
    """Coordinates that are given, and their velocities, shape (N, d + rotations) each."""

    held: tuple[Flags, Driven]

    gives = ("external",)

    def driven(self) -> Iterator[tuple[TimeFunction, Callable[[Sensitivity, float], float]]]:
        """Of a velocity, a displacement is missed."""
        velocity = self.held[1]
        for those, column, function in velocity.changing():
            yield function, partial(_length, float(np.abs(velocity.scale[those, column]).max()))

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What gives the velocities exerts the forces that are left."""
        return {"external": float(np.sum(np.where(self.held[0], at.reaction, 0.0) * rates.v))}


def _length(size: float, to: Sensitivity, dt: float) -> float:
    return to.of_length(dt) * size


def check(facts: ValidatedScene, faults: list[str]) -> Holds:
    """Holds of a scene.

    Raises
    ------
    SceneError
        Naming the entry at fault.
    """
    scene, (count, d) = facts.scene, facts.x.shape
    fixed = np.zeros((count, facts.width), dtype=bool)
    terms: list[Term] = []
    for number, hold in enumerate(scene.hold):
        where = f"[[hold]] {number}"
        particles = numbers_of(scene, hold.particles, count, where)
        terms += _moved(facts, hold, where, particles, fixed)
        if hold.spin is not None:
            labels = turn_labels(scene, "spin", hold.spin, where, d)
            twice = particles[fixed[particles, d]]
            if len(twice):
                raise SceneError(f"{where}: {particles_named(twice)} given two spins")
            fixed[particles, d:] = True
            terms += terms_of(scene, particles, range(d, d + len(labels)), hold.spin, labels)
    return Holds((fixed, Driven(terms, facts.coordinates_scale(1))))


def _moved(
    facts: ValidatedScene, hold: Hold, where: str, particles: np.ndarray[tuple[int], np.dtype[np.int64]], fixed: Flags
) -> list[Term]:
    """Velocities of the positions that an entry gives, which are noted as given."""
    d = facts.x.shape[1]
    given = hold.axes if isinstance(hold.axes, str) else ""
    if not given or any(axis not in AXES[:d] for axis in given) or len(set(given)) < len(given):
        raise SceneError(f"{where}: axes must be some of {AXES[:d]!r}, not {hold.axes!r}")
    velocity = hold.velocity if hold.velocity is not None else [0.0] * len(hold.axes)
    if not is_list(velocity, len(hold.axes)):
        raise SceneError(f"{where}: velocity needs one component for each of the axes {hold.axes!r}")
    columns = [AXES.index(name) for name in hold.axes]
    for column in columns:
        twice = particles[fixed[particles, column]]
        if len(twice):
            raise SceneError(f"{where}: {particles_named(twice)} held twice along {AXES[column]}")
        fixed[particles, column] = True
    labels = [f"{where}: velocity along {name}" for name in hold.axes]
    return terms_of(facts.scene, particles, columns, velocity, labels)
