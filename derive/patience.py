"""An end to what may have none: symbolic work is counted, and given up beyond a number of operations.

Input: how many operations some work may take. Output: an exception in it once it has taken more.

Operations are counted, not timed: what is given up is the same on a slow machine, a busy one and a fast one. One is
about what it takes to make one node of an expression; whoever makes some says so beforehand.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sympy import Basic


#: Operations beyond all that any work is allowed.
MOST_COUNTED = 10**9


@dataclass
class _Allowance:
    left: int
    over: type[Exception]


_allowance: ContextVar[_Allowance | None] = ContextVar("allowance", default=None)


@contextmanager
def within(operations: int | None, over: type[Exception], apart: bool = False) -> Iterator[None]:
    """Raise an exception in some work once it has taken more than so many operations.

    Within the work of another allowance it takes its operations from that, and at most what is left of it.

    Parameters
    ----------
    operations : int, or None
        None for no end of its own.
    over : type of Exception
    apart : bool
        Take nothing from the work around it.
    """
    outer = None if apart else _allowance.get()
    if operations is None:
        yield
        return
    given = operations if outer is None else max(0, min(operations, outer.left))
    own = _Allowance(given, over)
    token = _allowance.set(own)
    try:
        yield
    finally:
        _allowance.reset(token)
        if outer is not None:
            outer.left -= given - own.left


def spend(operations: int = 1) -> None:
    """Count operations, before they are done.

    Raises
    ------
    Exception
        The one that :func:`within` was given, if more are spent than it allows.
    """
    allowance = _allowance.get()
    if allowance is not None:
        allowance.left -= operations
        if allowance.left < 0:
            raise allowance.over


@lru_cache(maxsize=100_000)
def nodes(expr: Basic) -> int:
    """How many nodes an expression has, as a tree; a whole power of a sum as many as it has multiplied out, if more.

    Whoever asks sympy for the sign of an expression may have it multiplied out.
    """
    found = 1 + sum(map(nodes, expr.args))
    if expr.is_Pow and expr.args[0].is_Add and expr.args[1].is_Integer:
        power, terms = abs(int(expr.args[1])), len(expr.args[0].args)
        found = max(found, min(comb(power + terms - 1, terms - 1), MOST_COUNTED))
    return found
