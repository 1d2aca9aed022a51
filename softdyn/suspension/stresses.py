"""Stresses of a sheared suspension, averaged over time, with errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.fluid.fields import AXES
from softdyn.rheology.steady_state import Steady, steady_state

if TYPE_CHECKING:
    from softdyn.fluid.fluid_result import FluidResult

#: The two, and words for them.
WORDS = {"fluid_stress": "of the fluid", "grain_stress": "of contacts"}
#: How far steps that are equal may differ, of their length.
EQUAL = 1e-9
#: Of the norm of stresses, what the mean of a shear stress is at least where there is a shear.
PART = 0.4


def largest_shear(arrays: Mapping[str, NDArray[Any]]) -> tuple[int, int]:
    """Axes of the largest shear stress, of fluid and grains together, in the mean over all steps."""
    whole = np.abs(sum(arrays[name].sum(axis=0) for name in WORDS))
    a, b = np.unravel_index(int(np.argmax(np.triu(whole, 1))), whole.shape)
    return (int(a), int(b)) if a != b else (0, 1)


def mean_stresses(result: FluidResult) -> Steady:
    """Mean stresses of fluid and grains, with errors by blocks, from when on the largest shear stress is steady.

    Its means have the names ``fluid_stress_xy``, ``grain_stress_xy`` and so on; of a run that is not steady they are
    those of its last half. Steps must be equal.

    Parameters
    ----------
    result : FluidResult
        Of grains in a fluid.
    """
    d = result.at.shape[1]
    series = {
        f"{name}_{AXES[a]}{AXES[b]}": result.arrays[name][:, a, b] for name in WORDS for a in range(d) for b in range(d)
    }
    a, b = largest_shear(result.arrays)
    largest = max(WORDS, key=lambda name: abs(float(result.arrays[name][:, a, b].mean())))
    return steady_state(series, (f"{largest}_{AXES[a]}{AXES[b]}",))


def is_sheared(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether the mean of the largest shear stress is a good part of all stresses that there are."""
    whole = np.asarray(sum(arrays[name] for name in WORDS))
    if not len(whole):
        return False
    a, b = largest_shear(arrays)
    size = float(np.sqrt(np.mean(np.sum(whole**2, axis=(1, 2)))))
    return abs(float(whole[:, a, b].mean())) > PART * size


def told_stresses(result: FluidResult) -> str:
    """A line of the largest shear stress, of fluid and of contacts; "" without, or where steps differ in length."""
    if not is_sheared(result.arrays) or np.ptp(result.step_dt) > EQUAL * result.step_dt.max():
        return ""
    found, (a, b) = mean_stresses(result), largest_shear(result.arrays)
    parts = []
    for name, words in WORDS.items():
        mean = found.means[f"{name}_{AXES[a]}{AXES[b]}"]
        error = f" +- {mean.error:.1g}" if mean.error and mean.resolved and found.steady else ""
        parts.append(f"{words} {mean.value:.5g}{error}")
    start = float(result.step_t[found.start - 1]) if found.start else 0.0
    unsteady = "" if found.steady else f" (not steady: {found.why})"
    return f"mean shear stress {AXES[a]}{AXES[b]} from t = {start:.4g} on: {', '.join(parts)}{unsteady}"
