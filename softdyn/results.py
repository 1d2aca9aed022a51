"""Results of a run: arrays, statistics, and files that are written whole or not at all."""

from __future__ import annotations

import json
import math
import os
import secrets
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.archive import read_arrays, read_json
from softdyn.errors import SceneError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softdyn.particles.results import ParticleResult

SUFFIXES = (".json", ".npz", ".csv")
ENDINGS = f"of a run of two particles the ending must be one of {', '.join(SUFFIXES)}; .gsd and .pvd are for many"


@dataclass(frozen=True)
class Event:
    """What happened on the way: what it was, when, and the gap and the deflection there."""

    what: str
    t: float
    h: float
    delta: float


@dataclass(frozen=True)
class PairResult:
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
    """

    law: str
    target: str
    parameters: Mapping[str, float]
    arrays: Mapping[str, NDArray[np.float64]]
    stopped_by: str
    stats: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    events: tuple[Event, ...] = ()

    def __getattr__(self, name: str) -> NDArray[np.float64]:
        if name != "arrays" and name in self.arrays:
            return self.arrays[name]
        there = ", ".join(self.arrays) if name != "arrays" else ""
        raise AttributeError(f"the result has no {name!r}; its arrays are {there}")

    def __len__(self) -> int:
        return len(self.arrays["t"])

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data, the arrays as lists."""
        return {
            "status": "success",
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
        """Write to a .json, .npz or .csv file; see :func:`load_result`.

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written; then nothing is left behind.
        """
        path = Path(path)
        if path.suffix not in SUFFIXES:
            raise SceneError(f"cannot save to {path}: {ENDINGS}")
        with written_whole(path) as temporary:
            if path.suffix == ".json":
                temporary.write_text(json.dumps(self.to_dict()) + "\n", encoding="utf-8")
            elif path.suffix == ".npz":
                about = {key: value for key, value in self.to_dict().items() if key not in self.arrays}
                with temporary.open("wb") as file:
                    content: dict[str, Any] = {"about": np.array(json.dumps(about)), **self.arrays}
                    np.savez(file, **content)
            else:
                columns = np.column_stack(list(self.arrays.values()))
                np.savetxt(temporary, columns, delimiter=",", header=",".join(self.arrays), comments="", fmt="%.17g")
        return path

    def plot(self) -> Figure:
        """Draw the gap and the deflection against time, and the local exponents against the gap."""
        from softdyn.pair.plots import plot_pair

        return plot_pair(self)


def _json_number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def beside(path: Path) -> Path:
    """Name of a hidden file, or folder, that nobody else has, beside another, with its ending."""
    return path.with_name(f".{path.stem[:100]}.{secrets.token_hex(8)}{path.suffix}")


class written_whole:
    """Context: a temporary file, of the same ending, that takes the place of ``path`` once it is written."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> Path:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.is_dir():
                raise IsADirectoryError(21, "it is a folder")
            self.temporary = beside(self.path)
            # the system takes the umask off; to ask for it is to change it, for all threads
            os.close(os.open(self.temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        except ValueError as error:  # NUL in it
            raise SceneError(f"cannot write {str(self.path)!r}: {error}") from None
        except OSError as error:
            raise SceneError(f"cannot write {self.path}: {error.strerror}") from None
        return self.temporary

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        try:
            if kind is None:
                os.replace(self.temporary, self.path)
        except OSError as failed:
            error = failed
        finally:
            self.temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise SceneError(f"cannot write {self.path}: {error.strerror}") from None


def require_folder(folder: Path) -> None:
    """Make a folder, and see that it takes files, before any work is done.

    Raises
    ------
    SceneError
        If it cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise SceneError(f"cannot write to the folder {folder}: {error.strerror}") from None


def load_result(path: str | Path) -> PairResult | ParticleResult:
    """Read a result saved as .json or .npz.

    Raises
    ------
    SceneError
        If the file is not such a result.
    """
    path = Path(path)
    if path.suffix not in (".json", ".npz"):
        raise SceneError(
            f"cannot read {path}: results are read back from .json and .npz, which hold all of a run; a .csv holds the "
            "arrays alone, .gsd and .pvd what other programs show"
        )
    try:
        if path.suffix == ".npz":
            arrays = read_arrays(path)
            if "about" not in arrays:
                raise ValueError("it holds no run; the table of a sweep is for numpy.load")
            about = read_json(str(arrays.pop("about")))
            if about.get("kind") == "checkpoint":
                raise ValueError("it is a checkpoint, from which the run that left it goes on with --resume")
            if about.get("kind") == "particles":
                from softdyn.particles.results import result_from

                return result_from(about, arrays)
        else:
            about = read_json(path.read_text(encoding="utf-8-sig"))
            arrays = {
                name: np.array([math.nan if v is None else v for v in values], dtype=float)
                for name, values in about.items()
                if isinstance(values, list) and name not in ("warnings", "events")
            }
        arrays = {"t": arrays["t"], "h": arrays["h"], "delta": arrays["delta"], **arrays}
        for name, values in arrays.items():
            if values.dtype.kind != "f" or values.ndim != 1 or len(values) != len(arrays["t"]) or not len(values):
                raise ValueError(f"{name} has the shape {values.shape}, t the shape {arrays['t'].shape}")
        return PairResult(
            law=str(about["law"]),
            target=str(about["target"]),
            parameters={str(name): float(value) for name, value in about["parameters"].items()},
            arrays=arrays,
            stopped_by=str(about["stopped_by"]),
            stats=dict(about["stats"]),
            warnings=tuple(str(warning) for warning in about["warnings"]),
            events=tuple(
                Event(str(event["what"]), *(float(event[name]) for name in ("t", "h", "delta")))
                for event in about.get("events", ())
            ),
        )
    except OSError as error:
        raise SceneError(f"cannot read {path}: {error.strerror or error}") from None
    except KeyError as error:
        raise SceneError(f"{path} is not a result saved by softdyn (.json or .npz): it has no {error}") from None
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise SceneError(f"{path} is not a result saved by softdyn (.json or .npz): {error}") from None
