"""The cases of a certificate, and the multipliers that compare terms in each.

Input: a statement, as plain data. Output: the certificate. Cases are split, and multipliers solved for, where the
checker asks for them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from math import prod
from typing import Any

from sympy import Add, Expr, Mul, Pow, Rational, Symbol, exp, log, pi

from softdyn.certificate_checker import Missing, Refused, Vector, names_in, plus, shown, visit

#: Cases, and comparisons in one of them, that are tried.
MOST_CASES, MOST_COMPARISONS = 60, 400
#: Exponentials and logarithms beyond which not each choice of some is tried.
MOST_CHOSEN = 4


class UnknownSizeError(Exception):
    """Exponentials and logarithms must be variables of their own."""


def prefix(expr: Expr, special: Callable[[Expr], Any] | None = None) -> Any:
    """An expression in prefix notation.

    Parameters
    ----------
    expr : Expr
    special : callable, optional
        Prefix notation of what has a form of its own, None of what has not.

    Raises
    ------
    Refused
        If it holds a function that certificates have no rule for.
    """
    if special is not None and (text := special(expr)) is not None:
        return text
    if isinstance(expr, Symbol):
        return expr.name
    if expr == pi:
        return "pi"
    if isinstance(expr, Rational):
        return str(expr)
    if isinstance(expr, Pow) and isinstance(expr.exp, Rational):
        return ["^", prefix(expr.base, special), str(expr.exp)]
    if isinstance(expr, Add):
        first, rest = expr.as_coeff_Add()
        number = [str(first)] if first != 0 else []
        return ["+", *number, *(prefix(part, special) for part in Add.make_args(rest))]
    if isinstance(expr, Mul):
        return ["*", *(prefix(part, special) for part in expr.args)]
    if isinstance(expr, (exp, log)):
        return [type(expr).__name__, prefix(expr.args[0], special)]
    raise Refused(f"certificates have no rule for {expr}")


def certificate_of(data: dict[str, Any]) -> dict[str, Any]:
    """Find the cases and the multipliers of a statement.

    Raises
    ------
    Refused, UnknownSizeError
        If none are found.
    """
    found: dict[str, Any] = {}
    for text in [data["order"], data.get("forces", []), *(expr for _, expr in data["definitions"]), data["claim"]]:
        _functions(text, {"pi", *data["fixed"]}, found)
    reasons: list[Refused] = []
    for atoms in _choices(list(found.values())):
        try:
            return _filled({**data, "atoms": atoms})
        except Refused as reason:
            reasons.append(reason)
        except UnknownSizeError:
            continue
    raise reasons[0] if reasons else UnknownSizeError


def _choices(found: list[Any]) -> list[list[Any]]:
    """Which exponentials and logarithms are variables: beside some that vanish or grow, others may tend to 1."""
    kinds: tuple[tuple[str, ...], ...] = ((), ("exp", "log"), ("log",), ("exp",))
    chosen = [[atom for atom in found if atom[1][0] in kind] for kind in kinds]
    if len(found) <= MOST_CHOSEN:
        chosen += [list(some) for count in range(len(found)) for some in combinations(found, count)]
    return [atoms for i, atoms in enumerate(chosen) if atoms not in chosen[:i]]


def constant_sums(text: Any, given: set[str], found: dict[str, Any]) -> None:
    """Sums of what is fixed, with terms of both signs, as 1 - nu^2: positive, as the law's ranges have it.

    Parameters
    ----------
    text : prefix notation
    given : set of str
        What is fixed.
    found : dict
        They are added to it; what is in it is positive.
    """
    if isinstance(text, list):
        for part in text[1:]:
            constant_sums(part, given, found)
        if text[0] == "+" and names_in(text) <= given and _sign_of(text, found) == 0:
            found.setdefault(str(text), text)


def _sign_of(text: Any, positive: Mapping[str, Any]) -> int:
    """Sign of an expression of positive names; 0 if it is not told by the signs of its terms."""
    if str(text) in positive:
        return 1
    if isinstance(text, str):
        return -1 if text.startswith("-") else 1
    signs = [_sign_of(part, positive) for part in (text[1:2] if text[0] == "^" else text[1:])]
    if text[0] == "*":
        return prod(signs)
    if text[0] == "+":
        return signs[0] if len(set(signs)) == 1 else 0
    if text[0] == "^":
        return signs[0] if signs[0] > 0 else signs[0] ** Fraction(text[2]).numerator
    return 1 if text[0] == "exp" else 0


def _functions(text: Any, given: set[str], found: dict[str, Any]) -> None:
    """Exponentials and logarithms of what is not fixed, inner ones first."""
    if isinstance(text, list):
        for part in text:
            _functions(part, given, found)
        if text and text[0] in ("exp", "log") and not names_in(text) <= given:
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
    raise UnknownSizeError


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
