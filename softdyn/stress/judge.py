"""What came of a run that should have been refused, or right: one judgement for the whole stress matrix.

A run is *right* if all outputs are within what is allowed, *told* if the result itself warns of an error at least as
large as the true one, *refused* if an error names the cause, and *wrong* in every other case: none may be.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from softdyn.errors import SoftdynError
from softdyn.results.pair_result import PairResult

RIGHT, TOLD, REFUSED, WRONG = "right", "told", "refused", "wrong"
OUTCOMES = (RIGHT, TOLD, REFUSED, WRONG)


@dataclass(frozen=True)
class Cell:
    """What came of one case in one column: a tolerance, or a hostile value.

    Attributes
    ----------
    error : float
        Largest true error of the outputs, relative; nan where there is none.
    estimated : float
        What the result says it is; nan where it does not.
    allowed : float
        What it may be.
    said : str
        The error's or the warning's words.
    """

    group: str
    name: str
    column: str
    outcome: str
    error: float = math.nan
    estimated: float = math.nan
    allowed: float = math.nan
    said: str = ""


def judge(
    where: tuple[str, str, str], run: Callable[[], PairResult], error_of: Callable[[PairResult], float], allowed: float
) -> Cell:
    """Run, and compare.

    Parameters
    ----------
    where : tuple of str
        Group, name and column of the cell.
    run : function without arguments
        Makes the result.
    error_of : function of a PairResult
        Largest true error of its outputs, relative.
    allowed : float
        What that may be.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = run()
    except SoftdynError as refusal:
        return Cell(*where, REFUSED, allowed=allowed, said=str(refusal))
    except Exception as failure:  # anything else is a fault, and is reported as one
        return Cell(*where, WRONG, allowed=allowed, said=f"{type(failure).__name__}: {failure}")
    finite = all(np.isfinite(values).all() for values in result.arrays.values())
    if not finite or not (result.h > 0).all():
        return Cell(*where, WRONG, allowed=allowed, said="an output is not finite, or h is not positive")
    error, estimated = error_of(result), float(result.stats.get("error", math.nan))
    if error <= allowed:
        return Cell(*where, RIGHT, error, estimated, allowed)
    told = [warning for warning in result.warnings if "known" in warning]
    if told and (error <= estimated or "not known" in told[0]):
        return Cell(*where, TOLD, error, estimated, allowed, told[0])
    return Cell(*where, WRONG, error, estimated, allowed, f"the result estimates {estimated:.1e}")


def judge_number(where: tuple[str, str, str], find: Callable[[], float], expected: float, allowed: float) -> Cell:
    """Run what ends in one number, and compare it, relative to what is expected unless that is 0.

    Parameters
    ----------
    where : tuple of str
        Group, name and column of the cell.
    find : function without arguments
        Finds the number.
    expected : float
        What it is by another way.
    allowed : float
        What the error may be.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = find()
    except SoftdynError as refusal:
        return Cell(*where, REFUSED, allowed=allowed, said=str(refusal))
    except Exception as failure:  # anything else is a fault, and is reported as one
        return Cell(*where, WRONG, allowed=allowed, said=f"{type(failure).__name__}: {failure}")
    error = abs(found - expected) / (abs(expected) or 1.0)
    # a nan is not within what is allowed
    return Cell(*where, RIGHT if error <= allowed else WRONG, error, allowed=allowed)


def worst(cells: Sequence[Cell]) -> Cell:
    """The cell that is furthest from right."""
    return max(cells, key=lambda cell: (OUTCOMES.index(cell.outcome), cell.error if cell.error == cell.error else 0.0))
