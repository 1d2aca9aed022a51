"""Certificates of proved limits: what an independent checker needs to see that a claim holds, as plain data.

Input: a law, a limit and a quantity claimed there. Output: the definitions that the quantity rests on, the order, a
tree of cases, and the multipliers that compare terms in each; :mod:`softdyn.certificate_checker` reads them. The prover
takes no part: cases are split, and multipliers solved for, where the checker asks for them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from typing import TYPE_CHECKING, Any

from sympy import Add, Expr, Mul, Piecewise, Pow, Rational, S, Symbol, exp, expand_mul, log, pi
from sympy.core.relational import Ge, Gt, Le, Lt

from softdyn.certificate_checker import FORMAT, Case, Missing, Refused, Vector, names_in, plus, ratio, shown, visit
from softdyn.derive.closure import Closure, c, claimed_of, in_fractions, phi, result_of
from softdyn.derive.closure_limits import Ordered, ordered, paths_of
from softdyn.derive.closure_regimes import applies, cases_of, in_words, points_on
from softdyn.derive.dominant_balance import definitions, size
from softdyn.derive.law import parameters_of
from softdyn.derive.symbols import COMMON_PARAMETERS, F, a, delta
from softdyn.derive.witness import inequalities, side_of
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

#: Cases, and comparisons in one of them, that are tried.
MOST_CASES, MOST_COMPARISONS = 60, 400
NAMES = {"F_ela": "F"}


class _Atoms(Exception):
    """Exponentials and logarithms must be variables of their own."""


def prefix(expr: Expr) -> Any:
    """An expression in prefix notation.

    Raises
    ------
    Refused
        If it holds a function that certificates have no rule for.
    """
    if isinstance(expr, Symbol):
        return expr.name
    if expr == pi:
        return "pi"
    if isinstance(expr, Rational):
        return str(expr)
    if isinstance(expr, Pow) and isinstance(expr.exp, Rational):
        return ["^", prefix(expr.base), str(expr.exp)]
    if isinstance(expr, (Add, Mul)):
        return ["+", *_summands(expr)] if isinstance(expr, Add) else ["*", *map(prefix, expr.args)]
    if isinstance(expr, (exp, log)):
        return [type(expr).__name__, prefix(expr.args[0])]
    raise Refused(f"certificates have no rule for {expr}")


def _summands(expr: Expr) -> list[Any]:
    first, rest = expr.as_coeff_Add()
    return [*([str(first)] if first != 0 else []), *(prefix(part) for part in Add.make_args(rest))]


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
        _constant_sums(text, given, constant)
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
    first: Refused | _Atoms | None = None
    # the force is left out at first: a claim that holds without it holds on a larger set
    asks = any(small.has(F) or large.has(F) for small, large in inequalities(limit))
    ways = [(False, False), *([(True, False), (True, True)] if asks else [(False, True)])]
    for forces, written_out in ways:
        try:
            return _certificate_of(statement(law, limit, quantity, forces, written_out))
        except (Refused, _Atoms) as reason:
            first = first or reason
    assert first is not None
    raise first


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
        _constant_sums(prefix(expr), given, constant)
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
    return _certificate_of(closure_statement(closure, limit, quantity))


def _certificate_of(data: dict[str, Any]) -> dict[str, Any]:
    """Find the cases and the multipliers of a statement."""
    try:
        return _filled({**data, "atoms": []})
    except _Atoms:
        found: dict[str, Any] = {}
        for text in [data["order"], data.get("forces", []), *(expr for _, expr in data["definitions"]), data["claim"]]:
            _functions(text, found)
        # beside a logarithm that grows, an exponential may tend to 1, and the other way round
        for kinds in (("exp", "log"), ("log",), ("exp",)):
            atoms = [atom for atom in found.values() if atom[1][0] in kinds]
            try:
                return _filled({**data, "atoms": atoms})
            except _Atoms:
                continue
        raise


def _constant_sums(text: Any, given: set[str], found: dict[str, Any]) -> None:
    """Sums of what is fixed, with terms of both signs, as 1 - nu^2: positive, as the law's ranges have it."""
    if isinstance(text, list):
        for part in text[1:]:
            _constant_sums(part, given, found)
        if text[0] == "+" and names_in(text) <= given:
            found.setdefault(str(text), text)


def _functions(text: Any, found: dict[str, Any]) -> None:
    if isinstance(text, list):
        for part in text:
            _functions(part, found)
        if text and text[0] in ("exp", "log"):
            found.setdefault(str(text), [f"~{len(found)}", text, "1/8" if text[0] == "log" else "8"])


def _filled(data: dict[str, Any]) -> dict[str, Any]:
    given: dict[str, list[Any]] = {}
    start: list[Vector] = [{name: Fraction(1)} for name in data["fixed"]]
    count = [0]

    def cases(above: list[Vector], level: list[Vector]) -> Any:
        count[0] += 1
        if count[0] > MOST_CASES:
            raise Refused(f"there are more than {MOST_CASES} cases")
        tried: set[int] = set()
        for _ in range(MOST_COMPARISONS):
            try:
                visit(data, "leaf", above, level, given, 0)
                return "leaf"
            except Missing as missing:
                grow, bounded = missing.case.grow, missing.case.bounded
                if len(grow) not in tried and _add(given, {}, grow, bounded):
                    continue
                tried.add(len(grow))
                added = [_add(given, quotient, grow, bounded) for quotient in missing.quotients]
                if not any(added):
                    at = _undecided(missing.quotients, grow, bounded)
                    opposite = plus({}, at, Fraction(-1))
                    return {
                        "split": {name: str(x) for name, x in at.items()},
                        "above": cases([*above, at], level),
                        "below": cases([*above, opposite], level),
                        "level": cases(above, [*level, at]),
                    }
        raise Refused("there are too many comparisons")

    tree = cases([], start)
    return {**data, "cases": tree, "multipliers": given}


def _undecided(quotients: Sequence[Vector], grow: Sequence[Vector], bounded: Sequence[Vector]) -> Vector:
    """A quotient of which nothing follows from what is known: there, a case is split."""
    for quotient in quotients:
        opposite = plus({}, quotient, Fraction(-1))
        if not any(multipliers(one, grow, bounded) for one in (quotient, opposite)):
            return quotient
    raise _Atoms


def _add(given: dict[str, list[Any]], quotient: Vector, grow: Sequence[Vector], bounded: Sequence[Vector]) -> bool:
    found = multipliers(quotient, grow, bounded)
    if found is None:
        return False
    entries = given.setdefault(shown(quotient), [])
    entry = [[str(x) for x in part] for part in found]
    if entry in entries:
        return False
    entries.append(entry)
    return True


def multipliers(
    quotient: Vector, grow: Sequence[Vector], bounded: Sequence[Vector]
) -> tuple[list[Fraction], list[Fraction]] | None:
    """Multipliers >= 0 of what grows, and of either sign of what is bounded, that add up to a vector; None without.

    Parameters
    ----------
    quotient : vector
        What is to be made of them.
    grow, bounded : sequence of vectors
        Powers of ratios that grow, and of such that are bounded.
    """
    for count in range(0 if quotient else 1, min(len(grow), 5) + 1):
        for chosen in combinations(range(len(grow)), count):
            solved = _solved([grow[i] for i in chosen] + list(bounded), quotient, len(chosen))
            if solved is None or any(x <= 0 for x in solved[:count]):
                continue
            by = [Fraction(0)] * len(grow)
            for i, x in zip(chosen, solved, strict=False):
                by[i] = x
            return by, solved[count:]
    return None


def _solved(columns: Sequence[Vector], target: Mapping[str, Fraction], fixed: int) -> list[Fraction] | None:
    """Exact solution of a linear system; what is free is 1 among the first ``fixed``, else 0. None if there is none."""
    names = sorted({name for column in [*columns, target] for name in column})
    rows = [[column.get(n, Fraction(0)) for column in columns] + [target.get(n, Fraction(0))] for n in names]
    pivots: list[int] = []
    for j in range(len(columns)):
        i = next((i for i in range(len(pivots), len(rows)) if rows[i][j]), None)
        if i is None:
            continue
        top = len(pivots)
        rows[top], rows[i] = rows[i], rows[top]
        rows[top] = [x / rows[top][j] for x in rows[top]]
        for k in range(len(rows)):
            if k != top and rows[k][j]:
                rows[k] = [x - rows[k][j] * y for x, y in zip(rows[k], rows[top], strict=True)]
        pivots.append(j)
    if any(row[-1] for row in rows[len(pivots) :]):
        return None
    found = [Fraction(int(j < fixed)) if j not in pivots else Fraction(0) for j in range(len(columns))]
    for row, j in zip(rows, pivots, strict=False):
        found[j] = row[-1] - sum((row[k] * found[k] for k in range(len(columns)) if k not in pivots), Fraction(0))
    return found


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
                made.append(
                    closure_certificate(law, limit, quantity)
                    if isinstance(law, Closure)
                    else certificate(law, limit, quantity)
                )
            except (Refused, _Atoms, LawError) as reason:
                without.append((f"{limit.name}: {quantity}", str(reason) or "exponentials of unknown size"))
    return made, without
