"""Bounds of expressions over boxes of scales, bounded or not.

Input: an expression in positive variables, and a box: from where to where the logarithm of each may go, to infinity if
need be. Output: its sign, if it has one on the whole box, and bounds of its values.

On a box an expression is a sum of terms, each a number times powers of the variables; the number is exact, or an
interval. Products and powers of monomials are exact, and so are their ranges, also on a box without end: what interval
arithmetic loses there, h/(R + h) - 1 as h -> oo, cancels here term by term. A power or a function of a sum is that of
its largest term, times a series in the others over it; the remainder (Lagrange's) is an interval. Every operation on
numbers is rounded outward.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from sympy import asin, asinh, atan, atanh, erf, sin, sinh, tan, tanh

INF = math.inf
#: Relative width given to what a function of math.h returns: far more than any of them is off.
SLACK = 2.0**-44
#: Exact numbers are kept exact up to so many bits.
EXACT_BITS = 96

Span = tuple[float, float]
Number = Fraction | Span
Powers = tuple[int, ...]
Term = tuple[Powers, Number]
Frame = tuple[tuple[int, ...], ...]


class OutOfReachError(Exception):
    """Nothing is known of a value on a box: a root of what may be negative, a pole."""


# ------------------------------------------------------------------------------------------ numbers, rounded outward


def down(x: float) -> float:
    """The next number below."""
    return math.nextafter(x, -INF)


def up(x: float) -> float:
    """The next number above."""
    return math.nextafter(x, INF)


def wider(low: float, high: float) -> Span:
    """Bounds of what functions of math.h return."""
    return down(low - abs(low) * SLACK) if low > -INF else low, up(high + abs(high) * SLACK) if high < INF else high


def span(x: Number) -> Span:
    """Bounds of a number."""
    if isinstance(x, tuple):
        return x
    try:
        near = x.numerator / x.denominator
    except OverflowError:
        return (1e308, INF) if x > 0 else (-INF, -1e308)
    return (near, near) if Fraction(near) == x else (down(near), up(near))


def add(x: Number, y: Number) -> Number:
    """Sum of two numbers."""
    if isinstance(x, Fraction) and isinstance(y, Fraction):
        return _kept(x + y)
    (a, b), (c, d) = span(x), span(y)
    low, high = a + c, b + d
    # a sum with 0 is exact, and so is one that is 0
    low = low if 0 in (a, c, low) else down(low)
    high = high if 0 in (b, d, high) else up(high)
    return (-INF if math.isnan(low) else low), (INF if math.isnan(high) else high)


def times(x: Number, y: Number) -> Number:
    """Product of two numbers."""
    if isinstance(x, Fraction) and isinstance(y, Fraction):
        return _kept(x * y)
    (a, b), (c, d) = span(x), span(y)
    if a >= 0 and c >= 0:
        high = _product(b, d)
        return max(down(_product(a, c)), 0.0), (up(high) if high else 0.0)
    several = (_product(a, c), _product(a, d), _product(b, c), _product(b, d))
    low, high = min(several), max(several)
    return (down(low) if low else 0.0), (up(high) if high else 0.0)


def _product(x: float, y: float) -> float:
    if x == 0 or y == 0:
        return 0.0
    return x * y or math.copysign(5e-324, x) * math.copysign(1.0, y)


def _kept(x: Fraction) -> Number:
    long = max(x.numerator.bit_length(), x.denominator.bit_length()) > EXACT_BITS
    return span(x) if long else x


def reciprocal(x: Number) -> Number:
    """Inverse of a number that is not 0."""
    if isinstance(x, Fraction):
        return 1 / x
    low, high = x
    if low < 0 < high or low == high == 0:
        raise OutOfReachError
    if low >= 0:
        return max(down(1 / high), 0.0), (up(1 / low) if low > 0 else INF)
    return (down(1 / low) if low > -INF else -0.0), min(0.0, up(1 / high)) if high < 0 else -INF


def raised(x: Span, power: Fraction) -> Span:
    """A power of a number >= 0; not an integer in general."""
    low, high = max(x[0], 0.0), x[1]
    if power < 0:
        low, high = (1 / high if high else INF), (1 / low if low else INF)
        low, high = max(down(low), 0.0), up(high)
        power = -power
    return max(wider(_pow(low, float(power)), 0.0)[0], 0.0), wider(0.0, _pow(high, float(power)))[1]


def _pow(x: float, power: float) -> float:
    try:
        return float(x**power)
    except OverflowError:
        return INF


def exponential(x: Span) -> Span:
    """Bounds of exp."""
    low, high = x
    below = 0.0 if low < -740 else math.exp(low) if low < 700 else 1e304
    above = INF if high > 700 else math.exp(high) if high > -740 else 1e-320
    return max(wider(below, 0.0)[0], 0.0), wider(0.0, above)[1]


def logarithm(x: Span) -> Span:
    """Bounds of log of a number > 0."""
    low = -INF if x[0] <= 0 else math.log(x[0]) if x[0] < INF else 709.0
    high = math.log(x[1]) if 0 < x[1] < INF else (INF if x[1] > 0 else -INF)
    return wider(low, high)


def hull(x: Span, y: Span) -> Span:
    """The shortest interval that holds two."""
    return min(x[0], y[0]), max(x[1], y[1])


# ------------------------------------------------------------------------------------------------ values on a box


@dataclass(frozen=True, slots=True)
class Value:
    """A sum of terms; ``sign`` is 1 or -1 where the whole has one on the whole box, else 0."""

    terms: tuple[Term, ...]
    sign: int = 0


class Box:
    """A box of scales, and what is computed on it.

    Parameters
    ----------
    ends : sequence of (float, float)
        Of the coordinates.
    frame : sequence of sequences of int
        The logarithm of a variable is the sum of the numbers of a row times the coordinates.
    parts : int
        Powers of terms are counted in parts of 1: halves, thirds.
    kept : int
        Terms kept of a sum; with 1, what is not the largest term becomes a part of its number.
    """

    def __init__(self, ends: Sequence[Span], frame: Frame, parts: int, kept: int) -> None:
        self.ends, self.parts, self.kept = tuple(ends), parts, kept
        self.columns = None if all(map(_is_unit, range(len(frame)), frame)) else tuple(zip(*frame, strict=True))
        self.none: Powers = (0,) * len(ends)
        self.point = representative(self.ends, frame)
        self._ranges: dict[Powers, Span] = {}

    # ---------------------------------------------------------------------------------------------- terms

    def variable(self, powers: Powers) -> Value:
        """A variable by itself."""
        return Value(((powers, Fraction(1)),), 1)

    def exponents(self, powers: Powers) -> Span:
        """Bounds of the logarithm of a monomial."""
        low = high = size = 0.0
        if self.columns is not None:
            powers = tuple(sum(map(int.__mul__, powers, column)) for column in self.columns)
        for power, (first, last) in zip(powers, self.ends, strict=True):
            if power:
                one, other = power * first / self.parts, power * last / self.parts
                low, high = low + min(one, other), high + max(one, other)
                size += max(abs(x) for x in (one, other, 0.0) if abs(x) < INF)
        slack = size * 2.0**-48
        return low - slack, high + slack

    def range(self, powers: Powers) -> Span:
        """Bounds of a monomial."""
        if powers == self.none:
            return 1.0, 1.0
        found = self._ranges.get(powers)
        if found is None:
            found = self._ranges[powers] = exponential(self.exponents(powers))
        return found

    def size(self, term: Term) -> float:
        """Logarithm of a term, about in the middle of the box."""
        powers, number = term
        low, high = span(number)
        middle = max(abs(low), abs(high)) if max(abs(low), abs(high)) < INF else 1e300
        return sum(p * x for p, x in zip(powers, self.point, strict=True)) / self.parts + (
            math.log(middle) if middle else -INF
        )

    def sum(self, terms: Sequence[Term], sign_: int = 0) -> Value:
        """Terms together, equal powers once, no more than are kept."""
        collected: dict[Powers, Number] = {}
        for powers, number in terms:
            collected[powers] = add(collected[powers], number) if powers in collected else number
        left = [(powers, number) for powers, number in collected.items() if number != 0]
        sign_ = sign_ or self.sign(left)
        if len(left) > self.kept:
            left.sort(key=self.size, reverse=True)
            kept = dict(left[: self.kept])
            for term in left[self.kept :]:
                self._absorbed(kept, term)
            left = list(kept.items())
        found = tuple(left)
        return Value(found, sign_ or self.sign(found))

    def _absorbed(self, kept: dict[Powers, Number], term: Term) -> None:
        """Make a term a part of the number of another: of the smallest that is larger on the whole box."""
        powers, number = term
        options = []
        for place, other in enumerate(kept):
            quotient = times(self.range(_minus(powers, other)), number)
            over = max(map(abs, span(quotient)))
            options.append((over > 1e-3, over if over > 1e-3 else -place, other, quotient))
        _, _, other, quotient = min(options, key=lambda option: option[:2])
        kept[other] = add(span(kept[other]), quotient)

    def sign(self, terms: Sequence[Term]) -> int:
        """Sign of a sum, if one of its terms tells it; else 0."""
        bounds = [span(number) for _, number in terms]
        if not terms:
            return 0
        if all(low >= 0 for low, _ in bounds) and any(low > 0 for low, _ in bounds):
            return 1
        if all(high <= 0 for _, high in bounds) and any(high < 0 for _, high in bounds):
            return -1
        for powers, number in terms:
            low, high = span(number)
            if low > 0 or high < 0:
                low, high = self.over(terms, powers)
                if low > 0 or high < 0:
                    return 1 if low > 0 else -1
        return 0

    def over(self, terms: Sequence[Term], powers: Powers) -> Span:
        """Bounds of a sum over a monomial."""
        total: Number = Fraction(0)
        for other, number in terms:
            total = add(total, number if other == powers else times(number, self.range(_minus(other, powers))))
        return span(total)

    def leading(self, value: Value) -> Term:
        """The largest term whose number is not 0 anywhere."""
        definite = [term for term in value.terms if span(term[1])[0] > 0 or span(term[1])[1] < 0]
        if not definite:
            # a number that may be as small as one likes, as exp(-h) is
            if value.sign and len(value.terms) == 1:
                return value.terms[0]
            raise OutOfReachError
        return max(definite, key=self.size)

    def bounds(self, value: Value) -> Span:
        """Bounds of a value."""
        if not value.terms:
            return 0.0, 0.0
        low, high = -INF, INF
        total: Number = Fraction(0)
        for powers, number in value.terms:
            total = add(total, times(number, self.range(powers)))
        low, high = span(total)
        if len(value.terms) > 1:
            for powers, _ in value.terms:
                one, other = span(times(self.over(value.terms, powers), self.range(powers)))
                low, high = max(low, one), min(high, other)
        if value.sign > 0:
            low = max(low, 0.0)
        if value.sign < 0:
            high = min(high, 0.0)
        return low, high

    # ------------------------------------------------------------------------------------------ operations

    def constant(self, number: Number, sign_: int = 0) -> Value:
        """A number."""
        if number == 0:
            return Value(())
        low, high = span(number)
        return Value(((self.none, number),), sign_ or (low > 0) - (high < 0))

    def total(self, values: Sequence[Value]) -> Value:
        """A sum."""
        signs = {value.sign for value in values if value.terms}
        one_sign = signs.pop() if len(signs) == 1 else 0
        return self.sum([term for value in values for term in value.terms], one_sign)

    def product(self, one: Value, other: Value) -> Value:
        """A product."""
        terms = [
            (tuple(map(int.__add__, powers, more)), times(number, factor))
            for powers, number in one.terms
            for more, factor in other.terms
        ]
        return self.sum(terms, one.sign * other.sign)

    def negative(self, value: Value) -> Value:
        """The same with the other sign."""
        return Value(tuple((p, times(n, Fraction(-1))) for p, n in value.terms), -value.sign)

    def power(self, value: Value, power: Fraction) -> Value:
        """A rational power."""
        if power.denominator == 1 and 0 <= power <= 8:
            found = self.constant(Fraction(1))
            for _ in range(int(power)):
                found = self.product(found, value)
            even = power % 2 == 0 and value.sign != 0
            return Value(found.terms, 1 if even else found.sign)
        if not value.terms:
            if power > 0:
                return value
            raise OutOfReachError
        if power.denominator == 1 and value.sign < 0:
            found = self.power(self.negative(value), power)
            return found if power % 2 == 0 else self.negative(found)
        if value.sign <= 0:
            raise OutOfReachError
        powers, number = self.leading(value)
        if span(number)[1] <= 0:  # a positive sum, but not by its largest term
            raise OutOfReachError
        first = Value(((tuple(p * power.numerator // power.denominator for p in powers), _power(number, power)),), 1)
        rest = self._rest(value, powers, number)
        low, high = self.bounds(rest)
        if not rest.terms:
            return first
        if self.kept > 1 and low >= -0.5 and high <= 0.5:
            series = [Fraction(1)]
            for k in range(1, self.kept + 1):
                series.append(series[-1] * (power - k + 1) / k)
            inner = raised((max(down(1 + min(low, 0.0)), 0.0), up(1 + max(high, 0.0))), power - self.kept)
            factor = self._series([*series[:-1], times(series[-1], inner)], rest)
        else:
            factor = self.constant(raised((max(down(1 + low), 0.0), up(1 + high)), power), 1)
        found = self.product(first, factor)
        return Value(found.terms, 1)

    def _rest(self, value: Value, powers: Powers, number: Number) -> Value:
        """What a sum over one of its terms is besides 1."""
        inverse = reciprocal(number)
        terms = [(_minus(p, powers), times(n, inverse)) for p, n in value.terms if p != powers]
        return Value(tuple(terms), self.sign(terms))

    def _series(self, numbers: Sequence[Number], value: Value) -> Value:
        """A polynomial of a value."""
        found = self.constant(numbers[-1])
        for number in reversed(numbers[:-1]):
            found = self.total([self.product(found, value), self.constant(number)])
        return found

    def exp(self, value: Value, less: int = 0) -> Value:
        """exp(x), or exp(x) - 1."""
        low, high = self.bounds(value)
        sign_ = value.sign if less else 1
        if self.kept > 1 and low >= -1 and high <= 1:
            numbers: list[Number] = [Fraction(1, math.factorial(k)) for k in range(self.kept)]
            last = times(Fraction(1, math.factorial(self.kept)), exponential((min(low, 0.0), max(high, 0.0))))
            numbers = [Fraction(1 - less), *numbers[1:], last]
            found = self._series(numbers, value)
            return Value(found.terms, sign_ or found.sign)
        found_span = exponential((low, high))
        if less:
            if value.sign > 0 and high < INF:  # between x and x (exp(b) - 1)/b
                slope = wider(1.0, math.expm1(high) / high if 0 < high < 700 else INF if high else 1.0)
                return Value(self.product(value, self.constant((1.0, slope[1]))).terms, 1)
            if value.sign < 0 and low > -INF:
                slope = wider(math.expm1(low) / low if low else 1.0, 1.0)
                return Value(self.product(value, self.constant((slope[0], 1.0))).terms, -1)
            found_span = down(found_span[0] - 1), up(found_span[1] - 1)
        return self.constant(found_span, sign_)

    def log(self, value: Value) -> Value:
        """The natural logarithm."""
        if value.sign <= 0:
            raise OutOfReachError
        powers, number = self.leading(value)
        rest = self._rest(value, powers, number)
        unit = powers == self.none and number == 1
        more = self.log1p(rest)
        if unit:
            return more
        known = self._log_of_term(powers, number)
        if not rest.terms:
            return known
        both = self.total([known, self.constant(self.bounds(more))])
        one = [term for term in value.terms if term == (self.none, Fraction(1))]
        if one:  # log(1 + x), with a large x: its sign is that of x
            others = [term for term in value.terms if term not in one]
            return Value(both.terms, both.sign or self.sign(others))
        return both

    def _log_of_term(self, powers: Powers, number: Number) -> Value:
        """The logarithm of a term; without end, as a part of the term's root: log(z) < 0.736 sqrt(z), z > 1."""
        low, high = span(add(self.exponents(powers), logarithm(span(number))))
        if (low == -INF) == (high == INF):
            return self.constant((low, high))
        out, end = (1, low) if high == INF else (-1, high)
        root = Value(((powers, number),), 1)
        root = self.product(self.power(root, Fraction(out, 2)), self.constant(exponential((-out * end / 2,) * 2)))
        part = self.product(root, self.constant((0.0, 0.736) if out > 0 else (-0.736, 0.0)))
        return self.total([self.constant((end, end)), part])

    def log1p(self, value: Value) -> Value:
        """log(1 + x)."""
        low, high = self.bounds(value)
        if self.kept > 1 and low >= -0.5 and high <= 0.5:
            numbers: list[Number] = [Fraction(0)]
            numbers += [Fraction((-1) ** (k + 1), k) for k in range(1, self.kept)]
            inner = raised((down(1 + min(low, 0.0)), up(1 + max(high, 0.0))), Fraction(-self.kept))
            found = self._series([*numbers, times(Fraction((-1) ** (self.kept + 1), self.kept), inner)], value)
            return Value(found.terms, value.sign or found.sign)
        if value.sign > 0 and 0 < high < INF:  # between x log(1 + b)/b and x
            slope = wider(math.log1p(high) / high, 1.0)
            if low < 1e-3 * high or low < 0.1:
                return Value(self.product(value, self.constant((max(slope[0], 0.0), 1.0))).terms, 1)
        below = max(down(1 + low), 0.0)
        if high == INF and 4 < low < INF:  # log(1 + x)/sqrt(x) falls from there on
            first = logarithm((below, below))
            part = self.product(self.power(value, Fraction(1, 2)), self.constant((0.0, up(first[1] / math.sqrt(low)))))
            return Value(self.total([self.constant(first), part]).terms, 1)
        bounds = logarithm((below, up(1 + high)))
        return self.constant(bounds, value.sign)

    def monotone(self, function: Any, value: Value) -> Value:
        """An odd function that grows: sinh, tanh, asinh, atanh, asin, atan, erf."""
        low, high = self.bounds(value)
        if function in ON_UNIT and (low < -1 or high > 1):
            raise OutOfReachError
        first, third = ODD[function]
        if self.kept > 1 and low >= -0.5 and high <= 0.5:
            cubic = self.total([value, self.product(self.constant(third), self.power(value, Fraction(3)))])
            return Value(self.product(self.constant(first), cubic).terms, value.sign)
        ends = _at(function, low), _at(function, high)
        if value.sign > 0 and low <= 1e-3 * high and 0 < high < INF and ends[1] < INF:
            slopes = sorted((span(first)[1], ends[1] / high))  # f(x)/x goes from one to the other
            between = wider(slopes[0] * (1 - SLACK), slopes[1])
            return Value(self.product(value, self.constant((max(between[0], 0.0), between[1]))).terms, 1)
        return self.constant(wider(*ends), value.sign)

    def cosh(self, value: Value) -> Value:
        """cosh(x), by exp(|x|)."""
        low, high = self.bounds(value)
        if self.kept > 1 and max(abs(low), abs(high)) <= 0.5:
            return self._series([Fraction(1), Fraction(0), Fraction(1, 2), Fraction(0), (1 / 24, 1.13 / 24)], value)
        near, far = (0.0 if low <= 0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))
        bounds = wider(math.cosh(near) if near < 700 else 1e303, math.cosh(far) if far < 700 else INF)
        return self.constant((max(bounds[0], 1.0), bounds[1]), 1)

    def circular(self, function: Any, value: Value) -> Value:
        """Sine, cosine, tangent."""
        low, high = self.bounds(value)
        if not high - low < 3:
            if function is tan:
                raise OutOfReachError
            return self.constant((-1.0, 1.0))
        one, other = (getattr(math, function.__name__)(end) for end in (low, high))
        if function is tan:
            if not (math.cos(low) * math.cos(high) > 1e-9 and one <= other):
                raise OutOfReachError
            return self.constant(wider(one, other))
        bounds = wider(min(one, other), max(one, other))
        shift = 0.25 if function is sin else 0.0
        for extreme, at in ((1.0, shift), (-1.0, shift + 0.5)):
            first = math.ceil(low / (2 * math.pi) - at - 1e-9)
            if first + at <= high / (2 * math.pi) + 1e-9:
                bounds = hull(bounds, (extreme, extreme))
        return self.constant((max(bounds[0], -1.0), min(bounds[1], 1.0)))

    def either(self, values: Sequence[Value]) -> Value:
        """One of several values."""
        if all(value == values[0] for value in values):
            return values[0]
        signs = {value.sign for value in values}
        sign_ = signs.pop() if len(signs) == 1 else 0
        filled = [value for value in values if value.terms]
        if not filled:
            return Value(())
        powers = max((term for value in filled for term in value.terms), key=self.size)[0]
        bounds = self.over(values[0].terms, powers)
        for value in values[1:]:
            bounds = hull(bounds, self.over(value.terms, powers))
        return Value(((powers, bounds),), sign_)


def _minus(powers: Powers, other: Powers) -> Powers:
    return tuple(map(int.__sub__, powers, other))


def _power(number: Number, power: Fraction) -> Number:
    if isinstance(number, Fraction):
        if power.denominator == 1:
            return _kept(number ** int(power))
        both = (number.numerator, number.denominator)
        if all(0 < part < 2**50 for part in both):
            roots = [round(part ** (1 / power.denominator)) for part in both]
            if Fraction(roots[0] ** power.denominator, roots[1] ** power.denominator) == number:
                return _kept(Fraction(*roots) ** power.numerator)
    return raised(span(number), power)


def _is_unit(at: int, row: Sequence[int]) -> bool:
    return all(number == (i == at) for i, number in enumerate(row))


def unit_frame(size: int) -> Frame:
    """Coordinates that are the logarithms themselves."""
    return tuple(tuple(int(i == j) for j in range(size)) for i in range(size))


def representative(ends: Sequence[Span], frame: Frame) -> tuple[float, ...]:
    """Logarithms of the variables at a point of a box: the middle, or well within what has no end."""
    point = []
    for low, high in ends:
        if low == -INF and high == INF:
            point.append(0.0)
        elif low == -INF or high == INF:
            point.append(high - 7.0 if low == -INF else low + 7.0)
        else:
            point.append(low + (high - low) / 2)
    return tuple(sum(map(float.__mul__, map(float, row), point)) for row in frame)


#: Odd functions that grow: the slope at 0, and over it f'''/6 for abs(x) <= 1/2. For x > 0, f(x)/x is monotone.
ODD: dict[Any, tuple[Number, Span]] = {
    sinh: (Fraction(1), (0.1666, 0.1880)),
    tanh: (Fraction(1), (-0.3334, -0.0942)),
    asinh: (Fraction(1), (-0.1667, -0.0476)),
    atanh: (Fraction(1), (0.3333, 1.3829)),
    asin: (Fraction(1), (0.1666, 0.5133)),
    atan: (Fraction(1), (-0.3334, -0.0426)),
    erf: (wider(2 / math.sqrt(math.pi), 2 / math.sqrt(math.pi)), (-0.3334, -0.1297)),
}
ON_UNIT = (asin, atanh)
ENDS = {sinh: INF, tanh: 1.0, asinh: INF, atanh: INF, asin: math.pi / 2, atan: math.pi / 2, erf: 1.0}


def _at(function: Any, x: float) -> float:
    if abs(x) == INF or (function is atanh and abs(x) == 1) or (function is sinh and abs(x) > 700):
        return math.copysign(ENDS[function], x)
    return float(getattr(math, function.__name__)(x))
