"""A law at real values of its parameters, in SI units: ``R=50e-6,sigma=.03``.

Input: a law, and numbers for its parameters as text. Output: the law with these as its typical values, in units of R, a
modulus E and eta, in which all that is found of it is in numbers; and what these units are.

What is not given is taken from the law's typical values. A law without E has the modulus of its own elastic parameter,
as sigma/R; one whose eta is not given has its rates times eta. Numbers are read by a grammar of their own: nothing is
evaluated as code.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sympy import Expr, Mul, Rational, S, Symbol

from softdyn.derive.dimensions import DIMENSIONLESS, VISCOSITY, Dimension, powers_of_units
from softdyn.derive.forms import force_unit
from softdyn.derive.law import dimensions_for, parameters_of, range_text, ranges_of, sizes_asked
from softdyn.derive.regimes import sizes_words
from softdyn.derive.symbols import COMMON_PARAMETERS, E, R, eta
from softdyn.errors import SceneError
from softdyn.words import listed, suggestion

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
#: Sizes of what is given, and of that in units of R, E and eta: beyond them floating point has no room for powers.
LARGEST_GIVEN, LARGEST_RATIO = 1e100, 1e40

#: How SI units are written.
SI = {
    "dimensionless": "", "mass": "kg", "length": "m", "time": "s", "force": "N", "energy": "J", "pressure": "Pa",
    "viscosity": "Pa s", "friction (force/velocity)": "N s/m",
}  # fmt: skip


@dataclass(frozen=True)
class RealValues:
    """A law at real values.

    Attributes
    ----------
    law : ContactLaw
        With the values as its typical ones.
    values : mapping from Symbol to float
        Of all parameters that have one, in SI units.
    taken : tuple of Symbol
        Of these, what was not given, and taken from the law's typical values.
    length, modulus, viscosity : float
        What R, E and eta are 1 in units of, in m, Pa and Pa s; the latter 1, if eta is not known.
    timed : bool
        Whether eta is known: else rates are times eta.
    """

    law: ContactLaw
    values: Mapping[Symbol, float]
    taken: tuple[Symbol, ...]
    length: float
    modulus: float
    viscosity: float
    timed: bool

    def unit(self, dimension: Dimension) -> float:
        """Return what 1 in units of R, E and eta is in SI units, for a quantity of a dimension."""
        x, y, z = powers_of_units(dimension)
        return float(self.length ** float(x) * self.modulus ** float(y) * self.viscosity ** float(z))

    def words(self) -> str:
        """Return the values, as "R = 5e-05 m, sigma = 0.03 N/m"."""
        dimensions = dimensions_for(self.law)
        parts = [f"{s} = {value:.6g} {si_unit(dimensions[s])}".rstrip() for s, value in self.values.items()]
        return ", ".join(parts)


def si_unit(dimension: Dimension, eta_power: int = 0) -> str:
    """SI unit of a quantity; of the quantity times a power of eta, where that is what is known."""
    dimension = dimension * VISCOSITY**eta_power
    named = SI.get(str(dimension))
    if named is not None:
        return named
    # in N rather than kg, as N/m: M = N T^2/L
    powers = {"N": dimension.mass, "m": dimension.length - dimension.mass, "s": dimension.time + 2 * dimension.mass}

    def written(sign: int) -> str:
        parts = [(name, sign * power) for name, power in powers.items() if sign * power > 0]
        return " ".join(
            name if p == 1 else f"{name}^{p}" if p.denominator == 1 else f"{name}^({p})" for name, p in parts
        )

    above, below = written(1), written(-1)
    return f"{above or '1'}/{below if ' ' not in below else f'({below})'}" if below else above


def read_values(texts: Sequence[str]) -> dict[str, Rational]:
    """Read NAME=VALUE,NAME=VALUE,... as exact numbers.

    Raises
    ------
    SceneError
        Listing every fault.
    """
    found: dict[str, Rational] = {}
    faults = []
    for pair in (pair for text in texts for pair in text.split(",")):
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or not name:
            faults.append(f"--at {_short(pair)!r}: NAME=VALUE is expected, as in R=50e-6,sigma=.03")
        elif len(value) > 100 or NUMBER.fullmatch(value) is None:
            faults.append(f"--at {_short(name)}={_short(value)}: a decimal number is expected, as 50e-6, in SI units")
        elif abs(float(value)) > LARGEST_GIVEN or 0 < abs(float(value)) < 1 / LARGEST_GIVEN:
            faults.append(
                f"--at {_short(name)}={value}: the value must lie between {1 / LARGEST_GIVEN:g} and {LARGEST_GIVEN:g}"
            )
        elif name in found:
            faults.append(f"--at {_short(name)} is given twice")
        else:
            # the decimal number that was written, to the digits of a double
            found[name] = Rational(str(float(value)))
    if faults:
        raise SceneError(listed(faults))
    return found


def at_values(law: ContactLaw, given: Mapping[str, Rational]) -> RealValues | ContactLaw:
    """Return a law at real values; where only numbers without a unit are given, with these, and R, E, eta left open.

    Raises
    ------
    SceneError
        Listing what is unknown, not allowed, or missing.
    """
    used = {symbol.name: symbol for symbol in parameters_of(law)}
    faults = [_unknown(law, name, used) for name in given if name not in used]
    known = {used[name]: value for name, value in given.items() if name in used}
    faults += [fault for symbol, value in known.items() if (fault := _fault(law, symbol, value))]
    if faults:
        raise SceneError(listed(faults))
    dimensions = dimensions_for(law)
    if known and all(dimensions[symbol] == DIMENSIONLESS for symbol in known):
        return _with_typical(law, {**law.typical, **known})
    modulus = known.get(E)
    if modulus is None and E not in used.values():
        modulus = _modulus_of_typical(law, known)
    units = {R: known.get(R), E: modulus, eta: known.get(eta)}
    taken = {}
    missing = [symbol for symbol in (R, E) if symbol in used.values() and symbol not in known]
    for symbol in used.values():
        if symbol in known or symbol in COMMON_PARAMETERS:
            continue
        value = law.typical.get(symbol)
        needs = () if value is None else [unit for unit in (R, E, eta) if units[unit] is None and S(value).has(unit)]
        if value is None or (E in needs and E not in used.values()):
            missing.append(symbol)
        elif needs:
            missing += [unit for unit in needs if unit not in missing]
        else:
            taken[symbol] = Rational(S(value).subs({unit: x for unit, x in units.items() if x is not None}))
    if missing:
        raise SceneError(_missing(law, missing, given))
    whole = {symbol: {**known, **taken}[symbol] for symbol in used.values() if symbol in known or symbol in taken}
    return _in_units(law, whole, tuple(taken))


def require_sizes(law: ContactLaw) -> None:
    """Ask for the sizes of parameters that a law gives no typical values of, where its regimes depend on them.

    Raises
    ------
    SceneError
        If they do.
    """
    asked = sizes_asked(law)
    if not asked:
        return
    dimensions = dimensions_for(law)
    real = [symbol for symbol in parameters_of(law) if symbol != eta and dimensions[symbol] != DIMENSIONLESS]
    units = {symbol: R**x * E**y * eta**z for symbol in asked for x, y, z in [_rational_powers(dimensions[symbol])]}
    raise SceneError(
        f"law {law.name!r}: {sizes_words(asked)}. Give real values, in SI units: "
        f"--at {','.join(f'{symbol}=...' for symbol in real)}; or their orders of magnitude in the law: "
        f"typical={{{', '.join(f'{symbol}: number*{unit}' for symbol, unit in units.items())}}}"
    )


def _rational_powers(dimension: Dimension) -> tuple[Rational, Rational, Rational]:
    x, y, z = (Rational(p.numerator, p.denominator) for p in powers_of_units(dimension))
    return x, y, z


def _in_units(law: ContactLaw, whole: dict[Symbol, Rational], taken: tuple[Symbol, ...]) -> RealValues:
    """The law with typical values that are real ones, in units of R, a modulus and eta."""
    dimensions = dimensions_for(law)
    modulus = whole[E] if E in whole else _modulus(law, whole)
    units = {R: whole[R], E: modulus, eta: whole.get(eta, S.One)}
    typical = {}
    for symbol, value in whole.items():
        if symbol in COMMON_PARAMETERS:
            continue
        x, y, z = _rational_powers(dimensions[symbol])
        if z != 0 and eta not in whole:
            raise SceneError(
                f"--at: {symbol} is a {dimensions[symbol]}, and is small or large against eta: give eta too"
            )
        number = _exact(value / Mul(units[R] ** x, units[E] ** y, units[eta] ** z))
        if number != 0 and not 1 / LARGEST_RATIO < abs(number) < LARGEST_RATIO:
            raise SceneError(
                f"--at: {symbol} is {float(number):.3g} times {_named(law, R**x * E**y * eta**z)}; beyond "
                f"{LARGEST_RATIO:g} nothing can be computed: are all values in SI units?"
            )
        typical[symbol] = number * R**x * E**y * eta**z
    return RealValues(
        _with_typical(law, typical),
        {symbol: float(value) for symbol, value in whole.items()},
        taken,
        float(units[R]),
        float(units[E]),
        float(units[eta]),
        eta in whole,
    )


def _named(law: ContactLaw, unit: Expr) -> Expr:
    """A unit in the law's own parameters, where it has no E."""
    return unit if E in parameters_of(law) else unit.subs(E, force_unit(law) / R**2)


def _exact(value: Expr) -> Rational:
    """A number as a fraction; a root to the digits of a double."""
    return value if value.is_Rational else Rational(str(float(value)))


def _modulus(law: ContactLaw, values: Mapping[Symbol, Rational]) -> Rational:
    """What stands for E in a law without it: of its own elastic parameter; else of any that holds a force."""
    unit = force_unit(law)
    if not unit.has(E):
        return _exact(unit.subs(values) / values[R] ** 2)
    found = []
    for symbol in values:
        x, y, z = _rational_powers(dimensions_for(law)[symbol])
        if y != 0 and z == 0 and values[symbol] != 0:
            found.append(_exact((abs(values[symbol]) / values[R] ** x) ** (1 / y)))
    return max(found, default=S.One)


def _modulus_of_typical(law: ContactLaw, known: Mapping[Symbol, Rational]) -> Rational | None:
    """What E stands for in the typical values of a law without it, from a value that is given; None if from none."""
    first = sorted(known, key=lambda symbol: symbol not in force_unit(law).free_symbols)
    for symbol in first:
        value = S(law.typical.get(symbol, 0))
        power = value.as_powers_dict().get(E, S.Zero)
        rest = value.subs({E: 1, **known})
        if power != 0 and rest.is_number and rest != 0 and (known[symbol] / rest).is_positive:
            return _exact((known[symbol] / rest) ** (1 / power))
    return None


def _with_typical(law: ContactLaw, typical: Mapping[Symbol, Expr]) -> ContactLaw:
    """The law with other typical values; nothing that was checked of it depends on them."""
    changed = copy(law)
    object.__setattr__(changed, "typical", dict(typical))
    return changed


def _unknown(law: ContactLaw, name: str, used: Mapping[str, Symbol]) -> str:
    if name in {symbol.name for symbol in law.parameters}:
        return f"--at {name}: no regime of {law.name} depends on it: leave it out"
    hint = suggestion(name, list(used))
    if name in {symbol.name for symbol in COMMON_PARAMETERS}:
        hint = f": leave it out; there are {', '.join(used)}"
    return f"--at {_short(name)!r}: {law.name} has no such parameter{hint}"


def _fault(law: ContactLaw, symbol: Symbol, value: Rational) -> str | None:
    allowed = ranges_of(law).get(symbol)
    if allowed is not None and value not in allowed:
        return f"--at {symbol}={float(value):g} lies outside of its range, {range_text(symbol, allowed)}"
    if symbol.is_positive and value <= 0:
        return f"--at {symbol}={float(value):g} must be positive"
    if value == 0 and dimensions_for(law)[symbol] != DIMENSIONLESS:
        return f"--at {symbol}=0 has no order of magnitude: give a number that is small"
    return None


def _missing(law: ContactLaw, missing: Sequence[Symbol], given: Mapping[str, Rational]) -> str:
    dimensions = dimensions_for(law)
    parts = [f"{symbol} ({si_unit(dimensions[symbol]) or 'a number'})" for symbol in missing]
    example = ",".join([*(f"{name}={float(value):g}" for name, value in given.items()), *(f"{s}=..." for s in missing)])
    verb = "is" if len(parts) == 1 else "are"
    return (
        f"--at: {', '.join(parts)} {verb} not given, and no typical value of {law.name} tells what "
        f"{'it is' if len(parts) == 1 else 'they are'}; write --at {example}"
    )


def _short(text: str) -> str:
    """What somebody wrote, in a message of one line."""
    text = "".join(sign if sign.isprintable() else "?" for sign in text)
    return text if len(text) <= 40 else text[:37] + "..."
