"""Certificates of proved limits: what an independent checker needs to see that a claim holds, as plain data.

Input: a law, a limit and a quantity claimed there. Output: the definitions that the quantity rests on, the order, a
tree of cases, and the multipliers that compare terms in each; :mod:`softdyn.certificate_checker` reads them. The prover
takes no part: cases are split, and multipliers solved for, where the checker asks for them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from sympy import Add, Expr, Piecewise, S, Symbol, expand_mul
from sympy.core.relational import Ge, Gt, Le, Lt

from softdyn.certificate_checker import FORMAT, Case, Refused, Vector, plus, ratio
from softdyn.derive.certificate_cases import UnknownSizeError, certificate_of, constant_sums, multipliers, prefix
from softdyn.derive.closure import Closure
from softdyn.derive.closure_certificate import closure_certificates
from softdyn.derive.dominant_balance import definitions, size
from softdyn.derive.law import parameters_of
from softdyn.derive.symbols import COMMON_PARAMETERS, F, a, delta
from softdyn.derive.witness import inequalities, side_of
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

NAMES = {"F_ela": "F"}


def statement(
    law: ContactLaw, limit: Limit, quantity: str, forces: bool = False, written_out: bool = False
) -> dict[str, Any]:
    """What is certified: fixed parameters, order, definitions, quantity and claim.

    Parameters
    ----------
    forces : bool
        Whether what the order says of the force counts; without it a claim holds on a larger set.
    written_out : bool
        Whether sums that hold the radius have it in h and delta: a^2 - 2 R h cancels, 2 R delta does not. Here, and
        with ``forces``, the force that drives the gap is a sum of the remote force's own terms.
    """
    side = side_of(limit)
    compared = inequalities(limit)
    named = {symbol for small, large in compared for symbol in (small * large).free_symbols}
    fixed = [s for s in parameters_of(law) if s in COMMON_PARAMETERS or s not in named]
    known_sides = {delta: side * size}
    ordered_by = [
        (small.subs(known_sides), large.subs(known_sides))
        for small, large in compared
        if not (small.has(F) or large.has(F))
    ]
    branches: dict[tuple[Expr, Expr], None] = {}
    known: dict[Symbol, Expr] = {delta: side * size}
    name = NAMES.get(quantity, quantity)
    equations: list[tuple[Symbol, Expr]] = []
    for symbol, expr in definitions(law).items():
        value = expr.xreplace(known) if expr.is_Symbol else expr.subs(known)
        value = _in_one_branch(value, ordered_by, fixed, branches)
        if written_out and symbol != a:
            value = _without_radius(value, equations[0][1])
        if (forces or written_out) and symbol.name == "net":
            # terms of the remote force that may cancel one another are each small against the force
            value = expand_mul(value.xreplace({s: x for s, x in equations if s.name == "F_adh"}))
        if value == 0:
            known[symbol] = S.Zero
        else:
            equations.append((symbol, value))
    claim = limit.claims[quantity].subs(known)
    target = side * size if name == "delta" else next((s for s, _ in equations if s.name == name), S.Zero)
    if target == 0 or claim == 0:
        raise Refused("nothing to certify: one of the two is 0")
    needed = target.free_symbols | claim.free_symbols | ({F} if forces else set())
    kept = []
    for symbol, value in reversed(equations):
        if symbol in needed:
            kept.append([symbol.name, prefix(value)])
            needed |= value.free_symbols
    # in the size of the force, whose sign is that of delta
    by_force = [
        (small.subs(F, side * F).subs(known_sides), large.subs(F, side * F).subs(known_sides))
        for small, large in compared
        if forces and (small.has(F) or large.has(F))
    ]
    given = {"pi", *(s.name for s in fixed)}
    constant: dict[str, Any] = {}
    for text in [expr for _, expr in kept] + [prefix(claim)]:
        constant_sums(text, given, constant)
    return {
        "format": FORMAT,
        "claim_of": f"{law.name}: {limit.name}: {quantity}",
        "fixed": [s.name for s in fixed],
        "assumed": list(constant.values()),
        "order": [[prefix(small), prefix(large)] for small, large in ordered_by],
        "branches": [[prefix(small), prefix(large)] for small, large in branches],
        "forces": [[F.name, prefix(small), prefix(large)] for small, large in by_force],
        "definitions": kept[::-1],
        "quantity": prefix(target),
        "claim": prefix(claim),
    }


def _in_one_branch(
    expr: Expr, order: Sequence[tuple[Expr, Expr]], fixed: Sequence[Symbol], branches: dict[tuple[Expr, Expr], None]
) -> Expr:
    """An expression without the branches (Piecewise) that an order excludes; what tells so is added to ``branches``.

    Raises
    ------
    Refused
        If the order does not tell.
    """
    if not expr.has(Piecewise):
        return expr
    plain = Case([], [], {})
    grow = [ratio(prefix(small), prefix(large), plain) for small, large in order]
    bounded: list[Vector] = [{symbol.name: Fraction(1)} for symbol in fixed]

    def chosen(node: Piecewise) -> Expr:
        for value, condition in node.args:
            if condition == True:  # noqa: E712 (sympy's own truth)
                return value
            if not isinstance(condition, (Lt, Le, Gt, Ge)):
                break
            small, large = condition.lts, condition.gts
            quotient = ratio(prefix(small), prefix(large), plain)
            if multipliers(quotient, grow, bounded):
                branches[small, large] = None
                return value
            if not multipliers(plus({}, quotient, Fraction(-1)), grow, bounded):
                break
            branches[large, small] = None
        raise Refused(f"which branch applies is not told by the order: {node}")

    return expr.replace(lambda node: isinstance(node, Piecewise), chosen)


def _without_radius(expr: Expr, radius: Expr) -> Expr:
    """An expression in which sums that hold the radius are fractions in h and delta, where they are such."""

    def written(total: Expr) -> Expr:
        explicit = total.xreplace({a: radius})
        return explicit.cancel() if explicit.is_rational_function() else total

    return expr.replace(lambda node: isinstance(node, Add) and node.has(a), written)


def certificate(law: ContactLaw, limit: Limit, quantity: str) -> dict[str, Any]:
    """The certificate of a claim.

    Parameters
    ----------
    law : ContactLaw
    limit : Limit
    quantity : str
        Of its claims.

    Raises
    ------
    Refused
        If there is none: the claim is wrong, or it rests on what certificates have no rule for.
    """
    first: Refused | UnknownSizeError | None = None
    # the force is left out at first: a claim that holds without it holds on a larger set
    asks = any(small.has(F) or large.has(F) for small, large in inequalities(limit))
    ways = [(False, False), *([(True, False), (True, True)] if asks else [(False, True)])]
    for forces, written_out in ways:
        try:
            return certificate_of(statement(law, limit, quantity, forces, written_out))
        except (Refused, UnknownSizeError) as reason:
            first = first or reason
    assert first is not None
    raise first


def certificates(
    law: ContactLaw | Closure, claims: Collection[tuple[str, str]] | None = None
) -> tuple[list[dict[str, Any]], list[tuple[str, str]]]:
    """Certificates of a law's claims, and the claims that have none, with the reason.

    Parameters
    ----------
    law : ContactLaw or Closure
    claims : collection of (limit, quantity), optional
        Those that are asked for; all by default.
    """
    made, without = [], []
    for limit in law.limits:
        for quantity in limit.claims:
            if claims is not None and (limit.name, str(quantity)) not in claims:
                continue
            try:
                made += (
                    closure_certificates(law, limit, quantity)
                    if isinstance(law, Closure)
                    else [certificate(law, limit, quantity)]
                )
            except (Refused, UnknownSizeError, LawError) as reason:
                without.append((f"{limit.name}: {quantity}", str(reason) or "exponentials of unknown size"))
    return made, without
