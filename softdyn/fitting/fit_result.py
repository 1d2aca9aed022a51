"""What a fit gives."""

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
from softdyn.results.origin import Origin
from softdyn.results.result import Result
from softdyn.results.whole_files import written_whole
from softdyn.words import in_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SUFFIXES = (".json", ".npz", ".csv")
#: Correlations that are told.
HIGH = 0.9
#: How many of them at most.
MOST_TOLD = 6


@dataclass(frozen=True, repr=False)
class Fit(Result):
    """A law fitted to data; numbers are in SI units where the data have units, else in theirs.

    Attributes
    ----------
    law, target : str
    parameters : mapping from str to float
        What was not fitted.
    names : tuple of str
        What was.
    values, errors : mapping from str to float
        Of the fitted parameters, with standard errors.
    intervals : mapping from str to (low, high)
        Within which each is with a probability of 95 %: by its profile, where there is one; infinite, or 0, where the
        data set no bound.
    covariance : array, shape (names, names)
        Of the values; ``correlation`` likewise.
    chi2, dof : float, int
        Sum of the squares of what is left, in standard errors of the data; points less parameters.
    undetermined : tuple of str
        Combinations of parameters that the data do not determine, in words and figures, and what is known of them.
    warnings : tuple of str
    about : mapping
        ``curves``: of each its name, its abscissa and the quantities that were compared; ``loss``; ``evaluations``;
        ``estimated``: whether errors of the data were estimated from the residuals; ``units`` of the parameters;
        ``linear``: those that were not fitted by their logarithm.
    arrays : mapping from str to array
        Of curve 1 ``t_1``, or ``rate_1``; of each quantity, as F, ``F_1`` (measured), ``F_1_fit``, ``F_1_error``
        (standard error, given or estimated); of a profile ``profile_NAME`` and ``profile_NAME_chi2`` (its rise).
    """

    kind: ClassVar[str] = "fit"
    law: str
    target: str
    parameters: Mapping[str, float]
    names: tuple[str, ...]
    values: Mapping[str, float]
    errors: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    covariance: Array
    chi2: float
    dof: int
    undetermined: tuple[str, ...]
    warnings: tuple[str, ...]
    about: Mapping[str, Any]
    arrays: Mapping[str, Array]
    origin: Origin | None = None

    @property
    def correlation(self) -> Array:
        """Correlations of the fitted parameters."""
        spread = np.sqrt(np.diag(self.covariance))
        found: Array = self.covariance / np.outer(spread, spread)
        return found

    def __len__(self) -> int:
        return sum(len(self.arrays[f"{name}_{n}"]) for n, curve in self._curves() for name in curve["quantities"])

    def __repr__(self) -> str:
        found = ", ".join(f"{name} = {value_and_error(self.values[name], self.errors[name])}" for name in self.names)
        return f"<Fit of {self.law}: {found}>"

    def __str__(self) -> str:
        what = ", ".join(f"{curve['name']} ({', '.join(curve['quantities'])})" for _, curve in self._curves())
        quality = f"chi2/dof = {self.chi2 / self.dof:.3g}" if self.dof and not self.about["estimated"] else ""
        quality = quality or "errors of the data estimated from what is left"
        units = self.about.get("units", {})
        rows = [("", "value", "error", "", "95 %", "")]
        for name in self.names:
            value, error, (low, high) = self.values[name], self.errors[name], self.intervals[name]
            part = f"{100 * error / abs(value):.2g} %" if value else ""
            rows.append(
                (f"  {name}", f"{value:.5g}", f"{error:.2g}", part, f"{low:.4g} .. {high:.4g}", units.get(name, ""))
            )
        lines = [
            f"Fit of {self.law} to {what}: {len(self)} points, {len(self.names)} parameters, {quality}",
            *(line.rstrip() for line in in_columns(rows).splitlines()),
        ]
        told = self._correlated()
        lines += [f"  correlated: {', '.join(told)}"] if told else []
        lines += [f"  not determined: {words}" for words in self.undetermined]
        lines += [f"  warning: {words}" for words in self.warnings]
        return "\n".join(lines)

    def _curves(self) -> list[tuple[int, Mapping[str, Any]]]:
        return list(enumerate(self.about["curves"], start=1))

    def _correlated(self) -> list[str]:
        found = []
        correlation = self.correlation
        for i, first in enumerate(self.names):
            for j in range(i):
                if abs(correlation[i, j]) >= HIGH:
                    found.append((abs(float(correlation[i, j])), f"{self.names[j]}, {first} {correlation[i, j]:+.3f}"))
        told = [words for _, words in sorted(found, reverse=True)]
        return [*told[:MOST_TOLD], *([f"{len(told) - MOST_TOLD} more"] if len(told) > MOST_TOLD else [])]

    def plot(self) -> Figure:
        """Draw data and fit, what is left, and the profiles."""
        from softdyn.fitting.fit_plots import plot_fit

        return plot_fit(self)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data, the arrays as lists."""
        return {**self._told(), **{name: _plain(values.tolist()) for name, values in self.arrays.items()}}

    def _told(self) -> dict[str, Any]:
        return {
            "status": "success",
            "kind": self.kind,
            "law": self.law,
            "target": self.target,
            "parameters": dict(self.parameters),
            "names": {"fitted": list(self.names)},
            "values": dict(self.values),
            "errors": {name: _plain(error) for name, error in self.errors.items()},
            "intervals": {name: _plain(list(ends)) for name, ends in self.intervals.items()},
            "covariance": {"rows": _plain(self.covariance.tolist())},
            "chi2": self.chi2,
            "dof": self.dof,
            "undetermined": {"words": list(self.undetermined)},
            "warnings": list(self.warnings),
            "about": dict(self.about),
        }

    def save(self, path: str | Path) -> Path:
        """Write to a .json or .npz file, which :func:`softdyn.load_result` reads, or parameters to a .csv.

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written; then nothing is left behind.
        """
        path = Path(path)
        if path.suffix not in SUFFIXES:
            raise SceneError(f"cannot save to {path}: of a fit the ending must be one of {', '.join(SUFFIXES)}")
        with written_whole(path) as temporary:
            if path.suffix == ".json":
                temporary.write_text(json.dumps(self.to_dict()) + "\n", encoding="utf-8")
            elif path.suffix == ".npz":
                with temporary.open("wb") as file:
                    content: dict[str, Any] = {"about": np.array(json.dumps(self._told())), **self.arrays}
                    np.savez(file, **content)
            else:
                rows = ["name,value,error,low,high"]
                rows += [
                    ",".join(
                        [name, *(f"{x:.17g}" for x in (self.values[name], self.errors[name], *self.intervals[name]))]
                    )
                    for name in self.names
                ]
                temporary.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return path


def value_and_error(value: float, error: float) -> str:
    """A value and its standard error, to the digits that are known."""
    if not (math.isfinite(error) and error > 0):
        return f"{value:.4g}"
    digits = max(1, min(15, math.floor(math.log10(abs(value) / error)) + 2)) if value else 1
    return f"{value:.{digits}g} +- {error:.1g}"


def _plain(value: Any) -> Any:
    """Numbers as JSON has them: what is not finite as a word."""
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return value if math.isfinite(value) else str(value)


def _number(value: Any) -> float:
    return float(value)


def fit_from(content: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Fit:
    """Fit from the content of a file.

    Raises
    ------
    ValueError, KeyError, TypeError
        If something is missing, or does not fit the rest.
    """
    names = tuple(str(name) for name in content["names"]["fitted"])
    covariance = np.array([[_number(x) for x in row] for row in content["covariance"]["rows"]])
    if covariance.shape != (len(names), len(names)):
        raise ValueError(f"the covariance has the shape {covariance.shape}, of {len(names)} parameters")
    curves: Sequence[Mapping[str, Any]] = content["about"]["curves"]
    missing = [
        key
        for n, curve in enumerate(curves, start=1)
        for key in (f"{curve['abscissa']}_{n}", *(f"{name}_{n}" for name in curve["quantities"]))
        if key not in arrays
    ]
    if missing:
        raise KeyError(missing[0])
    return Fit(
        law=str(content["law"]),
        target=str(content["target"]),
        parameters={str(name): float(value) for name, value in content["parameters"].items()},
        names=names,
        values={name: float(content["values"][name]) for name in names},
        errors={name: _number(content["errors"][name]) for name in names},
        intervals={
            name: (_number(content["intervals"][name][0]), _number(content["intervals"][name][1])) for name in names
        },
        covariance=covariance,
        chi2=float(content["chi2"]),
        dof=int(content["dof"]),
        undetermined=tuple(str(words) for words in content["undetermined"]["words"]),
        warnings=tuple(str(words) for words in content["warnings"]),
        about=dict(content["about"]),
        arrays={name: np.asarray(values, dtype=float) for name, values in arrays.items()},
    )
