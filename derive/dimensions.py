"""Physical dimensions, and the dimension of an expression.

Dimensions are exponents of mass, length and time; a law declares one for each of its own parameters, as in
``parameters={sigma: FORCE / LENGTH}``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from numbers import Real

from sympy import Abs, Add, Expr, Max, Min, Mul, Piecewise, Pow, Rational, Symbol, sign
from sympy.core.relational import Relational


@dataclass(frozen=True)
class Dimension:
    """Exponents of mass, length and time; dimensions multiply, divide and take rational powers, ``1/LENGTH`` too."""

    mass: Fraction = Fraction(0)
    length: Fraction = Fraction(0)
    time: Fraction = Fraction(0)

    def __mul__(self, other: Dimension | Real) -> Dimension:
        if isinstance(other, Real):  # a number has no dimension
            return self
        if not isinstance(other, Dimension):
            return NotImplemented
        return Dimension(self.mass + other.mass, self.length + other.length, self.time + other.time)

    __rmul__ = __mul__

    def __truediv__(self, other: Dimension | Real) -> Dimension:
        return self * other**-1 if isinstance(other, Dimension) else self * other

    def __rtruediv__(self, other: Real) -> Dimension:
        return self**-1 * other

    def __pow__(self, power: int | float | Fraction) -> Dimension:
        if not isinstance(power, Real):
            return NotImplemented
        power = Fraction(power).limit_denominator(1000) if isinstance(power, float) else Fraction(power)
        return Dimension(self.mass * power, self.length * power, self.time * power)

    def __str__(self) -> str:
        for name, known in NAMED.items():
            if self == known:
                return name
        parts = [
            symbol if power == 1 else f"{symbol}^{power}" if power.denominator == 1 else f"{symbol}^({power})"
            for symbol, power in (("M", self.mass), ("L", self.length), ("T", self.time))
            if power
        ]
        return " ".join(parts)


DIMENSIONLESS = Dimension()
MASS = Dimension(mass=Fraction(1))
LENGTH = Dimension(length=Fraction(1))
TIME = Dimension(time=Fraction(1))
FORCE = MASS * LENGTH / TIME**2
ENERGY = FORCE * LENGTH
PRESSURE = FORCE / LENGTH**2
VISCOSITY = PRESSURE * TIME
FRICTION = FORCE * TIME / LENGTH

NAMED = {
    "dimensionless": DIMENSIONLESS,
    "mass": MASS,
    "length": LENGTH,
    "time": TIME,
    "force": FORCE,
    "energy": ENERGY,
    "pressure": PRESSURE,
    "viscosity": VISCOSITY,
    "friction (force/velocity)": FRICTION,
}


def powers_of_units(dimension: Dimension) -> tuple[Fraction, Fraction, Fraction]:
    """Return the powers of R, E and eta whose product has a dimension."""
    return (
        dimension.length + dimension.mass,
        -(dimension.time + dimension.mass),
        2 * dimension.mass + dimension.time,
    )


class DimensionMismatchError(Exception):
    """An expression has no dimension: it adds unlike things, or takes a function of a dimensional one."""


def dimension_of(expr: Expr, known: Mapping[Symbol, Dimension]) -> Dimension | None:
    """Dimension of an expression.

    Parameters
    ----------
    expr : Expr
    known : mapping from symbol to Dimension

    Returns
    -------
    Dimension, or None for an exact zero, which has any dimension

    Raises
    ------
    DimensionMismatchError
        Naming the part of the expression at fault.
    """
    if expr.is_zero:
        return None
    if isinstance(expr, Symbol):
        return known[expr]
    if isinstance(expr, Mul):
        product = DIMENSIONLESS
        for factor in expr.args:
            product = product * (dimension_of(factor, known) or DIMENSIONLESS)
        return product
    if isinstance(expr, Pow):
        base = dimension_of(expr.base, known) or DIMENSIONLESS
        if isinstance(expr.exp, Rational):
            return base ** Fraction(int(expr.exp.p), int(expr.exp.q))
        _require_dimensionless(expr.exp, known, f"the exponent of {expr}")
        _require_dimensionless(expr.base, known, f"the base of {expr}, whose exponent is not a number,")
        return DIMENSIONLESS
    if isinstance(expr, (Add, Min, Max)):
        return _common(expr.args, known, expr)
    if isinstance(expr, Abs):
        return dimension_of(expr.args[0], known)
    if isinstance(expr, sign):
        dimension_of(expr.args[0], known)
        return DIMENSIONLESS
    if isinstance(expr, Piecewise):
        for condition in expr.atoms(Relational):
            _common(condition.args, known, condition)
        return _common([branch for branch, _ in expr.args], known, expr)
    for argument in expr.args:
        _require_dimensionless(argument, known, f"the argument of {expr}")
    return DIMENSIONLESS


def _common(terms: object, known: Mapping[Symbol, Dimension], whole: object) -> Dimension | None:
    found: Dimension | None = None
    first = None
    for term in terms:  # type: ignore[attr-defined]
        this = dimension_of(term, known)
        if this is None:
            continue
        if found is not None and this != found:
            raise DimensionMismatchError(f"{whole} combines {first} ({found}) with {term} ({this})")
        if found is None:
            found, first = this, term
    return found


def _require_dimensionless(expr: Expr, known: Mapping[Symbol, Dimension], what: str) -> None:
    found = dimension_of(expr, known)
    if found not in (None, DIMENSIONLESS):
        raise DimensionMismatchError(f"{what} must be dimensionless; {expr} is a {found}")
