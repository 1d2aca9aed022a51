"""From when on a run is steady, if it ever is.

Two tests, and both must be passed. The marginal standard error rule (MSER; White, Simulation 69 (1997) 323; how it
does on molecular simulations: Clark, Cole & Michel, J. Chem. Theory Comput. 2024, doi:10.1021/acs.jctc.4c01359) leaves
out so much of the beginning that the mean of the rest has the least standard error as if its values were independent;
where that is more than half, there is no steady state. And both halves of what is left must have one mean, as far as
their errors by blocking tell (:mod:`softdyn.rheology.blocking`; Student's t, at a chance of 1 in 1000 of refusing what
is steady), or within 1 part in 1000.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softdyn.rheology.blocking import Mean, blocked_mean

Array = NDArray[np.float64]

#: Values up to this many are averaged before the rule is asked, where there are enough of them: MSER-5.
BATCH, ENOUGH = 5, 20
#: Of the values, the most that may be left out; and those of which the rule is asked.
MOST, ASKED = 0.5, 0.75
#: Chance at which halves of what is steady are told apart, and relative difference that is none.
CHANCE, NO_DIFFERENCE = 1e-3, 1e-3
#: Fewest values of which anything is said, and fewest blocks that are independent of one another.
FEWEST, INDEPENDENT = 16, 12


@dataclass(frozen=True)
class Steady:
    """What is known of the steady state of several series.

    Attributes
    ----------
    steady : bool
    why : str
        Why not, in words; "" if it is.
    start : int
        First value of the steady state; of what is not steady, of its last half.
    means : mapping from str to Mean
        Of the values from there on.
    """

    steady: bool
    why: str
    start: int
    means: Mapping[str, Mean]


def truncation(values: Array) -> int:
    """Values at the beginning that the marginal standard error rule leaves out."""
    size = max(1, min(BATCH, len(values) // ENOUGH))
    spare = len(values) % size
    means = np.asarray(values[spare:], dtype=float).reshape(-1, size).mean(axis=1)
    n = len(means)
    kept = n - np.arange(int(ASKED * n) + 1)
    # sums over what is kept, of values that are small: no digits are lost
    centred = means - means[n // 2 :].mean()
    sums, squares = (np.cumsum(part[::-1])[::-1][: len(kept)] for part in (centred, centred**2))
    marginal = (squares - sums**2 / kept) / kept**2
    found = int(np.argmin(marginal))
    return spare + found * size if found else 0


def steady_state(series: Mapping[str, Array], judged: tuple[str, ...] = ()) -> Steady:
    """Judge series of values at equal times, all together.

    Parameters
    ----------
    series : mapping from str to array, shape (n,)
    judged : tuple of str
        Those that must be steady; all by default. The latest beginning counts for all.
    """
    count = len(next(iter(series.values())))
    names = judged or tuple(series)
    half = count - count // 2
    if count < FEWEST:
        return _unsteady(f"{count} outputs are too few to tell a steady state: ask for {FEWEST} at least", half, series)
    starts = {name: truncation(series[name]) for name in names}
    latest = max(starts, key=lambda name: starts[name])
    if starts[latest] > MOST * count:
        return _unsteady(f"{latest} still changes in the second half of the run", half, series)
    start = starts[latest]
    for name in names:
        if words := _trend(series[name][start:]):
            return _unsteady(f"{name} {words}", half, series)
    return Steady(True, "", start, {name: blocked_mean(values[start:]) for name, values in series.items()})


def _trend(values: Array) -> str:
    """Words about halves that differ, or that cannot be compared."""
    middle = len(values) // 2
    first, second = blocked_mean(values[:middle]), blocked_mean(values[middle:])
    difference = abs(second.value - first.value)
    if difference <= NO_DIFFERENCE * max(abs(first.value), abs(second.value)):
        return ""
    whole = blocked_mean(values)
    if not whole.resolved or whole.blocks < INDEPENDENT:
        return "is correlated over all of the run: it is too short to tell a mean and its error"
    error = math.hypot(first.error, second.error)
    from scipy.stats import t

    allowed = float(t.ppf(1 - CHANCE / 2, max(1, first.blocks + second.blocks - 2)))
    if difference > allowed * error:
        return (
            f"drifts: {first.value:.4g} in the first and {second.value:.4g} in the second half of what the rule "
            f"leaves, with errors of {first.error:.1g} and {second.error:.1g}"
        )
    return ""


def _unsteady(why: str, start: int, series: Mapping[str, Array]) -> Steady:
    return Steady(False, why, start, {name: blocked_mean(values[start:]) for name, values in series.items()})
