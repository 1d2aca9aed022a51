"""Quantities with units, as people write them: "50 um", "1 mN/m", "0.89 mPa s"; all in SI units.

A small table of SI's units and prefixes, and of those of the CGS system that rheologists use, is all that scenes and
measured data take: lengths, times, masses and their products. There is no temperature, no current. Quantities of pint,
and of packages like it, are taken as they are.
"""

from __future__ import annotations

import math
import re
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
    if hasattr(value, "to_base_units") and hasattr(value, "units"):
        base = value.to_base_units()
        unit = read_unit(f"{base.units:~C}" or "1") if not base.dimensionless else read_unit("1")
        require_powers(f"{what} = {value}", unit.powers, powers)
        return float(Fraction(float(base.magnitude)) * unit.size)
    if isinstance(value, bool) or (not isinstance(value, (int, float)) and not hasattr(value, "__float__")):
        raise SceneError(f"{what} must be a number, or one with a unit, not {value!r}")
    number = float(value)
    if not math.isfinite(number):
        raise SceneError(f"{what} must be finite, not {value!r}")
    return number


def require_powers(what: str, powers: Powers, wanted: Powers | None) -> None:
    """Refuse a unit of another dimension.

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
