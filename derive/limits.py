"""Proof or refutation of the limits that a law claims.

Input: a law and its declared limits. Output: a verdict for each claim, *proved*, *disproved* or *undecided*, with the
evidence for it.

A limit is an ordering of lengths, such as h << delta << R; it holds in a cone of scalings. Each quantity Q(h, delta)
and its claimed form are expanded there (:mod:`softdyn.derive.balance`), the force through F = F_ela(a(h, delta),
delta), so nothing is inverted. The leading term of Q/claim must be exactly 1 in the whole of the cone, which is cut
where terms compete; otherwise that term is the ratio found. A verdict other than undecided is also certified
numerically: the ratio is evaluated in high precision along several scalings, down to eps = 1e-30, and must tend to what
was found. In the series exponentials are smaller than any power, and logarithms larger than no power: so each claim is
also looked at in numbers on random paths into the whole of its ordering (:mod:`softdyn.derive.witness`), where an
exponential may be as large as a power of another ratio, and a logarithm larger; one on which it fails refutes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Literal

import mpmath
from sympy import Add, Dummy, Expr, Poly, Rational, S, Symbol, lambdify, log, powsimp, simplify

from softdyn.derive.asymptotics import (
    KEPT,
    Order,
    OutOfEffortError,
    Scale,
    Series,
    SplitError,
    UndecidedError,
    expand,
    in_large_logarithms,
    is_small,
    leading,
    minimal,
    outgrowing,
    relative,
    require_definite,
    scale_of,
)
from softdyn.derive.balance import contact_series, definitions, series_of, settle, size
from softdyn.derive.checks import chains
from softdyn.derive.cones import Cone, Normal, facets, orthants
from softdyn.derive.forms import joined_logarithms
from softdyn.derive.law import is_rigid, parameters_of, sample_values
from softdyn.derive.patience import within
from softdyn.derive.symbols import COMMON_PARAMETERS, E, F, R, a, delta
from softdyn.derive.witness import (
    Sample,
    Witness,
    axes_of,
    contradiction,
    functions,
    inequalities,
    samples_of,
    side_of,
)

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

Verdict = Literal["proved", "disproved", "undecided"]

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
    """What was found in one cone."""

    verdict: Verdict
    ratio: Expr | None
    reason: str
    chain: tuple[tuple[Expr, Expr], ...] = ()
    rate: tuple[Expr, ...] = ()
    certificate: tuple[tuple[float, float], ...] = ()


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
    sampled = [(limit, samples_of(law, limit)) for limit in law.limits]
    found = Findings()
    with within(effort, OutOfEffortError):
        for limit, samples in sampled:
            found += [
                _check_claim(law, limit, quantity, claimed, samples, effort // SHARE)
                for quantity, claimed in limit.claims.items()
            ]
    return found


def _check_claim(
    law: ContactLaw, limit: Limit, quantity: str, claimed: Expr, samples: Sequence[Sample], effort: int
) -> Finding:
    try:
        with within(effort, OutOfEffortError):
            pieces = _judged(law, limit, quantity, claimed)
    except UndecidedError as reason:
        pieces = [Piece("undecided", None, str(reason))]
    piece = _together(pieces)
    witness = None
    if piece.verdict != "disproved" and samples and claimed != 0:
        witness = contradiction(law, limit, samples, NAMES.get(quantity, quantity), claimed)
    if witness is not None:
        piece = replace(piece, verdict="disproved", ratio=None, reason=str(witness), rate=())
    return Finding(
        limit.name, ordering(limit), quantity, claimed, piece.verdict, piece.ratio, piece.reason,
        piece.chain, piece.rate, piece.certificate, _set_of(law, limit), len(samples), witness,
    )  # fmt: skip


def _set_of(law: ContactLaw, limit: Limit) -> str:
    """On which set a verdict holds, in words."""
    named = {symbol for pair in inequalities(limit) for length in pair for symbol in length.free_symbols}
    fixed = [symbol.name for symbol in parameters_of(law) if symbol in law.parameters and symbol not in named]
    given = f", at any fixed {', '.join(fixed)}" if fixed else ""
    return f"as every inequality of {ordering(limit)} sharpens, at whatever rates{given}"


def _judged(law: ContactLaw, limit: Limit, quantity: str, claimed: Expr) -> list[Piece]:
    """Judge a claim in each part of its ordering, and where these meet: there, terms that compete are equally large."""
    pieces: list[Piece] = []
    directions, side = axes_of(law, limit), side_of(limit)
    cones = _region(law, limit, directions)
    if not cones:
        raise UndecidedError("no scaling has this ordering")
    while cones:
        judged = settle(cones, lambda cone: _judge(law, cone, directions, side, quantity, claimed))
        pieces += [piece for _, piece in judged]
        walls = facets(cone for cone, _ in judged)
        cones = [wall for wall in walls if _is_inside(law, limit, directions, wall)]
    return pieces


def _together(pieces: Sequence[Piece]) -> Piece:
    """One verdict on all parts of an ordering: a claim that is wrong in one of them is wrong."""
    worst = min(pieces, key=lambda piece: ("disproved", "undecided", "proved").index(piece.verdict))
    certificate = tuple(
        (eps, max(piece.certificate[i][1] for piece in pieces if piece.certificate))
        for i, (eps, _) in enumerate(worst.certificate)
    )
    verdicts = {(piece.verdict, piece.ratio) for piece in pieces}
    reason = worst.reason if len(verdicts) == 1 else f"in a part of the ordering, {worst.reason}"
    rate = tuple(dict.fromkeys(term for piece in pieces for term in piece.rate))
    return Piece(worst.verdict, worst.ratio, reason, worst.chain, rate, certificate)


# --------------------------------------------------------------------------------------------------- the ordering


def _region(law: ContactLaw, limit: Limit, directions: Mapping[Symbol, Normal]) -> list[Cone]:
    """Cones of scalings that fill the ordering of a limit."""
    settled = settle(orthants(len(directions)), lambda cone: _is_inside(law, limit, directions, cone))
    return [cone for cone, inside in settled if inside]


def _is_inside(law: ContactLaw, limit: Limit, directions: Mapping[Symbol, Normal], cone: Cone) -> bool:
    """Whether the scalings in a cone have the ordering of a limit.

    Raises
    ------
    SplitError
        If some have it, and others have not.
    """
    side = side_of(limit)
    pairs = inequalities(limit)
    scale = _knowing_force(law, scale_of(cone, directions, 1), side, any(e.has(F) for p in pairs for e in p))
    for small, large in pairs:
        below, above = (expand(_sized(x, side), scale) for x in (small, large))
        if not below.terms and not below.remainder:
            continue  # an exponential, smaller than any power: random points tell where it is not
        low, high = leading(below, small)[0], leading(above, large)[0]
        quotient = tuple(x - y for x, y in zip(low, high, strict=True))
        if any(x < 0 for x in quotient) and any(x > 0 for x in quotient):
            raise SplitError(quotient, f"{small} << {large}")
        if not any(x > 0 for x in quotient):
            return False
    return True


def _sized(length: Expr, side: int) -> Expr:
    return length.subs(delta, side * size)


def _knowing_force(law: ContactLaw, scale: Scale, side: int, needed: bool = True) -> Scale:
    """Add the series of F = F_ela."""
    if not needed:
        return scale
    force = series_of(law, scale, side, ("F",))["F"]
    if isinstance(force, UndecidedError):
        raise force
    return scale.knowing(F, force)


# ------------------------------------------------------------------------------------------------------ one claim


def _judge(
    law: ContactLaw,
    cone: Cone,
    directions: Mapping[Symbol, Normal],
    side: int,
    quantity: str,
    claimed: Expr,
) -> Piece:
    """Verdict on a claim in one cone.

    Raises
    ------
    SplitError
        If the cone must be cut first.
    """
    name = NAMES.get(quantity, quantity)
    declared = law.F_adh if name == "F_adh" else S.One
    if claimed == 0 or declared == 0:
        equal = claimed == 0 and declared == 0
        return Piece("proved" if equal else "disproved", None, "both vanish" if equal else "one of the two vanishes")
    try:
        found, claim, series = _compared(law, cone, directions, side, name, claimed)
        (order, numerator), (other, denominator) = leading(found, quantity), leading(claim, f"the claim for {quantity}")
        require_definite(numerator / denominator, quantity, scale_of(cone, directions))
        require_definite(denominator, f"the claim for {quantity}", scale_of(cone, directions))
    except SplitError:
        raise
    except UndecidedError as reason:
        return Piece("undecided", None, str(reason))
    powers = tuple(x - y for x, y in zip(order, other, strict=True))
    scale = scale_of(cone, directions)
    ratio = _simplified(numerator / denominator)
    tends, slowly = _without_logarithms(ratio, scale)
    if tends is None:
        return Piece("undecided", None, f"found/claimed = {ratio}: how its logarithms compare depends on the scaling")
    chain = tuple(_chain(law, series, directions, cone, side))
    rate, corrections = _rate(found, claim, quantity)
    if slowly:
        rate = (_simplified(ratio / tends - 1),)
    certificate, converges = _certify(
        law, cone, directions, side, name, claimed, tends, None if slowly else corrections, slowly
    )
    evidence = (chain, rate, tuple(certificate))
    if not converges:
        return Piece(
            "undecided", tends, f"the series gives the ratio {tends}, but the numbers do not tend to it", *evidence
        )
    if tends == 1:
        return Piece("proved", S.One, "the leading terms are equal", *evidence)
    if any(powers):
        end = "infinity" if all(x <= 0 for x in powers) else "0" if all(x >= 0 for x in powers) else "no limit"
        return Piece("disproved", tends, f"found/claimed = {tends}, which tends to {end}", *evidence)
    return Piece("disproved", tends, f"found/claimed tends to {tends}, not to 1", *evidence)


def _compared(
    law: ContactLaw,
    cone: Cone,
    directions: Mapping[Symbol, Normal],
    side: int,
    name: str,
    claimed: Expr,
) -> tuple[Series, Series, dict[str, Series | UndecidedError]]:
    """Series of a quantity and of its claimed form, and those of all that the quantity follows from."""
    wanted = {name, "F"} if claimed.has(F) or name == "delta" else {name}
    series = contact_series(law, cone, directions, side, (CLAIM_TERMS, KEPT), wanted=wanted - {"delta"})
    scale = scale_of(cone, directions, KEPT)
    if isinstance(series.get("F"), UndecidedError) and "F" in wanted:
        raise series["F"]  # type: ignore[misc]
    deflection = Series(dict.fromkeys(scale.known[size].terms, side * size))
    found = deflection if name == "delta" else series[name]
    known = {**scale.known, delta: deflection}
    if "F" in wanted:
        known[F] = series["F"]  # type: ignore[assignment]
    # a claim may well be wrong by a factor of i
    scale = replace(scale, known=known, imaginary=True, found={})
    if isinstance(found, Series) and not found.terms and not found.remainder:
        # smaller than any power, as exp(-h) is: the quotient with the claim may be none the less
        quotient = powsimp(getattr(law, name, S.Zero) / claimed)
        if quotient != 0:
            known[a] = contact_series(law, cone, directions, side, wanted=("a",))["a"]  # type: ignore[assignment]
            return expand(quotient, scale), Series({(0,) * scale.size: S.One}), series
    if isinstance(found, UndecidedError):
        raise found
    return found, expand(claimed, scale), series


#: Terms kept of the series of a claim: the leading one and some of the next, to tell the rate.
CLAIM_TERMS = 4


def _simplified(ratio: Expr) -> Expr:
    return simplify(ratio) if is_small(ratio) else ratio


def _without_logarithms(ratio: Expr, scale: Scale) -> tuple[Expr | None, bool]:
    """What a ratio tends to as its logarithms grow, and whether that is any different from it; None if that depends.

    Numerator and denominator are polynomials in L_1, L_2, ... -> infinity; if the terms that outgrow all others are the
    same in both, up to a factor, and of one sign, the ratio tends to that factor.
    """
    written, large = in_large_logarithms(ratio, scale) if ratio.has(log) else (ratio, [])
    present = [L for L in large if written.has(L)]
    if not present:
        return ratio, False
    top, bottom = written.together().as_numer_denom()
    if not (top.is_polynomial(*present) and bottom.is_polynomial(*present)):
        return None, False
    upper, lower = (outgrowing(Poly(part, *present)) for part in (top, bottom))
    if upper.keys() == lower.keys():
        quotients = {simplify(upper[m] / lower[m]) for m in lower}
        signs = {(c.is_positive, c.is_negative) for c in lower.values()}
        if len(quotients) == 1 and (len(lower) == 1 or signs in ({(True, False)}, {(False, True)})):
            return quotients.pop(), True
    # one outgrows the other
    for weak, strong in ((upper, lower), (lower, upper)):
        if all(any(m != n and all(x <= y for x, y in zip(m, n, strict=True)) for n in strong) for m in weak):
            return ratio, False
    return None, False


def _rate(found: Series, claim: Series, quantity: str) -> tuple[tuple[Expr, ...], list[Order]]:
    """Largest corrections to found/claimed, as terms in h and delta, and their orders."""
    top, bottom = relative(found, quantity), relative(claim, quantity)
    terms = dict(top.terms)
    for order, term in bottom.terms.items():
        terms[order] = terms.get(order, S.Zero) - term
    terms = {order: term for order, term in terms.items() if term != 0}
    orders = minimal([*terms, *top.remainder, *bottom.remainder])
    return tuple(joined_logarithms(powsimp(terms[order])) for order in orders if order in terms), orders


def _chain(
    law: ContactLaw,
    series: Mapping[str, Series | UndecidedError],
    directions: Mapping[Symbol, Normal],
    cone: Cone,
    side: int,
) -> list[tuple[Expr, Expr]]:
    """Sums that a quantity rests on, each with its dominant term; then the quantities on the way."""
    scale = scale_of(cone, directions)
    known = {**scale.known, delta: Series(dict.fromkeys(scale.known[size].terms, side * size))}
    if isinstance(series.get("a"), Series):
        known[a] = series["a"]  # type: ignore[assignment]
    scale = Scale(scale.size, known, scale.orders)
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
    law: ContactLaw,
    cone: Cone,
    directions: Mapping[Symbol, Normal],
    side: int,
    name: str,
    claimed: Expr,
    ratio: Expr,
    corrections: Sequence[Order] | None,
    slowly: bool,
) -> tuple[list[tuple[float, float]], bool]:
    """Evaluate quantity/claim/ratio - 1 for vanishing eps and compare with the predicted rate.

    The deviation must be small at last, and must have fallen by the predicted power of eps, less a tenth for
    logarithms, or by more where a coefficient happens to vanish.
    """
    quotient = claimed * ratio.subs(size, size_of_delta)
    arguments = sorted(quotient.free_symbols, key=str)
    expected = lambdify(arguments, quotient, modules="mpmath", dummify=True)
    orders = scale_of(cone, directions).orders
    worst = {power: mpmath.mpf(0) for power in CERTIFICATE_SCALES}
    converges = True
    for weights in _weights(len(cone)):
        deviations = []
        for power in CERTIFICATE_SCALES:
            decades = {
                symbol: -power
                * sum(Rational(x.numerator, x.denominator) * w for x, w in zip(order, weights, strict=True))
                for symbol, order in orders.items()
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
        predicted = (
            None
            if not corrections
            else min(
                float(sum(float(x) * float(w) for x, w in zip(order, weights, strict=True))) for order in corrections
            )
        )
        converges = converges and (_falls_as_a_logarithm(deviations) if slowly else _falls(deviations, predicted))
    return [(float(f"1e-{power}"), float(value)) for power, value in worst.items()], converges


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
    return bool(late < 0.05) and slope >= 0.9 * predicted - 0.02


def _falls_as_a_logarithm(deviations: Sequence[mpmath.mpf]) -> bool:
    """Whether a deviation falls as 1/log(1/eps), at least: by a third per decade of the logarithm, or nearly."""
    early, late = deviations[0], deviations[-1]
    return bool(late <= early * mpmath.mpf(CERTIFICATE_SCALES[0]) / CERTIFICATE_SCALES[-1] * 2 and late < 0.5)
