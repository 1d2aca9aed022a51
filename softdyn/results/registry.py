"""Reading results of every kind."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softdyn.archive import read_arrays, read_json
from softdyn.errors import SceneError
from softdyn.results.pair_result import Event, PairResult

if TYPE_CHECKING:
    from softdyn.particles.results import ParticleResult


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
