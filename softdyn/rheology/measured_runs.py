"""What is told of one run among many: numbers by their names."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from softdyn.rheology.blocking import FEWEST, blocked_mean
from softdyn.rheology.kinds import Measured

if TYPE_CHECKING:
    from softdyn.fluid.fluid_result import FluidResult
    from softdyn.particles.results import ParticleResult
    from softdyn.results.pair_result import PairResult

Array = NDArray[np.float64]

#: How far steps that are equal may differ, over the time: by rounding.
EVEN = 1e-12


def measured_particles(result: ParticleResult) -> Measured:
    """What is known of a run: its end, whether it was steady, means with errors, and last values.

    Returns
    -------
    dict from str to float
        ``steady`` is 1 or 0; of what is not, means are those of the last half, and ``NAME_error`` is nan, for there is
        no error of a mean that does not exist.
    str
        Why it is not steady, or "".
    """
    from softdyn.rheology.measures import JUDGED, even_part, ratio, series, sheared_by
    from softdyn.rheology.steady_state import steady_state

    found = series(result)
    row = {"t_end": float(result.t[-1]), "strain_end": float(sheared_by(result)[-1])}
    even = even_part(result.t)
    note = "" if even else "output times are not evenly spaced: no steady state can be told"
    if even:
        judged = tuple(name for name in JUDGED if name in found)
        state = steady_state({name: values[:even] for name, values in found.items()}, judged)
        row |= {
            "steady": float(state.steady),
            "steady_from": float(result.t[state.start]) if state.steady else math.nan,
        }
        note = state.why
        for name, mean in state.means.items():
            row |= {name: mean.value, f"{name}_error": mean.error if state.steady else math.nan}
        if row.get("shear_rate"):
            value, error = ratio(
                row["shear_stress"], row["shear_stress_error"], row["shear_rate"], row["shear_rate_error"]
            )
            row |= {"viscosity": value, "viscosity_error": error}
    row |= {f"{name}_end": float(values[-1]) for name, values in found.items() if len(values)}
    return row, note


def measured_flow(result: FluidResult) -> Measured:
    """What the steps of a fluid, or of grains in one, tell: forces, fluxes, powers, stresses, imbalances.

    Returns
    -------
    dict from str to float
        Of a steady flow each as ``NAME``; else that is the mean over the second half of the time, and there are
        ``NAME_error``, the standard error of that mean by blocks, where steps are equal, ``NAME_min``, ``NAME_max`` of
        that half, and ``NAME_end``, the last value.
    str
        What the run warns of, or "".
    """
    t = np.asarray(result.arrays["step_t"], dtype=float)
    row = {"t_end": float(t[-1]) if len(t) else 0.0}
    for column, series in columns_of(result).items() if len(t) else ():
        row |= {column: float(series[-1])} if result.stats["method"] == "steady" else _of_half(column, t, series)
    return row, "; ".join(result.warnings)


def columns_of(result: FluidResult) -> dict[str, Array]:
    """Numbers of each step by their names, with the axes of components: force_top_x, fluid_stress_xy."""
    from softdyn.fluid.fields import AXES

    found = {}
    for name in map(str, result.arrays.get("step_names", ())):
        values = result.arrays[name]
        for where in np.ndindex(*values.shape[1:]):
            letters = "".join(AXES[k] for k in where)
            found[f"{name}_{letters}" if letters else name] = values[(slice(None), *where)]
    return found


def _of_half(name: str, t: Array, values: Array) -> dict[str, float]:
    """Mean, its error, extremes and last value of a series, linear between its times, over the second half of them."""
    middle = t[-1] / 2
    late = t > middle
    times = np.concatenate([[middle], t[late]])
    part = np.concatenate([[np.interp(middle, t, values)], values[late]])
    mean = float(trapezoid(part, times) / (times[-1] - times[0]))
    row = {name: mean, f"{name}_min": float(part.min()), f"{name}_max": float(part.max())}
    even = np.ptp(np.diff(t[late])) <= EVEN * t[-1] if late.sum() > FEWEST else False
    if even:
        row[f"{name}_error"] = blocked_mean(values[late]).error
    return {**row, f"{name}_end": float(values[-1])}


def measured_pair(result: PairResult) -> Measured:
    """State of two particles at the end, and what the run warns of."""
    names = ("t", "h", "delta", "X", "F")
    ends = {f"{name}_end": float(result.arrays[name][-1]) for name in names if len(result.arrays.get(name, ()))}
    return ends, "; ".join(result.warnings)
