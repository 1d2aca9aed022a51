"""What a closure gives is positive: proved where the prover can, else looked at in points.

Input: a closure. Output: whether each of its expressions is positive for all Re > 0, every volume fraction below the
densest packing, and all parameters within their ranges.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, product
from typing import Literal

import mpmath
from sympy import Dummy, Expr, Interval, Rational, lambdify

from softdyn.derive.closure import Closure, Re, c, densest, in_fractions, phi, ranges_of, sample_values
from softdyn.derive.positive import Domain, positivity, ranges_of_symbol

#: Boxes that the prover looks at, at most, in each part of the domain.
BOXES = 100
#: Values at which a sign that is not proved is looked at: of Re, and of phi over that of the densest packing.
NUMBERS = [Rational(10) ** k for k in (-6, -4, -2, 0, 2, 4, 6)]
FRACTIONS = [Rational(k, 20) for k in (1, 3, 6, 9, 11, 14, 17, 19)]
MOST_LOOKED_AT = 400


@dataclass(frozen=True)
class SignOfClosure:
    """Whether an expression of a closure is positive.

    Attributes
    ----------
    name : str
        "expression" or "in_plane".
    verdict : "proved", "sampled" or "negative"
    at : str
        Where it is not positive, and what it is there.
    points : int
        Points that it was looked at in, where it is not proved.
    left : str
        The box in which it is not proved.
    """

    name: str
    verdict: Literal["proved", "sampled", "negative"]
    at: str
    points: int
    left: str


def signs_of_closure(closure: Closure) -> list[SignOfClosure]:
    """Return what is known of the signs of a closure's expressions."""
    names = ["expression", *(["in_plane"] if closure.in_plane is not None else [])]
    return [_sign(closure, name, getattr(closure, name)) for name in names]


def _sign(closure: Closure, name: str, expr: Expr) -> SignOfClosure:
    # what of the densest packing is taken: a number below 1, whatever that packing is
    share = Dummy("phi", positive=True)
    limit = densest(closure)
    written = in_fractions(closure, expr) if limit == 1 else in_fractions(closure, expr, phi).subs(phi, limit * share)
    allowed = {**ranges_of(closure), share: Interval.open(0, 1)}
    symbols = sorted(written.free_symbols, key=str)
    domain: Domain = tuple((symbol, ranges_of_symbol(symbol, allowed.get(symbol))) for symbol in symbols)
    try:
        found = positivity(written, domain, BOXES)
    except (TypeError, ValueError, NotImplementedError):  # it has no real value somewhere
        found = None
    if found is not None and found.verdict == "positive":
        return SignOfClosure(name, "proved", "", 0, "")
    if found is not None and found.verdict == "witness":
        shown = {key: limit * value if key == share.name and limit != 1 else value for key, value in found.at.items()}
        return SignOfClosure(name, "negative", _told(shown, found.value), 0, "")
    points = 0
    for at, value in _values(closure, expr):
        points += 1
        if not value > 0:
            return SignOfClosure(name, "negative", _told(at, value), points, "")
    ends = {} if found is None else found.left
    left = ", ".join(f"{low:.3g} < {symbol} < {high:.3g}" for symbol, (low, high) in ends.items())
    return SignOfClosure(name, "sampled", "", points, left)


def _told(at: dict[str, mpmath.mpf], value: object) -> str:
    return f"at {', '.join(f'{name}={mpmath.nstr(x, 6)}' for name, x in at.items())} it is {mpmath.nstr(value, 6)}"


def _values(closure: Closure, expr: Expr) -> Iterator[tuple[dict[str, mpmath.mpf], mpmath.mpf]]:
    """Values at points of the plane, the parameters being typical."""
    fixed = {symbol: value for symbol, value in sample_values(closure).items() if symbol not in (Re, c, phi)}
    limit = densest(closure).subs(fixed)
    function = lambdify([Re, c], in_fractions(closure, expr).subs(fixed), modules="mpmath")
    for number, part in islice(product(NUMBERS, FRACTIONS), MOST_LOOKED_AT):
        at = {"Re": number, "c": 1 - limit * part}
        numbers = {name: mpmath.mpf(int(x.p)) / int(x.q) for name, x in at.items()}
        try:
            value = function(*numbers.values())
        except (ZeroDivisionError, ValueError, OverflowError):
            continue
        if mpmath.im(value) == 0:
            yield numbers, mpmath.re(value)
