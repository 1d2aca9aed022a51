"""Expressions by cases: written in the functions that all targets have, and complete over the domain h > 0.

Input: a declared expression. Output: the same without functions that are others in disguise; and where a Piecewise has
no value, since none of its conditions holds there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, islice, pairwise, product

from sympy import (
    Abs,
    Expr,
    Heaviside,
    Integer,
    LambertW,
    Max,
    Min,
    Piecewise,
    Poly,
    PolynomialError,
    Rational,
    Symbol,
    cos,
    cosh,
    cot,
    coth,
    csc,
    csch,
    false,
    nsimplify,
    real_roots,
    sec,
    sech,
    sign,
    sin,
    sinh,
    tan,
    tanh,
    true,
)
from sympy.core.relational import Relational

from softdyn.derive.bessel import AS_ONES_OF_ORDER
from softdyn.derive.special import principal
from softdyn.derive.symbols import COMMON_PARAMETERS, a, delta, h

#: What a function is in terms of those that math.h has.
AS_OTHERS = {
    coth: lambda x: 1 / tanh(x),
    sech: lambda x: 1 / cosh(x),
    csch: lambda x: 1 / sinh(x),
    cot: lambda x: 1 / tan(x),
    sec: lambda x: 1 / cos(x),
    csc: lambda x: 1 / sin(x),
    LambertW: principal,
    **AS_ONES_OF_ORDER,
    Heaviside: lambda x, *_: Piecewise((Integer(1), x > 0), (Integer(0), True)),
}
#: Values of the other variables at which a gap between branches is looked for, at most.
LOOKED_AT = 64
#: Where h, delta and a may be, in units of R, and sizes at which they are looked at where one of them is not varied.
DOMAINS = {h: (0, None), a: (0, None), delta: (-1, 1)}
SIZES = {
    h: [Rational(1, 10**6), Rational(1, 100), Integer(1), Integer(100)],
    a: [Rational(1, 10**3), Rational(1, 10), Integer(1)],
    delta: [Rational(-1, 2), Integer(0), Rational(1, 10**4), Rational(1, 2)],
}


def in_plain_functions(expr: Expr) -> Expr:
    """Write coth, sech, csch, cot, sec, csc, Heaviside, W and Bessel's by functions that all targets have."""
    for function, other in AS_OTHERS.items():
        if expr.has(function):
            expr = expr.replace(function, other)
    return expr


def has_kinks(*expressions: Expr) -> bool:
    """Whether expressions have a kink or a jump where h, delta or a passes anything else than delta = 0."""
    changing: set[Expr] = set()
    for expr in expressions:
        changing |= {node.args[0] for node in expr.atoms(Abs, sign)}
        changing |= {one - other for node in expr.atoms(Max, Min) for one, other in combinations(node.args, 2)}
        changing |= {node.lhs - node.rhs for node in expr.atoms(Relational)}
    # what is delta times something of one sign changes its own at delta = 0 alone
    return any(expr.has(*DOMAINS) and (expr / delta).cancel().is_nonzero is not True for expr in changing)


def gap_of(expr: Expr, samples: Mapping[Symbol, Sequence[Rational]]) -> tuple[Piecewise, str] | None:
    """A Piecewise within an expression that has no value somewhere, and words for where; None if there is none.

    Without a default branch, conditions are looked at in all the intervals between their ends, at R = E = eta = 1 and
    the given samples of the law's own parameters.
    """
    for cases in sorted(expr.atoms(Piecewise), key=str):
        if cases.args[-1][1] == true:
            continue
        where = _gap_in(cases, samples)
        if where:
            return cases, where
    return None


def _gap_in(cases: Piecewise, samples: Mapping[Symbol, Sequence[Rational]]) -> str:
    conditions = [condition for _, condition in cases.args]
    free = set().union(*(condition.free_symbols for condition in conditions))
    variables = [symbol for symbol in DOMAINS if symbol in free]
    own = [symbol for symbol in samples if symbol in free]
    for varied in variables or [h]:
        others = [symbol for symbol in variables if symbol != varied]
        for values in islice(product(*(SIZES[x] for x in others), *(samples[x] for x in own)), LOOKED_AT):
            known = dict(zip([*others, *own], values, strict=True))
            at = {**known, **dict.fromkeys(COMMON_PARAMETERS, 1)}
            for point, words in _intervals(varied, [condition.subs(at) for condition in conditions]):
                if all(condition.subs({**at, varied: point}) == false for condition in conditions):
                    given = ", ".join(f"{symbol.name} = {value}" for symbol, value in known.items())
                    return f"{words} (R = E = eta = 1{', ' + given if given else ''})"
    return ""


def _intervals(varied: Symbol, conditions: Sequence[Expr]) -> Iterator[tuple[Expr, str]]:
    """Points of all intervals between the ends of conditions, with words for the interval."""
    low, high = DOMAINS[varied]
    ends: set[Expr] = set()
    for condition in conditions:
        for relation in condition.atoms(Relational):
            ends |= set(_roots(relation.lhs - relation.rhs, varied))
    inner = sorted((end for end in ends if end > low and (high is None or end < high)), key=float)
    name = varied.name
    if inner:
        yield _between(low, inner[0]), f"for {name} < {_printed(inner[0])}"
        yield (2 * inner[-1] if high is None else _between(inner[-1], high)), f"for {name} > {_printed(inner[-1])}"
    for end, following in pairwise(inner):
        yield _between(end, following), f"for {_printed(end)} < {name} < {_printed(following)}"
    for point in (*inner, *SIZES[varied]):
        yield point, f"at {name} = {_printed(point)}"


def _between(low: Expr | int, high: Expr | int) -> Rational:
    return nsimplify((low + high) / 2, rational=True)


def _printed(end: Expr) -> str:
    return str(end) if end.is_Rational and end.q < 10**6 else f"{float(end):.6g}"


def _roots(expr: Expr, varied: Symbol) -> list[Expr]:
    """Real roots of a polynomial or a fraction of such; none of anything else."""
    try:
        return list(real_roots(Poly(expr.together().as_numer_denom()[0], varied, domain="QQ")))
    except (PolynomialError, NotImplementedError, ValueError, TypeError):
        return []
