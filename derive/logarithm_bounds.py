"""Bounds on boxes of scales where the logarithm of a variable is a factor of its own, tied to it.

Input and output are those of :mod:`softdyn.derive.bounds`. Here a term is a number times powers of the variables and of
the sizes of their logarithms, so that log(6 b/h) - log(h/b)/2 cancels term by term where h/b is as small as one likes.
A variable x and L = abs(log(x)) are one coordinate, y = log(x): on an interval, the logarithm of x^p L^q, which is
p y + q log(abs(y)), is extreme at an end, or at y = -q/p.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from softdyn.derive.bounds import INF, Box, Frame, Number, OutOfReachError, Powers, Span, Term, Value, logarithm, span

#: Logarithms of variables and of their logarithms have this relative error.
SLACK = 2.0**-48


class LogarithmBox(Box):
    """A box on which logarithms of variables are factors of terms, where their sign is known."""

    def __init__(self, ends: Sequence[Span], frame: Frame, parts: int, kept: int) -> None:
        super().__init__(ends, frame, parts, kept)
        self.none = (0,) * (2 * len(ends))
        self.extents = [_extent(self.ends, row) for row in frame]
        self.signs = [1 if low > 0 else -1 if high < 0 else 0 for low, high in self.extents]

    def variable(self, powers: Powers) -> Value:
        """A variable by itself."""
        return Value((((*powers, *(0 for _ in powers)), Fraction(1)),), 1)

    def exponents(self, powers: Powers) -> Span:
        """Bounds of the logarithm of a product of powers of variables and of their logarithms."""
        count = len(self.ends)
        plain, logarithms = powers[:count], powers[count:]
        if not any(logarithms):
            return super().exponents(plain)
        # with coordinates that are no logarithms of variables, the two factors are bounded one by one
        alone = self.columns is None
        low = high = 0.0
        if not alone:
            low, high = super().exponents(plain)
        for power, number, ends in zip(plain, logarithms, self.extents, strict=True):
            p, q = power / self.parts if alone else 0.0, number / self.parts
            if not p and not q:
                continue
            values = [_exponent(p, q, y) for y in ends]
            if p and q and ends[0] < -q / p < ends[1]:
                values.append(_exponent(p, q, -q / p))
            low, high = low + min(values) - _slack(p, q, ends), high + max(values) + _slack(p, q, ends)
        return low, high

    def size(self, term: Term) -> float:
        """Logarithm of a term, about in the middle of the box."""
        count = len(self.ends)
        powers, number = term
        beside = sum(q * math.log(abs(y) or 1e-300) for q, y in zip(powers[count:], self.point, strict=True) if q)
        return super().size((powers[:count], number)) + beside / self.parts

    def log(self, value: Value) -> Value:
        """The natural logarithm: that of the largest term, term by term, and what the rest adds to it."""
        if value.sign <= 0:
            raise OutOfReachError
        powers, number = self.leading(value)
        rest = self._rest(value, powers, number)
        if powers == self.none and number == 1:
            return self.log1p(rest)
        return self._log_of_sum(powers, number, rest)

    def log1p(self, value: Value) -> Value:
        """log(1 + x); that of x, and what 1 adds to it, where x is large."""
        if value.sign > 0 and len(value.terms) == 1 and self.bounds(value)[0] >= 1:
            ((powers, number),) = value.terms
            more = self.power(value, Fraction(-1))
            return self._log_of_sum(powers, number, more)
        return super().log1p(value)

    def _log_of_sum(self, powers: Powers, number: Number, rest: Value) -> Value:
        known = self._log_of_term(powers, number)
        return self.total([known, super().log1p(rest)]) if rest.terms else known

    def _log_of_term(self, powers: Powers, number: Number) -> Value:
        count = len(self.ends)
        involved = [i for i, power in enumerate(powers[:count]) if power]
        if any(powers[count:]) or not all(self.signs[i] for i in involved):
            return super()._log_of_term(powers, number)
        terms = [
            (tuple(self.parts * (k == count + i) for k in range(2 * count)), Fraction(powers[i], self.parts) * s)
            for i in involved
            for s in (self.signs[i],)
        ]
        return self.sum([*terms, (self.none, Fraction(0) if number == 1 else logarithm(span(number)))])


def _extent(ends: Sequence[Span], row: Sequence[int]) -> Span:
    """From where to where the logarithm of a variable goes."""
    sides = [(k * low, k * high) for k, (low, high) in zip(row, ends, strict=True) if k]
    low, high = sum(map(min, sides)), sum(map(max, sides))
    if sum(map(bool, row)) > 1:
        low, high = low - abs(low) * SLACK if low > -INF else low, high + abs(high) * SLACK if high < INF else high
    return low, high


def _exponent(p: float, q: float, y: float) -> float:
    """Return p y + q log(abs(y)), or its limit at an end."""
    if abs(y) == INF:
        return p * y if p else math.copysign(INF, q)
    if y == 0:
        return math.copysign(INF, -q) if q else 0.0
    return p * y + q * math.log(abs(y))


def _slack(p: float, q: float, ends: Span) -> float:
    points = [y for y in (*ends, -q / p if p else 0.0) if 0 < abs(y) < INF]
    finite = [abs(p * y) + abs(q) * (1 + abs(math.log(abs(y)))) for y in points]
    return max(finite, default=0.0) * SLACK
