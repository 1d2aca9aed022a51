"""Curves of many runs, each over its own times: one long table."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.results.whole_files import written_whole
from softdyn.rheology.column_units import head_of
from softdyn.rheology.run_table import ENDINGS
from softdyn.rheology.runs import Run, states

if TYPE_CHECKING:
    from xarray import Dataset

    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curves:
    """What was measured over time, of each run.

    Attributes
    ----------
    varied : mapping from str to array, shape (runs,)
    curves : mapping from int to mapping from str to array
        Of each run that is done, by its number: columns of one length.
    failed, missing, units
        As of :class:`softdyn.rheology.run_table.RunTable`.
    """

    varied: Mapping[str, Array]
    curves: Mapping[int, Mapping[str, Array]]
    failed: Mapping[int, str]
    missing: tuple[int, ...]
    units: str = ""

    def words(self, run: int) -> str:
        """What was varied, of a run."""
        return ", ".join(f"{name} = {values[run]:g}" for name, values in self.varied.items())

    def table(self) -> dict[str, Array]:
        """All curves below one another: the run, what was varied, and the columns."""
        numbers = list(self.curves)
        sizes = [len(next(iter(self.curves[number].values()))) for number in numbers]
        found = {"run": np.repeat(np.array(numbers, dtype=float), sizes)}
        found |= {f"varied_{name}": np.repeat(values[numbers], sizes) for name, values in self.varied.items()}
        names = list(next(iter(self.curves.values()))) if numbers else []
        return found | {name: np.concatenate([self.curves[number][name] for number in numbers]) for name in names}

    def to_xarray(self) -> Dataset:
        """As an xarray.Dataset of one dimension, the rows; needs ``pip install 'softdyn[data]'``.

        Raises
        ------
        SceneError
        """
        try:
            from xarray import Dataset as Made
        except ImportError:
            raise SceneError("this needs xarray: pip install 'softdyn[data]'") from None
        return Made({name.replace(".", "_"): ("row", values) for name, values in self.table().items()})

    def save(self, path: Path) -> Path:
        """Write to .csv, .npz or .nc.

        Raises
        ------
        SceneError
        """
        if path.suffix not in ENDINGS:
            raise SceneError(f"cannot save to {path}: the ending of a table must be one of {', '.join(ENDINGS)}")
        table = self.table()
        with written_whole(path) as temporary:
            if path.suffix == ".nc":
                self.to_xarray().to_netcdf(temporary, engine="scipy")
            elif path.suffix == ".npz":
                about = {"failed": dict(self.failed), "missing": list(self.missing)}
                with temporary.open("wb") as file:
                    np.savez(file, **{"about": np.array(json.dumps(about)), **table})  # type: ignore[arg-type]
            else:
                heads = ",".join(head_of(name, self.units) for name in table)
                rows = np.column_stack(list(table.values()))
                np.savetxt(temporary, rows, delimiter=",", header=heads, comments="", fmt="%.17g")
        return path


def gathered_curves(
    runs: Sequence[Run], axes: Mapping[str, Array], measured: Callable[[ParticleResult, Run], Mapping[str, Array]]
) -> Curves:
    """Gather the curves of runs that are done.

    Parameters
    ----------
    runs : sequence of Run
    axes : mapping from str to array
        What is varied, and its values.
    measured : function of a result and its run
        Columns of the curve of a run, shape (points,) each.
    """
    from softdyn.particles.results import load_particles

    done, failed, missing = states(runs)
    units: set[str] = set()
    curves: dict[int, Mapping[str, Array]] = {}
    for run in done:
        result = load_particles(run.result)
        units.add(result.units or "")
        curves[run.number] = measured(result, run)
    varied = {name: np.array([run.values[name] for run in runs]) for name in axes}
    return Curves(varied, curves, failed, tuple(missing), units.pop() if len(units) == 1 else "")
