"""Measured points as a function in a law: a cubic spline that keeps their shape, with its range.

Input: an expression, and points. Output: a function of one argument, with exact rational coefficients. Its slopes at
the points are those of Fritsch & Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, weighted harmonic means, 0 at an
extremum: where the points rise, so does the spline. It has one continuous derivative.

Beyond its points it is a straight line, so that Newton's iteration may pass there; no result rests on that: a run that
ends a step there ends with an error (:mod:`softdyn.table_ranges`), and proofs of limits say that it is numbers only.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from hashlib import sha256
from itertools import pairwise
from math import comb
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from sympy import Expr, Function, FunctionClass, Integer, Rational, S, nan, sympify

from softdyn.tables import Column, read_columns

Coefficients = tuple[Rational, ...]


class Spline(Function):
    """A spline, or a derivative of one; each is a class of its own, made by :func:`spline_class`.

    Attributes
    ----------
    points, values : tuple of Rational
    order : int
        Which derivative it is.
    pieces : tuple of tuple of Rational
        Of this derivative, between two points each: coefficients of powers of the distance from the first.
    """

    nargs = 1
    points: Coefficients = ()
    values: Coefficients = ()
    order = 0
    pieces: tuple[Coefficients, ...] = ()

    @classmethod
    def eval(cls, x: Expr) -> Expr | None:
        """Values at numbers are exact."""
        if x is nan or x is S.ComplexInfinity:
            return nan
        if isinstance(x, Rational):
            start, coefficients = cls.piece(x)
            return sum((c * (x - start) ** k for k, c in enumerate(coefficients)), start=S.Zero)
        return None

    @classmethod
    def piece(cls, x: Rational, below: bool = False) -> tuple[Rational, Coefficients]:
        """The start of the piece that a number is in, and its coefficients; at a point, of the piece above or below."""
        index = bisect_right(cls.points, x) - 1
        if below and index >= 0 and cls.points[index] == x:
            index -= 1
        if 0 <= index < len(cls.pieces):
            return cls.points[index], cls.pieces[index]
        return cls.points[0 if index < 0 else -1], cls.line(index >= 0)

    @classmethod
    def line(cls, above: bool) -> Coefficients:
        """Coefficients beyond the points: of a straight line, or its derivatives."""
        if cls.order > 1:
            return (S.Zero,)
        at, coefficients = (cls.points[-1] - cls.points[-2], cls.pieces[-1]) if above else (S.Zero, cls.pieces[0])
        value = sum((c * at**k for k, c in enumerate(coefficients)), start=S.Zero)
        slope = sum((k * c * at ** (k - 1) for k, c in enumerate(coefficients) if k), start=S.Zero)
        return (value,) if cls.order else (value, slope)

    def fdiff(self, argindex: int = 1) -> Expr:
        """Return the derivative."""
        if self.order == 3:
            return S.Zero
        return spline_class(self.points, self.values, self.order + 1)(self.args[0])

    def _eval_is_real(self) -> bool | None:
        return True if self.args[0].is_real else None

    def _eval_is_positive(self) -> bool | None:
        (x,) = self.args
        return True if x.is_positive and _is_positive_above_zero(KNOWN[type(self).__name__]) else None

    def _eval_evalf(self, prec: int) -> Expr | None:
        x = self.args[0]._eval_evalf(prec)
        if x is None or not x.is_Float:
            return None
        with mpmath.workprec(prec):
            return sympify(evaluated(type(self).__name__, x._to_mpmath(prec)))

    def _sympystr(self, printer: Any) -> str:
        return f"spline({printer._print(self.args[0])}, {len(self.points)} points)" + "'" * self.order

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        power = "" if exp is None else f"^{{{exp}}}"
        name = r"\mathrm{spline}" + ("^{" + r"\prime" * self.order + "}" if self.order else "")
        text = rf"{name}\left({printer._print(self.args[0])}\right)"
        return rf"\left({text}\right){power}" if power else text

    def _numpycode(self, printer: Any) -> str:
        function = printer._module_format(f"{__name__}.evaluated")
        return f"{function}({type(self).__name__!r}, {printer._print(self.args[0])})"

    _pythoncode = _mpmathcode = _numpycode

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        return _rebuilt, (self.points, self.values, self.order, self.args[0])


#: The classes that there are, by their names.
KNOWN: dict[str, Any] = {}


@lru_cache(maxsize=512)
def spline_class(points: Coefficients, values: Coefficients, order: int = 0) -> Any:
    """Return the class of a spline through points, or of a derivative.

    Parameters
    ----------
    points, values : tuple of Rational
    order : int
        Which derivative.
    """
    digest = sha256(repr((points, values)).encode()).hexdigest()[:12]
    name = f"Spline_{digest}_{order}"
    if name not in KNOWN:
        pieces = [list(piece) for piece in _cubics(points, values)]
        for _ in range(order):
            pieces = [[k * c for k, c in enumerate(piece) if k] for piece in pieces]
        facts = {"points": points, "values": values, "order": order, "pieces": tuple(map(tuple, pieces))}
        KNOWN[name] = FunctionClass(name, (Spline,), {**facts, "__module__": __name__})
    return KNOWN[name]


def _rebuilt(points: Coefficients, values: Coefficients, order: int, x: Expr) -> Expr:
    return spline_class(points, values, order)(x)


def spline(argument: Expr, points: Iterable[Any], values: Iterable[Any]) -> Expr:
    """A function of an expression through measured points, for any of a law's expressions.

    With points of delta/R and of F/(E R^2) ``F_ela = E * R**2 * sign(delta) * spline(Abs(delta) / R, points, values)``.
    Where a law starts as a power, as Hertz's, divide the values by it: the spline then multiplies the power, and limits
    can be proved.

    Parameters
    ----------
    argument : Expr
        A pure number.
    points : sequence of numbers
        Increasing; at least two. Floats are taken as they are written, 0.1 being 1/10.
    values : sequence of numbers
        Pure numbers, too.

    Raises
    ------
    ValueError
        If these are no such points.

    Examples
    --------
    >>> from softdyn.derive import R, delta, spline
    >>> force = spline(delta / R, [0, 0.1, 0.2], [0, 1, 4])
    >>> force.subs(delta, R / 10)
    1
    """
    x, y = (tuple(map(_exact, numbers)) for numbers in (points, values))
    if len(x) != len(y) or len(x) < 2:
        raise ValueError(f"a spline needs two points at least, and a value for each, not {len(x)} and {len(y)}")
    for number, (one, other) in enumerate(pairwise(x), start=2):
        if not one < other:
            raise ValueError(f"points of a spline must increase, but number {number} is {other}, after {one}")
    return spline_class(x, y)(sympify(argument))


def read_points(path: str | Path, argument: str, value: str) -> tuple[list[float], list[float]]:
    r"""Points of a spline from a table.

    Parameters
    ----------
    path : str or Path
    argument, value : str
        Headings of their columns, without units: delta of "delta/R". A table without headings has these two.

    Raises
    ------
    SceneError
        If it is no such table.

    Examples
    --------
    >>> from pathlib import Path
    >>> from softdyn.derive import read_points
    >>> _ = Path("points.csv").write_text("delta,force\n0,0\n0.1,1\n0.2,4\n", encoding="utf-8")
    >>> read_points("points.csv", "delta", "force")
    ([0.0, 0.1, 0.2], [0.0, 1.0, 4.0])
    """
    read = read_columns(path, "table", [Column(argument), Column(value)], order=(argument, value))
    return read[argument].tolist(), read[value].tolist()


def _exact(number: Any) -> Rational:
    """A number as it is written."""
    try:
        near = float(number)
    except (TypeError, ValueError):
        raise ValueError(f"a point of a spline is {number!r}, which is no number") from None
    if not math.isfinite(near):
        raise ValueError(f"a point of a spline is {number!r}, which is not finite")
    if isinstance(number, (int, np.integer)):
        return Integer(int(number))
    return number if isinstance(number, Rational) else Rational(repr(near))


def _cubics(x: Coefficients, y: Coefficients) -> list[Coefficients]:
    """Coefficients of the cubic between each two points."""
    width = [b - a for a, b in pairwise(x)]
    rise = [(b - a) / w for (a, b), w in zip(pairwise(y), width, strict=True)]
    slopes = _slopes(width, rise)
    found = []
    for w, r, value, (one, other) in zip(width, rise, y, pairwise(slopes), strict=False):
        found.append((value, one, (3 * r - 2 * one - other) / w, (one + other - 2 * r) / w**2))
    return found


def _slopes(width: Sequence[Rational], rise: Sequence[Rational]) -> list[Rational]:
    """Slopes at the points."""
    if len(rise) == 1:
        return [rise[0]] * 2
    inner = []
    for (w, v), (r, s) in zip(pairwise(width), pairwise(rise), strict=True):
        one, other = 2 * v + w, v + 2 * w
        inner.append((one + other) / (one / r + other / s) if r * s > 0 else S.Zero)
    ends = [_slope_at_end(*width[:2], *rise[:2]), _slope_at_end(width[-1], width[-2], rise[-1], rise[-2])]
    return [ends[0], *inner, ends[1]]


def _slope_at_end(w: Rational, v: Rational, r: Rational, s: Rational) -> Rational:
    """That of a parabola through three points, but that it keeps the sign of what is next, and is not too steep."""
    slope = ((2 * w + v) * r - w * s) / (w + v)
    if slope * r <= 0:
        return S.Zero
    return 3 * r if r * s < 0 and abs(slope) > 3 * abs(r) else slope


# ------------------------------------------------------------------------------------------------------------- numbers


def evaluated(name: str, x: Any) -> Any:
    """Values of a spline of this class: of a number, with mpmath's digits if it has them, or of an array."""
    here = KNOWN[name]
    if isinstance(x, (mpmath.mpf, mpmath.mpc)):
        if not isinstance(x, mpmath.mpf) or mpmath.isnan(x):
            return mpmath.nan
        start, coefficients = here.piece(Rational(*_of_float(x)) if mpmath.isfinite(x) else S.Zero)
        t = x - mpmath.mpf(int(start.p)) / int(start.q)
        return mpmath.polyval([mpmath.mpf(int(c.p)) / int(c.q) for c in reversed(coefficients)], t)
    starts, rows = _in_floats(here)
    x = np.asarray(x, dtype=float)
    index = np.clip(np.searchsorted(starts[1:], x, side="right"), 0, len(rows) - 1)
    t = x - starts[index]
    c = rows[index]
    return (c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3])))[()]


def within_range(name: str, x: Any) -> Any:
    """The same where there are points.

    Raises
    ------
    ValueError
        Elsewhere, where the table has no value.
    """
    points = KNOWN[name].points
    if not float(points[0]) <= x <= float(points[-1]):
        raise ValueError(f"{x} is outside of the table")
    return evaluated(name, x)


def _of_float(x: Any) -> tuple[int, int]:
    """A number near enough to tell the piece that it is in."""
    return float(x).as_integer_ratio() if abs(x) < 1e300 else (int(mpmath.sign(x)) * 10**300, 1)


@lru_cache(maxsize=512)
def _in_floats(here: Any) -> tuple[Any, Any]:
    """Starts of the pieces and their four coefficients, with the lines before and behind."""
    starts = [here.points[0], *here.points]
    rows = [here.line(False), *here.pieces, here.line(True)]
    filled = [[float(c) for c in row] + [0.0] * (4 - len(row)) for row in rows]
    return np.array([float(start) for start in starts]), np.array(filled)


def bounds(here: Any, low: float, high: float) -> tuple[Fraction | None, Fraction | None]:
    """Exact bounds between two numbers, of which the second may be infinite; None where there is none.

    A polynomial on an interval is between the least and the largest of its coefficients in Bernstein's form.

    Parameters
    ----------
    here : spline, or its class
    low, high : float
    """
    first, last = Fraction(low), None if high == float("inf") else Fraction(high)
    found: list[Fraction] = []
    for start, end, coefficients in _all_pieces(here):
        left = first if start is None or first > start else start
        right = end if last is None or (end is not None and end < last) else last
        if right is None:
            slope = coefficients[1] if len(coefficients) > 1 else Fraction(0)
            if slope:  # along the last line without end
                known = [*found, _taylor(coefficients, left - here_start(here, True))[0]]
                return (min(known), None) if slope > 0 else (None, max(known))
            right = left
        if left <= right:
            origin = start if start is not None else here_start(here, False)
            found += _bernstein(_taylor(coefficients, left - origin), right - left)
    return min(found), max(found)


def here_start(here: Any, above: bool) -> Fraction:
    """Where the straight lines start."""
    return _fraction(here.points[-1 if above else 0])


def _fraction(x: Rational) -> Fraction:
    return Fraction(int(x.p), int(x.q))


@lru_cache(maxsize=512)
def _all_pieces(here: Any) -> tuple[tuple[Fraction | None, Fraction | None, tuple[Fraction, ...]], ...]:
    """Starts, ends and coefficients, with the lines."""
    ends = [None, *map(_fraction, here.points), None]
    rows = [here.line(False), *here.pieces, here.line(True)]
    return tuple(
        (one, other, tuple(map(_fraction, row))) for (one, other), row in zip(pairwise(ends), rows, strict=True)
    )


def _taylor(coefficients: Sequence[Fraction], shift: Fraction) -> list[Fraction]:
    """Coefficients of a polynomial about another place."""
    n = len(coefficients)
    return [sum((comb(k, j) * coefficients[k] * shift ** (k - j) for k in range(j, n)), Fraction(0)) for j in range(n)]


def _bernstein(coefficients: Sequence[Fraction], width: Fraction) -> list[Fraction]:
    """Bernstein's coefficients from 0 to a width."""
    n = len(coefficients) - 1
    weighted = [c * width**k / comb(n, k) for k, c in enumerate(coefficients)]
    return [sum((comb(i, k) * weighted[k] for k in range(i + 1)), Fraction(0)) for i in range(n + 1)]


@lru_cache(maxsize=512)
def _is_positive_above_zero(here: Any) -> bool:
    """Whether all values at positive numbers are seen to be positive."""
    if here.points[0] > 0:
        return False
    for start, end, coefficients in _all_pieces(here):
        if start is None or (end is not None and end <= 0):
            continue
        left = max(start, Fraction(0))
        if end is None:
            return coefficients[0] > 0 and all(c >= 0 for c in coefficients)
        # the value at 0 itself may be 0
        if not _is_positive(_taylor(coefficients, left - start), end - left, left == 0, HALVINGS):
            return False
    return False


#: Times that an interval is halved in search of a polynomial's sign.
HALVINGS = 6


def _is_positive(coefficients: Sequence[Fraction], width: Fraction, at_zero: bool, halvings: int) -> bool:
    """Whether a polynomial is seen to be positive from 0 to a width; ``at_zero``: without its value at 0."""
    first, *others = _bernstein(coefficients, width)
    if first < 0 or (first == 0 and not at_zero) or (others and others[-1] <= 0):
        return False
    if all(c > 0 for c in others) or not halvings:
        return all(c > 0 for c in others)
    half = width / 2
    return _is_positive(coefficients, half, at_zero, halvings - 1) and _is_positive(
        _taylor(coefficients, half), half, False, halvings - 1
    )


# ------------------------------------------------------------------------------------------------------------- kernels


def called_in(body: str) -> list[Any]:
    """Classes of the splines that a kernel's body calls."""
    return [KNOWN[name] for name in sorted(KNOWN) if f"_{name.lower()}(" in body]


def kernel_name(expr: Spline) -> str:
    """Name of the function in kernels."""
    return f"_{type(expr).__name__.lower()}"


def leaves(here: Any) -> list[tuple[float, tuple[float, ...]]]:
    """Starts and coefficients of all pieces, with the lines before and behind."""
    starts, rows = _in_floats(here)
    most = max(len(here.pieces[0]), 1)
    return [(float(start), tuple(row[:most].tolist())) for start, row in zip(starts, rows, strict=True)]
