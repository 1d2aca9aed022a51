"""Imposed shear: the background flow u = shear_rate y along x, and with it a periodic box."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.driven import given_function
from softdyn.particles.energy import power_of_box
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import is_number

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.resolve import Sensitivity
    from softdyn.particles.system import System, ValidatedScene
    from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shear(Mechanism):
    """A shear rate as a function of time.

    Attributes
    ----------
    rate : TimeFunction
    d : int
        Dimension of space.
    moves_box : bool
        Whether it is more than a number, with which the lattice moves by itself.
    """

    rate: TimeFunction
    d: int
    moves_box: bool

    gives = ("box",)

    def driven(self) -> Iterator[tuple[TimeFunction, Callable[[Sensitivity, float], float]]]:
        """Of a shear rate, a strain is missed."""
        if self.moves_box:
            yield self.rate, lambda to, dt: to.of_strain(dt)

    def gradient(self, t: float, rates: Array) -> Array:
        """See :class:`Mechanism`."""
        return shearing(self.rate(t), self.d)

    def strain(self, t: float) -> float:
        """The integral of the shear rate from 0 to a time."""
        return self.rate.integral(t)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What shears the box exerts the forces of the contacts through its faces."""
        return {"box": power_of_box(system, contacts, at, shearing(system.box.shear_rate, self.d))}


def shearing(rate: float, d: int) -> Array:
    """Velocity gradient of a shear rate."""
    gradient = np.zeros((d, d))
    gradient[0, 1] = rate
    return gradient


def check(facts: ValidatedScene, faults: list[str]) -> Shear | None:
    """Shear flow of a scene.

    Raises
    ------
    SceneError
        If the rate is no function of time.
    """
    scene, box, d = facts.scene, facts.box, facts.x.shape[1]
    if d == 1:
        faults.append("a shear flow needs two dimensions at least")
    if not scene.drag and not box.periodic[: min(d, 2)].all():
        faults.append(
            "the flow moves the particles by their drag, or by the walls of a sheared periodic box, and here is "
            "neither: give drag = 1, or a box periodic along x and y"
        )
    if d > 1 and box.periodic[1] and not box.periodic[0]:
        faults.append("[box] a sheared box must be periodic along x where it is along y")
    rate = given_function(scene, scene.shear_rate, "[flow] shear_rate")
    return Shear(rate, d, not is_number(scene.shear_rate)) if d > 1 else None
