"""Gravity: the weight of each sphere less its buoyancy, (density - fluid_density) 4/3 pi R^3 times the acceleration.

In two dimensions, too, particles are spheres. The fluid is at rest under gravity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.driven import Driven
from softdyn.particles.energy import power_of
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import components, is_list, is_number, which
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import COORDINATES, NOT_NEGATIVE, Kind

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.force_balance import Balance
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import System, ValidatedScene

Array = NDArray[np.float64]


DENSITY = Kind(
    "a number, or one for each species",
    {
        "anyOf": [
            {"type": "number", "minimum": 0},
            {"type": "object", "additionalProperties": {"type": "number", "minimum": 0}},
        ]
    },
)


@with_keys
@dataclass(frozen=True)
class Gravity:
    """The weight of the particles, less their buoyancy."""

    acceleration: Annotated[
        Sequence[float],
        Key("[gravity] acceleration", COORDINATES, "Acceleration, one number for each axis.", "length/time^2"),
    ]
    density: Annotated[
        float | Mapping[str, float],
        Key("[gravity] density", DENSITY, "Density of the particles.", "force time^2/length^4"),
    ]
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
    density = _densities(facts, given.density, faults)
    if len(faults) > before:
        return None
    weight = np.zeros((count, facts.width))
    with np.errstate(over="ignore", invalid="ignore"):
        mass = (density - float(given.fluid_density)) * (4 / 3 * math.pi * facts.radii**3)
        weight[:, :d] = mass[:, None] * np.array(given.acceleration, dtype=float)
    beyond = np.asarray(~np.isfinite(weight).all(axis=1))
    if beyond.any():
        faults.append(f"[gravity] the weight of {which(beyond)} is beyond the largest number: choose other units")
    return Weights(Driven([], facts.coordinates_scale(-1), weight))


def _densities(facts: ValidatedScene, given: Any, faults: list[str]) -> Array:
    """Density of each particle: one for all, or one for each species."""
    values = given if isinstance(given, Mapping) else dict.fromkeys(facts.names, given)
    unknown = [name for name in values if name not in facts.names]
    missing = [name for name in facts.names if name not in values]
    if unknown:
        faults.append(f"[gravity] density: there is no species {', '.join(map(repr, unknown))}")
    if missing:
        faults.append(f"[gravity] density has no value for species {', '.join(map(repr, missing))}")
    wrong = [value for value in values.values() if not (is_number(value) and value >= 0)]
    if wrong:
        faults.append(f"[gravity] density must be 0 or a positive number, not {wrong[0]!r}")
    if missing or wrong:
        return np.zeros(len(facts.x))
    return np.array([float(values[name]) for name in facts.names])[facts.species]
