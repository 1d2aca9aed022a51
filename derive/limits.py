"""Proof or refutation of the limits that a law claims.

Input: a law and its declared limits. Output: a verdict for each claim, *proved*, *disproved* or *undecided*, with the
evidence for it.

A limit is an ordering of lengths, such as h << delta << R; it holds in a region of scalings, in which each exponential
and each logarithm that varies has an axis of its own (:mod:`softdyn.derive.scalings`). Each quantity Q(h, delta) and
its claimed form are expanded there (:mod:`softdyn.derive.dominant_balance`), the force through F = F_ela(a(h, delta),
delta), so nothing is inverted. The leading term of Q/claim must be exactly 1 in the whole of the region, which is cut
where terms compete; otherwise that term is the ratio found, and where an axis is in play a path is given on which it
shows. A
verdict is also certified in numbers: along several scalings of powers, down to eps = 1e-30, where no axis is in play;
else along paths into the part, where one is found. Besides, each claim is looked at on random paths into the whole of
its ordering (:mod:`softdyn.derive.witness`), which know of no proof; one on which it fails refutes it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise, product
from typing import TYPE_CHECKING, Literal, TypeVar

import mpmath
from sympy import Add, Dummy, Expr, Rational, S, Symbol, lambdify, powsimp, simplify

from softdyn.derive.asymptotics import (
    KEPT,
    AxisError,
    CancelError,
    Order,
    OutOfEffortError,
    Scale,
    Series,
    SplitError,
    UndecidedError,
    expand,
    is_small,
    leading,
    minimal,
    minus,
    relative,
    require_definite,
)
from softdyn.derive.checks import chains
from softdyn.derive.dimensions import LENGTH, Dimension
from softdyn.derive.dominant_balance import definitions, definitions_at, series_of, size
from softdyn.derive.forms import joined_logarithms
from softdyn.derive.law import dimensions_for, is_rigid, parameters_of, ranges_of, sample_values
from softdyn.derive.patience import within
from softdyn.derive.positive import knowing_ranges
from softdyn.derive.scalings import Part, SeveralLogarithmsError, paths_into, settled, whole
from softdyn.derive.symbols import COMMON_PARAMETERS, E, F, R, a, delta
from softdyn.derive.witness import (
    FAR,
    FAR_ALONG,
    Sample,
    Witness,
    axes_of,
    contradiction,
    deviation,
    far_contradiction,
    functions,
    has_its_digits,
    inequalities,
    sample_along,
    samples_of,
    side_of,
    told,
)

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

Verdict = Literal["proved", "disproved", "undecided"]
Found = TypeVar("Found")

#: The scales of the numerical certificate: each ratio of the ordering is eps to some power.
CERTIFICATE_SCALES = (10, 20, 30)
CERTIFICATE_WEIGHTS = ("1", "1/3", "2/5")

#: Quantities that go by another name in what follows from a law.
NAMES = {"F_ela": "F"}

#: Operations after which what is not yet decided is given up: all claims of a law together, and the share of each.
EFFORT, SHARE = 400_000, 3


@dataclass(frozen=True)
class Finding:
    """Verdict on one claim, and the evidence for it.

    Attributes
    ----------
    limit, ordering, quantity : str
        The ordering in words, as "h << delta << R".
    claimed : Expr
    verdict : "proved", "disproved" or "undecided"
    ratio : Expr or None
        Leading form of quantity/claim: 1 if proved.
    reason : str
        In words; for "undecided", what stands in the way.
    chain : tuple of (Expr, Expr)
        Each sum in the declaration that the quantity rests on, and its dominant term; then each quantity on the way and
        its leading form, in h and delta.
    rate : tuple of Expr
        The largest terms of quantity/claim/ratio - 1, in h and delta: how fast the ratio is approached.
    certificate : tuple of (eps, deviation)
        Largest deviation of quantity/claim from ``ratio`` over all scalings tried, relative to ``ratio``, at each eps.
    holds : str
        On which set the verdict holds, in words.
    samples : int
        Random paths into the whole of that set on which the claim was looked at in numbers.
    witness : Witness or None
        One on which it fails, if that is how it was refuted.
    """

    limit: str
    ordering: str
    quantity: str
    claimed: Expr
    verdict: Verdict
    ratio: Expr | None
    reason: str
    chain: tuple[tuple[Expr, Expr], ...] = ()
    rate: tuple[Expr, ...] = ()
    certificate: tuple[tuple[float, float], ...] = ()
    holds: str = ""
    samples: int = 0
    witness: Witness | None = None


class Findings(list[Finding]):
    """Verdicts on all that a law claims; a notebook shows them as a table."""

    def _repr_html_(self) -> str:
        from softdyn.derive.typeset import findings_html

        return findings_html(self)


@dataclass(frozen=True)
class Piece:
    """What was found in one part of an ordering."""

    verdict: Verdict
    ratio: Expr | None
    reason: str
    chain: tuple[tuple[Expr, Expr], ...] = ()
    rate: tuple[Expr, ...] = ()
    certificate: tuple[tuple[float, float], ...] = ()
    witness: Witness | None = None


def ordering(limit: Limit) -> str:
    """Return the ordering in words, as "h << delta << R"."""
    return ", ".join(" << ".join(str(length) for length in chain) for chain in chains(limit))


def check_limits(law: ContactLaw, effort: int = EFFORT) -> Findings:
    """Prove or disprove every limit that a law claims.

    Parameters
    ----------
    law : ContactLaw
    effort : int
        Operations after which claims that are not yet decided are left undecided.
    """
    found = Findings()
    with within(effort, OutOfEffortError), knowing_ranges(ranges_of(law)):
        for limit in law.limits:
            samples, regions = samples_of(law, limit), Regions()
            found += [
                _check_claim(law, limit, quantity, claimed, samples, regions, effort // SHARE)
                for quantity, claimed in limit.claims.items()
            ]
    return found


#: Parts of the ordering of a limit, which all of its claims share, by whether logarithms are decomposed.
Regions = dict[bool, "list[Part]"]


def _check_claim(
    law: ContactLaw,
    limit: Limit,
    quantity: str,
    claimed: Expr,
    samples: Sequence[Sample],
    regions: Regions,
    effort: int,
) -> Finding:
    try:
        with within(effort, OutOfEffortError):
            pieces = _judged(law, limit, quantity, claimed, regions)
    except UndecidedError as reason:
        pieces = [Piece("undecided", None, str(reason))]
    piece = together(pieces)
    if piece.verdict != "disproved" and samples and claimed != 0:
        witness = contradiction(law, limit, samples, NAMES.get(quantity, quantity), claimed)
        if witness is None and piece.verdict == "undecided":
            witness = far_contradiction(law, limit, NAMES.get(quantity, quantity), claimed)
        if witness is not None:
            piece = replace(piece, verdict="disproved", ratio=None, reason=str(witness), rate=(), witness=witness)
    return Finding(
        limit.name, ordering(limit), quantity, claimed, piece.verdict, piece.ratio, piece.reason,
        piece.chain, piece.rate, piece.certificate, _set_of(law, limit), len(samples), piece.witness,
    )  # fmt: skip


def _set_of(law: ContactLaw, limit: Limit) -> str:
    """On which set a verdict holds, in words."""
    named = {symbol for pair in inequalities(limit) for length in pair for symbol in length.free_symbols}
    fixed = [symbol.name for symbol in parameters_of(law) if symbol in law.parameters and symbol not in named]
    given = f", at any fixed {', '.join(fixed)}" if fixed else ""
    return f"as every inequality of {ordering(limit)} sharpens, at whatever rates{given}"


def _judged(law: ContactLaw, limit: Limit, quantity: str, claimed: Expr, regions: Regions) -> list[Piece]:
    """Judge a claim in each part of its ordering."""

    def judged(decomposed: bool) -> list[Piece]:
        if decomposed not in regions:
            regions[decomposed] = _region(law, limit, decomposed)
        pieces = settled(regions[decomposed], lambda part: _judge(law, limit, part, quantity, claimed), _units(law))
        return [piece for _, piece in pieces]

    try:
        return judged(decomposed=False)
    except SeveralLogarithmsError:
        return judged(decomposed=True)


def _units(law: ContactLaw) -> dict[Symbol, Dimension]:
    return {**dimensions_for(law), size: LENGTH}


def together(pieces: Sequence[Piece]) -> Piece:
    """One verdict on all parts of an ordering: a claim that is wrong in one of them is wrong."""
    worst = min(pieces, key=lambda piece: ("disproved", "undecided", "proved").index(piece.verdict))
    measured = [piece.certificate for piece in pieces if piece.certificate]
    certificate = tuple(
        (eps, max(values[i][1] for values in measured)) for i, (eps, _) in enumerate(next(iter(measured), ()))
    )
    verdicts = {(piece.verdict, piece.ratio) for piece in pieces}
    reason = worst.reason if len(verdicts) == 1 else f"in a part of the ordering, {worst.reason}"
    rate = tuple(dict.fromkeys(term for piece in pieces for term in piece.rate))
    return replace(worst, reason=reason, rate=rate, certificate=certificate)


# --------------------------------------------------------------------------------------------------- the ordering


def _region(law: ContactLaw, limit: Limit, decomposed: bool) -> list[Part]:
    """Parts that fill the ordering of a limit.

    Parameters
    ----------
    law, limit
    decomposed : bool
        Whether logarithms are written in those of the ordering's own ratios.

    Raises
    ------
    UndecidedError
        Also if there are none.
    """
    units, parts = _units(law), [whole(axes_of(law, limit), decomposed)]
    for small, large in inequalities(limit):

        def compared(part: Part, small: Expr = small, large: Expr = large) -> bool:
            return _is_inside(law, limit, part, small, large)

        inside = settled(parts, compared, units)
        parts = [part for part, holds in inside if holds]
    if not parts:
        raise UndecidedError("no scaling has this ordering")
    return parts


def _is_inside(law: ContactLaw, limit: Limit, part: Part, small: Expr, large: Expr) -> bool:
    """Whether one size is much smaller than another in a part.

    Raises
    ------
    SplitError
        If it is so in some of it, and not in the rest.
    """
    side = side_of(limit)

    def quotient(kept: int) -> Order:
        symbols = small.free_symbols | large.free_symbols
        scale = _knowing(law, part.scale(kept), side, symbols)
        return minus(*(leading(expand(x, scale), x)[0] for x in (small, large)))

    found = with_more_terms(quotient)
    if any(x < 0 for x in found) and any(x > 0 for x in found):
        raise SplitError(found, f"{small} << {large}")
    return any(x > 0 for x in found)


def _knowing(law: ContactLaw, scale: Scale, side: int, symbols: AbstractSet[Symbol]) -> Scale:
    """Add the series of delta, and of a and F = F_ela where they are needed."""
    scale = scale.knowing(delta, Series(dict.fromkeys(scale.known[size].terms, side * size)), side * size)
    for name, symbol in (("a", a), ("F", F)):
        if symbol in symbols:
            found = series_of(law, scale, side, (name,))[name]
            if isinstance(found, UndecidedError):
                raise found
            scale = scale.knowing(symbol, found, definitions_at(law, side)[symbol])
    return scale


# ------------------------------------------------------------------------------------------------------ one claim


def _judge(law: ContactLaw, limit: Limit, part: Part, quantity: str, claimed: Expr) -> Piece:
    """Verdict on a claim in one part of its ordering.

    Raises
    ------
    SplitError, AxisError
        If the part must be cut first, or needs an axis more.
    """
    name, side = NAMES.get(quantity, quantity), side_of(limit)
    declared = law.F_adh if name == "F_adh" else S.One
    if claimed == 0 or declared == 0:
        equal = claimed == 0 and declared == 0
        return Piece("proved" if equal else "disproved", None, "both vanish" if equal else "one of the two vanishes")
    scale = part.scale(KEPT)
    try:
        found, claim, series = _compared(law, part, side, name, claimed)
        ratio, powers = ratio_of(found, claim, quantity, scale)
    except (SplitError, AxisError):
        raise
    except UndecidedError as reason:
        return Piece("undecided", None, str(reason))
    tends = part.axes.written(simplified(ratio))
    chain = tuple((whole, part.axes.written(term)) for whole, term in _chain(law, series, part, side))
    rate, corrections = rate_of(found, claim, quantity)
    rate = tuple(joined_logarithms(part.axes.written(term)) for term in rate)
    certificate, converges, witness = _certify(law, limit, part, name, claimed, tends, corrections)
    evidence = (chain, rate, tuple(certificate))
    if not converges:
        return Piece(
            "undecided", tends, f"the series gives the ratio {tends}, but the numbers do not tend to it", *evidence
        )
    if tends == 1 and not any(powers):
        return Piece("proved", S.One, "the leading terms are equal", *evidence)
    fails = how_it_fails(tends, powers)
    if part.of_axes and witness is None:
        return Piece("undecided", tends, f"{fails}, if it is reached: no path into this part was found", *evidence)
    if witness is not None:
        fails = f"{fails}: {witness}"
    return Piece("disproved", tends, fails, *evidence, witness)


def _compared(
    law: ContactLaw, part: Part, side: int, name: str, claimed: Expr
) -> tuple[Series, Series, dict[str, Series | UndecidedError]]:
    """Series of a quantity and of its claimed form, and those of all that the quantity follows from."""
    wanted = {name, "F"} if claimed.has(F) or name == "delta" else {name}

    def series_with(kept: int) -> tuple[Series, Series, dict[str, Series | UndecidedError]]:
        scale = part.scale(kept)
        series = series_of(law, scale, side, wanted - {"delta"}, _known_of(law, part, side, kept))
        for needed in wanted - {"delta"}:
            if isinstance(series[needed], UndecidedError):
                raise series[needed]  # type: ignore[misc]
        deflection = Series(dict.fromkeys(scale.known[size].terms, side * size))
        found = deflection if name == "delta" else series[name]
        # a claim may well be wrong by a factor of i
        here = replace(scale, imaginary=True, found={}).knowing(delta, deflection, side * size)
        if "F" in wanted:
            formulas = definitions_at(law, side)
            here = here.knowing(F, series["F"], formulas[F].xreplace({a: formulas[a]}))  # type: ignore[arg-type]
        claim = expand(claimed, here)
        assert isinstance(found, Series)
        return found, claim, series

    return with_more_terms(series_with, MORE_TERMS)


@lru_cache(maxsize=256)
def _known_of(law: ContactLaw, part: Part, side: int, kept: int) -> dict[Symbol, Series | UndecidedError]:
    """Series of a law's quantities in a part, found for one claim and used for the next."""
    return {}


#: Terms kept of the series of a claim: the leading one and some of the next, to tell the rate.
CLAIM_TERMS = 4
#: Then more, until one is left where the leading ones cancel; the effort allowed ends it.
MORE_TERMS = (CLAIM_TERMS, KEPT, 3 * KEPT, 9 * KEPT)


def with_more_terms(find: Callable[[int], Found], kept: Sequence[int] = (1, KEPT, 3 * KEPT)) -> Found:
    """Find something with so many terms of each series; with more, where the leading ones cancel."""
    for terms in kept[:-1]:
        try:
            return find(terms)
        except CancelError:
            continue
    return find(kept[-1])


def simplified(ratio: Expr) -> Expr:
    return simplify(ratio) if is_small(ratio) else ratio


def ratio_of(found: Series, claim: Series, quantity: str, scale: Scale) -> tuple[Expr, Order]:
    """Leading term of found/claimed, and its order.

    Parameters
    ----------
    found, claim : Series
    quantity : str
    scale : Scale

    Raises
    ------
    SplitError
        If it vanishes in some of the part, and grows in the rest.
    UndecidedError
    """
    (order, numerator), (other, denominator) = leading(found, quantity), leading(claim, f"the claim for {quantity}")
    require_definite(numerator / denominator, quantity, scale)
    require_definite(denominator, f"the claim for {quantity}", scale)
    powers = minus(order, other)
    if any(x > 0 for x in powers) and any(x < 0 for x in powers):
        raise SplitError(powers, quantity)
    return numerator / denominator, powers


def how_it_fails(tends: Expr, powers: Order) -> str:
    """Words for the leading term of found/claimed, which is not 1."""
    if not any(powers):
        return f"found/claimed tends to {tends}, not to 1"
    return f"found/claimed = {tends}, which tends to {'infinity' if all(x <= 0 for x in powers) else '0'}"


def rate_of(found: Series, claim: Series, quantity: str) -> tuple[tuple[Expr, ...], list[Order]]:
    """Largest corrections to found/claimed, as terms in h and delta, and their orders.

    Parameters
    ----------
    found, claim : Series
    quantity : str
    """
    top, bottom = relative(found, quantity), relative(claim, quantity)
    terms = dict(top.terms)
    for order, term in bottom.terms.items():
        terms[order] = terms.get(order, S.Zero) - term
    terms = {order: term for order, term in terms.items() if term != 0}
    orders = minimal([*terms, *top.remainder, *bottom.remainder])
    return tuple(joined_logarithms(powsimp(terms[order])) for order in orders if order in terms), orders


def _scale_of_chain(law: ContactLaw, part: Part, side: int, radius: Series | None) -> Scale:
    """What is known of the symbols in a part, with the sums that were looked at before."""
    scales = _scales_of_chains(law, part, side)
    for other, scale in scales:
        if other == radius:
            return scale
    scale = _knowing(law, part.scale(CLAIM_TERMS), side, frozenset())
    scales.append((radius, scale if radius is None else scale.knowing(a, radius)))
    return scales[-1][1]


@lru_cache(maxsize=256)
def _scales_of_chains(law: ContactLaw, part: Part, side: int) -> list[tuple[Series | None, Scale]]:
    return []


def _chain(
    law: ContactLaw, series: Mapping[str, Series | UndecidedError], part: Part, side: int
) -> list[tuple[Expr, Expr]]:
    """Sums that a quantity rests on, each with its dominant term; then the quantities on the way."""
    radius = series.get("a")
    scale = _scale_of_chain(law, part, side, radius if isinstance(radius, Series) else None)
    steps: dict[Expr, Expr] = {}
    elastic = S.Zero if is_rigid(law) else law.F_ela
    for quantity, declared in (("a", law.a), ("F", elastic), ("zeta", law.zeta), ("F_adh", law.F_adh)):
        if quantity not in series:
            continue
        for node in _sums(declared):
            try:
                dominant = leading(expand(node, scale), node)[1]
            except UndecidedError:
                continue
            if dominant != node:
                steps[node] = dominant
    for symbol in definitions(law):
        value = series.get(symbol.name)
        if (symbol.name == "net" and law.F_adh == 0) or (symbol == F and is_rigid(law)):
            continue  # it is F
        if isinstance(value, Series) and value.terms:
            steps[symbol] = leading(value)[1]
    if is_rigid(law):
        steps = {whole: term.subs(size, F / (E * R)) for whole, term in steps.items()}
    return list(steps.items())


def _sums(expr: Expr) -> list[Expr]:
    """Sums within an expression, the innermost first."""
    inner = [node for part in expr.args for node in _sums(part)]
    return [*inner, expr] if isinstance(expr, Add) else inner


# ---------------------------------------------------------------------------------------------- the numerical proof


def _certify(
    law: ContactLaw, limit: Limit, part: Part, name: str, claimed: Expr, ratio: Expr, corrections: Sequence[Order]
) -> tuple[list[tuple[float, float]], bool, Witness | None]:
    """Evaluate quantity/claim/ratio - 1 for vanishing eps, and compare it with the corrections predicted.

    Where exponentials or logarithms have axes, paths into the part are taken, and one on which a wrong claim fails is
    returned too: it shows that the part is reached.
    """
    if part.of_axes:
        return _certify_on_paths(law, limit, part, name, claimed, ratio)
    side = side_of(limit)
    quotient = claimed * ratio.subs(size, size_of_delta)
    arguments = sorted(quotient.free_symbols, key=str)
    expected = lambdify(arguments, quotient, modules="mpmath", dummify=True)
    scale = part.scale(1)
    worst = {power: mpmath.mpf(0) for power in CERTIFICATE_SCALES}
    converges = True
    for weights in _weights(scale.size):
        deviations = []
        for power in CERTIFICATE_SCALES:
            decades = {
                symbol: -power
                * sum(Rational(x.numerator, x.denominator) * w for x, w in zip(order, weights, strict=True))
                for symbol, order in scale.orders.items()
            }
            with mpmath.workdps(60 + 14 * int(max(abs(x) for x in decades.values()) + 1)):
                values = _sample(law, decades, side)
                try:
                    found = _evaluated(law, values, name)
                    deviation = abs(found / expected(*(values[symbol] for symbol in arguments)) - 1)
                except (ZeroDivisionError, ValueError, OverflowError, TypeError):  # the claim has no value there
                    deviation = mpmath.inf
                deviation = mpmath.mpf(deviation)
            worst[power] = max(worst[power], deviation)
            deviations.append(deviation)
        rates = (sum(float(x) * float(w) for x, w in zip(order, weights, strict=True)) for order in corrections)
        converges = converges and _falls(deviations, min(rates) if corrections else None)
    return [(float(f"1e-{power}"), float(value)) for power, value in worst.items()], converges, None


def _certify_on_paths(
    law: ContactLaw, limit: Limit, part: Part, name: str, claimed: Expr, ratio: Expr
) -> tuple[list[tuple[float, float]], bool, Witness | None]:
    """The same along paths into a part; where none is known, random points of the whole ordering must do."""
    fixed = {**dict.fromkeys(COMMON_PARAMETERS, 1.0), **{x: float(value) for x, value in sample_values(law).items()}}
    for path in paths_into(part, fixed):
        sample = sample_along(law, limit, path)
        if sample is None:
            continue
        with mpmath.workdps(60):
            known = [deviation(point, name, claimed * ratio.subs(size, abs(delta))) for point in sample.points]
        off = [x for x in known if x is not None]
        if len(off) < len(known):
            continue
        converges = off[-1] < TOLERABLE or off[-1] < LITTLE * off[0]
        if not converges and not has_its_digits(law, limit, sample, name, claimed * ratio, FAR_ALONG):
            continue
        last = sample.points[-1]
        fails = ratio != 1 and (
            (deviation(last, name, claimed) or 0) > FAR
            or (ratio.free_symbols.isdisjoint(part.directions) and _tells_apart(off, last.of(ratio)))
        )
        shows = fails and has_its_digits(law, limit, sample, name, claimed, FAR_ALONG)
        return [], converges, told(limit, sample, name, claimed) if shows else None
    return [], True, None


def _tells_apart(off: Sequence[mpmath.mpf], ratio: mpmath.mpf | None) -> bool:
    """Whether deviations from a ratio show that it is this that is approached, and not 1, however near that is."""
    if ratio is None:
        return False
    return bool(off[-1] < abs(1 - 1 / ratio) / 2) or all(late < LITTLE * early for early, late in pairwise(off))


#: What may be left of a deviation at the end of a path of logarithms: in itself, or of what it was.
TOLERABLE, LITTLE = 0.05, 0.8


#: Stands for the size of delta in a ratio.
size_of_delta = Dummy("size_of_delta", positive=True)


def _weights(size: int) -> list[tuple[Rational, ...]]:
    """Powers of eps with which the ratios vanish together: all choices, or some where there would be many."""
    values = [Rational(w) for w in CERTIFICATE_WEIGHTS]
    if size <= 2:
        return list(product(values, repeat=size))
    return [tuple(values[(i * k + j) % 3] for i in range(size)) for k in range(3) for j in range(3)]


def _sample(law: ContactLaw, decades: Mapping[Symbol, Expr], side: int) -> dict[Symbol, mpmath.mpf]:
    """Values of all symbols, in units R = E = eta = 1."""
    values = {symbol: mpmath.mpf(1) for symbol in COMMON_PARAMETERS}
    values.update({symbol: mpmath.mpf(value.p) / value.q for symbol, value in sample_values(law).items()})
    for i, (symbol, power) in enumerate(decades.items()):
        # at the same power of eps, sizes must still differ
        values[symbol] = (mpmath.mpf(13 + 7 * i) / (17 + 12 * i)) * mpmath.mpf(10) ** (mpmath.mpf(power.p) / power.q)
    return {**values, size_of_delta: values[size], delta: side * values[size]}


def _evaluated(law: ContactLaw, values: dict[Symbol, mpmath.mpf], name: str) -> mpmath.mpf:
    """Value of a quantity, from the values of h, delta and the parameters; those on the way are added to them."""
    for symbol, (arguments, function) in functions(law).items():
        values[symbol] = function(*(values[x] for x in arguments))
    return values[next(symbol for symbol in (delta, *definitions(law)) if symbol.name == name)]


def _falls(deviations: Sequence[mpmath.mpf], predicted: float | None) -> bool:
    if predicted is None:  # no correction at all: exact, or smaller than any power
        return bool(deviations[-1] < mpmath.mpf(10) ** -30)
    early, late = deviations[0], deviations[-1]
    if late == 0:
        return True
    # corrections of opposite signs may nearly cancel at one scale: a factor of ten is allowed for
    slope = float(mpmath.log10(10 * early / late)) / (CERTIFICATE_SCALES[-1] - CERTIFICATE_SCALES[0]) if early else 0.0
    largest = max(0.05, 100 * 10 ** (-predicted * CERTIFICATE_SCALES[-1]))
    return bool(late < largest) and slope >= 0.9 * predicted - 0.02
