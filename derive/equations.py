"""The equations of a kernel, before and after what a scene does not need is left out: the same for every kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from sympy import Expr, Symbol

from softdyn.derive.printing import operations, straight_line


@dataclass(frozen=True)
class Equations:
    """Each symbol in terms of earlier symbols, and of what the code around provides.

    ``wanted`` are those that the kernel uses; whatever these do not need is not emitted.
    """

    definitions: dict[Symbol, Expr]
    wanted: frozenset[Symbol]


def changed(equations: Equations, change: Callable[[Expr], Expr]) -> Equations:
    """Return the equations with every expression changed."""
    return replace(equations, definitions={symbol: change(expr) for symbol, expr in equations.definitions.items()})


def inserted(equations: Equations, known: Mapping[Symbol, Expr]) -> Equations:
    """Return the equations with what is known of some symbols in the place of these, and of their definitions."""
    return replace(
        equations,
        definitions={symbol: known.get(symbol, expr.subs(known)) for symbol, expr in equations.definitions.items()},
    )


def followed(equations: Equations) -> Equations:
    """Return the equations with what has become a number in the place of its symbol, until nothing else does."""
    while True:
        definitions = equations.definitions
        used = {symbol for expr in definitions.values() for symbol in expr.free_symbols}
        numbers = {symbol: expr for symbol, expr in definitions.items() if symbol in used and expr.is_number}
        if not numbers:
            return equations
        equations = inserted(equations, numbers)


def cost(equations: Equations) -> int:
    """Operations of all that the kernel uses, computed once."""
    order = [symbol for symbol in equations.definitions if symbol in equations.wanted]
    return sum(operations(straight_line(order, equations.definitions)).values())
