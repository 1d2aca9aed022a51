"""Logarithms and exponentials without a branch, for the loops over lanes of the contact kernel.

Compilers vectorise no call of libm, and one such call leaves the whole loop scalar. The functions of the template
``elementary`` are arithmetic alone, and give the same bits in every target: a power of two is taken out of the number
by its bits, and a polynomial does the rest (argument reduction of Cody & Waite and of Tang, ACM Trans. Math. Softw. 15
(1989) 144 and 16 (1990) 378, but for their tables; Muller, Elementary Functions, 2016).

Logarithm: x = 2^k (1 + f), 1 + f from sqrt(1/2) to sqrt(2), so that k = 0 around x = 1. With s = f/(2 + f), z = s^2,

    ln(1 + f) = 2 atanh(s) = 2 s + s z P(z) = f - (f^2/2 - s (f^2/2 + z P(z))) ,

whose last form takes from f, which is exact, terms that are small beside it. log1p finds what 1 + x loses (Knuth's
sum) and adds it to f; what that loses in turn is added to the result. Exponential: x = k ln 2 + r, |r| up to ln(2)/2,

    exp(r) = 1 + r + r^2 Q(r) .

ln 2 is a sum of two numbers, and k times the first is exact. Errors of log, log1p and exp stay below 1 unit in the last
place: half a unit of the last sum, and less than that of the terms before it, which are small beside the result. expm1
has no 1 to hide the roundings of r + r^2 Q behind, where k is 1 or -1: below 2 units.

P and Q interpolate at Chebyshev's points: the error is that of the best polynomial but for a factor of 2 or 3 (Powell,
Comput. J. 9 (1967) 404). Their degrees are the lowest that leave less than 2^-60 of the result, a hundredth of a unit.
"""

from __future__ import annotations

import ast
import math
import re
import struct
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import mpmath

#: What the template ``elementary`` holds.
FUNCTIONS = ("log", "log1p", "exp", "expm1")
#: What truncation may leave, relative to the result.
TRUNCATION = 2.0**-60
#: Digits that the coefficients are computed with.
DIGITS = 50
#: Terms of the series, which are exact with these: 0.03^40 < 1e-60.
TERMS = 40


@cache
def constants() -> dict[str, int | float | tuple[float, ...]]:
    """Numbers that the functions take, each rounded once.

    Returns
    -------
    dict
        ``ln2_high`` (whose last 11 bits are 0) and ``ln2_low``, which together are ln 2; ``log2_e``; ``log`` and
        ``exp``: coefficients of P and Q, that of power 0 first; ``root`` and ``carry``: the bits of sqrt(1/2), and
        those of 1 less these.
    """
    root, one = (struct.unpack("<q", struct.pack("<d", x))[0] for x in (math.sqrt(0.5), 1.0))
    with mpmath.workdps(DIGITS):
        ln2 = mpmath.ln(2)
        # 42 bits of ln 2, so that its product with a whole number of 11 bits is exact
        high = mpmath.floor(mpmath.ldexp(ln2, 42)) / 2**42
        # f = sqrt(2) - 1 and f = sqrt(1/2) - 1 have the same z, the largest
        largest = (3 - 2 * mpmath.sqrt(2)) ** 2
        return {
            "ln2_high": float(high),
            "ln2_low": float(ln2 - high),
            "log2_e": float(1 / ln2),
            # an error of P is z/2 as large in 2 s (1 + z P/2)
            "log": _near_best(log_series, (mpmath.mpf(0), largest), largest / 2),
            # an error of Q is r as large in expm1(r), and less in exp(r)
            "exp": _near_best(exp_series, (-ln2 / 2, ln2 / 2), ln2 / 2),
            "root": root,
            "carry": one - root,
        }


def log_series(z: Any) -> Any:
    """P(z) = (2 atanh(s) - 2 s)/(s z) with s = sqrt(z), by its series; z below 0.03."""
    return mpmath.fsum(2 * z**n / (2 * n + 3) for n in range(TERMS))


def exp_series(r: Any) -> Any:
    """Q(r) = (exp(r) - 1 - r)/r^2, by its series; |r| below 0.4."""
    return mpmath.fsum(r**n / mpmath.factorial(n + 2) for n in range(TERMS))


def _near_best(function: Callable[[Any], Any], ends: tuple[Any, Any], weight: Any) -> tuple[float, ...]:
    """Coefficients of the first interpolant at Chebyshev's points whose error, times the weight, is small enough."""
    for count in range(2, 30):
        coefficients, error = mpmath.chebyfit(function, list(ends), count, error=True)
        if error * weight < TRUNCATION:
            return tuple(float(value) for value in reversed(coefficients))
    raise AssertionError("no polynomial of a moderate degree is close enough")


def nested(coefficients: Sequence[float], name: str) -> str:
    """Text of a polynomial by Horner's rule, its constant first."""
    first, *rest = coefficients
    return f"{first!r} + {name} * ({nested(rest, name)})" if len(rest) > 1 else f"{first!r} + {name} * {rest[0]!r}"


def for_lanes(text: str) -> str:
    """Return an expression's text with calls of these functions instead of libm's."""
    return re.sub(rf"\b({'|'.join(FUNCTIONS)})\(", r"_lane_\1(", text)


class _Powers(ast.NodeTransformer):
    """Write x^y, of positive numbers, as exp(y ln x)."""

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        if not (isinstance(node.func, ast.Name) and node.func.id == "pow"):
            return node
        base, power = node.args
        logarithm = ast.Call(ast.Name("log", ast.Load()), [base], [])
        return ast.Call(ast.Name("exp", ast.Load()), [ast.BinOp(power, ast.Mult(), logarithm)], [])


def without_powers(text: str) -> str:
    """Return an expression's text with powers of positive numbers as exponentials, which loops over lanes can take.

    The error, relative, is some |y ln x| roundings: that of closures, whose powers are moderate, is some 1e-15.
    """
    return ast.unparse(_Powers().visit(ast.parse(text, mode="eval"))) if "pow(" in text else text


def used_functions(body: str) -> tuple[str, ...]:
    """Which of the functions a kernel's body calls."""
    return tuple(name for name in FUNCTIONS if f"_lane_{name}(" in body)
