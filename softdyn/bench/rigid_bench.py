"""What a step of rigid grains costs, beside MigFlow 1.4 where that is installed: columns at rest.

One step after another from rest, under gravity, on one thread; the physical residual is what the floor's force lacks of
the weight, taken from the momentum of all grains. Times are CPU times: of the first step, and the median of the others.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

COLUMNS = (30, 100, 300)
STEPS = 6
DT, G, RADIUS, MU = 1e-3, 9.81, 0.5, 0.3
#: Tolerance that MigFlow is asked for, a length: smaller ones change nothing, since it stops after so many iterations.
TOLERANCE = 1e-10

Figures = dict[str, float]


def column_ours(n: int) -> Figures:
    """Steps of contact dynamics here."""
    from softdyn.particles import Friction, Gravity, Inertia, ParticleScene, Wall
    from softdyn.particles.contact_dynamics.rigid_run import prepare, start_of
    from softdyn.particles.contact_dynamics.rigid_steps import take_step
    from softdyn.particles.particle_scene import check

    scene = ParticleScene(
        positions=[[0.0, RADIUS * (2 * k + 1)] for k in range(n)],
        radii=RADIUS,
        inertia=Inertia(density=1.0, shape="disc"),
        friction=Friction(mu=MU),
        gravity=Gravity(acceleration=[0.0, -G]),
        wall=[Wall([0.0, 0.0], [0.0, -1.0])],
        until_t=STEPS * DT,
        step=DT,
        times=2,
    )
    system = prepare(check(scene))
    state = start_of(system)

    def step() -> float:
        before = state.v[:, 1].copy()
        began = time.process_time()
        take_step(system, state, STEPS * DT)
        taken = time.process_time() - began
        lacking.append(abs(float(np.mean(state.v[:, 1] - before))) / (G * DT))
        return taken

    lacking: list[float] = []
    return _figures([step() for _ in range(STEPS)], lacking)


def column_migflow(n: int) -> Figures:
    """Steps of MigFlow's."""
    from migflow import scontact

    problem = scontact.ParticleProblem(2)
    problem.set_friction_coefficient(MU)
    problem.add_boundary_segment(np.array([-5.0, 0.0]), np.array([5.0, 0.0]), "floor")
    mass = np.pi * RADIUS**2
    for k in range(n):
        problem.add_particle(np.array([0.0, RADIUS * (2 * k + 1)]), RADIUS, mass)
    weight = np.tile([0.0, -mass * G], (n, 1))
    times, lacking = [], []
    for _ in range(STEPS):
        before = problem.body_velocity()[:, 1].copy()
        began = time.process_time()
        problem.iterate(DT, weight, tol=TOLERANCE, force_motion=1)
        times.append(time.process_time() - began)
        lacking.append(abs(float(np.sum(problem.body_velocity()[:, 1] - before))) / (n * G * DT))
    return _figures(times, lacking)


def _figures(times: list[float], lacking: list[float]) -> Figures:
    return {"first": times[0], "step": float(np.median(times[1:])), "lacking": max(lacking)}


def tell_columns(tell: Callable[[str], None]) -> None:
    """Tell one line for each column, and each peer."""
    for n in COLUMNS:
        ours = column_ours(n)
        tell(f"column of {n} rigid discs at rest: {_words(ours)}")
        if find_spec("migflow"):
            theirs = column_migflow(n)
            tell(f"    MigFlow 1.4: {_words(theirs)}; ours over theirs: step {ours['step'] / theirs['step']:.2g}")
        else:
            tell("    MigFlow 1.4 is not installed, and so not measured: pip install 'softdyn[bench-fluid]'")


def _words(figures: Figures) -> str:
    return (
        f"first step {1e3 * figures['first']:.3g} ms, later {1e3 * figures['step']:.3g} ms, the floor's force off by "
        f"{figures['lacking']:.1e} of the weight"
    )
