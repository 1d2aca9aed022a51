"""Proofs that a quantity is positive, wherever a law holds.

Input: an expression, and the domain of its symbols. Output: *positive*, a *witness* (numbers at which it is not), or
*unknown*, with the box that is left.

Branch and bound: the domain is a box in the logarithms of the variables, without end where these may be as small or as
large as one likes. A box on which the sign of the expression is certain (:mod:`softdyn.derive.bounds`) is done; another
is looked at in a point, and halved. Effort is counted in boxes, so that the answer is the same on any machine.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations, product
from types import MappingProxyType
from typing import Literal

import mpmath
from sympy import (
    Abs,
    Add,
    Basic,
    Dummy,
    Expr,
    Integer,
    Interval,
    Matrix,
    Max,
    Min,
    Mul,
    Piecewise,
    Pow,
    Rational,
    S,
    Symbol,
    bottom_up,
    lambdify,
    oo,
)
from sympy.core.relational import Relational

from softdyn.derive.bound_programs import BoundProgram, bound_program
from softdyn.derive.bounds import (
    INF,
    Box,
    Frame,
    OutOfReachError,
    Span,
    Value,
    down,
    representative,
    span,
    unit_frame,
    up,
)
from softdyn.derive.logarithm_bounds import LogarithmBox
from softdyn.derive.patience import nodes, spend
from softdyn.derive.soundness import rewritable, tidy
from softdyn.derive.symbols import h

#: Boxes looked at, at most, for one quantity on one side.
MOST = 200
#: Terms kept of sums where one is not enough.
KEPT = 4
#: Logarithms beyond which nothing is cut, and those of numbers that can be shown as witnesses.
FARTHEST, SHOWN = 2000.0, 690.0
#: Digits with which a number that is not positive is looked at again: it must stay what it is.
CERTAIN = (40, 400, 1200)
#: Sides of a box are not cut below this.
SHORTEST = 1e-9

Verdict = Literal["positive", "witness", "unknown"]


@dataclass(frozen=True)
class Positivity:
    """What is known of the sign of a quantity.

    Attributes
    ----------
    verdict : "positive", "witness" or "unknown"
    at : dict
        Numbers at which it is not positive, by the names of the symbols; of a witness.
    value : number or None
        What it is there.
    left : dict
        Box in which nothing is known, by the names of the symbols: from where to where.
    boxes : int
        Boxes looked at.
    """

    verdict: Verdict
    at: dict[str, mpmath.mpf] = field(default_factory=dict)
    value: mpmath.mpf | mpmath.mpc | None = None
    left: dict[str, Span] = field(default_factory=dict)
    boxes: int = 0


@dataclass(frozen=True)
class Range:
    """A part of a symbol's values: an expression in a positive variable, and the ends of its logarithm."""

    expression: Expr
    variable: Symbol | None
    ends: Span = (-INF, INF)


Domain = tuple[tuple[Symbol, tuple[Range, ...]], ...]


@lru_cache(maxsize=128)
def ranges_of_positive(name: str, most: Rational | None = None) -> tuple[Range, ...]:
    """All positive numbers, or those below one."""
    variable = Dummy(name, positive=True)
    return (Range(variable, variable, (-INF, INF if most is None else logarithm_of(most))),)


@lru_cache(maxsize=128)
def ranges_between(name: str, allowed: Interval) -> tuple[Range, ...]:
    """The numbers of an interval: ends that belong to it, and distances from an end that is left out."""
    low, high = Rational(allowed.start), Rational(allowed.end)
    one, other = Dummy(name, positive=True), Dummy(name, positive=True)
    ends = [(low, allowed.left_open), (high, allowed.right_open)]
    points = tuple(Range(end, None) for end, is_open in ends if not is_open)
    if not allowed.right_open:
        return (*points, Range(low + one, one, (-INF, logarithm_of(high - low))))
    half = (-INF, logarithm_of((high - low) / 2))
    return (*points, Range(low + one, one, half), Range(high - other, other, half))


@lru_cache(maxsize=128)
def ranges_of_real(name: str) -> tuple[Range, ...]:
    """All real numbers."""
    one, other = Dummy(name, positive=True), Dummy(name, positive=True)
    return Range(one, one), Range(-other, other), Range(S.Zero, None)


def ranges_of_symbol(symbol: Symbol, allowed: Interval | None) -> tuple[Range, ...]:
    """Values of a symbol: those of an interval that its assumptions allow, or all that they do."""
    if allowed is not None:
        low, high = Rational(allowed.start), Rational(allowed.end)
        inside = Interval(0, high, True, allowed.right_open) if symbol.is_positive and low <= 0 else allowed
        return ranges_between(symbol.name, inside)
    parts = ranges_of_positive(symbol.name) if symbol.is_positive else ranges_of_real(symbol.name)
    return tuple(part for part in parts if part.expression.is_nonnegative or not symbol.is_nonnegative)


#: Values that parameters may take, where a law that is looked at declares a range of them.
_allowed: ContextVar[Mapping[Symbol, Interval]] = ContextVar("allowed", default=MappingProxyType({}))
#: Boxes looked at for the sign of a coefficient.
FEW = 40


@contextmanager
def knowing_ranges(ranges: Mapping[Symbol, Interval]) -> Iterator[None]:
    """Let some work know which values parameters may take."""
    token = _allowed.set(ranges)
    try:
        yield
    finally:
        _allowed.reset(token)


def range_known(symbol: Expr) -> Interval | None:
    """Return the values that a parameter may take, if that is known here."""
    return _allowed.get().get(symbol)


def sides_taken(expr: Expr) -> frozenset[int]:
    """Return which signs an expression may have, its parameters being within their ranges.

    Returns
    -------
    frozenset of int
        {1}, {-1} or {0}; {1, -1} if it is shown to have both; empty if it is not known.
    """
    symbols = sorted(expr.free_symbols, key=str)
    domain = tuple((symbol, ranges_of_symbol(symbol, _allowed.get().get(symbol))) for symbol in symbols)
    spend(FEW * nodes(expr))
    try:
        found = [(side, positivity(side * expr, domain, FEW)) for side in (1, -1)]
    except (TypeError, ValueError, NotImplementedError):  # it has no real value
        return frozenset()
    for side, one in found:
        if one.verdict == "positive":
            return frozenset({side})
    # where it is not positive it is negative, or 0
    values = [one.value for _, one in found if one.verdict == "witness"]
    return frozenset({1, -1}) if len(values) == 2 and all(mpmath.im(x) == 0 for x in values) else frozenset()


def knows_range_in(expr: Expr) -> bool:
    """Whether the range of a parameter in an expression is known here."""
    return not _allowed.get().keys().isdisjoint(expr.free_symbols)


def logarithm_of(number: Rational) -> float:
    """Upper bound of the logarithm of a number."""
    exact = mpmath.log(mpmath.mpf(int(number.p)) / int(number.q))
    return up(float(exact)) if exact else 0.0


def positivity(expr: Expr, domain: Domain, most: int = MOST) -> Positivity:
    """Prove that an expression is positive, or show where it is not.

    Parameters
    ----------
    expr : Expr
    domain : tuple of (Symbol, tuple of Range)
        Of each symbol.
    most : int
        Boxes looked at, at most, in each part of the domain.
    """
    # factors that are positive by themselves do not matter, nor do symbols that are in these alone
    rest = Mul(*(factor for factor in Mul.make_args(expr) if not factor.is_positive))
    found = _positivity(rest, tuple((s, ranges) for s, ranges in domain if s in rest.free_symbols), most)
    return _positivity(expr, domain, most) if found.verdict == "witness" and rest != expr else found


@lru_cache(maxsize=512)
def _positivity(expr: Expr, domain: Domain, most: int) -> Positivity:
    found = _on_domain(expr, domain, most)
    if found.verdict != "unknown":
        return found
    again = _on_domain(*_in_reduced_gap(expr, domain), most)
    return replace(found if again.verdict == "unknown" else again, boxes=found.boxes + again.boxes)


def _on_domain(expr: Expr, domain: Domain, most: int) -> Positivity:
    looked = 0
    left: dict[str, Span] = {}
    relevant = [(symbol, ranges) for symbol, ranges in domain if symbol in expr.free_symbols]
    for parts in product(*(ranges for _, ranges in relevant)):
        found = _on_part(expr, {symbol: part for (symbol, _), part in zip(relevant, parts, strict=True)}, most)
        looked += found.boxes
        if found.verdict == "witness":
            return replace(found, boxes=looked)
        if found.verdict == "unknown" and not left:
            left = found.left
    return Positivity("unknown" if left else "positive", left=left, boxes=looked)


def _in_reduced_gap(expr: Expr, domain: Domain) -> tuple[Expr, Domain]:
    """The same in x = h/(1 + h), which laws are often made of: then fractions of it cancel."""
    x = Dummy("x", positive=True)
    whole = (Range(x / (1 - x), x, (-INF, 0.0)),)
    return expr, tuple((symbol, whole if symbol == h else ranges) for symbol, ranges in domain)


def _cancelled(expr: Expr) -> Expr:
    """An expression with every fraction in it as simple as it can be, as a sum where that is as short."""

    def simplest(node: Basic) -> Basic:
        if not isinstance(node, (Add, Mul)) or not rewritable(node) or not node.is_rational_function():
            return node
        quotient = node.cancel()
        return min((quotient.expand(), quotient, quotient.factor()), key=lambda form: form.count_ops())

    return bottom_up(expr, simplest)


def _on_part(expr: Expr, parts: Mapping[Symbol, Range], most: int) -> Positivity:
    here = tidy(expr.subs({symbol: part.expression for symbol, part in parts.items()}))
    if any(part.expression.has(Pow) for part in parts.values()):
        here = _cancelled(here)
    if here.is_positive:
        return Positivity("positive")
    free = tuple(v for part in parts.values() if (v := part.variable) is not None and part.ends == (-INF, INF))
    units = dict.fromkeys(scalable(here, free), Integer(1))
    here = here.subs(units)
    parts = {
        s: Range(part.expression.subs(units), None) if part.variable in units else part for s, part in parts.items()
    }
    known = [part for part in parts.values() if part.variable is not None]
    variables = [part.variable for part in known if part.variable is not None]
    forms = [here]
    if rewritable(here):
        forms.append(here.factor())
        if forms[1].is_positive:
            return Positivity("positive")
    programs = []
    for form in dict.fromkeys(forms):
        try:
            programs.append(bound_program(form, variables, {}))
        except OutOfReachError:
            continue
    search = _Search(expr, parts, variables, programs)
    return search.run(tuple(part.ends for part in known), most)


def scalable(expr: Expr, variables: Sequence[Symbol]) -> tuple[Symbol, ...]:
    """Variables that may be set to 1: scaling these together with others changes the expression by a factor alone."""
    conditions: list[Matrix] = []
    zero = Matrix([[0] * len(variables)])

    def degree(node: Basic) -> Matrix:
        if node in variables:
            return Matrix([[int(node == symbol) for symbol in variables]])
        if isinstance(node, Mul):
            return sum(map(degree, node.args), zero)
        if isinstance(node, Pow) and node.exp.is_Rational:
            return degree(node.base) * node.exp
        if isinstance(node, Relational):
            return same([node.lhs, node.rhs])
        if isinstance(node, (Add, Max, Min)):
            return same(node.args)
        if isinstance(node, Piecewise):
            for _, condition in node.args:
                degree(condition)
            return same([case for case, _ in node.args])
        if isinstance(node, Abs):
            return degree(node.args[0])
        conditions.extend(degree(part) for part in node.args)
        return zero

    def same(parts: Sequence[Basic]) -> Matrix:
        degrees = [degree(part) for part in parts if part != 0]
        conditions.extend(other - degrees[0] for other in degrees[1:])
        return degrees[0] if degrees else zero

    degree(expr)
    scalings = Matrix.vstack(zero, *conditions).nullspace()
    _, pivots = Matrix.hstack(*scalings).T.rref() if scalings else (None, ())
    return tuple(variables[i] for i in pivots)


Part = tuple[tuple[Span, ...], Frame]


class _Search:
    """Branch and bound on one part of the domain."""

    def __init__(
        self, expr: Expr, parts: Mapping[Symbol, Range], variables: Sequence[Symbol], programs: Sequence[BoundProgram]
    ) -> None:
        self.expr, self.parts, self.variables, self.programs = expr, parts, variables, programs
        self.function = lambdify(list(parts), expr, modules="mpmath", dummify=True)

    def run(self, whole: tuple[Span, ...], most: int) -> Positivity:
        waiting: deque[Part] = deque([(whole, unit_frame(len(whole)))])
        looked = 0
        left: list[Part] = []
        while waiting:
            part = waiting.popleft()
            looked += 1
            if self.positive(part):
                continue
            at = self.witness(representative(*part))
            if at is not None:
                return Positivity("witness", *at, boxes=looked)
            halves = self.halves(part) if looked < most else None
            if halves is None:
                left.append(part)
            else:
                waiting += halves
        if not left:
            return Positivity("positive", boxes=looked)
        return Positivity("unknown", left=self._shown(left), boxes=looked)

    def positive(self, part: Part) -> bool:
        """Whether the expression is certainly positive on a box."""
        tried = [(program, kept, Box) for kept in (1, KEPT) for program in self.programs]
        tried += [(program, KEPT, LogarithmBox) for program in self.programs if program.has_logarithms]
        for program, kept, kind in tried:
            try:
                if program.on(*part, kept, kind)[1].sign > 0:
                    return True
            except OutOfReachError:
                continue
        return False

    def halves(self, part: Part) -> tuple[Part, Part] | None:
        """The two parts of a box, cut across the coordinate that matters most: most is known where it is fixed."""
        best, most = None, (-INF, -INF)
        for first, last, i in (*_diagonals(part), *_cuts(part)):
            fixed = sum(self.known(_fixed(half, k)) for half, k in ((first, i[0]), (last, i[1])))
            width = part[0][i[0]][1] - part[0][i[0]][0]
            if (fixed, width) > most:
                best, most = (first, last), (fixed, width)
        return best

    def known(self, part: Part) -> float:
        """How near a box is to be decided: 1 if it is."""
        best = -2.0
        for program in self.programs:
            try:
                best = max(best, _nearness(*program.on(*part, KEPT)))
            except OutOfReachError:
                continue
        return best

    def witness(self, point: Sequence[float]) -> tuple[dict[str, mpmath.mpf], mpmath.mpf] | None:
        """Numbers at which the expression is not positive, at or beside a point; None if it is."""
        if any(abs(x) > SHOWN for x in point):
            return None
        for digits in (3, 17):
            with mpmath.workdps(40):
                scales = {v: mpmath.exp(x) for v, x in zip(self.variables, point, strict=True)}
                try:
                    numbers = [_number(part, scales, digits) for part in self.parts.values()]
                except ZeroDivisionError:
                    return None  # at an end that is left out
            found = self.not_positive(numbers)
            if found is not None:
                return {symbol.name: number for symbol, number in zip(self.parts, numbers, strict=True)}, found
        return None

    def not_positive(self, numbers: Sequence[mpmath.mpf]) -> mpmath.mpf | None:
        """The value at a point, if it is certainly not positive: more digits leave it as it is."""
        last = None
        for digits in CERTAIN:
            with mpmath.workdps(digits):
                found = self.value(numbers)
                if found is None or (mpmath.im(found) == 0 and mpmath.re(found) > 0):
                    return None
                if last is not None and abs(found - last) > abs(found) * mpmath.mpf(10) ** -10:
                    last = None if digits == CERTAIN[-1] else found
                else:
                    last = found
        if last == 0:
            exact = {s: Rational(*mpmath.libmp.to_rational(x._mpf_)) for s, x in zip(self.parts, numbers, strict=True)}
            return last if self.expr.subs(exact).is_zero else None
        return last

    def value(self, numbers: Sequence[mpmath.mpf]) -> mpmath.mpf | None:
        try:
            return self.function(*numbers)
        except (ZeroDivisionError, ValueError, OverflowError):
            return None

    def _shown(self, left: Sequence[Part]) -> dict[str, Span]:
        """Box around what is left, by the names of the symbols."""
        shown = {}
        for symbol, part in self.parts.items():
            if part.variable is None:
                continue
            row = self.variables.index(part.variable)
            logarithms = [_extent(ends, frame[row]) for ends, frame in left]
            ends = _exp(min(low for low, _ in logarithms)), _exp(max(high for _, high in logarithms))
            values = [_at_end(part.expression, part.variable, end) for end in ends]
            shown[symbol.name] = (min(values), max(values))
        return shown


def _extent(ends: Sequence[Span], row: Sequence[int]) -> Span:
    """From where to where the logarithm of a variable goes on a box."""
    sides = [(number * low, number * high) for number, (low, high) in zip(row, ends, strict=True) if number]
    return sum(map(min, sides)), sum(map(max, sides))


def _fixed(part: Part, i: int) -> Part:
    """A box on which one coordinate is fixed, somewhere in the middle."""
    ends, frame = part
    (middle,) = representative((ends[i],), ((1,),))
    return (*ends[:i], (middle, middle), *ends[i + 1 :]), frame


def _cuts(part: Part) -> Iterator[tuple[Part, Part, tuple[int, int]]]:
    """Halves of a box, across each side that may be cut, and which that is."""
    ends, frame = part
    for i, (low, high) in enumerate(ends):
        cut = _cut((low, high))
        if cut is not None:
            first, last = (*ends[:i], (low, cut), *ends[i + 1 :]), (*ends[:i], (cut, high), *ends[i + 1 :])
            yield (first, frame), (last, frame), (i, i)


def _diagonals(part: Part) -> Iterator[tuple[Part, Part, tuple[int, int]]]:
    """Halves of a corner without end, along the diagonal of two of its sides; their new coordinates."""
    ends, frame = part
    endless = [i for i, (low, high) in enumerate(ends) if (low == -INF) != (high == INF)]
    for i, j in combinations(endless, 2):
        yield _beside(ends, frame, i, j), _beside(ends, frame, j, i), (i, j)


def _beside(ends: tuple[Span, ...], frame: Frame, i: int, j: int) -> Part:
    """The part of a corner in which one coordinate is farther out than another: what it is farther is the new one.

    With v_i = t + s v_j, s the sign of one's direction by the other's.
    """
    (low, high), (first, last) = ends[i], ends[j]
    out, along = (1 if high == INF else -1), (1 if last == INF else -1)
    start, other = (low if out > 0 else high), (first if along > 0 else last)
    sign_ = out * along
    new = start - sign_ * other
    new = down(new) if out > 0 else up(new)
    side = (new, INF) if out > 0 else (-INF, new)
    rows = tuple(tuple(number + sign_ * row[i] if k == j else number for k, number in enumerate(row)) for row in frame)
    return (*ends[:i], side, *ends[i + 1 :]), rows


def _at_end(expr: Expr, variable: Symbol, end: float) -> float:
    value = expr.subs(variable, oo if end == INF else end)
    return float(value) if value.is_finite else INF if value != -oo else -INF


def _exp(x: float) -> float:
    return math.exp(x) if x < 700 else INF


def _number(part: Range, scales: Mapping[Symbol, mpmath.mpf], digits: int) -> mpmath.mpf:
    """A number of few digits in a range, near a point of it."""
    if part.variable is None:
        return mpmath.mpf(int(part.expression.p)) / int(part.expression.q)
    scale = mpmath.mpf(mpmath.nstr(scales[part.variable], digits))
    if scale >= mpmath.exp(part.ends[1]):
        scale = scales[part.variable]
    value = part.expression.subs(part.variable, Symbol("x"))
    return lambdify(Symbol("x"), value, modules="mpmath")(scale)


def _nearness(box: Box, value: Value) -> float:
    if value.sign > 0:
        return 1.0
    best = -1.0
    for powers, number in value.terms:
        if span(number)[0] > 0:
            low, high = box.over(value.terms, powers)
            if low > -INF and high < INF:
                best = max(best, low / max(abs(low), abs(high)))
    return best


def _cut(side: Span) -> float | None:
    low, high = side
    if low == -INF and high == INF:
        return 0.0
    if low == -INF:
        return high - max(6.0, abs(high)) if high > -FARTHEST else None
    if high == INF:
        return low + max(6.0, abs(low)) if low < FARTHEST else None
    return low + (high - low) / 2 if high - low > SHORTEST else None
