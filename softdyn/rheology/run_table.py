"""One table of many runs: what was varied, and what was measured, a row for each."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.results.whole_files import written_whole
from softdyn.rheology.column_units import head_of, unit_of
from softdyn.rheology.kinds import Measured, kind_of
from softdyn.rheology.runs import Run

if TYPE_CHECKING:
    from xarray import Dataset

Array = NDArray[np.float64]

ENDINGS = (".csv", ".npz", ".nc")


@dataclass(frozen=True)
class RunTable:
    """A row for each run.

    Attributes
    ----------
    varied : mapping from str to array, shape (runs,)
    columns : mapping from str to array, shape (runs,)
        What was measured; nan of runs that failed, or that are missing.
    failed : mapping from int to str
        Why runs failed.
    missing : tuple of int
        Runs that are not made yet.
    notes : mapping from int to str
        What is to be known of single runs: why one is not steady.
    axes : mapping from str to array
        The values that each name was varied over; the runs are all combinations, the last name fastest.
    units : str
        "SI" if numbers are known to be in SI units: heads say so then.
    """

    varied: Mapping[str, Array]
    columns: Mapping[str, Array]
    failed: Mapping[int, str]
    missing: tuple[int, ...]
    notes: Mapping[int, str]
    axes: Mapping[str, Array]
    units: str = ""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def save(self, path: str | Path) -> Path:
        """Write to .csv, .npz, or .nc (netCDF; needs ``pip install 'softdyn[data]'``).

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written.
        """
        path = Path(path)
        if path.suffix not in ENDINGS:
            raise SceneError(f"cannot save to {path}: the ending of a table must be one of {', '.join(ENDINGS)}")
        with written_whole(path) as temporary:
            if path.suffix == ".nc":
                self.to_xarray().to_netcdf(temporary, engine="scipy")
            elif path.suffix == ".npz":
                about = {
                    "failed": dict(self.failed),
                    "missing": list(self.missing),
                    "notes": dict(self.notes),
                    "units": self.units,
                }
                content: dict[str, Any] = {
                    **{f"varied_{name}": values for name, values in self.varied.items()},
                    **self.columns,
                }
                with temporary.open("wb") as file:
                    np.savez(file, about=np.array(json.dumps(about)), **content)
            else:
                heads = [*(f"varied_{name}" for name in self.varied), *self.columns, "note"]
                lines = [",".join(head_of(name, self.units) for name in heads)]
                for run in range(len(self)):
                    values = [values[run] for values in (*self.varied.values(), *self.columns.values())]
                    note = self.failed.get(run) or self.notes.get(run, "")
                    note = "not made yet" if run in self.missing else note
                    quoted = '"' + " ".join(note.split()).replace('"', '""') + '"' if note else ""
                    lines.append(",".join([*(f"{value:.17g}" for value in values), quoted]))
                temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def to_xarray(self) -> Dataset:
        """As an xarray.Dataset over all that was varied; needs ``pip install 'softdyn[data]'``.

        Raises
        ------
        SceneError
            If xarray is missing.
        """
        try:
            from xarray import Dataset as Made
        except ImportError:
            raise SceneError("this needs xarray: pip install 'softdyn[data]'") from None
        names = {name: name.replace(".", "_") for name in self.axes}
        shape = tuple(len(values) for values in self.axes.values())
        besides = {name.replace(".", "_"): values for name, values in self.varied.items() if name not in names}
        data: dict[str, Any] = {
            name: (tuple(names.values()), values.reshape(shape), self._attributes(name))
            for name, values in {**besides, **self.columns}.items()
            if name not in names.values()
        }
        return Made(data, coords={names[name]: values for name, values in self.axes.items()})

    def _attributes(self, name: str) -> dict[str, str]:
        unit = unit_of(name) if self.units == "SI" else ""
        return {"units": unit} if unit else {}


def gathered(
    runs: Sequence[Run],
    axes: Mapping[str, Array],
    measured: Callable[[Any, Run], Measured],
) -> RunTable:
    """Gather the results of runs into one table.

    Parameters
    ----------
    runs : sequence of Run
        All combinations of ``axes``.
    axes : mapping from str to array, shape (values,)
    measured : function of a result and a Run
        Gives a mapping from names to numbers, and a note or "".
    """
    from softdyn.results.registry import load_result
    from softdyn.rheology.runs import states

    done, failed, missing = states(runs)
    rows: dict[int, Mapping[str, float]] = {}
    notes: dict[int, str] = {}
    units: set[str] = set()
    for run in done:
        result = load_result(run.result)
        units.add(result.units or "")
        rows[run.number], note = measured(result, run)
        if note:
            notes[run.number] = note
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    columns = {
        name: np.array([rows.get(run.number, {}).get(name, math.nan) for run in runs]) for name in names or ["t_end"]
    }
    varied = {name: np.array([run.values[name] for run in runs]) for name in runs[0].values}
    return RunTable(varied, columns, failed, tuple(missing), notes, dict(axes), units.pop() if len(units) == 1 else "")


def measured_run(result: Any, run: Run) -> Measured:
    """What is told of a run by itself; see :mod:`softdyn.rheology.measured_runs`."""
    return kind_of(run.content).measured(result)
