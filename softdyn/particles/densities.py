"""Densities and volumes of the particles, which their weight and their inertia share."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.names import is_number
from softdyn.scene.kinds import Kind

if TYPE_CHECKING:
    from softdyn.particles.system import ValidatedScene

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


def volumes(facts: ValidatedScene) -> Array:
    """Volume of each particle, shape (N,)."""
    inertia = facts.scene.inertia
    if inertia is not None and inertia.shape == "disc" and facts.box.depth is not None:
        return np.asarray(math.pi * facts.radii**2 * facts.box.depth)
    return np.asarray(4 / 3 * math.pi * facts.radii**3)


def densities(facts: ValidatedScene, given: Any, name: str, faults: list[str]) -> Array:
    """Density of each particle, shape (N,): one for all, or one for each species; ``name`` is that of the key.

    Parameters
    ----------
    facts : ValidatedScene
    given : number, or mapping from species to number
        Mass over volume.
    name : str
        Of the key, for faults.
    faults : list of str
        To which is added what is wrong.
    """
    values = given if isinstance(given, Mapping) else dict.fromkeys(facts.names, given)
    unknown = [name for name in values if name not in facts.names]
    missing = [name for name in facts.names if name not in values]
    if unknown:
        faults.append(f"{name}: there is no species {', '.join(map(repr, unknown))}")
    if missing:
        faults.append(f"{name} has no value for species {', '.join(map(repr, missing))}")
    wrong = [value for value in values.values() if not (is_number(value) and value >= 0)]
    if wrong:
        faults.append(f"{name} must be 0 or a positive number, not {wrong[0]!r}")
    if missing or wrong:
        return np.zeros(len(facts.x))
    return np.array([float(values[name]) for name in facts.names])[facts.species]
