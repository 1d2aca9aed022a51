"""What is certified of the claims of a closure.

Input: a closure, a limit and a quantity claimed there. Output: its certificate, like those of contact laws
(:mod:`softdyn.derive.certificate`).
"""

from __future__ import annotations

from typing import Any

from sympy import Add, Expr, S, Symbol, expand_mul, simplify

from softdyn.certificate_checker import FORMAT, Refused
from softdyn.derive.certificate_cases import certificate_of, constant_sums, prefix
from softdyn.derive.certified_terms import Terms
from softdyn.derive.closure import Closure, c, claimed_of, in_fractions, phi, ranges_of, result_of
from softdyn.derive.closure_limits import Ordered, ordered, paths_of
from softdyn.derive.closure_regimes import Case, applies, cases_of, in_words, points_on
from softdyn.derive.law import Limit


def closure_statements(closure: Closure, limit: Limit, quantity: str | Expr) -> list[dict[str, Any]]:
    """What is certified of a closure's claim: likewise, in each of the cases that its order lies in.

    Parameters
    ----------
    closure : Closure
    limit : Limit
    quantity : str or Expr
        Of its claims.
    """
    order = ordered(limit)
    cases = _cases_in(closure, order)
    found = []
    for case in cases:
        where = f", where {simplify(case.condition.subs(c, 1 - phi))}" if len(cases) > 1 else ""
        found.append(_statement(closure, limit, quantity, order, case.expression, where))
    return found


def _statement(
    closure: Closure, limit: Limit, quantity: str | Expr, order: Ordered, expression: Expr, where: str
) -> dict[str, Any]:
    about = claimed_of(closure, quantity)
    claim = S(limit.claims[quantity])
    if about is None or about == 0 or claim == 0:
        raise Refused("nothing to certify: one of the two is 0")
    sides = [
        in_fractions(closure, x, order.fraction).xreplace(order.replaced)
        for x in (about.subs(result_of(closure), expression), claim)
    ]
    # a fraction that is fixed is a number c, and phi another; no more is used of them
    varies = any(size_.has(c, phi) for pair in order.pairs for size_ in pair)
    value, claim = (expand_mul(_cancelled(x) if varies or order.written else in_words(x)) for x in sides)
    # differences that an order names stand by themselves, as a size that vanishes
    names = {gap: Symbol(f"gap_{i}", positive=True) for i, gap in enumerate(order.written)}
    value, claim = (x.xreplace(names) for x in (value, claim))
    pairs = [(small.xreplace(names), large.xreplace(names)) for small, large in order.pairs]
    varying = {symbol for pair in pairs for size_ in pair for symbol in size_.free_symbols}
    terms = Terms((value.free_symbols | claim.free_symbols) - varying, _below_one(closure), pairs)
    texts = [terms.text(x) for x in (value, claim)]
    fixed = terms.fixed_names()
    for text in texts:
        constant_sums(text, {"pi", *fixed}, terms.assumed)
    return {
        "format": FORMAT,
        "claim_of": f"{closure.name}: {limit.name}: {quantity}{where}",
        "fixed": fixed,
        "assumed": list(terms.assumed.values()),
        "order": [[prefix(small), prefix(large)] for small, large in pairs],
        "named": [list(one) for one in terms.named.values()],
        "definitions": [["found", texts[0]]],
        "quantity": "found",
        "claim": texts[1],
    }


def _below_one(closure: Closure) -> set[Symbol]:
    return {x for x, values in ranges_of(closure).items() if values.end < 1 or (values.end == 1 and values.right_open)}


def _cases_in(closure: Closure, order: Ordered) -> list[Case]:
    """The cases of a closure that apply in an ordering: several, if that depends on what does not vary."""
    return [
        case
        for case in cases_of(closure)
        if any(
            applies(closure, case.condition, number, fraction)
            for path in paths_of(order)
            for number, fraction in points_on(closure, order, path)
        )
    ]


def _cancelled(expr: Expr) -> Expr:
    """An expression with each sum in it as simple as it can be: 1 - (a - gap)/a is gap/a."""
    return expr.replace(lambda node: isinstance(node, Add) and node.is_rational_function(), lambda node: node.cancel())


def closure_certificates(closure: Closure, limit: Limit, quantity: str | Expr) -> list[dict[str, Any]]:
    """The certificates of a closure's claim, one of each case that its order lies in.

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
    return [certificate_of(statement) for statement in closure_statements(closure, limit, quantity)]
