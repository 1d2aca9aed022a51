"""How regimes are written in text: by formulas in the law's parameters, or in numbers with SI units.

Input: leading forms, conditions and lines in h and F. Output: text. Both notations have the same methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sympy import Expr, Float, Mul, Rational, Symbol, sstr

from softdyn.derive.dimensions import DIMENSIONLESS, FORCE, FRICTION, LENGTH, TIME, Dimension
from softdyn.derive.dominant_balance import size
from softdyn.derive.forms import force, force_unit, kappa, plain
from softdyn.derive.law import parameters_of
from softdyn.derive.symbols import E, R, eta, h
from softdyn.derive.typeset import RATES
from softdyn.study.plane import parameter_values
from softdyn.study.values import RealValues, si_unit

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw
    from softdyn.derive.regimes import Condition

#: Dimensions of what has a leading form.
DIMENSIONS: dict[str, Dimension] = {
    "a": LENGTH, "zeta": FRICTION, "delta": LENGTH, "F_adh": FORCE, "C": FORCE / LENGTH, "D": FRICTION,
    "dh_dt": LENGTH / TIME, "dX_dt": LENGTH / TIME, "U_h": FORCE,
    "h": LENGTH, "F": FORCE, "rate": TIME**-1,
}  # fmt: skip
#: h/R, in numbers.
x = Symbol("x", positive=True)
#: Digits of a number.
DIGITS = 4


@dataclass(frozen=True)
class Formulas:
    """Writes what is found of a law in its parameters, forces over a unit of the law's own."""

    law: ContactLaw

    @property
    def unit(self) -> Expr:
        """Return the force that kappa = 1 stands for."""
        return force_unit(self.law)

    def about(self) -> list[str]:
        """Return what stands for what."""
        return [f"kappa = F/({self.unit}), V = F/(eta R); F and delta stand for their sizes"]

    def name(self, name: str) -> str:
        """Return how a quantity is called."""
        return name

    def form(self, name: str, form: Expr) -> str:
        """Return the text of a leading form."""
        return plain(form, self.unit, name in RATES)

    def term(self, term: Expr) -> str:
        """Return the text of a correction."""
        return plain(term, self.unit)

    def condition(self, condition: Condition) -> str:
        """Return an inequality between dimensionless sizes, h or F first."""
        small, large = condition.small, condition.large
        if (small / large).free_symbols - {h, force, R, E, eta} - self.unit.free_symbols:
            return f"{small} << {large}" if small in (force, h, size) else f"{large} >> {small}"
        over = self.unit if force in small.free_symbols | large.free_symbols else R
        texts = (plain(small / over, self.unit), plain(large / over, self.unit))
        return f"{texts[0]} << {texts[1]}" if small in (force, h, size) else f"{texts[1]} >> {texts[0]}"

    def line(self, left: Expr, value: Expr) -> str:
        """Return an equation for a force or a gap."""
        return f"{'kappa' if left == force else 'h'} = {self.value(left, value)}"

    def value(self, left: Expr, value: Expr) -> str:
        """Return the right-hand side alone."""
        return plain(value / self.unit if left == force else value, self.unit)

    def scale(self, name: str) -> tuple[float, str]:
        """Return what a number of a quantity is multiplied by, and its unit."""
        return 1.0, ""


@dataclass(frozen=True)
class Numbers:
    """Writes what is found of a law in numbers, with SI units."""

    real: RealValues

    def about(self) -> list[str]:
        """Return the values, and what stands for what."""
        real = self.real
        taken = ", ".join(map(str, real.taken))
        length, load = real.unit(LENGTH), real.unit(FORCE)
        lines = [f"at {real.words()}"]
        lines += [f"not given, and taken from the law's typical values: {taken}"] if taken else []
        unit = float(force_unit(self.real.law).subs(parameter_values(self.real.law)))
        lines.append(
            f"x = h/({length:.{DIGITS}g} m), kappa = F/({load * unit:.{DIGITS}g} N); F and delta stand for their sizes"
        )
        if not real.timed and eta in parameters_of(real.law):
            lines.append("eta is not given: friction is told over eta, and rates times eta")
        return lines

    def name(self, name: str) -> str:
        """Return how a quantity is called."""
        power = self._eta(DIMENSIONS[name])
        return f"{name}/eta" if power > 0 else f"{name} eta" if power < 0 else name

    def _eta(self, dimension: Dimension) -> int:
        """Power of an unknown eta in a quantity."""
        return 0 if self.real.timed else int(2 * dimension.mass + dimension.time)

    def written(self, form: Expr, dimension: Dimension) -> str:
        """Return a form in x, kappa and numbers."""
        values = parameter_values(self.real.law)
        unit = float(force_unit(self.real.law).subs(values))
        number = form.subs(values).subs({force: kappa * Float(unit), h: x}).evalf()
        factor = self.real.unit(dimension)
        named = si_unit(dimension, -self._eta(dimension))
        parts = [part.as_base_exp() for part in Mul.make_args(number)]
        if all(base in (x, kappa) or base.is_number for base, _ in parts) and all(p.is_number for _, p in parts):
            c = factor * float(Mul(*(base**p for base, p in parts if base.is_number)))
            powers = {base: p for base, p in parts if not base.is_number}
            texts = [_power(base, powers[base]) for base in (kappa, x) if base in powers]
            lead = f"{c:.{DIGITS}g} {named}".strip()
            if lead in ("1", "-1") and texts:
                return ("-" if lead == "-1" else "") + " ".join(texts)
            return " ".join([lead, *texts])
        short = number.xreplace({n: Float(n, DIGITS) for n in number.atoms(Float)})
        lead = f"{factor:.{DIGITS}g} {named}".strip()
        return f"{lead} * ({sstr(short)})" if lead != "1" else sstr(short)

    def form(self, name: str, form: Expr) -> str:
        """Return the text of a leading form."""
        return self.written(form, DIMENSIONS[name])

    def term(self, term: Expr) -> str:
        """Return the text of a correction."""
        return self.written(term, DIMENSIONLESS)

    def condition(self, condition: Condition) -> str:
        """Return an inequality, h or F first."""
        small, large = condition.small, condition.large
        left, right, sign = (small, large, "<<") if small in (force, h, size) else (large, small, ">>")
        return f"{'F' if left == force else left} {sign} {self.value(left, right)}"

    def line(self, left: Expr, value: Expr) -> str:
        """Return an equation for a force or a gap."""
        return f"{'F' if left == force else 'h'} = {self.value(left, value)}"

    def value(self, left: Expr, value: Expr) -> str:
        """Return the right-hand side alone."""
        return self.written(value, FORCE if left == force else LENGTH)

    def scale(self, name: str) -> tuple[float, str]:
        """Return what a number of a quantity is multiplied by, and its unit."""
        dimension = DIMENSIONS[name]
        return self.real.unit(dimension), si_unit(dimension, -self._eta(dimension))


def _power(base: Symbol, power: Any) -> str:
    exact = Rational(str(float(power))).limit_denominator(100)
    if exact == 1:
        return str(base.name)
    text = str(exact) if abs(exact - power) < 1e-9 else f"{float(power):.{DIGITS}g}"
    return f"{base.name}^({text})" if "/" in text or text.startswith("-") else f"{base.name}^{text}"
