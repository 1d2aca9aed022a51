"""Inertia: masses and moments of inertia of the particles.

They are solid spheres, of the mass density 4/3 pi R^3 and the moment 2/5 m R^2, in two dimensions too; or, there,
discs: cylinders as deep as the layer, density pi R^2 depth and 1/2 m R^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.densities import DENSITY, densities, volumes
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import which
from softdyn.scene.keys import Key, with_keys
from softdyn.scene.kinds import choice

if TYPE_CHECKING:
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]

#: Moment of inertia over m R^2 of each shape.
GYRATION = {"sphere": 0.4, "disc": 0.5}


@with_keys
@dataclass(frozen=True)
class Inertia:
    """The mass of the particles."""

    density: Annotated[
        float | Mapping[str, float],
        Key(
            "[inertia] density",
            DENSITY,
            "Density of the particles, which gives them mass and a moment of inertia.",
            "force time^2/length^4",
        ),
    ]
    shape: Annotated[
        str,
        Key(
            "[inertia] shape",
            choice("shape", tuple(GYRATION)),
            "Shape of the particles in two dimensions: solid spheres, as in three, or discs, which are as deep as the "
            "layer ([box] depth, twice the mean radius by default).",
        ),
    ] = "sphere"


@dataclass(frozen=True)
class Masses(Mechanism):
    """Masses and moments of inertia, shape (N,) each."""

    mass: Array
    moment: Array

    takes = ("kinetic",)


def check(facts: ValidatedScene, faults: list[str]) -> Masses | None:
    """Inertia of a scene."""
    given, d = facts.scene.inertia, facts.x.shape[1]
    assert given is not None
    before = len(faults)
    if given.shape == "disc" and d != 2:
        faults.append(f'[inertia] shape = "disc" is for two dimensions, and there are {d}: leave it out')
    density = densities(facts, given.density, "[inertia] density", faults)
    if len(faults) == before and not density.all():
        faults.append(f"[inertia] density of {which(density == 0)} is 0: without mass there is no inertia")
    if len(faults) > before:
        return None
    with np.errstate(over="ignore", under="ignore"):
        mass = density * volumes(facts)
        moment = GYRATION[given.shape] * mass * facts.radii**2
    start_velocities(facts, faults)
    odd = ~(np.isfinite(mass) & np.isfinite(moment) & (moment > 0))
    if odd.any():
        faults.append(f"[inertia] the mass or the moment of inertia of {which(odd)} is no number: choose other units")
    return Masses(mass, moment)


def start_velocities(facts: ValidatedScene, faults: list[str]) -> tuple[Array, Array]:
    """Velocities at the start, shape (N, d), and angular ones, shape (N, rotations).

    At rest where none are given; in a box that is sheared, with the flow.
    """
    scene, (count, d) = facts.scene, facts.x.shape
    turning = facts.width - d
    found = [np.zeros((count, d)), np.zeros((count, turning))]
    for k, (name, given, columns) in enumerate((("velocities", scene.velocities, d), ("spins", scene.spins, turning))):
        if given is None:
            continue
        if not columns:
            faults.append(f"[particles] {name}: particles turn with [friction] or tangential motion, in two dimensions")
            continue
        try:
            array = np.array(given, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape == (count, columns) and np.isfinite(array).all():
            found[k] = array
        else:
            faults.append(f"[particles] {name} must be {columns} finite numbers for each of {count} particles")
    return found[0], found[1]
