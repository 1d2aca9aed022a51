"""What LAMMPS reads: the plugin's source and its build line, the data file, gaps, loads, and the input script."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.derive.contact_equations import undragged
from softdyn.kernels import manifest_of
from softdyn.lammps.carried import Prepared, explicit_needs
from softdyn.laws import find
from softdyn.particles.contact_kernels import contact_manifest
from softdyn.particles.geometry import rotations
from softdyn.particles.parameters import mixed_parameters
from softdyn.particles.system import System
from softdyn.results.whole_files import written_whole
from softdyn.targets import lammps

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Thickness of the skin of neighbour lists, in radii of the smallest particle; how far beyond the list particles are
#: known, in radii of the largest: centres of pulled surfaces are that far apart.
SKIN, BULGE = 0.3, 0.5
#: So many particles are few.
FEW = 100
#: Types of particles, by species and radius; of more radii, those of a species are one type.
MOST_TYPES = 16


def plugin(system: System) -> dict[str, Any]:
    """Source of a plugin, and what must be known of it: a manifest, see :mod:`softdyn.kernels`."""
    return manifest_of(find(system.scene.law), "lammps", explicit_needs(system), "contacts", contact_manifest)


def types_of(system: System) -> Integers:
    """Type of each particle, from 1 on."""
    both = np.column_stack([system.species.astype(float), system.radii])
    kinds, types = np.unique(both, axis=0, return_inverse=True)
    if len(kinds) > MOST_TYPES:
        _, types = np.unique(system.species, return_inverse=True)
    return np.asarray(types).reshape(-1) + 1


def home_cells(system: System) -> tuple[Array, Integers, float]:
    """Positions in the box of LAMMPS, which leans by half its length at most; lattice vectors that were taken off.

    Returns
    -------
    x : array, shape (N, d)
    home : array of int, shape (N, d)
        In vectors of the box as softdyn has it, which leans on and on.
    tilt : float
    """
    d, periodic, cell = system.dimension, system.box.periodic, system.box.cell
    turns = round(cell[0, 1] / cell[0, 0]) if d > 1 and periodic[:2].all() and cell[0, 1] else 0
    reduced = cell.copy()
    if turns:
        reduced[0, 1] -= turns * cell[0, 0]
    full = reduced + np.diag(np.where(periodic, 0.0, 1.0))
    home = np.floor(np.linalg.solve(full, system.x.T).T).astype(np.int64)
    home[:, ~periodic] = 0
    x = system.x - home @ reduced.T
    if turns:
        home[:, 0] -= turns * home[:, 1]
    return x, home, float(reduced[0, 1]) if d > 1 else 0.0


def leans(system: System) -> bool:
    """Whether the box of LAMMPS is to lean, now or ever."""
    sheared = bool(system.scene.shear_rate) and bool(system.box.periodic[1])
    return sheared or bool(system.box.tilt)


def data_text(system: System) -> str:
    """The data file: the box and the particles."""
    (x, _, tilt), types, d = home_cells(system), types_of(system), system.dimension
    place = np.zeros((len(x), 3))
    place[:, :d] = x
    largest = float(system.radii.max())
    low, high = place.min(axis=0) - largest, place.max(axis=0) + largest
    low[:d][system.box.periodic], high[:d][system.box.periodic] = 0.0, system.box.lengths[system.box.periodic]
    if d == 2:
        low[2], high[2] = -largest, largest
    lines = ["written by softdyn", "", f"{len(x)} atoms", f"{int(types.max())} atom types", ""]
    lines += [
        f"{a:.17g} {b:.17g} {axis}lo {axis}hi" for axis, a, b in zip("xyz", low.tolist(), high.tolist(), strict=True)
    ]
    lines += [f"{tilt:.17g} 0 0 xy xz yz"] if leans(system) else []
    lines += ["", "Atoms # sphere", ""]
    rows = zip(types.tolist(), (2 * system.radii).tolist(), place.tolist(), strict=True)
    lines += [
        f"{n} {kind} {size:.17g} 1 {a:.17g} {b:.17g} {c:.17g}" for n, (kind, size, (a, b, c)) in enumerate(rows, 1)
    ]
    return "\n".join(lines) + "\n"


def contacts_text(ready: Prepared) -> str:
    """Gaps at the start, and tangential forces, of the contacts within range."""
    contacts, d = ready.state.contacts, ready.system.dimension
    near = contacts.h < ready.system.reach
    rows = np.column_stack([contacts.i[near] + 1, contacts.j[near] + 1]).tolist()
    T = np.zeros((int(near.sum()), 3))
    T[:, : min(d, contacts.T.shape[1])] = contacts.T[near]
    tangential = ready.system.kernel.tangential
    values = np.column_stack([contacts.h[near], *(T.T if tangential else ())]).tolist()
    return "".join(
        f"{i} {j} {' '.join(f'{one:.17g}' for one in numbers)}\n" for (i, j), numbers in zip(rows, values, strict=True)
    )


def loads_text(ready: Prepared) -> str:
    """External forces and torques of the particles that have any; empty without."""
    system, d = ready.system, ready.system.dimension
    six = np.zeros((len(ready.loads), 6))
    six[:, :d] = ready.loads[:, :d]
    if ready.loads.shape[1] > d:
        torques = ready.loads[:, d:] * system.radii[:, None]
        six[:, 6 - torques.shape[1] :] = torques
    some = np.flatnonzero(six.any(axis=1))
    return "".join(f"{n + 1} {' '.join(f'{one:.17g}' for one in six[n].tolist())}\n" for n in some.tolist())


def holds_text(system: System) -> str:
    """Particles that are held: along which axes, whether they turn as given; velocities that do not change."""
    d, given = system.dimension, system.velocity.unchanging()
    some = np.flatnonzero(system.fixed.any(axis=1))
    rows = np.zeros((len(some), 10))
    rows[:, :d], rows[:, 4 : 4 + d] = system.fixed[some, :d], given[some, :d]
    if system.width > d:
        rows[:, 3] = system.fixed[some, d]
        rows[:, 10 - rotations(d) :] = given[some, d:] / system.radii[some, None]
    flags, rates = rows[:, :4].astype(int).tolist(), rows[:, 4:].tolist()
    return "".join(
        f"{n + 1} {' '.join(map(str, flag))} {' '.join(f'{one:.17g}' for one in rate)}\n"
        for n, flag, rate in zip(some.tolist(), flags, rates, strict=True)
    )


def drives_texts(system: System, dt: float) -> tuple[str, str]:
    """What changes with time: whose it is, and its mean over each step, a line each; empty where nothing does.

    Of means no pulse is missed, however short, and a velocity leads to where it is to lead. The line behind the last
    step has the values at the end.
    """
    d = system.dimension
    # force, torque, velocity, angular velocity: of two dimensions the last is about z
    turns = 6 - rotations(d) - d
    every = [(0, term) for term in system.force.changing()] + [(6, term) for term in system.velocity.changing()]
    if not every:
        return "", ""
    lines = []
    for column, (first, (those, axis, _)) in enumerate(every):
        lines += [f"{n + 1} {first + axis + (turns if axis >= d else 0)} {column}" for n in those.tolist()]
    times = step_times(run_times(system), dt)
    means = []
    for _, (_, _, function) in every:
        whole = np.array([function.integral(t) for t in times.tolist()])
        means.append(np.append(np.diff(whole) / np.diff(times), function(float(times[-1]))))
    rows = np.column_stack(means).tolist()
    return "\n".join(lines) + "\n", "".join(f"{' '.join(f'{one:.17g}' for one in row)}\n" for row in rows)


def coefficients(system: System, varying: Sequence[str]) -> list[str]:
    """Lines of pair_coeff: what depends on the types of both, mixed as in every contact."""
    names = [name for name in varying if name not in ("R", "size_ratio")]
    if not names:
        return ["pair_coeff * *"]
    types = types_of(system)
    first = [int(np.flatnonzero(types == kind)[0]) for kind in range(1, int(types.max()) + 1)]
    lines = []
    for a, i in enumerate(first):
        for b, j in enumerate(first[a:], a):
            asked: Any = SimpleNamespace(varying=names)
            values = mixed_parameters(system, asked, np.array([i]), np.array([j]))[:, 0].tolist()
            told = " ".join(f"{name} {value:.17g}" for name, value in zip(names, values, strict=True))
            lines.append(f"pair_coeff {a + 1} {b + 1} {told}")
    return lines


def uniform(system: System, names: Sequence[str]) -> dict[str, float]:
    """Values of the parameters that all contacts share, by the plugin's names."""
    scene = system.scene
    given: Mapping[str, Any] = {**scene.parameters, undragged.name: max(0.0, 1 - float(scene.drag))}
    return {name: float(given[name]) for name in names}


def segments(times: Array, dt: float) -> list[tuple[int, float]]:
    """Steps, and their length, from each time to the next, the first from 0: no step is longer than dt."""
    found = []
    for before, after in zip([0.0, *times[:-1].tolist()], times.tolist(), strict=True):
        steps = math.ceil((after - before) / dt * (1 - 1e-12)) if after > before else 0
        found.append((steps, (after - before) / steps if steps else dt))
    return found


def step_times(times: Array, dt: float) -> Array:
    """Times between which the steps are, the start and the end with them."""
    starts = [0.0, *times[:-1].tolist()]
    parts = [
        start + length * np.arange(steps) for start, (steps, length) in zip(starts, segments(times, dt), strict=True)
    ]
    return np.append(np.concatenate(parts), times[-1])


def run_times(system: System) -> Array:
    """Output times, the start before them and the end after them."""
    end = float(system.scene.until_t or 0.0)
    times = np.unique(np.concatenate([[0.0], system.times]))
    return np.append(times, end) if times[-1] < end else times


def neighbours(system: System) -> str:
    """How neighbours are looked for: few in pairs, whatever their box; different sizes apart from one another."""
    if len(system.x) <= FEW:
        return "nsq"
    return "multi" if system.radii.max() > 2 * system.radii.min() else "bin"


def input_text(ready: Prepared, manifest: Mapping[str, Any], dt: float, name: str, given: Sequence[str] = ()) -> str:
    """The input script.

    Parameters
    ----------
    ready : Prepared
    manifest : mapping
        Of the plugin.
    dt : float
        Longest time step, in units of the scene.
    name : str
        What the names of files begin with.
    given : sequence of str
        Of loads, holds, drives and signals those of which there is a file.
    """
    system, law = ready.system, manifest["name"]
    scene, d, reach = system.scene, system.dimension, system.reach
    largest, skin = float(system.radii.max()), SKIN * float(system.radii.min())
    ghosts = 2 * largest + reach + skin + BULGE * largest
    periodic = [*system.box.periodic, *([True] * (3 - d))]
    turns = "vel yes " if "keep" in manifest["tangential"] else ""
    many = " ".join(f"{key} {value:.17g}" for key, value in uniform(system, manifest["uniform"]).items())
    rate = float(scene.shear_rate)  # type: ignore[arg-type]
    lines = [
        f"# {law}, written by softdyn; units are those of the scene",
        "units lj",
        f"dimension {d}",
        "newton off",
        "atom_style sphere",
        "atom_modify map yes",
        f"boundary {' '.join('p' if axis else 's' for axis in periodic)}",
        f"comm_modify {turns}cutoff {ghosts:.17g}",
        f"read_data {name}.data",
        f"plugin load ./{name}.so",
        f"pair_style softdyn/{law} reach {reach:.17g} contacts {name}.contacts {many}",
        *coefficients(system, manifest["varying"]),
        f"neighbor {skin:.17g} {neighbours(system)}",
        "neigh_modify every 1 delay 0 check yes",
        f"fix move all softdyn/{law}/move drag {float(scene.drag):.17g}"
        + (f" shear {rate:.17g}" if rate else "")
        + "".join(f" {one} {name}.{one}" for one in given),
        *(["fix plane all enforce2d"] if d == 2 else []),
        f"fix frames all softdyn/{law}/frames {name}.frames",
        "compute stress all pressure NULL virial",
        "thermo_style custom step time c_stress[1] c_stress[2] c_stress[3] c_stress[4] f_frames",
        "thermo_modify norm no flush yes format float %.10g",
        "thermo 1000",
    ]
    for steps, length in segments(run_times(system), dt):
        lines += [f"timestep {length:.17g}", f"run {steps}"]
    return "\n".join(lines) + "\n"


def write_inputs(ready: Prepared, manifest: Mapping[str, Any], dt: float, folder: Path, name: str) -> list[Path]:
    """Write all but the plugin's source and library; returns the files.

    Parameters
    ----------
    ready : Prepared
    manifest : mapping
        Of the plugin.
    dt : float
        Longest time step, in units of the scene.
    folder : Path
    name : str
        What the names of files begin with.

    Raises
    ------
    SceneError
        If one cannot be written.
    """
    drives, signals = drives_texts(ready.system, dt)
    written = {"loads": loads_text(ready), "holds": holds_text(ready.system), "drives": drives, "signals": signals}
    given = {ending: text for ending, text in written.items() if text}
    texts = {
        "data": data_text(ready.system),
        "contacts": contacts_text(ready),
        **given,
        "in": input_text(ready, manifest, dt, name, list(given)),
    }
    return [_written(folder / f"{name}.{ending}", text) for ending, text in texts.items()]


def write_plugin(manifest: Mapping[str, Any], folder: Path, name: str) -> list[Path]:
    """Write the plugin's source, and the line that compiles it.

    Parameters
    ----------
    manifest : mapping
        Of the plugin.
    folder : Path
    name : str
        What the names of files begin with.

    Raises
    ------
    SceneError, CompileError
    """
    source = _written(folder / f"{name}{manifest['suffix']}", manifest["source"])
    command = lammps.command_of(lammps.identity(), source.name, f"{name}.so")
    note = f"# for LAMMPS {lammps.installed().number}; of another one: its number, and its headers"
    text = f'#!/bin/sh\n{note}\ncd "$(dirname "$0")"\n'
    return [source, _written(folder / f"{name}.build.sh", text + shlex.join(command) + "\n")]


def _written(path: Path, text: str) -> Path:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path
