"""Means of correlated values, with their standard errors, by blocking.

Values are averaged in pairs, again and again, until neighbouring means are no longer correlated; then their scatter
tells the error of the mean (Flyvbjerg & Petersen, J. Chem. Phys. 91 (1989) 461, doi:10.1063/1.457480). Where that is, a
test says: of the correlations of neighbours, at this level and all coarser ones, as Jonsson proposed (Phys. Rev. E 98
(2018) 043304).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Fewest blocks whose correlation is tested, and from whose scatter an error is taken.
FEWEST = 8
#: Chance at which uncorrelated values are taken for correlated ones.
CHANCE = 0.05


class Mean(NamedTuple):
    """A mean of correlated values.

    Attributes
    ----------
    value : float
    error : float
        Its standard error; where not ``resolved``, the largest that any level gives, which is too small.
    blocks : int
        From the scatter of so many means of blocks: the error is known to a part 1/sqrt(2 (blocks - 1)) of itself.
    resolved : bool
        Whether blocks are long enough to be uncorrelated, and FEWEST at least.
    """

    value: float
    error: float
    blocks: int
    resolved: bool


def blocked_mean(values: Array) -> Mean:
    """Mean of values that follow one another at equal times, with its error.

    Of an odd number the oldest is left out of the next level.

    Parameters
    ----------
    values : array, shape (n,)
        Of one stationary process.
    """
    values = np.asarray(values, dtype=float)
    mean = float(values.mean())
    levels: list[tuple[int, float, float]] = []  # number, variance, and what its test adds
    x = values - mean
    while len(x) >= FEWEST:
        n, variance = len(x), float(np.var(x))
        if variance == 0 or variance <= (8 * np.finfo(float).eps * mean) ** 2:  # all alike, but for rounding
            levels.append((n, variance, 0.0))
            break
        neighbours = float(x[:-1] @ x[1:]) / n
        # of uncorrelated values neighbours have this much less than 0, since their own mean is taken off
        levels.append((n, variance, n * (((n - 1) * variance / n**2 + neighbours) / variance) ** 2))
        x = (x[n % 2 :: 2] + x[n % 2 + 1 :: 2]) / 2
    if not levels:
        spread = float(np.std(values, ddof=1) / math.sqrt(len(values))) if len(values) > 1 else math.nan
        return Mean(mean, spread, len(values), False)
    from scipy.stats import chi2

    for k, (n, variance, _) in enumerate(levels):
        left = sum(term for _, _, term in levels[k:])
        if left < chi2.ppf(1 - CHANCE, len(levels) - k):
            return Mean(mean, math.sqrt(variance / (n - 1)), n, True)
    return Mean(mean, max(math.sqrt(variance / (n - 1)) for n, variance, _ in levels), levels[-1][0], False)
