"""``softdyn bench suspension``: what a step of grains in a fluid costs, beside MigFlow 1.4 where it is installed.

MigFlow's own example "depot": discs on a square lattice below the lid of a box of water begin to sink. Both take the
same mesh, grains, drag and length of step, and their own methods for contacts: explicit sub-steps here, contact
dynamics there. The residual of ours is that of the equations of the flow; MigFlow linearises them once, and tells none.
Each measurement is a process of its own, so that its memory is its own; times are CPU times on one thread, medians of
some steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.bench.fluid_bench import _be_silent, _peak, measured
from softdyn.bench.record import told

if TYPE_CHECKING:
    from pathlib import Path

Array = NDArray[np.float64]
#: Cells along the width of the box, two thirds of those along its height, and discs along its width.
CASES = ((20, 40), (40, 40), (40, 80), (80, 80))
WIDTH, HEIGHT, DENSITY, GRAIN_DENSITY, VISCOSITY, GRAVITY = 0.4, 0.6, 1000.0, 1500.0, 1e-3, 9.81
#: Of a step; steps that do not count, and that do; repetitions of the projection.
DT, WARM, STEPS, PROJECTIONS = 1e-3, 4, 16, 20
#: Speed at which discs sink to begin with: the drag on one at rest in two dimensions is that of all of the box.
SPEED = 0.05
#: Of the contact law: overlaps of a layer of grains in the depot are below 1e-3 of a radius.
STIFF, RATIO, TAU = 1e6, 0.3, 1e-3
#: Width of the filter: what the coarsest mesh resolves.
FILTER = 0.0202
WALLS = ("left", "right", "bottom", "top")

Figures = dict[str, float]


def bench_suspension(folder: Path) -> int:
    """Measure, and tell one line for each figure; see :func:`softdyn.bench.record.told`.

    Raises
    ------
    SceneError
        If the folder cannot be written to.
    """
    with told(folder, "suspension") as tell:
        peers = {name: made for name, (package, made) in PEERS.items() if find_spec(package)}
        missing = [name for name in PEERS if name not in peers]
        if missing:
            tell(f"not installed, and so not measured: {', '.join(missing)}; pip install 'softdyn[bench-fluid]'")
        for cells, across in CASES:
            ours = measured(time_ours, cells, str(across))
            tell(
                f"{ours['grains']:.0f} discs, {3 * cells**2} triangles: {_words(ours)}; {ours['flows']:.2g} flows and "
                f"{ours['substeps']:.0f} sub-steps a step, residual {ours['residual']:.0e}"
            )
            for name, made in peers.items():
                theirs = measured(made, cells, str(across))
                ratios = [f"{key} {ours[key] / theirs[key]:.2g}" for key in ("step", "memory", "projection")]
                tell(f"    {name}: {_words(theirs)}; ours over theirs: {', '.join(ratios)}")
    return 0


def _words(figures: Figures) -> str:
    return (
        f"step {1e3 * figures['step']:.3g} ms, memory {figures['memory'] / 1e6:.0f} MB, projection "
        f"{1e6 * figures['projection']:.2g} us a grain"
    )


def discs(across: int) -> tuple[Array, float]:
    """Places of discs on a square lattice that fills the upper quarter of the box, and their radius."""
    radius = WIDTH / across / 2
    x, y = np.meshgrid(
        radius * (2 * np.arange(across) + 1), HEIGHT - radius * (2 * np.arange(round(HEIGHT / 4 / (2 * radius))) + 1)
    )
    # as far apart as rounding
    return np.column_stack([x.ravel(), y.ravel()]), radius * (1 - 1e-6)


def scene_of_depot(cells: int, across: int) -> Any:
    """The scene.

    Parameters
    ----------
    cells : int
        Along the width of the box.
    across : int
        Discs along it.
    """
    from softdyn.fluid import Boundary, MeshSection
    from softdyn.suspension import SuspensionScene

    x, radius = discs(across)
    return SuspensionScene(
        viscosity=VISCOSITY, density=DENSITY, elements="P1-P1", positions=x, radii=radius, grain_density=GRAIN_DENSITY,
        velocities=np.tile([0.0, -SPEED], (len(x), 1)),
        mesh=MeshSection(box=[WIDTH, HEIGHT], cells=[cells, 3 * cells // 2]), gravity=[0.0, -GRAVITY],
        boundary=[Boundary(list(WALLS), velocity=[0.0, 0.0])], drag="migflow_drag", law="hertz", walls=list(WALLS),
        parameters={"E": STIFF, "nu": RATIO, "tau": TAU}, width=FILTER, rtol=1e-3,
        until_t=(WARM + STEPS) * DT, dt=DT, times=[(WARM + STEPS) * DT],
    )  # fmt: skip


def median_of_steps(step: Callable[[], Any]) -> float:
    """Median CPU time of some steps, behind some that do not count."""
    times = []
    for _ in range(WARM + STEPS):
        began = time.process_time()
        step()
        times.append(time.process_time() - began)
    return float(np.median(times[WARM:]))


def time_ours(cells: int, across: str) -> Figures:
    """Steps here; memory is what they take besides all that is imported, and the mesh."""
    from softdyn.fluid.balances import measures_of
    from softdyn.fluid.fluid_result import HISTORY
    from softdyn.fluid.fluid_run import solver_of
    from softdyn.fluid.mesh_section import made_mesh
    from softdyn.suspension.filter import spread, weights_at
    from softdyn.suspension.suspension_run import Run, _begin, _columns, _step, made_ready

    made_ready(scene_of_depot(20, 8))  # kernels
    scene = scene_of_depot(cells, int(across))
    made_mesh(scene.mesh)
    before = _peak()
    system = made_ready(scene)
    run = Run(system, measures_of(system.fluid), solver_of(system.fluid), [], _begin(system))
    step = median_of_steps(lambda: _step(run))
    count = len(system.radii)

    def projected() -> None:
        weights, _ = weights_at(system.filter, run.state.x)
        spread(system.filter, weights, system.volume)

    began = time.process_time()
    for _ in range(PROJECTIONS):
        projected()
    projection = (time.process_time() - began) / PROJECTIONS / count
    columns = (*HISTORY, *_columns(run).columns)
    told_of = dict(zip(columns, np.array(run.history)[WARM:].T, strict=True))
    counts = run.state.counts
    return {
        "grains": count,
        "step": step,
        "memory": _peak() - before,
        "projection": projection,
        "residual": float(told_of["step_residual"].max()),
        "flows": counts["flows"] / counts["steps"],
        "substeps": float(told_of["substeps"].mean()),
    }


def time_migflow(cells: int, across: str) -> Figures:
    """Steps of MigFlow, as its example makes them."""
    _be_silent()
    from migflow import fluid, scontact, time_integration

    from softdyn.fluid.mesh_section import made_mesh

    x, radius = discs(int(across))
    mesh = made_mesh(scene_of_depot(cells, 8).mesh)
    before = _peak()
    grains = scontact.ParticleProblem(2)
    corners = [(0.0, 0.0), (WIDTH, 0.0), (WIDTH, HEIGHT), (0.0, HEIGHT)]
    for k, name in enumerate(("bottom", "right", "top", "left")):
        grains.add_boundary_segment(corners[k], corners[(k + 1) % 4], name)
    mass = np.pi * radius**2 * GRAIN_DENSITY
    for place in x:
        grains.add_particle(place, radius, mass)
    grains.body_velocity()[-len(x) :, 1] = -SPEED  # those of the walls come first
    flow = fluid.FluidProblem(2, [0.0, -GRAVITY], VISCOSITY, DENSITY)
    points = np.column_stack([mesh.at, np.zeros(len(mesh.at))])
    sides = [(name, np.asarray(mesh.boundaries[name], np.int32)) for name in WALLS]
    flow.set_mesh(points, np.asarray(mesh.corners, np.int32), np.ones(len(mesh.corners), np.int32), sides)
    for name in WALLS:
        flow.set_wall_boundary(name)
    flow.set_mean_pressure(0)

    def given() -> tuple[Any, ...]:
        state = (grains.delassus(), grains.volume(), grains.position(), grains.velocity(), grains.omega())
        return (*state, grains.contact_forces())

    flow.set_particles(*given())
    weight = mass * np.array([[0.0, -GRAVITY]] * len(x))
    step = median_of_steps(
        lambda: time_integration.iterate(flow, grains, DT, min_nsub=2, external_particles_forces=weight)
    )
    began = time.process_time()
    for _ in range(PROJECTIONS):
        flow.set_particles(*given())
    projection = (time.process_time() - began) / PROJECTIONS / len(x)
    return {"grains": len(x), "step": step, "memory": _peak() - before, "projection": projection}


#: Package, and what measures it.
PEERS: dict[str, tuple[str, Callable[[int, str], Figures]]] = {"MigFlow 1.4": ("migflow", time_migflow)}
