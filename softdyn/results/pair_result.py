"""What a run of two particles gives."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.results.origin import Origin, about, origin_in
from softdyn.results.result import Result, dataset, table, write_table
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset


SUFFIXES = (".json", ".npz", ".csv", ".nc")
ENDINGS = f"of a run of two particles the ending must be one of {', '.join(SUFFIXES)}; .gsd and .pvd are for many"


@dataclass(frozen=True)
class Event:
    """What happened on the way: what it was, when, and the gap and the deflection there."""

    what: str
    t: float
    h: float
    delta: float


@dataclass(frozen=True, repr=False)
class PairResult(Result):
    """What a run of two particles gave; all numbers in the units of the scene's parameters.

    Attributes
    ----------
    law, target : str
    parameters : mapping from str to float
    arrays : mapping from str to array of shape (outputs,)
        ``t`` (time), ``h`` (gap, length), ``delta`` (deflection, length), and the quantities asked for: ``X``
        (distance of the centres, length), ``a`` (contact radius, length), ``F`` (force), ``dF_dt`` (force/time),
        ``zeta`` and ``D`` (force time/length), ``C`` (force/length), ``F_adh`` (force), ``dh_dt``, ``ddelta_dt``,
        ``dX_dt`` (length/time), ``lambda1`` and ``lambda2`` (dimensionless: local exponents of delta and dh/dt in h, at
        constant force).
        Each is an attribute, too: ``result.h`` is ``result.arrays["h"]``.
    stopped_by : str
        "h" or "t": which end was reached.
    stats : mapping
        ``method`` (what was done), ``steps``, ``rejected``, ``evaluations`` (of dh/dt), ``stiffness`` (largest step
        times rate of decay), ``error`` (estimated, of h, relative, the largest of all outputs; where these are not at
        given times, of t or of h, whichever is less), ``rtol`` (of the steps: below the scene's where errors grow on
        the way), ``force_residual`` (largest abs(F_ela - F_ext) relative to the largest force) or ``drift``
        (largest distance of X from where a position or a spring has it, over R), ``wall_s``, ``compile_s`` (deriving,
        compiling and loading), ``kernel`` (its key).
    warnings : tuple of str
    events : tuple of Event
        Where steps had to end, in order: rows of a table, the force crossing zero, a film reached, the gap of the end.
    origin : Origin, optional
        By what it was made; None of results that earlier versions have saved.
    """

    kind: ClassVar[str] = "pair"
    law: str
    target: str
    parameters: Mapping[str, float]
    arrays: Mapping[str, NDArray[np.float64]]
    stopped_by: str
    stats: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    events: tuple[Event, ...] = ()
    origin: Origin | None = None

    def __repr__(self) -> str:
        t, h = self.arrays["t"], self.arrays["h"]
        return f"<PairResult of {self.law}: {len(t)} outputs up to t={t[-1]:.6g}, h={h[-1]:.6g}>"

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data, the arrays as lists."""
        return {
            "status": "success",
            "kind": self.kind,
            **about(self.origin),
            "law": self.law,
            "target": self.target,
            "parameters": dict(self.parameters),
            "stopped_by": self.stopped_by,
            **{name: [_json_number(value) for value in values] for name, values in self.arrays.items()},
            "stats": dict(self.stats),
            "warnings": list(self.warnings),
            "events": [vars(event) for event in self.events],
        }

    def save(self, path: str | Path) -> Path:
        """Write to a .json, .npz, .csv or .nc file (netCDF); see :func:`softdyn.load_result`.

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written; then nothing is left behind.
        """
        path = Path(path)
        if path.suffix not in SUFFIXES:
            raise SceneError(f"cannot save to {path}: {ENDINGS}")
        if path.suffix == ".nc":
            write_table(self, path)
            return path
        with written_whole(path) as temporary:
            if path.suffix == ".json":
                temporary.write_text(json.dumps(self.to_dict()) + "\n", encoding="utf-8")
            elif path.suffix == ".npz":
                rest = {key: value for key, value in self.to_dict().items() if key not in self.arrays}
                with temporary.open("wb") as file:
                    content: dict[str, Any] = {"about": np.array(json.dumps(rest)), **self.arrays}
                    np.savez(file, **content)
            else:
                columns = np.column_stack(list(self.arrays.values()))
                np.savetxt(temporary, columns, delimiter=",", header=",".join(self.arrays), comments="", fmt="%.17g")
        return path

    def plot(
        self, *, width: str | float = "page", panels: Sequence[str] | None = None, ax: Axes | None = None
    ) -> Figure:
        """Draw the gap and the deflection against time, and the local exponents against the gap.

        Parameters
        ----------
        width : "column", "page" or float
            The latter in inches.
        panels : sequence of str, optional
            Some of "h", "delta", "X", "F" and "exponents".
        ax : Axes, optional
            Takes a single one: see :func:`softdyn.pair.pair_plots.plot_pair`.
        """
        from softdyn.pair.pair_plots import plot_pair

        return plot_pair(self, width=width, panels=panels, ax=ax)

    def to_xarray(self) -> Dataset:
        """Everything over time as an xarray.Dataset; needs ``pip install 'softdyn[data]'``."""
        return dataset(self, dict.fromkeys(self.arrays, ("output",)))

    def to_pandas(self) -> DataFrame:
        """Everything over time as a pandas.DataFrame; needs ``pip install 'softdyn[data]'``."""
        return table(self.arrays)


def pair_from(content: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> PairResult:
    """Result from the content of a file.

    Raises
    ------
    ValueError, KeyError, TypeError
        If something is missing, or does not fit the rest.
    """
    arrays = {"t": arrays["t"], "h": arrays["h"], "delta": arrays["delta"], **arrays}
    for name, values in arrays.items():
        if values.dtype.kind != "f" or values.ndim != 1 or len(values) != len(arrays["t"]) or not len(values):
            raise ValueError(f"{name} has the shape {values.shape}, t the shape {arrays['t'].shape}")
    return PairResult(
        law=str(content["law"]),
        target=str(content["target"]),
        parameters={str(name): float(value) for name, value in content["parameters"].items()},
        arrays=arrays,
        stopped_by=str(content["stopped_by"]),
        stats=dict(content["stats"]),
        warnings=tuple(str(warning) for warning in content["warnings"]),
        events=tuple(
            Event(str(event["what"]), *(float(event[name]) for name in ("t", "h", "delta")))
            for event in content.get("events", ())
        ),
        origin=origin_in(content),
    )


def _json_number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
