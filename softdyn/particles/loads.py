"""What acts on a scene from outside, as functions of t: forces, torques, held coordinates, moving walls, stress.

In come the entries of a :class:`ParticleScene`, numbers or expressions; out go functions of t that give arrays, and
which coordinates are given. What is wrong with an entry is refused by its name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.expression import FUNCTIONS
from softdyn.particles.geometry import Box
from softdyn.particles.imposed import Imposed
from softdyn.particles.sliding import rotations
from softdyn.particles.time_functions import TimeFunction, is_driven, time_function
from softdyn.particles.words import ALL, AXES, components, is_list, is_number, listed, particles_named
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.particles.particle_scene import Checked, ParticleScene

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

    def _sum(self, constant: Array, of: Callable[[TimeFunction], float]) -> Array:
        values = constant.copy()
        for those, column, function in self.terms:
            if not function.constant:
                values[those, column] += of(function)
        return np.asarray(values * self.scale)


def numbers_of(scene: ParticleScene, particles: Any, count: int, where: str) -> NDArray[np.int64]:
    """Numbers of the particles that are named: by their numbers, their species, or all of them."""
    if isinstance(particles, str):
        if particles == ALL:
            return np.arange(count)
        names = [] if scene.species is None else list(scene.species)
        if particles not in names:
            known = ", ".join(map(repr, (ALL, *sorted(set(names)))))
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


def _time_function(scene: ParticleScene, value: Any, where: str) -> TimeFunction:
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
    given = [values for push in scene.push for values in (push.force, push.torque)]
    given += [values for hold in scene.hold for values in (hold.velocity, hold.spin)]
    given += [wall.velocity for wall in scene.wall]
    given += [list(scene.stress.values())]
    texts = [value for values in given if values is not None for value in values if isinstance(value, str)]
    texts += [scene.shear_rate] if isinstance(scene.shear_rate, str) else []
    unused = [name for name in scene.constants if not any(re.search(rf"\b{re.escape(name)}\b", text) for text in texts)]
    if unused:
        raise SceneError(f"constants: {', '.join(unused)} does not appear in any expression")


def _terms(
    scene: ParticleScene, those: NDArray[np.int64], columns: Iterable[int], values: Any, labels: Iterable[str]
) -> list[Term]:
    """Terms of the components that are not 0; the labels are for errors."""
    parts = list(zip(columns, values, labels, strict=True))
    parts = [part for part in parts if not (is_number(part[1]) and part[1] == 0)]
    return [(those, column, _time_function(scene, value, label)) for column, value, label in parts]


def _turns(scene: ParticleScene, name: str, values: Any, where: str, d: int) -> list[str]:
    """Names of the components of a torque or an angular velocity, for errors; refuse what is none."""
    if not scene.tangential:
        raise SceneError(f"{where}: {name} has no meaning without tangential motion, [contacts] tangential = true")
    m = rotations(d)
    if not is_list(values, m):
        raise SceneError(f"{where}: {name} needs {components(m)} in {d} dimensions")
    return [f"{where}: {name} about {axis}" for axis in AXES[-m:]]


def pushes(scene: ParticleScene, pushed: Sequence[NDArray[np.int64]], count: int, d: int) -> tuple[Driven, Driven]:
    """External forces and torques."""
    forces: list[Term] = []
    torques: list[Term] = []
    for number, (push, particles) in enumerate(zip(scene.push, pushed, strict=True)):
        where = f"[[push]] {number}"
        if push.force is None and push.torque is None:
            raise SceneError(f"{where}: force or torque is missing")
        if push.force is not None:
            if not is_list(push.force, d):
                raise SceneError(f"{where}: force needs {components(d)}, one for each axis")
            labels = [f"{where}: force along {axis}" for axis in AXES[:d]]
            forces += _terms(scene, particles, range(d), push.force, labels)
        if push.torque is not None:
            labels = _turns(scene, "torque", push.torque, where, d)
            torques += _terms(scene, particles, range(len(labels)), push.torque, labels)
    return Driven(forces, np.ones((count, d))), Driven(torques, np.ones((count, rotations(d))))


def holds(
    scene: ParticleScene, held: Sequence[NDArray[np.int64]], count: int, d: int
) -> tuple[NDArray[np.bool_], Driven]:
    """Which positions are given, shape (N, d), and their velocities."""
    fixed = np.zeros((count, d), dtype=bool)
    terms: list[Term] = []
    for number, (hold, particles) in enumerate(zip(scene.hold, held, strict=True)):
        where = f"[[hold]] {number}"
        given = hold.axes if isinstance(hold.axes, str) else ""
        if not given or any(axis not in AXES[:d] for axis in given) or len(set(given)) < len(given):
            raise SceneError(f"{where}: axes must be some of {AXES[:d]!r}, not {hold.axes!r}")
        velocity = hold.velocity if hold.velocity is not None else [0.0] * len(hold.axes)
        if not is_list(velocity, len(hold.axes)):
            raise SceneError(f"{where}: velocity needs one component for each of the axes {hold.axes!r}")
        columns = [AXES.index(name) for name in hold.axes]
        for column in columns:
            twice = particles[fixed[particles, column]]
            if len(twice):
                raise SceneError(f"{where}: {particles_named(twice)} held twice along {AXES[column]}")
            fixed[particles, column] = True
        labels = [f"{where}: velocity along {name}" for name in hold.axes]
        terms += _terms(scene, particles, columns, velocity, labels)
    return fixed, Driven(terms, np.ones((count, d)))


def spins(
    scene: ParticleScene, held: Sequence[NDArray[np.int64]], count: int, d: int
) -> tuple[NDArray[np.bool_], Driven]:
    """Particles whose rotation is given, shape (N,), and their angular velocities."""
    turned = np.zeros(count, dtype=bool)
    terms: list[Term] = []
    for number, (hold, particles) in enumerate(zip(scene.hold, held, strict=True)):
        if hold.spin is None:
            continue
        where = f"[[hold]] {number}"
        labels = _turns(scene, "spin", hold.spin, where, d)
        twice = particles[turned[particles]]
        if len(twice):
            raise SceneError(f"{where}: {particles_named(twice)} given two spins")
        turned[particles] = True
        terms += _terms(scene, particles, range(len(labels)), hold.spin, labels)
    return turned, Driven(terms, np.ones((count, rotations(d))))


def with_rotations(checked: Checked) -> tuple[NDArray[np.bool_], Driven, Driven]:
    """Fixed coordinates, force and velocity for the coordinates (x, R theta); forces on these are (force, torque/R)."""
    (_, d), m, R = checked.x.shape, rotations(checked.x.shape[1]), checked.radii[:, None]
    fixed = np.concatenate([checked.fixed, np.repeat(checked.turned[:, None], m, axis=1)], axis=1)

    def beside(one: Driven, other: Driven, scale: Array) -> Driven:
        moved = [(those, d + column, function) for those, column, function in other.terms]
        return Driven([*one.terms, *moved], np.concatenate([one.scale, np.repeat(scale, m, axis=1)], axis=1))

    return fixed, beside(checked.force, checked.torque, 1 / R), beside(checked.velocity, checked.spin, R)


def wall_velocity(scene: ParticleScene, d: int) -> Driven | None:
    """Velocities of the walls, shape (walls, d); None if all of them are at rest."""
    terms = []
    for number, wall in enumerate(scene.wall):
        if wall.velocity is not None:
            labels = [f"wall {number}: velocity along {axis}" for axis in AXES[:d]]
            terms += _terms(scene, np.array([number]), range(d), wall.velocity, labels)
    return Driven(terms, np.ones((len(scene.wall), d))) if terms else None


def shear_flow(scene: ParticleScene) -> TimeFunction | None:
    """The shear rate as a function of t; None where it is a number."""
    if is_number(scene.shear_rate):
        return None
    return _time_function(scene, scene.shear_rate, "[flow] shear_rate")


def imposed_stress(scene: ParticleScene, box: Box) -> Imposed | None:
    """Stress imposed on the box, if there is any."""
    if not scene.stress:
        if scene.stress_viscosity is not None:
            raise SceneError("[stress] viscosity resists a box whose stress is imposed, and none is")
        return None
    d = len(box.lengths)
    known = [*(["xy"] if d > 1 else []), *(2 * axis for axis in AXES[:d]), "pressure"]
    faults = [
        f"[stress] unknown component {name!r}{suggestion(name, known)}" for name in scene.stress if name not in known
    ]
    if not box.periodic.all():
        faults.append("[stress] a stress is imposed on a box that is periodic along all axes: give its lengths")
    if "xy" in scene.stress and (is_driven(scene.shear_rate) or scene.shear_rate):
        faults.append(
            "[stress] xy and [flow] shear_rate: the shear rate follows from the shear stress; give one of them"
        )
    if "pressure" in scene.stress and any(2 * axis in scene.stress for axis in AXES):
        faults.append("[stress] pressure and the stress along an axis: give either")
    if scene.wall or scene.hold:
        faults.append(
            "[stress] walls and held particles do not move with a box whose stress is imposed: leave them out"
        )
    viscosity = scene.stress_viscosity if scene.stress_viscosity is not None else scene.parameters.get("eta")
    if isinstance(viscosity, Mapping) or not is_number(viscosity) or not viscosity > 0:  # type: ignore[operator]
        faults.append("[stress] viscosity, or the parameter eta, must be a positive number: it resists the box")
    if faults:
        raise SceneError(listed(faults))
    names = tuple(name for name in known if name in scene.stress)
    terms = [
        (np.array([k]), 0, _time_function(scene, scene.stress[name], f"[stress] {name}"))
        for k, name in enumerate(names)
    ]
    signs = np.array([[-1.0 if name == "pressure" else 1.0] for name in names])
    return Imposed(names, Driven(terms, signs), float(viscosity))  # type: ignore[arg-type]
