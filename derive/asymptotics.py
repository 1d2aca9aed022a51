"""Asymptotic series in several independent small ratios, by dominant balance on the expression tree.

An ordering of lengths s0 << s1 << ... << R makes the ratios r1 = s0/s1, r2 = s1/s2, ... independent small variables.
Every expression is then a series of monomials in them, exact in rationals. One monomial is negligible against another
only if their quotient has no negative power of any ratio, that is, whatever the powers with which the ratios vanish:
so what holds here holds for every power-law scaling that the ordering admits.

Along such scalings logarithms grow more slowly than any power; they stay in the coefficients as L_i = log(1/r_i) > 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

from sympy import (
    Abs,
    Add,
    Dummy,
    Expr,
    Max,
    Min,
    Mul,
    Pow,
    Rational,
    S,
    Symbol,
    acosh,
    asin,
    asinh,
    atan,
    atanh,
    binomial,
    cos,
    cosh,
    erf,
    erfc,
    exp,
    expand_log,
    factorial,
    log,
    sign,
    simplify,
    sin,
    sinh,
    tan,
    tanh,
)
from sympy.codegen.cfunctions import expm1, log1p

Exponents = tuple[Rational, ...]

#: Terms kept in a series; further ones go into its remainder.
KEPT = 8

#: Analytic functions, expanded about a finite argument.
ANALYTIC = (exp, sin, cos, tan, asin, atan, sinh, cosh, tanh, asinh, acosh, atanh, erf, erfc)


class UndecidedError(Exception):
    """The method cannot tell; the text says why."""


@dataclass(frozen=True)
class Series:
    """A sum of ``coefficient * r1**x1 * r2**x2 ...``, up to terms of the order of the remainder.

    ``terms`` maps exponents to coefficients free of the ratios; ``remainder`` holds exponents of what was cut off.
    """

    terms: dict[Exponents, Expr] = field(default_factory=dict)
    remainder: frozenset[Exponents] = frozenset()


def negligible(small: Exponents, large: Exponents) -> bool:
    """Whether one monomial vanishes against another, however the ratios tend to zero."""
    return small != large and all(x >= y for x, y in zip(small, large, strict=True))


def leading(series: Series, what: object = "the expression") -> tuple[Exponents, Expr]:
    """Return exponents and coefficient of the term that dominates all others.

    Raises
    ------
    UndecidedError
        If the terms cancel as far as they are known, or if none dominates throughout the ordering.
    """
    if not series.terms:
        raise UndecidedError(f"the leading terms of {what} cancel, to the order kept")
    candidates = minimal([*series.terms, *series.remainder])
    if len(candidates) > 1:
        raise UndecidedError(f"no term of {what} dominates in the whole of the ordering: it must be split")
    (dominant,) = candidates
    if dominant not in series.terms:
        raise UndecidedError(f"the leading terms of {what} cancel, to the order kept")
    return dominant, series.terms[dominant]


def minimal(exponents: Iterable[Exponents]) -> list[Exponents]:
    """Return the monomials that are negligible against no other."""
    distinct = sorted(set(exponents))
    return [e for e in distinct if not any(negligible(e, other) for other in distinct)]


def expand(expr: Expr, ratios: tuple[Symbol, ...]) -> Series:
    """Series of an expression in small positive ratios.

    Parameters
    ----------
    expr : Expr
        In the ratios and in symbols that stay fixed as the ratios vanish.
    ratios : tuple of Symbol

    Raises
    ------
    UndecidedError
        Where the method does not apply, saying why.
    """
    zero: Exponents = (S.Zero,) * len(ratios)
    if not expr.free_symbols & set(ratios):
        return Series({zero: expr} if expr != 0 else {})
    if expr in ratios:
        return Series({tuple(S.One if ratio == expr else S.Zero for ratio in ratios): S.One})
    if isinstance(expr, Add):
        return _cut(_sum(expand(term, ratios) for term in expr.args))
    if isinstance(expr, Mul):
        product = Series({zero: S.One})
        for factor in expr.args:
            product = _product(product, expand(factor, ratios))
        return product
    if isinstance(expr, Pow) and expr.exp.is_negative and _grows_exponentially(expr.base, ratios):
        return Series()  # smaller than any power of the ratios
    if isinstance(expr, Pow) and isinstance(expr.exp, Rational):
        return _power(expand(expr.base, ratios), expr.exp, expr.base)
    if isinstance(expr, (Abs, sign)):
        argument = expand(expr.args[0], ratios)
        side = _sign(leading(argument, expr.args[0])[1], expr.args[0])
        return Series({zero: S(side)}) if isinstance(expr, sign) else _scaled(argument, S(side))
    if isinstance(expr, (Min, Max)):
        return _extremum(expr, ratios)
    if isinstance(expr, (log1p, expm1)):
        return expand(expr.expand(func=True), ratios)
    if isinstance(expr, log):
        return _logarithm(expand(expr.args[0], ratios), expr, ratios)
    if isinstance(expr, (exp, *ANALYTIC)):
        return _analytic(expr, expand(expr.args[0], ratios), ratios)
    raise UndecidedError(f"{expr.func} is outside the method")


def _sum(parts: Iterable[Series]) -> Series:
    terms: dict[Exponents, Expr] = {}
    remainder: set[Exponents] = set()
    for part in parts:
        remainder |= part.remainder
        for exponents, coefficient in part.terms.items():
            terms[exponents] = terms.get(exponents, S.Zero) + coefficient
    return Series({e: c for e, c in terms.items() if not _is_zero(c)}, frozenset(remainder))


def _is_zero(coefficient: Expr) -> bool:
    if coefficient.is_zero is not None:
        return bool(coefficient.is_zero)
    return bool(simplify(coefficient) == 0)


def _cut(series: Series) -> Series:
    """Drop terms below the remainder; move those beyond the KEPT largest into it."""
    remainder = minimal(series.remainder)
    known = {e: c for e, c in series.terms.items() if not any(e == r or negligible(e, r) for r in remainder)}
    # whatever is moved must not leave behind a term that it dominates: sorting by degree ensures it
    ordered = sorted(known, key=lambda e: (sum(e), e))
    moved = ordered[KEPT:]
    return Series({e: known[e] for e in ordered[:KEPT]}, frozenset(minimal([*remainder, *moved])))


def _scaled(series: Series, factor: Expr) -> Series:
    return Series({e: factor * c for e, c in series.terms.items()}, series.remainder)


def _product(left: Series, right: Series) -> Series:
    terms: dict[Exponents, Expr] = {}
    for e1, c1 in left.terms.items():
        for e2, c2 in right.terms.items():
            exponents = _add(e1, e2)
            terms[exponents] = terms.get(exponents, S.Zero) + c1 * c2
    remainder = {
        *(_add(e, r) for e in minimal([*left.terms, *left.remainder]) for r in right.remainder),
        *(_add(e, r) for e in minimal([*right.terms, *right.remainder]) for r in left.remainder),
    }
    return _cut(Series({e: c for e, c in terms.items() if not _is_zero(c)}, frozenset(remainder)))


def _add(left: Exponents, right: Exponents) -> Exponents:
    return tuple(x + y for x, y in zip(left, right, strict=True))


def _relative(series: Series, dominant: Exponents, coefficient: Expr) -> Series:
    """Return series/leading term - 1."""
    shift = tuple(-x for x in dominant)
    return Series(
        {_add(e, shift): c / coefficient for e, c in series.terms.items() if e != dominant},
        frozenset(_add(r, shift) for r in series.remainder),
    )


def _compose(small: Series, coefficients: Iterable[Expr], size: int) -> Series:
    """Sum of coefficients[k] * small**k, for a series that vanishes with the ratios."""
    zero: Exponents = (S.Zero,) * size
    total, power = Series(), Series({zero: S.One})
    for order, coefficient in enumerate(coefficients):
        total = _cut(_sum([total, _scaled(power, coefficient)]))
        power = _product(power, small)
        if not power.terms and not power.remainder:
            return total
        if order == KEPT:
            break
    cut_off = frozenset(minimal([*power.terms, *power.remainder]))
    return _cut(Series(total.terms, total.remainder | cut_off))


def _power(base: Series, power: Rational, what: Expr) -> Series:
    dominant, coefficient = leading(base, what)
    if not power.is_integer and _sign(coefficient, what) < 0:
        raise UndecidedError(f"{what} is negative under a root")
    small = _relative(base, dominant, coefficient)
    unit = _compose(small, (binomial(power, k) for k in range(KEPT + 1)), len(dominant))
    factor = Series({tuple(power * x for x in dominant): coefficient**power})
    return _product(factor, unit)


def _sign(coefficient: Expr, what: object) -> int:
    for candidate in (coefficient, simplify(coefficient)):
        if candidate.is_positive:
            return 1
        if candidate.is_negative:
            return -1
    raise UndecidedError(f"the sign of {what} is not known: its leading coefficient is {coefficient}")


def _extremum(expr: Expr, ratios: tuple[Symbol, ...]) -> Series:
    chosen, *others = expr.args
    for other in others:
        _, difference = leading(expand(chosen - other, ratios), chosen - other)
        if (_sign(difference, chosen - other) > 0) != isinstance(expr, Max):
            chosen = other
    return expand(chosen, ratios)


def _logarithm(argument: Series, what: Expr, ratios: tuple[Symbol, ...]) -> Series:
    dominant, coefficient = leading(argument, what)
    if _sign(coefficient, what.args[0]) < 0:
        raise UndecidedError(f"{what} is the logarithm of a negative number")
    slow = expand_log(log(coefficient)) - sum(
        (x * slow_logarithm(ratio) for x, ratio in zip(dominant, ratios, strict=True)), start=S.Zero
    )
    small = _relative(argument, dominant, coefficient)
    series = (S.Zero, *(-((S.NegativeOne) ** k) / S(k) for k in range(1, KEPT + 1)))
    corrections = _compose(small, series, len(ratios))
    zero: Exponents = (S.Zero,) * len(ratios)
    return _cut(_sum([Series({zero: slow} if slow != 0 else {}), corrections]))


def _grows_exponentially(expr: Expr, ratios: tuple[Symbol, ...]) -> bool:
    """Whether an expression is exp, sinh or cosh of an argument that grows as a power of the ratios."""
    if not isinstance(expr, (exp, sinh, cosh)):
        return False
    dominant, coefficient = leading(expand(expr.args[0], ratios), expr.args[0])
    zero: Exponents = (S.Zero,) * len(ratios)
    return negligible(zero, dominant) and (isinstance(expr, cosh) or _sign(coefficient, expr.args[0]) > 0)


@cache
def slow_logarithm(ratio: Symbol) -> Symbol:
    """Return L = log(1/r), which grows more slowly than any power of r: one symbol for each ratio, and no law's own."""
    return Dummy(f"L_{ratio.name}", positive=True)


def _analytic(expr: Expr, argument: Series, ratios: tuple[Symbol, ...]) -> Series:
    zero: Exponents = (S.Zero,) * len(ratios)
    large = [e for e in argument.terms if e != zero and not negligible(e, zero)]
    if large or not all(negligible(r, zero) for r in argument.remainder):
        dominant, coefficient = leading(argument, expr.args[0])
        if isinstance(expr, tanh) and negligible(zero, dominant):
            return Series({zero: S(_sign(coefficient, expr.args[0]))})  # up to less than any power of the ratios
        if isinstance(expr, exp) and negligible(zero, dominant) and _sign(coefficient, expr.args[0]) < 0:
            return Series()  # smaller than any power of the ratios
        raise UndecidedError(f"{expr} has an argument that is neither small nor of order one")
    centre = argument.terms.get(zero, S.Zero)
    x = Symbol("x", positive=True)
    derivatives, function = [], expr.func(x)
    for k in range(KEPT + 1):
        value = function.subs(x, centre)
        if not value.is_finite:
            raise UndecidedError(f"{expr} is singular where its argument tends to {centre}")
        derivatives.append(value / factorial(k))
        function = function.diff(x)
    small = Series({e: c for e, c in argument.terms.items() if e != zero}, argument.remainder)
    return _compose(small, derivatives, len(ratios))
