"""What potentials and bonds share: a potential with its parameters, and the pairs that it acts on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.names import is_number
from softdyn.particles.potential_kernels import PotentialKernel, energies_and_forces, get_potential_kernel
from softdyn.scene.kinds import Kind
from softdyn.scene.numbers import range_fault
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.particles.geometry import Contacts
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


def _is_potential_file(value: str) -> bool:
    return ".py" in value


POTENTIAL = Kind(
    "the name of a stock potential, a path or a Potential",
    {"type": "string"},
    path=_is_potential_file,
)


@dataclass(frozen=True)
class PairForce:
    """A potential's kernel, with the values of its parameters in the kernel's order."""

    kernel: PotentialKernel
    p: Array

    def __call__(self, r: Array, touching: Array) -> tuple[Array, Array, Array]:
        """Energy, force that pushes apart, and its slope, at the distances r; without the activation."""
        return energies_and_forces(self.kernel, self.p, r, touching)


def pair_force(
    facts: ValidatedScene, potential: Any, parameters: Mapping[str, float], where: str, faults: list[str]
) -> PairForce | None:
    """The potential that an entry of a scene names, with its parameters; ``where`` is for faults.

    Parameters
    ----------
    facts : ValidatedScene
    potential : str, Path or Potential
    parameters : mapping from str to float
        Of the potential.
    where : str
        Place in the scene.
    faults : list of str
        To which is added what is wrong.

    Raises
    ------
    LawError, SceneError
        If there is no such potential.
    """
    kernel = get_potential_kernel(potential, facts.scene.target)
    before = len(faults)
    names = kernel.parameters
    faults += [
        f"{where} parameters: {name!r} is not one of {kernel.potential}{suggestion(name, names)}"
        for name in parameters
        if name not in names
    ]
    for name in names:
        value = parameters.get(name, math.nan)
        if name not in parameters:
            faults.append(f"{where} parameters: {name} is missing; {kernel.potential} has {', '.join(names)}")
        elif not is_number(value):
            faults.append(f"{where} parameters: {name} must be a finite number, not {value!r}")
        elif name in kernel.ranges and (fault := range_fault(name, value, kernel.ranges[name])):
            faults.append(f"{where}: {fault}")
        elif name in kernel.positive and not value > 0:
            faults.append(f"{where} parameters: {name} must be positive, not {value!r}")
        elif name in kernel.not_negative and not value >= 0:
            faults.append(f"{where} parameters: {name} must not be negative, not {value!r}")
    if len(faults) > before:
        return None
    return PairForce(kernel, np.array([float(parameters[name]) for name in names]))


def require_resistance(facts: ValidatedScene, what: str, faults: list[str]) -> None:
    """Forces along the lines of the centres move particles that something resists by itself.

    Parameters
    ----------
    facts : ValidatedScene
    what : str
        Such forces, in words.
    faults : list of str
        To which is added what is wrong.
    """
    if not facts.scene.drag and facts.scene.inertia is None:
        faults.append(f"{what} move particles that drag resists, or inertia: give [flow] drag, 1 for Stokes' drag")


@dataclass
class Remembered:
    """Something that was found of a list of contacts, for the next call with the same list."""

    of: Any = None
    found: Any = None


@dataclass
class RowsOf:
    """Rows of a list of contacts that something acts on: looked for once in each list."""

    last: Remembered = field(default_factory=Remembered)

    def known(self, contacts: Contacts) -> Any:
        """What was found of this list; None if nothing was yet."""
        return self.last.found if self.last.of is contacts.i else None

    def keep(self, contacts: Contacts, found: Any) -> Any:
        """Remember what was found of this list. One assignment: threads may ask for it at once."""
        self.last = Remembered(contacts.i, found)
        return found
