"""Quantities with units, as people write them: "50 um", "1 mN/m", "0.89 mPa s"; all in SI units.

A small table of SI's units and prefixes, and of those of the CGS system that rheologists use, is all that scenes and
measured data take: lengths, times, masses and their products. There is no temperature, no current. Quantities of pint,
and of packages like it, are taken as they are.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from softdyn.errors import SceneError
from softdyn.words import suggestion

#: Powers of mass, length and time.
Powers = tuple[Fraction, Fraction, Fraction]

#: Powers of ten.
PREFIXES = {
    "f": -15, "p": -12, "n": -9, "u": -6, "\N{MICRO SIGN}": -6, "\N{GREEK SMALL LETTER MU}": -6, "m": -3, "c": -2,
    "d": -1, "h": 2, "k": 3, "M": 6, "G": 9, "T": 12,
}  # fmt: skip

#: Units that take prefixes: in SI units, and powers of mass, length and time.
UNITS: dict[str, tuple[str, tuple[int, int, int]]] = {
    "m": ("1.0", (0, 1, 0)),
    "s": ("1.0", (0, 0, 1)),
    "g": ("1e-3", (1, 0, 0)),
    "N": ("1.0", (1, 1, -2)),
    "Pa": ("1.0", (1, -1, -2)),
    "J": ("1.0", (1, 2, -2)),
    "W": ("1.0", (1, 2, -3)),
    "Hz": ("1.0", (0, 0, -1)),
    "P": ("0.1", (1, -1, -1)),
    "dyn": ("1e-5", (1, 1, -2)),
    "bar": ("1e5", (1, -1, -2)),
}
#: Those that take none.
WHOLE: dict[str, tuple[str, tuple[int, int, int]]] = {
    "1": ("1.0", (0, 0, 0)),
    "%": ("1e-2", (0, 0, 0)),
    "rad": ("1.0", (0, 0, 0)),
    "min": ("60.0", (0, 0, 1)),
    "atm": ("101325.0", (1, -1, -2)),
    "\N{ANGSTROM SIGN}": ("1e-10", (0, 1, 0)),
    "\N{LATIN CAPITAL LETTER A WITH RING ABOVE}": ("1e-10", (0, 1, 0)),
    "angstrom": ("1e-10", (0, 1, 0)),
    "micron": ("1e-6", (0, 1, 0)),
}
#: Powers as they are printed: the sign, then the digits.
RAISED = str.maketrans("\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076", "-0123456")
NAMES = (*UNITS, *(name for name in WHOLE if name != "1"))

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL)
_PART = re.compile(
    r"(?P<mark>\s*[*/\u00b7\u22c5]\s*|\s+|^)(?P<name>[^\W\d_]+|%|1)(?:(?:\^|\*\*)?\s*(?P<power>[+-]?\d+))?"
)


@dataclass(frozen=True)
class Unit:
    """A unit: in SI units, and its powers of mass, length and time."""

    text: str
    size: Fraction
    powers: Powers


def read_unit(text: str) -> Unit:
    """Read a unit: names with prefixes, side by side or with ``*``, ``/`` and powers, as "mN/m", "Pa s", "m s^-1".

    What follows one ``/`` divides, up to the next ``*`` or space.

    Raises
    ------
    SceneError
        Naming the part that is no unit.
    """
    left = text.strip().translate(RAISED)
    place, size, powers = 0, Fraction(1), [Fraction(0)] * 3
    if not left:
        raise SceneError("a unit is missing")
    while place < len(left):
        found = _PART.match(left, place)
        if found is None or found.end() == place:
            raise SceneError(f"{text!r} is no unit: {left[place:].strip()!r} is not understood")
        one_size, one_powers = _named(found["name"], text)
        power = int(found["power"] or 1) * (-1 if "/" in found["mark"] else 1)
        size *= one_size**power
        powers = [total + power * one for total, one in zip(powers, one_powers, strict=True)]
        place = found.end()
    return Unit(text.strip(), size, (powers[0], powers[1], powers[2]))


def _named(name: str, text: str) -> tuple[Fraction, tuple[int, int, int]]:
    """Size, exact, and powers of a unit, with a prefix or without."""
    size, powers = WHOLE.get(name) or UNITS.get(name) or ("0", (0, 0, 0))
    if size != "0":
        return Fraction(size), powers
    if name[:1] in PREFIXES and name[1:] in UNITS:
        size, powers = UNITS[name[1:]]
        return Fraction(size) * Fraction(10) ** PREFIXES[name[:1]], powers
    raise SceneError(f"{text!r} is no unit: {name!r} is not known{suggestion(name, NAMES)}")


def quantity(what: str, value: Any, powers: Powers | None) -> float:
    """Number in SI units of a number with a unit, "50 um", or of a quantity of pint; a plain number stays as it is.

    Parameters
    ----------
    what : str
        What it is, for messages.
    value : number, str or quantity
    powers : of mass, length and time, that it must have; None for any

    Raises
    ------
    SceneError
        If it is no number, its unit is unknown, or of another dimension.
    """
    if isinstance(value, str):
        found = _NUMBER.fullmatch(value)
        if found is None:
            raise SceneError(f"{what}: {value!r} is no number with a unit, as 50 um")
        if not found[2].strip():
            return float(found[1])
        try:
            unit = read_unit(found[2])
        except SceneError as error:
            raise SceneError(f"{what} = {value!r}: {error}") from None
        require_powers(f"{what} = {value!r}", unit.powers, powers)
        return float(Fraction(found[1]) * unit.size)  # rounded once: 50 um is 5e-5
    if _is_quantity(value):
        return float(_of_pint(what, value, powers))
    if isinstance(value, bool) or (not isinstance(value, (int, float)) and not hasattr(value, "__float__")):
        raise SceneError(f"{what} must be a number, or one with a unit, not {value!r}")
    number = float(value)
    if not math.isfinite(number):
        raise SceneError(f"{what} must be finite, not {value!r}")
    return number


def _is_quantity(value: Any) -> bool:
    return hasattr(value, "to_base_units") and hasattr(value, "units")


def _of_pint(what: str, value: Any, powers: Powers | None) -> Any:
    """Number, or array, in SI units of a quantity of pint."""
    base = value.to_base_units()
    found = {str(name): Fraction(power).limit_denominator(1000) for name, power in base.unit_items()}
    names = {"kilogram": 0, "gram": 0, "meter": 1, "second": 2, "radian": None}
    unknown = [name for name in found if name not in names]
    if unknown:
        raise SceneError(f"{what} = {value}: {', '.join(unknown)} is no unit of mass, length or time")
    own = [Fraction(0)] * 3
    for name, power in found.items():
        place = names[name]
        if place is not None:
            own[place] += power
    require_powers(f"{what} = {value}", (own[0], own[1], own[2]), powers)
    grams = float(found.get("gram", 0))  # of a registry whose base is not SI's
    return base.magnitude * 1e-3**grams if grams else base.magnitude


#: Of a dimension in words: force, length and time in mass, length and time.
WORDS: dict[str, tuple[int, int, int]] = {"force": (1, 1, -2), "length": (0, 1, 0), "time": (0, 0, 1)}


def powers_of(dimension: str) -> Powers:
    """Powers of a dimension as keys tell it: "force time^2/length^4", "1/time"."""
    total = [Fraction(0)] * 3
    for k, part in enumerate(dimension.split("/")):
        for factor in part.split():
            name, _, power = factor.partition("^")
            for i, one in enumerate(WORDS.get(name, (0, 0, 0))):
                total[i] += one * int(power or 1) * (-1 if k else 1)
    return total[0], total[1], total[2]


def plain(what: str, value: Any, powers: Powers | None) -> Any:
    """What is given, with each quantity in it as a number in SI units; all else stays as it is.

    A text is a quantity if a number stands before a word, "50 um"; else it may be an expression.

    Parameters
    ----------
    what : str
        Name of the key, for errors.
    value : Any
    powers : Powers, optional
        Of the dimension that is needed.

    Raises
    ------
    SceneError
        If a unit is unknown, or of another dimension.
    """
    if isinstance(value, str):
        found = _NUMBER.fullmatch(value)
        named = found is not None and (found[2][:1].isalpha() or found[2][:1] == "%")
        return quantity(what, value, powers) if named else value
    if _is_quantity(value):
        return _of_pint(what, value, powers)
    if isinstance(value, (list, tuple)) and any(_may_hold(one) for one in value):
        made = [plain(what, one, powers) for one in value]
        return made if isinstance(value, list) else tuple(made)
    if isinstance(value, Mapping) and "file" not in value:
        return {name: plain(f"{what} {name}", one, powers) for name, one in value.items()}
    return value


def _may_hold(value: Any) -> bool:
    """Whether there may be a quantity in it: long lists of numbers are not gone through."""
    return isinstance(value, (str, list, tuple, Mapping)) or _is_quantity(value)


def require_powers(what: str, powers: Powers, wanted: Powers | None) -> None:
    """Refuse a unit of another dimension.

    Parameters
    ----------
    what : str
        What has the unit, for errors.
    powers : Powers
        Of its dimension.
    wanted : Powers, optional
        Of the dimension that is needed.

    Raises
    ------
    SceneError
    """
    if wanted is not None and powers != wanted:
        raise SceneError(f"{what} is in {in_base_units(powers)}, and {in_base_units(wanted)} is needed")


def in_base_units(powers: Powers) -> str:
    """Powers as a unit, as "kg m^-1 s^-2"; the common ones by their names."""
    for name in ("m", "s", "N", "N/m", "Pa", "Pa s", "J", "m/s", "1/s", "N/s"):
        if read_unit(name).powers == powers:
            return name
    parts = [
        name if power == 1 else f"{name}^{power}" for name, power in zip(("kg", "m", "s"), powers, strict=True) if power
    ]
    return " ".join(parts) or "a number without a unit"
