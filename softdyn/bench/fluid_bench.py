"""``softdyn bench fluid``: what a step of a flow costs, beside MigFlow 1.4 and scikit-fem where these are installed.

One step of a lid-driven cavity from rest, by implicit Euler, linearised once, as MigFlow steps: the matrix is
assembled, factorised, and solved with. And the mean of some steps of a run from there: MigFlow linearises each once,
softdyn solves each to its residual, with factors that serve several of them. All take the same mesh and the same order
of elements. Each measurement is a process of its own, so that its memory is its own; times are CPU times, of all
threads, medians of several runs.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.bench.record import told
from softdyn.peak_memory import peak_memory

Array = NDArray[np.float64]
#: Squares along each side of the cavity, of two triangles each.
CELLS = (32, 70, 128, 224)
ELEMENTS = ("P1-P1", "P2-P1")
RUNS = 3
#: Of a run.
STEPS = 20
DENSITY, VISCOSITY, DT = 1.0, 1e-3, 0.01
WALLS = ("left", "right", "bottom", "top")

Figures = dict[str, float]


def bench_fluid(folder: Path) -> int:
    """Measure, and tell one line for each figure; see :func:`softdyn.bench.record.told`.

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    """
    with told(folder, "fluid") as tell:
        peers = {name: made for name, (package, made) in PEERS.items() if find_spec(package)}
        missing = [name for name in PEERS if name not in peers]
        if missing:
            tell(f"not installed, and so not measured: {', '.join(missing)}; pip install 'softdyn[bench-fluid]'")
        for elements in ELEMENTS:
            for cells in CELLS:
                ours = measured(time_ours, cells, elements)
                tell(
                    f"{elements}, {2 * cells**2} triangles, {ours['unknowns']:.0f} unknowns: "
                    f"{_words(ours)}; residual {ours['residual']:.0e} of the linear system"
                )
                for name, made in peers.items():
                    theirs = measured(made, cells, elements)
                    ratios = [
                        f"{key} {ours[key] / theirs[key]:.2g}"
                        for key in ("assembly", "step", "of a run", "memory")
                        if theirs.get(key, 0) > 0
                    ]
                    tell(f"    {name}: {_words(theirs)}; ours over theirs: {', '.join(ratios)}")
    return 0


def _words(figures: Figures) -> str:
    words = [f"{key} {1e3 * figures[key]:.3g} ms" for key in ("assembly", "step", "of a run") if key in figures]
    return ", ".join([*words, *([f"memory {figures['memory'] / 1e6:.0f} MB"] if "memory" in figures else [])])


def measured(work: Callable[[int, str], Figures], cells: int, elements: str) -> Figures:
    """What some work measures, in a process of its own on one thread.

    Parameters
    ----------
    work : function of a number of cells and of elements
    cells : int
        Along each edge of the square, of two triangles each.
    elements : str
        As "P2-P1".
    """
    threads = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    kept = {name: os.environ.get(name) for name in threads}
    os.environ.update(dict.fromkeys(threads, "1"))
    try:
        with get_context("spawn").Pool(1) as pool:
            return pool.apply(work, (cells, elements))
    finally:
        for name, value in kept.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def cavity(cells: int, elements: str) -> Any:
    """The scene."""
    from softdyn.fluid.boundary_keys import Boundary
    from softdyn.fluid.fluid_scene import FluidScene
    from softdyn.fluid.mesh_section import MeshSection

    return FluidScene(
        viscosity=VISCOSITY,
        density=DENSITY,
        elements=elements,
        mesh=MeshSection(box=[1.0, 1.0], cells=[cells, cells]),
        boundary=[Boundary(on=WALLS[:3], velocity=[0, 0]), Boundary(on=WALLS[3], velocity=[1, 0])],
        until_t=DT,
    )


def _peak() -> float:
    return peak_memory()


def median_of(work: Callable[[], Any]) -> tuple[float, Any]:
    """Median CPU time of some work, and what it gives."""
    times, found = [], None
    for _ in range(RUNS):
        began = time.process_time()
        found = work()
        times.append(time.process_time() - began)
    return float(np.median(times)), found


def time_ours(cells: int, elements: str) -> Figures:
    """One step here; memory is what it takes besides all that is imported, and the mesh."""
    from softdyn.fluid.flow_system import prepared
    from softdyn.fluid.linear_solvers import LinearSolver

    system = prepared(cavity(cells, elements))
    unknowns, before = system.unknowns, _peak()
    rest = np.zeros(len(unknowns.kinds))
    x = unknowns.all_of(unknowns.free_of(rest), system.given(DT))
    equations = system.equations(DT, 1 / DT, rest)
    assembly, (residual, matrix) = median_of(lambda: equations.linearised(x))
    solver = LinearSolver(unknowns.free_kinds, starts=unknowns.starts)

    def solved() -> None:
        solver.factorise(unknowns.free_matrix(matrix))
        solver.solve(unknowns.free_of(residual))

    solution, _ = median_of(solved)
    memory = _peak() - before
    return {
        "unknowns": len(rest),
        "assembly": assembly,
        "step": assembly + solution,
        "of a run": _step_of_a_run(system),
        "memory": memory,
        "residual": solver.worst,
    }


def _step_of_a_run(system: Any) -> float:
    """Mean CPU time of the steps from the first one on, which is that of a jump."""
    from softdyn.fluid.linear_solvers import LinearSolver
    from softdyn.fluid.march import FlowState, Stepping, march

    solver = LinearSolver(system.unknowns.free_kinds, starts=system.unknowns.starts)
    state = FlowState(0.0, DT, [0.0], [np.zeros(len(system.unknowns.kinds))])
    until, stepping = (STEPS + 1) * DT, Stepping(order=1, rtol=1.0, dt=DT)
    march(system, solver, state, DT, until, stepping, lambda step: None)
    began = time.process_time()
    march(system, solver, state, until, until, stepping, lambda step: None)
    return (time.process_time() - began) / STEPS


def _mesh(cells: int, elements: str) -> Any:
    from softdyn.fluid.mesh_section import made_mesh

    return made_mesh(cavity(cells, elements).mesh)


def _be_silent() -> None:
    """Let this process print nothing any more, not even at its end: what others print is not of the report."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


def time_migflow(cells: int, elements: str) -> Figures:
    """One step of MigFlow, whose own clock tells the parts; its first, which prepares its solver, does not count."""
    _be_silent()
    from migflow import fluid

    mesh = _mesh(cells, elements)
    flow = fluid.FluidProblem(2, [0.0, 0.0], VISCOSITY, DENSITY, p2p1=elements == "P2-P1")
    points = np.column_stack([mesh.at, np.zeros(len(mesh.at))])
    sides = [(name, np.asarray(mesh.boundaries[name], np.int32)) for name in WALLS]
    before = _peak()
    flow.set_mesh(points, np.asarray(mesh.corners, np.int32), np.ones(len(mesh.corners), np.int32), sides)
    for name in WALLS:
        velocity = [1.0, 0.0] if name == "top" else [0.0, 0.0]
        flow.set_wall_boundary(name, velocity=velocity)
        flow.set_strong_boundary(name, velocity=velocity)
    flow.set_mean_pressure(0)
    flow.implicit_euler(DT)
    steps = [flow.implicit_euler(DT) for _ in range(STEPS)]
    assembly = float(np.median([step["assemble"] for step in steps[:RUNS]]))
    return {
        "assembly": assembly,
        "step": float(np.median([sum(step.values()) for step in steps[:RUNS]])),
        "of a run": float(np.mean([sum(step.values()) for step in steps])),
        "memory": _peak() - before,
    }


def time_scikit_fem(cells: int, elements: str) -> Figures:
    """The matrix of the same linearised equations, without stabilisation, by scikit-fem."""
    import skfem
    from skfem.helpers import ddot, div, dot, grad, mul, sym_grad

    made = _mesh(cells, elements)
    mesh = skfem.MeshTri(made.at.T.copy(), made.corners.T.copy())
    of = {"P2-P1": skfem.ElementTriP2, "P1-P1": skfem.ElementTriP1}[elements]()
    velocity = skfem.Basis(mesh, skfem.ElementVector(of), intorder=2 + 2 * (elements == "P2-P1"))
    pressure = velocity.with_element(skfem.ElementTriP1())

    @skfem.BilinearForm
    def momentum(u: Any, v: Any, w: Any) -> Any:
        carried = dot(mul(grad(u), w.old), v) + dot(mul(grad(w.old), u), v)
        return DENSITY * (dot(u, v) / DT + carried) + 2 * VISCOSITY * ddot(sym_grad(u), sym_grad(v))

    @skfem.BilinearForm
    def volume(u: Any, q: Any, _: Any) -> Any:
        return q * div(u)

    old = np.zeros(velocity.N)

    def assembled() -> Any:
        matrix = momentum.assemble(velocity, old=velocity.interpolate(old))
        return matrix, volume.assemble(velocity, pressure)

    return {"assembly": median_of(assembled)[0]}


#: Package, and what measures it.
PEERS: dict[str, tuple[str, Callable[[int, str], Figures]]] = {
    "MigFlow 1.4": ("migflow", time_migflow),
    "scikit-fem": ("skfem", time_scikit_fem),
}
