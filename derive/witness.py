"""Numbers against a claim, from the whole set that its ordering describes: the certificate that knows of no proof.

Input: a law and a limit. Output: for each claim, a path on which it fails, with numbers, or none.

Points are drawn with a fixed seed inside the ordering, near its faces and in its exponentially small corners: along a
path, each ratio of the ordering falls as a power of a small eps, or only as a logarithm of it, or stays as it is where
the ordering lets it; so exp(-h/ell) is compared with powers of other ratios, and log(R/h) with any of them. The only
thing taken from the law is what it says, in numbers. A claim fails if, as every inequality sharpens, found/claimed
stays away from 1.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise, product
from math import lcm, log10
from random import Random
from typing import TYPE_CHECKING, Any

import mpmath
from sympy import (
    Add,
    Basic,
    Expr,
    Function,
    Rational,
    Symbol,
    cosh,
    coth,
    count_ops,
    erf,
    erfc,
    exp,
    lambdify,
    sinh,
    tanh,
)

from softdyn.derive.checks import chains
from softdyn.derive.cones import Cone, Normal, cut, dot, orthants
from softdyn.derive.dominant_balance import definitions, size
from softdyn.derive.evaluation import Known, Program
from softdyn.derive.law import ranges_of, sample_values
from softdyn.derive.scalings import Path
from softdyn.derive.splines import within_range
from softdyn.derive.symbols import COMMON_PARAMETERS, F, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

#: Paths tried for each limit, of these with the same dominant terms at first, and how many are drawn to find them.
PATHS, ALIKE, DRAWN = 48, 16, 1500
#: Operations of a law times paths, and times paths drawn, that are computed at most; but of any law so many paths.
OPERATIONS, OPERATIONS_DRAWN, FEWEST_PATHS = 17_600, 550_000, 6
#: Operations of a law beyond which no point is computed: its verdicts then say that they rest on none.
LARGEST = 10_000
#: Paths of the ordering that may follow each other without one that is new.
IN_VAIN = 60
#: Decades by which ratios have fallen along a path.
LEVELS = (10, 40, 160)
#: Those at which a claim must still fail: what falls by a logarithm only has then fallen by 80 decades, at the slowest.
CONFIRMED = (10**8, 10**40, 10**400)
#: What a deviation has grown to there, where a power of log(1/eps) outgrows an exponential: no function of its own
#: logarithm, which is 400, does by a slow rise.
OUTGROWN = 1e30
#: Digits of points there, besides those of the level: a sum that needs more has none.
DIGITS_FAR = 100
#: The same for a path that a proof leads to.
FAR_ALONG = (20, 60, 180)
#: Digits beyond which a point is not computed.
MOST_DIGITS = 6000
#: Binary digits of an argument before its point, beyond which an exponential is not told from 0.
HUGE = 4000
#: Speeds of a ratio along a path: a power of eps, or of its logarithm.
POWERS = tuple(Fraction(w) for w in ("1/4", "1/3", "2/3", "1"))
SLOWLY = tuple(Fraction(w) for w in ("1/5", "1/3", "1/2", "1", "2"))
#: Deviation from 1 that is not called small, and how little it may fall from level to level to count as lasting.
FAR, LASTING = 0.05, 0.999
#: Smaller ones, down to the first of these, must stay what they are, to within the second.
LEAST, NEARLY_STEADY = 1e-6, 0.01
#: Functions that fall, or grow, faster than any power.
EXPONENTIAL = (exp, sinh, cosh, tanh, coth, erf, erfc)

Numbers = dict[Symbol, mpmath.mpf]


@dataclass(frozen=True)
class Point:
    """The values of all quantities at one point, and the digits that they were computed with.

    ``known`` is what was computed of a law's program on the way.
    """

    values: Numbers
    digits: int
    known: Known

    def of(self, expr: Expr) -> mpmath.mpf | None:
        """Value of an expression; None if it has none, or no real one."""
        arguments, function = _compiled(expr)
        with mpmath.workdps(self.digits):
            try:
                value = function(*(self.values[x] for x in arguments))
                return mpmath.mpf(value) if mpmath.isfinite(value) else None
            except (ZeroDivisionError, ValueError, OverflowError, TypeError, KeyError):
                return None

    def quantity(self, name: str) -> mpmath.mpf:
        """Value of a quantity, by its name."""
        return self.values[next(symbol for symbol in self.values if symbol.name == name and symbol != size)]


@dataclass(frozen=True)
class Witness:
    """A path on which a claim fails, with numbers along it.

    Attributes
    ----------
    points : tuple of (mapping from str to str, str)
        From point to point, as every inequality of the ordering sharpens: the values of all that varies, in units
        R = E = eta = 1, and of each small/large; and found/claimed there.
    """

    points: tuple[tuple[Mapping[str, str], str], ...]

    def __str__(self) -> str:
        at, found = self.points[1]
        where = ", ".join(f"{name} = {value}" for name, value in at.items())
        ratios = ", ".join(ratio for _, ratio in self.points)
        return f"at {where} found/claimed = {found}; as every inequality sharpens: {ratios}"


@dataclass(frozen=True)
class Sample:
    """A path within an ordering, and the values of all quantities at each of its levels.

    ``further`` holds those at other levels that were asked for, by level and digits: all claims ask for the same.
    """

    path: Path
    points: tuple[Point, ...]
    further: dict[tuple[int, int], Point | None] = field(default_factory=dict, compare=False, repr=False)


def inequalities(limit: Limit) -> list[tuple[Expr, Expr]]:
    """Return the pairs (small, large) that a limit orders."""
    return [pair for chain in chains(limit) for pair in pairwise(chain)]


def side_of(limit: Limit) -> int:
    """Return the sign of delta and F in a limit: -1 if it orders -delta or -F."""
    lengths = [length for chain in chains(limit) for length in chain]
    return -1 if any((-x).has(delta, F) and x.could_extract_minus_sign() for x in lengths) else 1


def axes_of(law: ContactLaw, limit: Limit) -> dict[Symbol, Normal]:
    """An axis for h, one for delta, and one for each parameter of the law's own that the limit orders."""
    named = {symbol for pair in inequalities(limit) for length in pair for symbol in length.free_symbols}
    varying = [h, size, *sorted(named & law.parameters.keys(), key=str)]
    return {symbol: tuple(int(i == j) for j in range(len(varying))) for i, symbol in enumerate(varying)}


def contradiction(law: ContactLaw, limit: Limit, samples: Sequence[Sample], name: str, claim: Expr) -> Witness | None:
    """Return a path on which a quantity, over what is claimed of it, does not tend to 1; None if none is found.

    Parameters
    ----------
    law : ContactLaw
    limit : Limit
    samples : sequence of Sample
        Paths, and points on them.
    name : str
        Of the quantity.
    claim : Expr
    """
    for sample in samples:
        off = [deviation(point, name, claim) for point in sample.points]
        if not _lasts(off) or not has_its_digits(law, limit, sample, name, claim):
            continue
        further = _further(law, limit, sample, name, claim)
        off += further
        if _lasts(off[1:]) and ((further and (off[-1] or 0) > FAR) or _is_steady(off)):
            return told(limit, sample, name, claim)
    return None


def has_its_digits(
    law: ContactLaw, limit: Limit, sample: Sample, name: str, claim: Expr, levels: Sequence[int] = LEVELS
) -> bool:
    """Whether three times the digits leave a deviation as it is: in cosh(h/R) - 1 all of them may be lost.

    It is looked at where most are needed, and where that takes too many, at a point before.

    Parameters
    ----------
    law : ContactLaw
    limit : Limit
    sample : Sample
        A path, and points on it.
    name : str
        Of the quantity.
    claim : Expr
    levels : sequence of int
        How far along the path the points are.
    """
    for level, point in reversed(list(zip(levels, sample.points, strict=False))):
        exact = _point_of(law, limit, sample, level, 3 * _digits_at(sample.path, level))
        if exact is not None:
            one, other = (deviation(x, name, claim) for x in (point, exact))
            return one is not None and other is not None and bool(abs(one - other) <= (1 - LASTING) * abs(other))
    return False


def _point_of(law: ContactLaw, limit: Limit, sample: Sample, level: int, digits: int) -> Point | None:
    if (level, digits) not in sample.further:
        sample.further[level, digits] = _point(law, limit, sample.path, level, digits)
    return sample.further[level, digits]


def _further(law: ContactLaw, limit: Limit, sample: Sample, name: str, claim: Expr) -> list[mpmath.mpf]:
    """Deviations along a path beyond the points that it was first looked at, the nearest first; those that have digits.

    In log(1 + h/R) a small h/R would be lost, and with it what the claim is about.
    """
    found = []
    for level in CONFIRMED:
        digits = DIGITS_FAR + len(str(level))
        points = (_point_of(law, limit, sample, level, digits * more) for more in (1, 3))
        one, exact = (None if point is None else deviation(point, name, claim) for point in points)
        if one is not None and exact is not None and abs(one - exact) <= (1 - LASTING) * abs(exact):
            found.append(exact)
    return found


def _is_steady(off: Sequence[mpmath.mpf | None]) -> bool:
    """Whether deviations are the same at the last two levels."""
    one, other = (mpmath.mpf(x or 0) for x in off[-2:])
    return bool(abs(one - other) <= (1 - LASTING) * abs(other))


def deviation(point: Point, name: str, claim: Expr) -> mpmath.mpf | None:
    """Return abs(found/claimed - 1), if it has a value.

    Parameters
    ----------
    point : Point
    name : str
        Of the quantity.
    claim : Expr
    """
    expected = point.of(claim)
    return abs(point.quantity(name) / expected - 1) if expected else None


def _lasts(off: Sequence[mpmath.mpf | None]) -> bool:
    """Whether deviations stay away from 0, as far as they are known."""
    known = [x for x in off if x is not None]
    if len(known) < len(off) or len(known) < 2 or known[-1] < LEAST:
        return False
    if known[-1] <= FAR:
        return bool(abs(known[-1] - known[-2]) <= NEARLY_STEADY * known[-1])
    return bool(known[-1] >= LASTING * known[-2])


def told(limit: Limit, sample: Sample, name: str, claim: Expr) -> Witness:
    """Return what there is to tell of a claim on a path.

    Parameters
    ----------
    limit : Limit
    sample : Sample
        A path, and points on it.
    name : str
        Of the quantity.
    claim : Expr
    """
    points = []
    for point in sample.points:
        varying = [delta if symbol == size else symbol for symbol in sample.path.power]
        at = {str(symbol): _text(point.values[symbol]) for symbol in varying}
        at |= {f"({small})/({large})": _text(point.of(small / large)) for small, large in inequalities(limit)}
        points.append((at, _text(point.quantity(name) / point.of(claim))))
    return Witness(tuple(points))


def _digits_of_one(value: mpmath.mpf) -> int:
    """Digits that a number shares with 1, of these at most 9: what it differs by is to be seen."""
    if not 0.99 < value < 1.01 or value == 1:
        return 0
    return min(9, int(-mpmath.log10(abs(value - 1))) - 1)


def _text(value: mpmath.mpf | None) -> str:
    """A number to three digits, however small."""
    if value is None or value == 0 or 1e-4 < abs(value) < 1e4:
        return "nothing" if value is None else mpmath.nstr(value, 4 + _digits_of_one(value))
    decades = mpmath.floor(mpmath.log10(abs(value)))
    if abs(decades) > 1e12:
        return f"{'-' if value < 0 else ''}10^({mpmath.nstr(decades, 3)})"
    return f"{mpmath.nstr(value / mpmath.mpf(10) ** decades, 3)}e{int(decades):+d}"


# ------------------------------------------------------------------------------------------------------------ points


def samples_of(law: ContactLaw, limit: Limit) -> list[Sample]:
    """Paths within the ordering of a limit, with all quantities at each level, the same at every call."""
    draw = Random(0)
    directions = axes_of(law, limit)
    cones = cut(orthants(len(directions)), _monomial_normals(limit, directions))
    exponents = _exponents(law, limit, directions)
    found: list[Sample] = []
    balanced: Counter[tuple[int, ...]] = Counter()
    alike: Counter[tuple[object, ...]] = Counter()
    in_vain = 0
    operations = 1 + sum(int(count_ops(expr)) for expr in definitions(law).values())
    if operations > LARGEST:
        return []
    most = max(FEWEST_PATHS, min(PATHS, OPERATIONS // operations))
    for number in range(max(FEWEST_PATHS, min(DRAWN, OPERATIONS_DRAWN // operations)) if cones else 0):
        # every other path keeps an exponential comparable with powers of the other ratios
        slowly = draw.choice(exponents) if exponents and number % 2 else None
        path = _drawn(law, directions, draw.choice(cones), draw, number, slowly)
        first = _point(law, limit, path, LEVELS[0])
        if first is None or not _holds(limit, first):
            continue
        balance = _dominant(law, first)
        kind = (balance, *(not path.power[x] for x in directions), *(not path.slow[x] for x in directions))
        in_vain += 1
        if balanced[balance] < ALIKE and alike[kind] < ALIKE / 4:
            points = _along(law, limit, path, first)
            if len(points) == len(LEVELS):
                balanced[balance] += 1
                alike[kind] += 1
                found.append(Sample(path, points))
                in_vain = 0
        if len(found) >= most or in_vain == IN_VAIN:
            break
    return found


def sample_along(law: ContactLaw, limit: Limit, path: Path) -> Sample | None:
    """Return a path with its points, far along it; None if the ordering does not hold there, ever more sharply.

    Parameters
    ----------
    law : ContactLaw
    limit : Limit
    path : Path
    """
    first = _point(law, limit, path, FAR_ALONG[0])
    if first is None or not _holds(limit, first):
        return None
    points = _along(law, limit, path, first, FAR_ALONG)
    return Sample(path, points) if len(points) == len(FAR_ALONG) else None


def _along(
    law: ContactLaw, limit: Limit, path: Path, first: Point, levels: Sequence[int] = LEVELS
) -> tuple[Point, ...]:
    """The points of a path, as long as each inequality sharpens along it."""
    points = [first]
    for level in levels[1:]:
        point = _point(law, limit, path, level)
        if point is None or not _sharper(limit, points[-1], point):
            break
        points.append(point)
    return tuple(points)


def _dominant(law: ContactLaw, point: Point) -> tuple[int, ...]:
    """Which term is the largest of each sum that a law rests on: what tells paths from each other."""
    found, program = [], _program(law)

    def size_of(term: Expr) -> mpmath.mpf:
        try:
            value = mpmath.mpf(program.value(point.known, term))
            return abs(value) if mpmath.isfinite(value) else mpmath.mpf(-1)
        except (ZeroDivisionError, ValueError, OverflowError, TypeError):
            return mpmath.mpf(-1)

    with mpmath.workdps(point.digits):
        for total in _sums(law):
            sizes = [size_of(term) for term in total]
            found.append(max(range(len(sizes)), key=sizes.__getitem__))
    return tuple(found)


@lru_cache(maxsize=32)
def _sums(law: ContactLaw) -> tuple[tuple[Expr, ...], ...]:
    """The terms of each sum in a law."""
    totals = {total for expr in definitions(law).values() for total in expr.atoms(Add)}
    return tuple(total.args for total in sorted(totals, key=str))


def _monomial_normals(limit: Limit, directions: Mapping[Symbol, Normal]) -> list[Normal]:
    """The inequalities that are linear in exponents, as normals; those with F, exponentials or logarithms are not."""
    found = (
        _normal((small / large).subs(delta, side_of(limit) * size), directions) for small, large in inequalities(limit)
    )
    return [normal for normal in found if normal is not None and any(normal)]


def _exponents(law: ContactLaw, limit: Limit, directions: Mapping[Symbol, Normal]) -> list[Normal]:
    """The arguments of exponentials in a law and a limit that are products of powers, as normals."""
    written = [
        *definitions(law).values(),
        *(side for pair in inequalities(limit) for side in pair),
        *limit.claims.values(),
    ]
    arguments = {
        term: None
        for expr in written
        for function in sorted(expr.atoms(*EXPONENTIAL), key=str)
        for term in Add.make_args(function.args[0].subs(delta, size).expand())
    }
    found = dict.fromkeys(_normal(term, directions) for term in arguments)
    return [normal for normal in found if normal is not None and any(normal)]


def _normal(monomial: Expr, directions: Mapping[Symbol, Normal]) -> Normal | None:
    """Exponent of a product of powers as a linear form of the axes, up to a factor; None if it is no such product."""
    total = [Rational(0)] * len(directions)
    for base, power in monomial.as_powers_dict().items():
        if base.is_number and power.is_number:
            continue
        if not base.is_Symbol or not power.is_Rational or base == F:
            return None
        if base in directions:
            total = [x + power * y for x, y in zip(total, directions[base], strict=True)]
    whole = lcm(*(int(x.q) for x in total))
    return tuple(int(x * whole) for x in total)


def _drawn(
    law: ContactLaw,
    directions: Mapping[Symbol, Normal],
    cone: Cone,
    draw: Random,
    number: int,
    slowly: Normal | None,
) -> Path:
    """A path into a cone: each of its edges is followed by a power of eps, by a logarithm, or not at all.

    The first paths follow one edge by a power and the others by logarithms, or the reverse; the rest are drawn. What is
    ``slowly`` varies by a logarithm only.
    """
    weights, logarithms = [], []
    for i, ray in enumerate(cone):
        kind, speeds = draw.random(), SLOWLY
        if number < 4 * len(cone):
            speeds = SLOWLY[:2]
            kind = 0.2 if (number // 4 == i) == (number // 2 % 2 == 0) else 0.8
        if slowly is not None and dot(slowly, ray) != 0:
            kind = 0.8
        weights.append(draw.choice(POWERS) if kind < 0.5 else Fraction(0))
        logarithms.append(draw.choice(speeds) if 0.4 <= kind < 0.92 else Fraction(0))

    def along(symbol: Symbol, speeds: Sequence[Fraction]) -> Fraction:
        rates = (speed * dot(ray, directions[symbol]) for ray, speed in zip(cone, speeds, strict=True))
        return sum(rates, start=Fraction(0))

    ranges = ranges_of(law)
    free = [symbol for symbol in (*directions, *law.parameters) if symbol not in ranges]
    factor = {
        symbol: Fraction(1) if number < 8 and symbol not in directions else Fraction(draw.randint(40, 250), 100)
        for symbol in dict.fromkeys(free)
    }
    return Path(
        {symbol: along(symbol, weights) for symbol in directions},
        {symbol: along(symbol, logarithms) for symbol in directions},
        factor,
    )


def far_samples(law: ContactLaw, limit: Limit) -> list[Sample]:
    """Paths far out on which an exponential is a power of a logarithm: exp(-h/ell) log(R/h) does not vanish there.

    What is in an exponential varies as a power of log(T), all else as eps = 10^-T.
    """
    directions = axes_of(law, limit)
    cones = cut(orthants(len(directions)), _monomial_normals(limit, directions))
    found = []
    for cone, argument in product(cones, _exponents(law, limit, directions)):
        held = [ray for ray in cone if dot(argument, ray)]
        if len(held) == len(cone) or not all(dot(argument, ray) < 0 for ray in held):
            continue
        speeds = [Fraction(-1, 2 * len(held) * dot(argument, ray)) if ray in held else Fraction(0) for ray in cone]
        swift = [Fraction(int(not speed)) for speed in speeds]

        def along(symbol: Symbol, rates: Sequence[Fraction], cone: Cone = cone) -> Fraction:
            parts = (rate * dot(ray, directions[symbol]) for ray, rate in zip(cone, rates, strict=True))
            return sum(parts, start=Fraction(0))

        path = Path(
            {symbol: along(symbol, swift) for symbol in directions},
            dict.fromkeys(directions, Fraction(0)),
            dict.fromkeys(directions, Fraction(1)),
            {symbol: along(symbol, speeds) for symbol in directions},
        )
        points = [_point(law, limit, path, level, DIGITS_FAR + len(str(level))) for level in CONFIRMED]
        known = [point for point in points if point is not None]
        pairs = list(pairwise(known))
        if len(known) == len(CONFIRMED) and _holds(limit, known[0]) and all(_sharper(limit, *pair) for pair in pairs):
            found.append(Sample(path, tuple(known)))
    return found


def far_contradiction(law: ContactLaw, limit: Limit, name: str, claim: Expr) -> Witness | None:
    """Return a path far out on which a claim fails, to digits that more of them leave as they are.

    Parameters
    ----------
    law : ContactLaw
    limit : Limit
    name : str
        Of the quantity.
    claim : Expr
    """
    for sample in far_samples(law, limit):
        off = _further(law, limit, sample, name, claim)
        if len(off) == len(CONFIRMED) and _lasts(off) and off[-1] > OUTGROWN:
            return told(limit, sample, name, claim)
    return None


def _digits_at(path: Path, level: int) -> int:
    """Digits with which a point is computed: three times the decades by which anything has fallen."""
    return 40 + int(3 * max(abs(float(path.power[s]) * level + float(path.slow[s]) * log10(level)) for s in path.power))


def _point(law: ContactLaw, limit: Limit, path: Path, level: int, digits: int | None = None) -> Point | None:
    """All quantities of a law at a level of a path, in units R = E = eta = 1; None where they have no value."""
    digits = _digits_at(path, level) if digits is None else digits
    if digits > MOST_DIGITS:
        return None
    with mpmath.workdps(digits):
        values = {symbol: mpmath.mpf(1) for symbol in COMMON_PARAMETERS}
        values.update({symbol: mpmath.mpf(value.p) / value.q for symbol, value in sample_values(law).items()})
        for symbol, factor in path.factor.items():
            own = values.get(symbol, mpmath.mpf(1)) if symbol not in path.power else mpmath.mpf(1)
            values[symbol] = own * factor.numerator / factor.denominator
        for symbol, power in path.power.items():
            slow = path.slow[symbol]
            fallen = mpmath.mpf(10) ** (mpmath.mpf(-power.numerator * level) / power.denominator)
            values[symbol] *= fallen * mpmath.mpf(level) ** (mpmath.mpf(-slow.numerator) / slow.denominator)
            if slowest := path.slowest.get(symbol):
                values[symbol] *= mpmath.log10(level) ** (mpmath.mpf(-slowest.numerator) / slowest.denominator)
        values[delta] = side_of(limit) * values[size]
        program = _program(law)
        known = program.start(values)
        try:
            for symbol, expr in definitions(law).items():
                values[symbol] = mpmath.mpf(program.value(known, expr))
                program.tell(known, symbol, values[symbol])
        except (ZeroDivisionError, ValueError, OverflowError, TypeError):
            return None
        return Point(values, digits, known)


def _exp(x: mpmath.mpf) -> mpmath.mpf:
    """Return exp(x), or 0 where that has no end of digits."""
    if mpmath.mag(x) > HUGE:
        if x > 0:
            raise OverflowError
        return mpmath.mpf(0)
    return mpmath.exp(x)


def _bounded(function: Callable[[mpmath.mpf], mpmath.mpf]) -> Callable[[mpmath.mpf], mpmath.mpf]:
    """A function that is not asked at arguments beyond all bounds; there, what it tends to, if anything."""
    ends = {mpmath.tanh: (-1, 1), mpmath.coth: (-1, 1), mpmath.erf: (-1, 1), mpmath.erfc: (2, 0)}.get(function)

    def value(x: mpmath.mpf) -> mpmath.mpf:
        if mpmath.mag(x) <= HUGE / 2:
            return function(x)
        if ends is None:
            raise OverflowError
        return mpmath.mpf(ends[x > 0])

    return value


#: Binary digits that must be left of a number for it to be one.
LEFT = 50


def _sum(*terms: mpmath.mpf) -> mpmath.mpf:
    """A sum; as large as it may be where its terms cancel to all digits, as in 1 - tanh(1e30).

    With more digits it is another number then: what depends on it is seen to have none.
    """
    total = mpmath.fsum(terms)
    least = max((mpmath.mag(x) for x in terms if x), default=0) - mpmath.mp.prec + LEFT
    lost = any(terms) and (not total or mpmath.mag(total) < least)
    return mpmath.ldexp(-1 if total < 0 else 1, least) if lost else total


def _away_from_one(function: Callable[[mpmath.mpf], mpmath.mpf]) -> Callable[[mpmath.mpf], mpmath.mpf]:
    """A function that vanishes, or has no value, at 1 or -1; beside it, where the argument is not told from that."""
    below = function is not mpmath.acosh and function is not mpmath.log

    def value(x: mpmath.mpf) -> mpmath.mpf:
        off, least = abs(x) - 1, LEFT - mpmath.mp.prec
        if off and mpmath.mag(off) >= least:
            return function(x)
        return function(mpmath.sign(x) * (1 + mpmath.ldexp(-1 if below else 1, least)))

    return value


#: Stands for a sum whose digits are looked after.
checked_sum = Function("checked_sum")


def compiled(arguments: Sequence[Symbol], expr: Expr) -> Any:
    """An expression as a function of mpmath numbers, in which sums are looked after that lose all digits."""
    looked_after = expr.replace(lambda node: isinstance(node, Add), lambda node: checked_sum(*node.args))
    return lambdify(arguments, looked_after, modules=[GUARDED, "mpmath"], dummify=True)


#: Functions that never come to an end at huge arguments, or lose all digits, and what is asked instead.
GUARDED = {
    "checked_sum": _sum,
    **{name: _away_from_one(getattr(mpmath, name)) for name in ("log", "acos", "acosh", "atanh")},
    "exp": _exp,
    "evaluated": within_range,  # what is beyond the points of a spline refutes nothing
    **{name: _bounded(getattr(mpmath, name)) for name in ("sinh", "cosh", "tanh", "coth", "erf", "erfc", "sin", "cos")},
}


@lru_cache(maxsize=32)
def _program(law: ContactLaw) -> Program:
    """Steps that compute the quantities of a law, and all parts of these."""

    def other(node: Basic) -> tuple[list[Symbol], Any]:
        arguments = sorted(node.free_symbols, key=str)
        return arguments, compiled(arguments, node)

    plain = {name: getattr(mpmath, name) for name in ("asin", "asinh", "atan", "expm1", "log1p", "tan", "sign")}
    named = {**plain, "Abs": abs, **GUARDED, "Add": _sum}
    return Program(definitions(law).values(), named, other)


@lru_cache(maxsize=32)
def functions(law: ContactLaw) -> dict[Symbol, tuple[list[Symbol], Any]]:
    """Each quantity as a function of mpmath numbers; its arguments, and the function."""
    made = {}
    for symbol, expr in definitions(law).items():
        arguments = sorted(expr.free_symbols, key=str)
        made[symbol] = (arguments, compiled(arguments, expr))
    return made


@lru_cache(maxsize=512)
def _compiled(expr: Expr) -> tuple[list[Symbol], Any]:
    arguments = sorted(expr.free_symbols, key=str)
    return arguments, compiled(arguments, expr)


def _holds(limit: Limit, point: Point) -> bool:
    """Whether each inequality of an ordering holds at a point."""
    ratios = (point.of(small / large) for small, large in inequalities(limit))
    return all(ratio is not None and 0 < ratio < 1 for ratio in ratios)


def _sharper(limit: Limit, before: Point, after: Point) -> bool:
    """Whether each inequality of an ordering holds at the second point, and by more than at the first."""
    for small, large in inequalities(limit):
        earlier, later = (point.of(small / large) for point in (before, after))
        if earlier is None or later is None or not 0 < later < min(0.8 * earlier, 0.7):
            return False
    return True
