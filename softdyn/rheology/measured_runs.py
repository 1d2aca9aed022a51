"""What is told of one run among many: numbers by their names."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from softdyn.rheology.kinds import Measured

if TYPE_CHECKING:
    from softdyn.fluid.fluid_result import FluidResult
    from softdyn.particles.results import ParticleResult
    from softdyn.results.pair_result import PairResult

Array = NDArray[np.float64]


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
    """What the steps of a fluid, or of grains in one, tell: forces, fluxes, powers, imbalances.

    Returns
    -------
    dict from str to float
        Of a steady flow each as ``NAME``; else that is the mean over the second half of the time, and there are
        ``NAME_min``, ``NAME_max`` of that half, and ``NAME_end``, the last value.
    str
        What the run warns of, or "".
    """
    from softdyn.fluid.fields import AXES
    from softdyn.fluid.fluid_result import HISTORY

    t = np.asarray(result.arrays["step_t"], dtype=float)
    row = {"t_end": float(t[-1]) if len(t) else 0.0}
    for name, values in result.arrays.items():
        if name in HISTORY or name == "t" or not _is_of_steps(name, values, len(t)):
            continue
        columns = {name: values} if values.ndim == 1 else {f"{name}_{AXES[k]}": v for k, v in enumerate(values.T)}
        for column, series in columns.items():
            row |= {column: float(series[-1])} if result.stats["method"] == "steady" else _of_half(column, t, series)
    return row, "; ".join(result.warnings)


def _is_of_steps(name: str, values: NDArray[np.generic], steps: int) -> bool:
    """Whether an array has a number, or a vector, for each step: all that does has its name from what is measured."""
    told = ("force_", "flux_", "power_", "grain_", "coupling_", "bed_force", "volume_force", "momentum_rate")
    named = ("kinetic_rate", "kinetic_energy", "contacts", "substeps")
    of_steps = name.startswith(told) or name.endswith("_imbalance") or name in named
    return steps > 0 and len(values) == steps and values.ndim <= 2 and (of_steps or name == "dissipation")


def _of_half(name: str, t: Array, values: Array) -> dict[str, float]:
    """Mean, extremes and last value of a series that is linear between its times, over the second half of them."""
    middle = t[-1] / 2
    late = t > middle
    times = np.concatenate([[middle], t[late]])
    part = np.concatenate([[np.interp(middle, t, values)], values[late]])
    mean = float(trapezoid(part, times) / (times[-1] - times[0]))
    low, high = float(part.min()), float(part.max())
    return {name: mean, f"{name}_min": low, f"{name}_max": high, f"{name}_end": float(values[-1])}


def measured_pair(result: PairResult) -> Measured:
    """State of two particles at the end, and what the run warns of."""
    names = ("t", "h", "delta", "X", "F")
    ends = {f"{name}_end": float(result.arrays[name][-1]) for name in names if len(result.arrays.get(name, ()))}
    return ends, "; ".join(result.warnings)
