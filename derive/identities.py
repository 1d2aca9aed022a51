"""Functions written in others, where their own series do not serve: far out, or beside a point where they are singular.

Input: a function of an argument, and to which side it grows. Output: the same in exponentials, logarithms, roots and
functions of a small argument; exact, but for the error functions, Lambert's and Bessel's, whose series say what they
leave out.
"""

from __future__ import annotations

from dataclasses import dataclass

from sympy import (
    Expr,
    Integer,
    LambertW,
    S,
    acos,
    acosh,
    acoth,
    asin,
    asinh,
    atan,
    atanh,
    cosh,
    coth,
    erf,
    erfc,
    exp,
    factorial2,
    log,
    pi,
    sinh,
    sqrt,
    tanh,
)

from softdyn.derive import bessel
from softdyn.derive.bessel import Bessel

#: Terms of the asymptotic series of the error functions.
TERMS = 8


@dataclass(frozen=True)
class Tail:
    """A function as ``whole`` + ``factor`` (``known`` + something of the order of ``rest``)."""

    whole: Expr
    factor: Expr
    known: Expr
    rest: Expr


def everywhere(expr: Expr) -> Expr | None:
    """Write a function that is singular at a finite argument in others, which are not; None if there is no need."""
    x = expr.args[0]
    if isinstance(expr, acosh):
        return log(x + sqrt(x - 1) * sqrt(x + 1))
    if isinstance(expr, acos):
        return 2 * atan(sqrt(1 - x) / sqrt(1 + x))
    if isinstance(expr, asin):
        return atan(x / (sqrt(1 - x) * sqrt(1 + x)))
    if isinstance(expr, atanh):
        return (log(1 + x) - log(1 - x)) / 2
    if isinstance(expr, acoth):
        return (log(1 + 1 / x) - log(1 - 1 / x)) / 2
    if isinstance(expr, coth):
        return 1 / tanh(x)
    return None


def at_zero(expr: Expr) -> Tail | None:
    """Write a function that has a logarithm at 0, and no power series; None if it is another."""
    if not isinstance(expr, Bessel) or expr.kind not in "yk":
        return None
    known, rest = bessel.near_zero(expr)
    return Tail(S.Zero, S.One, known, rest)


def far_out(expr: Expr, side: int) -> Expr | Tail | None:
    """Write a function of an argument that grows beyond all bounds, to one side; None if that is not known."""
    x = expr.args[0]
    away = side * x
    if isinstance(expr, (sinh, cosh)):
        return (
            (exp(away) + (1 if isinstance(expr, cosh) else -1) * exp(-away))
            * (S.One if isinstance(expr, cosh) else Integer(side))
            / 2
        )
    if isinstance(expr, tanh):
        return side * (1 - exp(-2 * away)) / (1 + exp(-2 * away))
    if isinstance(expr, atan):
        return side * pi / 2 - atan(1 / x)
    if isinstance(expr, asinh):
        return side * log(away + sqrt(1 + x**2))
    if isinstance(expr, LambertW) and side > 0:
        return Tail(log(x) - log(log(x)), S.One, S.Zero, log(log(x)) / log(x))
    if isinstance(expr, Bessel):
        series = bessel.far_out(expr) if side > 0 else None
        return None if series is None else Tail(S.Zero, *series)
    if isinstance(expr, (erf, erfc)):
        # erfc(x) ~ exp(-x^2)/(x sqrt(pi)) (1 - 1/(2 x^2) + 3/(2 x^2)^2 - ...)
        known = sum((S.NegativeOne**k * factorial2(2 * k - 1) / (2 * x**2) ** k for k in range(TERMS)), start=S.Zero)
        factor = exp(-(x**2)) / (away * sqrt(pi))
        whole = Integer(side) if isinstance(expr, erf) else Integer(1 - side)
        return Tail(whole, -side * factor if isinstance(expr, erf) else side * factor, known, x ** (-2 * TERMS))
    return None
