"""Runs LAMMPS, and reads back what it wrote, as a result like any other."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn import cache
from softdyn.errors import IntegrationError, SceneError
from softdyn.lammps.carried import EXPLICIT_NS, SHARE, Prepared, crossover_words, prepared
from softdyn.lammps.inputs import home_cells, leans, plugin, run_times, segments, write_inputs
from softdyn.particles.geometry import Contacts, bare_contacts, lattice, rotations
from softdyn.particles.parameters import mixed_parameters
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.results import Frame, ParticleResult, frame_of, gather
from softdyn.particles.state import State, overlaps
from softdyn.particles.system import System
from softdyn.targets import lammps

Array = NDArray[np.float64]

#: Numbers before the particles of a frame, of each particle, and of each contact, as the template's Frames has them.
HEAD, OF_PARTICLE, OF_CONTACT = 16, 10, 10
#: Energies of a frame, as the template counts them.
ENERGIES = ("flow", "external", "drag", "gaps", "remote", "elastic", "sliding", "rolling", "sheared")
#: The name of all files of a run.
NAME = "softdyn"


@dataclass(frozen=True)
class Told:
    """A frame as LAMMPS wrote it.

    Attributes
    ----------
    step : int
    limit : float
        Longest time step that was stable, in the part of the run that ended there.
    cpu_s, kernel_s, solved : float
        Processor time so far, of it in the kernel, and contacts that it solved.
    energy : dict
        Energies exchanged since the start.
    particles : array, shape (N, 10)
        Number, position in the box of LAMMPS without wrapping, velocity apart from the flow, angular velocity.
    contacts : array, shape (contacts, 10)
        Numbers of both, gap, power that is lost, vector from one centre to the other, tangential force.
    """

    step: int
    limit: float
    cpu_s: float
    kernel_s: float
    solved: float
    energy: dict[str, float]
    particles: Array
    contacts: Array


def simulate_in_lammps(
    scene: ParticleScene,
    ranks: int = 1,
    dt: float | None = None,
    folder: Path | None = None,
    told: Callable[[str], None] | None = None,
) -> ParticleResult:
    """Integrate a scene by LAMMPS.

    Parameters
    ----------
    scene : ParticleScene
    ranks : int
        Processes, over which the particles are distributed.
    dt : float, optional
        Longest time step; without it a quarter of the longest that is stable at the start. Errors of positions and gaps
        are of the first order in it.
    folder : Path, optional
        Where the files of LAMMPS are, and stay; without it they are temporary.
    told : function of str, optional
        Called before the run with its number of steps, and with what they cost next to implicit ones.

    Returns
    -------
    ParticleResult
        Its ``target`` is "lammps"; ``contact_dissipation`` is the power that is lost in each contact.

    Raises
    ------
    SceneError
        If LAMMPS cannot run the scene, or is not installed.
    CompileError
    IntegrationError
        If LAMMPS ends before the end, with its words. ``partial`` is the result up to the last frame.
    """
    began = time.perf_counter()
    if ranks < 1:
        raise SceneError(f"--ranks {ranks}: at least one process is needed")
    if dt is not None and not 0 < dt < np.inf:
        raise SceneError(f"--dt {dt:g}: a time step is positive")
    lammps.installed()
    ready = prepared(scene)
    chosen = dt if dt is not None else SHARE * ready.limit
    if not np.isfinite(chosen):
        chosen = float(run_times(ready.system)[-1]) / 1000
    steps = sum(count for count, _ in segments(run_times(ready.system), chosen))
    if told is not None:
        told(f"{steps} steps, {crossover_words(ready, chosen, ranks=ranks)}")
    manifest = plugin(ready.system)
    library = built(manifest)
    compile_s = time.perf_counter() - began
    with tempfile.TemporaryDirectory(prefix="softdyn-") as scratch:
        place = Path(scratch) if folder is None else folder
        for old in place.glob(f"{NAME}.frames.*"):
            old.unlink()
        write_inputs(ready, manifest, chosen, place, NAME)
        shutil.copyfile(library, place / f"{NAME}.so")
        ran = time.perf_counter()
        words = run_lammps(place, f"{NAME}.in", ranks)
        wall = time.perf_counter() - ran
        frames = read_frames(place, len(ready.system.x))
    result, fault = _result(ready, frames, chosen, ranks, wall, compile_s)
    if words or fault is not None:
        error = fault or IntegrationError(f"LAMMPS has stopped: {words}")
        error.partial = result if len(result) else None
        raise error
    return result


def built(manifest: Mapping[str, Any]) -> Path:
    """The compiled plugin, from the cache or made now.

    Raises
    ------
    CompileError, SceneError
    """
    name, made_by = manifest["name"], lammps.identity()
    key = cache.key_of(manifest["source"], made_by)
    entry = cache.read("lammps", key)
    if entry is None:
        files = lammps.build(name, manifest["source"], made_by)
        entry = cache.publish("lammps", key, files, {"made_by": made_by})
    return entry / f"{name}.so"


def run_lammps(folder: Path, script: str, ranks: int = 1) -> str:
    """Run a script in its folder; returns what LAMMPS says of why it has stopped, empty if it has not.

    Parameters
    ----------
    folder : Path
    script : str
        Name of the file.
    ranks : int
        Processes, over which the particles are distributed.

    Raises
    ------
    SceneError
        If the program cannot be started, or several processes cannot.
    """
    found = lammps.installed()
    if ranks > 1 and found.starter is None:
        raise SceneError(f"nothing that starts {ranks} processes, mpiexec, is installed: {lammps.INSTALL}")
    start = [str(found.starter), "-n", str(ranks)] if ranks > 1 else []
    command = [*start, str(found.program), "-in", script, "-log", "log.lammps", "-screen", "none"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    if found.libraries is not None:
        others = environment.get("LD_LIBRARY_PATH")
        environment["LD_LIBRARY_PATH"] = f"{found.libraries}{os.pathsep + others if others else ''}"
    try:
        code, said_out = _until_its_end(command, folder, environment)
    except OSError as error:
        raise SceneError(f"cannot start LAMMPS: {' '.join(command)}: {error}") from None
    if code == 0:
        return ""
    log = ""
    with suppress(OSError):
        log = (folder / "log.lammps").read_text(encoding="utf-8", errors="replace")
    said = re.search(r"^ERROR(?: on proc \d+)?: (.*?)(?: \(\S*?:\d+\))?$", f"{log}\n{said_out}", re.M)
    if said:
        return said[1]
    return " ".join(said_out.strip().splitlines()[-3:]) or f"it exited with {code}"


def _until_its_end(command: list[str], folder: Path, environment: Mapping[str, str]) -> tuple[int, str]:
    """Exit status of a program, and what it says; if this process is stopped meanwhile, all of its processes are."""
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as running:
        try:
            said, _ = running.communicate()
        except BaseException:
            running.terminate()  # mpiexec ends those that it has started
            with suppress(subprocess.TimeoutExpired):
                running.wait(10)
            raise
    return running.returncode, said.decode(errors="replace")


def read_frames(folder: Path, count: int, name: str = NAME) -> list[Told]:
    """Read the frames that all processes wrote, up to the first that is not whole.

    Parameters
    ----------
    folder : Path
    count : int
        Number of all particles: a frame with fewer is not whole.
    name : str
        What the names of files begin with.
    """
    parts = [_read_part(path) for path in sorted(folder.glob(f"{name}.frames.*"))]
    frames = []
    for those in zip(*parts, strict=False):
        heads = np.array([head for head, _, _ in those])
        particles = np.concatenate([rows for _, rows, _ in those])
        contacts = np.concatenate([rows for _, _, rows in those])
        if len(particles) != count:
            break
        energy = dict(zip(ENERGIES, heads[:, 6 : 6 + len(ENERGIES)].sum(axis=0).tolist(), strict=True))
        stiffest = float(heads[:, 3].max())
        cpu, kernel, solved = (float(heads[:, column].sum()) for column in (15, 4, 5))
        limit = 1 / stiffest if stiffest > 0 else np.inf
        particles = particles[np.argsort(particles[:, 0])]
        frames.append(Told(int(heads[0, 0]), limit, cpu, kernel, solved, energy, particles, contacts))
    return frames


def _read_part(path: Path) -> list[tuple[Array, Array, Array]]:
    numbers = np.fromfile(path)
    found, at = [], 0
    while at + HEAD <= len(numbers):
        head = numbers[at : at + HEAD]
        middle = at + HEAD + OF_PARTICLE * int(head[1])
        end = middle + OF_CONTACT * int(head[2])
        if end > len(numbers):
            break
        particles, contacts = numbers[at + HEAD : middle], numbers[middle:end]
        found.append((head, particles.reshape(-1, OF_PARTICLE), contacts.reshape(-1, OF_CONTACT)))
        at = end
    return found


def _contacts(system: System, told: Told, x: Array, cell: Array) -> tuple[Contacts, Array]:
    """Contacts of a frame, in softdyn's order, and the power that is lost in each."""
    d, rows = system.dimension, told.contacts
    first, second = rows[:, 0].astype(np.int64) - 1, rows[:, 1].astype(np.int64) - 1
    sign = np.where(first < second, 1.0, -1.0)
    i, j = np.minimum(first, second), np.maximum(first, second)
    line, T = sign[:, None] * rows[:, 4 : 4 + d], sign[:, None] * rows[:, 7 : 7 + d]
    full = cell + np.diag(np.where(system.box.periodic, 0.0, 1.0))
    shift = np.rint(np.linalg.solve(full, (line - (x[j] - x[i])).T).T).astype(np.int64)
    order = np.lexsort((*shift.T, j, i))
    i, j, shift = i[order].astype(np.int32), j[order].astype(np.int32), shift[order]
    contacts = bare_contacts(i, j, shift, system.radii)
    contacts.q = mixed_parameters(system, system.kernel, i, j)
    contacts.h, contacts.touched = rows[order, 2].copy(), np.ones(len(i), bool)
    contacts.T = T[order] if system.width > d else np.zeros((len(i), 0))
    return contacts, rows[order, 3]


def _frame(ready: Prepared, told: Told, t: float, home: NDArray[np.int64]) -> tuple[Frame, Array, dict[str, float]]:
    """A frame as softdyn has it; the power lost in each contact; and the energies."""
    system, d = ready.system, ready.system.dimension
    cell = lattice(system.box, t)
    x = told.particles[:, 1 : 1 + d] + home @ cell.T
    v = told.particles[:, 4 : 4 + d].copy()
    if d > 1:
        v[:, 0] += system.box.shear_rate * x[:, 1]
    contacts, lost = _contacts(system, told, x, cell)
    if system.width > d:
        spin = told.particles[:, 10 - rotations(d) : 10] * system.radii[:, None]
        v = np.concatenate([v, spin], axis=1)
    if system.fixed.any():  # LAMMPS has means over steps
        v = np.where(system.fixed, system.velocity(t), v)
    state = replace(ready.state, t=t, x=x, contacts=contacts)
    overlap = overlaps(system, state)
    at: Any = SimpleNamespace(h=contacts.h, r=contacts.S - overlap)
    for mechanism in system.having["require"]:
        mechanism.require(system, state, at, t)
    energy = _energies(ready, told, state)
    exchanged = np.array([*(energy[name] for name in system.works), energy["stored"]])
    return frame_of(system, t, x, v, contacts, exchanged), lost, energy


def _stored(system: System, state: State) -> tuple[float, float]:
    """Energy that is stored by films, and by what shears them."""
    each = [(one, one.stored(system, state.contacts, overlaps(system, state))) for one in system.having["stored"]]
    films = sum(energy for one, energy in each if "gaps" in one.takes)
    return films, sum(energy for _, energy in each) - films


def _energies(ready: Prepared, told: Told, state: State) -> dict[str, float]:
    """Energies exchanged so far, by softdyn's names.

    What flow and box give is told as one, and what all loads do. Of the power into elastic deflection, what is not
    stored is what a law takes whose stiffness changes with the gap, U_h and k_t.
    """
    system, given = ready.system, told.energy
    now, first = _stored(system, state), _stored(system, ready.state)
    films, sheared = now[0] - first[0], now[1] - first[1]
    energy = dict.fromkeys(system.works, 0.0)
    flowing = "box" if "box" in energy and leans(system) else "flow"
    loaded = "external" if "external" in energy else "gravity"
    found = {name: given[name] for name in ("drag", "gaps", "remote", "sliding", "rolling")}
    found |= {flowing: given["flow"], loaded: given["external"], "U_h": given["elastic"] - films}
    found |= {"k_t": given["sheared"] - given["sliding"] - sheared}
    return {**energy, **{name: value for name, value in found.items() if name in energy}, "stored": films + sheared}


def _result(
    ready: Prepared, told: list[Told], dt: float, ranks: int, wall_s: float, compile_s: float
) -> tuple[ParticleResult, IntegrationError | None]:
    """Result of a run, up to the first frame at which no law holds; and what is wrong with that."""
    system = ready.system
    times, home = run_times(system), home_cells(system)[1]
    steps = segments(times, dt)
    frames, lost, energies = [], [], []
    fault: IntegrationError | None = None
    for t, one in zip(times.tolist(), told, strict=False):
        try:
            frame, power, energy = _frame(ready, one, t, home)
        except IntegrationError as error:
            fault = error
            break
        energies.append(energy)
        if t in system.times:
            frames.append(frame)
            lost.append(power)
    last = energies[-1] if energies else dict.fromkeys((*system.works, "stored"), 0.0)
    put_in = system.given
    given = sum(last[name] for name in put_in)
    taken = sum(value for name, value in last.items() if name not in put_in)
    size = sum(abs(value) for value in last.values())
    done = told[-1] if told else None
    contact_steps = told[-1].solved - told[0].solved if told else 0.0
    cpu = told[-1].cpu_s - told[0].cpu_s if told else 0.0
    ns = 1e9 * cpu / contact_steps if contact_steps else EXPLICIT_NS
    stats = {
        "method": f"explicit steps of LAMMPS {lammps.installed().number} on {ranks} process{'es' if ranks > 1 else ''}",
        "steps": done.step if done else 0,
        "dt": max((length for count, length in steps if count), default=dt),
        "explicit_limit": min((one.limit for one in told), default=ready.limit),
        "contact_steps": contact_steps,
        "cpu_s": cpu,
        "kernel_s": done.kernel_s if done else 0.0,
        "crossover": crossover_words(ready, dt, ns, ranks),
        "wall_s": wall_s,
        "compile_s": compile_s,
        "ranks": ranks,
        "given": list(put_in),
        "pulled": [],
        "warnings": [],
    }
    energy = {**last, "imbalance": (given - taken) / size if size else 0.0}
    result = gather(system, frames, [], energy, stats)
    arrays = {**result.arrays, "contact_dissipation": np.concatenate([np.empty(0), *lost])}
    return replace(result, target="lammps", arrays=arrays), fault
