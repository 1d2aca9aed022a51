"""Proof or refutation of the limits that a law claims.

Input: a law and its declared limits. Output: a verdict for each claim, *proved*, *disproved* or *undecided*.

Each quantity Q(h, delta) and its claimed form are expressed in the state (h, delta), the force through
F = F_ela(a(h, delta), delta), so nothing is inverted. The leading term of Q/claim in the ratios of the ordering must be
exactly 1; otherwise that term is the ratio found. A verdict other than undecided is also certified numerically: the
ratio is evaluated in high precision along several scalings, down to eps = 1e-30, and must tend to what was found.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Literal

import mpmath
from sympy import Dummy, Expr, S, Symbol, lambdify, log, simplify

from softdyn.derive.asymptotics import Series, UndecidedError, expand, leading, minimal, slow_logarithm
from softdyn.derive.dynamics import dF_dt, law_quantities
from softdyn.derive.law import expressions
from softdyn.derive.symbols import F, R, a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

Verdict = Literal["proved", "disproved", "undecided"]

#: The scales of the numerical certificate: each ratio of the ordering is eps to some power.
CERTIFICATE_SCALES = (10, 20, 30)
CERTIFICATE_WEIGHTS = ("1", "1/3", "2/5")


@dataclass(frozen=True)
class Finding:
    """Verdict on one claim.

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
    certificate : tuple of (eps, deviation)
        Largest deviation of quantity/claim from ``ratio`` over all scalings tried, relative to ``ratio``, at each eps.
    """

    limit: str
    ordering: str
    quantity: str
    claimed: Expr
    verdict: Verdict
    ratio: Expr | None
    reason: str
    certificate: tuple[tuple[float, float], ...] = ()


def check_limits(law: ContactLaw) -> list[Finding]:
    """Prove or disprove every limit that a law claims."""
    # what is declared is taken as declared, what is derived in its sound form
    quantities = {**law_quantities(law), **expressions(law)}
    quantities = {name: expr.subs(dF_dt, 0).subs(a, law.a) for name, expr in quantities.items()}
    quantities["delta"] = delta
    force = quantities["F_ela"]
    return [
        _check_claim(limit, quantity, claimed, quantities[quantity].subs(F, force), claimed.subs(F, force))
        for limit in law.limits
        for quantity, claimed in limit.claims.items()
    ]


def scaling(limit: Limit) -> tuple[dict[Symbol, Expr], tuple[Symbol, ...]]:
    """Return h and delta in terms of R and the small ratios of the ordering, and those ratios."""
    ratios = tuple(Dummy(f"r{i + 1}", positive=True) for i in range(len(limit.order) - 1))
    sizes: dict[Expr, Expr] = {limit.order[0]: S.One}
    for smaller, larger, ratio in zip(limit.order, limit.order[1:], ratios, strict=False):
        sizes[larger] = sizes[smaller] / ratio
    values = {}
    for length, size in sizes.items():
        size = R * size / sizes[R]
        if length == h:
            values[h] = size
        elif length in (delta, -delta):
            values[delta] = size if length == delta else -size
    return values, ratios


def _check_claim(limit: Limit, quantity: str, claimed: Expr, found: Expr, claim: Expr) -> Finding:
    values, ratios = scaling(limit)
    quotient = (found / claim).subs(values)

    def finding(verdict: Verdict, ratio: Expr | None, reason: str, *certificate: tuple[float, float]) -> Finding:
        ordering = " << ".join(str(length) for length in limit.order)
        return Finding(limit.name, ordering, quantity, claimed, verdict, ratio, reason, tuple(certificate))

    if claimed == 0 or found == 0:
        equal = claimed == 0 and found == 0
        return finding("proved" if equal else "disproved", None, "both vanish" if equal else "one of the two vanishes")
    try:
        top = expand(found.subs(values), ratios)
        bottom = expand(claim.subs(values), ratios)
        (exponents, numerator), (others, denominator) = (
            leading(top, quantity),
            leading(bottom, f"the claim for {quantity}"),
        )
    except UndecidedError as reason:
        return finding("undecided", None, str(reason))
    powers = [x - y for x, y in zip(exponents, others, strict=True)]
    coefficient = simplify(numerator / denominator)
    ratio = coefficient
    for small, power in zip(ratios, powers, strict=True):
        ratio *= small**power
    rate = _rate(top, exponents, bottom, others)
    certificate, converges = _certify(quotient, ratio, ratios, rate)
    lengths = _back_to_lengths(ratio, ratios, limit)
    if not converges:
        return finding(
            "undecided",
            lengths,
            f"the series gives the ratio {lengths}, but the numbers do not tend to it",
            *certificate,
        )
    if any(slow_logarithm(small) in ratio.free_symbols for small in ratios):
        return finding(
            "undecided", None, "found and claimed differ by logarithms of the ratios, which the method keeps apart"
        )
    if ratio == 1:
        return finding("proved", S.One, "the leading terms are equal", *certificate)
    if any(powers):
        tends = (
            "infinity" if all(power <= 0 for power in powers) else "0" if all(p >= 0 for p in powers) else "no limit"
        )
        return finding("disproved", lengths, f"found/claimed = {lengths}, which tends to {tends}", *certificate)
    return finding("disproved", lengths, f"found/claimed tends to {lengths}, not to 1", *certificate)


def _back_to_lengths(ratio: Expr, ratios: tuple[Symbol, ...], limit: Limit) -> Expr:
    """The ratio in h, delta and R, with delta standing for its size."""
    size = Symbol("delta", positive=True)
    lengths = [size if length in (delta, -delta) else length for length in limit.order]
    quotients = {small: low / high for small, low, high in zip(ratios, lengths, lengths[1:], strict=False)}
    return simplify(ratio.subs(quotients))


def _rate(top: Series, top_leading: tuple, bottom: Series, bottom_leading: tuple) -> list[tuple]:
    """Exponents of the largest corrections to the ratio."""
    corrections = []
    for series, dominant in ((top, top_leading), (bottom, bottom_leading)):
        for exponents in minimal([*(set(series.terms) - {dominant}), *series.remainder]):
            corrections.append(tuple(x - y for x, y in zip(exponents, dominant, strict=True)))
    return minimal(corrections)


def _certify(
    quotient: Expr, ratio: Expr, ratios: tuple[Symbol, ...], corrections: list[tuple]
) -> tuple[list[tuple[float, float]], bool]:
    """Evaluate quotient/ratio - 1 for vanishing eps and compare with the predicted rate.

    The deviation must be small at last, and must have fallen by the predicted power of eps, less a tenth for
    logarithms, or by more where a coefficient happens to vanish.
    """
    own = sorted((quotient.free_symbols | ratio.free_symbols) - set(ratios), key=str)
    slow = [slow_logarithm(small) for small in ratios]
    values = {symbol: S(3 + 2 * i) / 7 for i, symbol in enumerate(own) if symbol not in slow}
    ratio = ratio.subs({slow_logarithm(small): -log(small) for small in ratios})
    function = lambdify(ratios, (quotient / ratio).subs(values), modules="mpmath")
    worst = {power: mpmath.mpf(0) for power in CERTIFICATE_SCALES}
    converges = True
    with mpmath.workdps(40 * len(ratios) * 6):
        for weights in product((S(w) for w in CERTIFICATE_WEIGHTS), repeat=len(ratios)):
            deviations = []
            for power in CERTIFICATE_SCALES:
                point = [mpmath.mpf(10) ** (-power * mpmath.mpf(w.p) / w.q) for w in weights]
                try:
                    deviation = abs(function(*point) - 1)
                except (ZeroDivisionError, ValueError, OverflowError):  # the claim has no value there
                    deviation = mpmath.inf
                worst[power] = max(worst[power], deviation)
                deviations.append(deviation)
            converges = converges and _falls(deviations, _slope(corrections, weights))
    return [(float(f"1e-{power}"), float(value)) for power, value in worst.items()], converges


def _slope(corrections: list[tuple], weights: tuple[S, ...]) -> float | None:
    slopes = [float(sum(x * w for x, w in zip(exponents, weights, strict=True))) for exponents in corrections]
    return min(slopes) if slopes else None


def _falls(deviations: list[mpmath.mpf], predicted: float | None) -> bool:
    if predicted is None:  # no correction at all: exact, or smaller than any power
        return bool(deviations[-1] < mpmath.mpf(10) ** -30)
    early, late = deviations[0], deviations[-1]
    if late == 0:
        return True
    # corrections of opposite signs may nearly cancel at one scale: a factor of ten is allowed for
    slope = float(mpmath.log10(10 * early / late)) / (CERTIFICATE_SCALES[-1] - CERTIFICATE_SCALES[0]) if early else 0.0
    return bool(late < 0.05) and slope >= 0.9 * predicted - 0.02
