"""Proofs that a quantity is nowhere negative, though it may be 0 on parts of its domain.

A load of surfaces that touch is such a quantity: it is 0 where they do not. Where a case of it is not 0 it must be
positive, which :mod:`softdyn.derive.positive` decides; where a case ends, it may vanish. So each case is looked at by
itself, in coordinates that measure how far from its end it is: where it holds for x < y, y is x + d with d > 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import mpmath
from sympy import (
    And,
    Basic,
    Dummy,
    Expr,
    Max,
    Min,
    Not,
    Piecewise,
    S,
    Symbol,
    lambdify,
    piecewise_fold,
    simplify_logic,
)
from sympy.core.relational import Ge, Gt, Le, Lt, Relational

from softdyn.derive.bounds import INF
from softdyn.derive.positive import MOST, Domain, Positivity, Range, positivity, ranges_of_positive
from softdyn.derive.soundness import rewritable, tidy

#: How far beside a point where a quantity is 0 it is looked at.
BESIDE = mpmath.mpf("1.01")


def not_negative(expr: Expr, domain: Domain, most: int = MOST) -> Positivity:
    """Prove that an expression is not negative, or show where it is.

    Parameters
    ----------
    expr : Expr
        Continuous where a case of it ends: there it is not looked at.
    domain : tuple of (Symbol, tuple of Range)
        Of each symbol.
    most : int
        Boxes looked at, at most, in each part of the domain of each case.

    Returns
    -------
    Positivity
        "positive" stands for positive or 0. Where a number is 0 within a case, nothing is known: "unknown".
    """
    boxes, left = 0, None
    for value, condition in _cases(expr):
        found = _case(value, condition, domain, most)
        boxes += found.boxes
        if found.verdict == "witness":
            return replace(found, boxes=boxes)
        left = found if found.verdict == "unknown" and left is None else left
    return Positivity("positive", boxes=boxes) if left is None else replace(left, boxes=boxes)


def _cases(expr: Expr) -> Iterator[tuple[Expr, Basic]]:
    """Cases of an expression that are not 0, and where each holds."""
    if expr.has(Max, Min):
        expr = expr.replace(lambda node: isinstance(node, (Max, Min)), lambda node: node.rewrite(Piecewise))
    whole = piecewise_fold(expr) if expr.has(Piecewise) else expr
    if not isinstance(whole, Piecewise):
        yield whole, S.true
        return
    before: Any = S.true
    for value, condition in whole.args:
        if value != 0:
            yield value, simplify_logic(And(condition, before)) if before != S.true else condition
        before = And(before, Not(condition))


def _case(expr: Expr, condition: Basic, domain: Domain, most: int) -> Positivity:
    """Whether a case is not negative where it holds."""
    ranges, back = dict(domain), dict[Symbol, Expr]()
    parts = condition.args if isinstance(condition, And) else (condition,)
    rest = []
    for part in parts:
        pair = _ordered(part.xreplace(back), ranges) if isinstance(part, Relational) else None
        if pair is None:
            rest.append(part)
            continue
        small, large = pair
        beyond = Dummy(f"{large.name} - {small.name}", positive=True)
        back = {symbol: value.xreplace({large: small + beyond}) for symbol, value in back.items()}
        back[large] = small + beyond
        ranges[beyond] = ranges_of_positive(beyond.name)
        del ranges[large]
    here = tidy(expr.xreplace(back))
    if here.is_nonnegative or (rewritable(here) and here.factor().is_nonnegative):
        return Positivity("positive")
    where = And(*rest).xreplace(back)
    here = here if where == S.true else Piecewise((here, where), (1, True))
    found = positivity(here, tuple((s, r) for s, r in ranges.items() if s in here.free_symbols), most)
    if found.verdict == "witness" and found.value == 0:
        found = _beside(here, found, ranges)
    return replace(found, at=_back(found.at, back))


def _beside(expr: Expr, found: Positivity, ranges: Mapping[Symbol, tuple[Range, ...]]) -> Positivity:
    """Whether an expression that is 0 at a point is negative beside it."""
    for symbol in sorted(expr.free_symbols, key=str):
        for factor in (BESIDE, 1 / BESIDE) if _any_positive(ranges[symbol]) else ():
            at = {**found.at, symbol.name: found.at[symbol.name] * factor}
            value = lambdify(list(ranges), expr, modules="mpmath", dummify=True)(*(at.get(s.name, 1) for s in ranges))
            if mpmath.im(value) == 0 and value < 0:
                return replace(found, at=at, value=value)
    left = {name: (float(x), float(x)) for name, x in found.at.items()}
    return Positivity("unknown", left=left, boxes=found.boxes)


def _ordered(part: Basic, ranges: Mapping[Symbol, tuple[Range, ...]]) -> tuple[Symbol, Symbol] | None:
    """The smaller and the larger of two symbols that may be any positive numbers, where a condition says that."""
    if not isinstance(part, (Lt, Le, Gt, Ge)):
        return None
    small, large = part.args if isinstance(part, (Lt, Le)) else part.args[::-1]
    free = all(isinstance(one, Symbol) and _any_positive(ranges.get(one, ())) for one in (small, large))
    return (small, large) if free else None


def _any_positive(ranges: tuple[Range, ...]) -> bool:
    """Whether these are all positive numbers."""
    return len(ranges) == 1 and ranges[0].expression == ranges[0].variable and ranges[0].ends == (-INF, INF)


def _back(at: Mapping[str, mpmath.mpf], back: Mapping[Symbol, Expr]) -> dict[str, mpmath.mpf]:
    """Numbers of a witness, by the symbols that were declared."""
    numbers = dict(at)
    for symbol, value in reversed(list(back.items())):
        # what the sign does not depend on may be anything
        parts = [numbers.setdefault(one.name, mpmath.mpf(1)) for one in value.free_symbols]
        numbers[symbol.name] = mpmath.fsum(parts)
    new = {one.name for value in back.values() for one in value.free_symbols if isinstance(one, Dummy)}
    return {name: number for name, number in numbers.items() if name not in new}
