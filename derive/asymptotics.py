"""Asymptotic series in several independent small ratios, by dominant balance on the expression tree.

A cone of scalings is spanned by rays; moving along each of them by its own small ratio r1, r2, ... reaches every
scaling inside. A symbol then has an order, the powers of the ratios that it goes with, and every expression is a series
of terms of different orders, exact in rationals. One term is negligible against another only if their quotient has no
negative power of any ratio, that is, whatever the powers with which the ratios vanish: so what holds here holds for
every scaling inside the cone. Where two terms compete, :class:`SplitError` says by which hyperplane to cut the cone.

Coefficients keep the symbols themselves: a leading term can be read as it stands. Logarithms grow more slowly than any
power; they stay in the coefficients, as sums of log(symbol).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from operator import add, sub
from typing import TypeVar
from zlib import crc32

from sympy import (
    Abs,
    Add,
    Dummy,
    Expr,
    Function,
    Integer,
    LambertW,
    Max,
    Min,
    Mul,
    Piecewise,
    Poly,
    Pow,
    Rational,
    S,
    Symbol,
    acos,
    acosh,
    acoth,
    asin,
    asinh,
    atan,
    atanh,
    cos,
    cosh,
    coth,
    erf,
    erfc,
    exp,
    expand_log,
    expand_power_base,
    factor_terms,
    factorial,
    ff,
    log,
    nan,
    preorder_traversal,
    sign,
    simplify,
    sin,
    sinh,
    tan,
    tanh,
    zoo,
)
from sympy import expand as multiplied_out
from sympy.codegen.cfunctions import expm1, log1p
from sympy.core.relational import Ge, Gt, Le, Lt
from sympy.logic.boolalg import And, Boolean, Not, Or

from softdyn.derive.bessel import Bessel, powers_at_zero
from softdyn.derive.cones import Cone, Normal, dot
from softdyn.derive.identities import Tail, at_zero, everywhere, far_out
from softdyn.derive.patience import nodes, spend
from softdyn.derive.positive import knows_range_in, sides_taken
from softdyn.derive.regions import combination
from softdyn.derive.splines import Spline

#: Powers of the ratios: whole ones as int, which is many times faster.
Order = tuple[int | Fraction, ...]

#: Terms kept in a series; further ones go into its remainder.
KEPT = 8

#: Analytic functions, expanded about a finite argument.
ANALYTIC = (exp, sin, cos, tan, atan, sinh, cosh, tanh, asinh, erf, erfc, LambertW, Bessel, Spline)

#: Functions that are written in these.
DERIVED = (acosh, acos, asin, atanh, acoth, coth)

#: Operations that it takes to try to simplify something, for each of its nodes.
REWRITTEN = 50

#: Operations beyond which simplification is not tried: it may not come to an end.
MOST_OPERATIONS = 60


class UndecidedError(Exception):
    """The method cannot tell; the text says why."""


class CancelError(UndecidedError):
    """The leading terms cancel, to the order kept: more terms may tell."""


class OutOfEffortError(UndecidedError):
    """The operations allowed are used up."""

    def __init__(self, reason: str = "it takes more operations than are allowed") -> None:
        super().__init__(reason)


class SplitError(UndecidedError):
    """Two terms compete: which of them dominates depends on the scaling.

    Attributes
    ----------
    values : tuple of Fraction
        Order of one over the other: positive and negative at different rays of the cone.
    """

    def __init__(self, values: Order, what: object) -> None:
        super().__init__(f"no term of {what} dominates in the whole of the ordering: it must be split")
        self.values = values


class AxisError(UndecidedError):
    """An exponential or a logarithm varies in a region, and has no axis yet.

    Attributes
    ----------
    kind : "exp", "log" or "power"
    argument : Expr
        m, large and positive, of exp(-m); or M, a product of powers that vanishes, of log(1/M) or M^power.
    order : Order
        That of the argument.
    power : Expr
        One that is no rational number.
    """

    def __init__(self, kind: str, argument: Expr, order: Order, power: Expr = S.One) -> None:
        super().__init__(f"{kind}({argument}) has no axis of its own")
        self.kind, self.argument, self.order, self.power = kind, argument, order, power


@dataclass(frozen=True)
class Axes:
    """Exponentials and logarithms with an axis of their own: symbols that vary as others do.

    Attributes
    ----------
    exponentials : mapping from Expr to Symbol
        From m to the symbol that stands for exp(-m).
    logarithms : mapping from Expr to Symbol
        From M, a product of powers of symbols, to the symbol that stands for log(1/M).
    powers : mapping from (Expr, Expr) to Symbol
        From M and a power that is no rational number to a symbol as large as M to that power. Coefficients hold no
        such symbol: it only tells an order.
    """

    exponentials: Mapping[Expr, Symbol] = field(default_factory=dict)
    logarithms: Mapping[Expr, Symbol] = field(default_factory=dict)
    powers: Mapping[tuple[Expr, Expr], Symbol] = field(default_factory=dict)

    def meanings(self) -> dict[Symbol, Expr]:
        """Return what each symbol stands for."""
        names = {X: exp(-m) for m, X in self.exponentials.items()}
        return names | {Y: log(1 / M) for M, Y in self.logarithms.items()}

    def written(self, form: Expr) -> Expr:
        """A form in the law's own symbols."""
        names = self.meanings()
        while form.free_symbols & names.keys():
            form = form.xreplace(names)
        return form


@dataclass(frozen=True)
class Series:
    """A sum of terms of different orders in the ratios, up to terms of the order of the remainder.

    ``terms`` maps orders to coefficients; ``remainder`` holds the orders of what was cut off.
    """

    terms: Mapping[Order, Expr] = field(default_factory=dict)
    remainder: frozenset[Order] = frozenset()


@dataclass(frozen=True)
class Scale:
    """What is known of the symbols in a cone of scalings.

    Attributes
    ----------
    size : int
        How many ratios there are.
    known : mapping from Symbol to Series
        Every symbol that varies with the ratios; all others are fixed.
    orders : mapping from Symbol to Order
        Of the symbols that the logarithms in coefficients may hold.
    kept : int
        Terms kept in a series.
    imaginary : bool
        Whether the root of something negative is taken, and not refused.
    axes : Axes or None
        Exponentials and logarithms that are symbols here. None: the cone is one of powers alone; exponentials are
        smaller, or larger, than any, and logarithms stay in the coefficients.
    """

    size: int
    known: Mapping[Symbol, Series]
    orders: Mapping[Symbol, Order]
    kept: int = KEPT
    imaginary: bool = False
    axes: Axes | None = None
    #: Whether sums may be given names where leading terms cancel.
    names: bool = True
    #: What symbols that follow from others are in terms of these.
    formulas: Mapping[Symbol, Expr] = field(default_factory=dict)
    #: Series found so far: the same sums stand in many places of a law.
    found: dict[Expr, Series] = field(default_factory=dict, compare=False, repr=False)

    def knowing(self, symbol: Symbol, series: Series, formula: Expr | None = None) -> Scale:
        """The same, with one symbol more; with what it is in terms of others, if that is said.

        Parameters
        ----------
        symbol : Symbol
        series : Series
            Of the symbol.
        formula : Expr, optional
            The symbol in terms of others.
        """
        found = {expr: value for expr, value in self.found.items() if symbol not in symbols_in(expr)}
        formulas = self.formulas if formula is None else {**self.formulas, symbol: formula}
        return replace(self, known={**self.known, symbol: series}, found=found, formulas=formulas)


def scale_of(
    cone: Cone,
    directions: Mapping[Symbol, Normal],
    kept: int = KEPT,
    axes: Axes | None = None,
) -> Scale:
    """Return the scale of a cone.

    Parameters
    ----------
    cone : Cone
        Over some axes.
    directions : mapping from Symbol to Normal
        The exponent of each symbol, as a linear form of the axes.
    axes : Axes, optional
        Those of the symbols that stand for exponentials and logarithms.
    """
    orders = {symbol: tuple(dot(direction, ray) for ray in cone) for symbol, direction in directions.items()}
    known = {symbol: Series({order: symbol}) for symbol, order in orders.items()}
    return Scale(len(cone), known, orders, kept, axes=axes)


def zero(scale: Scale) -> Order:
    """Return the order of what does not vary."""
    return (0,) * scale.size


def negligible(small: Order, large: Order) -> bool:
    """Whether one term vanishes against another, however the ratios tend to zero."""
    # a loop, as this is asked a million times: all(...) makes a generator each time
    for x, y in zip(small, large, strict=True):
        if x < y:
            return False
    return small != large


def minimal(orders: Iterable[Order]) -> list[Order]:
    """Return the orders that are negligible against no other."""
    known = set(orders)
    if len(known) < 2:
        return list(known)
    least = tuple(map(min, zip(*known, strict=True)))
    if least in known:
        return [least]
    distinct = sorted(known)
    return [e for e in distinct if not any(negligible(e, other) for other in distinct)]


def leading(series: Series, what: object = "the expression") -> tuple[Order, Expr]:
    """Return order and coefficient of the term that dominates all others.

    Raises
    ------
    SplitError
        If none dominates throughout the cone.
    CancelError
        If the terms cancel as far as they are known.
    UndecidedError
        If the series has no term at all: it is smaller than any power.
    """
    if not series.terms and not series.remainder:
        raise UndecidedError(f"{what} is smaller than any power of the ratios")
    candidates = minimal([*series.terms, *series.remainder])
    if len(candidates) > 1:
        raise SplitError(minus(candidates[0], candidates[1]), what)
    (dominant,) = candidates
    if dominant not in series.terms:
        raise CancelError(f"the leading terms of {what} cancel, to the order kept")
    return dominant, series.terms[dominant]


def expand(expr: Expr, scale: Scale) -> Series:
    """Series of an expression in the ratios of a cone of scalings.

    Raises
    ------
    UndecidedError
        Where the method does not apply, saying why.
    """
    if expr.is_Symbol:
        return scale.known.get(expr, Series({zero(scale): expr}))
    if expr not in scale.found:
        spend()
        scale.found[expr] = _expanded(expr, scale)
    return scale.found[expr]


def _expanded(expr: Expr, scale: Scale) -> Series:
    if symbols_in(expr).isdisjoint(scale.known):
        expr = _with_known_signs(expr)
        return Series({} if is_zero(expr) else {zero(scale): expr})
    if isinstance(expr, Add):
        series = _cut_sum([expand(term, scale) for term in expr.args], scale.kept)
        return _with_names(expr, series, scale) if scale.names and _is_cut_off(series) else series
    if isinstance(expr, Mul):
        fixed, varying = expr.as_independent(*scale.known, as_Add=False)
        fixed = _with_known_signs(fixed)
        product = Series({} if is_zero(fixed) else {zero(scale): fixed})
        for factor in Mul.make_args(varying):
            product = multiplied(product, expand(factor, scale), scale.kept)
        return product
    if isinstance(expr, Pow) and scale.axes is None and expr.exp.is_negative and _grows_exponentially(expr.base, scale):
        return Series()  # smaller than any power of the ratios
    if isinstance(expr, Pow) and symbols_in(expr.exp).isdisjoint(scale.known) and expr.exp.is_real:
        return raised(expand(expr.base, scale), expr.exp, expr.base, scale)
    if isinstance(expr, Pow):
        return expand(exp(expr.exp * log(expr.base), evaluate=False), scale)
    if isinstance(expr, (Abs, sign)):
        argument = expand(expr.args[0], scale)
        side = sign_of(leading(argument, expr.args[0])[1], expr.args[0], scale)
        return Series({zero(scale): S(side)}) if isinstance(expr, sign) else scaled(argument, S(side))
    if isinstance(expr, (Min, Max)):
        return _extremum(expr, scale)
    if isinstance(expr, Piecewise):
        return _branch(expr, scale)
    if isinstance(expr, (log1p, expm1)):
        return expand(expr.expand(func=True), scale)
    if isinstance(expr, log):
        return _logarithm(expand(expr.args[0], scale), expr, scale)
    if isinstance(expr, DERIVED):
        return expand(everywhere(expr), scale)
    if isinstance(expr, exp) and scale.axes is not None:
        return _exponential(expr, expand(expr.args[0], scale), scale.axes, scale)
    if isinstance(expr, ANALYTIC):
        return _analytic(expr, expand(expr.args[0], scale), scale)
    raise UndecidedError(f"{expr.func} is outside the method")


def _is_cut_off(series: Series) -> bool:
    """Whether something that was cut off may be as large as all that is known."""
    return any(order not in series.terms for order in minimal([*series.terms, *series.remainder]))


#: Choices of names that are tried, each for one sum or more.
MOST_NAMED = 6


def _with_names(expr: Expr, cut_off: Series, scale: Scale) -> Series:
    """Series of a sum whose leading terms cancel, with names for what occurs in it more than once.

    In (1 + x) log(1 + 1/x) - 1 with x = h/(b (1 + h/R)) the leading terms cancel at every power of h/R; with a name for
    1 + h/R they cancel once and for all. What is named is as large as its leading term, so it is a symbol that varies.
    Names are written out again in the terms that are left, each of which is then expanded.
    """
    written = expr
    while written.free_symbols & scale.formulas.keys():
        written = written.xreplace(scale.formulas)
    if nodes(written) > MOST_NODES:
        return cut_off
    missing: SplitError | AxisError | None = None
    plain = replace(scale, names=False, found={})
    for sums in _choices_of_names(written, scale):
        meanings: dict[Symbol, Expr] = {}
        try:
            here, meanings = _naming(sums, plain)
            series = expand(written.xreplace({total: name for name, total in meanings.items()}), here)
            terms = [coefficient.xreplace(meanings) for coefficient in series.terms.values()]
            if any(term.has(nan, zoo) for term in terms):
                continue
            found = _cut(added([Series({}, series.remainder), *(expand(x, plain) for x in terms)]), scale.kept)
        except OutOfEffortError:
            raise
        except SplitError as competing:
            missing = missing or competing
        except AxisError as axis:
            missing = missing if missing or symbols_in(axis.argument) & meanings.keys() else axis
        except UndecidedError:
            continue
        else:
            if not _is_cut_off(found):
                return found
    if missing is not None:
        raise missing
    return cut_off


#: Nodes beyond which an expression is not written out.
MOST_NODES = 400


def _choices_of_names(expr: Expr, scale: Scale) -> Iterator[list[Expr]]:
    """Sums and functions to be named: all that hold no other, then each alone, the largest first."""
    spend(nodes(expr))
    count = Counter(node for node in preorder_traversal(expr) if isinstance(node, (Add, Function)) and node != expr)
    repeated = [node for node, times in count.items() if times > 1 and not symbols_in(node).isdisjoint(scale.known)]
    inner = [node for node in repeated if not any(part.has(*repeated) for part in node.args)]
    if len(inner) > 1:
        yield inner
    yield from ([node] for node in sorted(repeated, key=lambda x: (-nodes(x), str(x)))[:MOST_NAMED])


def _naming(sums: Iterable[Expr], scale: Scale) -> tuple[Scale, dict[Symbol, Expr]]:
    """Return a scale in which sums, or functions, are symbols of their own, and what these stand for."""
    meanings: dict[Symbol, Expr] = {}
    known, orders = dict(scale.known), dict(scale.orders)
    for total in sums:
        order, coefficient = leading(expand(total, scale), total)
        name = Dummy("s", positive=True) if sign_of(coefficient, total, scale) > 0 else Dummy("s", negative=True)
        meanings[name] = total
        known[name], orders[name] = Series({order: name}), order
    return replace(scale, known=known, orders=orders, found={}), meanings


def added(parts: Iterable[Series]) -> Series:
    """Sum of series."""
    terms: dict[Order, list[Expr]] = {}
    remainder: set[Order] = set()
    for part in parts:
        remainder |= part.remainder
        for order, coefficient in part.terms.items():
            terms.setdefault(order, []).append(coefficient)
    return Series(_collected(terms), frozenset(remainder))


def _collected(terms: Mapping[Order, list[Expr]]) -> dict[Order, Expr]:
    """Add up the coefficients of each order, and leave out those that cancel."""
    sums = ((order, _total(coefficients)) for order, coefficients in terms.items())
    return {order: total for order, total in sums if total is not None}


def _total(coefficients: Sequence[Expr]) -> Expr | None:
    """Sum of the coefficients of one order; None if they cancel."""
    if len(coefficients) == 1:
        return coefficients[0]
    spend(sum(map(nodes, coefficients)))
    total = _sum(tuple(coefficients))
    return None if is_zero(total) else total


@lru_cache(maxsize=20_000)
def _sum(coefficients: tuple[Expr, ...]) -> Expr:
    """Sum of coefficients, with what is common to all terms outside, so that products cancel."""
    total = Add(*coefficients)
    return factor_terms(total) if total.is_Add else total


@lru_cache(maxsize=100_000)
def symbols_in(expr: Expr) -> frozenset[Symbol]:
    """Return the symbols of an expression: asked of the same parts again and again."""
    return frozenset(expr.free_symbols)


def is_zero(coefficient: Expr) -> bool:
    """Whether a coefficient vanishes identically; decided in numbers first, then proved.

    Raises
    ------
    UndecidedError
        If it vanishes in numbers but that cannot be proved.
    """
    known = _is_zero_by_signs(coefficient)
    if known is not None:
        return known
    spend(nodes(coefficient))
    if not _vanishes_in_numbers(coefficient):
        return False
    spend(REWRITTEN * nodes(coefficient))
    if is_small(coefficient) and any(attempt(coefficient) == 0 for attempt in (multiplied_out, _radicals, simplify)):
        return True
    raise UndecidedError(f"whether {coefficient} vanishes is not known")


@lru_cache(maxsize=20_000)
def _is_zero_by_signs(coefficient: Expr) -> bool | None:
    """What signs say of a coefficient; what sympy says of it, which it finds anew for each equal one."""
    if sign_by_parts(coefficient) is not None or is_apart_from_zero(coefficient):
        return False
    return None if coefficient.is_zero is None else bool(coefficient.is_zero)


#: Rounding of an operation, or of a number, at most; of powers and logarithms, too.
ROUNDED = 4 * 2.0**-53
#: Relative error from which a value in floats tells nothing: below it squares of errors do not matter.
VAGUE = 1e-3
NOTHING = (math.nan, math.inf)


def is_apart_from_zero(expr: Expr) -> bool:
    """Whether a coefficient, at some positive numbers, is seen not to vanish."""
    return math.isfinite(_in_floats(expr)[0])


@lru_cache(maxsize=50_000)
def _in_floats(expr: Expr) -> tuple[float, float]:
    """Value, not 0, at positive numbers that satisfy no simple relation, and a bound of its relative error."""
    try:
        value, error = _value_and_error(expr)
    except (ArithmeticError, ValueError):
        return NOTHING
    # smaller numbers have fewer digits
    return (value, 1.01 * error) if 1e-290 < abs(value) < math.inf and error < VAGUE else NOTHING


def _value_and_error(expr: Expr) -> tuple[float, float]:
    if expr.is_Rational or expr.is_NumberSymbol:
        return float(expr), ROUNDED
    if expr.is_Symbol:
        return (1 + (crc32(expr.name.encode()) % 9973) / 7919, 0.0) if expr.is_positive else NOTHING
    if not (expr.is_Mul or expr.is_Pow or expr.is_Add or isinstance(expr, log)):
        return NOTHING
    values, errors = zip(*map(_in_floats, expr.args), strict=True)
    if expr.is_Mul:
        return math.prod(values), sum(errors) + len(values) * ROUNDED
    if expr.is_Pow:
        power = abs(values[1])
        return math.pow(*values), power * (errors[0] + abs(math.log(abs(values[0]))) * errors[1]) + ROUNDED
    if expr.is_Add:
        total = math.fsum(values)
        off = math.fsum(abs(value) * error for value, error in zip(values, errors, strict=True))
        return total, off / abs(total) + ROUNDED
    # of a number next to one the logarithm is what is left of their difference
    found = math.log(values[0])
    return found, errors[0] / abs(found) + ROUNDED


@lru_cache(maxsize=50_000)
def sign_by_parts(expr: Expr) -> int | None:
    """Sign of what is made of numbers and symbols of known signs by products, powers and sums of one sign; else None.

    Sympy finds it too, after it has asked for all else that may be known of an expression.
    """
    if expr.is_Rational:
        return (expr.p > 0) - (expr.p < 0) or None
    if expr.is_Symbol or expr.is_NumberSymbol:
        return 1 if expr.is_positive else -1 if expr.is_negative else None
    if expr.is_Pow:
        base = sign_by_parts(expr.args[0])
        return 1 if base == 1 and sign_by_parts(expr.args[1]) is not None else None
    if expr.is_Mul:
        signs = [sign_by_parts(factor) for factor in expr.args]
        return None if None in signs else math.prod(signs)  # type: ignore[arg-type]
    if expr.is_Add:
        signs = [sign_by_parts(term) for term in expr.args]
        return signs[0] if len(set(signs)) == 1 else None
    return None


@lru_cache(maxsize=20_000)
def _vanishes_in_numbers(coefficient: Expr) -> bool:
    own = sorted(coefficient.free_symbols, key=str)
    size = sum(abs(_at_sample(term, own)) for term in Add.make_args(coefficient))
    return bool(abs(_at_sample(coefficient, own)) <= size * Rational(1, 10**20))


def is_small(expr: Expr) -> bool:
    """Whether rewriting an expression comes to an end soon."""
    powers = (abs(power.exp) for power in expr.atoms(Pow) if power.exp.is_Rational and power.base.has(Add))
    return expr.count_ops() <= MOST_OPERATIONS and max((max(p.p, p.q) for p in powers), default=0) <= MOST_OPERATIONS


def _at_sample(coefficient: Expr, own: list[Symbol]) -> Expr:
    """Value at positive numbers that satisfy no simple relation."""
    values = {symbol: Rational(17 + 12 * i, 13 + 7 * i) for i, symbol in enumerate(own)}
    # not by subs: an exact number to a high power may have no end of digits
    value = coefficient.evalf(40, subs=values)
    if not value.is_number or not value.is_finite:
        raise UndecidedError(f"{coefficient} has no value")
    return value


def _radicals(coefficient: Expr) -> Expr:
    from sympy import nsimplify, powsimp, radsimp

    return nsimplify(radsimp(powsimp(multiplied_out(coefficient), force=True)))


def _cut(series: Series, kept: int) -> Series:
    """Drop terms below the remainder; move those beyond the largest ones kept into it."""
    return first_terms(series.terms, lambda coefficient: coefficient, series.remainder, kept)


def _cut_sum(parts: Sequence[Series], kept: int) -> Series:
    """Sum of series, cut: what is cut is not added up."""
    terms: dict[Order, list[Expr]] = {}
    for part in parts:
        for order, coefficient in part.terms.items():
            terms.setdefault(order, []).append(coefficient)
    return first_terms(terms, _total, set().union(*(part.remainder for part in parts)), kept)


Given = TypeVar("Given")


def first_terms(
    terms: Mapping[Order, Given], coefficient_of: Callable[[Given], Expr | None], remainder: Iterable[Order], kept: int
) -> Series:
    """The largest terms of a series, as many as are kept; the others go into its remainder.

    Coefficients are worked out of those terms alone on which the result depends.

    Parameters
    ----------
    terms : mapping from Order to anything
        What their coefficients are made of.
    coefficient_of : function of that
        None, if it vanishes.
    remainder : iterable of Order
        Of the series: what is not larger is dropped.
    kept : int
    """
    least = minimal(remainder)
    rest = {e: given for e, given in terms.items() if not any(e == r or negligible(e, r) for r in least)}
    found: dict[Order, Expr] = {}

    def vanishing(orders: Iterable[Order]) -> list[Order]:
        """Those whose terms cancel; the coefficients of the others are known then."""
        zero = []
        for e in orders:
            if e in rest and e not in found:
                coefficient = coefficient_of(rest[e])
                if coefficient is None:
                    zero.append(e)
                else:
                    found[e] = coefficient
        for e in zero:
            del rest[e]
        return zero

    if len(rest) <= kept:
        vanishing(list(rest))
        return Series({e: found[e] for e in rest}, frozenset(least))
    # the largest terms first, then those that only these dominate, and so on: no term is moved before one it dominates
    ordered: list[Order] = []
    while len(ordered) < kept and len(ordered) < len(rest):
        layer = minimal(rest.keys() - set(ordered))
        if not vanishing(layer):
            ordered += sorted(layer, key=lambda e: (sum(e), e))
    if len(rest) <= kept:
        return Series({e: found[e] for e in rest}, frozenset(least))
    beyond = rest.keys() - set(ordered[:kept])
    while vanishing(left := minimal([*least, *beyond])):
        beyond &= rest.keys()
    return Series({e: found[e] for e in ordered[:kept]}, frozenset(left))


def scaled(series: Series, factor: Expr) -> Series:
    """Product of a series and what does not vary."""
    return Series({e: factor * c for e, c in series.terms.items()}, series.remainder)


def multiplied(left: Series, right: Series, kept: int) -> Series:
    """Product of two series.

    Parameters
    ----------
    left, right : Series
    kept : int
        Terms that are kept.
    """
    for single, other in ((left, right), (right, left)):
        if len(single.terms) == 1 and not single.remainder:
            return _shifted(other, *next(iter(single.terms.items())))
    spend(len(left.terms) * len(right.terms))
    products: dict[Order, list[tuple[Expr, Expr]]] = {}
    for e1, c1 in left.terms.items():
        for e2, c2 in right.terms.items():
            products.setdefault(_plus(e1, e2), []).append((c1, c2))
    remainder = {
        *(_plus(e, r) for e in minimal([*left.terms, *left.remainder]) for r in right.remainder),
        *(_plus(e, r) for e in minimal([*right.terms, *right.remainder]) for r in left.remainder),
    }
    return first_terms(products, lambda pairs: _total([one * other for one, other in pairs]), remainder, kept)


def _shifted(series: Series, order: Order, coefficient: Expr) -> Series:
    """Product of a series and one term: nothing can cancel, and nothing is lost."""
    return Series(
        {_plus(order, e): coefficient * c for e, c in series.terms.items()},
        frozenset(_plus(order, r) for r in series.remainder),
    )


def _plus(left: Order, right: Order) -> Order:
    return tuple(map(add, left, right))


def minus(left: Order, right: Order) -> Order:
    """Order of a quotient."""
    return tuple(map(sub, left, right))


def relative(series: Series, what: object = "the expression") -> Series:
    """Return series/leading term - 1: the corrections to the leading term."""
    dominant, coefficient = leading(series, what)
    return Series(
        {minus(e, dominant): c / coefficient for e, c in series.terms.items() if e != dominant},
        frozenset(minus(r, dominant) for r in series.remainder),
    )


def _compose(small: Series, coefficients: Iterable[Expr], scale: Scale) -> Series:
    """Sum of coefficients[k] * small**k, for a series that vanishes with the ratios."""
    total, power = Series(), Series({zero(scale): S.One})
    for coefficient in coefficients:
        if not is_zero(coefficient):
            total = _cut_sum([total, scaled(power, coefficient)], scale.kept)
        power = _beyond(multiplied(power, small, scale.kept), total.remainder)
        if not power.terms and not power.remainder:
            return total  # nothing more is known, or there is nothing more
    cut_off = frozenset(minimal([*power.terms, *power.remainder]))
    return _cut(Series(total.terms, total.remainder | cut_off), scale.kept)


def _depth(scale: Scale) -> int:
    """Powers of a small series that are taken: as many as terms are kept, where leading ones cancel."""
    return max(KEPT, scale.kept)


def _beyond(series: Series, remainder: Iterable[Order]) -> Series:
    """What of a series is not lost in a remainder."""

    def lost(order: Order) -> bool:
        return any(order == r or negligible(order, r) for r in remainder)

    terms = {order: c for order, c in series.terms.items() if not lost(order)}
    return Series(terms, frozenset(order for order in series.remainder if not lost(order)))


def raised(base: Series, power: Expr, what: object, scale: Scale) -> Series:
    """Power of a series.

    Parameters
    ----------
    base : Series
    power : Expr
        A number.
    what : object
        The base in words, for errors.
    scale : Scale
    """
    dominant, coefficient = leading(base, what)
    if not power.is_integer and not scale.imaginary and sign_of(coefficient, what, scale) < 0:
        raise UndecidedError(f"{what} is negative under a root")
    if not power.is_positive:
        require_definite(coefficient, what, scale)
    if isinstance(power, Rational):
        exponent = Fraction(power.p, power.q)
        factor = Series({tuple(_whole(exponent * x) for x in dominant): coefficient**power})
    else:
        order = _order_of_power(coefficient, power, scale)
        factor = Series({order: expand_power_base(coefficient**power)})
    if len(base.terms) == 1 and not base.remainder:
        return factor
    unit = _compose(relative(base, what), (ff(power, k) / factorial(k) for k in range(_depth(scale) + 1)), scale)
    return multiplied(factor, unit, scale.kept)


def _order_of_power(term: Expr, power: Expr, scale: Scale) -> Order:
    """Order of a term to a power that is no rational number, by axes of such powers."""
    if scale.axes is None:
        raise UndecidedError(f"the power {power}, which is no rational number, is outside the method")
    powers, _ = _symbols_of(term)
    apart: dict[Expr, Expr] = {}
    for x, n in powers.items():
        for part in Add.make_args(multiplied_out(n * power)):
            number, t = part.as_coeff_Mul()
            number, t = (number, t) if number.is_Rational else (S.One, part)
            apart[t] = apart.get(t, S.One) * x**number
    total = order_of(apart.pop(S.One, S.One), scale)
    for t, monomial in apart.items():
        order = order_of(monomial, scale)
        if any(x > 0 for x in order) and any(x < 0 for x in order):
            raise SplitError(order, term)
        if not any(order):
            continue
        side = 1 if any(x > 0 for x in order) else -1
        vanishing = tuple(side * x for x in order)
        for (M, other), Y in scale.axes.powers.items():
            factors = combination(vanishing, (order_of(M, scale),), 1) if other == t else None
            if factors is not None:
                total = tuple(
                    _whole(x + side * Fraction(factors[0] * y)) for x, y in zip(total, scale.orders[Y], strict=True)
                )
                break
        else:
            raise AxisError("power", monomial**side, vanishing, t)
    return total


def _whole(power: Fraction) -> int | Fraction:
    return power.numerator if power.denominator == 1 else power


def sign_of(coefficient: Expr, what: object, scale: Scale) -> int:
    """Sign of a coefficient, where logarithms of what vanishes or grows count as large.

    Parameters
    ----------
    coefficient : Expr
    what : object
        What it is of, for errors.
    scale : Scale

    Raises
    ------
    UndecidedError
        If it is not known.
    """
    known = sign_by_parts(coefficient)
    if known is not None:
        return known
    candidates: list[Callable[[], Expr]] = [lambda: coefficient]
    if scale.axes is None:
        candidates.append(lambda: large_logarithms(coefficient, scale))
    if is_small(coefficient):
        candidates.append(lambda: simplify(coefficient))
    for candidate in candidates:
        value = candidate()
        if value.is_positive:
            return 1
        if value.is_negative:
            return -1
    if knows_range_in(coefficient):
        sides = [side for side in (1, -1) if sides_taken(coefficient) == {side}]
        if sides:
            return sides[0]
    raise UndecidedError(f"the sign of {what} is not known: its leading coefficient is {coefficient}")


def _with_known_signs(fixed: Expr) -> Expr:
    """What does not vary, without absolute values and signs that the ranges of parameters tell."""
    if not fixed.has(Abs, sign) or not knows_range_in(fixed):
        return fixed
    known = {}
    for node in fixed.atoms(Abs, sign):
        sides = sides_taken(node.args[0]) if knows_range_in(node) else frozenset()
        if len(sides) == 1:
            (side,) = sides
            known[node] = S(side) if isinstance(node, sign) else side * node.args[0]
    return fixed.xreplace(known)


def require_definite(coefficient: Expr, what: object, scale: Scale) -> None:
    """See that a coefficient vanishes nowhere, as a difference of logarithms, or of equally large terms, may.

    Parameters
    ----------
    coefficient : Expr
    what : object
        What it is of, for errors.
    scale : Scale

    Raises
    ------
    UndecidedError
        If that is not known.
    """
    for factor in Mul.make_args(coefficient):
        base, _ = factor.as_base_exp()
        if base.is_Symbol or not base.free_symbols:
            continue
        if base.free_symbols & scale.orders.keys():
            sign_of(base, what, scale)
        elif base.is_nonzero is None and len(sides_taken(base)) == 2:
            raise UndecidedError(f"the leading term of {what} vanishes where {base} = 0")


def in_large_logarithms(coefficient: Expr, scale: Scale) -> tuple[Expr, list[Symbol]]:
    """Write the logarithms of a coefficient in L_i = log(1/r_i), which are large and positive; returns these too."""
    large = [Dummy(f"L_{i}", positive=True) for i in range(scale.size)]
    spread = expand_log(coefficient)
    values = {
        log(symbol): -sum((exact(x) * L for x, L in zip(order, large, strict=True)), start=S.Zero)
        for symbol, order in scale.orders.items()
        if any(order)
    }
    return spread.subs(values), large


def large_logarithms(coefficient: Expr, scale: Scale) -> Expr:
    """Keep, of a polynomial in logarithms, the terms that dominate; anything else is returned as it is."""
    if not coefficient.has(log):
        return coefficient
    written, large = in_large_logarithms(coefficient, scale)
    if not written.has(*large) or not written.is_polynomial(*large):
        return coefficient
    kept = outgrowing(Poly(written, *large))
    return Add(*(c * Mul(*(L**x for L, x in zip(large, m, strict=True))) for m, c in kept.items()))


def outgrowing(polynomial: Poly) -> dict[tuple[int, ...], Expr]:
    """Return the terms of a polynomial in large variables that no other outgrows: powers, and coefficients."""
    terms = dict(polynomial.terms())
    return {
        m: c for m, c in terms.items()
        if not any(m != n and all(x <= y for x, y in zip(m, n, strict=True)) for n in terms)
    }  # fmt: skip


def _extremum(expr: Expr, scale: Scale) -> Series:
    chosen, *others = expr.args
    for other in others:
        if (_compare(chosen, other, scale) > 0) != isinstance(expr, Max):
            chosen = other
    return expand(chosen, scale)


def _compare(left: Expr, right: Expr, scale: Scale) -> int:
    """Sign of left - right."""
    difference = left - right
    if difference == 0:
        return 0
    return sign_of(leading(expand(difference, scale), difference)[1], difference, scale)


def _branch(expr: Expr, scale: Scale) -> Series:
    for value, condition in expr.args:
        if _holds(condition, scale):
            return expand(value, scale)
    raise UndecidedError(f"no branch of {expr} applies")


def _holds(condition: Boolean, scale: Scale) -> bool:
    if condition in (S.true, S.false):
        return bool(condition)
    if isinstance(condition, And):
        return all(_holds(part, scale) for part in condition.args)
    if isinstance(condition, Or):
        return any(_holds(part, scale) for part in condition.args)
    if isinstance(condition, Not):
        return not _holds(condition.args[0], scale)
    if isinstance(condition, (Gt, Ge, Lt, Le)):
        side = _compare(condition.lhs, condition.rhs, scale)
        wanted = 1 if isinstance(condition, (Gt, Ge)) else -1
        return side == wanted or (side == 0 and isinstance(condition, (Ge, Le)))
    raise UndecidedError(f"the condition {condition} is outside the method")


def _logarithm(argument: Series, what: Expr, scale: Scale) -> Series:
    _, coefficient = leading(argument, what)
    if sign_of(coefficient, what.args[0], scale) < 0:
        raise UndecidedError(f"{what} is the logarithm of a negative number")
    if scale.axes is None:
        written = expand_log(log(coefficient))
        slow = Series({zero(scale): written} if not is_zero(written) else {})
    else:
        slow = _logarithm_of_term(coefficient, scale.axes, scale)
    series = (S.Zero, *(-((S.NegativeOne) ** k) / S(k) for k in range(1, _depth(scale) + 1)))
    corrections = _compose(relative(argument, what), series, scale)
    return _cut_sum([slow, corrections], scale.kept)


def _logarithm_of_term(term: Expr, axes: Axes, scale: Scale) -> Series:
    """Series of the logarithm of a term: of exponentials their arguments, of powers a symbol, of the rest a number."""
    powers, rest = _symbols_of(term)
    apart: dict[Expr, Expr] = {}
    for x in [x for x, n in powers.items() if not n.is_Rational]:
        for part in Add.make_args(multiplied_out(powers.pop(x))):
            number, t = part.as_coeff_Mul()
            number, t = (number, t) if number.is_Rational else (S.One, part)
            apart[t] = apart.get(t, S.One) * x**number
    for x, n in apart.pop(S.One, S.One).as_powers_dict().items():
        powers[x] = powers.get(x, S.Zero) + n
    powers.pop(S.One, None)
    arguments = {X: m for m, X in axes.exponentials.items()}
    parts = [scaled(expand(arguments[x], scale), -powers.pop(x)) for x in list(powers) if x in arguments]
    parts += [scaled(_logarithm_of_term(monomial, axes, scale), t) for t, monomial in apart.items()]
    monomial = Mul(*(x**n for x, n in powers.items()))
    order = order_of(monomial, scale)
    if any(x > 0 for x in order) and any(x < 0 for x in order):
        raise SplitError(order, term)
    if any(order):
        side = -1 if any(x > 0 for x in order) else 1
        small = monomial**-side
        known = dict(axes.logarithms)
        forms = [order_of(M, scale) for M in known]
        factors = combination(tuple(-side * x for x in order), tuple(forms), scale.size)
        if factors is None:
            raise AxisError("log", small, tuple(-side * x for x in order))
        for k, factor in factors.items():
            M, Y = list(known.items())[k]
            parts.append(scaled(scale.known[Y], side * exact(_whole(factor))))
            small /= M ** exact(_whole(factor))
        monomial = small**-side
    # what varies in the rest does not vary as a whole
    rest *= monomial
    logarithm = expand_log(log(rest)) if rest.is_number else log(rest)
    if not is_zero(logarithm):
        parts.append(Series({zero(scale): logarithm}))
    return added(parts)


def _symbols_of(term: Expr) -> tuple[dict[Symbol, Expr], Expr]:
    """Return the powers of symbols that a term is as large as, and what is left of it, which does not vary."""
    powers: dict[Symbol, Expr] = {}
    rest = S.One
    for factor in Mul.make_args(factor_terms(term)):
        base, power = factor.as_base_exp()
        # a sum of terms of one order is as large as any of them
        first = base.args[0] if base.is_Add else base
        monomial = first.as_powers_dict()
        symbols = {x: n * power for x, n in monomial.items() if x.is_Symbol}
        rest *= factor / Mul(*(x**n for x, n in symbols.items()))
        for x, n in symbols.items():
            powers[x] = powers.get(x, S.Zero) + n
    return powers, rest


def order_of(monomial: Expr, scale: Scale) -> Order:
    """Order of a product of powers of symbols."""
    total = zero(scale)
    for x, n in monomial.as_powers_dict().items():
        if x in scale.orders:
            total = tuple(_whole(i + Fraction(n.p, n.q) * j) for i, j in zip(total, scale.orders[x], strict=True))
    return total


def _exponential(expr: Expr, argument: Series, axes: Axes, scale: Scale) -> Series:
    """Series of exp(x): powers of the exponentials that have an axis, times that of what stays finite."""
    unit = zero(scale)
    known = all(negligible(order, unit) for order in argument.remainder)
    growing = [order for order in argument.terms if order != unit and not negligible(order, unit)]
    if not known and scale.kept < KEPT:
        raise CancelError(f"{expr} has an argument that is not known well enough, to the order kept")
    if not known or len(growing) > MOST_EXPONENTIALS:
        return _whole_exponential(expr, argument, scale)
    for order in growing:
        if any(x > 0 for x in order):
            raise SplitError(order, expr.args[0])
    factor = Series({unit: S.One})
    for order in growing:
        coefficient = argument.terms[order]
        for term in Add.make_args(multiplied_out(coefficient) if is_small(coefficient) else coefficient):
            number, m = term.as_coeff_Mul()
            if not number.is_Rational:
                number, m = S.One, term
            if sign_of(m, expr.args[0], scale) < 0:
                number, m = -number, -m
            factor = _shifted(factor, *_power_of_axis(m, order, -number, axes, scale))
    finite = exp(argument.terms.get(unit, S.Zero))
    small = Series({e: c for e, c in argument.terms.items() if negligible(e, unit)}, argument.remainder)
    rest = _compose(small, (1 / factorial(k) for k in range(_depth(scale) + 1)), scale)
    return multiplied(factor, scaled(rest, finite), scale.kept)


#: Growing terms of an argument, each of which has an axis; one of more terms has an axis as a whole.
MOST_EXPONENTIALS = 2


def _power_of_axis(m: Expr, order: Order, power: Rational, axes: Axes, scale: Scale) -> tuple[Order, Expr]:
    """Return order and value of a power of exp(-m)."""
    if m not in axes.exponentials:
        raise AxisError("exp", m, order)
    X = axes.exponentials[m]
    number = Fraction(power.p, power.q)
    return tuple(_whole(number * x) for x in scale.orders[X]), X**power


def _whole_exponential(expr: Expr, argument: Series, scale: Scale) -> Series:
    """Series of the exponential of an argument with terms without end that grow: it has an axis as a whole."""
    assert scale.axes is not None
    order, coefficient = _leading_or_unit(argument, expr.args[0])
    if order == zero(scale) or negligible(order, zero(scale)):
        raise CancelError(f"{expr} has an argument that is not known well enough, to the order kept")
    m = expr.args[0]
    while m.free_symbols & scale.formulas.keys():
        m = m.xreplace(scale.formulas)
    side = sign_of(coefficient, expr.args[0], scale)
    return Series(dict([_power_of_axis(side * m, order, S(-side), scale.axes, scale)]))


def _grows_exponentially(expr: Expr, scale: Scale) -> bool:
    """Whether an expression is exp, sinh or cosh of an argument that grows as a power of the ratios."""
    if not isinstance(expr, (exp, sinh, cosh)):
        return False
    dominant, coefficient = _leading_or_unit(expand(expr.args[0], scale), expr.args[0])
    return negligible(zero(scale), dominant) and (
        isinstance(expr, cosh) or sign_of(coefficient, expr.args[0], scale) > 0
    )


def _leading_or_unit(argument: Series, what: Expr) -> tuple[Order, Expr]:
    """Return the leading term of an argument, which must be small, of order one or large throughout the cone."""
    dominant, coefficient = leading(argument, what)
    if any(x > 0 for x in dominant) and any(x < 0 for x in dominant):
        raise SplitError(dominant, what)
    return dominant, coefficient


def _analytic(expr: Expr, argument: Series, scale: Scale) -> Series:
    unit = zero(scale)
    if argument.terms or argument.remainder:
        dominant, coefficient = _leading_or_unit(argument, expr.args[0])
        if negligible(unit, dominant):
            return _saturated(expr, sign_of(coefficient, expr.args[0], scale), scale)
    centre = argument.terms.get(unit, S.Zero)
    if centre.has(log) and centre.free_symbols & scale.orders.keys():
        raise UndecidedError(f"{expr} has a logarithm in its argument")
    written = at_zero(expr) if centre == 0 else None
    if written is not None:
        return _with_tail(written, expr, scale)
    small = Series({e: c for e, c in argument.terms.items() if e != unit}, argument.remainder)
    if isinstance(expr, Spline):
        side = sign_of(leading(small, expr.args[0])[1], expr.args[0], scale) if small.terms or small.remainder else 1
        return _compose(small, _of_spline(expr, centre, side), scale)
    x = Symbol("x", positive=True)

    def derivatives() -> Iterable[Expr]:
        if isinstance(expr, LambertW) and centre == 0:
            yield S.Zero
            yield from ((-S(k)) ** (k - 1) / factorial(k) for k in range(1, _depth(scale) + 1))
            return
        if isinstance(expr, Bessel) and centre == 0:
            yield from powers_at_zero(expr, _depth(scale) + 1)
            return
        function = expr.func(x)
        for k in range(_depth(scale) + 1):
            value = function.subs(x, centre)
            if not value.is_finite:
                raise UndecidedError(f"{expr} is singular where its argument tends to {centre}")
            yield value / factorial(k)
            function = function.diff(x)

    return _compose(small, derivatives(), scale)


def _of_spline(expr: Spline, centre: Expr, side: int) -> list[Expr]:
    """Coefficients of the piece beside a number; of a table no more is known than at its points."""
    first, last = expr.points[0], expr.points[-1]
    if (
        not centre.is_Rational
        or not first <= centre <= last
        or centre == (last if side > 0 else first if side else None)
    ):
        raise UndecidedError(
            f"{expr}, a table from {first} to {last}, has an argument that tends to {centre}: numbers only"
        )
    start, coefficients = expr.piece(centre, below=side < 0)
    x = Symbol("x")
    powers = Poly(sum((c * (x + centre - start) ** k for k, c in enumerate(coefficients)), start=S.Zero), x)
    return list(reversed(powers.all_coeffs()))


def _saturated(expr: Expr, side: int, scale: Scale) -> Series:
    """Series of a function whose argument grows beyond all bounds, to the side given."""
    if isinstance(expr, exp) and side < 0:
        return Series()  # smaller than any power of the ratios
    if isinstance(expr, Spline):
        raise UndecidedError(f"{expr} is a table up to {expr.points[-1]}, and its argument grows: numbers only")
    written = far_out(expr, side) if scale.axes is not None or not isinstance(expr, (sinh, cosh, LambertW)) else None
    if written is None:
        raise UndecidedError(f"{expr} has an argument that is neither small nor of order one")
    return _with_tail(written, expr, scale) if isinstance(written, Tail) else expand(written, scale)


def _with_tail(written: Tail, expr: Expr, scale: Scale) -> Series:
    """Series of a function that is written up to a rest."""
    factor = expand(written.factor, scale)
    if factor.terms or factor.remainder:
        known, (left_out, _) = expand(written.known, scale), leading(expand(written.rest, scale), expr)
        known = Series(known.terms, known.remainder | {left_out})
        factor = multiplied(factor, known, scale.kept)
    return added([expand(written.whole, scale), factor])


def exact(order: int | Fraction) -> Rational:
    """Return a power as sympy writes it."""
    return Integer(order.numerator) / Integer(order.denominator)
