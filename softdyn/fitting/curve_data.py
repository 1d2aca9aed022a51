"""What was measured: columns of a file, or arrays by name, in one set of units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.scene.units import Powers, read_unit, require_powers
from softdyn.tables import Column, headings_of, read_columns
from softdyn.words import listed

Array = NDArray[np.float64]


def powers(mass: int, length: int, time: int) -> Powers:
    """Powers of mass, length and time.

    Parameters
    ----------
    mass, length, time : int
        Exponents of a unit.
    """
    return Fraction(mass), Fraction(length), Fraction(time)


TIME, LENGTH, FORCE, NUMBER = powers(0, 0, 1), powers(0, 1, 0), powers(1, 1, -2), powers(0, 0, 0)
VELOCITY, STIFFNESS, RATE, PRESSURE = powers(0, 1, -1), powers(1, 0, -2), powers(0, 0, -1), powers(1, -1, -2)

#: What a column of a pair can be, with its other headings and its dimension.
PAIR_COLUMNS: dict[str, tuple[tuple[str, ...], Powers]] = {
    "t": (("time",), TIME),
    "h": (("gap", "separation"), LENGTH),
    "X": (("distance",), LENGTH),
    "delta": (("deflection",), LENGTH),
    "a": ((), LENGTH),
    "F": (("force",), FORCE),
}
#: Of a flow curve.
FLOW_COLUMNS: dict[str, tuple[tuple[str, ...], Powers]] = {
    "rate": (("shear_rate", "shear rate", "gamma_dot"), RATE),
    "stress": (("shear_stress", "shear stress", "sigma", "tau"), PRESSURE),
}
#: Behind a heading: the standard error of each value.
ERROR = "_error"

_UNIT = re.compile(r"\s*(?:\(([^()]*)\)|\[([^\[\]]*)\])\s*$")


@dataclass(frozen=True)
class CurveData:
    """A curve that was measured.

    Attributes
    ----------
    name : str
        Of the file, or what stands for it.
    columns : mapping from str to array, shape (points,)
        Where a unit was given, in SI units; else as they are.
    with_units : tuple of str
        Columns whose unit was given.
    """

    name: str
    columns: Mapping[str, Array]
    with_units: tuple[str, ...]

    def measured(self, quantities: Sequence[str]) -> tuple[str, ...]:
        """Those of some quantities that were measured."""
        return tuple(name for name in quantities if name in self.columns)


def read_curve(
    given: Any, number: int, known: Mapping[str, tuple[tuple[str, ...], Powers]], also: Mapping[str, Powers]
) -> CurveData:
    """Read a curve.

    Parameters
    ----------
    given : path of a table, or mapping from str to array
        Headings and keys may have units, "F [nN]".
    number : int
        Of the curve, which names it where there is no file.
    known : mapping from str to (other headings, dimension)
        Columns that it may have; and each with its standard error, as F_error.
    also : mapping from str to dimension
        Other columns that are needed, by their headings.

    Raises
    ------
    SceneError
        If it cannot be read, if a column is missing, a unit unknown or of another dimension.
    """
    columns = [Column(name, other, needed=False) for name, (other, _) in known.items()]
    columns += [Column(name + ERROR, needed=False) for name in known]
    columns += [Column(name) for name in also if name not in known]
    dimensions = {**{name: of for name, (_, of) in known.items()}, **also}
    dimensions |= {name + ERROR: of for name, of in dimensions.items()}
    if isinstance(given, (str, Path)):
        left = headings_of(given, "data", columns)
        if not left:
            raise SceneError(
                f"data {given}: the first line must name the columns, as t [s], F [nN]; there may be "
                f"{', '.join(known)}, each with its standard error, as {list(known)[-1]}{ERROR}"
            )
        read = read_columns(given, "data", columns, besides=left)
        return _in_one_set(Path(given).name, dict(read.values), read.units, dimensions)
    if not hasattr(given, "keys"):
        raise SceneError(f"data must be the path of a table, or arrays by their names, not {given!r}")
    return _from_arrays(given, number, columns, dimensions)


def _from_arrays(
    given: Mapping[str, Any], number: int, columns: Sequence[Column], dimensions: Mapping[str, Powers]
) -> CurveData:
    """The same from arrays by name."""
    arrays: dict[str, Array] = {}
    units: dict[str, str] = {}
    faults = []
    names = {name: column.name for column in columns for name in (column.name, *column.also)}
    for key in given.keys():  # noqa: SIM118 - a DataFrame iterates so alone
        unit = _UNIT.search(str(key))
        heading = _UNIT.sub("", str(key)).strip()
        if heading not in names:
            continue
        name = names[heading]
        try:
            arrays[name] = np.array(given[key], dtype=float)
        except (TypeError, ValueError):
            faults.append(f"{heading} is no array of numbers")
            continue
        if arrays[name].ndim != 1 or not np.isfinite(arrays[name]).all():
            faults.append(f"{heading} must be one row of finite numbers, and has the shape {arrays[name].shape}")
        if unit:
            units[name] = unit[1] or unit[2]
    faults += [f"{column.name} is missing" for column in columns if column.needed and column.name not in arrays]
    lengths = {name: len(array) for name, array in arrays.items() if array.ndim == 1}
    if len(set(lengths.values())) > 1:
        faults.append(f"columns are of one length, and here {', '.join(f'{n} of {k}' for k, n in lengths.items())}")
    if faults:
        raise SceneError(f"data {number}: {listed(faults)}")
    return _in_one_set(f"curve {number}", arrays, units, dimensions)


def _in_one_set(
    name: str, columns: dict[str, Array], units: Mapping[str, str], dimensions: Mapping[str, Powers]
) -> CurveData:
    """Columns in SI units, where their units are known."""
    for column, text in units.items():
        try:
            unit = read_unit(text)
            require_powers(f"{column} [{text}]", unit.powers, dimensions[column])
        except SceneError as error:
            raise SceneError(f"data {name}, column {column}: {error}") from None
        columns[column] = columns[column] * float(unit.size)
    bad = [column for column, values in columns.items() if column.endswith(ERROR) and not (values > 0).all()]
    if bad:
        raise SceneError(f"data {name}: standard errors must be positive, and {', '.join(bad)} is not everywhere")
    return CurveData(name, columns, tuple(units))
