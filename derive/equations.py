"""The equations of a kernel, before and after what a scene does not need is left out: the same for every kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

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
    definitions = equations.definitions.items()
    return replace(
        equations, definitions={symbol: known.get(symbol, with_known(expr, known)) for symbol, expr in definitions}
    )


def with_known(expr: Expr, known: Mapping[Symbol, Expr]) -> Expr:
    """Return an expression with what is known of some symbols in the place of these.

    Parameters
    ----------
    expr : Expr
    known : mapping from Symbol to Expr
        In none of which there is one of these symbols.
    """
    # sympy goes through the whole of an expression for each symbol, also for those that are not in it
    there = tuple((symbol, known[symbol]) for symbol in known if symbol in expr.free_symbols)
    return _with_known(expr, there) if there else expr


@lru_cache(maxsize=4096)  # kernels of one law, whatever they leave out, ask for the same
def _with_known(expr: Expr, known: tuple[tuple[Symbol, Expr], ...]) -> Expr:
    return expr.subs(dict(known))


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
    return _cost(tuple(equations.definitions.items()), equations.wanted)


@lru_cache(maxsize=512)
def _cost(definitions: tuple[tuple[Symbol, Expr], ...], wanted: frozenset[Symbol]) -> int:
    order = [symbol for symbol, _ in definitions if symbol in wanted]
    return sum(operations(straight_line(order, dict(definitions))).values())
