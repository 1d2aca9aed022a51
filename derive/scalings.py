"""Parts of an ordering, in which each exponential and each logarithm that varies has an axis of its own.

A part is a region of scalings: of h, of delta, of parameters, and of symbols that stand for exp(-m), with m large, and
for log(1/M), with M small. Each of these is tied to its argument: exp(-m) is smaller than any power of m, and M than
any of log(1/M); log(exp(-m)) is -m; of two exponentials the one with the much larger argument is smaller than any power
of the other. All else is left open. So a part holds every path on which its inequalities sharpen, and perhaps some
points that no path reaches: what is true of a part is true on the whole of the ordering; what is not must still be seen
to fail on a path (:func:`paths_into`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import combinations, islice, product
from typing import TypeVar

import numpy as np
from sympy import Expr, Mul, Rational, S, Symbol, floor

from softdyn.derive.asymptotics import (
    Axes,
    AxisError,
    Order,
    Scale,
    SplitError,
    UndecidedError,
    exact,
    expand,
    leading,
    minus,
    order_of,
    scale_of,
)
from softdyn.derive.cones import Normal, dot, primitive
from softdyn.derive.dimensions import Dimension, dimension_of
from softdyn.derive.positive import range_known
from softdyn.derive.regions import Region, combination, cut_by, exact_form, form_with, lifted, reduced, space
from softdyn.derive.symbols import E, R, eta

Found = TypeVar("Found")

#: The power of m that stands for any, where exp(-m) is smaller.
BEYOND = 1000
#: Parts that an ordering may fall into.
MOST_PARTS = 400


@dataclass(frozen=True, eq=False)
class Part:
    """A part of an ordering.

    Attributes
    ----------
    region : Region
    directions : mapping from Symbol to Normal
        The exponent of each symbol that varies.
    axes : Axes
        What stands for exponentials and logarithms.
    ratios : tuple of Expr
        Products of powers that vanish in it.
    decomposed : bool
        Whether logarithms are written in those of the ratios.
    """

    region: Region
    directions: Mapping[Symbol, Normal]
    axes: Axes = field(default_factory=Axes)
    ratios: tuple[Expr, ...] = ()
    decomposed: bool = False

    def scale(self, kept: int) -> Scale:
        """Return what is known of the symbols, with so many terms of each series."""
        return scale_of(self.region.generators, self.directions, kept, self.axes)

    @cached_property
    def of_axes(self) -> frozenset[Symbol]:
        """Symbols that stand for exponentials and logarithms."""
        return frozenset((*self.axes.exponentials.values(), *self.axes.logarithms.values(), *self.axes.powers.values()))


class SeveralLogarithmsError(Exception):
    """Several logarithms vary, which are sums of others, and may cancel: they must be written in these."""


def whole(directions: Mapping[Symbol, Normal], decomposed: bool = False) -> Part:
    """Return the part that holds every scaling."""
    return Part(space(len(next(iter(directions.values())))), directions, decomposed=decomposed)


def settled(
    parts: Sequence[Part], find: Callable[[Part], Found], units: Mapping[Symbol, Dimension]
) -> list[tuple[Part, Found]]:
    """Cut parts, and give them axes, until something can be found in each piece.

    Parameters
    ----------
    parts : sequence of Part
    find : function of a Part
        Raises where the part must be cut, or needs an axis.
    units : mapping from Symbol to Dimension

    Raises
    ------
    UndecidedError
        As ``find`` does, but for SplitError and AxisError; or if there are more than MOST_PARTS pieces.
    """
    found: list[tuple[Part, Found]] = []
    waiting = list(parts)
    while waiting:
        part = waiting.pop()
        try:
            found.append((part, find(part)))
        except AxisError as missing:
            waiting.append(with_axis(part, missing, units))
        except SplitError as competing:
            pieces = pieces_of(part, form_with(competing.values, part.region.generators), units)
            if len(pieces) < 2:
                raise UndecidedError(str(competing)) from None
            waiting += pieces
        if len(found) + len(waiting) > MOST_PARTS:
            raise UndecidedError(f"the scalings fall into more than {MOST_PARTS} parts")
    return found


def pieces_of(part: Part, normal: Normal, units: Mapping[Symbol, Dimension]) -> list[Part]:
    """Return where a form grows, where it stays bounded, and where it falls.

    Parameters
    ----------
    part : Part
    normal : tuple
        Powers of the form, along the axes of the part.
    units : mapping from Symbol to Dimension
    """
    above, on, below = cut_by(part.region, normal)
    ratio = _ratio(part, normal, units)
    pieces = [replace(part, region=on)] if on is not None else []
    for region, vanishing in ((above, ratio), (below, 1 / ratio)):
        if region is not None:
            ratios = (*part.ratios, vanishing) if vanishing != 1 else part.ratios
            pieces.append(replace(part, region=region, ratios=ratios))
    return pieces


def _ratio(part: Part, normal: Normal, units: Mapping[Symbol, Dimension]) -> Expr:
    """The product of powers, without a dimension, that vanishes where a form grows; 1 if an exponential is in it."""
    powers = {}
    for symbol, direction in part.directions.items():
        place = next((i for i, x in enumerate(direction) if x), None)
        if place is not None and normal[place]:
            if symbol in part.of_axes or abs(direction[place]) != 1 or sum(map(abs, direction)) != 1:
                return S.One
            powers[symbol] = direction[place] * normal[place]
    return without_dimension(Mul(*(symbol**power for symbol, power in powers.items())), units)


def without_dimension(form: Expr, units: Mapping[Symbol, Dimension]) -> Expr:
    """Divide a form by its unit, made of R, E and eta."""
    unit = dimension_of(form, units)
    if unit is None:
        return form
    mass, length, time = (exact(x) for x in (unit.mass, unit.length, unit.time))
    return form / (R ** (length + mass) * E ** (-time - mass) * eta ** (2 * mass + time))


def with_axis(part: Part, missing: AxisError, units: Mapping[Symbol, Dimension]) -> Part:
    """Return a part with an axis more, tied to its argument.

    Parameters
    ----------
    part : Part
    missing : AxisError
        Which names the axis.
    units : mapping from Symbol to Dimension
    """
    number = len(part.of_axes)
    symbol = Symbol(f"{missing.kind} {number}", positive=True)
    directions = {x: (*normal, 0) for x, normal in part.directions.items()}
    unit = (*(0 for _ in next(iter(part.directions.values()))), 1)
    if missing.kind == "exp":
        axes = replace(part.axes, exponentials={**part.axes.exponentials, missing.argument: symbol})
        ties = [*_ties_of_exponential(part, missing.order, unit)]
        directions[symbol] = unit
    elif missing.kind == "power":
        axes = replace(part.axes, powers={**part.axes.powers, (missing.argument, missing.power): symbol})
        ties = list(_ties_of_power(missing.power, exact_form(missing.order, part.region.generators)))
        directions[symbol] = unit
    else:
        argument, order = _to_be_known(part, missing, units)
        axes = replace(part.axes, logarithms={**part.axes.logarithms, argument: symbol})
        vanishing = (*form_with(order, part.region.generators), 0)
        # beyond all bounds, and slower than any power
        ties = [unit, _minus(vanishing, unit, BEYOND), *_ties_of_logarithm(part, order, vanishing)]
        directions[symbol] = tuple(-x for x in unit)
    region = lifted(part.region)
    for tie in ties:
        above, _, _ = cut_by(region, tie)
        if above is None:
            raise UndecidedError(f"{missing.kind}({missing.argument}) cannot be as its argument has it")
        region = above
    return replace(part, region=region, directions=directions, axes=axes)


#: Parts of one to which powers that are no rational numbers are enclosed.
FINE = 10**9


def _ties_of_power(power: Expr, vanishing: Sequence[Fraction]) -> Iterator[Normal]:
    """What ties M^power to M: it lies between M to two rational powers, which enclose the power."""
    low, high = _enclosed(power)
    if low is not None:
        yield primitive((*(-low * x for x in vanishing), Fraction(1)))
    if high is not None:
        yield primitive((*(high * x for x in vanishing), Fraction(-1)))


def _enclosed(power: Expr) -> tuple[Fraction | None, Fraction | None]:
    """Rational numbers below and above a power.

    Raises
    ------
    UndecidedError
        If it is neither a number, nor positive, nor a parameter of which something is known.
    """
    if power.is_number and power.is_real:
        below = int(floor(power * FINE))
        return Fraction(below, FINE), Fraction(below + 1, FINE)
    allowed, little = range_known(power), Fraction(1, FINE)
    if allowed is not None:
        low, high = (Fraction(int(end.p), int(end.q)) for end in map(Rational, (allowed.start, allowed.end)))
        low, high = (low - (not allowed.left_open) * little, high + (not allowed.right_open) * little)
        return max(low, Fraction(0)) if power.is_positive else low, high
    if power.is_positive:
        return Fraction(0), None
    raise UndecidedError(f"nothing is known of the power {power}")


def _minus(one: Normal, other: Normal, times: int = 1) -> Normal:
    return tuple(x - times * y for x, y in zip(one, other, strict=True))


def _ties_of_exponential(part: Part, order: Order, unit: Normal) -> Iterator[Normal]:
    """What ties exp(-m) to powers of m, and to the exponentials and logarithms that there are."""
    generators = part.region.generators
    yield _minus(unit, tuple(-x for x in (*form_with(order, generators), 0)), BEYOND)
    scale = part.scale(1)
    for m, symbol in part.axes.exponentials.items():
        other = (*part.directions[symbol], 0)
        quotient = minus(leading(expand(m, scale), m)[0], order)  # of the other's argument over this one's
        if all(x >= 0 for x in quotient):
            yield _minus(unit, other, BEYOND) if any(quotient) else _multiple(unit, other)
        if all(x <= 0 for x in quotient):
            yield _minus(other, unit, BEYOND) if any(quotient) else _multiple(other, unit)
    for M, symbol in part.axes.logarithms.items():
        vanishing = (*form_with(order_of(M, scale), generators), 0)
        quotient = minus(scale.orders[symbol], order)  # of the logarithm over the argument
        if any(quotient) and all(x >= 0 for x in quotient):
            yield _minus(unit, vanishing, BEYOND)
        if any(quotient) and all(x <= 0 for x in quotient):
            yield _minus(vanishing, unit, BEYOND)


def _multiple(one: Normal, other: Normal) -> Normal:
    """Say of two exponentials with arguments of one order that neither is smaller than all powers of the other."""
    return tuple(BEYOND * x - y for x, y in zip(one, other, strict=True))


def _ties_of_logarithm(part: Part, order: Order, vanishing: Normal) -> Iterator[Normal]:
    """What ties M to the exponentials that there are, where it is known how their arguments compare with log(1/M).

    Its logarithm is smaller than any power of 1/M, and so of an m that grows as a power of 1/M.
    """
    scale = part.scale(1)
    for m, symbol in part.axes.exponentials.items():
        argument = leading(expand(m, scale), m)[0]
        # m as large as a power of 1/M, wherever M vanishes
        if all(m_ <= Fraction(-1, BEYOND) * M_ for m_, M_ in zip(argument, order, strict=True)):
            yield _minus((*part.directions[symbol], 0), vanishing, BEYOND)


def _to_be_known(part: Part, missing: AxisError, units: Mapping[Symbol, Dimension]) -> tuple[Expr, Order]:
    """Return the product of powers whose logarithm is to have an axis.

    A sole logarithm is its own. Several are written in those of ratios that the part knows to vanish, with positive
    factors, so that they cannot cancel.

    Raises
    ------
    SeveralLogarithmsError
        If that has not been done from the start.
    """
    whole_ = (without_dimension_if_any(missing.argument, units), missing.order)
    if not part.decomposed:
        if not part.axes.logarithms or not _composite(part, [missing.order]):
            return whole_
        raise SeveralLogarithmsError
    scale = part.scale(1)
    known = [*part.axes.logarithms, *(M for M in part.ratios if M not in part.axes.logarithms)]
    orders = [order_of(M, scale) for M in known]
    factors = combination(missing.order, orders, len(part.region.generators[0]))
    for k in sorted(factors or ()):
        if known[k] not in part.axes.logarithms:
            return known[k], orders[k]
    return whole_


def _composite(part: Part, orders: Sequence[Order]) -> bool:
    """Whether some of the logarithms, of which there are those of orders besides, are sums of several ratios'."""
    scale = part.scale(1)
    ratios = [order_of(M, scale) for M in part.ratios]
    every = [*(order_of(M, scale) for M in part.axes.logarithms), *orders]
    return any(len(combination(order, ratios, len(part.region.generators[0])) or (1,)) > 1 for order in every)


def without_dimension_if_any(form: Expr, units: Mapping[Symbol, Dimension]) -> Expr:
    """Divide a form by its unit, if all symbols have one."""
    return without_dimension(form, units) if form.free_symbols <= units.keys() else form


# ------------------------------------------------------------------------------------------------------------- paths


#: Largest powers that paths are tried with.
SPEEDS = (1, 4, 8)
#: Paths that are tried at most in each part: many logarithms have as many subsets as there are.
MOST_TRIED = 48


@dataclass(frozen=True)
class Path:
    """A symbol at the level T is factor * 10**(-power T) * T**(-slow) * log10(T)**(-slowest)."""

    power: Mapping[Symbol, Fraction]
    slow: Mapping[Symbol, Fraction]
    factor: Mapping[Symbol, Fraction]
    slowest: Mapping[Symbol, Fraction] = field(default_factory=dict)


def paths_into(part: Part, values: Mapping[Symbol, float]) -> Iterator[Path]:
    """Paths of h, delta and parameters on which every inequality of a part sharpens.

    Each exponential falls as a power of eps, since its argument grows as log(1/eps); or faster than any power.

    Parameters
    ----------
    part : Part
    values : mapping from Symbol to float
        Of what does not vary.
    """
    if part.axes.powers:
        return  # the random paths into the ordering have powers that are rational, and serve as well
    found: list[Path] = []
    fast, slower = _subsets(part.axes.exponentials.values()), _subsets(part.axes.logarithms.values())
    choices = product(SPEEDS, list(islice(fast, MOST_TRIED)), list(islice(slower, MOST_TRIED)))
    for speed, swift, slow in islice(choices, MOST_TRIED):
        path = _path(part, swift, slow, values, speed)
        if path is not None and path not in found:
            found.append(path)
            yield path


def _numbers(product: Expr) -> set[Expr]:
    return {base for base in product.as_powers_dict() if base.is_number}


def _value(form: Sequence[int | Fraction], vector: Sequence[int | Fraction]) -> Fraction:
    return Fraction(sum(x * y for x, y in zip(form, vector, strict=True)))


def _subsets(symbols: Iterable[Symbol]) -> Iterator[frozenset[Symbol]]:
    """Sets of symbols, the smaller ones first."""
    every = tuple(symbols)
    for count in range(len(every) + 1):
        yield from map(frozenset, combinations(every, count))


def _path(
    part: Part, fast: frozenset[Symbol], slower: frozenset[Symbol], values: Mapping[Symbol, float], speed: int
) -> Path | None:
    """A path on which some exponentials are smaller than any power of eps, and the others powers of it.

    Logarithms grow as T = log10(1/eps), but for some that grow more slowly still, as log(T).
    """
    dimension = len(part.region.generators[0])
    place = {symbol: next(i for i, x in enumerate(part.directions[symbol]) if x) for symbol in part.of_axes}
    unit = {symbol: tuple(int(i == place[symbol]) for i in range(dimension)) for symbol in part.of_axes}
    scale = part.scale(1)
    growing = {  # the form of log m
        symbol: exact_form([-x for x in leading(expand(m, scale), m)[0]], part.region.generators)
        for m, symbol in part.axes.exponentials.items()
    }
    followed = {m: symbol for m, symbol in part.axes.exponentials.items() if symbol not in fast}
    own = part.directions.keys() - part.of_axes
    if any(m.is_Add or not m.as_powers_dict().keys() - own <= set(values) | _numbers(m) for m in followed):
        return None
    # of strict forms those that a fast exponential decides hold, or fail, by themselves
    strict = []
    for normal in part.region.strict:
        weight = [normal[place[symbol]] for symbol in fast if normal[place[symbol]]]
        if weight and min(weight) < 0:
            return None
        if not weight:
            strict.append(normal)
    level: Region | None = part.region
    for symbol in (*followed.values(), *part.axes.logarithms.values()):
        # log m, or the logarithm of a logarithm: no power of eps
        level = _where_zero(level, growing.get(symbol, unit[symbol])) if level is not None else None
    if level is None or not any(level.inner):
        return None
    steep = level.inner
    if any(steep[place[symbol]] <= 0 for symbol in followed.values()):
        return None
    # then powers of the level T itself: an argument of an exponential grows as T, as do logarithms
    last = tuple(sum(unit[symbol][i] for symbol in slower) for i in range(dimension))
    tight = [normal for normal in strict if dot(normal, steep) == 0]
    equations: list[tuple[Sequence[int | Fraction], int]] = [(growing[symbol], 1) for symbol in followed.values()]
    equations += [(unit[symbol], 0) for symbol in (*followed.values(), *slower)]
    equations += [(unit[symbol], 1) for symbol in part.axes.logarithms.values() if symbol not in slower]
    slow = _solution(part, equations, [normal for normal in tight if dot(normal, last) <= 0], dimension)
    if slow is None or any(_value(normal, slow) < 0 for normal in tight):
        return None
    if any(_value(growing[symbol], steep) <= 0 and _value(growing[symbol], slow) <= 1 for symbol in fast):
        return None
    return _with_factors(part, _scaled(part, steep, speed), slow, followed, place, values)


def _where_zero(region: Region, form: Sequence[int | Fraction]) -> Region | None:
    """The face of a region's closure on which a form that is not negative there vanishes."""
    rays = tuple(ray for ray in region.rays if _value(form, ray) == 0)
    if any(_value(form, line) != 0 for line in region.lines):
        return None
    return Region(rays, region.lines, region.strict) if rays else None


def _solution(
    part: Part, equations: Sequence[tuple[Sequence[int | Fraction], int]], tight: Sequence[Normal], dimension: int
) -> list[Fraction] | None:
    """A vector in the span of a part on which forms have given values, and others are positive."""
    # homogeneous: one coordinate more, which is 1
    one = (*(0 for _ in range(dimension)), 1)
    region = Region((), (*((*row, 0) for row in _basis(part.region.generators)), one))
    for normal in [one, *((*normal, 0) for normal in tight)]:
        above, _, _ = cut_by(region, normal)
        if above is None:
            return None
        region = above
    for form, value in equations:
        _, on, _ = cut_by(region, primitive((*form, -value)))
        if on is None:
            return None
        region = on
    inner = region.inner
    return [Fraction(x, inner[-1]) for x in inner[:-1]]


def _basis(generators: Sequence[Sequence[int]]) -> list[tuple[int, ...]]:
    """Return vectors that span the same space as some, in reduced form: with as many zeros as can be."""
    rows = [[*ray, 0] for ray in generators]
    return [primitive(row[:-1]) for _, row in reduced(rows)]


def _scaled(part: Part, steep: Sequence[int], speed: int) -> list[Fraction]:
    """Scale the powers of a path so that the largest is the speed."""
    own = [normal for symbol, normal in part.directions.items() if symbol not in part.of_axes]
    fastest = max(abs(dot(normal, steep)) for normal in own) or 1
    return [Fraction(speed * x, fastest) for x in steep]


def _with_factors(
    part: Part,
    steep: Sequence[Fraction],
    slow: Sequence[Fraction],
    exponentials: Mapping[Expr, Symbol],
    place: Mapping[Symbol, int],
    values: Mapping[Symbol, float],
) -> Path:
    """Choose the factors of a path so that arguments of exponentials are what these say: m = power T log(10)."""
    own = [symbol for symbol in part.directions if symbol not in part.of_axes]

    def along(vector: Sequence[int | Fraction]) -> dict[Symbol, Fraction]:
        return {s: Fraction(sum(d * x for d, x in zip(part.directions[s], vector, strict=True))) for s in own}

    rows, sides = [], []
    for m, symbol in exponentials.items():
        powers = m.as_powers_dict()
        rows.append([float(powers.get(s, 0)) for s in own])
        rest = m / Mul(*(s ** powers.get(s, 0) for s in own))
        number = float(rest.subs({s: x for s, x in values.items() if s in rest.free_symbols}))
        sides.append(math.log(float(steep[place[symbol]]) * math.log(10) / number))
    logarithms = np.linalg.lstsq(np.array(rows), np.array(sides), rcond=None)[0] if rows else np.zeros(len(own))
    factor = {s: Fraction(math.exp(x)).limit_denominator(10**12) for s, x in zip(own, logarithms, strict=True)}
    return Path(along(steep), along(slow), factor)
