"""Writing a leading form as it is read: a number, powers of kappa and h/R, and what is left of the law's parameters.

Input: a form in h, F and the parameters. Output: its factors, in the customary order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from sympy import (
    Add,
    Expr,
    Mul,
    Rational,
    S,
    Symbol,
    expand_log,
    expand_power_base,
    factor_terms,
    gcd_list,
    log,
    powsimp,
    sstr,
)

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
    """Return what F is compared with: E R^2, or the same of the elastic force's own parameter where E is not in it."""
    if E not in parameters_of(law):
        for symbol in sorted(law.F_ela.free_symbols & law.parameters.keys(), key=str):
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
    written = (form / (force / (eta * R)) if outside else form).subs({force: kappa * unit, h: x * R})
    found = _factors(written) or (None if _holds_sums(written) else _factors(powsimp(written)))
    if found is None:
        return None
    number, powers = powsimp(found[0]), found[1]
    if outside:
        powers[V] = S.One
    order = [eta, E, V, R]
    rank = {symbol: i for i, symbol in enumerate(order)}
    last = {kappa: 1, x: 2}
    sorted_ = sorted(powers, key=lambda s: (last.get(s, 0), rank.get(s, len(order)), s.name))
    return Product(number, {symbol: powers[symbol] for symbol in sorted_ if powers[symbol] != 0})


def _holds_sums(form: Expr) -> bool:
    """Whether a factor is a power of a sum or a function, which none of its other forms gets rid of."""
    bases = (factor.as_base_exp()[0] for factor in Mul.make_args(form))
    return any((base.is_Add or base.is_Function) and base.has(kappa, x, R, E, eta) for base in bases)


def _factors(form: Expr) -> tuple[Expr, dict[Symbol, Expr]] | None:
    """Factor of a product that has none of kappa, x, R, E and eta, and the powers of all symbols; None for others."""
    number: Expr = S.One
    powers: dict[Symbol, Expr] = {}
    for factor in Mul.make_args(expand_power_base(form)):
        base, power = factor.as_base_exp()
        if base.is_Symbol and power.is_number:
            powers[base] = powers.get(base, S.Zero) + power
        elif not factor.free_symbols & {kappa, x, R, E, eta}:
            number *= factor  # of own parameters too, such as 1 - nu^2
        else:
            return None
    return number, powers


def joined_logarithms(form: Expr) -> Expr:
    """Write sums of multiples of logarithms as one multiple of one logarithm."""
    return form.replace(lambda part: part.is_Add and part.has(log), _joined) if form.has(log) else form


def _joined(total: Expr) -> Expr:
    argument: dict[Expr, Rational] = {}
    rest = []
    for term in Add.make_args(expand_log(total)):
        number, factor = term.as_coeff_Mul()
        if isinstance(factor, log) and number.is_Rational:
            argument[factor.args[0]] = argument.get(factor.args[0], S.Zero) + number
        else:
            rest.append(term)
    if not argument:
        return total
    common = Rational(gcd_list([abs(power) for power in argument.values()]))
    inside = Mul(*(base ** (power / common) for base, power in argument.items()))
    if inside.is_number and inside < 1:
        inside, common = 1 / inside, -common
    return Add(*rest, common * log(inside))


@lru_cache(maxsize=10_000)
def plain(form: Expr, unit: Expr, rate: bool = False) -> str:
    """Text of a form, as "3*6**(1/3)/4 R kappa^(2/3)".

    Parameters
    ----------
    form : Expr
    unit : Expr
        Of forces: kappa is a force over it.
    rate : bool
        Whether the form is a rate.
    """
    product = as_product(form, unit, rate)
    if product is None or product.powers.keys() - {eta, E, R, V, kappa, x} - unit.free_symbols:
        return str(sstr(form))  # forces and lengths of the law's own are best read where they stand
    parts = [_power(symbol, power) for symbol, power in product.powers.items()]
    factored = factor_terms(product.number)
    number = f"({sstr(factored)})" if factored.is_Add and parts else sstr(factored)
    if number == "-1" and parts:
        return "-" + " ".join(parts)
    return " ".join([*([number] if number != "1" or not parts else []), *parts])


def _power(symbol: Symbol, power: Expr) -> str:
    name = f"({symbol.name})" if "/" in symbol.name and power != 1 else symbol.name
    if power == 1:
        return name
    return f"{name}^{power}" if power.is_Integer else f"{name}^({power})"
