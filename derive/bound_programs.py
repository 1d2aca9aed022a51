"""Expressions as programs, to be bounded on many boxes (:mod:`softdyn.derive.bounds`).

Input: an expression, its positive variables, and the intervals of what else is in it. Output: steps, each an operation
on the results of earlier ones, of which equal ones are done once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
from sympy import (
    Abs,
    Add,
    And,
    Basic,
    Eq,
    Expr,
    Ge,
    Gt,
    LambertW,
    Le,
    Lt,
    Max,
    Min,
    Mul,
    Ne,
    Not,
    Or,
    Piecewise,
    Pow,
    S,
    Symbol,
    acos,
    acosh,
    cos,
    cosh,
    erfc,
    exp,
    false,
    log,
    sign,
    sin,
    tan,
    true,
)
from sympy.codegen.cfunctions import expm1, log1p

from softdyn.derive.bessel import Bessel
from softdyn.derive.bounds import INF, ODD, Box, Frame, OutOfReachError, Span, Value, span, wider
from softdyn.derive.special import LOWEST
from softdyn.derive.splines import Spline
from softdyn.derive.splines import bounds as spline_bounds

Step = tuple[str, Any, tuple[int, ...]]


@dataclass(frozen=True)
class BoundProgram:
    """An expression as steps.

    Attributes
    ----------
    steps : tuple of (str, Any, tuple of int)
        Name of the operation, what it needs to know besides, and places of the results that it works on.
    parts : int
        Common denominator of the powers of variables.
    """

    steps: tuple[Step, ...]
    parts: int

    @property
    def has_logarithms(self) -> bool:
        """Whether a logarithm is among the steps."""
        return any(name in ("log", "log1p") for name, _, _ in self.steps)

    def on(self, ends: Sequence[Span], frame: Frame, kept: int = 1, kind: type[Box] = Box) -> tuple[Box, Value]:
        """Value on a box.

        Parameters
        ----------
        ends : sequence of (float, float)
            Of the coordinates.
        frame : tuple of tuples of int
            Logarithms of the variables by coordinates.
        kept : int
            Terms kept of each sum.
        kind : type of Box

        Raises
        ------
        OutOfReachError
            If nothing is known of it.
        """
        box = kind(ends, frame, self.parts, kept)
        found: list[Any] = []
        for name, what, places in self.steps:
            try:
                found.append(_STEPS[name](box, what, [found[place] for place in places]))
            except (OutOfReachError, OverflowError, ZeroDivisionError):
                found.append(None)  # a branch that is not taken may well have no value
        if found[-1] is None:
            raise OutOfReachError
        return box, found[-1]


def bound_program(expr: Expr, variables: Sequence[Symbol], spans: Mapping[Symbol, Span]) -> BoundProgram:
    """Compile an expression.

    Parameters
    ----------
    expr : Expr
    variables : sequence of Symbol
        Those that a box has an interval of, of the logarithm.
    spans : mapping from Symbol to (float, float)
        Other symbols, and the interval in which the value of each is.

    Raises
    ------
    OutOfReachError
        If a function has no bounds here.
    """
    steps: list[Step] = []
    places: dict[Basic, int] = {}
    parts = _parts(expr)

    def visit(node: Basic) -> int:
        if node not in places:
            steps.append(_step(node, list(variables), spans, parts, visit))
            places[node] = len(steps) - 1
        return places[node]

    visit(expr)
    return BoundProgram(tuple(steps), parts)


def _parts(expr: Basic) -> int:
    inner = math.lcm(*map(_parts, expr.args)) if expr.args else 1
    if isinstance(expr, (log, log1p)):
        return 2 * inner  # which roots bound
    return inner * int(expr.exp.q) if isinstance(expr, Pow) and expr.exp.is_Rational else inner


def _step(
    node: Any, variables: list[Symbol], spans: Mapping[Symbol, Span], parts: int, visit: Callable[[Basic], int]
) -> Step:
    if node in variables:
        return "variable", tuple(parts * (symbol == node) for symbol in variables), ()
    if node in spans:
        return "number", spans[node], ()
    if node in (true, false):
        return "truth", bool(node), ()
    if node.is_Rational:
        return "number", Fraction(int(node.p), int(node.q)), ()
    if node.is_number and node.is_real:
        near = float(node)
        return "number", wider(near, near), ()
    if isinstance(node, Pow) and node.exp.is_Rational:
        return "power", Fraction(int(node.exp.p), int(node.exp.q)), (visit(node.base),)
    if isinstance(node, Piecewise):
        return "cases", None, tuple(visit(part) for case in node.args for part in case.args)
    for kinds, name in KINDS:
        if isinstance(node, kinds):
            args = (node.lhs - node.rhs,) if name in ("less", "equal") else node.args
            return name, type(node), tuple(map(visit, args))
    raise OutOfReachError(f"{node} has no bounds here")


KINDS: tuple[tuple[Any, str], ...] = (
    (Add, "+"),
    (Mul, "*"),
    (Pow, "**"),
    (exp, "exp"),
    (expm1, "expm1"),
    (log, "log"),
    (log1p, "log1p"),
    (tuple(ODD), "odd"),
    (cosh, "cosh"),
    ((sin, cos, tan), "circular"),
    ((acos, acosh, erfc, LambertW), "monotone"),
    (Bessel, "bessel"),
    (Spline, "spline"),
    (Abs, "abs"),
    (sign, "sign"),
    ((Max, Min), "extreme"),
    ((Lt, Le, Gt, Ge), "less"),
    ((Eq, Ne), "equal"),
    ((And, Or), "both"),
    (Not, "not"),
)


def _times(box: Box, _: Any, values: list[Any]) -> Value:
    found: Value = values[0]
    for value in values[1:]:
        found = box.product(found, value)
    return found


def _general_power(box: Box, _: Any, values: list[Any]) -> Value:
    base, power = values
    return box.exp(box.product(power, box.log(base)))


def _absolute(box: Box, _: Any, values: list[Any]) -> Value:
    (value,) = values
    if value.sign:
        return value if value.sign > 0 else box.negative(value)
    if len(value.terms) > 1:
        return box.either([value, box.negative(value)])
    return Value(tuple((powers, _sized(span(number))) for powers, number in value.terms))


def _sized(x: Span) -> Span:
    low, high = x
    return (0.0 if low <= 0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))


def _sign(box: Box, _: Any, values: list[Any]) -> Value:
    (value,) = values
    return box.constant(Fraction(value.sign)) if value.sign or not value.terms else box.constant((-1.0, 1.0))


def _extreme(box: Box, kind: Any, values: list[Any]) -> Value:
    left = list(values)
    for one in values:
        for other in values:
            if one in left and other in left and one is not other:
                difference = box.total([one, box.negative(other)]).sign
                if difference:
                    left.remove(one if (difference > 0) == (kind is Min) else other)
    found = box.either(left)
    certain = 1 if kind is Max else -1
    return Value(found.terms, certain if certain in [value.sign for value in values] else found.sign)


def _monotone(box: Box, kind: Any, values: list[Any]) -> Value:
    low, high = box.bounds(values[0])
    if kind is acosh:
        if low < 1:
            raise OutOfReachError
        return box.constant(wider(math.acosh(low), math.acosh(high) if high < INF else INF))
    if kind is LambertW:
        if low < LOWEST:
            raise OutOfReachError
        ends = (float(mpmath.re(mpmath.lambertw(end))) if end < INF else INF for end in (low, high))
        return box.constant(wider(*ends), values[0].sign)
    if kind is acos:
        if low < -1 or high > 1:
            raise OutOfReachError
        return box.constant(wider(math.acos(high), math.acos(low)))
    below, above = wider(math.erfc(high), math.erfc(low))
    return box.constant((max(below, 0.0), above), 1)


def _bessel(box: Box, kind: Any, values: list[Any]) -> Value:
    """I grows and K falls where the argument is positive; |J| is at most 1; of Y nothing is known here."""
    if kind.kind == "j":
        return box.constant((-1.0, 1.0))
    if kind.kind == "y" or values[0].sign <= 0:
        raise OutOfReachError
    # beyond 700 there are bounds, in place of values that have no float
    low, high = (min(max(end, 1e-300), 700.0) for end in box.bounds(values[0]))
    if kind.kind == "i":
        below, above = (float(mpmath.besseli(kind.order, end)) for end in (low, high))
        least = 0.0 if low <= 1e-300 and kind.order else below
        return box.constant((wider(least, least)[0], wider(above, above)[1] if high < 700 else INF), 1)
    below, above = (float(mpmath.besselk(kind.order, end)) for end in (high, low))
    return box.constant(
        (wider(below, below)[0] if high < 700 else 0.0, wider(above, above)[1] if low > 1e-300 else INF), 1
    )


def _spline(box: Box, kind: Any, values: list[Any]) -> Value:
    """Term by term in a piece that starts at 0, where powers of the argument may be as small as one likes."""
    (value,) = values
    low, high = box.bounds(value)
    if low == -INF:
        raise OutOfReachError
    if low >= 0 and kind.points[0] <= 0:
        start, coefficients = kind.piece(S.Zero)
        index = kind.points.index(start) if start == 0 else None
        if index is not None and index + 1 < len(kind.points) and high < float(kind.points[index + 1]):
            numbers = [Fraction(int(c.p), int(c.q)) for c in coefficients]
            powers = [(box.constant(c), box.power(value, Fraction(k))) for k, c in enumerate(numbers) if k and c]
            return box.total([box.constant(numbers[0]), *(box.product(*factors) for factors in powers)])
    least, most = spline_bounds(kind, low, high)
    return box.constant((-INF if least is None else span(least)[0], INF if most is None else span(most)[1]))


def _less(box: Box, kind: Any, values: list[Any]) -> bool | None:
    (difference,) = values
    if difference is None or (difference.terms and not difference.sign):
        return None
    return kind in (Le, Ge) if not difference.terms else (difference.sign < 0) == (kind in (Lt, Le))


def _equal(box: Box, kind: Any, values: list[Any]) -> bool | None:
    (difference,) = values
    if difference is None or (difference.terms and not difference.sign):
        return None
    return (not difference.terms) == (kind is Eq)


def _both(box: Box, kind: Any, values: list[Any]) -> bool | None:
    decisive = kind is Or
    if any(value is decisive for value in values):
        return decisive
    return None if None in values else not decisive


def _cases(box: Box, _: Any, values: list[Any]) -> Value:
    possible = []
    for value, condition in zip(values[::2], values[1::2], strict=True):
        if condition is not False:
            possible.append(value)
        if condition is True:
            break
    if not possible or None in possible:
        raise OutOfReachError
    return box.either(possible)


def _on_known(operation: Callable[[Box, Any, list[Any]], Any]) -> Callable[[Box, Any, list[Any]], Any]:
    """An operation, on values that are known."""

    def done(box: Box, what: Any, values: list[Any]) -> Any:
        if None in values:
            raise OutOfReachError
        return operation(box, what, values)

    return done


_STEPS: dict[str, Callable[[Box, Any, list[Any]], Any]] = {
    "variable": lambda box, powers, _: box.variable(powers),
    "number": lambda box, number, _: box.constant(number),
    "truth": lambda box, truth, _: truth,
    "+": _on_known(lambda box, _, values: box.total(values)),
    "*": _on_known(_times),
    "power": _on_known(lambda box, power, values: box.power(values[0], power)),
    "**": _on_known(_general_power),
    "exp": _on_known(lambda box, _, values: box.exp(values[0])),
    "expm1": _on_known(lambda box, _, values: box.exp(values[0], less=1)),
    "log": _on_known(lambda box, _, values: box.log(values[0])),
    "log1p": _on_known(lambda box, _, values: box.log1p(values[0])),
    "odd": _on_known(lambda box, function, values: box.monotone(function, values[0])),
    "cosh": _on_known(lambda box, _, values: box.cosh(values[0])),
    "circular": _on_known(lambda box, function, values: box.circular(function, values[0])),
    "monotone": _on_known(_monotone),
    "bessel": _on_known(_bessel),
    "spline": _on_known(_spline),
    "abs": _on_known(_absolute),
    "sign": _on_known(_sign),
    "extreme": _on_known(_extreme),
    "less": _less,
    "equal": _equal,
    "both": _both,
    "not": lambda box, _, values: None if values[0] is None else not values[0],
    "cases": _cases,
}
