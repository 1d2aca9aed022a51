"""Gravity: the weight of each particle less its buoyancy, (density - fluid_density) volume times the acceleration.

In two dimensions, too, particles are spheres, unless their inertia says that they are discs. The fluid is at rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.densities import DENSITY, densities, volumes
from softdyn.particles.driven import Driven
from softdyn.particles.energy import power_of
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import components, is_list, is_number, which
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import COORDINATES, NOT_NEGATIVE

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import System, ValidatedScene

Array = NDArray[np.float64]


@with_keys
@dataclass(frozen=True)
class Gravity:
    """The weight of the particles, less their buoyancy."""

    acceleration: Annotated[
        Sequence[float],
        Key("[gravity] acceleration", COORDINATES, "Acceleration, one number for each axis.", "length/time^2"),
    ]
    density: Annotated[
        float | Mapping[str, float] | None,
        Key(
            "[gravity] density",
            DENSITY,
            "Density of the particles; with inertia it is that of [inertia], and may be left out.",
            "force time^2/length^4",
        ),
    ] = None
    fluid_density: Annotated[
        float,
        Key(
            "[gravity] fluid_density",
            NOT_NEGATIVE,
            "Density of the fluid, whose buoyancy is taken off; 0 without.",
            "force time^2/length^4",
        ),
    ] = 0.0


@dataclass(frozen=True)
class Weights(Mechanism):
    """Weights less buoyancies, shape (N, d + rotations), the same at all times."""

    load: Driven

    gives = ("gravity",)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What gravity gives: minus the rate of the potential energy."""
        return {"gravity": power_of(system, self.load, at, rates)}


def check(facts: ValidatedScene, faults: list[str]) -> Weights | None:
    """Gravity of a scene."""
    given, (count, d) = facts.scene.gravity, facts.x.shape
    assert given is not None
    before = len(faults)
    if not is_list(given.acceleration, d) or not all(is_number(part) for part in given.acceleration):
        faults.append(f"[gravity] acceleration needs {components(d)}, finite numbers, not {given.acceleration!r}")
    inertia = facts.scene.inertia
    said = given.density if inertia is None or given.density is not None else inertia.density
    if inertia is not None and said != inertia.density:
        faults.append(
            f"[gravity] density = {said!r} and [inertia] density = {inertia.density!r} are of the same particles: "
            "leave the first out"
        )
    density = densities(facts, said, "[gravity] density", faults)
    if len(faults) > before:
        return None
    weight = np.zeros((count, facts.width))
    with np.errstate(over="ignore", invalid="ignore"):
        mass = (density - float(given.fluid_density)) * volumes(facts)
        weight[:, :d] = mass[:, None] * np.array(given.acceleration, dtype=float)
    beyond = np.asarray(~np.isfinite(weight).all(axis=1))
    if beyond.any():
        faults.append(f"[gravity] the weight of {which(beyond)} is beyond the largest number: choose other units")
    # with a drag they settle; where space has an end along it they are thrown
    free = inertia is not None and not (facts.scene.drag or facts.scene.wall or facts.scene.hold)
    if free and (weight[:, :d] * facts.box.periodic).any():
        faults.append(
            "[gravity] in a box that is periodic along it, without a wall or anything held, there is nothing to stand "
            "on: give [[wall]], [[hold]] or [flow] drag"
        )
    return Weights(Driven([], facts.coordinates_scale(-1), weight))
