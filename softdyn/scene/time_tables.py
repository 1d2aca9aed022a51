"""Tables of what is given over time: from files, results of earlier runs, or arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.scene.pair_quantities import QUANTITIES
from softdyn.tables import Column, read_columns


@dataclass(frozen=True)
class Table:
    """What is given at rising times, linear in between: arrays of one length, times and values.

    A time that comes twice is a jump, from the first value to the second.
    """

    t: NDArray[np.float64]
    F: NDArray[np.float64]


#: What changes in time: a number, an expression of t, a table, or a pair of arrays (t, values).
OverTime = float | str | Table | tuple[Any, Any] | list[Any]


def read_table(path: str | Path, name: str = "value", also: Sequence[str] = ()) -> Table:
    """Read a table of what is given over time: two columns, by their headings, or time and then value without any.

    Parameters
    ----------
    path : str or Path
        Of the table, or of a result of two particles (.npz, .json), of which the column is taken.
    name : str
        Heading of the values.
    also : sequence of str
        Other headings that they may have, besides "value".

    Returns
    -------
    Table

    Raises
    ------
    SceneError
        Naming the column or the line at fault.
    """
    if Path(path).suffix in (".npz", ".json") and Path(path).is_file():
        return _table_of_result(Path(path), name, also)
    known = (Column("time", ("t",)), Column(name, tuple(also) if name == "value" else (*also, "value")))
    read = read_columns(path, "table", known, order=("time", name), besides=("h", "delta", *QUANTITIES))
    t = read["time"]
    if len(t) < 2:
        raise SceneError(f"table {path}: at least two rows of time and {name} are needed, and {len(t)} found")
    steps = np.diff(t)
    back = steps < 0
    back[1:] |= (steps[1:] == 0) & (steps[:-1] == 0)
    if back.any():
        row = int(np.argmax(back)) + 1
        more = " (twice is a jump, more is nothing)" if steps[row - 1] == 0 else ""
        raise SceneError(f"{read.at(row)}: time {t[row]:.17g} does not come after {t[row - 1]:.17g}{more}")
    return Table(t, read[name])


def _table_of_result(path: Path, name: str, also: Sequence[str]) -> Table:
    """What a saved result of two particles says of a quantity over time."""
    from softdyn.results.pair_result import PairResult
    from softdyn.results.registry import load_result

    result = load_result(path)
    if not isinstance(result, PairResult):
        raise SceneError(f"{path} holds a run of many particles; a table of time and {name} is needed")
    held = [quantity for quantity in also if quantity in result.arrays]
    if not held:
        wanted = [quantity for quantity in also if quantity in QUANTITIES]
        quantity = f" ({wanted[0]})" if wanted else ""
        raise SceneError(f"the result {path} holds no {name}{quantity}; it holds {', '.join(result.arrays)}")
    return table_of(name, result.t, result.arrays[held[0]])


def table_of(name: str, t: Any, F: Any) -> Table:
    """Table from a pair of arrays.

    Parameters
    ----------
    name : str
        Of the key, for errors.
    t : array, shape (rows,)
        Times.
    F : array, shape (rows,)
        Values.

    Raises
    ------
    SceneError
        If they are not of one length, times do not rise, or a number is not finite.
    """
    try:
        table = Table(np.array(t, dtype=float), np.array(F, dtype=float))
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name}: a table is a pair of arrays of numbers, (t, values)") from None
    if table.t.ndim != 1 or table.t.shape != table.F.shape or len(table.t) < 2:
        found = " and ".join(str(len(values)) if values.ndim == 1 else f"{values}" for values in (table.t, table.F))
        raise SceneError(
            f"[drive] {name}: a table is two lists of one length, 2 at least, times and values, not {found}; many runs "
            "at once take their values as a numpy array"
        )
    steps = np.diff(table.t)
    rising = (steps >= 0).all() and not (np.diff(np.flatnonzero(steps == 0)) == 1).any()
    if not (np.isfinite(table.t).all() and np.isfinite(table.F).all() and rising):
        raise SceneError(f"{name}: a table's times must increase, or come twice at a jump, and its numbers be finite")
    # a row that repeats the value before and after it says nothing; steps would have to end there
    tells = np.ones(len(table.t), dtype=bool)
    tells[1:-1] = (table.F[1:-1] != table.F[:-2]) | (table.F[1:-1] != table.F[2:])
    return Table(table.t[tells], table.F[tells])
