"""Scenes of many particles, checked before anything runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.driven import require_used
from softdyn.particles.earlier_films import film_faults
from softdyn.particles.geometry import Box, Wall, bare_contacts, directions, find_pairs, lattice
from softdyn.particles.loose_particles import is_loose
from softdyn.particles.mechanisms import Mechanism, rooms_of
from softdyn.particles.names import ALL, AXES, SIZES, is_number, listed, which
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.system import ValidatedScene
from softdyn.particles.time_functions import is_driven
from softdyn.particles.until import run_end
from softdyn.scene.keys import key_faults
from softdyn.traits import traits_of

Array = NDArray[np.float64]

#: Lengths of a periodic box that a particle may be away from it.
FARTHEST = 1e6
#: Range of contacts, in largest radii, of a scene with drag that gives none: full up to half of it, where the exact
#: friction of two spheres exceeds their drags by 1.5 %.
FAR = 200.0
#: Range of contacts that end where surfaces part, in smallest radii: gaps below it are 0, and no other number is.
TOUCH = 1e-100
#: Particles up to this many may all be in contact with one another; beyond, contacts need a range.
MOST_WITHOUT_RANGE = 64


def check(scene: ParticleScene) -> ValidatedScene:
    """Refuse what is wrong with a scene whatever its law; as many faults at once as can be told.

    Raises
    ------
    SceneError
        Naming the particles at fault.
    """
    x = _array("positions", scene.positions)
    if x.ndim != 2 or not 1 <= x.shape[1] <= 3 or len(x) < 1:
        raise SceneError(f"[particles] positions must be one at least, of 1 to 3 coordinates, not of shape {x.shape}")
    count, d = x.shape
    if not np.isfinite(x).all():
        raise SceneError(f"[particles] positions of {which(np.asarray(~np.isfinite(x).all(axis=1)))} are not finite")
    radii = _array("radii", scene.radii)
    if radii.ndim == 0:
        radii = np.full(count, float(radii))
    if radii.ndim != 1:
        raise SceneError(f"[particles] radii must be one number, or a list of {count}, not of shape {radii.shape}")
    if radii.shape != (count,):
        raise SceneError(f"[particles] {len(radii)} radii for {count} particles")
    faults = key_faults(scene)
    if faults:
        raise SceneError(listed(faults))
    good = np.isfinite(radii) & (radii > 0)
    if not good.all():
        first = int(np.argmin(good))
        raise SceneError(
            f"[particles] radii must be positive and finite, unlike that of {which(~good)}: {radii[first]:g}"
        )
    faults += _size_faults(scene, x, radii)
    if not is_number(scene.shear_rate) and not is_driven(scene.shear_rate):
        faults.append(
            f"[flow] shear_rate must be a finite number, an expression of t or a table, not {scene.shear_rate!r}"
        )
    if faults:
        raise SceneError(listed(faults))
    end = run_end(scene)
    if not SIZES[0] < end < SIZES[1]:
        raise SceneError(f"the run would end at t={end:g}: choose units in which that lies between 1e-100 and 1e+100")
    scene = replace(scene, until_t=end)
    reach, ends = _reach(scene, radii)
    if is_loose(scene):
        told = {"range": scene.range is not None, "gap": scene.gap is not None, "tangential": scene.tangential}
        faults += [f"[contacts] {name} is of contacts with a law: leave it out" for name in told if told[name]]
    elif scene.gap is not None and scene.gap > reach / 2 and not ends:
        faults.append(
            f"[contacts] gap = {scene.gap:g} must not exceed half of the range, {reach / 2:g}: from there on "
            "contacts fade"
        )
    if scene.law is not None:
        faults += range_faults(scene, radii)
    for name in ("velocities", "spins") if scene.inertia is None else ():
        if getattr(scene, name) is not None:
            faults.append(f"[particles] {name}: without inertia forces make the velocities; give [inertia] density")
    box = _box(scene, radii, d, faults)
    if scene.tilt and not (d > 1 and box.periodic[:2].all()):
        faults.append("[box] tilt: only a box that is periodic along x and y leans")
    elif abs(scene.tilt) > FARTHEST * box.lengths[0]:
        faults.append(
            f"[box] tilt = {scene.tilt:g} is more than {FARTHEST:g} lengths of the box: take whole lengths off"
        )
    names, species = _species(scene, count, faults)
    facts = ValidatedScene(
        scene=scene,
        x=x,
        radii=radii,
        species=species,
        names=names,
        reach=reach,
        rtol=float(scene.rtol),
        times=np.empty(0),
        box=box,
        walls=(),
        mechanisms=(),
    )
    mechanisms = _mechanisms(facts, faults)
    walls = tuple(wall for mechanism in mechanisms for wall in mechanism.walls)
    if scene.films is not None:
        faults += film_faults(scene.films, radii, d, walls)
    if faults:
        raise SceneError(listed(faults))
    faults += _place_faults(x, box, walls) or ([] if is_loose(scene) else _overlap_faults(x, radii, box, walls))
    if faults:
        raise SceneError(listed(faults))
    if scene.constants:
        require_used(scene)
    return replace(facts, walls=walls, mechanisms=mechanisms, times=_times(scene, end))


def range_faults(scene: ParticleScene, radii: Array) -> list[str]:
    """Faults of soft contacts without a range, where they need one."""
    if scene.range is not None or _reach(scene, radii)[1]:
        return []
    if scene.box is not None and any(length is not None for length in scene.box):
        return ["in a periodic box contacts need a range, beyond which there are none: [contacts] range"]
    if len(radii) > MOST_WITHOUT_RANGE:
        return [
            f"{len(radii)} particles need a range of their contacts, beyond which there are none: [contacts] range, "
            f"half of the smallest radius or so ({radii.min() / 2:g})"
        ]
    return []


def _reach(scene: ParticleScene, radii: Array) -> tuple[float, bool]:
    """Range of the contacts, and whether they end there of themselves: dry ones, where surfaces part."""
    traits = None if scene.law is None else traits_of(scene.law)
    if traits is not None and traits.kind == "dry" and not traits.remote:
        return TOUCH * float(radii.min()), True
    if scene.range is not None:
        return float(scene.range), False
    if is_loose(scene):
        return 0.0, True
    return FAR * float(radii.max()) if scene.drag else math.inf, False


def _mechanisms(facts: ValidatedScene, faults: list[str]) -> tuple[Mechanism, ...]:
    """Mechanisms of a scene, as far as they are told without faults."""
    found = []
    for room in rooms_of(facts.scene):
        try:
            found.append(room.check(facts, faults))
        except SceneError as error:
            faults.append(str(error))
    return tuple(mechanism for mechanism in found if mechanism is not None)


def _size_faults(scene: ParticleScene, x: Array, radii: Array) -> list[str]:
    """Numbers whose squares and products would leave the range of double precision."""
    low, high = SIZES
    given: dict[str, Any] = {"[contacts] gap": scene.gap, "[contacts] range": scene.range, "[until] t": scene.until_t}
    given["[until] strain"] = scene.until_strain
    given |= {"[flow] shear_rate": scene.shear_rate, "[flow] drag": scene.drag}
    for name, value in scene.parameters.items():
        values = value if isinstance(value, Mapping) else {"": value}
        given |= {f"[parameters] {name}{f' of {kind}' if kind else ''}": one for kind, one in values.items()}
    numbers = {name: float(value) for name, value in given.items() if is_number(value)}
    found = [f"{name} = {value:g}" for name, value in numbers.items() if value and not low < abs(value) < high]
    far, odd = np.abs(x).max(axis=1) >= high, (radii <= low) | (radii >= high)
    found += [f"[particles] positions of {which(far)}"] if far.any() else []
    found += [f"[particles] radii of {which(odd)}"] if odd.any() else []
    return [f"{one}: choose units in which numbers lie between {low:g} and {high:g}" for one in found]


def _array(name: str, values: Any) -> Array:
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        rows = list(values) if isinstance(values, (list, tuple)) else []
        sizes = [len(row) if isinstance(row, (list, tuple, np.ndarray)) else 1 for row in rows]
        other = next((k for k, size in enumerate(sizes) if size != sizes[0]), None)
        if other is not None:
            raise SceneError(
                f"[particles] {name}: particle {other} has {sizes[other]} numbers, and particle 0 {sizes[0]}"
            ) from None
        raise SceneError(f"[particles] {name} must be numbers, not {str(values)[:80]}") from None
    flat = (
        values
        if not isinstance(values, (list, tuple))
        else [cell for row in values for cell in (row if isinstance(row, (list, tuple)) else (row,))]
    )
    if isinstance(flat, bool) or (isinstance(flat, list) and any(isinstance(cell, (bool, str)) for cell in flat)):
        raise SceneError(f"[particles] {name} must be numbers, not {str(values)[:80]}")
    return array


def _box(scene: ParticleScene, radii: Array, d: int, faults: list[str]) -> Box:
    lengths = np.full(d, math.inf)
    if scene.box is not None:
        given = list(scene.box)
        if len(given) != d:
            faults.append(f"[box] {len(given)} lengths for {d} dimensions")
        else:
            for axis, length in enumerate(given):
                if length is None:
                    continue
                if not is_number(length) or not length > 0:
                    faults.append(f"[box] the length along {AXES[axis]} must be positive, not {length!r}")
                else:
                    lengths[axis] = float(length)
    depth = None if d == 3 else 2 * float(np.mean(radii))
    if scene.depth is not None:
        if d == 3:
            faults.append("[box] depth: spheres in three dimensions are no layer that has a depth; leave it out")
        elif not np.isfinite(lengths).all() and (scene.inertia is None or scene.inertia.shape != "disc"):
            faults.append(
                "[box] depth makes a stress of the forces in a box that is periodic along all axes; elsewhere there is "
                "none, and nothing takes a depth: leave it out, or give all lengths"
            )
        else:
            depth = float(scene.depth)
    return Box(lengths, 0.0, float(scene.tilt), depth=depth)


def _species(scene: ParticleScene, count: int, faults: list[str]) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    none = ("",), np.zeros(count, dtype=np.int64)
    if scene.species is None:
        return none
    given = list(scene.species) if isinstance(scene.species, (list, tuple, np.ndarray)) else []
    if not given or not all(isinstance(name, str) for name in given):
        faults.append(f"[particles] species must be a list of names, one for each particle, not {scene.species!r}")
        return none
    if len(given) != count:
        faults.append(f"[particles] {len(given)} species for {count} particles")
        return none
    if ALL in given:
        faults.append(f"[particles] no species can have the name {ALL!r}: it stands for all particles")
    names = tuple(sorted(set(given)))
    return names, np.array([names.index(name) for name in given], dtype=np.int64)


def _place_faults(x: Array, box: Box, walls: tuple[Wall, ...]) -> list[str]:
    faults = []
    far = np.asarray((box.periodic & (np.abs(x) > FARTHEST * box.lengths)).any(axis=1))
    if far.any():
        faults.append(
            f"{which(far)} more than {FARTHEST:g} lengths outside of the periodic box, where digits are lost: move by "
            "whole lengths"
        )
    for number, wall in enumerate(walls):
        behind = (wall.point - x) @ wall.normal <= 0
        if behind.any():
            faults.append(f"{which(behind)} on the wrong side of wall {number}")
    return faults


def _overlap_faults(x: Array, radii: Array, box: Box, walls: tuple[Wall, ...]) -> list[str]:
    """Pairs that overlap by more than the smaller radius; no run leaves such."""
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


def _times(scene: ParticleScene, end: float) -> Array:
    given = scene.times
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        return np.linspace(0.0, end, int(given))
    try:
        times = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise SceneError("[output] times must be a count or a list of numbers") from None
    good = times.ndim == 1 and len(times) and np.isfinite(times).all() and (np.diff(times) > 0).all()
    if not good or times[0] < 0 or times[-1] > end:
        raise SceneError(f"[output] times must increase, from 0 at least to the end of the run, {end:g}, at most")
    return times
