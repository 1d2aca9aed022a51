"""Writing a leading form as it is read: a number, powers of kappa and h/R, and what is left of the law's parameters.

Input: a form in h, F and the parameters. Output: its factors, in the customary order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sympy import Expr, Mul, S, Symbol, powsimp, sstr

from softdyn.derive.dimensions import FORCE, LENGTH
from softdyn.derive.law import parameters_of
from softdyn.derive.symbols import E, R, eta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

#: |F|, in leading forms.
force = Symbol("F", positive=True)
#: Gap over radius, force over the law's unit of force, and F/(eta R).
x, kappa, V = Symbol("h/R", positive=True), Symbol("kappa", positive=True), Symbol("V", positive=True)


@dataclass(frozen=True)
class Product:
    """A number times powers of symbols: of parameters, then of kappa and h/R."""

    number: Expr
    powers: Mapping[Symbol, Expr]


def force_unit(law: ContactLaw) -> Expr:
    """Return what F is compared with: E R^2, or the same of the law's own parameter where E is not among them."""
    used = parameters_of(law)
    if E not in used:
        for symbol in used:
            if symbol in law.parameters:
                for power in (0, 1, 2):
                    if law.parameters[symbol] * LENGTH**power == FORCE:
                        return symbol * R**power
    return E * R**2


def as_product(form: Expr, unit: Expr, rate: bool = False) -> Product | None:
    """Write a form in kappa = F/unit and h/R; None if it is not a product of powers.

    Parameters
    ----------
    form : Expr
    unit : Expr
        Of :func:`force_unit`.
    rate : bool
        Whether to take out V = F/(eta R), where the form has F in it.
    """
    outside = rate and form.has(force)
    written = powsimp((form / (force / (eta * R)) if outside else form).subs({force: kappa * unit, h: x * R}))
    number = S.One
    powers: dict[Symbol, Expr] = {}
    for factor in Mul.make_args(written.expand(power_base=True) if written.is_Mul or written.is_Pow else written):
        base, power = factor.as_base_exp()
        if factor.is_number:
            number *= factor
        elif base.is_Symbol and power.is_number:
            powers[base] = powers.get(base, S.Zero) + power
        else:
            return None
    if outside:
        powers[V] = S.One
    order = [eta, E, V, R]
    rank = {symbol: i for i, symbol in enumerate(order)}
    last = {kappa: 1, x: 2}
    sorted_ = sorted(powers, key=lambda s: (last.get(s, 0), rank.get(s, len(order)), s.name))
    return Product(number, {symbol: powers[symbol] for symbol in sorted_ if powers[symbol] != 0})


def plain(form: Expr, unit: Expr, rate: bool = False) -> str:
    """Text of a form, as "3*6**(1/3)/4 R kappa^(2/3)"."""
    product = as_product(form, unit, rate)
    if product is None:
        return sstr(form)
    parts = [_power(symbol, power) for symbol, power in product.powers.items()]
    number = sstr(product.number)
    if number == "-1" and parts:
        return "-" + " ".join(parts)
    return " ".join([*([number] if number != "1" or not parts else []), *parts])


def _power(symbol: Symbol, power: Expr) -> str:
    name = f"({symbol.name})" if "/" in symbol.name and power != 1 else symbol.name
    if power == 1:
        return name
    return f"{name}^{power}" if power.is_Integer else f"{name}^({power})"
