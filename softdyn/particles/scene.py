"""Scenes of many particles, checked before anything runs."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import IntegrationError, SceneError
from softdyn.expression import FUNCTIONS, parse
from softdyn.expression import evaluate as evaluate_expression
from softdyn.particles.geometry import Box, Wall, bare_contacts, directions, find_pairs, lattice
from softdyn.particles.kernel import ContactKernel
from softdyn.particles.sliding import rotations
from softdyn.particles.surroundings import Imposed
from softdyn.scene import SMALLEST_RTOL, TARGETS, range_fault, suggestion

Array = NDArray[np.float64]

#: Beyond this ratio of radii, two spheres no longer meet as two half-spaces do while both are near-spherical.
LARGEST_RATIO = 10.0
MIXING: dict[str, Callable[[Array, Array], Array]] = {
    "arithmetic": lambda one, other: (one + other) / 2,
    "geometric": lambda one, other: np.sqrt(one * other),
    "harmonic": lambda one, other: 2 * one * other / (one + other),
}
#: Particles up to this many may all be in contact with one another; beyond, contacts need a range.
MOST_WITHOUT_RANGE = 64
AXES = "xyz"
#: Stands for all particles where some are named.
ALL = "all"


@dataclass(frozen=True)
class Push:
    """An external force or torque, or both, on each of some particles.

    Parameters
    ----------
    particles : sequence of int, or str
        Their numbers, the name of a species, or "all".
    force : sequence of (float or str), optional
        One for each axis: numbers, or expressions of t.
    torque : sequence of (float or str), optional
        About the centre, where there is tangential motion: one in two dimensions, > 0 from x to y; three in three.
    """

    particles: Sequence[int] | str
    force: Sequence[float | str] | None = None
    torque: Sequence[float | str] | None = None


@dataclass(frozen=True)
class Hold:
    """Coordinates that do not follow from forces: held at rest, or driven.

    Parameters
    ----------
    particles : sequence of int, or str
        Their numbers, the name of a species, or "all".
    axes : str
        Which of "xyz".
    velocity : sequence of (float or str), optional
        One for each of the axes; 0 without.
    spin : sequence of (float or str), optional
        Angular velocity, where there is tangential motion: one number in two dimensions, three in three. Without it the
        particles turn as torques make them.
    """

    particles: Sequence[int] | str
    axes: str
    velocity: Sequence[float | str] | None = None
    spin: Sequence[float | str] | None = None


@dataclass(frozen=True)
class ParticleScene:
    """Many particles; all numbers in one consistent set of units.

    Parameters
    ----------
    law : str, Path or ContactLaw
    parameters : mapping from str to float, or to a mapping from species to float
        A value for each parameter of the law but R, which follows from the radii.
    positions : array, shape (N, d), d = 1, 2 or 3
    radii : float, or array of shape (N,)
    species : sequence of str, optional
        One name for each particle; needed where a parameter depends on it.
    mixing : mapping from str to str
        For each parameter that depends on the species, how a contact of two takes it: "arithmetic", "geometric" or
        "harmonic" mean. E is always the harmonic mean, as for two elastic half-spaces under one pressure.
    gap : float, optional
        Initial gap of the pairs whose surfaces are closer than that, which are then pressed together; all others start
        undeformed.
    reach : float, optional
        Range of a contact: beyond this gap there is none, and from half of it on it fades. Without it all pairs are
        in contact.
    tangential : bool
        Whether particles slide, roll and turn, as their law declares.
    box : sequence of float or None, optional
        Edges of the periodic box; None along an axis that is not periodic.
    walls : sequence of Wall
    shear_rate : float
        Background flow u = shear_rate y along x; a periodic box is sheared with it.
    stress : mapping from str to (float or str)
        Imposed on a box that is periodic along all axes, which then shears or stretches as it must: "xy", the shear
        stress, instead of a shear rate; "xx", "yy", "zz", along an axis, > 0 in tension; or "pressure", minus a third
        (in two dimensions, half) of their sum, at which the box keeps its shape. Numbers, or expressions of t; stress
        of the contacts and of the fluid, 2 eta D.
    stress_viscosity : float, optional
        Viscosity eta of the fluid in that; the parameter eta by default.
    drag : float
        What resists each particle is 6 pi eta R times this: 1 for Stokes' drag, 0 for none.
    pushes : sequence of Push
    holds : sequence of Hold
    constants : mapping from str to float
        Named constants of the expressions.
    until : float
        The run ends at this time.
    until_strain : float, optional
        Or before, where a box under an imposed shear stress has this shear strain.
    times : int or sequence of float
        Output times: how many, evenly spaced from 0 to the end, or which.
    rtol : float
        Relative error of the gaps allowed in one step.
    target : "auto", "c" or "numba"
    """

    law: Any
    parameters: Mapping[str, float | Mapping[str, float]]
    positions: Any
    radii: Any
    until: float
    until_strain: float | None = None
    species: Sequence[str] | None = None
    mixing: Mapping[str, str] = field(default_factory=dict)
    gap: float | None = None
    reach: float | None = None
    tangential: bool = False
    box: Sequence[float | None] | None = None
    walls: Sequence[Wall] = ()
    shear_rate: float = 0.0
    stress: Mapping[str, float | str] = field(default_factory=dict)
    stress_viscosity: float | None = None
    drag: float = 0.0
    pushes: Sequence[Push] = ()
    holds: Sequence[Hold] = ()
    constants: Mapping[str, float] = field(default_factory=dict)
    times: int | Sequence[float] = 11
    rtol: float = 1e-4
    target: str = "auto"


@dataclass(frozen=True)
class Checked:
    """A scene as arrays: nothing in it contradicts anything else.

    Attributes
    ----------
    x : array, shape (N, d)
    radii : array, shape (N,)
    species : array of int, shape (N,)
    names : tuple of str
        Names of the species.
    box : Box
    walls : tuple of Wall
    fixed : array of bool, shape (N, d)
    force, velocity : function of t
    torque : function of t
        Shape (N, rotations).
    times : array
    turned : array of bool, shape (N,)
        Particles whose rotation is given.
    spin : function of t
        Angular velocity of these, shape (N, rotations).
    imposed : Imposed, optional
    wall_velocity : function of t, optional
        Velocities of the walls, shape (walls, d), if any of them moves.
    """

    x: Array
    radii: Array
    species: NDArray[np.int64]
    names: tuple[str, ...]
    box: Box
    walls: tuple[Wall, ...]
    fixed: NDArray[np.bool_]
    force: Callable[[float], Array]
    torque: Callable[[float], Array]
    velocity: Callable[[float], Array]
    times: Array
    turned: NDArray[np.bool_]
    spin: Callable[[float], Array]
    imposed: Imposed | None
    wall_velocity: Callable[[float], Array] | None


def check(scene: ParticleScene) -> Checked:
    """Refuse what is wrong with a scene whatever its law; as many faults at once as can be told.

    Raises
    ------
    SceneError
        Naming the particles at fault.
    """
    x = _array("positions", scene.positions)
    if x.ndim != 2 or not 1 <= x.shape[1] <= 3 or len(x) < 2:
        raise SceneError(f"[particles] positions must be two at least, of 1 to 3 coordinates, not of shape {x.shape}")
    count, d = x.shape
    if not np.isfinite(x).all():
        raise SceneError(f"[particles] positions of {_which(np.asarray(~np.isfinite(x).all(axis=1)))} are not finite")
    radii = _array("radii", scene.radii)
    if radii.ndim == 0:
        radii = np.full(count, float(radii))
    if radii.shape != (count,):
        raise SceneError(f"[particles] {len(radii)} radii for {count} particles")
    faults = []
    for name, kind in (("pushes", Push), ("holds", Hold), ("walls", Wall)):
        entries = getattr(scene, name)
        if not isinstance(entries, (list, tuple)) or not all(isinstance(entry, kind) for entry in entries):
            raise SceneError(f"{name} must be a list of {kind.__name__}(...), not {entries!r}")
    good = np.isfinite(radii) & (radii > 0)
    if not good.all():
        raise SceneError(f"[particles] radii must be positive and finite; {_which(~good)} have others")
    if radii.max() > LARGEST_RATIO * radii.min():
        small, large = int(np.argmin(radii)), int(np.argmax(radii))
        faults.append(
            f"[particles] radii differ by a factor of {radii.max() / radii.min():.3g} (particles {small} and {large}); "
            f"up to {LARGEST_RATIO:g} a contact is that of two near half-spaces"
        )
    for name, value in (("until", scene.until), ("rtol", scene.rtol)):
        if not _is_number(value) or not value > 0:
            faults.append(f"{name} must be a positive number, not {value!r}")
    for name, length in (("gap", scene.gap), ("reach", scene.reach)):
        if length is not None and not (_is_number(length) and length > 0):
            faults.append(f"{name} must be a positive number, not {length!r}")
    if scene.until_strain is not None:
        if not _is_number(scene.until_strain) or not scene.until_strain:
            faults.append(f"until_strain must be a number other than 0, not {scene.until_strain!r}")
        elif not isinstance(scene.stress, Mapping) or "xy" not in scene.stress:
            faults.append(
                "until_strain ends a run under an imposed shear stress, [stress] xy; elsewhere the strain is the time "
                "times the shear rate"
            )
    if not _is_number(scene.drag) or scene.drag < 0:
        faults.append(f"drag must be 0 or a positive number, not {scene.drag!r}")
    if not _is_number(scene.shear_rate):
        faults.append(f"shear_rate must be a finite number, not {scene.shear_rate!r}")
    if faults:
        raise SceneError(_listed(faults))
    if not SMALLEST_RTOL * 100 <= scene.rtol <= 0.1:
        faults.append(f"rtol must lie between {100 * SMALLEST_RTOL:g} and 0.1, not {scene.rtol:g}")
    if scene.target not in TARGETS:
        faults.append(f"unknown target {scene.target!r}{suggestion(scene.target, TARGETS)}")
    if scene.gap is not None and scene.reach is not None and scene.gap > scene.reach / 2:
        faults.append(f"gap = {scene.gap:g} must not exceed half the range of a contact, {scene.reach / 2:g}")
    if scene.reach is None and count > MOST_WITHOUT_RANGE:
        faults.append(f"{count} particles need a range of their contacts, [contacts] range")
    box = _box(scene, d, faults)
    walls = _walls(scene, d, faults)
    if not isinstance(scene.tangential, (bool, np.bool_)):
        faults.append(f"tangential must be true or false, not {scene.tangential!r}")
    if scene.tangential and d == 1:
        faults.append("[contacts] tangential: in one dimension there is no tangential motion")
    if scene.shear_rate and d == 1:
        faults.append("a shear flow needs two dimensions at least")
    if scene.shear_rate and not scene.drag and not box.periodic[: min(d, 2)].all():
        faults.append(
            "the flow moves the particles by their drag, or by the walls of a sheared periodic box, and here is "
            "neither: give drag = 1, or a box periodic along x and y"
        )
    if scene.shear_rate and d > 1 and box.periodic[1] and not box.periodic[0]:
        faults.append("[box] a sheared box must be periodic along x where it is along y")
    if faults:
        raise SceneError(_listed(faults))
    names, species = _species(scene, count)
    faults += _place_faults(x, box, walls)
    faults += _overlap_faults(x, radii, box, walls)
    if faults:
        raise SceneError(_listed(faults))
    pushed = [_numbers_of(scene, push.particles, count, f"[[push]] {k}") for k, push in enumerate(scene.pushes)]
    held = [_numbers_of(scene, hold.particles, count, f"[[hold]] {k}") for k, hold in enumerate(scene.holds)]
    fixed, velocity = _holds(scene, held, count, d)
    force, torque = _pushes(scene, pushed, count, d)
    _require_used(scene)
    turned, spin = _spins(scene, held, count, d)
    imposed, wall_velocity = _imposed(scene, box), _wall_velocity(scene, d)
    return Checked(
        x,
        radii,
        species,
        names,
        box,
        walls,
        fixed,
        force,
        torque,
        velocity,
        _times(scene),
        turned,
        spin,
        imposed,
        wall_velocity,
    )


def _array(name: str, values: Any) -> Array:
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(f"[particles] {name} must be numbers") from None


def _is_number(value: Any) -> bool:
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    return number and math.isfinite(value)


def _listed(faults: Sequence[str]) -> str:
    return faults[0] if len(faults) == 1 else "\n" + "\n".join(f"  - {fault}" for fault in faults)


def _which(flags: NDArray[np.bool_]) -> str:
    return particles_named(np.flatnonzero(flags))


def particles_named(numbers: Sequence[int] | NDArray[np.int64]) -> str:
    """Words for some particles: their numbers, or the first ten of them."""
    shown = ", ".join(str(int(number)) for number in numbers[:10])
    more = f" and {len(numbers) - 10} more" if len(numbers) > 10 else ""
    return f"particle{'s' if len(numbers) > 1 else ''} {shown}{more}"


def _box(scene: ParticleScene, d: int, faults: list[str]) -> Box:
    lengths = np.full(d, math.inf)
    if scene.box is not None:
        given = list(scene.box)
        if len(given) != d:
            faults.append(f"[box] {len(given)} lengths for {d} dimensions")
        else:
            for axis, length in enumerate(given):
                if length is None:
                    continue
                if not _is_number(length) or not length > 0:
                    faults.append(f"[box] the length along {AXES[axis]} must be positive, not {length!r}")
                else:
                    lengths[axis] = float(length)
    return Box(lengths, float(scene.shear_rate))


def _coordinates(values: Any, d: int) -> Array | None:
    """A point's finite coordinates; None for anything else."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        return None
    return array if array.shape == (d,) and np.isfinite(array).all() else None


def _walls(scene: ParticleScene, d: int, faults: list[str]) -> tuple[Wall, ...]:
    walls = []
    for number, wall in enumerate(scene.walls):
        point, normal = _coordinates(wall.point, d), _coordinates(wall.normal, d)
        size = 0.0 if normal is None else float(np.linalg.norm(normal))
        if point is None or normal is None or not 0 < size < math.inf:
            faults.append(f"wall {number} needs a point and a normal of {d} finite coordinates each, the normal not 0")
            continue
        if not isinstance(wall.rigid, (bool, np.bool_)):
            faults.append(f"wall {number}: rigid must be true or false, not {wall.rigid!r}")
            continue
        if wall.velocity is not None and not _is_list(wall.velocity, d):
            faults.append(f"wall {number}: velocity needs {_components(d)}, one for each axis")
            continue
        walls.append(Wall(point, normal / size, bool(wall.rigid), wall.velocity))
    return tuple(walls)


def _wall_velocity(scene: ParticleScene, d: int) -> Callable[[float], Array] | None:
    terms = []
    for number, wall in enumerate(scene.walls):
        if wall.velocity is not None:
            labels = [f"wall {number}: velocity along {axis}" for axis in AXES[:d]]
            terms += _terms(scene, np.array([number]), range(d), wall.velocity, labels)
    return _sum_of(terms, len(scene.walls), d) if terms else None


def _imposed(scene: ParticleScene, box: Box) -> Imposed | None:
    """Stress imposed on the box."""
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
    if "xy" in scene.stress and scene.shear_rate:
        faults.append(
            "[stress] xy and [flow] shear_rate: the shear rate follows from the shear stress; give one of them"
        )
    if "pressure" in scene.stress and any(2 * axis in scene.stress for axis in AXES):
        faults.append("[stress] pressure and the stress along an axis: give either")
    if scene.walls or scene.holds:
        faults.append(
            "[stress] walls and held particles do not move with a box whose stress is imposed: leave them out"
        )
    viscosity = scene.stress_viscosity if scene.stress_viscosity is not None else scene.parameters.get("eta")
    if isinstance(viscosity, Mapping) or not _is_number(viscosity) or not viscosity > 0:  # type: ignore[operator]
        faults.append("[stress] viscosity, or the parameter eta, must be a positive number: it resists the box")
    if faults:
        raise SceneError(_listed(faults))
    names = tuple(name for name in known if name in scene.stress)
    functions = [_function(scene, scene.stress[name], f"[stress] {name}") for name in names]
    signs = np.array([-1.0 if name == "pressure" else 1.0 for name in names])

    def values(t: float) -> Array:
        return signs * np.array([function(t) for function in functions])

    return Imposed(names, values, float(viscosity))  # type: ignore[arg-type]


def _species(scene: ParticleScene, count: int) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    if scene.species is None:
        return ("",), np.zeros(count, dtype=np.int64)
    given = list(scene.species) if isinstance(scene.species, (list, tuple, np.ndarray)) else []
    if not given or not all(isinstance(name, str) for name in given):
        raise SceneError(f"[particles] species must be a list of names, one for each particle, not {scene.species!r}")
    if len(given) != count:
        raise SceneError(f"[particles] {len(given)} species for {count} particles")
    if ALL in given:
        raise SceneError(f"[particles] no species can have the name {ALL!r}: it stands for all particles")
    names = tuple(sorted(set(given)))
    return names, np.array([names.index(name) for name in given], dtype=np.int64)


def _place_faults(x: Array, box: Box, walls: tuple[Wall, ...]) -> list[str]:
    faults = []
    with np.errstate(invalid="ignore"):
        outside = np.asarray((box.periodic & ((x < 0) | (x > np.where(box.periodic, box.lengths, 0.0)))).any(axis=1))
    if outside.any():
        faults.append(f"{_which(outside)} outside of the periodic box, which starts at 0")
    for number, wall in enumerate(walls):
        behind = (wall.point - x) @ wall.normal <= 0
        if behind.any():
            faults.append(f"{_which(behind)} on the wrong side of wall {number}")
    return faults


def _overlap_faults(x: Array, radii: Array, box: Box, walls: tuple[Wall, ...]) -> list[str]:
    """Pairs that overlap by more than the smaller radius."""
    # surfaces at most touching; a box too small for these is refused by the search
    i, j, shift = find_pairs(x, radii, box, 0.0, walls, 0.0)
    contacts = bare_contacts(i, j, shift, radii)
    with np.errstate(divide="ignore", invalid="ignore"):
        _, r = directions(contacts, x, lattice(box, 0.0), walls)
    smaller = np.minimum(radii[i], np.append(radii, np.full(len(walls), np.inf))[j])
    deep = np.flatnonzero(contacts.S - r > smaller)
    count = len(radii)
    return [
        f"particle {i[c]} and {f'particle {j[c]}' if j[c] < count else f'wall {j[c] - count}'} overlap by "
        f"{contacts.S[c] - r[c]:.4g}, more than the radius {smaller[c]:.4g}"
        for c in deep[:10]
    ] + ([f"and {len(deep) - 10} more pairs overlap as deeply"] if len(deep) > 10 else [])


def _numbers_of(scene: ParticleScene, particles: Any, count: int, where: str) -> NDArray[np.int64]:
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


def _is_list(values: Any, size: int) -> bool:
    return isinstance(values, (list, tuple, np.ndarray)) and len(values) == size


def _components(size: int) -> str:
    return f"{size} component{'s' if size > 1 else ''}"


def _function(scene: ParticleScene, value: Any, where: str) -> Callable[[float], float]:
    """Function of t from a number or an expression."""
    if isinstance(value, str):
        expression = parse(value, _constants(scene))
        start = evaluate_expression(expression, 0.0)
        if not math.isfinite(start):
            raise SceneError(f"{where} = {value!r} has no finite value at t = 0")

        def evaluated(t: float) -> float:
            found = evaluate_expression(expression, t)
            if not math.isfinite(found):
                raise IntegrationError(f"{where} = {value!r} has no finite value at t={t:.6g}")
            return found

        return evaluated
    if not _is_number(value):
        raise SceneError(f"{where} must be a number or an expression of t, not {value!r}")
    return lambda t: float(value)


def _constants(scene: ParticleScene) -> dict[str, float]:
    taken = [name for name in scene.constants if name in ("t", "pi", *FUNCTIONS)]
    if taken:
        raise SceneError(f"constants: {', '.join(taken)} has a meaning of its own in an expression")
    wrong = [name for name, value in scene.constants.items() if not _is_number(value)]
    if wrong:
        raise SceneError(f"constants: {', '.join(wrong)} must be a finite number")
    return {name: float(value) for name, value in scene.constants.items()}


def _require_used(scene: ParticleScene) -> None:
    given = [values for push in scene.pushes for values in (push.force, push.torque)]
    given += [values for hold in scene.holds for values in (hold.velocity, hold.spin)]
    given += [wall.velocity for wall in scene.walls]
    given += [list(scene.stress.values())]
    texts = [value for values in given if values is not None for value in values if isinstance(value, str)]
    unused = [name for name in scene.constants if not any(re.search(rf"\b{re.escape(name)}\b", text) for text in texts)]
    if unused:
        raise SceneError(f"constants: {', '.join(unused)} does not appear in any expression")


#: Particles (or walls), the column of theirs that is meant, and what it is as a function of t.
Term = tuple[NDArray[np.int64], int, Callable[[float], float]]


def _terms(
    scene: ParticleScene, those: NDArray[np.int64], columns: Iterable[int], values: Any, labels: Iterable[str]
) -> list[Term]:
    """Terms of the components that are not 0; the labels are for errors."""
    parts = list(zip(columns, values, labels, strict=True))
    parts = [part for part in parts if not (_is_number(part[1]) and part[1] == 0)]
    return [(those, column, _function(scene, value, label)) for column, value, label in parts]


def _sum_of(terms: Sequence[Term], count: int, width: int) -> Callable[[float], Array]:
    def total(t: float) -> Array:
        values = np.zeros((count, width))
        for those, column, function in terms:
            values[those, column] += function(t)
        return values

    return total


def _turns(scene: ParticleScene, name: str, values: Any, where: str, d: int) -> list[str]:
    """Names of the components of a torque or an angular velocity, for errors; refuse what is none."""
    if not scene.tangential:
        raise SceneError(f"{where}: {name} has no meaning without tangential motion, [contacts] tangential = true")
    m = rotations(d)
    if not _is_list(values, m):
        raise SceneError(f"{where}: {name} needs {_components(m)} in {d} dimensions")
    return [f"{where}: {name} about {axis}" for axis in AXES[-m:]]


def _pushes(
    scene: ParticleScene, pushed: Sequence[NDArray[np.int64]], count: int, d: int
) -> tuple[Callable[[float], Array], Callable[[float], Array]]:
    """External forces and torques."""
    forces: list[Term] = []
    torques: list[Term] = []
    for number, (push, particles) in enumerate(zip(scene.pushes, pushed, strict=True)):
        where = f"[[push]] {number}"
        if push.force is None and push.torque is None:
            raise SceneError(f"{where}: force or torque is missing")
        if push.force is not None:
            if not _is_list(push.force, d):
                raise SceneError(f"{where}: force needs {_components(d)}, one for each axis")
            labels = [f"{where}: force along {axis}" for axis in AXES[:d]]
            forces += _terms(scene, particles, range(d), push.force, labels)
        if push.torque is not None:
            labels = _turns(scene, "torque", push.torque, where, d)
            torques += _terms(scene, particles, range(len(labels)), push.torque, labels)
    return _sum_of(forces, count, d), _sum_of(torques, count, rotations(d))


def _holds(
    scene: ParticleScene, held: Sequence[NDArray[np.int64]], count: int, d: int
) -> tuple[NDArray[np.bool_], Callable[[float], Array]]:
    fixed = np.zeros((count, d), dtype=bool)
    terms: list[Term] = []
    for number, (hold, particles) in enumerate(zip(scene.holds, held, strict=True)):
        where = f"[[hold]] {number}"
        given = hold.axes if isinstance(hold.axes, str) else ""
        if not given or any(axis not in AXES[:d] for axis in given) or len(set(given)) < len(given):
            raise SceneError(f"{where}: axes must be some of {AXES[:d]!r}, not {hold.axes!r}")
        velocity = hold.velocity if hold.velocity is not None else [0.0] * len(hold.axes)
        if not _is_list(velocity, len(hold.axes)):
            raise SceneError(f"{where}: velocity needs one component for each of the axes {hold.axes!r}")
        columns = [AXES.index(name) for name in hold.axes]
        for column in columns:
            twice = particles[fixed[particles, column]]
            if len(twice):
                raise SceneError(f"{where}: {particles_named(twice)} held twice along {AXES[column]}")
            fixed[particles, column] = True
        labels = [f"{where}: velocity along {name}" for name in hold.axes]
        terms += _terms(scene, particles, columns, velocity, labels)
    return fixed, _sum_of(terms, count, d)


def _spins(
    scene: ParticleScene, held: Sequence[NDArray[np.int64]], count: int, d: int
) -> tuple[NDArray[np.bool_], Callable[[float], Array]]:
    """Rotations that are given."""
    turned = np.zeros(count, dtype=bool)
    terms: list[Term] = []
    for number, (hold, particles) in enumerate(zip(scene.holds, held, strict=True)):
        if hold.spin is None:
            continue
        where = f"[[hold]] {number}"
        labels = _turns(scene, "spin", hold.spin, where, d)
        twice = particles[turned[particles]]
        if len(twice):
            raise SceneError(f"{where}: {particles_named(twice)} given two spins")
        turned[particles] = True
        terms += _terms(scene, particles, range(len(labels)), hold.spin, labels)
    return turned, _sum_of(terms, count, rotations(d))


def with_rotations(
    checked: Checked,
) -> tuple[NDArray[np.bool_], Callable[[float], Array], Callable[[float], Array]]:
    """Fixed coordinates, force and velocity for the coordinates (x, R theta); forces on these are (force, torque/R)."""
    m, R = rotations(checked.x.shape[1]), checked.radii[:, None]
    fixed = np.concatenate([checked.fixed, np.repeat(checked.turned[:, None], m, axis=1)], axis=1)

    def force(t: float) -> Array:
        return np.concatenate([checked.force(t), checked.torque(t) / R], axis=1)

    def velocity(t: float) -> Array:
        return np.concatenate([checked.velocity(t), R * checked.spin(t)], axis=1)

    return fixed, force, velocity


def _times(scene: ParticleScene) -> Array:
    given = scene.times
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        if not 2 <= given <= 1_000_000:
            raise SceneError(f"[output] times must be 2 to 1000000, or a list, not {given}")
        return np.linspace(0.0, float(scene.until), int(given))
    if isinstance(given, str):
        raise SceneError(f"[output] times must be a count or a list of numbers, not {given!r}")
    try:
        times = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise SceneError("[output] times must be a count or a list of numbers") from None
    good = times.ndim == 1 and len(times) and np.isfinite(times).all() and (np.diff(times) > 0).all()
    if not good or times[0] < 0 or times[-1] > scene.until:
        raise SceneError(f"[output] times must increase, from 0 at least to until = {scene.until:g} at most")
    return times


def varying_parameters(scene: ParticleScene, checked: Checked) -> tuple[str, ...]:
    """Names of the parameters that differ from contact to contact.

    Raises
    ------
    SceneError
        If a parameter depends on species that there are not, or without a rule of mixing.
    """
    faults, varying = [], []
    if np.ptp(checked.radii) > 0 or checked.walls:
        varying += ["R", "size_ratio"] if scene.tangential else ["R"]
    if not isinstance(scene.parameters, Mapping):
        raise SceneError(f"[parameters] must map names to numbers, not {scene.parameters!r}")
    faults += [
        f"[parameters] {name} follows from the radii of the particles: leave it out"
        for name in ("R", "size_ratio")
        if name in scene.parameters
    ]
    for name, value in scene.parameters.items():
        if not isinstance(value, Mapping):
            if not _is_number(value):
                faults.append(f"[parameters] {name} must be a finite number, not {value!r}")
            continue
        unknown = [key for key in value if key not in checked.names]
        missing = [key for key in checked.names if key not in value]
        known = ", ".join(repr(key) for key in checked.names)
        if unknown:
            faults.append(f"[parameters] {name}: unknown species {', '.join(map(repr, unknown))}; there are {known}")
        if missing:
            faults.append(f"[parameters] {name} has no value for species {', '.join(map(repr, missing))}")
        if not all(_is_number(number) for number in value.values()):
            faults.append(f"[parameters] {name}: all values must be finite numbers")
        if name == "eta":
            faults.append("[parameters] eta is the fluid's, and cannot depend on the species")
        elif name != "E" and name not in scene.mixing:
            faults.append(
                f"[parameters] {name} depends on the species: say how two of them mix, [mixing] {name} = one of "
                f"{', '.join(MIXING)}"
            )
        varying.append(name)
    if "E" in scene.parameters and "E" not in varying and any(wall.rigid for wall in checked.walls):
        varying.append("E")
    for name, rule in scene.mixing.items():
        if rule not in tuple(MIXING):
            faults.append(f"[mixing] {name}: unknown rule {rule!r}{suggestion(rule, tuple(MIXING))}")
        if name in ("R", "E", "eta"):
            faults.append(f"[mixing] {name} is mixed as the physics of two elastic half-spaces asks: leave it out")
        elif not isinstance(scene.parameters.get(name), Mapping):
            faults.append(f"[mixing] {name} does not depend on the species")
    if faults:
        raise SceneError(_listed(faults))
    return tuple(varying)


def uniform_values(scene: ParticleScene, checked: Checked, kernel: ContactKernel) -> Array:
    """Values of the uniform parameters, in the kernel's order; checks those that vary, too.

    Raises
    ------
    SceneError
        Listing missing, unknown, non-positive and out-of-range parameters.
    """
    names = (*kernel.uniform, *kernel.varying)
    given = {"R": float(checked.radii[0]), **scene.parameters}
    faults = [
        f"[parameters] {name!r} is not a parameter of the law{suggestion(name, [n for n in names if n != 'R'])}"
        for name in given
        if name not in names and name != "R" and not (name == "eta" and scene.drag)
    ]
    for name in names:
        if name == "size_ratio":
            continue
        if name not in given:
            faults.append(f"[parameters] {name} is missing")
            continue
        value = given[name]
        for number in value.values() if isinstance(value, Mapping) else [value]:
            if name in kernel.ranges and (fault := range_fault(name, number, kernel.ranges[name])):
                faults.append(fault)
            elif name in kernel.positive and not number > 0:
                faults.append(f"[parameters] {name} must be positive, not {number!r}")
    eta = given.get("eta")
    if scene.drag and (isinstance(eta, Mapping) or not _is_number(eta) or not float(eta or 0) > 0):
        faults.append("[parameters] eta is missing, and the drag on a particle is 6 pi eta R")
    if faults:
        raise SceneError(_listed(faults))
    return np.array([float(given[name]) for name in kernel.uniform])  # type: ignore[arg-type]
