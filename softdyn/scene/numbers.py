"""Checks of single numbers, and of numbers by name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from softdyn.errors import SceneError

#: Below this, rounding of ln h is of the order of the tolerance.
SMALLEST_RTOL = 1e-14
LARGEST_COUNT = 10_000_000
#: What a parameter may be: low, high, and whether each of these is itself left out.
Range = tuple[float, float, bool, bool]


def named_numbers(where: str, values: Any) -> dict[str, float]:
    """Finite numbers by name.

    Raises
    ------
    SceneError
    """
    if not isinstance(values, Mapping):
        raise SceneError(f"{where} must map names to numbers, not {values!r}")
    return {str(name): finite_number(f"{where}: {name}", value) for name, value in values.items()}


def finite_number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise SceneError(f"{name} must be a number, not {value!r}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise SceneError(f"{name} must be finite, not {value!r}")
    return number


def positive_number(name: str, value: Any) -> float:
    number = finite_number(name, value)
    if number <= 0:
        raise SceneError(f"{name} must be positive, not {value!r}")
    if number < np.finfo(float).tiny:
        raise SceneError(f"{name} = {value!r} is below the smallest normal double; choose other units")
    return number


def range_fault(name: str, value: float, allowed: Range) -> str | None:
    """What is wrong with a parameter's value, if it is outside of its range.

    Parameters
    ----------
    name : str
        Of the parameter.
    value : float
    allowed : (low, high, bool, bool)
        From where to where, and whether low, and high, are left out.
    """
    low, high, above, below = allowed
    if (low < value if above else low <= value) and (value < high if below else value <= high):
        return None
    signs = ["<" if is_open else "<=" for is_open in (above, below)]
    return f"[parameters] {name} = {value:g} lies outside of its range, {low:g} {signs[0]} {name} {signs[1]} {high:g}"
