"""The cases of a certificate, and the multipliers that compare terms in each.

Input: a statement, as plain data. Output: the certificate. Cases are split, and multipliers solved for, where the
checker asks for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from typing import Any

from sympy import Add, Expr, Mul, Pow, Rational, Symbol, exp, log, pi

from softdyn.certificate_checker import Missing, Refused, Vector, names_in, plus, shown, visit

#: Cases, and comparisons in one of them, that are tried.
MOST_CASES, MOST_COMPARISONS = 60, 400


class UnknownSizeError(Exception):
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


def certificate_of(data: dict[str, Any]) -> dict[str, Any]:
    """Find the cases and the multipliers of a statement."""
    try:
        return _filled({**data, "atoms": []})
    except UnknownSizeError:
        found: dict[str, Any] = {}
        for text in [data["order"], data.get("forces", []), *(expr for _, expr in data["definitions"]), data["claim"]]:
            _functions(text, found)
        # beside a logarithm that grows, an exponential may tend to 1, and the other way round
        for kinds in (("exp", "log"), ("log",), ("exp",)):
            atoms = [atom for atom in found.values() if atom[1][0] in kinds]
            try:
                return _filled({**data, "atoms": atoms})
            except UnknownSizeError:
                continue
        raise


def constant_sums(text: Any, given: set[str], found: dict[str, Any]) -> None:
    """Sums of what is fixed, with terms of both signs, as 1 - nu^2: positive, as the law's ranges have it."""
    if isinstance(text, list):
        for part in text[1:]:
            constant_sums(part, given, found)
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
