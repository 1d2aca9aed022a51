"""What is certified of the claims of a closure.

Input: a closure, a limit and a quantity claimed there. Output: its certificate, like those of contact laws
(:mod:`softdyn.derive.certificate`).
"""

from __future__ import annotations

from typing import Any

from sympy import Add, Expr, S, Symbol, expand_mul

from softdyn.certificate_checker import FORMAT, Refused
from softdyn.derive.certificate_cases import certificate_of, constant_sums, prefix
from softdyn.derive.closure import Closure, c, claimed_of, in_fractions, phi, result_of
from softdyn.derive.closure_limits import Ordered, ordered, paths_of
from softdyn.derive.closure_regimes import applies, cases_of, in_words, points_on
from softdyn.derive.law import Limit


def closure_statement(closure: Closure, limit: Limit, quantity: str | Expr) -> dict[str, Any]:
    """What is certified of a closure's claim: likewise.

    Parameters
    ----------
    closure : Closure
    limit : Limit
    quantity : str or Expr
        Of its claims.
    """
    order = ordered(limit)
    about = claimed_of(closure, quantity)
    claim = S(limit.claims[quantity])
    if about is None or about == 0 or claim == 0:
        raise Refused("nothing to certify: one of the two is 0")
    sides = [
        in_fractions(closure, x, order.fraction).xreplace(order.replaced)
        for x in (about.subs(result_of(closure), _case_in(closure, order)), claim)
    ]
    # a fraction that is fixed is a number c, and phi another; no more is used of them
    varies = any(size_.has(c, phi) for pair in order.pairs for size_ in pair)
    value, claim = (expand_mul(_cancelled(x) if varies or order.written else in_words(x)) for x in sides)
    # differences that an order names stand by themselves, as a size that vanishes
    names = {gap: Symbol(f"gap_{i}", positive=True) for i, gap in enumerate(order.written)}
    value, claim = (x.xreplace(names) for x in (value, claim))
    pairs = [(small.xreplace(names), large.xreplace(names)) for small, large in order.pairs]
    varying = {symbol for pair in pairs for size_ in pair for symbol in size_.free_symbols}
    fixed = sorted((value.free_symbols | claim.free_symbols) - varying, key=str)
    constant: dict[str, Any] = {}
    given = {"pi", *(symbol.name for symbol in fixed)}
    for expr in (value, claim):
        constant_sums(prefix(expr), given, constant)
    return {
        "format": FORMAT,
        "claim_of": f"{closure.name}: {limit.name}: {quantity}",
        "fixed": [symbol.name for symbol in fixed],
        "assumed": list(constant.values()),
        "order": [[prefix(small), prefix(large)] for small, large in pairs],
        "definitions": [["found", prefix(value)]],
        "quantity": "found",
        "claim": prefix(claim),
    }


def _case_in(closure: Closure, order: Ordered) -> Expr:
    """The expression of the case of a closure that applies in an ordering.

    Raises
    ------
    Refused
        If it depends on what does not vary.
    """
    applying = {
        case.expression
        for case in cases_of(closure)
        for path in paths_of(order)
        for number, fraction in points_on(closure, order, path)
        if applies(closure, case.condition, number, fraction)
    }
    if len(applying) != 1:
        raise Refused("which case (Piecewise) applies depends on the volume fraction")
    return applying.pop()


def _cancelled(expr: Expr) -> Expr:
    """An expression with each sum in it as simple as it can be: 1 - (a - gap)/a is gap/a."""
    return expr.replace(lambda node: isinstance(node, Add) and node.is_rational_function(), lambda node: node.cancel())


def closure_certificate(closure: Closure, limit: Limit, quantity: str | Expr) -> dict[str, Any]:
    """The certificate of a closure's claim.

    Parameters
    ----------
    closure : Closure
    limit : Limit
    quantity : str or Expr
        Of its claims.

    Raises
    ------
    Refused
        If there is none: the claim is wrong, or it rests on what certificates have no rule for.
    """
    return certificate_of(closure_statement(closure, limit, quantity))
