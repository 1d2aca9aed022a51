"""Many expressions at one point, in mpmath's numbers: each part that they share is computed once, when it is asked for.

Input: expressions. Output: a program, and the values of parts of them at points. Where there are branches, only the one
that applies is computed.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from math import prod
from typing import Any

import mpmath
from sympy import Basic, Expr, Integer, Pow, Rational, S, Symbol

#: What has been computed at a point, by place in the program; None for what has not.
Known = list[Any]
Step = Callable[[Known], Any]
#: Computes a node that is no sum, product or power, from its symbols.
Other = Callable[[Basic], tuple[list[Symbol], Callable[..., Any]]]

COMPARED = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


class Program:
    """Steps that compute expressions and all of their parts.

    Parameters
    ----------
    expressions : iterable of Expr
    functions : mapping from str to function
        Of one number, by the names that sympy has for them; ``Add`` is that of all terms of a sum.
    other : function
        Of a node of another kind: its symbols, and a function of them.
    """

    def __init__(self, expressions: Iterable[Expr], functions: Mapping[str, Callable[..., Any]], other: Other) -> None:
        self._functions, self._other = functions, other
        self._places: dict[Basic, int] = {}
        self._steps: list[Step] = []
        for expr in expressions:
            self._place(expr)

    def start(self, values: Mapping[Symbol, Any]) -> Known:
        """Return what is known at a point before anything is computed: the values of symbols."""
        known: Known = [None] * len(self._steps)
        for symbol, value in values.items():
            self.tell(known, symbol, value)
        return known

    def tell(self, known: Known, symbol: Symbol, value: Any) -> None:
        """Let the value of a symbol be known.

        Parameters
        ----------
        known : list
            Is changed.
        symbol : Symbol
        value : number
        """
        if symbol in self._places:
            known[self._places[symbol]] = value

    def value(self, known: Known, expr: Expr) -> Any:
        """Value of an expression, or of a part of one, at the precision that mpmath has now.

        Raises
        ------
        ArithmeticError, ValueError, TypeError
            Where it has none.
        """
        return self._get(known, self._places[expr])

    def _get(self, known: Known, place: int) -> Any:
        found = known[place]
        if found is None:
            found = known[place] = self._steps[place](known)
        return found

    def _place(self, node: Basic) -> int:
        if node not in self._places:
            step = self._step(node)
            self._places[node] = len(self._steps)
            self._steps.append(step)
        return self._places[node]

    def _step(self, node: Basic) -> Step:
        get = self._get
        name = type(node).__name__
        if isinstance(node, Symbol):
            return _unknown
        if isinstance(node, Rational):
            p, q = int(node.p), int(node.q)
            return (lambda known: p) if q == 1 else (lambda known: mpmath.mpf(p) / q)
        if node.is_Add:
            terms, total = [self._place(term) for term in node.args], self._functions["Add"]
            return lambda known: total(*(get(known, i) for i in terms))
        if node.is_Mul:
            above, below = self._fraction(node)
            if not below:
                return lambda known: prod(get(known, i) for i in above)
            return lambda known: prod(get(known, i) for i in above) / prod(get(known, i) for i in below)
        if isinstance(node, Pow):
            return self._power(node)
        if node.is_Piecewise:
            branches = [(self._place(value), self._condition(condition)) for value, condition in node.args]
            return lambda known: next((get(known, i) for i, holds in branches if holds(known)), mpmath.nan)
        if name in self._functions and len(node.args) == 1:
            inside, function = self._place(node.args[0]), self._functions[name]
            return lambda known: function(get(known, inside))
        return self._opaque(node)

    def _fraction(self, node: Basic) -> tuple[list[int], list[int]]:
        """Factors of a product: those above, and the inverses of those below."""
        above: list[int] = []
        below: list[int] = []
        for factor in node.args:
            inverse = isinstance(factor, Pow) and factor.exp.is_Rational and factor.exp.is_negative
            (below if inverse else above).append(self._place(1 / factor if inverse else factor))
        return above, below

    def _power(self, node: Pow) -> Step:
        get, base = self._get, self._place(node.base)
        if node.exp == S.Half:
            return lambda known: mpmath.sqrt(get(known, base))
        if node.exp.is_Rational and node.exp.is_negative:
            inverse = self._place(1 / node)
            return lambda known: 1 / get(known, inverse)
        if isinstance(node.exp, Integer):
            whole = int(node.exp)
            return lambda known: get(known, base) ** whole
        power = self._place(node.exp)
        return lambda known: get(known, base) ** get(known, power)

    def _condition(self, node: Basic) -> Callable[[Known], bool]:
        get = self._get
        if node in (S.true, S.false):
            return lambda known: node == S.true
        if node.is_Relational and node.rel_op in COMPARED:
            compared = COMPARED[node.rel_op]
            left, right = (self._place(side) for side in node.args)
            return lambda known: bool(compared(get(known, left), get(known, right)))
        holds = self._opaque(node)
        return lambda known: bool(holds(known))

    def _opaque(self, node: Basic) -> Step:
        get = self._get
        symbols, function = self._other(node)
        places = [self._place(symbol) for symbol in symbols]
        return lambda known: function(*(get(known, i) for i in places))


def _unknown(known: Known) -> Any:
    raise ValueError("a symbol has no value")
