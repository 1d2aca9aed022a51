"""Parameters that are not known but as distributions, and quasi-random samples of them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from softdyn.errors import SceneError
from softdyn.words import suggestion

Array = NDArray[np.float64]

_CALL = re.compile(r"(\w+)\(([^()]*)\)")
#: The largest number of a distribution: beyond it, and from nan, there is none.
LARGEST = 1e300


def _normal(mean: float, deviation: float) -> Any:
    _require(deviation > 0, "the standard deviation must be positive")
    return stats.norm(mean, deviation)


def _lognormal(median: float, factor: float) -> Any:
    _require(median > 0, "the median must be positive")
    _require(factor > 1, "the factor must be more than 1")
    return stats.lognorm(math.log(factor), scale=median)


def _uniform(low: float, high: float) -> Any:
    _require(low < high, "the first number must be less than the second")
    return stats.uniform(low, high - low)


def _loguniform(low: float, high: float) -> Any:
    _require(0 < low < high, "the numbers must be positive, the first less than the second")
    return stats.loguniform(low, high)


def _triangular(low: float, mode: float, high: float) -> Any:
    _require(low <= mode <= high and low < high, "the numbers must be least, likeliest and largest, in this order")
    return stats.triang((mode - low) / (high - low), low, high - low)


def _integers(low: float, high: float) -> Any:
    _require(low.is_integer() and high.is_integer() and low <= high, "two whole numbers are needed, the least first")
    return stats.randint(int(low), int(high) + 1)


#: By name: what its numbers are, and what makes it of them.
DISTRIBUTIONS: dict[str, tuple[str, Callable[..., Any]]] = {
    "normal": ("mean, standard deviation", _normal),
    "lognormal": ("median, factor: 68 % lie between median/factor and median*factor", _lognormal),
    "uniform": ("least, largest", _uniform),
    "loguniform": ("least, largest", _loguniform),
    "triangular": ("least, likeliest, largest", _triangular),
    "integers": ("least, largest; as of packing.seed", _integers),
}


def _require(holds: bool, words: str) -> None:
    if not holds:
        raise SceneError(words)


def distribution(text: str) -> Any:
    """A distribution from its text, as ``normal(1.0, 0.1)``.

    Returns
    -------
    frozen distribution of scipy.stats

    Raises
    ------
    SceneError
        If there is none of that name, or its numbers are none that it takes.
    """
    match = _CALL.fullmatch(text.strip())
    name = match[1] if match else text.partition("(")[0].strip()
    if name not in DISTRIBUTIONS:
        raise SceneError(f"{text!r} is no distribution{suggestion(name, list(DISTRIBUTIONS))}")
    says, make = DISTRIBUTIONS[name]
    try:
        numbers = [float(part) for part in match[2].split(",")] if match else []
    except ValueError:
        numbers = []
    if len(numbers) != make.__code__.co_argcount or not all(abs(number) <= LARGEST for number in numbers):
        raise SceneError(f"{text!r}: {name} takes {make.__code__.co_argcount} numbers: {says}")
    try:
        return make(*numbers)
    except SceneError as error:
        raise SceneError(f"{text!r}: {error}") from None


def read_given(texts: Sequence[str]) -> dict[str, Any]:
    """Read several NAME=DISTRIBUTION.

    Returns
    -------
    dict from str to a frozen distribution

    Raises
    ------
    SceneError
        If one is none, or a name is given twice.
    """
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, rest = (part.strip() for part in text.partition("="))
        if not equals or not name:
            raise SceneError(f"--given {text}: NAME=DISTRIBUTION is expected, as sigma=normal(0.03,0.002)")
        if name in found:
            raise SceneError(f"--given {name} is given twice")
        try:
            found[name] = distribution(rest)
        except SceneError as error:
            raise SceneError(f"--given {name}: {error}") from None
    return found


def samples_of(given: Mapping[str, Any], count: int, seed: int, sobol: bool) -> list[dict[str, float]]:
    """Quasi-random samples: scrambled points of Sobol's sequence.

    Parameters
    ----------
    given : mapping from str to a frozen distribution
        The parameters are independent.
    count : int
        A power of two, for which the points are balanced.
    seed : int
        Of the scrambling: the same seed gives the same samples.
    sobol : bool
        Whether indices of Sobol are to be found: then there are two independent sets of samples, A and B, and for each
        parameter A with that one from B (Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018).

    Returns
    -------
    list of dict from str to float
        ``count`` of them; with ``sobol`` ``count (parameters + 2)``: A, B, then those for each parameter.

    Raises
    ------
    SceneError
        If the count is no power of two, at least 2.
    """
    if count < 2 or count & (count - 1):
        near = 2 ** max(1, round(math.log2(max(count, 2))))
        raise SceneError(f"--samples {count}: a power of two is needed, for which Sobol's points are balanced: {near}")
    names, d = list(given), len(given)
    points = stats.qmc.Sobol(2 * d if sobol else d, scramble=True, seed=seed).random(count)
    sets = [points[:, :d], points[:, d:]] if sobol else [points]
    for k in range(d) if sobol else ():
        mixed = sets[0].copy()
        mixed[:, k] = sets[1][:, k]
        sets.append(mixed)
    whole = np.concatenate(sets)
    columns = [np.asarray(given[name].ppf(whole[:, k]), dtype=float) for k, name in enumerate(names)]
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]
