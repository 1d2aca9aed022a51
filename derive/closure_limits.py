"""Proof or refutation of the limits that a closure claims, and the jumps of one that is declared by cases.

Input: a closure. Output: findings as those of a law (:mod:`softdyn.derive.limits`), and jumps.

What a claim is about, and its claimed form, are expanded in the whole of the ordering; the leading term of their
quotient must be 1. Besides, each claim is looked at in numbers, on random paths into the ordering, which know of no
proof.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from random import Random

import mpmath
from sympy import Dummy, Expr, Piecewise, Rational, S, Symbol, lambdify, log, simplify
from sympy.core.relational import Relational

from softdyn.derive.asymptotics import (
    KEPT,
    AxisError,
    OutOfEffortError,
    Series,
    SplitError,
    UndecidedError,
    expand,
    leading,
    minus,
)
from softdyn.derive.checks import chains
from softdyn.derive.closure import (
    Closure,
    c,
    claimed_of,
    dimensions_for,
    in_fractions,
    phi,
    ranges_of,
    result_of,
    sample_values,
    size_of,
)
from softdyn.derive.dimensions import DIMENSIONLESS, Dimension
from softdyn.derive.forms import joined_logarithms
from softdyn.derive.law import Limit
from softdyn.derive.limits import (
    EFFORT,
    MORE_TERMS,
    Finding,
    Findings,
    Piece,
    how_it_fails,
    ordering,
    rate_of,
    ratio_of,
    simplified,
    together,
    with_more_terms,
)
from softdyn.derive.patience import within
from softdyn.derive.positive import knowing_ranges
from softdyn.derive.scalings import Part, SeveralLogarithmsError, settled, whole
from softdyn.derive.witness import FAR, LASTING

#: Why nothing is known of an ordering that contradicts itself.
NO_SCALING = "no scaling has this ordering"
#: Decades by which ratios have fallen along a path; paths that are drawn, and at most looked at.
LEVELS, DRAWN, PATHS = (10, 20, 40), 400, 12
#: Powers of eps that a symbol may go with, and digits that are enough for them.
POWERS, DIGITS = (-2, -1, Rational(-1, 2), 0, Rational(1, 3), 1, Rational(3, 2)), 400
#: What may be left of a deviation: of itself, or of what it was.
TOLERABLE, LITTLE = 1e-2, 0.5


@dataclass(frozen=True)
class Ordered:
    """An ordering in symbols that vary by powers.

    Attributes
    ----------
    pairs : tuple of (small, large)
    written : mapping from Symbol to Expr
        What a symbol that stands for a difference is.
    replaced : mapping from Symbol to Expr
        The volume fraction in such a symbol.
    fraction : Symbol
        c or phi: the volume fraction that all is written in; of a potential the distance.
    unit : Dimension
        Of the differences.
    """

    pairs: tuple[tuple[Expr, Expr], ...]
    written: Mapping[Symbol, Expr]
    replaced: Mapping[Symbol, Expr]
    fraction: Symbol
    unit: Dimension = DIMENSIONLESS

    @property
    def varying(self) -> list[Symbol]:
        """All that varies."""
        return sorted({symbol for pair in self.pairs for size in pair for symbol in size.free_symbols}, key=str)


@dataclass(frozen=True)
class Known:
    """What is known of the symbols in a claim: their dimensions, and a value of each, to look at it in numbers."""

    units: Mapping[Symbol, Dimension]
    samples: Mapping[Symbol, Rational]


def known_of(closure: Closure) -> Known:
    """What is known of the symbols of a closure."""
    return Known(dimensions_for(closure), sample_values(closure))


def ordered(limit: Limit) -> Ordered:
    """Return the ordering of a limit."""
    written: dict[Symbol, Expr] = {}
    replaced: dict[Symbol, Expr] = {}
    pairs = []
    fraction = c
    for chain in chains(limit):
        sizes = []
        for member in map(S, chain):
            difference = size_of(member)
            if difference is not None:
                symbol, rest = difference
                gap = Dummy("gap", positive=True)
                written[gap], replaced[symbol] = member, rest - gap
            sizes.append(member if difference is None else gap)
            fraction = phi if member.has(phi) else fraction
        pairs += list(pairwise(sizes))
    return Ordered(tuple(pairs), written, replaced, fraction)


def check_closure_limits(closure: Closure, effort: int = EFFORT) -> Findings:
    """Prove or disprove every limit that a closure claims.

    Parameters
    ----------
    closure : Closure
    effort : int
        Operations after which claims that are not yet decided are left undecided.
    """
    found = Findings()
    with within(effort, OutOfEffortError), knowing_ranges(ranges_of(closure)):
        for limit in closure.limits:
            order = ordered(limit)
            for quantity, claimed in limit.claims.items():
                about = claimed_of(closure, quantity)
                assert about is not None
                value = about.subs(result_of(closure), closure.expression)
                sides = [in_fractions(closure, x, order.fraction).xreplace(order.replaced) for x in (value, S(claimed))]
                found.append(_finding(closure, limit, order, str(quantity), claimed, (sides[0], sides[1])))
    return found


def _finding(
    closure: Closure, limit: Limit, order: Ordered, quantity: str, claimed: Expr, sides: tuple[Expr, Expr]
) -> Finding:
    return finding_of(known_of(closure), limit, order, quantity, claimed, sides)


def finding_of(
    known: Known, limit: Limit, order: Ordered, quantity: str, claimed: Expr, sides: tuple[Expr, Expr]
) -> Finding:
    """Verdict on a claim, with what is known of it; the sides are as :func:`verdict_on` takes them.

    Parameters
    ----------
    known : Known
    limit : Limit
    order : Ordered
        Its ordering.
    quantity : str
        What is claimed of.
    claimed : Expr
    sides : (Expr, Expr)
    """
    piece, samples = verdict_on(known, order, quantity, sides)
    return Finding(
        limit.name, ordering(limit), quantity, claimed, piece.verdict, piece.ratio, piece.reason,
        rate=piece.rate, holds=_set_of(limit, order, sides), samples=samples,
    )  # fmt: skip


def verdict_on(known: Known, order: Ordered, quantity: str, sides: tuple[Expr, Expr]) -> tuple[Piece, int]:
    """Verdict on a claim in an ordering, and on how many paths into it numbers were looked at.

    Parameters
    ----------
    order : Ordered
        Of products of powers.
    sides : (Expr, Expr)
        What is found, and what is claimed of it.
    """
    try:
        piece = together(judged(known, order, quantity, *sides))
    except UndecidedError as why:
        piece = Piece("undecided", None, str(why))
    ratio = None if piece.ratio is None else piece.ratio.xreplace(order.written)
    looked = (_deviations(known, path, sides) for path in paths_of(order))
    off = [values for values in looked if values is not None]
    verdict, reason = piece.verdict, piece.reason
    if verdict == "proved" and any(not _falls(values) for values in off):
        verdict, reason = "undecided", f"the series gives the ratio {ratio}, but the numbers do not tend to it"
    if verdict == "disproved" and not any(_lasts(values) for values in off):
        verdict, reason = "undecided", f"{reason}; but no path was found on which it fails"
    rate = tuple(term.xreplace(order.written) for term in piece.rate)
    return replace(piece, verdict=verdict, ratio=ratio, reason=reason, rate=rate), len(off)


def _set_of(limit: Limit, order: Ordered, sides: tuple[Expr, Expr]) -> str:
    fixed = sorted((sides[0] / sides[1]).free_symbols - set(order.varying), key=str)
    given = f", at any fixed {', '.join(map(str, fixed))}" if fixed else ""
    return f"as every inequality of {ordering(limit)} sharpens, at whatever rates{given}"


def judged(known: Known, order: Ordered, quantity: str, value: Expr, claimed: Expr) -> list[Piece]:
    """Verdicts on a claim in the parts of its ordering: that value/claimed tends to 1.

    Parameters
    ----------
    known : Known
    order : Ordered
    quantity : str
        What is claimed of.
    value, claimed : Expr

    Raises
    ------
    UndecidedError
        Also if nothing has this ordering.
    """
    varying = order.varying
    directions = {x: tuple(int(i == j) for j in range(len(varying))) for i, x in enumerate(varying)}
    units = {**known.units, **dict.fromkeys(order.written, order.unit)}

    def in_parts(decomposed: bool) -> list[Piece]:
        parts = [whole(directions, decomposed)]
        for small, large in order.pairs:

            def compared(part: Part, small: Expr = small, large: Expr = large) -> bool:
                return _is_inside(part, small, large)

            inside = settled(parts, compared, units)
            parts = [part for part, holds in inside if holds]
        if not parts:
            raise UndecidedError(NO_SCALING)
        return [piece for _, piece in settled(parts, lambda part: _judge(part, quantity, value, claimed), units)]

    try:
        return in_parts(decomposed=False)
    except SeveralLogarithmsError:
        return in_parts(decomposed=True)


def _is_inside(part: Part, small: Expr, large: Expr) -> bool:
    """Whether one size is much smaller than another in a part."""
    scale = part.scale(1)
    found = minus(*(leading(expand(x, scale), x)[0] for x in (small, large)))
    if any(x < 0 for x in found) and any(x > 0 for x in found):
        raise SplitError(found, f"{small} << {large}")
    return any(x > 0 for x in found)


def _judge(part: Part, quantity: str, value: Expr, claimed: Expr) -> Piece:
    """Verdict on a claim in one part of its ordering."""
    if claimed == 0 or value == 0:
        same = claimed == 0 and value == 0
        return Piece("proved" if same else "disproved", None, "both vanish" if same else "one of the two vanishes")
    try:
        found, claim = with_more_terms(
            lambda kept: _known_enough(expand(value, part.scale(kept)), expand(claimed, part.scale(kept))), MORE_TERMS
        )
        ratio, powers = ratio_of(found, claim, quantity, part.scale(KEPT))
    except (SplitError, AxisError):
        raise
    except UndecidedError as reason:
        return Piece("undecided", None, str(reason))
    tends = part.axes.written(simplified(ratio))
    rate = tuple(joined_logarithms(part.axes.written(term)) for term in rate_of(found, claim, quantity)[0])
    if tends == 1 and not any(powers):
        return Piece("proved", S.One, "the leading terms are equal", rate=rate)
    return Piece("disproved", tends, how_it_fails(tends, powers), rate=rate)


def _known_enough(found: Series, claim: Series) -> tuple[Series, Series]:
    """Both series, if the leading terms have not cancelled."""
    leading(found)
    leading(claim)
    return found, claim


# ------------------------------------------------------------------------------------------------------ in numbers


def paths_of(order: Ordered) -> list[dict[Symbol, Rational]]:
    """Powers of eps on which every inequality sharpens, the same at every call."""
    draw = Random(0)
    found: list[dict[Symbol, Rational]] = []
    for _ in range(DRAWN):
        path = {symbol: S(draw.choice(POWERS)) for symbol in order.varying}
        exponents = [
            sum((path[x] * n for x, n in (small / large).as_powers_dict().items() if x in path), start=S.Zero)
            for small, large in order.pairs
        ]
        if all(x > 0 for x in exponents) and path not in found:
            found.append(path)
    return found[:PATHS]


def _deviations(known: Known, path: Mapping[Symbol, Rational], sides: tuple[Expr, Expr]) -> list[mpmath.mpf] | None:
    """Return abs(found/claimed - 1) along a path; None if it has no value somewhere."""
    quotient = sides[0] / sides[1]
    arguments = sorted(quotient.free_symbols, key=str)
    function = lambdify(arguments, quotient, modules="mpmath", dummify=True)
    off = []
    for level in LEVELS:
        with mpmath.workdps(DIGITS):
            values = {x: mpmath.mpf(int(v.p)) / int(v.q) for x, v in known.samples.items()}
            values |= {
                x: mpmath.mpf(3) / 4 * mpmath.mpf(10) ** (-level * mpmath.mpf(p.p) / p.q) for x, p in path.items()
            }
            try:
                off.append(abs(function(*(values[x] for x in arguments)) - 1))
            except (ZeroDivisionError, ValueError, OverflowError, TypeError):
                return None
    return off


def _falls(off: Sequence[mpmath.mpf]) -> bool:
    return bool(off[-1] < TOLERABLE or off[-1] < LITTLE * off[0])


def _lasts(off: Sequence[mpmath.mpf]) -> bool:
    """Whether a deviation stays away from 0; one of less than :data:`FAR` too, if it does not change."""
    return bool(off[-1] >= LASTING * off[-2] and (off[-1] > FAR or off[-1] <= off[-2] / LASTING) and off[-1] > 1e-6)


# ----------------------------------------------------------------------------------------------------------- jumps


#: Characters beyond which a ratio is told as a number only.
MOST_SHOWN = 60


@dataclass(frozen=True)
class Jump:
    """Where the cases of a closure do not meet.

    Attributes
    ----------
    symbol : Symbol
    at, left, right, ratio : Expr
        The value where it jumps; what the closure gives below and above it; left over right.
    example : mapping from Symbol to Rational
        Values of what the ratio depends on.
    """

    symbol: Symbol
    at: Expr
    left: Expr
    right: Expr
    ratio: Expr
    example: Mapping[Symbol, Rational]

    def __str__(self) -> str:
        number = mpmath.nstr(mpmath.mpf(str(self.ratio.subs(self.example).evalf(20))), 5)
        given = ", ".join(f"{symbol} = {value}" for symbol, value in self.example.items())
        exact = f"{self.ratio}, " if len(str(self.ratio)) < MOST_SHOWN else ""
        return f"jumps at {self.symbol} = {self.at}: below/above = {exact}{number}{given and f' at {given}'}"


def jumps_of(closure: Closure) -> list[Jump]:
    """Where a closure by cases jumps: at the values that its conditions compare one symbol with."""
    expr = in_fractions(closure, closure.expression)
    ends = {found for one in expr.atoms(Relational) if (found := _end_of(one)) is not None}
    jumps = []
    for symbol, at in sorted(ends, key=str):
        left, right = (_beside(expr, symbol, at, side).subs(symbol, at) for side in (-1, 1))
        # joined, logarithms of numbers may have no end of digits
        ratio = left / right if (left / right).has(log) else simplified(left / right)
        if ratio != 1 and (example := _example(closure, ratio, at)) is not None:
            jumps.append(Jump(symbol, at, left, right, ratio, example))
    return jumps


#: Values that are tried for a symbol on which it depends whether there is a jump.
TRIED = tuple(Rational(k, 10) for k in (5, 7, 9, 3, 1))


def _example(closure: Closure, ratio: Expr, at: Expr) -> dict[Symbol, Expr] | None:
    """Values at which a ratio is not 1; None if it is 1 at all that are tried."""
    symbols = sorted((ratio.free_symbols | at.free_symbols), key=str)
    values = {symbol: sample_values(closure)[symbol] for symbol in symbols}
    others = [{**values, symbol: value} for symbol in symbols for value in TRIED]
    return next((some for some in (values, *others) if ratio.subs(some) != 1), None)


def _end_of(condition: Relational) -> tuple[Symbol, Expr] | None:
    """The symbol that a condition compares, and with what; None if it is not linear in one."""
    difference = condition.lhs - condition.rhs
    for symbol in sorted(difference.free_symbols, key=str):
        slope = difference.diff(symbol)
        if not slope.has(symbol) and slope.is_number:
            return symbol, -difference.subs(symbol, 0) / slope
    for symbol in sorted(difference.free_symbols, key=str):
        slope = difference.diff(symbol)
        if not slope.has(symbol):
            return symbol, simplify(-difference.subs(symbol, 0) / slope)
    return None


def _beside(expr: Expr, symbol: Symbol, at: Expr, side: int) -> Expr:
    """An expression with the cases that apply next to a value of a symbol."""
    beside = at * (1 + side * Rational(1, 10**9))
    known = {
        one: S(bool(told)) for one in expr.atoms(Relational) if (told := one.subs(symbol, beside)) in (S.true, S.false)
    }
    return expr.replace(lambda x: isinstance(x, Piecewise), lambda x: x.subs(known))
