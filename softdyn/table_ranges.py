"""Whether a run stays where the tables of its law have values.

Input: a law with splines through points (:mod:`softdyn.derive.splines`), and states. Output: nothing, or an error that
names the quantity, the value and the range. A table in a branch that does not hold is not asked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sympy import And, Expr, Piecewise, Symbol, lambdify, nan

from softdyn.derive.law import ContactLaw, expressions, parameters_of, tangential_expressions
from softdyn.derive.special import IN_NUMPY
from softdyn.derive.splines import Spline
from softdyn.derive.symbols import a, delta, h, size_ratio
from softdyn.laws import law_of

Array = NDArray[np.float64]
#: Before the names of what tangential motion meets.
TANGENTIAL = "tangential "
#: Of the width of a range: how far beyond it a rounded value may be.
ROUNDING = 1e-9


class Table(NamedTuple):
    """A table in an expression of a law: its argument, its range, and what has no value outside of it."""

    name: str
    argument: Expr
    low: float
    high: float
    value: Callable[..., Any]
    masked: Callable[..., Any]


class Outside(NamedTuple):
    """The number of the first state that is outside of a table, and words for it."""

    number: int
    words: str


def has_tables(law: ContactLaw) -> bool:
    """Whether a law has splines through points."""
    return any(expr.has(Spline) for expr in _all_expressions(law).values())


def _all_expressions(law: ContactLaw) -> dict[str, Expr]:
    found = {**expressions(law), "unequal": law.unequal}
    if law.tangential is not None:
        found |= {f"{TANGENTIAL}{name}": expr for name, expr in tangential_expressions(law.tangential).items()}
    return found


def _symbols(law: ContactLaw) -> tuple[Symbol, ...]:
    return (h, delta, size_ratio, *parameters_of(law, tangential=True))


@lru_cache(maxsize=32)
def _tables(law: ContactLaw) -> tuple[Table, ...]:
    """Every table of a law; of derivatives the ranges are the same."""
    found = []
    for name, expr in _all_expressions(law).items():
        whole = expr.subs(a, law.a) if name != "a" else expr
        for one in sorted(whole.atoms(Spline), key=str):
            x, low, high = one.args[0], float(one.points[0]), float(one.points[-1])
            slack = ROUNDING * (high - low)
            masked = whole.xreplace({one: Piecewise((one, And(x >= low - slack, x <= high + slack)), (nan, True))})
            functions = (lambdify(_symbols(law), part, [IN_NUMPY, "numpy"]) for part in (x, masked))
            found.append(Table(name, x, low, high, *functions))
    return tuple(found)


@lru_cache(maxsize=8)
def law_once(law: ContactLaw | str | Path, kernel: str) -> ContactLaw:
    """Return a law that a kernel, told by its key, is of; a law file is run once for it."""
    return law_of(law)


def outside(
    law: ContactLaw, parameters: Mapping[str, Any], at: Array, deflection: Array, left_out: tuple[str, ...] = ()
) -> Outside | None:
    """Return the first state in which a law asks a table for what it has no value of.

    Parameters
    ----------
    law : ContactLaw
    parameters : mapping from str to number or array of shape (states,)
        Those of the law, R among them.
    at, deflection : array, shape (states,)
        h and delta.
    left_out : tuple of str
        Beginnings of the names of expressions that the run has no use for.
    """
    values = {**parameters, "h": at, "delta": deflection}
    values.setdefault("size_ratio", 0.25)
    known = [np.broadcast_to(np.asarray(values.get(s.name, np.nan), dtype=float), at.shape) for s in _symbols(law)]
    first: Outside | None = None
    for table in _tables(law):
        if table.name.startswith(left_out):
            continue
        with np.errstate(all="ignore"):
            x, whole = (np.broadcast_to(function(*known), at.shape) for function in (table.value, table.masked))
        slack = ROUNDING * (table.high - table.low)
        left = np.flatnonzero(np.isnan(whole) & ((x < table.low - slack) | (x > table.high + slack)))
        if len(left) and (first is None or left[0] < first.number):
            where = f"{table.argument} = {x[left[0]]:.6g}, and its table goes from {table.low:g} to {table.high:g}"
            first = Outside(int(left[0]), f"{table.name} is asked for at {where}")
    return first
