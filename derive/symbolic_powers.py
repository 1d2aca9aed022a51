"""Powers whose exponent is a parameter of a law, as delta^n: regimes are found at its typical value.

Input: a law. Output: those parameters with their values, and the law with the values in their place. A scaling of h and
delta says what h^n is only where n is a rational number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import copy
from typing import TYPE_CHECKING

from sympy import Pow, Rational, S, Symbol

from softdyn.derive.dimensions import DIMENSIONLESS
from softdyn.derive.law import expressions, typical_values
from softdyn.derive.symbols import a, delta, h

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw


def exponents_of(law: ContactLaw, scaled: Collection[Symbol]) -> dict[Symbol, Rational]:
    """Typical values of parameters that are exponents of what scales; of those that have one.

    Parameters
    ----------
    law : ContactLaw
    scaled : collection of Symbol
        Parameters that scale, besides the gap, the deflection and the radius.
    """
    known = {s: value for s, value in typical_values(law).items() if law.parameters.get(s) == DIMENSIONLESS}
    scaling = {a, delta, h, *scaled}
    powers = (power for expr in expressions(law).values() for power in expr.atoms(Pow))
    exponents = (power.exp for power in powers if power.base.free_symbols & scaling and power.exp.free_symbols)
    found = {
        symbol for exponent in exponents if exponent.free_symbols <= known.keys() for symbol in exponent.free_symbols
    }
    return {symbol: known[symbol] for symbol in sorted(found, key=str)}


def with_exponents(law: ContactLaw, values: Mapping[Symbol, Rational]) -> ContactLaw:
    """A law with numbers in the place of exponents; itself, if there are none.

    Parameters
    ----------
    law : ContactLaw
    values : mapping from Symbol to Rational
    """
    if not values:
        return law
    changed = copy(law)
    for name, expr in {**expressions(law), "dashpot": law.dashpot, "unequal": law.unequal}.items():
        object.__setattr__(changed, name, S(expr).subs(values))
    for name in ("parameters", "ranges", "typical"):
        kept = {symbol: value for symbol, value in getattr(law, name).items() if symbol not in values}
        object.__setattr__(changed, name, kept)
    return changed


def exponents_words(values: Mapping[Symbol, Rational]) -> str:
    """Say at which values of exponents regimes are found: "n at its typical value 3/2"."""
    return ", ".join(f"{symbol} at its typical value {value}" for symbol, value in values.items())
