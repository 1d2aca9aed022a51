"""Gravity: the weight of each sphere less its buoyancy, (density - fluid_density) 4/3 pi R^3 times the acceleration.

In two dimensions, too, particles are spheres. The fluid is at rest under gravity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.driven import Driven
from softdyn.particles.energy import power_of
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.words import components, is_list, is_number, which

if TYPE_CHECKING:
    from softdyn.particles.balance import Balance
    from softdyn.particles.energy import Rates
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import System, ValidatedScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gravity(Mechanism):
    """Weights less buoyancies, shape (N, d + rotations), the same at all times."""

    load: Driven

    gives = ("gravity",)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What gravity gives: minus the rate of the potential energy."""
        return {"gravity": power_of(system, self.load, at, rates)}


def check(facts: ValidatedScene, faults: list[str]) -> Gravity | None:
    """Gravity of a scene."""
    scene, (count, d) = facts.scene, facts.x.shape
    before = len(faults)
    if scene.gravity is None:
        faults.append("[gravity] acceleration is missing: a density has no meaning without it")
    elif not is_list(scene.gravity, d) or not all(is_number(part) for part in scene.gravity):
        faults.append(f"[gravity] acceleration needs {components(d)}, finite numbers, not {scene.gravity!r}")
    density = _densities(facts, scene.density, faults)
    if len(faults) > before:
        return None
    weight = np.zeros((count, facts.width))
    with np.errstate(over="ignore", invalid="ignore"):
        mass = (density - float(scene.fluid_density)) * (4 / 3 * math.pi * facts.radii**3)
        weight[:, :d] = mass[:, None] * np.array(scene.gravity, dtype=float)
    beyond = np.asarray(~np.isfinite(weight).all(axis=1))
    if beyond.any():
        faults.append(f"[gravity] the weight of {which(beyond)} is beyond the largest number: choose other units")
    return Gravity(Driven([], facts.coordinates_scale(-1), weight))


def _densities(facts: ValidatedScene, given: Any, faults: list[str]) -> Array:
    """Density of each particle: one for all, or one for each species."""
    if given is None:
        faults.append("[gravity] density is missing: a number, or one for each species")
    values = given if isinstance(given, Mapping) else dict.fromkeys(facts.names, given)
    unknown = [name for name in values if name not in facts.names]
    missing = [name for name in facts.names if name not in values]
    if unknown:
        faults.append(f"[gravity] density: there is no species {', '.join(map(repr, unknown))}")
    if missing:
        faults.append(f"[gravity] density has no value for species {', '.join(map(repr, missing))}")
    wrong = [value for value in values.values() if value is not None and not (is_number(value) and value >= 0)]
    if wrong:
        faults.append(f"[gravity] density must be 0 or a positive number, not {wrong[0]!r}")
    if given is None or missing or wrong:
        return np.zeros(len(facts.x))
    return np.array([float(values[name]) for name in facts.names])[facts.species]
