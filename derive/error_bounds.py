"""Claims with an error: how far a leading form is off, on a whole box of ratios.

Input: a limit that claims, besides leading forms, errors *within* which they hold, and *where*: below which values of
ratios such as h/R and delta/h. Output: a verdict on each, proved on the whole box by bounds, disproved by numbers, or
undecided, with the box that is left. Where no box is given the largest is sought on which the claim can be proved, all
ratios of the order below one number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import mpmath
from sympy import Dummy, Expr, Integer, Matrix, Mul, Pow, Rational, Symbol, powsimp

from softdyn.derive.bounds import INF
from softdyn.derive.checks import chains
from softdyn.derive.dominant_balance import definitions
from softdyn.derive.law import ranges_of
from softdyn.derive.positive import Positivity, Range, logarithm_of, positivity, ranges_between, ranges_of_positive
from softdyn.derive.soundness import tidy
from softdyn.derive.symbols import COMMON_PARAMETERS, F, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

#: Boxes looked at for each side of a claim.
MOST = 120
#: Ends of the boxes that are tried where none is given: these parts of a power of ten, down to 1e-12.
PARTS, SMALLEST = 4, 12


@dataclass(frozen=True)
class ErrorFinding:
    """Verdict on the error of one claim.

    Attributes
    ----------
    limit, quantity : str
    claimed : Expr
    error : Rational
        The claim is that abs(quantity/claimed - 1) < error.
    where : dict from Expr to Rational
        Below which value each ratio is: given, or found.
    verdict : "proved", "disproved" or "undecided"
    reason : str
        Numbers at which it fails, or the box that is left.
    boxes : int
        Boxes looked at.
    given : bool
        Whether the law says where.
    """

    limit: str
    quantity: str
    claimed: Expr
    error: Rational
    where: dict[Expr, Rational]
    verdict: Literal["proved", "disproved", "undecided"]
    reason: str
    boxes: int
    given: bool

    def __str__(self) -> str:
        percent = f"{float(100 * self.error):.4g} %"
        box = " and ".join(f"{ratio} < {float(bound):.3g}" for ratio, bound in self.where.items())
        return f"within {percent} for {box}" if box else f"within {percent}"


def check_errors(law: ContactLaw) -> list[ErrorFinding]:
    """Prove or disprove the errors that a law claims of its limits."""
    return [_check(law, limit, quantity, error) for limit in law.limits for quantity, error in limit.within.items()]


def _check(law: ContactLaw, limit: Limit, quantity: str, error: Rational) -> ErrorFinding:
    claimed = limit.claims[quantity]
    finding = ErrorFinding(
        limit.name, quantity, claimed, error, dict(limit.where), "undecided", "", 0, bool(limit.where)
    )
    if limit.where:
        return _on_box(law, limit, finding, _judge(law, limit, quantity, error, limit.where))
    ratios = _ratios(limit)
    if any(ratio.has(F) for ratio in ratios):
        return replace(finding, reason="the order compares forces: say where, in ratios of h and delta")
    # the largest box: what is proved on one is on each that it holds
    low, high, best, boxes = 0, PARTS * SMALLEST, None, 0
    while low <= high:
        part = (low + high) // 2
        where = dict.fromkeys(ratios, _bound(part))
        found = _judge(law, limit, quantity, error, where)
        boxes += found.boxes
        if found.verdict == "positive":
            best, high = where, part - 1
        else:
            low = part + 1
    if best is None:
        return replace(
            finding, reason=f"not proved even where all ratios are below {float(_bound(low)):g}", boxes=boxes
        )
    return replace(finding, verdict="proved", where=best, boxes=boxes)


def _on_box(law: ContactLaw, limit: Limit, finding: ErrorFinding, found: Positivity) -> ErrorFinding:
    if found.verdict == "positive":
        return replace(finding, verdict="proved", boxes=found.boxes)
    if found.verdict == "unknown":
        left = ", ".join(f"{low:.3g} < {name} < {high:.3g}" for name, (low, high) in found.left.items())
        return replace(finding, reason=f"not decided for {left}", boxes=found.boxes)
    at = ", ".join(f"{name} = {mpmath.nstr(number, 3)}" for name, number in found.at.items())
    reason = f"at {at} (R = E = eta = 1) found/claimed is {mpmath.nstr(found.value, 6)}"
    return replace(finding, verdict="disproved", reason=reason, boxes=found.boxes)


def _bound(part: int) -> Rational:
    """One of the ends that are tried, to two digits."""
    return Rational(str(float(f"{10 ** (-part / PARTS):.1e}")))


def _ratios(limit: Limit) -> list[Expr]:
    return [small / large for chain in chains(limit) for small, large in pairwise(chain)]


def found_in_gap(law: ContactLaw, quantity: str) -> dict[str, Expr]:
    """A quantity of a law, and the force, in h, delta and the parameters."""
    known: dict[Symbol, Expr] = {}
    for symbol, expr in definitions(law).items():
        known[symbol] = expr.subs(known)
    named = {symbol.name: expr for symbol, expr in known.items()} | {"delta": delta}
    named["F_ela"] = named.get("F", delta)
    return {"found": named[quantity], "F": named["F_ela"]}


def _judge(law: ContactLaw, limit: Limit, quantity: str, error: Rational, where: Mapping[Expr, Rational]) -> Positivity:
    """Whether found/claimed is between 1 - error and 1 + error where ratios are below given values."""
    units = dict.fromkeys(COMMON_PARAMETERS, Integer(1))
    terms = found_in_gap(law, quantity)
    size = Dummy("size", positive=True)
    side = -1 if any((-delta) in chain for chain in chains(limit)) else 1
    ratio = terms["found"] / limit.claims[quantity].subs(F, terms["F"])
    ratio = powsimp(tidy(ratio.subs(delta, side * size).subs(units)), force=False)
    inside, domain = _coordinates(law, {key.subs(delta, side * size).subs(units): x for key, x in where.items()}, size)
    ratio = tidy(ratio.subs(inside, simultaneous=True))
    names = {symbol.name: str(key) for key, (symbol, _) in zip(where, domain, strict=False)}
    boxes, left = 0, None
    for side_of_claim, gap in ((1, 1 + error - ratio), (-1, ratio - 1 + error)):
        found = positivity(gap, domain, MOST)
        boxes += found.boxes
        if found.verdict == "witness":
            off = 1 + side_of_claim * (mpmath.mpf(int(error.p)) / int(error.q) - found.value)
            return replace(found, value=off, boxes=boxes, at={names.get(x, x): n for x, n in found.at.items()})
        left = found.left if found.verdict == "unknown" else left
    if left is not None:
        return Positivity("unknown", boxes=boxes, left={names.get(x, x): ends for x, ends in left.items()})
    return Positivity("positive", boxes=boxes)


def _coordinates(
    law: ContactLaw, where: Mapping[Expr, Rational], size: Symbol
) -> tuple[dict[Symbol, Expr], tuple[tuple[Symbol, tuple[Range, ...]], ...]]:
    """Lengths in terms of the ratios that are bounded, and of what is left free; the domain of all of these."""
    variables = [h, size, *law.parameters]
    free = {symbol for symbol in variables if symbol in ranges_of(law) or not symbol.is_positive}
    order = [*(symbol for symbol in variables if symbol not in free)]
    rows = Matrix([[key.as_powers_dict().get(symbol, 0) for symbol in order] for key in where])
    scales = [Mul(*(b**e for b, e in key.as_powers_dict().items() if b.is_number)) for key in where]
    ratios = [Symbol(f"ratio {i}", positive=True) for i in range(len(where))]
    _, pivots = rows.rref()
    solved = {}
    if pivots:
        chosen = rows[:, list(pivots)]
        others = [i for i in range(len(order)) if i not in pivots]
        inverse = chosen.inv()
        for row, pivot in enumerate(pivots):
            # ratio_k/scale_k = product of all lengths to their powers
            parts = [Pow(x / scale, inverse[row, k]) for k, (x, scale) in enumerate(zip(ratios, scales, strict=True))]
            mixed = inverse[row, :] * rows[:, others] if others else None
            rest = [Pow(order[i], -mixed[0, k]) for k, i in enumerate(others)] if mixed is not None else []
            solved[order[pivot]] = Mul(*parts, *rest)
    domain: list[tuple[Symbol, tuple[Range, ...]]] = [
        (x, (Range(y, y, (-INF, logarithm_of(bound))),))
        for x, bound in zip(ratios, where.values(), strict=True)
        for y in [Dummy(x.name, positive=True)]
    ]
    allowed = ranges_of(law)
    for symbol in variables:
        if symbol not in solved:
            free_values = ranges_of_positive(symbol.name)
            known = ranges_between(symbol.name, allowed[symbol]) if symbol in allowed else free_values
            domain.append((symbol, known))
    return solved, tuple(domain)
