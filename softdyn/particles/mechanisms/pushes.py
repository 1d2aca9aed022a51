"""Pushes: external forces and torques on particles, as functions of time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.driven import Driven, Term, numbers_of, terms_of, turn_labels
from softdyn.particles.energy import power_of
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
class Pushes(Mechanism):
    """Forces, and torques over radii, shape (N, d + rotations)."""

    load: Driven

    gives = ("external",)

    def driven(self) -> Iterator[tuple[TimeFunction, Callable[[Sensitivity, float], float]]]:
        """Of a force, an impulse on each of its particles is missed."""
        for those, column, function in self.load.changing():
            yield function, partial(_impulse, those, np.abs(self.load.scale[those, column]))

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What they give."""
        return {"external": power_of(system, self.load, at, rates)}


def _impulse(those: NDArray[np.int64], size: Array, to: Sensitivity, dt: float) -> float:
    return float((to.force[those] * size).max())


def check(facts: ValidatedScene, faults: list[str]) -> Pushes:
    """Pushes of a scene.

    Raises
    ------
    SceneError
        Naming the entry at fault.
    """
    scene, (count, d) = facts.scene, facts.x.shape
    terms: list[Term] = []
    for number, push in enumerate(scene.push):
        where = f"[[push]] {number}"
        particles = numbers_of(scene, push.particles, count, where)
        if push.force is None and push.torque is None:
            raise SceneError(f"{where}: force or torque is missing")
        if push.force is not None:
            if not is_list(push.force, d):
                raise SceneError(f"{where}: force needs {components(d)}, one for each axis")
            labels = [f"{where}: force along {axis}" for axis in AXES[:d]]
            terms += terms_of(scene, particles, range(d), push.force, labels)
        if push.torque is not None:
            labels = turn_labels(scene, "torque", push.torque, where, d)
            terms += terms_of(scene, particles, range(d, d + len(labels)), push.torque, labels)
    return Pushes(Driven(terms, facts.coordinates_scale(-1)))
