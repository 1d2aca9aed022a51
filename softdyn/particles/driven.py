"""What is given as functions of time, entry by entry: forces, velocities, stresses; and of which particles.

In come the entries of a :class:`ParticleScene`, numbers, expressions or tables; out go functions of t that give arrays.
What is wrong with an entry is refused by its name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.expression import FUNCTIONS
from softdyn.particles.geometry import rotations
from softdyn.particles.names import ALL, AXES, components, is_list, is_number
from softdyn.particles.time_functions import TimeFunction, time_function
from softdyn.scene.keys import driven_values

if TYPE_CHECKING:
    from softdyn.particles.particle_keys import ParticleScene

Array = NDArray[np.float64]

#: Particles (or walls), the column of theirs that is meant, and what it is as a function of t.
Term = tuple[NDArray[np.int64], int, TimeFunction]


@dataclass(frozen=True)
class Driven:
    """An array whose entries are sums of given functions of time.

    Attributes
    ----------
    terms : sequence of Term
    scale : array
        Factor of each entry; the shape is that of the array.
    base : array, optional
        What they are added to; 0 without.
    """

    terms: Sequence[Term]
    scale: Array
    base: Array | None = None

    def __call__(self, t: float) -> Array:
        """Values at a time, or before the jump there."""
        return self._sum(self._constant, lambda function: function(t))

    def after(self, t: float) -> Array:
        """Values at a time, or behind the jump there."""
        return self._sum(self._constant, lambda function: function.after(t))

    def rate(self, t: float) -> Array:
        """Derivatives at a time, or before the kinks there; where one has none, infinite or nan."""
        return self._sum(np.zeros(self.scale.shape), lambda function: function.rate(t))

    def integral(self, t: float) -> Array:
        """Integrals from 0 to a time."""
        return self._sum(t * self._constant, lambda function: function.integral(t))

    @cached_property
    def _constant(self) -> Array:
        values = np.zeros(self.scale.shape) if self.base is None else self.base.copy()
        for those, column, function in self.terms:
            if function.constant:
                values[those, column] += function.number
        return values

    def unchanging(self) -> Array:
        """The part that is numbers, without the terms of :meth:`changing`."""
        return np.asarray(self._constant * self.scale)

    def changing(self) -> Iterator[Term]:
        """Terms that are not numbers."""
        return (term for term in self.terms if not term[2].constant)

    def _sum(self, constant: Array, of: Callable[[TimeFunction], float]) -> Array:
        values = constant.copy()
        for those, column, function in self.terms:
            if not function.constant:
                values[those, column] += of(function)
        return np.asarray(values * self.scale)


def sum_of(parts: Sequence[Driven], shape: tuple[int, int]) -> Driven:
    """Sum of arrays that have one scale; 0 of none."""
    if len(parts) == 1:
        return parts[0]
    scale = parts[0].scale if parts else np.ones(shape)
    base = sum((part.base for part in parts if part.base is not None), np.zeros(shape))
    return Driven([term for part in parts for term in part.terms], scale, base)


def constant(values: Array) -> Driven:
    """The same at all times."""
    return Driven([], np.ones(values.shape), values)


def numbers_of(scene: ParticleScene, particles: Any, count: int, where: str) -> NDArray[np.int64]:
    """Numbers of the particles that are named: by their numbers, their species, or all of them.

    Parameters
    ----------
    scene : ParticleScene
    particles : int, sequence of int, or str
        Numbers, a species, or "all".
    count : int
        How many particles there are.
    where : str
        Place in the scene, for errors.
    """
    if isinstance(particles, str):
        if particles == ALL:
            return np.arange(count)
        names = list(scene.species) if isinstance(scene.species, (list, tuple, np.ndarray)) else []
        if particles not in names:
            known = ", ".join(map(repr, (ALL, *sorted({str(name) for name in names}))))
            raise SceneError(
                f"{where}: there is no species {particles!r}; particles are named by {known}, or a list of numbers"
            )
        return np.flatnonzero([name == particles for name in names])
    given = list(particles) if isinstance(particles, (list, tuple, range, np.ndarray)) else [particles]
    if not all(isinstance(number, (int, np.integer)) and not isinstance(number, bool) for number in given):
        raise SceneError(f"{where}: particles must be a list of whole numbers, a species or {ALL!r}, not {particles!r}")
    try:
        numbers = np.array(given, dtype=np.int64)
    except OverflowError:
        raise SceneError(f"{where}: there is no particle {max(given, key=abs)}") from None
    wrong = [int(number) for number in numbers if not 0 <= number < count]
    if wrong or not len(numbers):
        raise SceneError(f"{where}: there is no particle {wrong[:10] or ''}; they are numbered 0 to {count - 1}")
    return numbers


def given_function(scene: ParticleScene, value: Any, where: str) -> TimeFunction:
    """A value of a scene as a function of time; ``where`` is for errors.

    Parameters
    ----------
    scene : ParticleScene
    value : number, str, table, or (times, values)
    where : str
        Place in the scene, for errors.
    """
    assert scene.until_t is not None  # the end that is known of a scene that is being checked
    return time_function(value, where, _constants(scene), float(scene.until_t))


def _constants(scene: ParticleScene) -> dict[str, float]:
    taken = [name for name in scene.constants if name in ("t", "pi", *FUNCTIONS)]
    if taken:
        raise SceneError(f"constants: {', '.join(taken)} has a meaning of its own in an expression")
    wrong = [name for name, value in scene.constants.items() if not is_number(value)]
    if wrong:
        raise SceneError(f"constants: {', '.join(wrong)} must be a finite number")
    return {name: float(value) for name, value in scene.constants.items()}


def require_used(scene: ParticleScene) -> None:
    """Refuse constants that no expression takes."""
    texts = [value for value in driven_values(scene) if isinstance(value, str)]
    unused = [name for name in scene.constants if not any(re.search(rf"\b{re.escape(name)}\b", text) for text in texts)]
    if unused:
        raise SceneError(f"constants: {', '.join(unused)} does not appear in any expression")


def terms_of(
    scene: ParticleScene, those: NDArray[np.int64], columns: Iterable[int], values: Any, labels: Iterable[str]
) -> list[Term]:
    """Terms of the components that are not 0; the labels are for errors.

    Parameters
    ----------
    scene : ParticleScene
    those : array of int
        Numbers of the particles.
    columns : iterable of int
        Coordinate of each component.
    values : sequence
        The components: numbers or functions of time.
    labels : iterable of str
        Their names, for errors.
    """
    parts = list(zip(columns, values, labels, strict=True))
    parts = [part for part in parts if not (is_number(part[1]) and part[1] == 0)]
    return [(those, column, given_function(scene, value, label)) for column, value, label in parts]


def turn_labels(scene: ParticleScene, name: str, values: Any, where: str, d: int) -> list[str]:
    """Names of the components of a torque or an angular velocity, for errors; refuse what is none.

    Parameters
    ----------
    scene : ParticleScene
    name : str
        Of the key.
    values : sequence
        The components: one in two dimensions, three in three.
    where : str
        Place in the scene, for errors.
    d : int
        Dimensions.
    """
    if not scene.turns:
        raise SceneError(
            f"{where}: {name} has no meaning without tangential motion, [contacts] tangential = true, or [friction]"
        )
    m = rotations(d)
    if not is_list(values, m):
        raise SceneError(f"{where}: {name} needs {components(m)} in {d} dimensions")
    return [f"{where}: {name} about {axis}" for axis in AXES[-m:]]
