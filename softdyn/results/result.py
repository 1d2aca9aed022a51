"""What the results of every kind of run can do."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.results.origin import Origin
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

#: Endings of tables that any result is written to.
TABLES = (".csv", ".nc")


class Result:
    """A result with named arrays, each of which is an attribute, too."""

    kind: ClassVar[str]
    law: str
    target: str
    parameters: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    origin: Origin | None

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name != "arrays" and name in self.arrays:
            return self.arrays[name]
        there = ", ".join(self.arrays) if name != "arrays" else ""
        raise AttributeError(f"the result has no {name!r}; its arrays are {there}")

    @property
    def units(self) -> str | None:
        """The units of all numbers, "SI", where the scene tells: by ``units``, or by a number with one."""
        scene = None if self.origin is None else self.origin.scene
        return scene.get("units") if isinstance(scene, Mapping) else getattr(scene, "units", None)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.arrays})

    def __len__(self) -> int:
        return len(self.arrays["t"])

    def plot(self) -> Figure:
        """Draw the run."""
        raise NotImplementedError

    def save(self, path: str | Path) -> Path:
        """Write to a file."""
        raise NotImplementedError

    def _repr_png_(self) -> bytes | None:
        """The picture that a notebook shows; None if there is nothing to draw."""
        if not len(self):
            return None
        file = BytesIO()
        self.plot().savefig(file, format="png", dpi=100)
        return file.getvalue()


def dataset(result: Result, dimensions: Mapping[str, tuple[str, ...]]) -> Dataset:
    """Return the arrays as an xarray.Dataset, over time ``t``, with law, target and parameters as attributes.

    Parameters
    ----------
    result : Result
    dimensions : mapping from str to tuple of str
        Names of the dimensions of each array.

    Raises
    ------
    SceneError
        If xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise SceneError("to_xarray needs xarray: pip install 'softdyn[data]'") from None
    numbers = {f"parameter_{name}": value for name, value in result.parameters.items() if isinstance(value, float)}
    variables = {name: (dimensions[name], array) for name, array in result.arrays.items() if name != "t"}
    over = {"t": (dimensions["t"], result.arrays["t"])}
    return xarray.Dataset(variables, over, {"law": result.law, "target": result.target, **numbers})


def table(columns: Mapping[str, NDArray[Any]]) -> DataFrame:
    """Return columns over time as a pandas.DataFrame with the index t.

    Raises
    ------
    SceneError
        If pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise SceneError("to_pandas needs pandas: pip install 'softdyn[data]'") from None
    index = pandas.Index(np.asarray(columns["t"]), name="t")
    return pandas.DataFrame({name: column for name, column in columns.items() if name != "t"}, index=index)


def write_table(result: Result, path: Path) -> None:
    """Write a .csv, what is one number at a time, or a .nc (netCDF), everything but arrays that are empty.

    Parameters
    ----------
    result : Result
        With ``to_pandas`` and ``to_xarray``.
    path : Path

    Raises
    ------
    SceneError
        If pandas or xarray is missing, or the file cannot be written.
    """
    made: Any = result
    written = made.to_xarray() if path.suffix == ".nc" else made.to_pandas()
    with written_whole(path) as temporary:
        if path.suffix == ".nc":
            # a dimension of length 0 means another thing in netCDF
            empty = [name for name, variable in written.variables.items() if 0 in variable.shape]
            written.drop_vars(empty).to_netcdf(temporary, engine="scipy")
        else:
            written.to_csv(temporary)
