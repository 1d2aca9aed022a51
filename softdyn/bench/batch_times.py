"""The batch of ``softdyn bench``.

10 000 approaches, from h/R = 100 to 1e-3, under as many forces; each has 50 outputs, at the times at which the gap is
evenly spaced in ln h, as quadrature has them: against these gaps errors are measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.kernels import get_kernel
from softdyn.pair.batch import STATES
from softdyn.pair.pair_run import MOST_STEPS
from softdyn.pair.quadrature import times_at_gaps
from softdyn.pair.states import deflection

Array = NDArray[np.float64]
#: Of a tolerance: gaps and deflections, a row for each run.
Solve = Callable[[float], tuple[Array, Array]]

RUNS, OUTPUTS = 10_000, 50
#: Runs whose outputs are compared with the exact ones, evenly spread.
COMPARED = 200
P = np.ones(3)
ABOUT = (
    f"{RUNS} approaches from h/R = 100 to 1e-3 under kappa = 1e-6 to 0.3, in one thread, {OUTPUTS} outputs each, "
    "evenly in ln h; CPU time per approach"
)


def reference() -> tuple[Array, Array, Array, Array]:
    """Forces; output times and deflections, a row for each run; and the gaps, the same in all."""
    forces = np.geomspace(1e-6, 0.3, RUNS)
    gaps = np.geomspace(100.0, 1e-3, OUTPUTS + 1)
    kernel = get_kernel("rognon_gay", "c", deflection="compression", outputs=("dh_dt",))
    times = np.array([times_at_gaps(kernel, P, float(force), gaps)[0][1:] for force in forces])
    deltas = np.array([deflection(kernel, gaps, np.full(OUTPUTS + 1, force), P) for force in forces])
    return forces, times, deltas, gaps


def error_of(found: tuple[Array, Array], deltas: Array, gaps: Array) -> float:
    """Largest relative error of h and of delta over the runs that are compared.

    Parameters
    ----------
    found : tuple of two arrays, shape (runs, outputs)
        h and delta, over R.
    deltas : array, shape (runs, outputs + 1)
        Deflections of the reference over R, with those at the start.
    gaps : array, shape (outputs + 1,)
        Over R, the same in all runs; the first is where they start.
    """
    some = slice(None, None, RUNS // COMPARED)
    worst = max(np.max(np.abs(found[0][some] / gaps[1:] - 1)), np.max(np.abs(found[1][some] / deltas[some, 1:] - 1)))
    return float(worst) if math.isfinite(worst) else math.inf


def integrators(forces: Array, times: Array, deltas: Array) -> Iterator[tuple[str, Callable[[], Solve], list[float]]]:
    """Name of each integrator, what prepares it, and the tolerances at which it is measured.

    Parameters
    ----------
    forces : array, shape (runs,)
        Over E R^2.
    times : array, shape (runs, outputs)
        Of the outputs, in units of eta/E.
    deltas : array, shape (runs, outputs + 1)
        Deflections of the reference over R; some integrators start from the first of them.
    """
    for target in ("c", "numba"):
        yield f"softdyn, {target}", partial(_ours, target, forces, times), [10.0**-k for k in range(5, 14)]
    for width in (4, 8):
        yield (
            f"heyoka, batches of {width}",
            partial(_heyoka, width, forces, times, deltas),
            [10.0**-k for k in range(6, 15)],
        )


def _ours(target: str, forces: Array, times: Array) -> Solve:
    kernel = get_kernel("rognon_gay", target, deflection="compression", outputs=("F_ela", "X", "a"))
    height = STATES + len(kernel.outputs)
    start = np.array([math.nan, math.log(100.0), math.nan, *P])
    rows = np.column_stack([times[:, -1], np.tile(start, (RUNS, 1)), forces]).ravel()
    targets, out = times.ravel(), np.empty((height * OUTPUTS + 2) * RUNS)

    def solve(tolerance: float) -> tuple[Array, Array]:
        settings = np.array([tolerance, 0.0, math.inf, float(MOST_STEPS), 1.0])
        kernel.functions.runs(RUNS, OUTPUTS, 0, settings, rows, targets, out)
        found = out[: height * RUNS * OUTPUTS].reshape(height, RUNS, OUTPUTS)
        return found[1], found[2]

    return solve


def _heyoka(width: int, forces: Array, times: Array, deltas: Array) -> Solve:
    import heyoka as hy

    u, delta = hy.make_vars("u", "delta")
    h = hy.exp(u)
    bar = h / (1.0 + h)
    a2 = 2.0 * (bar + delta)
    a = hy.sqrt(a2)
    h_dot = -hy.par[0] / (1.5 * math.pi * a2 * a2 / (bar * bar * bar))
    delta_dot = -delta / a / ((1.0 + h) * (1.0 + h)) * h_dot / (a + delta / a)
    made: dict[float, Any] = {}
    grids = np.concatenate([np.zeros((RUNS, 1)), times], axis=1)

    def solve(tolerance: float) -> tuple[Array, Array]:
        if tolerance not in made:
            made[tolerance] = hy.taylor_adaptive_batch(
                [(u, h_dot / h), (delta, delta_dot)], np.zeros((2, width)), tol=tolerance, pars=np.zeros((1, width))
            )
        engine = made[tolerance]
        found = np.empty((OUTPUTS + 1, 2, RUNS))
        for first in range(0, RUNS, width):
            lanes = slice(first, first + width)
            engine.set_time(0.0)
            engine.state[0], engine.state[1], engine.pars[0] = math.log(100.0), deltas[lanes, 0], forces[lanes]
            found[:, :, lanes] = engine.propagate_grid(grids[lanes].T)[-1]
        return np.exp(found[1:, 0].T), found[1:, 1].T

    return solve
