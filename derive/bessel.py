"""Bessel functions of whole order, which math.h does not have: in expressions, in proofs, and in kernels.

Laws are written with sympy's besselj, bessely, besseli and besselk; here each order is a function of one argument. Y
and K of any order are those of orders 0 and 1, by a recurrence that is stable upwards. For J and I it is not, so these
have functions of their own up to order 4: laws may use orders 0 to 2, the rest is for derivatives.

In kernels, x > 0 (J_n and I_n also x <= 0, by their symmetry); polynomials interpolate at Chebyshev's points:

- J_n = x^n p(x) up to 8, in pieces two wide. Y_n up to 2 is (2/pi) (log(x) J_n - [1/x]) + x^n p(x^2), and p(x) in
  pieces up to 8. Beyond, with chi = x - (2 n + 1) pi/4, whose cosine and sine are sums of those of x,
  J_n = sqrt(2/(pi x)) (P cos(chi) - Q sin(chi)), Y_n = sqrt(2/(pi x)) (P sin(chi) + Q cos(chi)), with polynomials for P
  and x Q in 1/x^2 (Watson, Theory of Bessel Functions, 1922, section 7.3).
- I_n = x^n p(x^2) up to 2, exp(x)/sqrt(x) p(1/x) beyond. K_n up to 1 is p(x^2) - log(x) I_0 or
  1/x + log(x) I_1 + x p(x^2), where nothing cancels, and exp(-x)/sqrt(x) p(1/x) beyond.

Up to order 2 errors stay below 4 units in the last place; those of J and Y where they oscillate, of the amplitude.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath
from sympy import (
    EulerGamma,
    Expr,
    Function,
    FunctionClass,
    Integer,
    Rational,
    S,
    besseli,
    besselj,
    besselk,
    bessely,
    exp,
    factorial,
    harmonic,
    log,
    oo,
    pi,
    sqrt,
)

#: sympy's classes, by kind.
GENERAL = {"j": besselj, "y": bessely, "i": besseli, "k": besselk}
#: Highest order of J and I in laws, and here.
HIGHEST, HIGHEST_HERE = 2, 4
#: Digits that coefficients are computed with.
DIGITS = 30
#: Terms of the series far out, and at 0 of Y and K.
TERMS, TERMS_AT_ZERO = 8, 4


class Bessel(Function):
    """A Bessel function of one kind, "j", "y", "i" or "k", and one order."""

    nargs = 1
    kind = ""
    order = 0

    @classmethod
    def eval(cls, x: Expr) -> Expr | None:
        """Value at 0, and the symmetry of J and I."""
        if x.is_zero:
            return {"y": -oo, "k": oo}.get(cls.kind, S.One if cls.order == 0 else S.Zero)
        if cls.kind in "ji" and x.could_extract_minus_sign():
            return (-1) ** cls.order * cls(-x)
        return None

    def fdiff(self, argindex: int = 1) -> Expr:
        """Return the derivative: finite at 0 where the function is, but for the highest order."""
        (x,), n = self.args, self.order
        here = FUNCTIONS[self.kind, n](x)
        if n == 0:
            return FUNCTIONS[self.kind, 1](x) * (1 if self.kind == "i" else -1)
        below = FUNCTIONS[self.kind, n - 1](x) * (-1 if self.kind == "k" else 1)
        if self.kind in "yk" or n == HIGHEST_HERE:
            return below - n * here / x
        above = FUNCTIONS[self.kind, n + 1](x)
        return (below + above) / 2 if self.kind == "i" else (below - above) / 2

    def _eval_is_real(self) -> bool | None:
        (x,) = self.args
        return True if (x.is_real if self.kind in "ji" else x.is_positive) else None

    def _eval_is_positive(self) -> bool | None:
        (x,) = self.args
        positive = x.is_positive or (self.kind == "i" and self.order % 2 == 0 and x.is_real)
        return True if self.kind in "ik" and positive else None

    def _eval_evalf(self, prec: int) -> Expr:
        return GENERAL[self.kind](self.order, self.args[0])._eval_evalf(prec)

    def _sympystr(self, printer: Any) -> str:
        return f"bessel{self.kind}({self.order}, {printer._print(self.args[0])})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        name = f"{self.kind.upper()}_{{{self.order}}}" + (f"^{{{exp}}}" if exp else "")
        return rf"{name}\left({printer._print(self.args[0])}\right)"

    def _mpmathcode(self, printer: Any) -> str:
        function = printer._module_format(f"{__name__}.in_digits")
        return f"{function}({self.kind!r}, {self.order}, {printer._print(self.args[0])})"

    def _numpycode(self, printer: Any) -> str:
        name = "scipy.special." + {"j": "jv", "y": "yv", "i": "iv", "k": "kv"}[self.kind]
        return f"{printer._module_format(name)}({self.order}, {printer._print(self.args[0])})"

    _pythoncode = _numpycode


ORDERS = {"j": HIGHEST_HERE, "y": 1, "i": HIGHEST_HERE, "k": 1}
FUNCTIONS: dict[tuple[str, int], Any] = {
    (kind, n): FunctionClass(f"Bessel{kind.upper()}{n}", (Bessel,), {"kind": kind, "order": n, "__module__": __name__})
    for kind, highest in ORDERS.items()
    for n in range(highest + 1)
}
globals().update({one.__name__: one for one in FUNCTIONS.values()})  # so that expressions can be pickled
#: Names in kernels, by those of the classes.
NAMES = {one.__name__: f"_bessel_{kind}{n}" for (kind, n), one in FUNCTIONS.items()}


def of_order(kind: str, n: Expr, x: Expr) -> Expr:
    """A Bessel function as laws have it; as sympy has it, where the order is no whole number or too high.

    Parameters
    ----------
    kind : "j", "y", "i" or "k"
    n : Expr
        The order.
    x : Expr
    """
    if not isinstance(n, Integer) or (kind in "ji" and abs(n) > HIGHEST):
        return GENERAL[kind](n, x)
    n, factor = abs(int(n)), (-1 if n < 0 and n % 2 and kind in "jy" else 1)
    if (kind, n) in FUNCTIONS:
        return factor * FUNCTIONS[kind, n](x)
    before, here = (FUNCTIONS[kind, m](x) for m in (0, 1))
    for m in range(1, n):
        before, here = here, Integer(2 * m) / x * here + (before if kind == "k" else -before)
    return factor * here


#: For :mod:`softdyn.derive.branches`: functions of sympy, by those of this module.
AS_ONES_OF_ORDER: dict[Any, Callable[[Expr, Expr], Expr]] = {
    besselj: lambda n, x: of_order("j", n, x),
    bessely: lambda n, x: of_order("y", n, x),
    besseli: lambda n, x: of_order("i", n, x),
    besselk: lambda n, x: of_order("k", n, x),
}


# -------------------------------------------------------------------------------------------------------------- series


def powers_at_zero(function: Bessel, count: int) -> list[Expr]:
    """Coefficients of the powers 0, 1, ... of J or I."""
    n, side = function.order, -1 if function.kind == "j" else 1
    found = [S.Zero] * count
    for k in range((count - n + 1) // 2):
        found[2 * k + n] = Integer(side) ** k / (factorial(k) * factorial(k + n) * Integer(2) ** (2 * k + n))
    return found


def near_zero(function: Bessel) -> tuple[Expr, Expr]:
    """Y or K of a small argument, up to something that is smaller than what comes second."""
    (x,), n = function.args, function.order
    side = -1 if function.kind == "y" else 1
    logarithm = log(x / 2) + EulerGamma
    total = S.Zero
    for k in range(TERMS_AT_ZERO):
        power = Integer(side) ** k * (x / 2) ** (2 * k + n) / (factorial(k) * factorial(k + n))
        total += power * (logarithm - (harmonic(k) + harmonic(k + n)) / 2)
    # what is left has a logarithm at the power that comes next
    rest = x ** (2 * TERMS_AT_ZERO + n - 1)
    if function.kind == "k":
        return (-total if n == 0 else 1 / x + total), rest
    return 2 * total / pi - (0 if n == 0 else 2 / (pi * x)), rest


def far_out(function: Bessel) -> tuple[Expr, Expr, Expr] | None:
    """I or K of a large positive argument: a factor, a sum, and what it leaves; None of others, which oscillate."""
    (x,), n = function.args, function.order
    if function.kind not in "ik":
        return None
    side = -1 if function.kind == "i" else 1
    known, term = S.Zero, S.One
    for k in range(TERMS):
        known += term * Integer(side) ** k / x**k
        term *= Rational(4 * n**2 - (2 * k + 1) ** 2, 8 * (k + 1))
    factor = exp(x) / sqrt(2 * pi * x) if function.kind == "i" else sqrt(pi / (2 * x)) * exp(-x)
    return factor, known, x**-TERMS


# ------------------------------------------------------------------------------------------------------------- numbers

#: Binary exponents of arguments, at most: exponentials and phases of larger ones have no end.
LARGEST = 1000


def in_digits(kind: str, n: int, x: Any) -> Any:
    """A Bessel function as an mpmath number; mpmath's own takes minutes for a thousand digits.

    Parameters
    ----------
    kind : "j", "y", "i" or "k"
    n : int
        The order.
    x : number

    Raises
    ------
    OverflowError
        If the argument is beyond all bounds, and the value is not 0.
    """
    x = mpmath.mpmathify(x)
    if mpmath.im(x) or (kind in "yk" and (x <= 0 or n > 1)):
        return getattr(mpmath, f"bessel{kind}")(n, x)
    if mpmath.mag(x) > LARGEST:
        if kind == "k":
            return mpmath.mpf(0)
        raise OverflowError
    if x < 0:
        return (-1) ** n * in_digits(kind, n, -x)
    digits = mpmath.mp.prec
    far = x > digits * 0.4 + 4 * n**2 + 20
    # by its powers what is of the order of exp(-x) is a sum of terms as large as exp(x)
    with mpmath.workprec(digits + 30 + (0 if far else int(3 * x))):
        found = _far_away(kind, n, x) if far else _by_powers(kind, n, x)
    return +found


def _by_powers(kind: str, n: int, x: Any) -> Any:
    """The power series, to its last term that counts."""
    square = (x / 2) ** 2 * (-1 if kind in "jy" else 1)
    term = (x / 2) ** n / mpmath.factorial(n)
    # of Y and K: log(x/2) less the mean of two psi
    logarithm = mpmath.log(x / 2) + mpmath.euler - sum(mpmath.mpf(1) / m for m in range(1, n + 1)) / 2
    total, k = mpmath.mpf(0), 0
    while True:
        total += term * (logarithm if kind in "yk" else 1)
        if abs(term) * (1 + abs(logarithm)) < mpmath.ldexp(abs(total), -mpmath.mp.prec) and k * (k + n) > abs(square):
            break
        k += 1
        term *= square / (k * (k + n))
        logarithm -= (mpmath.mpf(1) / k + mpmath.mpf(1) / (k + n)) / 2
    if kind == "k":
        return -total if n == 0 else 1 / x + total
    return total if kind in "ji" else 2 / mpmath.pi * (total - (0 if n == 0 else 1 / x))


def _far_away(kind: str, n: int, x: Any) -> Any:
    """The asymptotic series, whose smallest term is below the precision."""
    parts, term, k = [mpmath.mpf(0)] * 4, mpmath.mpf(1), 0
    while abs(term) > mpmath.ldexp(1, -mpmath.mp.prec) and k < 2 * x:
        parts[k % 4] += term
        k += 1
        term *= mpmath.mpf(4 * n**2 - (2 * k - 1) ** 2) / (8 * k * x)
    if kind == "i":
        return mpmath.exp(x) / mpmath.sqrt(2 * mpmath.pi * x) * (parts[0] - parts[1] + parts[2] - parts[3])
    if kind == "k":
        return mpmath.exp(-x) * mpmath.sqrt(mpmath.pi / (2 * x)) * sum(parts)
    P, Q, phase = parts[0] - parts[2], parts[1] - parts[3], x - (2 * n + 1) * mpmath.pi / 4
    along, across = mpmath.cos(phase), mpmath.sin(phase)
    wave = P * along - Q * across if kind == "j" else P * across + Q * along
    return mpmath.sqrt(2 / (mpmath.pi * x)) * wave


# ------------------------------------------------------------------------------------------------------------- kernels


def _fit(function: Callable[[Any], Any], low: float, high: float, count: int) -> tuple[float, ...]:
    """Coefficients in u, from -1 to 1 as the variable goes from low to high; a low of 0 is not asked for."""
    ends = mpmath.mpf(low), mpmath.mpf(high)
    value = cache(lambda u: function((ends[0] + ends[1]) / 2 + u * (ends[1] - ends[0]) / 2))  # asked for many times
    found = mpmath.chebyfit(value, [-1, 1], count)
    return tuple(float(value) for value in reversed(found))


#: Pieces of x, or of 1/x, with the number of coefficients in each: what they leave is below 2^-57 of the largest value.
MIDDLE = ((2.0, 4.0, 24), (4.0, 6.0, 18), (6.0, 8.0, 18))
FAR = 8.0
FAR_COUNT = 15
GROWING = ((0.25, 0.5, 20), (0.125, 0.25, 20), (0.0, 0.125, 30))
FADING = ((0.5, 1.0, 20), (0.25, 0.5, 20), (0.125, 0.25, 20), (0.0, 0.125, 22))


def parts(kind: str, n: int) -> dict[str, Any]:
    """Functions that polynomials stand for, with their ends and numbers of coefficients, by the names of parts."""

    def near(t: Any) -> Any:
        x = mpmath.sqrt(t)
        if kind in "ji":
            return in_digits(kind, n, x) / x**n
        regular = "j" if kind == "y" else "i"
        side = 2 / mpmath.pi if kind == "y" else -1
        pole = 0 if n == 0 else 1 / x
        if kind == "k":
            side = -1 if n == 0 else 1
            return (in_digits("k", n, x) - pole - side * mpmath.log(x) * in_digits(regular, n, x)) / x**n
        return (in_digits("y", n, x) - side * (mpmath.log(x) * in_digits(regular, n, x) - pole)) / x**n

    def wave(t: Any, second: bool) -> Any:
        x = FAR / mpmath.sqrt(t)
        chi = x - (2 * n + 1) * mpmath.pi / 4
        j, y, size = in_digits("j", n, x), in_digits("y", n, x), mpmath.sqrt(mpmath.pi * x / 2)
        if second:
            return size * x * (y * mpmath.cos(chi) - j * mpmath.sin(chi))
        return size * (j * mpmath.cos(chi) + y * mpmath.sin(chi))

    def scaled(z: Any) -> Any:
        x = 1 / z
        return in_digits(kind, n, x) * mpmath.sqrt(x) * mpmath.exp(-x if kind == "i" else x)

    if kind in "jy":
        middle = [
            (lambda x: in_digits(kind, n, x) / (x**n if kind == "j" else 1), low, high, count)
            for low, high, count in MIDDLE
        ]
        return {
            "near": [(near, 0.0, 4.0, 14)],
            "middle": middle,
            "P": [(lambda t: wave(t, False), 0.0, 1.0, FAR_COUNT)],
            "Q": [(lambda t: wave(t, True), 0.0, 1.0, FAR_COUNT)],
        }
    return {
        "near": [(near, 0.0, 4.0 if kind == "i" else 1.0, 14)],
        "far": [(scaled, *piece) for piece in (GROWING if kind == "i" else FADING)],
    }


@cache
def polynomials(kind: str, n: int) -> dict[str, tuple[tuple[float, float, tuple[float, ...]], ...]]:
    """Coefficients of a function's parts, each rounded once: pieces of (low, high, coefficients)."""
    with mpmath.workdps(DIGITS):
        return {
            name: tuple((low, high, _fit(function, low, high, count)) for function, low, high, count in pieces)
            for name, pieces in parts(kind, n).items()
        }


def called_in(body: str) -> list[tuple[str, int]]:
    """Kinds and orders of the functions that a kernel's body calls, behind those that they call themselves."""
    found = {(kind, int(n)) for kind, n in re.findall(r"\b_bessel_([jyik])(\d)\(", body)}
    found |= {({"y": "j", "k": "i"}[kind], n) for kind, n in found if kind in "yk"}
    return sorted(found)
