"""Logarithms, powers and differences, written as certificates have rules for them.

Input: an expression, and what is known of an order. Output: the same in prefix notation. The logarithm of what
vanishes is minus that of its inverse, which grows. Where w tends to 1, 1 - w^p is -expm1(p log(w)), and w^p is exp(p
log(w)) if p is no rational number. A power of something fixed is an exponential of its exponent. Any other power whose
exponent is no rational number is a positive quantity of a name of its own and of unknown size: what holds for any such
quantity holds for the power.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from sympy import Add, Expr, Pow, Rational, Symbol, log

from softdyn.certificate_checker import Case, Refused, Vector, plus, ratio
from softdyn.derive.certificate_cases import multipliers, prefix
from softdyn.derive.checks import is_monomial


@dataclass(frozen=True)
class Terms:
    """What is known of the terms of a claim, and what was assumed or named to write them.

    Attributes
    ----------
    fixed : collection of Symbol
    below_one : collection of Symbol
        Those that are less than 1.
    pairs : sequence of (small, large)
        The order.
    assumed : dict
        Logarithms of what is fixed, which are positive.
    named : dict from Expr to (name, power)
        Powers of unknown size.
    """

    fixed: Collection[Symbol]
    below_one: Collection[Symbol]
    pairs: Sequence[tuple[Expr, Expr]]
    assumed: dict[str, Any] = field(default_factory=dict)
    named: dict[Expr, tuple[str, Any]] = field(default_factory=dict)

    def text(self, expr: Expr) -> Any:
        """An expression in prefix notation.

        Raises
        ------
        Refused
            If it holds a function that certificates have no rule for.
        """
        return prefix(expr, self._special)

    def fixed_names(self) -> list[str]:
        """Names of what is fixed, powers among it."""
        powers = (name for power, (name, _) in self.named.items() if self._is_fixed(power))
        return [*sorted(symbol.name for symbol in self.fixed), *powers]

    def _special(self, expr: Expr) -> Any:
        if isinstance(expr, Add):
            return self._difference(expr)
        if isinstance(expr, log) and (found := self._logarithm(expr.args[0])) is not None:
            sign, text = found
            return text if sign > 0 else ["*", "-1", text]
        if isinstance(expr, Pow) and not isinstance(expr.exp, Rational):
            return self._power(expr.base, expr.exp)
        return None

    def _is_fixed(self, expr: Expr) -> bool:
        return bool(expr.free_symbols <= set(self.fixed))

    def _logarithm(self, argument: Expr) -> tuple[int, Any] | None:
        """Sign of a logarithm of a product of powers, and its size; None if the sign is not known."""
        if not is_monomial(argument):
            return None
        is_fixed = self._is_fixed(argument)
        above_one = self._above_one if is_fixed else self._grows
        for sign in (1, -1):
            if above_one(argument**sign):
                text = ["log", prefix(argument**sign)]
                if is_fixed:
                    self.assumed.setdefault(str(text), text)
                return sign, text
        return None

    def _above_one(self, monomial: Expr) -> bool:
        number, rest = monomial.as_coeff_Mul()
        powers = rest.as_powers_dict()
        known = all(base in self.below_one and power < 0 for base, power in powers.items() if base != 1)
        return bool(known and number >= 1 and monomial != 1)

    def _grows(self, monomial: Expr) -> bool:
        plain = Case([], [], {})
        grow = [ratio(prefix(small), prefix(large), plain) for small, large in self.pairs]
        bounded: list[Vector] = [{symbol.name: Fraction(1)} for symbol in self.fixed]
        return multipliers(plus({}, ratio(prefix(monomial), "1", plain), Fraction(-1)), grow, bounded) is not None

    def _vanishes(self, total: Expr) -> bool:
        return all(is_monomial(term) and self._grows(1 / term) for term in Add.make_args(total))

    def _difference(self, expr: Expr) -> Any:
        """1 - w^p, times a number and beside other terms, where w tends to 1; None without."""
        number, rest = expr.as_coeff_Add()
        for term in Add.make_args(rest) if number != 0 else ():
            base, exponent = (-term / number).as_base_exp()
            inside = self._near_one(base)
            if inside is None or (exponent.is_Integer and exponent > 0):
                continue
            text = ["*", str(-number), ["expm1", ["*", self.text(exponent), inside]]]
            others = rest - term
            return text if others == 0 else ["+", text, *(self.text(part) for part in Add.make_args(others))]
        return None

    def _near_one(self, base: Expr) -> Any:
        """Logarithm of a sum that tends to 1; None of any other."""
        one, small = base.as_coeff_Add()
        if one != 1 or small == 0 or not self._vanishes(small):
            return None
        return ["log", ["+", "1", *(self.text(part) for part in Add.make_args(small))]]

    def _power(self, base: Expr, exponent: Expr) -> Any:
        """A power whose exponent is no rational number: its base is positive, or it has no value."""
        if base.is_negative:
            raise Refused(f"certificates have no rule for {Pow(base, exponent)}")
        if self._is_fixed(base) and not self._is_fixed(exponent) and (found := self._logarithm(base)) is not None:
            sign, text = found
            first, rest = exponent.as_coeff_Add()
            return ["*", self.text(Pow(base, first)), ["exp", ["*", str(sign), self.text(rest), text]]]
        if (inside := self._near_one(base)) is not None:
            return ["exp", ["*", self.text(exponent), inside]]
        if is_monomial(base):  # of products, each by itself, as they may be joined otherwise elsewhere
            return ["*", *(self._named(part, power * exponent) for part, power in base.as_powers_dict().items())]
        return self._named(base, exponent)

    def _named(self, base: Expr, exponent: Expr) -> Any:
        sign = -1 if exponent.could_extract_minus_sign() else 1
        power = Pow(base, sign * exponent)
        if not isinstance(power, Pow) or isinstance(power.exp, Rational):
            return self.text(Pow(base, exponent))
        if power not in self.named:
            text = ["^", self.text(base), self.text(sign * exponent)]
            self.named[power] = (f"power_{len(self.named)}", text)
        return ["^", self.named[power][0], str(sign)]
