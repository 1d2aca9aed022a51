"""``softdyn bench particles``: what many particles cost, measured here and now.

Times are CPU times of this process, medians of several runs; nothing here is a promise about another machine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from softdyn.bench.record import told
from softdyn.particles import linear
from softdyn.particles.contact_kernels import get_contact_kernel
from softdyn.particles.force_balance import Newton, contact_forces
from softdyn.particles.geometry import directions, flow, lattice
from softdyn.particles.integrate import integrate
from softdyn.particles.packing import lattice_packing, random_packing
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import prepare
from softdyn.particles.start import start
from softdyn.particles.step import take_step
from softdyn.particles.system import contact_state
from softdyn.peak_memory import peak_memory

if TYPE_CHECKING:
    from softdyn.derive import ContactLaw

Array = NDArray[np.float64]
#: Tolerance and strain of the implicit run that explicit steps are compared with.
RTOL, STRAIN = 1e-2, 0.01
UNIT = {"E": 1.0, "eta": 1.0}
SPHERES = {**UNIT, "nu": 0.5}


def crystal(cells: int) -> tuple[Array, Array, Array]:
    """Positions, radii and box of a disturbed crystal in three dimensions: six contacts for each particle."""
    x, lengths = lattice_packing("fcc", [cells] * 3, 2.02)
    moved = x + 0.05 * np.random.default_rng(1).uniform(-1, 1, x.shape)
    return np.mod(moved, lengths), np.ones(len(x)), lengths


def plane_crystal(cells: int) -> tuple[Array, Array, Array]:
    """Positions, radii and box of a disturbed crystal in two dimensions."""
    x, lengths = lattice_packing("hexagonal", [cells, cells], 2.02)
    moved = x + 0.05 * np.random.default_rng(1).uniform(-1, 1, x.shape)
    return np.mod(moved, lengths), np.ones(len(x)), lengths


def sheared(packing: tuple[Array, Array, Array], **changes: Any) -> ParticleScene:
    """A sheared periodic packing."""
    x, radii, lengths = packing
    settings: dict[str, Any] = {
        "law": "rognon_gay",
        "parameters": UNIT,
        "positions": x,
        "radii": radii,
        "box": list(lengths),
        "gap": 0.02,
        "range": 0.4,
        "shear_rate": 1e-4,
        "drag": 1.0,
        "until_t": 1000.0,
        "times": 2,
        "rtol": 1e-3,
        **changes,
    }
    return ParticleScene(**settings)


def median_cpu(work: Callable[[], Any], runs: int = 5) -> float:
    """Median CPU time of some work, in seconds."""
    times = []
    for _ in range(runs):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return float(np.median(times))


def sliding_law() -> ContactLaw:
    """``rognon_gay``, which is for normal contacts, with the sliding of rigid spheres and a tangential stiffness."""
    from sympy import Rational, log, pi

    from softdyn.derive import E, R, Tangential, a, eta, h, size_ratio
    from softdyn.derive.laws.rognon_gay import law

    shear = pi * eta * R * log(1 + R / h)
    tangential = Tangential(
        sliding=Rational(4, 5) * (2 - 3 * size_ratio) * shear,
        coupling=Rational(3, 5) * R * shear,
        rolling=Rational(3, 5) * R**2 * shear,
        k_t=E * a,
    )
    return replace(law, tangential=tangential)


def time_kernel(law: Any, target: str, tangential: bool, contacts: int = 200_000) -> float:
    """Nanoseconds for force, implicit gap and consistent tangent of one contact of unequal spheres with a range.

    Gaps over two decades, pressed and pulled, moved by a few tenths of their gap in the step, with a cold guess.

    Parameters
    ----------
    law : str, Path or ContactLaw
    target : "c" or "numba"
    tangential : bool
        Whether contacts have tangential motion.
    contacts : int
        How many are solved at once.
    """
    varying = ("R", "size_ratio") if tangential else ("R",)
    kernel = get_contact_kernel(law, target, varying=varying, fading=True, tangential=tangential)
    draw = np.random.default_rng(0)
    start = 10 ** draw.uniform(-3, -1, contacts)
    deflection = 10 ** draw.uniform(-4, -1, contacts) * draw.choice([1, 1, 1, -0.3], contacts)
    overlap = 2 * deflection - start + 0.3 * draw.uniform(-1, 1, contacts) * start
    values = {**SPHERES, "R": 1.0, "size_ratio": 0.25}
    nothing, p = np.zeros(contacts), np.array([values[name] for name in kernel.uniform])
    q = np.repeat([values[name] for name in kernel.varying], contacts)
    y, gap, F, F_r = (np.empty(contacts) for _ in range(4))
    more = (np.empty(len(kernel.tangential) * contacts),) if tangential else ()

    def work() -> None:
        y[:] = 0.0
        kernel.contacts(contacts, 1.0, 0.5, overlap, start, nothing, p, q, y, gap, F, F_r, *more)

    work()
    return 1e9 * median_cpu(work) / contacts


def time_step(cells: int, **changes: Any) -> dict[str, float]:
    """Seconds of CPU for one implicit step in three dimensions, its length that of the run, and the memory it takes."""
    scene = sheared(crystal(cells), rtol=1e-2, **changes)
    system = prepare(scene)
    newton = Newton()
    state = start(system, newton)
    before = newton.counts["iterations"]
    # the first steps find the length that the tolerance allows
    integrate(replace(system, scene=replace(scene, until_t=200.0)), newton, state)
    dt = state.history[-2][1] if len(state.history) > 1 else state.dt
    steps = len(state.history)
    iterations = (newton.counts["iterations"] - before) / steps

    def work() -> None:
        take_step(system, state.contacts, newton, state.t, state.x, state.v, state.y_rate, dt)

    began = time.perf_counter()
    work()
    wall = time.perf_counter() - began
    seconds = median_cpu(work, 3)
    peak = peak_memory()
    return {
        "particles": len(system.x),
        "contacts": len(state.contacts),
        "seconds": seconds,
        "wall": wall,
        "iterations": iterations,
        "peak": float(peak),
    }


#: Explicit methods: rows of their stages, and weights. The first takes the longest steps that are stable for its work,
#: the second is the usual one of higher order.
EXPLICIT: dict[str, tuple[list[list[float]], list[float]]] = {
    "Euler": ([[]], [1.0]),
    "Runge-Kutta of order 4": ([[], [1 / 2], [0, 1 / 2], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
}


def time_explicit(shear_rate: float) -> dict[str, dict[str, float]]:
    """CPU time and error of implicit steps, and of explicit ones at the largest step that is good enough.

    The contacts are those at the start, without a range, so that both integrate the same equations. Explicit steps are
    shortened by a tenth until they are stable, and positions are as close to those of a run at a tolerance of 1e-6 as
    the implicit run's at :data:`RTOL`.
    """
    until = STRAIN / shear_rate
    packing = random_packing(1000, 2, 0.9, [1.0, 1.4], 1)
    scene = sheared(packing, range=0.5, shear_rate=shear_rate, until_t=until)
    system = prepare(scene)
    system = replace(system, reach=math.inf, kernel=get_contact_kernel("rognon_gay", varying=("R",)))
    first = start(system, Newton())
    within = first.contacts.h < 0.4
    contacts = replace(
        first.contacts,
        **{name: getattr(first.contacts, name)[within] for name in ("i", "j", "shift", "S", "h", "touched", "T")},
        q=np.ascontiguousarray(first.contacts.q[:, within]),
    )
    x0, h0 = first.x.copy(), contacts.h.copy()

    def integrated(rtol: float) -> tuple[Array, float]:
        state = replace(first, x=x0.copy(), contacts=replace(contacts), y_rate=np.zeros(len(h0)), frames=[], history=[])
        state.counts, state.work = dict(first.counts), dict(first.work)
        began = time.process_time()
        integrate(replace(system, rtol=rtol), Newton(), state)
        return state.x, time.process_time() - began

    expected, _ = integrated(1e-6)
    found, _ = integrated(RTOL)
    implicit = float(np.median([integrated(RTOL)[1] for _ in range(5)]))
    allowed = float(np.abs(found - expected).max())

    def rates(t: float, x: Array, h: Array) -> tuple[Array, Array]:
        n, r = directions(contacts, x, lattice(system.box, t), ())
        values = contact_state(system, contacts, contacts.S - r, h)
        forces = contact_forces(contacts, values["F"], n, len(x))
        return flow(system.box, x) - forces / system.resistance, values["dh_dt"]

    def error_of(method: str, steps: int) -> tuple[float, float]:
        """Error of an explicit run, inf if it is unstable, and its CPU time."""
        rows, weights = EXPLICIT[method]
        x, h, dt = x0, h0, until / steps
        began = time.process_time()
        with np.errstate(all="ignore"):
            for step in range(steps):
                known: list[tuple[Array, Array]] = []
                for row in rows:
                    moved, opened = x, h
                    for a, (v, g) in zip(row, known, strict=True):
                        if a:
                            moved, opened = moved + a * dt * v, opened + a * dt * g
                    known.append(rates(dt * (step + sum(row)), moved, opened))
                before = x
                for b, (v, g) in zip(weights, known, strict=True):
                    x, h = x + b * dt * v, h + b * dt * g
                # no step of a stable run moves a particle by half of a radius
                if not np.abs(x - before).max() < 0.5:
                    return math.inf, 0.0
        return float(np.abs(x - expected).max()), time.process_time() - began

    runs = {"implicit": {"seconds": implicit, "error": allowed}}
    for method in EXPLICIT:
        dt, error, seconds = min(256.0, until), math.inf, 0.0
        while not error <= allowed:  # nan, too, is none to stop at
            dt *= 0.9
            error, seconds = error_of(method, math.ceil(until / dt))
        runs[method] = {"seconds": seconds, "error": error, "dt": dt}
    return runs


def newton_matrix(packing: tuple[Array, Array, Array]) -> bsr_array:
    """Newton's matrix of a sheared packing, at a step as long as the tolerance allows."""
    scene = sheared(packing, rtol=1e-2, until_t=100.0)
    kept: list[bsr_array] = []
    prepared = linear.prepare

    def keep(solver: linear.Solver, matrix: bsr_array) -> None:
        kept[:] = [matrix]
        prepared(solver, matrix)

    linear.prepare = keep
    try:
        system = prepare(scene)
        newton = Newton()
        integrate(system, newton, start(system, newton))
    finally:
        linear.prepare = prepared
    return kept[0]


def time_solvers(matrix: bsr_array, d: int) -> dict[str, float]:
    """Seconds of CPU to prepare a solver and to solve with it once, for each solver; pyamg's where it is installed."""
    b = np.random.default_rng(0).standard_normal(matrix.shape[0])
    solvers: dict[str, Callable[[], Any]] = {
        "sparse LDL^T": lambda: linear.direct(matrix, d).solve(b),
        "conjugate gradients": lambda: linear.conjugate_gradients(
            matrix, linear.block_diagonal(matrix, d), b, d, linear.TOLERANCE, linear.MOST_ITERATIONS
        ),
    }
    try:
        import pyamg
    except ImportError:
        pass
    else:
        rows = matrix.tocsr()
        solvers["the same with pyamg"] = lambda: pyamg.smoothed_aggregation_solver(
            rows, B=np.tile(np.eye(d), (rows.shape[0] // d, 1))
        ).solve(b, tol=linear.TOLERANCE, accel="cg")
    return {name: median_cpu(solve, 3) for name, solve in solvers.items()}


def bench_particles(folder: Path) -> int:
    """Measure, and tell one line for each figure; see :func:`softdyn.bench.record.told`.

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    """
    with told(folder, "particles") as tell:
        _measure(tell)
    return 0


def _measure(tell: Callable[[str], None]) -> None:
    rows = []  # first, since the memory that compilers take would hide theirs
    for cells in (6, 14, 29):
        row = time_step(cells)
        rows.append(row)
        tell(
            f"implicit step, {row['particles']:.0f} spheres in 3D, {row['contacts']:.0f} contacts: "
            f"{row['seconds']:.3g} s of CPU in {row['wall']:.3g} s, {row['iterations']:.0f} Newton iterations; at most "
            f"{row['peak'] / 1e6:.0f} MB"
        )
    growth = np.log(rows[-1]["seconds"] / rows[0]["seconds"]) / np.log(rows[-1]["particles"] / rows[0]["particles"])
    memory = (rows[-1]["peak"] - rows[0]["peak"]) / (rows[-1]["contacts"] - rows[0]["contacts"])
    tell(f"cost of a step grows as N^{growth:.2f}; {memory:.0f} bytes per contact at the peak")
    for tangential in (False, True):
        row = time_step(14, law="equal_spheres", parameters=SPHERES, tangential=tangential)
        tell(
            f"implicit step of equal_spheres, {'normal and tangential' if tangential else 'normal'}, "
            f"{row['particles']:.0f} spheres, {row['contacts']:.0f} contacts: {row['seconds']:.3g} s"
        )
    for law, said in ((sliding_law(), ""), ("equal_spheres", ", of a law whose friction holds a logarithm")):
        for target in ("c", "numba"):
            normal, both = (time_kernel(law, target, tangential) for tangential in (False, True))
            tell(
                f"contact kernel{said}, target {target}: {normal:.1f} ns per contact, {both:.1f} with tangential motion"
            )
    for d, cells in ((2, 20), (2, 60), (2, 150), (3, 6), (3, 10)):
        matrix = newton_matrix(crystal(cells) if d == 3 else plane_crystal(cells))
        seconds = ", ".join(f"{name} {value:.3g} s" for name, value in time_solvers(matrix, d).items())
        tell(f"linear system, {d}D, {matrix.shape[0]} unknowns: {seconds}")
    for rate in (1e-4, 1e-6, 1e-8):
        runs = time_explicit(rate)
        ours = runs.pop("implicit")
        tell(
            f"1000 droplets sheared at {rate:g} E/eta by {STRAIN:g}: implicit {ours['seconds']:.3g} s, error "
            f"{ours['error']:.1e}; "
            + "; ".join(
                f"{name} {run['seconds'] / ours['seconds']:.3g} times as much, error {run['error']:.1e}, at steps of "
                f"{run['dt']:.3g} eta/E"
                for name, run in runs.items()
            )
        )
