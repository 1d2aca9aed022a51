"""Drag: what the fluid resists of each particle by itself, 6 pi eta R and 8 pi eta R^3 times ``[flow] drag``."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.mechanisms import Action, Mechanism
from softdyn.particles.parameters import mixed_parameters
from softdyn.particles.system import System, background

if TYPE_CHECKING:
    from softdyn.particles.contact_kernels import ContactKernel
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance, StageInput
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drag(Mechanism):
    """Resistance in proportion to the velocity relative to the background flow.

    Attributes
    ----------
    number : float
        Of single drags.
    coefficients : array, shape (N, d + rotations)
        Force over velocity; torque over radius, over radius times angular velocity.
    """

    number: float
    coefficients: Array = field(default_factory=lambda: np.empty((0, 0)))

    gives = ("flow",)
    takes = ("drag",)

    def ready(self, facts: ValidatedScene, kernel: ContactKernel, p: Array) -> Drag:
        """With the coefficients that the kernel gives."""
        count, d = facts.x.shape
        coefficients = np.zeros((count, facts.width))
        if kernel.drag is not None:
            own = np.arange(count)
            out = np.empty((2 if kernel.tangential else 1, count))
            kernel.drag(count, p, mixed_parameters(facts, kernel, own, own).reshape(-1), out.reshape(-1))
            coefficients[:, :d] = self.number * out[0][:, None]
            coefficients[:, d:] = self.number * (out[-1] / facts.radii**2)[:, None]
        return replace(self, coefficients=coefficients)

    def resistance(self, shape: tuple[int, int]) -> Array:
        """See :class:`Mechanism`."""
        return self.coefficients

    def act(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Action | None:
        """See :class:`Mechanism`."""
        if given.s <= 0:
            return None
        resisting = self.coefficients * ((at.x - given.x_star) / given.s - background(system, at.x))
        return Action(resisting, float(np.abs(resisting).max()), float(np.abs(self.coefficients).max()) / given.s)

    def tangent(self, system: System, contacts: Contacts, given: StageInput, at: Balance) -> Array | None:
        """See :class:`Mechanism`."""
        return self.coefficients / given.s if given.s > 0 else None

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What the flow gives, and what resistance takes."""
        v, u = rates.v, background(system, at.x)
        # as the forces have it: in very short steps velocities, differences of positions, are little but rounding
        left = np.where(system.fixed | (self.coefficients == 0), 0.0, at.reaction)
        resisting = self.coefficients * (v - u) - left
        return {"flow": -float(np.sum(resisting * u)), "drag": float(np.sum(resisting * (v - u)))}


def check(facts: ValidatedScene, faults: list[str]) -> Drag:
    """Drag of a scene."""
    return Drag(float(facts.scene.drag))
